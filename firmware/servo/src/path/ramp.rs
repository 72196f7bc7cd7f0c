//! Braking: a velocity that goes to zero at an acceleration limit (S-0-0138), and the way it covers.

use crate::path::setpoint::Setpoint;
use crate::units::derivatives::SignedAcceleration;
use crate::units::{Acceleration, Position, Velocity};

/// A velocity on its way to zero, and the position that belongs to it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Ramp {
    /// In 2^-48 revolution per tick.
    velocity: i64,
    /// What the last tick added to the velocity.
    acceleration: i64,
    position: Position,
    /// In 2^-48 revolution, below one position step.
    below: i64,
}

impl Ramp {
    /// Begins at this position and velocity.
    #[must_use]
    pub fn new(start: Setpoint) -> Self {
        Self {
            velocity: i64::from(start.velocity.to_bits()) << 12,
            acceleration: start.acceleration.to_bits(),
            position: start.position,
            below: 0,
        }
    }

    /// One tick further.
    #[inline]
    pub fn tick(&mut self, deceleration: Acceleration) -> Setpoint {
        let step = i64::try_from(deceleration.to_bits()).unwrap_or(i64::MAX);
        let before = self.velocity;
        self.velocity = if self.velocity >= 0 {
            self.velocity.saturating_sub(step).max(0)
        } else {
            self.velocity.saturating_add(step).min(0)
        };
        self.acceleration = self.velocity.wrapping_sub(before);
        let fine = self.below.wrapping_add(self.velocity);
        self.position = self.position + Position::from_bits(fine >> 16);
        self.below = fine & 0xFFFF;
        self.setpoint()
    }

    /// Position, velocity and acceleration of the last tick.
    #[inline]
    #[must_use]
    pub fn setpoint(&self) -> Setpoint {
        Setpoint {
            position: self.position,
            velocity: Velocity::saturating_from_bits(self.velocity >> 12),
            acceleration: SignedAcceleration::from_bits(self.acceleration),
        }
    }

    /// The velocity has come down to zero.
    #[inline]
    #[must_use]
    pub const fn is_finished(&self) -> bool {
        self.velocity == 0
    }

    /// Shifts the position by `difference` without a movement (homing).
    pub fn shift(&mut self, difference: Position) {
        self.position = self.position + difference;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ramp_takes_v_over_a_and_covers_half_of_v_squared_over_a() {
        // 2^-8 revolutions per tick, 2^-20 per tick squared: 4096 ticks, 8 revolutions less half the first step.
        for sign in [1, -1] {
            let mut ramp = Ramp::new(Setpoint::moving(Position::from_bits(77), Velocity::from_bits(sign << 28)));
            let ticks = (1..10_000).find(|_| ramp.tick(Acceleration::from_bits(1 << 28)).velocity == Velocity::ZERO);
            assert_eq!(ticks, Some(4_096));
            assert!(ramp.is_finished());
            let way = ramp.setpoint().position.to_bits() - 77;
            assert_eq!(way, i64::from(sign) * ((8 << 32) - (1 << 23)));
            assert_eq!(ramp.setpoint().acceleration.to_bits(), -i64::from(sign) << 28, "that of the last step");
            let standing = ramp.tick(Acceleration::from_bits(1 << 28));
            assert_eq!(standing, Setpoint::moving(Position::from_bits(way + 77), Velocity::ZERO), "and stands there");
        }
    }

    #[test]
    fn an_unlimited_deceleration_stands_at_once() {
        let mut ramp = Ramp::new(Setpoint::moving(Position::ZERO, -Velocity::MAX));
        assert_eq!(ramp.tick(Acceleration::from_bits(u64::MAX)).velocity, Velocity::ZERO);
        assert_eq!(ramp.setpoint().position, Position::ZERO);
    }
}
