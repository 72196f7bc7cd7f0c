//! Voltage of the DC bus: supervision, and the reciprocal that turns a voltage command into a duty cycle without a division.
//!
//! The reciprocal `r` of the filtered voltage `V` is followed with Newton's iteration, one step a tick of the supervision: `r := r (2 - V r)`. It squares
//! the relative error, so behind a filtered voltage it is always exact to the last bits. From far below it doubles at each step; from
//! far above the iteration would turn negative, so a step never takes more than half away.

use core::fmt;

use crate::arithmetic::gain::Gain;
use crate::error::{SettingsError, in_range};
use crate::monitor::debounce::{Debounce, ticks_of};
use crate::units::SUPERVISION_PERIOD_MICROSECONDS;

/// Voltage in V, steps of 2^-16 V.
pub type Volts = fixed::types::I16F16;

/// Part of the bus voltage, -2 ..= 2 - 2^-30: beyond +-1 the modulator cannot follow.
pub type Duty = fixed::types::I2F30;

/// Parameters of the bus voltage, in V unless said otherwise.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct VoltageParameters {
    /// Voltage of a sample of 4096, 50 ..= 4000.
    pub full_scale: u16,
    /// Time constant of the filter in microseconds.
    pub filter: u16,
    /// Below this voltage there is undervoltage (C1D bit 9).
    pub undervoltage: u16,
    /// Above this voltage there is overvoltage (C1D bit 8); at most the full scale.
    pub overvoltage: u16,
    /// Main power counts as present from this voltage on...
    pub power_on: u16,
    /// ... until it is below this one, which is less.
    pub power_off: u16,
    /// Time in ms for which undervoltage must last before it counts.
    pub undervoltage_time: u16,
    /// Ticks for which overvoltage must last before it counts: a capacitor that is charged by a braking motor does not wait for milliseconds.
    pub overvoltage_ticks: u8,
}

/// The bus voltage, scaled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct VoltageSettings {
    /// Counts to 2^-24 V.
    volts: Gain,
    share: Gain,
    /// Thresholds in 2^-24 V.
    undervoltage: i64,
    undervoltage_end: i64,
    overvoltage: i64,
    overvoltage_end: i64,
    power_on: i64,
    power_off: i64,
    undervoltage_ticks: u32,
    overvoltage_ticks: u32,
}

/// Filtered in 2^-24 V: below the quantum of the filter with the longest time constant.
const FINE_BITS: u32 = 24;
/// Under- and overvoltage end 1/32 inside their thresholds.
const HYSTERESIS_SHIFT: u32 = 5;

impl VoltageSettings {
    /// Scales the parameters. Divides.
    ///
    /// # Errors
    /// [`SettingsError::OutOfRange`] for a parameter beyond its range or thresholds in the wrong order.
    pub fn new(parameters: &VoltageParameters) -> Result<Self, SettingsError> {
        let full_scale = in_range("bus voltage at full scale", parameters.full_scale.into(), 50, 4_000)?;
        let overvoltage = in_range("overvoltage threshold", parameters.overvoltage.into(), 1, full_scale)?;
        in_range("undervoltage threshold", parameters.undervoltage.into(), 0, overvoltage.saturating_sub(1))?;
        let power_on = in_range("main power threshold", parameters.power_on.into(), 1, overvoltage)?;
        in_range("main power off threshold", parameters.power_off.into(), 0, power_on.saturating_sub(1))?;
        let period = u128::from(SUPERVISION_PERIOD_MICROSECONDS);
        let fine = |volts: u16| i64::from(volts) << FINE_BITS;
        let (undervoltage, overvoltage) = (fine(parameters.undervoltage), fine(parameters.overvoltage));
        Ok(Self {
            volts: Gain::from_ratio(u128::from(full_scale) << FINE_BITS, 4_096 << SAMPLE_BITS).unwrap_or(Gain::ZERO),
            share: Gain::from_ratio(period, period.saturating_add(parameters.filter.into())).unwrap_or(Gain::ONE),
            undervoltage,
            undervoltage_end: undervoltage.saturating_add(undervoltage >> HYSTERESIS_SHIFT),
            overvoltage,
            overvoltage_end: overvoltage.saturating_sub(overvoltage >> HYSTERESIS_SHIFT),
            power_on: fine(parameters.power_on),
            power_off: fine(parameters.power_off),
            undervoltage_ticks: ticks_of(parameters.undervoltage_time.into()),
            overvoltage_ticks: parameters.overvoltage_ticks.into(),
        })
    }

    /// Voltage of a sample in 2^-24 V.
    #[inline]
    fn fine_volts(&self, sample: u16) -> i64 {
        self.volts.apply(i64::from(sample) << SAMPLE_BITS)
    }
}

/// Samples enter the scaling with so many more bits: a factor must stay below 2^24.
const SAMPLE_BITS: u32 = 16;

/// The bus voltage is out of its range.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum VoltageError {
    /// C1D bit 9.
    Undervoltage {
        /// Lowest voltage in mV.
        expected: u32,
        /// Filtered voltage in mV.
        actual: u32,
    },
    /// C1D bit 8.
    Overvoltage {
        /// Highest voltage in mV.
        expected: u32,
        /// Voltage of this tick's sample in mV.
        actual: u32,
    },
}

impl fmt::Display for VoltageError {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Undervoltage { expected, actual } => {
                write!(formatter, "bus voltage of {actual} mV, expected at least {expected} mV")
            }
            Self::Overvoltage { expected, actual } => {
                write!(formatter, "bus voltage of {actual} mV, expected at most {expected} mV")
            }
        }
    }
}

impl core::error::Error for VoltageError {}

/// What a tick says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct VoltageOutput {
    /// Filtered voltage (S-0-0380).
    pub voltage: Volts,
    /// Reciprocal of the filtered voltage.
    pub reciprocal: Reciprocal,
    /// Main power is present (status word bits 15, 14 not 01).
    pub main_power: bool,
    /// The bus is not below the undervoltage threshold: a stop can be finished out of it, with or without main power.
    pub sustains: bool,
    /// Stands as long as its cause. A drive without main power has undervoltage: it only matters with torque on.
    pub error: Option<VoltageError>,
}

/// State of the bus voltage.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct BusVoltage {
    /// In 2^-24 V.
    filtered: i64,
    reciprocal: Reciprocal,
    main_power: bool,
    below: Debounce,
    above: Debounce,
    undervoltage: bool,
    overvoltage: bool,
}

impl BusVoltage {
    /// Starts with this sample as the filtered voltage.
    #[must_use]
    pub fn new(settings: &VoltageSettings, sample: u16) -> Self {
        Self {
            filtered: settings.fine_volts(sample),
            reciprocal: Reciprocal::SMALLEST,
            main_power: false,
            below: Debounce::new(),
            above: Debounce::new(),
            undervoltage: false,
            overvoltage: false,
        }
    }

    /// Takes the sample of a tick, 0 ..= 4095.
    #[inline]
    pub fn tick(&mut self, settings: &VoltageSettings, sample: u16) -> VoltageOutput {
        let now = settings.fine_volts(sample);
        self.filtered = self.filtered.wrapping_add(settings.share.apply(now.wrapping_sub(self.filtered)));
        let filtered = self.filtered;
        let voltage = to_volts(filtered);
        self.reciprocal = self.reciprocal.refined(voltage);

        self.main_power = filtered >= if self.main_power { settings.power_off } else { settings.power_on };
        let below = self.below.holds(filtered < settings.undervoltage, settings.undervoltage_ticks);
        self.undervoltage = below || (self.undervoltage && filtered < settings.undervoltage_end);
        // The sample itself: the filter's delay would let the voltage pass the threshold, and the count of ticks keeps noise out.
        let above = self.above.holds(now > settings.overvoltage, settings.overvoltage_ticks);
        self.overvoltage = above || (self.overvoltage && now > settings.overvoltage_end);

        let error = if self.overvoltage {
            Some(VoltageError::Overvoltage { expected: millivolts(settings.overvoltage), actual: millivolts(now) })
        } else if self.undervoltage {
            Some(VoltageError::Undervoltage {
                expected: millivolts(settings.undervoltage),
                actual: millivolts(filtered),
            })
        } else {
            None
        };
        let sustains = filtered >= settings.undervoltage;
        VoltageOutput { voltage, reciprocal: self.reciprocal, main_power: self.main_power, sustains, error }
    }
}

#[inline]
fn to_volts(fine: i64) -> Volts {
    // At most 4000 V: 28 bits.
    Volts::from_bits((fine >> 8) as i32)
}

#[inline]
fn millivolts(fine: i64) -> u32 {
    // At most 4 000 000, never negative.
    ((fine >> 8).wrapping_mul(1_000).wrapping_add(1 << 15) >> 16) as u32
}

/// Reciprocal of a voltage, followed one Newton step at a time; valid for 20 to 1000 V.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Reciprocal {
    /// In 2^-35 per volt: 1/20 V is 31 bits.
    bits: i32,
}

/// Voltages below and above count as these, in 2^-16 V.
const LOWEST: i32 = 20 << 16;
const HIGHEST: i32 = 1_000 << 16;
/// 1 in 2^-30.
const ONE: i64 = 1 << 30;

impl Reciprocal {
    /// 1/1000 V: a modulator that does not know the voltage yet gives too little, not too much.
    pub const SMALLEST: Self = Self { bits: 34_359_738 };

    /// One step nearer to the reciprocal of `voltage`; at most 12 steps to 0.01 % from any start.
    #[inline]
    #[must_use]
    pub fn refined(self, voltage: Volts) -> Self {
        let voltage = voltage.to_bits().clamp(LOWEST, HIGHEST);
        // 2^-16 * 2^-35 = 2^-51, to 2^-30
        let product = i64::from(voltage).wrapping_mul(i64::from(self.bits)) >> 21;
        let factor = (ONE << 1).wrapping_sub(product).max(ONE >> 1);
        // The factor is at most 2 and the result at most 1/20 V.
        let bits = i64::from(self.bits).wrapping_mul(factor).wrapping_add(ONE >> 1) >> 30;
        Self { bits: bits.clamp(1, i64::from(i32::MAX)) as i32 }
    }

    /// 2^44 divided by the voltage in 2^-14 V: the form that [`crate::current::BusScale::new`] takes.
    #[inline]
    #[must_use]
    pub const fn of_fine_volts(self) -> i32 {
        // 2^30 per volt, from 2^35 per volt.
        self.bits >> 5
    }

    /// `voltage` as a part of the bus voltage, limited to the range of [`Duty`].
    #[inline]
    #[must_use]
    pub fn duty(self, voltage: Volts) -> Duty {
        let product = i64::from(voltage.to_bits()).wrapping_mul(i64::from(self.bits)).wrapping_add(1 << 20) >> 21;
        // Clamped to the range of i32.
        Duty::from_bits(product.clamp(i64::from(i32::MIN), i64::from(i32::MAX)) as i32)
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use std::string::ToString;

    use super::*;
    use proptest::prelude::*;

    /// 1000 V at full scale, a 560 V bus.
    const PARAMETERS: VoltageParameters = VoltageParameters {
        full_scale: 1_000,
        filter: 0,
        undervoltage: 300,
        overvoltage: 800,
        power_on: 450,
        power_off: 350,
        undervoltage_time: 5,
        overvoltage_ticks: 3,
    };

    fn sample(volts: f64) -> u16 {
        (volts * 4.096).round() as u16
    }

    fn run(state: &mut BusVoltage, settings: &VoltageSettings, volts: f64, ticks: u32) -> VoltageOutput {
        (0..ticks).map(|_| state.tick(settings, sample(volts))).last().unwrap()
    }

    fn relative_error(reciprocal: Reciprocal, volts: f64) -> f64 {
        f64::from(reciprocal.bits) / f64::from(1_u32 << 31) / 16.0 * volts - 1.0
    }

    #[test]
    fn a_voltage_at_its_threshold_is_good_and_one_count_beyond_is_not() {
        let settings = VoltageSettings::new(&PARAMETERS).unwrap();
        let at = |sample: u16| settings.fine_volts(sample);
        let settings = VoltageSettings {
            undervoltage: at(1_000),
            undervoltage_end: at(1_100),
            overvoltage: at(3_000),
            overvoltage_end: at(2_900),
            undervoltage_ticks: 1,
            overvoltage_ticks: 1,
            ..settings
        };
        let mut state = BusVoltage::new(&settings, 2_000);
        for (sample, good, sustains) in [
            (1_000, true, true),
            (999, false, false),
            (1_099, false, true),
            (1_100, true, true),
            (3_000, true, true),
            (3_001, false, true),
            (2_901, false, true),
            (2_900, true, true),
        ] {
            let output = state.tick(&settings, sample);
            assert_eq!((output.error.is_none(), output.sustains), (good, sustains), "{sample}");
        }
    }

    #[test]
    fn an_error_of_the_voltage_says_what_there_is_and_what_there_should_be() {
        let low = VoltageError::Undervoltage { expected: 300_000, actual: 299_000 };
        let high = VoltageError::Overvoltage { expected: 800_000, actual: 801_000 };
        assert_eq!(low.to_string(), "bus voltage of 299000 mV, expected at least 300000 mV");
        assert_eq!(high.to_string(), "bus voltage of 801000 mV, expected at most 800000 mV");
    }

    #[test]
    fn millivolts_reciprocals_and_duties_are_rounded_to_the_nearest() {
        assert_eq!([0, 10_066, 1 << FINE_BITS].map(millivolts), [0, 1, 1_000]);
        for volts in [20, 24, 320, 560, 999] {
            let exact = (1_i64 << 35) / volts;
            let reciprocal = (0..20).fold(Reciprocal::SMALLEST, |last, _| last.refined(Volts::from_num(volts)));
            assert!((i64::from(reciprocal.bits) - exact).abs() <= 1, "1/{volts} V: {}, not {exact}", reciprocal.bits);
            assert_eq!(i64::from(reciprocal.of_fine_volts()), i64::from(reciprocal.bits) / 32);
        }
        let smallest = Reciprocal { bits: 1 };
        assert_eq!([(1 << 20) - 1, 1 << 20].map(|bits| smallest.duty(Volts::from_bits(bits)).to_bits()), [0, 1]);
    }

    #[test]
    fn a_sample_is_its_voltage() {
        let settings = VoltageSettings::new(&PARAMETERS).unwrap();
        let mut state = BusVoltage::new(&settings, 2_048);
        assert_eq!(state.tick(&settings, 2_048).voltage, Volts::from_num(500));
        let voltage = state.tick(&settings, 4_095).voltage.to_num::<f64>();
        assert!((voltage - 4_095.0 / 4.096).abs() < 0.000_1, "{voltage}");
    }

    #[test]
    fn the_filter_rises_to_63_percent_in_its_time_constant() {
        let settings = VoltageSettings::new(&VoltageParameters { filter: 10_000, ..PARAMETERS }).unwrap();
        let mut state = BusVoltage::new(&settings, sample(500.0));
        let voltage = run(&mut state, &settings, 600.0, 20).voltage.to_num::<f64>();
        // In 20 ticks 1 - (20/21)^20.
        assert!((561.8..562.8).contains(&voltage), "{voltage}");
    }

    #[test]
    fn undervoltage_comes_after_its_time_and_goes_above_its_threshold() {
        let settings = VoltageSettings::new(&PARAMETERS).unwrap();
        let mut state = BusVoltage::new(&settings, sample(560.0));
        assert_eq!(run(&mut state, &settings, 301.0, 1_000).error, None);
        assert_eq!(run(&mut state, &settings, 299.0, 9).error, None);
        let error = run(&mut state, &settings, 299.0, 1).error;
        let Some(VoltageError::Undervoltage { expected: 300_000, actual }) = error else { panic!("{error:?}") };
        assert!(actual.abs_diff(299_000) < 130, "{actual}");
        assert!(run(&mut state, &settings, 308.0, 100).error.is_some());
        assert_eq!(run(&mut state, &settings, 311.0, 1).error, None);
    }

    #[test]
    fn overvoltage_comes_within_three_ticks_whatever_the_filter() {
        let settings = VoltageSettings::new(&VoltageParameters { filter: 20_000, ..PARAMETERS }).unwrap();
        let mut state = BusVoltage::new(&settings, sample(560.0));
        assert_eq!(run(&mut state, &settings, 799.0, 1_000).error, None);
        assert_eq!(run(&mut state, &settings, 820.0, 2).error, None);
        assert_eq!(run(&mut state, &settings, 790.0, 1).error, None, "two ticks are noise");
        let error = run(&mut state, &settings, 820.0, 3).error;
        let Some(VoltageError::Overvoltage { expected: 800_000, actual }) = error else { panic!("{error:?}") };
        assert!(actual.abs_diff(820_000) < 130, "{actual}");
        assert!(run(&mut state, &settings, 776.0, 100).error.is_some());
        assert_eq!(run(&mut state, &settings, 774.0, 1).error, None);
    }

    #[test]
    fn main_power_has_a_hysteresis() {
        let settings = VoltageSettings::new(&PARAMETERS).unwrap();
        let mut state = BusVoltage::new(&settings, 0);
        assert!(!run(&mut state, &settings, 449.0, 100).main_power);
        assert!(run(&mut state, &settings, 451.0, 1).main_power);
        assert!(run(&mut state, &settings, 351.0, 100).main_power);
        assert!(!run(&mut state, &settings, 349.0, 1).main_power);
        assert!(!run(&mut state, &settings, 400.0, 100).main_power);
    }

    #[test]
    fn impossible_settings_are_refused() {
        let refused = |parameters| matches!(VoltageSettings::new(&parameters), Err(SettingsError::OutOfRange { .. }));
        assert!(refused(VoltageParameters { full_scale: 49, ..PARAMETERS }));
        assert!(refused(VoltageParameters { overvoltage: 1_001, ..PARAMETERS }));
        assert!(refused(VoltageParameters { undervoltage: 800, ..PARAMETERS }));
        assert!(refused(VoltageParameters { power_on: 801, ..PARAMETERS }));
        assert!(refused(VoltageParameters { power_off: 450, ..PARAMETERS }));
        assert!(!refused(VoltageParameters { full_scale: 4_000, ..PARAMETERS }));
    }

    #[test]
    fn a_bus_outside_the_range_of_the_reciprocal_counts_as_its_end() {
        let mut reciprocal = Reciprocal::SMALLEST;
        for _ in 0..12 {
            reciprocal = reciprocal.refined(Volts::ZERO);
        }
        assert!(relative_error(reciprocal, 20.0).abs() < 0.000_1);
        assert_eq!(reciprocal.duty(Volts::from_num(1_000)), Duty::MAX);
        assert_eq!(reciprocal.duty(Volts::from_num(-1_000)), Duty::MIN);
    }

    proptest! {
        #[test]
        fn from_any_voltage_to_any_other_the_reciprocal_is_right_after_twelve_ticks(
            before in 20.0..1_000.0_f64, after in 20.0..1_000.0_f64,
        ) {
            let mut reciprocal = Reciprocal::SMALLEST;
            for _ in 0..40 {
                reciprocal = reciprocal.refined(Volts::from_num(before));
            }
            prop_assert!(relative_error(reciprocal, before).abs() < 0.000_001, "at rest");
            for _ in 0..12 {
                reciprocal = reciprocal.refined(Volts::from_num(after));
            }
            let error = relative_error(reciprocal, after);
            prop_assert!(error.abs() < 0.000_1, "{} from {} to {}", error, before, after);
        }

        #[test]
        fn behind_a_change_of_a_tenth_two_ticks_are_enough(before in 30.0..900.0_f64, change in 0.91..1.1_f64) {
            let mut reciprocal = Reciprocal::SMALLEST;
            for _ in 0..40 {
                reciprocal = reciprocal.refined(Volts::from_num(before));
            }
            let after = before * change;
            for _ in 0..2 {
                reciprocal = reciprocal.refined(Volts::from_num(after));
            }
            prop_assert!(relative_error(reciprocal, after).abs() <= 0.000_101, "{}", relative_error(reciprocal, after));
        }

        #[test]
        fn duty_times_bus_voltage_is_the_voltage(bus in 20.0..1_000.0_f64, part in -1.0..1.0_f64) {
            let mut reciprocal = Reciprocal::SMALLEST;
            for _ in 0..40 {
                reciprocal = reciprocal.refined(Volts::from_num(bus));
            }
            let duty = reciprocal.duty(Volts::from_num(bus * part)).to_num::<f64>();
            prop_assert!((duty - part).abs() < 0.000_002, "{} instead of {}", duty, part);
        }
    }
}
