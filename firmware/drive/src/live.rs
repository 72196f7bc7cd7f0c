//! The data blocks and procedure commands that live in the drive, as the service channel asks for them.

use core::fmt::Write;

use heapless::{String, Vec};
use rtic_core::Mutex;
use sercon816::{Bus, Slave};
use sercos::command::{CommandAction, CommandState};
use sercos::data_block::{DataBlock, Location, NeededFor};
use sercos::parameters::Parameters;
use sercos::service::{LIVE_LIST_ENTRIES, LIVE_LONG_ENTRIES, LIVE_TEXT_BYTES, Live, ServiceError};
use sercos::transition::{self, Capabilities, CyclicConfiguration, Invalid, InvalidData, Reason};
use sercos::{Idn, Phase, PhaseMachine, dictionary};
use servo::motor::{BoardKind, Facts};
use servo::probe::ProbeSettings;

use crate::access::Access;
use crate::bits::{Source, enable_bit};
use crate::commissioning::{self, COMPUTE_GAINS, Commissioning, Finding as CommissioningFinding, is_identification};
use crate::communication::seconds;
use crate::crash::LastCrash;
use crate::diagnosis::{Diagnosis, diagnose};
use crate::error_memory::ErrorMemory;
use crate::hardware::{Hardware, LOOP_PERIOD_MICROSECONDS};
use crate::identity::Identity;
use crate::limits::Limit;
use crate::motion::{HomingFailure, Motion, MotorValue};
use crate::oscilloscope::{self, Configuration};
use crate::record::{Command, Feedback, Records};
use crate::rescaling::Rescaling;
use crate::settings::{CycleSettings, Direction, InvalidSetting, MotionSettings, OperationMode, homing};

/// So long S-0-0128 waits for the loops to lock to the ring: 200 ms in loop ticks, twice what a lock takes.
const LOCK_PATIENCE_TICKS: u16 = 400;

/// Period of the current loop in 0.1 us.
const fn current_loop_period(facts: &Facts) -> u16 {
    10 * LOOP_PERIOD_MICROSECONDS / facts.frequency.cycles_per_tick() as u16
}

const CLASS_2: Idn = Idn::standard(12);
const CLASS_3: Idn = Idn::standard(13);
const INTERFACE_STATUS: Idn = Idn::standard(14);
const PARK_AXIS: Idn = Idn::standard(139);
const REFERENCE_DISTANCE: Idn = Idn::standard(52);
const HOMING_PARAMETER: Idn = Idn::standard(147);
const HOMING: Idn = Idn::standard(148);
const PASSWORD: Idn = Idn::standard(267);
pub(crate) const POSITIVE_STOP: Idn = Idn::standard(149);
const PROBE_CONTROL: Idn = Idn::standard(169);
const PROBING: Idn = Idn::standard(170);
const CANCEL_REFERENCE: Idn = Idn::standard(191);
const LOAD_DEFAULTS: Idn = Idn::standard(262);
const CHECKSUM: Idn = Idn::standard(326);
const DIAGNOSTIC_NUMBER: Idn = Idn::standard(390);
const COMMAND_VALUE_MODE: Idn = Idn::standard(393);
const SET_ABSOLUTE_POSITION: Idn = Idn::standard(447);
const ERROR_TIMES: Idn = Idn::product(4);
const OPERATING_TIME: Idn = Idn::product(6);
const RESET_CAUSE: Idn = Idn::product(9);
const CRASH_RECORD: Idn = Idn::product(13);
const APPLICATION_WORD: Idn = Idn::product(19);
const COMMUTATION_ANGLE: Idn = Idn::product(118);
const PHASE_ERROR_HISTOGRAM: Idn = Idn::product(152);

/// What the transition checks have found and prepared.
#[derive(Debug, Default)]
pub(crate) struct Checks {
    /// Of the last S-0-0127.
    pub(crate) cyclic: Option<CyclicConfiguration>,
    /// S-0-0021.
    pub(crate) invalid_for_cp3: InvalidData,
    /// S-0-0022.
    pub(crate) invalid_for_cp4: InvalidData,
    /// S-0-0023: the operation mode parameter that CP4 asked for in vain.
    pub(crate) missing_mode: Option<Idn>,
    /// P-0-0003: what the last check that failed found first, or why a write was refused.
    pub(crate) finding: Option<Finding>,
    /// S-0-0128 waits for the loop clock.
    pub(crate) waits_for_lock: bool,
    /// A check or computation that was started and is carried out once the step that started it is released.
    pub(crate) started: Option<Idn>,
}

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
    /// S-0-0149 has failed: the torque went.
    PositiveStop,
}

/// What a service step works with: the drive without its service server and parameters.
pub(crate) struct Context<'a, B, M> {
    pub(crate) motion: &'a mut M,
    pub(crate) slave: &'a mut Slave<B>,
    pub(crate) phases: &'a mut PhaseMachine,
    pub(crate) checks: &'a mut Checks,
    pub(crate) commissioning: &'a mut Commissioning,
    pub(crate) identity: &'a Identity,
    pub(crate) access: &'a mut Access,
    pub(crate) rescaling: &'a mut Rescaling,
    pub(crate) errors: &'a ErrorMemory,
    /// P-0-0012, P-0-0013.
    pub(crate) crash: Option<&'a LastCrash>,
    /// A parameter of the loops has changed before they have begun to work with it; they get it once the step is released.
    pub(crate) settings_changed: bool,
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

    /// Carries out the check or computation that a step has started; `None` if there is none.
    ///
    /// It takes some 300 us, which no step of the service channel may.
    pub(crate) fn carry_out(&mut self, parameters: &mut Parameters) -> Option<(Idn, CommandState)> {
        let idn = self.checks.started.take()?;
        let state = match idn {
            Idn::CP3_TRANSITION_CHECK => self.check_cp3(parameters),
            Idn::CP4_TRANSITION_CHECK => self.check_cp4(parameters, true),
            COMPUTE_GAINS => {
                let result = commissioning::compute_gains(parameters, <H::Board>::FACTS.frequency, loops_accept::<H>);
                self.found(result)
            }
            _ => match self.start_identification(idn, parameters) {
                Ok(()) => CommandState::Executing,
                failure => self.found(failure),
            },
        };
        Some((idn, state))
    }

    fn start_identification(&mut self, idn: Idn, parameters: &Parameters) -> Result<(), CommissioningFinding> {
        let plan = commissioning::plan(idn, parameters, <H::Board>::FACTS.frequency)?;
        if !self.motion.lock(|motion| motion.start_identification(&plan)) {
            return Err(CommissioningFinding::Interrupted);
        }
        self.commissioning.identifying = Some(idn);
        Ok(())
    }

    /// Takes over what an identification has measured, if one has ended.
    pub(crate) fn conclude_identification(&mut self, parameters: &mut Parameters) -> Option<(Idn, CommandState)> {
        let outcome = self.motion.lock(Motion::take_identified)?;
        let idn = self.commissioning.identifying.take()?;
        let result = commissioning::take_over(outcome, parameters, loops_accept::<H>);
        Some((idn, self.found(result)))
    }

    /// Gives the loops what has changed before they have begun to work with it.
    pub(crate) fn settle(&mut self, parameters: &mut Parameters) {
        if core::mem::take(&mut self.settings_changed) {
            self.rescaling.refresh(parameters);
            // What does not go together yet waits for the rest; S-0-0128 finds what is left of it.
            match MotionSettings::new(parameters, &<H::Board>::FACTS) {
                Ok(settings) => self.motion.lock(|motion| motion.apply_settings(settings)),
                Err(_) => debug_assert!(!self.loops_work(), "what the loops work with was checked"),
            }
        }
    }

    fn found(&mut self, result: Result<(), CommissioningFinding>) -> CommandState {
        self.commissioning.finding = result.err();
        if result.is_ok() {
            self.settings_changed = true;
            CommandState::Executed
        } else {
            CommandState::Failed
        }
    }

    fn check_cp3(&mut self, parameters: &Parameters) -> CommandState {
        self.phases.withdraw();
        self.checks.cyclic = None;
        let (cyclic, ready) = match transition::check_cp3(parameters, &self.capabilities()) {
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
        let mdt = cyclic.mdt.iter().map(|datum| datum.idn);
        let at = cyclic.at.iter().map(|datum| datum.idn);
        let Some(records) = Records::new(mdt, at) else { return CommandState::Failed };
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
        let capabilities = self.capabilities();
        let Some(cyclic) = &self.checks.cyclic else { return CommandState::Failed };
        let misfits = self.rescaling.misfits(parameters);
        let synchronised = self.motion.lock(|motion| motion.is_synchronised());
        let settings = MotionSettings::new(parameters, &<H::Board>::FACTS);
        let mut invalid = match (transition::check_cp4(parameters, &capabilities, cyclic, synchronised), settings) {
            (Ok(ready), Ok(settings)) if misfits.is_empty() => {
                self.rescaling.take_over(parameters);
                self.checks.invalid_for_cp4 = InvalidData::default();
                self.checks.finding = None;
                self.motion.lock(|motion| motion.apply_settings(settings));
                self.phases.permit_cp4(ready);
                return CommandState::Executed;
            }
            (Ok(_), _) => InvalidData::default(),
            (Err(invalid), _) => invalid,
        };
        for idn in &misfits {
            invalid.add(*idn, Reason::OldScaling);
        }
        if let Err(setting) = settings {
            invalid.add(setting.idn, reason_of(&setting));
        } else if patient && invalid.not_synchronised && invalid.findings().is_empty() {
            self.checks.waits_for_lock = true;
            self.motion.lock(|motion| motion.wait_for_lock(LOCK_PATIENCE_TICKS));
            return CommandState::Executing;
        }
        self.checks.finding = Some(match (invalid.findings().first().copied(), settings) {
            (Some(first), Err(setting)) if first.idn == setting.idn && first.reason == Reason::NotTogether => {
                Finding::Settings(setting)
            }
            (Some(first), _) => Finding::DataBlock(first),
            (None, _) => Finding::NotSynchronised,
        });
        self.checks.invalid_for_cp4 = invalid;
        CommandState::Failed
    }

    /// What S-0-0128 would find first, if it was given now.
    fn first_invalid(&self, parameters: &Parameters) -> Option<Invalid> {
        let cyclic = self.checks.cyclic.as_ref()?;
        let checked = transition::check_cp4(parameters, &self.capabilities(), cyclic, true);
        checked.err().and_then(|invalid| invalid.findings().first().copied())
    }

    fn reset_class_1(&mut self) -> CommandState {
        let clear = self.motion.lock(|motion| motion.reset_class_1());
        if !clear {
            return CommandState::Failed;
        }
        self.phases.clear_error();
        self.checks.missing_mode = None;
        CommandState::Executed
    }

    /// S-0-0148: with neither switch nor marker and no way to go it is done at once, also without torque; else the drive moves.
    fn home(&mut self, parameters: &Parameters) -> Result<CommandState, ServiceError> {
        const NO_SWITCH_NO_MARKER: u16 = 1 << 5 | 1 << 6;
        const STOP_AT_REFERENCE: u16 = 1 << 7;
        let settings = MotionSettings::new(parameters, &<H::Board>::FACTS)
            .and_then(|settings| homing(parameters, &settings))
            .map_err(|setting| {
                self.checks.finding = Some(Finding::Settings(setting));
                ServiceError::CommandInvalidParameters
            })?;
        let way = parameters.get_word(HOMING_PARAMETER);
        let at_once = way & (NO_SWITCH_NO_MARKER | STOP_AT_REFERENCE) == NO_SWITCH_NO_MARKER;
        let reference = reference_distance(parameters);
        let state = self.motion.lock(|motion| {
            if motion.is_identifying() {
                return Err(ServiceError::CommandNotExecutableNow);
            }
            if at_once {
                if !motion.is_standing() {
                    return Err(ServiceError::CommandNotExecutableNow);
                }
                motion.hold_for_homing(true);
                motion.set_reference(reference);
                return Ok(CommandState::Executed);
            }
            let (settings, limits) = settings;
            if motion.start_homing(settings, limits) {
                Ok(CommandState::Executing)
            } else {
                Err(ServiceError::CommandNotExecutableNow)
            }
        })?;
        self.checks.finding = None;
        Ok(state)
    }

    /// S-0-0170 with S-0-0169.
    fn start_probing(&mut self, parameters: &Parameters) -> Result<CommandState, ServiceError> {
        let settings = ProbeSettings::new(parameters.get_word(PROBE_CONTROL))
            .map_err(|_| ServiceError::CommandInvalidParameters)?;
        self.motion.lock(|motion| motion.set_probing(Some(settings)));
        // It goes on until it is cancelled (sercos2.md 6.4).
        Ok(CommandState::Executing)
    }

    /// S-0-0447.
    fn set_absolute_position(&mut self, parameters: &Parameters) -> Result<CommandState, ServiceError> {
        let reference = reference_distance(parameters);
        self.without_torque(|context| context.motion.lock(|motion| motion.set_reference(reference)))
    }

    /// S-0-0262. In CP4 it would change scaling, modes and motor, which the phase protects; and to load some defaults only would be a drive
    /// that nobody has asked for.
    fn load_defaults(&mut self, parameters: &mut Parameters) -> Result<CommandState, ServiceError> {
        self.unlocked()?;
        if self.phases.current() == Phase::Cp4 {
            self.checks.finding = Some(Finding::LoadInOperation);
            return Err(ServiceError::CommandNotExecutableNow);
        }
        self.without_torque(|context| {
            parameters.load_defaults();
            context.rescaling.defaults_loaded(parameters);
            if context.phases.current() == Phase::Cp3 {
                context.phases.withdraw();
            }
            context.checks.finding = None;
            context.settings_changed = true;
        })
    }

    /// The loops work with the parameters as they are: S-0-0128 has passed, and nothing that it looked at was written since. Before that a
    /// master writes in any order, and S-0-0128 finds what does not go together.
    fn loops_work(&self) -> bool {
        match self.phases.current() {
            Phase::Cp4 => true,
            Phase::Cp3 => self.phases.is_permitted(),
            _ => false,
        }
    }

    fn unlocked(&self) -> Result<(), ServiceError> {
        if self.access.is_locked() { Err(ServiceError::ProtectedByPassword) } else { Ok(()) }
    }

    fn without_torque(&mut self, act: impl FnOnce(&mut Self)) -> Result<CommandState, ServiceError> {
        if self.motion.lock(|motion| motion.has_torque()) {
            return Err(ServiceError::CommandNotExecutableNow);
        }
        act(self);
        Ok(CommandState::Executed)
    }

    fn diagnosis(&mut self) -> &'static Diagnosis {
        let (phase, interface) = (self.phases.current(), self.phases.interface_status());
        diagnose(&self.motion.lock(|motion| motion.circumstances(phase, interface)))
    }
}

impl<B, H, M> Live for Context<'_, B, M>
where
    B: Bus + Clone,
    H: Hardware,
    M: Mutex<T = Motion<B, H>>,
{
    fn read(&mut self, idn: Idn, parameters: &Parameters) -> u64 {
        match idn {
            OPERATING_TIME => return seconds(self.motion.lock(|motion| motion.operating_time())).into(),
            RESET_CAUSE => return self.motion.lock(|motion| motion.reset_cause()).code().into(),
            INTERFACE_STATUS => return self.phases.interface_status().raw_value().into(),
            CHECKSUM => return parameters.checksum().into(),
            oscilloscope::STATE => return self.motion.lock(|motion| motion.oscilloscope().state()).into(),
            oscilloscope::WINDOW => return self.motion.lock(|motion| motion.oscilloscope().window()).into(),
            oscilloscope::INTERVAL => {
                return self
                    .motion
                    .lock(|motion| motion.oscilloscope().interval(const { current_loop_period(&<H::Board>::FACTS) }))
                    .into();
            }
            _ => {}
        }
        if let Some(value) = MotorValue::from_idn(idn) {
            return self.motion.lock(|motion| motion.motor_value(value)).into();
        }
        if let Some(source) = Source::from_idn(idn) {
            return self.motion.lock(|motion| {
                let value = motion.source_value(source);
                match idn {
                    CLASS_2 => motion.clear_class_2_change(),
                    CLASS_3 => motion.clear_class_3_change(),
                    _ => {}
                }
                value.into()
            });
        }
        if idn == DIAGNOSTIC_NUMBER {
            return self.diagnosis().number.into();
        }
        if let Some(feedback) = Feedback::from_idn(idn) {
            return self.motion.lock(|motion| motion.feedback(feedback)).into();
        }
        let snapshot = self.motion.lock(|motion| motion.snapshot());
        let commands = snapshot.commands;
        match idn.number() {
            28 => u64::from(snapshot.mst_errors),
            29 => u64::from(snapshot.mdt_errors),
            36 => commands.velocity.cast_unsigned().into(),
            37 => commands.additive_velocity.cast_unsigned().into(),
            47 => commands.position.cast_unsigned().into(),
            48 => commands.additive_position.cast_unsigned().into(),
            80 => commands.torque.cast_unsigned().into(),
            81 => commands.additive_torque.cast_unsigned().into(),
            96 => u64::from(u16::from_le_bytes([self.identity.address.get(); 2])),
            145 => commands.signal_control.into(),
            258 => commands.target_position.cast_unsigned().into(),
            282 => commands.positioning_value.cast_unsigned().into(),
            304 => u64::from(snapshot.status_word >> 6 & 1),
            306 => u64::from(snapshot.status_word >> 7 & 1),
            346 => commands.positioning_control.into(),
            // Parameters and unknown IDNs are not asked for here.
            _ => 0,
        }
    }

    fn cyclic(&mut self, idn: Idn) -> Option<u64> {
        let limit = Limit::from_idn(idn)?;
        self.motion.lock(|motion| motion.cyclic_limit(limit)).map(u64::from)
    }

    fn read_text(
        &mut self,
        idn: Idn,
        parameters: &Parameters,
        text: &mut String<LIVE_TEXT_BYTES>,
    ) -> Option<&'static str> {
        const GERMAN: u32 = 0;
        match (idn.is_product(), idn.number()) {
            (false, 30) => Some(concat!("sercos-drive ", env!("CARGO_PKG_VERSION"))),
            (false, 95) if parameters.get(Idn::standard(265)) == GERMAN => Some(self.diagnosis().german),
            (false, 95) => Some(self.diagnosis().text),
            (false, 140) => Some("STM32F407 + SERCON816"),
            (false, 143) => Some("V02.04"),
            (false, 267) => Some(self.access.shown()),
            (true, 3) => {
                // Longer than the longest finding; a test looks.
                let _ = match self.checks.finding {
                    None => Ok(()),
                    Some(Finding::DataBlock(invalid) | Finding::WriteOf(invalid)) => write!(text, "{invalid}"),
                    Some(Finding::Settings(setting) | Finding::Write(setting)) => write!(text, "{setting}"),
                    Some(Finding::Value(idn, taken)) => write!(text, "{idn}: {taken}"),
                    Some(Finding::LoadInOperation) => write!(text, "S-0-0262 changes what is protected in CP4"),
                    Some(Finding::NotSynchronised) => write!(text, "the loops have not locked to the ring"),
                    Some(Finding::Homing(HomingFailure::Way(error))) => write!(text, "{error}"),
                    Some(Finding::Homing(HomingFailure::Torque)) => write!(text, "the torque went while homing"),
                    Some(Finding::PositiveStop) => write!(text, "the torque went before the stop was reached"),
                    Some(Finding::Controller) => write!(text, "the ring controller refuses the configuration"),
                };
                None
            }
            (true, 12) => {
                // Longer than the longest crash; a test looks.
                let _ = self.crash.map_or(Ok(()), |(record, task)| write!(text, "{}", record.told_of(task)));
                None
            }
            (true, 10) => Some(self.diagnosis().cause),
            (true, 11) => Some(self.diagnosis().remedy),
            (true, 228) => {
                // Longer than the longest finding; a test looks.
                let _ = self.commissioning.finding.map_or(Ok(()), |finding| write!(text, "{finding}"));
                None
            }
            _ => None,
        }
    }

    fn read_list(&mut self, idn: Idn, list: &mut Vec<u16, LIVE_LIST_ENTRIES>) {
        match (idn.is_product(), idn.number()) {
            (false, 21) => fill(list, self.checks.invalid_for_cp3.idns().map(|idn| idn.0)),
            (false, 22) => fill(list, self.checks.invalid_for_cp4.idns().map(|idn| idn.0)),
            (false, 23) => fill(list, self.checks.missing_mode.into_iter().map(|idn| idn.0)),
            (false, 266) => fill(list, [0, 1].into_iter()),
            (false, 292) => fill(list, OperationMode::SUPPORTED.into_iter()),
            (false, 375) => fill(list, self.errors.newest_first().map(|error| error.number)),
            (true, 1) => fill(list, self.checks.invalid_for_cp3.codes()),
            (true, 2) => fill(list, self.checks.invalid_for_cp4.codes()),
            _ => {}
        }
    }

    fn read_longs(&mut self, idn: Idn, list: &mut Vec<u32, LIVE_LONG_ENTRIES>) {
        match idn {
            ERROR_TIMES => fill(list, self.errors.newest_first().map(|error| error.seconds)),
            CRASH_RECORD => fill(list, self.crash.iter().flat_map(|(record, _)| record.shown())),
            PHASE_ERROR_HISTOGRAM => {
                let histogram = self.motion.lock(|motion| motion.phase_error_histogram());
                fill(list, histogram.into_iter());
            }
            _ => {
                if let Some(channel) = oscilloscope::POINTS.iter().position(|&points| points == idn) {
                    self.motion.lock(|motion| fill(list, motion.oscilloscope().points(channel)));
                }
            }
        }
    }

    fn write(&mut self, idn: Idn, value: u64) {
        let raw = (value & 0xFFFF_FFFF) as u32;
        if let Some(command) = Command::from_idn(idn) {
            self.motion.lock(|motion| motion.set_command(command, raw));
        } else if let Some(bit) = enable_bit(idn) {
            self.motion.lock(|motion| motion.set_enable(bit, raw & 1 != 0));
        } else if idn == COMMUTATION_ANGLE {
            self.motion.lock(|motion| motion.set_commutation_angle(raw.cast_signed()));
        } else if idn == APPLICATION_WORD {
            self.motion.lock(|motion| motion.set_application_word((raw & 0xFFFF) as u16));
        } else if idn == oscilloscope::WINDOW {
            self.motion.lock(|motion| motion.oscilloscope().set_window((raw & 0xFFFF) as u16));
        }
    }

    fn write_text(&mut self, idn: Idn, text: &[u8]) -> Result<(), ServiceError> {
        if idn != PASSWORD {
            return Err(ServiceError::IdnNotAvailable);
        }
        self.access.write(text)?;
        let locked = self.access.is_locked();
        self.motion.lock(|motion| motion.show_lock(locked));
        Ok(())
    }

    fn written(&mut self, idn: Idn, parameters: &mut Parameters) -> Result<(), ServiceError> {
        if idn == oscilloscope::CONTROL {
            match (parameters.get_word(idn), scope_configuration(parameters)) {
                (1, Ok(configuration)) => self.motion.lock(|motion| motion.oscilloscope().arm(configuration)),
                _ => self.motion.lock(|motion| motion.oscilloscope().stop()),
            }
        }
        let block = dictionary::find(idn).filter(|block| block.location == Location::Parameter);
        let Some(block) = block.filter(|_| !oscilloscope::is_own(idn)) else {
            // The loops know nothing of them.
            return Ok(());
        };
        let needed_for = block.needed_for;
        let checked = match self.phases.current() {
            Phase::Cp2 => needed_for == NeededFor::Cp3,
            Phase::Cp3 => needed_for == NeededFor::Cp4,
            _ => false,
        };
        if checked {
            self.phases.withdraw();
        }
        if !self.loops_work() {
            self.settings_changed = true;
        } else {
            // Some 200 us, which the step is held for: its answer depends on it, and what is acknowledged is in effect.
            let settings = match (MotionSettings::new(parameters, &<H::Board>::FACTS), self.first_invalid(parameters)) {
                (Ok(settings), None) => settings,
                (Err(setting), _) => {
                    self.checks.finding = Some(Finding::Write(setting));
                    return Err(ServiceError::InvalidData);
                }
                (_, Some(invalid)) => {
                    self.checks.finding = Some(Finding::WriteOf(invalid));
                    return Err(ServiceError::InvalidData);
                }
            };
            self.motion.lock(|motion| motion.apply_settings(settings));
        }
        if matches!(self.checks.finding, Some(Finding::Write(_) | Finding::WriteOf(_) | Finding::Value(..))) {
            self.checks.finding = None;
        }
        Ok(())
    }

    fn not_taken(&mut self, block: &DataBlock) {
        self.checks.finding = Some(Finding::Value(block.idn, what_it_takes(block)));
    }

    fn command(
        &mut self,
        idn: Idn,
        action: CommandAction,
        parameters: &mut Parameters,
    ) -> Result<CommandState, ServiceError> {
        const START: CommandAction = CommandAction::Start;
        match (idn, action) {
            (Idn::RESET_CLASS_1_DIAGNOSTIC, START) => Ok(self.reset_class_1()),
            (Idn::CP3_TRANSITION_CHECK | Idn::CP4_TRANSITION_CHECK, START) => {
                self.checks.started = Some(idn);
                Ok(CommandState::Executing)
            }
            // The wait for the loops' lock can be given up and taken up again; the check itself is over in an instant.
            (Idn::CP3_TRANSITION_CHECK | Idn::CP4_TRANSITION_CHECK, _) => {
                self.checks.started = None;
                self.checks.waits_for_lock = false;
                Ok(CommandState::Interrupted)
            }
            (COMPUTE_GAINS, START) => {
                self.unlocked()?;
                self.checks.started = Some(idn);
                Ok(CommandState::Executing)
            }
            (_, START) if is_identification(idn) => {
                self.unlocked()?;
                if !self.motion.lock(|motion| motion.may_identify()) {
                    return Err(ServiceError::CommandNotExecutableNow);
                }
                self.checks.started = Some(idn);
                Ok(CommandState::Executing)
            }
            (_, CommandAction::Cancel) if self.commissioning.identifying == Some(idn) => {
                self.commissioning.identifying = None;
                self.motion.lock(|motion| motion.cancel_identification());
                Ok(CommandState::Executed)
            }
            (PARK_AXIS, CommandAction::Cancel) => {
                self.motion.lock(|motion| motion.park(false));
                Ok(CommandState::Executed)
            }
            (HOMING, CommandAction::Cancel) => {
                self.motion.lock(|motion| motion.hold_for_homing(false));
                Ok(CommandState::Executed)
            }
            (POSITIVE_STOP, CommandAction::Cancel) => {
                self.motion.lock(Motion::cancel_positive_stop);
                Ok(CommandState::Executed)
            }
            (PROBING, CommandAction::Cancel) => {
                self.motion.lock(|motion| motion.set_probing(None));
                Ok(CommandState::Executed)
            }
            // Over in an instant: there is nothing left to undo.
            (_, CommandAction::Cancel) => Ok(CommandState::Executed),
            (PARK_AXIS, START) => self.without_torque(|context| context.motion.lock(|motion| motion.park(true))),
            (HOMING, START) => self.home(parameters),
            (POSITIVE_STOP, START) => {
                let started = self.motion.lock(Motion::start_positive_stop);
                if started { Ok(CommandState::Executing) } else { Err(ServiceError::CommandNotExecutableNow) }
            }
            (PROBING, START) => self.start_probing(parameters),
            (CANCEL_REFERENCE, START) => {
                self.motion.lock(|motion| motion.cancel_reference());
                Ok(CommandState::Executed)
            }
            (LOAD_DEFAULTS, START) => self.load_defaults(parameters),
            (SET_ABSOLUTE_POSITION, START) => self.set_absolute_position(parameters),
            _ => Err(ServiceError::CommandNotInterruptible),
        }
    }

    fn refuses(&mut self, idn: Idn, value: u64, parameters: &Parameters) -> Option<ServiceError> {
        if idn == oscilloscope::CONTROL && value == 1 {
            return scope_configuration(parameters).err();
        }
        if let Some(error) = oscilloscope::refuses_setting(idn, value, parameters) {
            return Some(error);
        }
        // What somebody else sets would not last: only what is there already is taken.
        if let Some((mask, wanted)) = controlled_bits(idn, value) {
            let (bits, owned) = self.motion.lock(|motion| motion.controlled_bits());
            return ((bits ^ wanted) & mask & owned != 0).then_some(ServiceError::ProtectedBySettings);
        }
        if idn == COMMAND_VALUE_MODE && Direction::from_parameter(value as u16).is_none() {
            return Some(ServiceError::InvalidData);
        }
        // An angle that is taken over under torque would throw the motor to it.
        if idn == COMMUTATION_ANGLE {
            let torque = self.motion.lock(|motion| motion.has_torque());
            return torque.then_some(ServiceError::ProtectedBySettings);
        }
        // The reference stands on these two until the command is cancelled.
        let belongs_to_homing = matches!(idn, HOMING_PARAMETER | REFERENCE_DISTANCE);
        let refused = belongs_to_homing && self.motion.lock(|motion| motion.is_homing());
        refused.then_some(ServiceError::ProtectedBySettings)
    }

    fn is_locked(&self) -> bool {
        self.access.is_locked()
    }

    fn phase(&self) -> Phase {
        self.phases.current()
    }
}

/// What a data block takes that has refused a value, for P-0-0003.
fn what_it_takes(block: &DataBlock) -> &'static str {
    match (block.location, block.fixed_bytes()) {
        (Location::Command, _) => "a command takes 3 to start and 0 to cancel",
        (_, None) if block.idn == PASSWORD => "no password, or not the one in force",
        (_, None) if block.is_text() => "a text that is too long, too short or none",
        (_, None) => "a list that is too long, or an entry that it cannot have",
        _ => "a value that it does not have",
    }
}

/// As many entries as there is room for; `extend` would panic on one more.
fn fill<T, const N: usize>(list: &mut Vec<T, N>, entries: impl Iterator<Item = T>) {
    for entry in entries {
        if list.push(entry).is_err() {
            break;
        }
    }
}

fn scope_configuration(parameters: &Parameters) -> Result<Configuration, ServiceError> {
    Configuration::new(|idn| parameters.get(idn), parameters).map_err(|invalid| invalid.service_error())
}

/// What S-0-0128 tells of a parameter that the loops cannot work with.
const fn reason_of(setting: &InvalidSetting) -> Reason {
    match setting.reason {
        Some(_) => Reason::NotTogether,
        None => Reason::NotSupported,
    }
}

/// Whether the loops can work with the parameters.
fn loops_accept<H: Hardware>(parameters: &Parameters) -> Result<(), InvalidSetting> {
    MotionSettings::new(parameters, &<H::Board>::FACTS).map(|_| ())
}

/// For a data block of single bits that the control sets: where they lie, and how `value` wants them.
fn controlled_bits(idn: Idn, value: u64) -> Option<(u32, u32)> {
    if idn == APPLICATION_WORD {
        return Some((0xFFFF, (value & 0xFFFF) as u32));
    }
    enable_bit(idn).map(|bit| (bit, if value & 1 != 0 { bit } else { 0 }))
}

/// S-0-0052, in the weight of the position data.
fn reference_distance(parameters: &Parameters) -> i32 {
    parameters.get(REFERENCE_DISTANCE).cast_signed()
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

#[cfg(test)]
mod effects;
#[cfg(test)]
mod rig;
#[cfg(test)]
pub(crate) use rig::FACTS;
#[cfg(test)]
mod tests;
