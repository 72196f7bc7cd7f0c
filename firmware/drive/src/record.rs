//! Which signal stands where in the cyclic records: worked out at S-0-0127, walked through every cycle.

use heapless::Vec;
use sercos::Idn;
use servo::probe::{Edge, Probe};

use crate::bits::{Source, Word};
use crate::limits::Limit;

/// Most data blocks in a record (S-0-0016, S-0-0024).
pub const MOST_SIGNALS: usize = 16;

/// A command value that the MDT carries.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Command {
    /// S-0-0036, 4 bytes.
    Velocity,
    /// S-0-0037, 4 bytes.
    AdditiveVelocity,
    /// S-0-0047, 4 bytes.
    Position,
    /// S-0-0048, 4 bytes.
    AdditivePosition,
    /// S-0-0080, 2 bytes.
    Torque,
    /// S-0-0081, 2 bytes.
    AdditiveTorque,
    /// S-0-0145, 2 bytes.
    SignalControl,
    /// S-0-0258, 4 bytes.
    TargetPosition,
    /// S-0-0282, 4 bytes.
    PositioningValue,
    /// S-0-0346, 2 bytes.
    PositioningControl,
    /// A limit in place of its parameter.
    Limit(Limit),
}

impl Command {
    /// The command value of an IDN; `None` if the MDT cannot carry it.
    #[must_use]
    pub fn from_idn(idn: Idn) -> Option<Self> {
        const SIGNAL_CONTROL: Idn = Idn::standard(145);
        const ADDITIVE_TORQUE: Idn = Idn::standard(81);
        const TARGET_POSITION: Idn = Idn::standard(258);
        const POSITIONING_VALUE: Idn = Idn::standard(282);
        const POSITIONING_CONTROL: Idn = Idn::standard(346);
        match idn {
            Idn::VELOCITY_COMMAND => Some(Self::Velocity),
            Idn::ADDITIVE_VELOCITY_COMMAND => Some(Self::AdditiveVelocity),
            Idn::POSITION_COMMAND => Some(Self::Position),
            Idn::ADDITIVE_POSITION_COMMAND => Some(Self::AdditivePosition),
            Idn::TORQUE_COMMAND => Some(Self::Torque),
            ADDITIVE_TORQUE => Some(Self::AdditiveTorque),
            SIGNAL_CONTROL => Some(Self::SignalControl),
            TARGET_POSITION => Some(Self::TargetPosition),
            POSITIONING_VALUE => Some(Self::PositioningValue),
            POSITIONING_CONTROL => Some(Self::PositioningControl),
            _ => Limit::from_idn(idn).map(Self::Limit),
        }
    }

    /// Words in the record.
    #[must_use]
    pub const fn words(self) -> u16 {
        match self {
            Self::Torque | Self::AdditiveTorque | Self::SignalControl | Self::PositioningControl => 1,
            Self::Limit(limit) => limit.words(),
            _ => 2,
        }
    }
}

/// A value that the AT carries.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Feedback {
    /// S-0-0040, 4 bytes.
    Velocity,
    /// S-0-0051, 4 bytes.
    Position,
    /// S-0-0053, 4 bytes.
    Position2,
    /// S-0-0084.
    Torque,
    /// S-0-0144.
    SignalStatus,
    /// S-0-0189, 4 bytes.
    FollowingDistance,
    /// S-0-0347, 4 bytes.
    VelocityError,
    /// S-0-0130 to S-0-0133, 4 bytes.
    Probe(Probe, Edge),
    /// S-0-0380.
    BusVoltage,
    /// S-0-0383.
    MotorTemperature,
    /// S-0-0384.
    AmplifierTemperature,
    /// P-0-0160.
    Limits,
    /// S-0-0390.
    DiagnosticNumber,
    /// S-0-0430, 4 bytes.
    EffectiveTarget,
    /// A word of single bits: S-0-0011 to S-0-0014, S-0-0129, S-0-0181, S-0-0182, S-0-0403, S-0-0437, P-0-0019.
    Bits(Word),
}

impl Feedback {
    /// The value of an IDN; `None` if the AT cannot carry it.
    #[must_use]
    pub fn from_idn(idn: Idn) -> Option<Self> {
        if let Some(source) = Source::from_idn(idn) {
            return Some(Self::Bits(source.word()));
        }
        if idn.is_product() {
            return (idn.number() == 160).then_some(Self::Limits);
        }
        Some(match idn.0 {
            40 => Self::Velocity,
            51 => Self::Position,
            53 => Self::Position2,
            84 => Self::Torque,
            144 => Self::SignalStatus,
            189 => Self::FollowingDistance,
            347 => Self::VelocityError,
            130 => Self::Probe(Probe::One, Edge::Positive),
            131 => Self::Probe(Probe::One, Edge::Negative),
            132 => Self::Probe(Probe::Two, Edge::Positive),
            133 => Self::Probe(Probe::Two, Edge::Negative),
            380 => Self::BusVoltage,
            383 => Self::MotorTemperature,
            384 => Self::AmplifierTemperature,
            390 => Self::DiagnosticNumber,
            430 => Self::EffectiveTarget,
            _ => return None,
        })
    }

    /// Words in the record.
    #[must_use]
    pub const fn words(self) -> u16 {
        match self {
            Self::Velocity
            | Self::Position
            | Self::Position2
            | Self::FollowingDistance
            | Self::VelocityError
            | Self::EffectiveTarget
            | Self::Probe(..) => 2,
            _ => 1,
        }
    }
}

/// The two records of this drive, in their order.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Records {
    /// Behind control word and service info of the MDT.
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

    /// Limits in the MDT.
    pub(crate) fn limits(&self) -> impl Iterator<Item = Limit> {
        self.commands.iter().filter_map(|command| match command {
            Command::Limit(limit) => Some(*limit),
            _ => None,
        })
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
            let command = Command::from_idn(block.idn).unwrap_or_else(|| panic!("{} in the MDT", block.idn));
            assert_eq!(Some(command.words() * 2), block.fixed_bytes(), "{}", block.idn);
        }
    }
}
