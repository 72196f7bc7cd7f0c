//! Gain and phase at one frequency, as a logarithm and an angle: what stands one behind the other adds up.
//!
//! A frequency response is worked out in the background, of what a tick has summed up; nothing here belongs into a tick.

use crate::arithmetic::arctangent::arctangent;

/// A complex gain that is not zero.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Response {
    /// To the base of 2, in 2^-16.
    gain: i32,
    /// In 2^-32 revolution; what is late has a phase below zero.
    phase: i32,
}

impl Response {
    /// The gain 1.
    pub const ONE: Self = Self { gain: 0, phase: 0 };

    /// A gain as its logarithm to the base of 2 in 2^-16, and a phase in 2^-32 revolution.
    #[must_use]
    pub const fn new(gain: i32, phase: i32) -> Self {
        Self { gain, phase }
    }

    /// The complex number; `None` for zero. The gain is at most 0.001 dB off, the phase 0.01 degrees.
    #[must_use]
    pub fn of_vector(real: i64, imaginary: i64) -> Option<Self> {
        let longer = real.unsigned_abs().max(imaginary.unsigned_abs());
        // Either part has 30 bits then.
        let bits = 34_u32.checked_sub(longer.leading_zeros());
        let scaled = |part: i64| match bits {
            Some(more) => part >> more,
            None => part.wrapping_shl(longer.leading_zeros().wrapping_sub(34)),
        } as i32;
        let (x, y) = (scaled(real), scaled(imaginary));
        let square = |part: i32| u64::from(part.unsigned_abs()).saturating_mul(part.unsigned_abs().into());
        let length = logarithm(square(x).saturating_add(square(y)))? / 2;
        let shifted = 34_i32.wrapping_sub(longer.leading_zeros().cast_signed()) << FRACTION;
        Some(Self { gain: length.saturating_add(shifted), phase: arctangent(y, x).cast_signed() })
    }

    /// Logarithm of the gain to the base of 2, in 2^-16.
    #[must_use]
    pub const fn gain(self) -> i32 {
        self.gain
    }

    /// In 2^-32 revolution.
    #[must_use]
    pub const fn phase(self) -> i32 {
        self.phase
    }

    /// This one and another one behind it.
    #[must_use]
    pub const fn then(self, other: Self) -> Self {
        Self { gain: self.gain.saturating_add(other.gain), phase: self.phase.wrapping_add(other.phase) }
    }

    /// Without the other one, which is in it.
    #[must_use]
    pub const fn over(self, other: Self) -> Self {
        Self { gain: self.gain.saturating_sub(other.gain), phase: self.phase.wrapping_sub(other.phase) }
    }

    /// With the opposite sign.
    #[must_use]
    pub const fn negated(self) -> Self {
        Self { gain: self.gain, phase: self.phase.wrapping_add(i32::MIN) }
    }

    /// What lies between this one and another one at `share`, in 2^-16, of the way: a line for the logarithm, and one for the phase the
    /// shorter way round.
    #[must_use]
    pub fn between(self, other: Self, share: i32) -> Self {
        let part = |way: i32| (i64::from(way).wrapping_mul(share.into()) >> FRACTION) as i32;
        let Self { gain, phase } = other.over(self);
        self.then(Self { gain: part(gain), phase: part(phase) })
    }

    /// The gain in 0.01 dB.
    #[must_use]
    pub fn hundredths_of_decibel(self) -> i32 {
        decibels(self.gain)
    }

    /// The phase in 0.01 degrees, from -180 degrees on.
    #[must_use]
    pub fn hundredths_of_degree(self) -> i32 {
        degrees(self.phase)
    }
}

/// Fraction bits of a logarithm.
pub(crate) const FRACTION: u32 = 16;

/// A logarithm to the base of 2 in 2^-16, as a gain in 0.01 dB.
pub(crate) fn decibels(logarithm: i32) -> i32 {
    // 20 lg 2 in 10^-6 dB.
    let product = i64::from(logarithm).wrapping_mul(6_020_600);
    // 10^4 and 2^16, to the nearest.
    (product.wrapping_add(327_680_000) >> FRACTION).div_euclid(10_000) as i32
}

/// A gain in 0.01 dB as a logarithm to the base of 2 in 2^-16.
pub(crate) fn of_decibels(hundredths: i32) -> i32 {
    (i64::from(hundredths).wrapping_mul(655_360_000) / 6_020_600) as i32
}

/// An angle in 2^-32 revolution, in 0.01 degrees.
pub(crate) fn degrees(angle: i32) -> i32 {
    (i64::from(angle).wrapping_mul(36_000).wrapping_add(1 << 31) >> 32) as i32
}

/// To the base of 2, in 2^-16, at most a step too low; `None` for 0.
pub(crate) fn logarithm(value: u64) -> Option<i32> {
    let whole = value.checked_ilog2()?;
    // 1 to 2 in 2^-31.
    let mut mantissa = (value << 63_u32.wrapping_sub(whole)) >> 32;
    let mut fraction = 0_i32;
    for _ in 0..FRACTION {
        mantissa = mantissa.wrapping_mul(mantissa) >> 31;
        let carry = mantissa >> 32;
        mantissa >>= carry;
        fraction = fraction << 1 | carry as i32;
    }
    Some((whole << FRACTION).cast_signed() | fraction)
}

/// `value * 2^logarithm`, with the logarithm in 2^-16; at most 10^-6 of it off and rounded down, `u32::MAX` beyond.
pub(crate) fn scaled(value: u32, logarithm: i32) -> u32 {
    let mut mantissa = u64::from(value) << 31;
    for (step, root) in (1_u32..).zip(ROOTS) {
        if logarithm >> FRACTION.wrapping_sub(step) & 1 != 0 {
            // Below 2^64: the value has 32 bits, with all roots 33.
            mantissa = (u128::from(mantissa).wrapping_mul(root.into()) >> 31) as u64;
        }
    }
    let shift = 31_i32.saturating_sub(logarithm >> FRACTION);
    let shifted = match u32::try_from(shift) {
        Ok(down) => mantissa.checked_shr(down).unwrap_or(0),
        Err(_) => u64::MAX,
    };
    u32::try_from(shifted).unwrap_or(u32::MAX)
}

/// 2^(1/2), 2^(1/4), ... in 2^-31.
const ROOTS: [u64; FRACTION as usize] = [
    3_037_000_499,
    2_553_802_833,
    2_341_847_523,
    2_242_560_871,
    2_194_507_416,
    2_170_868_211,
    2_159_144_271,
    2_153_306_066,
    2_150_392_886,
    2_148_937_774,
    2_148_210_587,
    2_147_847_086,
    2_147_665_359,
    2_147_574_501,
    2_147_529_074,
    2_147_506_360,
];

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn close(response: Response, gain: f64, degrees: f64) {
        let decibels = f64::from(response.hundredths_of_decibel()) / 100.0;
        assert!((decibels - 20.0 * gain.log10()).abs() < 0.012, "{decibels} dB, not {}", 20.0 * gain.log10());
        let off = (f64::from(response.hundredths_of_degree()) / 100.0 - degrees).rem_euclid(360.0);
        assert!(off.min(360.0 - off) < 0.02, "{response:?}: {degrees} degrees");
    }

    proptest! {
        #[test]
        fn a_vector_has_its_length_and_its_angle(real in any::<i32>(), imaginary in any::<i32>(), more in 0_u32..31) {
            prop_assume!(real.unsigned_abs().max(imaginary.unsigned_abs()) > 1 << 12);
            let (real, imaginary) = (i64::from(real) << more, i64::from(imaginary) << more);
            let (x, y) = (real as f64, imaginary as f64);
            close(Response::of_vector(real, imaginary).unwrap(), x.hypot(y), y.atan2(x).to_degrees());
        }

        #[test]
        fn a_power_is_that_of_its_logarithm(value in 1_u32..1 << 24, logarithm in -1_000_000_i32..400_000) {
            let expected = f64::from(value) * (f64::from(logarithm) / 65_536.0).exp2();
            let actual = f64::from(scaled(value, logarithm));
            prop_assume!(expected < 4e9);
            prop_assert!((actual - expected).abs() <= 1.0 + expected * 1e-6, "{} {}", actual, expected);
        }
    }

    #[test]
    fn what_stands_behind_another_adds_up_and_comes_away_again() {
        let [one, other] = [(3_000, 4_000), (-500, 1_200)].map(|(x, y)| Response::of_vector(x, y).unwrap());
        // (3 + 4j)(-0.5 + 1.2j) = -6.3 + 1.6j.
        close(one.then(other), 6.5e6, 1.6_f64.atan2(-6.3).to_degrees());
        assert_eq!(one.then(other).over(other), one);
        close(one.negated(), 5_000.0, 4.0_f64.atan2(3.0).to_degrees() - 180.0);
        assert_eq!(Response::of_vector(0, 0), None);
        assert_eq!((one.between(other, 0), one.between(other, 1 << 16)), (one, other));
        let turned = |degrees: f64| Response::new(0, (degrees / 360.0 * 4_294_967_296.0) as i64 as i32);
        close(turned(170.0).between(turned(-170.0), 1 << 15), 1.0, 180.0);
    }

    #[test]
    fn decibels_and_logarithms_are_the_same_either_way() {
        for hundredths in [-6_000, -602, -1, 0, 1, 800, 602] {
            assert_eq!(decibels(of_decibels(hundredths)), hundredths);
        }
        assert!((of_decibels(602) - 65_536).abs() < 10);
        assert_eq!((logarithm(0), logarithm(1), logarithm(1 << 40)), (None, Some(0), Some(40 << 16)));
        assert_eq!(scaled(3, 40 << 16), u32::MAX);
        assert_eq!(scaled(u32::MAX, -(40 << 16)), 0);
    }
}
