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

use crate::arithmetic::division::divide_rounding;
use crate::arithmetic::trigonometry::high_product;
use crate::arithmetic::wide::saturated;
use crate::axis::velocity_loop::CURRENT_BITS;
use crate::error::{SettingsError, in_range};
use crate::units::Velocity;

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
    /// Of the Coulomb part: 2^31 over the band, right to 0.4 % up to 100 rpm. Beyond the band its product with a velocity ends at the range of
    /// a word.
    steepness: i32,
    /// Coulomb part in 2^-26 of peak.
    coulomb: i32,
    /// From velocity steps to 2^-25 of peak, in 2^-32: below a quarter.
    viscous: i32,
}

impl FrictionSettings {
    /// No compensation.
    pub const OFF: Self = Self { steepness: 0, coulomb: 0, viscous: 0 };

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
        let band = Velocity::from_ten_thousandths_rpm(band.cast_signed());
        let of_peak =
            |current: u32, scale: i128| divide_rounding(i128::from(current).saturating_mul(scale), peak_current.into());
        // A band of 0.1 rpm has 14 317 steps. uA/rpm: 2^-36 rev per tick is 480 000 / 2^36 rpm, and 2^25 * 480 000 / 2^36 / 1000 is 15 / 64.
        Ok(Self {
            steepness: divide_rounding(1 << 31, band.to_bits().into()) as i32,
            coulomb: of_peak(coulomb, 1 << (CURRENT_BITS + 1)) as i32,
            viscous: of_peak(viscous, 15 << 26) as i32,
        })
    }

    /// The current for a velocity command, in 2^-25 of the peak current and at most that.
    #[inline]
    #[must_use]
    pub fn current(&self, command: Velocity) -> i32 {
        let velocity = command.to_bits();
        let within = saturated(i64::from(velocity).wrapping_mul(self.steepness.into()));
        let total = high_product(within, self.coulomb).wrapping_add(high_product(velocity, self.viscous));
        total.clamp(-(1 << CURRENT_BITS), (1 << CURRENT_BITS) - 1)
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
        let current = FrictionSettings::new(parameters).unwrap().current(velocity);
        f64::from(current) / f64::from(1 << CURRENT_BITS) * f64::from(parameters.peak_current)
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
            let of = |bits| friction.current(Velocity::from_bits(bits));
            prop_assert!(of(a.min(b)) <= of(a.max(b)));
            // Two products, each rounded down.
            prop_assert!((of(a) + of(a.saturating_neg())).abs() <= 2);
        }
    }
}
