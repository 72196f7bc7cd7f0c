//! The hot tasks: command values at t3, feedback at t4, the loops every 125 us.
//!
//! All three run at one priority and share [`Motion`] without locks. The background tasks (phase change, service channel)
//! take it under a short lock to hand over settings or to read a snapshot.

use sercon816::{Bus, CommandPort, FeedbackPort};
use sercos::Phase;
use sercos::diagnostic::{Class1, Class2, Class3};
use sercos::phase::PhaseError;
use sercos::supervision::Supervision;
use servo::{Axis, CurrentFraction, Encoder, LoopClock, Mode};

mod background;
mod cycle;
mod words;

use crate::diagnosis::{Manufacturer1, Manufacturer2, Manufacturer3};
use crate::feedback::FeedbackValues;
use crate::hardware::{Amplifier, Hardware, InterruptLine};
use crate::mst::MstMonitor;
use crate::record::Records;
use crate::settings::{MotionSettings, OperationMode};
use crate::state::{Conditions, DriveState, StateMachine, Switches};
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
    /// S-0-0080 in 0.1 % of S-0-0111.
    pub torque: i16,
    /// S-0-0081 in 0.1 % of S-0-0111.
    pub additive_torque: i16,
    /// S-0-0145.
    pub signal_control: u16,
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
    records: Records,
    machine: StateMachine,
    amplifier: Amplifier,
    switches: Switches,
    mode: Option<OperationMode>,
    phase: Phase,
    commands: CommandValues,
    values: FeedbackValues,
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
    /// P-0-0019.
    application_word: u16,
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
    pub fn new(bus: B, address: u8, mut hardware: H, settings: MotionSettings) -> Self {
        let encoder = Encoder::new(settings.encoder, hardware.encoder_count());
        hardware.set_current(CurrentFraction::ZERO);
        hardware.set_amplifier(false);
        let amplifier = hardware.amplifier();
        Self {
            hardware,
            command_port: CommandPort::new(bus.clone(), address),
            feedback_port: FeedbackPort::new(bus.clone()),
            mst: MstMonitor::new(bus),
            axis: Axis::new(settings.with_lag, encoder.position()),
            encoder,
            clock: LoopClock::new(settings.clock),
            settings,
            records: Records::default(),
            machine: StateMachine::default(),
            amplifier,
            switches: Switches::default(),
            mode: None,
            phase: Phase::Cp0,
            commands: CommandValues::default(),
            values: FeedbackValues::default(),
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
            application_word: 0,
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
                let phase_of_timer = self.hardware.loop_timer_phase();
                self.clock.on_t3(phase_of_timer);
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

    /// Task of the loop timer, every 125 us: measures, steps the state machine and the loops, sets the current.
    ///
    /// Contract: done before the next tick with the tasks of t3 and t4 in between; no bus access but when a t3 event is overdue.
    pub fn control_loop(&mut self) -> Work {
        self.ticks = self.ticks.wrapping_add(1);
        let count = self.hardware.encoder_count();
        let position = self.encoder.update(self.counted(count));
        self.amplifier = self.hardware.amplifier();
        self.update_state();
        let output = self.axis.tick(position);
        if output.excessive_deviation {
            self.class_1 |= Class1::EXCESSIVE_DEVIATION;
        }
        self.hardware.set_current(output.current);
        self.values.take_output(&output);
        self.refresh_words(&output);
        let trim = self.clock.on_tick();
        self.hardware.trim_loop_timer(trim);
        self.flywheel() | self.tell_lock() | self.tell_news()
    }

    /// The encoder position that the hardware latched at an edge of this interrupt line; to be read before the interrupt is
    /// acknowledged.
    pub fn latch(&mut self, line: InterruptLine) -> u32 {
        self.hardware.encoder_latch(line)
    }

    /// Takes the position of this moment where the latch of an interrupt edge is missing (polled events).
    pub fn latch_now(&mut self) {
        self.latch = self.hardware.encoder_count();
    }

    /// The latch that belongs to t4.
    pub fn set_latch(&mut self, latch: u32) {
        self.latch = latch;
    }

    fn conditions(&self) -> Conditions {
        Conditions {
            operating_phase: self.phase == Phase::Cp4
                && self.lost.is_none()
                && !self.manufacturer_3.contains(Manufacturer3::PARKED),
            power: self.amplifier.main_power && !self.amplifier.fault,
            fault: !self.class_1.is_empty(),
            fatal: self.fatal,
            standstill: self.class_3.contains(Class3::STANDSTILL),
        }
    }

    /// Steps the state machine and puts its state into axis and amplifier.
    fn update_state(&mut self) {
        if self.machine.state().has_torque() {
            if self.amplifier.fault {
                self.class_1 |= Class1::MANUFACTURER;
                self.manufacturer_1 |= Manufacturer1::AMPLIFIER_FAULT;
                self.fatal = true;
            } else if !self.amplifier.main_power {
                self.class_1 |= Class1::UNDERVOLTAGE;
            }
        }
        let before = self.machine.state();
        let conditions = self.conditions();
        // A homing that is not cancelled holds the drive as HALT does.
        let switches = Switches { run: self.switches.run && !self.homing, ..self.switches };
        let state = self.machine.update(switches, conditions);
        let mode = match (state, self.mode) {
            (DriveState::Off | DriveState::Fault, _) => Mode::Off,
            (DriveState::SwitchingOff | DriveState::FaultReaction, _) => Mode::Stopping,
            (DriveState::Halted, _) => Mode::Halt,
            (DriveState::Following, Some(OperationMode::Torque)) => Mode::Torque,
            (DriveState::Following, Some(OperationMode::Velocity)) => Mode::Velocity,
            (DriveState::Following, _) => Mode::Position,
        };
        let without_lag = self.mode == Some(OperationMode::PositionWithoutLag);
        if without_lag != self.without_lag {
            self.without_lag = without_lag;
            self.apply_axis_settings();
        }
        self.axis.set_mode(mode);
        if state != before {
            if !state.has_torque() {
                self.hardware.set_current(CurrentFraction::ZERO);
            }
            self.hardware.set_amplifier(state.has_torque());
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
        if now == self.told {
            return Work::empty();
        }
        self.told = now;
        Work::SERVICE_CHANNEL
    }
}
