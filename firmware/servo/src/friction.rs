//! Friction compensation S-0-0155: the current that the friction of the motor and its load will need, fed forward.
//!
//! It follows the velocity command, not the measured velocity: friction fed forward from the measured velocity is positive feedback.
//! A step at zero velocity would chatter with every command that stands or hunts around zero, so the Coulomb part grows within a band.
//!
//! ```text
//!              ____ Coulomb + viscous * velocity
//!            /
//!  ---------/--------- velocity command
//!          /|
//!    _____/ band
//! ```

use crate::settings::in_range;
use crate::units::{divide_rounding, limited};
use crate::{CurrentFraction, Gain, SettingsError, Velocity};

/// Friction in physical units.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FrictionParameters {
    /// Current that overcomes Coulomb friction, in mA; 0: none, at most the peak current.
    pub coulomb: u32,
    /// Current that viscous friction needs more with each rpm, in uA; 0: none, at most what makes the peak current at 1 000 rpm.
    pub viscous: u32,
    /// Velocity up to which the Coulomb part grows in proportion, in 10^-4 rpm, 1 000 ..= 10 000 000.
    pub band: u32,
    /// Amplifier peak current S-0-0110 in mA: the unit of the current.
    pub peak_current: u32,
}

/// Friction, scaled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct FrictionSettings {
    /// Velocity steps to 2^-31 of peak, within the band.
    slope: Gain,
    /// In 2^-31 of peak.
    coulomb: i64,
    /// Velocity steps to 2^-31 of peak.
    viscous: Gain,
}

impl FrictionSettings {
    /// No compensation.
    pub const OFF: Self = Self { slope: Gain::ZERO, coulomb: 0, viscous: Gain::ZERO };

    /// Scales the parameters. Divides.
    ///
    /// # Errors
    /// [`SettingsError::Zero`] without peak current, [`SettingsError::OutOfRange`] for a value outside the range that
    /// [`FrictionParameters`] states.
    pub fn new(parameters: &FrictionParameters) -> Result<Self, SettingsError> {
        let FrictionParameters { coulomb, viscous, band, peak_current } = *parameters;
        if peak_current == 0 {
            return Err(SettingsError::Zero { parameter: "amplifier peak current S-0-0110" });
        }
        in_range("Coulomb friction current", coulomb, 0, peak_current)?;
        in_range("viscous friction current", viscous, 0, peak_current)?;
        in_range("band of the friction compensation", band, 1_000, 10_000_000)?;
        let coulomb = divide_rounding(i128::from(coulomb) << 31, peak_current.into());
        let band = Velocity::from_ten_thousandths_rpm(band.cast_signed());
        // uA/rpm: 2^-36 rev per tick is 480 000 / 2^36 rpm, and 2^31 * 480 000 / 2^36 / 1000 is 15.
        let viscous = Gain::from_ratio(u128::from(viscous).saturating_mul(15), peak_current.into());
        let slope = Gain::from_ratio(coulomb.unsigned_abs().into(), u128::from(band.to_bits().unsigned_abs()));
        // With these ranges they are at most 15 and 2^31 / 14 316.
        Ok(Self { slope: slope.unwrap_or(Gain::ZERO), coulomb, viscous: viscous.unwrap_or(Gain::ZERO) })
    }

    /// The current for a velocity command, at most the peak current.
    #[inline]
    #[must_use]
    pub fn current(&self, command: Velocity) -> CurrentFraction {
        if *self == Self::OFF {
            return CurrentFraction::ZERO;
        }
        let velocity = i64::from(command.to_bits());
        let coulomb = limited(self.slope.apply(velocity), self.coulomb);
        let total = coulomb.saturating_add(self.viscous.apply(velocity));
        let rounded = total.saturating_add(1 << 15) >> 16;
        CurrentFraction::from_bits(limited(rounded, i16::MAX.into()) as i16)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// 300 mA, 0.25 mA/rpm, 2 rpm, 10 A.
    const PARAMETERS: FrictionParameters =
        FrictionParameters { coulomb: 300, viscous: 250, band: 20_000, peak_current: 10_000 };

    /// In mA at a velocity in rpm.
    fn milliamperes(parameters: &FrictionParameters, rpm: f64) -> f64 {
        let velocity = Velocity::from_ten_thousandths_rpm((rpm * 10_000.0) as i32);
        FrictionSettings::new(parameters).unwrap().current(velocity).to_num::<f64>()
            * f64::from(parameters.peak_current)
    }

    #[test]
    fn the_current_is_coulomb_plus_viscous_friction_in_both_directions() {
        for (rpm, expected) in [(2.0, 300.5), (1_000.0, 550.0), (3_000.0, 1_050.0), (12_000.0, 3_300.0)] {
            let forward = milliamperes(&PARAMETERS, rpm);
            let backward = milliamperes(&PARAMETERS, -rpm);
            assert!((forward - expected).abs() < 0.2, "{rpm} rpm: {forward}");
            assert!((backward + expected).abs() < 0.2, "-{rpm} rpm: {backward}");
        }
    }

    #[test]
    fn within_the_band_the_coulomb_part_is_proportional_and_zero_at_standstill() {
        for (rpm, expected) in [(0.0, 0.0), (0.5, 75.1), (1.0, 150.25), (-1.5, -225.4), (1.999, 300.3)] {
            let actual = milliamperes(&PARAMETERS, rpm);
            assert!((actual - expected).abs() < 0.35, "{rpm} rpm: {actual}");
        }
    }

    #[test]
    fn a_command_that_hunts_around_zero_does_not_chatter() {
        // 0.01 rpm is 1/200 of the band.
        let swing = milliamperes(&PARAMETERS, 0.01) - milliamperes(&PARAMETERS, -0.01);
        assert!((2.0..4.0).contains(&swing), "{swing} mA");
    }

    #[test]
    fn more_than_the_peak_current_is_not_asked_for() {
        let strong = FrictionParameters { coulomb: 10_000, viscous: 10_000, ..PARAMETERS };
        assert!((milliamperes(&strong, 10_000.0) - 10_000.0).abs() < 0.5);
        assert!((milliamperes(&strong, -10_000.0) + 10_000.0).abs() < 0.5);
        assert_eq!(FrictionSettings::OFF.current(Velocity::MAX), 0);
    }

    #[test]
    fn values_out_of_range_are_refused() {
        let refused = |parameters| FrictionSettings::new(&parameters).unwrap_err();
        let out_of_range =
            |parameter, actual, minimum, maximum| SettingsError::OutOfRange { parameter, actual, minimum, maximum };
        assert_eq!(
            refused(FrictionParameters { peak_current: 0, ..PARAMETERS }),
            SettingsError::Zero { parameter: "amplifier peak current S-0-0110" }
        );
        assert_eq!(
            refused(FrictionParameters { coulomb: 10_001, ..PARAMETERS }),
            out_of_range("Coulomb friction current", 10_001, 0, 10_000)
        );
        assert_eq!(
            refused(FrictionParameters { viscous: 10_001, ..PARAMETERS }),
            out_of_range("viscous friction current", 10_001, 0, 10_000)
        );
        assert_eq!(
            refused(FrictionParameters { band: 999, ..PARAMETERS }),
            out_of_range("band of the friction compensation", 999, 1_000, 10_000_000)
        );
    }

    proptest! {
        #[test]
        fn the_current_never_falls_with_the_velocity_and_is_odd(
            coulomb in 0_u32..=10_000, viscous in 0_u32..=10_000, band in 1_000_u32..=10_000_000, a: i32, b: i32,
        ) {
            let parameters = FrictionParameters { coulomb, viscous, band, peak_current: 10_000 };
            let friction = FrictionSettings::new(&parameters).unwrap();
            let of = |bits| friction.current(Velocity::from_bits(bits)).to_bits();
            prop_assert!(of(a.min(b)) <= of(a.max(b)));
            prop_assert!((of(a) + of(a.saturating_neg())).abs() <= 1);
        }
    }
}
