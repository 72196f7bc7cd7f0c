//! An encoder that is read twice in a loop tick: the position between the two readings, a half increment fine.
//!
//! A counter shows where the shaft is to within an increment, and what it hides comes back as a velocity: one increment a tick. The mean of
//! two readings half a tick apart hides a half as much, and what it hides is different from tick to tick. It belongs to the instant in the
//! middle between the two, a quarter of a tick before the second: whoever compares it with a set-point takes the one of that instant, see
//! [`crate::axis::AxisSettings::with_setpoint_ahead`].

use crate::encoder::{Encoder, EncoderSettings};
use crate::error::SettingsError;
use crate::units::{Position, Velocity};

/// Follows the counter of an encoder by two readings a tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct DoubleSampledEncoder {
    /// Counts half increments: the sum of two counts.
    halves: Encoder,
}

/// Resolution of an encoder that is read twice, scaled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct DoubleSampledSettings {
    halves: EncoderSettings,
}

impl DoubleSampledSettings {
    /// An encoder with so many increments per revolution, 1 ..= 2^31 - 1.
    ///
    /// # Errors
    /// [`SettingsError::Zero`] for 0, [`SettingsError::OutOfRange`] above.
    pub fn new(increments_per_revolution: u32) -> Result<Self, SettingsError> {
        let out_of_range = SettingsError::OutOfRange {
            parameter: "increments per revolution",
            actual: increments_per_revolution,
            minimum: 1,
            maximum: i32::MAX.unsigned_abs(),
        };
        let halves = increments_per_revolution.checked_mul(2).ok_or(out_of_range)?;
        Ok(Self { halves: EncoderSettings::new(halves)? })
    }
}

impl DoubleSampledEncoder {
    /// Starts with the counter at `count`, which is position zero.
    #[must_use]
    pub const fn new(settings: DoubleSampledSettings, count: u32) -> Self {
        Self { halves: Encoder::new(settings.halves, count.wrapping_mul(2)) }
    }

    /// Takes two readings of the counter and gives the position in the middle between them.
    ///
    /// To be called at least once in 2^30 increments of movement.
    #[inline]
    pub fn update(&mut self, before: u32, now: u32) -> Position {
        self.halves.update(before.wrapping_add(now))
    }

    /// The velocity with which the counter gets from one reading to the next one, half a loop tick later; at most 2^23 increments count.
    #[inline]
    #[must_use]
    pub fn velocity(&self, before: u32, now: u32) -> Velocity {
        // Two halves an increment, two halves a tick.
        let moved = now.wrapping_sub(before).cast_signed().clamp(-(1 << 23), (1 << 23) - 1);
        self.halves.velocity(moved << 2)
    }

    /// The position at the last [`DoubleSampledEncoder::update`].
    #[inline]
    #[must_use]
    pub fn position(&self) -> Position {
        self.halves.position()
    }

    /// The position that belongs to a latched counter value, at most 2^30 increments before or after the last update.
    #[inline]
    #[must_use]
    pub fn position_of(&self, latched_count: u32) -> Position {
        self.halves.position_of(latched_count.wrapping_mul(2))
    }

    /// Shifts the zero so that the position at the last update reads `position` (homing, S-0-0052).
    pub fn set_position(&mut self, position: Position) {
        self.halves.set_position(position);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn two_readings_of_the_same_count_are_its_position_and_two_different_ones_the_middle() {
        let settings = DoubleSampledSettings::new(1 << 20).unwrap();
        let mut encoder = DoubleSampledEncoder::new(settings, u32::MAX);
        let increment = 1 << 12;
        assert_eq!(encoder.update(u32::MAX, u32::MAX), Position::ZERO);
        assert_eq!(encoder.update(u32::MAX, 0), Position::from_bits(increment / 2));
        assert_eq!(encoder.update(2, 1), Position::from_bits(increment * 5 / 2));
        assert_eq!(encoder.position_of(9), Position::from_bits(increment * 10));
        encoder.set_position(Position::REVOLUTION);
        assert_eq!(encoder.position_of(2), Position::from_bits((1 << 32) + increment / 2));
    }

    #[test]
    fn the_velocity_between_two_readings_is_that_of_half_a_tick() {
        for increments in [1_u32, 3, 2_000, 65_536, 1_000_003, 1 << 20, (1 << 31) - 1] {
            let encoder = DoubleSampledEncoder::new(DoubleSampledSettings::new(increments).unwrap(), 0);
            for moved in [0_i32, 1, -1, 40, -41, 1 << 14, i32::MAX, i32::MIN] {
                let counted = f64::from(moved.clamp(-(1 << 23), (1 << 23) - 1));
                let exact = 2.0 * counted / f64::from(increments) * 2_f64.powi(36);
                let exact = exact.clamp(f64::from(i32::MIN), f64::from(i32::MAX));
                let before = 0xFFFF_FFF0_u32;
                let error = f64::from(encoder.velocity(before, before.wrapping_add_signed(moved)).to_bits()) - exact;
                assert!(error.abs() <= 0.5 + exact.abs() * 1e-9, "{moved} of {increments}: {error}");
            }
        }
    }

    #[test]
    fn a_resolution_whose_halves_cannot_be_counted_is_refused() {
        assert!(DoubleSampledSettings::new(0).is_err());
        assert!(DoubleSampledSettings::new(1 << 31).is_err());
        assert!(DoubleSampledSettings::new((1 << 31) - 1).is_ok());
    }

    proptest! {
        /// The counter wraps, the sum of two readings twice as often.
        #[test]
        fn however_far_the_shaft_turns_a_latched_count_has_its_place(
            start in any::<u32>(), moves in proptest::collection::vec(-(1_i64 << 28)..1 << 28, 1..50), increments in 1_u32..1 << 28,
        ) {
            let settings = DoubleSampledSettings::new(increments).unwrap();
            let mut encoder = DoubleSampledEncoder::new(settings, start);
            let mut place = 0_i64;
            let count = |place: i64| start.wrapping_add(place as u32);
            for moved in moves {
                let middle = place + moved / 2;
                place += moved;
                let position = encoder.update(count(middle), count(place));
                let exact = |halves: i128| (halves << 32).div_euclid(i128::from(increments) * 2);
                let error = i128::from(position.to_bits()) - exact(i128::from(middle + place));
                prop_assert!((-2..=0).contains(&error), "{}", error);
                let error = i128::from(encoder.position_of(count(place)).to_bits()) - exact(2 * i128::from(place));
                prop_assert!((-2..=0).contains(&error), "{}", error);
            }
        }
    }
}
