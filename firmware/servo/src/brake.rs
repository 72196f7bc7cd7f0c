//! The holding brake: its order with the torque when the axis is switched on and off.
//!
//! ```text
//! Off -> Proving -> Releasing -> Released -> Engaging -> HoldTest -> Off
//!           |           |           |           |  ^        |
//!        (error)     (error) ------ or ------>  |  |        v
//!           v                                   +->HeldByTorque
//!          Off
//! ```
//!
//! Without a brake nothing is held and nothing can fall: there is nothing to prove, and an axis that turns is caught.
//!
//! The brake opens only when the torque is proven: the current follows a small test current in the field axis, which makes no torque.
//! The torque goes only when the brake has shown that it holds: it is lowered slowly while the movement is watched. When the axis
//! moves, or the brake's contact does not answer, the torque stays and the axis is held by it, until it is lowered under control or
//! switched off at once ([`BrakeRequest::Immediate`]).
//!
//! The current that held the axis before the brake closed is given back when the torque comes on again, so that the load does
//! not sink before the velocity loop has found it. The sequence knows nothing of safety: a brake that must hold people's lives needs a
//! chain of its own.

pub(crate) mod error;
pub(crate) mod settings;

use fixed::types::U1F15;

pub use error::BrakeError;
pub use settings::{BrakeParameters, BrakeSettings};

use settings::WHOLE;

use crate::monitor::debounce::{Debounce, milliseconds_of};
use crate::units::{CurrentFraction, Position};

/// Part of the current command that is passed on, 0 ..= 1.
pub type TorqueScale = U1F15;

/// What is asked of the sequence.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum BrakeRequest {
    /// Torque on, brake open, free to move.
    Release,
    /// Brake closed, torque off, in order.
    Engage,
    /// Torque off and brake closed at once (safe torque off, fatal error).
    Immediate,
}

/// What the sequence looks at in a tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BrakeInputs {
    /// What is asked.
    pub request: BrakeRequest,
    /// The bridge switches: [`BrakeOutput::torque`] has arrived, and no fault of the gate drivers has taken it away.
    pub bridge_on: bool,
    /// Within the standstill window (S-0-0124), and no ramp runs.
    pub standstill: bool,
    /// Position of the motor.
    pub position: Position,
    /// Torque-producing current as commanded to the current loop.
    pub torque_command: CurrentFraction,
    /// Torque-producing current as measured.
    pub torque_current: CurrentFraction,
    /// Current of the field axis as measured.
    pub field_current: CurrentFraction,
    /// The contact says that the brake is open. Not looked at without a contact.
    pub contact_open: bool,
    /// Motion is commanded and the torque is high, but the axis does not move.
    pub blocked: bool,
}

/// What the sequence wants in a tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BrakeOutput {
    /// Current through the brake: it opens.
    pub energise: bool,
    /// The bridge is to be on and the loops closed.
    pub torque: bool,
    /// The axis must hold its position; no motion is allowed.
    pub hold: bool,
    /// Factor of the torque-producing current command.
    pub torque_scale: TorqueScale,
    /// Command of the field axis while the torque is proven, else zero.
    pub test_current: CurrentFraction,
    /// In the tick in which the torque comes on: the current with which the velocity loop is to start ([`crate::axis::VelocityLoop::preset`]).
    pub preload: Option<CurrentFraction>,
    /// In the tick in which a brake that has held the axis begins to open: an axis that stands is to hold this place with this current,
    /// whatever it meant to do before. What its loops have worked up against the closed brake would throw the load.
    pub anchor: Option<CurrentFraction>,
    /// What is asked for is reached; an error keeps it from being reached.
    pub finished: bool,
    /// An error or a warning ([`BrakeError::is_warning`]), in the tick in which it is found.
    pub event: Option<BrakeError>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
enum State {
    Off,
    Proving,
    Releasing,
    Released,
    Engaging,
    HoldTest,
    HeldByTorque,
}

/// State of the sequence.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct BrakeSequencer {
    state: State,
    /// Ticks in this state.
    elapsed: u32,
    /// After an error the request to release must go and come again.
    locked: bool,
    proof: Debounce,
    blocked: Debounce,
    unsettled: Debounce,
    /// The axis has moved since the brake was energised: it is open.
    moved: bool,
    /// Position from which a movement counts.
    reference: Position,
    /// Scale of the torque in 2^-31.
    scale: u32,
    /// Filtered current that holds the axis, in 2^-31 of the peak current.
    load: i32,
    /// Ticks since the brake has had no current.
    closing: u32,
}

/// The load is filtered with 2^4 ticks of the supervision, 8 ms.
const LOAD_FILTER_SHIFT: u32 = 4;

impl Default for BrakeSequencer {
    fn default() -> Self {
        Self::new()
    }
}

impl BrakeSequencer {
    /// Starts without torque, the brake closed.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            state: State::Off,
            elapsed: 0,
            locked: false,
            proof: Debounce::new(),
            blocked: Debounce::new(),
            unsettled: Debounce::new(),
            moved: false,
            reference: Position::ZERO,
            scale: WHOLE,
            load: 0,
            closing: u32::MAX,
        }
    }

    /// Moves the zero of the position by `difference` without a movement.
    pub fn shift(&mut self, difference: Position) {
        self.reference = self.reference + difference;
    }

    /// One tick of the supervision.
    #[inline]
    pub fn tick(&mut self, settings: &BrakeSettings, inputs: &BrakeInputs) -> BrakeOutput {
        let before = self.state;
        self.elapsed = self.elapsed.saturating_add(1);
        self.closing = if self.energises(settings) { 0 } else { self.closing.saturating_add(1) };
        if inputs.request != BrakeRequest::Release {
            self.locked = false;
        }
        let depends_on_torque = !matches!(self.state, State::Off | State::Proving);
        let event = if inputs.request == BrakeRequest::Immediate {
            self.enter(State::Off);
            None
        } else if depends_on_torque && !inputs.bridge_on {
            self.fail(State::Off, BrakeError::TorqueLost)
        } else {
            match self.state {
                State::Off => self.off(inputs),
                State::Proving => self.proving(settings, inputs),
                State::Releasing => self.releasing(settings, inputs),
                State::Released => self.released(settings, inputs),
                State::Engaging => self.engaging(settings, inputs),
                State::HoldTest => self.hold_test(settings, inputs),
                State::HeldByTorque => self.held_by_torque(inputs),
            }
        };
        self.output(settings, inputs, before, event)
    }

    #[inline]
    fn output(
        &self,
        settings: &BrakeSettings,
        inputs: &BrakeInputs,
        before: State,
        event: Option<BrakeError>,
    ) -> BrakeOutput {
        let state = self.state;
        let reached = match inputs.request {
            BrakeRequest::Release => State::Released,
            BrakeRequest::Engage | BrakeRequest::Immediate => State::Off,
        };
        let proving = state == State::Proving && settings.fitted;
        let load = self.load();
        // At most 2^15.
        let scale = TorqueScale::from_bits((self.scale >> 16) as u16);
        BrakeOutput {
            energise: self.energises(settings),
            torque: state != State::Off,
            hold: state != State::Released,
            torque_scale: if state == State::Off { TorqueScale::ZERO } else { scale },
            test_current: CurrentFraction::from_bits(if proving { settings.proof_current } else { 0 }),
            preload: (state == State::Proving && before == State::Off).then_some(load),
            anchor: (settings.fitted && state == State::Releasing && before == State::Proving).then_some(load),
            finished: state == reached,
            event,
        }
    }

    const fn energises(&self, settings: &BrakeSettings) -> bool {
        settings.fitted && matches!(self.state, State::Releasing | State::Released)
    }

    fn enter(&mut self, state: State) {
        if self.state != state {
            self.state = state;
            self.elapsed = 0;
            self.scale = WHOLE;
        }
    }

    fn fail(&mut self, state: State, error: BrakeError) -> Option<BrakeError> {
        self.locked = true;
        self.enter(state);
        Some(error)
    }

    #[inline]
    fn off(&mut self, inputs: &BrakeInputs) -> Option<BrakeError> {
        if inputs.request == BrakeRequest::Release && !self.locked {
            self.proof = Debounce::new();
            self.enter(State::Proving);
        }
        None
    }

    #[inline]
    fn proving(&mut self, settings: &BrakeSettings, inputs: &BrakeInputs) -> Option<BrakeError> {
        if inputs.request != BrakeRequest::Release {
            // The brake has not been opened since it held, unless it is still closing from the time before.
            let holds = !settings.fitted || self.closing >= settings.off_delay;
            self.enter(if holds || !inputs.bridge_on { State::Off } else { State::Engaging });
            return None;
        }
        if !settings.fitted && inputs.bridge_on {
            self.release(inputs);
            self.enter(State::Released);
            return None;
        }
        let far = |commanded: i16, measured: CurrentFraction| {
            i32::from(commanded).abs_diff(i32::from(measured.to_bits())) > settings.proof_tolerance.unsigned_abs()
        };
        let follows = !far(settings.proof_current, inputs.field_current)
            && !far(inputs.torque_command.to_bits(), inputs.torque_current);
        if self.proof.holds(inputs.bridge_on && follows, settings.proof_ticks) {
            self.release(inputs);
            return None;
        }
        if self.elapsed < settings.proof_limit {
            return None;
        }
        let error = if inputs.bridge_on {
            BrakeError::TorqueNotProven {
                expected: per_mille(settings.proof_current),
                actual: per_mille(inputs.field_current.to_bits()),
            }
        } else {
            BrakeError::BridgeOff
        };
        self.fail(State::Off, error)
    }

    #[inline]
    fn release(&mut self, inputs: &BrakeInputs) {
        self.reference = inputs.position;
        self.moved = false;
        self.blocked = Debounce::new();
        self.unsettled = Debounce::new();
        self.enter(State::Releasing);
    }

    #[inline]
    fn releasing(&mut self, settings: &BrakeSettings, inputs: &BrakeInputs) -> Option<BrakeError> {
        self.follow_load(inputs);
        if inputs.request != BrakeRequest::Release {
            self.enter(State::Engaging);
            return None;
        }
        if settings.fitted && self.elapsed < settings.on_delay {
            return None;
        }
        if !settings.contact_fitted || inputs.contact_open {
            let late = settings.contact_fitted && self.elapsed > settings.on_delay.max(CONTACT_TICKS);
            let actual = milliseconds_of(self.elapsed);
            self.enter(State::Released);
            return late.then_some(BrakeError::ReleaseSlow { expected: milliseconds_of(settings.on_delay), actual });
        }
        if self.elapsed < settings.on_limit {
            return None;
        }
        self.fail(State::Engaging, BrakeError::NotReleased { expected: milliseconds_of(settings.on_limit) })
    }

    #[inline]
    fn released(&mut self, settings: &BrakeSettings, inputs: &BrakeInputs) -> Option<BrakeError> {
        self.follow_load(inputs);
        let moved = (inputs.position - self.reference).abs();
        self.moved |= moved > settings.hold_window;
        let suspected = settings.fitted && !self.moved;
        if self.blocked.holds(suspected && inputs.blocked, settings.stuck_ticks) {
            let error = BrakeError::BrakeStuck { expected: settings.hold_window, actual: moved };
            return self.fail(State::Engaging, error);
        }
        let stopping = inputs.request != BrakeRequest::Release;
        let closed = if settings.fitted { State::Engaging } else { State::Off };
        if stopping && inputs.standstill {
            self.enter(closed);
            return None;
        }
        let limit = settings.standstill_limit?;
        if self.unsettled.holds(stopping, limit) {
            return self.fail(closed, BrakeError::NoStandstill { expected: milliseconds_of(limit) });
        }
        None
    }

    #[inline]
    fn engaging(&mut self, settings: &BrakeSettings, inputs: &BrakeInputs) -> Option<BrakeError> {
        if inputs.request == BrakeRequest::Release && !self.locked {
            // Torque has been on since it was proven.
            self.release(inputs);
            return None;
        }
        if self.elapsed < settings.off_delay {
            return None;
        }
        if !settings.contact_fitted || !inputs.contact_open {
            let late = settings.contact_fitted && self.elapsed > settings.off_delay.max(CONTACT_TICKS);
            let actual = milliseconds_of(self.elapsed);
            self.reference = inputs.position;
            self.enter(if settings.fitted { State::HoldTest } else { State::Off });
            return late.then_some(BrakeError::EngageSlow { expected: milliseconds_of(settings.off_delay), actual });
        }
        if self.elapsed < settings.off_limit {
            return None;
        }
        self.fail(State::HeldByTorque, BrakeError::NotEngaged { expected: milliseconds_of(settings.off_limit) })
    }

    #[inline]
    fn hold_test(&mut self, settings: &BrakeSettings, inputs: &BrakeInputs) -> Option<BrakeError> {
        let moved = (inputs.position - self.reference).abs();
        if moved > settings.hold_window {
            let error = BrakeError::BrakeDoesNotHold { expected: settings.hold_window, actual: moved };
            return self.fail(State::HeldByTorque, error);
        }
        self.scale = self.scale.saturating_sub(settings.ramp);
        if self.elapsed >= settings.watch_ticks.saturating_mul(2) {
            self.enter(State::Off);
        }
        None
    }

    #[inline]
    fn held_by_torque(&mut self, inputs: &BrakeInputs) -> Option<BrakeError> {
        if inputs.request == BrakeRequest::Release && !self.locked {
            self.release(inputs);
        }
        None
    }

    /// The current that carries the load while the brake is open, or carried it before it closed.
    pub(crate) const fn load(&self) -> CurrentFraction {
        CurrentFraction::from_bits((self.load >> 16) as i16)
    }

    /// The current that carries the load: what is left of the command when it is smoothed.
    #[inline]
    fn follow_load(&mut self, inputs: &BrakeInputs) {
        let command = i64::from(inputs.torque_command.to_bits()) << 16;
        let change = command.wrapping_sub(i64::from(self.load)) >> LOAD_FILTER_SHIFT;
        // Between the last value and the command.
        self.load = i64::from(self.load).wrapping_add(change) as i32;
    }
}

/// A contact that answers within so many ticks is not slow, even with a delay of zero.
const CONTACT_TICKS: u32 = 2;

/// 2^-15 in 0.1 %.
#[inline]
fn per_mille(fraction: i16) -> i16 {
    // At most 1000.
    (i32::from(fraction).wrapping_mul(1_000) >> 15) as i16
}
