//! What is followed starts at the shaft, and no step of a command is followed that the velocity limit does not allow.

use ring::Nanoseconds;
use ring::ident::Idn;
use ring::service_client::status;

use crate::lasting::Lasting;
use crate::law::{Event, Law, Verdict};
use crate::scene::Scene;

/// A step of S-0-0047 that is so many times what S-0-0091 allows in a cycle of the control unit is a jump.
const JUMP: f64 = 2.0;
/// The shaft must not get faster for so long after one; by then the error has stopped it.
const WATCH: Nanoseconds = Nanoseconds::from_millis(100);
/// What a shaft may have on top of the speed that it had: a share, rad/s, and the acceleration of the moment for so long.
const TOLERANCE: (f64, f64, f64) = (0.05, 0.5, 2e-3);
const LASTING: Nanoseconds = Nanoseconds::from_millis(1);

/// In rad/s.
const STANDSTILL: f64 = 0.3;
/// Neither the torque nor the brake has to come for such a command.
const AWAY: &str = "the command is away from S-0-0051";

/// Watches what a jump of the command does to the shaft.
#[derive(Default)]
pub(crate) struct Following {
    command: Option<(f64, Nanoseconds)>,
    jump: Option<Jump>,
}

struct Jump {
    since: Nanoseconds,
    what: &'static str,
    increments: f64,
    speed: f64,
    faster: Lasting,
}

impl Following {
    fn record(&mut self, scene: &Scene) {
        let wire = &scene.wire;
        let (Some(units), Some(command)) = (scene.units, scene.position_command()) else {
            *self = Self::default();
            return;
        };
        let before = self.command.replace((command, scene.now));
        let moves = scene.drive_moves_the_axis();
        let position = scene.asks_for_position() && scene.asked_mode() == scene.actual_mode();
        if wire.phase != 4 || !wire.asks_to_follow() || wire.has_error() || moves || !position {
            self.jump = None;
            return;
        }
        let limit = scene.settings.unsigned(Idn(91)).map(|limit| limit as f64 * units.velocity);
        let window = scene.settings.unsigned(Idn(159)).unwrap_or(0) as f64;
        let step = limit.zip(before).map(|(limit, (from, then))| {
            let unit = scene.settings.word(Idn::CONTROL_UNIT_CYCLE).unwrap_or(2_000);
            let cycle = Nanoseconds::from_microseconds(unit.into()).0.max(scene.cycle.0).max((scene.now - then).0);
            let step = units.way(from, command);
            let allowed = JUMP * limit / core::f64::consts::TAU * units.increments * cycle as f64 * 1e-9;
            // Commands are whole increments, two of them with S-0-0048.
            (step, step.abs() > allowed + 2.0 * scene.quantum(&units).max(1.0))
        });
        let far = if wire.follows() {
            let Some((step, jumps)) = step else { return };
            jumps.then_some(("the command steps", step))
        } else {
            let Some(feedback) = scene.position_feedback().filter(|_| window > 0.0) else { return };
            // With following distance a shaft that turns is where it belongs when it is behind by its lag.
            let Some(kv) = scene.settings.unsigned(Idn(104)).map(|kv| kv.max(1) as f64 / 6.0) else { return };
            let speed = scene.sense().unwrap_or(0.0) * scene.sight.machine.velocity / core::f64::consts::TAU;
            let lag = if scene.asked_mode() == Some(3) { speed * units.increments / kv } else { 0.0 };
            let distance = units.way(feedback + lag, command);
            let turning = scene.sight.machine.velocity.abs() * units.increments * 3.0 * scene.cycle.as_seconds();
            // Since the last AT the drive may have begun to follow, with the command before this one.
            let way = step.filter(|(_, jumps)| !jumps).map_or(0.0, |(step, _)| step.abs());
            (distance.abs() > 1.05 * window + turning + way).then_some((AWAY, distance))
        };
        match far {
            Some((what, increments)) if self.jump.is_none() => {
                let speed = scene.sight.machine.velocity.abs();
                self.jump = Some(Jump { since: scene.now, what, increments, speed, faster: Lasting::default() });
            }
            // A command that has come back before anything followed it is no jump any more.
            None if !wire.follows() => self.jump = None,
            _ => {}
        }
    }

    fn look(&mut self, scene: &Scene) -> Verdict {
        let Some(jump) = &mut self.jump else { return Verdict::Silent };
        // A shaft that turns may be behind its command by what its loop lags.
        let stands = scene.sight.machine.velocity.abs() < STANDSTILL;
        if jump.what == AWAY && stands && scene.sight.bridge && !scene.before.bridge {
            let (increments, since) = (jump.increments, jump.since);
            return Verdict::Broken(format!(
                "the command is away from S-0-0051 by {increments:.0} increments since {since}, and the bridge comes on for it"
            ));
        }
        let machine = &scene.sight.machine;
        let over = scene.now.saturating_sub(jump.since) > WATCH && scene.wire.follows();
        // A far command waits for the bridge, which must not come.
        let gone = !scene.sight.bridge && jump.what != AWAY;
        if over || gone || !scene.is_left_alone(WATCH) {
            self.jump = None;
            return Verdict::Silent;
        }
        let span = scene.sight.time.saturating_sub(scene.before.time).as_seconds();
        let soon = scene.now.saturating_sub(jump.since) <= scene.cycles(1, 500);
        if soon && span > 0.0 {
            // Until t3 it does what it did.
            let acceleration = (machine.velocity - scene.before.machine.velocity).abs() / span;
            jump.speed = jump.speed.max(machine.velocity.abs() + acceleration * TOLERANCE.2);
        }
        if status::readiness(scene.wire.status) != 3 {
            return Verdict::Silent;
        }
        let fast = machine.velocity.abs() > jump.speed * (1.0 + TOLERANCE.0) + TOLERANCE.1;
        let driven = machine.torque * machine.velocity > 0.0;
        Verdict::of(!jump.faster.lasts(fast && driven, scene.now, LASTING), || {
            let (what, increments, since) = (jump.what, jump.increments, jump.since);
            format!(
                "{what} by {increments:.0} increments at {since}, and the shaft follows with {:.1} rpm",
                scene.sight.rpm()
            )
        })
    }
}

impl Law for Following {
    fn sentence(&self) -> &'static str {
        "what is followed starts at the shaft, and no jump of a command is followed"
    }

    fn judge(&mut self, event: &Event<'_>, scene: &Scene) -> Verdict {
        match event {
            Event::Record => {
                self.record(scene);
                Verdict::Silent
            }
            Event::Look => self.look(scene),
            _ => Verdict::Silent,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::fake::Fake;

    /// HALT, and then S-0-0047 as it is given, the shaft accelerated.
    fn released(command: i32, acceleration: f64) -> Fake {
        let mut fake = Fake::in_cp4(Following::default());
        fake.write(32, &[11]);
        fake.cycle(0, 0x8000);
        fake.sight.bridge = true;
        fake.sight.machine.torque = 60.0;
        fake.run(5, 0xC000, 0xC000);
        fake.data[0] = command.to_le_bytes().to_vec();
        fake.cycle(0xE000, 0xC000);
        for _ in 0..10 {
            fake.turning(0xE000, 0xC008, acceleration, |_| {});
        }
        fake
    }

    #[test]
    fn a_command_within_the_window_may_be_followed_and_one_beyond_it_not() {
        assert_eq!(released(100_000, 400.0).broken(), None);
        assert_eq!(released(3_600_000, 0.0).broken(), None);
        assert!(released(3_600_000, 400.0).broken().is_some_and(|words| words.contains("away from S-0-0051")));
    }

    #[test]
    fn an_axis_far_from_its_command_stays_off() {
        for (command, lawful) in [(100_000_i32, true), (3_600_000, false)] {
            let mut fake = Fake::in_cp4(Following::default());
            fake.write(32, &[11]);
            fake.data[0] = command.to_le_bytes().to_vec();
            fake.run(5, 0, 0x8000);
            fake.run(2, 0xE000, 0x8000);
            fake.sight.bridge = true;
            fake.run(5, 0xE000, 0x8000);
            assert_eq!(fake.broken().is_none(), lawful, "{:?}", fake.broken());
        }
    }

    #[test]
    fn a_step_in_operation_is_not_followed() {
        for (step, lawful) in [(300_000, true), (3_600_000, false)] {
            let mut fake = released(0, 0.0);
            fake.data[0] = i32::to_le_bytes(step).to_vec();
            for _ in 0..10 {
                fake.turning(0xE000, 0xC008, 400.0, |_| {});
            }
            assert_eq!(fake.broken().is_none(), lawful, "{:?}", fake.broken());
        }
    }
}
