//! Error words of the service channel.

use core::fmt;

/// An element of a data block, 1 to 7 (sercos2.md 3.1).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Element {
    /// 1: writing it opens the channel, reading it shows what is open.
    Idn = 1,
    /// 2.
    Name = 2,
    /// 3.
    Attribute = 3,
    /// 4.
    Unit = 4,
    /// 5: minimum input value.
    Minimum = 5,
    /// 6: maximum input value.
    Maximum = 6,
    /// 7: operation data.
    Data = 7,
}

impl Element {
    /// The element of control word bits 5 to 3; `None` for 0 (close) and numbers above 7.
    pub const fn from_number(number: u8) -> Option<Self> {
        Some(match number {
            1 => Element::Idn,
            2 => Element::Name,
            3 => Element::Attribute,
            4 => Element::Unit,
            5 => Element::Minimum,
            6 => Element::Maximum,
            7 => Element::Data,
            _ => return None,
        })
    }

    const fn code(self, low: u16) -> u16 {
        ((self as u16) << 12) | low
    }
}

/// Why a step was refused (sercos2.md 3.5, the codes that a SERCOS II slave may send).
///
/// 0009H (invalid access to element 0) is never sent: masters close with any bits (sercos2.md 2.1).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum ServiceError {
    /// 0001H: no IDN is open.
    ChannelNotOpen,
    /// 1001H.
    IdnNotAvailable,
    /// 1009H: element 1 was written without END.
    InvalidIdnAccess,
    /// n001H: the data block does not have this element.
    NotAvailable(Element),
    /// n002H: END came before the data were complete.
    TooShort(Element),
    /// n003H: more data than there are or fit.
    TooLong(Element),
    /// n004H: can never be written.
    ReadOnly(Element),
    /// n005H: cannot be written in this communication phase.
    WriteProtected(Element),
    /// 7006H.
    BelowMinimum,
    /// 7007H.
    AboveMaximum,
    /// 7008H: bit combination or list entry that is not supported.
    InvalidData,
    /// 7009H: locked by the password S-0-0267.
    ProtectedByPassword,
    /// 700AH.
    ConfiguredCyclically,
    /// 700CH: protected by other settings, as by a drive that is enabled.
    ProtectedBySettings,
    /// 7010H: procedure command already active.
    CommandActive,
    /// 7011H.
    CommandNotInterruptible,
    /// 7012H: procedure command not executable now.
    CommandNotExecutableNow,
    /// 7013H: procedure command not executable with these parameters.
    CommandInvalidParameters,
}

impl ServiceError {
    /// The error word for the INFO of the AT.
    pub const fn code(self) -> u16 {
        match self {
            ServiceError::ChannelNotOpen => 0x0001,
            ServiceError::IdnNotAvailable => 0x1001,
            ServiceError::InvalidIdnAccess => 0x1009,
            ServiceError::NotAvailable(element) => element.code(1),
            ServiceError::TooShort(element) => element.code(2),
            ServiceError::TooLong(element) => element.code(3),
            ServiceError::ReadOnly(element) => element.code(4),
            ServiceError::WriteProtected(element) => element.code(5),
            ServiceError::BelowMinimum => 0x7006,
            ServiceError::AboveMaximum => 0x7007,
            ServiceError::InvalidData => 0x7008,
            ServiceError::ProtectedByPassword => 0x7009,
            ServiceError::ConfiguredCyclically => 0x700A,
            ServiceError::ProtectedBySettings => 0x700C,
            ServiceError::CommandActive => 0x7010,
            ServiceError::CommandNotInterruptible => 0x7011,
            ServiceError::CommandNotExecutableNow => 0x7012,
            ServiceError::CommandInvalidParameters => 0x7013,
        }
    }
}

impl fmt::Display for ServiceError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "service channel error {:04X}H", self.code())
    }
}

impl core::error::Error for ServiceError {}
