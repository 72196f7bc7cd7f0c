//! The capacitance of a leg against the waveform of its voltage.

use crate::common::{BUS, MILLISECOND, assert_near, ideal, seized};
use plant::{Inverter, LegCapacitance, Machine, MachineSettings};

const DEAD_TIME: f64 = 1e-6;
const PERIOD: f64 = 62.5e-6;

fn with_capacitance(farads: f64) -> MachineSettings {
    let mut settings = ideal();
    settings.inverter = Inverter { dead_time: DEAD_TIME, period: PERIOD, voltage_drop: 0.0 };
    settings.effects.leg_capacitance = Some(LegCapacitance { farads });
    settings
}

/// What a leg's mean voltage lacks at a current into the motor: its waveform in the two dead times, step by step.
fn lost(farads: f64, current: f64) -> f64 {
    let steps = 100_000;
    let dt = DEAD_TIME / f64::from(steps);
    // After the high transistor has opened, the current takes the charge; before it closes, the lower diode conducts.
    let (mut voltage, mut area) = (BUS, 0.0);
    for _ in 0..steps {
        let next = (voltage - current / farads * dt).max(0.0);
        area += 0.5 * (voltage + next) * dt;
        voltage = next;
    }
    (BUS * DEAD_TIME - area) / PERIOD
}

#[test]
fn what_a_period_loses_is_the_area_below_the_slewing_voltage() {
    // 10 nF: 3 A bring 300 V down within 1 us.
    for voltage in [0.5, 2.0, 4.0, 8.0, 12.0, 20.0, -12.0] {
        let mut machine = seized(with_capacitance(10e-9), voltage, 0.0);
        let [current, _] = machine.dq_currents(50 * MILLISECOND);
        // Out of the first phase, back through the two others: 2/3 (lost(i) + lost(i / 2)) along the first phase.
        let size = current.abs();
        let expected = voltage.abs() - 2.0 / 3.0 * (lost(10e-9, size) + lost(10e-9, 0.5 * size));
        assert_near(size, expected, 2e-4);
        assert_near(current, size * voltage.signum(), 0.0);
    }
}

#[test]
fn a_small_current_meets_a_resistance_and_a_large_one_loses_all_but_a_part_that_falls_with_it() {
    // Below 3 A: 4.8 V / (2 * 3 A) = 0.8 ohm in series with 1 ohm.
    let mut machine = seized(with_capacitance(10e-9), 1.0, 0.0);
    assert_near(machine.dq_currents(50 * MILLISECOND)[0], 1.0 / 1.8, 1e-6);
    // 10 A: 4.8 V less 15 % in the first phase, less 30 % in the others.
    let voltage = 10.0 + 3.2 * (0.85 + 0.7);
    let mut machine = seized(with_capacitance(10e-9), voltage, 0.0);
    assert_near(machine.dq_currents(50 * MILLISECOND)[0], 10.0, 1e-6);
}

#[test]
fn a_capacitance_of_next_to_nothing_leaves_the_dead_time_as_it_is() {
    let mut with = seized(with_capacitance(1e-15), 20.0, 0.0);
    let mut without = {
        let mut settings = with_capacitance(1e-15);
        settings.effects.leg_capacitance = None;
        seized(settings, 20.0, 0.0)
    };
    let at = 50 * MILLISECOND;
    assert_near(with.dq_currents(at)[0], without.dq_currents(at)[0], 0.02);
}

#[test]
fn a_bridge_that_stands_open_and_one_without_dead_time_do_not_slew() {
    for (dead_time, bridge) in [(DEAD_TIME, false), (0.0, true)] {
        let run = |capacitance| {
            let mut settings = with_capacitance(10e-9);
            settings.inverter.dead_time = dead_time;
            settings.effects.leg_capacitance = capacitance;
            settings.mechanics.rotor_inertia = 1e6;
            let mut machine = Machine::new(settings);
            machine.set_bridge(bridge, 0);
            // Of 346 V between two phases 300 go against the bus.
            machine.set_velocity(500.0, 0);
            machine.dq_currents(10 * MILLISECOND)
        };
        let (with, without) = (run(Some(LegCapacitance { farads: 10e-9 })), run(None));
        assert!(without[1] < -5.0, "{without:?}");
        assert_near(with[0], without[0], 1e-6);
        assert_near(with[1], without[1], 1e-6);
    }
}
