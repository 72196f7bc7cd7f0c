//! Sine and cosine, the one place where [`idsp`] is used for them: its interface changes between releases.

/// Sine and cosine of an angle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Rotation {
    /// In 2^-31.
    pub cosine: i32,
    /// In 2^-31.
    pub sine: i32,
}

impl Rotation {
    /// No rotation; short of 1 by 2^-31.
    pub const NONE: Self = Self { cosine: i32::MAX, sine: 0 };

    /// The rotation by an angle in 2^-32 revolution. Sine and cosine are at most 2e-5 off.
    #[inline]
    #[must_use]
    pub fn by(angle: u32) -> Self {
        let (cosine, sine) = idsp::cossin(angle.cast_signed());
        Self { cosine, sine }
    }

    /// The rotation by so many 2^-31 of a quarter revolution, either way. Sine and cosine are at most 8.2e-5 off, 0.005 degrees: for what turns
    /// between two cycles, where two polynomials are half of what a table takes.
    #[inline]
    #[must_use]
    pub fn within_a_quarter(share: i32) -> Self {
        let [first, third, fifth] = SINE;
        let [whole, second, fourth, sixth] = COSINE;
        // Everything with its sign turned round, and the share by its complement, half a step beside it: of a factor that cannot be negative
        // the compiler makes an unsigned one, and with it two instructions more than a signed product and its sum take.
        let share = !share;
        // 2^-30
        let square = high_product(share, !share);
        let slope = first.wrapping_add(high_product(square, third.wrapping_add(high_product(square, fifth))));
        let cosine = fourth.wrapping_add(high_product(square, sixth));
        let cosine = whole.wrapping_add(high_product(square, second.wrapping_add(high_product(square, cosine))));
        Self { cosine: cosine.wrapping_neg().wrapping_shl(3), sine: high_product(share, slope).wrapping_shl(3) }
    }

    /// This rotation and then another one, in 2^-30.
    #[inline]
    #[must_use]
    pub fn half_then(self, then: Self) -> Self {
        Self {
            cosine: sum_of_products(self.cosine, then.cosine, self.sine.wrapping_neg(), then.sine),
            sine: sum_of_products(self.sine, then.cosine, self.cosine, then.sine),
        }
    }
}

/// sin(x pi/2) = 1.570243 x - 0.641711 x^3 + 0.071468 x^5: least largest error of those that are 1 at the end, in 2^-29, 2^-31, 2^-33. Short by
/// eight steps, which keeps it below 1. Signs as [`Rotation::within_a_quarter`] needs them.
const SINE: [i32; 3] = [-843_017_722, -1_378_063_688, -613_905_671];
/// cos(x pi/2) = 1 - 1.233542 x^2 + 0.252698 x^4 - 0.019164 x^6: least largest error of those that are 1 in the middle, in 2^-28, 2^-30,
/// 2^-32, 2^-34. Short by a step.
const COSINE: [i32; 4] = [-268_435_455, -1_324_505_336, -1_085_328_906, -329_234_142];

/// `(a * b + c * d) / 2^32`, rounded down.
#[inline]
pub(crate) fn sum_of_products(a: i32, b: i32, c: i32, d: i32) -> i32 {
    let sum = i64::from(a).wrapping_mul(i64::from(b)).wrapping_add(i64::from(c).wrapping_mul(i64::from(d)));
    (sum >> 32) as i32
}

/// `a * b / 2^32`, to the nearest.
#[inline]
pub(crate) fn rounded_product(a: i32, b: i32) -> i32 {
    (i64::from(a).wrapping_mul(i64::from(b)).wrapping_add(1 << 31) >> 32) as i32
}

/// `a * b / 2^32`, rounded down.
#[inline]
pub(crate) fn high_product(a: i32, b: i32) -> i32 {
    (i64::from(a).wrapping_mul(i64::from(b)) >> 32) as i32
}

#[cfg(test)]
mod tests {
    use super::*;

    const UNIT: f64 = 2_147_483_648.0;

    #[test]
    fn sine_and_cosine_are_within_the_error_that_is_stated() {
        let mut worst = 0.0_f64;
        for step in 0..100_000_u32 {
            let angle = step.wrapping_mul(42_949);
            let exact = f64::from(angle) / 4_294_967_296.0 * core::f64::consts::TAU;
            let rotation = Rotation::by(angle);
            worst = worst.max((f64::from(rotation.cosine) / UNIT - exact.cos()).abs());
            worst = worst.max((f64::from(rotation.sine) / UNIT - exact.sin()).abs());
        }
        assert!((5e-6..2e-5).contains(&worst), "{worst}");
    }

    #[test]
    fn a_rotation_within_a_quarter_is_within_its_error_up_to_both_ends() {
        let mut worst = [0.0_f64; 2];
        let ends = [i32::MIN, i32::MIN + 1, -1, 0, 1, i32::MAX - 1, i32::MAX];
        for share in (0..=100_000_i64).map(|step| (step * 42_949 - 2_147_450_000) as i32).chain(ends) {
            let exact = f64::from(share) / UNIT * core::f64::consts::FRAC_PI_2;
            let rotation = Rotation::within_a_quarter(share);
            let errors =
                [f64::from(rotation.cosine) / UNIT - exact.cos(), f64::from(rotation.sine) / UNIT - exact.sin()];
            worst = [worst[0].max(errors[0].abs()), worst[1].max(errors[1].abs())];
        }
        assert!((7e-6..8e-6).contains(&worst[0]), "cosine {worst:?}");
        assert!((8e-5..8.2e-5).contains(&worst[1]), "sine {worst:?}");
        assert!(Rotation::within_a_quarter(0) == Rotation { cosine: i32::MAX - 7, sine: 0 });
    }

    #[test]
    fn two_rotations_make_the_rotation_by_their_sum() {
        for (angle, then) in [(0, 0), (1 << 29, 1 << 28), (3 << 30, 1 << 27), (0xF000_0000, 0xF800_0000)] {
            let sum = Rotation::by(angle).half_then(Rotation::by(then));
            let exact = Rotation::by(angle.wrapping_add(then));
            assert!((2.0 * f64::from(sum.cosine) - f64::from(exact.cosine)).abs() < 4e-5 * UNIT, "{angle:X} {then:X}");
            assert!((2.0 * f64::from(sum.sine) - f64::from(exact.sine)).abs() < 4e-5 * UNIT, "{angle:X} {then:X}");
        }
    }
}
