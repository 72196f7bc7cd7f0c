//! Follows a recorded dialogue with one drive, from both ends.

use std::collections::BTreeMap;

use super::report::{DriveReport, FellBehind, StepError, StepTiming};
use crate::capture::RecordedCycle;
use crate::ident::{Element, Idn};
use crate::service_client::{AtWords, MdtWords, Step, control, meaning, status};

/// Data status of a procedure command that was executed correctly (sercos2.md 3.6).
const COMMAND_DONE: u16 = 3;

/// What the master has said to one drive, and what it is waiting for.
#[derive(Clone, Debug, Default)]
pub(super) struct Dialogue {
    last: Option<MdtWords>,
    opened: Option<Idn>,
    writing: Vec<u16>,
    outstanding: Option<Outstanding>,
    /// The last complete write of every data block.
    pub(super) written: BTreeMap<Idn, Vec<u16>>,
}

#[derive(Copy, Clone, Debug)]
struct Outstanding {
    step: Step,
    idn: Option<Idn>,
    cycle: u64,
    sent: u32,
    acknowledged: Option<u32>,
}

impl Dialogue {
    /// The last service words sent to this drive.
    pub(super) fn last(&self) -> Option<MdtWords> {
        self.last
    }

    /// A record goes out. Only a change of the handshake bit makes it a step (sercon816.md 8.2).
    pub(super) fn sent(&mut self, words: MdtWords, cycle: u64, phase: u8, report: &mut DriveReport) {
        let toggled = self.last.is_none_or(|last| (last.control ^ words.control) & control::HANDSHAKE != 0);
        self.last = Some(words);
        if !toggled {
            if let Some(outstanding) = &mut self.outstanding {
                outstanding.sent += 1;
            }
            return;
        }
        self.close(cycle, phase, report);
        let step = Step::of_words(words);
        self.take(step);
        self.outstanding = Some(Outstanding { step, idn: self.opened, cycle, sent: 1, acknowledged: None });
        report.steps += 1;
    }

    /// An AT has come.
    pub(super) fn received(&mut self, at: AtWords, cycle: u64, phase: u8, report: &mut DriveReport) {
        let Some(last) = self.last else { return };
        let Some(outstanding) = self.outstanding.as_mut().filter(|outstanding| outstanding.acknowledged.is_none())
        else {
            return;
        };
        let follows = (at.status ^ last.control) & status::HANDSHAKE == 0 && at.status & status::BUSY == 0;
        if !follows {
            return;
        }
        outstanding.acknowledged = Some(outstanding.sent);
        let (step, idn) = (outstanding.step, outstanding.idn);
        if at.status & status::ERROR != 0 {
            let (step, meaning) = (step.to_string(), meaning(at.info).to_owned());
            report.step_errors.push(StepError { cycle, phase, idn, step, code: at.info, meaning });
        } else if step.element == Element::Idn && at.info == COMMAND_DONE {
            match (idn, phase) {
                (Some(Idn::CHECK_FOR_CP3), 2) => report.s0127 = true,
                (Some(Idn::CHECK_FOR_CP4), 3) => report.s0128 = true,
                _ => {}
            }
        }
    }

    /// The step that was outstanding is over, acknowledged or not.
    fn close(&mut self, cycle: u64, phase: u8, report: &mut DriveReport) {
        let Some(done) = self.outstanding.take() else { return };
        let step = done.step.to_string();
        if done.acknowledged.is_none() {
            report.fell_behind.push(FellBehind { cycle, phase, idn: done.idn, step: step.clone(), allowed: done.sent });
        }
        report.timings.push(StepTiming {
            cycle: done.cycle,
            idn: done.idn,
            step,
            allowed: done.sent,
            taken: done.acknowledged,
        });
    }

    /// What a step does to the channel.
    fn take(&mut self, step: Step) {
        match (step.element, step.write) {
            (Element::Close, _) => {
                self.opened = None;
                self.writing.clear();
            }
            (Element::Idn, true) => {
                self.opened = Some(Idn(step.info));
                self.writing.clear();
            }
            (Element::Data, true) => {
                self.writing.push(step.info);
                if let (true, Some(idn)) = (step.end, self.opened) {
                    self.written.insert(idn, std::mem::take(&mut self.writing));
                }
            }
            _ => self.writing.clear(),
        }
    }
}

/// Every value that these cycles write to one drive in CP1 and CP2.
pub(super) fn written_values(cycles: &[RecordedCycle], address: u8) -> BTreeMap<Idn, Vec<u16>> {
    let mut dialogue = Dialogue::default();
    let mut ignored = DriveReport::default();
    for (cycle, recorded) in cycles.iter().enumerate() {
        if let Some(words) =
            recorded.mdt.as_ref().filter(|mdt| mdt[0] == address).and_then(|mdt| super::words_at(mdt, 1))
        {
            dialogue.sent(words, cycle as u64, recorded.phase, &mut ignored);
        }
    }
    dialogue.written
}

#[cfg(test)]
mod tests {
    use super::*;

    fn words(control: u16, info: u16) -> MdtWords {
        MdtWords { control, info }
    }

    fn at(status: u16, info: u16) -> AtWords {
        AtWords { status, info }
    }

    #[test]
    fn a_word_that_changes_without_its_handshake_is_no_step() {
        // sercon816.md 8.2: drive 1 in CP3 saw 3EH three times, 06H once, 07H.
        let (mut dialogue, mut report) = (Dialogue::default(), DriveReport::default());
        for (cycle, control) in [0x3E, 0x3E, 0x3E, 0x06, 0x07].into_iter().enumerate() {
            dialogue.received(at(0, 0), cycle as u64, 3, &mut report);
            dialogue.sent(words(control, 0), cycle as u64, 3, &mut report);
        }
        assert_eq!(report.steps, 2);
        assert_eq!(report.fell_behind, []);
        assert_eq!((report.timings[0].allowed, report.timings[0].taken), (4, Some(1)));
    }

    #[test]
    fn a_step_without_acknowledgement_before_the_next_fell_behind() {
        let (mut dialogue, mut report) = (Dialogue::default(), DriveReport::default());
        dialogue.sent(words(0x0F, 3), 10, 2, &mut report);
        dialogue.received(at(0x4000, 0), 11, 2, &mut report);
        dialogue.received(at(0x4003, 0), 12, 2, &mut report);
        dialogue.sent(words(0x18, 3), 12, 2, &mut report);
        assert_eq!(report.fell_behind.len(), 1);
        assert_eq!((report.fell_behind[0].cycle, report.fell_behind[0].step.as_str()), (12, "open S-0-0003"));
    }

    #[test]
    fn errors_and_acknowledgements_of_checks_are_seen_once() {
        let (mut dialogue, mut report) = (Dialogue::default(), DriveReport::default());
        dialogue.sent(words(0x0F, 127), 1, 2, &mut report);
        dialogue.received(at(0x4001, 3), 2, 2, &mut report);
        assert!(report.s0127 && !report.s0128);
        dialogue.sent(words(0x3E, 3), 2, 2, &mut report);
        dialogue.received(at(0x4004, 0x7012), 3, 2, &mut report);
        dialogue.received(at(0x4004, 0x7012), 4, 2, &mut report);
        assert_eq!(report.step_errors.len(), 1);
        assert_eq!((report.step_errors[0].code, report.step_errors[0].idn), (0x7012, Some(Idn(127))));
    }
}
