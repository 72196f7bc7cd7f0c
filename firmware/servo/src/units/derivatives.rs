//! Signed acceleration and jerk, the derivatives of a set-point beyond its velocity.

use crate::arithmetic::division::{TEN_TO_15, TWO_PI_TIMES_TEN_TO_15, divide_rounding};
use crate::arithmetic::wide::saturated;

/// Angular acceleration with its sign, in 2^-48 revolution per loop tick squared: what a set-point carries for the feed-forward S-0-0348.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct SignedAcceleration(i64);

impl SignedAcceleration {
    /// No change of velocity.
    pub const ZERO: Self = Self(0);

    /// So many 2^-48 revolutions per tick squared.
    #[must_use]
    pub const fn from_bits(bits: i64) -> Self {
        Self(bits)
    }

    /// In 2^-48 revolutions per tick squared.
    #[must_use]
    pub const fn to_bits(self) -> i64 {
        self.0
    }

    /// In 2^-42 revolutions per tick squared, 0.000 1 rad/s², at most 196 000 rad/s².
    #[inline]
    pub(crate) const fn coarse(self) -> i32 {
        saturated(self.0 >> 6)
    }
}

/// Magnitude of an angular jerk in 2^-48 revolution per loop tick cubed (0.011 rad/s³).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Jerk(u64);

impl Jerk {
    /// So many 2^-48 revolutions per tick cubed.
    #[must_use]
    pub const fn from_bits(bits: u64) -> Self {
        Self(bits)
    }

    /// In 2^-48 revolutions per tick cubed.
    #[must_use]
    pub const fn to_bits(self) -> u64 {
        self.0
    }

    /// From 10^-3 rad/s³, to the nearest step; the accelerations' preferred rotary scaling, a second further. Divides: for parameters.
    #[must_use]
    pub fn from_milliradians_per_second_cubed(value: u32) -> Self {
        // 1 rad/s³ = 2^48 / (2 pi * 8000^3) steps. Positive and below 2^29 for 2^32 of them.
        let bits = divide_rounding(
            (i128::from(value) << 48).saturating_mul(TEN_TO_15),
            TWO_PI_TIMES_TEN_TO_15.saturating_mul(1_000 * 512_000_000_000),
        ) as u64;
        Self(bits)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::Acceleration;

    #[test]
    fn a_jerk_is_what_an_acceleration_gains_in_a_tick() {
        // 8000 ticks of 1000 rad/s³ make 1000 rad/s², to the half step of the jerk.
        let jerk = Jerk::from_milliradians_per_second_cubed(1_000_000).to_bits();
        let acceleration = Acceleration::from_milliradians_per_second_squared(1_000_000).to_bits();
        assert!((jerk * 8_000).abs_diff(acceleration) <= 4_000, "{jerk} {acceleration}");
        assert!((87_490..=87_505).contains(&jerk), "{jerk}");
        assert_eq!(Jerk::from_milliradians_per_second_cubed(0).to_bits(), 0);
        assert!(Jerk::from_milliradians_per_second_cubed(u32::MAX).to_bits() < 1 << 29);
    }
}
