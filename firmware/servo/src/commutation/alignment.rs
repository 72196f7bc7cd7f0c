//! The electrical angle of the rotor after power-up, found with movements of a few electrical degrees.
//!
//! 1. **Pulses.** A current along 0 and then 90 degrees, with the pattern `+ - - +`: it accelerates, brakes, comes back and stands again.
//!    The swings are as the sine and cosine of the rotor's angle; nothing is pulled anywhere, so no angle is an unstable equilibrium. The
//!    duration is doubled from 0.5 ms on until the swing is 2 degrees: from here on `T` is known, the time in which this current turns
//!    this inertia by that much, and all that follows is scaled by it.
//! 2. **Swaying.** A d current at the estimated angle, ramped up. A controller lets the rotor sway slowly by 4 degrees around where it
//!    stood, by turning the current a little away from the estimate. The mean of what it needs over a whole period is the error of the
//!    estimate: inertia and Coulomb friction cancel. The part that goes with the position tells how the current turns with its angle:
//!    like the encoder counts (0), against it because two phases are swapped (-2), or not at all because a phase is missing (-1).
//! 3. **Verification.** A pulse of half the current along q must accelerate in counting direction; then the motor is brought back
//!    under q current and left.
//!
//! It takes 180 to 185 `T`, up to 64 more for each period that does not agree. `T` follows from the natural frequency of the rotor in
//! the field of the current, `w = sqrt(pole pairs * torque / inertia)`: about 90 ms above 370 rad/s, 180 ms from 190, 370 ms from 95,
//! 740 ms from 47 rad/s. Below 12 rad/s the current is too low.

mod controller;

use core::fmt;

use controller::{Controller, Counted, Means, Sums};

use super::{CommutationError, CommutationSettings, DEGREE};
use crate::arithmetic::arctangent::arctangent;
use crate::arithmetic::wide::limited;
use crate::units::{CurrentFraction, Position};

/// Why the angle was not found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum AlignmentError {
    /// The current moves nothing: axis blocked, brake closed, motor phase or encoder not connected, or the current too low for friction
    /// and inertia.
    NoMovement,
    /// The motor turned further than 30 electrical degrees: moved from outside, or current too high for its inertia.
    TooMuchMovement {
        /// Electrical angle turned; 2^32 is one revolution.
        actual: i32,
    },
    /// The encoder counts against the phase sequence: two motor phases or two encoder tracks are swapped.
    WrongDirection,
    /// The current does not turn with its angle: one motor phase is not connected.
    PhaseMissing,
    /// The estimates of successive periods do not agree: a load that varies, a loose encoder.
    NotSettled,
}

impl fmt::Display for AlignmentError {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoMovement => formatter.write_str("the motor does not move under the alignment current"),
            Self::TooMuchMovement { actual } => write!(
                formatter,
                "the motor turned by {} electrical degrees during the alignment, expected at most 30",
                actual.wrapping_div(DEGREE)
            ),
            Self::WrongDirection => formatter.write_str("the encoder counts against the phase sequence of the motor"),
            Self::PhaseMissing => {
                formatter.write_str("the current does not turn with its angle, a motor phase is missing")
            }
            Self::NotSettled => formatter.write_str("the commutation angle does not settle"),
        }
    }
}

impl core::error::Error for AlignmentError {}

/// Settings of the alignment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct AlignmentSettings {
    commutation: CommutationSettings,
    /// As the bits of a [`CurrentFraction`].
    current: i16,
}

impl AlignmentSettings {
    /// `current` is the peak of all currents of the alignment. Its torque should be ten times the friction, or more; a
    /// quarter of peak is a good value.
    ///
    /// # Errors
    /// [`CommutationError::Current`] unless it is above zero.
    pub fn new(commutation: CommutationSettings, current: CurrentFraction) -> Result<Self, CommutationError> {
        let actual = current.to_bits();
        if actual <= 0 {
            return Err(CommutationError::Current { actual });
        }
        Ok(Self { commutation, current: actual })
    }
}

/// How far the alignment has come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum AlignmentState {
    /// Under way.
    Running,
    /// [`AlignmentOutput::angle`] is the electrical angle of the rotor.
    Done,
    /// Given up, without current.
    Failed(AlignmentError),
}

/// Currents of a tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AlignmentOutput {
    /// Electrical angle of the d axis for the two currents; when done, that of the rotor at the position of this tick.
    pub angle: u32,
    /// Current along the angle.
    pub id: CurrentFraction,
    /// Current 90 degrees ahead of the angle.
    pub iq: CurrentFraction,
    /// State after this tick.
    pub state: AlignmentState,
}

/// Shortest and longest pulse: 2^2 and 2^7 ticks.
const SHORTEST: u32 = 2;
const LONGEST: u32 = 7;
/// A swing of the pulses that is large enough (twice, as it is measured twice). The next shorter pulse had less than a quarter.
const SWING: i32 = 2 * 7 * DEGREE / 4;
const MOVEMENT_LIMIT: i32 = 30 * DEGREE;
/// Amplitude of the swaying.
const AMPLITUDE: i32 = 4 * DEGREE;
/// Means of two periods that are so close are believed.
const AGREEMENT: i32 = 6 * DEGREE;
const PERIODS: u32 = 6;
/// So far must the verifying pulse turn the motor.
const VERIFIED: i32 = 2 * DEGREE;

/// State of the alignment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Alignment {
    settings: AlignmentSettings,
    origin: Position,
    stage: Stage,
    /// Ticks in this stage.
    elapsed: u32,
    /// `T` is 2^scale ticks.
    scale: u32,
    /// Electrical angle of the rotor at the origin.
    estimate: u32,
    controller: Controller,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
enum Stage {
    Pulse { first: Option<i32>, swing: i32 },
    Sway { sums: Sums, last: Option<i32>, periods: u32 },
    Settle,
    Verify { from: i32 },
    Recover,
    Done,
    Failed(AlignmentError),
}

impl Alignment {
    /// Moves the zero of the position by `difference` without a movement.
    pub fn shift(&mut self, difference: Position) {
        self.origin = self.origin + difference;
    }

    /// Begins at this position; the motor stands, its brake is open.
    #[must_use]
    pub const fn start(settings: AlignmentSettings, position: Position) -> Self {
        Self {
            settings,
            origin: position,
            stage: Stage::Pulse { first: None, swing: 0 },
            elapsed: 0,
            scale: SHORTEST,
            estimate: 0,
            controller: Controller::at(0),
        }
    }

    /// One tick of 125 us; the currents are to flow until the next. The motor must turn by less than half an electrical revolution in a
    /// tick.
    #[inline]
    pub fn tick(&mut self, position: Position) -> AlignmentOutput {
        let moved = self.settings.commutation.electrical(position - self.origin) as i32;
        let ended = matches!(self.stage, Stage::Done | Stage::Failed(_));
        if !ended && moved.saturating_abs() > MOVEMENT_LIMIT {
            self.enter(Stage::Failed(AlignmentError::TooMuchMovement { actual: moved }));
        }
        let rotor = self.estimate.wrapping_add_signed(moved);
        let (angle, id, iq) = match self.stage {
            Stage::Pulse { first, swing } => self.pulse(first, swing, moved),
            Stage::Sway { sums, last, periods } => {
                let (turn, current) = self.sway(sums, last, periods, moved);
                (rotor.wrapping_add_signed(turn), current, 0)
            }
            Stage::Settle => {
                let turn = self.controller.tick(moved, 0, self.scale);
                if self.elapsed >= self.time(8) {
                    self.enter(Stage::Verify { from: moved });
                }
                (rotor.wrapping_add_signed(turn), self.peak(), 0)
            }
            Stage::Verify { from } => (rotor, 0, self.verify(from, moved)),
            Stage::Recover => (rotor, 0, self.recover(moved)),
            Stage::Done | Stage::Failed(_) => (rotor, 0, 0),
        };
        self.elapsed = self.elapsed.wrapping_add(1);
        let state = match self.stage {
            Stage::Done => AlignmentState::Done,
            Stage::Failed(error) => AlignmentState::Failed(error),
            _ => AlignmentState::Running,
        };
        let current = |bits: i32| match state {
            // Never above the peak of the alignment, which has 16 bits.
            AlignmentState::Running => CurrentFraction::from_bits(bits as i16),
            AlignmentState::Done | AlignmentState::Failed(_) => CurrentFraction::ZERO,
        };
        AlignmentOutput { angle, id: current(id), iq: current(iq), state }
    }

    /// So many `T` in ticks.
    #[inline]
    const fn time(&self, times: u32) -> u32 {
        times.wrapping_shl(self.scale)
    }

    #[inline]
    fn peak(&self) -> i32 {
        i32::from(self.settings.current)
    }

    #[inline]
    fn enter(&mut self, stage: Stage) {
        self.stage = stage;
        // The tick that enters a stage belongs to the one before.
        self.elapsed = u32::MAX;
    }

    /// A pulse along 0 degrees, then one along 90. Gives angle, d and q current.
    #[inline]
    fn pulse(&mut self, first: Option<i32>, swing: i32, moved: i32) -> (u32, i32, i32) {
        let mut swing = swing;
        // Against the mean of begin and end: a slow drift does not count.
        if self.elapsed == 0 || self.elapsed == self.time(4) {
            swing = swing.wrapping_sub(moved);
        } else if self.elapsed == self.time(2) {
            swing = swing.wrapping_add(moved.wrapping_mul(2));
        }
        self.stage = Stage::Pulse { first, swing };
        let angle = if first.is_some() { 1 << 30 } else { 0 };
        let current = if self.elapsed < self.time(1) {
            self.peak()
        } else if self.elapsed < self.time(3) {
            self.peak().wrapping_neg()
        } else if self.elapsed < self.time(4) {
            self.peak()
        } else {
            0
        };
        if self.elapsed >= self.time(6) {
            match first {
                None => self.enter(Stage::Pulse { first: Some(swing), swing: 0 }),
                Some(first) => self.estimate(first, swing, moved),
            }
        }
        (angle, current, 0)
    }

    /// Both pulses are over: their swings are -sine and cosine of the rotor's angle.
    #[inline]
    fn estimate(&mut self, along_0: i32, along_90: i32, moved: i32) {
        let (one, other) = (along_0.saturating_abs(), along_90.saturating_abs());
        // The length of the vector within 12 %.
        let length = one.max(other).saturating_add(one.min(other) / 2);
        if length >= SWING {
            self.estimate = arctangent(along_0.saturating_neg(), along_90);
            self.controller = Controller::at(moved);
            self.enter(Stage::Sway { sums: Sums::default(), last: None, periods: 0 });
        } else if self.scale < LONGEST {
            self.scale = self.scale.wrapping_add(1);
            self.enter(Stage::Pulse { first: None, swing: 0 });
        } else {
            self.enter(Stage::Failed(AlignmentError::NoMovement));
        }
    }

    /// Gives the turn of the current from the estimate, and the current.
    #[inline]
    fn sway(&mut self, sums: Sums, last: Option<i32>, periods: u32, moved: i32) -> (i32, i32) {
        let period_shift = self.scale.wrapping_add(6);
        let quarter = i64::from(self.time(16));
        let phase = i64::from(self.elapsed) & quarter.wrapping_mul(4).wrapping_sub(1);
        let triangle = if phase < quarter {
            phase
        } else if phase < quarter.wrapping_mul(3) {
            quarter.wrapping_mul(2).wrapping_sub(phase)
        } else {
            phase.wrapping_sub(quarter.wrapping_mul(4))
        };
        let target = (i64::from(AMPLITUDE).wrapping_mul(triangle) >> self.scale.wrapping_add(4)) as i32;
        let turn = self.controller.tick(moved, target, self.scale);
        let sums = sums.with(turn, moved);
        let ramp = i64::from(self.elapsed.min(self.time(8)));
        let rising = if periods == 0 {
            i64::from(self.peak()).wrapping_mul(ramp) >> self.scale.wrapping_add(3)
        } else {
            i64::from(self.peak())
        };
        if self.elapsed >= self.time(64).wrapping_sub(1) {
            self.period(&sums.means(period_shift), last, periods.wrapping_add(1));
        } else {
            self.stage = Stage::Sway { sums, last, periods };
        }
        (turn, rising as i32)
    }

    /// A period of the swaying is over.
    #[inline]
    fn period(&mut self, means: &Means, last: Option<i32>, periods: u32) {
        let agrees = last.is_some_and(|last| last.wrapping_sub(means.turn).saturating_abs() <= AGREEMENT);
        let moves = means.range >= AMPLITUDE;
        let counted = if agrees && moves { means.counted } else { Counted::Forwards };
        if counted == Counted::Backwards {
            self.enter(Stage::Failed(AlignmentError::WrongDirection));
        } else if counted == Counted::Not {
            self.enter(Stage::Failed(AlignmentError::PhaseMissing));
        } else if agrees && moves {
            self.estimate = self.estimate.wrapping_add_signed(means.turn);
            self.controller.forget();
            self.enter(Stage::Settle);
        } else if periods >= PERIODS {
            self.enter(Stage::Failed(if moves { AlignmentError::NotSettled } else { AlignmentError::NoMovement }));
        } else {
            self.enter(Stage::Sway { sums: Sums::default(), last: Some(means.turn), periods });
        }
    }

    /// Gives the q current.
    #[inline]
    fn verify(&mut self, from: i32, moved: i32) -> i32 {
        let way = moved.wrapping_sub(from);
        if way >= VERIFIED {
            self.controller.forget();
            self.enter(Stage::Recover);
        } else if way <= -VERIFIED {
            self.enter(Stage::Failed(AlignmentError::WrongDirection));
        } else if self.elapsed >= self.time(4) {
            self.enter(Stage::Failed(AlignmentError::NoMovement));
        }
        self.controller.follow(moved, self.scale);
        self.peak() / 2
    }

    /// Gives the q current: the turn that the controller asks for, 45 degrees for the whole current.
    #[inline]
    fn recover(&mut self, moved: i32) -> i32 {
        let turn = i64::from(self.controller.without_integral(moved, 0, self.scale));
        if self.elapsed >= self.time(24) {
            let stands = moved.saturating_abs() <= AMPLITUDE;
            self.enter(if stands { Stage::Done } else { Stage::Failed(AlignmentError::NotSettled) });
        }
        let peak = self.peak();
        // Not `clamp`, which can panic: the compiler does not know that the peak is positive.
        limited(turn.wrapping_mul(i64::from(peak)) >> 29, i64::from(peak)) as i32
    }
}
