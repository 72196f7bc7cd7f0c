//! Which signal stands where in the cyclic records: worked out at S-0-0127, walked through every cycle.

use heapless::Vec;
use sercos::Idn;

/// Most data blocks in a record (S-0-0016, S-0-0024).
pub const MOST_SIGNALS: usize = 16;

/// A command value that the MDT carries.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Command {
    /// S-0-0036, 4 bytes.
    Velocity,
    /// S-0-0047, 4 bytes.
    Position,
}

impl Command {
    /// The command value of an IDN; `None` if the MDT cannot carry it.
    #[must_use]
    pub const fn from_idn(idn: Idn) -> Option<Self> {
        match idn {
            Idn::VELOCITY_COMMAND => Some(Self::Velocity),
            Idn::POSITION_COMMAND => Some(Self::Position),
            _ => None,
        }
    }
}

/// A value that the AT carries.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Feedback {
    /// S-0-0011.
    Class1,
    /// S-0-0012.
    Class2,
    /// S-0-0013.
    Class3,
    /// S-0-0014.
    InterfaceStatus,
    /// S-0-0040, 4 bytes.
    Velocity,
    /// S-0-0051, 4 bytes.
    Position,
    /// S-0-0084.
    Torque,
    /// S-0-0189, 4 bytes.
    FollowingDistance,
    /// S-0-0390.
    DiagnosticNumber,
    /// P-0-0019.
    ApplicationWord,
}

impl Feedback {
    /// The value of an IDN; `None` if the AT cannot carry it.
    #[must_use]
    pub const fn from_idn(idn: Idn) -> Option<Self> {
        const CLASS_1: Idn = Idn::standard(11);
        const CLASS_2: Idn = Idn::standard(12);
        const CLASS_3: Idn = Idn::standard(13);
        const INTERFACE_STATUS: Idn = Idn::standard(14);
        const TORQUE: Idn = Idn::standard(84);
        const FOLLOWING_DISTANCE: Idn = Idn::standard(189);
        const DIAGNOSTIC_NUMBER: Idn = Idn::standard(390);
        const APPLICATION_WORD: Idn = Idn::product(19);
        match idn {
            CLASS_1 => Some(Self::Class1),
            CLASS_2 => Some(Self::Class2),
            CLASS_3 => Some(Self::Class3),
            INTERFACE_STATUS => Some(Self::InterfaceStatus),
            Idn::VELOCITY_FEEDBACK => Some(Self::Velocity),
            Idn::POSITION_FEEDBACK => Some(Self::Position),
            TORQUE => Some(Self::Torque),
            FOLLOWING_DISTANCE => Some(Self::FollowingDistance),
            DIAGNOSTIC_NUMBER => Some(Self::DiagnosticNumber),
            APPLICATION_WORD => Some(Self::ApplicationWord),
            _ => None,
        }
    }

    /// Words in the record.
    #[must_use]
    pub const fn words(self) -> u16 {
        match self {
            Self::Velocity | Self::Position | Self::FollowingDistance => 2,
            _ => 1,
        }
    }
}

/// The two records of this drive, in their order.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Records {
    /// Behind control word and service info of the MDT; every command takes two words.
    pub commands: Vec<Command, MOST_SIGNALS>,
    /// Behind status word and service info of the AT.
    pub feedback: Vec<Feedback, MOST_SIGNALS>,
}

impl Records {
    /// The records of two configuration lists; `None` if an IDN can not be carried.
    #[must_use]
    pub fn new(mdt: impl Iterator<Item = Idn>, at: impl Iterator<Item = Idn>) -> Option<Self> {
        let mut records = Self::default();
        for idn in mdt {
            records.commands.push(Command::from_idn(idn)?).ok()?;
        }
        for idn in at {
            records.feedback.push(Feedback::from_idn(idn)?).ok()?;
        }
        Some(records)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use sercos::data_block::Selection;
    use sercos::dictionary;

    #[test]
    fn every_data_block_that_the_table_lets_a_master_configure_can_be_carried() {
        for block in dictionary::select(Selection::ConfigurableInAt) {
            let feedback = Feedback::from_idn(block.idn).unwrap_or_else(|| panic!("{} in the AT", block.idn));
            assert_eq!(Some(feedback.words() * 2), block.fixed_bytes(), "{}", block.idn);
        }
        for block in dictionary::select(Selection::ConfigurableInMdt) {
            assert!(Command::from_idn(block.idn).is_some(), "{} in the MDT", block.idn);
            assert_eq!(block.fixed_bytes(), Some(4));
        }
    }
}
