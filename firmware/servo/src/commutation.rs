//! Commutation of a synchronous motor from an incremental encoder.
//!
//! The electrical angle is `pole pairs * mechanical angle + offset`. It is anchored every loop tick in the exact position, and
//! carried on by the current loop from there with the encoder count alone ([`crate::current::SharedCommand::angle_at`]).
//!
//! The offset is not known after power-up: [`Alignment`] finds it with small movements, [`IndexCorrection`] refines it at the
//! first index pulse.
//!
//! Electrical angles are `u32` (differences `i32`), 2^32 to an electrical revolution. A current along angle 0 of the d axis turns the
//! rotor to electrical angle 0.

pub(crate) mod alignment;
pub(crate) mod index;

use core::fmt;

pub use alignment::{Alignment, AlignmentError, AlignmentOutput, AlignmentSettings, AlignmentState};
pub use index::{IndexCorrection, IndexError, IndexOutput, IndexState};

use crate::units::Position;

/// One electrical degree.
const DEGREE: i32 = 11_930_465;

/// Fewer increments in an electrical revolution are too coarse for a commutation by encoder: 0.5 degrees each.
const LEAST_RESOLUTION: u32 = 720;

/// Parameters that commutation cannot work with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum CommutationError {
    /// A motor has 1 to 64 pole pairs.
    PolePairs {
        /// Pole pairs given.
        actual: u8,
    },
    /// The encoder must have 720 increments or more for each pole pair.
    Resolution {
        /// Increments per revolution of the motor given.
        actual: u32,
        /// Increments per revolution needed.
        expected: u32,
    },
    /// The current of the alignment must be above zero.
    Current {
        /// Current given, in 2^-15 of the peak current.
        actual: i16,
    },
}

impl fmt::Display for CommutationError {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::PolePairs { actual } => write!(formatter, "{actual} pole pairs, expected 1 to 64"),
            Self::Resolution { actual, expected } => {
                write!(formatter, "{actual} increments per revolution, expected {expected} or more for commutation")
            }
            Self::Current { actual } => {
                write!(formatter, "alignment current of {actual}/32768 of peak, expected more than 0")
            }
        }
    }
}

impl core::error::Error for CommutationError {}

/// Pole pairs and encoder, scaled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct CommutationSettings {
    pole_pairs: u32,
    /// No angle outlives a change of the resolution: settings with another one are others.
    increments_per_revolution: u32,
}

impl CommutationSettings {
    /// A motor with 1 to 64 pole pairs on an encoder with 720 increments (edges) or more for each pole pair.
    ///
    /// # Errors
    /// [`CommutationError::PolePairs`], [`CommutationError::Resolution`].
    pub fn new(pole_pairs: u8, increments_per_revolution: u32) -> Result<Self, CommutationError> {
        if !(1..=64).contains(&pole_pairs) {
            return Err(CommutationError::PolePairs { actual: pole_pairs });
        }
        let pairs = u32::from(pole_pairs);
        let expected = pairs.saturating_mul(LEAST_RESOLUTION);
        if increments_per_revolution < expected {
            return Err(CommutationError::Resolution { actual: increments_per_revolution, expected });
        }
        Ok(Self { pole_pairs: pairs, increments_per_revolution })
    }

    /// Electrical angle that belongs to a mechanical one, without offset. A whole electrical revolution is 0.
    ///
    /// Exact for the position given: two steps of it (2^-32 revolution, see [`crate::encoder::Encoder`]) are 11e-6 electrical degrees at 64 pole
    /// pairs.
    #[inline]
    #[must_use]
    pub const fn electrical(&self, position: Position) -> u32 {
        // What lies above a revolution is whole electrical revolutions.
        self.pole_pairs.wrapping_mul(position.to_bits() as u32)
    }
}

/// Electrical angle of the rotor over the position of the axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct CommutationAngle {
    settings: CommutationSettings,
    offset: u32,
}

impl CommutationAngle {
    /// The rotor is at electrical angle `angle` where the position is `position`.
    #[must_use]
    pub const fn new(settings: CommutationSettings, position: Position, angle: u32) -> Self {
        Self { settings, offset: angle.wrapping_sub(settings.electrical(position)) }
    }

    /// Electrical angle of the rotor at this position.
    #[inline]
    #[must_use]
    pub const fn at(&self, position: Position) -> u32 {
        self.settings.electrical(position).wrapping_add(self.offset)
    }

    /// Turns the angle by `correction` at every position ([`IndexOutput::correction`]).
    #[inline]
    pub fn correct(&mut self, correction: i32) {
        self.offset = self.offset.wrapping_add_signed(correction);
    }

    /// The zero of the position has moved by `difference` (homing); the rotor has not.
    pub fn shift(&mut self, difference: Position) {
        self.offset = self.offset.wrapping_sub(self.settings.electrical(difference));
    }
}

/// An angle limited to `-limit ..= limit`.
#[inline]
const fn limited_angle(angle: i64, limit: i32) -> i32 {
    let limit = limit as i64;
    // Within the range of i32 after the limits.
    if angle > limit {
        limit as i32
    } else if angle < limit.wrapping_neg() {
        limit.wrapping_neg() as i32
    } else {
        angle as i32
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::encoder::{Encoder, EncoderSettings};
    use proptest::prelude::*;

    /// Electrical angle of so many increments, by whole numbers.
    fn exact(increments: i128, resolution: u32, pole_pairs: u8) -> u32 {
        let within = increments.rem_euclid(i128::from(resolution));
        ((within * i128::from(pole_pairs)) << 32).div_euclid(i128::from(resolution)) as u32
    }

    /// In degrees.
    fn error(angle: u32, exact: u32) -> f64 {
        f64::from(angle.wrapping_sub(exact) as i32) / f64::from(DEGREE)
    }

    proptest! {
        #[test]
        fn the_angle_is_exact_for_any_resolution_after_any_way(
            pole_pairs in 1_u8..=64,
            resolution in prop_oneof![Just(10_000_u32), Just(1 << 20), Just(u32::MAX), 720_u32..1 << 26],
            start in any::<u32>(),
            ways in proptest::collection::vec((any::<i32>(), -1_000_000_i32..1_000_000), 1..40),
        ) {
            prop_assume!(u64::from(resolution) >= 720 * u64::from(pole_pairs));
            let settings = CommutationSettings::new(pole_pairs, resolution).unwrap();
            let mut encoder = Encoder::new(EncoderSettings::new(resolution).unwrap(), start);
            let angle = CommutationAngle::new(settings, encoder.position(), 0);
            let mut count = start;
            let mut total = 0_i128;
            for (way, since) in ways {
                count = count.wrapping_add_signed(way);
                total += i128::from(way);
                encoder.update(count);
                let angle = angle.at(encoder.position_of(count.wrapping_add_signed(since)));
                let error = error(angle, exact(total + i128::from(since), resolution, pole_pairs));
                prop_assert!(error.abs() < 0.001, "{error} degrees");
            }
        }
    }

    #[test]
    fn two_days_at_full_speed_leave_no_trace() {
        // 10 000 rpm, every 125 us would take long: every quarter of a second, and a sample 125 us later.
        for (resolution, pole_pairs) in [(10_000_u32, 5), (1 << 20, 4), (999_983, 31)] {
            let settings = CommutationSettings::new(pole_pairs, resolution).unwrap();
            let mut encoder = Encoder::new(EncoderSettings::new(resolution).unwrap(), 0xFFFF_0000);
            let angle = CommutationAngle::new(settings, Position::ZERO, 1 << 30);
            let mut count = 0xFFFF_0000_u32;
            let mut total = 0_i128;
            let quarter = (u64::from(resolution) * 10_000 / 240) as u32;
            for step in 0..2 * 86_400 * 4_u32 {
                let moved = quarter - step % 1_009;
                count = count.wrapping_add(moved);
                total += i128::from(moved);
                encoder.update(count);
                let since = quarter / 2_000;
                let exact = exact(total + i128::from(since), resolution, pole_pairs).wrapping_add(1 << 30);
                let error = error(angle.at(encoder.position_of(count.wrapping_add(since))), exact);
                assert!(error.abs() < 0.001, "{error} degrees after {total} increments of {resolution}");
            }
        }
    }

    #[test]
    fn homing_moves_the_position_and_not_the_angle() {
        let settings = CommutationSettings::new(5, 10_000).unwrap();
        let mut encoder = Encoder::new(EncoderSettings::new(10_000).unwrap(), 0);
        let mut angle = CommutationAngle::new(settings, encoder.update(1_234), 0xC000_0000);
        let target = Position::from_bits(-98_765_432_109);
        let difference = target - encoder.position();
        encoder.set_position(target);
        angle.shift(difference);
        assert_eq!(angle.at(encoder.position()), 0xC000_0000);
        angle.correct(-0x4000_0000);
        assert_eq!(angle.at(encoder.position()), 0x8000_0000);
        // A tenth of a mechanical revolution is half an electrical one; the position is up to two steps below.
        let further = angle.at(encoder.update(2_234));
        assert!(further.wrapping_add(20) < 40, "{further:#X}");
    }

    #[test]
    fn motors_and_encoders_out_of_range_are_refused() {
        for actual in [0, 65, 255] {
            assert_eq!(CommutationSettings::new(actual, 1 << 20), Err(CommutationError::PolePairs { actual }));
        }
        let expected = Err(CommutationError::Resolution { actual: 2_879, expected: 2_880 });
        assert_eq!(CommutationSettings::new(4, 2_879), expected);
        assert!(CommutationSettings::new(4, 2_880).is_ok());
    }
}
