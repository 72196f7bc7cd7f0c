//! From a voltage to compare values: space vector modulation and dead-time compensation.

use crate::arithmetic::division::divide_rounding;
use crate::arithmetic::trigonometry::rounded_product;
use crate::error::SettingsError;

/// Bits of a compare value below a count, until it is rounded: rounded down earlier, it would be a voltage that stands in the stator, and
/// with it a torque that swings once in an electrical revolution.
pub(super) const FRACTION: u32 = 3;

/// Compare values of the three phases before they are rounded, in counts 2^-3.
pub(super) type Counts = [i32; 3];

/// Compare values of the three phases for a voltage, in counts 2^-3 like all that goes in, with half a count more for rounding and before
/// limiting. `side`: sqrt(3)/2 times beta; `middle`: the compare value without voltage.
///
/// The zero-sequence that puts the middle of the highest and the lowest phase into the middle of the period makes the same switching
/// pattern as space vector modulation, and reaches the same voltage: 1/sqrt(3) of the bus.
#[inline]
pub(super) fn space_vector(alpha: i32, side: i32, middle: i32) -> [i32; 3] {
    let half = alpha >> 1;
    let a = alpha;
    let b = side.wrapping_sub(half);
    let c = half.wrapping_add(side).wrapping_neg();
    // The three add up to nothing, so the highest and the lowest together are the one between them with its sign turned round.
    let between = a.min(b).max(a.max(b).min(c));
    let zero = (between >> 1).wrapping_add(middle).wrapping_add(1 << (FRACTION - 1));
    [a.wrapping_add(zero), b.wrapping_add(zero), c.wrapping_add(zero)]
}

/// A compare value from counts 2^-3 with their half for rounding.
///
/// Nothing is cut at its upper end: a compare value beyond the peak of the counter is a phase that is fully on, and so is one at the peak.
/// The voltage limit keeps it within 2 % of the peak, this one within what the register holds.
#[inline]
pub(super) fn to_compare_value(counts: i32) -> u16 {
    (counts >> FRACTION).clamp(0, LARGEST_COMPARE) as u16
}

/// Beyond the 10 500 of 8 kHz, and a power of two less one: one instruction limits to both ends.
const LARGEST_COMPARE: i32 = (1 << 14) - 1;

/// Gives back the voltage that the dead time takes: while both transistors of a phase are off, the current chooses the diode, and with it
/// the rail that makes it smaller.
///
/// The current is the one that is commanded. The measured one is the same but for its noise, which the compensation would amplify around
/// zero: to 5 V of 50 mA where the gain of the loop makes 2 V of them.
///
/// Currents are scaled so that the band ends at 2^14, where one instruction can limit them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct DeadTimeCompensation {
    /// From the alpha current in 2^-24 of peak to shares of the band in 2^-14, in 2^-32.
    alpha: i32,
    /// sqrt(3)/2 of it, for the beta current.
    side: i32,
    /// Counts 2^-3 at the end of the band, in 2^-18.
    full: i32,
}

impl DeadTimeCompensation {
    /// * `dead_time` in ns, up to 10 us; 0 switches the compensation off.
    /// * `band`: current in mA up to which the compensation grows in proportion. The ripple of a smaller current changes its sign within the
    ///   period, and the capacitances of the transistors make the transition gradual. Less than 0.2 % of the peak current counts as that,
    ///   and is far below the ripple.
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
        let full = divide_rounding((i128::from(dead_time) << (32 + FRACTION - BAND)).saturating_mul(168), 2_000);
        // 2^-14 of the band in 2^-32, for 2^-24 of peak.
        let alpha = divide_rounding(i128::from(peak_current) << (32 + BAND - 24), band.into()).min(i32::MAX.into());
        let side = i128::from(alpha).saturating_mul(HALF_ROOT_OF_THREE) >> 32;
        Ok(Self { alpha: alpha as i32, side: side as i32, full: full as i32 })
    }

    pub(super) const fn to_words(self) -> [u32; 3] {
        [self.alpha.cast_unsigned(), self.side.cast_unsigned(), self.full.cast_unsigned()]
    }

    pub(super) const fn from_words([alpha, side, full]: [u32; 3]) -> Self {
        Self { alpha: alpha.cast_signed(), side: side.cast_signed(), full: full.cast_signed() }
    }

    /// Compare values, in counts 2^-3, with the compensation for a current given by alpha and beta, in 2^-24 of peak.
    #[inline]
    pub(super) fn compensate(self, [a, b, c]: [i32; 3], [alpha, beta]: [i32; 2]) -> [i32; 3] {
        let alpha = rounded_product(alpha, self.alpha);
        let side = rounded_product(beta, self.side);
        let half = alpha >> 1;
        let with = |counts: i32, share: i32| {
            counts.wrapping_add(rounded_product(share.clamp(-(1 << BAND), (1 << BAND) - 1), self.full))
        };
        [with(a, alpha), with(b, side.wrapping_sub(half)), with(c, half.wrapping_add(side).wrapping_neg())]
    }
}

/// Bits of a share of the band.
const BAND: u32 = 14;
/// sqrt(3) / 2 in 2^-32.
const HALF_ROOT_OF_THREE: i128 = 3_719_550_787;

const LONGEST_DEAD_TIME: u32 = 10_000;

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_longest_voltage_in_the_linear_range_just_fits_the_period_at_every_angle() {
        let middle = 2_625 << FRACTION;
        let longest = f64::from(2 * middle) / 3_f64.sqrt();
        for step in 0..720 {
            let angle = f64::from(step) * core::f64::consts::TAU / 720.0;
            let side = longest * angle.sin() * 0.75_f64.sqrt();
            let counts = space_vector((longest * angle.cos()) as i32, side as i32, middle).map(to_compare_value);
            assert!(counts.iter().all(|&counts| counts <= 5_251), "{step}: {counts:?}");
        }
    }

    proptest! {
        #[test]
        fn the_differences_of_the_phases_are_the_voltage(alpha in -3_000_i32..3_000, side in -3_000_i32..3_000) {
            let [a, b, c] = space_vector(alpha, side, 2_621).map(f64::from);
            prop_assert!(((2.0 * a - b - c) / 3.0 - f64::from(alpha)).abs() < 0.7);
            prop_assert!(((b - c) / 2.0 - f64::from(side)).abs() < 0.1);
            let (high, low) = (a.max(b).max(c), a.min(b).min(c));
            prop_assert!((high + low - 5_250.0).abs() <= 3.0, "the same share of both zero vectors");
        }

        #[test]
        fn a_compare_value_is_the_nearest_count_and_never_below_nothing(counts in -100_000_i32..100_000) {
            let exact = (f64::from(counts) / 8.0).clamp(0.0, 12_500.0);
            let given = f64::from(to_compare_value(counts + 4));
            prop_assert!((given - exact).abs() <= 0.5, "{given}, {exact}");
        }

        #[test]
        fn the_compensation_is_odd_and_never_more_than_half_the_dead_time(
            alpha in -40_000_000_i32..40_000_000,
            beta in -40_000_000_i32..40_000_000,
            dead_time in 0_u32..=10_000,
            band in 1_u32..50_000,
        ) {
            let compensation = DeadTimeCompensation::new(dead_time, band, 25_000).unwrap();
            let half = f64::from(dead_time) * 0.084 * 8.0;
            let there = compensation.compensate([0; 3], [alpha, beta]);
            let back = compensation.compensate([0; 3], [-alpha, -beta]);
            for (there, back) in there.into_iter().zip(back) {
                prop_assert!(f64::from(there.abs()) <= half + 0.5);
                prop_assert!((there + back).abs() <= 2, "{there} {back}");
            }
        }

        #[test]
        fn the_compensation_of_a_phase_is_in_proportion_to_its_current_within_the_band(
            length in 0.0..2.0_f64,
            angle in 0.0..core::f64::consts::TAU,
            dead_time in 0_u32..=10_000,
            band in 50_u32..50_000,
        ) {
            let compensation = DeadTimeCompensation::new(dead_time, band, 25_000).unwrap();
            let peak = f64::from(1 << 24);
            let current = [length * angle.cos() * peak, length * angle.sin() * peak];
            let given = compensation.compensate([7, 8, 9], current.map(|current| current as i32));
            let half = f64::from(dead_time) * 0.084 * 8.0;
            for (phase, given) in given.into_iter().enumerate() {
                let phase_angle = angle - phase as f64 * core::f64::consts::TAU / 3.0;
                let share = (length * phase_angle.cos() * 25_000.0 / f64::from(band)).clamp(-1.0, 1.0);
                let error = f64::from(given) - (7 + phase as i32) as f64 - share * half;
                // Half for rounding, and what three steps of 2^-14 of the band make.
                prop_assert!(error.abs() <= 0.5 + half * 4.0 / 16_384.0, "phase {phase}: {error}");
            }
        }
    }

    #[test]
    fn the_compensation_reaches_half_the_dead_time_at_the_end_of_its_band() {
        let compensation = DeadTimeCompensation::new(1_000, 200, 25_000).unwrap();
        let of = |alpha: i32| compensation.compensate([0; 3], [alpha, 0])[0];
        // 200 mA of 25 A: 134 218 in 2^-24
        assert_eq!(of(134_218), 84 << FRACTION);
        assert!((83 << FRACTION..84 << FRACTION).contains(&of(133_500)));
        assert_eq!(of(67_109), 42 << FRACTION);
        assert_eq!(of(0), 0);
        assert_eq!(DeadTimeCompensation::new(0, 200, 25_000).unwrap().compensate([5; 3], [1 << 24, 0]), [5; 3]);
        assert_eq!(DeadTimeCompensation::new(10_001, 1, 1), Err(SettingsError::DeadTime { actual: 10_001 }));
    }

    #[test]
    fn a_narrower_band_than_a_five_hundredth_of_the_peak_current_is_not_made() {
        let [wide, narrow] = [49, 1].map(|band| DeadTimeCompensation::new(1_000, band, 25_000).unwrap());
        assert!(narrow == DeadTimeCompensation::new(1_000, 48, 25_000).unwrap() && narrow != wide);
        // 48.8 mA of 25 A
        assert_eq!(narrow.compensate([0; 3], [16_384, 0])[0], 42 << FRACTION);
    }
}
