//! Currents and torque against closed solutions.

use core::f64::consts::TAU;

use crate::common::{BUS, MICROSECOND, MILLISECOND, SECOND, assert_near, duties, ideal, seized};
use plant::{HeatedBody, Inverter, Machine, MachineSettings, Mechanics, Saturation, Supply, Thermal, Windings};

fn with_windings(change: impl FnOnce(&mut Windings)) -> MachineSettings {
    let mut settings = ideal();
    change(&mut settings.windings);
    settings
}

#[test]
fn the_current_rises_as_in_any_coil_within_the_error_that_the_documentation_names() {
    for (resistance, part) in [(1.0, 2.1e-6), (5.0, 5.3e-5)] {
        let time_constant = 1e-3 / resistance;
        let mut machine = seized(with_windings(|w| w.resistance = resistance), 10.0, 0.0);
        let end = 10.0 / resistance;
        let mut largest: f64 = 0.0;
        for n in 1..1_000 {
            let at = n * 7_777;
            let [d, q] = machine.dq_currents(at);
            let expected = end * (1.0 - (-(at as f64 * 1e-9) / time_constant).exp());
            largest = largest.max((d - expected).abs() / end);
            assert_near(q, 0.0, 1e-9);
        }
        assert!(largest < 0.37 * part, "L / R of {time_constant} s: off by {largest}");
    }
}

#[test]
fn the_phases_carry_their_share_of_the_current() {
    let mut machine = seized(ideal(), 10.0, 0.0);
    let [a, b, c] = machine.phase_currents(20 * MILLISECOND);
    assert_near(a, 10.0, 1e-6);
    assert_near(b, -5.0, 1e-6);
    assert_near(c, -5.0, 1e-6);
    let mut machine = seized(ideal(), 0.0, 10.0);
    let [a, b, c] = machine.phase_currents(20 * MILLISECOND);
    assert_near(a, 0.0, 1e-6);
    assert_near(b, 8.660_254, 1e-6);
    assert_near(c, -8.660_254, 1e-6);
}

#[test]
fn the_axis_along_the_magnet_leads_the_encoder_as_set() {
    let mut settings = ideal();
    settings.encoder.electrical_zero += 0.02;
    // 0.02 revolutions are 0.08 electrical turns: a voltage on the first phase's axis lies behind the magnet.
    let mut machine = seized(settings, 10.0, 0.0);
    let [d, q] = machine.dq_currents(20 * MILLISECOND);
    assert_near(d, 10.0 * (0.08 * TAU).cos(), 1e-6);
    assert_near(q, -10.0 * (0.08 * TAU).sin(), 1e-6);
}

#[test]
fn shorted_windings_carry_the_current_of_the_textbook_at_constant_speed() {
    let mut settings = with_windings(|w| w.inductance_q = 2e-3);
    settings.mechanics.rotor_inertia = 1e9;
    let mut machine = Machine::new(settings);
    machine.set_bridge(true, 0);
    machine.set_velocity(-150.0, 0);
    let speed = -600.0;
    let [d, q] = machine.dq_currents(50 * MILLISECOND);
    let determinant = 1.0 + speed * speed * 1e-3 * 2e-3;
    assert_near(d, -speed * speed * 2e-3 * 0.1 / determinant, 1e-6);
    assert_near(q, -speed * 0.1 / determinant, 1e-6);
}

#[test]
fn a_rotating_voltage_gives_the_currents_of_the_voltage_equations() {
    let mut settings = with_windings(|w| w.inductance_q = 2e-3);
    settings.mechanics.rotor_inertia = 1e9;
    let mut machine = Machine::new(settings);
    machine.set_bridge(true, 0);
    machine.set_velocity(125.0, 0);
    let speed = 500.0;
    // vd = R id - w Lq iq, vq = R iq + w (Ld id + flux)
    let (d, q) = (-6.0_f64, 9.0_f64);
    let (voltage_d, voltage_q) = (d - speed * 2e-3 * q, q + speed * (1e-3 * d + 0.1));
    let lead = voltage_q.atan2(voltage_d) / TAU;
    let (period, mut sums) = (62_500, [0.0; 2]);
    for n in 0..1_600 {
        // Held for a period, the voltage is right in its middle.
        let middle = (n * period + period / 2) as f64 * 1e-9;
        machine.set_duties(duties(voltage_d.hypot(voltage_q), speed * middle / TAU + lead), n * period);
        if n >= 800 {
            for part in 0..25 {
                let currents = machine.dq_currents(n * period + part * 2_500);
                sums = [sums[0] + currents[0] / 20_000.0, sums[1] + currents[1] / 20_000.0];
            }
        }
    }
    assert_near(sums[0], d, 0.02);
    assert_near(sums[1], q, 0.02);
}

#[test]
fn the_torque_is_that_of_magnet_and_reluctance() {
    let settings = with_windings(|w| w.inductance_q = 3e-3);
    let mut machine = seized(settings, -5.0, 8.0);
    let [d, q] = machine.dq_currents(100 * MILLISECOND);
    assert_near(d, -5.0, 1e-6);
    assert_near(q, 8.0, 1e-6);
    // 1.5 * 4 * (0.1 * 8 + (0.001 - 0.003) * -5 * 8)
    assert_near(machine.torque(100 * MILLISECOND), 5.28, 1e-5);
    assert_near(settings.torque_constant(), 0.6, 1e-12);
}

#[test]
fn the_torque_accelerates_in_counting_direction() {
    let mut settings = ideal();
    settings.mechanics.rotor_inertia = 100.0;
    let mut machine = Machine::new(settings);
    machine.set_bridge(true, 0);
    machine.set_duties(duties(10.0, 0.25), 0);
    // 10 A * 0.6 Nm/A / 100 kg m², 1 ms late: 0.06 rad/s² for 0.099 s
    assert_near(machine.velocity(100 * MILLISECOND), 0.06 * 0.099, 1e-5);
}

#[test]
fn saturated_iron_links_less_flux() {
    let saturation = Some(Saturation { current: 10.0 });
    let mut settings = with_windings(|w| (w.resistance, w.saturation) = (0.0, saturation));
    settings.windings.inductance_q = 2e-3;
    let mut machine = seized(settings, 10.0, 0.0);
    for at in [200, 500, 800].map(|at| at * MICROSECOND) {
        // L i / sqrt(1 + (i / 10 A)²) = v t
        let unsaturated = 10.0 * at as f64 * 1e-9 / 1e-3;
        let expected = unsaturated / (1.0 - unsaturated * unsaturated / 100.0).sqrt();
        assert_near(machine.dq_currents(at)[0], expected, 0.000_3 * expected);
    }
    settings.windings.resistance = 1.0;
    let mut machine = seized(settings, 10.0, 10.0);
    // 1.5 * 4 * (0.1 + (0.001 - 0.002) / sqrt(2) * 10) * 10
    assert_near(machine.torque(100 * MILLISECOND), 5.575_736, 1e-5);
}

#[test]
fn a_speed_that_rises_evenly_induces_the_current_of_its_instant() {
    // Shorted windings of L / R = 10 us, driven with 10 000 rad/s² by what no torque of theirs slows down. While w L is far below R, the
    // current is -flux / R times the speed of L / R ago.
    let time_constant = 1e-5;
    let mut settings = with_windings(|w| (w.inductance_d, w.inductance_q) = (time_constant, time_constant));
    settings.mechanics.rotor_inertia = 1e6;
    let mut machine = Machine::new(settings);
    machine.set_bridge(true, 0);
    machine.set_load_torque(1e10, 0);
    let mut largest: f64 = 0.0;
    for n in 70..140 {
        let at = n * 14_321;
        let time = at as f64 * 1e-9;
        let speed = 4.0 * 1e4 * (time - time_constant * (1.0 - (-time / time_constant).exp()));
        let [_, q] = machine.dq_currents(at);
        largest = largest.max((q / (-0.1 * speed) - 1.0).abs());
    }
    assert!(largest < 1e-5, "{largest}");
}

#[test]
fn a_shaft_that_friction_has_stopped_induces_nothing_more() {
    // 1e6 rad/s²: it stands within the second step of 5 us.
    let mut settings = ideal();
    settings.mechanics.coulomb_friction = 1e4;
    let mut machine = Machine::new(settings);
    machine.set_bridge(true, 0);
    machine.set_velocity(7.5, 0);
    let [_, at_rest] = machine.dq_currents(10 * MICROSECOND);
    assert_eq!(machine.velocity(10 * MICROSECOND), 0.0);
    assert!(at_rest < -0.01, "{at_rest}");
    for after in [5, 50, 500] {
        let [_, q] = machine.dq_currents((10 + after) * MICROSECOND);
        assert_near(q / at_rest, (-(after as f64) * 1e-3).exp(), 1e-5);
    }
}

#[test]
fn a_short_circuit_turns_movement_into_heat_and_nothing_is_lost() {
    let mut settings = with_windings(|w| w.inductance_q = 1.5e-3);
    settings.mechanics.rotor_inertia = 0.002;
    settings.thermal.winding = HeatedBody { capacity: 0.5, resistance: 1e12 };
    let mut machine = Machine::new(settings);
    machine.set_bridge(true, 0);
    machine.set_velocity(200.0, 0);
    for at in [2, 5, 20, 60].map(|at| at * MILLISECOND) {
        let velocity = machine.velocity(at);
        let [d, q] = machine.dq_currents(at);
        let kinetic = 0.5 * 0.002 * velocity * velocity;
        let magnetic = 0.75 * (1e-3 * d * d + 1.5e-3 * q * q);
        let heat = 0.5 * (machine.winding_temperature(at) - 20.0);
        assert_near(kinetic + magnetic + heat, 0.5 * 0.002 * 200.0 * 200.0, 1e-5);
    }
    assert!(machine.velocity(60 * MILLISECOND) < 150.0, "it must have braked");
}

fn with_dead_time() -> MachineSettings {
    MachineSettings { inverter: Inverter { dead_time: 1e-6, period: 62.5e-6, voltage_drop: 1.5 }, ..ideal() }
}

#[test]
fn dead_time_and_voltage_drop_take_their_share_in_the_current_s_direction() {
    // Each phase loses 300 V * 1 / 62.5 + 1.5 V = 6.3 V: along the first phase 4/3 of that.
    for voltage in [20.0, -20.0] {
        let mut machine = seized(with_dead_time(), voltage, 0.0);
        let expected = voltage - 8.4 * f64::signum(voltage);
        assert_near(machine.dq_currents(20 * MILLISECOND)[0], expected, 1e-6);
    }
    // Duties that give the loss back where the current flows make up for it.
    let mut machine = seized(with_dead_time(), 20.0, 0.0);
    let [a, b, c] = duties(20.0, 0.0);
    let lost = 6.3 / BUS;
    machine.set_duties([a + lost, b - lost, c - lost], 0);
    assert_near(machine.dq_currents(20 * MILLISECOND)[0], 20.0, 1e-6);
}

#[test]
fn a_small_current_meets_the_dead_time_as_a_resistance() {
    // 6.3 V within 50 mA: 126 ohm in series with 1 ohm.
    let mut machine = seized(with_dead_time(), 3.0, 0.0);
    assert_near(machine.dq_currents(20 * MILLISECOND)[0], 3.0 / 127.0, 1e-6);
}

#[test]
fn a_phase_that_does_not_switch_has_no_dead_time() {
    let mut settings = with_dead_time();
    settings.inverter.voltage_drop = 0.0;
    settings.windings.resistance = 20.0;
    let mut machine = seized(settings, 0.0, 0.0);
    machine.set_duties([1.0, 0.0, 0.0], 0);
    // 2/3 of the bus, less nothing
    assert_near(machine.dq_currents(20 * MILLISECOND)[0], 10.0, 1e-6);
    machine.set_duties([2.0, -1.0, -7.0], 20 * MILLISECOND);
    assert_near(machine.dq_currents(40 * MILLISECOND)[0], 10.0, 1e-6);
}

#[test]
fn an_open_bridge_lets_the_current_run_out_against_the_bus() {
    for (turns, index) in [(0.0, 0), (0.5, 0)] {
        let mut machine = seized(ideal(), 0.0, 0.0);
        machine.set_duties(duties(10.0, turns), 0);
        machine.set_bridge(false, 20 * MILLISECOND);
        let start = 10.0 * (turns * TAU).cos();
        // -2/3 bus - R i: with 1 ms towards -+200 A, through zero after 1 ms * ln(210 / 200) = 48.8 us
        let after = |time: f64| start.signum() * (210.0 * (-time / 1e-3_f64).exp() - 200.0);
        for microseconds in [5, 20, 40] {
            let at = 20 * MILLISECOND + microseconds * MICROSECOND;
            assert_near(machine.dq_currents(at)[index], after(microseconds as f64 * 1e-6), 1e-3);
        }
        for microseconds in [55, 70, 1_000] {
            let at = 20 * MILLISECOND + microseconds * MICROSECOND;
            assert!(machine.phase_currents(at).iter().all(|current| current.abs() < 1e-3));
        }
    }
}

#[test]
fn an_uneven_current_runs_out_phase_by_phase() {
    // At 0.05 turns the second phase carries least and is empty first; the others then share the line voltage: -bus / 2 per phase.
    let mut settings = ideal();
    settings.windings.resistance = 0.0;
    let mut machine = seized(settings, 0.0, 0.0);
    machine.set_duties(duties(10.0, 0.05), 0);
    machine.set_duties([0.5; 3], MILLISECOND);
    let [a, b, c] = machine.phase_currents(MILLISECOND);
    assert!(a > 9.0 && b < -1.0 && c < b - 1.0, "{a} {b} {c}");
    machine.set_bridge(false, MILLISECOND);
    // a falls with 2/3 bus / L, b and c rise with 1/3 bus / L.
    let (fast, slow) = (2.0 / 3.0 * BUS / 1e-3, BUS / 3.0 / 1e-3);
    let first = -b / slow;
    let rest = a - fast * first;
    let whole = first + rest / (0.5 * BUS / 1e-3);
    let at = |seconds: f64| MILLISECOND + (seconds * 1e9) as u64;
    assert_near(machine.phase_currents(at(first))[0], rest, 0.05);
    let half = 0.5 * (first + whole);
    assert_near(machine.phase_currents(at(half))[0], 0.5 * rest, 0.15);
    assert!(machine.phase_currents(at(whole) + 10_000).iter().all(|current| current.abs() < 1e-3));
}

#[test]
fn what_the_coils_hold_goes_into_the_bus() {
    let mut settings = ideal();
    settings.supply = Supply { voltage: BUS, resistance: 0.1, capacitance: 1e-4, chopper: None, resistor: None };
    settings.windings.resistance = 0.0;
    let mut machine = seized(settings, 20.0, 0.0);
    machine.set_bridge(false, MILLISECOND);
    let (before, [current, _]) = (machine.bus_voltage(MILLISECOND), machine.dq_currents(MILLISECOND));
    let after = machine.bus_voltage(2 * MILLISECOND);
    let taken = 0.5 * 1e-4 * (after * after - before * before);
    let held = 0.75 * 1e-3 * current * current;
    assert!(held > 0.2, "{held} J");
    assert_near(taken, held, 0.02 * held);
}

#[test]
fn an_emf_above_the_bus_charges_it_through_the_diodes_and_one_below_does_not() {
    let mut settings = with_windings(|w| w.resistance = 2.0);
    settings.mechanics.rotor_inertia = 1e6;
    settings.supply = Supply { voltage: BUS, resistance: 0.1, capacitance: 1e-3, chopper: None, resistor: None };
    let machine_at = |line_voltage: f64| {
        let mut machine = Machine::new(settings);
        machine.set_velocity(line_voltage / (3.0_f64.sqrt() * 4.0 * 0.1), 0);
        machine.set_supply(0.0, 0);
        machine
    };
    let mut below = machine_at(290.0);
    assert_near(below.bus_voltage(SECOND / 2), BUS, 0.1);
    assert!(below.torque(SECOND / 2).abs() < 1e-3, "it must turn freely");
    let mut above = machine_at(360.0);
    assert!(above.torque(MILLISECOND) < -0.1, "charging must brake");
    assert_near(above.bus_voltage(SECOND / 2), 360.0, 2.0);
}

#[test]
fn a_voltage_from_the_bus_costs_the_supply_what_the_windings_burn() {
    let mut settings = ideal();
    settings.supply = Supply { voltage: BUS, resistance: 2.0, capacitance: 1e-4, chopper: None, resistor: None };
    let mut machine = seized(settings, 50.0, 0.0);
    let at = 100 * MILLISECOND;
    let (bus, [current, _]) = (machine.bus_voltage(at), machine.dq_currents(at));
    assert_near(current, 50.0 * bus / BUS, 1e-6);
    let supplied = bus * (BUS - bus) / 2.0;
    assert_near(supplied, 1.5 * current * current, 0.001 * supplied);
    assert!(bus < 290.0);
}

#[test]
fn copper_resists_more_when_it_is_warm() {
    let mut settings = ideal();
    settings.thermal = Thermal { ambient: 120.0, ..settings.thermal };
    let mut machine = seized(settings, 10.0, 0.0);
    assert_near(machine.dq_currents(20 * MILLISECOND)[0], 10.0 / 1.393, 1e-6);
}

#[test]
fn the_rotor_swings_into_the_field_of_a_standing_current() {
    // A small swing about the field of 10 A along the first phase: 1.5 p flux i sin(p angle) over J.
    let mut settings = ideal();
    settings.encoder.electrical_zero += 0.002;
    settings.mechanics = Mechanics { rotor_inertia: 0.1, ..settings.mechanics };
    settings.windings.inductance_d = 1e-5;
    settings.windings.inductance_q = 1e-5;
    let mut machine = Machine::new(settings);
    machine.set_bridge(true, 0);
    machine.set_duties(duties(10.0, 0.0), 0);
    // sqrt(6 * 0.1 * 10 * 4 / 0.1) = 15.49 rad/s: after half a swing it is as far on the other side, less what the EMF has damped.
    let half = (core::f64::consts::PI / 240.0_f64.sqrt() * 1e9) as u64;
    let swing = machine.angle(half);
    assert!((-0.004..-0.003).contains(&swing), "{swing}");
    // The velocity feeds 1.5 * (4 * 0.1)² / R = 0.24 Nm s/rad back: damping ratio 0.24 / (2 * 0.1 * 15.49)
    let ratio: f64 = 0.24 / (2.0 * 0.1 * 240.0_f64.sqrt());
    let overshoot = (-core::f64::consts::PI * ratio / (1.0 - ratio * ratio).sqrt()).exp();
    assert_near(swing, -0.002 * (1.0 + overshoot), 2e-5);
}
