//! A stop never makes the shaft faster nor turns it back, and it stands when the deceleration says so.

use ring::Nanoseconds;
use ring::ident::Idn;
use ring::service_client::{control, status};

use crate::law::{Event, Law, Verdict};
use crate::scene::Scene;

/// What a loop overshoots: a share of the speed, and rad/s (5 rpm) of what is no speed yet.
const OVERSHOOT: (f64, f64) = (0.05, 0.5);
/// The torque of the moment goes on for so long: filter of the velocity and current loop.
const LOOP_LAG: f64 = 2e-3;
/// And where the load hangs on an elastic shaft, which winds up and unwinds.
const ELASTIC_LAG: f64 = 4e-3;
/// It is no overshoot that lasts longer than this.
const LASTING: Nanoseconds = Nanoseconds::from_millis(1);
/// The axis stands when it is slower than this in rad/s, or has this share of its speed.
const STANDSTILL: (f64, f64) = (1.0, 0.02);
/// Margin of the time to standstill: a share, and milliseconds for filters and the end of the loops' settling.
const MARGIN: (f64, f64) = (0.2, 100.0);
/// A stop whose loops settle goes on: what else asks for a stop meanwhile finds an overshoot, and no speed of its own.
const SETTLING: Nanoseconds = Nanoseconds::from_millis(50);
/// A loop that overshoots its standstill comes back so far: revolutions, and seconds of the speed that the stop began with and that the torque
/// of the moment adds, which may be that of a stop before. At the torque limit
/// (P-0-0140 = 0) the set-point is a step to zero, behind which the integral part turns a motor without friction back with a quarter of its speed.
const BACK: (f64, f64) = (0.005, 8e-3);
/// What was braked shortly before the stop was braked with all that the loop has, and its integral part turns the shaft back: a speed is forgotten
/// with this time constant in seconds.
const RECENT: f64 = 10e-3;
/// And this share of what is left of it is no speed that the stop has made, where the shaft turns the other way.
const SWING: f64 = 0.4;
/// After a change of the load the shaft may do what it must for so long.
const RECOVERY: Nanoseconds = Nanoseconds::from_millis(300);

/// Follows a stop from its cause to the end of the torque, or of the stop.
#[derive(Default)]
pub(crate) struct Stop {
    running: Option<Running>,
    /// The highest speed of the last milliseconds in rad/s, fading with [`RECENT`].
    recent: f64,
    error: bool,
    lost: bool,
}

struct Running {
    cause: &'static str,
    begun: Nanoseconds,
    /// Until when the cause may not have reached the loops yet.
    effect: Nanoseconds,
    /// The highest speed that the shaft had when the stop began, in rad/s.
    speed: f64,
    /// What may come on top.
    tolerance: f64,
    /// When it has to stand, in units of a look; `None` when that is not known.
    deadline: Option<Nanoseconds>,
    faster: Option<Nanoseconds>,
    /// Since when it has stood.
    stood: Option<Nanoseconds>,
    /// What the torque of the moment adds to it.
    added: f64,
    /// The speed of which a loop that was braking already comes back.
    recent: f64,
    /// The way that the shaft turned when the stop began, 1 or -1, and how far it has come that way, in revolutions.
    direction: f64,
    furthest: f64,
}

impl Stop {
    fn begin(&mut self, cause: &'static str, scene: &Scene, effect: Nanoseconds) {
        // Before it is in operation the drive looks for its commutation angle, and moves the shaft for it.
        let operates = status::readiness(scene.wire.status) == 3;
        let settles = |running: &Running| running.stood.is_none_or(|since| scene.now.saturating_sub(since) < SETTLING);
        if !scene.sight.bridge || !operates || self.running.as_ref().is_some_and(settles) {
            return;
        }
        let velocity = scene.sight.machine.velocity;
        let span = scene.sight.time.saturating_sub(scene.before.time).as_seconds();
        let acceleration = if span > 0.0 { (velocity - scene.before.machine.velocity).abs() / span } else { 0.0 };
        let speed = velocity.abs();
        let halt = scene.settings.signed(Idn(372)).filter(|value| cause == "HALT" && *value != 0);
        let ramp = halt.or_else(|| scene.settings.unsigned(Idn(138)));
        let deadline = ramp.zip(scene.units).map(|(ramp, units)| {
            let ramp = ramp as f64 * units.acceleration;
            let jerk = scene.settings.signed(Idn(349)).unwrap_or(0) as f64 * units.acceleration;
            let rounded = if jerk > 0.0 { ramp / jerk } else { 0.0 };
            // A position loop with lag comes to rest behind its ramp like any other of its order: 5 time constants are 1 %.
            let kv = scene.settings.unsigned(Idn(104)).unwrap_or(1).max(1) as f64 / 6.0;
            let seconds = (speed / ramp + rounded) * (1.0 + MARGIN.0) + MARGIN.1 * 1e-3 + 5.0 / kv;
            scene.now + effect + Nanoseconds((seconds.min(1e6) * 1e9) as u64)
        });
        let lag = if scene.machine.mechanics.load.is_some() { ELASTIC_LAG } else { LOOP_LAG };
        let tolerance = OVERSHOOT.0 * speed + OVERSHOOT.1 + acceleration * lag;
        let effect = scene.now + effect;
        let direction = velocity.signum();
        self.running = Some(Running {
            cause,
            begun: scene.now,
            effect,
            speed,
            tolerance,
            deadline,
            faster: None,
            stood: None,
            added: acceleration * lag,
            recent: self.recent.max(speed),
            direction,
            furthest: scene.sight.machine.angle * direction,
        });
    }

    fn watch(&mut self, scene: &Scene) -> Verdict {
        let span = scene.sight.time.saturating_sub(scene.before.time).as_seconds();
        self.recent = (self.recent * (-span / RECENT).exp()).max(scene.sight.machine.velocity.abs());
        if !scene.sight.bridge || scene.deceived {
            self.running = None;
            return Verdict::Silent;
        }
        let Some(running) = &mut self.running else { return Verdict::Silent };
        let machine = &scene.sight.machine;
        let speed = machine.velocity.abs();
        let way = machine.angle * running.direction;
        if scene.now <= running.effect {
            running.furthest = way;
            running.speed = running.speed.max(speed);
            running.recent = running.recent.max(speed);
            return Verdict::Silent;
        }
        if scene.within(scene.disturbed, RECOVERY)
            || machine.seized
            || scene.outruns_its_motor()
            || (scene.hurries_its_brake() && !scene.sight.coil)
        {
            // Another load is another stop: it counts from where it leaves the shaft.
            running.speed = running.speed.max(speed);
            running.recent = running.recent.max(speed);
            running.faster = None;
            running.deadline = None;
            running.furthest = way;
            return Verdict::Silent;
        }
        let driving = machine.torque * machine.velocity > 0.0;
        // A loop that was braking swings to the other side, and never on.
        let swing = if machine.velocity * running.direction < 0.0 { SWING * running.recent } else { 0.0 };
        if speed > running.speed.max(swing) + running.tolerance && driving {
            let since = *running.faster.get_or_insert(scene.now);
            if scene.now.saturating_sub(since) > LASTING {
                let rpm = |speed: f64| speed * 60.0 / core::f64::consts::TAU;
                let (cause, begun) = (running.cause, running.begun);
                let (was, now) = (rpm(running.speed), rpm(speed));
                return Verdict::Broken(format!(
                    "stopped by {cause} at {begun} with {was:.1} rpm, the shaft has {now:.1} rpm"
                ));
            }
        } else {
            running.faster = None;
        }
        // A stop that has settled is over when something else moves the shaft: whoever stops it then is another matter.
        let settled = running.stood.is_some_and(|since| scene.now.saturating_sub(since) > SETTLING);
        if settled && !driving && speed > STANDSTILL.0 + STANDSTILL.1 * running.speed {
            self.running = None;
            return Verdict::Silent;
        }
        // What a load turns back, or a shaft that unwinds, is not the drive's doing.
        if !driving || way > running.furthest {
            running.furthest = running.furthest.max(way);
        }
        let back = running.furthest - way;
        if driving && back > BACK.0 + BACK.1 * (running.recent + running.added) / core::f64::consts::TAU {
            let (cause, begun) = (running.cause, running.begun);
            return Verdict::Broken(format!(
                "stopped by {cause} at {begun}, the shaft is turned back by {back:.4} revolutions"
            ));
        }
        if speed < STANDSTILL.0 + STANDSTILL.1 * running.speed {
            running.stood.get_or_insert(scene.now);
        }
        if let Some(deadline) = &mut running.deadline {
            if scene.is_at_its_limit() {
                *deadline += scene.sight.time.saturating_sub(scene.before.time);
            }
            if running.stood.is_none() && scene.now > *deadline {
                let (cause, begun, rpm) = (running.cause, running.begun, scene.sight.rpm());
                return Verdict::Broken(format!("stopped by {cause} at {begun}, it should stand and has {rpm:.1} rpm"));
            }
        }
        Verdict::Kept
    }
}

impl Law for Stop {
    fn sentence(&self) -> &'static str {
        "a stop never makes the shaft faster nor turns it back, and it stands when the deceleration says so"
    }

    fn judge(&mut self, event: &Event<'_>, scene: &Scene) -> Verdict {
        let wire = &scene.wire;
        let soon = scene.cycles(1, 500);
        match event {
            Event::Record if wire.phase == 4 => {
                let switched = |bit| wire.control_before & bit != 0 && wire.control & bit == 0;
                if wire.asks_to_follow() && !wire.has_error() && !self.lost {
                    self.running = None;
                } else if switched(control::ON) {
                    self.begin("bit 15", scene, soon);
                } else if switched(control::NO_HALT) && wire.asks_for_torque() {
                    self.begin("HALT", scene, soon);
                }
            }
            Event::Answer => {
                if wire.has_error() && !self.error {
                    self.begin("an error", scene, Nanoseconds::ZERO);
                }
                self.error = wire.has_error();
            }
            Event::Mst if wire.phase < 4 && wire.phase_before == 4 && wire.phase_since == scene.now => {
                self.begin("a phase change", scene, soon);
            }
            Event::Look => {
                let lost = wire.is_lost(scene.now, scene.cycle);
                if lost && !self.lost {
                    self.begin("a lost ring", scene, soon);
                }
                self.lost = lost;
                // With bits 15 and 14 and without an error a movement of the drive's own ends whatever stop there was.
                if scene.drive_moves_the_axis() && wire.asks_for_torque() && !wire.has_error() && !lost {
                    self.running = None;
                }
                return self.watch(scene);
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
    use crate::sight::Sight;

    const FOLLOW: u16 = 0xE000;
    const FOLLOWS: u16 = 0xC008;

    fn at_speed(velocity: f64) -> Fake {
        let mut fake = Fake::in_cp4(Stop::default());
        // 400 rad/s².
        fake.write(138, &[0x1A80, 6]);
        fake.cycle(0, 0x8000);
        fake.sight.bridge = true;
        fake.sight.machine.velocity = velocity;
        fake.run(5, FOLLOW, FOLLOWS);
        fake
    }

    fn torque(torque: f64) -> impl FnMut(&mut Sight) {
        move |sight| sight.machine.torque = torque
    }

    #[test]
    fn a_stop_on_its_ramp_keeps_it() {
        for (control, status) in [(0xC000, 0xC000), (0x6000, 0xC000), (FOLLOW, 0xE000)] {
            let mut fake = at_speed(100.0);
            // 250 ms.
            for _ in 0..125 {
                fake.turning(control, status, -400.0, torque(-60.0));
            }
            fake.sight.machine.velocity = 0.0;
            fake.run(200, control, status);
            assert_eq!(fake.broken(), None);
            assert!(fake.armed() > 1_000);
        }
    }

    #[test]
    fn a_stop_that_accelerates_first_breaks_it() {
        for (control, status) in [(0xC000, 0xC000), (0x6000, 0xC000), (FOLLOW, 0xE000)] {
            let mut fake = at_speed(5.0);
            for _ in 0..10 {
                fake.turning(control, status, 400.0, torque(60.0));
            }
            assert!(fake.broken().is_some_and(|words| words.contains("rpm, the shaft has")), "{control:x} {status:x}");
        }
    }

    #[test]
    fn a_stop_that_comes_back_breaks_it() {
        let stopped = |back: f64, motor: f64| {
            let mut fake = at_speed(20.0);
            for _ in 0..25 {
                fake.turning(0xC000, 0xC000, -400.0, torque(-60.0));
            }
            fake.sight.machine.velocity = -back;
            for _ in 0..20 {
                fake.turning(0xC000, 0xC000, 0.0, torque(motor));
            }
            fake.broken()
        };
        assert_eq!(stopped(4.0, -60.0), None, "0.16 rad come back");
        assert!(stopped(6.0, -60.0).is_some_and(|words| words.contains("turned back")), "0.24 rad come back");
        assert_eq!(stopped(5.0, 60.0), None, "a load does it");
    }

    #[test]
    fn a_loop_that_was_braking_before_the_stop_comes_back_from_the_speed_that_it_had() {
        let stopped = |before: f64, milliseconds: usize| {
            let mut fake = at_speed(before);
            for _ in 0..milliseconds / 2 {
                fake.turning(FOLLOW, FOLLOWS, (10.0 - before) / (milliseconds as f64 * 1e-3), torque(-60.0));
            }
            fake.sight.machine.velocity = 10.0;
            fake.run(1, 0xC000, 0xC000);
            fake.sight.machine.velocity = -5.0;
            for _ in 0..25 {
                fake.turning(0xC000, 0xC000, 0.0, torque(-60.0));
            }
            fake.broken()
        };
        assert!(stopped(10.0, 10).is_some_and(|words| words.contains("turned back")), "0.25 rad of 10 rad/s come back");
        assert_eq!(stopped(70.0, 10), None, "70 rad/s were braked within 10 ms");
        assert!(stopped(70.0, 60).is_some(), "what was braked long ago is forgotten");
    }

    #[test]
    fn a_speed_of_just_before_excuses_a_swing_back_and_no_swing_on() {
        // 100 rad/s (955 rpm) two milliseconds before the stop, which begins with 21 rad/s (200 rpm).
        let stopped = |after: f64| {
            let mut fake = at_speed(100.0);
            fake.sight.machine.velocity = 21.0;
            fake.run(1, FOLLOW, FOLLOWS);
            fake.run(2, 0xC000, 0xC000);
            fake.sight.machine.velocity = after;
            fake.sight.machine.torque = 60.0 * after.signum();
            fake.run(1, 0xC000, 0xC000);
            fake.broken()
        };
        assert!(stopped(31.3).is_some_and(|words| words.contains("the shaft has 298.9 rpm")), "{:?}", stopped(31.3));
        assert_eq!(stopped(-28.0), None, "267 rpm back");
        assert!(stopped(-50.0).is_some_and(|words| words.contains("the shaft has")), "477 rpm back");
    }

    #[test]
    fn a_load_that_breaks_away_after_the_stop_begins_another_one() {
        let caught = |rests: usize, load: f64| {
            let mut fake = at_speed(10.0);
            for _ in 0..12 {
                fake.turning(0xC000, 0xC000, -400.0, torque(-60.0));
            }
            fake.sight.machine.velocity = 0.0;
            fake.run(rests, 0xC000, 0xC000);
            for _ in 0..5 {
                fake.turning(0xC000, 0xC000, -1_500.0, torque(load));
            }
            // Caught, and a little too much of it.
            fake.sight.machine.velocity = 13.0;
            fake.sight.machine.torque = 10.0;
            fake.run(2, 0xC000, 0xA000);
            fake.broken()
        };
        assert_eq!(caught(50, 10.0), None);
        assert!(caught(10, 10.0).is_some_and(|words| words.contains("the shaft has")), "it has not settled yet");
        assert!(caught(50, -10.0).is_some_and(|words| words.contains("the shaft has")), "the motor does it");
    }

    #[test]
    fn a_movement_of_the_drives_own_ends_a_stop_of_bit_15_but_not_that_of_an_error() {
        for (status, starts, lawful) in [(0xC000, true, true), (0xC000, false, false), (0xE000, true, false)] {
            let mut fake = at_speed(20.0);
            for _ in 0..25 {
                fake.turning(0x6000, status, -400.0, torque(-60.0));
            }
            fake.run(5, 0xC000, status);
            if starts {
                fake.write(0x8000 | 225, &[3]);
            }
            fake.sight.machine.velocity = -6.0;
            for _ in 0..20 {
                fake.turning(0xC000, status, 0.0, torque(-60.0));
            }
            assert_eq!(fake.broken().is_none(), lawful, "{status:X} {starts}: {:?}", fake.broken());
        }
    }

    #[test]
    fn a_load_that_pulls_is_not_the_drives_doing() {
        let mut fake = at_speed(5.0);
        for _ in 0..10 {
            fake.turning(0xC000, 0xC000, 400.0, torque(-60.0));
        }
        assert_eq!(fake.broken(), None);
    }

    #[test]
    fn a_stop_without_an_end_breaks_it() {
        let mut fake = at_speed(100.0);
        fake.write(104, &[6_000]);
        fake.run(125 + 25, 0xC000, 0xC000);
        assert_eq!(fake.broken(), None);
        fake.run(70, 0xC000, 0xC000);
        assert!(fake.broken().is_some_and(|words| words.contains("it should stand")));
    }

    #[test]
    fn a_lost_ring_is_a_stop_too() {
        let mut fake = at_speed(5.0);
        fake.silence(3, 400.0, torque(60.0));
        assert_eq!(fake.broken(), None, "the drive is not sure yet");
        fake.silence(10, 400.0, torque(60.0));
        assert!(fake.broken().is_some_and(|words| words.contains("a lost ring")));
    }
}
