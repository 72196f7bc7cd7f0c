//! The velocity that the loop controls: differences of the measured position, filtered.
//!
//! A first-order low-pass over the difference per tick. A higher order or an observer would damp the quantisation of the
//! encoder more, but costs phase where the velocity loop needs it, or a model of the load; the difference has no bias at constant
//! speed, and its only parameter exists as an IDN (S-0-0392). One increment per tick of a 65 536-increment encoder is
//! 7.3 rpm; a time constant of 1 ms brings that down to 0.9 rpm, at 11 degrees of phase at 200 rad/s.

use crate::arithmetic::share::Share;
use crate::axis::velocity_rate::VelocityRate;
use crate::units::{LOOP_PERIOD_MICROSECONDS, Position, Velocity};

/// Time constant of a velocity filter, scaled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct VelocityFilter {
    /// Of the new value in the filtered one.
    share: Share,
}

impl VelocityFilter {
    /// A filter of a value that comes once a tick, with this time constant; 0 lets it pass.
    #[must_use]
    pub const fn from_microseconds(time_constant: u16) -> Self {
        Self::new(time_constant, VelocityRate::EachTick)
    }

    /// A filter of a value that comes with every step of the velocity loop, with this time constant in us (S-0-0392); 0 lets it pass.
    #[must_use]
    pub const fn new(time_constant: u16, rate: VelocityRate) -> Self {
        // In half microseconds.
        let period = match rate {
            VelocityRate::EachTick => LOOP_PERIOD_MICROSECONDS << 1,
            VelocityRate::TwiceATick => LOOP_PERIOD_MICROSECONDS,
        };
        Self { share: Share::new(period, period.saturating_add((time_constant as u32) << 1)) }
    }
}

/// A velocity behind a [`VelocityFilter`].
///
/// A jump of more than 15 000 rpm from one tick to the next counts as 15 000 rpm in that tick.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct FilteredVelocity {
    /// In 2^-68 revolution per tick, 32 bits below [`Velocity`]: the filter settles to the last step with every time constant.
    filtered: i64,
}

impl FilteredVelocity {
    /// Of something that has moved with `velocity` for long.
    #[must_use]
    pub const fn new(velocity: Velocity) -> Self {
        Self { filtered: (velocity.to_bits() as i64) << 32 }
    }

    /// Takes the velocity of the next tick.
    #[inline]
    pub fn update(&mut self, filter: &VelocityFilter, velocity: Velocity) -> Velocity {
        // Never past the new value, so always within the range of the type.
        self.filtered = filter.share.added_to(self.filtered, (velocity - self.velocity()).to_bits());
        self.velocity()
    }

    /// The filtered velocity of the last tick.
    #[inline]
    #[must_use]
    pub const fn velocity(&self) -> Velocity {
        Velocity::from_bits((self.filtered >> 32) as i32)
    }
}

/// Estimates velocity from positions at successive ticks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct VelocityEstimate {
    position: Position,
    filtered: FilteredVelocity,
}

impl VelocityEstimate {
    /// Starts at standstill at `position`.
    #[must_use]
    pub const fn new(position: Position) -> Self {
        Self { position, filtered: FilteredVelocity::new(Velocity::ZERO) }
    }

    /// Takes the position one tick later.
    #[inline]
    pub fn update(&mut self, filter: &VelocityFilter, position: Position) -> Velocity {
        let moved = Velocity::of_a_tick(position - self.position);
        self.position = position;
        self.filtered.update(filter, moved)
    }

    /// The last estimate.
    #[inline]
    #[must_use]
    pub const fn velocity(&self) -> Velocity {
        self.filtered.velocity()
    }

    /// Shifts the origin of the position by `difference` without a velocity (homing).
    pub fn shift(&mut self, difference: Position) {
        self.position = self.position + difference;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn constant_speed_is_estimated_without_bias() {
        for (time_constant, tolerance) in [(0, 0), (500, 0), (65_500, 0)] {
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
        let mut expected = FilteredVelocity::new(Velocity::ZERO);
        let mut position = 0;
        for tick in 0..2_000_i64 {
            let moved = (tick % 300) * 1_000 - 90_000;
            position += moved;
            let measured = estimate.update(&filter, Position::from_bits(position));
            let wanted = expected.update(&filter, Velocity::from_bits((moved << 4) as i32));
            assert_eq!(measured, wanted, "tick {tick}");
        }
        let steady = Velocity::from_bits(-123_456);
        assert_eq!(FilteredVelocity::new(steady).update(&filter, steady), steady);
    }

    #[test]
    fn beyond_the_range_it_saturates_and_a_shift_is_no_movement() {
        let filter = VelocityFilter::from_microseconds(0);
        let mut estimate = VelocityEstimate::new(Position::ZERO);
        assert_eq!(
            estimate.update(&filter, Position::from_bits(i64::MIN)),
            Velocity::from_bits(i32::MIN),
            "-15 000 rpm"
        );
        let mut estimate = VelocityEstimate::new(Position::ZERO);
        estimate.shift(Position::from_bits(1 << 40));
        assert_eq!(estimate.update(&filter, Position::from_bits(1 << 40)), Velocity::ZERO);
    }
}
