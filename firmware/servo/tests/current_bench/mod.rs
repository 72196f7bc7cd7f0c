//! The current loop on the machine without the tasks around it: samples at the peak of the period, compare values that load half a period
//! later.

use plant::{Machine, MachineSettings, Windings};
use servo::arithmetic::Rotation;
use servo::current::{
    BusScale, CurrentCommand, CurrentLoop, CurrentLoopParameters, CurrentLoopSettings, PwmFrequency, SharedCommand,
    SharedReadings,
};

/// A current loop and its machine.
#[derive(Debug)]
pub(crate) struct Bench {
    pub(crate) machine: Machine,
    pub(crate) readings: SharedReadings,
    /// Instant of the next sample of the currents, in nanoseconds.
    pub(crate) time: u64,
    current_loop: CurrentLoop,
    command: SharedCommand,
    frequency: PwmFrequency,
}

impl Bench {
    /// At rest with the bridge on.
    pub(crate) fn new(settings: MachineSettings, parameters: &CurrentLoopParameters) -> Self {
        let mut machine = Machine::new(settings);
        machine.set_bridge(true, 0);
        Self {
            machine,
            readings: SharedReadings::new(),
            time: 0,
            current_loop: CurrentLoop::new(CurrentLoopSettings::new(parameters).unwrap()),
            command: SharedCommand::new(),
            frequency: parameters.frequency,
        }
    }

    /// A period of the modulation, in nanoseconds.
    pub(crate) fn period(&self) -> u64 {
        1_000_000_000 / u64::from(self.frequency.hertz())
    }

    /// The bus as the current loop sees it.
    pub(crate) fn bus(&self) -> BusScale {
        let voltage = (self.machine.settings().supply.voltage * 16_384.0) as i64;
        BusScale::new(voltage as i32, ((1_i64 << 44) / voltage) as i32, self.frequency.reload())
    }

    /// A period of the modulation from peak to peak with a command, at the electrical angle that this makes of it.
    pub(crate) fn cycle(
        &mut self,
        command: &CurrentCommand,
        angle: impl FnOnce(&mut Machine, &SharedCommand, u64) -> u32,
    ) {
        let (now, half) = (self.time, self.period() / 2);
        self.command.set(command);
        let samples = self.machine.current_samples(now);
        self.readings.set_phases(samples.map(|sample| (i32::from(sample) - 2_048) * 8));
        self.readings.set_angle(angle(&mut self.machine, &self.command, now));
        let counts = self.current_loop.cycle(&self.command, &self.readings);
        let reload = f64::from(self.frequency.reload());
        self.machine.set_duties(counts.map(|count| f64::from(count) / reload), now + half);
        self.time += 2 * half;
    }
}

/// Electrical data of a motor of one pole pair, of a phase, and its inverter.
#[derive(Clone, Copy, Debug)]
pub(crate) struct MotorData {
    /// Ohm.
    pub(crate) resistance: f64,
    /// Henry, of both axes.
    pub(crate) inductance: f64,
    /// Flux linkage of the magnets in Vs.
    pub(crate) flux: f64,
    /// Voltage of the bus.
    pub(crate) bus: i32,
    /// Peak current in A.
    pub(crate) peak: f64,
    /// Rate of the current loop.
    pub(crate) frequency: PwmFrequency,
}

/// A motor whose speed is given, with its angle known to the current loop.
#[derive(Debug)]
pub(crate) struct Drive {
    bench: Bench,
    peak: f64,
}

/// The current sensors measure twice the peak current.
const RANGE: f64 = 2.0;
/// A rotor that no torque of the motor moves within a cycle, in kg m².
const FLYWHEEL: f64 = 1e6;

impl Drive {
    /// At rest, with S-0-0106 in mV/A and S-0-0107 in us.
    pub(crate) fn new(data: MotorData, proportional_gain: u32, integral_time: u32) -> Self {
        let windings = Windings {
            pole_pairs: 1,
            resistance: data.resistance,
            inductance_d: data.inductance,
            inductance_q: data.inductance,
            flux: data.flux,
            saturation: None,
        };
        let mut settings = MachineSettings::textbook(windings, f64::from(data.bus), data.peak * RANGE);
        settings.inverter.period = 1.0 / f64::from(data.frequency.hertz());
        settings.mechanics.rotor_inertia = FLYWHEEL;
        let parameters = CurrentLoopParameters {
            peak_current: (data.peak * 1_000.0) as u32,
            measuring_range: (data.peak * RANGE * 1_000.0) as u32,
            proportional_gain,
            integral_time,
            frequency: data.frequency,
            dead_time: 0,
            dead_time_band: 1,
        };
        Self { bench: Bench::new(settings, &parameters), peak: data.peak }
    }

    /// The bus as the current loop sees it.
    pub(crate) fn bus(&self) -> BusScale {
        self.bench.bus()
    }

    pub(crate) fn readings(&self) -> &SharedReadings {
        &self.bench.readings
    }

    /// d and q current as shares of peak, at the next sample.
    pub(crate) fn current(&mut self) -> (f64, f64) {
        let Bench { machine, time, .. } = &mut self.bench;
        let [d, q] = machine.dq_currents(*time);
        (d / self.peak, q / self.peak)
    }

    /// A period of the modulation from peak to peak, with d and q current commands as shares of peak and a speed in rad/s (electrical).
    pub(crate) fn cycle(&mut self, direct: f64, quadrature: f64, speed: f64) {
        let share = |value: f64| (value * f64::from(1 << 26)).round() as i32;
        let bus = self.bus();
        let bench = &mut self.bench;
        if bench.machine.velocity(bench.time) != speed {
            bench.machine.set_velocity(speed, bench.time);
        }
        let ahead = speed * bench.period() as f64 * 1e-9 / std::f64::consts::TAU;
        let command = CurrentCommand {
            direct: share(direct),
            quadrature: share(quadrature),
            angle: 0,
            count: 0,
            angle_per_increment: 0,
            // Half a period to the load, half to the middle of the hold.
            ahead: Rotation::by(angle_of(ahead)),
            direct_voltage: 0,
            quadrature_voltage: 0,
            bus,
        };
        bench.cycle(&command, |machine, _, now| angle_of(machine.angle(now)));
    }
}

/// An electrical angle in turns as the current loop wants it.
pub(crate) fn angle_of(turns: f64) -> u32 {
    (turns.rem_euclid(1.0) * 4_294_967_296.0) as u64 as u32
}
