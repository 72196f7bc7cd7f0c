//! What was seen of a drive after a fault.

use ring::Nanoseconds;
use std::fmt;

/// What the drive did.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reaction {
    /// It went on, without a word.
    None,
    /// It went on and warns.
    Warning,
    /// It tells of an error; there was no torque to take away.
    Error,
    /// It stopped the axis with its own torque, on the ramp S-0-0138, and then took the torque away.
    Ramp,
    /// It took the torque away where the axis was, or stood.
    TorqueOff,
    /// It tells of an error and holds the axis by its torque.
    Holds,
}

impl fmt::Display for Reaction {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.pad(match self {
            Self::None => "goes on",
            Self::Warning => "warns, goes on",
            Self::Error => "error, stays off",
            Self::Ramp => "ramp, torque off",
            Self::TorqueOff => "torque off",
            Self::Holds => "error, holds by torque",
        })
    }
}

/// What came of the error once its cause was gone.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Afterwards {
    /// There was none.
    NoError,
    /// S-0-0099 cleared it, and the axis could be switched on and followed.
    RunsAgain,
    /// S-0-0099 cleared it, but the axis could not be switched on.
    StaysOff,
    /// S-0-0099 helped only after the control unit had taken ENABLE back; the axis could be switched on and followed.
    RunsAgainReleased,
    /// S-0-0099 was refused, or did not last.
    NotCleared,
}

impl fmt::Display for Afterwards {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.pad(match self {
            Self::NoError => "-",
            Self::RunsAgain => "yes, runs again",
            Self::RunsAgainReleased => "without ENABLE, runs again",
            Self::StaysOff => "yes, does not switch on",
            Self::NotCleared => "no",
        })
    }
}

/// What was measured in a cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outcome {
    /// What the drive did.
    pub reaction: Reaction,
    /// From the fault to the bridge's switching off, in steps of 62.5 us.
    pub torque_off: Option<Nanoseconds>,
    /// Degrees from the fault to standstill, signed; `None` where the axis went on.
    pub turned: Option<f64>,
    /// S-0-0390.
    pub number: u16,
    /// S-0-0011.
    pub class_1: u16,
    /// Whether the coil of the brake was without current in the end; `None` without a brake.
    pub brake_closed: Option<bool>,
    /// Whether S-0-0099 helps.
    pub afterwards: Afterwards,
}
