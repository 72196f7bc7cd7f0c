//! What is watched: bus, temperatures, loads, encoder, the current loop itself.

use sercos::diagnostic::Class1;
use servo::axis::Limiting;
use servo::commutation::IndexCorrection;
use servo::current::{BusScale, Trip};
use servo::encoder::EncoderMonitorInputs;
use servo::monitor::{TemperatureOutput, VoltageError, VoltageOutput};
use servo::units::CurrentFraction;

use super::Motor;
use crate::diagnosis::Manufacturer1;
use crate::hardware::Inputs;
use crate::link::get;
use crate::settings::motor::FREQUENCY;

/// What the supervision has found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Findings {
    /// Errors for C1D.
    pub(crate) class_1: Class1,
    /// Errors behind C1D bit 15.
    pub(crate) manufacturer_1: Manufacturer1,
    /// The motor cannot be stopped under control any more: torque off at once.
    pub(crate) fatal: bool,
}

impl Findings {
    fn fatal(class_1: Class1) -> Self {
        Self { class_1, manufacturer_1: Manufacturer1::empty(), fatal: true }
    }

    fn own(manufacturer_1: Manufacturer1, fatal: bool) -> Self {
        Self { class_1: Class1::MANUFACTURER, manufacturer_1, fatal }
    }

    pub(crate) fn add(&mut self, other: Self) {
        self.class_1 |= other.class_1;
        self.manufacturer_1 |= other.manufacturer_1;
        self.fatal |= other.fatal;
    }

    pub(crate) fn add_own(&mut self, manufacturer_1: Manufacturer1, fatal: bool) {
        self.add(Self::own(manufacturer_1, fatal));
    }

    pub(crate) fn add_fatal(&mut self, class_1: Class1) {
        self.add(Self::fatal(class_1));
    }
}

/// Values and warnings of the slow supervision.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Watched {
    /// Heat sink in 0.1 degrees C.
    pub(crate) heat_sink: i16,
    /// Motor in 0.1 degrees C.
    pub(crate) winding: i16,
    /// Load of the motor in 0.1 %.
    pub(crate) motor_load: u16,
    /// Load of the amplifier in 0.1 %.
    pub(crate) amplifier_load: u16,
    /// Bus voltage in V.
    pub(crate) bus: u16,
    /// Current that the thermal models allow.
    pub(crate) allowed: [CurrentFraction; 2],
    /// C2D bits 0, 1, 2: overload, amplifier temperature, motor temperature.
    pub(crate) overload: bool,
    pub(crate) heat_sink_warning: bool,
    pub(crate) winding_warning: bool,
}

/// What the supervision needs to know of the rest of the drive.
pub(crate) struct Surroundings {
    /// Torque is on.
    pub(crate) torque: bool,
    /// Encoder count in the direction of positive current.
    pub(crate) count: u32,
    /// Count at an index pulse since the last time.
    pub(crate) index: Option<u32>,
}

/// So much more than flows the loops may ask for at the voltage limit: a sixteenth of the peak current, within which the current loop stays at
/// that limit.
const REACH: i16 = i16::MAX / 16;

impl Motor {
    /// Looks at everything once.
    pub(crate) fn supervise(&mut self, surroundings: &Surroundings) -> Findings {
        let mut findings = Findings::default();
        self.watch_bus(surroundings.torque, &mut findings);
        self.watch_current_loop(&mut findings);
        self.watch_encoder(surroundings, &mut findings);
        self.watch_temperatures(&mut findings);
        self.watch_loads(&mut findings);
        self.weakening_limit = None;
        self.within_reach = None;
        self.limiting = Limiting::empty();
        if self.bridge_on {
            self.weaken(&mut findings);
        } else {
            self.weakening.reset();
            self.weakened = CurrentFraction::ZERO;
        }
        self.combine_limits();
        findings
    }

    /// Field weakening, and what it leaves for the torque.
    fn weaken(&mut self, findings: &mut Findings) {
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
        self.watch_current(findings);
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
        self.induced > self.bus_scale.longest() >> 1
    }

    /// All the voltage there is, little of it for the rotation, and still the current does not follow: a converter that has stopped, a sensor
    /// without supply, or a phase that is open. Without this the loop would push ever more current that it does not see.
    fn watch_current(&mut self, findings: &mut Findings) {
        let deviation = i32::from(self.commanded.to_bits()).abs_diff(i32::from(self.measured.torque_current.to_bits()));
        let blind = deviation > BLIND_DEVIATION && self.limiting.contains(Limiting::VOLTAGE) && !self.is_turning();
        self.blind = if blind { self.blind.saturating_add(1) } else { 0 };
        if self.blind >= BLIND_TICKS {
            findings.add_own(Manufacturer1::CURRENT_SENSOR, true);
        }
    }

    /// Main power is present: the line says so, and the bus is charged.
    pub(crate) fn has_power(&self, inputs: &Inputs) -> bool {
        inputs.main_power && self.bus.main_power
    }

    /// The DC link is not below P-0-0104: it carries a stop to its end.
    pub(crate) const fn link_sustains(&self) -> bool {
        self.bus.sustains
    }

    /// One loop tick: a counter that jumps, or stands still at once. What must be done about it, if anything.
    #[inline]
    pub(crate) fn watch_motion(&mut self, count: u32, torque: bool) -> Option<Findings> {
        self.encoder_motion.tick(&self.settings.encoder, count)?;
        Some(self.encoder_failed(torque))
    }

    fn watch_temperatures(&mut self, findings: &mut Findings) {
        let temperatures = get(&self.link.report.temperatures);
        let heat_sink = self.heat_sink.tick(&self.settings.heat_sink, (temperatures & 0xFFFF) as u16);
        self.watched.heat_sink = heat_sink.temperature.unwrap_or_default();
        self.watched.heat_sink_warning = heat_sink.warning;
        watch_temperature(&heat_sink, Class1::AMPLIFIER_TEMPERATURE, findings);
        let winding = self.winding.tick(&self.settings.winding, (temperatures >> 16) as u16);
        self.watched.winding = winding.temperature.unwrap_or_default();
        self.watched.winding_warning = winding.warning;
        watch_temperature(&winding, Class1::MOTOR_TEMPERATURE, findings);
    }

    fn watch_loads(&mut self, findings: &mut Findings) {
        let (torque, field) = (self.measured.torque_current, self.measured.field_current);
        let motor = self.motor_load.tick(&self.settings.motor_load, torque, field);
        let amplifier = self.amplifier_load.tick(&self.settings.amplifier_load, torque, field);
        self.watched.motor_load = motor.load;
        self.watched.amplifier_load = amplifier.load;
        self.watched.allowed = [motor.allowed, amplifier.allowed];
        self.watched.overload = motor.load >= WARNING || amplifier.load >= WARNING;
        if motor.shutdown || amplifier.shutdown {
            findings.class_1 |= Class1::OVERLOAD;
        }
    }

    fn watch_bus(&mut self, torque: bool, findings: &mut Findings) {
        let sample = self.measured.bus;
        self.bus = self.voltage.tick(&self.settings.voltage, sample);
        let VoltageOutput { voltage, reciprocal, error, .. } = self.bus;
        // From 2^-16 V to 2^-14 V.
        self.bus_scale = BusScale::new(voltage.to_bits() >> 2, reciprocal.of_fine_volts(), FREQUENCY.reload());
        self.watched.bus = voltage.to_num();
        match error {
            // Without torque neither is the drive's doing, and a bus whose thresholds are just being written has not failed.
            Some(VoltageError::Overvoltage { .. }) if torque => findings.add_fatal(Class1::OVERVOLTAGE),
            Some(VoltageError::Undervoltage { .. }) if torque => findings.add_fatal(Class1::UNDERVOLTAGE),
            _ => {}
        }
    }

    fn watch_current_loop(&mut self, findings: &mut Findings) {
        match self.measured.trip {
            None => {}
            Some(Trip::Overcurrent) => findings.add_fatal(Class1::OVERCURRENT),
            Some(Trip::Overvoltage) => findings.add_fatal(Class1::OVERVOLTAGE),
            Some(Trip::EncoderJump) => {
                self.forget_the_angle();
                findings.add_fatal(Class1::FEEDBACK);
            }
            Some(Trip::CurrentSum) => findings.add_own(Manufacturer1::CURRENT_SENSOR, true),
            Some(Trip::Late) => findings.add_own(Manufacturer1::DEADLINE, true),
        }
    }

    fn watch_encoder(&mut self, surroundings: &Surroundings, findings: &mut Findings) {
        // A field current that is being built up takes a voltage as a magnet that turns does.
        let field = self.held.is_some() || self.brake_output.test_current != CurrentFraction::ZERO;
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
            findings.add(self.encoder_failed(surroundings.torque));
        }
    }

    fn encoder_failed(&mut self, torque: bool) -> Findings {
        self.forget_the_angle();
        // What a motor without torque does is nobody's fault: it may be turned by hand while the encoder is being wired.
        if torque { Findings::fatal(Class1::FEEDBACK) } else { Findings::default() }
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

fn watch_temperature(output: &TemperatureOutput, class_1: Class1, findings: &mut Findings) {
    if output.shutdown {
        findings.class_1 |= class_1;
    }
    if output.error.is_some() {
        findings.add_own(Manufacturer1::TEMPERATURE_SENSOR, false);
    }
}
