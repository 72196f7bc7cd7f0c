//! Divisions of settings and displays: to the nearest, and by 2 pi. Nothing here belongs into a tick.

/// Quotient to the nearest integer, halves away from zero, limited to the range of `i64`; 0 for a divisor of 0.
pub(crate) fn divide_rounding(numerator: i128, divisor: i128) -> i64 {
    let half = divisor / 2;
    let adjusted =
        if (numerator < 0) == (divisor < 0) { numerator.saturating_add(half) } else { numerator.saturating_sub(half) };
    let quotient = adjusted.checked_div(divisor).unwrap_or(0);
    // Clamped to the range of i64.
    quotient.clamp(i128::from(i64::MIN), i128::from(i64::MAX)) as i64
}

/// 2 pi in 10^-15.
pub(crate) const TWO_PI_TIMES_TEN_TO_15: i128 = 6_283_185_307_179_586;
pub(crate) const TEN_TO_15: i128 = 1_000_000_000_000_000;

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn rounding_is_to_nearest(numerator in -(1_i64 << 50)..1 << 50, divisor in 1_i64..1 << 30) {
            let quotient = i128::from(divide_rounding(numerator.into(), divisor.into()));
            prop_assert!((quotient * i128::from(divisor) - i128::from(numerator)).abs() * 2 <= i128::from(divisor));
        }
    }
}
