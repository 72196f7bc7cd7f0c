//! Which signal stands where in the cyclic records: worked out at S-0-0127, walked through every cycle.

use heapless::Vec;

use super::command::{Command, CommandValue};
use super::feedback::Feedback;
use super::limit::Limit;

/// Most data blocks in a record (S-0-0016, S-0-0024).
pub const MOST_SIGNALS: usize = 16;

/// A signal in a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Datum<T> {
    /// What it is.
    pub signal: T,
    /// Words that it takes, 1 or 2.
    pub words: u16,
}

/// The two records of this drive, in their order.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Records {
    /// Behind control word and service info of the MDT.
    pub commands: Vec<Datum<Command>, MOST_SIGNALS>,
    /// Behind status word and service info of the AT.
    pub feedback: Vec<Datum<Feedback>, MOST_SIGNALS>,
}

impl Records {
    /// Whether the MDT carries a command value.
    pub(crate) fn carry(&self, value: CommandValue) -> bool {
        self.commands.iter().any(|datum| datum.signal == Command::Value(value))
    }

    /// Limits in the MDT.
    pub(crate) fn limits(&self) -> impl Iterator<Item = Limit> {
        self.commands.iter().filter_map(|datum| match datum.signal {
            Command::Limit(limit) => Some(limit),
            Command::Value(_) => None,
        })
    }
}
