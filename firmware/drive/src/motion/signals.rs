//! What the drive tells of itself, asked part by part: status word, signal status word, the values of the AT. Nothing here changes anything.

use sercon816::Bus;
use sercos::diagnostic::Class3;
use servo::probe::{Edge, Probe};
use servo::units::Velocity;

use super::Motion;
use crate::feedback::torque_word;
use crate::hardware::Hardware;
use crate::signal::command::CommandValue;
use crate::signal::feedback::{Feedback, FeedbackValue};
use crate::signal::word::{Source, SourceBit, Word};
use crate::state::status_bits;

/// Real-time status bits of the status word, S-0-0305 and S-0-0307.
const REAL_TIME_STATUS: [u16; 2] = [1 << 6, 1 << 7];

impl<B: Bus + Clone, H: Hardware> Motion<B, H> {
    /// The operation data of a data block of bits (those of S-0-0398).
    pub fn source_value(&self, source: Source) -> u16 {
        source.value(self.word(source.word()))
    }

    /// S-0-0144.
    pub fn signal_status(&self) -> u16 {
        let bits = self.settings.bits.signal_status.iter().rev();
        bits.fold(0, |word, &bit| word << 1 | u16::from(self.source_bit(bit)))
    }

    /// The two real-time status bits (S-0-0304, S-0-0306).
    pub fn real_time_status(&self) -> [bool; 2] {
        self.settings.bits.status.map(|bit| self.source_bit(bit))
    }

    /// Bits 15 to 6 and 3 of the status word.
    pub(super) fn status_word(&self) -> u16 {
        let mut status = self.status_without_real_time_bits();
        for (bit, mask) in self.settings.bits.status.into_iter().zip(REAL_TIME_STATUS) {
            if self.source_bit(bit) {
                status |= mask;
            }
        }
        status
    }

    /// A value of the AT.
    pub(super) fn signal(&self, signal: Feedback) -> u32 {
        let value = match signal {
            Feedback::Bits(word) => return self.word(word).into(),
            Feedback::Value(value) => value,
        };
        match value {
            FeedbackValue::Velocity => self.weighted_velocity(self.shown.velocity).cast_unsigned(),
            FeedbackValue::Position2 if !self.settings.has_feedback_2 => 0,
            FeedbackValue::Position | FeedbackValue::Position2 => self.shown_position().cast_unsigned(),
            FeedbackValue::Torque => torque_word(self.shown_torque()),
            FeedbackValue::SignalStatus => u32::from(self.signal_status()),
            FeedbackValue::FollowingDistance => {
                self.settings.coordinates.difference(self.shown.following_error).cast_unsigned()
            }
            FeedbackValue::VelocityError => self.weighted_velocity(self.shown.velocity_deviation).cast_unsigned(),
            FeedbackValue::Probe1Positive => self.probe_value(Probe::One, Edge::Positive).cast_unsigned(),
            FeedbackValue::Probe1Negative => self.probe_value(Probe::One, Edge::Negative).cast_unsigned(),
            FeedbackValue::Probe2Positive => self.probe_value(Probe::Two, Edge::Positive).cast_unsigned(),
            FeedbackValue::Probe2Negative => self.probe_value(Probe::Two, Edge::Negative).cast_unsigned(),
            FeedbackValue::BusVoltage => self.motor.watched().bus.into(),
            FeedbackValue::MotorTemperature => u32::from(self.motor.watched().winding.cast_unsigned()),
            FeedbackValue::AmplifierTemperature => u32::from(self.motor.watched().heat_sink.cast_unsigned()),
            FeedbackValue::Limits => self.status.limiting().bits().into(),
            FeedbackValue::EffectiveTarget => self.positioning.effective_target(&self.scene()).cast_unsigned(),
            FeedbackValue::DiagnosticNumber => u32::from(self.status.diagnostic_number()),
        }
    }

    /// A command value as it is transmitted. S-0-0047 is the place where the axis is held, while homing holds it.
    pub(crate) fn command_data(&self, value: CommandValue) -> u32 {
        match value {
            CommandValue::Position => self.position_command_data().cast_unsigned(),
            _ => self.ring.commands().data(value),
        }
    }

    /// S-0-0130 to S-0-0133, in the coordinates of the instant of the edge.
    fn probe_value(&self, probe: Probe, edge: Edge) -> i32 {
        self.settings.coordinates.data(self.probing.value(probe, edge))
    }

    /// S-0-0047, as the service channel and the oscilloscope read it. While S-0-0148 holds the axis it is what commands the place where the
    /// axis is held: a control that goes on from there moves nothing.
    pub(super) fn position_command_data(&self) -> i32 {
        let commands = self.ring.commands();
        if !self.function.holds() {
            return commands.position;
        }
        let held = self.axis.cyclic_position(self.output.position_command) - commands.additive_position(&self.settings);
        self.settings.coordinates.data(self.settings.coordinates.range.reduce(held))
    }

    /// The bits of C3D that tell of having reached something.
    #[inline]
    pub(super) fn reached(&self) -> Class3 {
        let in_operation = self.operation.state().is_in_operation();
        self.positioning.reached(&self.scene(), in_operation, self.function.is_travelling_home())
    }

    /// S-0-0051.
    #[inline]
    fn shown_position(&self) -> i32 {
        self.settings.coordinates.data(self.axis.cyclic_position(self.shown.position))
    }

    fn weighted_velocity(&self, velocity: Velocity) -> i32 {
        let reversed = self.settings.velocity_polarity.feedback;
        self.settings.velocity.from_velocity(if reversed { -velocity } else { velocity })
    }

    fn shown_torque(&self) -> i64 {
        let torque = self.settings.torque.increments_of(self.shown.current);
        if self.settings.torque_polarity.feedback { torque.wrapping_neg() } else { torque }
    }

    fn word(&self, word: Word) -> u16 {
        match word {
            Word::Class1 => self.status.class_1().bits(),
            Word::Class2 => self.status.class_2().bits(),
            Word::Class3 => self.status.class_3().bits(),
            Word::InterfaceStatus => self.status.interface_status(),
            Word::Manufacturer1 => self.status.manufacturer_1().bits(),
            Word::Manufacturer2 => self.status.manufacturer_2().bits(),
            Word::Manufacturer3 => self.status.manufacturer_3().bits(),
            Word::Control => self.ring.commands().control_word,
            Word::Status => self.status_without_real_time_bits(),
            Word::PositionStatus => u16::from(self.reference.is_known()),
            Word::Application => (self.controls.all() & 0xFFFF) as u16,
            Word::Signals => self.signals(),
            Word::ProbeStatus => self.probing.status(),
            Word::Positioning => {
                self.positioning.status(self.status.class_3(), self.ring.commands().positioning_control)
            }
        }
    }

    fn source_bit(&self, bit: Option<SourceBit>) -> bool {
        bit.is_some_and(|bit| self.word(bit.word) & bit.mask != 0)
    }

    fn status_without_real_time_bits(&self) -> u16 {
        status_bits(self.operation.state(), self.conditions()) | self.operation.mode_bits() | self.status.change_bits()
    }

    /// Single bits of inputs and sequences: 0 home switch, 1 and 2 probes, 3 marker registered, 4 to 7 the bits of S-0-0179, 8 to 10
    /// S-0-0405 to S-0-0407.
    fn signals(&self) -> u16 {
        u16::from(self.home_switch(self.settings.home_switch_at_drive))
            | u16::from(self.inputs.probe_1) << 1
            | u16::from(self.inputs.probe_2) << 2
            | u16::from(self.function.marker_registered()) << 3
            | self.probing.status() << 4
            | self.controls.enables() << 8
    }
}
