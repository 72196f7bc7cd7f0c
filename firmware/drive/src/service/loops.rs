//! What the parameters make of the loops.

use sercos::parameters::Parameters;
use servo::motor::BoardKind;

use crate::dictionary::source;
use crate::hardware::Hardware;
use crate::settings::DriveSettings;
use crate::settings::invalid::InvalidSetting;

/// The settings of the loops. About a millisecond; divides.
///
/// # Errors
/// The first parameter that the drive cannot work with.
pub(crate) fn settings<H: Hardware>(parameters: &Parameters) -> Result<DriveSettings, InvalidSetting> {
    DriveSettings::new(parameters, &<H::Board>::FACTS, source)
}

/// Whether the loops can work with the parameters.
pub(super) fn accept<H: Hardware>(parameters: &Parameters) -> Result<(), InvalidSetting> {
    settings::<H>(parameters).map(|_| ())
}
