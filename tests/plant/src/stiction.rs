//! Static friction above Coulomb's.

use crate::exponential::decay;
use crate::friction::Friction;

/// A shaft that sticks more than it rubs. At standstill friction holds up to the static torque, without any movement; at a velocity `v` it
/// is `coulomb + (static - coulomb) exp(-(v / stribeck)²)` beside the viscous part (the Stribeck curve; Armstrong-Helouvry, Dupont, Canudas de
/// Wit, Automatica 30, 1994, 1083).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stiction {
    /// Torque in Nm that breaks the shaft away, without the brake; below Coulomb friction it is that.
    pub static_torque: f64,
    /// Velocity in rad/s at which 37 % of the surplus are left.
    pub stribeck_velocity: f64,
}

impl Stiction {
    pub(crate) fn check(&self) {
        assert!(self.static_torque >= 0.0, "static friction must not be negative");
        assert!(self.stribeck_velocity > 0.0, "the Stribeck velocity must be positive");
    }

    /// The velocity after `dt` under an outside torque, of a shaft with a friction that contains `coulomb` of its own.
    #[cold]
    pub(crate) fn rub(&self, mut friction: Friction, coulomb: f64, velocity: f64, outside: f64, dt: f64) -> f64 {
        let surplus = (self.static_torque - coulomb).max(0.0);
        let holding = friction.coulomb + surplus;
        let ratio = velocity / self.stribeck_velocity;
        friction.coulomb += surplus * decay(ratio * ratio);
        friction.rub_or_stick(velocity, outside, holding, dt)
    }
}
