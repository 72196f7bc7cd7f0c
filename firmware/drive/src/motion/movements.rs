//! Movements of the drive's own, and the probes that look on: from the parts that know the way to axis, motor and hardware.

use sercon816::Bus;
use servo::axis::Mode;
use servo::homing::HomingInputs;
use servo::identification::IdentificationInputs;
use servo::probe::{ProbeInput as ProbeSide, ProbeInputs};
use servo::units::Position;

use super::Motion;
use super::function::Function;
use super::identification::Request;
use super::positioning::Scene;
use crate::hardware::{Hardware, ProbeInput};
use crate::signal::control_bits::Enable;
use crate::state::DriveState;

impl<B: Bus + Clone, H: Hardware> Motion<B, H> {
    /// Begins or ends a function, and what follows from it.
    pub(super) fn with_function<T>(&mut self, change: impl FnOnce(&mut Function) -> T) -> T {
        let result = change(&mut self.function);
        self.update_state();
        result
    }

    /// One loop tick of homing, before the loops: the edge of a switch is found at their rate. Returns whether the service channel has
    /// something to take.
    pub(super) fn home(&mut self) -> bool {
        let Some(run) = self.function.homing() else { return false };
        let (at_drive, limits) = (run.is_switch_at_drive(), run.limits());
        if !self.operation.state().is_in_operation() {
            self.function.fail_homing();
            return true;
        }
        // The others are the supervision's, which says why the torque goes when it acts on them.
        self.inputs.home_switch = self.hardware.inputs().home_switch;
        let inputs = HomingInputs {
            position: self.encoder.position(),
            home_switch: self.home_switch(at_drive),
            homing_enable: self.controls.has(Enable::Homing),
            index: None,
            standstill: self.output.standstill,
            moving_finished: self.output.travelled,
            run: self.operation.may_run(),
        };
        let Some(step) = self.function.home(inputs) else { return false };
        if step.arm_index {
            self.hardware.arm_index();
        }
        self.axis.travel(limits, step.travel);
        if let Some(Ok(shift)) = step.end {
            self.shift_zero(shift);
            self.reference.set();
        }
        step.end.is_some()
    }

    /// The home switch of its owner.
    pub(super) fn home_switch(&self, at_drive: bool) -> bool {
        if at_drive { self.inputs.home_switch } else { self.controls.has(Enable::HomeSwitch) }
    }

    /// Moves the zero of all positions by `difference` without a movement. Divides.
    pub(super) fn shift_zero(&mut self, difference: Position) {
        self.encoder.set_position(self.encoder.position() + difference);
        self.axis.shift(difference);
        self.motor.shift(difference);
        // What the last tick and the last t4 have left is read before the next.
        self.output.position_command = self.output.position_command + difference;
        self.shown.position = self.shown.position + difference;
        self.reference.zero_has_moved();
        self.positioning.forget();
    }

    /// One loop tick of an identification, before that of the axis.
    pub(super) fn identify(&mut self) {
        let inputs = IdentificationInputs {
            readings: self.motor.measured().readings,
            longest_voltage: self.motor.longest_voltage(),
            position: self.encoder.position(),
        };
        let Some((request, ended)) = self.function.identify(&inputs) else { return };
        match request {
            Request::Current { angle, current } => self.motor.hold(Some((angle, current))),
            Request::Velocity(velocity) => self.axis.command_velocity(velocity),
        }
        if ended {
            self.let_go();
        }
    }

    /// An identification has ended.
    pub(super) fn let_go(&mut self) {
        self.motor.hold(None);
        // The halt takes over in this tick already, from where and how fast the motor is.
        if self.operation.state() == DriveState::Halted {
            self.axis.set_mode(Mode::Halt);
        }
    }

    /// The axis, as a movement to a target sees it.
    #[inline]
    pub(super) fn scene(&self) -> Scene<'_> {
        Scene::new(&self.axis, &self.output, &self.settings, self.encoder.position())
    }

    /// A mode with a target may begin or end.
    #[inline(never)]
    pub(super) fn watch_positioning(&mut self) {
        let free =
            matches!(self.operation.state(), DriveState::Following | DriveState::Halted) && self.function.is_none();
        let control = self.ring.commands().positioning_control;
        self.positioning.watch(self.operation.mode(), free, control, self.settings.positioning.drops_target);
    }

    /// One step on the way to the target of a positioning.
    #[inline(never)]
    pub(super) fn position_to_target(&mut self) {
        let scene = Scene::new(&self.axis, &self.output, &self.settings, self.encoder.position());
        let step = self.positioning.step(&scene, self.ring.commands());
        if let Some(data) = step.stays_at {
            self.ring.replace_target(data);
        }
        if step.renewed {
            self.status.show_reached(self.reached(), self.settings.class_3_mask);
        }
        let limits = self.cyclic_limits.movements().positioning.unwrap_or(self.settings.positioning.limits);
        self.axis.travel(limits, step.travel);
    }

    /// One look at the probes.
    pub(super) fn probe(&mut self) {
        let direction = self.motor.direction();
        self.probing.look(|| {
            let mut side = |probe: ProbeInput, level: bool, enable: bool| {
                let mut latched = |rising| {
                    let latch = self.hardware.probe_latch(probe, rising)?;
                    // In the turn of the data in which the edge came.
                    Some(self.axis.cyclic_position(self.encoder.position_of(latch.wrapping_mul(direction))))
                };
                ProbeSide { level, enable, positive: latched(true), negative: latched(false) }
            };
            let one = side(ProbeInput::One, self.inputs.probe_1, self.controls.has(Enable::Probe1));
            let two = side(ProbeInput::Two, self.inputs.probe_2, self.controls.has(Enable::Probe2));
            ProbeInputs { active: true, one, two }
        });
    }
}
