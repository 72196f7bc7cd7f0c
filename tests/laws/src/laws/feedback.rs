//! S-0-0051 follows the shaft, and does not jump but by homing, S-0-0447 or rescaling.

use core::f64::consts::TAU;

use ring::Nanoseconds;
use ring::ident::Idn;

use crate::law::{Event, Law, Verdict};
use crate::scene::Scene;

/// Between two looks the shaft is where a straight line says, and the latch is exact to this, in seconds.
const TIMING: f64 = 1e-6;
/// A tolerance of the communication cycle: an MST that comes then is in time.
const JITTER: Nanoseconds = Nanoseconds::from_microseconds(2);
/// A procedure that gives positions another zero is done so long after its beginning, or is still running.
const REZEROING: Nanoseconds = Nanoseconds::from_millis(100);

/// Knows where the zero of S-0-0051 is.
#[derive(Default)]
pub(crate) struct Feedback {
    /// S-0-0051 less what the shaft has turned, in increments.
    zero: Option<f64>,
    /// The fastest that the shaft was since then, in revolutions per second: the zero is as exact as the latch at that speed.
    fastest: f64,
    session: Nanoseconds,
}

impl Law for Feedback {
    fn sentence(&self) -> &'static str {
        "S-0-0051 follows the shaft and does not jump but by homing, S-0-0447 or rescaling"
    }

    fn judge(&mut self, event: &Event<'_>, scene: &Scene) -> Verdict {
        if scene.deceived {
            // Also where the bridge comes on, and ends it, before an AT.
            self.zero = None;
        }
        if !matches!(event, Event::Answer) {
            return Verdict::Silent;
        }
        let wire = &scene.wire;
        let homing = scene.homing || scene.within(scene.rezeroed, REZEROING + scene.cycles(4, 0));
        if wire.phase != 4 || scene.deceived || homing || self.session != wire.phase_since {
            self.zero = None;
            self.session = wire.phase_since;
            return Verdict::Silent;
        }
        if let (Some(units), Some(shown)) = (scene.units.filter(|units| units.is_modulo), scene.position_feedback())
            && wire.answers > 3
            && !(0.0..units.modulo).contains(&shown)
        {
            return Verdict::Broken(format!("S-0-0051 shows {shown}, and S-0-0103 is {}", units.modulo));
        }
        // What the AT shows was captured at t4 of the cycle before. A cycle without an MST has its own idea of t4.
        let regular = wire.mst.0.abs_diff(wire.mst_before.0 + scene.cycle.0) <= JITTER.0;
        let (Some(units), Some(sense), Some(shown)) = (scene.units, scene.sense(), scene.position_feedback()) else {
            return Verdict::Silent;
        };
        let t4 = scene.settings.word(Idn::T4).unwrap_or(0);
        if wire.at.saturating_sub(wire.mst) > Nanoseconds::from_microseconds(t4.into()) {
            // So early in the cycle it may be that of the same.
            return Verdict::Silent;
        }
        let captured = wire.mst_before + Nanoseconds::from_microseconds(t4.into());
        let Some(angle) = scene.angle_at(captured).filter(|_| regular && wire.answers > 3) else {
            return Verdict::Silent;
        };
        let turned = sense * angle * units.increments;
        let speed = scene.sight.machine.velocity.abs().max(scene.before.machine.velocity.abs()) / TAU;
        let Some(zero) = self.zero else {
            self.fastest = speed;
            self.zero = Some(shown - turned);
            return Verdict::Silent;
        };
        let off = units.way(zero + turned, shown);
        self.fastest = self.fastest.max(speed);
        let tolerance = 2.0 * scene.quantum(&units) + 2.0 + self.fastest * TIMING * units.increments;
        Verdict::of(off.abs() <= tolerance, || {
            format!(
                "S-0-0051 shows {shown}, but the shaft is {off:.0} increments from there (tolerance {tolerance:.0})"
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::fake::Fake;

    /// So many cycles at 100 rad/s; S-0-0051 at the beginning of the cycle before, times `factor`, plus `offset`.
    fn turn(fake: &mut Fake, cycles: usize, factor: f64, offset: f64) {
        fake.sight.machine.velocity = 100.0;
        for _ in 0..cycles {
            let shown = factor * fake.angle_before() * 3_600_000.0 + offset;
            fake.data[1] = (shown.floor() as i64 as i32).to_le_bytes().to_vec();
            fake.cycle(0, 0x8000);
        }
    }

    #[test]
    fn a_position_that_turns_with_the_shaft_keeps_it() {
        let mut fake = Fake::in_cp4(Feedback::default());
        turn(&mut fake, 300, 1.0, 12_345.0);
        assert_eq!(fake.broken(), None);
        assert!(fake.armed() > 200);
    }

    #[test]
    fn a_jump_and_a_wrong_weight_break_it() {
        let mut fake = Fake::in_cp4(Feedback::default());
        turn(&mut fake, 20, 1.0, 12_345.0);
        turn(&mut fake, 2, 1.0, 13_345.0);
        assert!(fake.broken().is_some_and(|words| words.contains("999 increments")), "{:?}", fake.broken());
        for wrong in [-1.0, 1.01, 2.0] {
            let mut fake = Fake::in_cp4(Feedback::default());
            turn(&mut fake, 20, wrong, 0.0);
            assert!(fake.broken().is_some(), "{wrong}");
        }
    }

    #[test]
    fn a_modulo_position_is_less_than_its_modulo() {
        for (shown, lawful) in [(0, true), (3_599_999, true), (3_600_000, false), (-1, false)] {
            let mut fake = Fake::in_cp4(Feedback::default());
            fake.write(76, &[0x82]);
            fake.run(200, 0, 0x8000);
            fake.data[1] = i32::to_le_bytes(shown).to_vec();
            fake.write(52, &[0, 0]);
            fake.write(447, &[3]);
            fake.write(447, &[0]);
            fake.run(100, 0, 0x8000);
            assert_eq!(fake.broken().is_none(), lawful, "{shown}: {:?}", fake.broken());
        }
    }

    #[test]
    fn a_new_zero_by_s_0_0447_is_lawful() {
        let mut fake = Fake::in_cp4(Feedback::default());
        turn(&mut fake, 20, 1.0, 0.0);
        fake.write(447, &[3]);
        turn(&mut fake, 20, 1.0, 77_777.0);
        fake.write(447, &[0]);
        turn(&mut fake, 100, 1.0, 77_777.0);
        assert_eq!(fake.broken(), None);
    }
}
