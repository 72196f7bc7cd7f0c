//! From a wrapping 32-bit increment counter to an unbounded, exact position.

pub(crate) mod double_sampled;
pub(crate) mod hidden_motion;
pub(crate) mod jump;
pub(crate) mod monitor;

pub use double_sampled::{DoubleSampledEncoder, DoubleSampledSettings};
pub use jump::EncoderMotion;
pub use monitor::{
    EncoderError, EncoderMonitor, EncoderMonitorInputs, EncoderMonitorParameters, EncoderMonitorSettings,
};

use crate::arithmetic::wide::saturated;
use crate::error::SettingsError;
use crate::units::{Position, Velocity};

/// Resolution of an incremental encoder, with the factors that replace divisions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct EncoderSettings {
    increments_per_revolution: u32,
    /// 2^64 / increments, in two words: 2^32 / increments and the fraction of it. For one increment, which is always at zero, a step less.
    scale_whole: u32,
    scale_fraction: u32,
}

impl EncoderSettings {
    /// An encoder with so many increments (edges: four per line) per revolution, any number from 1.
    ///
    /// # Errors
    /// [`SettingsError::Zero`] for 0.
    pub fn new(increments_per_revolution: u32) -> Result<Self, SettingsError> {
        let scale = (1_u128 << 64)
            .checked_div(u128::from(increments_per_revolution))
            .ok_or(SettingsError::Zero { parameter: "increments per revolution" })?;
        let scale = u64::try_from(scale).unwrap_or(u64::MAX);
        Ok(Self { increments_per_revolution, scale_whole: (scale >> 32) as u32, scale_fraction: scale as u32 })
    }

    /// Increments per revolution.
    #[must_use]
    pub const fn increments_per_revolution(&self) -> u32 {
        self.increments_per_revolution
    }
}

/// Follows the counter of an encoder.
///
/// Whole revolutions and increments within the revolution are counted as integers and only then scaled:
/// the position never drifts from the counter, however long and however far the motor turns. The scaled
/// position lies at most two steps of 2^-32 revolution below the true ratio, and on it for a power of two.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Encoder {
    settings: EncoderSettings,
    count: u32,
    place: Place,
    offset: Position,
}

/// Whole revolutions since the start and increments within the revolution.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
struct Place {
    revolutions: i32,
    /// Below the increments per revolution.
    increments: u32,
}

impl Encoder {
    /// Starts with the counter at `count`, which is position zero.
    #[must_use]
    pub const fn new(settings: EncoderSettings, count: u32) -> Self {
        Self { settings, count, place: Place { revolutions: 0, increments: 0 }, offset: Position::ZERO }
    }

    /// Takes the counter's new value and gives the position.
    ///
    /// To be called at least once in 2^31 increments of movement.
    #[inline]
    pub fn update(&mut self, count: u32) -> Position {
        self.place = self.place_at(count);
        self.count = count;
        self.position()
    }

    /// The position at the last [`Encoder::update`].
    #[inline]
    #[must_use]
    pub fn position(&self) -> Position {
        self.scaled(self.place)
    }

    /// The position that belongs to a latched counter value, at most 2^31 increments before or after the last update.
    #[inline]
    #[must_use]
    pub fn position_of(&self, latched_count: u32) -> Position {
        self.scaled(self.place_at(latched_count))
    }

    /// The velocity of something that moves by so many increments in a loop tick, at most 2^25 of them; to the nearest.
    #[inline]
    #[must_use]
    pub fn velocity(&self, moved: i32) -> Velocity {
        let moved = i64::from(moved);
        let whole = moved.wrapping_mul(i64::from(self.settings.scale_whole)) << 4;
        // The fraction with 31 bits, so that it is one of a word with a sign.
        let fraction = moved.wrapping_mul(i64::from((self.settings.scale_fraction >> 1) as i32));
        Velocity::from_bits(saturated(whole.wrapping_add(fraction.wrapping_add(1 << 26) >> 27)))
    }

    /// Shifts the zero so that the position at the last update reads `position` (homing, S-0-0052).
    pub fn set_position(&mut self, position: Position) {
        self.offset = self.offset + (position - self.position());
    }

    #[inline]
    fn place_at(&self, count: u32) -> Place {
        let moved = i64::from(count.wrapping_sub(self.count) as i32);
        // Wraps to a large number below zero.
        let increments = i64::from(self.place.increments).wrapping_add(moved) as u64;
        if increments < u64::from(self.settings.increments_per_revolution) {
            return Place { increments: increments as u32, ..self.place };
        }
        self.place_nearby(increments, moved)
    }

    /// The same for a movement out of the revolution: into the one after it or before it, or further.
    #[cold]
    #[inline(never)]
    fn place_nearby(&self, increments: u64, moved: i64) -> Place {
        let resolution = u64::from(self.settings.increments_per_revolution);
        let after = increments.wrapping_sub(resolution);
        if after < resolution {
            return Place { revolutions: self.place.revolutions.wrapping_add(1), increments: after as u32 };
        }
        let before = increments.wrapping_add(resolution);
        if before < resolution {
            return Place { revolutions: self.place.revolutions.wrapping_sub(1), increments: before as u32 };
        }
        self.place_beyond(moved)
    }

    /// The same for any movement.
    fn place_beyond(&self, moved: i64) -> Place {
        let resolution = i64::from(self.settings.increments_per_revolution);
        // The estimate with the truncated reciprocal is right or one off; what it leaves is folded back below.
        let mut whole = moved.wrapping_mul(i64::from(self.settings.scale_whole)) >> 32;
        let mut increments =
            i64::from(self.place.increments).wrapping_add(moved).wrapping_sub(whole.wrapping_mul(resolution));
        if increments < 0 {
            increments = increments.wrapping_add(resolution);
            whole = whole.wrapping_sub(1);
        }
        for _ in 0..2 {
            if increments >= resolution {
                increments = increments.wrapping_sub(resolution);
                whole = whole.wrapping_add(1);
            }
        }
        // Revolutions wrap like the position they are part of; increments are those of one revolution.
        Place { revolutions: self.place.revolutions.wrapping_add(whole as i32), increments: increments as u32 }
    }

    #[inline]
    fn scaled(&self, place: Place) -> Position {
        let EncoderSettings { scale_whole, scale_fraction, .. } = self.settings;
        // Below a revolution, so that 32 bits hold the sum and the low word of the product.
        let below = (u64::from(place.increments).wrapping_mul(u64::from(scale_fraction)) >> 32) as u32;
        let fraction = place.increments.wrapping_mul(scale_whole).wrapping_add(below);
        Position::from_bits(i64::from(place.revolutions) << 32 | i64::from(fraction)) + self.offset
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn encoder(increments: u32, count: u32) -> Encoder {
        Encoder::new(EncoderSettings::new(increments).unwrap(), count)
    }

    /// The position of so many increments, rounded down.
    fn exact(increments: i128, resolution: u32) -> i128 {
        (increments << 32).div_euclid(i128::from(resolution))
    }

    #[test]
    fn no_increments_are_refused() {
        assert_eq!(EncoderSettings::new(0), Err(SettingsError::Zero { parameter: "increments per revolution" }));
    }

    #[test]
    fn a_quarter_turn_of_a_power_of_two_is_exact() {
        let mut encoder = encoder(1 << 20, u32::MAX);
        assert_eq!(encoder.update((1 << 18) - 1), Position::from_bits(1 << 30));
        assert_eq!(encoder.update(u32::MAX - (1 << 18)), Position::from_bits(-(1 << 30)));
    }

    #[test]
    fn thirty_days_at_full_speed_do_not_drift() {
        // 10 000 rpm, 2^20 increments: the counter wraps every 24.6 s. Steps of 0.1 s would be 17 million increments;
        // they vary, so that every place of the revolution is met.
        for resolution in [10_000, 1 << 20, 999_983] {
            let mut encoder = encoder(resolution, 0x1234_5678);
            let mut total = 0_i128;
            let mut count = 0x1234_5678_u32;
            let mut step = 17_000_000_i32;
            for _ in 0..30 * 86_400 {
                step = 17_000_000 + (step.wrapping_mul(1_103_515_245) >> 12).rem_euclid(1_000_003);
                // ten tenths of a second at once: still below 2^31
                let moved = step * 10;
                count = count.wrapping_add(moved as u32);
                total += i128::from(moved);
                let error = exact(total, resolution) - i128::from(encoder.update(count).to_bits());
                // the position itself wraps at 2^31 revolutions: 64 bits
                assert!(
                    (0..=2).contains(&i128::from(error as i64)),
                    "{error} after {total} increments of {resolution}"
                );
            }
        }
    }

    #[test]
    fn homing_shifts_the_zero() {
        let mut encoder = encoder(4_000, 17);
        encoder.update(1_017);
        encoder.set_position(Position::from_bits(-5));
        assert_eq!(encoder.position(), Position::from_bits(-5));
        assert_eq!(encoder.update(2_017), Position::from_bits((1 << 30) - 5));
    }

    #[test]
    fn a_latched_count_before_and_after_the_tick_gives_its_own_position() {
        let mut encoder = encoder(4_096, 0);
        encoder.update(10_000);
        let before = encoder;
        assert_eq!(encoder.position_of(9_999).to_bits(), 9_999 << 20);
        assert_eq!(encoder.position_of(10_300).to_bits(), 10_300 << 20);
        assert_eq!(encoder, before, "a look does not move it");
    }

    proptest! {
        #[test]
        fn any_resolution_and_any_way_give_the_exact_ratio(
            resolution in prop_oneof![1_u32..20, Just(1_u32 << 20), Just(u32::MAX), 1_u32..1 << 31],
            start in any::<u32>(),
            moves in proptest::collection::vec(any::<i32>(), 1..50),
        ) {
            let mut encoder = encoder(resolution, start);
            let mut count = start;
            let mut total = 0_i128;
            for moved in moves {
                count = count.wrapping_add(moved as u32);
                total += i128::from(moved);
                let position = encoder.update(count).to_bits();
                let error = (exact(total, resolution) as i64).wrapping_sub(position);
                prop_assert!((0..=2).contains(&error), "{} below", error);
                // What is left over would pile up, unseen at first.
                prop_assert!(encoder.place.increments < resolution);
            }
        }

        #[test]
        fn within_the_revolution_the_short_way_counts_like_the_long_one(
            resolution in prop_oneof![1_u32..20, Just(1_u32 << 20), Just(u32::MAX), 1_u32..1 << 31, any::<u32>()],
            start in any::<u32>(), way in any::<i32>(), moved in any::<i32>(), shift in 0_u32..32,
        ) {
            prop_assume!(resolution > 0);
            let mut encoder = encoder(resolution, start);
            encoder.update(start.wrapping_add(way as u32));
            let moved = moved >> shift;
            let place = encoder.place_at(encoder.count.wrapping_add(moved as u32));
            prop_assert_eq!(place, encoder.place_beyond(moved.into()));
        }
    }
}
