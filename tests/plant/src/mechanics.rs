//! Masses, shaft and friction.

use core::f64::consts::TAU;

use crate::friction::Friction;
use crate::stiction::Stiction;
use crate::turn::Turn;

/// What the motor turns, at the motor shaft.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mechanics {
    /// Inertia of the rotor, and of all that is rigidly coupled to it, in kg m².
    pub rotor_inertia: f64,
    /// Coulomb friction at the motor shaft in Nm; holds it at standstill against any smaller torque.
    pub coulomb_friction: f64,
    /// Viscous friction at the motor shaft in Nm s/rad.
    pub viscous_friction: f64,
    /// A load behind an elastic shaft; `None` is one rigid mass.
    pub load: Option<Load>,
    /// Torque of gravity on the load in Nm, positive in counting direction.
    pub gravity_torque: f64,
}

/// A load on an elastic shaft.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Load {
    /// In kg m².
    pub inertia: f64,
    /// Torsional stiffness in Nm/rad.
    pub stiffness: f64,
    /// Torsional damping in Nm s/rad, of a shaft that is not in its play.
    pub damping: f64,
    /// Total play between motor and load in rad.
    pub backlash: f64,
}

/// State of the masses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Shafts {
    /// Angle of the motor shaft.
    pub(crate) turn: Turn,
    /// Velocity of the motor shaft in rad/s.
    pub(crate) velocity: f64,
    /// How it changed in the last step, in rad/s².
    acceleration: f64,
    /// How far the load leads the motor, in rad.
    twist: f64,
    /// In rad/s.
    load_velocity: f64,
}

/// Torques from outside, in Nm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Torques {
    /// Of the motor.
    pub(crate) motor: f64,
    /// On the load.
    pub(crate) load: f64,
    /// That the brake can hold.
    pub(crate) brake: f64,
}

impl Load {
    /// Torque of the shaft on the motor. In its play the shaft is free; out of it, it pushes and never pulls.
    fn shaft_torque(&self, twist: f64, velocity: f64) -> f64 {
        let play = 0.5 * self.backlash;
        let torque = |wound: f64| self.stiffness * wound + self.damping * velocity;
        if self.backlash == 0.0 {
            torque(twist)
        } else if twist > play {
            torque(twist - play).max(0.0)
        } else if twist < -play {
            torque(twist + play).min(0.0)
        } else {
            0.0
        }
    }

    /// The twist at which the shaft carries a torque.
    fn twist_under(&self, torque: f64) -> f64 {
        if torque == 0.0 { 0.0 } else { torque / self.stiffness + 0.5 * self.backlash * torque.signum() }
    }
}

impl Mechanics {
    pub(crate) fn check(&self) {
        assert!(self.rotor_inertia > 0.0, "inertia must be positive");
        assert!(self.coulomb_friction >= 0.0 && self.viscous_friction >= 0.0, "friction must not be negative");
        if let Some(load) = self.load {
            assert!(load.inertia > 0.0 && load.stiffness > 0.0, "inertia and stiffness of the load must be positive");
            assert!(load.damping >= 0.0 && load.backlash >= 0.0, "damping and backlash must not be negative");
        }
    }

    /// Masses that move together, the shaft wound up by gravity alone.
    pub(crate) fn together(&self, turn: Turn, velocity: f64) -> Shafts {
        let twist = self.load.map_or(0.0, |load| load.twist_under(self.gravity_torque));
        Shafts { turn, velocity, acceleration: 0.0, twist, load_velocity: velocity }
    }

    /// The masses after `dt`; a seized motor shaft stands. First the velocities, then with them the angles: swings keep their energy.
    pub(crate) fn step(
        &self,
        old: Shafts,
        torques: Torques,
        stiction: Option<&Stiction>,
        seized: bool,
        dt: f64,
    ) -> Shafts {
        let outer = torques.load + self.gravity_torque;
        let shaft = self.load.map(|load| load.shaft_torque(old.twist, old.load_velocity - old.velocity));
        let friction = Friction {
            coulomb: self.coulomb_friction + torques.brake,
            viscous: self.viscous_friction,
            inertia: self.rotor_inertia,
        };
        let driving = torques.motor + shaft.unwrap_or(outer);
        let velocity = match stiction {
            _ if seized => 0.0,
            None => friction.rub(old.velocity, driving, dt),
            Some(stiction) => stiction.rub(friction, self.coulomb_friction, old.velocity, driving, dt),
        };
        let turn = old.turn.after(0.5 * (old.velocity + velocity) * dt / TAU);
        // A shaft that friction has stopped does not go on.
        let acceleration = if velocity == 0.0 { 0.0 } else { (velocity - old.velocity) / dt };
        match (self.load, shaft) {
            (Some(load), Some(shaft)) => {
                let load_velocity = old.load_velocity + (outer - shaft) / load.inertia * dt;
                let twist = old.twist + (load_velocity - velocity) * dt;
                Shafts { turn, velocity, acceleration, twist, load_velocity }
            }
            _ => Shafts { turn, velocity, acceleration, twist: 0.0, load_velocity: velocity },
        }
    }
}

impl Shafts {
    /// The velocity in the middle of the next step of `dt`, if it goes on changing as in the last one.
    pub(crate) fn velocity_ahead(&self, dt: f64) -> f64 {
        self.velocity + 0.5 * dt * self.acceleration
    }

    /// The motor shaft stops at once.
    pub(crate) fn stop(&mut self) {
        (self.velocity, self.acceleration) = (0.0, 0.0);
    }

    /// Revolutions by which the load leads the motor.
    pub(crate) fn lead_of_load(&self) -> f64 {
        self.twist / TAU
    }
}
