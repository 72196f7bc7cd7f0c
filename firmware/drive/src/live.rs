//! The data blocks and procedure commands that live in the drive, as the service channel asks for them.

use heapless::{String, Vec};
use rtic_core::Mutex;
use sercon816::{Bus, Slave};
use sercos::command::{CommandAction, CommandState};
use sercos::data_block::NeededFor;
use sercos::parameters::Parameters;
use sercos::service::{LIVE_LIST_ENTRIES, LIVE_TEXT_BYTES, Live, ServiceError};
use sercos::transition::{self, Capabilities, CyclicConfiguration, InvalidData};
use sercos::{Idn, Phase, PhaseMachine, dictionary};

use crate::diagnosis::diagnose;
use crate::hardware::Hardware;
use crate::identity::Identity;
use crate::motion::Motion;
use crate::record::{Command, Feedback, Records};
use crate::settings::{MotionSettings, OperationMode};

/// So long S-0-0128 waits for the loops to lock to the ring: 200 ms in loop ticks, twice what a lock takes.
const LOCK_PATIENCE_TICKS: u16 = 1_600;

/// What the transition checks have found and prepared.
#[derive(Debug, Default)]
pub(crate) struct Checks {
    /// Of the last S-0-0127.
    pub(crate) cyclic: Option<CyclicConfiguration>,
    /// S-0-0021.
    pub(crate) invalid_for_cp3: InvalidData,
    /// S-0-0022: culprits of the protocol, and one of the motion side.
    pub(crate) invalid_for_cp4: InvalidData,
    pub(crate) invalid_setting: Option<Idn>,
    /// S-0-0128 waits for the loop clock.
    pub(crate) waits_for_lock: bool,
    /// A check that was started and is carried out once the step that started it is released.
    pub(crate) started: Option<Idn>,
}

/// What a service step works with: the drive without its service server and parameters.
pub(crate) struct Context<'a, B, M> {
    pub(crate) motion: &'a mut M,
    pub(crate) slave: &'a mut Slave<B>,
    pub(crate) phases: &'a mut PhaseMachine,
    pub(crate) checks: &'a mut Checks,
    pub(crate) identity: &'a Identity,
    /// A parameter of the loops has changed; they get it once the step is released.
    pub(crate) settings_changed: &'a mut bool,
}

impl<B, H, M> Context<'_, B, M>
where
    B: Bus + Clone,
    H: Hardware,
    M: Mutex<T = Motion<B, H>>,
{
    fn capabilities(&self) -> Capabilities {
        Capabilities { bit_rate: protocol_bit_rate(self.identity.bit_rate), operation_modes: &OperationMode::SUPPORTED }
    }

    /// Carries out the check that a step has started; `None` if there is none.
    ///
    /// It takes some 300 us, which no step of the service channel may.
    pub(crate) fn carry_out(&mut self, parameters: &Parameters) -> Option<(Idn, CommandState)> {
        let idn = self.checks.started.take()?;
        let state = match idn {
            Idn::CP3_TRANSITION_CHECK => self.check_cp3(parameters),
            _ => self.check_cp4(parameters, true),
        };
        Some((idn, state))
    }

    fn check_cp3(&mut self, parameters: &Parameters) -> CommandState {
        self.phases.withdraw();
        self.checks.cyclic = None;
        let (cyclic, ready) = match transition::check_cp3(parameters, &self.capabilities()) {
            Ok(passed) => passed,
            Err(invalid) => {
                self.checks.invalid_for_cp3 = invalid;
                return CommandState::Failed;
            }
        };
        self.checks.invalid_for_cp3 = InvalidData::default();
        let mdt = cyclic.mdt.iter().map(|datum| datum.idn);
        let at = cyclic.at.iter().map(|datum| datum.idn);
        let Some(records) = Records::new(mdt, at) else { return CommandState::Failed };
        if self.slave.configure_cyclic(&chip_configuration(&cyclic)).is_err() {
            return CommandState::Failed;
        }
        self.motion.lock(|motion| motion.set_records(records));
        self.checks.cyclic = Some(cyclic);
        self.phases.permit_cp3(ready);
        CommandState::Executed
    }

    /// S-0-0128, once more when the loop clock has locked. `patient`: still worth waiting for it.
    pub(crate) fn check_cp4(&mut self, parameters: &Parameters, patient: bool) -> CommandState {
        self.checks.waits_for_lock = false;
        let capabilities = self.capabilities();
        let Some(cyclic) = &self.checks.cyclic else { return CommandState::Failed };
        let synchronised = self.motion.lock(|motion| motion.is_synchronised());
        let settings = MotionSettings::new(parameters, H::LOOP_TIMER_COUNTS);
        self.checks.invalid_setting = settings.err().map(|invalid| invalid.idn);
        match (transition::check_cp4(parameters, &capabilities, cyclic, synchronised), settings) {
            (Ok(ready), Ok(settings)) => {
                self.checks.invalid_for_cp4 = InvalidData::default();
                self.motion.lock(|motion| motion.apply_settings(settings));
                self.phases.permit_cp4(ready);
                CommandState::Executed
            }
            (Err(invalid), Ok(_)) if patient && invalid.not_synchronised && invalid.findings().is_empty() => {
                self.checks.waits_for_lock = true;
                self.motion.lock(|motion| motion.wait_for_lock(LOCK_PATIENCE_TICKS));
                CommandState::Executing
            }
            (Err(invalid), _) => {
                self.checks.invalid_for_cp4 = invalid;
                CommandState::Failed
            }
            (Ok(_), Err(_)) => {
                self.checks.invalid_for_cp4 = InvalidData::default();
                CommandState::Failed
            }
        }
    }

    fn reset_class_1(&mut self) -> CommandState {
        let clear = self.motion.lock(|motion| motion.reset_class_1());
        if !clear {
            return CommandState::Failed;
        }
        self.phases.clear_error();
        CommandState::Executed
    }
}

impl<B, H, M> Live for Context<'_, B, M>
where
    B: Bus + Clone,
    H: Hardware,
    M: Mutex<T = Motion<B, H>>,
{
    fn read(&mut self, idn: Idn) -> u32 {
        let interface = self.phases.interface_status();
        let snapshot = self.motion.lock(|motion| {
            if idn == Idn::standard(13) {
                motion.clear_class_3_change();
            }
            motion.snapshot()
        });
        match idn.number() {
            28 => u32::from(snapshot.mst_errors),
            29 => u32::from(snapshot.mdt_errors),
            36 => snapshot.commands.velocity.cast_unsigned(),
            47 => snapshot.commands.position.cast_unsigned(),
            96 => u32::from(u16::from_le_bytes([self.identity.address.get(); 2])),
            134 => u32::from(snapshot.commands.control_word),
            135 => u32::from(snapshot.status_word),
            390 => u32::from(diagnose(&snapshot, self.phases.current(), interface).number),
            _ => match Feedback::from_idn(idn) {
                Some(Feedback::Class1) => u32::from(snapshot.class_1.bits()),
                Some(Feedback::Class3) => u32::from(snapshot.class_3.bits()),
                Some(Feedback::InterfaceStatus) => u32::from(interface.raw_value()),
                Some(Feedback::Velocity) => snapshot.values.velocity.cast_unsigned(),
                Some(Feedback::Position) => snapshot.values.position.cast_unsigned(),
                Some(Feedback::Torque) => snapshot.values.torque_word(),
                Some(Feedback::FollowingDistance) => snapshot.values.following_distance.cast_unsigned(),
                // No warning of class 2 exists yet; parameters and unknown IDNs are not asked for here.
                _ => 0,
            },
        }
    }

    fn read_text(&mut self, idn: Idn, text: &mut String<LIVE_TEXT_BYTES>) {
        let interface = self.phases.interface_status();
        let content = match idn.number() {
            30 => concat!("sercos-drive ", env!("CARGO_PKG_VERSION")),
            95 => {
                let snapshot = self.motion.lock(|motion| motion.snapshot());
                diagnose(&snapshot, self.phases.current(), interface).text
            }
            140 => "STM32F407 + SERCON816",
            143 => "V02.04",
            _ => "",
        };
        // The longest of these is shorter than the buffer; a text that is not would arrive empty.
        let _ = text.push_str(content);
    }

    fn read_list(&mut self, idn: Idn, list: &mut Vec<u16, LIVE_LIST_ENTRIES>) {
        match idn.number() {
            21 => fill(list, self.checks.invalid_for_cp3.idns().map(|idn| idn.0)),
            22 => {
                fill(list, self.checks.invalid_for_cp4.idns().map(|idn| idn.0));
                let setting = self.checks.invalid_setting.map(|idn| idn.0).filter(|idn| !list.contains(idn));
                fill(list, setting.into_iter());
            }
            292 => fill(list, OperationMode::SUPPORTED.into_iter()),
            _ => {}
        }
    }

    fn write(&mut self, idn: Idn, value: u32) {
        if let Some(command) = Command::from_idn(idn) {
            self.motion.lock(|motion| motion.set_command(command, value.cast_signed()));
        }
    }

    fn written(&mut self, idn: Idn, _parameters: &mut Parameters) {
        let needed_for = dictionary::find(idn).map_or(NeededFor::Neither, |block| block.needed_for);
        let checked = match self.phases.current() {
            Phase::Cp2 => needed_for == NeededFor::Cp3,
            Phase::Cp3 => needed_for == NeededFor::Cp4,
            _ => false,
        };
        if checked {
            self.phases.withdraw();
        }
        *self.settings_changed = true;
    }

    fn command(
        &mut self,
        idn: Idn,
        action: CommandAction,
        _parameters: &mut Parameters,
    ) -> Result<CommandState, ServiceError> {
        match (idn, action) {
            (Idn::RESET_CLASS_1_DIAGNOSTIC, CommandAction::Start) => Ok(self.reset_class_1()),
            (Idn::CP3_TRANSITION_CHECK | Idn::CP4_TRANSITION_CHECK, CommandAction::Start) => {
                self.checks.started = Some(idn);
                Ok(CommandState::Executing)
            }
            (Idn::CP3_TRANSITION_CHECK | Idn::CP4_TRANSITION_CHECK, CommandAction::Cancel) => {
                self.checks.started = None;
                self.checks.waits_for_lock = false;
                Ok(CommandState::Interrupted)
            }
            _ => Err(ServiceError::CommandNotInterruptible),
        }
    }

    fn phase(&self) -> Phase {
        self.phases.current()
    }
}

/// As many entries as there is room for; `extend` would panic on one more.
fn fill(list: &mut Vec<u16, LIVE_LIST_ENTRIES>, entries: impl Iterator<Item = u16>) {
    for entry in entries {
        if list.push(entry).is_err() {
            break;
        }
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
/// A t3 or t4 at the very end of the cycle (legal: t3 <= tScyc) is set one microsecond earlier, because the timers start
/// again with the MST that falls on the same instant.
fn chip_configuration(cyclic: &CyclicConfiguration) -> sercon816::CyclicConfiguration {
    let last = cyclic.cycle_us.saturating_sub(1);
    sercon816::CyclicConfiguration {
        cycle_us: cyclic.cycle_us,
        t1_us: cyclic.t1_us,
        t2_us: cyclic.t2_us,
        t3_us: cyclic.t3_us.min(last),
        t4_us: cyclic.t4_us.min(last),
        at_words: cyclic.at_data_bytes() / 2,
        mdt_words: cyclic.mdt_data_bytes() / 2,
        mdt_length_words: cyclic.mdt_length_bytes / 2,
        record_position_words: cyclic.record_position_bytes.saturating_sub(1) / 2,
    }
}
