//! Torque commands up to a velocity limit: where the command is held back, and by how much.
//!
//! Near the limit no more current is given than what carries the load and what the proportional gain of the velocity loop makes of the distance
//! from the limit. A shaft that nothing holds comes to the limit along the time constant of that loop, and does not pass it. The velocity loop
//! itself would pass it by two thirds of what the shaft gains within that time, because its integral part begins with the torque of the command: of
//! a light shaft that is as much as the limit.
//!
//! What carries the load is what makes the shaft no faster: the current, less the gain times what the shaft has gained within the time constant,
//! both smoothed over that. The time constant is taken to be half of the integral action time: twice what [`velocity_gains`] makes of it, and what
//! tighter loops have. One that is shorter meets the limit sooner than it had to; one that is twice as long passes it by an eighth of the way from
//! where it was met.
//!
//! [`velocity_gains`]: crate::axis::velocity_gains

use crate::axis::limits::TorqueLimits;
use crate::axis::velocity_loop::VelocityLoopSettings;
use crate::units::{CurrentFraction, Velocity};

/// State of the guard.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub(crate) struct VelocityGuard {
    /// The velocity, smoothed.
    behind: Velocity,
    /// The current, smoothed, 2^-30 of peak.
    flowing: i32,
}

/// What the guard gives in a tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Guarded {
    /// The current.
    pub(crate) current: CurrentFraction,
    /// It is less than what was wanted.
    pub(crate) is_held: bool,
    /// What the next mode is to begin with.
    pub(crate) lasting: CurrentFraction,
}

impl VelocityGuard {
    /// Of a shaft that turns at this velocity, with a load that is carried by this current.
    pub(crate) const fn new(velocity: Velocity, carried: CurrentFraction) -> Self {
        Self { behind: velocity, flowing: (carried.to_bits() as i32) << 15 }
    }

    /// One tick: the current that is wanted, or less where it would take the shaft beyond the velocity `limit`; it brakes a shaft that is beyond it.
    pub(crate) fn tick(
        &mut self,
        settings: &VelocityLoopSettings,
        limits: &TorqueLimits,
        [limit, measured]: [Velocity; 2],
        wanted: CurrentFraction,
    ) -> Guarded {
        let shift = settings.time_constant();
        self.behind = Velocity::from_bits(towards(self.behind.to_bits(), measured.to_bits(), shift));
        let asked = i32::from(wanted.to_bits());
        // The gain's products have 2^-25 of peak and are within 16 peaks.
        let accelerating = settings.current_for((measured - self.behind).to_bits()) >> 10;
        let carried = (self.flowing >> 15).saturating_sub(accelerating).clamp(asked.min(0), asked.max(0));
        let allowed = carried.saturating_add(settings.current_for((limit - measured).to_bits()) >> 10);
        let is_held = if asked >= 0 { allowed < asked } else { allowed > asked };
        let current = if is_held { limits.apply(fraction(allowed)).0 } else { wanted };
        // Currents are within half of the range: no difference of two passes it.
        self.flowing = towards(self.flowing, i32::from(current.to_bits()) << 15, shift);
        let lasting = if is_held { fraction(self.flowing >> 15) } else { wanted };
        Guarded { current, is_held, lasting }
    }
}

fn fraction(bits: i32) -> CurrentFraction {
    CurrentFraction::from_bits(bits.clamp(i16::MIN.into(), i16::MAX.into()) as i16)
}

/// A value that follows another within 2^`shift` ticks.
pub(crate) const fn towards(from: i32, to: i32, shift: u32) -> i32 {
    from.wrapping_add(to.wrapping_sub(from) >> shift)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::axis::limits::Limiting;
    use crate::axis::velocity_rate::VelocityRate;

    /// 0.1 A s/rad, 10 A; 10 ms are a time constant of 32 ticks.
    fn settings() -> VelocityLoopSettings {
        VelocityLoopSettings::new(100, 100, 0, 10_000, VelocityRate::EachTick).unwrap()
    }

    /// 1 rad/s in steps.
    const RADIAN_PER_SECOND: f64 = 1_367_130.0;

    fn radians(value: f64) -> Velocity {
        Velocity::from_bits((value * RADIAN_PER_SECOND) as i32)
    }

    fn everything() -> TorqueLimits {
        TorqueLimits::symmetrical(CurrentFraction::MAX, Limiting::TORQUE_BIPOLAR)
    }

    /// How far from the limit of 200 rad/s half of the peak current is held back, in rad/s, if the shaft gains so much a tick.
    fn held_from(gain: f64, sign: f64) -> f64 {
        let wanted = CurrentFraction::from_num(0.5 * sign);
        let mut guard = VelocityGuard::new(Velocity::ZERO, CurrentFraction::ZERO);
        // The command stands for a while before the shaft is let go.
        for tick in -400..10_000_i16 {
            let speed = gain * f64::from(tick.max(0));
            let velocities = [radians(200.0 * sign), radians(speed * sign)];
            if guard.tick(&settings(), &everything(), velocities, wanted).is_held {
                return 200.0 - speed;
            }
        }
        panic!("never")
    }

    #[test]
    fn a_shaft_that_is_accelerated_is_met_before_the_limit_and_one_that_creeps_there_at_it() {
        for sign in [1.0, -1.0] {
            // 5 A over 0.1 A s/rad are 50 rad/s if none of it carries a load: then they are gained within a time constant of 32 ticks.
            for (gain, expected) in [(50.0 / 32.0, 50.0), (25.0 / 32.0, 25.0), (1.0 / 32.0, 1.0)] {
                let before = held_from(gain, sign);
                assert!((expected * 0.6..expected + gain).contains(&before), "{gain} a tick: {before} rad/s");
            }
        }
    }

    /// Speeds of a shaft of so many times the inertia that the loop is tuned for, from this one on, at half of the peak current and a load; so many
    /// amperes carry it before.
    fn speeds(inertia: f64, from: f64, carried: f64, load: impl Fn(usize) -> f64) -> [(f64, bool); 1_000] {
        let carried = CurrentFraction::from_num(carried / 10.0);
        let (mut speed, mut guard) = (from, VelocityGuard::new(radians(from), carried));
        core::array::from_fn(|tick| {
            let velocities = [radians(200.0), radians(speed)];
            let guarded = guard.tick(&settings(), &everything(), velocities, CurrentFraction::from_num(0.5));
            // An ampere makes 1 / (0.1 * 32) rad/s a tick of the inertia that the gain is for.
            speed += (guarded.current.to_num::<f64>() * 10.0 - load(tick)) / (3.2 * inertia);
            (speed, guarded.is_held)
        })
    }

    #[test]
    fn the_limit_is_reached_and_hardly_passed_with_and_without_a_load_whatever_the_inertia() {
        for (inertia, load, most) in
            [(0.5, 0.0, 0.3), (1.0, 0.0, 0.3), (1.0, 4.0, 0.5), (2.0, 0.0, 6.0), (2.0, 4.0, 3.0), (4.0, 0.0, 15.0)]
        {
            let seen = speeds(inertia, 20.0 * load, 0.0, |_| load);
            let over = seen.iter().fold(0.0, |most: f64, (speed, _)| most.max(speed - 200.0));
            assert!(over <= most, "inertia {inertia}, load {load}: {over} rad/s");
            assert!((seen[999].0 - 200.0).abs() < 0.5, "inertia {inertia}, load {load}: {} rad/s", seen[999].0);
        }
    }

    #[test]
    fn a_load_that_takes_all_of_the_torque_gets_it_below_the_limit() {
        // A load that is carried already is known; another one lets the shaft sag until it is.
        for (carried, lowest, known) in [(5.0, 193.0, 0), (4.0, 193.0, 200), (0.0, 100.0, 200)] {
            for (tick, (speed, is_held)) in speeds(1.0, 195.0, carried, |_| 5.0).into_iter().enumerate() {
                assert!(speed > lowest && speed < 195.1, "{carried} A: {speed} rad/s in tick {tick}");
                assert!(tick < known || !is_held, "{carried} A: held in tick {tick} at {speed} rad/s");
            }
        }
    }

    #[test]
    fn a_load_that_breaks_away_is_missed_by_half_of_what_the_shaft_gains_within_the_time_constant() {
        // It is carried at 199 rad/s, of which no more than half is taken back by then.
        let seen = speeds(1.0, 190.0, 0.0, |tick| if tick < 500 { 5.0 } else { 0.0 });
        let over = seen.iter().fold(0.0, |most: f64, (speed, _)| most.max(speed - 200.0));
        assert!(over < 25.0, "{over} rad/s");
        assert!((seen[999].0 - 200.0).abs() < 0.2, "{}", seen[999].0);
    }
}
