//! Velocities that the motor is to keep, with ramps between them.

use super::IdentificationParameters;
use crate::arithmetic::division::divide_rounding;
use crate::error::{SettingsError, in_range};
use crate::units::{Position, Velocity};

/// Velocity and ramp of a sequence that turns the motor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub(super) struct Motion {
    /// The higher velocity; the lower one is half of it.
    pub(super) high: Velocity,
    /// In 2^-48 revolution per tick squared.
    step: i64,
    pub(super) movement: Position,
    /// Ticks of the ramp from standstill to the lower velocity, or from that to the higher one.
    pub(super) ramp: u32,
}

impl Motion {
    /// Divides.
    pub(super) fn new(parameters: &IdentificationParameters) -> Result<Self, SettingsError> {
        let speed = parameters.velocity.abs();
        let rpm = speed.to_ten_thousandths_rpm().unsigned_abs() / 10_000;
        in_range("velocity of the identification in rpm", rpm, 1, 15_000)?;
        let step = i64::try_from(parameters.acceleration.to_bits()).unwrap_or(i64::MAX).min(1 << 43);
        let way = i128::from(speed.to_bits()) << 12;
        let ticks = u32::try_from(divide_rounding(way, step.into())).unwrap_or(u32::MAX);
        let is_at_rest = step == 0;
        let ticks = if is_at_rest { u32::MAX } else { ticks };
        in_range("ramp of the identification in loop ticks", ticks, 0, 240_000)?;
        let revolutions = u32::try_from(parameters.movement.to_bits() >> 32).unwrap_or(u32::MAX);
        in_range("movement of the identification in revolutions", revolutions, 0, 1 << 20)?;
        Ok(Self { high: parameters.velocity, step, movement: parameters.movement, ramp: (ticks / 2).saturating_add(1) })
    }

    /// Half the higher velocity.
    #[inline]
    pub(super) fn low(&self) -> Velocity {
        Velocity::from_bits(self.high.to_bits() >> 1)
    }
}

/// A velocity on its way, in 2^-48 revolution per tick.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub(super) struct VelocityRamp(i64);

impl VelocityRamp {
    /// One tick towards `target`.
    #[inline]
    pub(super) fn tick(&mut self, motion: &Motion, target: Velocity) -> Velocity {
        let way = (i64::from(target.to_bits()) << 12).wrapping_sub(self.0);
        self.0 = self.0.wrapping_add(way.min(motion.step).max(motion.step.wrapping_neg()));
        Velocity::saturating_from_bits(self.0 >> 12)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::current::settings::PwmFrequency;
    use crate::units::Acceleration;

    const PARAMETERS: IdentificationParameters = IdentificationParameters {
        peak_current: 10_000,
        current: 3_000,
        ripple: 500,
        pole_pairs: 4,
        velocity: Velocity::from_bits(-(1 << 28)),
        acceleration: Acceleration::from_bits(1 << 28),
        movement: Position::REVOLUTION,
        frequency: PwmFrequency::Khz16,
    };

    #[test]
    fn a_ramp_reaches_its_velocities_in_the_ticks_that_are_stated() {
        let motion = Motion::new(&PARAMETERS).unwrap();
        assert_eq!(motion.ramp, 2_049);
        let mut ramp = VelocityRamp::default();
        for target in [motion.low(), motion.high, motion.low(), Velocity::ZERO] {
            let mut last = Velocity::ZERO;
            for _ in 0..motion.ramp - 2 {
                last = ramp.tick(&motion, target);
            }
            assert_ne!(last, target);
            assert_eq!(ramp.tick(&motion, target), target);
            assert_eq!(ramp.tick(&motion, target), target);
        }
    }

    #[test]
    fn ramps_without_end_and_without_velocity_are_refused() {
        for parameters in [
            IdentificationParameters { velocity: Velocity::from_bits(100_000), ..PARAMETERS },
            IdentificationParameters { acceleration: Acceleration::from_bits(0), ..PARAMETERS },
            IdentificationParameters { acceleration: Acceleration::from_bits(1 << 20), ..PARAMETERS },
            IdentificationParameters { movement: Position::from_bits(-1), ..PARAMETERS },
        ] {
            assert!(matches!(Motion::new(&parameters), Err(SettingsError::OutOfRange { .. })), "{parameters:?}");
        }
    }
}
