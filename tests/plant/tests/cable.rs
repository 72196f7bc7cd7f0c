//! Bad contacts, broken cores, earth faults and swapped phases against the circuits of the textbook.

use crate::common::{BUS, MICROSECOND, MILLISECOND, SECOND, assert_near, duties, ideal, seized};
use plant::{EarthFault, Machine, Supply, Wiring};

#[test]
fn a_bad_contact_is_a_resistance_in_its_phase_alone() {
    // The first phase with 2 ohm in series with the two others of 1 ohm and 1 mH side by side: 15 V at 2.5 ohm and 1.5 mH.
    let mut machine = seized(ideal(), 10.0, 0.0);
    machine.set_contact_resistances([1.0, 0.0, 0.0], 0);
    for microseconds in [100, 600, 5_000] {
        let [a, b, c] = machine.phase_currents(microseconds * MICROSECOND);
        let expected = 6.0 * (1.0 - (-(microseconds as f64) * 1e-6 / 0.6e-3).exp());
        assert_near(a, expected, 2e-5);
        assert_near(b, -0.5 * expected, 1e-5);
        assert_near(c, -0.5 * expected, 1e-5);
    }
    // A step across it meets only the others.
    let mut machine = seized(ideal(), 0.0, 10.0);
    machine.set_contact_resistances([1.0, 0.0, 0.0], 0);
    assert_near(machine.phase_currents(20 * MILLISECOND)[1], 8.660_254, 1e-6);
    machine.set_contact_resistances([0.0; 3], 20 * MILLISECOND);
    machine.set_duties(duties(10.0, 0.0), 20 * MILLISECOND);
    assert_near(machine.phase_currents(40 * MILLISECOND)[0], 10.0, 1e-6);
}

#[test]
fn without_a_phase_the_other_two_are_one_coil() {
    let mut machine = seized(ideal(), 0.0, 0.0);
    machine.open_phase(0, true, 0);
    // 12 V between the others: 2 ohm, 2 mH.
    machine.set_duties([0.9, 0.5 + 6.0 / BUS, 0.5 - 6.0 / BUS], 0);
    for microseconds in [100, 1_000, 20_000] {
        let [a, b, c] = machine.phase_currents(microseconds * MICROSECOND);
        let expected = 6.0 * (1.0 - (-(microseconds as f64) * 1e-6 / 1e-3).exp());
        assert_near(a, 0.0, 1e-5);
        assert_near(b, expected, 1e-5);
        assert_near(c, -expected, 1e-5);
    }
}

#[test]
fn a_core_that_breaks_ends_its_current_at_once_and_one_that_is_joined_carries_it_again() {
    for bridge in [true, false] {
        let mut machine = seized(ideal(), 10.0, 0.0);
        let at = 20 * MILLISECOND;
        machine.open_phase(0, true, at);
        machine.set_bridge(bridge, at);
        let [a, b, c] = machine.phase_currents(at + 10 * MICROSECOND);
        assert_near(a, 0.0, 1e-5);
        // Nothing drives one of the others more than the other.
        assert_near(b, 0.0, 1e-5);
        assert_near(c, 0.0, 1e-5);
        machine.open_phase(0, false, 2 * at);
        machine.set_bridge(true, 2 * at);
        assert_near(machine.phase_currents(3 * at)[0], 10.0, 1e-6);
    }
    // Seen by the sensors, too: 100 counts per A.
    let mut machine = seized(ideal(), 0.0, 8.0);
    machine.open_phase(1, true, 0);
    let [a, b, c] = machine.current_samples(20 * MILLISECOND).map(|sample| i32::from(sample) - 2_048);
    // 4 * sqrt(3) V over the remaining two of 2 ohm.
    assert_eq!((a, b, c), (346, 0, -346));
}

/// An earth fault of the first leg.
fn earth(resistance: f64, inductance: f64) -> Option<(usize, EarthFault)> {
    Some((0, EarthFault { resistance, inductance }))
}

#[test]
fn an_earth_fault_draws_its_current_from_the_bus_while_its_leg_is_high() {
    for share in [0.0, 0.3, 1.0] {
        let mut settings = ideal();
        settings.supply = Supply { voltage: BUS, resistance: 2.0, capacitance: 1e-4, chopper: None, resistor: None };
        let mut machine = seized(settings, 0.0, 0.0);
        machine.set_duties([share; 3], 0);
        machine.fail_to_earth(earth(100.0, 0.0), 0);
        let bus = machine.bus_voltage(100 * MILLISECOND);
        assert_near((BUS - bus) / 2.0, share * bus / 100.0, 1e-6);
        assert_near(machine.phase_currents(100 * MILLISECOND)[0], 0.0, 1e-9);
        machine.fail_to_earth(None, 100 * MILLISECOND);
        assert_near(machine.bus_voltage(200 * MILLISECOND), BUS, 1e-3);
    }
}

/// Current of a coil that is switched between the bus and nothing, in the middle of its time at nothing, after many periods.
fn switched_coil(resistance: f64, inductance: f64, share: f64) -> f64 {
    let (steps, period) = (62_500, 62.5e-6);
    let dt = period / f64::from(steps);
    let (mut current, mut found) = (0.0, 0.0);
    for _ in 0..40 {
        for n in 0..steps {
            // High in the middle of the period.
            let part = f64::from(n) / f64::from(steps);
            let high = (part - 0.5).abs() < 0.5 * share;
            if n == 0 {
                found = current;
            }
            current += (if high { BUS } else { 0.0 } - resistance * current) / inductance * dt;
        }
    }
    found
}

#[test]
fn a_sensor_sees_of_an_earth_fault_what_its_inductance_holds_up_while_the_leg_is_low() {
    for (resistance, inductance, share) in [(20.0, 1e-3, 0.5), (20.0, 2e-3, 0.8), (200.0, 1e-3, 0.9), (20.0, 0.0, 0.7)]
    {
        let mut machine = seized(ideal(), 0.0, 0.0);
        machine.set_duties([share; 3], 0);
        machine.fail_to_earth(earth(resistance, inductance), 0);
        let [a, b, c] = machine.current_samples(20 * MILLISECOND).map(|sample| f64::from(sample) - 2_048.0);
        let expected = if inductance == 0.0 { 0.0 } else { switched_coil(resistance, inductance, share) };
        assert_near(a, 100.0 * expected, 0.6);
        assert_eq!((b, c), (0.0, 0.0));
    }
    let mut machine = seized(ideal(), 0.0, 0.0);
    machine.set_duties([1.0; 3], 0);
    machine.fail_to_earth(earth(20.0, 1e-3), 0);
    assert_eq!(
        machine.current_samples(20 * MILLISECOND)[0],
        2_048 + 1_500,
        "a leg that never is low feeds it all the time"
    );
}

#[test]
fn an_earth_fault_brakes_a_motor_with_an_open_bridge_through_the_lower_diodes() {
    // Coils without weight on the time: 10 us. The EMF of 20 V drives its current out of the first phase through the fault of 3 ohm, and
    // back through the lower diodes of the two others.
    let mut settings = ideal();
    (settings.windings.inductance_d, settings.windings.inductance_q) = (1e-5, 1e-5);
    settings.mechanics.rotor_inertia = 1e6;
    settings.supply.capacitance = 1e-3;
    let mut machine = Machine::new(settings);
    machine.set_velocity(-50.0, 0);
    machine.fail_to_earth(earth(3.0, 0.0), 0);
    // -200 rad/s: the EMF of the first phase, -speed * flux * sin(angle), has its maximum after three quarters of a turn.
    let turn = SECOND as f64 * core::f64::consts::TAU / 200.0;
    let at = |turns: f64| (turns * turn) as u64;
    for turns in [0.75, 1.75, 5.75] {
        let [a, b, c] = machine.phase_currents(at(turns));
        // EMF 20 V against -10 V of the others: 30 V at 3 + 1 + 0.5 ohm.
        assert_near(a, -30.0 / 4.5, 0.02);
        assert_near(b + c, -a, 1e-9);
        // Nothing flows through the leg itself and its sensor.
        assert_near(f64::from(machine.current_samples(at(turns))[0]), 2_048.0, 1.0);
        assert!(machine.torque(at(turns)) > 0.1, "it brakes");
    }
    for turns in [6.25, 7.25] {
        let [a, _, _] = machine.phase_currents(at(turns));
        assert_near(a, 0.0, 1e-4);
    }
    // Current and heat go past the bus, which nobody feeds: within these turns the fault makes some 50 J of heat, and the bus holds 45 J.
    machine.set_supply(0.0, at(8.0));
    let before = machine.bus_voltage(at(8.0));
    assert_near(machine.bus_voltage(at(40.0)), before, 0.01);
    // What is behind a broken core does not drain it either.
    machine.open_phase(0, true, at(40.0));
    assert_near(machine.bus_voltage(at(80.0)), before, 0.01);
    let mut sound = Machine::new(settings);
    sound.set_velocity(-50.0, 0);
    assert_near(sound.torque(at(5.75)), 0.0, 1e-6);
}

#[test]
fn swapped_phases_turn_the_field_the_other_way_and_the_sensors_are_the_legs() {
    let wired = |wiring, voltage_d, voltage_q| {
        let mut settings = ideal();
        settings.effects.wiring = Some(wiring);
        let mut machine = seized(settings, voltage_d, voltage_q);
        let [d, q] = machine.dq_currents(20 * MILLISECOND);
        (d, q, machine.current_samples(20 * MILLISECOND))
    };
    let (d, q, samples) = wired(Wiring::swapped(1, 2), 3.0, 8.0);
    assert_near(d, 3.0, 1e-6);
    assert_near(q, -8.0, 1e-6);
    assert_eq!(samples, seized(ideal(), 3.0, 8.0).current_samples(20 * MILLISECOND));
    // The field of the first leg is that of the second winding, a third of a turn ahead.
    let (d, q, samples) = wired(Wiring::turned_on(), 8.0, 0.0);
    assert_near(d, -4.0, 1e-6);
    assert_near(q, 6.928_203, 1e-6);
    assert_eq!(samples, [2_848, 1_648, 1_648]);
}

#[test]
#[should_panic(expected = "the resistance of an earth fault must be positive")]
fn an_earth_fault_without_resistance_makes_no_sense() {
    seized(ideal(), 0.0, 0.0).fail_to_earth(earth(0.0, 0.0), 0);
}

#[test]
fn a_glance_tells_of_a_broken_cable() {
    let mut machine = Machine::new(ideal());
    machine.open_phase(2, true, MILLISECOND);
    machine.open_phase(2, false, 2 * MILLISECOND);
    machine.set_contact_resistances([0.0, 0.1, 0.0], 3 * MILLISECOND);
    machine.set_contact_resistances([0.0; 3], 4 * MILLISECOND);
    machine.fail_to_earth(earth(10.0, 0.0), 5 * MILLISECOND);
    for (at, broken) in [(0, false), (1, true), (2, false), (3, true), (4, false), (5, true)] {
        assert_eq!(machine.glance(at * MILLISECOND).cable_broken, broken, "{at} ms");
    }
}
