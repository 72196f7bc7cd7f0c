//! Temperature of amplifier, motor or cooling from a 12-bit sample, with warning, shut-down and supervision of the sensor.
//!
//! One type serves all three places: S-0-0200 and S-0-0203 for the amplifier, S-0-0201 and S-0-0204 for the motor, S-0-0202 and
//! S-0-0205 for the cooling. A sensor that is broken or short is an error of its own: its reading is not taken for a temperature.

use core::fmt;

use crate::arithmetic::gain::Gain;
use crate::error::{SettingsError, in_range};
use crate::monitor::debounce::{Debounce, ticks_of};
use crate::units::SUPERVISION_PERIOD_MICROSECONDS;

/// Parameters of a temperature measurement.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TemperatureParameters {
    /// Sample at 0 °C; may lie outside the converter's range.
    pub zero_counts: i16,
    /// Slope of the sensor in 1/1000 count per kelvin, negative when the sample falls with temperature; 50 to 1 000 000 in magnitude.
    pub millicounts_per_kelvin: i32,
    /// Lowest sample of a sound sensor.
    pub lowest_sample: u16,
    /// Highest sample of a sound sensor, at most 4095.
    pub highest_sample: u16,
    /// Warning temperature (S-0-0200, 0201, 0202) in 0.1 °C, below the shut-down temperature.
    pub warning: u16,
    /// Shut-down temperature (S-0-0203, 0204, 0205) in 0.1 °C, at most 32 767.
    pub shutdown: u16,
    /// Time constant of the filter in ms, at most 60 000.
    pub filter: u16,
    /// Time in ms for which a condition must hold before it counts.
    pub debounce: u16,
}

/// A temperature measurement, scaled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct TemperatureSettings {
    /// In 2^-20 count.
    zero: i64,
    /// From 2^-20 count to 0.1 K.
    kelvins: Gain,
    falling: bool,
    share: Gain,
    lowest_sample: u16,
    highest_sample: u16,
    warning: i16,
    shutdown: i16,
    debounce: u32,
}

const COUNT_BITS: u32 = 20;
/// A condition ends this far below its threshold, in 0.1 K.
const HYSTERESIS: i16 = 50;

impl TemperatureSettings {
    /// Scales the parameters. Divides.
    ///
    /// # Errors
    /// [`SettingsError::OutOfRange`] for a parameter beyond its range.
    pub fn new(parameters: &TemperatureParameters) -> Result<Self, SettingsError> {
        let slope = parameters.millicounts_per_kelvin.unsigned_abs();
        in_range("slope of the temperature sensor", slope, 50, 1_000_000)?;
        let highest = in_range("highest sample of the temperature sensor", parameters.highest_sample.into(), 1, 4_095)?;
        in_range("lowest sample of the temperature sensor", parameters.lowest_sample.into(), 0, highest)?;
        in_range("filter of the temperature", parameters.filter.into(), 0, 60_000)?;
        let shutdown =
            in_range("shut-down temperature", parameters.shutdown.into(), 1, i16::MAX.unsigned_abs().into())?;
        let warning = in_range("warning temperature", parameters.warning.into(), 0, shutdown.saturating_sub(1))?;
        let period = u128::from(SUPERVISION_PERIOD_MICROSECONDS);
        let time_constant = u128::from(parameters.filter).saturating_mul(1_000);
        Ok(Self {
            zero: i64::from(parameters.zero_counts) << COUNT_BITS,
            kelvins: Gain::from_ratio(10_000, u128::from(slope) << COUNT_BITS).unwrap_or(Gain::ZERO),
            falling: parameters.millicounts_per_kelvin < 0,
            share: Gain::from_ratio(period, period.saturating_add(time_constant)).unwrap_or(Gain::ONE),
            lowest_sample: parameters.lowest_sample,
            highest_sample: parameters.highest_sample,
            // Range checked.
            warning: warning as i16,
            shutdown: shutdown as i16,
            debounce: ticks_of(parameters.debounce.into()),
        })
    }
}

/// The sensor cannot be believed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum TemperatureError {
    /// The sample is below that of a sound sensor: a short circuit, or a broken wire where the sensor pulls up.
    BelowRange {
        /// Lowest sample of a sound sensor.
        expected: u16,
        /// Sample of this tick.
        actual: u16,
    },
    /// The sample is above that of a sound sensor: a broken wire, or a short circuit where the sensor pulls up.
    AboveRange {
        /// Highest sample of a sound sensor.
        expected: u16,
        /// Sample of this tick.
        actual: u16,
    },
}

impl fmt::Display for TemperatureError {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::BelowRange { expected, actual } => {
                write!(formatter, "temperature sensor at {actual} counts, expected at least {expected}")
            }
            Self::AboveRange { expected, actual } => {
                write!(formatter, "temperature sensor at {actual} counts, expected at most {expected}")
            }
        }
    }
}

impl core::error::Error for TemperatureError {}

/// What a tick says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct TemperatureOutput {
    /// In 0.1 °C (S-0-0383, S-0-0384); `None` before the first sound sample. While the sensor fails, the last one that was sound.
    pub temperature: Option<i16>,
    /// Warning temperature reached (C2D bit 1, 2 or 3).
    pub warning: bool,
    /// Shut-down temperature reached (C1D bit 1, 2 or 3); the cause is gone 5 K below.
    pub shutdown: bool,
    /// The sensor has been out of its range for the debounce time, up to this tick.
    pub error: Option<TemperatureError>,
}

/// State of a temperature measurement.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Temperature {
    /// In 2^-20 count.
    filtered: Option<i64>,
    warning: Threshold,
    shutdown: Threshold,
    sensor: Debounce,
}

impl Temperature {
    /// Starts without a sample: the first sound one is taken as it is, unfiltered.
    #[must_use]
    pub const fn new() -> Self {
        Self { filtered: None, warning: Threshold::new(), shutdown: Threshold::new(), sensor: Debounce::new() }
    }

    /// Takes the sample of a tick, 0 ..= 4095.
    #[inline]
    pub fn tick(&mut self, settings: &TemperatureSettings, sample: u16) -> TemperatureOutput {
        let error = if sample < settings.lowest_sample {
            Some(TemperatureError::BelowRange { expected: settings.lowest_sample, actual: sample })
        } else if sample > settings.highest_sample {
            Some(TemperatureError::AboveRange { expected: settings.highest_sample, actual: sample })
        } else {
            self.filter(settings, sample);
            None
        };
        let failed = self.sensor.holds(error.is_some(), settings.debounce);
        let temperature = self.filtered.map(|filtered| scaled(settings, filtered));
        if let Some(temperature) = temperature {
            self.warning.tick(temperature, settings.warning, settings.debounce);
            self.shutdown.tick(temperature, settings.shutdown, settings.debounce);
        }
        TemperatureOutput {
            temperature,
            warning: self.warning.reached,
            shutdown: self.shutdown.reached,
            error: error.filter(|_| failed),
        }
    }

    #[inline]
    fn filter(&mut self, settings: &TemperatureSettings, sample: u16) {
        let sample = i64::from(sample) << COUNT_BITS;
        let filtered = self.filtered.unwrap_or(sample);
        self.filtered = Some(filtered.wrapping_add(settings.share.apply(sample.wrapping_sub(filtered))));
    }
}

#[inline]
fn scaled(settings: &TemperatureSettings, filtered: i64) -> i16 {
    let above_zero = filtered.wrapping_sub(settings.zero);
    let above_zero = if settings.falling { above_zero.wrapping_neg() } else { above_zero };
    // Clamped to the range of i16.
    settings.kelvins.apply(above_zero).clamp(i64::from(i16::MIN), i64::from(i16::MAX)) as i16
}

/// A temperature that has been reached for the debounce time, until it is left by 5 K.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
struct Threshold {
    debounce: Debounce,
    reached: bool,
}

impl Threshold {
    const fn new() -> Self {
        Self { debounce: Debounce::new(), reached: false }
    }

    #[inline]
    fn tick(&mut self, temperature: i16, threshold: i16, debounce: u32) {
        if self.debounce.holds(temperature >= threshold, debounce) {
            self.reached = true;
        } else if temperature < threshold.saturating_sub(HYSTERESIS) {
            self.reached = false;
        }
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use std::string::ToString;

    use super::*;
    use proptest::prelude::*;

    /// 10 counts per kelvin, 500 counts at 0 °C, 80 and 90 °C.
    const PARAMETERS: TemperatureParameters = TemperatureParameters {
        zero_counts: 500,
        millicounts_per_kelvin: 10_000,
        lowest_sample: 100,
        highest_sample: 4_000,
        warning: 800,
        shutdown: 900,
        filter: 0,
        debounce: 10,
    };

    fn run(settings: &TemperatureSettings, state: &mut Temperature, sample: u16, ticks: u32) -> TemperatureOutput {
        (0..ticks).map(|_| state.tick(settings, sample)).last().unwrap()
    }

    #[test]
    fn an_error_of_the_sensor_says_what_was_measured_and_what_a_sound_one_shows() {
        let below = TemperatureError::BelowRange { expected: 100, actual: 7 };
        let above = TemperatureError::AboveRange { expected: 4_000, actual: 4_095 };
        assert_eq!(below.to_string(), "temperature sensor at 7 counts, expected at least 100");
        assert_eq!(above.to_string(), "temperature sensor at 4095 counts, expected at most 4000");
    }

    #[test]
    fn a_sample_is_the_temperature_of_the_line() {
        let rising = TemperatureSettings::new(&PARAMETERS).unwrap();
        assert_eq!(Temperature::new().tick(&rising, 753).temperature, Some(253));
        assert_eq!(Temperature::new().tick(&rising, 300).temperature, Some(-200));
        let falling = TemperatureParameters { millicounts_per_kelvin: -25_000, zero_counts: 3_500, ..PARAMETERS };
        let falling = TemperatureSettings::new(&falling).unwrap();
        assert_eq!(Temperature::new().tick(&falling, 2_500).temperature, Some(400));
    }

    #[test]
    fn the_filter_rises_to_63_percent_in_its_time_constant() {
        let settings = TemperatureSettings::new(&TemperatureParameters { filter: 1_000, ..PARAMETERS }).unwrap();
        let mut state = Temperature::new();
        assert_eq!(run(&settings, &mut state, 500, 100).temperature, Some(0));
        let temperature = run(&settings, &mut state, 1_500, 2_000).temperature.unwrap();
        assert!((628..=636).contains(&temperature), "{temperature}");
    }

    #[test]
    fn the_slowest_filter_settles_on_the_sample() {
        let settings = TemperatureSettings::new(&TemperatureParameters { filter: 60_000, ..PARAMETERS }).unwrap();
        let mut state = Temperature::new();
        state.tick(&settings, 500);
        // 15 time constants; a step of half a count is 0.05 K
        let temperature = run(&settings, &mut state, 600, 1_800_000).temperature.unwrap();
        assert!((97..=100).contains(&temperature), "{temperature}");
    }

    #[test]
    fn warning_and_shutdown_come_after_the_debounce_time_and_go_five_kelvins_below() {
        let settings = TemperatureSettings::new(&PARAMETERS).unwrap();
        let mut state = Temperature::new();
        assert!(!run(&settings, &mut state, 1_299, 1_000).warning, "79.9 °C");
        assert!(!run(&settings, &mut state, 1_300, 19).warning, "80 °C, 19 ticks");
        assert!(run(&settings, &mut state, 1_300, 1).warning);
        assert!(!run(&settings, &mut state, 1_399, 1_000).shutdown);
        assert!(!run(&settings, &mut state, 1_400, 19).shutdown);
        let hot = run(&settings, &mut state, 1_400, 1);
        assert!(hot.shutdown && hot.warning);
        assert!(run(&settings, &mut state, 1_350, 1_000).shutdown, "85.0 °C");
        assert!(!run(&settings, &mut state, 1_349, 1).shutdown);
        assert!(run(&settings, &mut state, 1_250, 1_000).warning, "75.0 °C");
        assert!(!run(&settings, &mut state, 1_249, 1).warning);
    }

    #[test]
    fn a_broken_sensor_is_an_error_and_not_a_temperature() {
        let settings = TemperatureSettings::new(&PARAMETERS).unwrap();
        for (sample, expected) in [
            (4_001, TemperatureError::AboveRange { expected: 4_000, actual: 4_001 }),
            (99, TemperatureError::BelowRange { expected: 100, actual: 99 }),
        ] {
            let mut state = Temperature::new();
            assert_eq!(run(&settings, &mut state, sample, 1).temperature, None);
            run(&settings, &mut state, 750, 5);
            assert_eq!(run(&settings, &mut state, sample, 19).error, None);
            let output = run(&settings, &mut state, sample, 1);
            assert_eq!(output.error, Some(expected));
            assert_eq!(output.temperature, Some(250), "the last sound one");
            assert!(!output.warning && !output.shutdown);
            assert_eq!(run(&settings, &mut state, 750, 1).error, None);
        }
        assert_eq!(run(&settings, &mut Temperature::new(), 100, 1_000).error, None);
        assert_eq!(run(&settings, &mut Temperature::new(), 4_000, 1_000).error, None);
    }

    #[test]
    fn impossible_settings_are_refused() {
        let refused =
            |parameters| matches!(TemperatureSettings::new(&parameters), Err(SettingsError::OutOfRange { .. }));
        assert!(refused(TemperatureParameters { millicounts_per_kelvin: 49, ..PARAMETERS }));
        assert!(refused(TemperatureParameters { highest_sample: 4_096, ..PARAMETERS }));
        assert!(refused(TemperatureParameters { lowest_sample: 4_001, ..PARAMETERS }));
        assert!(refused(TemperatureParameters { filter: 60_001, ..PARAMETERS }));
        assert!(refused(TemperatureParameters { warning: 900, ..PARAMETERS }));
        assert!(refused(TemperatureParameters { shutdown: 32_768, ..PARAMETERS }));
        assert!(!refused(TemperatureParameters { warning: 899, ..PARAMETERS }));
    }

    proptest! {
        #[test]
        fn any_line_gives_the_exact_temperature_to_a_tenth(
            zero in -4_000_i16..4_000, slope in prop_oneof![50_i32..1_000_000, -1_000_000_i32..-50], sample in 0_u16..4_096,
        ) {
            let parameters = TemperatureParameters {
                zero_counts: zero, millicounts_per_kelvin: slope, lowest_sample: 0, highest_sample: 4_095, ..PARAMETERS
            };
            let settings = TemperatureSettings::new(&parameters).unwrap();
            let exact = (f64::from(sample) - f64::from(zero)) * 10_000.0 / f64::from(slope);
            let temperature = Temperature::new().tick(&settings, sample).temperature.unwrap();
            let exact = exact.clamp(-32_768.0, 32_767.0);
            prop_assert!((f64::from(temperature) - exact).abs() <= 0.51, "{} instead of {}", temperature, exact);
        }
    }
}
