//! The board's motor side, simulated: encoder counter and latches, loop timer, amplifier, motor.

use std::cell::RefCell;
use std::rc::Rc;

use drive::{Amplifier, Hardware, InterruptLine, ResetCause};
use fixed::types::I1F15;
use plant::Motor;
use ring::Nanoseconds;
use ring::time::SharedClock;

/// The loop timer's clock in MHz: twice APB1 (42 MHz) of the STM32F407 at 168 MHz.
const TIMER_MEGAHERTZ: u64 = 84;

/// What a drive and its observer share.
pub type SharedMotorSide = Rc<RefCell<MotorSideState>>;

/// Motor and board of one drive.
#[derive(Debug)]
pub struct MotorSideState {
    clock: SharedClock,
    motor: Motor,
    inputs: Amplifier,
    amplifier_on: bool,
    latches: [u32; 2],
    current: f64,
    timer: LoopTimer,
}

/// A timer with preloaded period: a trim holds from the period after the running one.
#[derive(Debug)]
struct LoopTimer {
    /// Timer counts of the simulation's start to the last tick, of a clock that is off by so many ppm.
    last_tick: u64,
    period: u64,
    next_period: u64,
    clock_ppm: i64,
}

impl LoopTimer {
    fn time_of(&self, counts: u64) -> Nanoseconds {
        let nominal = counts * 1_000 / TIMER_MEGAHERTZ;
        let drift = i64::try_from(nominal).unwrap_or(i64::MAX) / 1_000_000 * self.clock_ppm;
        Nanoseconds(nominal.saturating_add_signed(-drift))
    }

    fn counts_at(&self, now: Nanoseconds) -> u64 {
        let drift = i64::try_from(now.0).unwrap_or(i64::MAX) / 1_000_000 * self.clock_ppm;
        now.0.saturating_add_signed(drift) * TIMER_MEGAHERTZ / 1_000
    }
}

impl MotorSideState {
    /// A motor at rest beside an amplifier with main power on; the board's crystal is `clock_ppm` fast.
    pub fn new(clock: SharedClock, motor: Motor, clock_ppm: i64) -> Self {
        let period = u64::from(MotorSide::LOOP_TIMER_COUNTS);
        Self {
            clock,
            motor,
            inputs: Amplifier { main_power: true, fault: false },
            amplifier_on: false,
            latches: [0; 2],
            current: 0.0,
            timer: LoopTimer { last_tick: 0, period, next_period: period, clock_ppm },
        }
    }

    /// The motor, to look at it or to load it.
    pub fn motor(&mut self) -> &mut Motor {
        &mut self.motor
    }

    /// The amplifier's status lines.
    pub fn set_amplifier_inputs(&mut self, inputs: Amplifier) {
        self.inputs = inputs;
        self.apply_current(self.clock.get());
    }

    /// Whether the drive has the amplifier switched on.
    pub fn amplifier_on(&self) -> bool {
        self.amplifier_on
    }

    /// The current command as a fraction of the peak current, zero while the amplifier is off.
    pub fn current(&self) -> f64 {
        if self.is_powered() { self.current } else { 0.0 }
    }

    /// An edge on an interrupt line latches the encoder.
    pub fn latch(&mut self, line: InterruptLine, at: Nanoseconds) {
        self.latches[latch_index(line)] = self.motor.encoder_count(at.0);
    }

    /// When the loop timer ticks next.
    pub fn next_tick(&self) -> Nanoseconds {
        self.timer.time_of(self.timer.last_tick + self.timer.period)
    }

    /// Takes a tick that is due.
    pub fn take_tick(&mut self, now: Nanoseconds) -> bool {
        let due = self.next_tick() <= now;
        if due {
            self.timer.last_tick += self.timer.period;
            self.timer.period = self.timer.next_period;
        }
        due
    }

    /// The amplifier's status lines.
    #[must_use]
    pub fn amplifier_inputs(&self) -> Amplifier {
        self.inputs
    }

    /// The analogue current command, as a fraction of the peak current, from `at` on.
    pub fn command_current(&mut self, fraction: f64, at: Nanoseconds) {
        self.current = fraction;
        self.apply_current(at);
    }

    /// The amplifier's enable line from `at` on.
    pub fn switch_amplifier(&mut self, on: bool, at: Nanoseconds) {
        self.amplifier_on = on;
        self.apply_current(at);
    }

    fn is_powered(&self) -> bool {
        self.amplifier_on && self.inputs.main_power && !self.inputs.fault
    }

    fn apply_current(&mut self, at: Nanoseconds) {
        let now = at.0;
        if self.is_powered() {
            self.motor.set_current(self.current, now);
        } else {
            self.motor.cut_current(now);
        }
    }
}

const fn latch_index(line: InterruptLine) -> usize {
    match line {
        InterruptLine::Int0 => 0,
        InterruptLine::Int1 => 1,
    }
}

/// The board as the drive sees it.
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

impl Hardware for MotorSide {
    const LOOP_TIMER_COUNTS: u16 = 10_500;

    fn encoder_count(&mut self) -> u32 {
        let state = &mut *self.state.borrow_mut();
        state.motor.encoder_count(state.clock.get().0)
    }

    fn encoder_latch(&mut self, line: InterruptLine) -> u32 {
        self.state.borrow().latches[latch_index(line)]
    }

    fn set_current(&mut self, fraction_of_peak: I1F15) {
        let state = &mut *self.state.borrow_mut();
        let now = state.clock.get();
        state.command_current(fraction_of_peak.to_num(), now);
    }

    fn set_amplifier(&mut self, on: bool) {
        let state = &mut *self.state.borrow_mut();
        let now = state.clock.get();
        state.switch_amplifier(on, now);
    }

    fn amplifier(&mut self) -> Amplifier {
        self.state.borrow().inputs
    }

    fn reset_cause(&self) -> ResetCause {
        ResetCause::PowerOn
    }

    fn loop_timer_phase(&mut self) -> u16 {
        let state = self.state.borrow();
        let counts = state.timer.counts_at(state.clock.get()).saturating_sub(state.timer.last_tick);
        u16::try_from(counts).unwrap_or(u16::MAX)
    }

    fn trim_loop_timer(&mut self, counts: i16) {
        let state = &mut *self.state.borrow_mut();
        state.timer.next_period = u64::from(Self::LOOP_TIMER_COUNTS).saturating_add_signed(i64::from(counts));
    }
}
