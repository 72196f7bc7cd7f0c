//! Why a check, a command or a write has failed, as P-0-0003 tells it.

use core::fmt;

use sercos::Idn;
use sercos::data_block::{DataBlock, Location};
use sercos::transition::{Invalid, Reason};

use crate::dictionary::access::Access;
use crate::dictionary::access_of;
use crate::dictionary::texts::Text;
use crate::motion::HomingFailure;
use crate::production::RecordError;
use crate::remembering::keeping::MemoryFailure;
use crate::settings::invalid::InvalidSetting;

/// What keeps a transition check from passing, homing from starting or a write from being taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Finding {
    /// A data block is to blame.
    DataBlock(Invalid),
    /// The loops cannot work with the parameters.
    Settings(InvalidSetting),
    /// The loops could not work with what was written, and it was taken back.
    Write(InvalidSetting),
    /// The same for what S-0-0128 would not let pass.
    WriteOf(Invalid),
    /// A data block cannot have the value that was written, and what it takes.
    Value(Idn, &'static str),
    /// S-0-0262 where it would change what the phase protects.
    LoadInOperation,
    /// The loops have not locked to the ring (S-0-0128).
    NotSynchronised,
    /// The ring controller refuses the configuration.
    Controller,
    /// S-0-0148 has failed.
    Homing(HomingFailure),
    /// S-0-0264 or S-0-0293 with torque.
    SaveWithTorque,
    /// S-0-0293 with an empty S-0-0270.
    NothingSelected,
    /// S-0-0263, S-0-0264 or S-0-0293 has failed, or what was written could not be kept.
    Memory(MemoryFailure),
    /// Nobody knows the amplifier.
    Production(RecordError),
    /// What was saved names another rating than the drive has.
    AnotherAmplifier(Idn),
    /// S-0-0149 has failed: the torque went.
    PositiveStop,
}

impl Finding {
    /// It is about a write, and over when a write has succeeded.
    pub(crate) const fn is_of_a_write(&self) -> bool {
        matches!(self, Self::Write(_) | Self::WriteOf(_) | Self::Value(..))
    }
}

impl fmt::Display for Finding {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::DataBlock(invalid) | Self::WriteOf(invalid) => invalid.fmt(formatter),
            Self::Settings(setting) | Self::Write(setting) => setting.fmt(formatter),
            Self::Value(idn, taken) => write!(formatter, "{idn}: {taken}"),
            Self::LoadInOperation => formatter.write_str("S-0-0262 and S-0-0263 change what is protected in CP4"),
            Self::SaveWithTorque => {
                formatter.write_str("S-0-0264 and S-0-0293 only without torque: the flash stops the processor")
            }
            Self::NothingSelected => formatter.write_str("S-0-0270 is empty: write what S-0-0293 is to save"),
            Self::Memory(failure) => formatter.write_str(failure.words()),
            Self::NotSynchronised => formatter.write_str("the loops have not locked to the ring"),
            Self::Homing(HomingFailure::Way(error)) => error.fmt(formatter),
            Self::Homing(HomingFailure::Torque) => formatter.write_str("the torque went while homing"),
            Self::PositiveStop => formatter.write_str("the torque went before the stop was reached"),
            Self::Production(error) => error.fmt(formatter),
            Self::AnotherAmplifier(idn) => {
                write!(
                    formatter,
                    "{idn}: saved of another amplifier; write this one's record, or say by S-0-0264 that it is right"
                )
            }
            Self::Controller => formatter.write_str("the ring controller refuses the configuration"),
        }
    }
}

/// What a data block takes that has refused a value.
pub(super) fn what_it_takes(block: &DataBlock) -> &'static str {
    match (block.location, block.fixed_bytes()) {
        (Location::Command, _) => "a command takes 3 to start and 0 to cancel",
        (_, None) if access_of(block) == Access::Text(Text::Password) => "no password, or not the one in force",
        (_, None) if block.is_text() => "a text that is too long, too short or none",
        (_, None) if block.idn == Idn::SELECTED_BACKUP => "up to 16 IDNs, each of them one of S-0-0192",
        (_, None) => "a list that is too long, or an entry that it cannot have",
        _ => "a value that it does not have",
    }
}

/// What S-0-0128 tells of a parameter that the loops cannot work with.
pub(super) const fn reason_of(setting: &InvalidSetting) -> Reason {
    match setting.reason {
        Some(_) => Reason::NotTogether,
        None => Reason::NotSupported,
    }
}
