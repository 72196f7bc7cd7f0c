//! Temperature of amplifier or motor from a 12-bit sample, with warning, shut-down and supervision of the sensor.
//!
//! One type serves both places: S-0-0200 and S-0-0203 for the amplifier, S-0-0201 and S-0-0204 for the motor. A sensor with a broken wire and one
//! with a short circuit are errors of their own: their readings are not taken for temperatures. A sensor that knows cold and hot only has no
//! temperature, no warning and no limits: it shuts down where it was made to.

use core::fmt;

use crate::arithmetic::gain::Gain;
use crate::error::{SettingsError, in_range};
use crate::monitor::debounce::{Debounce, ticks_of};
use crate::monitor::thermometer::{CURVE_BITS, Characteristic, Contact, Curve};
use crate::units::SUPERVISION_PERIOD_MICROSECONDS;

/// What S-0-0383 and S-0-0384 show where there is no temperature, in 0.1 °C: colder than any sensor measures.
pub const NO_TEMPERATURE: i16 = -2_000;

/// Parameters of a temperature measurement.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TemperatureParameters {
    /// What the samples mean.
    pub sensor: &'static Characteristic,
    /// Warning temperature (S-0-0200, 0201) in 0.1 °C, below the shut-down temperature.
    pub warning: u16,
    /// Shut-down temperature (S-0-0203, 0204) in 0.1 °C, at most the hottest that the sensor shows.
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
    sensor: &'static Characteristic,
    share: Gain,
    warning: i16,
    shutdown: i16,
    debounce: u32,
}

/// Of a filtered temperature, below 0.1 K: with a filter of a minute a step of the supervision is 2^-17 of what is missing.
const FILTER_BITS: u32 = 20;
/// A condition ends this far below its threshold, in 0.1 K.
const HYSTERESIS: i16 = 50;

impl TemperatureSettings {
    /// Scales the parameters. Divides.
    ///
    /// # Errors
    /// [`SettingsError::OutOfRange`] for a parameter beyond its range, [`SettingsError::BeyondSensor`] for a shut-down temperature that the sensor
    /// cannot show.
    pub fn new(parameters: &TemperatureParameters) -> Result<Self, SettingsError> {
        let hottest = match parameters.sensor {
            Characteristic::Curve(curve) => curve.hottest,
            Characteristic::None | Characteristic::Contact(_) => i16::MAX,
        };
        in_range("filter of the temperature", parameters.filter.into(), 0, 60_000)?;
        let shutdown =
            in_range("shut-down temperature", parameters.shutdown.into(), 1, i16::MAX.unsigned_abs().into())?;
        if parameters.shutdown > hottest.unsigned_abs() {
            return Err(SettingsError::BeyondSensor { actual: parameters.shutdown, hottest: hottest.unsigned_abs() });
        }
        let warning = in_range("warning temperature", parameters.warning.into(), 0, shutdown.saturating_sub(1))?;
        let period = u128::from(SUPERVISION_PERIOD_MICROSECONDS);
        let time_constant = u128::from(parameters.filter).saturating_mul(1_000);
        Ok(Self {
            sensor: parameters.sensor,
            share: Gain::from_ratio(period, period.saturating_add(time_constant)).unwrap_or(Gain::ONE),
            // Range checked.
            warning: warning as i16,
            shutdown: shutdown as i16,
            debounce: ticks_of(parameters.debounce.into()),
        })
    }

    /// Both measure with the same sensor at the same input. Where the compiler keeps a table twice the answer may be no: to compare them would hold
    /// the cycle up.
    pub(crate) fn has_sensor_of(&self, other: &Self) -> bool {
        core::ptr::eq(self.sensor, other.sensor)
    }
}

/// The sensor cannot be believed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum TemperatureError {
    /// The sample is below that of a sound sensor.
    ShortCircuit {
        /// Lowest sample of a sound sensor.
        expected: u16,
        /// Sample of this tick.
        actual: u16,
    },
    /// The sample is above that of a sound sensor.
    BrokenWire {
        /// Highest sample of a sound sensor.
        expected: u16,
        /// Sample of this tick.
        actual: u16,
    },
}

impl fmt::Display for TemperatureError {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::ShortCircuit { expected, actual } => {
                write!(formatter, "temperature sensor short-circuited: {actual} counts, expected at least {expected}")
            }
            Self::BrokenWire { expected, actual } => {
                write!(formatter, "wire of the temperature sensor broken: {actual} counts, expected at most {expected}")
            }
        }
    }
}

impl core::error::Error for TemperatureError {}

/// What a tick says.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct TemperatureOutput {
    /// In 0.1 °C (S-0-0383, S-0-0384); `None` before the first sound sample, while the sensor fails, and where a sensor has no degrees.
    pub temperature: Option<i16>,
    /// Warning temperature reached (C2D bit 1 or 2).
    pub warning: bool,
    /// Shut-down temperature reached (C1D bit 1 or 2); the cause is gone 5 K below. Or the sensor is one that says no more than hot.
    pub shutdown: bool,
    /// The sensor has been out of its range for the debounce time, up to this tick.
    pub error: Option<TemperatureError>,
}

/// State of a temperature measurement.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Temperature {
    /// In 2^-20 of 0.1 °C.
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
        match settings.sensor {
            Characteristic::Curve(curve) => self.measure(settings, curve, sample),
            Characteristic::Contact(contact) => self.watch(settings, contact, sample),
            Characteristic::None => TemperatureOutput::default(),
        }
    }

    #[inline]
    fn measure(&mut self, settings: &TemperatureSettings, curve: &Curve, sample: u16) -> TemperatureOutput {
        let error = if sample < curve.lowest {
            Some(TemperatureError::ShortCircuit { expected: curve.lowest, actual: sample })
        } else if sample > curve.highest {
            Some(TemperatureError::BrokenWire { expected: curve.highest, actual: sample })
        } else {
            let now = i64::from(curve.temperature(sample)) << FILTER_BITS.wrapping_sub(CURVE_BITS);
            let filtered = self.filtered.unwrap_or(now);
            self.filtered = Some(filtered.wrapping_add(settings.share.apply(now.wrapping_sub(filtered))));
            None
        };
        let failed = self.sensor.holds(error.is_some(), settings.debounce);
        if failed {
            // What comes after a repair is another temperature.
            self.filtered = None;
        }
        let temperature = self.filtered.map(rounded);
        if let Some(temperature) = temperature {
            let thresholds = [(&mut self.warning, settings.warning), (&mut self.shutdown, settings.shutdown)];
            for (threshold, limit) in thresholds {
                threshold.tick(temperature, limit, limit.saturating_sub(HYSTERESIS), settings.debounce);
            }
        }
        TemperatureOutput {
            temperature,
            warning: self.warning.reached,
            shutdown: self.shutdown.reached,
            error: error.filter(|_| failed),
        }
    }

    #[inline]
    fn watch(&mut self, settings: &TemperatureSettings, contact: &Contact, sample: u16) -> TemperatureOutput {
        let short = sample < contact.lowest;
        if !short {
            // Samples have 12 bits.
            let [sample, hot, cold] = [sample, contact.hot, contact.cold].map(u16::cast_signed);
            self.shutdown.tick(sample, hot, cold, settings.debounce);
        }
        let failed = self.sensor.holds(short, settings.debounce);
        TemperatureOutput {
            shutdown: self.shutdown.reached,
            error: failed.then_some(TemperatureError::ShortCircuit { expected: contact.lowest, actual: sample }),
            ..TemperatureOutput::default()
        }
    }
}

/// From the filter to 0.1 °C.
#[inline]
const fn rounded(filtered: i64) -> i16 {
    const HALF: i64 = 1 << (FILTER_BITS - 1);
    // A mean of temperatures of an i16.
    (filtered.wrapping_add(HALF) >> FILTER_BITS) as i16
}

/// A value that has been reached for the debounce time, until it is left.
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

    /// Reached at `limit`, left below `end`.
    #[inline]
    fn tick(&mut self, value: i16, limit: i16, end: i16, debounce: u32) {
        if self.debounce.holds(value >= limit, debounce) {
            self.reached = true;
        } else if value < end {
            self.reached = false;
        }
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use std::string::ToString;

    use super::*;
    use crate::monitor::thermometer::{Divider, TemperatureSensor};

    const DIVIDER: Divider = Divider { pull_up: 2_200, supply: 3_300, reference: 3_300 };
    static PTC: Characteristic = Characteristic::of(TemperatureSensor::Ptc, &DIVIDER);
    static SWITCH: Characteristic = Characteristic::of(TemperatureSensor::Switch, &DIVIDER);
    static NONE: Characteristic = Characteristic::of(TemperatureSensor::None, &DIVIDER);

    /// 10 counts per kelvin, 500 counts at 0 °C, 80 and 90 °C.
    static LINE: Characteristic = Characteristic::Curve(Curve::line(500, 100, 4_000));
    const PARAMETERS: TemperatureParameters =
        TemperatureParameters { sensor: &LINE, warning: 800, shutdown: 900, filter: 0, debounce: 10 };

    fn run(settings: &TemperatureSettings, state: &mut Temperature, sample: u16, ticks: u32) -> TemperatureOutput {
        (0..ticks).map(|_| state.tick(settings, sample)).last().unwrap()
    }

    /// What shows `ohms` behind the divider.
    fn sample(ohms: u32) -> u16 {
        (4_096 * ohms / (ohms + DIVIDER.pull_up)) as u16
    }

    #[test]
    fn an_error_of_the_sensor_says_what_was_measured_and_what_a_sound_one_shows() {
        let short = TemperatureError::ShortCircuit { expected: 100, actual: 7 };
        let broken = TemperatureError::BrokenWire { expected: 4_000, actual: 4_095 };
        assert_eq!(short.to_string(), "temperature sensor short-circuited: 7 counts, expected at least 100");
        assert_eq!(broken.to_string(), "wire of the temperature sensor broken: 4095 counts, expected at most 4000");
    }

    #[test]
    fn a_sample_is_the_temperature_of_the_curve() {
        let settings = TemperatureSettings::new(&PARAMETERS).unwrap();
        assert_eq!(Temperature::new().tick(&settings, 753).temperature, Some(253));
        assert_eq!(Temperature::new().tick(&settings, 300).temperature, Some(-200));
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
        // 15 time constants
        let temperature = run(&settings, &mut state, 600, 1_800_000).temperature.unwrap();
        assert!((98..=100).contains(&temperature), "{temperature}");
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
            (4_001, TemperatureError::BrokenWire { expected: 4_000, actual: 4_001 }),
            (99, TemperatureError::ShortCircuit { expected: 100, actual: 99 }),
        ] {
            let mut state = Temperature::new();
            assert_eq!(run(&settings, &mut state, sample, 1).temperature, None);
            run(&settings, &mut state, 750, 5);
            let output = run(&settings, &mut state, sample, 19);
            assert_eq!((output.error, output.temperature), (None, Some(250)), "the last sound one");
            let output = run(&settings, &mut state, sample, 1);
            assert_eq!((output.error, output.temperature), (Some(expected), None));
            assert!(!output.warning && !output.shutdown);
            let output = run(&settings, &mut state, 900, 1);
            assert_eq!((output.error, output.temperature), (None, Some(400)), "the first sound one, unfiltered");
        }
        assert_eq!(run(&settings, &mut Temperature::new(), 100, 1_000).error, None);
        assert_eq!(run(&settings, &mut Temperature::new(), 4_000, 1_000).error, None);
    }

    #[test]
    fn a_sensor_that_breaks_while_it_is_hot_leaves_the_motor_hot() {
        let settings = TemperatureSettings::new(&PARAMETERS).unwrap();
        let mut state = Temperature::new();
        assert!(run(&settings, &mut state, 1_500, 20).shutdown);
        let output = run(&settings, &mut state, 4_095, 1_000);
        assert!(output.shutdown && output.warning && output.error.is_some());
        assert!(!run(&settings, &mut state, 600, 1).shutdown);
    }

    #[test]
    fn a_ptc_shuts_down_above_its_resistance_whatever_the_limits_say_and_lets_go_below_another() {
        let settings = TemperatureSettings::new(&TemperatureParameters { sensor: &PTC, ..PARAMETERS }).unwrap();
        let mut state = Temperature::new();
        // Three in series 5 K below their temperature, and just below what trips.
        for ohms in [60, 1_650, 3_290] {
            assert_eq!(run(&settings, &mut state, sample(ohms), 1_000), TemperatureOutput::default(), "{ohms}");
        }
        assert!(!run(&settings, &mut state, sample(3_310), 19).shutdown);
        let hot = run(&settings, &mut state, sample(3_310), 1);
        assert_eq!(hot, TemperatureOutput { shutdown: true, ..TemperatureOutput::default() }, "no degrees, no warning");
        assert!(run(&settings, &mut state, sample(1_810), 1_000).shutdown);
        assert!(!run(&settings, &mut state, sample(1_790), 1).shutdown);
        // A broken wire cannot be told from a hot motor.
        assert!(run(&settings, &mut state, 4_095, 20).shutdown);
    }

    #[test]
    fn a_ptc_of_no_resistance_is_short_circuited_and_does_not_cool_a_hot_motor() {
        let settings = TemperatureSettings::new(&TemperatureParameters { sensor: &PTC, ..PARAMETERS }).unwrap();
        let mut state = Temperature::new();
        run(&settings, &mut state, sample(5_000), 20);
        assert_eq!(run(&settings, &mut state, 0, 19).error, None);
        let output = run(&settings, &mut state, 0, 1);
        assert_eq!(output.error, Some(TemperatureError::ShortCircuit { expected: 36, actual: 0 }));
        assert!(output.shutdown);
        assert_eq!(run(&settings, &mut state, sample(21), 1), TemperatureOutput::default());
    }

    #[test]
    fn a_switch_shuts_down_when_it_opens_and_its_closed_contact_is_no_short_circuit() {
        let settings = TemperatureSettings::new(&TemperatureParameters { sensor: &SWITCH, ..PARAMETERS }).unwrap();
        let mut state = Temperature::new();
        assert_eq!(run(&settings, &mut state, 0, 1_000), TemperatureOutput::default());
        assert!(!run(&settings, &mut state, 4_095, 19).shutdown);
        assert!(run(&settings, &mut state, 4_095, 1).shutdown);
        assert_eq!(run(&settings, &mut state, sample(100), 1), TemperatureOutput::default());
    }

    #[test]
    fn without_a_sensor_nothing_is_seen() {
        let settings = TemperatureSettings::new(&TemperatureParameters { sensor: &NONE, ..PARAMETERS }).unwrap();
        let mut state = Temperature::new();
        for sample in [0, 2_000, 4_095] {
            assert_eq!(run(&settings, &mut state, sample, 1_000), TemperatureOutput::default());
        }
    }

    #[test]
    fn other_limits_are_of_the_same_measurement_and_another_sensor_is_of_another() {
        let settings = |parameters| TemperatureSettings::new(&parameters).unwrap();
        let line = settings(PARAMETERS);
        assert!(line.has_sensor_of(&settings(TemperatureParameters { warning: 500, filter: 3, ..PARAMETERS })));
        assert!(!line.has_sensor_of(&settings(TemperatureParameters { sensor: &PTC, ..PARAMETERS })));
        assert_eq!(NO_TEMPERATURE, -2_000, "colder than any sensor measures");
    }

    #[test]
    fn impossible_settings_are_refused() {
        let refused =
            |parameters| matches!(TemperatureSettings::new(&parameters), Err(SettingsError::OutOfRange { .. }));
        assert!(refused(TemperatureParameters { filter: 60_001, ..PARAMETERS }));
        assert!(refused(TemperatureParameters { warning: 900, ..PARAMETERS }));
        assert!(!refused(TemperatureParameters { warning: 899, ..PARAMETERS }));
        assert!(refused(TemperatureParameters { shutdown: 0, ..PARAMETERS }));
        assert!(refused(TemperatureParameters { shutdown: 32_768, sensor: &PTC, ..PARAMETERS }));
        let hotter_than_shown = TemperatureSettings::new(&TemperatureParameters { shutdown: 3_001, ..PARAMETERS });
        assert_eq!(hotter_than_shown, Err(SettingsError::BeyondSensor { actual: 3_001, hottest: 3_000 }));
        assert!(TemperatureSettings::new(&TemperatureParameters { shutdown: 3_000, ..PARAMETERS }).is_ok());
        assert!(!refused(TemperatureParameters { sensor: &PTC, shutdown: 32_767, ..PARAMETERS }));
    }
}
