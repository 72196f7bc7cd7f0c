//! What the drive makes of the axis by itself, started over the service channel: homing S-0-0148 or an identification P-0-0224 to P-0-0226.
//!
//! They exclude each other: neither begins while the other is under way, nor an identification while S-0-0148 holds the axis. An identification
//! runs while the drive is in operation and halted, instead of the halt: the control unit keeps both hands on it, because the end of HALT, like
//! every other change of state, ends the identification before the loops act again. A homing that has ended holds the axis as HALT does, until
//! it is cancelled.
//!
//! Positioning is no such function but an operation mode, the positive stop S-0-0149 looks on while any of them moves the axis, and so do the
//! probes: these have files of their own.

use sercos::command::CommandState;
use servo::axis::Mode;
use servo::homing::{HomingInputs, HomingSettings};
use servo::identification::IdentificationInputs;
use servo::path::MotionLimits;
use servo::units::Position;

use super::homing::{HomingFailure, HomingRun, HomingStep};
use super::identification::{Failure, Identification, Outcome, Plan, Request};

/// The function that is active, and how the last ones have ended.
#[derive(Debug, Default)]
pub(super) struct Function {
    active: Active,
    /// How a homing has ended, until the service channel has taken it.
    homed: Option<CommandState>,
    /// Why it failed.
    homing_error: Option<HomingFailure>,
    /// S-0-0408 of a homing that has ended.
    marker_registered: bool,
    /// What came of an identification, until the background has asked.
    identified: Option<Outcome>,
    /// P-0-0227.
    percent: u8,
}

/// Its number is a byte of its own, not a niche of what is inside: that S-0-0148 holds the axis is asked for at every step of the state.
#[derive(Debug, Default)]
#[repr(u8)]
#[expect(
    clippy::large_enum_variant,
    reason = "the smaller ones lie in the memory of the largest; there is no heap to put it on"
)]
enum Active {
    /// The axis is the control's.
    #[default]
    None,
    /// P-0-0224, P-0-0225 or P-0-0226 is under way.
    Identification(Identification),
    /// S-0-0148 has ended, and holds the axis until it is cancelled.
    Held,
    /// S-0-0148 moves the axis.
    Homing(HomingRun),
}

impl Function {
    /// No function is active.
    #[inline]
    pub(super) const fn is_none(&self) -> bool {
        matches!(self.active, Active::None)
    }

    /// S-0-0148 moves or holds the axis.
    #[inline]
    pub(super) const fn holds(&self) -> bool {
        matches!(self.active, Active::Homing(_) | Active::Held)
    }

    /// S-0-0148 moves the axis.
    #[inline]
    pub(super) const fn is_travelling_home(&self) -> bool {
        matches!(self.active, Active::Homing(_))
    }

    /// An identification is under way.
    #[inline]
    pub(super) const fn is_identifying(&self) -> bool {
        matches!(self.active, Active::Identification(_))
    }

    /// What the axis does for the function, in the place of what HALT or the operation mode say.
    #[inline]
    pub(super) const fn axis_mode(&self) -> Option<Mode> {
        match &self.active {
            Active::None | Active::Held => None,
            Active::Homing(_) => Some(Mode::Travel),
            Active::Identification(identification) if identification.turns() => Some(Mode::Velocity),
            // The current along the magnets holds the rotor, and the loops look on.
            Active::Identification(_) => Some(Mode::Off),
        }
    }

    /// Starts a homing with a movement, also in the place of one before. `false`: an identification is under way.
    pub(super) fn start_homing(&mut self, position: Position, settings: HomingSettings, limits: MotionLimits) -> bool {
        if self.is_identifying() {
            return false;
        }
        self.active = Active::Homing(HomingRun::start(position, settings, limits));
        self.homed = None;
        self.homing_error = None;
        self.marker_registered = false;
        true
    }

    /// A homing without a movement holds the axis. Nothing happens while an identification is under way.
    pub(super) fn hold(&mut self) {
        if !self.is_identifying() {
            self.leave_homing();
            self.active = Active::Held;
        }
    }

    /// Homing is cancelled, whether it moves or holds; nobody is told how it would have ended.
    pub(super) fn release(&mut self) {
        if self.holds() {
            self.leave_homing();
        }
        self.homed = None;
    }

    fn leave_homing(&mut self) {
        if let Active::Homing(run) = &self.active {
            self.marker_registered = run.marker_registered();
        }
        self.active = Active::None;
        self.homed = None;
    }

    /// The homing that moves the axis.
    #[inline]
    pub(super) const fn homing(&self) -> Option<&HomingRun> {
        match &self.active {
            Active::Homing(run) => Some(run),
            _ => None,
        }
    }

    /// The position of an index pulse, if the supervision has seen one.
    #[inline]
    pub(super) fn note_marker(&mut self, index: Option<Position>) {
        if let Active::Homing(run) = &mut self.active {
            run.note_marker(index);
        }
    }

    /// One loop tick of homing. What has ended holds the axis from now on.
    pub(super) fn home(&mut self, inputs: HomingInputs) -> Option<HomingStep> {
        let Active::Homing(run) = &mut self.active else { return None };
        let step = run.tick(inputs);
        if let Some(end) = step.end {
            self.end_homing(end.err());
        }
        Some(step)
    }

    /// The torque of a homing has gone.
    pub(super) fn fail_homing(&mut self) {
        self.end_homing(Some(Some(HomingFailure::Torque)));
    }

    fn end_homing(&mut self, failure: Option<Option<HomingFailure>>) {
        self.leave_homing();
        self.active = Active::Held;
        self.homed = Some(if failure.is_some() { CommandState::Failed } else { CommandState::Executed });
        self.homing_error = failure.flatten();
    }

    /// How a homing has ended, once.
    pub(super) const fn take_homing_result(&mut self) -> Option<CommandState> {
        self.homed.take()
    }

    /// Why the last homing failed.
    pub(super) const fn homing_error(&self) -> Option<HomingFailure> {
        self.homing_error
    }

    /// S-0-0408.
    #[inline]
    pub(super) const fn marker_registered(&self) -> bool {
        match &self.active {
            Active::Homing(run) => run.marker_registered(),
            _ => self.marker_registered,
        }
    }

    /// Starts an identification where the motor stands; `angle` is its electrical angle there, in 2^-32 revolution. `false`: another function
    /// is active.
    pub(super) fn start_identification(&mut self, plan: &Plan, position: Position, angle: u32) -> bool {
        let free = self.is_none();
        if free {
            self.active = Active::Identification(Identification::start(plan, position, angle));
            self.identified = None;
            self.percent = 0;
        }
        free
    }

    /// One loop tick of an identification, before that of the axis: what it asks for, and whether it has ended.
    pub(super) fn identify(&mut self, inputs: &IdentificationInputs) -> Option<(Request, bool)> {
        let Active::Identification(identification) = &mut self.active else { return None };
        let step = identification.tick(inputs);
        self.percent = step.percent;
        if let Some(result) = step.result {
            self.active = Active::None;
            self.identified = Some(result.map_err(Failure::Sequence));
        }
        Some((step.request, step.result.is_some()))
    }

    /// The state has changed under an identification: gives it up. Returns whether there was one.
    #[inline]
    pub(super) fn interrupt_identification(&mut self) -> bool {
        let interrupted = self.is_identifying();
        if interrupted {
            self.active = Active::None;
            self.identified = Some(Err(Failure::Interrupted));
        }
        interrupted
    }

    /// What came of an identification, once.
    pub(super) const fn take_identified(&mut self) -> Option<Outcome> {
        self.identified.take()
    }

    /// An identification has ended, and nobody has asked yet how.
    #[inline]
    pub(super) const fn has_identified(&self) -> bool {
        self.identified.is_some()
    }

    /// A function has ended, and nobody has asked yet how.
    #[inline]
    pub(super) const fn has_results(&self) -> bool {
        self.identified.is_some() || self.homed.is_some()
    }

    /// P-0-0227 in %.
    pub(super) const fn percent(&self) -> u8 {
        self.percent
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dictionary::procedures::Procedure;
    use crate::dictionary::source;
    use crate::service::commissioning;
    use crate::service::rig::FACTS;
    use crate::settings::{DriveSettings, homing};

    fn start_homing(function: &mut Function) -> bool {
        let parameters = crate::service::rig::parameters();
        let settings = DriveSettings::new(&parameters, &FACTS, source).unwrap();
        let (settings, limits) = homing(&parameters, &settings.motion).unwrap();
        function.start_homing(Position::ZERO, settings, limits)
    }

    fn start_identification(function: &mut Function) -> bool {
        let plan = commissioning::plan(Procedure::IdentifyInertia, &crate::service::rig::parameters(), FACTS.frequency)
            .unwrap();
        function.start_identification(&plan, Position::ZERO, 0)
    }

    #[test]
    fn no_function_begins_in_the_place_of_another() {
        let mut function = Function::default();
        assert!(start_identification(&mut function));
        assert!(!start_homing(&mut function));
        function.hold();
        function.release();
        assert!(function.is_identifying() && !function.holds(), "an identification is not homing's to end");
        assert!(function.interrupt_identification() && !function.interrupt_identification());
        assert_eq!(function.take_identified(), Some(Err(Failure::Interrupted)));

        assert!(start_homing(&mut function) && !start_identification(&mut function));
        function.fail_homing();
        assert!(function.holds() && !function.is_travelling_home() && !start_identification(&mut function));
        assert!(start_homing(&mut function), "a homing may begin once more");
        function.release();
        assert!(function.is_none() && start_identification(&mut function));
    }

    #[test]
    fn a_homing_that_is_cancelled_tells_nobody_how_it_has_ended_but_why() {
        let mut function = Function::default();
        assert!(start_homing(&mut function));
        function.fail_homing();
        assert!(function.has_results());
        function.release();
        assert_eq!((function.has_results(), function.take_homing_result()), (false, None));
        assert_eq!(function.homing_error(), Some(HomingFailure::Torque));
        assert!(start_homing(&mut function));
        assert_eq!(function.homing_error(), None, "of the one before");
    }
}
