//! Velocity control: proportional and integral with feed-forward, current limited, with anti-windup.
//!
//! Anti-windup is conditional integration: while the current stands at its limit, an error that would push it further is not
//! integrated, one that leads back is. Back-calculation would also empty the integrator when a single noisy difference of the
//! encoder touches the limit; conditional integration does not, and has no time constant of its own to set.

use crate::arithmetic::division::{TEN_TO_15, TWO_PI_TIMES_TEN_TO_15};
use crate::arithmetic::limited_gain::LimitedGain;
use crate::arithmetic::wide::quotient;
use crate::axis::acceleration_gain::AccelerationGain;
use crate::axis::limits::{Limiting, TorqueLimits};
use crate::axis::velocity_rate::VelocityRate;
use crate::error::SettingsError;
use crate::units::derivatives::SignedAcceleration;
use crate::units::{CurrentFraction, LOOP_TICKS_PER_SECOND, Velocity};

/// Currents inside the loop are in 2^-25 of the peak current. What its parts add up to stays within 32 bits, each where it cannot turn
/// the sum: the proportional part within 8 to 16 peaks, the feed-forward within 5, the integral part within the limits.
pub(crate) const CURRENT_BITS: u32 = 25;
/// From the 15 bits of [`CurrentFraction`].
const MORE_BITS: u32 = CURRENT_BITS - 15;

/// Gains of the velocity loop, scaled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct VelocityLoopSettings {
    /// Velocity steps to 2^-25 of the peak current.
    proportional: LimitedGain,
    /// What the proportional gain makes of the error, to 2^-57 of the peak current per step.
    integral: i32,
    acceleration: AccelerationGain,
    /// 2^ so many ticks are half of the integral action time.
    time_constant: u32,
}

impl VelocityLoopSettings {
    /// * `gain`: S-0-0100 in mA s/rad (an increment of the IDN), RMS as the peak current is.
    /// * `integral_time`: S-0-0101 in 0.1 ms; 0 switches the integral part off.
    /// * `acceleration_gain`: S-0-0348 in uA s²/rad, 0: no feed-forward.
    /// * `peak_current`: of the amplifier, S-0-0110, in mA.
    /// * `rate`: how often [`VelocityLoop::tick`] is called.
    ///
    /// # Errors
    /// [`SettingsError::Zero`] without peak current, [`SettingsError::VelocityGain`] when the gain is beyond what can be represented
    /// (the whole peak current for a difference of less than 2^-17 of the highest speed).
    pub fn new(
        gain: u32,
        integral_time: u16,
        acceleration_gain: u32,
        peak_current: u32,
        rate: VelocityRate,
    ) -> Result<Self, SettingsError> {
        if peak_current == 0 {
            return Err(SettingsError::Zero { parameter: "amplifier peak current S-0-0110" });
        }
        let too_high = SettingsError::VelocityGain { actual: gain };
        // fraction [2^-25] = v [2^-36 rev/tick] * 2^-11 * 2 pi * 8000 * gain / peak current
        let two_pi = u128::try_from(TWO_PI_TIMES_TEN_TO_15).unwrap_or_default();
        let unit = u128::try_from(TEN_TO_15).unwrap_or_default();
        let ticks = u128::from(LOOP_TICKS_PER_SECOND);
        let numerator = u128::from(gain).saturating_mul(ticks).saturating_mul(two_pi);
        let denominator = u128::from(peak_current).saturating_mul(1 << 11).saturating_mul(unit);
        let factor = quotient(numerator, denominator).filter(|factor| *factor < HIGHEST_GAIN << 64).ok_or(too_high)?;
        let proportional = LimitedGain::from_ratio(numerator, denominator).ok_or(too_high)?;
        // To the nearest power of two; a tick is 1.25 times 0.1 ms.
        let half = u32::from(integral_time).saturating_mul(2) / 5;
        let square = half.saturating_mul(half).saturating_mul(2);
        let time_constant = square.checked_ilog2().map_or(TIME_CONSTANT, |bits| bits / 2);
        let times = u128::from(integral_time).saturating_mul(4).saturating_mul(rate.steps().into());
        let per_step = factor.saturating_mul(5).checked_div(times).unwrap_or(0);
        // fraction [2^-25] = a [2^-42 rev/tick²] * 2^-17 * 2 pi * 8000² * gain / peak current
        let of_acceleration =
            u128::from(acceleration_gain).saturating_mul(ticks.saturating_mul(ticks)).saturating_mul(two_pi);
        let per_peak = u128::from(peak_current).saturating_mul(1_000 << 17).saturating_mul(unit);
        Ok(Self {
            proportional,
            integral: proportional.mantissa_of(per_step),
            acceleration: AccelerationGain::from_ratio(of_acceleration, per_peak).ok_or(too_high)?,
            time_constant,
        })
    }

    /// The current that makes this acceleration, in 2^-25 of the peak current, within four peaks.
    #[inline]
    #[must_use]
    pub fn feed_forward(&self, acceleration: SignedAcceleration) -> i32 {
        self.acceleration.apply(acceleration)
    }

    /// What the proportional part makes of a velocity, in 2^-25 of the peak current, within 16 peaks.
    pub(crate) fn current_for(&self, velocity: i32) -> i32 {
        self.proportional.apply(velocity)
    }

    /// The time in which the proportional part alone would take the shaft to its command: half of the integral action time at most, in 2^ so
    /// many ticks.
    pub(crate) const fn time_constant(&self) -> u32 {
        self.time_constant
    }

    /// From an acceleration to that current.
    pub(crate) const fn acceleration(&self) -> AccelerationGain {
        self.acceleration
    }
}

/// Of a loop without integral part: 2^5 ticks, 4 ms.
const TIME_CONSTANT: u32 = 5;

/// A velocity step may make 2^-7 of the peak current.
const HIGHEST_GAIN: u128 = 1 << 18;

/// What the velocity loop gives in a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct VelocityLoopOutput {
    /// Torque-producing current.
    pub current: CurrentFraction,
    /// The limit that the current is held back by (C3D bit 4).
    pub limiting: Limiting,
}

/// State of the velocity loop: the integral part.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct VelocityLoop {
    /// In 2^-57 of the peak current: every error counts, however small, and what an error of either sign adds up to is exact.
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

    /// Whether the integral part pushes a shaft on that turns at this velocity.
    #[must_use]
    pub const fn pushes(&self, velocity: Velocity) -> bool {
        (self.integral > 0 && velocity.to_bits() > 0) || (self.integral < 0 && velocity.to_bits() < 0)
    }

    /// The velocity error is over at once, and what the proportional part made of it: no more of the integral part is kept than what flowed of
    /// both together.
    pub fn keep_at_most(&mut self, current: CurrentFraction) {
        let flowed = i64::from(current.to_bits()) << (MORE_BITS + 32);
        self.integral = flowed.clamp(self.integral.min(0), self.integral.max(0));
    }

    /// What carries the load, of the current that flows: what accelerates the shaft comes from the other parts of the loop, or passes the integral
    /// part by. A loop without integral part carries with all that it gives.
    #[must_use]
    pub fn carrying(&self, settings: &VelocityLoopSettings, current: CurrentFraction) -> CurrentFraction {
        if settings.integral == 0 {
            return current;
        }
        let part = rounded(high_word(self.integral));
        part.max(current.min(CurrentFraction::ZERO)).min(current.max(CurrentFraction::ZERO))
    }

    /// Starts with this current at zero velocity error: bumpless start against a known load.
    pub fn preset(&mut self, current: CurrentFraction) {
        self.integral = i64::from(current.to_bits()) << (MORE_BITS + 32);
    }

    /// One step. `feed_forward` in 2^-25 of the peak current, within five peaks, is added to what the loop gives, within the limits.
    ///
    /// An error beyond the range of [`Velocity`] counts as the end of the range.
    #[inline]
    pub fn tick(
        &mut self,
        settings: &VelocityLoopSettings,
        limits: &TorqueLimits,
        command: Velocity,
        measured: Velocity,
        feed_forward: i32,
    ) -> VelocityLoopOutput {
        let error = settings.proportional.full_width((command - measured).to_bits());
        let [lower, upper] = bounds(limits);
        let beside = settings.proportional.of_full_width(error).saturating_add(feed_forward);
        let next = self.integral.wrapping_add(i64::from(error).wrapping_mul(i64::from(settings.integral)));
        let next_part = high_word(next);
        let total = beside.saturating_add(next_part);
        let is_within = |part| lower <= part && part <= upper;
        if is_within(total) && lower <= next_part && next_part < upper {
            self.integral = next;
            return VelocityLoopOutput { current: rounded(total), limiting: Limiting::empty() };
        }
        self.tick_at_limit(limits, next, beside)
    }

    /// The rest of a step where the current, the integral part or both are at a limit or beyond.
    #[cold]
    #[inline(never)]
    fn tick_at_limit(&mut self, limits: &TorqueLimits, next: i64, beside: i32) -> VelocityLoopOutput {
        let [lower, upper] = bounds(limits);
        let wanted = beside.saturating_add(high_word(next));
        let pushes_further = (wanted > upper && next > self.integral) || (wanted < lower && next < self.integral);
        if !pushes_further {
            self.integral = next.min(i64::from(upper) << 32).max(i64::from(lower) << 32);
        }
        let total = beside.saturating_add(high_word(self.integral));
        let current = total.min(upper).max(lower);
        let limiting = if total == current { Limiting::empty() } else { limits.met_by(rounded(current)) };
        VelocityLoopOutput { current: rounded(current), limiting }
    }
}

/// The lowest and the highest current inside the loop, in 2^-25 of the peak current.
#[inline]
pub(crate) fn bounds(limits: &TorqueLimits) -> [i32; 2] {
    [limits.negative, limits.positive].map(|limit| i32::from(limit.to_bits()) << MORE_BITS)
}

#[inline]
const fn high_word(value: i64) -> i32 {
    (value >> 32) as i32
}

/// A current inside the loop, within the limits of 16 bits, to the nearest.
#[inline]
fn rounded(current: i32) -> CurrentFraction {
    CurrentFraction::from_bits((current.wrapping_add(1 << (MORE_BITS - 1)) >> MORE_BITS) as i16)
}

#[cfg(test)]
mod tests {
    use super::*;
    use VelocityRate::EachTick;
    use proptest::prelude::*;

    /// 1 A s/rad, 10 ms, 10 A.
    fn settings(integral_time: u16) -> VelocityLoopSettings {
        VelocityLoopSettings::new(1_000, integral_time, 0, 10_000, EachTick).unwrap()
    }

    fn within(limit: f64) -> TorqueLimits {
        let positive = CurrentFraction::saturating_from_num(limit);
        let cause = Limiting::TORQUE_BIPOLAR;
        TorqueLimits { positive, negative: -positive, positive_cause: cause, negative_cause: cause }
    }

    /// 1 rad/s in steps.
    const RADIAN_PER_SECOND: i32 = 1_367_130;

    #[test]
    fn a_radian_per_second_gives_the_current_of_the_gain() {
        let mut velocity_loop = VelocityLoop::new();
        let output =
            velocity_loop.tick(&settings(0), &within(1.0), Velocity::from_bits(RADIAN_PER_SECOND), Velocity::ZERO, 0);
        assert_eq!(output.current, CurrentFraction::from_num(0.1));
        assert!(output.limiting.is_empty());
    }

    #[test]
    fn the_integral_part_equals_the_proportional_part_after_its_action_time() {
        let mut velocity_loop = VelocityLoop::new();
        let settings = settings(100);
        let mut current = CurrentFraction::ZERO;
        for _ in 0..80 {
            current = velocity_loop
                .tick(&settings, &within(1.0), Velocity::from_bits(RADIAN_PER_SECOND), Velocity::ZERO, 0)
                .current;
        }
        assert!((current.to_num::<f64>() - 0.2).abs() < 0.000_1, "{current}");
    }

    #[test]
    fn the_integral_part_leaves_saturation_at_once_when_the_error_turns() {
        let settings = settings(100);
        let mut velocity_loop = VelocityLoop::new();
        for _ in 0..8_000 {
            assert!(
                velocity_loop
                    .tick(&settings, &within(1.0), Velocity::from_bits(20 * RADIAN_PER_SECOND), Velocity::ZERO, 0)
                    .limiting
                    .contains(Limiting::TORQUE_BIPOLAR)
            );
        }
        let back = velocity_loop.tick(&settings, &within(1.0), Velocity::ZERO, Velocity::ZERO, 0);
        assert!(back.current < CurrentFraction::from_num(0.05), "nothing was wound up: {}", back.current);
    }

    #[test]
    fn a_preset_current_flows_at_zero_error_and_a_reset_clears_it() {
        let mut velocity_loop = VelocityLoop::new();
        velocity_loop.preset(CurrentFraction::from_num(-0.25));
        let output = velocity_loop.tick(&settings(100), &within(1.0), Velocity::ZERO, Velocity::ZERO, 0);
        assert_eq!(output.current, CurrentFraction::from_num(-0.25));
        velocity_loop.reset();
        assert_eq!(velocity_loop.tick(&settings(100), &within(1.0), Velocity::ZERO, Velocity::ZERO, 0).current, 0);
    }

    #[test]
    fn a_lowered_limit_takes_the_integral_part_along() {
        let mut velocity_loop = VelocityLoop::new();
        velocity_loop.preset(CurrentFraction::from_num(0.8));
        assert_eq!(
            velocity_loop.tick(&settings(100), &within(0.2), Velocity::ZERO, Velocity::ZERO, 0).current,
            CurrentFraction::from_num(0.2)
        );
        let again = velocity_loop.tick(&settings(100), &within(1.0), Velocity::ZERO, Velocity::ZERO, 0);
        assert_eq!(again.current, CurrentFraction::from_num(0.2), "nothing waits above the limit");
    }

    #[test]
    fn the_acceleration_makes_its_current() {
        // 1 mA s²/rad at 10 A: 100 rad/s² make 0.1 A, 0.01 of the peak.
        let settings = VelocityLoopSettings::new(0, 0, 1_000, 10_000, EachTick).unwrap();
        let acceleration = crate::units::Acceleration::from_milliradians_per_second_squared(100_000).to_bits();
        let forwards = settings.feed_forward(SignedAcceleration::from_bits(acceleration as i64));
        assert!((forwards - (1 << CURRENT_BITS) / 100).abs() < 4, "{forwards}");
        let output = VelocityLoop::new().tick(&settings, &within(1.0), Velocity::ZERO, Velocity::ZERO, -forwards);
        assert_eq!(output.current, CurrentFraction::from_num(-0.01));
    }

    #[test]
    fn each_sign_has_its_own_limit() {
        let negative = CurrentFraction::from_num(-0.125);
        let limits = TorqueLimits { negative, negative_cause: Limiting::MOTOR_LOAD, ..within(0.5) };
        let fast = Velocity::from_bits(100 * RADIAN_PER_SECOND);
        let mut velocity_loop = VelocityLoop::new();
        let output = velocity_loop.tick(&settings(100), &limits, fast, Velocity::ZERO, 0);
        assert_eq!((output.current, output.limiting), (CurrentFraction::from_num(0.5), Limiting::TORQUE_BIPOLAR));
        let output = velocity_loop.tick(&settings(100), &limits, -fast, Velocity::ZERO, 0);
        assert_eq!((output.current, output.limiting), (negative, Limiting::MOTOR_LOAD));
    }

    #[test]
    fn impossible_settings_are_refused() {
        assert_eq!(
            VelocityLoopSettings::new(1, 1, 0, 0, EachTick),
            Err(SettingsError::Zero { parameter: "amplifier peak current S-0-0110" })
        );
        assert_eq!(
            VelocityLoopSettings::new(312_900, 1, 0, 1, EachTick),
            Err(SettingsError::VelocityGain { actual: 312_900 })
        );
        assert!(
            VelocityLoopSettings::new(312_900, 1, 0, 10_000, EachTick).is_ok(),
            "the highest gain of S-0-0100 at 10 A"
        );
    }

    proptest! {
        #[test]
        fn the_current_never_passes_its_limit(
            limit in 0.0..1.0, gain in 0_u32..300_000, time in any::<u16>(),
            errors in proptest::collection::vec((any::<i32>(), any::<i32>()), 1..200),
        ) {
            let Ok(settings) = VelocityLoopSettings::new(gain, time, gain, 10_000, EachTick) else { return Ok(()) };
            let bound = limit + 0.000_04;
            let mut velocity_loop = VelocityLoop::new();
            for (command, measured) in errors {
                let output = velocity_loop.tick(
                    &settings,
                    &within(limit),
                    Velocity::from_bits(command),
                    Velocity::from_bits(measured),
                    command >> 5,
                );
                prop_assert!(output.current.to_num::<f64>().abs() <= bound);
            }
        }
    }
}
