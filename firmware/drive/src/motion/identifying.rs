//! The identification of the motor (P-0-0224 to P-0-0226) within the loop tick: when it may run, what it takes over, how it ends.
//!
//! It runs while the drive is in operation and halted, instead of the halt: the control unit keeps both hands on it, because the end of
//! HALT, like every other change of state, ends the identification before the loops act again.

use sercon816::Bus;
use servo::axis::Mode;
use servo::identification::IdentificationInputs;

use super::Motion;
use crate::hardware::Hardware;
use crate::identification::{Failure, Identification, Outcome, Plan, Request};
use crate::state::DriveState;

impl<B: Bus + Clone, H: Hardware> Motion<B, H> {
    /// The drive holds a motor that stands, by HALT, and nothing else is made of that.
    pub(crate) fn may_identify(&self) -> bool {
        self.machine.state() == DriveState::Halted
            && self.is_standing()
            && !self.homing
            && self.identification.is_none()
            && self.motor.commutates()
    }

    /// Starts; `false` if it may not.
    pub(crate) fn start_identification(&mut self, plan: &Plan) -> bool {
        if !self.may_identify() {
            return false;
        }
        let position = self.encoder.position();
        // Known, see `may_identify`.
        let angle = self.motor.commutation_angle(position).unwrap_or(0);
        self.identification = Some(Identification::start(plan, position, angle));
        self.identified = None;
        self.identification_percent = 0;
        self.update_state();
        true
    }

    /// Gives up what runs. Nobody is told of it.
    pub(crate) fn cancel_identification(&mut self) {
        self.abandon_identification();
        self.identified = None;
        self.update_state();
    }

    /// An identification is under way.
    pub(crate) const fn is_identifying(&self) -> bool {
        self.identification.is_some()
    }

    /// What came of it, once.
    pub(crate) fn take_identified(&mut self) -> Option<Outcome> {
        self.identified.take()
    }

    /// What the axis does instead of holding its position.
    pub(super) fn identification_mode(&self) -> Mode {
        match &self.identification {
            Some(identification) if identification.turns() => Mode::Velocity,
            // The current along the magnets holds the rotor, and the loops look on.
            _ => Mode::Off,
        }
    }

    /// The state has changed under it.
    pub(super) fn abandon_identification(&mut self) {
        if self.identification.is_some() {
            self.end_identification(Err(Failure::Interrupted));
        }
    }

    /// One tick, before that of the axis.
    pub(super) fn identify(&mut self) {
        let position = self.encoder.position();
        let Some(identification) = &mut self.identification else { return };
        let inputs = IdentificationInputs {
            readings: self.motor.measured().readings,
            longest_voltage: self.motor.longest_voltage(),
            position,
        };
        let step = identification.tick(&inputs);
        self.identification_percent = step.percent;
        match step.request {
            Request::Current { angle, current } => self.motor.hold(Some((angle, current))),
            Request::Velocity(velocity) => self.axis.command_velocity(velocity),
        }
        if let Some(result) = step.result {
            self.end_identification(result.map_err(Failure::Sequence));
        }
    }

    fn end_identification(&mut self, outcome: Outcome) {
        self.identification = None;
        self.identified = Some(outcome);
        self.motor.hold(None);
        // The halt takes over in this tick already, from where and how fast the motor is.
        if self.machine.state() == DriveState::Halted {
            self.axis.set_mode(Mode::Halt);
        }
    }
}
