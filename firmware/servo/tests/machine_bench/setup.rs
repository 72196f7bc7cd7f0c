//! Parameters of a drive for a reference axis, as a commissioning engineer finds them.

use plant::{LowSideShunts, ReferenceAxis};
use servo::arithmetic::Gain;
use servo::axis::{
    AxisParameters, CommandedTorqueLimits, CurrentFilterSettings, FilterSection, FrictionParameters, FrictionSettings,
    TorqueLimitParameters, TorqueLimitSettings, VelocityLimits, VelocityRate, current_gains,
};
use servo::brake::{BrakeParameters, BrakeSettings};
use servo::commutation::{AlignmentSettings, CommutationSettings};
use servo::current::{
    CurrentLoopParameters, CurrentLoopSettings, FieldWeakeningParameters, FieldWeakeningSettings, MotorModel,
    Protection,
};
use servo::encoder::{EncoderMonitorParameters, EncoderMonitorSettings};
use servo::monitor::{
    ChopperParameters, ChopperSettings, GeneratingParameters, GeneratingSettings, LoadParameters, LoadSettings,
    TemperatureParameters, TemperatureSensor, TemperatureSettings, VoltageParameters, VoltageSettings,
};
use servo::motor::{BoardKind, CurrentSettings, MotorSettings};
use servo::path::Interpolation;
use servo::units::{Acceleration, CurrentFraction, Position, Velocity};

use super::master::{revolutions, rpm};
use super::stage::Kind;

/// Everything that a bench is made of.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Setup {
    pub(crate) reference: ReferenceAxis,
    pub(crate) axis: AxisParameters,
    pub(crate) current: CurrentLoopParameters,
    /// The voltages that the rotation induces are fed forward.
    pub(crate) decoupled: bool,
    /// Position that the encoder shows at the start.
    pub(crate) start: Position,
    /// Largest flux-producing current in 0.01 % of peak; 0: no field weakening.
    pub(crate) weakening: u16,
    /// Trip level in shares of the peak current.
    pub(crate) trip: f64,
    /// Continuous power in W of the resistor that the axis has, if it has one.
    pub(crate) resistor_power: u32,
}

/// Bandwidth of the current loop in Hz: 64 degrees of phase margin with the unsaturated inductance.
pub(crate) const CURRENT_BANDWIDTH: u32 = 2_200;

impl Setup {
    /// The gains that the reference axis suggests, position commands without lag at 2 ms, the gains of [`current_gains`] with the data
    /// of the winding, dead time compensated.
    pub(crate) fn of(reference: ReferenceAxis) -> Self {
        let gains = reference.gains;
        let axis = AxisParameters {
            ticks_per_cycle: 16,
            modulo: None,
            position_gain: gains.position_gain,
            feed_forward: 10_000,
            velocity_gain: u32::from(gains.velocity_gain) * 100,
            integral_time: gains.integral_time,
            velocity_rate: VelocityRate::TwiceATick,
            velocity_filter: gains.velocity_filter,
            peak_current: reference.peak_current,
            acceleration_gain: 0,
            acceleration_smoothing: 0,
            friction: FrictionSettings::OFF,
            filter: CurrentFilterSettings::new([FilterSection::Off; 2], VelocityRate::TwiceATick).unwrap(),
            velocity_limits: VelocityLimits::new(rpm(f64::from(reference.maximum_speed) * 1.1), None, None),
            deceleration: Acceleration::from_milliradians_per_second_squared(gains.acceleration_limit),
            halt_deceleration: Acceleration::from_bits(0),
            jerk: None,
            velocity_ramp: None,
            interpolation: Interpolation::Cubic,
            standstill_window: Velocity::from_ten_thousandths_rpm(100_000),
            monitoring_window: Position::from_bits((1 << 32) / 12),
            largest_step: Position::ZERO,
        };
        Self {
            axis,
            current: current_loop(&reference, CURRENT_BANDWIDTH),
            reference,
            decoupled: true,
            start: Position::ZERO,
            weakening: 0,
            trip: 1.25,
            resistor_power: 1_000_000,
        }
    }

    /// With a current loop of so many Hz.
    pub(crate) fn with_current_bandwidth(mut self, bandwidth: u32) -> Self {
        self.current = current_loop(&self.reference, bandwidth);
        self
    }

    /// With commands every so many ticks.
    pub(crate) fn with_cycle(mut self, ticks: u16) -> Self {
        self.axis.ticks_per_cycle = ticks;
        self
    }

    /// With the acceleration fed forward that the inertia needs, S-0-0348.
    pub(crate) fn with_acceleration_feed_forward(mut self) -> Self {
        self.axis.acceleration_gain = (self.inertia() / self.reference.machine.torque_constant() * 1e6).round() as u32;
        self
    }

    /// With the friction of the axis fed forward, S-0-0155.
    pub(crate) fn with_friction_compensation(mut self) -> Self {
        let mechanics = &self.reference.machine.mechanics;
        let constant = self.reference.machine.torque_constant();
        let per_rpm = std::f64::consts::TAU / 60.0;
        self.axis.friction = FrictionSettings::new(&FrictionParameters {
            coulomb: (mechanics.coulomb_friction / constant * 1e3).round() as u32,
            viscous: (mechanics.viscous_friction * per_rpm / constant * 1e6).round() as u32,
            band: 2_000,
            peak_current: self.reference.peak_current,
        })
        .unwrap();
        self
    }

    /// A rotor that no torque accelerates within a test, without friction.
    pub(crate) fn with_flywheel(mut self) -> Self {
        let mechanics = &mut self.reference.machine.mechanics;
        mechanics.rotor_inertia = 1e4;
        mechanics.coulomb_friction = 0.0;
        mechanics.viscous_friction = 0.0;
        mechanics.load = None;
        mechanics.gravity_torque = 0.0;
        self
    }

    /// Current sensors that show what flows, in steps of their converter.
    pub(crate) fn with_exact_sensors(mut self) -> Self {
        let sensors = &mut self.reference.machine.current_sensors;
        sensors.noise = 0.0;
        sensors.offset = [0.0; 3];
        sensors.gain_error = [0.0; 3];
        self
    }

    /// With shunts of the low side in place of sensors in the lines: they settle to 1 % in 1.2 us, and the converter samples for 0.7 us.
    pub(crate) fn with_shunts(mut self) -> Self {
        self.reference.machine.effects.shunts = Some(LowSideShunts { settling_time: 1.2e-6, sampling_time: 0.7e-6 });
        self
    }

    /// Of motor and load in kg m².
    pub(crate) fn inertia(&self) -> f64 {
        let mechanics = &self.reference.machine.mechanics;
        mechanics.rotor_inertia + mechanics.load.map_or(0.0, |load| load.inertia)
    }

    pub(super) fn protection(&self) -> Protection {
        let machine = &self.reference.machine;
        let range = self.current.measuring_range;
        let trip = (f64::from(self.reference.peak_current) * self.trip) as u32;
        let increments = machine.encoder.increments_per_revolution;
        let highest_bus = (machine.supply.voltage * 1.4 / machine.bus_range * 4_096.0) as u16;
        let fastest = u64::from(self.reference.maximum_speed) * u64::from(increments) / 60 / 16_000;
        Protection::new(trip, range, highest_bus, u32::try_from(fastest * 3 / 2).unwrap() + 3).unwrap()
    }

    /// P-0-0105 in V.
    pub(crate) fn overvoltage(&self) -> u16 {
        self.reference.machine.supply.voltage as u16 * 14 / 10
    }

    pub(super) fn voltage(&self) -> VoltageSettings {
        let machine = &self.reference.machine;
        let volts = machine.supply.voltage as u16;
        VoltageSettings::new(&VoltageParameters {
            full_scale: machine.bus_range as u16,
            filter: 500,
            undervoltage: volts / 2,
            overvoltage: self.overvoltage(),
            power_on: volts * 9 / 16,
            power_off: volts / 2,
            undervoltage_time: 2,
            overvoltage_ticks: 2,
        })
        .unwrap()
    }

    /// Everything of the motor side.
    pub(super) fn motor(&self) -> MotorSettings {
        let machine = &self.reference.machine;
        let increments = machine.encoder.increments_per_revolution;
        let pole_pairs = u8::try_from(machine.windings.pole_pairs).unwrap();
        let commutation = CommutationSettings::new(pole_pairs, increments).unwrap();
        let peak = self.reference.peak_current;
        let thermometers = Kind::FACTS.thermometers;
        let temperature = |sensor| {
            TemperatureSettings::new(&TemperatureParameters {
                sensor,
                warning: 1_000,
                shutdown: 1_500,
                filter: 2_000,
                debounce: 200,
            })
            .unwrap()
        };
        let load = LoadSettings::new(&LoadParameters {
            continuous_current: peak,
            peak_current: peak,
            amplifier_peak_current: peak,
            time_constant: 60_000,
            warning_level: 900,
            shutdown_level: 1_100,
        })
        .unwrap();
        MotorSettings {
            current: CurrentSettings {
                current_loop: CurrentLoopSettings::new(&self.current).unwrap(),
                protection: self.protection(),
            },
            model: self.model(),
            commutation,
            angle_per_increment: self.angle_per_increment(),
            pole_pairs: pole_pairs.into(),
            alignment: AlignmentSettings::new(commutation, CurrentFraction::from_num(0.5)).unwrap(),
            index_angle: None,
            voltage: self.voltage(),
            chopper: ChopperSettings::new(&ChopperParameters {
                full_scale: machine.bus_range as u16,
                overvoltage: self.overvoltage(),
                resistance: machine.supply.resistor.map_or(0, |ohms| (ohms * 1e3) as u32),
                continuous_power: self.resistor_power,
                time_constant: 10_000,
                frequency: Kind::FACTS.frequency,
            })
            .unwrap(),
            generating: GeneratingSettings::new(&GeneratingParameters {
                full_scale: machine.bus_range as u16,
                overvoltage: self.overvoltage(),
                resistance: (machine.windings.resistance * 1e3) as u32,
                continuous_current: self.reference.standstill_current,
                peak_current: peak,
                holds_a_load: machine.brake.is_some(),
            })
            .unwrap(),
            heat_sink: temperature(thermometers.heat_sink()),
            winding: temperature(thermometers.motor(TemperatureSensor::Kty84 as u16).unwrap()),
            motor_load: load,
            amplifier_load: load,
            encoder: EncoderMonitorSettings::new(&EncoderMonitorParameters {
                increments_per_revolution: increments,
                maximum_velocity: rpm(f64::from(self.reference.maximum_speed) * 1.1),
                pole_pairs: pole_pairs.into(),
                flux: (machine.windings.flux * 1e6).round() as u32,
                dead_time_compensated: true,
                index_width: None,
            })
            .unwrap(),
            brake: BrakeSettings::new(&BrakeParameters {
                fitted: false,
                contact_fitted: false,
                drive_on_delay: 50,
                drive_off_delay: 50,
                maximum_drive_off_delay: 1_000,
                proof_current: CurrentFraction::from_num(0.1),
                proof_tolerance: CurrentFraction::from_num(0.05),
                proof_time: 2,
                proof_limit: 100,
                hold_test_time: 100,
                hold_window: Position::from_bits(1 << 24),
                stuck_time: 500,
            })
            .unwrap(),
            has_brake: false,
            aligns_with_open_brake: false,
            torque_limits: TorqueLimitSettings::new(&TorqueLimitParameters {
                commanded: CommandedTorqueLimits {
                    positive: CurrentFraction::MAX,
                    negative: CurrentFraction::MIN,
                    bipolar: CurrentFraction::MAX,
                    reversed: false,
                },
                motor_peak: peak,
                amplifier_peak: peak,
            })
            .unwrap(),
            weakening: self.weakening(),
            phase_current: Gain::from_ratio(u128::from(self.current.measuring_range) * 2, peak.into()).unwrap(),
            bus_millivolts: Gain::from_ratio(machine.bus_range as u128 * 1_000, 4_096).unwrap(),
        }
    }

    /// The angle of the d axis where the encoder starts, at time zero: in the middle of an increment, of which the drive knows the lower
    /// edge.
    pub(super) fn electrical_angle(&self) -> u32 {
        let machine = &self.reference.machine;
        let middle = 0.5 / f64::from(machine.encoder.increments_per_revolution);
        let turns = f64::from(machine.windings.pole_pairs) * (machine.encoder.electrical_zero + middle);
        (turns.rem_euclid(1.0) * 4_294_967_296.0) as u64 as u32
    }

    pub(super) fn angle_per_increment(&self) -> u32 {
        let machine = &self.reference.machine;
        let turns = f64::from(machine.windings.pole_pairs) / f64::from(machine.encoder.increments_per_revolution);
        (turns * 4_294_967_296.0).round() as u32
    }

    pub(super) fn model(&self) -> MotorModel {
        let windings = &self.reference.machine.windings;
        let micro = |value: f64| if self.decoupled { (value * 1e6).round() as u32 } else { 0 };
        MotorModel::new(
            micro(windings.inductance_d),
            micro(windings.inductance_q),
            micro(windings.flux),
            self.reference.peak_current,
        )
        .unwrap()
    }

    pub(super) fn weakening(&self) -> FieldWeakeningSettings {
        FieldWeakeningSettings::new(&FieldWeakeningParameters {
            limit: self.weakening,
            voltage: 9_300,
            integral_time: 100,
        })
        .unwrap()
    }
}

/// The gains of the smaller inductance: saturation and saliency only make the loop slower or leave it the margin.
fn current_loop(reference: &ReferenceAxis, bandwidth: u32) -> CurrentLoopParameters {
    let machine = &reference.machine;
    let windings = &machine.windings;
    let inductance = windings.inductance_d.min(windings.inductance_q);
    let gains = current_gains(
        (windings.resistance * 1e3).round() as u32,
        (inductance * 1e6).round() as u32,
        bandwidth,
        Kind::FACTS.frequency,
    )
    .unwrap();
    CurrentLoopParameters {
        peak_current: reference.peak_current,
        measuring_range: (machine.current_sensors.range * 1e3).round() as u32,
        proportional_gain: gains.proportional,
        integral_time: gains.integral_time,
        frequency: Kind::FACTS.frequency,
        dead_time: Kind::FACTS.dead_time,
        dead_time_band: reference.peak_current / 100,
    }
}

/// An acceleration in rad/s².
pub(crate) fn acceleration(value: f64) -> Acceleration {
    Acceleration::from_milliradians_per_second_squared((value * 1e3).round() as u32)
}

/// So many revolutions as the start of the encoder.
pub(crate) fn starting_at(setup: Setup, turns: f64) -> Setup {
    Setup { start: revolutions(turns), ..setup }
}
