//! Alignment of a simulated synchronous motor.

use std::f64::consts::TAU;

use servo::commutation::{
    Alignment, AlignmentError, AlignmentOutput, AlignmentSettings, AlignmentState, CommutationError,
    CommutationSettings,
};
use servo::units::{CurrentFraction, Position};

const POLE_PAIRS: u8 = 4;
/// Electrical.
const DEGREE: i64 = (1 << 32) / 360;
/// Of peak.
const CURRENT: f64 = 0.25;

#[derive(Clone, Copy, Debug, PartialEq)]
enum Fault {
    None,
    PhasesSwapped,
    PhaseMissing,
    /// From this tick on.
    Blocked(u32),
    /// As soon as there is q current.
    BlockedLater,
    ReversedLater,
    /// A torque as this part of that of the current, as soon as there is q current.
    LoadLater(f64),
    /// From 20 ms on, in positive and negative direction by turns of so many ticks.
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
            Fault::AlternatingLoad(..) if self.ticks < 160 => 0.0,
            Fault::AlternatingLoad(load, ticks) if (self.ticks / ticks) & 1 == 0 => load * self.torque,
            Fault::AlternatingLoad(load, _) => -load * self.torque,
            _ => 0.0,
        }
    }

    fn tick(&mut self, output: &AlignmentOutput) {
        const STEPS: u32 = 4;
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
        let is_blocked = match self.fault {
            Fault::Blocked(from) => self.ticks > from,
            Fault::BlockedLater => self.is_later,
            _ => false,
        };
        if is_blocked {
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
                    assert!((2.5..11.0).contains(&run.moved), "{case:?} {run:?}");
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
    for (natural, friction) in [(90.0, 0.1), (360.0, 0.0)] {
        for motor in motors(natural, friction, 10_000) {
            let run = run(Motor { fault: Fault::PhasesSwapped, ..motor });
            assert_eq!(run.state, AlignmentState::Failed(AlignmentError::WrongDirection));
            assert!((2.5..18.0).contains(&run.moved), "{run:?}");
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
fn a_blocked_motor_is_given_up_after_the_longest_pulses_or_six_periods() {
    // 12 T for T = 0.5, 1, 2 ... 16 ms; with T = 1 ms, 18 ms and six periods of 64 ms.
    for (from, shortest, longest) in [(0, 377.0, 382.0), (160, 400.0, 406.0)] {
        let run = run(Motor { fault: Fault::Blocked(from), ..Motor::new(180.0, 0.0, 10_000, 1.0) });
        assert_eq!(run.state, AlignmentState::Failed(AlignmentError::NoMovement));
        assert!((shortest..longest).contains(&run.duration), "{run:?}");
    }
}

#[test]
fn the_holding_current_is_ramped() {
    let mut motor = Motor::new(180.0, 0.0, 1 << 20, 1.0);
    let mut alignment = Alignment::start(settings(motor.resolution), motor.position());
    let mut last = 0.0;
    for tick in 0..300 {
        let output = alignment.tick(motor.position());
        motor.tick(&output);
        let current = output.id.to_num::<f64>() / CURRENT;
        // The pulses take 12 T for T = 4 and 8 ticks, and end without current; the ramp takes 8 T.
        if (144..200).contains(&tick) {
            let step: f64 = current - last;
            assert!((-1e-9..1.01 / 64.0).contains(&step), "{step} at {tick}");
        }
        last = current;
        if tick == 146 || tick == 250 {
            assert_eq!(current > 0.99, tick == 250, "{current}");
        }
    }
}

#[test]
fn a_q_current_that_does_not_accelerate_forwards_is_found_by_the_verification() {
    for (fault, error) in [
        (Fault::BlockedLater, AlignmentError::NoMovement),
        (Fault::ReversedLater, AlignmentError::WrongDirection),
        (Fault::LoadLater(0.6), AlignmentError::NotSettled),
    ] {
        let run = run(Motor { fault, ..Motor::new(180.0, 0.02, 10_000, 2.0) });
        assert_eq!(run.state, AlignmentState::Failed(error), "{fault:?} {run:?}");
        assert!((150.0..200.0).contains(&run.duration), "{run:?}");
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
        assert!((i64::from(actual) - degrees * DEGREE).abs() < 100, "{actual}");
        assert_eq!(alignment.tick(Position::ZERO).state, output.state, "for good");
    }
}

#[test]
fn no_current_is_refused() {
    let commutation = CommutationSettings::new(POLE_PAIRS, 10_000).unwrap();
    for actual in [0, -1, i16::MIN] {
        let result = AlignmentSettings::new(commutation, CurrentFraction::from_bits(actual));
        assert_eq!(result, Err(CommutationError::Current { actual }));
    }
}

#[test]
fn a_zero_that_moves_during_the_search_does_not_disturb_it() {
    // Of homing, at the instants at which the stages of the search are under way.
    for ticks in [1, 40, 400, 900, 1_400] {
        for difference in [-555.25, 0.001, 200_000.0] {
            let mut motor = Motor::new(180.0, 0.05, 10_000, 0.7);
            let zero = Position::from_bits((difference * 2_f64.powi(32)) as i64);
            let mut alignment = Alignment::start(settings(motor.resolution), motor.position());
            let mut shift = Position::ZERO;
            let state = (0..40_000).find_map(|tick| {
                if tick == ticks {
                    alignment.shift(zero);
                    shift = zero;
                }
                let output = alignment.tick(motor.position() + shift);
                let error = (degrees(output.angle) - motor.angle.to_degrees() + 540.0).rem_euclid(360.0) - 180.0;
                motor.tick(&output);
                (output.state != AlignmentState::Running).then_some((output.state, error))
            });
            let (state, error) = state.unwrap();
            assert_eq!(state, AlignmentState::Done, "{difference} revolutions at tick {ticks}");
            assert!(error.abs() < 0.3, "{error} degrees, {difference} revolutions at tick {ticks}");
        }
    }
}
