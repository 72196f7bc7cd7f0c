//! What operation data measure, and how a number of them reads: elements 3 and 4 of a data block.

use crate::idn::Idn;

/// What operation data measure, if a scaling type says in which increments.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Dimension {
    /// By S-0-0076.
    Position,
    /// By S-0-0044.
    Velocity,
    /// By S-0-0160.
    Acceleration,
    /// By S-0-0160: the same increments a second.
    Jerk,
    /// By S-0-0086.
    Torque,
}

/// Element 4 of a data block before the scaling is looked at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unit {
    /// The same whatever the scaling is; empty: the data block has none.
    Fixed(&'static str),
    /// As the scaling says.
    Scaled(Dimension),
}

impl Unit {
    /// The data block has no element 4.
    pub const fn is_empty(self) -> bool {
        matches!(self, Unit::Fixed(unit) if unit.is_empty())
    }

    /// The unit under the default of the scaling.
    pub const fn preferred(self) -> &'static str {
        match self {
            Unit::Fixed(unit) => unit,
            Unit::Scaled(dimension) => dimension.preferred().unit,
        }
    }

    /// Decimal places under the default of the scaling; `fixed` where the scaling changes nothing.
    pub const fn preferred_decimals(self, fixed: u8) -> u8 {
        match self {
            Unit::Fixed(_) => fixed,
            Unit::Scaled(dimension) => dimension.preferred().decimals,
        }
    }
}

impl Dimension {
    /// The scaling type.
    pub const fn scaling_type(self) -> Idn {
        match self {
            Dimension::Position => POSITION_TYPE,
            Dimension::Velocity => VELOCITY_TYPE,
            Dimension::Acceleration | Dimension::Jerk => ACCELERATION_TYPE,
            Dimension::Torque => TORQUE_TYPE,
        }
    }

    /// What elements 3 and 4 say under the default of the scaling.
    pub const fn preferred(self) -> Weight {
        let (unit, decimals) = match self {
            Dimension::Position => ("deg", 4),
            Dimension::Velocity => ("rpm", 4),
            Dimension::Acceleration => ("rad/s^2", 3),
            Dimension::Jerk => ("rad/s^3", 3),
            Dimension::Torque => ("%", 1),
        };
        Weight { unit, decimals, factor: 1 }
    }
}

const VELOCITY_TYPE: Idn = Idn::standard(44);
const POSITION_TYPE: Idn = Idn::standard(76);
const TORQUE_TYPE: Idn = Idn::standard(86);
const ACCELERATION_TYPE: Idn = Idn::standard(160);

/// How a value reads: the number, times `factor`, with so many decimal places, in this unit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Weight {
    /// Element 4.
    pub unit: &'static str,
    /// Bits 27 to 24 of element 3.
    pub decimals: u8,
    /// Bits 15 to 0 of element 3.
    pub factor: u16,
}
