//! Everything that looks after the loops, every 500 us: supervision, switching on and off, brake, diagnostic words, and who is told.

use sercon816::Bus;
use sercos::Phase;
use sercos::diagnostic::{Class1, Class3};
use servo::motor::{MotorFaults, Sequence, SequenceInputs, Surroundings};
use servo::units::Position;

use super::Motion;
use crate::diagnosis::faults::Findings;
use crate::diagnosis::{Manufacturer1, Manufacturer3};
use crate::hardware::Hardware;
use crate::operation_mode::Reaction;
use crate::state::{Conditions, DriveState};
use crate::work::Work;

/// So long the two channels of safe torque off may differ, in ticks of the supervision: relays do not switch at the same instant.
const CHANNELS_DIFFER_TICKS: u16 = 200;

impl<B: Bus + Clone, H: Hardware> Motion<B, H> {
    /// Task of the supervision, every 500 us, started by every fourth loop tick: looks after the motor side, steps the state machine, brake
    /// and probes, and brings the diagnostic words up to date.
    ///
    /// Contract: done before the next loop tick, 125 us after the one that started it, with the tasks of the chip in between. No bus access.
    pub fn supervise(&mut self) -> Work {
        self.supervisions = self.supervisions.wrapping_add(1);
        self.motor.measure();
        self.inputs = self.hardware.inputs();
        let index = self.hardware.index_latch().map(|latch| self.counted(latch));
        self.axis.follow_ranges();
        self.look_after_the_motor(index);
        self.update_state();
        let index = index.map(|count| self.encoder.position_of(count));
        self.note_marker(index);
        self.step_sequence(index);
        self.probe();
        if self.is_positioning() {
            self.position_to_target();
        }
        self.limiting = self.output.limiting | self.motor.limiting();
        self.refresh_words();
        self.accompanied = self.motor.is_searching()
            || self.is_travelling_home()
            || self.is_identifying()
            || self.oscilloscope.is_recording();
        self.watch_positive_stop() | self.tell_lock() | self.tell_news() | self.tell_limits()
    }

    /// One loop tick of what must not wait for the supervision: a counter that says what no shaft does.
    #[inline]
    pub(super) fn watch_encoder(&mut self, count: u32) {
        if let Some(faults) = self.motor.watch_motion(count, self.machine.state().has_torque()) {
            self.take_jump(faults);
        }
    }

    #[cold]
    #[inline(never)]
    fn take_jump(&mut self, faults: MotorFaults) {
        self.take(faults.into());
        self.update_state();
    }

    /// One loop tick of the search for the commutation angle, if it is under way.
    pub(super) fn align(&mut self) {
        if self.motor.is_searching() && self.bridge_on && self.hardware.bridge_is_on() {
            self.motor.search(self.encoder.position());
        }
    }

    pub(super) fn conditions(&self) -> Conditions {
        let sustained = self.motor.link_sustains() && self.inputs.bridge_ready && self.permits_torque();
        Conditions {
            operating_phase: self.phase == Phase::Cp4
                && self.switches.is_some()
                && self.lost.is_none()
                && !self.manufacturer_3.contains(Manufacturer3::PARKED),
            power: self.motor.has_power(self.inputs.main_power) && sustained,
            sustained,
            fault: !self.class_1.is_empty(),
            fatal: self.fatal || (!self.class_1.is_empty() && self.settings.reaction == Reaction::TorqueFree),
            standstill: self.output.standstill,
            released: self.progress.released,
            torque_off: self.progress.torque_off,
        }
    }

    /// The control asks for torque: bits 15 and 14 of an MDT of this CP4.
    pub(super) fn wants_torque(&self) -> bool {
        self.switches.is_some_and(|switches| switches.on && switches.enable)
    }

    /// A stop is under way that the control or an error has asked for, and the control has not asked for torque again since. The main
    /// contactor may open then: an emergency stop circuit does it.
    fn is_stopping(&self) -> bool {
        let requested = self.wants_torque();
        match self.machine.state() {
            DriveState::SwitchingOff => !requested,
            DriveState::Engaging => !requested || !self.class_1.is_empty(),
            state => state == DriveState::FaultReaction,
        }
    }

    /// Both channels of safe torque off permit torque.
    const fn permits_torque(&self) -> bool {
        self.inputs.safe_torque_1 && self.inputs.safe_torque_2
    }

    /// Supervision of everything below the velocity loop, and of what only counts while torque is on.
    fn look_after_the_motor(&mut self, index: Option<u32>) {
        let torque = self.machine.state().has_torque();
        let in_operation = self.machine.state().is_in_operation();
        let leaves_its_range = self.watch_range();
        let faults = self.motor.supervise(&Surroundings { torque, count: self.counted(self.motor.count()), index });
        self.take_faults(faults);
        self.watch_safe_torque_off(torque);
        if !torque {
            return;
        }
        let mut findings = Findings::default();
        if !self.inputs.bridge_ready
            || (self.bridge_on && !self.hardware.bridge_is_on() && self.motor.measured().trip.is_none())
        {
            findings.add_own(Manufacturer1::AMPLIFIER_FAULT, true);
        } else if !self.motor.link_sustains() || (!self.motor.has_power(self.inputs.main_power) && !self.is_stopping())
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
        if in_operation && self.phase == Phase::Cp4 && self.lost.is_none() && !self.clock.is_locked() {
            findings.add_own(Manufacturer1::SYNCHRONISATION, false);
        }
        self.take(findings);
    }

    /// The two channels are observed, never relied on: the hardware behind them takes the torque away by itself.
    fn watch_safe_torque_off(&mut self, torque: bool) {
        let differ = self.inputs.safe_torque_1 != self.inputs.safe_torque_2;
        self.channels_differ = if differ { self.channels_differ.saturating_add(1) } else { 0 };
        let mut findings = Findings::default();
        if self.channels_differ >= CHANNELS_DIFFER_TICKS {
            findings.add_own(Manufacturer1::SAFE_TORQUE_CHANNELS, true);
        }
        if torque && !self.permits_torque() {
            findings.add_own(Manufacturer1::SAFE_TORQUE_OFF, true);
        }
        self.take(findings);
    }

    #[inline]
    fn take_faults(&mut self, faults: MotorFaults) {
        if !faults.is_empty() {
            self.take(faults.into());
        }
    }

    pub(super) fn take(&mut self, findings: Findings) {
        self.class_1 |= findings.class_1;
        self.manufacturer_1 |= findings.manufacturer_1;
        self.fatal |= findings.fatal;
        // Increments were lost or added: nobody knows any more where the axis is.
        self.referenced &= !findings.class_1.contains(Class1::FEEDBACK);
    }

    /// One step of switching on or off, and what it asks of bridge and brake.
    fn step_sequence(&mut self, index: Option<Position>) {
        let state = self.machine.state();
        let wanted = match state {
            DriveState::Off | DriveState::Fault => Sequence::Off,
            DriveState::Engaging => Sequence::Stop,
            _ => Sequence::Start,
        };
        let mut faults = MotorFaults::NONE;
        let bridge_on = self.bridge_on && self.hardware.bridge_is_on();
        self.progress = self.motor.sequence(
            &SequenceInputs {
                wanted,
                bridge_on,
                standstill: self.output.standstill,
                position: self.encoder.position(),
                torque_command: self.output.current,
                brake_contact: self.inputs.brake_open,
                blocked: !self.expects_a_stop()
                    && self.output.standstill
                    && self.class_3.contains(Class3::TORQUE_LIMIT)
                    && self.output.velocity_command.abs() > self.settings.standstill_window,
                index,
            },
            &mut faults,
        );
        self.take_faults(faults);
        if let Some(current) = self.progress.preload {
            self.axis.preload(current);
        }
        if let Some(current) = self.progress.anchor {
            self.axis.anchor(current);
        }
        self.set_bridge(self.progress.bridge);
        self.hardware.set_brake(self.progress.brake);
    }

    pub(super) fn set_bridge(&mut self, on: bool) {
        if on == self.bridge_on {
            return;
        }
        self.bridge_on = on;
        if on {
            // A break without torque, as when the gate drivers had no supply yet, was nobody's error; one with torque is kept in C1D.
            self.hardware.reset_bridge();
        }
        self.hardware.set_bridge(on);
    }

    fn tell_lock(&mut self) -> Work {
        if self.lock_patience == 0 {
            return Work::empty();
        }
        self.lock_patience = if self.clock.is_locked() { 0 } else { self.lock_patience.saturating_sub(1) };
        if self.lock_patience == 0 { Work::SERVICE_CHANNEL } else { Work::empty() }
    }

    /// Asks the background to look at what has become of the drive: its diagnosis and its error memory.
    fn tell_news(&mut self) -> Work {
        let now = (self.machine.state(), self.class_1, self.class_2);
        if now == self.told && self.identified.is_none() {
            return Work::empty();
        }
        self.told = now;
        Work::SERVICE_CHANNEL
    }
}
