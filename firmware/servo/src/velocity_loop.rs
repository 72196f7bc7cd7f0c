//! Velocity control: proportional and integral, current limited, with anti-windup.
//!
//! Anti-windup is conditional integration: while the current stands at its limit, an error that would push it further is not
//! integrated, one that leads back is. Back-calculation would also empty the integrator when a single noisy difference of the
//! encoder touches the limit; conditional integration does not, and has no time constant of its own to set.

use crate::units::{TEN_TO_15, TWO_PI_TIMES_TEN_TO_15, limited};
use crate::{CurrentFraction, Gain, LOOP_TICKS_PER_SECOND, SettingsError, Velocity};

/// Gains and limit of the velocity loop, scaled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct VelocityLoopSettings {
    /// Velocity steps to 2^-31 of the peak current.
    proportional: Gain,
    /// Velocity steps to 2^-39 of the peak current, per tick.
    integral: Gain,
    /// In 2^-31 of the peak current.
    limit: i64,
}

impl VelocityLoopSettings {
    /// * `gain`: S-0-0100 in mA s/rad (an increment of 0.1 A s/rad is 100).
    /// * `integral_time`: S-0-0101 in 0.1 ms; 0 switches the integral part off.
    /// * `peak_current`: of the amplifier, S-0-0110, in mA.
    /// * `current_limit`: bipolar limit in mA; above the peak current it counts as the peak current.
    ///
    /// # Errors
    /// [`SettingsError::Zero`] without peak current, [`SettingsError::VelocityGain`] when the gain is beyond what can be represented
    /// (the whole peak current for a difference of less than 2^-17 of the highest speed).
    pub fn new(gain: u32, integral_time: u16, peak_current: u32, current_limit: u32) -> Result<Self, SettingsError> {
        if peak_current == 0 {
            return Err(SettingsError::Zero { parameter: "amplifier peak current S-0-0110" });
        }
        let too_high = SettingsError::VelocityGain { actual: gain };
        // fraction [2^-31] = v [2^-36 rev/tick] * 2^-5 * 2 pi * 8000 * gain / peak current
        let two_pi = u128::try_from(TWO_PI_TIMES_TEN_TO_15).unwrap_or_default();
        let unit = u128::try_from(TEN_TO_15).unwrap_or_default();
        let numerator = u128::from(gain).saturating_mul(u128::from(LOOP_TICKS_PER_SECOND)).saturating_mul(two_pi);
        let denominator = u128::from(peak_current).saturating_mul(32).saturating_mul(unit);
        // One tick is 1.25 times 0.1 ms; the integrator has 8 more bits.
        let integral = if integral_time == 0 {
            Gain::ZERO
        } else {
            let numerator = numerator.saturating_mul(256 * 5);
            let denominator = denominator.saturating_mul(u128::from(integral_time)).saturating_mul(4);
            Gain::from_ratio(numerator, denominator).ok_or(too_high)?
        };
        let limit =
            (u64::from(current_limit.min(peak_current)) << 31).checked_div(u64::from(peak_current)).unwrap_or(0);
        Ok(Self {
            proportional: Gain::from_ratio(numerator, denominator).ok_or(too_high)?,
            integral,
            limit: i64::try_from(limit).unwrap_or(i64::MAX).min(LARGEST_CURRENT),
        })
    }
}

impl VelocityLoopSettings {
    /// A current within the limit, and whether it had to be limited. For torque commands, which do not come from the loop.
    #[must_use]
    pub fn limit_current(&self, current: CurrentFraction) -> VelocityLoopOutput {
        let wanted = i64::from(current.to_bits()) << 16;
        let limit = self.limit;
        // Not `clamp`: it panics if its limits are the wrong way round, and the compiler cannot see that they never are.
        let within = wanted.max(limit.wrapping_neg()).min(limit);
        VelocityLoopOutput { current: CurrentFraction::from_bits((within >> 16) as i16), limited: within != wanted }
    }
}

/// 1 - 2^-15, the largest [`CurrentFraction`], in 2^-31.
const LARGEST_CURRENT: i64 = (1 << 31) - (1 << 16);

/// What the velocity loop gives in a tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct VelocityLoopOutput {
    /// Torque-producing current.
    pub current: CurrentFraction,
    /// The current stands at its limit (C3D bit 4).
    pub limited: bool,
}

/// State of the velocity loop: the integral part.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct VelocityLoop {
    /// In 2^-39 of the peak current.
    integral: i64,
}

impl VelocityLoop {
    /// Starts without integral part.
    #[must_use]
    pub const fn new() -> Self {
        Self { integral: 0 }
    }

    /// Clears the integral part.
    pub fn reset(&mut self) {
        self.integral = 0;
    }

    /// Starts with this current at zero velocity error: bumpless start against a known load.
    pub fn preset(&mut self, current: CurrentFraction) {
        self.integral = i64::from(current.to_bits()) << 24;
    }

    /// One tick.
    #[inline]
    pub fn tick(
        &mut self,
        settings: &VelocityLoopSettings,
        command: Velocity,
        measured: Velocity,
    ) -> VelocityLoopOutput {
        let error = i64::from(command.to_bits()).wrapping_sub(i64::from(measured.to_bits()));
        let limit = settings.limit;
        let proportional = settings.proportional.apply(error);
        let step = settings.integral.apply(error);
        let wanted = proportional.saturating_add(self.integral.saturating_add(step) >> 8);
        let pushes_further = (wanted > limit && step > 0) || (wanted < limit.wrapping_neg() && step < 0);
        if !pushes_further {
            let fine_limit = limit << 8;
            self.integral = limited(self.integral.saturating_add(step), fine_limit);
        }
        let total = proportional.saturating_add(self.integral >> 8);
        let current = limited(total, limit);
        // Within +-(2^31 - 2^16) and rounded to 2^-15: fits 16 bits.
        let bits = (current.wrapping_add(1 << 15) >> 16) as i16;
        VelocityLoopOutput { current: CurrentFraction::from_bits(bits), limited: total != current }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// 1 A s/rad, 10 ms, 10 A.
    fn settings(integral_time: u16) -> VelocityLoopSettings {
        VelocityLoopSettings::new(1_000, integral_time, 10_000, 10_000).unwrap()
    }

    /// 1 rad/s in steps.
    const RADIAN_PER_SECOND: i32 = 1_367_130;

    #[test]
    fn a_radian_per_second_gives_the_current_of_the_gain() {
        let mut velocity_loop = VelocityLoop::new();
        let output = velocity_loop.tick(&settings(0), Velocity::from_bits(RADIAN_PER_SECOND), Velocity::ZERO);
        assert_eq!(output.current, CurrentFraction::from_num(0.1));
        assert!(!output.limited);
    }

    #[test]
    fn the_integral_part_equals_the_proportional_part_after_its_action_time() {
        let mut velocity_loop = VelocityLoop::new();
        let settings = settings(100);
        let mut current = CurrentFraction::ZERO;
        for _ in 0..80 {
            current = velocity_loop.tick(&settings, Velocity::from_bits(RADIAN_PER_SECOND), Velocity::ZERO).current;
        }
        assert!((current.to_num::<f64>() - 0.2).abs() < 0.000_1, "{current}");
    }

    #[test]
    fn the_integral_part_leaves_saturation_at_once_when_the_error_turns() {
        let settings = settings(100);
        let mut velocity_loop = VelocityLoop::new();
        for _ in 0..8_000 {
            assert!(velocity_loop.tick(&settings, Velocity::from_bits(20 * RADIAN_PER_SECOND), Velocity::ZERO).limited);
        }
        let back = velocity_loop.tick(&settings, Velocity::ZERO, Velocity::ZERO);
        assert!(back.current < CurrentFraction::from_num(0.05), "nothing was wound up: {}", back.current);
    }

    #[test]
    fn a_preset_current_flows_at_zero_error_and_a_reset_clears_it() {
        let mut velocity_loop = VelocityLoop::new();
        velocity_loop.preset(CurrentFraction::from_num(-0.25));
        let output = velocity_loop.tick(&settings(100), Velocity::ZERO, Velocity::ZERO);
        assert_eq!(output.current, CurrentFraction::from_num(-0.25));
        velocity_loop.reset();
        assert_eq!(velocity_loop.tick(&settings(100), Velocity::ZERO, Velocity::ZERO).current, 0);
    }

    #[test]
    fn a_lowered_limit_takes_the_integral_part_along() {
        let lower = VelocityLoopSettings::new(1_000, 100, 10_000, 2_000).unwrap();
        let mut velocity_loop = VelocityLoop::new();
        velocity_loop.preset(CurrentFraction::from_num(0.8));
        assert_eq!(velocity_loop.tick(&lower, Velocity::ZERO, Velocity::ZERO).current, CurrentFraction::from_num(0.2));
        let again = velocity_loop.tick(&settings(100), Velocity::ZERO, Velocity::ZERO);
        assert_eq!(again.current, CurrentFraction::from_num(0.2), "nothing waits above the limit");
    }

    #[test]
    fn impossible_settings_are_refused() {
        assert_eq!(
            VelocityLoopSettings::new(1, 1, 0, 0),
            Err(SettingsError::Zero { parameter: "amplifier peak current S-0-0110" })
        );
        assert_eq!(VelocityLoopSettings::new(312_900, 1, 1, 1), Err(SettingsError::VelocityGain { actual: 312_900 }));
        assert!(VelocityLoopSettings::new(312_900, 1, 10_000, 10_000).is_ok(), "the highest gain of S-0-0100 at 10 A");
    }

    proptest! {
        #[test]
        fn the_current_never_passes_its_limit(
            limit in 0_u32..20_000, gain in 0_u32..300_000, time in any::<u16>(),
            errors in proptest::collection::vec((any::<i32>(), any::<i32>()), 1..200),
        ) {
            let Ok(settings) = VelocityLoopSettings::new(gain, time, 10_000, limit) else { return Ok(()) };
            let bound = f64::from(limit.min(10_000)) / 10_000.0 + 0.000_04;
            let mut velocity_loop = VelocityLoop::new();
            for (command, measured) in errors {
                let output = velocity_loop.tick(&settings, Velocity::from_bits(command), Velocity::from_bits(measured));
                prop_assert!(output.current.to_num::<f64>().abs() <= bound);
            }
        }
    }
}
