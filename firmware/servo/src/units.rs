//! Position, velocity, acceleration and current in the loop's own units.
//!
//! | type | unit | one step | range |
//! |---|---|---|---|
//! | [`Position`] | revolution of the motor, 2^-32 | 84 n° | +-2^31 revolutions, then wraps (149 days at 10 000 rpm; differences stay right) |
//! | [`Velocity`] | revolution per loop tick, 2^-36 | 7.0e-6 rpm | +-15 000 rpm, saturating |
//! | [`Acceleration`] | revolution per loop tick squared, 2^-48 | 1.4e-6 rad/s² | 0 ... 2.2e9 rad/s² |
//! | [`CurrentFraction`] | peak current, 2^-15 | 31 ppm of peak | -1 ... +1 - 2^-15 |

pub(crate) mod derivatives;
pub(crate) mod modulo;
pub(crate) mod scaling;

use core::ops::{Add, Neg, Sub};

use fixed::types::{I1F15, I32F32};

pub use derivatives::{Jerk, SignedAcceleration};
pub use modulo::{Modulo, ModuloCounter};
pub use scaling::{PositionScale, VelocityScale};

use crate::arithmetic::division::{TEN_TO_15, TWO_PI_TIMES_TEN_TO_15, divide_rounding};
use crate::arithmetic::wide::saturated;

/// Period of the position and velocity loop in microseconds.
pub const LOOP_PERIOD_MICROSECONDS: u32 = 125;

/// Loop ticks between two looks of the supervision: bus, loads, temperatures, brake, state.
pub const LOOP_TICKS_PER_SUPERVISION: u32 = 4;

/// Period of the supervision in microseconds.
pub const SUPERVISION_PERIOD_MICROSECONDS: u32 = LOOP_PERIOD_MICROSECONDS * LOOP_TICKS_PER_SUPERVISION;

/// Loop ticks in a second.
pub const LOOP_TICKS_PER_SECOND: u32 = 8_000;

/// Torque-producing current as a fraction of the amplifier's peak current (S-0-0110); positive accelerates in counting direction.
pub type CurrentFraction = I1F15;

/// An angle of the motor shaft, or a difference of two, in 2^-32 revolution.
///
/// Sums and differences wrap at +-2^31 revolutions: an axis may turn one way for ever, its following error stays right.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Position(i64);

impl Position {
    /// The zero of the axis.
    pub const ZERO: Self = Self(0);

    /// One revolution of the motor.
    pub const REVOLUTION: Self = Self(1 << 32);

    /// So many 2^-32 revolutions.
    #[must_use]
    pub const fn from_bits(bits: i64) -> Self {
        Self(bits)
    }

    /// In 2^-32 revolutions.
    #[must_use]
    pub const fn to_bits(self) -> i64 {
        self.0
    }

    /// From revolutions as a fixed-point number, exactly.
    #[must_use]
    pub const fn from_revolutions(revolutions: I32F32) -> Self {
        Self(revolutions.to_bits())
    }

    /// Revolutions as a fixed-point number, exactly.
    #[must_use]
    pub const fn to_revolutions(self) -> I32F32 {
        I32F32::from_bits(self.0)
    }

    /// The magnitude; that of -2^31 revolutions is one step short of 2^31.
    #[must_use]
    pub const fn abs(self) -> Self {
        Self(self.0.saturating_abs())
    }
}

impl Add for Position {
    type Output = Self;
    #[inline]
    fn add(self, other: Self) -> Self {
        Self(self.0.wrapping_add(other.0))
    }
}

impl Sub for Position {
    type Output = Self;
    #[inline]
    fn sub(self, other: Self) -> Self {
        Self(self.0.wrapping_sub(other.0))
    }
}

impl Neg for Position {
    type Output = Self;
    #[inline]
    fn neg(self) -> Self {
        Self(self.0.wrapping_neg())
    }
}

#[cfg(feature = "defmt")]
impl defmt::Format for Position {
    fn format(&self, formatter: defmt::Formatter<'_>) {
        defmt::write!(formatter, "Position({=i64})", self.0);
    }
}

/// Angular velocity in 2^-36 revolution per loop tick; sums and differences saturate at +-15 000 rpm.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Velocity(i32);

impl Velocity {
    /// Standstill.
    pub const ZERO: Self = Self(0);

    /// The fastest representable velocity, 15 000 rpm less one step.
    pub const MAX: Self = Self(i32::MAX);

    /// So many 2^-36 revolutions per tick.
    #[must_use]
    pub const fn from_bits(bits: i32) -> Self {
        Self(bits)
    }

    /// In 2^-36 revolutions per tick.
    #[must_use]
    pub const fn to_bits(self) -> i32 {
        self.0
    }

    /// So many 2^-36 revolutions per tick, limited to the range of the type.
    #[inline]
    #[must_use]
    pub fn saturating_from_bits(bits: i64) -> Self {
        Self(saturated(bits).max(-i32::MAX))
    }

    /// Of something that moves by `way` in a tick; beyond the range of the type the last 16 steps within it.
    #[inline]
    #[must_use]
    pub fn of_a_tick(way: Position) -> Self {
        // 15 000 rpm are 2^27 position steps a tick.
        Self(saturated(way.0).clamp(-(1 << 27), (1 << 27) - 1) << 4)
    }

    /// From 10^-4 rpm, the preferred rotary scaling of S-0-0036, S-0-0040, S-0-0091 (sercos2.md 6.5); limited to +-15 000 rpm.
    ///
    /// Divides: for parameters. Cyclic values go through [`crate::units::VelocityScale`].
    #[must_use]
    pub fn from_ten_thousandths_rpm(value: i32) -> Self {
        // 10^-4 rpm = 2^36 / (60 * 8000 * 10^4) steps = 2^24 / 1171875 steps
        Self::saturating_from_bits(divide_rounding(i128::from(value) << 24, 1_171_875))
    }

    /// In 10^-4 rpm, to the nearest. Divides: for displays.
    #[must_use]
    pub fn to_ten_thousandths_rpm(self) -> i32 {
        // At most 15 000 rpm: 1.5e8.
        divide_rounding(i128::from(self.0).saturating_mul(1_171_875), 1 << 24) as i32
    }

    /// The magnitude.
    #[inline]
    #[must_use]
    pub const fn abs(self) -> Self {
        Self(self.0.saturating_abs())
    }

    /// Limited to `-limit ..= limit`; a negative limit counts as its magnitude.
    #[inline]
    #[must_use]
    pub fn limit(self, limit: Self) -> Self {
        let limit = limit.abs().0;
        Self(self.0.min(limit).max(limit.wrapping_neg()))
    }
}

impl Add for Velocity {
    type Output = Self;
    #[inline]
    fn add(self, other: Self) -> Self {
        Self(self.0.saturating_add(other.0))
    }
}

impl Sub for Velocity {
    type Output = Self;
    #[inline]
    fn sub(self, other: Self) -> Self {
        Self(self.0.saturating_sub(other.0))
    }
}

impl Neg for Velocity {
    type Output = Self;
    #[inline]
    fn neg(self) -> Self {
        Self(self.0.saturating_neg())
    }
}

/// Magnitude of an angular acceleration in 2^-48 revolution per loop tick squared.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Acceleration(u64);

impl Acceleration {
    /// So many 2^-48 revolutions per tick squared.
    #[must_use]
    pub const fn from_bits(bits: u64) -> Self {
        Self(bits)
    }

    /// In 2^-48 revolutions per tick squared.
    #[must_use]
    pub const fn to_bits(self) -> u64 {
        self.0
    }

    /// From 10^-3 rad/s², the preferred rotary scaling of S-0-0138 (sercos2.md 6.5). Divides: for parameters.
    #[must_use]
    pub fn from_milliradians_per_second_squared(value: u32) -> Self {
        // 1 rad/s² = 2^48 / (2 pi * 8000^2) steps; at most 3.1e12 steps
        // Positive and below 2^42.
        let bits = divide_rounding(
            (i128::from(value) << 48).saturating_mul(TEN_TO_15),
            TWO_PI_TIMES_TEN_TO_15.saturating_mul(1_000 * 64_000_000),
        ) as u64;
        Self(bits)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn speeds_are_those_of_the_table() {
        // 10 000 rpm = 1/48 revolution per tick
        assert_eq!(
            Velocity::from_ten_thousandths_rpm(100_000_000).to_bits(),
            ((1_i64 << 36) as f64 / 48.0).round() as i32
        );
        assert_eq!(Velocity::MAX.to_ten_thousandths_rpm(), 150_000_000);
        assert_eq!(Velocity::from_ten_thousandths_rpm(i32::MAX), Velocity::MAX);
        assert_eq!(Velocity::from_ten_thousandths_rpm(i32::MIN), -Velocity::MAX);
    }

    #[test]
    fn an_acceleration_is_that_of_its_radians() {
        // 2000 pi rad/s² = 1000 rev/s² = 1000 * 2^48 / 8000^2
        let thousand = Acceleration::from_milliradians_per_second_squared(6_283_185).to_bits();
        assert!(thousand.abs_diff(1_000 * (1_u64 << 48) / 64_000_000) < 300, "{thousand}");
    }

    #[test]
    fn a_following_error_stays_right_where_positions_wrap() {
        let command = Position::from_bits(i64::MIN + 5);
        let measured = Position::from_bits(i64::MAX - 5);
        assert_eq!((command - measured).to_bits(), 11);
        assert_eq!(Position::from_bits(i64::MIN).abs().to_bits(), i64::MAX);
    }

    #[test]
    fn revolutions_are_exact() {
        let position = Position::from_revolutions(I32F32::from_num(-2.75));
        assert_eq!(position.to_bits(), -(11 << 30));
        assert_eq!(position.to_revolutions(), I32F32::from_num(-2.75));
        assert_eq!(Position::REVOLUTION.to_revolutions(), 1);
    }

    #[test]
    fn velocities_saturate() {
        assert_eq!(Velocity::MAX + Velocity::MAX, Velocity::MAX);
        assert_eq!(Velocity::from_bits(7).limit(Velocity::from_bits(-5)), Velocity::from_bits(5));
        assert_eq!(Velocity::from_bits(-7).limit(Velocity::from_bits(5)), Velocity::from_bits(-5));
        assert_eq!(Velocity::saturating_from_bits(i64::MIN), -Velocity::MAX);
        assert_eq!(Velocity::saturating_from_bits(i64::MAX), Velocity::MAX);
    }

    #[test]
    fn the_way_of_a_tick_is_its_velocity_and_keeps_its_sign_however_long() {
        let of = |bits| Velocity::of_a_tick(Position::from_bits(bits)).to_bits();
        assert_eq!([of(1), of(-1), of((1 << 27) - 1), of(-(1 << 27))], [16, -16, i32::MAX - 15, i32::MIN]);
        for far in [1 << 27, 1 << 31, 3 << 31, 1 << 32, i64::MAX] {
            assert_eq!([of(far), of(-far)], [i32::MAX - 15, i32::MIN], "{far}");
        }
    }

    proptest! {
        #[test]
        fn a_velocity_in_ten_thousandths_of_rpm_reads_back(value in -149_999_000..149_999_000) {
            prop_assert_eq!(Velocity::from_ten_thousandths_rpm(value).to_ten_thousandths_rpm(), value);
        }
    }
}
