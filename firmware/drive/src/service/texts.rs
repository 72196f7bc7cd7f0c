//! Texts that the drive supplies.

use core::fmt::Write;

use heapless::String;
use rtic_core::Mutex;
use sercon816::Bus;
use sercos::Idn;
use sercos::capacity::LIVE_TEXT_BYTES;
use sercos::parameters::Parameters;

use super::context::Context;
use crate::dictionary::texts::Text;
use crate::hardware::Hardware;
use crate::motion::Motion;

/// S-0-0265: 0 German, 1 English.
const LANGUAGE: Idn = Idn::standard(265);
const GERMAN: u32 = 0;

impl<B, H, M> Context<'_, B, M>
where
    B: Bus + Clone,
    H: Hardware,
    M: Mutex<T = Motion<B, H>>,
{
    /// A text: one that never changes is returned, any other is put into `buffer`, which is longer than the longest of them; a test looks.
    pub(super) fn text(
        &mut self,
        text: Text,
        parameters: &Parameters,
        buffer: &mut String<LIVE_TEXT_BYTES>,
    ) -> Option<&'static str> {
        // Nothing else can go wrong with a buffer.
        let _ = match text {
            Text::Version => return Some(concat!("sercos-drive ", env!("CARGO_PKG_VERSION"))),
            Text::DiagnosticMessage if parameters.get(LANGUAGE) == GERMAN => return Some(self.diagnosis().german),
            Text::DiagnosticMessage => return Some(self.diagnosis().text),
            Text::ControllerType => return Some("STM32F407 + SERCON816"),
            Text::SystemInterface => return Some("V02.04"),
            Text::Password => return Some(self.access.shown()),
            Text::DiagnosticCause => return Some(self.diagnosis().cause),
            Text::DiagnosticRemedy => return Some(self.diagnosis().remedy),
            Text::CheckFinding => self.checks.finding.map_or(Ok(()), |finding| write!(buffer, "{finding}")),
            Text::SerialNumber => {
                buffer.push_str(self.identity.production.serial_number()).map_err(|_| core::fmt::Error)
            }
            Text::HardwareName => buffer.push_str(self.identity.production.hardware()).map_err(|_| core::fmt::Error),
            Text::LastCrash => self.crash.map_or(Ok(()), |(record, task)| write!(buffer, "{}", record.told_of(task))),
            Text::IdentificationFinding => {
                self.commissioning.finding.map_or(Ok(()), |finding| write!(buffer, "{finding}"))
            }
        };
        None
    }
}
