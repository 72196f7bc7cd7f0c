//! Which path leads from one command to the next, and in how many ticks.

use crate::arithmetic::trigonometry::high_product;
use crate::arithmetic::wide::times_fraction;
use crate::error::SettingsError;
use crate::path::command_step::CommandLimits;
use crate::units::modulo::Modulo;

/// Path from one position command to the next.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Interpolation {
    /// A straight line: the velocity jumps at each command, and what it jumps by is given as an acceleration over the cycle.
    #[default]
    Linear,
    /// A cubic that begins with the velocity that it ended with at the last command, and ends with one and a half of this cycle's way less a
    /// half of the last one's: the slope of the parabola through the last three commands. Constant acceleration is followed exactly.
    ///
    /// It leaves the straight line by at most 8/27 of the largest change of the way from a cycle to the next: as much it may
    /// overshoot at a sudden stop.
    Cubic,
}

/// Ticks per cycle, the reciprocal of it, the path between commands, and the modulo value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct InterpolatorSettings {
    ticks_per_cycle: u16,
    /// 2^32 / ticks, to the nearest: at most 2^30.
    reciprocal: i32,
    /// 2^32 / ticks², to the nearest: at most 2^28.
    reciprocal_of_square: i32,
    interpolation: Interpolation,
    modulo: Option<Modulo>,
    limits: CommandLimits,
}

impl InterpolatorSettings {
    /// A control unit cycle (S-0-0001) of 4 to 520 loop ticks: 500 us to 65 ms. With a modulo value, commands lie within
    /// `0 ..` modulo value and each goes the shortest way from the one before. [`Interpolation::Linear`].
    ///
    /// # Errors
    /// [`SettingsError::TicksPerCycle`] beyond that range.
    pub fn new(ticks_per_cycle: u16, modulo: Option<Modulo>) -> Result<Self, SettingsError> {
        let out_of_range = SettingsError::TicksPerCycle { actual: ticks_per_cycle };
        if !(4..=520).contains(&ticks_per_cycle) {
            return Err(out_of_range);
        }
        let ticks = u64::from(ticks_per_cycle);
        let reciprocal = ((1_u64 << 32).saturating_add(ticks >> 1))
            .checked_div(ticks)
            .and_then(|r| i32::try_from(r).ok())
            .ok_or(out_of_range)?;
        Ok(Self {
            ticks_per_cycle,
            reciprocal,
            reciprocal_of_square: square_of(reciprocal),
            interpolation: Interpolation::Linear,
            modulo,
            limits: CommandLimits::NONE,
        })
    }

    /// The same with another path between position commands.
    #[must_use]
    pub const fn with_interpolation(self, interpolation: Interpolation) -> Self {
        Self { interpolation, ..self }
    }

    /// The same with limits for the commands; without them every command is taken.
    #[must_use]
    pub const fn with_limits(self, limits: CommandLimits) -> Self {
        Self { limits, ..self }
    }

    /// Loop ticks per control unit cycle.
    #[must_use]
    pub const fn ticks_per_cycle(&self) -> u16 {
        self.ticks_per_cycle
    }

    /// The modulo value, if position data are modulo.
    #[must_use]
    pub const fn modulo(&self) -> Option<&Modulo> {
        self.modulo.as_ref()
    }

    /// The path between commands.
    pub(crate) const fn interpolation(&self) -> Interpolation {
        self.interpolation
    }

    /// Of the commands.
    pub(crate) const fn limits(&self) -> &CommandLimits {
        &self.limits
    }

    /// `distance / ticks²`, to 32 millionths.
    #[inline]
    pub(crate) fn per_square_of_ticks(&self, distance: i64) -> i64 {
        times_fraction(distance, self.reciprocal_of_square)
    }

    /// `value / ticks`, rounded down.
    #[inline]
    pub(crate) fn share_of_tick(&self, value: i32) -> i32 {
        high_product(value, self.reciprocal)
    }

    /// `distance / ticks`, the remainder spread once more: less than a step of `distance` off after all ticks.
    #[inline]
    pub(crate) fn per_tick(&self, distance: i64) -> i64 {
        let slope = times_fraction(distance, self.reciprocal);
        let rest = distance.wrapping_sub(slope.wrapping_mul(i64::from(self.ticks_per_cycle)));
        slope.wrapping_add(times_fraction(rest, self.reciprocal))
    }
}

/// The square of a fraction in 2^-32, to the nearest; at most 2^28.
const fn square_of(reciprocal: i32) -> i32 {
    let square = (reciprocal as i64).wrapping_mul(reciprocal as i64);
    (square.wrapping_add(1 << 31) >> 32) as i32
}
