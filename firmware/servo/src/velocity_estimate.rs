//! The velocity that the loop controls: differences of the measured position, filtered.
//!
//! A first-order low-pass over the difference per tick. A higher order or an observer would damp the quantisation of the
//! encoder more, but costs phase where the velocity loop needs it, or a model of the load; the difference has no bias at constant
//! speed, and its only parameter exists as an IDN (S-0-0392). One increment per tick of a 65 536-increment encoder is
//! 7.3 rpm; a time constant of 1 ms brings that down to 0.9 rpm, at 11 degrees of phase at 200 rad/s.

use crate::{Gain, LOOP_PERIOD_MICROSECONDS, Position, Velocity};

/// Time constant of a velocity filter, scaled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct VelocityFilter {
    /// Share of the new difference in the estimate.
    share: Gain,
}

impl VelocityFilter {
    /// A filter with this time constant (S-0-0392); 0 passes the differences unfiltered.
    #[must_use]
    pub fn from_microseconds(time_constant: u16) -> Self {
        let period = u128::from(LOOP_PERIOD_MICROSECONDS);
        let share = Gain::from_ratio(period, period.saturating_add(u128::from(time_constant)));
        Self { share: share.unwrap_or(Gain::ONE) }
    }
}

/// Estimates velocity from positions at successive ticks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct VelocityEstimate {
    position: Position,
    /// In 2^-42 revolution per tick: six bits below [`Velocity`], so that the filter settles to the last
    /// step with time constants up to 10 ms, and within five steps (0.000 04 rpm) with the longest.
    filtered: i64,
}

impl VelocityEstimate {
    /// Starts at standstill at `position`.
    #[must_use]
    pub const fn new(position: Position) -> Self {
        Self { position, filtered: 0 }
    }

    /// Takes the position one tick later.
    #[inline]
    pub fn update(&mut self, filter: &VelocityFilter, position: Position) -> Velocity {
        let moved = (position - self.position).to_bits().clamp(-MOVED_LIMIT, MOVED_LIMIT);
        self.position = position;
        let change = (moved << 10).wrapping_sub(self.filtered);
        self.filtered = self.filtered.wrapping_add(filter.share.apply(change));
        self.velocity()
    }

    /// The last estimate.
    #[inline]
    #[must_use]
    pub fn velocity(&self) -> Velocity {
        Velocity::saturating_from_bits(self.filtered >> 6)
    }

    /// Shifts the origin of the position by `difference` without a velocity (homing).
    pub fn shift(&mut self, difference: Position) {
        self.position = self.position + difference;
    }
}

/// The velocity that an axis exactly on its set-point would be estimated to have: the commanded one through the filter of the estimate.
///
/// Fed forward in its place, the commanded velocity would be ahead of the measured one by the time of the filter. The velocity loop would
/// take that for an error, and at constant acceleration a the position loop would have to hold a * time / Kv against it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ExpectedVelocity {
    /// In 2^-42 revolution per tick.
    filtered: i64,
}

impl ExpectedVelocity {
    /// Of a set-point that has moved with `velocity` for long.
    #[must_use]
    pub const fn new(velocity: Velocity) -> Self {
        Self { filtered: (velocity.to_bits() as i64) << 6 }
    }

    /// Takes what the set-point has moved by in a tick.
    #[inline]
    pub fn update(&mut self, filter: &VelocityFilter, velocity: Velocity) -> Velocity {
        let change = (i64::from(velocity.to_bits()) << 6).wrapping_sub(self.filtered);
        self.filtered = self.filtered.wrapping_add(filter.share.apply(change));
        Velocity::saturating_from_bits(self.filtered >> 6)
    }
}

/// Largest movement in a tick that counts: that of [`Velocity::MAX`].
const MOVED_LIMIT: i64 = 1 << 27;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn constant_speed_is_estimated_without_bias() {
        for (time_constant, tolerance) in [(0, 0), (500, 1), (65_500, 5)] {
            let filter = VelocityFilter::from_microseconds(time_constant);
            for step in [1_i64, 7, 1_000_003, -1, -7, -1_000_003] {
                let mut estimate = VelocityEstimate::new(Position::ZERO);
                for tick in 1..200_000_i64 {
                    estimate.update(&filter, Position::from_bits(tick * step));
                }
                let error = i64::from(estimate.velocity().to_bits()) - (step << 4);
                assert!(error.abs() <= tolerance, "{error} at {step} a tick, {time_constant} us");
            }
        }
    }

    #[test]
    fn a_step_rises_to_63_percent_in_the_time_constant() {
        let filter = VelocityFilter::from_microseconds(2_000);
        let mut estimate = VelocityEstimate::new(Position::ZERO);
        for tick in 1..=16_i64 {
            estimate.update(&filter, Position::from_bits(tick << 20));
        }
        let share = f64::from(estimate.velocity().to_bits()) / f64::from(1 << 24);
        assert!((0.61..0.64).contains(&share), "{share}");
    }

    #[test]
    fn the_expected_velocity_is_that_of_an_axis_on_its_set_point() {
        let filter = VelocityFilter::from_microseconds(700);
        let mut estimate = VelocityEstimate::new(Position::ZERO);
        let mut expected = ExpectedVelocity::new(Velocity::ZERO);
        let mut position = 0;
        for tick in 0..2_000_i64 {
            let moved = (tick % 300) * 1_000 - 90_000;
            position += moved;
            let measured = estimate.update(&filter, Position::from_bits(position));
            let wanted = expected.update(&filter, Velocity::from_bits((moved << 4) as i32));
            assert_eq!(measured, wanted, "tick {tick}");
        }
        let steady = Velocity::from_bits(-123_456);
        assert_eq!(ExpectedVelocity::new(steady).update(&filter, steady), steady);
    }

    #[test]
    fn beyond_the_range_it_saturates_and_a_shift_is_no_movement() {
        let filter = VelocityFilter::from_microseconds(0);
        let mut estimate = VelocityEstimate::new(Position::ZERO);
        assert_eq!(estimate.update(&filter, Position::from_bits(i64::MIN)), -Velocity::MAX);
        let mut estimate = VelocityEstimate::new(Position::ZERO);
        estimate.shift(Position::from_bits(1 << 40));
        assert_eq!(estimate.update(&filter, Position::from_bits(1 << 40)), Velocity::ZERO);
    }
}
