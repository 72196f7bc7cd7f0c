//! The exponential function, from additions and multiplications alone: the C library's differs in the last bit between machines.

/// Above this e^-x is below the last bit of anything that it is added to.
const FORGOTTEN: f64 = 60.0;
/// Terms of the series up to 0.5: the next one is below 1e-17.
const TERMS: u32 = 15;

/// e^-x for an x that is not negative. The error is below 1e-13 of the value.
pub(crate) fn decay(x: f64) -> f64 {
    if x >= FORGOTTEN {
        return 0.0;
    }
    let (mut part, mut doublings) = (x, 0);
    while part > 0.5 {
        part *= 0.5;
        doublings += 1;
    }
    let series = (1..=TERMS).rev().fold(1.0, |inner, n| 1.0 - part / f64::from(n) * inner);
    (0..doublings).fold(series, |value, _| value * value)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_decays_is_that_of_the_library() {
        for n in 0..60_000 {
            let x = f64::from(n) * 1e-3;
            let (value, expected) = (decay(x), (-x).exp());
            assert!((value / expected - 1.0).abs() < 1e-13, "{x}: {value} instead of {expected}");
        }
        assert_eq!((decay(0.0), decay(60.0), decay(1e300)), (1.0, 0.0, 0.0));
    }
}
