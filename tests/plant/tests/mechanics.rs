//! Masses, friction and brake against closed solutions.

use core::f64::consts::TAU;

use crate::common::{MICROSECOND, MILLISECOND, SECOND, assert_near, ideal};
use plant::{BrakeFailure, HoldingBrake, Load, Machine, MachineSettings, Mechanics};

fn with_mechanics(change: impl FnOnce(&mut Mechanics)) -> MachineSettings {
    let mut settings = ideal();
    change(&mut settings.mechanics);
    settings
}

fn with_load(load: Load) -> MachineSettings {
    with_mechanics(|m| m.load = Some(load))
}

fn with_brake() -> MachineSettings {
    let brake = Some(HoldingBrake { holding_torque: 9.0, release_delay: 0.040, engage_delay: 0.025 });
    MachineSettings { brake, ..ideal() }
}

#[test]
fn gravity_lets_a_machine_fall_freely() {
    let mut machine = Machine::new(with_mechanics(|m| m.gravity_torque = -2.0));
    // 2 Nm / 0.01 kg m²: 200 rad/s²
    assert_near(machine.velocity(SECOND / 2), -100.0, 1e-5);
    assert_near(machine.angle(SECOND / 2) * TAU, -25.0, 1e-5);
    assert_eq!(machine.load_angle(SECOND / 2), machine.angle(SECOND / 2), "one rigid mass");
    // A load on a shaft that gravity has wound up falls with the motor.
    let load = Load { inertia: 0.03, stiffness: 1_000.0, damping: 1.0, backlash: 0.0 };
    let settings = with_mechanics(|m| (m.load, m.gravity_torque) = (Some(load), -2.0));
    let mut machine = Machine::new(settings);
    assert_near(machine.load_angle(0) * TAU, -0.002, 1e-12);
    // 50 rad/s², and the shaft carries 0.5 Nm then
    assert_near(machine.velocity(SECOND), -50.0, 0.001);
    assert_near((machine.load_angle(SECOND) - machine.angle(SECOND)) * TAU, -0.000_5, 1e-9);
}

#[test]
fn friction_holds_brakes_and_never_drives() {
    let mut machine = Machine::new(with_mechanics(|m| m.coulomb_friction = 1.0));
    machine.set_load_torque(-0.99, 0);
    assert_eq!(machine.velocity(SECOND), 0.0);
    machine.set_load_torque(-1.5, SECOND);
    assert_near(machine.velocity(2 * SECOND), -50.0, 1e-5);
    machine.set_load_torque(0.0, 2 * SECOND);
    assert_near(machine.velocity(2 * SECOND + SECOND / 4), -25.0, 1e-5);
    let stands = machine.angle(3 * SECOND);
    assert_near(stands * TAU, -25.0 - 12.5, 0.001);
    assert_eq!(machine.angle(4 * SECOND), stands);

    let mut machine = Machine::new(with_mechanics(|m| m.viscous_friction = 0.1));
    machine.set_velocity(80.0, 0);
    assert_near(machine.velocity(SECOND / 10), 80.0 * (-1.0_f64).exp(), 1e-6);
}

#[test]
fn a_seized_shaft_stops_at_once_and_stays() {
    const UNIT: u64 = 100 * MILLISECOND;
    let load = Load { inertia: 0.03, stiffness: 1_000.0, damping: 0.0, backlash: 0.0 };
    let mut machine = Machine::new(with_load(load));
    machine.set_velocity(10.0, 0);
    machine.block(true, UNIT + 1_234);
    let stands = machine.angle(UNIT + 1_234);
    assert_near(stands * TAU, 1.000_012_34, 1e-6);
    assert_eq!(machine.velocity(UNIT + 1_234), 0.0);
    machine.set_velocity(10.0, 2 * UNIT);
    assert_eq!(machine.velocity(2 * UNIT), 0.0);
    assert_eq!(machine.angle(3 * UNIT), stands);
    machine.block(false, 3 * UNIT);
    machine.set_velocity(1.0, 3 * UNIT);
    assert_near(machine.angle(4 * UNIT) * TAU, stands * TAU + 0.1, 1e-6);
}

/// Mean distance of the instants at which the load passes its middle in positive direction, in seconds.
fn period_of(machine: &mut Machine, middle: impl Fn(&mut Machine, u64) -> f64, swings: usize) -> f64 {
    let step = 10 * MICROSECOND;
    let (mut at, mut crossings) = (0, Vec::new());
    let mut before = middle(machine, 0);
    while crossings.len() <= swings {
        let value = middle(machine, at + step);
        if before < 0.0 && value >= 0.0 {
            crossings.push((at as f64 - before / (value - before) * step as f64) * 1e-9);
        }
        (at, before) = (at + step, value);
        assert!(at < 10 * SECOND, "no swing");
    }
    (crossings[swings] - crossings[0]) / swings as f64
}

#[test]
fn two_masses_swing_at_their_resonance() {
    let load = Load { inertia: 0.03, stiffness: 40_000.0, damping: 0.0, backlash: 0.0 };
    let mut machine = Machine::new(with_load(load));
    machine.set_load_torque(4.0, 0);
    machine.set_load_torque(0.0, MILLISECOND);
    // Against each other: 40 000 * (1 / 0.01 + 1 / 0.03)
    let resonance = (40_000.0_f64 * (100.0 + 100.0 / 3.0)).sqrt();
    let twist = |machine: &mut Machine, at| machine.load_angle(at) - machine.angle(at);
    let at = 10 * MILLISECOND;
    let period = period_of(&mut machine, |machine, after| twist(machine, at + after), 200);
    assert_near(period * resonance / TAU, 1.0, 1e-5);
    // The load against the seized motor: 40 000 / 0.03
    let mut machine = Machine::new(with_load(load));
    machine.block(true, 0);
    machine.set_velocity(0.1, 0);
    let period = period_of(&mut machine, |machine, at| machine.load_angle(at), 200);
    assert_near(period * (40_000.0_f64 / 0.03).sqrt() / TAU, 1.0, 1e-5);
}

#[test]
fn a_damped_swing_decays_as_it_should_and_an_undamped_one_keeps_its_energy() {
    for damping in [0.0, 3.0] {
        let load = Load { inertia: 0.03, stiffness: 40_000.0, damping, backlash: 0.0 };
        let mut machine = Machine::new(with_load(load));
        machine.block(true, 0);
        machine.set_velocity(0.1, 0);
        let mut largest = |from: u64| {
            let angles = (0..1_000).map(|n| machine.load_angle(from + n * 10 * MICROSECOND) * TAU);
            angles.fold(0.0, f64::max)
        };
        let (first, later) = (largest(0), largest(100 * MILLISECOND));
        // exp(-d / 2 J t)
        let expected = (-damping / 0.06 * 0.1_f64).exp();
        assert_near(later / first, expected, 0.003);
    }
}

#[test]
fn the_load_falls_through_its_play_and_the_shaft_holds_it_behind() {
    let load = Load { inertia: 0.03, stiffness: 2_000.0, damping: 2.0, backlash: 0.01 };
    let mut machine = Machine::new(with_load(load));
    machine.set_load_torque(0.6, 0);
    // Half the play, 0.005 rad at 20 rad/s²: 22.4 ms in which the motor notices nothing.
    assert_near(machine.load_angle(20 * MILLISECOND) * TAU, 0.5 * 20.0 * 0.02 * 0.02, 1e-5);
    assert_eq!(machine.velocity(22 * MILLISECOND), 0.0);
    assert!(machine.velocity(24 * MILLISECOND) > 0.0);

    let mut machine = Machine::new(with_load(load));
    machine.block(true, 0);
    machine.set_load_torque(0.6, 0);
    let forth = machine.load_angle(SECOND / 2) * TAU;
    machine.set_load_torque(-0.6, SECOND / 2);
    let back = machine.load_angle(SECOND) * TAU;
    assert_near(forth, 0.005 + 0.6 / 2_000.0, 1e-6);
    assert_near(back, -0.005 - 0.6 / 2_000.0, 1e-6);
}

#[test]
fn a_shaft_with_play_pushes_and_never_pulls() {
    let load = Load { inertia: 0.03, stiffness: 2_000.0, damping: 50.0, backlash: 0.01 };
    for direction in [1.0, -1.0] {
        let mut machine = Machine::new(with_load(load));
        machine.block(true, 0);
        machine.set_load_torque(0.6 * direction, 0);
        machine.set_load_torque(-0.6 * direction, SECOND);
        // Wound up by 0.0003 rad, the load leaves its end at once: the strong damping must not hold it there.
        // 20 rad/s² through all the play of 0.01 rad: 31.6 ms
        let at = SECOND + 25 * MILLISECOND;
        let expected = direction * (0.0053 - 0.5 * 20.0 * 0.025 * 0.025);
        assert_near(machine.load_angle(at) * TAU, expected, 2e-4);
    }
}

#[test]
fn a_shaft_without_play_pulls_as_well() {
    // Poles at (-20 +- sqrt(20² - 4 * 0.03 * 1000)) / 0.06
    let load = Load { inertia: 0.03, stiffness: 1_000.0, damping: 20.0, backlash: 0.0 };
    let root = 280.0_f64.sqrt();
    let (slow, fast) = ((-20.0 + root) / 0.06, (-20.0 - root) / 0.06);
    for direction in [1.0, -1.0] {
        let mut machine = Machine::new(with_load(load));
        machine.block(true, 0);
        machine.set_load_torque(direction, 0);
        machine.set_load_torque(0.0, SECOND);
        let left = (fast * (slow * 0.04).exp() - slow * (fast * 0.04).exp()) / (fast - slow);
        assert_near(machine.load_angle(SECOND + 40 * MILLISECOND) * TAU, 0.001 * direction * left, 1e-6);
    }
}

#[test]
fn gravity_has_taken_up_the_play_at_the_start() {
    let load = Load { inertia: 0.03, stiffness: 1_000.0, damping: 1.0, backlash: 0.01 };
    let mut machine = Machine::new(with_mechanics(|m| (m.load, m.gravity_torque) = (Some(load), -2.0)));
    machine.block(true, 0);
    for at in [0, SECOND / 10] {
        assert_near(machine.load_angle(at) * TAU, -0.005 - 0.002, 1e-9);
    }
}

#[test]
fn the_brake_lets_go_and_grips_after_its_delays() {
    let mut machine = Machine::new(with_brake());
    assert!(machine.brake_holds(100 * MILLISECOND));
    machine.set_brake(true, 100 * MILLISECOND);
    assert_eq!(machine.brake_torque(139_900_000), 9.0);
    assert!(!machine.brake_holds(140_100_000));
    assert_near(machine.brake_torque(144 * MILLISECOND), 4.5, 1e-6);
    assert!(machine.brake_torque(147_900_000) > 0.0);
    assert_eq!(machine.brake_torque(148_100_000), 0.0);
    machine.set_brake(false, 200 * MILLISECOND);
    assert_eq!(machine.brake_torque(224_900_000), 0.0);
    assert_near(machine.brake_torque(226 * MILLISECOND), 1.8, 1e-6);
    assert!(!machine.brake_holds(229_900_000));
    assert!(machine.brake_holds(230_100_000));
    let mut without = Machine::new(ideal());
    assert!(!without.brake_holds(0));
    assert_eq!(without.brake_torque(0), 0.0);
}

#[test]
fn the_delays_of_the_brake_are_exact_beside_the_grid_and_whatever_else_happens() {
    let mut machine = Machine::new(with_brake());
    machine.set_brake(true, 1_234);
    machine.set_load_torque(0.1, 20 * MILLISECOND);
    assert_near(machine.brake_torque(44 * MILLISECOND + 1_234), 4.5, 1e-9);
}

#[test]
fn a_pulse_shorter_than_the_delay_does_not_move_the_brake() {
    let mut machine = Machine::new(with_brake());
    machine.set_brake(true, 0);
    machine.set_brake(false, 39 * MILLISECOND);
    for at in 0..200 {
        assert!(machine.brake_holds(at * MILLISECOND), "{at} ms");
    }
}

#[test]
fn the_brake_holds_what_it_can_and_rubs_beyond() {
    let mut machine = Machine::new(with_brake());
    machine.set_load_torque(-8.9, 0);
    assert_eq!(machine.velocity(SECOND), 0.0);
    // 1 Nm is left of 10: 100 rad/s²
    machine.set_load_torque(-10.0, SECOND);
    assert_near(machine.velocity(SECOND + SECOND / 10), -10.0, 1e-6);
    machine.set_load_torque(0.0, SECOND + SECOND / 10);
    assert_near(machine.velocity(SECOND + SECOND / 10 + 5 * MILLISECOND), -5.5, 1e-6);
    assert_eq!(machine.velocity(SECOND + SECOND / 10 + 12 * MILLISECOND), 0.0);
}

#[test]
fn a_released_axis_falls_until_the_brake_grips() {
    let mut settings = with_brake();
    settings.mechanics.gravity_torque = -1.5;
    let mut machine = Machine::new(settings);
    machine.set_brake(true, 0);
    machine.set_brake(false, 60 * MILLISECOND);
    assert_eq!(machine.angle(40 * MILLISECOND), 0.0);
    // It slips once 1.5 of 9 Nm are left, after 40 ms + 8 ms * 5/6 = 46.67 ms, and gains 150 rad/s² less the rest of the torque:
    // 75 rad/s² on average until 48 ms.
    let velocity = -75.0 * 0.008 / 6.0 - 150.0 * 0.037;
    assert_near(machine.velocity(85 * MILLISECOND), velocity, 1e-3);
    // The torque rises by 9 Nm in 5 ms.
    let gripping = |t: f64| velocity - 150.0 * t + 0.5 * 180_000.0 * t * t;
    assert_near(machine.velocity(88 * MILLISECOND), gripping(0.003), 3e-4);
    assert!(gripping(0.005) < 0.0);
    let stops = 0.090 - gripping(0.005) / 750.0;
    assert!(machine.velocity((stops * 1e9) as u64 - 100_000) < 0.0);
    assert_eq!(machine.velocity((stops * 1e9) as u64 + 100_000), 0.0);
}

#[test]
fn a_brake_fails_in_three_ways_and_can_be_repaired() {
    const UNIT: u64 = 100 * MILLISECOND;
    let mut machine = Machine::new(with_brake());
    machine.fail_brake(Some(BrakeFailure::StuckEngaged), 0);
    machine.set_brake(true, 0);
    assert!(machine.brake_holds(UNIT));
    machine.fail_brake(None, UNIT);
    assert!(machine.brake_holds(UNIT + 39 * MILLISECOND));
    assert_eq!(machine.brake_torque(UNIT + 49 * MILLISECOND), 0.0);
    machine.fail_brake(Some(BrakeFailure::StuckReleased), 2 * UNIT);
    machine.set_brake(false, 2 * UNIT);
    assert_eq!(machine.brake_torque(3 * UNIT), 0.0);
    machine.fail_brake(Some(BrakeFailure::Worn(0.2)), 3 * UNIT);
    assert!(machine.brake_holds(4 * UNIT));
    machine.set_load_torque(1.7, 4 * UNIT);
    assert_eq!(machine.velocity(5 * UNIT), 0.0);
    machine.set_load_torque(2.0, 5 * UNIT);
    assert_near(machine.velocity(6 * UNIT), 2.0, 1e-3);
}
