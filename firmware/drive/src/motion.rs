//! The hot tasks of the loop tick: command values at t3, feedback at t4, the loops every 125 us. The current loop runs above them,
//! see [`crate::CurrentControl`].
//!
//! All three run at one priority and share [`Motion`] without locks. The background tasks (phase change, service channel)
//! take it under a short lock to hand over settings or to read a snapshot.

use sercon816::{Bus, CommandPort, FeedbackPort};
use sercos::Phase;
use sercos::diagnostic::{Class1, Class2, Class3};
use sercos::phase::PhaseError;
use sercos::supervision::Supervision;
use servo::{Axis, CurrentFraction, Encoder, Limiting, LoopClock, Mode, Position, Scope, Velocity};

mod background;
mod clock_monitor;
mod cycle;
mod identifying;
mod recording;
mod travel;
mod words;

pub(crate) use background::MotorValue;
use clock_monitor::ClockMonitor;
pub(crate) use travel::{HOME_SWITCH, HOMING_ENABLE, HomingFailure, PROBE_1_ENABLE, PROBE_2_ENABLE};
use travel::{HomingRun, ProbeRun};

use crate::diagnosis::{Manufacturer1, Manufacturer2, Manufacturer3};
use crate::feedback::{MeasuredValues, ShownValues};
use crate::hardware::{Hardware, Inputs, InterruptLine};
use crate::identification::{Identification, Outcome};
use crate::link::CurrentLink;
use crate::motor::{Findings, Motor, Progress, Sequence, SequenceInputs, Surroundings};
use crate::mst::MstMonitor;
use crate::oscilloscope::Oscilloscope;
use crate::record::Records;
use crate::settings::{MotionSettings, OperationMode, Reaction};
use crate::state::{Conditions, DriveState, StateMachine, Switches};
use crate::work::Work;

/// So long the two channels of safe torque off may differ, in loop ticks: relays do not switch at the same instant.
const CHANNELS_DIFFER_TICKS: u16 = 800;

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
    /// S-0-0080 in 0.1 % of S-0-0111.
    pub torque: i16,
    /// S-0-0081 in 0.1 % of S-0-0111.
    pub additive_torque: i16,
    /// S-0-0145.
    pub signal_control: u16,
    /// S-0-0258.
    pub target_position: i32,
}

impl CommandValues {
    /// The values that make a point of a path: with one of them changed, the control unit has given a new one.
    const fn path(&self) -> (i32, i32, i32, i32) {
        (self.velocity, self.additive_velocity, self.position, self.additive_position)
    }
}

/// The motor side of the drive and the cyclic half of the bus.
#[derive(Debug)]
pub struct Motion<B, H> {
    hardware: H,
    command_port: CommandPort<B>,
    feedback_port: FeedbackPort<B>,
    mst: MstMonitor<B>,
    settings: MotionSettings,
    axis: Axis,
    encoder: Encoder,
    clock: LoopClock,
    clock_monitor: ClockMonitor,
    records: Records,
    machine: StateMachine,
    motor: Motor,
    inputs: Inputs,
    progress: Progress,
    /// The bridge as it was last set.
    bridge_on: bool,
    /// What the loops gave in the last tick.
    torque_command: CurrentFraction,
    velocity_command: Velocity,
    /// What limits the drive right now (P-0-0160).
    limiting: Limiting,
    /// Ticks for which the two channels of safe torque off have differed.
    channels_differ: u16,
    /// Phase of the last edge of t3.
    edge_phase: u16,
    switches: Switches,
    mode: Option<OperationMode>,
    phase: Phase,
    commands: CommandValues,
    values: MeasuredValues,
    shown: ShownValues,
    supervision: Supervision,
    lost: Option<PhaseError>,
    uninitialised_mode: bool,
    class_1: Class1,
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
    /// An identification has moved the axis: the first command after HALT is looked at before it is followed.
    displaced: bool,
    /// P-0-0019 in the low half, the enable bits of S-0-0400 and S-0-0405 to S-0-0407 above.
    controlled: u32,
    homing_run: HomingRun,
    probe_run: ProbeRun,
    /// S-0-0258 and the place that it means.
    target: Option<(i32, Position)>,
    /// The movement of the drive itself has reached its target.
    travelled: bool,
    /// S-0-0403 bit 0.
    referenced: bool,
    /// S-0-0148 holds the position until it is cancelled.
    homing: bool,
    /// Homing has just ended with torque on: the next command is looked at before it is followed.
    resuming: bool,
    /// Loop ticks for which a lost telegram is still a warning.
    loss_shown: u16,
    /// Loop ticks since the start.
    ticks: u64,
    diagnostic_number: u16,
    interface_status: u16,
    latch: u32,
    /// Loop ticks since the last t3 event, or since the flywheel stood in for one.
    ticks_since_t3: u16,
    fatal: bool,
    without_lag: bool,
    /// Cycles since a command value was last handed to the axis.
    cycles_since_command: u16,
    /// Ticks for which somebody still waits for the loop clock to lock, see [`Motion::wait_for_lock`].
    lock_patience: u16,
    /// CP3 was entered in this cycle.
    entered_cyclic: bool,
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
        let encoder = Encoder::new(settings.encoder, hardware.encoder_count());
        hardware.set_bridge(false);
        hardware.set_brake(false);
        let inputs = hardware.inputs();
        Self {
            hardware,
            command_port: CommandPort::new(bus.clone(), address),
            feedback_port: FeedbackPort::new(bus.clone()),
            mst: MstMonitor::new(bus),
            axis: Axis::new(settings.with_lag, encoder.position()),
            encoder,
            clock: LoopClock::new(settings.clock),
            clock_monitor: ClockMonitor::default(),
            settings,
            records: Records::default(),
            machine: StateMachine::default(),
            motor: Motor::new(link, settings.motor),
            inputs,
            progress: Progress::default(),
            bridge_on: false,
            torque_command: CurrentFraction::ZERO,
            velocity_command: Velocity::ZERO,
            limiting: Limiting::empty(),
            channels_differ: 0,
            edge_phase: 0,
            switches: Switches::default(),
            mode: None,
            phase: Phase::Cp0,
            commands: CommandValues::default(),
            values: MeasuredValues::default(),
            shown: ShownValues::default(),
            supervision: Supervision::new(),
            lost: None,
            uninitialised_mode: false,
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
            displaced: false,
            controlled: 0,
            homing_run: HomingRun::default(),
            probe_run: ProbeRun::default(),
            target: None,
            travelled: true,
            referenced: false,
            homing: false,
            resuming: false,
            loss_shown: 0,
            ticks: 0,
            diagnostic_number: 0,
            interface_status: 0,
            latch: 0,
            ticks_since_t3: 0,
            fatal: false,
            without_lag: false,
            cycles_since_command: 0,
            lock_patience: 0,
            entered_cyclic: false,
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
                self.ticks_since_t3 = 0;
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
        for &signal in &self.records.feedback {
            let value = self.signal(signal);
            if signal.words() == 2 {
                self.feedback_port.set_double_word(word, value);
            } else {
                self.feedback_port.set_word(word, (value & 0xFFFF) as u16);
            }
            word = word.wrapping_add(signal.words());
        }
    }

    /// Task of the loop tick, every 125 us, started by the current loop: looks after the motor side, steps the state machine and the
    /// loops, and gives the current loop its order.
    ///
    /// Contract: done before the next tick, 125 us later, with the tasks of the chip in between; 28 us when nothing is in between, so that the
    /// current loop's second cycle of the tick has the order. No bus access but when a t3 event is overdue.
    pub fn control_loop(&mut self) -> Work {
        self.ticks = self.ticks.wrapping_add(1);
        self.inputs = self.hardware.inputs();
        let count = self.motor.measure().count;
        let _ = self.encoder.update(self.counted(count));
        let index = self.hardware.index_latch().map(|latch| self.counted(latch));
        self.look_after_the_motor(index);
        self.update_state();
        let index = index.map(|count| self.encoder.position_of(count));
        self.step_sequence(index);
        let homed = self.home(index);
        self.probe();
        if self.is_positioning() {
            self.position_to_target();
        }
        // Only now: homing may just have moved the zero.
        let position = self.encoder.position();
        self.identify(position);
        let output = self.axis.tick(position, self.motor.torque_limits());
        if output.excessive_deviation {
            self.class_1 |= Class1::EXCESSIVE_DEVIATION;
        }
        let trim = self.clock.on_tick();
        self.motor.command(position, output.current, output.loop_velocity, trim);
        self.torque_command = output.current;
        self.velocity_command = output.velocity_command;
        self.limiting = output.limiting | self.motor.limiting();
        self.travelled = output.travelled;
        self.values.take_output(&output, self.motor.torque_current());
        self.refresh_words(&output);
        self.record(position, &output);
        let homed = if homed { Work::SERVICE_CHANNEL } else { Work::empty() };
        self.flywheel() | self.tell_lock() | self.tell_news() | homed
    }

    /// The drive follows S-0-0258 by itself.
    fn is_positioning(&self) -> bool {
        self.axis.mode() == Mode::Travel && !self.homing
    }

    /// Keeps the phase that the edge of t3 on this interrupt line has to the loop tick; to be called before the interrupt is acknowledged.
    #[inline]
    pub fn take_edge(&mut self, line: InterruptLine) {
        self.edge_phase = self.hardware.edge_phase(line);
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

    fn conditions(&self) -> Conditions {
        Conditions {
            operating_phase: self.phase == Phase::Cp4
                && self.lost.is_none()
                && !self.manufacturer_3.contains(Manufacturer3::PARKED),
            power: self.motor.has_power(&self.inputs) && self.inputs.bridge_ready && self.permits_torque(),
            fault: !self.class_1.is_empty(),
            fatal: self.fatal || (!self.class_1.is_empty() && self.settings.reaction == Reaction::TorqueFree),
            standstill: self.class_3.contains(Class3::STANDSTILL),
            released: self.progress.released,
            torque_off: self.progress.torque_off,
        }
    }

    /// Both channels of safe torque off permit torque.
    const fn permits_torque(&self) -> bool {
        self.inputs.safe_torque_1 && self.inputs.safe_torque_2
    }

    /// Supervision of everything below the velocity loop, and of what only counts while torque is on.
    fn look_after_the_motor(&mut self, index: Option<u32>) {
        let torque = self.machine.state().has_torque();
        let in_operation = self.machine.state().is_in_operation();
        let findings = self.motor.supervise(&Surroundings {
            torque,
            count: self.counted(self.motor.measured().count),
            index,
            velocity_command: if in_operation && self.axis.mode() != Mode::Torque {
                self.velocity_command
            } else {
                Velocity::ZERO
            },
        });
        self.take(findings);
        self.watch_safe_torque_off(torque);
        if !torque {
            return;
        }
        let mut findings = Findings::default();
        if !self.inputs.bridge_ready
            || (self.bridge_on && !self.hardware.bridge_is_on() && self.motor.measured().trip.is_none())
        {
            findings.add_own(Manufacturer1::AMPLIFIER_FAULT, true);
        } else if !self.motor.has_power(&self.inputs) {
            // Without power the torque goes, and a drive that is off for no reason would help nobody.
            findings.class_1 |= Class1::UNDERVOLTAGE;
        }
        if self.values.measured_velocity.abs() > self.settings.overspeed {
            findings.add_own(Manufacturer1::OVERSPEED, false);
        }
        if self.is_leaving_its_range() {
            findings.class_1 |= Class1::POSITION_LIMIT;
        }
        if in_operation && self.phase == Phase::Cp4 && self.lost.is_none() && !self.clock.is_locked() {
            findings.add_own(Manufacturer1::SYNCHRONISATION, false);
        }
        self.take(findings);
    }

    /// The axis is beyond S-0-0049 or S-0-0050 and moves further out. The way back is free, so that S-0-0099 and a command inwards
    /// bring it home. Without reference the limits mean nothing.
    fn is_leaving_its_range(&self) -> bool {
        let Some((highest, lowest)) = self.settings.position_limits.filter(|_| self.referenced) else { return false };
        let position = self.encoder.position();
        let outwards = |velocity: Velocity| {
            (position > highest && velocity > Velocity::ZERO) || (position < lowest && velocity < Velocity::ZERO)
        };
        outwards(self.velocity_command) && self.machine.state().is_in_operation()
    }

    /// The two channels are observed, never relied on: the hardware behind them takes the torque away by itself.
    fn watch_safe_torque_off(&mut self, torque: bool) {
        let differ = self.inputs.safe_torque_1 != self.inputs.safe_torque_2;
        self.channels_differ = if differ { self.channels_differ.saturating_add(1) } else { 0 };
        let mut findings = Findings::default();
        if self.channels_differ >= CHANNELS_DIFFER_TICKS {
            findings.add_own(Manufacturer1::SAFE_TORQUE_CHANNELS, true);
        }
        if torque && !self.permits_torque() {
            findings.add_own(Manufacturer1::SAFE_TORQUE_OFF, true);
        }
        self.take(findings);
    }

    fn take(&mut self, findings: Findings) {
        self.class_1 |= findings.class_1;
        self.manufacturer_1 |= findings.manufacturer_1;
        self.fatal |= findings.fatal;
        // Increments were lost or added: nobody knows any more where the axis is.
        self.referenced &= !findings.class_1.contains(Class1::FEEDBACK);
    }

    /// One tick of switching on or off, and what it asks of bridge and brake.
    fn step_sequence(&mut self, index: Option<Position>) {
        let state = self.machine.state();
        let wanted = match state {
            DriveState::Off | DriveState::Fault => Sequence::Off,
            DriveState::Engaging => Sequence::Stop,
            _ => Sequence::Start,
        };
        let mut findings = Findings::default();
        let bridge_on = self.bridge_on && self.hardware.bridge_is_on();
        self.progress = self.motor.sequence(
            &SequenceInputs {
                wanted,
                bridge_on,
                standstill: self.class_3.contains(Class3::STANDSTILL),
                position: self.encoder.position(),
                torque_command: self.torque_command,
                brake_contact: self.inputs.brake_open,
                blocked: self.class_3.contains(Class3::TORQUE_LIMIT | Class3::STANDSTILL)
                    && self.velocity_command.abs() > self.settings.standstill_window,
                index,
            },
            &mut findings,
        );
        self.take(findings);
        if let Some(current) = self.progress.preload {
            self.axis.preload(current);
        }
        self.set_bridge(self.progress.bridge);
        self.hardware.set_brake(self.progress.brake);
    }

    fn set_bridge(&mut self, on: bool) {
        if on == self.bridge_on {
            return;
        }
        self.bridge_on = on;
        if on {
            // A break without torque, as when the gate drivers had no supply yet, was nobody's error; one with torque is kept in C1D.
            self.hardware.reset_bridge();
        }
        self.hardware.set_bridge(on);
    }

    /// Steps the state machine and puts its state into axis, bridge and brake.
    fn update_state(&mut self) {
        let before = self.machine.state();
        let conditions = self.conditions();
        // A homing that is not cancelled holds the drive as HALT does.
        let switches = Switches { run: self.switches.run && !self.homing, ..self.switches };
        let state = self.machine.update(switches, conditions);
        if state != DriveState::Halted {
            self.abandon_identification();
        }
        let mode = match (state, self.mode) {
            (DriveState::Off | DriveState::Fault, _) => Mode::Off,
            // Without an angle there is no torque that a loop could use.
            (DriveState::SwitchingOn, _) if !self.motor.commutates() => Mode::Off,
            (DriveState::SwitchingOff | DriveState::FaultReaction, _) => Mode::Stopping,
            (DriveState::Halted, _) if self.identification.is_some() => self.identification_mode(),
            (DriveState::Following | DriveState::Halted, _) if self.is_travelling_home() => Mode::Travel,
            (DriveState::Halted | DriveState::SwitchingOn | DriveState::Engaging, _) => Mode::Halt,
            (DriveState::Following, Some(OperationMode::PositioningWithLag | OperationMode::PositioningWithoutLag)) => {
                Mode::Travel
            }
            (DriveState::Following, Some(OperationMode::Torque)) => Mode::Torque,
            (DriveState::Following, Some(OperationMode::Velocity)) => Mode::Velocity,
            (DriveState::Following, _) => Mode::Position,
        };
        let without_lag =
            matches!(self.mode, Some(OperationMode::PositionWithoutLag | OperationMode::PositioningWithoutLag));
        if without_lag != self.without_lag {
            self.without_lag = without_lag;
            self.apply_axis_settings();
        }
        if mode != Mode::Travel {
            self.target = None;
        }
        self.axis.set_mode(mode);
        if state != before && !state.has_torque() {
            self.set_bridge(false);
            self.hardware.set_brake(false);
        }
    }

    /// A count in the direction of positive current (S-0-0277).
    const fn counted(&self, count: u32) -> u32 {
        if self.settings.encoder_reversed { count.wrapping_neg() } else { count }
    }

    fn apply_axis_settings(&mut self) {
        self.axis.apply_settings(if self.without_lag { self.settings.without_lag } else { self.settings.with_lag });
    }

    fn tell_lock(&mut self) -> Work {
        if self.lock_patience == 0 {
            return Work::empty();
        }
        self.lock_patience = if self.clock.is_locked() { 0 } else { self.lock_patience.saturating_sub(1) };
        if self.lock_patience == 0 { Work::SERVICE_CHANNEL } else { Work::empty() }
    }

    /// Asks the background to look at what has become of the drive: its diagnosis and its error memory.
    fn tell_news(&mut self) -> Work {
        let now = (self.machine.state(), self.class_1, self.class_2);
        if now == self.told && self.identified.is_none() {
            return Work::empty();
        }
        self.told = now;
        Work::SERVICE_CHANNEL
    }
}
