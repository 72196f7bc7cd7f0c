//! What the tasks of low priority ask of the motor side, each under one short lock.

use sercon816::Bus;
use sercos::Phase;
use sercos::command::CommandState;
use sercos::diagnostic::Class1;
use sercos::phase::{InterfaceStatus, PhaseError};
use servo::axis::Axis;
use servo::encoder::DoubleSampledEncoder;
use servo::homing::HomingSettings;
use servo::path::MotionLimits;
use servo::probe::ProbeSettings;
use servo::units::SUPERVISION_PERIOD_MICROSECONDS;

use super::Motion;
use super::function::Function;
use super::homing::HomingFailure;
use super::identification::{Failure, Outcome, Plan};
use super::ring_clock::{ClockMonitor, PHASE_ERROR_CLASSES};
use crate::diagnosis::faults::Findings;
use crate::diagnosis::words::{Circumstances, Manufacturer1};
use crate::hardware::{Hardware, ResetCause};
use crate::settings::{CycleSettings, DriveSettings, MotionSettings};
use crate::signal::bits::BitSettings;
use crate::signal::command::{Command, CommandValue};
use crate::signal::control_bits::Enable;
use crate::signal::feedback::{Feedback, FeedbackValue};
use crate::signal::record::Records;
use crate::snapshot::Snapshot;
use crate::state::DriveState;

impl<B: Bus + Clone, H: Hardware> Motion<B, H> {
    /// Enters a communication phase that the slave has accepted.
    ///
    /// CP3 clears the supervision and fills the AT record, so that the first AT is complete. Every phase below CP4 takes the
    /// command values away: a motor that runs is stopped.
    pub fn enter_phase(&mut self, phase: Phase) {
        self.ring.enter(phase);
        self.operation.enter_phase();
        self.function.release();
        self.positive_stop.cancel();
        self.set_probing(None);
        self.positioning.reset();
        self.clock.expect(if phase < Phase::Cp3 { 0 } else { self.settings.cycle.ticks_to_overdue });
        self.cyclic_limits.restart(&self.settings.limits);
        match phase {
            Phase::Cp3 => {
                self.clock.restart(self.settings.cycle.clock);
                self.latch_now();
                self.capture_feedback();
            }
            Phase::Cp4 => self.change_mode(self.settings.modes.first().copied().flatten()),
            Phase::Cp2 => {
                self.clock_monitor = ClockMonitor::new();
                self.park(false);
            }
            _ => {}
        }
        self.update_state();
    }

    /// Which values the cyclic records carry; before CP3.
    pub fn set_records(&mut self, records: Records) {
        self.cyclic_limits.configure(records.limits());
        self.ring.set_records(records);
    }

    /// Settings from changed parameters, all at once: for a ring that is not in operation. The tasks of the cycle wait for it meanwhile, so that in
    /// operation `service::hand_over` does it by parts.
    pub fn apply_settings(&mut self, settings: &DriveSettings) {
        self.apply_motor_settings(settings);
        self.take_axis_settings(settings, false);
        self.take_axis_settings(settings, true);
        self.put_axis_settings_in_force();
        self.apply_motion_settings(&settings.motion);
    }

    /// The motor's part.
    pub(crate) fn apply_motor_settings(&mut self, settings: &DriveSettings) {
        self.motor.apply_settings(&settings.motor, settings.motion.encoder_reversed);
        self.obey_carried_limits();
    }

    /// The axis' part for the modes without lag, or for those with it.
    pub(crate) fn take_axis_settings(&mut self, settings: &DriveSettings, without_lag: bool) {
        if without_lag {
            self.without_lag = settings.without_lag;
        } else {
            self.with_lag = settings.with_lag;
        }
    }

    /// What has been taken over for the axis acts from now on.
    pub(crate) fn put_axis_settings_in_force(&mut self) {
        self.apply_axis_settings();
        self.obey_carried_limits();
    }

    /// The part around the loops. Another encoder resolution starts the position at zero again.
    pub(crate) fn apply_motion_settings(&mut self, settings: &MotionSettings) {
        let encoder =
            settings.encoder != self.settings.encoder || settings.encoder_reversed != self.settings.encoder_reversed;
        let clock = settings.cycle.clock != self.settings.cycle.clock;
        // From here on from its own place: the compiler would copy all of it a second time for what is read below.
        self.settings = *settings;
        self.cyclic_limits.rescale(&self.settings.limits);
        if clock {
            self.restart_clock();
        }
        if encoder {
            self.restart_encoder();
        }
        self.obey_carried_limits();
    }

    #[cold]
    #[inline(never)]
    fn restart_clock(&mut self) {
        self.clock.restart(self.settings.cycle.clock);
    }

    #[cold]
    #[inline(never)]
    fn restart_encoder(&mut self) {
        let count = self.hardware.encoder_count();
        self.encoder = DoubleSampledEncoder::new(self.settings.encoder, self.counted(count));
        self.axis = Axis::new(self.with_lag, self.encoder.position());
        self.reference.forget();
        self.positioning.forget();
        self.apply_axis_settings();
    }

    /// Not for a cycle may the parameters be in force in the place of what the MDT carries.
    fn obey_carried_limits(&mut self) {
        if self.cyclic_limits.is_carried() {
            self.cyclic_limits.work_out_anew();
            self.obey_limits();
        }
    }

    /// The ring's cycle that S-0-0127 has accepted, before CP3 can begin.
    pub(crate) fn apply_cycle(&mut self, cycle: CycleSettings) {
        if cycle.clock != self.settings.cycle.clock {
            self.clock.restart(cycle.clock);
        }
        self.settings.cycle = cycle;
    }

    /// What the loops work with, for tests and tools beside the ring.
    pub const fn settings(&self) -> DriveSettings {
        DriveSettings {
            with_lag: self.with_lag,
            without_lag: self.without_lag,
            motor: *self.motor.settings(),
            motion: self.settings,
        }
    }

    /// The error that supervision has found, once.
    pub fn take_loss(&mut self) -> Option<PhaseError> {
        self.ring.take_loss()
    }

    /// A communication error found elsewhere (an illegal phase): C1D bit 12 and best possible deceleration.
    pub fn communication_fault(&mut self) {
        self.fail(Findings { class_1: Class1::COMMUNICATION, ..Findings::default() });
    }

    /// Nothing is remembered of the parameters.
    pub(crate) fn memory_fault(&mut self) {
        let mut findings = Findings::default();
        findings.add_own(Manufacturer1::MEMORY, false);
        self.fail(findings);
    }

    /// Nobody knows the amplifier, or somebody does again.
    pub(crate) fn show_amplifier_unknown(&mut self, unknown: bool) {
        self.status.show_amplifier_unknown(unknown);
    }

    /// Parameters were written that are to be kept and are not yet.
    pub(crate) fn show_unsaved(&mut self, unsaved: bool) {
        self.status.show_unsaved(unsaved);
    }

    /// S-0-0014 and S-0-0390, for the AT.
    pub fn set_diagnostics(&mut self, interface_status: u16, diagnostic_number: u16) {
        self.status.set_diagnostics(interface_status, diagnostic_number);
    }

    /// S-0-0099: clears C1D unless a cause is still there, the error reaction still runs, or an error has come while the command was on its way:
    /// one that no AT has told of would be gone without a word, and the torque with it.
    ///
    /// Returns whether the drive is free of errors now.
    pub fn reset_class_1(&mut self) -> bool {
        let has_error = self.status.has_error();
        let reacting = self.operation.state().has_torque() && has_error;
        if reacting || !self.inputs.bridge_ready || (has_error && !self.ring.shows_error()) {
            return false;
        }
        self.status.clear_errors();
        self.update_state();
        true
    }

    /// Asks for `Tasks::SERVICE_CHANNEL` when the loop clock has locked to the ring, or after so many ticks of the supervision without.
    pub fn wait_for_lock(&mut self, ticks: u16) {
        self.clock.wait_for_lock(ticks);
    }

    /// Whether the wait that [`Motion::wait_for_lock`] began still lasts.
    pub const fn waits_for_lock(&self) -> bool {
        self.clock.is_awaited()
    }

    /// Whether the loops run in a fixed phase to the ring.
    pub fn is_synchronised(&self) -> bool {
        self.clock.is_locked()
    }

    /// What the log tells of.
    pub const fn snapshot(&mut self) -> Snapshot {
        Snapshot { state: self.operation.state(), class_1: self.status.class_1() }
    }

    /// A homing, an identification or a positive stop has ended, and nobody has asked yet how.
    pub(crate) const fn has_results(&self) -> bool {
        self.function.has_results() || self.positive_stop.has_result()
    }

    /// Time since the processor was started, in us.
    pub(crate) fn operating_time(&self) -> u64 {
        self.halves.wrapping_mul(u64::from(SUPERVISION_PERIOD_MICROSECONDS / 2))
    }

    /// What the diagnosis is made of; `phase` and `interface` are the slave's.
    pub(crate) fn circumstances(&self, phase: Phase, interface: InterfaceStatus) -> Circumstances {
        Circumstances {
            phase,
            interface,
            state: self.operation.state(),
            power: self.conditions().power,
            homing: self.function.holds(),
            class_1: self.status.class_1(),
            class_2: self.status.class_2(),
            manufacturer_1: self.status.manufacturer_1(),
            manufacturer_2: self.status.manufacturer_2(),
            manufacturer_3: self.status.manufacturer_3(),
        }
    }

    /// One value of the AT, as the service channel shows it (from the last t4, or from now before CP3).
    pub fn feedback(&mut self, feedback: Feedback) -> u32 {
        if self.ring.phase() < Phase::Cp3 {
            self.refresh_values(self.encoder.position());
        }
        self.signal(feedback)
    }

    /// Ends the change bit of C2D: the master has read S-0-0012.
    pub fn clear_class_2_change(&mut self) {
        self.status.clear_class_2_change();
    }

    /// Ends the change bit of C3D: the master has read S-0-0013.
    pub fn clear_class_3_change(&mut self) {
        self.status.clear_class_3_change();
    }

    /// A command value over the service channel, while it is not cyclic.
    pub(crate) fn set_command(&mut self, value: CommandValue, raw: u32) {
        // The axis takes a point of the path with the next MDT.
        let _ = self.ring.put_command(Command::Value(value), raw, &mut self.cyclic_limits);
        self.pass_on(value == CommandValue::TargetPosition, value == CommandValue::SignalControl);
        // What is reached is told of the new target as soon as it is acknowledged.
        if self.positioning.is_active() {
            self.position_to_target();
        }
    }

    /// One of the bits above P-0-0019, over the service channel.
    pub(crate) fn set_enable(&mut self, enable: Enable, set: bool) {
        self.controls.set_enable(enable, set);
    }

    /// P-0-0019 and the bits above it as they are, and those of them that somebody else sets: the MDT in every cycle, or an input.
    pub(crate) fn controlled_bits(&self) -> (u32, u32) {
        let BitSettings { control: [first, second], signal_control, .. } = self.settings.bits;
        let mut owned = 0;
        if self.ring.phase() == Phase::Cp4 {
            owned = first | second;
            if self.ring.carries_signals() {
                owned = signal_control.into_iter().fold(owned, |all, bit| all | bit);
            }
        }
        let mut bits = self.controls.all();
        if self.settings.home_switch_at_drive {
            let switch = Enable::HomeSwitch.mask();
            owned |= switch;
            bits = if self.inputs.home_switch { bits | switch } else { bits & !switch };
        }
        (bits, owned)
    }

    /// P-0-0019 over the service channel.
    pub fn set_application_word(&mut self, word: u16) {
        self.controls.set_application_word(word);
    }

    /// Whether torque is on.
    pub const fn has_torque(&self) -> bool {
        self.operation.state().has_torque()
    }

    /// Whether the processor may stand still for 100 us from now on, the time of a word of flash: there is no torque, and nothing is due on the ring. Each
    /// answer is for one word.
    pub fn may_stand_still(&mut self) -> bool {
        !self.has_torque() && self.clock.is_idle(self.ring.phase(), &self.settings.cycle)
    }

    /// Whether the motor stands (C3D bit 1).
    pub const fn is_standing(&self) -> bool {
        self.output.standstill
    }

    /// S-0-0051, where it is known what it counts from (S-0-0403 bit 0).
    pub(crate) fn referenced_position(&mut self) -> Option<i32> {
        let known = self.reference.is_known();
        known.then(|| self.feedback(Feedback::Value(FeedbackValue::Position)).cast_signed())
    }

    /// S-0-0191.
    pub fn cancel_reference(&mut self) {
        self.reference.forget();
    }

    /// S-0-0149. `false`: the drive does not follow and is not halted.
    pub(crate) fn start_positive_stop(&mut self) -> bool {
        let may =
            matches!(self.operation.state(), DriveState::Following | DriveState::Halted) && !self.status.has_error();
        if may {
            self.positive_stop.start();
        }
        may
    }

    /// S-0-0149 is cancelled.
    pub(crate) fn cancel_positive_stop(&mut self) {
        self.positive_stop.cancel();
    }

    /// How S-0-0149 has ended, once.
    pub(crate) fn take_positive_stop_result(&mut self) -> Option<CommandState> {
        self.positive_stop.take_result()
    }

    /// S-0-0170 with S-0-0169, or its end.
    pub(crate) fn set_probing(&mut self, settings: Option<ProbeSettings>) {
        self.probing.set(settings, &mut self.hardware);
    }

    /// S-0-0169 was written.
    pub(crate) const fn select_probe_edges(&mut self, edges: ProbeSettings) {
        self.probing.select(edges);
    }

    /// Starts S-0-0148 with a movement. The old reference is gone from now on. `false`: the drive is not in operation.
    pub(crate) fn start_homing(&mut self, settings: HomingSettings, limits: MotionLimits) -> bool {
        if !matches!(self.operation.state(), DriveState::Following | DriveState::Halted) {
            return false;
        }
        let position = self.encoder.position();
        self.reference.forget();
        self.with_function(|function| function.start_homing(position, settings, limits))
    }

    /// S-0-0148 holds the position, or is cancelled.
    pub fn hold_for_homing(&mut self, hold: bool) {
        if hold {
            return self.with_function(Function::hold);
        }
        // Where S-0-0047 is not cyclic nobody else brings it into the new coordinates.
        self.ring.replace_position(self.position_command_data());
        self.with_function(Function::release);
    }

    /// S-0-0148 moves or holds the axis.
    pub const fn is_homing(&self) -> bool {
        self.function.holds()
    }

    /// How a homing has ended, once.
    pub(crate) const fn take_homing_result(&mut self) -> Option<CommandState> {
        self.function.take_homing_result()
    }

    /// Why the last homing failed.
    pub(crate) const fn homing_error(&self) -> Option<HomingFailure> {
        self.function.homing_error()
    }

    /// The place where the motor stands is the position `value`, in the weight of S-0-0052, from now on. Divides.
    pub fn set_reference(&mut self, value: i32) {
        self.shift_zero(self.settings.coordinates.place(value) - self.encoder.position());
        self.reference.set();
    }

    /// The drive holds a motor that stands, by HALT, and nothing else is made of that.
    pub(crate) const fn may_identify(&self) -> bool {
        matches!(self.operation.state(), DriveState::Halted)
            && self.is_standing()
            && self.function.is_none()
            && self.motor.commutates()
    }

    /// Starts an identification.
    ///
    /// # Errors
    /// Why it may not.
    pub(crate) fn start_identification(&mut self, plan: &Plan) -> Result<(), Failure> {
        if !self.may_identify() {
            return Err(Failure::Interrupted);
        }
        plan.look_at_load(self.motor.carried_load())?;
        let position = self.encoder.position();
        // Known, see `may_identify`.
        let angle = self.motor.commutation_angle(position).unwrap_or(0);
        let started = self.with_function(|function| function.start_identification(plan, position, angle));
        if started { Ok(()) } else { Err(Failure::Interrupted) }
    }

    /// Gives up an identification. Nobody is told of it.
    pub(crate) fn cancel_identification(&mut self) {
        if self.function.interrupt_identification() {
            self.let_go();
        }
        let _ = self.with_function(Function::take_identified);
    }

    /// An identification is under way.
    pub(crate) const fn is_identifying(&self) -> bool {
        self.function.is_identifying()
    }

    /// What came of an identification, once.
    pub(crate) const fn take_identified(&mut self) -> Option<Outcome> {
        self.function.take_identified()
    }

    /// S-0-0139 and its cancellation.
    pub fn park(&mut self, parked: bool) {
        self.status.park(parked);
    }

    /// Shows in S-0-0182 whether the password locks the parameters.
    pub fn show_lock(&mut self, locked: bool) {
        self.status.show_lock(locked);
    }

    /// P-0-0118 in 0.01 degree; -1: not known.
    pub(crate) fn commutation_angle(&self) -> i32 {
        const CIRCLE: u32 = 36_000;
        let angle = self.motor.commutation_angle(self.encoder.position());
        let hundredths = |angle: u32| (u64::from(angle).wrapping_mul(CIRCLE.into()).wrapping_add(1 << 31) >> 32) as u32;
        angle.map_or(-1, |angle| (hundredths(angle) % CIRCLE).cast_signed())
    }

    /// P-0-0119.
    pub(crate) fn commutation_state(&self) -> u16 {
        self.motor.commutation_state()
    }

    /// P-0-0132, P-0-0133 and P-0-0238.
    pub(crate) fn loads(&self) -> [u16; 3] {
        let watched = self.motor.watched();
        [watched.motor_load, watched.amplifier_load, watched.chopper_load]
    }

    /// P-0-0150 in ns.
    pub(crate) const fn phase_error(&self) -> i32 {
        self.clock_monitor.last()
    }

    /// P-0-0151 in ns.
    pub(crate) fn largest_phase_error(&self) -> u32 {
        self.clock_monitor.largest()
    }

    /// P-0-0153.
    pub(crate) const fn late_current_loops(&self) -> u32 {
        self.motor.measured().late
    }

    /// P-0-0227 in %.
    pub(crate) const fn identification_percent(&self) -> u8 {
        self.function.percent()
    }

    /// S-0-0028 and S-0-0029.
    pub(crate) const fn lost_telegrams(&self) -> [u16; 2] {
        self.ring.errors()
    }

    /// P-0-0152.
    pub fn phase_error_histogram(&self) -> [u32; PHASE_ERROR_CLASSES] {
        self.clock_monitor.histogram()
    }

    /// P-0-0118 in 0.01 degree: the electrical angle of the place where the motor stands; negative: it is searched for again. Divides.
    pub fn set_commutation_angle(&mut self, hundredths: i32) {
        // At most 36 000.
        let angle = u64::try_from(hundredths).ok().map(|hundredths| ((hundredths << 32) / 36_000) as u32);
        self.motor.set_commutation_angle(self.encoder.position(), angle);
    }

    /// P-0-0009.
    pub fn reset_cause(&self) -> ResetCause {
        self.hardware.reset_cause()
    }
}
