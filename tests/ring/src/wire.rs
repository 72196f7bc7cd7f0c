//! The wire: what one telegram looks like on the fibre, and what can be wrong with it.
//!
//! sercon816.md 10: flag, address, data, frame check sequence, flag; least significant bit first; a zero inserted
//! after five ones between the flags; NRZI, where a zero is a change of level.

use thiserror::Error;

/// A telegram to be sent: address and data in wire order, without flags and frame check sequence.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Transmission {
    /// First the address, then the data field, low byte of every word first.
    pub bytes: Vec<u8>,
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
    #[error("no closing flag: {bits} bits after the opening one")]
    Unterminated {
        /// Number of data bits, zero removal done, up to the end.
        bits: usize,
    },
    /// Seven or more ones in a row between the flags: the sender aborted, or this is fill.
    #[error("aborted after {bits} bits: seven ones in a row, six at most expected")]
    Aborted {
        /// Number of data bits, zero removal done, before the run of ones.
        bits: usize,
    },
    /// The data bits between the flags are no whole number of bytes.
    #[error("{bits} bits between the flags: expected a multiple of 8")]
    NotWholeBytes {
        /// Number of data bits, zero removal done.
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
    #[error("telegram cut after {bits} bits by another sender")]
    Collision {
        /// Line bits that had passed.
        bits: usize,
    },
}
