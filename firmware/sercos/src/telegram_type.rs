//! S-0-0015: what the cyclic telegrams carry.

use crate::idn::Idn;

/// A telegram type (sercos2.md 1.8).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum TelegramType {
    /// 0: nothing.
    Empty = 0,
    /// 1: torque command.
    Torque = 1,
    /// 2: velocity command, velocity feedback.
    Velocity = 2,
    /// 3: velocity command, position feedback.
    VelocityWithPosition = 3,
    /// 4: position command, position feedback.
    Position = 4,
    /// 5: position and velocity both ways.
    PositionAndVelocity = 5,
    /// 6: velocity command.
    VelocityCommandOnly = 6,
    /// 7: the lists S-0-0016 and S-0-0024.
    Application = 7,
}

impl TelegramType {
    /// The type that a value of S-0-0015 stands for; `None` if a reserved bit is set, and for the types with position
    /// feedback 2 (bit 3), which this drive does not have.
    pub const fn from_parameter(value: u16) -> Option<Self> {
        Some(match value {
            0 => TelegramType::Empty,
            1 => TelegramType::Torque,
            2 => TelegramType::Velocity,
            3 => TelegramType::VelocityWithPosition,
            4 => TelegramType::Position,
            5 => TelegramType::PositionAndVelocity,
            6 => TelegramType::VelocityCommandOnly,
            7 => TelegramType::Application,
            _ => return None,
        })
    }

    /// Data of the MDT record; `None`: as S-0-0024 says.
    pub const fn mdt(self) -> Option<&'static [Idn]> {
        match self {
            TelegramType::Empty => Some(&[]),
            TelegramType::Torque => Some(&[Idn::TORQUE_COMMAND]),
            TelegramType::Velocity | TelegramType::VelocityWithPosition | TelegramType::VelocityCommandOnly => {
                Some(&[Idn::VELOCITY_COMMAND])
            }
            TelegramType::Position => Some(&[Idn::POSITION_COMMAND]),
            TelegramType::PositionAndVelocity => Some(&[Idn::POSITION_COMMAND, Idn::VELOCITY_COMMAND]),
            TelegramType::Application => None,
        }
    }

    /// Data of the AT; `None`: as S-0-0016 says.
    pub const fn at(self) -> Option<&'static [Idn]> {
        match self {
            TelegramType::Empty | TelegramType::Torque | TelegramType::VelocityCommandOnly => Some(&[]),
            TelegramType::Velocity => Some(&[Idn::VELOCITY_FEEDBACK]),
            TelegramType::VelocityWithPosition | TelegramType::Position => Some(&[Idn::POSITION_FEEDBACK]),
            TelegramType::PositionAndVelocity => Some(&[Idn::POSITION_FEEDBACK, Idn::VELOCITY_FEEDBACK]),
            TelegramType::Application => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn type_5_carries_position_before_velocity() {
        let both = TelegramType::from_parameter(5).unwrap();
        assert_eq!(both.mdt(), Some([Idn::standard(47), Idn::standard(36)].as_slice()));
        assert_eq!(both.at(), Some([Idn::standard(51), Idn::standard(40)].as_slice()));
    }

    #[test]
    fn types_with_a_second_encoder_and_reserved_bits_are_refused() {
        for value in 8..=u16::MAX {
            assert_eq!(TelegramType::from_parameter(value), None);
        }
        for value in 0..8 {
            assert_eq!(TelegramType::from_parameter(value).map(|kind| kind as u16), Some(value));
        }
    }
}
