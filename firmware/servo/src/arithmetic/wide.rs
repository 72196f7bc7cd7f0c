//! Arithmetic on 64-bit values with what the processor has: 32-bit multiplications whose products have 64 bits.
//!
//! The compiler makes a call or a dozen instructions of a general 64-bit multiplication or limit; these shapes it turns into
//! three or four.

/// `value` limited to the range of `i32`.
#[inline]
pub(crate) const fn saturated(value: i64) -> i32 {
    let low = value as i32;
    if low as i64 == value {
        low
    } else {
        // All ones for a negative value: the complement of the largest is the smallest.
        i32::MAX ^ (value >> 63) as i32
    }
}

/// `value` limited to `-limit ..= limit`. Unlike `clamp` it has no panic for a negative limit.
#[inline]
pub(crate) fn limited(value: i64, limit: i64) -> i64 {
    value.min(limit).max(limit.wrapping_neg())
}

/// `value * fraction / 2^32`, rounded down; the fraction is not negative.
#[inline]
pub(crate) fn times_fraction(value: i64, fraction: i32) -> i64 {
    let high = (value >> 32) as i32;
    let of_low = u64::from(value as u32).wrapping_mul(u64::from(fraction as u32)) >> 32;
    i64::from(high).wrapping_mul(i64::from(fraction)).wrapping_add(of_low as i64)
}

/// `numerator / denominator` in 2^-64, rounded down; `None` when the denominator is 0 or above 2^126, or the quotient is 2^32 or more.
/// Slow: for settings.
pub(crate) fn quotient(numerator: u128, denominator: u128) -> Option<u128> {
    if denominator > 1 << 126 {
        return None;
    }
    let whole = numerator.checked_div(denominator).filter(|whole| *whole < 1 << 32)?;
    let mut rest = numerator.checked_rem(denominator)?;
    let mut quotient = whole;
    for _ in 0..64 {
        rest = rest.saturating_mul(2);
        let carry = rest >= denominator;
        if carry {
            rest = rest.saturating_sub(denominator);
        }
        quotient = quotient << 1 | u128::from(carry);
    }
    Some(quotient)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn quotients_out_of_range_are_refused() {
        assert_eq!(quotient(1, 0), None);
        assert_eq!(quotient(1 << 32, 1), None);
        assert_eq!(quotient(1, (1 << 126) + 1), None);
        assert_eq!(quotient((1 << 32) - 1, 1), Some(((1 << 32) - 1) << 64));
        assert_eq!(quotient(2, 3), Some(12_297_829_382_473_034_410));
    }

    proptest! {
        #[test]
        fn the_limit_is_that_of_the_type(value in any::<i64>(), small in any::<i32>(), beside in -3_i64..3) {
            for value in [value, i64::from(small), i64::from(i32::MAX) + beside, i64::from(i32::MIN) + beside] {
                prop_assert_eq!(i64::from(saturated(value)), value.clamp(i32::MIN.into(), i32::MAX.into()));
            }
        }

        #[test]
        fn the_fraction_of_a_product_is_exact(value in any::<i64>(), fraction in 0..=i32::MAX) {
            let product = i128::from(value) * i128::from(fraction);
            prop_assert_eq!(i128::from(times_fraction(value, fraction)), product >> 32);
        }

        #[test]
        fn a_quotient_is_cut_to_its_last_bit(numerator in any::<u64>(), denominator in 1_u64..) {
            prop_assume!(numerator / denominator < 1 << 32);
            let exact = (u128::from(numerator / denominator) << 64)
                + (u128::from(numerator % denominator) << 64) / u128::from(denominator);
            prop_assert_eq!(quotient(numerator.into(), denominator.into()), Some(exact));
        }
    }
}
