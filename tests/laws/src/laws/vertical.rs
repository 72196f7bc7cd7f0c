//! A vertical load never falls further than its brake needs to catch it.

use core::f64::consts::TAU;

use ring::service_client::control;

use crate::law::{Event, Law, Verdict};
use crate::scene::Scene;

/// From the error to the end of the coil's current, in seconds, when the torque goes at once.
const LATENCY: f64 = 2e-3;
/// The brake's torque builds up within a fifth of the delay after it: as good as there at half of that.
const BUILD_UP: f64 = 1.1;
/// A fall is watched for so long, in seconds, beyond the delay of the brake.
const WATCHED: f64 = 0.5;
/// In cycles: the AT that is being sent cannot show the error any more, and a ring is lost after two and a half.
const SHOWN_AFTER: u64 = 3;
/// Share, and revolutions for the shaft between motor and load.
const MARGIN: (f64, f64) = (1.3, 0.005);
/// A brake that was switched on and off again on its way holds with what it has, for its whole delay once more.
const CLOSED: f64 = 0.95;
/// Share, for a shaft that was wound up.
const WOUND: f64 = 1.5;

/// Follows a load from the end of the torque.
#[derive(Default)]
pub(crate) struct Vertical {
    fall: Option<Fall>,
    /// A load that may fall has not been caught since, although the bridge came on: there was no torque yet.
    falls_on: bool,
}

struct Fall {
    since: ring::Nanoseconds,
    from: f64,
    direction: f64,
    /// In revolutions, until the brake has caught it.
    way: f64,
    /// The torque went before the brake could hold.
    at_once: bool,
    /// An AT that shows why may be still to come.
    soon: bool,
}

impl Fall {
    fn allowed(&self) -> f64 {
        if self.at_once || self.soon { MARGIN.0 * self.way + MARGIN.1 } else { MARGIN.1 }
    }
}

impl Vertical {
    fn begin(scene: &Scene) -> Option<Fall> {
        let (machine, brake) = (&scene.sight.machine, scene.machine.brake?);
        let mechanics = &scene.machine.mechanics;
        let pull = machine.load_torque.abs() - mechanics.coulomb_friction;
        // A limit that the load is stronger than has let it fall before.
        let weak = scene.settings.unsigned(ring::ident::Idn(92)).is_some_and(|limit| {
            scene
                .units
                .is_some_and(|units| limit as f64 * units.torque * scene.torque_constant() < machine.load_torque.abs())
        });
        if pull <= 0.0 || machine.brake_broken || weak {
            return None;
        }
        let direction = machine.load_torque.signum();
        let acceleration = pull / scene.inertia();
        let speed = (machine.velocity * direction).max(0.0);
        // Currents that nobody has measured, or that worked against the brake, may have wound up the shaft between motor and load.
        let wound = if scene.deceived || scene.hurries_its_brake() { WOUND } else { 1.0 };
        // A brake that has closed before holds at once; one that holds already lets nothing fall.
        let closed = !scene.sight.coil && machine.brake_torque > CLOSED * brake.holding_torque;
        let delay = if closed { 0.0 } else { BUILD_UP * brake.engage_delay + LATENCY };
        let stop = (brake.holding_torque + mechanics.coulomb_friction - machine.load_torque.abs()) / scene.inertia();
        let then = speed + acceleration * delay;
        let way = speed * delay
            + 0.5 * acceleration * delay * delay
            + if stop > 0.0 { then * then / (2.0 * stop) } else { return None };
        // Only an error or bit 14 takes the torque before the brake holds.
        let at_once = scene.wire.has_error()
            || scene.wire.control & control::ENABLE == 0
            || !scene.is_operating()
            || !scene.sight.bridge_ready
            || !scene.sight.safe_torque
            || !scene.sight.main_power
            || scene.deceived;
        Some(Fall { since: scene.now, from: machine.angle, direction, way: wound * way / TAU, at_once, soon: true })
    }
}

impl Law for Vertical {
    fn sentence(&self) -> &'static str {
        "a vertical load never falls further than its brake needs to catch it"
    }

    fn judge(&mut self, event: &Event<'_>, scene: &Scene) -> Verdict {
        if let Some(fall) = &mut self.fall {
            // The error is shown, or the ring is seen to be lost, after the torque has gone.
            fall.soon = scene.now.saturating_sub(fall.since) <= scene.cycles(SHOWN_AFTER, 0);
            fall.at_once |= fall.soon && (scene.wire.has_error() || !scene.is_operating());
        }
        let Event::Look = event else { return Verdict::Silent };
        let machine = &scene.sight.machine;
        let falling = machine.velocity * machine.load_torque.signum() > 0.0;
        self.falls_on = falling && (self.falls_on || self.fall.as_ref().is_some_and(|fall| fall.at_once));
        if scene.before.bridge && !scene.sight.bridge {
            self.fall = Self::begin(scene);
            if let Some(fall) = &mut self.fall {
                fall.at_once |= self.falls_on;
            }
        }
        let over = |fall: &Fall| (scene.now - fall.since).as_seconds() > WATCHED;
        if scene.sight.bridge
            || scene.sight.machine.brake_broken
            || self.fall.as_ref().is_some_and(over)
            || scene.disturbed.is_some_and(|then| self.fall.as_ref().is_some_and(|fall| then > fall.since))
        {
            self.fall = None;
        }
        let Some(fall) = &self.fall else { return Verdict::Silent };
        let fallen = (scene.sight.machine.angle - fall.from) * fall.direction;
        let allowed = fall.allowed();
        Verdict::of(fallen <= allowed, || {
            format!("the load has fallen by {fallen:.4} revolutions since {}, {allowed:.4} allowed", fall.since)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::fake::Fake;
    use plant::ReferenceAxis;

    /// The torque goes, and the load falls freely for so many cycles of 2 ms.
    fn fall(cycles: usize, status: u16) -> Fake {
        let mut fake = Fake::of(Vertical::default(), ReferenceAxis::vertical().machine);
        fake.sight.bridge = true;
        fake.sight.coil = true;
        fake.sight.machine.load_torque = -1.5;
        fake.run(5, 0xE000, 0xC008);
        fake.run(2, 0xE000, status);
        fake.sight.bridge = false;
        fake.sight.coil = false;
        for _ in 0..cycles {
            // 1.25 Nm on 0.001 kg m².
            fake.turning(0xE000, status, -1_250.0, |_| {});
        }
        fake.sight.machine.velocity = 0.0;
        fake.run(20, 0xE000, status);
        fake
    }

    #[test]
    fn a_bridge_that_comes_on_for_a_moment_catches_nothing_unless_the_load_has_stood() {
        let again = |caught: bool| {
            let mut fake = Fake::of(Vertical::default(), ReferenceAxis::vertical().machine);
            fake.sight.bridge = true;
            fake.sight.coil = true;
            fake.sight.machine.load_torque = -1.5;
            fake.run(5, 0xE000, 0xC008);
            fake.run(2, 0xA000, 0xC008);
            (fake.sight.bridge, fake.sight.coil) = (false, false);
            for _ in 0..3 {
                fake.turning(0xA000, 0x8000, -1_250.0, |_| {});
            }
            fake.sight.bridge = true;
            if caught {
                fake.sight.machine.velocity = 0.0;
                fake.run(10, 0xE000, 0xC008);
            } else {
                fake.turning(0xE000, 0xC008, -1_250.0, |_| {});
            }
            fake.sight.bridge = false;
            for _ in 0..9 {
                fake.turning(0xE000, 0x8000, -1_250.0, |_| {});
            }
            fake.broken()
        };
        assert_eq!(again(false), None);
        assert!(again(true).is_some_and(|words| words.contains("fallen")));
    }

    #[test]
    fn a_load_may_fall_until_its_brake_holds_after_an_error_and_not_at_all_without() {
        assert_eq!(fall(13, 0xA000).broken(), None);
        assert!(fall(20, 0xA000).broken().is_some_and(|words| words.contains("fallen")));
        assert_eq!(fall(1, 0x8000).broken(), None);
        assert!(fall(10, 0x8000).broken().is_some());
    }
}
