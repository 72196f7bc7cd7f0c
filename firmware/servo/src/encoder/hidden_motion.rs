//! Movement that the encoder does not see: what tells a dead encoder from an axis that is blocked.
//!
//! Both show a counter that stands while current flows. The magnets tell them apart. With a dead encoder the current vector stands still in
//! space, and a rotor that is free turns towards it, up to a quarter of an electrical revolution: its flux, which had no part along the
//! believed d axis but its own, is taken out of there and induces a voltage across the current, whose integral is the flux of the magnets.
//! A blocked rotor induces nothing. Across the current there is no resistance, so that its value and the temperature do not matter.
//!
//! The voltage of a movement ends with it. One that only grows is that of a current loop that does not see its current, and no movement.
//!
//! What this cannot tell: a rotor that does not turn because friction, a brake or a stop holds it, with a dead encoder; one that creeps so
//! slowly that its voltage drowns in what the bridge's dead time leaves; and one that stands along the current already.

use crate::error::{SettingsError, in_range};
use crate::units::SUPERVISION_PERIOD_MICROSECONDS;

/// The watch, scaled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub(crate) struct HiddenMotionSettings {
    /// Largest change of the flux, in volt 2^-14 times ticks.
    limit: i32,
    /// From there to 0.1 % of the magnets' flux: a product's high word.
    per_mille: i32,
    /// Voltages below 2^-`quiet_shift` of the longest vector count as none.
    quiet_shift: u32,
}

/// Flux of which a third must have turned.
const SHARE: u64 = 3;
/// The integral forgets with 2^6 ticks of the supervision, 32 ms: a rotor is drawn to the current faster, and what a bridge leaves across
/// it for ever is forgotten.
const LEAK_SHIFT: u32 = 6;
/// With the dead time made up for, 2.8 V of a bus of 320 V count as none.
const QUIET_SHIFT: u32 = 6;
/// Without, 5.7 V: a dead time of 1.6 % of the period takes a vector of 6.8 V, up to 30 degrees off the current.
const DISTURBED_SHIFT: u32 = 5;

impl HiddenMotionSettings {
    /// Change of the flux that may be, in 0.1 % of the magnets'.
    pub(crate) const ALLOWED: u32 = 1_000 / SHARE as u32;

    /// Flux linkage of the magnets in uVs (from the torque constant P-0-0114), at most 2.5 Vs; 0: not known, nothing is found. The current loop makes up for the dead time of the
    /// bridge, or not. Divides.
    ///
    /// # Errors
    /// [`SettingsError::OutOfRange`] for more.
    pub(crate) fn new(flux: u32, compensated: bool) -> Result<Self, SettingsError> {
        let flux = u64::from(in_range("flux linkage in uVs (P-0-0114 and P-0-0110)", flux, 0, 2_500_000)?);
        // At most 8.2e7: 2.5 Vs in ticks of 500 us.
        let whole = (flux << 14).checked_div(SUPERVISION_PERIOD_MICROSECONDS.into()).unwrap_or(0);
        Ok(Self {
            limit: i32::try_from(whole / SHARE).unwrap_or(i32::MAX),
            per_mille: i32::try_from((1_000_u64 << 32).checked_div(whole).unwrap_or(0)).unwrap_or(i32::MAX),
            quiet_shift: if compensated { QUIET_SHIFT } else { DISTURBED_SHIFT },
        })
    }
}

/// State of the watch.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub(crate) struct HiddenMotion {
    /// Change of the flux along the d axis, in volt 2^-14 times ticks.
    flux: i32,
    /// Highest voltage that has made it, volt 2^-14; forgotten like the flux.
    highest: i32,
}

impl HiddenMotion {
    /// Nothing has moved yet.
    #[must_use]
    pub(crate) const fn new() -> Self {
        Self { flux: 0, highest: 0 }
    }

    /// One tick of the supervision with a counter that stands: the voltage of the d axis and the longest voltage vector, volt 2^-14.
    ///
    /// Gives the change of the flux in 0.1 % of that of the magnets, once, when it has been more than a third and the voltage has fallen to
    /// half of its highest: the rotor is past the current.
    #[inline]
    pub(crate) fn tick(&mut self, settings: &HiddenMotionSettings, direct_voltage: i32, longest: i32) -> Option<u32> {
        let quiet = longest.wrapping_shr(settings.quiet_shift);
        let beyond = direct_voltage.wrapping_abs().wrapping_sub(quiet).max(0);
        let change = if direct_voltage < 0 { beyond.wrapping_neg() } else { beyond };
        // 1 000 V for 2^6 ticks: 2^30.
        self.flux = self.flux.wrapping_sub(self.flux >> LEAK_SHIFT).wrapping_add(change);
        self.highest = beyond.max(self.highest.wrapping_sub(self.highest >> LEAK_SHIFT));
        let turned = self.flux.wrapping_abs();
        if settings.limit == 0 || turned <= settings.limit || beyond > self.highest >> 1 {
            return None;
        }
        *self = Self::new();
        Some((i64::from(turned).wrapping_mul(settings.per_mille.into()) >> 32) as u32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::f64::consts::FRAC_PI_2;

    /// 0.133 Vs on a bus that carries 181 V.
    const LONGEST: i32 = 181 << 14;
    const FLUX: f64 = 0.133_333;

    fn settings() -> HiddenMotionSettings {
        HiddenMotionSettings::new(133_333, true).unwrap()
    }

    fn volts(volts: f64) -> i32 {
        (volts * 16_384.0) as i32
    }

    /// A rotor is drawn from the q axis to the current there within `milliseconds`, and as far beyond, at constant speed: flux * speed *
    /// cosine.
    fn drawn(milliseconds: f64, offset: f64) -> Option<u32> {
        let mut watch = HiddenMotion::new();
        let ticks = (milliseconds * 2.0) as u32;
        let speed = FRAC_PI_2 / (milliseconds * 1e-3);
        (0..2 * ticks).find_map(|tick| {
            let angle = FRAC_PI_2 * (1.0 - f64::from(tick) / f64::from(ticks));
            watch.tick(&settings(), volts(offset - FLUX * speed * angle.cos()), LONGEST)
        })
    }

    #[test]
    fn a_third_of_the_flux_may_change() {
        assert_eq!(HiddenMotionSettings::ALLOWED, 333);
    }

    #[test]
    fn a_voltage_that_swings_to_both_sides_is_no_movement() {
        let settings = HiddenMotionSettings { limit: 1_000, per_mille: 1 << 20, quiet_shift: 31 };
        let mut state = HiddenMotion::new();
        for swing in 0..1_000 {
            let voltage = if swing % 2 == 0 { 900 } else { -900 };
            assert_eq!(state.tick(&settings, voltage, 0), None, "{swing}");
        }
        assert!(state.flux.abs() < 1_000, "{}", state.flux);
    }

    #[test]
    fn a_movement_is_over_when_its_voltage_is_half_of_the_highest() {
        let settings = HiddenMotionSettings { limit: 10, per_mille: 1 << 30, quiet_shift: 31 };
        let mut state = HiddenMotion::new();
        assert_eq!(state.tick(&settings, 100, 0), None, "it grows");
        // The highest of 100 has become 99.
        assert_eq!({ state }.tick(&settings, 50, 0), None);
        assert!(state.tick(&settings, 49, 0).is_some());
    }

    #[test]
    fn a_rotor_that_is_drawn_to_the_current_is_seen() {
        for milliseconds in [3.0, 6.0, 12.0, 24.0] {
            let share = drawn(milliseconds, 0.0);
            assert!(share.is_some_and(|share| (333..1_800).contains(&share)), "{milliseconds} ms: {share:?}");
            // In spite of what the bridge leaves across the current.
            assert!(drawn(milliseconds, 1.5).is_some() && drawn(milliseconds, -1.5).is_some(), "{milliseconds} ms");
        }
    }

    #[test]
    fn a_rotor_that_creeps_is_not() {
        assert_eq!(drawn(200.0, 0.0), None, "0.7 rad/s an electrical radian: 1 V");
    }

    #[test]
    fn what_the_bridge_leaves_across_the_current_is_no_movement_however_long_it_lasts() {
        for offset in [2.8, 3.8, -3.8] {
            let mut watch = HiddenMotion::new();
            for _ in 0..100_000 {
                assert_eq!(watch.tick(&settings(), volts(offset), LONGEST), None, "{offset} V");
            }
        }
        // It comes and goes with the current. Without compensation it is more.
        let coming_and_going = |settings: HiddenMotionSettings| {
            let mut watch = HiddenMotion::new();
            let offset = |tick| volts(if tick % 500 < 250 { 5.0 } else { 0.0 });
            (0..100_000).find_map(|tick| watch.tick(&settings, offset(tick), LONGEST))
        };
        assert_eq!(coming_and_going(HiddenMotionSettings::new(133_333, false).unwrap()), None);
        assert!(coming_and_going(settings()).is_some(), "with compensation 5 V are too many");
    }

    #[test]
    fn a_voltage_that_only_grows_is_no_movement() {
        let mut watch = HiddenMotion::new();
        for tick in 0..1_800 {
            assert_eq!(watch.tick(&settings(), volts(f64::from(tick) * 0.1), LONGEST), None);
        }
    }

    #[test]
    fn without_a_flux_nothing_is_found_and_too_much_is_refused() {
        let unknown = HiddenMotionSettings::new(0, true).unwrap();
        let mut watch = HiddenMotion::new();
        assert!((0..100).all(|_| watch.tick(&unknown, volts(100.0), LONGEST).is_none()));
        assert!(HiddenMotionSettings::new(2_500_001, true).is_err());
    }
}
