//! The service channel, overheard (sercos2.md 3.3): which step the drive has acknowledged, and what it meant.

use ring::ident::{Element, Idn};
use ring::service_client::{AtWords, MdtWords, Step, control, status};

/// What the service channel has brought to its end.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Heard {
    /// A data block was opened; the data status that came with it.
    Opened(Idn, u16),
    /// All words of an element were written, and the drive took them.
    Written(Idn, Element, Vec<u16>),
    /// All words of an element were read.
    Read(Idn, Element, Vec<u16>),
    /// A step was refused with this code.
    Refused(Idn, Step, u16),
}

/// A listener at the service channel of one drive.
#[derive(Clone, Debug, Default)]
pub struct Dialogue {
    handshake: Option<u16>,
    pending: Option<Step>,
    open: Option<Idn>,
    element: Option<(Element, bool)>,
    words: Vec<u16>,
}

impl Dialogue {
    /// The channel begins anew, as in CP0 and CP1. The data block that was being written then: nobody has heard whether the drive took it.
    pub fn reset(&mut self) -> Option<Idn> {
        let written = self.pending.is_some_and(|step| step.write && step.element == Element::Data && step.end);
        let unanswered = self.open.filter(|_| written);
        *self = Self::default();
        unanswered
    }

    /// The words of a record that has reached the drive.
    pub fn record(&mut self, words: MdtWords) {
        let handshake = words.control & control::HANDSHAKE;
        if self.handshake.is_some_and(|before| before != handshake) {
            self.pending = Some(Step::of_words(words));
        }
        self.handshake = Some(handshake);
    }

    /// The procedure command that the record in front of the drive starts: it may begin before an AT acknowledges it.
    #[must_use]
    pub fn starts(&self) -> Option<Idn> {
        let step = self.pending.filter(|step| step.write && step.element == Element::Data && step.end)?;
        self.open.filter(|_| step.info == 3)
    }

    /// The words of an AT of the drive.
    pub fn answer(&mut self, words: AtWords) -> Option<Heard> {
        if words.status & status::HANDSHAKE != self.handshake? || words.status & status::BUSY != 0 {
            return None;
        }
        let step = self.pending.take()?;
        if words.status & status::ERROR != 0 {
            self.element = None;
            self.words.clear();
            return Some(Heard::Refused(self.open.unwrap_or(Idn(step.info)), step, words.info));
        }
        match (step.element, step.write) {
            (Element::Close, _) => {
                self.open = None;
                self.element = None;
                None
            }
            (Element::Idn, true) => {
                self.open = Some(Idn(step.info));
                self.element = None;
                Some(Heard::Opened(Idn(step.info), words.info))
            }
            (element, write) => {
                if self.element != Some((element, write)) {
                    self.words.clear();
                    self.element = Some((element, write));
                }
                self.words.push(if write { step.info } else { words.info });
                if !step.end {
                    return None;
                }
                self.element = None;
                let words = std::mem::take(&mut self.words);
                let idn = self.open?;
                Some(if write { Heard::Written(idn, element, words) } else { Heard::Read(idn, element, words) })
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn say(dialogue: &mut Dialogue, step: Step, handshake: u16, status: u16, info: u16) -> Option<Heard> {
        dialogue.record(MdtWords { control: step.control() | handshake, info: step.info });
        let before = dialogue.answer(AtWords { status: 1 - handshake, info });
        assert_eq!(before, None, "not acknowledged yet");
        dialogue.answer(AtWords { status: status | handshake, info })
    }

    #[test]
    fn a_write_that_the_channel_s_end_leaves_unanswered_is_named_once() {
        let mut dialogue = Dialogue::default();
        dialogue.record(MdtWords { control: 0, info: 0 });
        say(&mut dialogue, Step::open(Idn(92)), 1, 1, 0);
        assert_eq!(dialogue.clone().reset(), None, "nothing is under way");
        let write = Step { element: Element::Data, write: true, end: true, info: 2_000 };
        dialogue.record(MdtWords { control: write.control(), info: write.info });
        assert_eq!(dialogue.reset(), Some(Idn(92)));
        assert_eq!(dialogue.reset(), None);
    }

    #[test]
    fn a_long_word_is_heard_when_its_last_step_is_acknowledged() {
        let mut dialogue = Dialogue::default();
        dialogue.record(MdtWords { control: 0, info: 0 });
        assert_eq!(say(&mut dialogue, Step::open(Idn(47)), 1, 0, 0), Some(Heard::Opened(Idn(47), 0)));
        let step = |info, end| Step { element: Element::Data, write: true, end, info };
        assert_eq!(say(&mut dialogue, step(7, false), 0, 0, 0), None);
        let written = Heard::Written(Idn(47), Element::Data, vec![7, 8]);
        assert_eq!(say(&mut dialogue, step(8, true), 1, 0, 0), Some(written));
        let read = Step { write: false, ..step(0, true) };
        assert_eq!(say(&mut dialogue, read, 0, 0, 9), Some(Heard::Read(Idn(47), Element::Data, vec![9])));
    }

    #[test]
    fn a_command_starts_before_the_drive_has_said_so() {
        let mut dialogue = Dialogue::default();
        dialogue.record(MdtWords { control: 0, info: 0 });
        say(&mut dialogue, Step::open(Idn(148)), 1, 0, 0);
        assert_eq!(dialogue.starts(), None);
        let write = Step { element: Element::Data, write: true, end: true, info: 3 };
        dialogue.record(MdtWords { control: write.control(), info: 3 });
        assert_eq!(dialogue.starts(), Some(Idn(148)));
        assert!(dialogue.answer(AtWords { status: 0, info: 0 }).is_some());
        assert_eq!(dialogue.starts(), None);
    }

    #[test]
    fn a_busy_drive_has_not_answered_and_an_error_is_no_value() {
        let mut dialogue = Dialogue::default();
        dialogue.record(MdtWords { control: 0, info: 0 });
        let open = Step::open(Idn(99));
        assert_eq!(say(&mut dialogue, open, 1, status::BUSY, 0), None);
        assert_eq!(dialogue.answer(AtWords { status: 1, info: 7 }), Some(Heard::Opened(Idn(99), 7)));
        let write = Step { element: Element::Data, write: true, end: true, info: 3 };
        assert_eq!(say(&mut dialogue, write, 0, status::ERROR, 0x7005), Some(Heard::Refused(Idn(99), write, 0x7005)));
    }
}
