//! What the drive tells of itself: diagnostic words, status word, signal status word, feedback values.

use sercon816::Bus;
use sercos::Phase;
use sercos::diagnostic::{Class1, Class2, Class3};
use servo::axis::Limiting;
use servo::probe::{Edge, Probe};
use servo::units::{Position, Velocity};

use super::Motion;
use crate::diagnosis::{Manufacturer2, Manufacturer3};
use crate::feedback::{ShownValues, torque_word};
use crate::hardware::Hardware;
use crate::signal::feedback::{Feedback, FeedbackValue};
use crate::signal::word::{Source, SourceBit, Word};
use crate::state::status_bits;

/// Change bits of the status word (sercos2.md 1.7).
const CLASS_2_CHANGE: u16 = 1 << 12;
const CLASS_3_CHANGE: u16 = 1 << 11;

/// Ticks of the supervision after the start in which the current sensors have found their zero.
const CALIBRATION_TICKS: u64 = 500;

/// The limits that C3D bit 4 stands for.
pub(super) const TORQUE_LIMITS: Limiting = Limiting::TORQUE_POSITIVE
    .union(Limiting::TORQUE_NEGATIVE)
    .union(Limiting::TORQUE_BIPOLAR)
    .union(Limiting::MOTOR_PEAK)
    .union(Limiting::AMPLIFIER_PEAK)
    .union(Limiting::MOTOR_LOAD)
    .union(Limiting::AMPLIFIER_LOAD);

/// The limits that C3D bit 5 stands for.
const VELOCITY_LIMITS: Limiting =
    Limiting::VELOCITY_POSITIVE.union(Limiting::VELOCITY_NEGATIVE).union(Limiting::VELOCITY_BIPOLAR);

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

    /// S-0-0012, S-0-0013 and their manufacturer's words, from what the loops gave in their last tick.
    pub(super) fn refresh_words(&mut self) {
        let class_2 = self.class_2_of();
        self.class_2_change |= (class_2 ^ self.class_2).bits() & self.settings.class_2_mask != 0;
        self.class_2 = class_2;
        let class_3 = self.class_3_of();
        self.show_class_3(class_3);
    }

    /// S-0-0013, and whether its change bit tells of it.
    pub(super) fn show_class_3(&mut self, class_3: Class3) {
        self.class_3_change |= (class_3 ^ self.class_3).bits() & self.settings.class_3_mask != 0;
        self.class_3 = class_3;
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

    /// What is shown from now on is `position` and what the loops gave in their last tick.
    #[inline]
    pub(super) fn refresh_values(&mut self, position: Position) {
        self.shown = ShownValues::at(position, &self.output, self.motor.torque_current());
    }

    fn weighted_velocity(&self, velocity: Velocity) -> i32 {
        let reversed = self.settings.velocity_polarity.feedback;
        self.settings.velocity.from_velocity(if reversed { -velocity } else { velocity })
    }

    fn shown_torque(&self) -> i64 {
        let torque = self.settings.torque.increments_of(self.shown.current);
        if self.settings.torque_polarity.feedback { torque.wrapping_neg() } else { torque }
    }

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
            FeedbackValue::FollowingDistance => self.shown_following_distance().cast_unsigned(),
            FeedbackValue::VelocityError => self.weighted_velocity(self.shown.velocity_deviation).cast_unsigned(),
            FeedbackValue::Probe1Positive => self.probe_value(Probe::One, Edge::Positive).cast_unsigned(),
            FeedbackValue::Probe1Negative => self.probe_value(Probe::One, Edge::Negative).cast_unsigned(),
            FeedbackValue::Probe2Positive => self.probe_value(Probe::Two, Edge::Positive).cast_unsigned(),
            FeedbackValue::Probe2Negative => self.probe_value(Probe::Two, Edge::Negative).cast_unsigned(),
            FeedbackValue::BusVoltage => self.motor.watched().bus.into(),
            FeedbackValue::MotorTemperature => u32::from(self.motor.watched().winding.cast_unsigned()),
            FeedbackValue::AmplifierTemperature => u32::from(self.motor.watched().heat_sink.cast_unsigned()),
            FeedbackValue::Limits => self.limiting.bits().into(),
            FeedbackValue::EffectiveTarget => self.effective_target().cast_unsigned(),
            FeedbackValue::DiagnosticNumber => u32::from(self.diagnostic_number),
        }
    }

    fn word(&self, word: Word) -> u16 {
        match word {
            Word::Class1 => self.class_1.bits(),
            Word::Class2 => self.class_2.bits(),
            Word::Class3 => self.class_3.bits(),
            Word::InterfaceStatus => self.interface_status,
            Word::Manufacturer1 => self.manufacturer_1.bits(),
            Word::Manufacturer2 => self.manufacturer_2.bits(),
            Word::Manufacturer3 => self.manufacturer_3.bits(),
            Word::Control => self.commands.control_word,
            Word::Status => self.status_without_real_time_bits(),
            Word::PositionStatus => u16::from(self.referenced),
            Word::Application => (self.controlled & 0xFFFF) as u16,
            Word::Signals => self.signals(),
            Word::ProbeStatus => self.probe_status(),
            Word::Positioning => self.positioning_status(),
        }
    }

    fn source_bit(&self, bit: Option<SourceBit>) -> bool {
        bit.is_some_and(|bit| self.word(bit.word) & bit.mask != 0)
    }

    fn status_without_real_time_bits(&self) -> u16 {
        let mode = (self.mode_bits & 0x0300) | ((self.mode_bits & 0x0800) >> 1);
        let class_2 = if self.class_2_change { CLASS_2_CHANGE } else { 0 };
        let class_3 = if self.class_3_change { CLASS_3_CHANGE } else { 0 };
        status_bits(self.machine.state(), self.conditions()) | mode | class_2 | class_3
    }

    fn class_2_of(&mut self) -> Class2 {
        self.loss_shown = self.loss_shown.saturating_sub(1);
        let torque = self.machine.state().has_torque();
        let mut own = Manufacturer2::empty();
        own.set(Manufacturer2::NOT_LOCKED, self.phase == Phase::Cp4 && !self.clock.is_locked());
        own.set(Manufacturer2::TELEGRAM_LOST, self.loss_shown > 0);
        let known = self.class_1.contains(Class1::MANUFACTURER);
        own.set(Manufacturer2::AMPLIFIER_NOT_READY, !self.inputs.bridge_ready && !torque && !known);
        own.set(Manufacturer2::LIMIT_OUT_OF_RANGE, self.cyclic_limits.complains());
        own.set(
            Manufacturer2::NOT_CALIBRATED,
            !self.motor.measured().calibrated && self.supervisions > CALIBRATION_TICKS,
        );
        self.manufacturer_2 = own;

        let mut class_2 = Class2::empty();
        let wants_torque = self.wants_torque();
        class_2.set(Class2::UNDERVOLTAGE, wants_torque && !torque && !self.motor.has_power(self.inputs.main_power));
        let watched = self.motor.watched();
        class_2.set(Class2::OVERLOAD, watched.overload);
        class_2.set(Class2::AMPLIFIER_TEMPERATURE, watched.heat_sink_warning);
        class_2.set(Class2::MOTOR_TEMPERATURE, watched.winding_warning);
        let window = self.settings.velocity_monitoring_window;
        let output = &self.output;
        let deviation = (output.velocity_command - output.velocity).abs();
        class_2.set(Class2::VELOCITY_DEVIATION, torque && window != Velocity::ZERO && deviation > window);
        class_2.set(Class2::MANUFACTURER, !own.is_empty());
        class_2
    }

    fn class_3_of(&mut self) -> Class3 {
        self.manufacturer_3.set(Manufacturer3::LOCKED, self.clock.is_locked());
        let settings = &self.settings;
        let output = &self.output;
        let mut class_3 = Class3::empty();
        let velocity = output.velocity.abs();
        let velocity_error = output.velocity_command - output.velocity;
        class_3.set(Class3::VELOCITY_REACHED, velocity_error.abs() <= settings.velocity_window);
        class_3.set(Class3::STANDSTILL, output.standstill);
        class_3.set(Class3::BELOW_THRESHOLD, velocity < settings.velocity_threshold);
        let torque = i32::from(self.motor.torque_current().to_bits()).unsigned_abs();
        class_3.set(Class3::TORQUE_THRESHOLD, torque >= settings.torque_threshold);
        class_3.set(Class3::TORQUE_LIMIT, output.limiting.intersects(TORQUE_LIMITS));
        class_3.set(Class3::VELOCITY_LIMIT, output.limiting.intersects(VELOCITY_LIMITS));
        class_3.set(Class3::MANUFACTURER, !self.manufacturer_3.is_empty());
        class_3 | self.reached()
    }
}
