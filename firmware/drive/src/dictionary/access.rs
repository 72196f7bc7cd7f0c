//! Where the operation data of a data block live, and what follows from that.

use sercos::data_block::{Bits, Cyclic, Location, Selection};

use super::lists::{Longs, Words};
use super::numbers::Number;
use super::procedures::Procedure;
use super::ratings::Rating;
use super::texts::Text;
use crate::signal::command::{Command, CommandValue};
use crate::signal::control_bits::Enable;
use crate::signal::feedback::{Feedback, FeedbackValue};
use crate::signal::limit::Limit;
use crate::signal::word::{Source, Word};

/// Where the operation data of a data block live.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Access {
    /// A parameter.
    Parameter,
    /// A parameter that the amplifier gives.
    Rating(Rating),
    /// A parameter in whose place the MDT may carry a value.
    Limit(Limit),
    /// An IDN list that follows from the table.
    List(Selection),
    /// A value that the AT can carry.
    Feedback(FeedbackValue),
    /// A value that the MDT can carry.
    Command(CommandValue),
    /// A word of bits.
    Word(Word),
    /// One bit of a word.
    Bit(Word, u8),
    /// A bit that the control sets.
    Enable(Enable),
    /// A number that only the service channel shows.
    Number(Number),
    /// A text.
    Text(Text),
    /// A list of two-byte numbers.
    Words(Words),
    /// A list of four-byte numbers.
    Longs(Longs),
    /// A procedure command.
    Procedure(Procedure),
}

impl Access {
    /// Where the service channel finds the operation data.
    pub(crate) const fn location(self) -> Location {
        match self {
            Self::Parameter | Self::Rating(_) | Self::Limit(_) => Location::Parameter,
            Self::List(selection) => Location::Dictionary(selection),
            Self::Procedure(_) => Location::Command,
            _ => Location::Live,
        }
    }

    /// The telegram that can carry the operation data.
    pub(crate) const fn cyclic(self) -> Cyclic {
        match self {
            Self::Feedback(_) => Cyclic::At,
            // The status word stands before them, and the control word comes from the MDT.
            Self::Word(Word::Status | Word::Control) => Cyclic::Never,
            Self::Word(_) => Cyclic::At,
            Self::Command(_) | Self::Limit(_) => Cyclic::Mdt,
            _ => Cyclic::Never,
        }
    }

    /// What a real-time bit or a bit of a signal word can do with it.
    pub(crate) const fn bits(self) -> Bits {
        match self {
            Self::Word(Word::Application) | Self::Enable(_) => Bits::Target,
            Self::Word(_) | Self::Bit(..) => Bits::Source,
            _ => Bits::Never,
        }
    }

    /// What bits can do with it; `None`: nothing.
    pub(crate) const fn source(self) -> Option<Source> {
        match self {
            Self::Word(word) => Some(Source::Word(word)),
            Self::Bit(word, bit) => Some(Source::Bit(word, bit)),
            Self::Enable(enable) => Some(Source::Enable(enable)),
            _ => None,
        }
    }

    /// As a signal of the AT; `None` if it cannot carry it.
    pub(crate) const fn feedback(self) -> Option<Feedback> {
        match (self.cyclic(), self) {
            (Cyclic::At, Self::Feedback(value)) => Some(Feedback::Value(value)),
            (Cyclic::At, Self::Word(word)) => Some(Feedback::Bits(word)),
            _ => None,
        }
    }

    /// As a signal of the MDT; `None` if it cannot carry it.
    pub(crate) const fn command(self) -> Option<Command> {
        match self {
            Self::Command(value) => Some(Command::Value(value)),
            Self::Limit(limit) => Some(Command::Limit(limit)),
            _ => None,
        }
    }
}
