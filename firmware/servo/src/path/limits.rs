//! Limits of a movement that the drive makes by itself, scaled for the tick.

use crate::error::SettingsError;
use crate::path::stopping::{LONGEST_BRAKING, Slope, SmoothBrake};
use crate::units::derivatives::Jerk;
use crate::units::{Acceleration, Velocity};

/// Share of the velocity limit that a drive-controlled movement may use (S-0-0108).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct FeedrateOverride {
    /// 2^-24, 0 ..= 2^24.
    share: u32,
}

impl FeedrateOverride {
    /// The whole velocity.
    pub const FULL: Self = Self { share: 1 << 24 };

    /// From the data of S-0-0108, in 0.01 %: `0 ..= 10_000`. Divides.
    ///
    /// # Errors
    /// [`SettingsError::FeedrateOverride`] above 100 %.
    pub fn new(hundredths_of_percent: u16) -> Result<Self, SettingsError> {
        if hundredths_of_percent > 10_000 {
            return Err(SettingsError::FeedrateOverride { actual: hundredths_of_percent });
        }
        let share = (u64::from(hundredths_of_percent) << 24) / 10_000;
        Ok(Self { share: u32::try_from(share).unwrap_or(0) })
    }
}

/// Velocity, acceleration, deceleration and jerk that a [`crate::path::Trajectory`] never exceeds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct MotionLimits {
    /// In 2^-48 revolution per tick.
    full_velocity: i64,
    /// With the feedrate override.
    pub(crate) velocity: i64,
    /// In 2^-48 revolution per tick squared.
    pub(crate) acceleration: i64,
    pub(crate) deceleration: i64,
    pub(crate) shape: Shape,
}

/// How the acceleration changes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub(crate) enum Shape {
    /// At once: trapezoids of velocity.
    Trapezoid {
        /// Deceleration that a movement counts on.
        brake: Slope,
    },
    /// With limited jerk: S-curves of velocity.
    Smooth(Smooth),
}

/// Jerk, and what a movement counts on of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub(crate) struct Smooth {
    /// In 2^-48 revolution per tick cubed.
    pub(crate) jerk: i64,
    /// For the end of an acceleration.
    pub(crate) release: Slope,
    /// For a stop at a position.
    pub(crate) brake: SmoothBrake,
}

/// A brake is begun as if the limit was less by this share, 2^-8 of the deceleration and 2^-6 of the jerk: what is rounded, and steps
/// that do not fall on a tick, are made good within the limit. It takes less than 0.4 % more of the time of a movement.
const DECELERATION_RESERVE: u32 = 8;
const JERK_RESERVE: u32 = 6;
/// The same for the end of an acceleration. Less than that of the brake, which may then still be made harder.
const RELEASE_RESERVE: u32 = 8;

/// Ticks in which the jerk may make the whole acceleration: a shorter time is lengthened, a jerk has no effect on less than that.
const SHORTEST_BUILD_UP: i64 = 4;

impl MotionLimits {
    /// * `velocity`: positioning velocity S-0-0259, jog velocity, homing velocity S-0-0041 or another, within S-0-0091.
    /// * `acceleration`: towards a higher speed (S-0-0136, S-0-0260, S-0-0042).
    /// * `deceleration`: towards standstill (S-0-0137, S-0-0372, S-0-0138).
    /// * `jerk`: S-0-0193 or S-0-0349; without it the acceleration changes at once. A jerk that makes the whole acceleration in less
    ///   than four ticks is lowered to that.
    ///
    /// From 1 to 10^6 rad/s² and from 1 rad/s³ all limits are possible with all velocities. Divides.
    ///
    /// # Errors
    /// [`SettingsError::Zero`] for a limit of zero, [`SettingsError::TooSmooth`] for a jerk below 0.74 rad/s³ and
    /// [`SettingsError::BrakingTime`] when braking from the velocity takes too long.
    pub fn new(
        velocity: Velocity,
        acceleration: Acceleration,
        deceleration: Acceleration,
        jerk: Option<Jerk>,
    ) -> Result<Self, SettingsError> {
        for (zero, parameter) in [
            (velocity <= Velocity::ZERO, "velocity of a movement"),
            (acceleration.to_bits() == 0, "acceleration of a movement"),
            (deceleration.to_bits() == 0, "deceleration of a movement"),
            (jerk.is_some_and(|jerk| jerk.to_bits() == 0), "jerk of a movement"),
        ] {
            if zero {
                return Err(SettingsError::Zero { parameter });
            }
        }
        let velocity = i64::from(velocity.to_bits()) << 12;
        let [acceleration, deceleration] = [acceleration, deceleration]
            .map(|limit| i64::try_from(limit.to_bits()).unwrap_or(i64::MAX).min(Slope::LARGEST));
        let Some(jerk) = jerk else {
            let brake = Slope::new(deceleration.saturating_sub(deceleration >> DECELERATION_RESERVE));
            braking_time(brake.time(velocity))?;
            let shape = Shape::Trapezoid { brake };
            return Ok(Self { full_velocity: velocity, velocity, acceleration, deceleration, shape });
        };
        let jerk = i64::try_from(jerk.to_bits())
            .unwrap_or(i64::MAX)
            .min(acceleration / SHORTEST_BUILD_UP)
            .min(deceleration / SHORTEST_BUILD_UP);
        let reserved = jerk.saturating_sub(jerk >> JERK_RESERVE);
        if reserved < Slope::SMALLEST {
            return Err(SettingsError::TooSmooth { actual: jerk.unsigned_abs() });
        }
        // More acceleration than that is not reached on the way to the velocity.
        let highest =
            i64::try_from(u128::from(velocity.unsigned_abs()).saturating_mul(reserved.unsigned_abs().into()).isqrt())
                .unwrap_or(i64::MAX)
                .max(Slope::SMALLEST);
        let [acceleration, deceleration] = [acceleration, deceleration].map(|limit| limit.min(highest));
        let release = Slope::new(jerk.saturating_sub(jerk >> RELEASE_RESERVE));
        let brake = SmoothBrake::new(
            Slope::new(deceleration.saturating_sub(deceleration >> DECELERATION_RESERVE)),
            Slope::new(reserved),
        );
        braking_time(brake.time(velocity))?;
        let shape = Shape::Smooth(Smooth { jerk, release, brake });
        Ok(Self { full_velocity: velocity, velocity, acceleration, deceleration, shape })
    }

    /// The same limits with this share of the velocity given to [`MotionLimits::new`]. Does not divide: for the tick.
    #[inline]
    #[must_use]
    pub fn with_override(self, feedrate: FeedrateOverride) -> Self {
        // A velocity below 2^43, of which 2^-36 is enough.
        let velocity = (self.full_velocity >> 12).wrapping_mul(i64::from(feedrate.share)) >> 12;
        Self { velocity, ..self }
    }
}

/// Checks a time in 2^-12 ticks.
fn braking_time(time: i64) -> Result<(), SettingsError> {
    let ticks = time >> 12;
    if ticks > LONGEST_BRAKING {
        return Err(SettingsError::BrakingTime { actual: ticks.unsigned_abs() });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    const ACCELERATION: Acceleration = Acceleration::from_bits(1 << 30);

    fn new(velocity: Velocity, acceleration: u64, jerk: Option<u64>) -> Result<MotionLimits, SettingsError> {
        let acceleration = Acceleration::from_bits(acceleration);
        MotionLimits::new(velocity, acceleration, acceleration, jerk.map(Jerk::from_bits))
    }

    #[test]
    fn braking_may_take_the_longest_time_and_no_tick_more() {
        assert_eq!(braking_time(LONGEST_BRAKING << 12), Ok(()));
        let actual = LONGEST_BRAKING.unsigned_abs() + 1;
        assert_eq!(braking_time((LONGEST_BRAKING + 1) << 12), Err(SettingsError::BrakingTime { actual }));
    }

    #[test]
    fn limits_of_zero_are_refused_with_their_name() {
        let none = Acceleration::from_bits(0);
        let zero = |name| Err(SettingsError::Zero { parameter: name });
        assert_eq!(new(Velocity::ZERO, 1 << 30, None), zero("velocity of a movement"));
        assert_eq!(MotionLimits::new(Velocity::MAX, none, ACCELERATION, None), zero("acceleration of a movement"));
        assert_eq!(MotionLimits::new(Velocity::MAX, ACCELERATION, none, None), zero("deceleration of a movement"));
        assert_eq!(new(Velocity::MAX, 1 << 30, Some(0)), zero("jerk of a movement"));
    }

    #[test]
    fn limits_that_take_too_long_to_stop_are_refused() {
        // 1 rad/s² is legal with every velocity, a half of that is not.
        assert!(new(Velocity::MAX, 700_000, None).is_ok());
        let ticks = (1_u64 << 43) / (350_000 - 350_000 / 256);
        let Err(SettingsError::BrakingTime { actual }) = new(Velocity::MAX, 350_000, None) else { panic!("accepted") };
        assert!(actual.abs_diff(ticks) < 100, "{actual}, not {ticks}");
        assert!(new(Velocity::from_bits(1 << 29), 350_000, None).is_ok());
        assert!(new(Velocity::MAX, 700_000, Some(87)).is_ok(), "1 rad/s³");
    }

    #[test]
    fn a_jerk_below_what_is_resolved_is_refused() {
        assert_eq!(new(Velocity::MAX, 1 << 30, Some(63)), Err(SettingsError::TooSmooth { actual: 63 }));
        assert_eq!(new(Velocity::from_bits(1), 252, Some(1 << 30)), Err(SettingsError::TooSmooth { actual: 63 }));
        assert!(new(Velocity::MAX, 1 << 30, Some(65)).is_ok());
    }

    #[test]
    fn a_jerk_without_effect_is_lowered_to_four_ticks() {
        let limits = new(Velocity::MAX, 1 << 30, Some(u64::MAX)).unwrap();
        let Shape::Smooth(smooth) = limits.shape else { panic!("no jerk limit") };
        assert_eq!(smooth.jerk, 1 << 28);
    }

    #[test]
    fn the_override_is_a_share_of_the_full_velocity() {
        let limits = new(Velocity::from_bits(1 << 30), 1 << 30, None).unwrap();
        let half = limits.with_override(FeedrateOverride::new(5_000).unwrap());
        assert_eq!((half.velocity, half.with_override(FeedrateOverride::FULL)), (1 << 41, limits));
        assert_eq!(limits.with_override(FeedrateOverride::new(10_000).unwrap()), limits);
        let hundredth = limits.with_override(FeedrateOverride::new(1).unwrap()).velocity;
        assert!((hundredth - (1 << 42) / 10_000).abs() < 1 << 19, "{hundredth}");
        assert_eq!(limits.with_override(FeedrateOverride::new(0).unwrap()).velocity, 0);
        assert_eq!(FeedrateOverride::new(10_001), Err(SettingsError::FeedrateOverride { actual: 10_001 }));
    }
}
