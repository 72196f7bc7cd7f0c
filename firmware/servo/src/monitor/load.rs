//! Thermal load of motor or amplifier: a first-order model of the squared current (I2t), with foldback.
//!
//! The load follows `(i / continuous current)^2` with one time constant: 100 % is the final temperature of the continuous current.
//! Below the warning level the whole peak current is allowed. From there on the allowed current falls along a straight line, down
//! to the continuous current at 100 %. At that current the load settles at 100 %, so a drive that keeps to the allowed current never
//! passes it. What passes it all the same (an amplifier that does not follow its command) is shut down at its load limit: S-0-0114 of the motor, 110 % of the amplifier.
//!
//! One type serves motor (S-0-0111, S-0-0109) and amplifier (S-0-0112, S-0-0110), each with a time constant of its own.

use crate::arithmetic::gain::Gain;
use crate::error::{SettingsError, in_range};
use crate::units::CurrentFraction;

/// Parameters of a thermal model, as the IDNs carry them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LoadParameters {
    /// Current that may flow for ever in mA: S-0-0111 of the motor, S-0-0112 of the amplifier. At least 1/64 of S-0-0110.
    pub continuous_current: u32,
    /// Peak current in mA, from which the foldback starts: S-0-0109 of the motor, S-0-0110 of the amplifier.
    pub peak_current: u32,
    /// Amplifier peak current S-0-0110 in mA: the unit of [`CurrentFraction`].
    pub amplifier_peak_current: u32,
    /// Thermal time constant in ms: 10 ms to one hour.
    pub time_constant: u32,
    /// Level in 0.1 % from which warning and foldback start, 100 ..= 990.
    pub warning_level: u16,
    /// Load limit in 0.1 %, S-0-0114 of the motor, above the warning level.
    pub shutdown_level: u16,
}

/// A thermal model, scaled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct LoadSettings {
    /// Squared current (2^-30 of the squared peak) to load (2^-30).
    heating: Gain,
    /// Difference to the final load (2^-30) to the change in a tick (2^-46).
    share: Gain,
    /// Load above the warning level (2^-30) to the current that is taken away (2^-15 of the peak).
    foldback: Gain,
    /// Levels in 2^-30.
    warning_level: i64,
    warning_end: i64,
    shutdown_level: i64,
    /// In 2^-15 of the peak current.
    peak: i64,
    continuous: i64,
}

/// 100 % load.
const FULL_LOAD: i64 = 1 << 30;
/// The state has 16 bits more than the load that is compared, so that a time constant of an hour still counts every tick.
const FINE_BITS: u32 = 16;
/// The model stays below 256 times the full load, however long an overload lasts.
const LARGEST_LOAD: i64 = 1 << (30 + 8 + FINE_BITS);
/// The warning ends this far below its level, in 0.1 %: at the end of the foldback the load would make it come and go.
const WARNING_HYSTERESIS: u16 = 20;
const LARGEST_CURRENT: i64 = 0x7FFF;
const HIGHEST_CURRENT_RATIO: u32 = 64;

impl LoadSettings {
    /// Scales the parameters. Divides.
    ///
    /// # Errors
    /// [`SettingsError::OutOfRange`] for a parameter beyond its range. The shortest time constant also depends on the steepness of the
    /// foldback: a tick at the peak current may take a quarter of the way from the warning level to 100 %. With more, the tick between the
    /// allowed and the measured current would make the load pass it.
    pub fn new(parameters: &LoadParameters) -> Result<Self, SettingsError> {
        let amplifier_peak =
            in_range("amplifier peak current S-0-0110", parameters.amplifier_peak_current, 1, u32::MAX)?;
        let smallest = amplifier_peak.div_ceil(HIGHEST_CURRENT_RATIO);
        let continuous = in_range("continuous current", parameters.continuous_current, smallest, u32::MAX)?;
        let peak = parameters.peak_current.min(amplifier_peak);
        let warning = in_range("warning level of the load", parameters.warning_level.into(), 100, 990)?;
        let above_warning = warning.saturating_add(1);
        in_range("load limit", parameters.shutdown_level.into(), above_warning, u16::MAX.into())?;

        // Peak heating falls by 2 r (r - 1) over the span of the foldback; a quarter of the span in a tick of 1/2 ms.
        let (peak_wide, continuous_wide) = (u128::from(peak), u128::from(continuous));
        let steepness = peak_wide.saturating_mul(peak_wide.saturating_sub(continuous_wide)).saturating_mul(4_000);
        let span =
            continuous_wide.saturating_mul(continuous_wide).saturating_mul(1_000_u128.saturating_sub(warning.into()));
        let shortest = steepness.div_ceil(span.max(1)).clamp(10, HOUR.into());
        // Clamped to an hour.
        let time_constant = in_range("thermal time constant", parameters.time_constant, shortest as u32, HOUR)?;

        let squared = |current: u32| u128::from(current).saturating_mul(u128::from(current));
        let ticks = u128::from(crate::monitor::debounce::ticks_of(time_constant));
        let peak = fraction(peak, amplifier_peak);
        let continuous_fraction = fraction(continuous, amplifier_peak);
        let taken = peak.saturating_sub(continuous_fraction).max(0);
        let warning_level = level(parameters.warning_level);
        let above = FULL_LOAD.saturating_sub(warning_level);
        Ok(Self {
            heating: Gain::from_ratio(squared(amplifier_peak), squared(continuous)).ok_or(TOO_SMALL)?,
            share: Gain::from_ratio(1 << FINE_BITS, ticks).ok_or(TOO_SMALL)?,
            foldback: Gain::from_ratio(taken.unsigned_abs().into(), above.unsigned_abs().into()).ok_or(TOO_SMALL)?,
            warning_level,
            warning_end: level(parameters.warning_level.saturating_sub(WARNING_HYSTERESIS)),
            shutdown_level: level(parameters.shutdown_level),
            peak,
            continuous: continuous_fraction.min(peak),
        })
    }
}

/// A factor beyond [`Gain`]; the ranges of the parameters leave none.
const TOO_SMALL: SettingsError = SettingsError::Zero { parameter: "continuous current" };
/// The longest time constant, in ms.
const HOUR: u32 = 3_600_000;

/// A current in 2^-15 of the peak current, rounded down.
fn fraction(current: u32, amplifier_peak: u32) -> i64 {
    let bits = (u64::from(current) << 15).checked_div(u64::from(amplifier_peak)).unwrap_or(0);
    i64::try_from(bits).unwrap_or(LARGEST_CURRENT).min(LARGEST_CURRENT)
}

/// A load in 0.1 % as 2^-30.
const fn level(load: u16) -> i64 {
    ((load as i64) << 30) / 1_000
}

/// What the model says in a tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LoadOutput {
    /// Load in 0.1 %, rounded down, at most 6553.5 %.
    pub load: u16,
    /// Magnitude of the current that may flow in the next tick.
    pub allowed: CurrentFraction,
    /// The allowed current is below the peak current.
    pub folded_back: bool,
    /// The load has reached the warning level (C2D bit 0).
    pub warning: bool,
    /// The load has passed its limit (C1D bit 0).
    pub shutdown: bool,
}

/// State of a thermal model.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct LoadModel {
    /// In 2^-46.
    load: i64,
    warning: bool,
}

impl LoadModel {
    /// Starts cold.
    #[must_use]
    pub const fn new() -> Self {
        Self { load: 0, warning: false }
    }

    /// Starts at this load in 0.1 %: a restart of the processor does not cool a motor.
    #[must_use]
    pub const fn at(load: u16) -> Self {
        Self { load: level(load) << FINE_BITS, warning: false }
    }

    /// One tick of the supervision with the measured currents of both axes of the rotor frame.
    #[inline]
    pub fn tick(
        &mut self,
        settings: &LoadSettings,
        torque_current: CurrentFraction,
        field_current: CurrentFraction,
    ) -> LoadOutput {
        let squared = squared(torque_current).wrapping_add(squared(field_current));
        let difference = settings.heating.apply(squared).wrapping_sub(self.load >> FINE_BITS);
        self.load = self.load.wrapping_add(settings.share.apply(difference)).clamp(0, LARGEST_LOAD);

        let load = self.load >> FINE_BITS;
        let threshold = if self.warning { settings.warning_end } else { settings.warning_level };
        self.warning = load >= threshold;
        let taken = settings.foldback.apply(load.wrapping_sub(settings.warning_level).max(0));
        let allowed = settings.peak.wrapping_sub(taken).max(settings.continuous);
        LoadOutput {
            // At most 256 000 before the limit.
            load: (load.wrapping_mul(1_000) >> 30).min(i64::from(u16::MAX)) as u16,
            // Between two values of 15 bits.
            allowed: CurrentFraction::from_bits(allowed as i16),
            folded_back: allowed < settings.peak,
            warning: self.warning,
            shutdown: load > settings.shutdown_level,
        }
    }
}

#[inline]
fn squared(current: CurrentFraction) -> i64 {
    let bits = i32::from(current.to_bits());
    i64::from(bits.wrapping_mul(bits))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// 5 A of 20 A, 2 s.
    const PARAMETERS: LoadParameters = LoadParameters {
        continuous_current: 5_000,
        peak_current: 20_000,
        amplifier_peak_current: 20_000,
        time_constant: 2_000,
        warning_level: 900,
        shutdown_level: 1_100,
    };

    fn current(fraction: f64) -> CurrentFraction {
        CurrentFraction::from_num(fraction)
    }

    /// Ticks until `reached`, at a constant current.
    fn ticks_until(settings: &LoadSettings, current: CurrentFraction, reached: impl Fn(LoadOutput) -> bool) -> f64 {
        let mut model = LoadModel::new();
        let mut ticks = 1;
        while !reached(model.tick(settings, current, CurrentFraction::ZERO)) {
            ticks += 1;
            assert!(ticks < 1_000_000, "never reached");
        }
        f64::from(ticks)
    }

    #[test]
    fn twice_the_continuous_current_takes_the_time_of_the_closed_solution() {
        let settings = LoadSettings::new(&PARAMETERS).unwrap();
        for (ratio, level, expected) in [
            // t = T ln(r^2 / (r^2 - level))
            (2.0, 1_000_u16, 4_000.0 * (4.0_f64 / 3.0).ln()),
            (2.0, 900, 4_000.0 * (4.0_f64 / 3.1).ln()),
            (3.0, 1_000, 4_000.0 * (9.0_f64 / 8.0).ln()),
            (1.2, 1_000, 4_000.0 * (1.44_f64 / 0.44).ln()),
        ] {
            let ticks = ticks_until(&settings, current(ratio / 4.0), |output| output.load >= level);
            assert!((ticks / expected - 1.0).abs() < 0.002, "{ticks} ticks at {ratio}, expected {expected}");
        }
    }

    #[test]
    fn warning_and_shutdown_come_at_their_levels() {
        let settings = LoadSettings::new(&PARAMETERS).unwrap();
        let warned = ticks_until(&settings, current(0.5), |output| output.warning);
        assert!((warned / (4_000.0 * (4.0_f64 / 3.1).ln()) - 1.0).abs() < 0.002);
        let shut_down = ticks_until(&settings, current(0.5), |output| output.shutdown);
        assert!((shut_down / (4_000.0 * (4.0_f64 / 2.9).ln()) - 1.0).abs() < 0.002);
    }

    #[test]
    fn the_warning_ends_two_percent_lower() {
        let settings = LoadSettings::new(&PARAMETERS).unwrap();
        let mut model = LoadModel::at(905);
        assert!(model.tick(&settings, CurrentFraction::ZERO, CurrentFraction::ZERO).warning);
        let last = core::iter::repeat_with(|| model.tick(&settings, CurrentFraction::ZERO, CurrentFraction::ZERO))
            .take_while(|output| output.warning)
            .last()
            .unwrap();
        assert_eq!(last.load, 880);
    }

    #[test]
    fn field_current_heats_like_torque_current() {
        let settings = LoadSettings::new(&PARAMETERS).unwrap();
        let (mut both, mut one) = (LoadModel::new(), LoadModel::new());
        for _ in 0..4_000 {
            both.tick(&settings, current(0.15), current(-0.2));
            one.tick(&settings, current(-0.25), current(0.0));
        }
        assert!((both.load - one.load).abs() < one.load / 2_000, "{} {}", both.load, one.load);
        assert!(((one.load >> 16) as f64 / FULL_LOAD as f64 - 0.632).abs() < 0.001, "63 % after the time constant");
    }

    #[test]
    fn the_whole_peak_current_is_allowed_up_to_the_warning_and_the_middle_halfway() {
        let settings = LoadSettings::new(&PARAMETERS).unwrap();
        let allowed = |load| LoadModel::at(load).tick(&settings, current(0.25), CurrentFraction::ZERO);
        assert_eq!(allowed(899).allowed, CurrentFraction::MAX);
        assert!(!allowed(899).folded_back);
        let middle = allowed(950).allowed.to_num::<f64>();
        assert!((middle - 0.625).abs() < 0.002, "{middle}");
        assert!(allowed(950).folded_back);
        assert_eq!(allowed(1_000).allowed, current(0.25));
        assert_eq!(allowed(1_200).allowed, current(0.25), "never below the continuous current");
    }

    #[test]
    fn an_hour_of_time_constant_still_settles() {
        let settings = LoadSettings::new(&LoadParameters { time_constant: HOUR, ..PARAMETERS }).unwrap();
        let mut model = LoadModel::at(995);
        let first = model.load;
        for _ in 0..20_000 {
            model.tick(&settings, current(0.25), CurrentFraction::ZERO);
        }
        // 10 s of 3600 s: 1 - exp(-1/360) of the 0.5 % that are missing
        let moved = (model.load - first) as f64 / (FULL_LOAD << FINE_BITS) as f64;
        assert!((moved / (0.005 * (1.0 - (-1.0_f64 / 360.0).exp())) - 1.0).abs() < 0.01, "{moved}");
    }

    #[test]
    fn impossible_settings_are_refused() {
        let refused = |change: fn(&mut LoadParameters)| {
            let mut parameters = PARAMETERS;
            change(&mut parameters);
            match LoadSettings::new(&parameters) {
                Err(SettingsError::OutOfRange { parameter, minimum, .. }) => (parameter, minimum),
                other => panic!("{other:?}"),
            }
        };
        assert_eq!(refused(|p| p.amplifier_peak_current = 0), ("amplifier peak current S-0-0110", 1));
        assert_eq!(refused(|p| p.continuous_current = 312), ("continuous current", 313));
        assert_eq!(refused(|p| p.time_constant = 479), ("thermal time constant", 480));
        assert_eq!(refused(|p| p.time_constant = HOUR + 1), ("thermal time constant", 480));
        assert_eq!(refused(|p| p.warning_level = 991), ("warning level of the load", 100));
        assert_eq!(refused(|p| p.shutdown_level = 900), ("load limit", 901));
    }

    /// The parameters with the shortest time constant that they allow, times a factor.
    fn fastest(parameters: LoadParameters, factor: u32) -> LoadParameters {
        match LoadSettings::new(&LoadParameters { time_constant: 0, ..parameters }) {
            Err(SettingsError::OutOfRange { parameter: "thermal time constant", minimum, .. }) => {
                LoadParameters { time_constant: minimum * factor, ..parameters }
            }
            other => panic!("{other:?}"),
        }
    }

    proptest! {
        // Each case runs for seconds of the drive's time.
        #![proptest_config(ProptestConfig::with_cases(64))]

        #[test]
        fn a_drive_that_keeps_to_the_allowed_current_never_passes_full_load(
            continuous_current in 1_000_u32..20_000, warning_level in 500_u16..=990, factor in 1_u32..20,
            bursts in proptest::collection::vec((any::<bool>(), 1_u32..2_000), 1..12),
        ) {
            let parameters = fastest(LoadParameters { continuous_current, warning_level, ..PARAMETERS }, factor);
            let settings = LoadSettings::new(&parameters).unwrap();
            let mut model = LoadModel::new();
            let mut allowed = CurrentFraction::MAX;
            let mut most = 0;
            for (loaded, ticks) in bursts {
                for _ in 0..ticks {
                    let current = if loaded { allowed } else { CurrentFraction::ZERO };
                    allowed = model.tick(&settings, -current, CurrentFraction::ZERO).allowed;
                    most = most.max(model.load >> FINE_BITS);
                }
            }
            prop_assert!(most <= FULL_LOAD + FULL_LOAD / 1_000_000, "{} of {}", most, FULL_LOAD);
        }

        #[test]
        fn under_lasting_demand_load_and_current_settle_at_full_load_and_the_continuous_current(
            continuous_current in 4_000_u32..19_000, warning_level in 500_u16..=990, factor in 1_u32..3,
        ) {
            let parameters = fastest(LoadParameters { continuous_current, warning_level, ..PARAMETERS }, factor);
            let settings = LoadSettings::new(&parameters).unwrap();
            let mut model = LoadModel::new();
            let mut output = model.tick(&settings, CurrentFraction::MAX, CurrentFraction::ZERO);
            for _ in 0..10 * 2 * parameters.time_constant {
                output = model.tick(&settings, output.allowed, CurrentFraction::ZERO);
            }
            prop_assert!((998..=1_000).contains(&output.load), "{:?}", output);
            let exact = f64::from(continuous_current) / 20_000.0;
            let allowed = output.allowed.to_num::<f64>();
            prop_assert!((-0.000_1..0.000_3).contains(&(allowed - exact)), "{} instead of {}", allowed, exact);
        }
    }
}
