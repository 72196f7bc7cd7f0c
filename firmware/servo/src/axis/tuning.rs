//! Gains of the loops from the data of the motor.
//!
//! Each loop is made so much slower than the one inside it that the inner one is only a delay to it:
//!
//! | loop | rule | phase margin |
//! |---|---|---|
//! | current | the zero of the controller lies on the pole of the winding; gain for the bandwidth | 60 degrees or more |
//! | velocity | gain for the bandwidth; integral action time 4 / bandwidth: the ideal loop is critically damped | 45 degrees or more |
//! | position | a quarter of the velocity bandwidth | |
//! | encoder's steps | velocity filter, and a low-pass at five times the velocity bandwidth, where they would be felt | 16 degrees less, of what small times may take |
//! | feed-forward | the current that the inertia takes, smoothed as the rounding of the commands asks for | |
//!
//! All of it divides: for commands and parameters, not for a tick.

use crate::arithmetic::division::{TEN_TO_15, TWO_PI_TIMES_TEN_TO_15, divide_rounding};
use crate::arithmetic::trigonometry::Rotation;
use crate::axis::velocity_rate::VelocityRate;
use crate::current::settings::PwmFrequency;
use crate::error::{SettingsError, in_range};

/// Gains of the current loop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct CurrentGains {
    /// S-0-0106 in mV/A.
    pub proportional: u32,
    /// S-0-0107 in us.
    pub integral_time: u32,
}

/// Gains of the velocity loop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct VelocityGains {
    /// S-0-0100 in mA s/rad.
    pub proportional: u32,
    /// S-0-0101 in 0.1 ms.
    pub integral_time: u16,
}

/// Gains of the current loop for a winding of `resistance` in mOhm and `inductance` in uH, both of a phase (half of what is measured
/// between two terminals), such that its -3 dB frequency is `bandwidth` in Hz.
///
/// The current is sampled at the peak of the period, the voltage changes half a period later and holds for a period. Sampled at the peak,
/// the open loop is `k (z^-1 + z^-2) / 2 / (1 - z^-1)`: at the angle p of a frequency its gain is `k / (2 tan(p/2))` and its phase
/// -90 degrees - p. Closed, it has -3 dB at p for
///
/// ```text
/// k = 2 tan(p/2) (sqrt(1 + sin^2 p) - sin p),   gain = k (L/T - R/2),   integral action time = L/R - T/2
/// ```
///
/// with the period T. The halves are what integration in steps of T adds: with them the zero lies on the pole of the sampled winding too.
///
/// The crossing lies where `2 tan(p/2)` is k. A phase margin of 60 degrees is a crossing at p = 30 degrees, and a bandwidth of 0.1698
/// of the frequency: 2 716 Hz at 16 kHz, 1 358 Hz at 8 kHz.
///
/// # Errors
/// [`SettingsError::Zero`] without resistance or inductance; [`SettingsError::OutOfRange`] when the bandwidth is not 10 Hz to the one
/// above, the gain is not within 1 mV/A to 500 V/A, or the integral action time not within a period and 6.5 s: a winding with a shorter
/// time constant cannot be controlled at this rate.
pub fn current_gains(
    resistance: u32,
    inductance: u32,
    bandwidth: u32,
    frequency: PwmFrequency,
) -> Result<CurrentGains, SettingsError> {
    if resistance == 0 {
        return Err(SettingsError::Zero { parameter: "resistance of the winding" });
    }
    if inductance == 0 {
        return Err(SettingsError::Zero { parameter: "inductance of the winding" });
    }
    let hertz = i128::from(frequency.hertz());
    let highest = divide_rounding(hertz.saturating_mul(HIGHEST_BANDWIDTH).saturating_sub(5_000), 10_000) as u32;
    in_range("bandwidth of the current loop", bandwidth, 10, highest)?;
    // Below a sixth of a revolution.
    let angle = |parts: i128| divide_rounding(i128::from(bandwidth) << 32, hertz.saturating_mul(parts)) as u32;
    let half = Rotation::by(angle(2));
    // 2^-31
    let sine = i128::from(half.sine).saturating_mul(half.cosine.into()) >> 30;
    let square = sine.saturating_mul(sine).saturating_add(1 << 62);
    let root = square.unsigned_abs().isqrt().cast_signed();
    let k = divide_rounding(
        i128::from(half.sine).saturating_mul(2).saturating_mul(root.saturating_sub(sine)),
        half.cosine.into(),
    );
    // L - R T / 2 in nH: mOhm / Hz is 10^6 nH.
    let resistive = divide_rounding(i128::from(resistance).saturating_mul(500_000), hertz);
    let inductive = i128::from(inductance).saturating_mul(1_000).saturating_sub(resistive.into());
    // nH / s is 10^-6 mV/A, nH / mOhm is us.
    let proportional = divide_rounding(i128::from(k).saturating_mul(inductive).saturating_mul(hertz), 1_000_000 << 31);
    let time = divide_rounding(inductive, resistance.into());
    let period = 1_000_000_u32.div_ceil(frequency.hertz());
    Ok(CurrentGains {
        proportional: in_range("current loop proportional gain S-0-0106", limited_to_u32(proportional), 1, 500_000)?,
        integral_time: in_range("current loop integral action time S-0-0107", limited_to_u32(time), period, 6_553_500)?,
    })
}

/// Bandwidth with a phase margin of 60 degrees, in 10^-4 of the frequency: its p solves
/// `2 tan(p/2) (sqrt(1 + sin^2 p) - sin p) = 2 tan(15 degrees)`.
const HIGHEST_BANDWIDTH: i128 = 1_698;

/// Gains of the velocity loop for an `inertia` in 10^-7 kg m^2 (motor and load) and a `torque_constant` in uNm/A, that crosses at
/// `bandwidth` in Hz.
///
/// The integral part moves the crossing to 1.03 times that.
///
/// `small_times`: those of the loop in us: velocity filter S-0-0392, filters of the current command, the current loop
/// (inductance / S-0-0106), and what the loop itself delays, [`VelocityRate::delay`].
///
/// ```text
/// gain = inertia * 2 pi * bandwidth / torque constant,   integral action time = 4 / (2 pi * bandwidth)
/// ```
///
/// The integral part takes 14 degrees of phase at the crossing, each small time at most 360 degrees * bandwidth * time. Small times may
/// take 30 degrees: the bandwidth is at most 1 / (12 `small_times`).
///
/// # Errors
/// [`SettingsError::Zero`] without inertia or torque constant; [`SettingsError::OutOfRange`] when the bandwidth is not 1 Hz to the one
/// above, or the gain is not within 1 to 6 553 500 mA s/rad.
pub fn velocity_gains(
    inertia: u32,
    torque_constant: u32,
    bandwidth: u32,
    small_times: u32,
) -> Result<VelocityGains, SettingsError> {
    if inertia == 0 {
        return Err(SettingsError::Zero { parameter: "moment of inertia" });
    }
    if torque_constant == 0 {
        return Err(SettingsError::Zero { parameter: "torque constant" });
    }
    let highest = PHASE_OF_SMALL_TIMES.checked_div(small_times).unwrap_or(HIGHEST_CROSSING).min(HIGHEST_CROSSING);
    in_range("bandwidth of the velocity loop", bandwidth, 1, highest)?;
    let angular = i128::from(bandwidth).saturating_mul(TWO_PI_TIMES_TEN_TO_15);
    // 10^-7 kg m^2 / (10^-6 Nm/A) in mA is 100.
    let proportional = divide_rounding(
        i128::from(inertia).saturating_mul(angular).saturating_mul(100),
        i128::from(torque_constant).saturating_mul(TEN_TO_15),
    );
    let time = divide_rounding(TEN_TO_15.saturating_mul(40_000), angular);
    Ok(VelocityGains {
        proportional: in_range("velocity loop proportional gain S-0-0100", limited_to_u32(proportional), 1, 6_553_500)?,
        // 4 / 2 pi seconds at 1 Hz, 1.4 ms at the highest.
        integral_time: time as u16,
    })
}

/// A twelfth of a second, in us.
const PHASE_OF_SMALL_TIMES: u32 = 83_333;

/// What the loop itself leaves at its shorter period, in Hz.
const HIGHEST_CROSSING: u32 = PHASE_OF_SMALL_TIMES / VelocityRate::TwiceATick.delay(false);

/// Kv-factor S-0-0104 in 0.01 * 1000/min for a velocity loop that crosses at `velocity_bandwidth` in Hz: a quarter of it.
///
/// # Errors
/// [`SettingsError::OutOfRange`] when the bandwidth is not 1 to 6 953 Hz, the range of S-0-0104.
pub fn position_gain(velocity_bandwidth: u32) -> Result<u16, SettingsError> {
    let bandwidth = in_range("bandwidth of the velocity loop", velocity_bandwidth, 1, 6_953)?;
    // 1/s is 6 of 0.01 * 1000/min: 6 * 2 pi / 4. At most 65 531.
    Ok(divide_rounding(
        i128::from(bandwidth).saturating_mul(TWO_PI_TIMES_TEN_TO_15).saturating_mul(6),
        TEN_TO_15.saturating_mul(4),
    ) as u16)
}

/// Acceleration feed-forward S-0-0348 in 0.1 mA s²/rad for an `inertia` in 10^-7 kg m^2 (motor and load) and a `torque_constant` in uNm/A:
/// the one over the other. An inertia that takes less than half a step gets none.
///
/// # Errors
/// [`SettingsError::Zero`] without torque constant; [`SettingsError::OutOfRange`] above 65 535, the range of S-0-0348.
pub fn acceleration_feed_forward(inertia: u32, torque_constant: u32) -> Result<u16, SettingsError> {
    if torque_constant == 0 {
        return Err(SettingsError::Zero { parameter: "torque constant" });
    }
    // 10^-7 kg m^2 / (10^-6 Nm/A) in 0.1 mA is 1000.
    let gain = divide_rounding(i128::from(inertia).saturating_mul(1_000), torque_constant.into());
    let gain = in_range("acceleration feed-forward S-0-0348", limited_to_u32(gain), 0, u16::MAX.into())?;
    Ok(gain as u16)
}

/// Smoothing time P-0-0231 in us of the acceleration feed-forward, for position commands every `cycle` us (S-0-0001): 0.5 ms² / cycle.
///
/// A command is rounded, and what that makes of an acceleration grows with the square of the rate: 0.0001 degrees are 7 rad/s² at 500 us.
/// Every microsecond of smoothing lets a ramp begin later than the set-point. On the press axis (`tests/feed_forward.rs`) this time keeps
/// the ripple that the rounding makes below a tenth of that of the encoder, and costs a few thousandths of a degree where a ramp begins.
#[must_use]
pub const fn acceleration_smoothing(cycle: u16) -> u16 {
    match 500_000_u32.checked_div(cycle as u32) {
        Some(time) if time < 20_000 => time as u16,
        _ => 20_000,
    }
}

/// Whether the steps of an encoder of `increments` a revolution are felt in the torque. `gain`: S-0-0100 in mA s/rad; `peak`: the peak current in mA,
/// both amplitudes or both RMS; `hertz`: the rate of the differences that the measured velocity is made of.
///
/// At constant speed a count more or less in a difference is a step of `gain * 2 pi / increments * hertz`. On the press axis that is a quarter of the
/// peak current in a tick, and a velocity filter of 500 us leaves 1.25 % rms of it. Steps of a fiftieth of the peak current, 0.1 % rms, are left
/// alone.
#[must_use]
pub fn is_felt(gain: u32, increments: u32, peak: u32, hertz: u32) -> bool {
    let step = i128::from(gain).saturating_mul(TWO_PI_TIMES_TEN_TO_15).saturating_mul(hertz.into());
    let felt = i128::from(peak).saturating_mul(increments.into()).saturating_mul(TEN_TO_15) / 50;
    step > felt
}

/// Frequency in 0.1 Hz of the low-pass of the current command that keeps steps which are felt out of the torque; `bandwidth`: of the velocity loop
/// in Hz.
///
/// A low-pass at five times the bandwidth leaves a tenth of them (`tests/paths.rs`). It takes 16 degrees of phase at the crossing, see
/// [`NOISE_DAMPING`].
#[must_use]
pub const fn noise_filter(bandwidth: u32) -> u16 {
    match bandwidth.saturating_mul(50) {
        frequency if frequency < 100 => 100,
        frequency if frequency > 35_000 => 35_000,
        frequency => frequency as u16,
    }
}

/// Velocity filter S-0-0392 in us for an encoder whose steps are felt.
pub const NOISE_TIME: u16 = 500;

/// Damping in 0.001 of the low-pass of [`noise_filter`].
pub const NOISE_DAMPING: u16 = 707;

fn limited_to_u32(value: i64) -> u32 {
    value.clamp(0, u32::MAX.into()) as u32
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::f64::consts::{PI, TAU};

    #[test]
    fn steps_of_a_coarse_encoder_are_felt_and_get_a_low_pass_at_five_times_the_bandwidth() {
        // 13.3 A s/rad, 42.4 A: in a tick a count of 65 536 is 24 % of peak, the 50th is reached at 12 times as many, in half a tick at 24 times.
        for hertz in [8_000, 16_000] {
            let share = |increments: f64| 13.329 * TAU / increments * f64::from(hertz) / 42.426;
            let limit = (share(1.0) * 50.0) as u32;
            assert!((share(limit.into()) - 0.02).abs() < 1e-6);
            assert!(is_felt(13_329, 65_536, 42_426, hertz));
            assert!(is_felt(13_329, limit - 2, 42_426, hertz));
            assert!(!is_felt(13_329, limit + 2, 42_426, hertz));
        }
        assert!(is_felt(u32::MAX, 1, 1, u32::MAX) && !is_felt(0, 1, 1, 16_000));
        assert_eq!([1, 40, 600, 800, u32::MAX].map(noise_filter), [100, 2_000, 30_000, 35_000, 35_000]);
    }

    /// k of the closed form.
    fn gain_of_the_open_loop(bandwidth: f64, hertz: f64) -> f64 {
        let p = TAU * bandwidth / hertz;
        2.0 * (p / 2.0).tan() * ((1.0 + p.sin().powi(2)).sqrt() - p.sin())
    }

    #[test]
    fn current_gains_are_those_of_the_closed_form() {
        for (frequency, hertz, bandwidth) in [
            (PwmFrequency::Khz16, 16_000.0, 1_500),
            (PwmFrequency::Khz16, 16_000.0, 2_716),
            (PwmFrequency::Khz16, 16_000.0, 100),
            (PwmFrequency::Khz8, 8_000.0, 1_000),
        ] {
            let gains = current_gains(700, 3_500, bandwidth, frequency).unwrap();
            let expected = gain_of_the_open_loop(f64::from(bandwidth), hertz) * (0.003_5 * hertz - 0.35) * 1_000.0;
            assert!((f64::from(gains.proportional) / expected - 1.0).abs() < 1e-3, "{bandwidth}: {gains:?} {expected}");
            assert_eq!(gains.integral_time, 5_000 - (500_000.0 / hertz) as u32);
        }
    }

    #[test]
    fn the_highest_bandwidth_leaves_a_phase_margin_of_60_degrees_and_one_more_hertz_is_refused() {
        for (frequency, hertz, highest) in
            [(PwmFrequency::Khz16, 16_000.0, 2_716), (PwmFrequency::Khz8, 8_000.0, 1_358)]
        {
            let gains = current_gains(700, 3_500, highest, frequency).unwrap();
            let k = f64::from(gains.proportional) / 1_000.0 / (0.003_5 * hertz - 0.35);
            let crossing = 2.0 * (k / 2.0).atan();
            let margin = (PI / 2.0 - crossing).to_degrees();
            assert!((60.0..60.05).contains(&margin), "{margin} degrees");
            assert_eq!(
                current_gains(700, 3_500, highest + 1, frequency),
                Err(SettingsError::OutOfRange {
                    parameter: "bandwidth of the current loop",
                    actual: highest + 1,
                    minimum: 10,
                    maximum: highest,
                })
            );
        }
    }

    #[test]
    fn velocity_gains_are_those_of_the_closed_form() {
        // 0.15 kg m^2 and 2 Nm/A; 250 rad/s would be 18.75 A s/rad and 16 ms.
        let gains = velocity_gains(1_500_000, 2_000_000, 40, 250).unwrap();
        let angular = 40.0 * TAU;
        assert_eq!(f64::from(gains.proportional), (0.15 * angular / 2.0 * 1_000.0).round());
        assert_eq!(f64::from(gains.integral_time), (4.0 / angular * 10_000.0).round());
        assert_eq!(position_gain(40), Ok((angular / 4.0 * 6.0).round() as u16));
    }

    #[test]
    fn the_highest_velocity_bandwidth_leaves_a_phase_margin_of_45_degrees() {
        for small_times in [125_u32, 250, 500, 2_000] {
            let delay = f64::from(small_times) * 1e-6;
            let margin = |hertz: u32| {
                // Where (1 / u) sqrt(1 + 1 / (4 u)^2) is 1.
                let crossing = (0.5 + 1.25_f64.sqrt() / 2.0).sqrt();
                (PI / 2.0 - (0.25 / crossing).atan() - crossing * TAU * f64::from(hertz) * delay).to_degrees()
            };
            let Err(SettingsError::OutOfRange { maximum, .. }) = velocity_gains(1_000, 100_000, 1_000_000, small_times)
            else {
                panic!("a megahertz is refused");
            };
            assert!(velocity_gains(1_000, 100_000, maximum, small_times).is_ok());
            assert!((45.3..46.5).contains(&margin(maximum)), "{small_times} us: {}", margin(maximum));
        }
    }

    #[test]
    fn the_feed_forward_is_the_current_that_the_inertia_takes() {
        // 0.15 kg m^2 and 2 Nm/A: 75 mA s²/rad.
        assert_eq!(acceleration_feed_forward(1_500_000, 2_000_000), Ok(750));
        // 1 kg cm^2 and 0.48 Nm/A: 0.208 mA s²/rad.
        assert_eq!(acceleration_feed_forward(1_000, 480_000), Ok(2));
        assert_eq!(acceleration_feed_forward(1, 480_000), Ok(0));
        assert_eq!(acceleration_feed_forward(1, 0), Err(SettingsError::Zero { parameter: "torque constant" }));
        let parameter = "acceleration feed-forward S-0-0348";
        let refused = SettingsError::OutOfRange { parameter, actual: 65_536, minimum: 0, maximum: 65_535 };
        assert_eq!(acceleration_feed_forward(65_536, 1_000), Err(refused));
        assert_eq!(acceleration_feed_forward(65_535, 1_000), Ok(65_535));
        assert_eq!([500, 1_000, 10_000, 65_000, 0].map(acceleration_smoothing), [1_000, 500, 50, 7, 20_000]);
    }

    #[test]
    fn impossible_inputs_are_refused() {
        let frequency = PwmFrequency::Khz16;
        let out_of_range =
            |parameter, actual, minimum, maximum| SettingsError::OutOfRange { parameter, actual, minimum, maximum };
        let zero = |parameter| SettingsError::Zero { parameter };
        assert_eq!(current_gains(0, 1, 1_000, frequency), Err(zero("resistance of the winding")));
        assert_eq!(current_gains(1, 0, 1_000, frequency), Err(zero("inductance of the winding")));
        assert_eq!(velocity_gains(0, 1, 10, 0), Err(zero("moment of inertia")));
        assert_eq!(velocity_gains(1, 0, 10, 0), Err(zero("torque constant")));
        assert!(matches!(
            current_gains(100_000, 200_000_000, 1_000, frequency),
            Err(SettingsError::OutOfRange {
                parameter: "current loop proportional gain S-0-0106",
                maximum: 500_000,
                ..
            })
        ));
        assert_eq!(
            current_gains(1, 10_000, 1_000, frequency),
            Err(out_of_range("current loop integral action time S-0-0107", 9_999_969, 63, 6_553_500))
        );
        assert_eq!(
            current_gains(100_000, 9_300, 1_000, frequency),
            Err(out_of_range("current loop integral action time S-0-0107", 62, 63, 6_553_500))
        );
        assert_eq!(
            velocity_gains(u32::MAX, 1, 10, 0),
            Err(out_of_range("velocity loop proportional gain S-0-0100", u32::MAX, 1, 6_553_500))
        );
        assert_eq!(velocity_gains(1, 1, 0, 0), Err(out_of_range("bandwidth of the velocity loop", 0, 1, 666)));
        assert_eq!(velocity_gains(1, 1, 1, u32::MAX), Err(out_of_range("bandwidth of the velocity loop", 1, 1, 0)));
        assert_eq!(position_gain(6_954), Err(out_of_range("bandwidth of the velocity loop", 6_954, 1, 6_953)));
        assert_eq!(position_gain(0), Err(out_of_range("bandwidth of the velocity loop", 0, 1, 6_953)));
    }
}
