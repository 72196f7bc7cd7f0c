//! A positive real factor for 32-bit values whose product is limited, applied in a handful of instructions.

use crate::arithmetic::wide::{quotient, saturated};

/// A factor below 2^20, of which the product with a 32-bit value is limited to a magnitude between 2^28 and 2^29.
///
/// The value is shifted to the full width of a word, where it is limited, and the high word of its product with the mantissa is the result.
/// The mantissa of a factor from 1/8 on has 30 bits; that of a smaller one, which limits nothing, counts in 2^-32.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub(crate) struct LimitedGain {
    /// 2 to the number of bits by which a value is shifted.
    widening: i32,
    mantissa: i32,
}

/// Most bits to shift a value by: for a factor of 2^20.
const SHIFT_LIMIT: u32 = 22;

impl LimitedGain {
    /// The factor `numerator / denominator`; `None` when the denominator is 0 or above 2^126, or the factor is 2^20 or more. Slow.
    pub(crate) fn from_ratio(numerator: u128, denominator: u128) -> Option<Self> {
        let factor = quotient(numerator, denominator)?;
        // The fewest bits by which the factor gets below 1/4.
        let shift = (128_u32.saturating_sub(factor.leading_zeros())).saturating_sub(62);
        if shift > SHIFT_LIMIT {
            return None;
        }
        let mut gain = Self { widening: 1 << shift, mantissa: 0 };
        gain.mantissa = gain.mantissa_of(factor);
        Some(gain)
    }

    /// What a factor in 2^-64 is for values in this gain's width; up to twice the gain itself.
    pub(crate) fn mantissa_of(self, factor: u128) -> i32 {
        let dropped = self.widening.trailing_zeros().saturating_add(32);
        let half = 1_u128 << dropped.saturating_sub(1);
        i32::try_from(factor.saturating_add(half) >> dropped).unwrap_or(i32::MAX)
    }

    /// `value` in the full width of a word, and limited to it: the operand for the mantissa.
    #[inline]
    pub(crate) fn full_width(self, value: i32) -> i32 {
        saturated(i64::from(value).wrapping_mul(i64::from(self.widening)))
    }

    /// The product with what [`LimitedGain::full_width`] made of a value, to the nearest integer.
    #[inline]
    pub(crate) fn of_full_width(self, value: i32) -> i32 {
        (i64::from(value).wrapping_mul(i64::from(self.mantissa)).wrapping_add(1 << 31) >> 32) as i32
    }

    /// `value` times this factor, to the nearest integer and limited.
    #[inline]
    pub(crate) fn apply(self, value: i32) -> i32 {
        self.of_full_width(self.full_width(value))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn gain(numerator: u64, denominator: u64) -> Option<LimitedGain> {
        LimitedGain::from_ratio(numerator.into(), denominator.into())
    }

    #[test]
    fn simple_factors_are_exact() {
        assert_eq!(gain(1, 1).unwrap().apply(-123_456_789), -123_456_789);
        assert_eq!(gain(3, 2).unwrap().apply(7), 11, "10.5 rounds up");
        assert_eq!(gain(3, 2).unwrap().apply(-7), -10, "-10.5 rounds up");
        assert_eq!(gain(1 << 19, 1).unwrap().apply(-3), -3 << 19);
        assert_eq!(gain(0, 5).unwrap().apply(i32::MIN), 0);
    }

    #[test]
    fn factors_out_of_range_are_refused() {
        assert_eq!(gain(1, 0), None);
        assert_eq!(gain(1 << 20, 1), None);
        assert!(gain((1 << 20) - 1, 1).is_some());
        assert!(gain(1, u64::MAX).is_some());
    }

    prop_compose! {
        fn factor()(
            numerator in 1_u64..1 << 50, shift in 0_u32..50, denominator in 1_u64..1 << 50, smaller in 0_u32..50,
        ) -> (u64, u64) {
            (numerator >> shift, (denominator >> smaller).max(1))
        }
    }

    proptest! {
        #[test]
        fn the_product_is_exact_to_its_last_bit_and_a_billionth_or_limited(
            (numerator, denominator) in factor(), value in any::<i32>(), shift in 0_u32..31,
        ) {
            let Some(gain) = gain(numerator, denominator) else { return Ok(()) };
            let value = value >> shift;
            let product = i128::from(gain.apply(value));
            let exact = i128::from(value) * i128::from(numerator);
            let off = (product * i128::from(denominator) - exact).abs();
            // Half of the last bit for rounding, another half for a mantissa that counts in 2^-32.
            let allowed = i128::from(denominator) + exact.abs() / 1_000_000_000;
            if i32::try_from(i64::from(value) * i64::from(gain.widening)).is_err() {
                prop_assert_eq!(product.signum(), i128::from(value.signum()));
                prop_assert!((1 << 28..=1 << 29).contains(&product.abs()), "{}", product);
                prop_assert!(product.abs() * i128::from(denominator) <= exact.abs() + allowed);
            } else {
                prop_assert!(off <= allowed, "{} of {}/{}", product, exact, denominator);
            }
        }

        #[test]
        fn a_larger_value_never_has_a_smaller_product(
            (numerator, denominator) in factor(), value in any::<i32>(), shift in 0_u32..31, more in 0..=i32::MAX,
        ) {
            let Some(gain) = gain(numerator, denominator) else { return Ok(()) };
            let value = value >> shift;
            prop_assert!(gain.apply(value) <= gain.apply(value.saturating_add(more >> shift)));
        }
    }
}
