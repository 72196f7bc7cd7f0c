//! What can go wrong with a holding brake.

use core::fmt;

use crate::units::Position;

/// An error or a warning of the holding brake.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum BrakeError {
    /// The bridge did not come on in time. The brake stays closed.
    BridgeOff,
    /// The current did not follow in time. The brake stays closed.
    TorqueNotProven {
        /// Test current in 0.1 % of the peak current.
        expected: i16,
        /// Current measured in the field axis in the last tick.
        actual: i16,
    },
    /// The bridge went off while the axis was held by torque. The brake closes at once.
    TorqueLost,
    /// Warning: the brake opened later than S-0-0206.
    ReleaseSlow {
        /// S-0-0206 in ms.
        expected: u32,
        /// Time in ms.
        actual: u32,
    },
    /// The contact did not tell an open brake within twice S-0-0206. The brake closes, then the torque goes.
    NotReleased {
        /// Time limit in ms.
        expected: u32,
    },
    /// The axis did not move in its first motion although the torque was high. The brake closes, then the torque goes.
    BrakeStuck {
        /// Movement beyond which the brake counts as open.
        expected: Position,
        /// Movement since the brake was energised.
        actual: Position,
    },
    /// The axis did not stand still within S-0-0273. The brake closes while it moves.
    NoStandstill {
        /// S-0-0273 in ms.
        expected: u32,
    },
    /// Warning: the brake closed later than S-0-0207.
    EngageSlow {
        /// S-0-0207 in ms.
        expected: u32,
        /// Time in ms.
        actual: u32,
    },
    /// The contact did not tell a closed brake within twice S-0-0207. The axis is held by torque.
    NotEngaged {
        /// Time limit in ms.
        expected: u32,
    },
    /// The axis moved while the torque was lowered. It is held by torque.
    BrakeDoesNotHold {
        /// Movement allowed.
        expected: Position,
        /// Movement seen.
        actual: Position,
    },
}

impl BrakeError {
    /// The sequence goes on.
    #[must_use]
    pub const fn is_warning(self) -> bool {
        matches!(self, Self::ReleaseSlow { .. } | Self::EngageSlow { .. })
    }
}

impl fmt::Display for BrakeError {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::BridgeOff => formatter.write_str("the bridge does not come on: brake kept closed"),
            Self::TorqueNotProven { expected, actual } => {
                write!(formatter, "current of {actual} in 0.1 %, expected {expected}: brake kept closed")
            }
            Self::TorqueLost => formatter.write_str("the bridge went off under load: brake closed"),
            Self::ReleaseSlow { expected, actual } => {
                write!(formatter, "brake opened after {actual} ms, expected {expected} ms")
            }
            Self::NotReleased { expected } => write!(formatter, "brake not open after {expected} ms"),
            Self::BrakeStuck { expected, actual } => write!(
                formatter,
                "axis moved by {} of a revolution against its brake, expected {}",
                actual.to_revolutions(),
                expected.to_revolutions()
            ),
            Self::NoStandstill { expected } => write!(formatter, "no standstill after {expected} ms: brake closed"),
            Self::EngageSlow { expected, actual } => {
                write!(formatter, "brake closed after {actual} ms, expected {expected} ms")
            }
            Self::NotEngaged { expected } => write!(formatter, "brake not closed after {expected} ms: held by torque"),
            Self::BrakeDoesNotHold { expected, actual } => write!(
                formatter,
                "axis moved by {} of a revolution in its brake, expected at most {}: held by torque",
                actual.to_revolutions(),
                expected.to_revolutions()
            ),
        }
    }
}

impl core::error::Error for BrakeError {}
