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
//! * With the switch alone: the input is read once a tick and the edge taken in the middle between two readings. At a velocity of `v`
//!   revolutions per second the error is at most `v * 125 us / 2`: 0.0375 degrees at 100 rpm, besides the delay and the scatter of the
//!   switch itself.

mod settings;

use core::fmt;

use settings::{
    HALF_REVOLUTION, HOMING_ENABLE_EVALUATED, MARKER_NOT_EVALUATED, NEGATIVE, STOP_AT_REFERENCE_POINT,
    SWITCH_NOT_EVALUATED,
};
pub use settings::{HomingParameters, HomingSettings, HomingSettingsError};

use crate::units::{Position, Velocity};

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
    /// To be added to positions so that the reference point reads S-0-0052: the argument of [`crate::axis::Axis::shift`].
    pub shift: Position,
    /// Edge of the home switch, in the coordinates before the shift; `None` when it is not evaluated.
    pub switch: Option<Position>,
    /// Marker, in the coordinates before the shift; `None` when it is not evaluated.
    pub marker: Option<Position>,
    /// Reference cam shift S-0-0298: the switch, moved so far in the homing direction (negative: against it), would have the marker half
    /// a revolution behind it, where neither scatter nor wear of the switch chooses another marker. Adding it to S-0-0299 does the same;
    /// where it is negative, with one revolution more, for the marker after this one. Zero without switch or without marker.
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
