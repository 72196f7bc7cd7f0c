//! A positive real factor as mantissa and shift, applied without division.

/// A factor in `0 ..= 2^24` with a relative error of at most 2^-24.
///
/// Built once from a ratio of integers, applied in the loop as one multiplication and one shift, rounded to nearest.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Gain {
    mantissa: u32,
    shift: u32,
    half: i64,
}

/// Inputs are limited to this magnitude, so that the product with the mantissa stays within 64 bits.
const INPUT_LIMIT: i64 = 1 << 38;
const MANTISSA_BITS: u32 = 24;
const SHIFT_LIMIT: u32 = 62;

impl Gain {
    /// The factor 0.
    pub const ZERO: Self = Self { mantissa: 0, shift: 0, half: 0 };

    /// The factor 1.
    pub const ONE: Self = Self { mantissa: 1, shift: 0, half: 0 };

    /// The factor `numerator / denominator`; `None` when the denominator is 0 or above 2^126, or the factor is 2^24 or more.
    ///
    /// A factor below 2^-62 becomes 0.
    #[must_use]
    pub fn from_ratio(numerator: u128, denominator: u128) -> Option<Self> {
        if denominator > 1 << 126 {
            return None;
        }
        let whole = numerator.checked_div(denominator)?;
        let mut rest = numerator.checked_rem(denominator)?;
        let mut mantissa = u32::try_from(whole).ok()?;
        if mantissa >= 1 << MANTISSA_BITS {
            return None;
        }
        let mut shift = 0_u32;
        while mantissa < 1 << (MANTISSA_BITS - 1) && shift < SHIFT_LIMIT {
            rest = rest.saturating_mul(2);
            let carry = rest >= denominator;
            if carry {
                rest = rest.saturating_sub(denominator);
            }
            mantissa = mantissa.saturating_mul(2).saturating_add(u32::from(carry));
            shift = shift.saturating_add(1);
        }
        if rest.saturating_mul(2) >= denominator {
            mantissa = mantissa.saturating_add(1);
        }
        if mantissa == 0 {
            return Some(Self::ZERO);
        }
        let half = if shift == 0 { 0 } else { 1_i64.wrapping_shl(shift.wrapping_sub(1)) };
        Some(Self { mantissa, shift, half })
    }

    /// `value` times this factor, to the nearest integer. Values beyond +-2^38 count as +-2^38.
    #[inline]
    #[must_use]
    pub fn apply(self, value: i64) -> i64 {
        let value = value.clamp(-INPUT_LIMIT, INPUT_LIMIT);
        value.wrapping_mul(i64::from(self.mantissa)).wrapping_add(self.half).wrapping_shr(self.shift)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn simple_factors_are_exact() {
        assert_eq!(Gain::from_ratio(1, 1).unwrap().apply(-123_456_789_012), -123_456_789_012);
        assert_eq!(Gain::from_ratio(3, 2).unwrap().apply(7), 11, "10.5 rounds up");
        assert_eq!(Gain::from_ratio(3, 2).unwrap().apply(-7), -10, "-10.5 rounds up");
        assert_eq!(Gain::from_ratio(0, 5).unwrap(), Gain::ZERO);
        assert_eq!(Gain::ONE.apply(5), 5);
        assert_eq!(Gain::ZERO.apply(i64::MAX), 0);
    }

    #[test]
    fn factors_out_of_range_are_refused() {
        assert_eq!(Gain::from_ratio(1, 0), None);
        assert_eq!(Gain::from_ratio(1 << 24, 1), None);
        assert_eq!(Gain::from_ratio(1, (1 << 126) + 1), None);
        assert!(Gain::from_ratio((1 << 24) - 1, 1).is_some());
    }

    proptest! {
        #[test]
        fn the_product_is_within_a_relative_error_of_a_ten_millionth(
            numerator in 1_u64..1 << 50, denominator in 1_u64..1 << 50, value in -(1_i64 << 38)..=1_i64 << 38,
        ) {
            prop_assume!(numerator / denominator < (1 << 24) - 1);
            let product = Gain::from_ratio(numerator.into(), denominator.into()).unwrap().apply(value);
            let exact = i128::from(value) * i128::from(numerator);
            let error = (i128::from(product) * i128::from(denominator) - exact).abs();
            prop_assert!(error <= exact.abs() / 10_000_000 + i128::from(denominator));
        }
    }
}
