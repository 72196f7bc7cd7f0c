//! From a voltage to compare values: space vector modulation and dead-time compensation.

use crate::SettingsError;
use crate::trigonometry::rounded_product;
use crate::units::divide_rounding;

/// Bits of a compare value below a count, until it is rounded: rounded down earlier, it would be a voltage that stands in the stator, and
/// with it a torque that swings once in an electrical revolution.
pub(super) const FRACTION: u32 = 3;

/// Compare values of the three phases for a voltage, from the middle of the period and before limiting, in counts 2^-3 like all that goes
/// in. `side`: sqrt(3)/2 times beta.
///
/// The zero-sequence that puts the middle of the highest and the lowest phase into the middle of the period makes the same switching
/// pattern as space vector modulation, and reaches the same voltage: 1/sqrt(3) of the bus.
#[inline]
pub(super) fn space_vector(alpha: i32, side: i32) -> [i32; 3] {
    let half = alpha >> 1;
    let a = alpha;
    let b = side.wrapping_sub(half);
    let c = half.wrapping_add(side).wrapping_neg();
    // The three add up to nothing, so the highest and the lowest together are the one between them with its sign turned round.
    let between = a.min(b).max(a.max(b).min(c));
    let zero = between >> 1;
    [a.wrapping_add(zero), b.wrapping_add(zero), c.wrapping_add(zero)]
}

/// A compare value from counts 2^-3 beside the middle of the period, to the nearest and within the period.
#[inline]
pub(super) fn limited_to_period(beside: i32, middle: i32) -> u16 {
    let counts = middle.wrapping_add(beside).wrapping_add(1 << (FRACTION - 1)) >> FRACTION;
    // Within 0 ..= 10 500.
    counts.min(middle >> (FRACTION - 1)).max(0) as u16
}

/// Gives back the voltage that the dead time takes: while both transistors of a phase are off, the current chooses the diode, and with it
/// the rail that makes it smaller.
///
/// The current is the one that is commanded. The measured one is the same but for its noise, which the compensation would amplify around
/// zero: to 5 V of 50 mA where the gain of the loop makes 2 V of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct DeadTimeCompensation {
    /// Current from which the compensation is full, in 2^-24 of peak.
    band: i32,
    /// Counts 2^-3 per 2^-24 of peak within the band, in 2^-32.
    slope: i32,
}

impl DeadTimeCompensation {
    /// * `dead_time` in ns, up to 10 us; 0 switches the compensation off.
    /// * `band`: current in mA up to which the compensation grows in proportion. The ripple of a smaller current changes its sign within the
    ///   period, and the capacitances of the transistors make the transition gradual.
    /// * `peak_current` in mA: the unit of the current.
    ///
    /// # Errors
    /// [`SettingsError::Zero`] for a band or peak current of zero, [`SettingsError::DeadTime`] above 10 us.
    pub fn new(dead_time: u32, band: u32, peak_current: u32) -> Result<Self, SettingsError> {
        if band == 0 || peak_current == 0 {
            return Err(SettingsError::Zero { parameter: "band of the dead-time compensation" });
        }
        if dead_time > LONGEST_DEAD_TIME {
            return Err(SettingsError::DeadTime { actual: dead_time });
        }
        // The high side is on for twice the compare value: half the dead time in counts of 168 MHz.
        let full = i128::from(dead_time).saturating_mul(168) << (32 + FRACTION);
        let band = divide_rounding(i128::from(band) << 24, peak_current.into());
        // A narrower band would be a thousandth of the ripple, and a slope beyond 2^31.
        let narrowest = divide_rounding(full, 2_000_i128 << 31).saturating_add(1);
        let band = band.max(narrowest).min(i32::MAX.into());
        let slope = divide_rounding(full, i128::from(band).saturating_mul(2_000));
        Ok(Self { band: band as i32, slope: slope as i32 })
    }

    pub(super) const fn to_words(self) -> [u32; 2] {
        [self.band.cast_unsigned(), self.slope.cast_unsigned()]
    }

    pub(super) const fn from_words([band, slope]: [u32; 2]) -> Self {
        Self { band: band.cast_signed(), slope: slope.cast_signed() }
    }

    /// Counts 2^-3 to add to the compare value of a phase for this current, in 2^-24 of peak.
    #[inline]
    pub(super) fn counts(self, current: i32) -> i32 {
        rounded_product(current.min(self.band).max(self.band.wrapping_neg()), self.slope)
    }
}

const LONGEST_DEAD_TIME: u32 = 10_000;

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_longest_voltage_in_the_linear_range_just_fits_the_period_at_every_angle() {
        let middle = 2_625;
        let longest = f64::from(2 * middle) / 3_f64.sqrt();
        for step in 0..720 {
            let angle = f64::from(step) * core::f64::consts::TAU / 720.0;
            let side = longest * angle.sin() * 0.75_f64.sqrt();
            let counts = space_vector((longest * angle.cos()) as i32, side as i32).map(|beside| middle + beside);
            assert!(counts.iter().all(|&counts| (-2..=5_252).contains(&counts)), "{step}: {counts:?}");
        }
    }

    proptest! {
        #[test]
        fn the_differences_of_the_phases_are_the_voltage(alpha in -3_000_i32..3_000, side in -3_000_i32..3_000) {
            let [a, b, c] = space_vector(alpha, side).map(|beside| f64::from(2_625 + beside));
            prop_assert!(((2.0 * a - b - c) / 3.0 - f64::from(alpha)).abs() < 0.7);
            prop_assert!(((b - c) / 2.0 - f64::from(side)).abs() < 0.1);
            let (high, low) = (a.max(b).max(c), a.min(b).min(c));
            prop_assert!((high + low - 5_250.0).abs() <= 3.0, "the same share of both zero vectors");
        }

        #[test]
        fn the_compensation_is_odd_and_never_more_than_half_the_dead_time(current: i32, band in 1_u32..10_000) {
            let compensation = DeadTimeCompensation::new(1_000, band, 25_000).unwrap();
            let counts = compensation.counts(current);
            prop_assert!(counts.abs() <= 84 << FRACTION);
            prop_assert!((counts + compensation.counts(current.saturating_neg())).abs() <= 1);
        }
    }

    #[test]
    fn the_compensation_reaches_half_the_dead_time_at_the_end_of_its_band() {
        let compensation = DeadTimeCompensation::new(1_000, 200, 25_000).unwrap();
        // 200 mA of 25 A: 134 218 in 2^-24
        assert_eq!(compensation.counts(134_218), 84 << FRACTION);
        assert!((83 << FRACTION..84 << FRACTION).contains(&compensation.counts(133_500)));
        assert_eq!(compensation.counts(67_109), 42 << FRACTION);
        assert_eq!(compensation.counts(0), 0);
        assert_eq!(DeadTimeCompensation::new(0, 200, 25_000).unwrap().counts(1 << 24), 0);
        assert_eq!(DeadTimeCompensation::new(10_001, 1, 1), Err(SettingsError::DeadTime { actual: 10_001 }));
    }
}
