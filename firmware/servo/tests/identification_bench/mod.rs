//! Motors to be identified, of which the drive knows little: the current loop on their machine, a velocity loop, and what can go wrong.

use std::f64::consts::TAU;

use plant::{MachineSettings, Windings};
use servo::arithmetic::Rotation;
use servo::axis::{
    Limiting, TorqueLimits, VelocityEstimate, VelocityFilter, VelocityLoop, VelocityLoopSettings, VelocityRate,
};
use servo::current::{CurrentCommand, CurrentLoopParameters, CurrentReadings, PwmFrequency};
use servo::encoder::{Encoder, EncoderSettings};
use servo::identification::{CurrentRequest, IdentificationInputs};
use servo::units::{CurrentFraction, Position, Velocity};

use crate::current_bench::{self, angle_of};

/// A motor in SI units, with the drive that belongs to it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Machine {
    pub(crate) name: &'static str,
    pub(crate) resistance: f64,
    pub(crate) direct_inductance: f64,
    pub(crate) quadrature_inductance: f64,
    pub(crate) flux: f64,
    pub(crate) pole_pairs: u8,
    pub(crate) inertia: f64,
    pub(crate) coulomb_friction: f64,
    pub(crate) viscous_friction: f64,
    pub(crate) increments: u32,
    pub(crate) bus: f64,
    /// In A.
    pub(crate) peak_current: f64,
    pub(crate) measuring_range: f64,
    /// Of the identification, in A.
    pub(crate) current: f64,
    pub(crate) ripple: f64,
    /// In rpm and rad/s².
    pub(crate) speed: f64,
    pub(crate) acceleration: f64,
    /// Bandwidth of the current loop in Hz, as far as the motor was known when its gains were set.
    pub(crate) bandwidth: f64,
    pub(crate) frequency: PwmFrequency,
}

/// What is wrong with a bench.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Fault {
    None,
    /// From this time on, in s.
    BridgeOff(f64),
    Blocked,
    /// So many Nm from this time on.
    Load(f64, f64),
    /// Ohm in the first phase, which come and go with a period of 0.6 s.
    LooseContact(f64),
}

pub(crate) struct Bench {
    pub(crate) machine: Machine,
    pub(crate) fault: Fault,
    /// Electrical angle that the drive holds; else it follows the encoder.
    pub(crate) held_angle: Option<u32>,
    bench: current_bench::Bench,
    encoder: Encoder,
    velocity_settings: VelocityLoopSettings,
    velocity_loop: VelocityLoop,
    estimate: VelocityEstimate,
    command: CurrentCommand,
    /// Electrical angle at time zero.
    start: u32,
}

/// Time of the inverter's dead time, and what the drive believes of it.
const DEAD_TIME: f64 = 1.5e-6;
const COMPENSATED_NANOSECONDS: u32 = 1_000;
/// The compensation reaches its full effect at this part of peak.
const BAND: f64 = 0.01;
/// Standard deviation of a sample's noise in counts.
const NOISE: f64 = 0.577;

impl Machine {
    fn settings(&self, angle: f64) -> MachineSettings {
        let windings = Windings {
            pole_pairs: self.pole_pairs.into(),
            resistance: self.resistance,
            inductance_d: self.direct_inductance,
            inductance_q: self.quadrature_inductance,
            flux: self.flux,
            saturation: None,
        };
        let mut settings = MachineSettings::textbook(windings, self.bus, self.measuring_range);
        settings.inverter.dead_time = DEAD_TIME;
        settings.inverter.period = 1.0 / f64::from(self.frequency.hertz());
        settings.current_sensors.noise = NOISE;
        settings.encoder.increments_per_revolution = self.increments;
        settings.encoder.electrical_zero = angle / TAU;
        settings.mechanics.rotor_inertia = self.inertia;
        settings.mechanics.coulomb_friction = self.coulomb_friction;
        settings.mechanics.viscous_friction = self.viscous_friction;
        settings
    }
}

impl Bench {
    /// At rest, with the shaft at an angle in rad.
    pub(crate) fn new(machine: Machine, angle: f64) -> Self {
        let milli = |value: f64| (value * 1_000.0).round() as u32;
        let parameters = CurrentLoopParameters {
            peak_current: milli(machine.peak_current),
            measuring_range: milli(machine.measuring_range),
            proportional_gain: milli(machine.direct_inductance * TAU * machine.bandwidth),
            integral_time: 3_000,
            frequency: machine.frequency,
            dead_time: COMPENSATED_NANOSECONDS,
            dead_time_band: milli(machine.peak_current * BAND),
        };
        let torque_constant = 1.5 * f64::from(machine.pole_pairs) * machine.flux;
        let velocity_gain = machine.inertia * TAU * 12.0 / torque_constant;
        let peak = milli(machine.peak_current);
        let velocity_settings =
            VelocityLoopSettings::new((velocity_gain * 1_000.0).ceil() as u32, 400, 0, peak, VelocityRate::EachTick)
                .unwrap();
        let bench = current_bench::Bench::new(machine.settings(angle), &parameters);
        let encoder = Encoder::new(EncoderSettings::new(machine.increments).unwrap(), 0);
        let command = CurrentCommand {
            direct: 0,
            quadrature: 0,
            angle: 0,
            count: 0,
            angle_per_increment: 0,
            ahead: Rotation::NONE,
            direct_voltage: 0,
            quadrature_voltage: 0,
            bus: bench.bus(),
        };
        Self {
            machine,
            fault: Fault::None,
            held_angle: None,
            estimate: VelocityEstimate::new(encoder.position()),
            bench,
            encoder,
            velocity_settings,
            velocity_loop: VelocityLoop::new(),
            command,
            start: angle_of(f64::from(machine.pole_pairs) * angle / TAU),
        }
    }

    /// Of the last tick.
    pub(crate) fn position(&self) -> Position {
        self.encoder.position()
    }

    /// Of the shaft, in revolutions since the start.
    pub(crate) fn turns(&mut self) -> f64 {
        self.bench.machine.angle(self.bench.time)
    }

    /// The cycle that starts a tick, and what the control loop sees then.
    pub(crate) fn begin_tick(&mut self) -> IdentificationInputs {
        self.cycle();
        let readings = self.bench.readings.readings();
        // Currents reach the control loop with 16 bits.
        let current = |value: i32| CurrentCommand::reference(CurrentReadings::fraction(value));
        let mut readings =
            CurrentReadings { direct: current(readings.direct), quadrature: current(readings.quadrature), ..readings };
        if matches!(self.fault, Fault::BridgeOff(from) if self.seconds() >= from) {
            // What the drive takes for the readings then.
            readings = CurrentReadings::default();
        }
        let position = self.encoder.update(self.bench.machine.encoder_count(self.bench.time));
        self.estimate.update(&VelocityFilter::from_microseconds(1_000), position);
        IdentificationInputs { readings, longest_voltage: self.command.bus.longest(), position }
    }

    /// What the control loop asks for, for the rest of the tick.
    pub(crate) fn end_tick(&mut self, request: &CurrentRequest) {
        let pairs = u32::from(self.machine.pole_pairs);
        let count = self.bench.machine.encoder_count(self.bench.time);
        let per_increment = (2_f64.powi(32) * f64::from(pairs) / f64::from(self.machine.increments)).round() as u32;
        let angle = pairs.wrapping_mul(self.position().to_bits() as u32).wrapping_add(self.start);
        let speed = (i64::from(self.estimate.velocity().to_bits()) * i64::from(pairs)) >> 4;
        let cycles = i64::from(self.machine.frequency.cycles_per_tick());
        let (angle, angle_per_increment, ahead) = match self.held_angle {
            Some(held) => (held, 0, Rotation::NONE),
            None => (angle, per_increment, Rotation::by((speed / cycles) as u32)),
        };
        self.command = CurrentCommand {
            direct: CurrentCommand::reference(request.direct),
            quadrature: CurrentCommand::reference(request.quadrature),
            angle,
            count,
            angle_per_increment,
            ahead,
            direct_voltage: request.direct_voltage,
            quadrature_voltage: request.quadrature_voltage,
            bus: self.command.bus,
        };
        for _ in 1..self.machine.frequency.cycles_per_tick() {
            self.cycle();
        }
    }

    /// The velocity loop.
    pub(crate) fn end_tick_with_velocity(&mut self, velocity: Velocity) {
        let measured = self.estimate.velocity();
        let output = self.velocity_loop.tick(
            &self.velocity_settings,
            &TorqueLimits::symmetrical(CurrentFraction::from_num(0.5), Limiting::TORQUE_BIPOLAR),
            velocity,
            measured,
            0,
        );
        self.end_tick(&CurrentRequest {
            direct: CurrentFraction::ZERO,
            quadrature: output.current,
            ..CurrentRequest::default()
        });
    }

    fn cycle(&mut self) {
        self.break_it();
        self.bench.cycle(&self.command, |machine, command, now| command.angle_at(machine.encoder_count(now)));
    }

    /// What the fault has done by now.
    fn break_it(&mut self) {
        let (seconds, now) = (self.seconds(), self.bench.time);
        let machine = &mut self.bench.machine;
        match self.fault {
            Fault::None => {}
            Fault::BridgeOff(from) => machine.set_bridge(seconds < from, now),
            Fault::Blocked => machine.block(true, now),
            Fault::Load(load, from) => machine.set_load_torque(if seconds < from { 0.0 } else { -load }, now),
            Fault::LooseContact(ohm) => {
                let lifted = (seconds / 0.3) as u64 % 2 == 1;
                machine.set_contact_resistances([if lifted { ohm } else { 0.0 }, 0.0, 0.0], now);
            }
        }
    }

    fn seconds(&self) -> f64 {
        self.bench.time as f64 * 1e-9
    }
}
