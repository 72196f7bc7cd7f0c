//! The tasks of low priority: phase change and service channel.

use core::fmt;

use rtic_core::Mutex;
use sercon816::{Block, Boundary, Bus, Configuration, InitialiseError, ServiceAnswer, ServicePort, ServiceStep, Slave};
use sercos::command::CommandState;
use sercos::parameters::Parameters;
use sercos::phase::{PhaseChange, PhaseError};
use sercos::service::{ReadPosition, Reply, Server, Step};
use sercos::transition::OPERATION_MODES;
use sercos::{Idn, Phase, PhaseMachine};
use servo::motor::BoardKind;

use crate::amplifier::Amplifier;
use crate::crash::{CrashRecord, LastCrash};
use crate::diagnosis::error_memory::{ErrorMemory, ErrorRecord, seconds};
use crate::diagnosis::news::Announcement;
use crate::diagnosis::table::{SAVE_CUT, of_phase_error};
use crate::dictionary::procedures::Procedure;
use crate::dictionary::{DICTIONARY, parameters_on};
use crate::hardware::Hardware;
use crate::identity::Identity;
use crate::interrupts::RingInterrupts;
use crate::motion::Motion;
use crate::remembering::keeping::{Keep, Keeping, MemoryFailure, Selected};
use crate::remembering::log::{KeptPosition, Log, Moment};
use crate::remembering::set::{self, Recollection};
use crate::service::access::Access;
use crate::service::checks::amplifier_is_unknown;
use crate::service::commissioning::Commissioning;
use crate::service::context::{Checks, Context};
use crate::service::finding::Finding;
use crate::service::rescaling::Rescaling;
use crate::service::{hand_over, loops};

/// Why the drive cannot start.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum StartError {
    /// The ring controller is not there or not sound.
    Chip(InitialiseError),
}

impl fmt::Display for StartError {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self::Chip(error) = self;
        write!(formatter, "ring controller: {error}; check its supply, clock, reset line and bus")
    }
}

impl core::error::Error for StartError {}

/// Words of a long element that are handed over in one step, half of what the container takes: every word costs bus accesses, and the master
/// takes one a step, so that it waits for none of them either way.
const SEGMENT_WORDS: usize = 8;

/// A phase change or an error of communication that has happened, for the log.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct PhaseReport {
    /// Phase until now.
    pub from: Phase,
    /// Phase from now on.
    pub to: Phase,
    /// Why, if it was not the master's regular step.
    pub error: Option<PhaseError>,
}

/// The ring's side of the drive: phases, parameters, service channel.
///
/// `phase_change` and `service_channel` run at one priority and share it without locks.
#[derive(Debug)]
pub struct Communication<B> {
    identity: Identity,
    slave: Slave<B>,
    service: ServicePort<B>,
    phases: PhaseMachine,
    server: Server,
    parameters: Parameters,
    checks: Checks,
    commissioning: Commissioning,
    access: Access,
    rescaling: Rescaling,
    errors: ErrorMemory,
    /// Seconds of operation of all starts before this one.
    total_seconds: u32,
    /// P-0-0016: from before this start.
    last_position: Option<KeptPosition>,
    /// What the next log keeps where the drive does not know its zero: that of the last one, of this start or before.
    newest_position: Option<KeptPosition>,
    keeping: Keeping,
    /// The parameters are those that the memory had at the start.
    has_recalled: bool,
    crash: Option<LastCrash>,
    announcement: Announcement,
}

impl<B: Bus + Clone> Communication<B> {
    /// That of a drive which has not touched its chip yet: with the parameters that it remembers, and the ratings of its production record; without one, with
    /// those of the board. What it does not remember is the default and, from [`Communication::start`] on, an error that S-0-0099 clears.
    pub fn new<H: Hardware>(bus: B, identity: Identity, recollection: Recollection<'_>) -> Self {
        let amplifier = identity.production.amplifier(&H::AMPLIFIER);
        let parameters = parameters_on(amplifier, &<H::Board>::FACTS);
        let mut communication = Self {
            identity,
            slave: Slave::new(bus.clone()),
            service: ServicePort::new(bus),
            phases: PhaseMachine::new(),
            server: Server::with_segment_words(&DICTIONARY, SEGMENT_WORDS),
            rescaling: Rescaling::new(&parameters),
            parameters,
            checks: Checks::default(),
            commissioning: Commissioning::default(),
            access: Access::default(),
            errors: ErrorMemory::new(),
            total_seconds: 0,
            last_position: None,
            newest_position: None,
            keeping: Keeping::with_memory(),
            has_recalled: false,
            crash: None,
            announcement: Announcement::default(),
        };
        communication.recall(recollection);
        communication
    }

    /// Sets the chip up for CP0; once, before its interrupts can come. Some 1 000 bus accesses.
    ///
    /// # Errors
    /// [`StartError`]; the drive then stays out of the ring: its repeater may be on, but it never answers.
    pub fn start<H: Hardware>(
        &mut self,
        interrupts: &mut RingInterrupts<B>,
        motion: &mut Motion<B, H>,
    ) -> Result<(), StartError> {
        let configuration = Configuration {
            address: self.identity.address.get(),
            bit_rate: self.identity.bit_rate,
            clock: self.identity.master_clock,
            transceiver: self.identity.transceiver,
        };
        self.slave.initialise(&configuration).map_err(StartError::Chip)?;
        self.service.reset();
        if !self.has_recalled {
            motion.memory_fault();
        }
        motion.show_lock(self.access.is_locked());
        motion.show_amplifier_unknown(self.amplifier(&H::AMPLIFIER).is_none());
        motion.enter_phase(Phase::Cp0);
        interrupts.enable();
        Ok(())
    }

    /// How the program ended last, in the task of this name; before it starts. One that no start has told of comes into the error memory.
    pub fn note_crash(&mut self, record: CrashRecord, task: &'static str) {
        if !record.told {
            self.note_error(record.cause.diagnosis().number, 0);
        }
        self.crash = Some((record, task));
    }

    /// The parameters are those that the drive remembers, if it does.
    fn recall(&mut self, recollection: Recollection<'_>) {
        let set = match recollection {
            Recollection::Set(set) => Some(set),
            Recollection::Unfinished(set) => {
                self.note_error(SAVE_CUT.number, 0);
                set
            }
            Recollection::Empty | Recollection::Damaged => None,
        };
        self.has_recalled = set.is_some_and(|set| self.take_set(set));
    }

    fn take_set(&mut self, set: &[u8]) -> bool {
        let Some(dropped) = set::take_set(set, &mut self.parameters) else { return false };
        self.keeping.dropped = dropped;
        self.rescaling = Rescaling::new(&self.parameters);
        // What was written before counts no more.
        self.rescaling.take_over(&mut self.parameters);
        true
    }

    /// What has happened before this start, as it was kept, and the last crash of it, which nobody has told of since.
    /// Before [`Communication::note_crash`] and [`Communication::start`].
    pub fn recall_log(&mut self, bytes: &[u8]) -> Option<CrashRecord> {
        let log = Log::parse(bytes)?;
        let this_start = core::mem::replace(&mut self.errors, log.errors);
        for error in this_start.newest_first() {
            self.errors.add(ErrorRecord { seconds: log.seconds, ..error });
        }
        self.total_seconds = log.seconds;
        (self.last_position, self.newest_position) = (log.position, log.position);
        self.access = log.access;
        log.crash
    }

    /// The next thing that is to be kept, and what is said of the moment.
    pub(crate) fn next_to_keep<H: Hardware>(
        &mut self,
        motion: &mut impl Mutex<T = Motion<B, H>>,
    ) -> Option<(Keep, Moment)> {
        let (now, torque) = motion.lock(|motion| (motion.operating_time(), motion.has_torque()));
        let keep = self.keeping.next(now, torque)?;
        let seconds = self.total_seconds.saturating_add(seconds(now));
        // A drive that does not know its zero knows less than it did before.
        if keep == Keep::Log
            && let Some(position) = motion.lock(Motion::referenced_position)
        {
            self.newest_position = Some(KeptPosition { position, seconds });
        }
        Some((keep, Moment { seconds, position: self.newest_position }))
    }

    /// The parameters of S-0-0192, for the memory.
    pub(crate) fn write_set(&self, buffer: &mut [u8]) -> Option<usize> {
        set::write_set(&self.parameters, buffer)
    }

    /// What S-0-0293 is to save.
    pub(crate) fn selected(&self) -> Selected {
        self.keeping.selected.clone()
    }

    /// Gives a set what is selected as it is now; the number of bytes it has then.
    pub(crate) fn amend_set(&self, selected: &[Idn], set: &mut [u8], length: usize) -> Option<usize> {
        set::amend_set(&self.parameters, selected, set, length)
    }

    /// What has happened, for the memory.
    pub(crate) fn write_log(&self, moment: &Moment, buffer: &mut [u8]) -> Option<usize> {
        let told = self.crash.as_ref().map(|(record, _)| CrashRecord { told: true, ..*record });
        Log::write(moment, &self.errors, told.as_ref(), &self.access, buffer)
    }

    /// S-0-0263, behind the step that has started it.
    pub(crate) fn load_set<H: Hardware>(
        &mut self,
        set: &[u8],
        motion: &mut impl Mutex<T = Motion<B, H>>,
    ) -> Result<(), MemoryFailure> {
        // It was refused in CP4; a control that has gone on there has left the command behind.
        if self.phases.current() == Phase::Cp4 {
            return Err(MemoryFailure::InOperation);
        }
        if !self.take_set(set) {
            return Err(MemoryFailure::NoSet);
        }
        if self.phases.current() == Phase::Cp3 {
            self.phases.withdraw();
        }
        // What does not go together is found by S-0-0128.
        if let Ok(settings) = loops::settings::<H>(&self.parameters) {
            hand_over::by_parts(motion, &settings);
        }
        Ok(())
    }

    /// Something was kept or loaded, or not.
    pub(crate) fn kept<H: Hardware>(
        &mut self,
        result: Result<(), MemoryFailure>,
        motion: &mut impl Mutex<T = Motion<B, H>>,
    ) {
        let now = motion.lock(|motion| motion.operating_time());
        let command = self.keeping.done(now, result.is_ok());
        let unsaved = self.keeping.has_unsaved();
        if command == Some(Procedure::SaveParameters) && result.is_ok() {
            self.keeping.settle();
        }
        let unknown = self.amplifier(&H::AMPLIFIER).is_none();
        motion.lock(|motion| {
            motion.show_unsaved(unsaved);
            motion.show_amplifier_unknown(unknown);
        });
        if let Some(procedure) = command {
            // Nobody has asked for the rest, and S-0-0182 bit 3 tells of it.
            if let Err(failure) = result {
                self.checks.finding = Some(Finding::Memory(failure));
            }
            let state = if result.is_ok() { CommandState::Executed } else { CommandState::Failed };
            self.server.command_progress(procedure.idn(), state);
            self.service.set_command_change(self.server.command_change());
        }
    }

    /// The slave's phase.
    pub fn phase(&self) -> Phase {
        self.phases.current()
    }

    /// Its number in the ring, 1 to 254.
    pub(crate) const fn address(&self) -> u8 {
        self.identity.address.get()
    }

    /// The amplifier; `of_board` is the one without a production record. `None`: nobody knows it.
    pub(crate) fn amplifier<'a>(&'a self, of_board: &'a Amplifier) -> Option<&'a Amplifier> {
        let known = amplifier_is_unknown(&self.identity.production, of_board, &self.keeping).is_none();
        known.then(|| self.identity.production.amplifier(of_board))
    }

    /// The parameters, for tests and tools beside the ring.
    pub fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    /// Task of a phase change: the MST carries another phase, or supervision has given the ring up.
    ///
    /// Contract: at most 50 us from the MST at 168 MHz; the first AT of CP3 may miss its t1, one is allowed (sercos2.md 2.4).
    pub fn phase_change<H: Hardware>(
        &mut self,
        interrupts: &mut impl Mutex<T = RingInterrupts<B>>,
        motion: &mut impl Mutex<T = Motion<B, H>>,
    ) -> Option<PhaseReport> {
        let from = self.phases.current();
        let lost = motion.lock(Motion::take_loss);
        let mut noted = None;
        let result = match lost {
            Some(error @ PhaseError::UninitialisedMode { selected }) => {
                // The control has to learn of it from the ATs: only the motor stops.
                self.phases.note(error);
                self.checks.missing_mode = OPERATION_MODES.get(usize::from(selected)).copied();
                self.remember(error, motion);
                noted = Some(error);
                self.phases.received(self.slave.phase_received())
            }
            Some(error) => Err(self.phases.fail(error)),
            None => self.phases.received(self.slave.phase_received()),
        };
        let report = match result {
            Ok(PhaseChange::Unchanged) => match noted {
                Some(_) => PhaseReport { from, to: from, error: noted },
                None => return None,
            },
            Ok(PhaseChange::Entered { from, to }) => {
                self.enter(to, interrupts, motion);
                PhaseReport { from, to, error: None }
            }
            Err(error) => {
                self.remember(error, motion);
                motion.lock(Motion::communication_fault);
                self.enter(Phase::Cp0, interrupts, motion);
                // The master may have gone to CP0 in the same moment: then this is its CP0, and no other change will tell.
                let _ = self.phases.received(self.slave.phase_received());
                PhaseReport { from, to: Phase::Cp0, error: Some(error) }
            }
        };
        self.announce(motion);
        Some(report)
    }

    /// Task of INT_SC_0: serves the step that waits in the service container; the next one starts it anew, also while it runs. Also started by
    /// the motion side when it has become another state, error or warning, to bring diagnosis and error memory up to date.
    ///
    /// Contract: at most 100 us from the end of the MDT to the release (S-0-0326 takes 74, the average is 13). The checks of S-0-0127 and
    /// S-0-0128, and settings that a write has changed before them, are worked out after the release. The last step of a parameter that is
    /// written while the loops work with it takes longer, for it is refused if they cannot: the chip holds it (BUSY) into the next cycle.
    pub fn service_channel<H: Hardware>(&mut self, motion: &mut impl Mutex<T = Motion<B, H>>) {
        let mut context = Context {
            motion,
            slave: &mut self.slave,
            phases: &mut self.phases,
            checks: &mut self.checks,
            commissioning: &mut self.commissioning,
            identity: &self.identity,
            access: &mut self.access,
            rescaling: &mut self.rescaling,
            errors: &self.errors,
            keeping: &mut self.keeping,
            total_seconds: self.total_seconds,
            last_position: self.last_position,
            crash: self.crash.as_ref(),
            settings_changed: false,
        };
        // The motion side also starts this task for other news than the lock that S-0-0128 waits for.
        if context.checks.waits_for_lock && !context.motion.lock(|motion| motion.waits_for_lock()) {
            let state = context.check_cp4(&mut self.parameters, false);
            self.server.command_progress(Idn::CP4_TRANSITION_CHECK, state);
            self.service.set_command_change(self.server.command_change());
        }
        if context.motion.lock(|motion| motion.has_results()) {
            if let Some((idn, state)) = context.conclude_identification(&mut self.parameters) {
                self.server.command_progress(idn, state);
                self.service.set_command_change(self.server.command_change());
            }
            if let Some(state) = context.motion.lock(Motion::take_homing_result) {
                let failure = context.motion.lock(|motion| motion.homing_error());
                context.checks.finding = failure.map(Finding::Homing);
                self.server.command_progress(Idn::standard(148), state);
                self.service.set_command_change(self.server.command_change());
            }
            if let Some(state) = context.motion.lock(Motion::take_positive_stop_result) {
                context.checks.finding = (state == CommandState::Failed).then_some(Finding::PositiveStop);
                self.server.command_progress(Procedure::PositiveStop.idn(), state);
                self.service.set_command_change(self.server.command_change());
            }
        }
        if let Some(step) = self.service.pending() {
            if let Some(info) = step.silent {
                // The controller has accepted this word by itself; an error in it comes back with the next step.
                let before = Step { info, end: false, ..protocol_step(&step) };
                let _ = self.server.step(before, &mut self.parameters, &mut context);
            }
            let reply = self.server.step(protocol_step(&step), &mut self.parameters, &mut context);
            self.service.set_command_change(self.server.command_change());
            self.service.release(answer(&step, &reply));
            if let Some((idn, state)) = context.carry_out(&mut self.parameters) {
                self.server.command_progress(idn, state);
                self.service.set_command_change(self.server.command_change());
            }
        }
        context.settle(&mut self.parameters);
        // Behind the step, which is released: it takes divisions.
        if let Some(preparation) = motion.lock(Motion::take_preparation) {
            let prepared = preparation.carry_out();
            motion.lock(|motion| motion.take_prepared(&prepared));
        }
        self.announce(motion);
    }

    fn remember<H: Hardware>(&mut self, error: PhaseError, motion: &mut impl Mutex<T = Motion<B, H>>) {
        let now = motion.lock(|motion| motion.operating_time());
        self.note_error(of_phase_error(error).number, now);
    }

    fn note_error(&mut self, number: u16, now: u64) {
        self.errors.add(ErrorRecord { number, seconds: self.total_seconds.saturating_add(seconds(now)) });
        self.keeping.note_event();
    }

    fn enter<H: Hardware>(
        &mut self,
        phase: Phase,
        interrupts: &mut impl Mutex<T = RingInterrupts<B>>,
        motion: &mut impl Mutex<T = Motion<B, H>>,
    ) {
        if phase == Phase::Cp3 {
            // The record of the first AT is complete before the chip may send it.
            motion.lock(|motion| motion.enter_phase(phase));
        }
        let timers = interrupts.lock(|interrupts| interrupts.timers_for(phase));
        // CP3 without a cyclic configuration can not be reached: the phase machine asks for S-0-0127 first.
        let _ = self.slave.enter(phase.number(), timers.as_ref());
        match phase {
            Phase::Cp0 | Phase::Cp1 => self.service.set_block(&Block::INITIAL),
            Phase::Cp2 => {
                self.service.reset();
                self.rescaling.take_over(&mut self.parameters);
                self.parameters.forget_written();
            }
            Phase::Cp3 => self.service.set_block(&Block::CYCLIC),
            Phase::Cp4 => {}
        }
        if phase != Phase::Cp3 {
            motion.lock(|motion| motion.enter_phase(phase));
        }
        self.checks.waits_for_lock = false;
        self.checks.started = None;
        self.commissioning.identifying = None;
        if matches!(phase, Phase::Cp0 | Phase::Cp1) {
            self.keeping.forget_command();
        }
        self.server.phase_changed(phase);
        self.service.set_command_change(self.server.command_change());
    }

    /// Shows the diagnosis in the AT and keeps new errors, if anything about them has changed.
    fn announce<H: Hardware>(&mut self, motion: &mut impl Mutex<T = Motion<B, H>>) {
        let (phase, interface) = (self.phases.current(), self.phases.interface_status());
        let now = motion.lock(|motion| motion.circumstances(phase, interface));
        let Some(news) = self.announcement.news(&now) else { return };
        let operating_time = motion.lock(|motion| {
            motion.set_diagnostics(news.interface_status, news.number);
            motion.operating_time()
        });
        for error in news.errors() {
            self.note_error(error.number, operating_time);
        }
    }
}

fn protocol_step(step: &ServiceStep) -> Step {
    Step {
        element: step.element,
        write: step.write,
        end: step.end,
        info: step.info,
        new_transfer: step.new_transfer,
        position: match step.boundary {
            Boundary::None => ReadPosition::Within,
            Boundary::EndInside => ReadPosition::NotLast,
            Boundary::SegmentSent => ReadPosition::TookLast,
            Boundary::SegmentExhausted => ReadPosition::Exhausted,
        },
    }
}

fn answer<'a>(step: &ServiceStep, reply: &'a Reply) -> ServiceAnswer<'a> {
    match reply {
        Reply::Send(words) => ServiceAnswer::Send { words },
        Reply::Continue => ServiceAnswer::Continue,
        Reply::Accept { info } => ServiceAnswer::Accept { info: *info },
        // The last word went out with this step; that there is no further one is an error of the next step, if it asks.
        Reply::Error(_) if step.boundary == Boundary::SegmentSent && !step.end => ServiceAnswer::Continue,
        Reply::Error(error) => ServiceAnswer::Error { code: error.code() },
    }
}
