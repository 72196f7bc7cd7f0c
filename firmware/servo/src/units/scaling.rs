//! From the weighting of cyclic data (S-0-0044, S-0-0076 ...) to the loop's units and back, without division in the cycle.

use crate::arithmetic::gain::Gain;
use crate::error::SettingsError;
use crate::units::{Position, Velocity};

/// Scaling of position data: increments per revolution of the motor, a ratio of integers.
///
/// Rotary scaling at the motor shaft: S-0-0079 / 1. At the load: (S-0-0079 * S-0-0122) / S-0-0121 (sercos2.md 6.5).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct PositionScale {
    /// Position steps per increment, 32.32.
    steps: u64,
    /// Increments per revolution, 32.32.
    increments: u64,
}

impl PositionScale {
    /// `numerator / denominator` increments per revolution of the motor, 4 to 2^31: the 2^32 values of the data are 2^30 revolutions at most.
    ///
    /// # Errors
    /// [`SettingsError::Zero`], or [`SettingsError::PositionScaleOutOfRange`] beyond the range.
    pub fn new(numerator: u64, denominator: u64) -> Result<Self, SettingsError> {
        let zero = SettingsError::Zero { parameter: "position scale" };
        let numerator = u128::from(numerator);
        let denominator = u128::from(denominator);
        let increments =
            (numerator << 32).checked_add(denominator >> 1).and_then(|n| n.checked_div(denominator)).ok_or(zero)?;
        let steps = (denominator << 64).checked_div(numerator).ok_or(zero)?;
        if !(1_u128 << 34..=1_u128 << 63).contains(&increments) {
            return Err(SettingsError::PositionScaleOutOfRange);
        }
        // Range checked.
        Ok(Self { steps: steps as u64, increments: increments as u64 })
    }

    /// The position of a data value; at most one step of 2^-32 revolution off.
    #[inline]
    #[must_use]
    pub fn to_position(&self, value: i32) -> Position {
        let value = i64::from(value);
        let whole = value.wrapping_mul((self.steps >> 32) as i64);
        let fraction = value.wrapping_mul((self.steps & LOW_WORD) as i64);
        Position::from_bits(whole.wrapping_add(fraction.wrapping_add(1 << 31) >> 32))
    }

    /// The nearest data value of a position, wrapping at 32 bits.
    #[inline]
    #[must_use]
    pub fn from_position(&self, position: Position) -> i32 {
        let bits = position.to_bits();
        let revolutions = bits >> 32;
        let angle = bits as u64 & LOW_WORD;
        let whole_increments = self.increments >> 32;
        let increment_fraction = self.increments & LOW_WORD;
        // revolutions * increments + angle * increments, all in 2^-32 increment, wrapping: only the low 64 bits matter
        let of_revolutions = revolutions.wrapping_mul(self.increments as i64);
        let of_angle = angle.wrapping_mul(whole_increments).wrapping_add(angle.wrapping_mul(increment_fraction) >> 32);
        // Wraps like the 32-bit data value.
        (of_revolutions.wrapping_add(of_angle as i64).wrapping_add(1 << 31) >> 32) as i32
    }
}

/// Scaling of velocity data: one increment as a ratio of rpm at the motor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct VelocityScale {
    to_velocity: Gain,
    from_velocity: Gain,
}

impl VelocityScale {
    /// One increment is `numerator / denominator` rpm of the motor: 1 / 10 000 for the preferred rotary scaling.
    ///
    /// # Errors
    /// [`SettingsError::Zero`], or [`SettingsError::VelocityScaleOutOfRange`] when an increment is above 100 rpm or below 10^-9 rpm.
    pub fn new(numerator: u64, denominator: u64) -> Result<Self, SettingsError> {
        if numerator == 0 || denominator == 0 {
            return Err(SettingsError::Zero { parameter: "velocity scale" });
        }
        // 1 rpm = 2^36 / (60 * 8000) steps = 2^29 / 3750 steps
        let steps = u128::from(numerator) << 29;
        let divisor = u128::from(denominator).saturating_mul(3_750);
        let out_of_range = SettingsError::VelocityScaleOutOfRange;
        Ok(Self {
            to_velocity: Gain::from_ratio(steps, divisor).ok_or(out_of_range)?,
            from_velocity: Gain::from_ratio(divisor, steps).ok_or(out_of_range)?,
        })
    }

    /// The velocity of a data value, limited to the range of [`Velocity`].
    #[inline]
    #[must_use]
    pub fn to_velocity(&self, value: i32) -> Velocity {
        Velocity::saturating_from_bits(self.to_velocity.apply(i64::from(value)))
    }

    /// The nearest data value of a velocity, saturating at 32 bits.
    #[inline]
    #[must_use]
    pub fn from_velocity(&self, velocity: Velocity) -> i32 {
        let value = self.from_velocity.apply(i64::from(velocity.to_bits()));
        // Clamped to the range of i32.
        value.clamp(i64::from(i32::MIN), i64::from(i32::MAX)) as i32
    }
}

const LOW_WORD: u64 = 0xFFFF_FFFF;

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn nothing_is_nothing_in_every_scale() {
        for (numerator, denominator) in [(1, 1), (3_600_000, 1), (1_048_577, 7), (2, 1)] {
            if let Ok(scale) = PositionScale::new(numerator, denominator) {
                assert_eq!(scale.to_position(0), Position::ZERO);
            }
            for scale in [VelocityScale::new(1, 10_000 * numerator), VelocityScale::new(denominator, numerator)] {
                assert!(scale.is_ok_and(|scale| scale.to_velocity(0) == Velocity::ZERO));
            }
        }
    }

    #[test]
    fn the_preferred_rotary_scalings_give_degrees_and_rpm() {
        let scale = PositionScale::new(3_600_000, 1).unwrap();
        assert_eq!(scale.to_position(900_000), Position::from_bits(1 << 30));
        assert_eq!(scale.from_position(Position::from_bits(-(1 << 30))), -900_000);
        let scale = VelocityScale::new(1, 10_000).unwrap();
        let exact = Velocity::from_ten_thousandths_rpm(6_000_000).to_bits();
        assert!(scale.to_velocity(6_000_000).to_bits().abs_diff(exact) <= 4, "24 bits of the factor");
        assert_eq!(scale.from_velocity(Velocity::from_ten_thousandths_rpm(-6_000_000)), -6_000_000);
        assert_eq!(scale.to_velocity(i32::MAX), Velocity::MAX);
    }

    #[test]
    fn impossible_scalings_are_refused() {
        assert_eq!(PositionScale::new(0, 1), Err(SettingsError::Zero { parameter: "position scale" }));
        assert_eq!(PositionScale::new(1, 0), Err(SettingsError::Zero { parameter: "position scale" }));
        assert_eq!(PositionScale::new(1, 1), Err(SettingsError::PositionScaleOutOfRange));
        assert_eq!(PositionScale::new(3, 1), Err(SettingsError::PositionScaleOutOfRange));
        assert_eq!(PositionScale::new(1 << 32, 1), Err(SettingsError::PositionScaleOutOfRange));
        assert!(PositionScale::new(4, 1).is_ok() && PositionScale::new(1 << 31, 1).is_ok());
        assert_eq!(VelocityScale::new(0, 1), Err(SettingsError::Zero { parameter: "velocity scale" }));
        assert_eq!(VelocityScale::new(1_000, 1), Err(SettingsError::VelocityScaleOutOfRange));
        assert_eq!(VelocityScale::new(1, 1 << 60), Err(SettingsError::VelocityScaleOutOfRange));
    }

    proptest! {
        #[test]
        fn positions_are_within_a_step_of_the_exact_ratio(
            numerator in 1_u64..1 << 40, denominator in 1_u64..1 << 30, value in any::<i32>(),
        ) {
            let Ok(scale) = PositionScale::new(numerator, denominator) else { return Ok(()) };
            let exact = (i128::from(value) << 32) * i128::from(denominator);
            let position = i128::from(scale.to_position(value).to_bits());
            prop_assert!((position * i128::from(numerator) - exact).abs() <= i128::from(numerator));
        }

        #[test]
        fn position_data_read_back(numerator in 4_u64..1 << 31, value in any::<i32>()) {
            let scale = PositionScale::new(numerator, 1).unwrap();
            prop_assert_eq!(scale.from_position(scale.to_position(value)), value);
        }

        #[test]
        fn data_of_positions_far_away_wrap_like_the_increments_they_count(
            numerator in 4_u64..1 << 31, revolutions in any::<i32>(), angle in any::<u32>(),
        ) {
            let scale = PositionScale::new(numerator, 1).unwrap();
            let bits = (i128::from(revolutions) << 32) + i128::from(angle);
            let exact = (bits * i128::from(numerator) + (1 << 31)) >> 32;
            prop_assert_eq!(scale.from_position(Position::from_bits(bits as i64)), exact as i32);
        }

        #[test]
        fn velocity_data_read_back(value in -149_000_000_i32..149_000_000) {
            let scale = VelocityScale::new(1, 10_000).unwrap();
            let back = scale.from_velocity(scale.to_velocity(value));
            prop_assert!(back.abs_diff(value) <= 1 + value.unsigned_abs() / 8_000_000);
        }
    }
}
