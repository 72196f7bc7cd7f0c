//! Parameters that the loops cannot work with.

use core::fmt;

use sercos::Idn;
use sercos::parameters::Parameters;
use servo::SettingsError;

/// A parameter that the drive cannot work with: a write in operation is refused for it, and S-0-0128 lists it in S-0-0022.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct InvalidSetting {
    /// The parameter.
    pub idn: Idn,
    /// What is wrong with it, where the motion side says more than "not supported".
    pub reason: Option<SettingsError>,
}

impl fmt::Display for InvalidSetting {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.reason {
            Some(reason) => write!(formatter, "{}: {reason}", self.idn),
            None => write!(formatter, "{}: a value this drive does not support", self.idn),
        }
    }
}

pub(super) fn invalid(number: u16) -> impl Fn(SettingsError) -> InvalidSetting {
    move |reason| InvalidSetting { idn: Idn::standard(number), reason: Some(reason) }
}

/// A complaint of the loops, with the parameter that it is about.
pub(super) fn blamed(reason: SettingsError) -> InvalidSetting {
    let number = match reason {
        SettingsError::TicksPerCycle { .. } => 1,
        SettingsError::Zero { .. } => 91,
        SettingsError::FeedForward { .. } => 296,
        SettingsError::ModuloOutOfRange => 103,
        SettingsError::TooSmooth { .. } | SettingsError::BrakingTime { .. } => 349,
        _ => 100,
    };
    invalid(number)(reason)
}

pub(super) fn unsupported(number: u16) -> InvalidSetting {
    InvalidSetting { idn: Idn::standard(number), reason: None }
}

/// A 32-bit parameter as the signed number that scalings work with; unsigned ones saturate.
pub(super) fn signed(parameters: &Parameters, number: u16) -> i32 {
    i32::try_from(parameters.get_signed(Idn::standard(number))).unwrap_or(i32::MAX)
}
