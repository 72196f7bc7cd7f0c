//! The wire: what one telegram looks like on the fibre, and what can be wrong with it.
//!
//! sercon816.md 10: flag, address, data, frame check sequence, flag; least significant bit first; a zero inserted
//! after five ones between the flags; NRZI, where a zero is a change of level.
//!
//! Three layers, each a value of its own: the bytes of a [`Transmission`], the *bits* of [`encode`] and [`decode`]
//! (flags and inserted zeros included), and the *levels* of a [`LineSignal`], which is what travels on the ring.

mod codec;
mod signal;

use thiserror::Error;

use crate::time::Nanoseconds;

pub use codec::{FLAG, check_sequence, decode, encode};
pub use signal::LineSignal;

/// The bytes of the frame check sequence.
pub const CHECK_SEQUENCE_BYTES: usize = 2;
/// The least a telegram has between its flags: address, one data byte, frame check sequence (sercon816.md 10.5).
pub const SHORTEST_TELEGRAM_BYTES: usize = 4;
/// Address of every telegram that is meant for all drives: MST always, MDT in CP3 and CP4 (sercos2.md 1.2).
pub const BROADCAST: u8 = 255;

/// A telegram to be sent: address and data in wire order, without flags and frame check sequence.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Transmission {
    /// First the address, then the data field, low byte of every word first.
    pub bytes: Vec<u8>,
}

/// The bit rates of SERCOS I and II (sercos2.md 1.1).
#[derive(Copy, Clone, Debug, PartialEq, Eq, Default, Hash)]
pub enum BitRate {
    /// 2 Mbit/s, 500 ns a bit.
    #[default]
    M2,
    /// 4 Mbit/s, 250 ns a bit.
    M4,
    /// 8 Mbit/s, 125 ns a bit.
    M8,
    /// 16 Mbit/s, 62.5 ns a bit.
    M16,
}

impl BitRate {
    /// All of them, slowest first.
    pub const ALL: [Self; 4] = [Self::M2, Self::M4, Self::M8, Self::M16];

    /// Megabits a second.
    pub const fn megabits(self) -> u64 {
        match self {
            Self::M2 => 2,
            Self::M4 => 4,
            Self::M8 => 8,
            Self::M16 => 16,
        }
    }

    /// The rate of so many Mbit/s, if there is one.
    pub fn from_megabits(megabits: u64) -> Option<Self> {
        Self::ALL.into_iter().find(|rate| rate.megabits() == megabits)
    }

    /// How long `bits` bit times last, rounded down to a nanosecond (at 16 Mbit/s a bit is 62.5 ns).
    pub const fn span(self, bits: usize) -> Nanoseconds {
        Nanoseconds(bits as u64 * 1_000 / self.megabits())
    }

    /// How many whole bit times fit into `span`.
    pub const fn bits_in(self, span: Nanoseconds) -> usize {
        (span.0 * self.megabits() / 1_000) as usize
    }
}

/// Why the bits between two flags, or the lack of them, are no telegram. sercon816.md 10.5.
#[derive(Copy, Clone, Debug, PartialEq, Eq, Error)]
pub enum LineError {
    /// No opening flag in the recorded or received bits.
    #[error("no opening flag in {bits} bits")]
    NoFlag {
        /// Number of bits searched.
        bits: usize,
    },
    /// The bits end before a closing flag.
    #[error("no closing flag in {bits} bits after the opening one")]
    Unterminated {
        /// Number of line bits, inserted zeros included, up to the end.
        bits: usize,
    },
    /// Seven or more ones in a row between the flags: the sender aborted, or this is fill.
    #[error("aborted after {bits} bits: seven ones in a row, six at most expected")]
    Aborted {
        /// Number of line bits, inserted zeros included, before the run of ones.
        bits: usize,
    },
    /// The data bits between the flags are no whole number of bytes.
    #[error("{bits} bits between the flags: expected a multiple of 8")]
    NotWholeBytes {
        /// Number of data bits, inserted zeros removed.
        bits: usize,
    },
    /// Too short for address, one data byte and frame check sequence.
    #[error("{bytes} bytes between the flags: expected at least {expected}")]
    TooShort {
        /// Bytes between the flags.
        bytes: usize,
        /// The least a telegram has.
        expected: usize,
    },
    /// The frame check sequence does not belong to the bytes before it.
    #[error("frame check sequence {actual:#06x}, expected {expected:#06x}")]
    CheckSequence {
        /// Calculated from address and data.
        expected: u16,
        /// Received.
        actual: u16,
    },
    /// Another transmitter cut into the telegram while it passed.
    #[error("telegram cut by another sender: {bits} bits passed")]
    Collision {
        /// Line bits that had passed.
        bits: usize,
    },
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bit_times_are_exact_where_a_nanosecond_can_hold_them() {
        assert_eq!(BitRate::M2.span(49), Nanoseconds(24_500));
        assert_eq!(BitRate::M16.span(3), Nanoseconds(187));
        assert_eq!(BitRate::M16.span(1600), Nanoseconds::from_microseconds(100));
        for rate in BitRate::ALL {
            assert_eq!(BitRate::from_megabits(rate.megabits()), Some(rate));
            assert_eq!(rate.bits_in(rate.span(800)), 800);
        }
        assert_eq!(BitRate::from_megabits(3), None);
    }
}
