//! The data blocks of this drive, and where the operation data of each live.
//!
//! The rows stand in sections, by what they are. A row names its accessor; what follows from that (the telegrams that can carry it, the
//! bits that can show it, who reads and writes it) is told nowhere else.

pub(crate) mod access;
mod axis;
mod bits;
mod idn_lists;
pub(crate) mod lists;
pub(crate) mod numbers;
pub(crate) mod procedures;
mod product;
pub(crate) mod ratings;
mod ring;
pub(crate) mod texts;

use sercos::Idn;
use sercos::data_block::DataBlock;
use sercos::parameters::Parameters;
use sercos::transition::{CyclicConfiguration, CyclicDatum};
use servo::motor::Facts;

use crate::amplifier::Amplifier;
use crate::signal::command::COMMAND_VALUES;
use crate::signal::feedback::FEEDBACK_VALUES;
use crate::signal::limit::LIMITS;
use crate::signal::record::{Datum, Records};
use crate::signal::word::Source;
use access::Access;
use axis::AXIS_PARAMETERS;
use bits::BITS;
use idn_lists::IDN_LISTS;
use lists::{LONG_LISTS, WORD_LISTS};
use numbers::NUMBERS;
use procedures::PROCEDURES;
use product::PRODUCT_PARAMETERS;
use ratings::RATINGS;
use ring::RING_PARAMETERS;
use texts::TEXTS;

sercos::dictionary! {
    /// All data blocks of the drive.
    pub static DICTIONARY accessed by Access in static ACCESSORS;
    RING_PARAMETERS,
    AXIS_PARAMETERS,
    PRODUCT_PARAMETERS,
    RATINGS as Rating,
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
pub(crate) fn access_of(block: &DataBlock) -> Access {
    // Every block of the table has its row there.
    ACCESSORS.get(block.row()).copied().unwrap_or(Access::Parameter)
}

/// All parameters as the table gives them, with the ratings of this amplifier on a board with these facts.
pub fn parameters_on(amplifier: &Amplifier, facts: &Facts) -> Parameters {
    let mut parameters = Parameters::new(&DICTIONARY);
    amplifier.show(facts, &mut parameters);
    parameters
}

/// The amplifier gives the operation data, not the table.
pub fn is_rating(block: &DataBlock) -> bool {
    matches!(access_of(block), Access::Rating(_))
}

/// The same of an IDN.
pub fn is_rating_of(idn: Idn) -> bool {
    DICTIONARY.find(idn).is_some_and(is_rating)
}

/// What bits can do with the data block of an IDN; `None`: nothing.
pub fn source(idn: Idn) -> Option<Source> {
    access_of(DICTIONARY.find(idn)?).source()
}

/// What the telegrams carry; `None` if they cannot, which the check has ruled out.
pub fn records(cyclic: &CyclicConfiguration) -> Option<Records> {
    let accessed = |datum: &CyclicDatum| Some((access_of(DICTIONARY.find(datum.idn)?), datum.bytes / 2));
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

#[cfg(test)]
mod tests;
