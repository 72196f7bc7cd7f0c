//! The factor from an acceleration to the current that makes it.

use crate::arithmetic::wide::{quotient, saturated, times_fraction_to_nearest};
use crate::units::derivatives::SignedAcceleration;

/// A factor below 2^18 from acceleration steps to 2^-25 of the peak current; what it makes is limited to four peaks.
///
/// Accelerations have 64 bits, so that the slowest axis has the resolution and the fastest the range.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub(crate) struct AccelerationGain {
    fraction: i32,
    shift: u32,
    limit: i32,
}

/// Four peaks.
const LIMIT: i32 = 1 << 27;
const SHIFT_LIMIT: u32 = 19;

impl AccelerationGain {
    /// The factor `numerator / denominator`; `None` when the denominator is 0 or above 2^126, or the factor is 2^18 or more. Slow.
    pub(crate) fn from_ratio(numerator: u128, denominator: u128) -> Option<Self> {
        let factor = quotient(numerator, denominator)?;
        // The fewest bits by which the factor gets below 1/2.
        let shift = (128_u32.saturating_sub(factor.leading_zeros())).saturating_sub(63);
        if shift > SHIFT_LIMIT {
            return None;
        }
        let dropped = shift.saturating_add(32);
        let half = 1_u128 << dropped.saturating_sub(1);
        let fraction = i32::try_from(factor.saturating_add(half) >> dropped).unwrap_or(i32::MAX);
        Some(Self { fraction, shift, limit: LIMIT >> shift })
    }

    #[inline]
    pub(crate) fn apply(self, acceleration: SignedAcceleration) -> i32 {
        let product = saturated(times_fraction_to_nearest(acceleration.to_bits(), self.fraction));
        product.min(self.limit).max(self.limit.wrapping_neg()).wrapping_shl(self.shift)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_current_is_that_of_the_factor_to_its_steps_and_a_billionth_or_limited(
            numerator in 1_u64..1 << 50, shift in 0_u32..50, denominator in 1_u64..1 << 50,
            divisor in 0_u32..50, acceleration in any::<i64>(), smaller in 0_u32..63,
        ) {
            let (numerator, denominator) = (numerator >> shift, (denominator >> divisor).max(1));
            let Some(gain) = AccelerationGain::from_ratio(numerator.into(), denominator.into()) else { return Ok(()) };
            let acceleration = acceleration >> smaller;
            let current = f64::from(gain.apply(SignedAcceleration::from_bits(acceleration)));
            let factor = numerator as f64 / denominator as f64;
            let exact = (acceleration as f64 * factor).clamp(-f64::from(LIMIT), f64::from(LIMIT));
            // The fraction counts in 2^-32, and the product in up to four of the steps that the factor makes of one.
            let allowed = 1.0 + 2.0 * factor.max(1.0) + exact.abs() / 1e9 + acceleration.unsigned_abs() as f64 * 1.2e-10;
            prop_assert!((current - exact).abs() <= allowed, "{} for {}", current, exact);
        }
    }

    #[test]
    fn factors_out_of_range_are_refused() {
        assert_eq!(AccelerationGain::from_ratio(1, 0), None);
        assert_eq!(AccelerationGain::from_ratio(1 << 18, 1), None);
        let largest = AccelerationGain::from_ratio((1 << 18) - 1, 1).unwrap();
        assert_eq!(largest.apply(SignedAcceleration::from_bits(i64::MIN)), -LIMIT);
        assert_eq!(AccelerationGain::from_ratio(0, 1).unwrap().apply(SignedAcceleration::from_bits(i64::MAX)), 0);
    }
}
