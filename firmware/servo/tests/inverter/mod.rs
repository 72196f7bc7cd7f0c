//! A permanent magnet motor on an inverter, in f64, for the real current loop: samples at the peak of the period, compare values that load
//! half a period later.

use servo::arithmetic::Rotation;
use servo::current::{
    BusScale, CurrentCommand, CurrentLoop, CurrentLoopParameters, CurrentLoopSettings, PwmFrequency, SharedCommand,
    SharedReadings,
};

/// Electrical data of a motor, of a phase, and its inverter.
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

/// Motor, inverter and current loop.
#[derive(Debug)]
pub(crate) struct Drive {
    data: MotorData,
    /// The current loop.
    current_loop: CurrentLoop,
    command: SharedCommand,
    pub(crate) readings: SharedReadings,
    /// d and q current in A.
    current: (f64, f64),
    /// Electrical angle in rad.
    angle: f64,
    /// Phase voltages now, without zero sequence: alpha and beta.
    voltage: (f64, f64),
}

/// Steps of the integration in half a period.
const STEPS: u32 = 32;
/// The current sensors measure twice the peak current.
const RANGE: f64 = 2.0;

impl Drive {
    /// At rest, with S-0-0106 in mV/A and S-0-0107 in us.
    pub(crate) fn new(data: MotorData, proportional_gain: u32, integral_time: u32) -> Self {
        let settings = CurrentLoopSettings::new(&CurrentLoopParameters {
            peak_current: (data.peak * 1_000.0) as u32,
            measuring_range: (data.peak * RANGE * 1_000.0) as u32,
            proportional_gain,
            integral_time,
            frequency: data.frequency,
            dead_time: 0,
            dead_time_band: 1,
        })
        .unwrap();
        Self {
            data,
            current_loop: CurrentLoop::new(settings),
            command: SharedCommand::new(),
            readings: SharedReadings::new(),
            current: (0.0, 0.0),
            angle: 0.0,
            voltage: (0.0, 0.0),
        }
    }

    /// The bus as the current loop sees it.
    pub(crate) fn bus(&self) -> BusScale {
        let voltage = self.data.bus << 14;
        BusScale::new(voltage, ((1_i64 << 44) / i64::from(voltage)) as i32, self.data.frequency.reload())
    }

    /// d and q current as shares of peak.
    pub(crate) fn current(&self) -> (f64, f64) {
        (self.current.0 / self.data.peak, self.current.1 / self.data.peak)
    }

    /// A period of the modulation from peak to peak, with d and q current commands as shares of peak and a speed in rad/s (electrical).
    pub(crate) fn cycle(&mut self, direct: f64, quadrature: f64, speed: f64) {
        let period = 1.0 / f64::from(self.data.frequency.hertz());
        let turns = |radians: f64| ((radians / std::f64::consts::TAU).rem_euclid(1.0) * 4_294_967_296.0) as u64 as u32;
        let share = |value: f64| (value * f64::from(1 << 26)).round() as i32;
        self.command.set(&CurrentCommand {
            direct: share(direct),
            quadrature: share(quadrature),
            angle: 0,
            count: 0,
            angle_per_increment: 0,
            // Half a period to the load, half to the middle of the hold.
            ahead: Rotation::by(turns(speed * period)),
            direct_voltage: 0,
            quadrature_voltage: 0,
            bus: self.bus(),
        });
        self.readings.set_phases(self.samples());
        self.readings.set_angle(turns(self.angle));
        let counts = self.current_loop.cycle(&self.command, &self.readings).map(f64::from);
        self.run(speed, period / 2.0);
        let per_count = f64::from(self.data.bus) / f64::from(self.data.frequency.reload());
        let [a, b, c] = counts.map(|counts| counts * per_count);
        self.voltage = ((2.0 * a - b - c) / 3.0, (b - c) / 3_f64.sqrt());
        self.run(speed, period / 2.0);
    }

    /// Phase currents in steps of a 12-bit converter, as the current loop wants them: in 2^-3.
    fn samples(&self) -> [i32; 3] {
        let (direct, quadrature) = self.current;
        [0.0, -1.0, 1.0].map(|third| {
            let angle = self.angle + third * std::f64::consts::TAU / 3.0;
            let current = direct * angle.cos() - quadrature * angle.sin();
            (current / (self.data.peak * RANGE) * 2_048.0).round().clamp(-2_048.0, 2_047.0) as i32 * 8
        })
    }

    fn run(&mut self, speed: f64, time: f64) {
        let MotorData { resistance, inductance, flux, .. } = self.data;
        let step = time / f64::from(STEPS);
        for _ in 0..STEPS {
            let (sine, cosine) = (self.angle + speed * step / 2.0).sin_cos();
            let (alpha, beta) = self.voltage;
            let (voltage_d, voltage_q) = (alpha * cosine + beta * sine, beta * cosine - alpha * sine);
            let slope = |(d, q): (f64, f64)| {
                (
                    (voltage_d - resistance * d + speed * inductance * q) / inductance,
                    (voltage_q - resistance * q - speed * (inductance * d + flux)) / inductance,
                )
            };
            let (d, q) = self.current;
            let half = slope((d, q));
            let middle = slope((d + half.0 * step / 2.0, q + half.1 * step / 2.0));
            self.current = (d + middle.0 * step, q + middle.1 * step);
            self.angle = (self.angle + speed * step).rem_euclid(std::f64::consts::TAU);
        }
    }
}
