//! The electrical angle of the rotor after power-up, found with movements of a few electrical degrees.
//!
//! 1. **Pulses.** A current along 0 and then 90 degrees, with the pattern `+ - - +`: it accelerates, brakes, comes back and stands again. The swings are as
//!    the sine and cosine of the rotor's angle; nothing is pulled anywhere, so no angle is an unstable equilibrium. The duration is doubled from 0.5 ms
//!    on until the swing is 2 degrees: from here on `T` is known, the time in which this current turns this inertia by that much, and
//!    all that follows is scaled by it.
//! 2. **Swaying.** A d current at the estimated angle, ramped up. A controller lets the rotor sway slowly by 4 degrees around where it stood, by
//!    turning the current a little away from the estimate. The mean of what it needs over a whole period is the error of the estimate: inertia and
//!    Coulomb friction cancel. The part that goes with the position tells how the current turns with its angle: like the encoder counts (0), against
//!    it because two phases are swapped (-2), or not at all because a phase is missing (-1).
//! 3. **Verification.** A pulse of half the current along q must accelerate in counting direction; then the motor is brought back
//!    under q current and left.
//!
//! It takes 180 to 240 `T`. `T` follows from the natural frequency of the rotor in the field of the current, `w = sqrt(pole pairs * torque / inertia)`:
//! about 90 ms above 370 rad/s, 180 ms from 190, 370 ms from 95, 740 ms from 47 rad/s. Below 12 rad/s the current is too low.

mod controller;

use core::fmt;

use controller::{Controller, Counted, Means, Sums};

use super::{CommutationError, CommutationSettings, DEGREE, arctangent::arctangent};
use crate::{CurrentFraction, Position};

/// Why the angle was not found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum AlignmentError {
    /// The current moves nothing: axis blocked, brake closed, motor phase or encoder not connected, or the current too low for friction and inertia.
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
    current: CurrentFraction,
}

impl AlignmentSettings {
    /// `current` is the peak of all currents of the alignment. Its torque should be ten times the friction, or more; a
    /// quarter of peak is a good value.
    ///
    /// # Errors
    /// [`CommutationError::Current`] unless it is above zero.
    pub fn new(commutation: CommutationSettings, current: CurrentFraction) -> Result<Self, CommutationError> {
        if current <= CurrentFraction::ZERO {
            return Err(CommutationError::Current { actual: current });
        }
        Ok(Self { commutation, current })
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
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
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
const AGREEMENT: i32 = 4 * DEGREE;
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

    /// One tick of 125 us; the currents are to flow until the next. The motor must turn by less than half an electrical revolution in a tick.
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
        i32::from(self.settings.current.to_bits())
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
        (turn.wrapping_mul(i64::from(peak)) >> 29).clamp(i64::from(peak).wrapping_neg(), i64::from(peak)) as i32
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::f64::consts::TAU;

    const POLE_PAIRS: u8 = 4;
    /// Of peak.
    const CURRENT: f64 = 0.25;

    #[derive(Clone, Copy, Debug, PartialEq)]
    enum Fault {
        None,
        PhasesSwapped,
        PhaseMissing,
        Blocked,
        /// As soon as there is q current.
        BlockedLater,
        ReversedLater,
        /// A torque as this part of that of the current, as soon as there is q current.
        LoadLater(f64),
        /// In positive and negative direction by turns of so many ticks.
        AlternatingLoad(f64, u32),
    }

    /// A motor in electrical radians; torques are accelerations.
    struct Motor {
        angle: f64,
        speed: f64,
        current: (f64, f64),
        /// At the alignment current.
        torque: f64,
        friction: f64,
        /// Six periods in an electrical revolution.
        cogging: f64,
        resolution: u32,
        fault: Fault,
        is_later: bool,
        ticks: u32,
    }

    impl Motor {
        /// `natural`: rad/s of the swinging in the field of the alignment current. `friction`: part of the torque.
        fn new(natural: f64, friction: f64, resolution: u32, angle: f64) -> Self {
            let torque = natural * natural;
            Self {
                angle,
                speed: 0.0,
                current: (0.0, 0.0),
                torque,
                friction: friction * torque,
                cogging: 0.0,
                resolution,
                fault: Fault::None,
                is_later: false,
                ticks: 0,
            }
        }

        fn position(&self) -> Position {
            let counts = (self.angle / TAU / f64::from(POLE_PAIRS) * f64::from(self.resolution)).floor();
            Position::from_bits((counts / f64::from(self.resolution) * 2_f64.powi(32)).floor() as i64)
        }

        fn load(&self) -> f64 {
            match self.fault {
                Fault::LoadLater(load) if self.is_later => load * self.torque,
                Fault::AlternatingLoad(load, ticks) if self.ticks / ticks % 2 == 0 => load * self.torque,
                Fault::AlternatingLoad(load, _) => -load * self.torque,
                _ => 0.0,
            }
        }

        fn tick(&mut self, output: &AlignmentOutput) {
            const STEPS: u32 = 5;
            const DT: f64 = 125e-6 / STEPS as f64;
            self.ticks += 1;
            self.is_later |= output.iq != 0;
            let (sine, cosine) = degrees(output.angle).to_radians().sin_cos();
            let (d, q) = (output.id.to_num::<f64>() / CURRENT, output.iq.to_num::<f64>() / CURRENT);
            let mut wanted = (d * cosine - q * sine, d * sine + q * cosine);
            match self.fault {
                Fault::PhasesSwapped => wanted.1 = -wanted.1,
                Fault::PhaseMissing => wanted.1 = 0.0,
                Fault::ReversedLater if self.is_later => wanted = (-wanted.0, -wanted.1),
                _ => {}
            }
            if self.fault == Fault::Blocked || (self.fault == Fault::BlockedLater && self.is_later) {
                self.speed = 0.0;
                return;
            }
            for _ in 0..STEPS {
                // The current loop follows with 150 us.
                self.current.0 += (wanted.0 - self.current.0) * DT / 150e-6;
                self.current.1 += (wanted.1 - self.current.1) * DT / 150e-6;
                let (sine, cosine) = self.angle.sin_cos();
                let drive = (self.current.1 * cosine - self.current.0 * sine) * self.torque;
                let torque = drive + self.load() + self.cogging * self.torque * (6.0 * self.angle).sin();
                if self.speed == 0.0 && torque.abs() <= self.friction {
                    continue;
                }
                let against = if self.speed == 0.0 { torque.signum() } else { self.speed.signum() };
                let before = self.speed;
                self.speed += (torque - against * self.friction) * DT;
                if before * self.speed < 0.0 {
                    self.speed = 0.0;
                }
                self.angle += self.speed * DT;
            }
        }
    }

    fn degrees(angle: u32) -> f64 {
        f64::from(angle) / 2_f64.powi(32) * 360.0
    }

    /// The end of an alignment, in milliseconds and electrical degrees.
    #[derive(Debug)]
    struct Run {
        state: AlignmentState,
        duration: f64,
        moved: f64,
        error: f64,
    }

    fn settings(resolution: u32) -> AlignmentSettings {
        let commutation = CommutationSettings::new(POLE_PAIRS, resolution).unwrap();
        AlignmentSettings::new(commutation, CurrentFraction::from_num(CURRENT)).unwrap()
    }

    fn run(mut motor: Motor) -> Run {
        let start = motor.angle;
        let mut alignment = Alignment::start(settings(motor.resolution), motor.position());
        let mut moved = 0.0_f64;
        for tick in 0..40_000 {
            let output = alignment.tick(motor.position());
            assert!(output.id.abs() <= CURRENT && output.iq.abs() <= CURRENT);
            if output.state != AlignmentState::Running {
                assert_eq!((output.id, output.iq), (CurrentFraction::ZERO, CurrentFraction::ZERO));
                let error = (degrees(output.angle) - motor.angle.to_degrees() + 540.0).rem_euclid(360.0) - 180.0;
                return Run { state: output.state, duration: f64::from(tick) / 8.0, moved, error };
            }
            motor.tick(&output);
            moved = moved.max((motor.angle - start).to_degrees().abs());
        }
        panic!("the alignment does not end");
    }

    /// Motors standing at 64 angles, none of them exactly on an axis.
    fn motors(natural: f64, friction: f64, resolution: u32) -> impl Iterator<Item = Motor> {
        (0..64).map(move |step| Motor::new(natural, friction, resolution, f64::from(step) / 64.0 * TAU + 0.01))
    }

    #[test]
    fn from_every_angle_it_finds_the_rotor_with_little_movement_in_its_time() {
        for (natural, shortest, longest) in [(90.0, 360.0, 745.0), (180.0, 175.0, 370.0), (360.0, 85.0, 185.0)] {
            for friction in [0.0, 0.05, 0.1] {
                for resolution in [10_000, 1 << 20] {
                    let mut largest_error = 0.0_f64;
                    for motor in motors(natural, friction, resolution) {
                        let run = run(motor);
                        let case = (natural, friction, resolution);
                        assert_eq!(run.state, AlignmentState::Done, "{case:?} {run:?}");
                        assert!((shortest..longest).contains(&run.duration), "{case:?} {run:?}");
                        // A twentieth of an electrical revolution would be 18; the swaying alone is 4, less what friction takes.
                        assert!((2.5..9.5).contains(&run.moved), "{case:?} {run:?}");
                        largest_error = largest_error.max(run.error.abs());
                    }
                    // An increment of the coarse encoder is 0.144 degrees, of the fine one 0.0014.
                    let (least, most) = if resolution == 10_000 { (0.02, 0.2) } else { (0.000_3, 0.02) };
                    assert!((least..most).contains(&largest_error), "{largest_error}");
                }
            }
        }
    }

    #[test]
    fn cogging_costs_accuracy_and_not_more() {
        let mut largest_error = 0.0_f64;
        for mut motor in motors(180.0, 0.05, 10_000) {
            motor.cogging = 0.03;
            let run = run(motor);
            assert_eq!(run.state, AlignmentState::Done, "{run:?}");
            assert!(run.moved < 18.0);
            largest_error = largest_error.max(run.error.abs());
        }
        // The cogging torque holds the rotor up to asin 0.03 beside the field.
        assert!((1.0..2.5).contains(&largest_error), "{largest_error}");
    }

    #[test]
    fn swapped_phases_are_a_wrong_direction_from_every_angle() {
        for natural in [90.0, 360.0] {
            for friction in [0.0, 0.1] {
                for motor in motors(natural, friction, 10_000) {
                    let run = run(Motor { fault: Fault::PhasesSwapped, ..motor });
                    assert_eq!(run.state, AlignmentState::Failed(AlignmentError::WrongDirection));
                    assert!((2.5..18.0).contains(&run.moved), "{run:?}");
                }
            }
        }
    }

    #[test]
    fn a_missing_phase_is_never_aligned_and_nearly_always_named() {
        let mut named = 0;
        for motor in motors(180.0, 0.05, 10_000) {
            let run = run(Motor { fault: Fault::PhaseMissing, ..motor });
            assert!(matches!(run.state, AlignmentState::Failed(_)), "{run:?}");
            assert!(run.moved < 40.0, "{run:?}");
            named += u32::from(run.state == AlignmentState::Failed(AlignmentError::PhaseMissing));
        }
        // Where its axis goes along the remaining field, the rotor hardly moves.
        assert!((44..64).contains(&named), "{named} of 64");
    }

    #[test]
    fn a_blocked_motor_is_given_up_after_the_longest_pulses() {
        let run = run(Motor { fault: Fault::Blocked, ..Motor::new(180.0, 0.0, 10_000, 1.0) });
        assert_eq!(run.state, AlignmentState::Failed(AlignmentError::NoMovement));
        // 12 T for T = 0.5, 1, 2 ... 16 ms.
        assert!((377.0..382.0).contains(&run.duration), "{run:?}");
    }

    #[test]
    fn a_q_current_that_does_not_accelerate_forwards_is_found_by_the_verification() {
        for (fault, error) in [
            (Fault::BlockedLater, AlignmentError::NoMovement),
            (Fault::ReversedLater, AlignmentError::WrongDirection),
            (Fault::LoadLater(0.9), AlignmentError::NotSettled),
        ] {
            let run = run(Motor { fault, ..Motor::new(180.0, 0.02, 10_000, 2.0) });
            assert_eq!(run.state, AlignmentState::Failed(error), "{fault:?} {run:?}");
            assert!((165.0..200.0).contains(&run.duration), "{run:?}");
        }
    }

    #[test]
    fn a_load_that_varies_does_not_settle() {
        // Its turns are as long as the periods of the swaying, 64 ms.
        let run = run(Motor { fault: Fault::AlternatingLoad(0.2, 512), ..Motor::new(180.0, 0.0, 10_000, 1.0) });
        assert_eq!(run.state, AlignmentState::Failed(AlignmentError::NotSettled), "{run:?}");
        assert!((395.0..410.0).contains(&run.duration), "{run:?}");
    }

    #[test]
    fn a_motor_that_is_turned_from_outside_is_left_without_current() {
        let electrical = |degrees: i64| Position::from_bits(degrees * (1 << 32) / 360 / i64::from(POLE_PAIRS));
        for (degrees, is_failed) in [(29, false), (31, true), (-29, false), (-31, true)] {
            let mut alignment = Alignment::start(settings(1 << 20), Position::ZERO);
            alignment.tick(Position::ZERO);
            let output = alignment.tick(electrical(degrees));
            let AlignmentState::Failed(AlignmentError::TooMuchMovement { actual }) = output.state else {
                assert!(!is_failed, "{output:?}");
                assert_eq!(output.id, CURRENT);
                continue;
            };
            assert!(is_failed);
            assert_eq!((output.id, output.iq), (CurrentFraction::ZERO, CurrentFraction::ZERO));
            assert!((i64::from(actual) - degrees * i64::from(DEGREE)).abs() < 100, "{actual}");
            assert_eq!(alignment.tick(Position::ZERO).state, output.state, "for good");
        }
    }

    #[test]
    fn no_current_is_refused() {
        let commutation = CommutationSettings::new(POLE_PAIRS, 10_000).unwrap();
        for actual in [CurrentFraction::ZERO, CurrentFraction::from_num(-0.1)] {
            assert_eq!(AlignmentSettings::new(commutation, actual), Err(CommutationError::Current { actual }));
        }
    }
}
