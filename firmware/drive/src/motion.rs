//! The hot tasks of the drive: command values at t3, feedback at t4, the loops every 125 us and the velocity loop once more in between, the supervision
//! every 500 us in two halves. The current loop runs above them, see [`crate::CurrentControl`].
//!
//! All five run at one priority and share [`Motion`] without locks. The background tasks (phase change, service channel)
//! take it under a short lock to hand over settings or to read a snapshot.
//!
//! What the loops themselves need stays in the loop tick. All that looks after them (bus, loads, temperatures, brake, state machine,
//! diagnostic words) has time constants of milliseconds and its own, slower task.
//!
//! What is to be known between two tasks lies in parts, each in a file of its own that nobody else may change: [`RingSide`], [`RingClock`],
//! [`Status`], [`Operation`], [`Function`] and the smaller ones beside it. The tasks hand values from one to the other. `docs/design.md`
//! says what each part owns.

use sercon816::Bus;
use sercos::Phase;
use sercos::diagnostic::Class1;
use sercos::phase::PhaseError;
use servo::axis::{Axis, AxisOutput, AxisSettings};
use servo::encoder::DoubleSampledEncoder;
use servo::motor::{CurrentLink, Motor, MotorFaults};
use servo::path::CommandJump;
use servo::scope::Scope;
use servo::units::{LOOP_TICKS_PER_SUPERVISION, Position};

mod control_bits;
mod function;
mod homing;
pub(crate) mod identification;
mod limiting;
mod movements;
mod operation;
mod positioning;
mod positive_stop;
mod probing;
mod recording;
mod reference;
mod requests;
mod ring_clock;
mod ring_side;
mod signals;
mod status;
mod supervision;
#[cfg(test)]
mod tests;

pub(crate) use homing::HomingFailure;

use control_bits::ControlBits;
use function::Function;
use operation::{Operation, Selection};
use positioning::Positioning;
use positive_stop::PositiveStop;
use probing::Probing;
use reference::Reference;
use ring_clock::{ClockMonitor, RingClock};
use ring_side::{Cycle, RingSide};
use status::Status;

use crate::diagnosis::faults::Findings;
use crate::diagnosis::words::Manufacturer1;
use crate::feedback::ShownValues;
use crate::hardware::{Hardware, Inputs, InterruptLine};
use crate::limits::CyclicLimits;
use crate::operation_mode::OperationMode;
use crate::oscilloscope::Oscilloscope;
use crate::settings::{DriveSettings, MotionSettings};
use crate::signal::record::Datum;
use crate::state::DriveState;
use crate::tasks::Tasks;

/// The motor side of the drive and the cyclic half of the bus.
///
/// Laid out as declared: what every loop tick touches comes first, where an instruction reaches it without an address of its own. What an
/// instruction for two words reaches, 1 020 bytes, is the axis's.
#[repr(C)]
#[derive(Debug)]
pub struct Motion<B, H: Hardware> {
    /// Loop ticks until the next half of the supervision.
    until_supervision: u8,
    /// Something goes along with the loops, see [`Motion::accompany`], or the oscilloscope records; found out by the supervision.
    accompanied: bool,
    encoder: DoubleSampledEncoder,
    clock: RingClock,
    /// What the loops gave in the last tick.
    output: AxisOutput,
    axis: Axis,
    status: Status,
    operation: Operation,
    hardware: H,
    ring: RingSide<B>,
    inputs: Inputs,
    shown: ShownValues,
    positioning: Positioning,
    positive_stop: PositiveStop,
    controls: ControlBits,
    motor: Motor<H::Board>,
    clock_monitor: ClockMonitor,
    reference: Reference,
    function: Function,
    probing: Probing,
    oscilloscope: Oscilloscope<'static>,
    /// Halves of the supervision since the start.
    halves: u64,
    /// Limits of the MDT.
    cyclic_limits: CyclicLimits,
    settings: MotionSettings,
    /// Of the axis, in the modes with lag and in those without it.
    with_lag: AxisSettings,
    without_lag: AxisSettings,
}

impl<B: Bus + Clone, H: Hardware> Motion<B, H> {
    /// A motor side at rest: torque-free, CP0, position zero where the encoder stands.
    #[inline(never)]
    pub fn new(
        bus: B,
        address: u8,
        mut hardware: H,
        link: &'static CurrentLink,
        scope: &'static mut Scope,
        settings: &DriveSettings,
    ) -> Self {
        let &DriveSettings { with_lag, without_lag, motor, motion: settings } = settings;
        let encoder = DoubleSampledEncoder::new(settings.encoder, hardware.encoder_count());
        hardware.set_bridge(false);
        hardware.set_brake(false);
        let inputs = hardware.inputs();
        let position = encoder.position();
        Self {
            until_supervision: 1,
            accompanied: false,
            encoder,
            output: AxisOutput::at_rest(position),
            axis: Axis::new(with_lag, position),
            motor: Motor::new(link, motor),
            clock: RingClock::new(settings.cycle.clock),
            status: Status::default(),
            operation: Operation::default(),
            hardware,
            ring: RingSide::new(bus, address),
            clock_monitor: ClockMonitor::new(),
            inputs,
            shown: ShownValues::default(),
            positioning: Positioning::default(),
            positive_stop: PositiveStop::default(),
            reference: Reference::default(),
            controls: ControlBits::default(),
            function: Function::default(),
            probing: Probing::default(),
            oscilloscope: Oscilloscope::new(scope),
            halves: 0,
            cyclic_limits: CyclicLimits::default(),
            settings,
            with_lag,
            without_lag,
        }
    }

    /// Task of t3 (CP3, CP4): the MDT record of this cycle becomes active. In CP1 and CP2, when the window of the MDT is over:
    /// arms the one AT that answers an MDT to this drive.
    ///
    /// Contract: at most 15 us at 168 MHz from the interrupt to the command in force, with the slowest bus timing; 5 to 8 bus
    /// accesses. The emulator measures it.
    pub fn command_valid(&mut self) -> Tasks {
        match self.ring.phase() {
            Phase::Cp0 => Tasks::empty(),
            Phase::Cp1 | Phase::Cp2 => {
                self.ring.answer();
                self.clock.close_cycle();
                self.refresh_values(self.encoder.position());
                let status = self.status_word();
                self.ring.show_initial_status(status);
                Tasks::empty()
            }
            Phase::Cp3 | Phase::Cp4 => {
                self.clock.on_t3(self.settings.cycle.ticks_to_overdue);
                self.clock_monitor.take(self.clock.phase_error(), self.clock.is_locked());
                self.take_cycle()
            }
        }
    }

    /// Task of t4: position latched by hardware, status word and cyclic data written into the record of the next AT.
    ///
    /// Contract: within t5 (S-0-0005, 30 us) from the interrupt to the last word written, with the task of t3 in between; 2 to 18
    /// bus accesses. The emulator measures it.
    pub fn capture_feedback(&mut self) {
        let position = self.encoder.position_of(self.counted(self.clock.latch()));
        self.refresh_values(position);
        let status = self.status_word();
        self.ring.show_status(status);
        let (mut index, mut word) = (0_usize, 0_u16);
        while let Some(Datum { signal, words }) = self.ring.feedback(index) {
            let value = self.signal(signal);
            word = self.ring.show(word, words, value);
            index = index.wrapping_add(1);
        }
        self.clock.close_cycle();
    }

    /// Task of the loop tick, every 125 us, started by the current loop: position, velocity and torque, and the order to the current loop.
    ///
    /// Contract: done before the current loop's second cycle of the tick, 62.5 us after the one that started it, with t3, t4 and a half of the
    /// supervision in between; then the order acts in it. No bus access but when a t3 event is overdue.
    pub fn control_loop(&mut self) -> Tasks {
        let [before, now] = self.motor.take_counts();
        let count = self.counted(now);
        let mut position = self.encoder.update(self.counted(before), count);
        // A counter that says what no shaft does must not wait for the supervision.
        if let Some(faults) = self.motor.watch_motion(count, self.operation.state().has_torque()) {
            self.take_jump(faults);
        }
        let mut work = Tasks::empty();
        if self.accompanied {
            work = self.accompany();
            // Homing may just have moved the zero.
            position = self.encoder.position();
        }
        let latest = self.encoder.velocity(self.counted(before), count);
        self.output = self.axis.tick(position, latest, self.motor.torque_limits());
        let trim = self.clock.on_tick();
        self.motor.command(position, self.output.current, self.output.loop_velocity, trim);
        if self.accompanied {
            self.record(position);
        }
        self.until_supervision = self.until_supervision.wrapping_sub(1);
        if self.until_supervision == 0 {
            self.until_supervision = TICKS_TO_NEXT_HALF;
            work |= Tasks::SUPERVISION;
        }
        if self.clock.is_overdue(self.settings.cycle.ticks_per_cycle) {
            work |= self.take_cycle();
        }
        work
    }

    /// Task of the second half of a loop tick, started by the current loop's second cycle: the velocity loop once more, and its correction of the
    /// order that is in force. A board whose current loop has one cycle a tick has no use for it.
    ///
    /// Contract: done before the next cycle of the current loop, 62.5 us after the one that started it, with t3 and t4 in between. No bus
    /// access.
    pub fn velocity_loop(&mut self) {
        let [before, now] = self.motor.half_counts();
        let latest = self.encoder.velocity(self.counted(before), self.counted(now));
        if let Some(current) = self.axis.half_tick(latest, self.motor.torque_limits()) {
            self.motor.correct(current);
        }
    }

    /// What goes along with the loops at their rate, but seldom: the search for the commutation angle, homing, an identification.
    #[cold]
    fn accompany(&mut self) -> Tasks {
        self.motor.measure();
        if self.motor.is_searching() && self.operation.bridge_is_on(&mut self.hardware) {
            self.motor.search(self.encoder.position());
        }
        let homed = self.home();
        self.identify();
        if homed { Tasks::SERVICE_CHANNEL } else { Tasks::empty() }
    }

    /// Keeps the phase that the edge of t3 on this interrupt line has to the loop tick; to be called before the interrupt is acknowledged.
    #[inline]
    pub fn take_edge(&mut self, line: InterruptLine) {
        self.clock.take_edge(self.hardware.edge_phase(line));
    }

    /// See [`Hardware::edge_waits`].
    #[inline]
    pub fn edge_waits(&mut self, line: InterruptLine) -> bool {
        self.hardware.edge_waits(line)
    }

    /// Keeps the encoder position that the hardware latched at the edge of t4 on this interrupt line; to be called before the interrupt is
    /// acknowledged.
    #[inline]
    pub fn take_latch(&mut self, line: InterruptLine) {
        self.clock.take_latch(self.hardware.encoder_latch(line));
    }

    /// Takes the position of this moment where the latch of an interrupt edge is missing (polled events).
    pub fn latch_now(&mut self) {
        self.clock.take_latch(self.hardware.encoder_count());
        self.clock.take_edge(self.hardware.phase_now());
    }

    /// What one communication cycle brought: supervision, control word, command values.
    fn take_cycle(&mut self) -> Tasks {
        match self.ring.take_cycle() {
            Cycle::WithCommands => self.take_commands(),
            Cycle::WithoutCommands => Tasks::empty(),
            Cycle::Lost(error) => self.lose(error),
        }
    }

    fn take_commands(&mut self) -> Tasks {
        let fresh = self.ring.take_commands(self.settings.cycle.cycles_per_command, &mut self.cyclic_limits);
        if self.ring.passes_on() {
            self.pass_on(self.ring.carries_target(), self.ring.carries_signals());
        }
        let control_word = self.ring.commands().control_word;
        self.controls.take_control_word(&self.settings.bits, control_word);
        let mut work = Tasks::empty();
        match self.operation.take_control_word(control_word, &self.settings.modes) {
            Selection::Kept => {}
            Selection::Changed(mode) => self.change_mode(mode),
            Selection::Missing { selected } => work = self.refuse_mode(selected),
        }
        if self.operation.would_switch_on(|| self.conditions()) {
            self.look_before_switching_on();
        }
        self.update_state();
        if self.cyclic_limits.is_carried() {
            self.obey_limits();
        }
        if self.positioning.is_active() {
            self.position_to_target();
        }
        if fresh {
            self.axis.command_velocity(self.ring.commands().velocity(&self.settings));
            if let Err(jump) = self.axis.command_position(self.ring.commands().position(&self.settings)) {
                // Stops the axis, from as fast as it is, in place of taking the command.
                self.fail(errors_of(jump));
            }
        }
        // A torque command is no point of a path: nothing is interpolated.
        self.axis.command_torque(self.ring.commands().torque(&self.settings));
        work
    }

    /// What others have to do about S-0-0258 and S-0-0145.
    #[inline(never)]
    fn pass_on(&mut self, target: bool, signals: bool) {
        if target {
            self.positioning.target_is_written();
        }
        if signals {
            self.controls.take_signal_control(&self.settings.bits, self.ring.commands().signal_control);
        }
    }

    /// The motor stops with C1D bit 12 and S-0-0014 bit 9, told once, and again after S-0-0099. The ring goes on.
    #[cold]
    fn refuse_mode(&mut self, selected: u8) -> Tasks {
        if self.operation.misses_its_mode(self.status.class_1().contains(Class1::COMMUNICATION)) {
            self.lose(PhaseError::UninitialisedMode { selected })
        } else {
            Tasks::empty()
        }
    }

    /// A drive that is to be switched on far from its command stays off: neither the torque nor the brake has to come for it.
    ///
    /// A drive that stays off anyway is not asked: commands may run away from it, and after an error they do.
    #[cold]
    fn look_before_switching_on(&mut self) {
        // A movement of the drive's own begins where the axis stands.
        let positioned = matches!(
            self.operation.mode(),
            None | Some(OperationMode::PositionWithLag | OperationMode::PositionWithoutLag)
        );
        if !positioned {
            return;
        }
        if let Err(jump) = self.axis.would_follow(self.ring.commands().position(&self.settings)) {
            self.take(errors_of(jump));
        }
    }

    #[cold]
    fn lose(&mut self, error: PhaseError) -> Tasks {
        self.ring.lose(error);
        self.communication_fault();
        Tasks::PHASE_CHANGE
    }

    #[cold]
    #[inline(never)]
    fn take_jump(&mut self, faults: MotorFaults) {
        self.fail(faults.into());
    }

    /// Errors whose consequences cannot wait for the next look at the state.
    #[inline]
    fn fail(&mut self, findings: Findings) {
        self.take(findings);
        self.update_state();
    }

    /// Steps the state machine and puts its state into axis, bridge and brake.
    fn update_state(&mut self) {
        let before = self.operation.state();
        let conditions = self.conditions();
        let state = self.operation.step(self.function.holds(), conditions);
        if state != DriveState::Halted && self.function.interrupt_identification() {
            self.motor.hold(None);
        }
        if self.cyclic_limits.is_carried() {
            self.choose_limits(state);
        }
        if self.positioning.is_concerned(self.operation.mode()) {
            self.watch_positioning();
        }
        let mode = self.operation.axis_mode(self.motor.commutates(), self.settings.reaction, &self.function, || {
            self.positioning.is_active()
        });
        if mode != self.axis.mode() {
            // An axis that stands although it is to move, because it is blocked, has a ramp before it.
            self.output.standstill &= self.output.velocity_command.abs() <= self.settings.standstill_window;
            self.axis.set_mode(mode);
            // Between two commands bit 3 of the status word says that the drive follows before the next one comes.
            self.axis.note_standing_command(self.ring.commands().position(&self.settings));
            self.positioning.begin_again();
        }
        if state != before && !state.has_torque() {
            self.operation.switch_off(&mut self.hardware);
        }
    }

    /// Puts an operation mode into force; its state follows with [`Motion::update_state`].
    #[cold]
    fn change_mode(&mut self, mode: Option<OperationMode>) {
        let without_lag = self.operation.is_without_lag();
        self.operation.set_mode(mode);
        if self.operation.is_without_lag() != without_lag {
            self.apply_axis_settings();
        }
    }

    /// A count in the direction of positive current (S-0-0277).
    const fn counted(&self, count: u32) -> u32 {
        count.wrapping_mul(self.motor.direction())
    }

    /// What is shown from now on is `position` and what the loops gave in their last tick.
    #[inline]
    fn refresh_values(&mut self, position: Position) {
        self.shown = ShownValues::at(position, &self.output, self.motor.torque_current());
    }

    fn apply_axis_settings(&mut self) {
        let before = self.axis.settings().velocity_limits();
        let without_lag = self.operation.is_without_lag();
        self.axis.apply_settings(if without_lag { &self.without_lag } else { &self.with_lag });
        self.keep_limits(before);
    }
}

/// The supervision comes by halves.
const TICKS_TO_NEXT_HALF: u8 = (LOOP_TICKS_PER_SUPERVISION / 2) as u8;

/// What a command is that jumps. It is never taken: an error comes before anything moves towards it.
///
/// Following begins wherever the axis comes into [`servo::axis::Mode::Position`]: switched on, at the end of HALT, of homing, of an identification
/// or of a positioning, with another mode of operation, or when bit 15 comes back during a stop. There the interpolator starts at the shaft,
/// and the first command must lie within S-0-0159 of it; each later one within a step of the one before.
fn errors_of(jump: CommandJump) -> Findings {
    let mut findings = Findings::default();
    match jump {
        CommandJump::FarFromAxis { .. } => findings.class_1 = Class1::EXCESSIVE_DEVIATION,
        CommandJump::Step { .. } => findings.add_own(Manufacturer1::COMMAND_JUMP, false),
    }
    findings
}
