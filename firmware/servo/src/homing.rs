//! Drive-controlled homing S-0-0148: finds the home switch and the marker of the encoder, and with them the zero of the axis.
//!
//! ```text
//!           on the switch                          edge                 index pulse
//! start --> Leave --> TurnAround --> Approach -------------> Marker ------------------> Arrive --> done
//!                       (stands)                (S-0-0299)             (S-0-0150, 0052)
//! ```
//!
//! The sequencer asks for motion and looks at what comes of it; it does not interpolate. A home switch divides the way into two zones: the
//! homing direction leads from the zone before the switch onto the switch. An axis that starts on it first goes back until it is off,
//! stands, and then approaches like any other: the edge is always met in the homing direction.
//!
//! # Accuracy
//! * With marker: that of the hardware latch, one increment of the encoder at any velocity. The switch only chooses the revolution.
//! * With the switch alone: the input is read once a tick and the edge taken in the middle between two readings. At a velocity of `v` revolutions per
//!   second the error is at most `v * 125 us / 2`: 0.0375 degrees at 100 rpm, besides the delay and the scatter of the switch itself.

mod settings;

use core::fmt;

use settings::{
    HALF_REVOLUTION, HOMING_ENABLE_EVALUATED, MARKER_NOT_EVALUATED, NEGATIVE, STOP_AT_REFERENCE_POINT,
    SWITCH_NOT_EVALUATED,
};
pub use settings::{HomingParameters, HomingSettings, HomingSettingsError};

use crate::{Position, Velocity};

/// A marker closer than this to the beginning of its search, or to a whole revolution behind it, may be missed or met by chance.
const UNAMBIGUOUS: i64 = HALF_REVOLUTION / 4;

/// What homing looks at in a tick. All positions have the same zero, from the start to the end of homing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct HomingInputs {
    /// Position measured in this tick.
    pub position: Position,
    /// Home switch S-0-0400.
    pub home_switch: bool,
    /// Homing enable S-0-0407.
    pub homing_enable: bool,
    /// Position latched in hardware at the first index pulse since [`HomingOutput::arm_index`] went from `false` to `true`.
    pub index: Option<Position>,
    /// The axis stands (S-0-0331).
    pub standstill: bool,
    /// The movement that the last [`HomingMotion::MoveTo`] asked for has reached its target.
    pub moving_finished: bool,
    /// Control word bit 13; `false` (halt) pauses the movement.
    pub run: bool,
}

/// Movement that homing asks for, with the homing acceleration S-0-0042.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum HomingMotion {
    /// Brake and stand.
    Hold,
    /// Turn at this velocity (S-0-0041 with sign).
    Velocity(Velocity),
    /// Go to this position at S-0-0041.
    MoveTo(Position),
}

/// The reference point that was found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Reference {
    /// To be added to positions so that the reference point reads S-0-0052: the argument of [`crate::Axis::shift`].
    pub shift: Position,
    /// Edge of the home switch, in the coordinates before the shift; `None` when it is not evaluated.
    pub switch: Option<Position>,
    /// Marker, in the coordinates before the shift; `None` when it is not evaluated.
    pub marker: Option<Position>,
    /// Reference cam shift S-0-0298: the switch, moved so far in the homing direction (negative: against it), would have the marker half a
    /// revolution behind it, where neither scatter nor wear of the switch chooses another marker. Adding it to S-0-0299 does the same; where it is
    /// negative, with one revolution more, for the marker after this one. Zero without switch or without marker.
    pub cam_shift: Position,
    /// The marker lies within 1/8 revolution of the beginning of its search, or of a whole revolution behind it: the next homing may find
    /// the one before or after. `cam_shift` is the remedy.
    pub is_ambiguous: bool,
}

/// Why homing failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum HomingError {
    /// The home switch (or its end, where homing began on it) did not come. Wiring, homing direction, polarity (S-0-0147 bits 0 and 1).
    SwitchNotFound {
        /// Way from the start.
        travelled: Position,
    },
    /// No index pulse came. Index track of the encoder, its input, or a way that is blocked.
    MarkerNotFound {
        /// Way since the marker was first expected.
        travelled: Position,
    },
    /// Homing enable S-0-0407 was 0 where the switch or the marker was to be taken (S-0-0147 bit 4).
    HomingEnableMissing,
}

impl fmt::Display for HomingError {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::SwitchNotFound { travelled } => {
                write!(formatter, "home switch not found on a way of {} revolutions", travelled.to_revolutions())
            }
            Self::MarkerNotFound { travelled } => {
                write!(formatter, "no marker on a way of {} revolutions", travelled.to_revolutions())
            }
            Self::HomingEnableMissing => {
                formatter.write_str("homing enable S-0-0407 was not set at the switch or marker")
            }
        }
    }
}

impl core::error::Error for HomingError {}

/// How far homing has come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum HomingState {
    /// Under way or paused.
    Running,
    /// The reference is known; the axis stands.
    Done,
    /// Given up; the axis brakes.
    Failed(HomingError),
}

/// What homing asks for and tells in a tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct HomingOutput {
    /// Movement until the next tick.
    pub motion: HomingMotion,
    /// Latch the first index pulse from now on. A rising edge discards what was latched before.
    pub arm_index: bool,
    /// The marker has been found (S-0-0408).
    pub marker_registered: bool,
    /// What was found; `Some` from the tick in which the state becomes [`HomingState::Done`].
    pub reference: Option<Reference>,
    /// State after this tick.
    pub state: HomingState,
}

/// State of homing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Homing {
    phase: Phase,
    start: Position,
    last: Position,
    /// The index pulse was armed in the last tick; the hardware has had its time.
    index_armed: bool,
    /// The last output was the movement to the reference point.
    moving: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
enum Phase {
    /// Nothing has been looked at yet.
    Start,
    /// Off the switch, against the homing direction.
    Leave,
    /// Off the switch, braking.
    TurnAround,
    /// In the homing direction, towards the edge of the switch.
    Approach,
    /// In the homing direction, towards the marker, which counts from `begin` on.
    Marker {
        switch: Option<Position>,
        begin: Position,
    },
    /// To the reference point, or to a stand anywhere.
    Arrive {
        reference: Reference,
        point: Position,
    },
    Done(Reference),
    Failed(HomingError),
}

impl Homing {
    /// Begins at this position. The caller has cleared S-0-0403 bit 0.
    #[must_use]
    pub const fn start(position: Position) -> Self {
        Self { phase: Phase::Start, start: position, last: position, index_armed: false, moving: false }
    }

    /// One tick of 125 us. The settings must stay the same from the start to the end.
    #[inline]
    pub fn tick(&mut self, settings: &HomingSettings, inputs: HomingInputs) -> HomingOutput {
        self.phase = self.next_phase(settings, &inputs);
        self.last = inputs.position;
        let (wanted, arm_index, marker_registered) = match self.phase {
            Phase::Start | Phase::TurnAround | Phase::Done(_) | Phase::Failed(_) => (HomingMotion::Hold, false, false),
            Phase::Leave => (HomingMotion::Velocity(-settings.velocity), false, false),
            Phase::Approach => (HomingMotion::Velocity(settings.velocity), false, false),
            Phase::Marker { begin, .. } => {
                let begun = settings.forwards(inputs.position - begin) >= 0;
                let enabled = inputs.homing_enable || !settings.has(HOMING_ENABLE_EVALUATED);
                (HomingMotion::Velocity(settings.velocity), self.index_armed || (begun && enabled), false)
            }
            Phase::Arrive { point, .. } if settings.has(STOP_AT_REFERENCE_POINT) => {
                (HomingMotion::MoveTo(point), false, true)
            }
            Phase::Arrive { .. } => (HomingMotion::Hold, false, true),
        };
        let motion = if inputs.run { wanted } else { HomingMotion::Hold };
        self.index_armed = arm_index;
        self.moving = matches!(motion, HomingMotion::MoveTo(_));
        let (reference, state) = match self.phase {
            Phase::Done(reference) => (Some(reference), HomingState::Done),
            Phase::Failed(error) => (None, HomingState::Failed(error)),
            _ => (None, HomingState::Running),
        };
        let found = marker_registered || reference.is_some();
        HomingOutput {
            motion,
            arm_index,
            marker_registered: found && !settings.has(MARKER_NOT_EVALUATED),
            reference,
            state,
        }
    }

    #[inline]
    fn next_phase(&self, settings: &HomingSettings, inputs: &HomingInputs) -> Phase {
        let on_switch = settings.is_on_switch(inputs.home_switch);
        match self.phase {
            Phase::Start if settings.has(SWITCH_NOT_EVALUATED) => found(settings, inputs, None, inputs.position),
            Phase::Start if on_switch => Phase::Leave,
            Phase::Start => Phase::Approach,
            Phase::Leave if !on_switch => Phase::TurnAround,
            // A switch that bounced, or a short one behind the axis: once more.
            Phase::TurnAround if inputs.standstill && on_switch => Phase::Leave,
            Phase::TurnAround if inputs.standstill => Phase::Approach,
            Phase::Approach if on_switch => found(settings, inputs, Some(self.edge(inputs)), self.edge(inputs)),
            Phase::Leave | Phase::TurnAround | Phase::Approach => self.within_travel(settings, inputs),
            Phase::Marker { switch, begin } => self.marker(settings, inputs, switch, begin),
            Phase::Arrive { reference, .. } if self.has_arrived(settings, inputs) => Phase::Done(reference),
            Phase::Arrive { .. } | Phase::Done(_) | Phase::Failed(_) => self.phase,
        }
    }

    /// The middle of the last tick's way: the switch has changed somewhere on it.
    #[inline]
    fn edge(&self, inputs: &HomingInputs) -> Position {
        self.last + Position::from_bits((inputs.position - self.last).to_bits() / 2)
    }

    #[inline]
    fn within_travel(&self, settings: &HomingSettings, inputs: &HomingInputs) -> Phase {
        let travelled = (inputs.position - self.start).abs();
        if travelled.to_bits() > settings.travel_limit {
            return Phase::Failed(HomingError::SwitchNotFound { travelled });
        }
        self.phase
    }

    #[inline]
    fn marker(
        &self,
        settings: &HomingSettings,
        inputs: &HomingInputs,
        switch: Option<Position>,
        begin: Position,
    ) -> Phase {
        // A latch that was not armed yet holds an older pulse.
        if let (true, Some(marker)) = (self.index_armed, inputs.index) {
            return arrive(settings, switch, Some((begin, marker)), marker);
        }
        let travelled = inputs.position - begin;
        if settings.forwards(travelled) <= settings.marker_limit {
            return self.phase;
        }
        Phase::Failed(if self.index_armed {
            HomingError::MarkerNotFound { travelled: travelled.abs() }
        } else {
            HomingError::HomingEnableMissing
        })
    }

    #[inline]
    const fn has_arrived(&self, settings: &HomingSettings, inputs: &HomingInputs) -> bool {
        if settings.has(STOP_AT_REFERENCE_POINT) { self.moving && inputs.moving_finished } else { inputs.standstill }
    }
}

/// The switch is found, or not evaluated: to the marker, or to the reference point.
#[inline]
fn found(settings: &HomingSettings, inputs: &HomingInputs, switch: Option<Position>, place: Position) -> Phase {
    let marker = !settings.has(MARKER_NOT_EVALUATED);
    // Without switch, the marker waits for homing enable.
    let needs_enable = settings.has(HOMING_ENABLE_EVALUATED) && (switch.is_some() || !marker);
    if needs_enable && !inputs.homing_enable {
        return Phase::Failed(HomingError::HomingEnableMissing);
    }
    if !marker {
        return arrive(settings, switch, None, place);
    }
    let offset = if switch.is_some() { settings.switch_offset } else { 0 };
    let offset = Position::from_bits(offset);
    Phase::Marker { switch, begin: if settings.has(NEGATIVE) { place - offset } else { place + offset } }
}

/// The place from which S-0-0150 leads to the reference point is known. `marker` is the beginning of its search and itself.
#[inline]
fn arrive(
    settings: &HomingSettings,
    switch: Option<Position>,
    marker: Option<(Position, Position)>,
    place: Position,
) -> Phase {
    let point = place + settings.reference_offset;
    let distance = match (switch, marker) {
        (Some(_), Some((begin, marker))) => Some(settings.forwards(marker - begin)),
        _ => None,
    };
    let reference = Reference {
        shift: settings.reference_distance - point,
        switch,
        marker: marker.map(|(_, marker)| marker),
        cam_shift: Position::from_bits(distance.map_or(0, |distance| distance.wrapping_sub(HALF_REVOLUTION))),
        is_ambiguous: distance.is_some_and(|distance| {
            distance.wrapping_sub(HALF_REVOLUTION).saturating_abs() > HALF_REVOLUTION.wrapping_sub(UNAMBIGUOUS)
        }),
    };
    Phase::Arrive { reference, point }
}

#[cfg(test)]
mod tests {
    use super::*;

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
            let output = machine.home(&settings(way | SWITCH_NOT_EVALUATED));
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
            let HomingState::Failed(HomingError::SwitchNotFound { travelled }) = output.state else {
                panic!("{output:?}")
            };
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
            let HomingState::Failed(HomingError::MarkerNotFound { travelled }) = output.state else {
                panic!("{output:?}")
            };
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
}
