//! Steps of the service channel (sercos2.md 3.3), put together and read.

use ring::ident::{Element, Idn};
use ring::service_client::{Step, StepRecord};

use crate::units::{value_of, words_of};

/// Opens a data block and writes its operation data.
pub(crate) fn writing(idn: u16, words: &[u16]) -> Vec<Step> {
    let mut steps = vec![Step::open(Idn(idn))];
    steps.extend(writing_open(words));
    steps
}

/// Writes operation data of the data block that is open.
pub(crate) fn writing_open(words: &[u16]) -> impl Iterator<Item = Step> + '_ {
    let last = words.len().saturating_sub(1);
    let step = move |(index, word): (usize, &u16)| Step {
        element: Element::Data,
        write: true,
        end: index == last,
        info: *word,
    };
    words.iter().enumerate().map(step)
}

/// Reads operation data of fixed length; `open`: opens the data block first.
pub(crate) fn reading(idn: u16, open: bool) -> Vec<Step> {
    let words = words_of(idn, 0).len();
    let mut steps = Vec::new();
    if open {
        steps.push(Step::open(Idn(idn)));
    }
    steps.extend((1..=words).map(|word| Step { element: Element::Data, write: false, end: word == words, info: 0 }));
    steps
}

/// The value that the reading steps among these have brought, if none of them is refused.
pub(crate) fn read_value(idn: u16, records: &[StepRecord]) -> Option<i64> {
    let reads = records.iter().filter(|record| record.step.element == Element::Data && !record.step.write);
    let words: Option<Vec<u16>> = reads.map(|record| (!record.error).then_some(record.reply)).collect();
    words.filter(|words| !words.is_empty()).map(|words| value_of(idn, &words))
}

/// The data blocks that were refused, with the first error word of each.
pub(crate) fn refusals(records: &[StepRecord]) -> Vec<(u16, u16)> {
    let mut open = 0;
    let mut refused: Vec<(u16, u16)> = Vec::new();
    for record in records {
        if record.step.element == Element::Idn {
            open = record.step.info;
        }
        if record.error && refused.last().is_none_or(|(idn, _)| *idn != open) {
            refused.push((open, record.reply));
        }
    }
    refused
}
