//! The hot tasks of the drive: command values at t3, feedback at t4, the loops every 125 us, the supervision every 500 us. The current loop
//! runs above them, see [`crate::CurrentControl`].
//!
//! All four run at one priority and share [`Motion`] without locks. The background tasks (phase change, service channel)
//! take it under a short lock to hand over settings or to read a snapshot.
//!
//! What the loops themselves need stays in the loop tick. All that looks after them (bus, loads, temperatures, brake, state machine,
//! diagnostic words) has time constants of milliseconds and its own, slower task.

use sercon816::{Bus, CommandPort, FeedbackPort};
use sercos::Phase;
use sercos::command::CommandState;
use sercos::diagnostic::{Class1, Class2, Class3};
use sercos::phase::PhaseError;
use sercos::supervision::Supervision;
use servo::axis::{Axis, AxisOutput, Limiting, Mode};
use servo::clock::LoopClock;
use servo::encoder::TwiceReadEncoder;
use servo::monitor::RangeMonitor;
use servo::motor::{CurrentLink, Motor, Progress};
use servo::scope::Scope;
use servo::units::LOOP_TICKS_PER_SUPERVISION;

mod background;
mod clock_monitor;
mod coordinates;
mod cycle;
mod following;
mod identifying;
mod limiting;
mod positioning;
mod positive_stop;
mod range;
mod recording;
mod supervision;
mod travel;
mod words;

use clock_monitor::ClockMonitor;
use positioning::Positioning;
use positive_stop::PositiveStop;
pub(crate) use travel::HomingFailure;
use travel::{HomingRun, ProbeRun};

use crate::diagnosis::{Manufacturer1, Manufacturer2, Manufacturer3};
use crate::feedback::ShownValues;
use crate::hardware::{Hardware, Inputs, InterruptLine};
use crate::identification::{Identification, Outcome};
use crate::limits::CyclicLimits;
use crate::mst::MstMonitor;
use crate::operation_mode::{OperationMode, Reaction};
use crate::oscilloscope::Oscilloscope;
use crate::settings::MotionSettings;
use crate::signal::record::{Datum, Records};
use crate::state::{DriveState, StateMachine, Switches};
use crate::work::Work;

/// The cyclic command values as they came last, each in the weight of its IDN.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CommandValues {
    /// S-0-0134, the control word with its service bits.
    pub control_word: u16,
    /// S-0-0036.
    pub velocity: i32,
    /// S-0-0037.
    pub additive_velocity: i32,
    /// S-0-0047.
    pub position: i32,
    /// S-0-0048.
    pub additive_position: i32,
    /// S-0-0080.
    pub torque: i16,
    /// S-0-0081.
    pub additive_torque: i16,
    /// S-0-0145.
    pub signal_control: u16,
    /// S-0-0258.
    pub target_position: i32,
    /// S-0-0282.
    pub positioning_value: i32,
    /// S-0-0346.
    pub positioning_control: u16,
}

impl CommandValues {
    /// The values that make a point of a path: with one of them changed, the control unit has given a new one.
    const fn path(&self) -> (i32, i32, i32, i32) {
        (self.velocity, self.additive_velocity, self.position, self.additive_position)
    }
}

/// The motor side of the drive and the cyclic half of the bus.
///
/// Laid out as declared: what every loop tick touches comes first, where an instruction reaches it without an address of its own.
#[repr(C)]
#[derive(Debug)]
pub struct Motion<B, H: Hardware> {
    /// Loop ticks until a t3 event is overdue; 0 outside the cyclic phases.
    until_overdue: u16,
    /// Loop ticks until the next look of the supervision.
    until_supervision: u8,
    /// Something goes along with the loops, see [`Motion::accompany`], or the oscilloscope records; found out by the supervision.
    accompanied: bool,
    class_1: Class1,
    encoder: TwiceReadEncoder,
    clock: LoopClock,
    /// What the loops gave in the last tick.
    output: AxisOutput,
    axis: Axis,
    motor: Motor<H::Board>,
    machine: StateMachine,
    hardware: H,
    /// The bridge as it was last set.
    bridge_on: bool,
    command_port: CommandPort<B>,
    feedback_port: FeedbackPort<B>,
    mst: MstMonitor<B>,
    clock_monitor: ClockMonitor,
    records: Records,
    inputs: Inputs,
    progress: Progress,
    /// What limits the drive right now (P-0-0160).
    limiting: Limiting,
    /// Ticks of the supervision for which the two channels of safe torque off have differed.
    channels_differ: u16,
    /// Phase of the last edge of t3.
    edge_phase: u16,
    /// Of the last MDT; `None` until one has come in this phase.
    switches: Option<Switches>,
    mode: Option<OperationMode>,
    phase: Phase,
    commands: CommandValues,
    shown: ShownValues,
    supervision: Supervision,
    lost: Option<PhaseError>,
    /// The control asks for a mode that is not set.
    uninitialised_mode: bool,
    /// Control word bits 11, 9, 8 of the mode in force.
    mode_bits: u16,
    class_2: Class2,
    class_3: Class3,
    manufacturer_1: Manufacturer1,
    manufacturer_2: Manufacturer2,
    manufacturer_3: Manufacturer3,
    class_2_change: bool,
    class_3_change: bool,
    /// State and diagnostic words that the background has been told of.
    told: (DriveState, Class1, Class2),
    oscilloscope: Oscilloscope<'static>,
    /// P-0-0224, P-0-0225 or P-0-0226 is under way.
    identification: Option<Identification>,
    /// What came of it, until the background has asked.
    identified: Option<Outcome>,
    /// P-0-0227.
    identification_percent: u8,
    /// P-0-0019 in the low half, the enable bits of S-0-0400 and S-0-0405 to S-0-0407 above.
    controlled: u32,
    homing_run: HomingRun,
    probe_run: ProbeRun,
    positioning: Positioning,
    /// S-0-0403 bit 0.
    referenced: bool,
    /// S-0-0049 and S-0-0050, while they are in force.
    range_monitor: Option<RangeMonitor>,
    /// S-0-0148 holds the position until it is cancelled.
    homing: bool,
    /// S-0-0149.
    positive_stop: PositiveStop,
    /// How it has ended, until the service channel has taken it.
    positive_stop_result: Option<CommandState>,
    /// Ticks of the supervision for which a lost telegram is still a warning.
    loss_shown: u16,
    /// Ticks of the supervision since the start.
    supervisions: u64,
    diagnostic_number: u16,
    interface_status: u16,
    latch: u32,
    fatal: bool,
    without_lag: bool,
    /// Cycles since a command value was last handed to the axis.
    cycles_since_command: u16,
    /// Ticks of the supervision for which somebody still waits for the loop clock to lock, see [`Motion::wait_for_lock`].
    lock_patience: u16,
    /// CP3 was entered in this cycle.
    entered_cyclic: bool,
    /// Limits of the MDT.
    cyclic_limits: CyclicLimits,
    settings: MotionSettings,
}

impl<B: Bus + Clone, H: Hardware> Motion<B, H> {
    /// A motor side at rest: torque-free, CP0, position zero where the encoder stands.
    pub fn new(
        bus: B,
        address: u8,
        mut hardware: H,
        link: &'static CurrentLink,
        scope: &'static mut Scope,
        settings: MotionSettings,
    ) -> Self {
        let encoder = TwiceReadEncoder::new(settings.encoder, hardware.encoder_count());
        hardware.set_bridge(false);
        hardware.set_brake(false);
        let inputs = hardware.inputs();
        let position = encoder.position();
        Self {
            hardware,
            command_port: CommandPort::new(bus.clone(), address),
            feedback_port: FeedbackPort::new(bus.clone()),
            mst: MstMonitor::new(bus),
            axis: Axis::new(settings.with_lag, position),
            encoder,
            clock: LoopClock::new(settings.cycle.clock),
            clock_monitor: ClockMonitor::default(),
            settings,
            records: Records::default(),
            machine: StateMachine::default(),
            motor: Motor::new(link, settings.motor),
            inputs,
            progress: Progress::default(),
            bridge_on: false,
            output: AxisOutput::at_rest(position),
            limiting: Limiting::empty(),
            accompanied: false,
            until_supervision: 1,
            channels_differ: 0,
            edge_phase: 0,
            switches: None,
            mode: None,
            phase: Phase::Cp0,
            commands: CommandValues::default(),
            shown: ShownValues::default(),
            supervision: Supervision::new(),
            lost: None,
            uninitialised_mode: false,
            mode_bits: 0,
            class_1: Class1::empty(),
            class_2: Class2::empty(),
            class_3: Class3::empty(),
            manufacturer_1: Manufacturer1::empty(),
            manufacturer_2: Manufacturer2::empty(),
            manufacturer_3: Manufacturer3::empty(),
            class_2_change: false,
            class_3_change: false,
            told: (DriveState::Off, Class1::empty(), Class2::empty()),
            oscilloscope: Oscilloscope::new(scope),
            identification: None,
            identified: None,
            identification_percent: 0,
            controlled: 0,
            homing_run: HomingRun::default(),
            probe_run: ProbeRun::default(),
            positioning: Positioning::default(),
            referenced: false,
            range_monitor: None,
            homing: false,
            positive_stop: PositiveStop::Inactive,
            positive_stop_result: None,
            loss_shown: 0,
            supervisions: 0,
            diagnostic_number: 0,
            interface_status: 0,
            latch: 0,
            until_overdue: 0,
            fatal: false,
            without_lag: false,
            cycles_since_command: 0,
            lock_patience: 0,
            entered_cyclic: false,
            cyclic_limits: CyclicLimits::default(),
        }
    }

    /// Task of t3 (CP3, CP4): the MDT record of this cycle becomes active. In CP1 and CP2, when the window of the MDT is over:
    /// arms the one AT that answers an MDT to this drive.
    ///
    /// Contract: at most 15 us at 168 MHz from the interrupt to the command in force, with the slowest bus timing; 5 to 8 bus
    /// accesses. The emulator measures it.
    pub fn command_valid(&mut self) -> Work {
        match self.phase {
            Phase::Cp0 => Work::empty(),
            Phase::Cp1 | Phase::Cp2 => {
                let addressed = self.command_port.take_initial();
                self.command_port.answer_once(addressed);
                self.refresh_values(self.encoder.position());
                let status = self.status_word();
                self.feedback_port.set_initial_status(status);
                Work::empty()
            }
            Phase::Cp3 | Phase::Cp4 => {
                self.clock.on_t3(self.edge_phase);
                self.clock_monitor.take(self.clock.phase_error(), self.clock.is_locked());
                self.until_overdue = self.settings.cycle.ticks_to_overdue;
                self.take_cycle()
            }
        }
    }

    /// Task of t4: position latched by hardware, status word and cyclic data written into the record of the next AT.
    ///
    /// Contract: within t5 (S-0-0005, 30 us) from the interrupt to the last word written, with the task of t3 in between; 2 to 18
    /// bus accesses. The emulator measures it.
    pub fn capture_feedback(&mut self) {
        let position = self.encoder.position_of(self.counted(self.latch));
        self.refresh_values(position);
        let status = self.status_word();
        self.feedback_port.set_status(status);
        let mut word = 0;
        for &Datum { signal, words } in &self.records.feedback {
            let value = self.signal(signal);
            if words == 2 {
                self.feedback_port.set_double_word(word, value);
            } else {
                self.feedback_port.set_word(word, (value & 0xFFFF) as u16);
            }
            word = word.wrapping_add(words);
        }
    }

    /// Task of the loop tick, every 125 us, started by the current loop: position, velocity and torque, and the order to the current loop.
    ///
    /// Contract: done before the current loop's second cycle of the tick, 62.5 us after the one that started it, with t3 or t4 in between;
    /// then the order acts in it. No bus access but when a t3 event is overdue.
    pub fn control_loop(&mut self) -> Work {
        let [before, now] = self.motor.take_counts();
        let count = self.counted(now);
        let mut position = self.encoder.update(self.counted(before), count);
        self.watch_encoder(count);
        let mut work = Work::empty();
        if self.accompanied {
            work = self.accompany();
            // Homing may just have moved the zero.
            position = self.encoder.position();
        }
        self.output = self.axis.tick(position, self.motor.torque_limits());
        if self.output.excessive_deviation && !self.expects_a_stop() {
            self.class_1 |= Class1::EXCESSIVE_DEVIATION;
        }
        let trim = self.clock.on_tick();
        self.motor.command(position, self.output.current, self.output.loop_velocity, trim);
        if self.accompanied {
            self.record(position);
        }
        self.until_supervision = self.until_supervision.wrapping_sub(1);
        if self.until_supervision == 0 {
            self.until_supervision = LOOP_TICKS_PER_SUPERVISION as u8;
            work |= Work::SUPERVISION;
        }
        if self.until_overdue != 0 {
            work |= self.flywheel();
        }
        work
    }

    /// What goes along with the loops at their rate, but seldom: the search for the commutation angle, homing, an identification.
    #[cold]
    fn accompany(&mut self) -> Work {
        self.motor.measure();
        self.align();
        let homed = self.home();
        self.identify();
        if homed { Work::SERVICE_CHANNEL } else { Work::empty() }
    }

    /// The drive goes to a target by itself, or waits in HALT to go on.
    const fn is_positioning(&self) -> bool {
        self.positioning.is_active()
    }

    /// Keeps the phase that the edge of t3 on this interrupt line has to the loop tick; to be called before the interrupt is acknowledged.
    #[inline]
    pub fn take_edge(&mut self, line: InterruptLine) {
        self.edge_phase = self.hardware.edge_phase(line);
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
        self.latch = self.hardware.encoder_latch(line);
    }

    /// Takes the position of this moment where the latch of an interrupt edge is missing (polled events).
    pub fn latch_now(&mut self) {
        self.latch = self.hardware.encoder_count();
        self.edge_phase = self.hardware.phase_now();
    }

    /// Steps the state machine and puts its state into axis, bridge and brake.
    fn update_state(&mut self) {
        let before = self.machine.state();
        let conditions = self.conditions();
        // A homing that is not cancelled holds the drive as HALT does.
        let switches = self.switches.unwrap_or_default();
        let switches = Switches { run: switches.run && !self.homing, ..switches };
        let state = self.machine.update(switches, conditions);
        if state != DriveState::Halted {
            self.abandon_identification();
        }
        if self.cyclic_limits.is_carried() {
            self.choose_limits(state);
        }
        self.watch_positioning(state);
        let mode = match (state, self.mode) {
            (DriveState::Off | DriveState::Fault, _) => Mode::Off,
            // Without an angle there is no torque that a loop could use.
            (DriveState::SwitchingOn, _) if !self.motor.commutates() => Mode::Off,
            (DriveState::FaultReaction, _) if self.settings.reaction == Reaction::TorqueLimit => Mode::Braking,
            (DriveState::SwitchingOff | DriveState::FaultReaction, _) => Mode::Stopping,
            (DriveState::Halted, _) if self.identification.is_some() => self.identification_mode(),
            (DriveState::Following | DriveState::Halted, _) if self.is_travelling_home() => Mode::Travel,
            (DriveState::Halted | DriveState::SwitchingOn | DriveState::Engaging, _) => Mode::Halt,
            (DriveState::Following, Some(OperationMode::Torque)) => Mode::Torque,
            (DriveState::Following, Some(OperationMode::Velocity)) => Mode::Velocity,
            (DriveState::Following, _) if self.is_positioning() => Mode::Travel,
            (DriveState::Following, _) => Mode::Position,
        };
        if mode != self.axis.mode() {
            // An axis that stands although it is to move, because it is blocked, has a ramp before it.
            self.output.standstill &= self.output.velocity_command.abs() <= self.settings.standstill_window;
            self.axis.set_mode(mode);
            self.positioning.begin_again();
        }
        if state != before && !state.has_torque() {
            self.set_bridge(false);
            self.hardware.set_brake(false);
        }
    }

    /// Puts an operation mode into force; its state follows with [`Motion::update_state`].
    #[cold]
    fn change_mode(&mut self, mode: Option<OperationMode>) {
        self.mode = mode;
        let without_lag = mode.is_some_and(OperationMode::is_without_lag);
        if without_lag != self.without_lag {
            self.without_lag = without_lag;
            self.apply_axis_settings();
        }
    }

    /// A count in the direction of positive current (S-0-0277).
    const fn counted(&self, count: u32) -> u32 {
        count.wrapping_mul(self.motor.direction())
    }

    fn apply_axis_settings(&mut self) {
        let before = self.axis.settings().velocity_limits();
        self.axis.apply_settings(if self.without_lag { self.settings.without_lag } else { self.settings.with_lag });
        self.keep_limits(before);
    }
}
