//! From a wrapping 32-bit increment counter to an unbounded, exact position.

use crate::{Position, SettingsError};

/// Resolution of an incremental encoder, with the factors that replace divisions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct EncoderSettings {
    increments_per_revolution: u32,
    /// 2^64 / increments, as whole part (2^32 / increments) and fraction.
    scale_whole: i64,
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
        // The whole part is at most 2^32, the fraction is cut on purpose.
        Ok(Self { increments_per_revolution, scale_whole: (scale >> 32) as i64, scale_fraction: scale as u32 })
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
    increments: i64,
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

    /// Shifts the zero so that the position at the last update reads `position` (homing, S-0-0052).
    pub fn set_position(&mut self, position: Position) {
        self.offset = self.offset + (position - self.position());
    }

    #[inline]
    fn place_at(&self, count: u32) -> Place {
        let resolution = i64::from(self.settings.increments_per_revolution);
        let moved = i64::from(count.wrapping_sub(self.count) as i32);
        // The estimate with the truncated reciprocal is right or one off; what it leaves is folded back below.
        let whole = moved.wrapping_mul(self.settings.scale_whole) >> 32;
        let mut increments = self.place.increments.wrapping_add(moved).wrapping_sub(whole.wrapping_mul(resolution));
        let mut whole = whole;
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
        // Revolutions wrap like the position they are part of.
        let revolutions = self.place.revolutions.wrapping_add(whole as i32);
        Place { revolutions, increments }
    }

    #[inline]
    fn scaled(&self, place: Place) -> Position {
        // Increments are never negative and below 2^32.
        let increments = place.increments as u64;
        let below = increments.wrapping_mul(u64::from(self.settings.scale_fraction)) >> 32;
        let fraction = place.increments.wrapping_mul(self.settings.scale_whole).wrapping_add(below as i64);
        Position::from_bits((i64::from(place.revolutions) << 32).wrapping_add(fraction)) + self.offset
    }
}
