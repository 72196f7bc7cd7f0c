//! An absolute axis that positions itself goes the way that the numbers go.

use ring::Nanoseconds;

use crate::law::{Event, Law, Verdict};
use crate::scene::Scene;

/// Operation modes 0013H and 001BH: to S-0-0258.
const POSITIONING: [u16; 2] = [0x13, 0x1B];
/// From one AT to the next no axis moves through half of its numbers.
const HALF: f64 = 2_147_483_648.0;
/// In increments: an axis that is held on the border trembles over it.
const TREMBLE: f64 = 100_000.0;
/// A load that has just changed moves the shaft itself.
const GRACE: Nanoseconds = Nanoseconds::from_millis(500);

/// Compares S-0-0051 of one AT and the next.
#[derive(Default)]
pub(crate) struct Border {
    before: Option<f64>,
    /// S-0-0051 when the drive began to go.
    from: Option<f64>,
}

impl Law for Border {
    fn sentence(&self) -> &'static str {
        "an absolute axis that positions itself never goes over the border of its numbers"
    }

    fn judge(&mut self, event: &Event<'_>, scene: &Scene) -> Verdict {
        if !matches!(event, Event::Answer) {
            return Verdict::Silent;
        }
        let wire = &scene.wire;
        let goes = wire.phase == 4 && wire.follows() && !wire.has_error();
        let goes = goes && scene.actual_mode().is_some_and(|mode| POSITIONING.contains(&mode));
        let absolute = scene.units.is_some_and(|units| !units.is_modulo) && !scene.deceived;
        let left_alone = scene.is_left_alone(GRACE) && !scene.within(scene.rezeroed, GRACE) && scene.command.is_none();
        let shown = scene.position_feedback().filter(|_| goes && absolute && left_alone);
        let Some(shown) = shown else {
            *self = Self::default();
            return Verdict::Silent;
        };
        let from = *self.from.get_or_insert(shown);
        let Some(before) = self.before.replace(shown) else { return Verdict::Silent };
        // It has gone there by itself.
        let gone = HALF - from.abs() > TREMBLE;
        Verdict::of(!gone || (shown - before).abs() < HALF, || {
            format!("S-0-0051 was {before} and is {shown}, on the way of the drive's own from {from}")
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::fake::Fake;

    #[test]
    fn a_target_behind_the_border_is_gone_to_the_long_way() {
        for (next, lawful) in [(2_147_483_647_i32, true), (-2_147_483_648, false)] {
            let mut fake = Fake::in_cp4(Border::default());
            fake.write(32, &[0x1B]);
            fake.run(400, 0, 0x8000);
            fake.data[1] = 2_147_000_000_i32.to_le_bytes().to_vec();
            fake.run(5, 0xE000, 0xC008);
            fake.data[1] = next.to_le_bytes().to_vec();
            fake.run(5, 0xE000, 0xC008);
            assert_eq!(fake.broken().is_none(), lawful, "{next}: {:?}", fake.broken());
        }
    }
}
