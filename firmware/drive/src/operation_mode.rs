//! What a control chooses once: modes of operation, directions, reactions.

/// What a mode of operation does with the command values (sercos2.md 6.2).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum OperationMode {
    /// 1: torque commands S-0-0080.
    Torque,
    /// 2: velocity commands S-0-0036.
    Velocity,
    /// 3: position commands S-0-0047 with following distance.
    PositionWithLag,
    /// 11: position commands S-0-0047 with velocity feed-forward.
    PositionWithoutLag,
    /// 0013H: the drive goes to S-0-0258 by itself, with following distance.
    PositioningWithLag,
    /// 001BH: the drive goes to S-0-0258 by itself, with velocity feed-forward.
    PositioningWithoutLag,
    /// 0213H: the drive goes by itself to what S-0-0346 takes over of S-0-0282, with following distance.
    ControlledPositioningWithLag,
    /// 021BH: the drive goes by itself to what S-0-0346 takes over of S-0-0282, with velocity feed-forward.
    ControlledPositioningWithoutLag,
}

/// Where the target of a movement that the drive makes by itself comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum TargetSource {
    /// S-0-0258.
    Target,
    /// S-0-0282, when S-0-0346 takes it over.
    Control,
}

impl OperationMode {
    /// The values of S-0-0032 to S-0-0035 and S-0-0284 to S-0-0287, and of S-0-0292.
    pub const SUPPORTED: [u16; 8] = [1, 2, 3, 11, 0x13, 0x1B, 0x213, 0x21B];

    /// The mode of an operation-mode parameter, `None` for 0 (none) and for everything this drive does not have.
    #[must_use]
    pub const fn from_parameter(value: u16) -> Option<Self> {
        match value {
            1 => Some(Self::Torque),
            2 => Some(Self::Velocity),
            3 => Some(Self::PositionWithLag),
            11 => Some(Self::PositionWithoutLag),
            0x13 => Some(Self::PositioningWithLag),
            0x1B => Some(Self::PositioningWithoutLag),
            0x213 => Some(Self::ControlledPositioningWithLag),
            0x21B => Some(Self::ControlledPositioningWithoutLag),
            _ => None,
        }
    }

    /// Where the target comes from in a mode in which the drive moves by itself; `None` in the others.
    #[inline]
    #[must_use]
    pub const fn target_source(self) -> Option<TargetSource> {
        match self {
            Self::PositioningWithLag | Self::PositioningWithoutLag => Some(TargetSource::Target),
            Self::ControlledPositioningWithLag | Self::ControlledPositioningWithoutLag => Some(TargetSource::Control),
            Self::Torque | Self::Velocity | Self::PositionWithLag | Self::PositionWithoutLag => None,
        }
    }

    /// Whether the mode feeds the velocity forward.
    #[inline]
    #[must_use]
    pub const fn is_without_lag(self) -> bool {
        matches!(self, Self::PositionWithoutLag | Self::PositioningWithoutLag | Self::ControlledPositioningWithoutLag)
    }
}

/// In which direction a modulo axis goes to a position (bits 1 and 0 of S-0-0393).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Direction {
    /// 0: the shortest way.
    #[default]
    Shortest,
    /// 1: upwards.
    Positive,
    /// 2: downwards.
    Negative,
}

impl Direction {
    /// The direction in S-0-0393; `None` for what is none.
    #[must_use]
    pub const fn from_parameter(value: u16) -> Option<Self> {
        match value & 3 {
            0 => Some(Self::Shortest),
            1 => Some(Self::Positive),
            2 => Some(Self::Negative),
            _ => None,
        }
    }
}

/// What an error does to a motor that runs (P-0-0140).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Reaction {
    /// 0: the velocity command goes to zero at once; the motor stops at its torque limit.
    TorqueLimit,
    /// 1: torque-free at once, the brake closes.
    TorqueFree,
    /// 2: the velocity command goes to zero at S-0-0138.
    #[default]
    Ramp,
}

impl Reaction {
    pub(crate) const fn from_parameter(value: u16) -> Self {
        match value {
            0 => Self::TorqueLimit,
            1 => Self::TorqueFree,
            _ => Self::Ramp,
        }
    }
}

/// Which signs are turned round (S-0-0043, S-0-0055, S-0-0085).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Polarity {
    /// Bit 0: the command value.
    pub command: bool,
    /// Bit 1: the additive command value.
    pub additive: bool,
    /// Bit 2: the feedback value.
    pub feedback: bool,
}

impl Polarity {
    pub(crate) const fn from_parameter(value: u16) -> Self {
        Self { command: value & 1 != 0, additive: value & 2 != 0, feedback: value & 4 != 0 }
    }
}
