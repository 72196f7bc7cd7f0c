//! Static friction: sticking, breaking away, and the Stribeck curve.

use crate::common::{MICROSECOND, MILLISECOND, SECOND, assert_near, ideal};
use plant::{HoldingBrake, Load, Machine, MachineSettings, Stiction};

const COULOMB: f64 = 1.0;
const STATIC: f64 = 1.5;
const STRIBECK: f64 = 0.4;

fn with_stiction() -> MachineSettings {
    let mut settings = ideal();
    settings.mechanics.coulomb_friction = COULOMB;
    settings.mechanics.viscous_friction = 0.05;
    settings.effects.stiction = Some(Stiction { static_torque: STATIC, stribeck_velocity: STRIBECK });
    settings
}

#[test]
fn a_shaft_that_sticks_does_not_creep_under_any_torque_below_the_static_one() {
    let mut machine = Machine::new(with_stiction());
    for n in 0..10_000 {
        let torque = if n % 2 == 0 { 1.499 } else { -1.2 };
        machine.set_load_torque(torque, n * MILLISECOND);
    }
    for n in 0..100 {
        let at = n * 100 * MILLISECOND + 333 * MICROSECOND;
        assert_eq!((machine.angle(at), machine.velocity(at)), (0.0, 0.0));
    }
    // It breaks away with what is left beyond the static torque, and rubs less from there.
    machine.set_load_torque(1.501, 10 * SECOND);
    let first = machine.velocity(10 * SECOND + MILLISECOND);
    assert!(first > 0.0, "{first}");
    assert!(machine.velocity(11 * SECOND) > 5.0);
}

#[test]
fn friction_at_a_velocity_is_that_of_the_stribeck_curve() {
    for velocity in [0.05, 0.2, 0.4, 0.8, 3.0, -0.2] {
        let mut settings = with_stiction();
        settings.mechanics.rotor_inertia = 10.0;
        let mut machine = Machine::new(settings);
        machine.set_velocity(velocity, 0);
        let at = 100 * MICROSECOND;
        let torque = (machine.velocity(at) - velocity) * 10.0 / 100e-6;
        let size = f64::abs(velocity);
        let surplus = 0.5 * (-(size / STRIBECK) * (size / STRIBECK)).exp();
        assert_near(torque, -(COULOMB + surplus + 0.05 * size) * velocity.signum(), 1e-4);
    }
}

#[test]
fn a_shaft_that_comes_to_rest_sticks_again() {
    let mut machine = Machine::new(with_stiction());
    machine.set_velocity(1.0, 0);
    machine.set_load_torque(-1.4, 0);
    let stands = machine.angle(SECOND);
    assert!(stands > 0.0);
    assert_eq!((machine.velocity(SECOND), machine.angle(9 * SECOND)), (0.0, stands));
    machine.set_load_torque(-1.501, 9 * SECOND);
    assert!(machine.angle(10 * SECOND) < stands);
    // Without stiction the same torque would have turned it back.
    let mut settings = with_stiction();
    settings.effects.stiction = None;
    let mut slides = Machine::new(settings);
    slides.set_velocity(1.0, 0);
    slides.set_load_torque(-1.4, 0);
    assert!(slides.velocity(SECOND) < -1.0);
}

#[test]
fn a_shaft_sticks_while_its_load_swings() {
    let mut settings = with_stiction();
    settings.mechanics.load = Some(Load { inertia: 0.01, stiffness: 1_000.0, damping: 0.0, backlash: 0.0 });
    let mut machine = Machine::new(settings);
    // It winds the shaft up to twice this.
    machine.set_load_torque(0.74, 0);
    let mut largest: f64 = 0.0;
    for n in 0..1_000 {
        let at = n * MILLISECOND;
        assert_eq!((machine.angle(at), machine.velocity(at)), (0.0, 0.0));
        largest = largest.max(machine.load_angle(at));
    }
    assert_near(largest * core::f64::consts::TAU, 2.0 * 0.74 / 1_000.0, 1e-5);
}

#[test]
fn the_brake_holds_beside_it_and_a_static_torque_below_coulomb_friction_is_none() {
    let mut settings = with_stiction();
    settings.brake = Some(HoldingBrake { holding_torque: 9.0, release_delay: 0.0, engage_delay: 0.0 });
    for (torque, moves) in [(10.49, false), (10.51, true)] {
        let mut machine = Machine::new(settings);
        machine.set_load_torque(torque, 0);
        assert_eq!(machine.velocity(SECOND) > 0.0, moves, "{torque} Nm");
    }
    let run = |stiction| {
        let mut settings = with_stiction();
        settings.effects.stiction = stiction;
        let mut machine = Machine::new(settings);
        machine.set_load_torque(1.01, 0);
        machine.velocity(SECOND)
    };
    let below = Stiction { static_torque: 0.5, stribeck_velocity: STRIBECK };
    assert_eq!(run(Some(below)), run(None));
    assert!(run(None) > 0.1);
}
