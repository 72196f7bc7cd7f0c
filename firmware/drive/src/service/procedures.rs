//! Procedure commands: what each does when it is started, interrupted and cancelled.

use rtic_core::Mutex;
use sercon816::Bus;
use sercos::command::{CommandAction, CommandState};
use sercos::error::ServiceError;
use sercos::parameters::Parameters;
use sercos::{Idn, Phase};
use servo::motor::BoardKind;
use servo::probe::ProbeSettings;

use super::commissioning::{self, Finding as CommissioningFinding};
use super::context::Context;
use super::finding::Finding;
use super::loops;
use crate::dictionary::procedures::Procedure;
use crate::hardware::Hardware;
use crate::motion::Motion;
use crate::remembering::keeping::{MemoryFailure, Selected};
use crate::settings::homing;

/// S-0-0147.
pub(super) const HOMING_PARAMETER: Idn = Idn::standard(147);
/// S-0-0052.
pub(super) const REFERENCE_DISTANCE: Idn = Idn::standard(52);
/// S-0-0169.
pub(super) const PROBE_CONTROL: Idn = Idn::standard(169);

impl<B, H, M> Context<'_, B, M>
where
    B: Bus + Clone,
    H: Hardware,
    M: Mutex<T = Motion<B, H>>,
{
    /// Does what the master wants of a procedure command.
    ///
    /// # Errors
    /// The master's step is refused, and the state of the command stays.
    pub(super) fn procedure(
        &mut self,
        procedure: Procedure,
        action: CommandAction,
        parameters: &mut Parameters,
    ) -> Result<CommandState, ServiceError> {
        match action {
            CommandAction::Start => self.start(procedure, parameters),
            CommandAction::Cancel => Ok(self.cancel(procedure)),
            CommandAction::Interrupt => self.interrupt(procedure),
        }
    }

    fn start(&mut self, procedure: Procedure, parameters: &mut Parameters) -> Result<CommandState, ServiceError> {
        match procedure {
            Procedure::ResetClass1 => Ok(self.reset_class_1()),
            Procedure::CheckForCp3 | Procedure::CheckForCp4 => {
                self.checks.started = Some(procedure);
                Ok(CommandState::Executing)
            }
            Procedure::ComputeGains => {
                self.unlocked()?;
                self.checks.started = Some(procedure);
                Ok(CommandState::Executing)
            }
            Procedure::IdentifyWinding | Procedure::IdentifyFlux | Procedure::IdentifyInertia => {
                self.unlocked()?;
                if !self.motion.lock(|motion| motion.may_identify()) {
                    return Err(ServiceError::CommandNotExecutableNow);
                }
                self.checks.started = Some(procedure);
                Ok(CommandState::Executing)
            }
            Procedure::ParkAxis => self.without_torque(|context| context.motion.lock(|motion| motion.park(true))),
            Procedure::Homing => self.home(parameters),
            Procedure::PositiveStop => {
                let started = self.motion.lock(Motion::start_positive_stop);
                if started { Ok(CommandState::Executing) } else { Err(ServiceError::CommandNotExecutableNow) }
            }
            Procedure::Probing => self.start_probing(parameters),
            Procedure::CancelReference => {
                self.motion.lock(|motion| motion.cancel_reference());
                Ok(CommandState::Executed)
            }
            Procedure::LoadDefaults => self.load_defaults(parameters),
            Procedure::LoadParameters => self.load_parameters(),
            Procedure::SaveParameters => self.save_parameters(procedure),
            Procedure::SaveSelected => {
                let list = parameters.list(Idn::SELECTED_BACKUP);
                if list.is_empty() {
                    self.checks.finding = Some(Finding::NothingSelected);
                    return Err(ServiceError::CommandInvalidParameters);
                }
                let selected = Selected::from_slice(list).map_err(|_| ServiceError::CommandInvalidParameters)?;
                let state = self.save_parameters(procedure)?;
                // It may be written anew before the flash takes it.
                self.keeping.selected = selected;
                Ok(state)
            }
            Procedure::SetAbsolutePosition => self.set_absolute_position(parameters),
        }
    }

    fn cancel(&mut self, procedure: Procedure) -> CommandState {
        match procedure {
            Procedure::CheckForCp3 | Procedure::CheckForCp4 => return self.give_up_check(),
            Procedure::IdentifyWinding | Procedure::IdentifyFlux | Procedure::IdentifyInertia
                if self.commissioning.identifying == Some(procedure) =>
            {
                self.commissioning.identifying = None;
                self.motion.lock(|motion| motion.cancel_identification());
            }
            Procedure::ParkAxis => self.motion.lock(|motion| motion.park(false)),
            Procedure::Homing => self.motion.lock(|motion| motion.hold_for_homing(false)),
            Procedure::PositiveStop => self.motion.lock(Motion::cancel_positive_stop),
            Procedure::Probing => self.motion.lock(|motion| motion.set_probing(None)),
            Procedure::LoadParameters | Procedure::SaveParameters | Procedure::SaveSelected => {
                self.keeping.cancel(procedure);
            }
            // Over in an instant, or not the identification that runs: there is nothing left to undo.
            _ => {}
        }
        CommandState::Executed
    }

    fn interrupt(&mut self, procedure: Procedure) -> Result<CommandState, ServiceError> {
        match procedure {
            Procedure::CheckForCp3 | Procedure::CheckForCp4 => Ok(self.give_up_check()),
            _ => Err(ServiceError::CommandNotInterruptible),
        }
    }

    /// The wait for the loops' lock can be given up and taken up again; the check itself is over in an instant.
    fn give_up_check(&mut self) -> CommandState {
        self.checks.started = None;
        self.checks.waits_for_lock = false;
        CommandState::Interrupted
    }

    /// Carries out the check or computation that a step has started; `None` if there is none.
    ///
    /// It takes some 300 us, which no step of the service channel may.
    pub(crate) fn carry_out(&mut self, parameters: &mut Parameters) -> Option<(Idn, CommandState)> {
        let started = self.checks.started.take()?;
        let state = match started {
            Procedure::CheckForCp3 => self.check_cp3(parameters),
            Procedure::CheckForCp4 => self.check_cp4(parameters, true),
            Procedure::ComputeGains => {
                let result = commissioning::compute_gains(parameters, <H::Board>::FACTS.frequency, loops::accept::<H>);
                self.taken(result, parameters)
            }
            _ => match self.start_identification(started, parameters) {
                Ok(()) => CommandState::Executing,
                failure => self.found(failure),
            },
        };
        Some((started.idn(), state))
    }

    fn start_identification(
        &mut self,
        procedure: Procedure,
        parameters: &Parameters,
    ) -> Result<(), CommissioningFinding> {
        let plan = commissioning::plan(procedure, parameters, <H::Board>::FACTS.frequency)?;
        self.motion.lock(|motion| motion.start_identification(&plan))?;
        self.commissioning.identifying = Some(procedure);
        Ok(())
    }

    /// Takes over what an identification has measured, if one has ended.
    pub(crate) fn conclude_identification(&mut self, parameters: &mut Parameters) -> Option<(Idn, CommandState)> {
        let outcome = self.motion.lock(Motion::take_identified)?;
        let procedure = self.commissioning.identifying.take()?;
        let result = commissioning::take_over(outcome, parameters, loops::accept::<H>);
        Some((procedure.idn(), self.taken(result, parameters)))
    }

    /// Found, and taken over into the parameters.
    fn taken(&mut self, result: Result<(), CommissioningFinding>, parameters: &Parameters) -> CommandState {
        if result.is_ok() {
            self.note_stored(parameters);
        }
        self.found(result)
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
        let settings = loops::settings::<H>(parameters)
            .and_then(|settings| homing(parameters, &settings.motion))
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
        self.may_load()?;
        self.without_torque(|context| {
            parameters.load_defaults();
            context.rescaling.defaults_loaded(parameters);
            if context.phases.current() == Phase::Cp3 {
                context.phases.withdraw();
            }
            context.checks.finding = None;
            context.settings_changed = true;
            context.note_stored(parameters);
        })
    }

    fn may_load(&mut self) -> Result<(), ServiceError> {
        self.unlocked()?;
        if self.phases.current() == Phase::Cp4 {
            self.checks.finding = Some(Finding::LoadInOperation);
            return Err(ServiceError::CommandNotExecutableNow);
        }
        Ok(())
    }

    /// S-0-0263.
    fn load_parameters(&mut self) -> Result<CommandState, ServiceError> {
        self.may_load()?;
        if self.motion.lock(|motion| motion.has_torque()) {
            return Err(ServiceError::CommandNotExecutableNow);
        }
        self.start_keeping(Procedure::LoadParameters)
    }

    /// S-0-0264 and S-0-0293.
    fn save_parameters(&mut self, procedure: Procedure) -> Result<CommandState, ServiceError> {
        if self.motion.lock(|motion| motion.has_torque()) {
            self.checks.finding = Some(Finding::SaveWithTorque);
            return Err(ServiceError::ProtectedBySettings);
        }
        self.start_keeping(procedure)
    }

    fn start_keeping(&mut self, procedure: Procedure) -> Result<CommandState, ServiceError> {
        if !self.keeping.has_memory() {
            self.checks.finding = Some(Finding::Memory(MemoryFailure::NoMemory));
        }
        self.keeping.start(procedure)?;
        self.checks.finding = None;
        Ok(CommandState::Executing)
    }
}

/// S-0-0052, in the weight of the position data.
fn reference_distance(parameters: &Parameters) -> i32 {
    parameters.get(REFERENCE_DISTANCE).cast_signed()
}
