//! From one velocity command per control unit cycle to one per loop tick.

use crate::path::settings::InterpolatorSettings;
use crate::units::Velocity;
use crate::units::derivatives::SignedAcceleration;

/// Interpolates velocity commands: a straight line to each new value, held when commands are missing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct VelocityInterpolator {
    target: Velocity,
    /// In 2^-48 revolution per tick.
    remaining: i64,
    slope: i64,
    ticks: u16,
}

impl VelocityInterpolator {
    /// Runs at `velocity`.
    #[must_use]
    pub const fn new(velocity: Velocity) -> Self {
        Self { target: velocity, remaining: 0, slope: 0, ticks: 0 }
    }

    /// Takes the command that became valid at t3: reached after one cycle of ticks.
    #[inline]
    pub fn command(&mut self, settings: &InterpolatorSettings, command: Velocity) {
        let here = self.velocity();
        self.target = command;
        self.remaining = i64::from(command.to_bits()).wrapping_sub(i64::from(here.to_bits())) << 12;
        self.slope = settings.per_tick(self.remaining);
        self.ticks = settings.ticks_per_cycle();
    }

    /// One tick further: the velocity command of this tick.
    #[inline]
    pub fn tick(&mut self) -> Velocity {
        if self.ticks > 0 {
            self.ticks = self.ticks.saturating_sub(1);
            self.remaining = if self.ticks == 0 { 0 } else { self.remaining.wrapping_sub(self.slope) };
        }
        self.velocity()
    }

    /// What a tick adds to the velocity command.
    #[inline]
    #[must_use]
    pub fn acceleration(&self) -> SignedAcceleration {
        SignedAcceleration::from_bits(if self.ticks > 0 { self.slope } else { 0 })
    }

    /// The velocity command of the last tick.
    #[inline]
    #[must_use]
    pub fn velocity(&self) -> Velocity {
        Velocity::saturating_from_bits(i64::from(self.target.to_bits()).wrapping_sub(self.remaining >> 12))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn velocity_commands_are_reached_in_a_line_and_held() {
        let settings = InterpolatorSettings::new(4, None).unwrap();
        let mut interpolator = VelocityInterpolator::new(Velocity::from_bits(100));
        interpolator.command(&settings, Velocity::from_bits(-300));
        let run: [i32; 6] = core::array::from_fn(|_| interpolator.tick().to_bits());
        assert_eq!(run, [0, -100, -200, -300, -300, -300]);
        interpolator.command(&settings, Velocity::MAX);
        for _ in 0..4 {
            interpolator.tick();
        }
        assert_eq!(interpolator.velocity(), Velocity::MAX);
    }
}
