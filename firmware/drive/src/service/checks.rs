//! The transition checks S-0-0127 and S-0-0128: what the protocol asks for, what the loops can work with, what the ring controller takes.

use rtic_core::Mutex;
use sercon816::Bus;
use sercos::Idn;
use sercos::command::CommandState;
use sercos::data_block::Selection;
use sercos::parameters::Parameters;
use sercos::transition::{self, Capabilities, CyclicConfiguration, Invalid, InvalidData, Reason};

use super::context::Context;
use super::finding::{Finding, reason_of};
use super::loops;
use servo::motor::BoardKind;

use crate::amplifier::Amplifier;
use crate::dictionary::records;
use crate::hardware::Hardware;
use crate::motion::Motion;
use crate::operation_mode::OperationMode;
use crate::production::Production;
use crate::remembering::keeping::Keeping;
use crate::remembering::set::Dropped;
use crate::settings::{CycleSettings, has_feedback_2};

/// So long S-0-0128 waits for the loops to lock to the ring: 200 ms in loop ticks, twice what a lock takes.
const LOCK_PATIENCE_TICKS: u16 = 400;

/// What a motor is: a drive that runs one with the data of another turns it the wrong way round, or burns it.
const MOTOR: [Idn; 6] = [
    Idn::standard(109),
    Idn::standard(111),
    Idn::standard(113),
    Idn::standard(116),
    Idn::product(110),
    Idn::product(114),
];

/// Stands for the whole production record in S-0-0022.
const HARDWARE: Idn = Idn::product(21);

impl<B, H, M> Context<'_, B, M>
where
    B: Bus + Clone,
    H: Hardware,
    M: Mutex<T = Motion<B, H>>,
{
    fn capabilities(&self, parameters: &Parameters) -> Capabilities {
        capabilities(self.identity.bit_rate, parameters)
    }

    pub(super) fn check_cp3(&mut self, parameters: &Parameters) -> CommandState {
        self.phases.withdraw();
        self.checks.cyclic = None;
        let (cyclic, ready) = match transition::check_cp3(parameters, &self.capabilities(parameters)) {
            Ok(passed) => passed,
            Err(invalid) => {
                self.checks.finding = invalid.findings().first().copied().map(Finding::DataBlock);
                self.checks.invalid_for_cp3 = invalid;
                return CommandState::Failed;
            }
        };
        let cycle = match CycleSettings::new(parameters, <H::Board>::FACTS.loop_timer_counts) {
            Ok(cycle) => cycle,
            Err(setting) => {
                self.checks.finding = Some(Finding::Settings(setting));
                self.checks.invalid_for_cp3 = InvalidData::default();
                self.checks.invalid_for_cp3.add(setting.idn, reason_of(&setting));
                return CommandState::Failed;
            }
        };
        self.checks.invalid_for_cp3 = InvalidData::default();
        self.checks.finding = Some(Finding::Controller);
        let Some(records) = records(&cyclic) else { return CommandState::Failed };
        if self.slave.configure_cyclic(&chip_configuration(&cyclic)).is_err() {
            return CommandState::Failed;
        }
        self.motion.lock(|motion| {
            motion.set_records(records);
            motion.apply_cycle(cycle);
        });
        self.checks.cyclic = Some(cyclic);
        self.checks.finding = None;
        self.phases.permit_cp3(ready);
        CommandState::Executed
    }

    /// S-0-0128, once more when the loop clock has locked. `patient`: still worth waiting for it.
    pub(crate) fn check_cp4(&mut self, parameters: &mut Parameters, patient: bool) -> CommandState {
        self.checks.waits_for_lock = false;
        let capabilities = self.capabilities(parameters);
        let Some(cyclic) = &self.checks.cyclic else { return CommandState::Failed };
        let misfits = self.rescaling.misfits(parameters);
        let untold = self.untold(parameters);
        let unknown = amplifier_is_unknown(&self.identity.production, &H::AMPLIFIER, self.keeping);
        let synchronised = self.motion.lock(|motion| motion.is_synchronised());
        let settings = loops::settings::<H>(parameters);
        let mut invalid = match (transition::check_cp4(parameters, &capabilities, cyclic, synchronised), settings) {
            (Ok(ready), Ok(settings)) if misfits.is_empty() && untold.is_empty() && unknown.is_none() => {
                self.rescaling.take_over(parameters);
                self.checks.invalid_for_cp4 = InvalidData::default();
                self.checks.finding = None;
                self.motion.lock(|motion| motion.apply_settings(&settings));
                self.phases.permit_cp4(ready);
                return CommandState::Executed;
            }
            (Ok(_), _) => InvalidData::default(),
            (Err(invalid), _) => invalid,
        };
        if let Some((idn, _)) = unknown {
            invalid.add(idn, Reason::NotSupported);
        }
        for idn in self.keeping.disputed() {
            invalid.add(idn, Reason::NotSupported);
        }
        for idn in &misfits {
            invalid.add(*idn, Reason::OldScaling);
        }
        for idn in &untold {
            invalid.add(*idn, Reason::NeverTold);
        }
        if let Err(setting) = settings {
            invalid.add(setting.idn, reason_of(&setting));
        } else if patient && invalid.not_synchronised && invalid.findings().is_empty() {
            self.checks.waits_for_lock = true;
            self.motion.lock(|motion| motion.wait_for_lock(LOCK_PATIENCE_TICKS));
            return CommandState::Executing;
        }
        self.checks.finding = Some(match (invalid.findings().first().copied(), settings) {
            _ if let Some((_, finding)) = unknown => finding,
            (Some(first), Err(setting)) if first.idn == setting.idn && first.reason == Reason::NotTogether => {
                Finding::Settings(setting)
            }
            (Some(first), _) => Finding::DataBlock(first),
            (None, _) => Finding::NotSynchronised,
        });
        self.checks.invalid_for_cp4 = invalid;
        CommandState::Failed
    }

    /// What no default can be right for, and nobody has told; and what was saved and could not be taken over.
    fn untold(&self, parameters: &Parameters) -> Dropped {
        // What once was a parameter and is a rating of the amplifier now nobody can tell any more.
        let is_kept =
            |idn: &Idn| parameters.dictionary().find(*idn).is_some_and(|block| block.is_in(Selection::Backup));
        let asked_for = |idn: &Idn| is_kept(idn) && !parameters.is_told(*idn);
        let mut untold = Dropped::new();
        for idn in MOTOR.iter().chain(&self.keeping.dropped).filter(|idn| asked_for(idn)) {
            // More than that are not told of.
            let _ = untold.push(*idn);
        }
        untold
    }

    /// What S-0-0128 would find first, if it was given now.
    pub(super) fn first_invalid(&self, parameters: &Parameters) -> Option<Invalid> {
        let cyclic = self.checks.cyclic.as_ref()?;
        let checked = transition::check_cp4(parameters, &self.capabilities(parameters), cyclic, true);
        checked.err().and_then(|invalid| invalid.findings().first().copied())
    }
}

/// Which data block shows that nobody knows the amplifier, and why; `None`: it is known. `of_board` is the one without a production record.
pub(crate) fn amplifier_is_unknown(
    production: &Production,
    of_board: &Amplifier,
    keeping: &Keeping,
) -> Option<(Idn, Finding)> {
    if let Some(error) = production.error() {
        return Some((HARDWARE, Finding::Production(error)));
    }
    if let Err(setting) = production.amplifier(of_board).check() {
        return Some((setting.idn, Finding::Settings(setting)));
    }
    keeping.disputed().next().map(|other| (other, Finding::AnotherAmplifier(other)))
}

/// What the drive can do beyond the read-only data of its dictionary.
pub(super) fn capabilities(bit_rate: sercon816::BitRate, parameters: &Parameters) -> Capabilities {
    Capabilities {
        bit_rate: protocol_bit_rate(bit_rate),
        operation_modes: &OperationMode::SUPPORTED,
        feedback_2: has_feedback_2(parameters),
    }
}

const fn protocol_bit_rate(rate: sercon816::BitRate) -> sercos::duration::BitRate {
    match rate {
        sercon816::BitRate::Mbit2 => sercos::duration::BitRate::Mbit2,
        sercon816::BitRate::Mbit4 => sercos::duration::BitRate::Mbit4,
        sercon816::BitRate::Mbit8 => sercos::duration::BitRate::Mbit8,
        sercon816::BitRate::Mbit16 => sercos::duration::BitRate::Mbit16,
    }
}

/// The chip's view of a checked configuration: words instead of bytes.
///
/// A t3 or t4 at the very end of the cycle (legal: t3 <= tScyc) is set one microsecond earlier, and one of 0 one later, because the timers
/// start again with the MST that falls on the same instant: they would never come.
fn chip_configuration(cyclic: &CyclicConfiguration) -> sercon816::CyclicConfiguration {
    // S-0-0002 has a minimum.
    let last = cyclic.cycle_us.saturating_sub(1).max(1);
    sercon816::CyclicConfiguration {
        cycle_us: cyclic.cycle_us,
        t1_us: cyclic.t1_us,
        t2_us: cyclic.t2_us,
        t3_us: cyclic.t3_us.clamp(1, last),
        t4_us: cyclic.t4_us.clamp(1, last),
        at_words: cyclic.at_data_bytes() / 2,
        mdt_words: cyclic.mdt_data_bytes() / 2,
        mdt_length_words: cyclic.mdt_length_bytes / 2,
        record_position_words: cyclic.record_position_bytes.saturating_sub(1) / 2,
    }
}
