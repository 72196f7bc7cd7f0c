//! The data blocks of this drive, and where the operation data of each live.
//!
//! The rows stand in sections, by what they are. A row names its accessor; what follows from that (the telegrams that can carry it, the
//! bits that can show it, who reads and writes it) is told nowhere else.

mod axis;
mod bits;
mod lists;
mod numbers;
mod procedures;
mod product;
mod ring;
mod texts;

use sercos::Idn;
use sercos::data_block::{Bits, Cyclic, DataBlock, Location, Selection};
use sercos::transition::{CyclicConfiguration, CyclicDatum};

use crate::signal::command::{COMMAND_VALUES, Command, CommandValue};
use crate::signal::control_bits::Enable;
use crate::signal::feedback::{FEEDBACK_VALUES, Feedback, FeedbackValue};
use crate::signal::limit::{LIMITS, Limit};
use crate::signal::record::{Datum, Records};
use crate::signal::word::{Source, Word};
use axis::AXIS_PARAMETERS;
use bits::BITS;
use lists::{IDN_LISTS, LONG_LISTS, WORD_LISTS};
use numbers::NUMBERS;
use procedures::PROCEDURES;
use product::PRODUCT_PARAMETERS;
use ring::RING_PARAMETERS;
use texts::TEXTS;

pub use lists::{Longs, Words};
pub use numbers::Number;
pub use procedures::Procedure;
pub use texts::Text;

/// Where the operation data of a data block live.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// A parameter.
    Parameter,
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

sercos::dictionary! {
    /// All data blocks of the drive.
    pub static DICTIONARY accessed by Access in static ACCESSORS;
    RING_PARAMETERS,
    AXIS_PARAMETERS,
    PRODUCT_PARAMETERS,
    LIMITS as Limit,
    COMMAND_VALUES as Command,
    FEEDBACK_VALUES as Feedback,
    BITS,
    NUMBERS as Number,
    TEXTS as Text,
    IDN_LISTS,
    WORD_LISTS as Words,
    LONG_LISTS as Longs,
    PROCEDURES as Procedure,
}

/// Where the operation data of a data block live.
pub(crate) fn access(block: &DataBlock) -> Access {
    // Every block of the table has its row there.
    ACCESSORS.get(block.row()).copied().unwrap_or(Access::Parameter)
}

/// What bits can do with the data block of an IDN; `None`: nothing.
pub fn source(idn: Idn) -> Option<Source> {
    access(DICTIONARY.find(idn)?).source()
}

/// What the telegrams carry; `None` if they cannot, which the check has ruled out.
pub fn records(cyclic: &CyclicConfiguration) -> Option<Records> {
    let accessed = |datum: &CyclicDatum| Some((access(DICTIONARY.find(datum.idn)?), datum.bytes / 2));
    let mut records = Records::default();
    for datum in &cyclic.mdt {
        let (access, words) = accessed(datum)?;
        records.commands.push(Datum { signal: Access::command(access)?, words }).ok()?;
    }
    for datum in &cyclic.at {
        let (access, words) = accessed(datum)?;
        records.feedback.push(Datum { signal: Access::feedback(access)?, words }).ok()?;
    }
    Some(records)
}

impl Access {
    /// Where the service channel finds the operation data.
    pub(crate) const fn location(self) -> Location {
        match self {
            Self::Parameter | Self::Limit(_) => Location::Parameter,
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

#[cfg(test)]
mod tests;
