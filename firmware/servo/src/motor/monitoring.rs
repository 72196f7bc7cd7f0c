//! What is watched: bus, temperatures, loads, encoder, the current loop itself.

use super::HANDS_OVER;
use super::Motor;
use super::facts::BoardKind;
use super::fault::{MotorFault, MotorFaults};
use super::link::{get, set};
use crate::axis::limits::Limiting;
use crate::commutation::index::IndexCorrection;
use crate::current::command::{BusScale, CurrentCommand};
use crate::current::protection::Trip;
use crate::encoder::monitor::EncoderMonitorInputs;
use crate::monitor::bus_voltage::{VoltageError, VoltageOutput};
use crate::monitor::current_balance::CurrentBalance;
use crate::monitor::open_phase::{OpenPhase, Phases, phases};
use crate::monitor::temperature::{NO_TEMPERATURE, TemperatureError, TemperatureOutput};
use crate::units::CurrentFraction;

/// What the supervision needs to know of the rest of the drive.
#[derive(Clone, Copy, Debug)]
pub struct Surroundings {
    /// Torque is on.
    pub torque: bool,
    /// Encoder count in the direction of positive current.
    pub count: u32,
    /// Count at an index pulse since the last time.
    pub index: Option<u32>,
}

/// So much more than flows the loops may ask for at the voltage limit: a sixteenth of the peak current, within which the current loop stays at
/// that limit.
const REACH: i16 = i16::MAX / 16;

impl<B: BoardKind> Motor<B> {
    /// Looks at what is over in milliseconds: bus, current loop, encoder and field weakening, and puts the limits of the torque together. To be
    /// called once in [`crate::units::LOOP_TICKS_PER_SUPERVISION`] ticks, as [`Motor::supervise_heat`] is, at other ticks.
    pub fn supervise(&mut self, surroundings: &Surroundings) -> MotorFaults {
        let mut faults = MotorFaults::NONE;
        self.watch_bus(surroundings.torque, &mut faults);
        self.watch_current_loop(&mut faults);
        self.watch_encoder(surroundings, &mut faults);
        self.weakening_limit = None;
        self.within_reach = None;
        self.limiting = Limiting::empty();
        // An open bridge has no current to weaken the field with: what is asked of it winds up in the current loop.
        if self.bridge_on && self.closed {
            self.weaken(&mut faults);
        } else {
            self.keep_the_field();
        }
        self.combine_limits();
        faults
    }

    pub(super) fn keep_the_field(&mut self) {
        self.weakening.reset();
        self.weakened = CurrentFraction::ZERO;
    }

    /// The bridge closes, on a motor that may already be faster than the voltage allows.
    pub(super) fn begin_to_weaken(&mut self) {
        if !self.commutates() {
            return;
        }
        let (settings, bus) = (&self.settings, &self.bus_scale);
        // No current has been asked for: what the rotation induces are the magnets alone.
        let output = self.weakening.preset(&settings.weakening, &settings.model, self.induced, bus);
        self.weakened = output.direct;
        if output.active {
            self.weakening_limit = Some(output.quadrature_limit);
            self.combine_limits();
        }
    }

    /// Looks at what takes longer: temperatures and loads, and whether sensors and phases agree.
    pub fn supervise_heat(&mut self) -> MotorFaults {
        let mut faults = MotorFaults::NONE;
        self.watch_temperatures(&mut faults);
        self.watch_loads(&mut faults);
        if self.bridge_on && self.closed {
            self.watch_sensors(&mut faults);
            self.watch_phases(&mut faults);
        } else {
            self.balance = CurrentBalance::default();
            self.open_phase = OpenPhase::default();
        }
        faults
    }

    /// Field weakening, and what it leaves for the torque.
    fn weaken(&mut self, faults: &mut MotorFaults) {
        let readings = &self.measured.readings;
        let output = self.weakening.tick(&self.settings.weakening, readings, &self.bus_scale);
        self.weakened = output.direct;
        if output.active {
            self.limiting |= Limiting::FIELD_WEAKENING;
            self.weakening_limit = Some(output.quadrature_limit);
        }
        // 97 % of the longest vector, squared.
        let coarse = |voltage: i32| i64::from(voltage >> 4);
        let (direct, quadrature) = (coarse(readings.direct_voltage), coarse(readings.quadrature_voltage));
        let longest = coarse(self.bus_scale.longest());
        let squared = direct.wrapping_mul(direct).wrapping_add(quadrature.wrapping_mul(quadrature));
        let saturated = squared.wrapping_mul(17) > longest.wrapping_mul(longest).wrapping_mul(16);
        if saturated {
            self.limiting |= Limiting::VOLTAGE;
        }
        self.keep_within_reach(saturated);
        self.watch_current(faults);
    }

    /// A motor that is too fast for the bus gets less current than the loops ask for. They are held near what flows: what they would pile up
    /// beyond it would go on pushing when they are told to brake.
    fn keep_within_reach(&mut self, saturated: bool) {
        let was_saturated = core::mem::replace(&mut self.saturated, saturated);
        let (commanded, flowing) = (self.commanded.to_bits(), self.measured.torque_current.to_bits());
        // One look alone is a current that is on its way.
        if !(saturated && was_saturated && self.is_turning()) || commanded == 0 {
            return;
        }
        let reach =
            if commanded > 0 { flowing.max(0).saturating_add(REACH) } else { flowing.min(0).saturating_sub(REACH) };
        self.within_reach = Some(CurrentFraction::from_bits(reach));
    }

    /// Half of the voltage that there is goes into the rotation.
    fn is_turning(&self) -> bool {
        self.induced.wrapping_abs() > self.bus_scale.longest() >> 1
    }

    /// All the voltage there is, little of it for the rotation, and still the current does not follow: a converter that has stopped, a sensor
    /// without supply, or a phase that is open: then the other two have a current. Without this the loop would push ever more current that it does not see.
    fn watch_current(&mut self, faults: &mut MotorFaults) {
        let deviation = i32::from(self.commanded.to_bits()).abs_diff(i32::from(self.measured.torque_current.to_bits()));
        let blind = deviation > BLIND_DEVIATION && self.limiting.contains(Limiting::VOLTAGE) && !self.is_turning();
        if !blind {
            self.blind = 0;
            return;
        }
        self.look_at_the_phases();
        if self.blind >= BLIND_TICKS {
            let [asked, flowed] = &self.seen_blind;
            faults.add(if flowed.lack_one_of(asked) { MotorFault::OpenPhase } else { MotorFault::CurrentSensor });
        }
    }

    /// What is asked of the phases, and what flows, since the current does not follow.
    #[cold]
    fn look_at_the_phases(&mut self) {
        if self.blind == 0 {
            self.seen_blind = [Phases::default(); 2];
        }
        self.blind = self.blind.saturating_add(1);
        let readings = &self.measured.readings;
        let angle = self.link.report.cycle(true).readings.angle();
        let [asked, flowed] = &mut self.seen_blind;
        asked.add(&phases([self.direct_command, self.commanded].map(CurrentCommand::reference), angle));
        flowed.add(&phases([readings.direct, readings.quadrature], angle));
    }

    /// Sensors that contradict each other by less than makes the current loop switch off.
    fn watch_sensors(&mut self, faults: &mut MotorFaults) {
        if self.balance.tick(self.link.report.cycle(true).readings.phases()) {
            faults.add(MotorFault::CurrentSensor);
        }
    }

    /// A phase of the motor that carries nothing of what is asked of it.
    fn watch_phases(&mut self, faults: &mut MotorFaults) {
        // At a speed that takes all the voltage the current is not the one that is asked for, and may be turned against it by any angle.
        if self.limiting.contains(Limiting::VOLTAGE) && self.is_turning() {
            return;
        }
        // The test before the torque judges what it asks for itself.
        if self.tested {
            return;
        }
        let cycle = &self.link.report.cycle(true).readings;
        let readings = cycle.readings();
        let asked = [self.direct_command, self.commanded].map(CurrentCommand::reference);
        if self.open_phase.tick(asked, [readings.direct, readings.quadrature], cycle.angle()) {
            faults.add(MotorFault::OpenPhase);
        }
    }

    /// Main power is present: its `line` says so, and the bus is charged.
    pub const fn has_power(&self, line: bool) -> bool {
        line && self.bus.main_power
    }

    /// The DC link is not below P-0-0104: it carries a stop to its end.
    pub const fn link_sustains(&self) -> bool {
        self.bus.sustains
    }

    /// One loop tick: a counter that jumps, or stands still at once. What must be done about it, if anything.
    #[inline]
    pub fn watch_motion(&mut self, count: u32, torque: bool) -> Option<MotorFaults> {
        self.encoder_motion.tick(&self.settings.encoder, count)?;
        Some(self.encoder_failed(torque))
    }

    fn watch_temperatures(&mut self, faults: &mut MotorFaults) {
        let temperatures = get(&self.link.report.temperatures);
        let heat_sink = self.heat_sink.tick(&self.settings.heat_sink, (temperatures & 0xFFFF) as u16);
        self.watched.heat_sink = heat_sink.temperature.unwrap_or(NO_TEMPERATURE);
        self.watched.heat_sink_warning = heat_sink.warning;
        watch_temperature(&heat_sink, MotorFault::AmplifierTemperature, faults);
        let winding = self.winding.tick(&self.settings.winding, (temperatures >> 16) as u16);
        self.watched.winding = winding.temperature.unwrap_or(NO_TEMPERATURE);
        self.watched.winding_warning = winding.warning;
        watch_temperature(&winding, MotorFault::MotorTemperature, faults);
    }

    fn watch_loads(&mut self, faults: &mut MotorFaults) {
        let (torque, field) = (self.measured.torque_current, self.measured.field_current);
        let motor = self.motor_load.tick(&self.settings.motor_load, torque, field);
        let amplifier = self.amplifier_load.tick(&self.settings.amplifier_load, torque, field);
        self.watched.motor_load = motor.load;
        self.watched.amplifier_load = amplifier.load;
        self.watched.allowed = [motor.allowed, amplifier.allowed];
        self.watched.overload = motor.load >= WARNING || amplifier.load >= WARNING;
        if motor.shutdown || amplifier.shutdown {
            faults.add(MotorFault::Overload);
        }
    }

    fn watch_bus(&mut self, torque: bool, faults: &mut MotorFaults) {
        let sample = self.measured.bus;
        self.bus = self.voltage.tick(&self.settings.voltage, sample);
        let VoltageOutput { voltage, reciprocal, error, .. } = self.bus;
        // From 2^-16 V to 2^-14 V.
        self.bus_scale = BusScale::new(voltage.to_bits() >> 2, reciprocal.of_fine_volts(), B::FACTS.frequency.reload());
        self.watched.bus = voltage.to_num();
        let chopper = self.chopper.tick(&self.settings.chopper, get(&self.link.report.chopped), sample);
        set(&self.link.chopper, chopper.levels.to_word());
        self.chopper_works = chopper.works;
        self.generating_from =
            if chopper.hands_over { HANDS_OVER } else { self.settings.generating.begin(chopper.works) };
        self.watched.chopper_load = chopper.load;
        self.watched.chopper_warning = chopper.warning;
        self.watched.chopper_off = chopper.too_hot;
        self.watched.link_full = self.link_full > 0;
        self.link_full = self.link_full.saturating_sub(1);
        match error {
            // Without torque neither is the drive's doing, and a bus whose thresholds are just being written has not failed.
            Some(VoltageError::Overvoltage { .. }) if torque => faults.add(MotorFault::Overvoltage),
            Some(VoltageError::Undervoltage { .. }) if torque => faults.add(MotorFault::Undervoltage),
            _ => {}
        }
    }

    fn watch_current_loop(&mut self, faults: &mut MotorFaults) {
        match self.measured.trip {
            None => {}
            Some(Trip::Overcurrent) => faults.add(MotorFault::Overcurrent),
            Some(Trip::Overvoltage) => faults.add(MotorFault::Overvoltage),
            Some(Trip::EncoderJump) => {
                self.forget_the_angle();
                faults.add(MotorFault::Feedback);
            }
            Some(Trip::CurrentSum) => faults.add(MotorFault::CurrentSensor),
            Some(Trip::Late) => faults.add(MotorFault::Deadline),
        }
    }

    fn watch_encoder(&mut self, surroundings: &Surroundings, faults: &mut MotorFaults) {
        // A field current that is being built up takes a voltage as a magnet that turns does.
        let field =
            self.held.is_some() || self.aligning.is_some() || self.brake_output.test_current != CurrentFraction::ZERO;
        self.disturbed = if field { DISTURBED_TICKS } else { self.disturbed.saturating_sub(1) };
        let error = self.encoder.tick(
            &self.settings.encoder,
            &EncoderMonitorInputs {
                count: surroundings.count,
                index: surroundings.index,
                voltage: (surroundings.torque && self.bridge_on && self.commutates() && self.disturbed == 0)
                    .then_some((self.measured.readings.direct_voltage, self.bus_scale.longest())),
            },
        );
        if error.is_some() {
            faults.add_all(self.encoder_failed(surroundings.torque));
        }
    }

    fn encoder_failed(&mut self, torque: bool) -> MotorFaults {
        self.forget_the_angle();
        // What a motor without torque does is nobody's fault: it may be turned by hand while the encoder is being wired.
        if torque { MotorFaults::of(MotorFault::Feedback) } else { MotorFaults::NONE }
    }

    /// Increments were lost or added: torque at the old angle could turn the motor anywhere.
    fn forget_the_angle(&mut self) {
        self.commutation = None;
        self.index = IndexCorrection::start(self.settings.index_angle);
        self.index_armed = false;
    }
}

/// An identification may end with all the current and voltage that it has: 5 ms, several times what the current loop needs to take them back.
const DISTURBED_TICKS: u8 = 10;

/// A tenth of the peak current, for 2 ms: twenty times what the loop needs at this voltage.
const BLIND_DEVIATION: u32 = 3_277;
const BLIND_TICKS: u16 = 4;

/// Load from which C2D bit 0 is set, in 0.1 %.
const WARNING: u16 = 900;

fn watch_temperature(output: &TemperatureOutput, shutdown: MotorFault, faults: &mut MotorFaults) {
    if output.shutdown {
        faults.add(shutdown);
    }
    match output.error {
        Some(TemperatureError::BrokenWire { .. }) => faults.add(MotorFault::ThermometerBroken),
        Some(TemperatureError::ShortCircuit { .. }) => faults.add(MotorFault::ThermometerShort),
        None => {}
    }
}
