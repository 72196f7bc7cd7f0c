//! The reference axes: consistent in themselves, and under a current loop.

use core::f64::consts::TAU;

use crate::common::{MILLISECOND, SECOND, assert_near};
use plant::{Machine, ReferenceAxis};

fn axes() -> [ReferenceAxis; 4] {
    [ReferenceAxis::press(), ReferenceAxis::small_cnc(), ReferenceAxis::precise(), ReferenceAxis::vertical()]
}

#[test]
fn motor_and_machine_are_the_same_axis() {
    for axis in axes() {
        let peak_current = f64::from(axis.peak_current) / 1_000.0;
        assert_near(axis.machine.torque_constant() * peak_current, axis.motor.peak_torque, 1e-9);
        assert_eq!(axis.machine.encoder.increments_per_revolution, axis.motor.increments_per_revolution);
        assert_eq!(axis.machine.mechanics.rotor_inertia, axis.motor.inertia);
        assert!(axis.machine.current_sensors.range > 1.1 * peak_current, "{}", axis.name);
        let samples = axis.machine().bus_sample(0);
        assert_near(f64::from(samples) / 4_096.0 * axis.machine.bus_range, axis.machine.supply.voltage, 0.2);
    }
}

#[test]
fn the_vertical_axis_falls_without_its_brake_and_the_others_stand() {
    for axis in axes() {
        let mut machine = axis.machine();
        machine.set_brake(true, 0);
        let falls = machine.angle(SECOND / 2) < -1.0;
        assert_eq!(falls, axis.feed_constant.is_some(), "{}", axis.name);
        assert_eq!(axis.machine().angle(SECOND / 2), 0.0, "{}", axis.name);
    }
    let vertical = ReferenceAxis::vertical();
    let standstill_torque = vertical.machine.torque_constant() * f64::from(vertical.standstill_current) / 1_000.0;
    assert_near(vertical.machine.mechanics.gravity_torque, -0.3 * standstill_torque, 1e-9);
}

/// A field-oriented current loop at 16 kHz, from samples to duties: sampled in the middle of a period, in force with the next.
struct CurrentLoop {
    axis: ReferenceAxis,
    integral: [f64; 2],
    offsets: [f64; 3],
    period: u64,
}

impl CurrentLoop {
    fn new(axis: ReferenceAxis) -> Self {
        Self { axis, integral: [0.0; 2], offsets: axis.machine.current_sensors.offset, period: 0 }
    }

    fn run(&mut self, machine: &mut Machine, command: f64) {
        const PERIOD: u64 = 62_500;
        let settings = &self.axis.machine;
        let now = self.period * PERIOD;
        self.period += 1;
        let samples = machine.current_samples(now);
        let currents: [f64; 3] = core::array::from_fn(|k| {
            (f64::from(samples[k]) - 2_048.0 - self.offsets[k]) * settings.current_sensors.range / 2_048.0
        });
        let encoder = &settings.encoder;
        let angle = f64::from(machine.encoder_count(now) as i32) / f64::from(encoder.increments_per_revolution);
        let pole_pairs = f64::from(settings.windings.pole_pairs);
        let turns = pole_pairs * (angle + encoder.electrical_zero);
        let axis_of = |k: usize, turns: f64| ((turns - k as f64 / 3.0) * TAU).sin_cos();
        let (mut d, mut q) = (0.0, 0.0);
        for (k, current) in currents.iter().enumerate() {
            let (sine, cosine) = axis_of(k, turns);
            (d, q) = (d + 2.0 / 3.0 * current * cosine, q - 2.0 / 3.0 * current * sine);
        }
        // Crossing at 3000 rad/s, the integral at the windings' time constant.
        let inductances = [settings.windings.inductance_d, settings.windings.inductance_q];
        let errors = [-d, command - q];
        let voltages: [f64; 2] = core::array::from_fn(|k| {
            self.integral[k] += 3_000.0 * settings.windings.resistance * errors[k] * PERIOD as f64 * 1e-9;
            3_000.0 * inductances[k] * errors[k] + self.integral[k]
        });
        let bus = f64::from(machine.bus_sample(now)) / 4_096.0 * settings.bus_range;
        let lead = machine.velocity(now) * pole_pairs / TAU * PERIOD as f64 * 1e-9;
        let lost = settings.inverter.dead_time / settings.inverter.period + settings.inverter.voltage_drop / bus;
        let duties: [f64; 3] = core::array::from_fn(|k| {
            let (sine, cosine) = axis_of(k, turns + lead);
            let compensation = lost * (currents[k] / 0.2).clamp(-1.0, 1.0);
            0.5 + (voltages[0] * cosine - voltages[1] * sine) / bus + compensation
        });
        machine.set_duties(duties, now + PERIOD / 2);
    }
}

#[test]
fn under_a_current_loop_every_axis_gives_the_torque_that_is_commanded() {
    for axis in axes() {
        let mut settings = axis.machine;
        settings.mechanics.rotor_inertia *= 50.0;
        let mut machine = Machine::new(settings);
        machine.set_bridge(true, 0);
        machine.set_brake(true, 0);
        machine.set_velocity(5.0, 50 * MILLISECOND);
        let command = 0.5 * f64::from(axis.peak_current) / 1_000.0;
        let mut current_loop = CurrentLoop::new(axis);
        let mut torques = Vec::new();
        for n in 0..4_800_u64 {
            current_loop.run(&mut machine, command);
            if n >= 3_200 {
                torques.push(machine.torque(n * 62_500));
            }
        }
        let mean = torques.iter().sum::<f64>() / torques.len() as f64;
        let expected = 0.5 * axis.motor.peak_torque;
        // The gain errors of the sensors are worth up to 0.5 %, with less than that in the mean.
        assert_near(mean, expected, 0.01 * expected);
        let ripple = torques.iter().map(|torque| (torque - mean).abs()).fold(0.0, f64::max);
        assert!(ripple < 0.005 * axis.motor.peak_torque, "{}: {ripple} Nm of {expected}", axis.name);
    }
}
