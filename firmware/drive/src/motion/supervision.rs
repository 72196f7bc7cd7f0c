//! Everything that looks after the loops, every 500 us in two halves: what cannot wait, with switching on and off and the brake, and 250 us
//! later what can: heat, diagnostic words, and who is told.

use sercon816::Bus;
use sercos::Phase;
use sercos::diagnostic::{Class1, Class3};
use servo::axis::Mode;
use servo::monitor::Commanded;
use servo::motor::{CALIBRATION_TICKS, MotorFaults, SequenceInputs, Surroundings};
use servo::units::{Position, Velocity};

use super::Motion;
use super::operation::permits_torque;
use super::status::{Look, TORQUE_LIMITS};
use crate::diagnosis::faults::Findings;
use crate::diagnosis::words::Manufacturer1;
use crate::hardware::Hardware;
use crate::operation_mode::Reaction;
use crate::state::Conditions;
use crate::tasks::Tasks;

impl<B: Bus + Clone, H: Hardware> Motion<B, H> {
    /// Task of the supervision, every 250 us, started by every second loop tick: one half of it, and the other one the next time. The loops and
    /// t3 wait for the half that is under way: in one piece it would make an order to the current loop late.
    ///
    /// Contract: done before the next loop tick, 125 us after the one that started it, with the tasks of the chip in between. No bus access.
    pub fn supervise(&mut self) -> Tasks {
        self.halves = self.halves.wrapping_add(1);
        if self.halves & 1 == 1 {
            self.look_after_the_axis();
            Tasks::empty()
        } else {
            self.bring_up_to_date()
        }
    }

    /// The half that cannot wait: looks after the axis and its motor side, steps the state machine, brake and probes.
    fn look_after_the_axis(&mut self) {
        self.motor.measure();
        self.inputs = self.hardware.inputs();
        let index = self.hardware.index_latch().map(|latch| self.counted(latch));
        if self.axis.supervise() && !self.positive_stop.is_expected() {
            self.take(Findings { class_1: Class1::EXCESSIVE_DEVIATION, ..Findings::default() });
        }
        self.look_after_the_motor(index);
        self.update_state();
        if self.positioning.takes_over() {
            // From where the axis has just been looked at: by the other half a load that sags has gone on.
            self.position_to_target();
        }
        let index = index.map(|count| self.encoder.position_of(count));
        self.function.note_marker(index);
        self.step_sequence(index);
        self.probe();
    }

    /// The half that can wait: heat, a movement to a target, diagnostic words, and what others have to hear.
    fn bring_up_to_date(&mut self) -> Tasks {
        let faults = self.motor.supervise_heat();
        // Before S-0-0128 has taken P-0-0134 over, the sensor may be another one. A dead one is found again in CP4.
        let unknown =
            if self.ring.phase() == Phase::Cp4 { MotorFaults::NONE } else { MotorFaults::OF_THE_MOTORS_SENSOR };
        self.take_faults(faults.without(unknown));
        if self.positioning.is_active() {
            self.position_to_target();
        }
        self.refresh_words();
        self.accompanied = self.motor.is_searching()
            || self.function.is_travelling_home()
            || self.function.is_identifying()
            || self.oscilloscope.is_recording();
        // Each of them is to be asked.
        let news = self.has_come_to_a_stop()
            | self.clock.has_waited()
            | self.status.is_news(self.operation.state())
            | self.function.has_identified()
            | self.cyclic_limits.needs_preparation();
        if news { Tasks::SERVICE_CHANNEL } else { Tasks::empty() }
    }

    /// What the state machine has to know.
    pub(super) fn conditions(&self) -> Conditions {
        let sustained = self.motor.link_sustains() && self.inputs.bridge_ready && permits_torque(&self.inputs);
        let fault = self.status.has_error();
        let (released, torque_off) = self.operation.progress();
        Conditions {
            operating_phase: self.ring.phase() == Phase::Cp4
                && self.operation.has_switches()
                && !self.ring.is_lost()
                && !self.status.is_parked(),
            power: self.motor.has_power(self.inputs.main_power) && sustained,
            sustained,
            fault,
            fatal: self.status.is_fatal() || (fault && self.settings.reaction == Reaction::TorqueFree),
            standstill: self.output.standstill,
            released,
            torque_off,
        }
    }

    /// Supervision of everything below the velocity loop, and of what only counts while torque is on.
    fn look_after_the_motor(&mut self, index: Option<u32>) {
        let state = self.operation.state();
        let torque = state.has_torque();
        let leaves_its_range = self.leaves_its_range();
        let faults = self.motor.supervise(&Surroundings { torque, count: self.counted(self.motor.count()), index });
        self.take_faults(faults);
        let findings = self.operation.watch_safe_torque_off(&self.inputs, torque);
        self.take(findings);
        if !torque {
            return;
        }
        let mut findings = Findings::default();
        if !self.inputs.bridge_ready
            || (self.operation.bridge_is_lost(&mut self.hardware) && self.motor.measured().trip.is_none())
        {
            findings.add_own(Manufacturer1::AMPLIFIER_FAULT, true);
        } else if !self.motor.link_sustains()
            || (!self.motor.has_power(self.inputs.main_power) && !self.operation.is_stopping(self.status.has_error()))
        {
            // Without power the axis stops or the torque goes, and a drive that does for no reason would help nobody.
            findings.class_1 |= Class1::UNDERVOLTAGE;
        }
        if self.output.velocity.abs() > self.settings.overspeed {
            findings.add_own(Manufacturer1::OVERSPEED, false);
        }
        if leaves_its_range {
            findings.class_1 |= Class1::POSITION_LIMIT;
        }
        let on_the_ring = self.ring.phase() == Phase::Cp4 && !self.ring.is_lost();
        if state.is_in_operation() && on_the_ring && !self.clock.is_locked() {
            findings.add_own(Manufacturer1::SYNCHRONISATION, false);
        }
        self.take(findings);
    }

    /// A command leads the axis beyond its position limits.
    fn leaves_its_range(&mut self) -> bool {
        let (axis, encoder, output) = (&self.axis, &self.encoder, &self.output);
        let (ring, settings) = (&self.ring, &self.settings);
        let in_operation = self.operation.state().is_in_operation();
        let range = self.settings.coordinates.range;
        let (reference, limits) = (self.reference, self.settings.position_limits);
        self.reference.is_left(limits, || {
            let position = encoder.position();
            // With the zero of the data: the nearer one of a modulo axis.
            let swing = limits.map_or(Position::ZERO, |limits| limits.swing);
            let measured = reference.beside_the_last(range, axis.cyclic_position(position), swing);
            let commanded = match axis.mode() {
                _ if !in_operation => Commanded::Nothing,
                // A stop leads nowhere, and a place is held where the axis has come to.
                Mode::Off | Mode::Stopping | Mode::Braking | Mode::Halt => Commanded::Nothing,
                Mode::Position | Mode::Travel => {
                    let near = |place: Position| measured + (place - position);
                    let setpoint = near(output.position_command);
                    axis.aim().map_or(Commanded::Rest(setpoint), |aim| Commanded::At { setpoint, aim: near(aim) })
                }
                // A command begins with the velocity of the shaft, which may tremble: as far as it is led there, too.
                Mode::Velocity => {
                    let (now, aim) = (output.velocity_command, ring.commands().velocity(settings));
                    let outwards = if now < Velocity::ZERO { now.max(aim) } else { now.min(aim) };
                    let led = (now < Velocity::ZERO) == (outwards < Velocity::ZERO);
                    Commanded::Turn(if led { outwards } else { Velocity::ZERO })
                }
                // No velocity is commanded, and the measured one of a standing axis is noise.
                Mode::Torque if output.standstill => Commanded::Turn(Velocity::ZERO),
                Mode::Torque => Commanded::Turn(output.velocity),
            };
            (measured, commanded)
        })
    }

    /// Errors have been found; the state follows with [`Motion::update_state`].
    pub(super) fn take(&mut self, findings: Findings) {
        self.status.raise(findings);
        // Increments were lost or added: nobody knows any more where the axis is.
        if findings.class_1.contains(Class1::FEEDBACK) {
            self.reference.forget();
        }
    }

    /// What the motor side has found, if anything.
    #[inline]
    fn take_faults(&mut self, faults: MotorFaults) {
        if !faults.is_empty() {
            self.take(faults.into());
        }
    }

    /// One step of switching on or off, and what it asks of bridge and brake.
    fn step_sequence(&mut self, index: Option<Position>) {
        let mut faults = MotorFaults::NONE;
        let bridge_on = self.operation.bridge_is_on(&mut self.hardware);
        let progress = self.motor.sequence(
            &SequenceInputs {
                wanted: self.operation.sequence(),
                bridge_on,
                standstill: self.output.standstill,
                position: self.encoder.position(),
                torque_command: self.output.current,
                brake_contact: self.inputs.brake_open,
                blocked: !self.positive_stop.is_expected()
                    && self.output.standstill
                    && self.status.class_3().contains(Class3::TORQUE_LIMIT)
                    && self.output.velocity_command.abs() > self.settings.standstill_window,
                index,
            },
            &mut faults,
        );
        self.take_faults(faults);
        if let Some(current) = progress.preload {
            self.axis.preload(current);
        }
        if let Some(current) = progress.anchor {
            self.axis.anchor(current);
        }
        self.operation.take_progress(&progress, &mut self.hardware);
    }

    /// The positive stop is reached, or out of reach.
    fn has_come_to_a_stop(&mut self) -> bool {
        let (output, window) = (&self.output, self.settings.standstill_window);
        // The shaft stands, whatever is commanded.
        let pressed = || output.limiting.intersects(TORQUE_LIMITS) && output.velocity.abs() <= window;
        self.positive_stop.look(self.operation.state().has_torque(), pressed)
    }

    /// The diagnostic words, from what the loops gave in their last tick.
    fn refresh_words(&mut self) {
        let torque = self.operation.state().has_torque();
        let look = Look {
            settings: &self.settings,
            output: &self.output,
            watched: self.motor.watched(),
            torque_current: self.motor.torque_current(),
            motor_limiting: self.motor.limiting(),
            torque,
            without_power: self.operation.wants_torque() && !torque && !self.motor.has_power(self.inputs.main_power),
            operating_phase: self.ring.phase() == Phase::Cp4,
            locked: self.clock.is_locked(),
            telegram_lost: self.ring.shows_loss(),
            bridge_ready: self.inputs.bridge_ready,
            limit_out_of_range: self.cyclic_limits.complains(),
            not_calibrated: !self.motor.measured().calibrated && self.halves >> 1 > u64::from(CALIBRATION_TICKS),
            reached: self.reached(),
        };
        self.status.look(&look);
    }
}
