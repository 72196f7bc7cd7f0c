//! P-0-0003 says why what was tried last has failed, and nothing after a success.

use ring::ident::{Element, Idn};

use crate::dialogue::Heard;
use crate::law::{Event, Law, Verdict};
use crate::scene::Scene;

const FINDING: Idn = Idn(0x8000 | 3);
/// Data status of a procedure command: executed, and ended with an error.
const EXECUTED: u16 = 3;
const FAILED: u16 = 0xF;
/// The error whose reason P-0-0003 tells.
const INVALID: u16 = 0x7008;

/// Remembers how the last check, homing or write has ended.
#[derive(Default)]
pub(crate) struct Findings {
    /// S-0-0127, 128 or 148 has been started, and nothing has failed since.
    started: Option<Idn>,
    /// Whether the last of them was a success; `None` when nobody knows.
    success: Option<bool>,
    /// What that was.
    tried: Option<Idn>,
}

impl Law for Findings {
    fn sentence(&self) -> &'static str {
        "P-0-0003 says why what was tried last has failed, and nothing after a success"
    }

    fn judge(&mut self, event: &Event<'_>, scene: &Scene) -> Verdict {
        match event {
            Event::Mst if scene.wire.phase == 0 => *self = Self::default(),
            Event::Service(Heard::Written(idn @ Idn(127 | 128 | 148), Element::Data, words)) if words[..] == [3] => {
                *self = Self { started: Some(*idn), success: None, tried: Some(*idn) };
            }
            // Other commands have findings of their own.
            Event::Service(
                Heard::Written(Idn(149 | 262..=264 | 293), Element::Data, _)
                | Heard::Refused(Idn(149 | 262..=264 | 293), ..),
            ) => {
                *self = Self::default();
            }
            Event::Service(Heard::Opened(idn, EXECUTED)) if self.started == Some(*idn) => self.success = Some(true),
            Event::Service(Heard::Opened(idn, FAILED)) if self.started == Some(*idn) => self.success = Some(false),
            Event::Service(Heard::Refused(idn, step, INVALID)) if step.write && step.element == Element::Data => {
                *self = Self { started: None, success: Some(false), tried: Some(*idn) };
            }
            // A command that is refused for another reason may have one of its own.
            Event::Service(Heard::Refused(_, step, _)) if step.write && step.element == Element::Data => {
                *self = Self::default();
            }
            // A write that succeeds ends the reason of one that did not.
            Event::Service(Heard::Written(_, Element::Data, _)) if self.success == Some(false) => self.success = None,
            Event::Service(Heard::Read(FINDING, Element::Data, words)) => {
                let Some((success, length)) = self.success.zip(words.first()) else { return Verdict::Silent };
                return Verdict::of(success == (*length == 0), || {
                    let how = if success { "succeeded" } else { "failed" };
                    let tried = self.tried.map_or_else(String::new, |idn| format!(" ({idn})"));
                    format!("what was tried last{tried} has {how}, and P-0-0003 has {length} characters")
                });
            }
            _ => {}
        }
        Verdict::Silent
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::fake::Fake;

    #[test]
    fn a_success_leaves_nothing_and_a_failure_a_reason() {
        for (status, length, lawful) in
            [(EXECUTED, 0, true), (EXECUTED, 12, false), (FAILED, 12, true), (FAILED, 0, false)]
        {
            let mut fake = Fake::in_cp4(Findings::default());
            fake.write(148, &[3]);
            fake.open(148, status);
            fake.read(0x8003, &[length]);
            assert_eq!(fake.broken().is_none(), lawful, "{status} {length}: {:?}", fake.broken());
            assert_eq!(fake.armed(), u64::from(lawful));
        }
    }

    #[test]
    fn what_is_not_known_is_not_judged() {
        let mut fake = Fake::in_cp4(Findings::default());
        fake.read(0x8003, &[12]);
        fake.write(148, &[3]);
        fake.read(0x8003, &[12]);
        assert_eq!((fake.broken(), fake.armed()), (None, 0));
    }
}
