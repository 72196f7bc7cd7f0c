//! What a step of the service channel works with.

use rtic_core::Mutex;
use sercon816::{Bus, Slave};
use sercos::command::CommandState;
use sercos::error::ServiceError;
use sercos::parameters::Parameters;
use sercos::transition::{CyclicConfiguration, InvalidData};
use sercos::{Idn, Phase, PhaseMachine};

use super::access::Access;
use super::commissioning::Commissioning;
use super::finding::Finding;
use super::loops;
use super::rescaling::Rescaling;
use crate::crash::LastCrash;
use crate::diagnosis::error_memory::ErrorMemory;
use crate::diagnosis::table::{Diagnosis, diagnose};
use crate::dictionary::procedures::Procedure;
use crate::hardware::Hardware;
use crate::identity::Identity;
use crate::motion::Motion;
use crate::remembering::keeping::Keeping;
use crate::remembering::log::KeptPosition;

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
    pub(crate) started: Option<Procedure>,
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
    pub(crate) keeping: &'a mut Keeping,
    /// Of all starts before this one.
    pub(crate) total_seconds: u32,
    /// P-0-0016.
    pub(crate) last_position: Option<KeptPosition>,
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
    /// Gives the loops what has changed before they have begun to work with it.
    pub(crate) fn settle(&mut self, parameters: &mut Parameters) {
        if core::mem::take(&mut self.settings_changed) {
            self.rescaling.refresh(parameters);
            // What does not go together yet waits for the rest; S-0-0128 finds what is left of it.
            match loops::settings::<H>(parameters) {
                Ok(settings) => self.motion.lock(|motion| motion.apply_settings(&settings)),
                Err(_) => debug_assert!(!self.loops_work(), "what the loops work with was checked"),
            }
        }
    }

    /// What S-0-0192 lists has changed: with S-0-0269 = 0 it is kept as soon as it can be.
    pub(crate) fn note_stored(&mut self, parameters: &Parameters) {
        const STORAGE_MODE: Idn = Idn::standard(269);
        if parameters.get_word(STORAGE_MODE) == 0 && self.keeping.has_memory() {
            let now = self.motion.lock(|motion| {
                motion.show_unsaved(true);
                motion.operating_time()
            });
            self.keeping.note_write(now);
        }
    }

    /// The lock S-0-0267 has changed: it is kept as soon as it can be.
    pub(crate) fn note_lock(&mut self) {
        if self.keeping.has_memory() {
            self.keeping.note_lock();
            self.motion.lock(|motion| motion.show_unsaved(true));
        }
    }

    /// The loops work with the parameters as they are: S-0-0128 has passed, and nothing that it looked at was written since. Before that a
    /// master writes in any order, and S-0-0128 finds what does not go together.
    pub(super) fn loops_work(&self) -> bool {
        match self.phases.current() {
            Phase::Cp4 => true,
            Phase::Cp3 => self.phases.is_permitted(),
            _ => false,
        }
    }

    pub(super) fn unlocked(&self) -> Result<(), ServiceError> {
        if self.access.is_locked() { Err(ServiceError::ProtectedByPassword) } else { Ok(()) }
    }

    pub(super) fn without_torque(&mut self, act: impl FnOnce(&mut Self)) -> Result<CommandState, ServiceError> {
        if self.motion.lock(|motion| motion.has_torque()) {
            return Err(ServiceError::CommandNotExecutableNow);
        }
        act(self);
        Ok(CommandState::Executed)
    }

    pub(super) fn diagnosis(&mut self) -> &'static Diagnosis {
        let (phase, interface) = (self.phases.current(), self.phases.interface_status());
        diagnose(&self.motion.lock(|motion| motion.circumstances(phase, interface)))
    }
}
