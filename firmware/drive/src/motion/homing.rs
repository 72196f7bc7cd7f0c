//! Homing S-0-0148 under way: a movement that the drive makes by itself.

use servo::axis::Travel;
use servo::homing::{Homing, HomingError, HomingInputs, HomingMotion, HomingSettings, HomingState};
use servo::path::MotionLimits;
use servo::units::Position;

/// Why homing failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum HomingFailure {
    /// The way was not as it should be.
    Way(HomingError),
    /// The torque went.
    Torque,
}

/// A homing under way, with what it works with.
#[derive(Clone, Copy, Debug)]
pub(super) struct HomingRun {
    homing: Homing,
    settings: HomingSettings,
    limits: MotionLimits,
    /// Armed, and the first index position since.
    index: Option<Option<Position>>,
    /// S-0-0408.
    marker_registered: bool,
}

/// What a tick of homing asks for.
#[derive(Clone, Copy, Debug)]
pub(super) struct HomingStep {
    /// The movement of the axis.
    pub(super) travel: Travel,
    /// The index pulse is to be armed.
    pub(super) arm_index: bool,
    /// How it has ended, if it has: with the way by which the zero is to move.
    pub(super) end: Option<Result<Position, Option<HomingFailure>>>,
}

impl HomingRun {
    /// Begins where the axis is.
    pub(super) const fn start(position: Position, settings: HomingSettings, limits: MotionLimits) -> Self {
        Self { homing: Homing::start(position), settings, limits, index: None, marker_registered: false }
    }

    /// The home switch is an input of the drive, not S-0-0400.
    pub(super) const fn is_switch_at_drive(&self) -> bool {
        self.settings.is_switch_at_drive()
    }

    /// Velocity, acceleration and jerk of its movements.
    pub(super) const fn limits(&self) -> MotionLimits {
        self.limits
    }

    /// S-0-0408.
    pub(super) const fn marker_registered(&self) -> bool {
        self.marker_registered
    }

    /// The position of an index pulse: the first since it was armed counts.
    pub(super) fn note_marker(&mut self, index: Option<Position>) {
        if let Some(first) = &mut self.index {
            *first = first.or(index);
        }
    }

    /// One tick, before the loops: the edge of a switch is found at their rate. The index of the inputs is left to the homing.
    pub(super) fn tick(&mut self, inputs: HomingInputs) -> HomingStep {
        let inputs = HomingInputs { index: self.index.flatten(), ..inputs };
        let output = self.homing.tick(&self.settings, inputs);
        let arm_index = output.arm_index && self.index.is_none();
        if arm_index {
            self.index = Some(None);
        }
        self.marker_registered = output.marker_registered;
        let travel = match output.motion {
            HomingMotion::Hold => Travel::Hold,
            HomingMotion::Velocity(velocity) => Travel::AtVelocity(velocity),
            HomingMotion::MoveTo(position) => Travel::To(position),
        };
        let end = match (output.state, output.reference) {
            (HomingState::Running, _) => None,
            (HomingState::Done, Some(reference)) => Some(Ok(reference.shift)),
            (HomingState::Done, None) => Some(Err(None)),
            (HomingState::Failed(error), _) => Some(Err(Some(HomingFailure::Way(error)))),
        };
        HomingStep { travel, arm_index, end }
    }
}
