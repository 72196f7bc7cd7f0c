//! Torque never goes without a request or an error that says why, and an error takes it when the axis stands.

use ring::Nanoseconds;
use ring::ident::Idn;
use ring::service_client::{control, status};

use crate::law::{Event, Law, Verdict};
use crate::scene::Scene;

/// An error that has taken the torque is in the AT so much later, beside three cycles.
const NOTICE_MICROSECONDS: u64 = 2_000;
/// The axis stands when it is slower than this, in rad/s: 3 rpm.
const STANDSTILL: f64 = 0.3;
/// From standstill to the end of the torque, beside the brake: jerk-limited ends of ramps, and the brake's own test.
const AFTERMATH: Nanoseconds = Nanoseconds::from_millis(1_000);

/// S-0-0099.
const RESET: Idn = Idn(99);

/// A DC link that is so much above P-0-0104 has energy left.
const LINK: f64 = 1.1;
/// Main power that has gone within this is why the torque goes.
const OUTAGE: Nanoseconds = Nanoseconds::from_millis(2_000);
/// In rpm: an axis that is slower stands.
const TURNS: f64 = 30.0;

/// Waits for the word that explains a torque that has gone, and for the torque that an error must take.
#[derive(Default)]
pub(crate) struct TorqueGoes {
    /// Gone, and nothing has said why.
    unexplained: Option<Nanoseconds>,
    /// The error is shown, the axis stands, and the bridge is still on.
    standing: Option<Nanoseconds>,
    /// S-0-0099 is set, and when it was started last.
    resets: bool,
    reset: Option<Nanoseconds>,
    /// The velocity with which main power went, in rad/s.
    then: f64,
}

impl TorqueGoes {
    fn is_explained(scene: &Scene) -> bool {
        let wire = &scene.wire;
        !scene.is_operating()
            // What was switched on in another CP4 is engaging its brake.
            || wire.edge.is_none()
            || wire.control & (control::ON | control::ENABLE) != control::ON | control::ENABLE
            || wire.has_error()
    }

    /// S-0-0099 has been started just now: an error of just now is cleared before an AT could show it.
    fn is_cleared(&mut self, scene: &Scene) -> bool {
        let resets = [scene.command, scene.starting].contains(&Some(RESET));
        if resets && !self.resets {
            self.reset = Some(scene.now);
        }
        self.resets = resets;
        scene.within(self.reset, scene.cycles(3, NOTICE_MICROSECONDS))
    }

    /// Main power has gone, nothing else is wrong, and the DC link could have stopped the shaft that turns still.
    fn wasted_link(&self, scene: &Scene) -> Option<String> {
        let (sight, settings) = (&scene.sight, &scene.settings);
        let sound = sight.bridge_ready && sight.safe_torque && !scene.deceived && !sight.machine.feverish;
        // Before it is in operation an axis looks for its angle: there is no stop to finish.
        let operated = status::readiness(scene.wire.status) == 3 || scene.wire.has_error();
        let asked = scene.wire.control & control::ENABLE != 0 && scene.wire.phase == 4 && operated;
        let ramp = settings.word(Idn(0x8000 | 140)).is_some_and(|reaction| reaction != 1);
        let least = settings.unsigned(Idn(0x8000 | 104))? as f64 * LINK;
        let just_gone = !sight.main_power && scene.within(scene.pins_changed, OUTAGE);
        let (volts, rpm) = (sight.machine.bus_voltage, sight.rpm());
        // A shaft that swings through its standstill has been stopped, and one that stood when main power went had no stop before it: a command of just
        // before moves a light one a little before the filtered velocity shows it.
        let turned = self.then.abs() * 60.0 / core::f64::consts::TAU > TURNS;
        let turns_on = turned && self.then * scene.sight.machine.velocity > 0.0;
        (just_gone && sound && asked && ramp && turns_on && rpm.abs() > TURNS && volts > least)
            .then(|| format!("without main power the torque went at {rpm:.0} rpm, and the DC link has {volts:.0} V"))
    }

    fn look(&mut self, scene: &Scene) -> Verdict {
        let cleared = self.is_cleared(scene);
        if scene.before.main_power && !scene.sight.main_power {
            self.then = scene.sight.machine.velocity;
        }
        if scene.before.bridge && !scene.sight.bridge {
            self.unexplained = Some(scene.now);
            if let Some(words) = self.wasted_link(scene) {
                return Verdict::Broken(words);
            }
        }
        if scene.sight.bridge {
            self.unexplained = None;
        }
        let error = scene.wire.has_error() && scene.is_operating();
        // An axis whose brake does not hold is held by its torque.
        if scene.sight.machine.brake_broken
            || !(error && scene.sight.bridge && scene.sight.machine.velocity.abs() < STANDSTILL)
        {
            self.standing = None;
        } else if self.standing.is_none() {
            self.standing = Some(scene.now);
        }
        if let Some(gone) = self.unexplained {
            if Self::is_explained(scene) || cleared {
                self.unexplained = None;
                return Verdict::Kept;
            }
            let patience = scene.cycles(3, NOTICE_MICROSECONDS);
            return Verdict::of(scene.now.saturating_sub(gone) <= patience, || {
                let (control, status) = (scene.wire.control, scene.wire.status);
                format!("the bridge went off at {gone}; control word {control:04X}H, status word {status:04X}H")
            });
        }
        let Some(standing) = self.standing else { return Verdict::Silent };
        let brake = scene.settings.unsigned(Idn(207)).unwrap_or(10_000)
            + scene.settings.unsigned(Idn(0x8000 | 123)).unwrap_or(20);
        let patience = AFTERMATH + Nanoseconds::from_millis(brake.unsigned_abs());
        Verdict::of(scene.now.saturating_sub(standing) <= patience, || {
            format!("with an error shown the axis stands since {standing}, and the bridge is on still")
        })
    }
}

impl Law for TorqueGoes {
    fn sentence(&self) -> &'static str {
        "torque never goes without a request or an error that says why, and an error takes the torque within its time"
    }

    fn judge(&mut self, event: &Event<'_>, scene: &Scene) -> Verdict {
        match event {
            Event::Look => self.look(scene),
            _ => Verdict::Silent,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::fake::Fake;

    fn in_operation() -> Fake {
        let mut fake = Fake::in_cp4(TorqueGoes::default());
        fake.cycle(0, 0x8000);
        fake.sight.bridge = true;
        fake.run(5, 0xE000, 0xC008);
        fake
    }

    #[test]
    fn a_request_or_an_error_explains_it() {
        let mut fake = in_operation();
        fake.sight.bridge = false;
        fake.run(10, 0x8000, 0x8000);
        assert_eq!((fake.broken(), fake.armed()), (None, 1));
        let mut fake = in_operation();
        fake.sight.bridge = false;
        fake.run(2, 0xE000, 0xC008);
        fake.run(10, 0xE000, 0xA000);
        assert_eq!(fake.broken(), None);
    }

    #[test]
    fn a_stop_is_finished_out_of_the_dc_link() {
        for (volts, lawful) in [(560.0, false), (155.0, true)] {
            let mut fake = in_operation();
            fake.sight.machine.velocity = 100.0;
            fake.sight.main_power = false;
            fake.run(2, 0xE000, 0xC008);
            fake.sight.machine.bus_voltage = volts;
            fake.sight.bridge = false;
            fake.run(10, 0x6000, 0xA000);
            assert_eq!(fake.broken().is_none(), lawful, "{:?}", fake.broken());
        }
    }

    #[test]
    fn silence_does_not() {
        let mut fake = in_operation();
        fake.sight.bridge = false;
        fake.run(10, 0xE000, 0x8000);
        assert!(fake.broken().is_some_and(|words| words.contains("went off")));
    }

    #[test]
    fn an_error_that_s_0_0099_clears_before_an_at_shows_it_explains_it() {
        // And not one of later on, however long the master leaves it at 3.
        for (cycles, lawful) in [(0, true), (2, true), (5, false), (100, false)] {
            let mut fake = in_operation();
            fake.write(99, &[3]);
            fake.run(cycles, 0xE000, 0xC008);
            fake.sight.bridge = false;
            fake.run(10, 0xE000, 0x8000);
            assert_eq!(fake.broken().is_none(), lawful, "{cycles} cycles: {:?}", fake.broken());
        }
    }

    #[test]
    fn an_error_does_not_leave_the_torque_on() {
        let mut fake = in_operation();
        fake.run(100, 0xE000, 0xE000);
        assert_eq!(fake.broken(), None);
        fake.run(600, 0xE000, 0xE000);
        assert!(fake.broken().is_some_and(|words| words.contains("is on still")));
    }
}
