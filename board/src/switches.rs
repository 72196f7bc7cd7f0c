//! What the operator sets before power-up: drive address and baud rate.
//!
//! | switch | pins | code |
//! |---|---|---|
//! | address, low digit | PG5 (1) to PG8 (8) | hexadecimal rotary switch, closed contact = 1 |
//! | address, high digit | PG10 (1) to PG13 (8) | hexadecimal rotary switch, closed contact = 1 |
//! | baud rate | PG14 (1), PG15 (2) | 0: 2 Mbit/s, 1: 4, 2: 8, 3: 16; closed contact = 1 |
//!
//! Pull-ups at the pins, contacts to ground. They are read once at start: an address that changes while the ring runs would
//! be a second drive with the same address for some cycles.

use stm32f4xx_hal::pac;

use crate::pins;

/// The switch positions at start.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Settings {
    /// Drive address, 0 to 255. 1 to 254 are drives; 0 and 255 make the station a repeater (sercos2.md 1).
    pub address: u8,
    /// Transmission rate of the ring.
    pub baud_rate: BaudRate,
}

/// Transmission rates of a SERCOS II ring.
#[derive(Clone, Copy, Debug, PartialEq, Eq, defmt::Format)]
pub enum BaudRate {
    /// 2 Mbit/s.
    Mbit2,
    /// 4 Mbit/s.
    Mbit4,
    /// 8 Mbit/s.
    Mbit8,
    /// 16 Mbit/s.
    Mbit16,
}

pub(crate) fn read(port: &pac::GPIOG) -> Settings {
    decode(port.idr().read().bits())
}

/// Settings that belong to the levels of port G.
#[must_use]
pub const fn decode(levels: u32) -> Settings {
    let closed = !levels;
    let low = closed >> pins::ADDRESS_LOW_DIGIT[0].number & 0xF;
    let high = closed >> pins::ADDRESS_HIGH_DIGIT[0].number & 0xF;
    Settings {
        address: (high << 4 | low) as u8,
        baud_rate: match closed >> pins::BAUD_SWITCH[0].number & 0b11 {
            0 => BaudRate::Mbit2,
            1 => BaudRate::Mbit4,
            2 => BaudRate::Mbit8,
            _ => BaudRate::Mbit16,
        },
    }
}
