//! The settings of the oscilloscope over the service channel: which signals there are, and what can be written.

use sercos::Idn;
use sercos::error::ServiceError;
use sercos::parameters::Parameters;

use crate::dictionary::access::Access;
use crate::dictionary::{DICTIONARY, access_of};
use crate::oscilloscope::{
    Configuration, INTERVAL, Internal, InvalidConfiguration, SIGNALS, STATE, Signal, TRIGGER, Width, trigger,
};

/// The signal of a number in P-0-0201 to P-0-0204.
///
/// # Errors
/// [`ServiceError::IdnNotAvailable`] if there is neither such a data block nor such an internal signal,
/// [`ServiceError::InvalidData`] for a data block whose operation data cannot be followed in every tick: lists, texts, commands,
/// and what the drive puts together only when it is asked.
pub fn signal(number: u16, parameters: &Parameters) -> Result<Signal, ServiceError> {
    let idn = Idn(number);
    if number == 0 {
        return Ok(Signal::Off);
    }
    if let Some(internal) = Internal::from_number(number) {
        return Ok(Signal::Internal(internal));
    }
    let block = DICTIONARY.find(idn).ok_or(ServiceError::IdnNotAvailable)?;
    let (access, width) = (access_of(block), Width::of(block.attribute));
    if let Some(source) = access.source() {
        return Ok(Signal::Bits(source));
    }
    if let Some(feedback) = access.feedback() {
        return Ok(Signal::Feedback(feedback, width));
    }
    if let Some(command) = access.command() {
        return Ok(Signal::Command(command, width));
    }
    match (access, block.fixed_bytes()) {
        (Access::Parameter, Some(_)) => Ok(Signal::Constant(width.extend(parameters.get(idn)))),
        _ => Err(ServiceError::InvalidData),
    }
}

/// P-0-0201 to P-0-0208.
///
/// # Errors
/// What the master is told of the first setting that no recording can be made with.
pub fn configuration(parameters: &Parameters) -> Result<Configuration, ServiceError> {
    let configuration = Configuration::new(|idn| parameters.get(idn), |number| signal(number, parameters));
    configuration.map_err(|invalid| invalid.service_error())
}

/// Whether a data block is one of the oscilloscope's (P-0-0200 to P-0-0215), of which the loops know nothing.
pub(crate) fn is_own(idn: Idn) -> bool {
    (STATE..=INTERVAL).contains(&idn)
}

/// Why this value cannot be written to a setting; `None` for one that can, and for all other data blocks.
pub fn refuses_setting(idn: Idn, value: u64, parameters: &Parameters) -> Option<ServiceError> {
    let word = (value & 0xFFFF) as u16;
    if SIGNALS.contains(&idn) {
        signal(word, parameters).err()
    } else if idn == TRIGGER {
        trigger(word).err().map(InvalidConfiguration::service_error)
    } else {
        None
    }
}
