//! The board's motor side, simulated: modulation timer, converters, encoder counters and their latches, digital inputs, and the machine
//! behind them.

use std::cell::RefCell;
use std::rc::Rc;

use drive::{
    BoardKind, Cycle, Divider, Facts, Hardware, Inputs, InterruptLine, PowerStage, ProbeInput, ResetCause, Samples,
    TemperatureSensor, Thermometers,
};
use laws::Sight;
use plant::{Machine, ReferenceAxis};
use ring::Nanoseconds;
use ring::time::SharedClock;
use servo::current::{CurrentSensing, PwmFrequency};

/// The modulation timer's clock in MHz: that of the APB2 timers of the STM32F407.
const TIMER_MEGAHERTZ: u64 = 168;
/// Counts of a period at 16 kHz: up and down.
const PERIOD: u64 = 2 * PwmFrequency::Khz16.reload() as u64;
/// Periods of a loop tick.
const PERIODS: u64 = PwmFrequency::Khz16.cycles_per_tick() as u64;
/// From the peak of the counter, where the currents are sampled, to the handler of the end of conversion: 1.9 us of conversion and 0.3 us.
const CONVERSION: Nanoseconds = Nanoseconds(2_200);

/// What a drive and its observer share.
pub type SharedMotorSide = Rc<RefCell<MotorSideState>>;

/// Machine and board of one drive.
#[derive(Debug)]
pub struct MotorSideState {
    clock: SharedClock,
    machine: Machine,
    peak_current: f64,
    supply: f64,
    inputs: Inputs,
    /// When inputs were last changed, until a processor has taken the edge.
    changed: Option<Nanoseconds>,
    /// The break input acts here; otherwise an emulated modulator sees to it.
    breaks: bool,
    bridge_on: bool,
    /// A break or the current loop has switched the bridge off; it stays off until it is reset.
    tripped: bool,
    brake_open: bool,
    latches: [u32; 2],
    /// Edges that no handler serves yet.
    waiting: [bool; 2],
    phases: [u16; 2],
    index_seen: u32,
    probes: [[Option<u32>; 2]; 2],
    /// Positive ones of probe 1.
    probe_1_edges: u32,
    /// Of main power, gate drivers and safe torque off.
    pin_changes: u32,
    timer: ModulationTimer,
    /// When the bridge was last switched off while it was on, and the coil's current.
    off: [Option<Nanoseconds>; 2],
    /// The next cycles come too late for their compare values.
    late_cycles: u32,
}

/// The two inputs of the power stage that most tests are about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Amplifier {
    /// Main power is applied.
    pub main_power: bool,
    /// The gate drivers report a fault.
    pub fault: bool,
}

/// A centre-aligned timer, seen from peak to peak.
#[derive(Debug)]
struct ModulationTimer {
    /// Counts from the simulation's start to the last peak, of a clock that is off by so many ppm.
    peak: u64,
    period: u64,
    next_period: u64,
    /// The last peak is that of a tick's first period.
    first: bool,
    /// Counts from the simulation's start to the beginning of the tick.
    tick: u64,
    clock_ppm: i64,
    /// When the current loop runs next: asked for at every event of the world.
    next_cycle: Nanoseconds,
}

impl ModulationTimer {
    fn new(clock_ppm: i64) -> Self {
        let mut timer = Self {
            peak: 0,
            period: PERIOD,
            next_period: PERIOD,
            first: false,
            tick: 0,
            clock_ppm,
            next_cycle: Nanoseconds::ZERO,
        };
        timer.find_next_cycle();
        timer
    }

    /// The counter has passed its peak.
    fn pass(&mut self) {
        self.peak += self.period;
        self.period = self.next_period;
        self.first = !self.first;
        if self.first {
            self.tick = self.peak;
        }
        self.find_next_cycle();
    }

    fn find_next_cycle(&mut self) {
        self.next_cycle = self.time_of(self.peak + self.period) + CONVERSION;
    }

    fn time_of(&self, counts: u64) -> Nanoseconds {
        let nominal = counts * 1_000 / TIMER_MEGAHERTZ;
        let drift = i64::try_from(nominal).unwrap_or(i64::MAX) / 1_000_000 * self.clock_ppm;
        Nanoseconds(nominal.saturating_add_signed(-drift))
    }

    fn counts_at(&self, now: Nanoseconds) -> u64 {
        let drift = i64::try_from(now.0).unwrap_or(i64::MAX) / 1_000_000 * self.clock_ppm;
        now.0.saturating_add_signed(drift) * TIMER_MEGAHERTZ / 1_000
    }

    /// Phase of an instant to the loop tick, in counts of 84 MHz.
    fn phase_of(&self, at: Nanoseconds) -> u16 {
        let counts = self.counts_at(at);
        // The edge may lie between the peak that begins a tick and the handler that counts it.
        let since = counts.saturating_sub(self.tick) % (PERIODS * PERIOD);
        u16::try_from(since / 2).unwrap_or(u16::MAX)
    }
}

impl MotorSideState {
    /// A machine at rest with main power on; the board's crystal is `clock_ppm` fast.
    pub fn new(clock: SharedClock, axis: &ReferenceAxis, clock_ppm: i64) -> Self {
        let inputs = Inputs {
            main_power: true,
            bridge_ready: true,
            safe_torque_1: true,
            safe_torque_2: true,
            ..Inputs::default()
        };
        Self {
            clock,
            machine: axis.machine(),
            peak_current: f64::from(axis.peak_current) / 1_000.0,
            supply: axis.machine.supply.voltage,
            inputs,
            changed: None,
            breaks: true,
            bridge_on: false,
            tripped: false,
            brake_open: false,
            latches: [0; 2],
            waiting: [false; 2],
            phases: [0; 2],
            index_seen: 0,
            probes: [[None; 2]; 2],
            probe_1_edges: 0,
            pin_changes: 0,
            timer: ModulationTimer::new(clock_ppm),
            off: [None; 2],
            late_cycles: 0,
        }
    }

    /// The machine, to look at it, to load it or to break it.
    pub fn machine(&mut self) -> &mut Machine {
        &mut self.machine
    }

    /// What can be seen of the axis from outside.
    pub fn sight(&mut self) -> Sight {
        let time = self.clock.get();
        Sight {
            time,
            machine: self.machine.glance(time.0),
            bridge: self.bridge_is_on(),
            coil: self.brake_open,
            main_power: self.inputs.main_power,
            bridge_ready: self.inputs.bridge_ready,
            pin_changes: self.pin_changes,
            safe_torque: self.inputs.safe_torque_1 && self.inputs.safe_torque_2,
            home_switch: self.inputs.home_switch,
            probe_1_edges: self.probe_1_edges,
            late: self.late_cycles > 0,
        }
    }

    /// The digital inputs as they are.
    pub fn inputs(&self) -> Inputs {
        self.inputs
    }

    /// The levels at the drive's pins: the inputs, and the contact of the machine's brake.
    pub fn levels(&mut self) -> Inputs {
        let now = self.clock.get();
        Inputs { brake_open: self.brake_open && !self.machine.brake_holds(now.0), ..self.inputs }
    }

    /// Changes digital inputs from now on. Without main power the supply is cut; a bridge that is not ready breaks the modulation.
    pub fn change_inputs(&mut self, change: impl FnOnce(&mut Inputs)) {
        let before = self.inputs;
        change(&mut self.inputs);
        let now = self.clock.get();
        self.changed = Some(now);
        if before.main_power != self.inputs.main_power {
            let voltage = if self.inputs.main_power { self.supply } else { 0.0 };
            self.machine.set_supply(voltage, now.0);
        }
        if self.breaks && !self.inputs.bridge_ready {
            self.trip(now);
        }
        let pins =
            |inputs: &Inputs| (inputs.main_power, inputs.bridge_ready, inputs.safe_torque_1, inputs.safe_torque_2);
        if pins(&before) != pins(&self.inputs) {
            self.pin_changes += 1;
        }
        if self.inputs.probe_1 && !before.probe_1 {
            self.probe_1_edges += 1;
        }
        for (probe, before, after) in
            [(0, before.probe_1, self.inputs.probe_1), (1, before.probe_2, self.inputs.probe_2)]
        {
            if before != after {
                self.probes[probe][usize::from(!after)] = Some(self.machine.encoder_count(now.0));
            }
        }
    }

    /// Leaves breaks and trips to an emulated modulator, which tells by [`MotorSideState::switch_bridge`].
    pub fn leave_breaks(&mut self) {
        self.breaks = false;
    }

    /// When inputs were changed that no processor has taken yet.
    pub const fn changed_inputs(&self) -> Option<Nanoseconds> {
        self.changed
    }

    /// The processor takes the inputs as they are.
    pub fn take_inputs(&mut self) {
        self.changed = None;
    }

    /// Main power, and whether the gate drivers are sound.
    pub fn set_amplifier_inputs(&mut self, amplifier: Amplifier) {
        self.change_inputs(|inputs| {
            inputs.main_power = amplifier.main_power;
            inputs.bridge_ready = !amplifier.fault;
        });
    }

    /// Whether the bridge switches.
    pub fn bridge_is_on(&self) -> bool {
        self.bridge_on && !self.tripped
    }

    /// Whether the coil of the brake has current.
    pub fn brake_is_open(&self) -> bool {
        self.brake_open
    }

    /// The torque-producing current as a fraction of the peak current.
    pub fn current(&mut self) -> f64 {
        let now = self.clock.get();
        self.machine.dq_currents(now.0)[1] / self.peak_current
    }

    /// The next so many cycles of the current loop come too late.
    pub fn delay_cycles(&mut self, cycles: u32) {
        self.late_cycles = cycles;
    }

    /// An edge on an interrupt line latches the encoder and its time.
    pub fn latch(&mut self, line: InterruptLine, at: Nanoseconds) {
        self.latches[line_index(line)] = self.machine.encoder_count(at.0);
        self.phases[line_index(line)] = self.timer.phase_of(at);
        self.waiting[line_index(line)] = true;
    }

    /// The handler of this line begins.
    pub fn acknowledge(&mut self, line: InterruptLine) {
        self.waiting[line_index(line)] = false;
    }

    /// When the current loop runs next.
    pub const fn next_cycle(&self) -> Nanoseconds {
        self.timer.next_cycle
    }

    /// Takes a cycle that is due.
    pub fn take_cycle(&mut self, now: Nanoseconds) -> bool {
        let due = self.next_cycle() <= now;
        if due {
            self.timer.pass();
        }
        due
    }

    /// When the bridge was switched off last.
    pub fn bridge_off_at(&self) -> Option<Nanoseconds> {
        self.off[0]
    }

    /// When the coil of the brake lost its current last.
    pub fn brake_off_at(&self) -> Option<Nanoseconds> {
        self.off[1]
    }

    /// Switches the bridge from `at` on.
    pub fn switch_bridge(&mut self, on: bool, at: Nanoseconds) {
        if self.bridge_on && !on {
            self.off[0] = Some(at);
        }
        self.bridge_on = on;
        let switches = self.bridge_is_on();
        self.machine.set_bridge(switches, at.0);
    }

    /// Shares of the high sides from `at` on.
    pub fn modulate(&mut self, duties: [f64; 3], at: Nanoseconds) {
        self.machine.set_duties(duties, at.0);
    }

    /// The resistor of the drive's chopper from `at` on.
    pub fn switch_chopper(&mut self, on: bool, at: Nanoseconds) {
        self.machine.set_chopper(on, at.0);
    }

    /// Current through the brake's coil from `at` on.
    pub fn switch_brake(&mut self, open: bool, at: Nanoseconds) {
        if open != self.brake_open {
            if !open {
                self.off[1] = Some(at);
            }
            self.brake_open = open;
            self.machine.set_brake(open, at.0);
        }
    }

    fn trip(&mut self, at: Nanoseconds) {
        self.tripped = true;
        self.machine.set_bridge(false, at.0);
    }

    /// The instant of the samples of this cycle.
    fn sampled(&self) -> Nanoseconds {
        self.timer.time_of(self.timer.peak)
    }
}

const fn line_index(line: InterruptLine) -> usize {
    match line {
        InterruptLine::Int0 => 0,
        InterruptLine::Int1 => 1,
    }
}

/// The board as the tasks of the loop tick see it.
#[derive(Debug)]
pub struct MotorSide {
    state: SharedMotorSide,
}

impl MotorSide {
    /// The drive's side of a shared motor side.
    pub fn new(state: SharedMotorSide) -> Self {
        Self { state }
    }
}

/// Of both temperature inputs.
const DIVIDER: Divider = Divider { pull_up: 2_200, supply: 3_300, reference: 3_300 };

/// The board that this computer stands for.
#[derive(Debug)]
pub struct HostBoard;

impl BoardKind for HostBoard {
    const FACTS: Facts = Facts {
        frequency: PwmFrequency::Khz16,
        dead_time: 1_000,
        current_sensing: CurrentSensing::InLine,
        loop_timer_counts: 10_500,
        sample_to_count: CONVERSION.0 as u16,
        encoder_rate: 18_600_000,
        thermometers: &Thermometers::new(TemperatureSensor::Ntc5k, &DIVIDER, &DIVIDER),
    };
}

/// That of the board.
const AMPLIFIER: drive::Amplifier = drive::Amplifier {
    peak_current: 14_142,
    continuous_current: 7_071,
    trip_current: 17_677,
    current_range: 25_000,
    dead_time_band: 200,
    bus_range: 500,
    undervoltage: 150,
    overvoltage: 440,
    withstand_voltage: 600,
    least_resistance: 220,
    warning_temperature: 800,
    shutdown_temperature: 900,
    thermal_time_constant: 5_000,
};

impl Hardware for MotorSide {
    type Board = HostBoard;

    const AMPLIFIER: drive::Amplifier = AMPLIFIER;

    fn encoder_count(&mut self) -> u32 {
        let state = &mut *self.state.borrow_mut();
        state.machine.encoder_count(state.clock.get().0)
    }

    fn encoder_latch(&mut self, line: InterruptLine) -> u32 {
        self.state.borrow().latches[line_index(line)]
    }

    fn edge_phase(&mut self, line: InterruptLine) -> u16 {
        self.state.borrow().phases[line_index(line)]
    }

    fn edge_waits(&mut self, line: InterruptLine) -> bool {
        self.state.borrow().waiting[line_index(line)]
    }

    fn phase_now(&mut self) -> u16 {
        let state = self.state.borrow();
        state.timer.phase_of(state.clock.get())
    }

    fn inputs(&mut self) -> Inputs {
        self.state.borrow_mut().levels()
    }

    fn set_bridge(&mut self, on: bool) {
        let state = &mut *self.state.borrow_mut();
        let now = state.clock.get();
        state.switch_bridge(on, now);
    }

    fn bridge_is_on(&mut self) -> bool {
        self.state.borrow().bridge_is_on()
    }

    fn reset_bridge(&mut self) {
        let state = &mut *self.state.borrow_mut();
        if state.inputs.bridge_ready {
            state.tripped = false;
        }
    }

    fn set_brake(&mut self, open: bool) {
        let state = &mut *self.state.borrow_mut();
        let now = state.clock.get();
        state.switch_brake(open, now);
    }

    fn arm_index(&mut self) {
        let state = &mut *self.state.borrow_mut();
        let now = state.clock.get();
        state.index_seen = state.machine.index_pulses(now.0);
    }

    fn index_latch(&mut self) -> Option<u32> {
        let state = &mut *self.state.borrow_mut();
        let now = state.clock.get();
        let pulses = state.machine.index_pulses(now.0);
        if pulses == state.index_seen {
            return None;
        }
        state.index_seen = pulses;
        state.machine.index_count(now.0)
    }

    fn arm_probe(&mut self, probe: ProbeInput) {
        self.state.borrow_mut().probes[probe_index(probe)] = [None; 2];
    }

    fn probe_latch(&mut self, probe: ProbeInput, rising: bool) -> Option<u32> {
        self.state.borrow_mut().probes[probe_index(probe)][usize::from(!rising)].take()
    }

    fn reset_cause(&self) -> ResetCause {
        ResetCause::PowerOn
    }
}

const fn probe_index(probe: ProbeInput) -> usize {
    match probe {
        ProbeInput::One => 0,
        ProbeInput::Two => 1,
    }
}

/// Inverter and converters as the current loop sees them.
#[derive(Debug)]
pub struct SimulatedStage {
    state: SharedMotorSide,
}

impl SimulatedStage {
    /// The current loop's side of a shared motor side.
    pub fn new(state: SharedMotorSide) -> Self {
        Self { state }
    }
}

impl PowerStage for SimulatedStage {
    type Board = HostBoard;

    fn begin(&mut self) -> Cycle {
        let state = &mut *self.state.borrow_mut();
        let late = state.late_cycles > 0;
        state.late_cycles = state.late_cycles.saturating_sub(1);
        Cycle { first: state.timer.first, late }
    }

    fn samples(&mut self) -> Samples {
        let state = &mut *self.state.borrow_mut();
        let at = state.sampled().0;
        let currents = state.machine.current_samples(at).map(u32::from);
        Samples { currents, bus: state.machine.bus_sample(at).into() }
    }

    fn temperatures(&mut self) -> [u32; 2] {
        let state = &mut *self.state.borrow_mut();
        let at = state.sampled().0;
        state.machine.temperature_samples(at).map(u32::from)
    }

    fn encoder_count(&mut self) -> u32 {
        let state = &mut *self.state.borrow_mut();
        state.machine.encoder_count(state.clock.get().0)
    }

    /// The preloaded values act from the bottom of the counter on, half a period after its peak.
    fn set_compare(&mut self, counts: [u16; 3]) {
        let state = &mut *self.state.borrow_mut();
        let bottom = state.timer.time_of(state.timer.peak + state.timer.period / 2);
        let duties = counts.map(|count| f64::from(count) / f64::from(HostBoard::FACTS.frequency.reload()));
        state.modulate(duties, bottom);
    }

    /// Both periods of a tick share the trim: so many counts of 168 MHz each.
    fn trim(&mut self, counts: i32) {
        let state = &mut *self.state.borrow_mut();
        state.timer.next_period = PERIOD.saturating_add_signed(i64::from(counts));
    }

    fn switch_off(&mut self) {
        let state = &mut *self.state.borrow_mut();
        let now = state.clock.get();
        state.trip(now);
    }

    fn set_chopper(&mut self, on: bool) {
        let state = &mut *self.state.borrow_mut();
        let now = state.clock.get();
        state.switch_chopper(on, now);
    }

    /// Host-side tasks do not hang.
    fn is_alive(&mut self) {}
}
