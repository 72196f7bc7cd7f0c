//! Torque, velocity, position and current stay within their limits, whoever asks.

use core::f64::consts::TAU;

use ring::Nanoseconds;
use ring::ident::Idn;
use ring::service_client::status;

use crate::lasting::Lasting;
use crate::law::{Event, Law, Verdict};
use crate::scene::{AMPLITUDE, Scene};

/// What the current loop overshoots, of the limit and of the amplifier's peak; it has settled within milliseconds.
const CURRENT: (f64, f64, Nanoseconds) = (1.1, 0.03, Nanoseconds::from_millis(5));
/// What the velocity loop overshoots, of the limit and in rad/s (10 rpm), and for how long.
const VELOCITY: (f64, f64, Nanoseconds) = (1.05, 1.0, Nanoseconds::from_millis(20));
/// A new limit, or another load, has its effect within this.
const GRACE: Nanoseconds = Nanoseconds::from_millis(300);
/// Beyond a position limit: what is more than the way of the stop, as a share, in seconds of the speed, and in revolutions.
const POSITION: (f64, f64, f64) = (1.3, 0.015, 0.03);
/// The share of the torque left that brakes; the loop controls with the rest.
const CONTROL: f64 = 0.8;

/// S-0-0092, 82, 83, 109 and 110.
#[derive(Default)]
pub(crate) struct Current(Lasting);

impl Law for Current {
    fn sentence(&self) -> &'static str {
        "torque and current stay within their limits, whoever asks"
    }

    fn judge(&mut self, event: &Event<'_>, scene: &Scene) -> Verdict {
        let (Event::Look, true) = (event, scene.sight.bridge) else { return Verdict::Silent };
        let wire = &scene.wire;
        let operates =
            wire.phase == 4 && status::readiness(wire.status) == 3 && !scene.deceived && !scene.outruns_its_motor();
        let q = scene.sight.machine.current[1];
        let limit = scene.is_positive(q, Idn(85)).and_then(|positive| scene.current_limit(positive));
        // A load that is stronger drives the shaft, and the current is what its rising voltage leaves of the limit.
        let driven = |limit: f64| scene.sight.machine.load_torque.abs() > limit * scene.torque_constant();
        // Limits of the MDT end where the drive stops by itself.
        let cyclic = [82, 83, 92].iter().any(|idn| wire.command(Idn(*idn)).is_some());
        let own_stop = cyclic && (!wire.asks_for_torque() || wire.has_error() || !scene.is_operating());
        let limit = limit.filter(|limit| !driven(*limit) && !own_stop);
        let (Some(limit), Some(peak), true) = (limit, scene.settings.unsigned(Idn(110)), operates) else {
            self.0.end();
            return Verdict::Silent;
        };
        let most = CURRENT.0 * limit + CURRENT.1 * peak as f64 * AMPLITUDE;
        Verdict::of(!self.0.lasts(q.abs() > most, scene.now, CURRENT.2), || {
            format!("{q:.2} A across the magnet, {limit:.2} A allowed")
        })
    }
}

/// S-0-0091, 38, 39 and 113.
#[derive(Default)]
pub(crate) struct Velocity(Lasting);

impl Velocity {
    /// In rad/s, for velocities of this sign.
    fn limit(scene: &Scene, positive: bool) -> Option<f64> {
        let units = scene.units?;
        let settings = &scene.settings;
        // S-0-0113 has rpm, whatever the scaling.
        let bipolar = (settings.unsigned(Idn(91))? as f64 * units.velocity)
            .min(settings.unsigned(Idn(113))? as f64 * 1e-4 / 60.0 * TAU);
        let side = |idn: u16| {
            let value = settings.signed(Idn(idn))?.unsigned_abs() as f64 * units.velocity;
            Some(if value == 0.0 { bipolar } else { value.min(bipolar) })
        };
        if positive { side(38) } else { side(39) }
    }
}

impl Law for Velocity {
    fn sentence(&self) -> &'static str {
        "velocity stays within its limits, whoever asks"
    }

    fn judge(&mut self, event: &Event<'_>, scene: &Scene) -> Verdict {
        let (Event::Look, true) = (event, scene.sight.bridge) else { return Verdict::Silent };
        let machine = &scene.sight.machine;
        // A shaft that another gear or scaling finds too fast is on its way.
        let known = scene.is_left_alone(GRACE) && !scene.within(scene.rezeroed, GRACE);
        let positive = scene.is_positive(machine.velocity, Idn(43)).filter(|_| known);
        let limit = positive.and_then(|positive| Self::limit(scene, positive));
        let Some(limit) = limit else {
            self.0.end();
            return Verdict::Silent;
        };
        // What is slowed down, or driven by its load, is not driven beyond its limit.
        let driven = machine.torque * machine.velocity > 0.0;
        let fast = machine.velocity.abs() > VELOCITY.0 * limit + VELOCITY.1;
        Verdict::of(!self.0.lasts(driven && fast, scene.now, VELOCITY.2), || {
            format!("{:.1} rpm, {:.1} rpm allowed", scene.sight.rpm(), limit * 60.0 / TAU)
        })
    }
}

/// S-0-0049 and 50 of an axis that is homed, with bit 4 of S-0-0055.
#[derive(Default)]
pub(crate) struct PositionLimits {
    beyond: Option<Beyond>,
}

/// An axis beyond its limit.
struct Beyond {
    /// Where the shaft was when it passed the limit, or was found beyond it, in revolutions.
    from: f64,
    since: Nanoseconds,
    /// When it was last looked at.
    seen: Nanoseconds,
    /// The speed in rad/s that it may still have.
    speed: f64,
    /// The way in revolutions that it may have come by now.
    way: f64,
}

impl Law for PositionLimits {
    fn sentence(&self) -> &'static str {
        "position stays within its limits, whoever asks"
    }

    fn judge(&mut self, event: &Event<'_>, scene: &Scene) -> Verdict {
        let Event::Answer = event else { return Verdict::Silent };
        let settings = &scene.settings;
        let acts = settings.word(Idn(55)).is_some_and(|word| word & 0x10 != 0)
            && scene.units.is_some_and(|units| !units.is_modulo);
        let referenced = scene.wire.feedback(Idn(403)).or_else(|| settings.word(Idn(403)).map(u32::from)) == Some(1);
        let homing = scene.command.is_some_and(|idn| matches!(idn.0, 148 | 447 | 191));
        let known =
            scene.position_feedback().zip(settings.signed(Idn(49))).zip(settings.signed(Idn(50))).zip(scene.sense());
        let alone = scene.is_left_alone(GRACE) && !scene.within(scene.overpowered, GRACE);
        let sees = acts && referenced && !homing && alone && scene.wire.phase == 4 && scene.sight.bridge;
        let Some((((position, high), low), sense)) = known.filter(|_| sees) else {
            *self = Self::default();
            return Verdict::Silent;
        };
        let out = if position > high as f64 {
            1.0
        } else if position < low as f64 {
            -1.0
        } else {
            0.0
        };
        if out == 0.0 {
            *self = Self::default();
            return Verdict::Kept;
        }
        let machine = &scene.sight.machine;
        let now = scene.now;
        let beyond = self.beyond.get_or_insert_with(|| {
            // Whoever is caught outside, or passes the limit, is stopped.
            let speed = machine.velocity.abs();
            Beyond { from: machine.angle, since: now, seen: now, speed, way: 0.0 }
        });
        let ramp = settings.unsigned(Idn(138)).unwrap_or(1).max(1) as f64
            * scene.units.map_or(1.0, |units| units.acceleration);
        // The motor brakes with what its limits leave it, and these may change on the way.
        let left = scene.is_positive(-sense * out, Idn(85)).and_then(|positive| scene.deceleration_left(positive));
        let ramp = left.map_or(ramp, |left| ramp.min(CONTROL * left));
        let span = now.saturating_sub(beyond.seen).as_seconds();
        beyond.seen = now;
        let before = beyond.speed;
        if now.saturating_sub(beyond.since).as_seconds() > POSITION.1 + 3.0 * scene.cycle.as_seconds() {
            beyond.speed = (beyond.speed - ramp / POSITION.0 * span).max(0.0);
        }
        beyond.way += 0.5 * (before + beyond.speed) * span / TAU;
        let (from, allowed) = (beyond.from, beyond.way + POSITION.2);
        let further = (machine.angle - from) * sense * out;
        Verdict::of(further <= allowed, || {
            format!("S-0-0051 is {position}, {further:.3} revolutions beyond the limit, {allowed:.3} allowed")
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::fake::Fake;

    #[test]
    fn current_and_velocity_beyond_their_limits_for_long_break_it() {
        for (current, lawful) in [(20.0, true), (-20.0, true), (30.0, false), (-30.0, false)] {
            let mut fake = Fake::in_cp4(Current::default());
            // The defaults: 14.1 A RMS of peak, 200 % of 3.5 A; here 400 %.
            fake.write(92, &[4_000]);
            fake.sight.bridge = true;
            fake.sight.machine.current = [0.0, current];
            fake.run(10, 0xE000, 0xC008);
            assert_eq!(fake.broken().is_none(), lawful, "{current}");
        }
        for (rpm, torque, lawful) in
            [(3_050.0, 1.0, true), (3_400.0, 1.0, false), (-3_400.0, -1.0, false), (3_400.0, -1.0, true)]
        {
            let mut fake = Fake::in_cp4(Velocity::default());
            fake.sight.bridge = true;
            fake.sight.machine.velocity = rpm / 60.0 * TAU;
            fake.sight.machine.torque = torque;
            fake.run(20, 0xE000, 0xC008);
            assert_eq!(fake.broken().is_none(), lawful, "{rpm}");
        }
    }

    #[test]
    fn a_limit_of_one_direction_counts_in_it() {
        for (rpm, lawful) in [(100.0, true), (-100.0, false)] {
            let mut fake = Fake::in_cp4(Velocity::default());
            let limit = -500_000_i32;
            fake.write(39, &[limit as u16, (limit >> 16) as u16]);
            fake.sight.bridge = true;
            fake.sight.machine.velocity = rpm / 60.0 * TAU;
            fake.sight.machine.torque = rpm;
            fake.run(20, 0xE000, 0xC008);
            assert_eq!(fake.broken().is_none(), lawful, "{rpm}");
        }
    }

    #[test]
    fn a_limit_turns_round_with_its_polarity() {
        for (polarity, rpm, lawful) in [(0, 100.0, true), (0, -100.0, false), (7, 100.0, false), (7, -100.0, true)] {
            let mut fake = Fake::in_cp4(Velocity::default());
            let limit = -500_000_i32;
            fake.write(39, &[limit as u16, (limit >> 16) as u16]);
            fake.write(43, &[polarity]);
            fake.sight.bridge = true;
            fake.sight.machine.velocity = rpm / 60.0 * TAU;
            fake.sight.machine.torque = rpm;
            fake.run(20, 0xE000, 0xC008);
            assert_eq!(fake.broken().is_none(), lawful, "{polarity} {rpm}");
            let mut fake = Fake::in_cp4(Current::default());
            fake.write(83, &[-500_i16 as u16]);
            fake.write(85, &[polarity]);
            fake.sight.bridge = true;
            fake.sight.machine.current = [0.0, rpm / 20.0];
            fake.run(20, 0xE000, 0xC008);
            assert_eq!(fake.broken().is_none(), lawful, "{polarity} {rpm}");
        }
    }

    #[test]
    fn an_axis_that_is_caught_beyond_its_limit_is_stopped_there() {
        for (acceleration, lawful) in [(-1_000.0, true), (0.0, false)] {
            let mut fake = Fake::in_cp4(PositionLimits::default());
            fake.settle_limits(1_000_000);
            fake.sight.machine.velocity = 100.0;
            for cycle in 0..60 {
                fake.sight.bridge = cycle > 10;
                let shown = (fake.angle_before() * 3_600_000.0) as i32 + 1_000_001;
                fake.data[1] = shown.to_le_bytes().to_vec();
                let braked = fake.sight.bridge && fake.sight.machine.velocity > 0.0;
                fake.turning(0xE000, 0xC008, if braked { acceleration } else { 0.0 }, |_| {});
            }
            assert_eq!(fake.broken().is_none(), lawful, "{:?}", fake.broken());
        }
    }

    #[test]
    fn an_axis_goes_as_far_beyond_its_limit_as_the_torque_left_to_it_takes() {
        // S-0-0083 in 0.1 % of 3.536 A RMS leaves 0.8 * 1.9 Nm/A * 5 A a per mille to the press's 0.16 kg m2: 48 rad/s2 a thousand, or nothing.
        // With a limit that comes back after 40 cycles the axis has the rest of the way to stand.
        for (left, back_after, deceleration, lawful) in [
            (-32_767_i16, None, 0.0, false),
            (0, None, 0.0, true),
            (-1_000, None, -45.0, true),
            (-1_000, None, -20.0, false),
            (0, Some(40), 0.0, false),
        ] {
            let mut fake = Fake::in_cp4(PositionLimits::default());
            fake.settle_limits(1_000_000);
            fake.write(83, &[left as u16]);
            fake.sight.bridge = true;
            fake.sight.machine.velocity = 20.0;
            for cycle in 0..600 {
                if back_after == Some(cycle) {
                    fake.write(83, &[-32_767_i16 as u16]);
                }
                let shown = (fake.angle_before() * 3_600_000.0) as i32;
                fake.data[1] = shown.to_le_bytes().to_vec();
                let braked = shown > 1_000_000 && fake.sight.machine.velocity > 0.0;
                fake.turning(0xE000, 0xC008, if braked { deceleration } else { 0.0 }, |_| {});
            }
            assert_eq!(fake.broken().is_none(), lawful, "{left} {back_after:?} {deceleration}: {:?}", fake.broken());
        }
    }

    #[test]
    fn currents_that_the_magnets_drive_beyond_the_voltage_of_the_link_are_no_currents_of_the_drive() {
        // 1.27 Vs of the magnets over all pole pairs, of which 7 A of weakening take 0.1, and 300 V that the bridge reaches.
        for (rpm, lawful) in [(1_500.0, false), (2_350.0, false), (3_000.0, true)] {
            let mut fake = Fake::in_cp4(Current::default());
            fake.write(113, &[0xFFFF, 0x7FFF]);
            fake.sight.bridge = true;
            fake.sight.machine.velocity = rpm / 60.0 * TAU;
            fake.sight.machine.current = [0.0, 30.0];
            fake.run(10, 0xE000, 0xC008);
            assert_eq!(fake.broken().is_none(), lawful, "{rpm}: {:?}", fake.broken());
        }
    }

    #[test]
    fn an_axis_that_goes_on_beyond_its_position_limit_breaks_it() {
        for (brakes, lawful) in [(true, true), (false, false)] {
            let mut fake = Fake::in_cp4(PositionLimits::default());
            fake.settle_limits(1_000_000);
            fake.sight.bridge = true;
            fake.sight.machine.velocity = 10.0;
            for _ in 0..200 {
                let shown = (fake.angle_before() * 3_600_000.0) as i32;
                fake.data[1] = shown.to_le_bytes().to_vec();
                let beyond = brakes && shown > 1_000_000 && fake.sight.machine.velocity > 0.0;
                fake.turning(0xE000, 0xC008, if beyond { -1_000.0 } else { 0.0 }, |_| {});
            }
            assert_eq!(fake.broken().is_none(), lawful, "{:?}", fake.broken());
        }
    }
}
