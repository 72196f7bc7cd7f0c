//! Numbers and bits that live in the drive: how the service channel reads and writes them.

use rtic_core::Mutex;
use sercon816::Bus;
use sercos::parameters::Parameters;
use servo::motor::{BoardKind, Facts};

use super::context::Context;
use crate::diagnosis::error_memory::seconds;
use crate::dictionary::access::Access;
use crate::dictionary::numbers::Number;
use crate::hardware::Hardware;
use crate::motion::Motion;
use crate::signal::feedback::{Feedback, FeedbackValue};
use crate::signal::word::{Source, Word};

/// Period of the current loop in 0.1 us.
const fn current_loop_period(facts: &Facts) -> u16 {
    (facts.frequency.nanoseconds() / 100) as u16
}

impl<B, H, M> Context<'_, B, M>
where
    B: Bus + Clone,
    H: Hardware,
    M: Mutex<T = Motion<B, H>>,
{
    /// Operation data of two or four bytes that live in the drive.
    pub(super) fn value(&mut self, access: Access, parameters: &Parameters) -> u32 {
        match access {
            Access::Number(number) => self.number(number, parameters),
            // As they are now, and not as they were at the last t4.
            Access::Feedback(FeedbackValue::DiagnosticNumber) => self.diagnosis().number.into(),
            Access::Word(Word::InterfaceStatus) => self.phases.interface_status().raw_value().into(),
            Access::Feedback(value) => self.motion.lock(|motion| motion.feedback(Feedback::Value(value))),
            Access::Command(value) => self.motion.lock(|motion| motion.command_data(value)),
            Access::Word(word) => self.bits(Source::Word(word)),
            Access::Bit(word, bit) => self.bits(Source::Bit(word, bit)),
            Access::Enable(enable) => self.bits(Source::Enable(enable)),
            Access::Parameter
            | Access::Rating(_)
            | Access::Limit(_)
            | Access::List(_)
            | Access::Text(_)
            | Access::Words(_)
            | Access::Longs(_)
            | Access::Procedure(_) => {
                debug_assert!(false, "{access:?} is no number of the drive's own");
                0
            }
        }
    }

    fn number(&mut self, number: Number, parameters: &Parameters) -> u32 {
        match number {
            Number::MstErrors => self.ask(|motion| motion.lost_telegrams()[0].into()),
            Number::MdtErrors => self.ask(|motion| motion.lost_telegrams()[1].into()),
            Number::SlaveArrangement => u16::from_le_bytes([self.identity.address.get(); 2]).into(),
            Number::RealTimeStatusBit1 => self.ask(|motion| motion.real_time_status()[0].into()),
            Number::RealTimeStatusBit2 => self.ask(|motion| motion.real_time_status()[1].into()),
            Number::Checksum => parameters.checksum(),
            Number::OperatingTime => seconds(self.motion.lock(|motion| motion.operating_time())),
            Number::TotalOperatingTime => {
                let now = self.motion.lock(|motion| motion.operating_time());
                self.total_seconds.saturating_add(seconds(now))
            }
            Number::ResetCause => self.ask(|motion| motion.reset_cause().code().into()),
            Number::CommutationAngle => self.ask(|motion| motion.commutation_angle().cast_unsigned()),
            Number::CommutationState => self.ask(|motion| motion.commutation_state().into()),
            Number::MotorLoad => self.ask(|motion| motion.loads()[0].into()),
            Number::AmplifierLoad => self.ask(|motion| motion.loads()[1].into()),
            Number::ChopperLoad => self.ask(|motion| motion.loads()[2].into()),
            Number::PhaseError => self.ask(|motion| motion.phase_error().cast_unsigned()),
            Number::LargestPhaseError => self.ask(|motion| motion.largest_phase_error()),
            Number::LateCurrentLoops => self.ask(|motion| motion.late_current_loops()),
            Number::ScopeState => self.ask(|motion| motion.oscilloscope().state().into()),
            Number::ScopeWindow => self.ask(|motion| motion.oscilloscope().window().into()),
            Number::ScopeInterval => {
                self.ask(|motion| motion.oscilloscope().interval(const { current_loop_period(&<H::Board>::FACTS) }))
            }
            Number::IdentificationProgress => self.ask(|motion| motion.identification_percent().into()),
        }
    }

    fn ask(&mut self, what: impl FnOnce(&mut Motion<B, H>) -> u32) -> u32 {
        self.motion.lock(what)
    }

    /// Reading S-0-0012 and S-0-0013 ends their change bits.
    fn bits(&mut self, source: Source) -> u32 {
        self.motion.lock(|motion| {
            let value = motion.source_value(source);
            match source {
                Source::Word(Word::Class2) => motion.clear_class_2_change(),
                Source::Word(Word::Class3) => motion.clear_class_3_change(),
                _ => {}
            }
            value.into()
        })
    }

    /// Takes operation data of two or four bytes; limits, phase and reasons of the drive's own have been looked at.
    pub(super) fn set_value(&mut self, access: Access, raw: u32) {
        let word = (raw & 0xFFFF) as u16;
        self.motion.lock(|motion| match access {
            Access::Command(value) => motion.set_command(value, raw),
            Access::Enable(enable) => motion.set_enable(enable, raw & 1 != 0),
            Access::Word(Word::Application) => motion.set_application_word(word),
            Access::Number(Number::CommutationAngle) => motion.set_commutation_angle(raw.cast_signed()),
            Access::Number(Number::ScopeWindow) => motion.oscilloscope().set_window(word),
            _ => debug_assert!(false, "{access:?} is read only"),
        });
    }
}
