//! What the loops follow, and where it comes from.

use crate::units::derivatives::SignedAcceleration;
use crate::units::{Position, Velocity};

/// Where the setpoint of a tick comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum CommandSource {
    /// On the line to the last command.
    Interpolated,
    /// The next command is late or missing: the line is continued with its last velocity, for two cycles at most.
    Extrapolated,
    /// Two commands and more are missing: the setpoint stands. The supervision has to stop the axis before that.
    Held,
}

/// What the loops follow in one tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Setpoint {
    /// Commanded position, unbounded.
    pub position: Position,
    /// Commanded velocity, for the velocity feed-forward.
    pub velocity: Velocity,
    /// Commanded acceleration, for the acceleration feed-forward S-0-0348.
    pub acceleration: SignedAcceleration,
}

impl Setpoint {
    /// Steady motion: no acceleration.
    #[must_use]
    pub const fn moving(position: Position, velocity: Velocity) -> Self {
        Self { position, velocity, acceleration: SignedAcceleration::ZERO }
    }
}
