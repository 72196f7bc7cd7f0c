//! Cogging and EMF harmonics against their formulas, and the energy of both.

use core::f64::consts::{PI, TAU};

use crate::common::{MILLISECOND, SECOND, assert_near, ideal};
use plant::{Cogging, EmfHarmonics, HeatedBody, Machine, MachineSettings, TorqueHarmonic};

const AMPLITUDE: f64 = 0.1;

/// Stable where the angle is a whole number of periods of 1/24 revolution.
fn with_cogging(second: TorqueHarmonic) -> MachineSettings {
    let first = TorqueHarmonic { per_revolution: 24, amplitude: AMPLITUDE, phase: 0.5 };
    let mut settings = ideal();
    settings.effects.cogging = Some(Cogging { harmonics: [first, second] });
    settings
}

const NO_SECOND: TorqueHarmonic = TorqueHarmonic { per_revolution: 1, amplitude: 0.0, phase: 0.0 };

/// From the lower edge of the increment in which the encoder starts, which is where angles are counted from.
fn angle_of_teeth(machine: &mut Machine, at: u64) -> f64 {
    machine.angle(at) + 0.5 / 4_096.0
}

#[test]
fn the_torque_is_the_sum_of_its_harmonics() {
    let second = TorqueHarmonic { per_revolution: 7, amplitude: 0.03, phase: 0.2 };
    let mut machine = Machine::new(with_cogging(second));
    // Driven by what no torque slows down.
    machine.set_velocity(100.0, 0);
    for n in 0..100 {
        let at = n * MILLISECOND;
        let angle = angle_of_teeth(&mut machine, at) * TAU;
        let expected = -AMPLITUDE * (24.0 * angle).sin() + 0.03 * (7.0 * angle + 0.2 * TAU).sin();
        assert_near(machine.cogging_torque(at), expected, 1e-12);
    }
    // But for what leaks through the open bridge, there is no current, and no torque of the motor.
    assert_near(machine.torque(100 * MILLISECOND), 0.0, 1e-6);
}

#[test]
fn a_rotor_swings_about_a_tooth_and_keeps_its_energy() {
    let mut machine = Machine::new(with_cogging(NO_SECOND));
    machine.set_velocity(0.01, 0);
    // sqrt(24 * 0.1 / 0.01) = 15.5 rad/s.
    let natural = (24.0 * AMPLITUDE / 0.01_f64).sqrt();
    let half = (PI / natural * 1e9) as u64;
    // It starts half an increment beside the tooth.
    let start = TAU * 0.5 / 4_096.0;
    let angle = |machine: &mut Machine, at| TAU * angle_of_teeth(machine, at);
    let energy = |machine: &mut Machine, at| {
        let velocity = machine.velocity(at);
        0.5 * 0.01 * velocity * velocity - AMPLITUDE / 24.0 * (24.0 * angle(machine, at)).cos()
    };
    let before = energy(&mut machine, 0);
    for n in 1..=10_u64 {
        let sign = if n % 2 == 0 { 1.0 } else { -1.0 };
        assert_near(angle(&mut machine, n * half), sign * start, 2e-6);
        assert_near(machine.velocity(n * half), sign * 0.01, 2e-5);
        assert_near(energy(&mut machine, n * half), before, 1e-12);
    }
}

#[test]
fn teeth_hold_a_load_up_to_their_amplitude_and_not_beyond() {
    let mut settings = with_cogging(NO_SECOND);
    settings.mechanics.viscous_friction = 0.2;
    let mut machine = Machine::new(settings);
    machine.set_load_torque(0.09, 0);
    let held = angle_of_teeth(&mut machine, 5 * SECOND) * TAU;
    assert_near(held, 0.9_f64.asin() / 24.0, 1e-9);
    machine.set_load_torque(0.101, 5 * SECOND);
    assert!(machine.angle(25 * SECOND) > 2.0 / 24.0, "it slips from tooth to tooth");
}

#[test]
fn the_first_harmonic_is_the_least_common_multiple_of_slots_and_poles() {
    for (slots, poles, expected) in [(12, 8, 24), (12, 10, 60), (36, 8, 72), (9, 6, 18), (24, 8, 24)] {
        let [first, second] = Cogging::of(slots, poles, 0.1).harmonics;
        assert_eq!((first.per_revolution, first.amplitude, second.amplitude), (expected, 0.1, 0.0));
    }
}

const HARMONICS: EmfHarmonics = EmfHarmonics { fifth: 0.04, seventh: -0.025 };

/// EMF of a phase at an electrical speed, with the d axis at an electrical angle in turns.
fn emf(speed: f64, turns: f64, phase: usize) -> f64 {
    let a = (turns - phase as f64 / 3.0) * TAU;
    -speed * 0.1 * (a.sin() + HARMONICS.fifth * (5.0 * a).sin() + HARMONICS.seventh * (7.0 * a).sin())
}

#[test]
fn the_emf_has_its_harmonics_in_every_phase_and_its_power_is_that_of_the_torque() {
    // Shorted coils of L / R = 1 us: each phase's current is its EMF over 1 ohm.
    let mut settings = ideal();
    (settings.windings.inductance_d, settings.windings.inductance_q) = (1e-6, 1e-6);
    settings.mechanics.rotor_inertia = 1e6;
    settings.effects.emf_harmonics = Some(HARMONICS);
    let speed = 200.0;
    let mut machine = Machine::new(settings);
    machine.set_bridge(true, 0);
    machine.set_velocity(speed / 4.0, 0);
    let (mut lowest, mut highest) = (f64::MAX, f64::MIN);
    for n in 0..400 {
        let at = 10 * MILLISECOND + n * 115_000;
        let turns = 4.0 * machine.angle(at);
        let currents = machine.phase_currents(at);
        let mut power = 0.0;
        for (phase, current) in currents.into_iter().enumerate() {
            // 5 us of 20 V that fall with the angle, twice the time constant late, and the seventh harmonic of it.
            assert_near(current, -emf(speed, turns, phase), 0.02);
            power += emf(speed, turns, phase) * current;
        }
        let torque = machine.torque(at);
        assert_near(torque * speed / 4.0, power, 1e-9 * power.abs());
        (lowest, highest) = (lowest.min(torque), highest.max(torque));
    }
    // The EMF squared: 1.5 * (20 V)² (1 +- 2 * 0.065) over the speed. Both harmonics are against each other in the middle.
    let mean = -1.5 * 400.0 / 50.0;
    assert_near(highest / mean, 1.0 - 0.130, 0.012);
    assert_near(lowest / mean, 1.0 + 0.130, 0.012);
}

#[test]
fn a_short_circuit_with_harmonics_loses_no_energy() {
    let mut settings = ideal();
    settings.mechanics.rotor_inertia = 0.002;
    settings.thermal.winding = HeatedBody { capacity: 0.5, resistance: 1e12 };
    settings.effects.emf_harmonics = Some(EmfHarmonics { fifth: 0.1, seventh: 0.05 });
    let mut machine = Machine::new(settings);
    machine.set_bridge(true, 0);
    machine.set_velocity(200.0, 0);
    for at in [2, 20, 60].map(|at| at * MILLISECOND) {
        let velocity = machine.velocity(at);
        let [d, q] = machine.dq_currents(at);
        let energy = 0.5 * 0.002 * velocity * velocity + 0.75e-3 * (d * d + q * q);
        let heat = 0.5 * (machine.winding_temperature(at) - 20.0);
        assert_near(energy + heat, 40.0, 1e-4);
    }
    assert!(machine.velocity(60 * MILLISECOND) < 150.0, "it must have braked");
}
