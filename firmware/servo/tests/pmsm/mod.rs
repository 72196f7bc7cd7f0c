//! A synchronous motor on an inverter with dead time, in floating point, under the real current loop.

use std::f64::consts::TAU;

use servo::arithmetic::Rotation;
use servo::axis::{Limiting, TorqueLimits, VelocityEstimate, VelocityFilter, VelocityLoop, VelocityLoopSettings};
use servo::current::{
    BusScale, CurrentCommand, CurrentLoop, CurrentLoopParameters, CurrentLoopSettings, CurrentReadings, PwmFrequency,
    SharedCommand, SharedReadings,
};
use servo::identification::{CurrentRequest, IdentificationInputs};
use servo::units::{CurrentFraction, Position, Velocity};

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
    /// V in the direct axis, as a square wave of 0.6 s.
    LooseConnection(f64),
}

pub(crate) struct Bench {
    pub(crate) machine: Machine,
    pub(crate) fault: Fault,
    /// Electrical angle that the drive holds; else it follows the encoder.
    pub(crate) held_angle: Option<u32>,
    current_loop: CurrentLoop,
    shared_command: SharedCommand,
    readings: SharedReadings,
    velocity_settings: VelocityLoopSettings,
    velocity_loop: VelocityLoop,
    estimate: VelocityEstimate,
    command: CurrentCommand,
    /// In A, rad and rad/s of the motor.
    direct: f64,
    quadrature: f64,
    pub(crate) angle: f64,
    speed: f64,
    /// Compare values that are at work, and those that come half a period later.
    counts: [u16; 3],
    next: [u16; 3],
    cycles: u64,
    /// Of the noise.
    random: u32,
}

/// Time of the inverter's dead time, and what the drive believes of it.
const DEAD_TIME: f64 = 1.5e-6;
const COMPENSATED_NANOSECONDS: u32 = 1_000;
/// Compensation and inverter reach their full effect at this part of peak.
const BAND: f64 = 0.01;
const STEPS: u32 = 6;

impl Bench {
    pub(crate) fn new(machine: Machine, angle: f64) -> Self {
        let milli = |value: f64| (value * 1_000.0).round() as u32;
        let gain = machine.direct_inductance * TAU * machine.bandwidth;
        let settings = CurrentLoopSettings::new(&CurrentLoopParameters {
            peak_current: milli(machine.peak_current),
            measuring_range: milli(machine.measuring_range),
            proportional_gain: milli(gain),
            integral_time: 3_000,
            frequency: machine.frequency,
            dead_time: COMPENSATED_NANOSECONDS,
            dead_time_band: milli(machine.peak_current * BAND),
        })
        .unwrap();
        let torque_constant = 1.5 * f64::from(machine.pole_pairs) * machine.flux;
        let velocity_gain = machine.inertia * TAU * 12.0 / torque_constant;
        let peak = milli(machine.peak_current);
        let velocity_settings =
            VelocityLoopSettings::new((velocity_gain * 1_000.0).ceil() as u32, 400, 0, peak).unwrap();
        let bits = (machine.bus * 16_384.0) as i64;
        let bus = BusScale::new(bits as i32, ((1_i64 << 44) / bits) as i32, machine.frequency.reload());
        let command = CurrentCommand {
            direct: 0,
            quadrature: 0,
            angle: 0,
            count: 0,
            angle_per_increment: 0,
            ahead: Rotation::NONE,
            direct_voltage: 0,
            quadrature_voltage: 0,
            bus,
        };
        let middle = [machine.frequency.reload() / 2; 3];
        let mut bench = Self {
            machine,
            fault: Fault::None,
            held_angle: None,
            current_loop: CurrentLoop::new(settings),
            shared_command: SharedCommand::new(),
            readings: SharedReadings::new(),
            velocity_settings,
            velocity_loop: VelocityLoop::new(),
            estimate: VelocityEstimate::new(Position::ZERO),
            command,
            direct: 0.0,
            quadrature: 0.0,
            angle,
            speed: 0.0,
            counts: middle,
            next: middle,
            cycles: 0,
            random: 1,
        };
        bench.estimate = VelocityEstimate::new(bench.position());
        bench
    }

    fn count(&self) -> u32 {
        (self.angle / TAU * f64::from(self.machine.increments)).floor() as i64 as u32
    }

    pub(crate) fn position(&self) -> Position {
        let counts = (self.angle / TAU * f64::from(self.machine.increments)).floor();
        Position::from_bits((counts / f64::from(self.machine.increments) * 2_f64.powi(32)).floor() as i64)
    }

    /// The cycle that starts a tick, and what the control loop sees then.
    pub(crate) fn begin_tick(&mut self) -> IdentificationInputs {
        self.cycle();
        let readings = self.readings.readings();
        // Currents reach the control loop with 16 bits.
        let current = |value: i32| CurrentCommand::reference(CurrentReadings::fraction(value));
        let mut readings =
            CurrentReadings { direct: current(readings.direct), quadrature: current(readings.quadrature), ..readings };
        if matches!(self.fault, Fault::BridgeOff(from) if self.time() >= from) {
            readings = CurrentReadings::default();
        }
        let position = self.position();
        self.estimate.update(&VelocityFilter::from_microseconds(1_000), position);
        IdentificationInputs { readings, longest_voltage: self.command.bus.longest(), position }
    }

    /// What the control loop asks for, for the rest of the tick.
    pub(crate) fn end_tick(&mut self, request: &CurrentRequest) {
        let pairs = u32::from(self.machine.pole_pairs);
        let count = self.count();
        let per_increment = (2_f64.powi(32) * f64::from(pairs) / f64::from(self.machine.increments)).round() as u32;
        let angle = pairs.wrapping_mul(self.position().to_bits() as u32);
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

    /// Samples at the peak, a new voltage half a period later.
    fn cycle(&mut self) {
        let currents = self.phase_currents().map(|current| {
            let counts = current / self.machine.measuring_range * 2_048.0 + 2_048.5 + self.noise();
            let counts = counts.floor().clamp(0.0, 4_095.0);
            ((counts - 2_048.0) * 8.0) as i32
        });
        self.shared_command.set(&self.command);
        self.readings.set_phases(currents);
        self.readings.set_angle(self.shared_command.angle_at(self.count()));
        self.next = self.current_loop.cycle(&self.shared_command, &self.readings);
        self.run(STEPS / 2);
        self.counts = self.next;
        self.run(STEPS / 2);
        self.cycles += 1;
    }

    /// In s.
    fn time(&self) -> f64 {
        self.cycles as f64 / f64::from(self.machine.frequency.hertz())
    }

    /// Up to one count of the converter.
    fn noise(&mut self) -> f64 {
        self.random = self.random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f64::from(self.random >> 8) / 2_f64.powi(23) - 1.0
    }

    fn phase_currents(&self) -> [f64; 3] {
        let angle = self.angle * f64::from(self.machine.pole_pairs);
        [0.0, TAU / 3.0, 2.0 * TAU / 3.0]
            .map(|phase| self.direct * (angle - phase).cos() - self.quadrature * (angle - phase).sin())
    }

    /// Voltages in the axes of the rotor.
    fn voltages(&self) -> (f64, f64) {
        let machine = &self.machine;
        let lost = DEAD_TIME * f64::from(machine.frequency.hertz()) * machine.bus;
        let band = BAND * machine.peak_current;
        let currents = self.phase_currents();
        let mut phases = [0.0; 3];
        for ((phase, current), counts) in phases.iter_mut().zip(currents).zip(self.counts) {
            let on = f64::from(counts) / f64::from(machine.frequency.reload());
            *phase = on * machine.bus - lost * (current / band).clamp(-1.0, 1.0);
        }
        let [a, b, c] = phases;
        let (alpha, beta) = ((2.0 * a - b - c) / 3.0, (b - c) / 3_f64.sqrt());
        let (sine, cosine) = (self.angle * f64::from(machine.pole_pairs)).sin_cos();
        let mut direct = alpha * cosine + beta * sine;
        if let Fault::LooseConnection(volts) = self.fault
            && (self.time() / 0.3) as u64 % 2 == 1
        {
            direct -= volts;
        }
        (direct, beta * cosine - alpha * sine)
    }

    fn run(&mut self, steps: u32) {
        let machine = self.machine;
        let time = 1.0 / f64::from(machine.frequency.hertz()) / f64::from(STEPS);
        let pairs = f64::from(machine.pole_pairs);
        for _ in 0..steps {
            let (direct_voltage, quadrature_voltage) = self.voltages();
            let speed = self.speed * pairs;
            let slopes = |direct: f64, quadrature: f64| {
                let linked = machine.direct_inductance * direct + machine.flux;
                (
                    (direct_voltage - machine.resistance * direct + speed * machine.quadrature_inductance * quadrature)
                        / machine.direct_inductance,
                    (quadrature_voltage - machine.resistance * quadrature - speed * linked)
                        / machine.quadrature_inductance,
                )
            };
            let (direct, quadrature) = slopes(self.direct, self.quadrature);
            let half = 0.5 * time;
            let (direct, quadrature) = slopes(self.direct + half * direct, self.quadrature + half * quadrature);
            self.direct += time * direct;
            self.quadrature += time * quadrature;
            self.turn(time);
        }
    }

    fn turn(&mut self, time: f64) {
        let machine = &self.machine;
        if self.fault == Fault::Blocked {
            self.speed = 0.0;
            return;
        }
        let difference = machine.direct_inductance - machine.quadrature_inductance;
        let mut torque =
            1.5 * f64::from(machine.pole_pairs) * (machine.flux + difference * self.direct) * self.quadrature;
        if let Fault::Load(load, from) = self.fault {
            torque -= if self.time() >= from { load } else { 0.0 };
        }
        torque -= machine.viscous_friction * self.speed;
        if self.speed == 0.0 && torque.abs() <= machine.coulomb_friction {
            return;
        }
        let against = if self.speed == 0.0 { torque.signum() } else { self.speed.signum() };
        let before = self.speed;
        self.speed += (torque - against * machine.coulomb_friction) / machine.inertia * time;
        if before * self.speed < 0.0 {
            self.speed = 0.0;
        }
        self.angle += self.speed * time;
    }
}
