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

use sercon816::BitRate;
use stm32f4xx_hal::pac;

use crate::{clocks::HCLK_HZ, pins};

/// The switch positions at start.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Settings {
    /// Drive address, 0 to 255. 1 to 254 are drives; 0 and 255 make the station a repeater (sercos2.md 1).
    pub address: u8,
    /// Bit rate of the ring.
    pub bit_rate: BitRate,
}

/// Pull-ups of 40 kilohm into 100 pF of wiring and contacts have a time constant of 4 us; 100 us is plenty.
const SETTLE_CYCLES: u32 = HCLK_HZ / 1_000_000 * 100;

/// Waits for the pull-ups that were just switched on, then reads all switches at the same instant.
pub(crate) fn read(port: &pac::GPIOG) -> Settings {
    cortex_m::asm::delay(SETTLE_CYCLES);
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
        bit_rate: match closed >> pins::BAUD_SWITCH[0].number & 0b11 {
            0 => BitRate::Mbit2,
            1 => BitRate::Mbit4,
            2 => BitRate::Mbit8,
            _ => BitRate::Mbit16,
        },
    }
}

// Open switches, one contact of each group, all closed; pins that are not switches do not matter.
const _: () = {
    let open = decode(0xFFFF);
    assert!(open.address == 0 && matches!(open.bit_rate, BitRate::Mbit2));
    let some = decode(!(1 << 6 | 1 << 10 | 1 << 14));
    assert!(some.address == 0x12 && matches!(some.bit_rate, BitRate::Mbit4));
    let closed = decode(0);
    assert!(closed.address == 0xFF && matches!(closed.bit_rate, BitRate::Mbit16));
    assert!(decode(0x0000_021F).address == 0xFF);
};
