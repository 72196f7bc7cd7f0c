//! What a life asks of the service channel, and what came of it.

use std::collections::VecDeque;

use drive::DICTIONARY;
use ring::ident::{Element, Idn, Value};
use ring::service_client::{Finished, Request, Step, StepRecord};
use sercos::attribute::Length;

use crate::coverage::Coverage;
use crate::life::Action;
use crate::master::Stubborn;
use crate::steps::{read_value, reading, writing, writing_open};
use crate::units::words_of;

/// S-0-0267.
pub(crate) const PASSWORD: u16 = 267;
/// The only one that a life locks with, so that peace can unlock.
pub(crate) const KEY: &str = "press";
/// What the telegrams are made of: a master that writes it keeps to it.
const TELEGRAMS: [u16; 9] = [1, 2, 6, 9, 10, 15, 16, 24, 89];
const DIAGNOSTIC_NUMBER: u16 = 390;
const RESET: u16 = 99;
/// Words of a procedure command that is started, and of one that is cancelled.
const START: u16 = 3;
const CANCEL: u16 = 0;

/// A data block that the life has written, and what it was before; `None`: nobody has seen, or a list.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Written {
    pub(crate) idn: u16,
    pub(crate) before: Option<i64>,
}

/// What is waited for, in the order of asking.
#[derive(Clone, Copy, Debug)]
enum Pending {
    Write { idn: u16, words: usize },
    Read,
    Diagnosis,
    Start(u16),
    Cancel,
}

/// The dialogues of a life.
#[derive(Clone, Debug, Default)]
pub(crate) struct Services {
    pending: VecDeque<Pending>,
    pub(crate) written: Vec<Written>,
    pub(crate) started: Vec<u16>,
    /// S-0-0267 was written, and the drive has taken it, or nobody knows.
    pub(crate) may_be_locked: bool,
}

impl Services {
    /// Asks for it, if it is a matter of the service channel; else `false`.
    pub(crate) fn ask(&mut self, master: &mut Stubborn, action: &Action) -> bool {
        match *action {
            Action::Read(idn) => {
                let all = is_list(idn);
                master.ask(if all { Request::Read(Idn(idn)) } else { Request::Steps(reading(idn, true)) });
                self.pending.push_back(Pending::Read);
            }
            Action::Start(idn) => {
                if idn == RESET {
                    self.ask_why(master);
                }
                master.ask(Request::Steps(writing(idn, &[START])));
                self.pending.push_back(Pending::Start(idn));
            }
            Action::Cancel(idn) => {
                master.ask(Request::Steps(writing(idn, &[CANCEL])));
                self.pending.push_back(Pending::Cancel);
            }
            _ => {
                let Some((idn, words)) = written_by(action) else { return false };
                // What was there before is looked at, if it is a number.
                let mut steps = if is_list(idn) { vec![Step::open(Idn(idn))] } else { reading(idn, true) };
                steps.extend(writing_open(&words));
                master.ask(Request::Steps(steps));
                self.pending.push_back(Pending::Write { idn, words: words.len() });
            }
        }
        true
    }

    /// Asks for S-0-0390.
    pub(crate) fn ask_why(&mut self, master: &mut Stubborn) {
        master.ask(Request::Steps(reading(DIAGNOSTIC_NUMBER, true)));
        self.pending.push_back(Pending::Diagnosis);
    }

    /// Takes back what has not begun: it never was.
    pub(crate) fn take_back(&mut self, master: &mut Stubborn) {
        let left = self.pending.len().saturating_sub(master.take_back());
        self.pending.truncate(left);
    }

    /// Requests that a run-up has cut off: nobody knows what came of them.
    pub(crate) fn drop_pending(&mut self) {
        for pending in std::mem::take(&mut self.pending) {
            match pending {
                Pending::Write { idn, .. } => self.note(idn, None),
                Pending::Start(idn) => self.started.push(idn),
                Pending::Read | Pending::Diagnosis | Pending::Cancel => {}
            }
        }
    }

    /// Takes the answers that have come, and gives the diagnostic numbers among them.
    pub(crate) fn harvest(&mut self, master: &mut Stubborn, coverage: &mut Coverage) -> Vec<u16> {
        let mut diagnoses = Vec::new();
        while let Some(finished) = master.answer() {
            let Some(pending) = self.pending.pop_front() else { continue };
            let phase = master.sent_phase();
            match pending {
                Pending::Write { idn, words } => self.has_written(idn, words, phase, &finished, coverage),
                Pending::Start(idn) => self.has_started(idn, phase, &finished, coverage),
                Pending::Diagnosis => {
                    diagnoses.extend(read_value(DIAGNOSTIC_NUMBER, &finished.steps).map(|number| number as u16));
                }
                Pending::Read | Pending::Cancel => {}
            }
        }
        diagnoses
    }

    /// The life has written something that tells the telegrams of the ring, and nothing has refused that.
    pub(crate) fn has_taken_telegrams(&self) -> bool {
        TELEGRAMS.iter().any(|idn| self.has_taken(*idn))
    }

    /// The life has written it, and nothing has refused that.
    pub(crate) fn has_taken(&self, idn: u16) -> bool {
        self.written.iter().any(|written| written.idn == idn)
    }

    fn has_written(&mut self, idn: u16, words: usize, phase: u8, finished: &Finished, coverage: &mut Coverage) {
        let writes = |record: &&StepRecord| record.step.write && record.step.element == Element::Data;
        let refused = finished.steps.iter().filter(writes).find(|record| record.error).map(|record| record.reply);
        let before = read_value(idn, &finished.steps).filter(|_| !is_list(idn));
        let name = Idn(idn);
        if let Some(code) = refused {
            coverage.count("write refused", format!("{name} CP{phase} {code:04X}H"));
            return;
        }
        if finished.result.is_ok() && finished.steps.iter().filter(writes).count() == words {
            coverage.count("write accepted", format!("{name} CP{phase}"));
        }
        self.note(idn, before);
    }

    fn has_started(&mut self, idn: u16, phase: u8, finished: &Finished, coverage: &mut Coverage) {
        let name = Idn(idn);
        match finished.steps.iter().find(|record| record.error) {
            Some(record) => coverage.count("command refused", format!("{name} CP{phase} {:04X}H", record.reply)),
            None => {
                coverage.count("command started", format!("{name} CP{phase}"));
                self.started.push(idn);
            }
        }
    }

    fn note(&mut self, idn: u16, before: Option<i64>) {
        // Nobody has changed it, whether the answer was heard or not.
        if DICTIONARY.find(sercos::Idn(idn)).is_some_and(|block| block.attribute.is_read_only()) {
            return;
        }
        self.written.push(Written { idn, before });
        self.may_be_locked |= idn == PASSWORD;
    }
}

/// The data block and the words that an action writes there.
fn written_by(action: &Action) -> Option<(u16, Vec<u16>)> {
    match action {
        Action::Write(idn, value) => Some((*idn, words_of(*idn, *value))),
        Action::WriteList(idn, items) => Some((*idn, words_of_list(*idn, items))),
        Action::WriteText(idn, text) => Some((*idn, words_of_text(text))),
        Action::WriteWords(idn, words) => Some((*idn, words.clone())),
        _ => None,
    }
}

/// The operation data of a list.
pub(crate) fn words_of_list(idn: u16, items: &[u32]) -> Vec<u16> {
    let long = length_of(idn) == Some(Length::ListOfFour);
    let bytes = items.iter().flat_map(|item| item.to_le_bytes().into_iter().take(if long { 4 } else { 2 })).collect();
    Value::Bytes(bytes).to_words()
}

/// The operation data of a text.
pub(crate) fn words_of_text(text: &str) -> Vec<u16> {
    Value::Bytes(text.as_bytes().to_vec()).to_words()
}

/// The operation data have no fixed length.
pub(crate) fn is_list(idn: u16) -> bool {
    length_of(idn).is_some_and(|length| length.fixed_bytes().is_none())
}

fn length_of(idn: u16) -> Option<Length> {
    DICTIONARY.find(sercos::Idn(idn)).map(|block| block.attribute.length())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_and_texts_are_written_with_their_length_in_bytes() {
        assert_eq!(words_of_list(26, &[11, 12]), [4, 4, 11, 12]);
        assert_eq!(words_of_list(0x8007, &[0x0001_0002]), [4, 4, 2, 1]);
        assert_eq!(words_of_list(27, &[]), [0, 0]);
        assert_eq!(words_of_text("abc"), [3, 3, 0x6261, 0x0063]);
    }
}
