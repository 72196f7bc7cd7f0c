//! S-0-0015: what the cyclic telegrams carry.

use crate::idn::Idn;

/// A telegram type (sercos2.md 1.8): what stands in the telegrams, and which position feedback is meant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct TelegramType {
    contents: Contents,
    feedback_2: bool,
}

/// Bits 2 to 0 of S-0-0015.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Contents {
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
    /// 7: the lists S-0-0016 and S-0-0024.
    pub const APPLICATION: Self = Self { contents: Contents::Application, feedback_2: false };

    /// The type that a value of S-0-0015 stands for; `None` if a reserved bit is set, or bit 3 (position feedback 2) where there is no
    /// position feedback: 11, 12 and 13 are the only types with it.
    pub const fn from_parameter(value: u16) -> Option<Self> {
        let contents = match value & 7 {
            0 => Contents::Empty,
            1 => Contents::Torque,
            2 => Contents::Velocity,
            3 => Contents::VelocityWithPosition,
            4 => Contents::Position,
            5 => Contents::PositionAndVelocity,
            6 => Contents::VelocityCommandOnly,
            _ => Contents::Application,
        };
        let feedback_2 = match value >> 3 {
            0 => false,
            1 if matches!(value, 11..=13) => true,
            _ => return None,
        };
        Some(Self { contents, feedback_2 })
    }

    /// Bits 2 to 0.
    pub const fn contents(self) -> Contents {
        self.contents
    }

    /// Bit 3: S-0-0053 takes the place of S-0-0051.
    pub const fn uses_feedback_2(self) -> bool {
        self.feedback_2
    }

    /// Data of the MDT record; `None`: as S-0-0024 says.
    pub const fn mdt(self) -> Option<&'static [Idn]> {
        match self.contents {
            Contents::Empty => Some(&[]),
            Contents::Torque => Some(&[Idn::TORQUE_COMMAND]),
            Contents::Velocity | Contents::VelocityWithPosition | Contents::VelocityCommandOnly => {
                Some(&[Idn::VELOCITY_COMMAND])
            }
            Contents::Position => Some(&[Idn::POSITION_COMMAND]),
            Contents::PositionAndVelocity => Some(&[Idn::POSITION_COMMAND, Idn::VELOCITY_COMMAND]),
            Contents::Application => None,
        }
    }

    /// Data of the AT; `None`: as S-0-0016 says.
    pub const fn at(self) -> Option<&'static [Idn]> {
        match (self.contents, self.feedback_2) {
            (Contents::Empty | Contents::Torque | Contents::VelocityCommandOnly, _) => Some(&[]),
            (Contents::Velocity, _) => Some(&[Idn::VELOCITY_FEEDBACK]),
            (Contents::VelocityWithPosition | Contents::Position, false) => Some(&[Idn::POSITION_FEEDBACK]),
            (Contents::VelocityWithPosition | Contents::Position, true) => Some(&[Idn::POSITION_FEEDBACK_2]),
            (Contents::PositionAndVelocity, false) => Some(&[Idn::POSITION_FEEDBACK, Idn::VELOCITY_FEEDBACK]),
            (Contents::PositionAndVelocity, true) => Some(&[Idn::POSITION_FEEDBACK_2, Idn::VELOCITY_FEEDBACK]),
            (Contents::Application, _) => None,
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
    fn bit_3_puts_position_feedback_2_where_the_first_was() {
        for (value, at) in [(11, [53].as_slice()), (12, &[53]), (13, &[53, 40])] {
            let second = TelegramType::from_parameter(value).unwrap();
            let first = TelegramType::from_parameter(value & 7).unwrap();
            let numbers: std::vec::Vec<u16> = second.at().unwrap().iter().map(|idn| idn.0).collect();
            assert_eq!((numbers.as_slice(), second.mdt()), (at, first.mdt()));
            assert!(second.uses_feedback_2() && !first.uses_feedback_2());
        }
    }

    #[test]
    fn the_types_are_0_to_7_and_11_to_13() {
        for value in 0..=u16::MAX {
            let kind = TelegramType::from_parameter(value);
            assert_eq!(kind.is_some(), matches!(value, 0..=7 | 11..=13), "{value}");
            if let Some(kind) = kind {
                assert_eq!(kind.contents() as u16, value & 7);
            }
        }
    }
}
