//! Settings that contradict each other never come into operation.

use ring::ident::{Element, Idn};

use crate::dialogue::Heard;
use crate::law::{Event, Law, Verdict};
use crate::scene::Scene;

/// S-0-0055: the command counts against the axis, the feedback does, and the limits act.
const COMMAND_TURNED: u16 = 1;
const FEEDBACK_TURNED: u16 = 4;
const LIMITS_ACT: u16 = 0x10;
/// S-0-0076: positions repeat after S-0-0103.
const MODULO: u16 = 0x80;
/// So many ATs of a CP4 are an answer of a drive that is in it.
const ANSWERS: u64 = 2;

/// Looks once in every CP4, and when one of the settings is written in it.
#[derive(Default)]
pub(crate) struct Contradictions {
    written: bool,
}

impl Contradictions {
    fn find(scene: &Scene) -> Verdict {
        let settings = &scene.settings;
        let known = settings.signed(Idn(49)).zip(settings.signed(Idn(50)));
        let known = known.zip(settings.word(Idn(55))).zip(settings.word(Idn(76)));
        let Some((((high, low), polarity), scaling)) = known else { return Verdict::Silent };
        let mixed = (polarity & COMMAND_TURNED != 0) != (polarity & FEEDBACK_TURNED != 0);
        Verdict::of(high >= low && !mixed && (polarity & LIMITS_ACT == 0 || scaling & MODULO == 0), || {
            format!("in CP4 S-0-0049 is {high}, S-0-0050 {low}, S-0-0055 {polarity:02X}H and S-0-0076 {scaling:02X}H")
        })
    }
}

impl Law for Contradictions {
    fn sentence(&self) -> &'static str {
        "settings that contradict each other never come into operation"
    }

    fn judge(&mut self, event: &Event<'_>, scene: &Scene) -> Verdict {
        match event {
            Event::Service(Heard::Written(Idn(49 | 50 | 55 | 76), Element::Data, _)) if scene.wire.phase == 4 => {
                self.written = true;
                Verdict::Silent
            }
            Event::Answer if scene.wire.phase == 4 && (self.written || scene.wire.answers == ANSWERS) => {
                self.written = false;
                Self::find(scene)
            }
            _ => Verdict::Silent,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::fake::Fake;

    fn long(value: i32) -> [u16; 2] {
        [value as u16, (value >> 16) as u16]
    }

    #[test]
    fn limits_of_one_order_and_polarities_of_one_sense_come_into_operation() {
        for (idn, value, lawful) in [
            (49, long(-1_000), false),
            (50, long(1_000), true),
            (55, [1, 0], false),
            (55, [4, 0], false),
            (55, [5, 0], true),
            (55, [0x10, 0], true),
        ] {
            let mut fake = Fake::in_cp4(Contradictions::default());
            fake.write(50, &long(0));
            fake.write(idn, if idn == 55 { &value[..1] } else { &value });
            fake.run(3, 0, 0x8000);
            assert_eq!(fake.broken().is_none(), lawful, "S-0-{idn:04}: {:?}", fake.broken());
        }
    }

    #[test]
    fn an_endless_axis_has_no_limits() {
        for (polarity, lawful) in [(0, true), (0x10, false)] {
            let mut fake = Fake::in_cp4(Contradictions::default());
            fake.write(76, &[0x82]);
            fake.write(55, &[polarity]);
            fake.run(3, 0, 0x8000);
            assert_eq!(fake.broken().is_none(), lawful);
        }
    }
}
