//! Nothing moves by itself beyond what was commanded.

use core::f64::consts::TAU;
use std::collections::VecDeque;

use ring::Nanoseconds;
use ring::ident::Idn;
use ring::service_client::status;

use crate::lasting::Lasting;
use crate::law::{Event, Law, Verdict};
use crate::scene::Scene;

/// After a change of the load nothing is asked for so long.
const GRACE: Nanoseconds = Nanoseconds::from_millis(500);
/// It is no overshoot that lasts longer.
const LASTING: Nanoseconds = Nanoseconds::from_millis(20);
/// Beyond the commanded way the shaft may be so far, in revolutions, and as far as S-0-0159 allows.
const SLACK: f64 = 0.02;
/// Without S-0-0159 nobody says how far it may be; it is not a revolution.
const UNMONITORED: f64 = 1.0;
/// Seconds in which a shaft that turns comes to what is commanded.
const CATCHING_UP: f64 = 0.05;
/// Beyond the commanded velocity: a share, and rad/s (20 rpm).
const OVERSHOOT: (f64, f64) = (1.1, 2.0);
/// A halted axis that has stood for so long stays where it is, within so many revolutions.
const HELD: (Nanoseconds, f64) = (Nanoseconds::from_millis(300), 0.01);

/// Adds up what is commanded.
#[derive(Default)]
pub(crate) struct NothingMoves {
    followed: Followed,
    outside: Lasting,
    driven: Driven,
    standing: Lasting,
    held: Option<f64>,
}

/// What the motor does to a shaft that is outside.
#[derive(Default)]
struct Driven {
    /// Since when, and the work of each look since then in J, of the last [`LASTING`].
    since: Option<Nanoseconds>,
    works: VecDeque<(Nanoseconds, f64)>,
}

impl Driven {
    /// Whether it has been outside for longer than [`LASTING`], and the motor has driven it there in the mean of that time.
    fn lasts(&mut self, outside: bool, work: f64, now: Nanoseconds) -> bool {
        if !outside {
            *self = Self::default();
            return false;
        }
        let since = *self.since.get_or_insert(now);
        self.works.push_back((now, work));
        while self.works.front().is_some_and(|(then, _)| now.saturating_sub(*then) > LASTING) {
            let _ = self.works.pop_front();
        }
        now.saturating_sub(since) > LASTING && self.works.iter().map(|(_, work)| work).sum::<f64>() > 0.0
    }
}

/// What has been commanded since the drive began to follow.
#[derive(Default)]
enum Followed {
    #[default]
    Nothing,
    /// Where the shaft was in revolutions, the last S-0-0047, and from there the command in revolutions: now, lowest, highest.
    Position { start: f64, last: f64, way: f64, low: f64, high: f64 },
    /// The highest speed so far in rad/s.
    Velocity(f64),
}

impl NothingMoves {
    fn record(&mut self, scene: &Scene) {
        let wire = &scene.wire;
        let moves = scene.drive_moves_the_axis();
        let steady = scene.is_operating() && wire.asks_to_follow() && wire.follows() && !wire.has_error() && !moves;
        let same = wire.control_before & 0x0B00 == wire.control & 0x0B00 && scene.asked_mode() == scene.actual_mode();
        let alone = scene.is_left_alone(GRACE) && !scene.within(scene.overpowered, GRACE);
        let known = scene.units.zip(scene.sense()).filter(|_| steady && same && alone);
        let Some((units, sense)) = known else {
            self.followed = Followed::Nothing;
            self.outside.end();
            self.driven = Driven::default();
            return;
        };
        let machine = &scene.sight.machine;
        match (scene.asked_mode(), scene.position_command(), &mut self.followed) {
            (Some(3 | 4 | 11 | 12), Some(command), Followed::Position { last, way, low, high, .. }) => {
                *way += sense * units.way(*last, command) / units.increments;
                *last = command;
                (*low, *high) = (low.min(*way), high.max(*way));
            }
            (Some(3 | 4 | 11 | 12), Some(command), followed) => {
                let Some(feedback) = scene.position_feedback() else { return };
                let increments = units.way(feedback, command);
                // The shaft is so far behind that nobody can tell in which turn of the data.
                if units.is_modulo && increments.abs() > units.modulo / 4.0 {
                    return;
                }
                let way = sense * increments / units.increments;
                // What turns already, after a cycle without a command, needs a way to come back.
                let going = machine.velocity / TAU * CATCHING_UP;
                let (low, high) = (way.min(going).min(0.0), way.max(going).max(0.0));
                *followed = Followed::Position { start: machine.angle, last: command, way, low, high };
            }
            (Some(2), ..) => {
                let value = |idn: Idn| {
                    wire.command(idn)
                        .map_or_else(|| scene.settings.signed(idn).unwrap_or(0), |raw| i64::from(raw.cast_signed()))
                };
                let speed = (value(Idn(36)).abs() + value(Idn(37)).abs()) as f64 * units.velocity;
                if let Followed::Velocity(most) = &mut self.followed {
                    *most = most.max(speed);
                } else {
                    self.followed = Followed::Velocity(speed.max(machine.velocity.abs()));
                }
            }
            _ => self.followed = Followed::Nothing,
        }
    }

    fn follow(&mut self, scene: &Scene) -> Verdict {
        // Without a new command the drive goes on with the old one, and then stops: that is the law of stops.
        if scene.now.saturating_sub(scene.wire.mdt.min(scene.wire.mst)) > scene.cycles(1, 500) || !scene.is_operating()
        {
            self.followed = Followed::Nothing;
            self.outside.end();
            self.driven = Driven::default();
        }
        let machine = &scene.sight.machine;
        match self.followed {
            Followed::Nothing => Verdict::Silent,
            Followed::Velocity(most) => {
                let fast = machine.velocity.abs() > OVERSHOOT.0 * most + OVERSHOOT.1
                    && machine.torque * machine.velocity > 0.0;
                Verdict::of(!self.outside.lasts(fast, scene.now, LASTING), || {
                    format!(
                        "{:.1} rpm, and never more than {:.1} rpm were commanded",
                        scene.sight.rpm(),
                        most * 60.0 / TAU
                    )
                })
            }
            Followed::Position { start, low, high, .. } => {
                let Some(units) = scene.units else { return Verdict::Silent };
                let window = scene.settings.unsigned(Idn(159)).unwrap_or(0) as f64 / units.increments;
                let window = SLACK + if window > 0.0 { window } else { UNMONITORED };
                let turned = machine.angle - start;
                // Nor does anybody stop a shaft that runs on with its inertia: the motor brakes it with all its torque.
                let monitored = scene.settings.unsigned(Idn(159)).unwrap_or(0) > 0;
                let outside = turned < low - window || turned > high + window;
                let broken = if monitored {
                    self.outside.lasts(outside, scene.now, LASTING)
                } else {
                    let seconds = scene.sight.time.saturating_sub(scene.before.time).as_seconds();
                    self.driven.lasts(outside, machine.torque * machine.velocity * seconds, scene.now)
                };
                Verdict::of(!broken, || {
                    format!(
                        "the shaft is {turned:.3} revolutions from where it began, commanded were {low:.3} to {high:.3}"
                    )
                })
            }
        }
    }

    fn hold(&mut self, scene: &Scene) -> Verdict {
        let wire = &scene.wire;
        let moves = scene.drive_moves_the_axis();
        let halted =
            scene.is_operating() && wire.asks_for_torque() && !wire.asks_to_follow() && !wire.has_error() && !moves;
        let machine = &scene.sight.machine;
        if !halted
            || !scene.sight.bridge
            || status::readiness(wire.status) != 3
            || !scene.is_left_alone(GRACE)
            || scene.is_at_its_limit()
        {
            self.held = None;
            self.standing.end();
            return Verdict::Silent;
        }
        let Some(held) = self.held else {
            if self.standing.lasts(machine.velocity.abs() < 0.1, scene.now, HELD.0) {
                self.held = Some(machine.angle);
            }
            return Verdict::Silent;
        };
        let off = machine.angle - held;
        Verdict::of(off.abs() <= HELD.1, || format!("halted, the shaft has moved by {off:.4} revolutions"))
    }
}

impl Law for NothingMoves {
    fn sentence(&self) -> &'static str {
        "nothing moves by itself beyond what was commanded"
    }

    fn judge(&mut self, event: &Event<'_>, scene: &Scene) -> Verdict {
        match event {
            Event::Record => {
                self.record(scene);
                Verdict::Silent
            }
            Event::Look if scene.sight.bridge => match self.follow(scene) {
                Verdict::Silent => self.hold(scene),
                verdict => verdict,
            },
            _ => Verdict::Silent,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::fake::Fake;

    fn following(mode: u16) -> Fake {
        let mut fake = Fake::in_cp4(NothingMoves::default());
        fake.write(32, &[mode]);
        fake.cycle(0, 0x8000);
        fake.sight.bridge = true;
        fake.sight.machine.torque = 10.0;
        fake.run(5, 0xE000, 0xC008);
        fake
    }

    /// The command goes up by a tenth of a revolution a cycle and over the border of 32 bits; the shaft goes with it, or back.
    fn over_the_border(sense: f64) -> Fake {
        let mut fake = following(11);
        let mut command = i32::MAX - 1_800_000;
        fake.cycle(0xC000, 0xC000);
        fake.sight.machine.velocity = 0.0;
        fake.data = [command.to_le_bytes().to_vec(), command.to_le_bytes().to_vec()];
        fake.run(3, 0xE000, 0xC008);
        fake.sight.machine.velocity = sense * 0.1 / 2e-3 * TAU;
        for _ in 0..60 {
            command = command.wrapping_add(360_000);
            fake.data = [command.to_le_bytes().to_vec(), command.to_le_bytes().to_vec()];
            fake.cycle(0xE000, 0xC008);
        }
        fake
    }

    #[test]
    fn a_small_step_over_the_border_is_a_small_step() {
        assert_eq!(over_the_border(1.0).broken(), None);
        assert!(over_the_border(1.0).armed() > 100);
        assert!(over_the_border(-1.0).broken().is_some_and(|words| words.contains("commanded were")));
    }

    #[test]
    fn an_axis_at_rest_stays_there() {
        let mut fake = following(11);
        fake.run(200, 0xE000, 0xC008);
        assert_eq!(fake.broken(), None);
        fake.sight.machine.velocity = 10.0;
        fake.run(200, 0xE000, 0xC008);
        assert!(fake.broken().is_some());
        let mut fake = following(2);
        fake.sight.machine.velocity = 10.0;
        fake.run(200, 0xE000, 0xC008);
        assert!(fake.broken().is_some_and(|words| words.contains("never more than 0.0 rpm")));
    }

    #[test]
    fn without_s_0_0159_a_shaft_that_runs_on_is_nobodys_doing_and_one_that_is_driven_on_is_the_drives() {
        for (monitored, torque, lawful) in [(0, -10.0, true), (0, 10.0, false), (300, -10.0, false)] {
            let mut fake = following(11);
            fake.write(159, &[monitored, 0]);
            fake.cycle(0xC000, 0xC000);
            fake.run(3, 0xE000, 0xC008);
            fake.sight.machine.velocity = 50.0;
            fake.sight.machine.torque = torque;
            fake.run(150, 0xE000, 0xC008);
            assert_eq!(fake.broken().is_none(), lawful, "{monitored} {torque}: {:?}", fake.broken());
        }
    }

    #[test]
    fn without_s_0_0159_a_shaft_that_is_driven_on_more_than_it_is_braked_is_the_drives_doing() {
        // The motor drives and brakes it in turn, every millisecond.
        for (driving, braking, lawful) in [(10.0, 5.0, false), (5.0, 10.0, true)] {
            let mut fake = following(11);
            fake.write(159, &[0, 0]);
            fake.cycle(0xC000, 0xC000);
            fake.run(3, 0xE000, 0xC008);
            fake.sight.machine.velocity = 50.0;
            for _ in 0..150 {
                let mut look = 0;
                fake.turning(0xE000, 0xC008, 0.0, |sight| {
                    sight.machine.torque = if look % 32 < 16 { driving } else { -braking };
                    look += 1;
                });
            }
            assert_eq!(fake.broken().is_none(), lawful, "{driving} {braking}: {:?}", fake.broken());
        }
    }

    #[test]
    fn what_a_load_does_to_a_motor_that_may_not_hold_it_is_not_the_drives_doing() {
        // 9 Nm on 1.9 Nm/A and 25 A or none.
        for (percent, lawful) in [(0, true), (2_000, false)] {
            let mut fake = Fake::in_cp4(NothingMoves::default());
            fake.write(32, &[11]);
            fake.write(92, &[percent]);
            fake.sight.machine.load_torque = -9.0;
            fake.cycle(0, 0x8000);
            fake.sight.bridge = true;
            fake.run(300, 0xE000, 0xC008);
            fake.sight.machine.velocity = -10.0;
            fake.run(600, 0xE000, 0xC008);
            assert_eq!(fake.broken().is_none(), lawful, "{percent}: {:?}", fake.broken());
        }
    }

    #[test]
    fn a_halted_axis_is_held() {
        let mut fake = following(2);
        fake.run(300, 0xC000, 0xC000);
        assert_eq!(fake.broken(), None);
        fake.sight.machine.velocity = 0.5;
        fake.run(200, 0xC000, 0xC000);
        assert!(fake.broken().is_some_and(|words| words.contains("halted")));
    }
}
