//! Homing on a simulated axis with a home switch and an index pulse.

use servo::homing::{
    Homing, HomingError, HomingInputs, HomingMotion, HomingOutput, HomingParameters, HomingSettings, HomingState,
    Reference,
};
use servo::units::{Position, Velocity};

// Bits of the homing parameter S-0-0147.
const NEGATIVE: u16 = 1 << 0;
const HOMING_ENABLE_EVALUATED: u16 = 1 << 4;
const SWITCH_NOT_EVALUATED: u16 = 1 << 5;
const MARKER_NOT_EVALUATED: u16 = 1 << 6;
const STOP_AT_REFERENCE_POINT: u16 = 1 << 7;

const SPEED: Velocity = Velocity::from_bits(1 << 25); // 2^-11 revolution per tick: 234 rpm
const TURN: i64 = 1 << 32;
/// Way per tick at SPEED.
const STEP: i64 = 1 << 21;
const DISTANCE: Position = Position::from_bits(7 * TURN + 12_345);

/// An axis with a ramp, a home switch that is on from `switch` on in the homing direction, and a marker every revolution.
struct Machine {
    position: i64,
    speed: i64,
    switch: i64,
    /// In 0 .. TURN.
    marker: Option<i64>,
    negative: bool,
    inverted: bool,
    enable: bool,
    run: bool,
    armed: bool,
    index: Option<Position>,
    moving_finished: bool,
}

impl Machine {
    fn new(homing_parameter: u16, position: i64, switch: i64, marker: Option<i64>) -> Self {
        Self {
            position,
            speed: 0,
            switch,
            marker,
            negative: homing_parameter & 1 != 0,
            inverted: homing_parameter & 2 != 0,
            enable: true,
            run: true,
            armed: false,
            index: None,
            moving_finished: true,
        }
    }

    fn inputs(&self) -> HomingInputs {
        let on = if self.negative { self.position <= self.switch } else { self.position >= self.switch };
        HomingInputs {
            position: Position::from_bits(self.position),
            home_switch: on != self.inverted,
            homing_enable: self.enable,
            index: self.index,
            standstill: self.speed == 0,
            moving_finished: self.moving_finished,
            run: self.run,
        }
    }

    /// A tick later. A movement brakes in time, and takes at least one tick to be finished.
    fn follow(&mut self, output: &HomingOutput) {
        const RAMP: i64 = STEP / 64;
        let target = match output.motion {
            HomingMotion::Hold => 0,
            HomingMotion::Velocity(velocity) => i64::from(velocity.to_bits()) >> 4,
            HomingMotion::MoveTo(target) => {
                let rest = target.to_bits() - self.position;
                self.moving_finished = rest == 0 && self.speed == 0;
                if rest.abs() <= RAMP { rest } else { (rest / 64).clamp(-STEP, STEP) + rest.signum() * RAMP / 2 }
            }
        };
        self.speed += (target - self.speed).clamp(-RAMP, RAMP);
        if target.abs() <= RAMP && self.speed.abs() <= 2 * RAMP {
            self.speed = target;
        }
        if output.arm_index && !self.armed {
            self.index = None;
        }
        self.armed = output.arm_index;
        let before = self.position;
        self.position += self.speed;
        if let (true, None, Some(marker)) = (self.armed, self.index, self.marker) {
            let turns = |position: i64| (position - marker).div_euclid(TURN);
            let passed = turns(before).max(turns(self.position));
            if turns(before) != turns(self.position) {
                self.index = Some(Position::from_bits(passed * TURN + marker));
            }
        }
    }

    fn home(&mut self, settings: &HomingSettings) -> HomingOutput {
        let mut homing = Homing::start(Position::from_bits(self.position));
        for _ in 0..100_000 {
            let output = homing.tick(settings, self.inputs());
            if output.state != HomingState::Running {
                return output;
            }
            self.follow(&output);
        }
        panic!("homing does not end: {homing:?}");
    }
}

fn parameters(homing_parameter: u16) -> HomingParameters {
    HomingParameters {
        homing_parameter,
        velocity: SPEED,
        reference_distance: DISTANCE,
        reference_offset: Position::from_bits(-TURN / 3),
        switch_offset: Position::ZERO,
        travel_limit: Some(Position::from_bits(9 * TURN)),
        marker_limit: None,
    }
}

fn settings(homing_parameter: u16) -> HomingSettings {
    HomingSettings::new(&parameters(homing_parameter)).unwrap()
}

/// Coordinate of `place` after homing.
fn shifted(reference: &Reference, place: i64) -> i64 {
    place + reference.shift.to_bits()
}

#[test]
fn switch_and_marker_give_the_same_zero_from_everywhere_in_both_directions_with_both_polarities() {
    for way in 0..4 {
        for stop in [0, STOP_AT_REFERENCE_POINT] {
            let forwards = if way & NEGATIVE != 0 { -1 } else { 1 };
            // The first marker in the homing direction comes 0.4 revolutions behind the edge.
            let switch = 1_000_003;
            let marker = switch + forwards * TURN * 2 / 5;
            for start in -8..=8 {
                let start = switch + start * TURN * 3 / 4 + start * 77_777 + 1;
                let mut machine = Machine::new(way, start, switch, Some(marker.rem_euclid(TURN)));
                let output = machine.home(&settings(way | stop));
                assert_eq!(output.state, HomingState::Done);
                assert!(output.marker_registered);
                let reference = output.reference.unwrap();
                assert_eq!(reference.marker, Some(Position::from_bits(marker)));
                assert_eq!(shifted(&reference, marker - TURN / 3), DISTANCE.to_bits());
                let edge = reference.switch.unwrap().to_bits() - switch;
                assert!(edge.abs() <= STEP / 2 + 1, "edge {edge} off, at {STEP} a tick");
                assert!(!reference.is_ambiguous);
                let cam_shift = reference.cam_shift.to_bits() + TURN / 10;
                assert!(cam_shift.abs() <= STEP, "{cam_shift}");
                assert_eq!(machine.speed, 0, "the axis stands");
                let there = machine.position == marker - TURN / 3;
                assert_eq!(there, stop != 0, "{way} from {start}: stands at {}", machine.position);
            }
        }
    }
}

#[test]
fn on_the_switch_the_axis_first_leaves_it_and_approaches_again() {
    let settings = settings(MARKER_NOT_EVALUATED);
    let mut machine = Machine::new(0, TURN, 0, None);
    let mut homing = Homing::start(Position::from_bits(machine.position));
    let mut motions = [HomingMotion::Hold; 6];
    let mut changes = 0;
    loop {
        let output = homing.tick(&settings, machine.inputs());
        if changes == 0 || motions[changes - 1] != output.motion {
            motions[changes] = output.motion;
            changes += 1;
        }
        if output.state != HomingState::Running {
            break;
        }
        machine.follow(&output);
    }
    let expected =
        [HomingMotion::Velocity(-SPEED), HomingMotion::Hold, HomingMotion::Velocity(SPEED), HomingMotion::Hold];
    assert_eq!(motions[..changes], expected);
}

#[test]
fn a_switch_that_is_on_again_after_the_turn_is_left_once_more() {
    let settings = settings(MARKER_NOT_EVALUATED);
    let mut homing = Homing::start(Position::ZERO);
    let mut motion = |home_switch, standstill| {
        let machine = Machine::new(0, 0, 0, None);
        homing.tick(&settings, HomingInputs { home_switch, standstill, ..machine.inputs() }).motion
    };
    let (on, off) = (true, false);
    assert_eq!(motion(on, true), HomingMotion::Velocity(-SPEED));
    assert_eq!(motion(off, false), HomingMotion::Hold);
    assert_eq!(motion(on, false), HomingMotion::Hold, "an edge against the homing direction does not count");
    assert_eq!(motion(on, true), HomingMotion::Velocity(-SPEED));
    assert_eq!(motion(off, false), HomingMotion::Hold);
    assert_eq!(motion(off, true), HomingMotion::Velocity(SPEED));
}

#[test]
fn the_edge_of_the_switch_alone_is_taken_within_half_a_tick() {
    for way in 0..4 {
        for start in [-TURN, -TURN / 7, TURN / 5] {
            let mut machine = Machine::new(way, start, 4_321, None);
            let output = machine.home(&settings(way | MARKER_NOT_EVALUATED | STOP_AT_REFERENCE_POINT));
            let reference = output.reference.unwrap();
            let error = shifted(&reference, 4_321 - TURN / 3) - DISTANCE.to_bits();
            assert!(error.abs() <= STEP / 2 + 1, "{error}");
            assert_eq!(shifted(&reference, machine.position), DISTANCE.to_bits());
            assert_eq!((reference.marker, output.marker_registered, reference.is_ambiguous), (None, false, false));
        }
    }
}

#[test]
fn the_marker_alone_is_the_first_in_the_homing_direction() {
    for (way, start, expected) in [(0, 5, TURN / 2), (1, 5, -TURN / 2), (0, TURN / 2 + 1, 3 * TURN / 2)] {
        let mut machine = Machine::new(way, start, 0, Some(TURN / 2));
        // A pulse from before the arming.
        machine.index = Some(Position::from_bits(99));
        // Without switch its offset is none.
        let switch_offset = Position::from_bits(TURN * 3 / 4);
        let alone = HomingParameters { switch_offset, ..parameters(way | SWITCH_NOT_EVALUATED) };
        let output = machine.home(&HomingSettings::new(&alone).unwrap());
        let reference = output.reference.unwrap();
        assert_eq!(reference.marker, Some(Position::from_bits(expected)));
        assert_eq!(reference.switch, None);
        assert_eq!(shifted(&reference, expected - TURN / 3), DISTANCE.to_bits());
    }
}

#[test]
fn without_switch_and_marker_the_reference_is_where_the_axis_stands() {
    let neither = SWITCH_NOT_EVALUATED | MARKER_NOT_EVALUATED;
    let mut machine = Machine::new(0, 555, 0, None);
    let reference = machine.home(&settings(neither)).reference.unwrap();
    assert_eq!(machine.position, 555);
    assert_eq!(shifted(&reference, 555 - TURN / 3), DISTANCE.to_bits());
    machine.home(&settings(neither | STOP_AT_REFERENCE_POINT));
    assert_eq!(machine.position, 555 - TURN / 3);
}

#[test]
fn a_marker_near_the_switch_is_a_warning_and_the_home_switch_offset_is_its_remedy() {
    for way in [0, NEGATIVE] {
        let forwards = if way == NEGATIVE { -1 } else { 1 };
        for (eighths_times_ten, ambiguous) in [(9, true), (11, false), (69, false), (71, true)] {
            let marker = (forwards * eighths_times_ten * TURN / 80).rem_euclid(TURN);
            let mut machine = Machine::new(way, -forwards * TURN, 0, Some(marker));
            let reference = machine.home(&settings(way)).reference.unwrap();
            assert_eq!(reference.is_ambiguous, ambiguous, "{eighths_times_ten} eightieths");
            let next = reference.cam_shift < Position::ZERO;
            let whole = if next { Position::REVOLUTION } else { Position::ZERO };
            let remedy = HomingParameters { switch_offset: reference.cam_shift + whole, ..parameters(way) };
            let mut machine = Machine::new(way, -forwards * TURN, 0, Some(marker));
            // A pulse that was latched before the marker counts.
            machine.index = Some(Position::from_bits(99));
            let better = machine.home(&HomingSettings::new(&remedy).unwrap()).reference.unwrap();
            assert!(!better.is_ambiguous);
            let moved = (better.marker.unwrap() - reference.marker.unwrap()).abs();
            assert_eq!(moved, whole);
            assert!(better.cam_shift.abs().to_bits() <= STEP);
        }
    }
}

#[test]
fn a_switch_that_does_not_come_fails_behind_the_travel_limit() {
    for (way, start, switch) in [(0, 0, 20 * TURN), (0, 0, -20 * TURN), (NEGATIVE, 0, -20 * TURN)] {
        let output = Machine::new(way, start, switch, Some(0)).home(&settings(way));
        let HomingState::Failed(HomingError::SwitchNotFound { travelled }) = output.state else { panic!("{output:?}") };
        assert!((9 * TURN..9 * TURN + STEP + 1).contains(&travelled.to_bits()), "{travelled:?}");
        assert_eq!((output.motion, output.reference), (HomingMotion::Hold, None));
    }
    let unlimited = HomingParameters { travel_limit: None, ..parameters(0) };
    let output = Machine::new(0, 0, 20 * TURN, Some(0)).home(&HomingSettings::new(&unlimited).unwrap());
    assert_eq!(output.state, HomingState::Done);
}

#[test]
fn a_marker_that_does_not_come_fails_after_one_and_a_half_revolutions_or_the_limit() {
    for (way, limit, expected) in [
        (0, None, TURN * 3 / 2),
        (NEGATIVE | SWITCH_NOT_EVALUATED, None, TURN * 3 / 2),
        (0, Some(Position::from_bits(TURN / 4)), TURN / 4),
    ] {
        let limited = HomingParameters { marker_limit: limit, ..parameters(way) };
        let output = Machine::new(way, -TURN, 0, None).home(&HomingSettings::new(&limited).unwrap());
        let HomingState::Failed(HomingError::MarkerNotFound { travelled }) = output.state else { panic!("{output:?}") };
        assert!((expected..expected + STEP + 1).contains(&travelled.to_bits()), "{travelled:?}");
    }
}

#[test]
fn without_homing_enable_neither_switch_nor_marker_counts() {
    for kind in [0, SWITCH_NOT_EVALUATED, MARKER_NOT_EVALUATED, SWITCH_NOT_EVALUATED | MARKER_NOT_EVALUATED] {
        for (evaluated, enable) in [(true, false), (true, true), (false, false)] {
            let way = kind | if evaluated { HOMING_ENABLE_EVALUATED } else { 0 };
            let mut machine = Machine::new(way, -TURN / 4, 0, Some(TURN / 2));
            machine.enable = enable;
            let expected = if evaluated && !enable {
                HomingState::Failed(HomingError::HomingEnableMissing)
            } else {
                HomingState::Done
            };
            assert_eq!(machine.home(&settings(way)).state, expected, "{way:#X} {enable}");
        }
    }
}

#[test]
fn halt_pauses_at_any_time_and_homing_ends_at_the_same_reference() {
    let settings = settings(STOP_AT_REFERENCE_POINT);
    let machine = || Machine::new(0, TURN / 9, 0, Some(TURN / 2));
    let undisturbed = machine().home(&settings).reference.unwrap();
    for halt_at in (0..8_000).step_by(37) {
        let mut machine = machine();
        let mut homing = Homing::start(Position::from_bits(machine.position));
        let mut last = None;
        for tick in 0..20_000 {
            machine.run = !(halt_at..halt_at + 300).contains(&tick);
            let output = homing.tick(&settings, machine.inputs());
            if !machine.run {
                assert_eq!(output.motion, HomingMotion::Hold);
            }
            if output.state != HomingState::Running {
                last = Some(output);
                break;
            }
            machine.follow(&output);
        }
        let output = last.expect("homing ends");
        assert_eq!(output.reference.unwrap().shift, undisturbed.shift, "halted at {halt_at}");
        assert_eq!(machine.position, TURN / 2 - TURN / 3);
    }
}
