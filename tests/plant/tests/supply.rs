//! Bus voltage, chopper and heat against closed solutions.

use crate::common::{BUS, MILLISECOND, SECOND, assert_near, ideal, seized};
use plant::{Chopper, HeatedBody, Inverter, Machine, MachineSettings, Supply, Thermal};

/// 2 ohm and 1 mF: 2 ms. The chopper's 50 ohm: 50 ms.
fn with_chopper() -> MachineSettings {
    let chopper = Some(Chopper { on_above: 390.0, off_below: 380.0, resistance: 50.0 });
    MachineSettings {
        supply: Supply { voltage: BUS, resistance: 2.0, capacitance: 1e-3, chopper, resistor: None },
        ..ideal()
    }
}

#[test]
fn the_rectifier_charges_the_bus_and_takes_nothing_back() {
    let mut machine = Machine::new(with_chopper());
    assert_eq!(machine.bus_voltage(SECOND / 10), BUS);
    machine.set_supply(320.0, SECOND / 10);
    for at in [1, 2, 5].map(|at| at * MILLISECOND) {
        let expected = 320.0 - 20.0 * (-(at as f64) / 2e6).exp();
        assert_near(machine.bus_voltage(SECOND / 10 + at), expected, 1e-4);
    }
    machine.set_supply(200.0, SECOND / 5);
    assert_near(machine.bus_voltage(SECOND / 4), 320.0, 1e-3);
}

#[test]
fn the_bus_runs_down_with_the_mains_off() {
    let mut settings = with_chopper();
    settings.inverter = Inverter { voltage_drop: 2.0, ..settings.inverter };
    let mut machine = seized(settings, 50.0, 0.0);
    machine.set_supply(0.0, 20 * MILLISECOND);
    // A constant share of the bus voltage drives the windings: what they burn halves the bus again and again.
    let energy = |machine: &mut Machine, at| 0.5e-3 * machine.bus_voltage(at) * machine.bus_voltage(at);
    let before = energy(&mut machine, 20 * MILLISECOND);
    let start = machine.dq_currents(20 * MILLISECOND)[0];
    let (mut burnt, step) = (0.0, 10_000);
    for at in (20 * MILLISECOND..40 * MILLISECOND).step_by(step) {
        let current = machine.dq_currents(at + step as u64 / 2)[0];
        // Along the first phase the others carry half each: the drops take 2 V * 2 |i|.
        burnt += (1.5 * current * current + 4.0 * current) * step as f64 * 1e-9;
    }
    let after = energy(&mut machine, 40 * MILLISECOND);
    assert!(after < 0.5 * before);
    let end = machine.dq_currents(40 * MILLISECOND)[0];
    let released = 0.75e-3 * (start * start - end * end);
    assert_near(before - after + released, burnt, 0.002 * burnt);
}

#[test]
fn a_bus_that_runs_empty_does_not_turn_negative() {
    let mut settings = with_chopper();
    settings.windings.resistance = 0.05;
    let mut machine = seized(settings, 100.0, 0.0);
    machine.set_supply(0.0, MILLISECOND);
    // Coils and capacitor would swing within milliseconds; the diodes of the bridge let the current flow on at 0 V.
    let voltages: Vec<f64> = (100..1_000).map(|n| machine.bus_voltage(n * 10_000)).collect();
    let lowest = voltages.iter().copied().fold(f64::INFINITY, f64::min);
    assert_eq!(lowest, 0.0);
    assert!(machine.dq_currents(10 * MILLISECOND)[0] > 10.0);
}

#[test]
fn the_chopper_burns_from_its_upper_limit_down_to_its_lower() {
    let mut machine = Machine::new(with_chopper());
    machine.set_supply(385.0, 0);
    assert_near(machine.bus_voltage(SECOND / 10), 385.0, 1e-3);
    // Mains above the limit: 50 ohm against 2 ohm.
    machine.set_supply(400.0, SECOND / 10);
    assert_near(machine.bus_voltage(SECOND / 5), 400.0 * 50.0 / 52.0, 1e-3);
    machine.set_supply(0.0, SECOND / 5);
    let start = 400.0 * 50.0 / 52.0;
    let expected = start * (-0.4e-3_f64 / 50e-3).exp();
    assert!(expected > 380.0);
    assert_near(machine.bus_voltage(SECOND / 5 + 400_000), expected, 1e-3);
    let left = machine.bus_voltage(SECOND / 2);
    assert!((379.95..=380.0).contains(&left), "{left}");
}

#[test]
fn a_motor_that_is_driven_keeps_the_bus_between_the_chopper_s_limits() {
    let mut settings = with_chopper();
    settings.mechanics.rotor_inertia = 1e6;
    settings.windings.resistance = 2.0;
    settings.supply.chopper = Some(Chopper { on_above: 390.0, off_below: 380.0, resistance: 10.0 });
    // 500 V behind 4 ohm charge beyond the upper limit; against 10 ohm they hold no more than 360 V.
    let mut machine = Machine::new(settings);
    machine.set_velocity(500.0 / (3.0_f64.sqrt() * 0.4), 0);
    let voltages: Vec<f64> = (0..20_000).map(|n| machine.bus_voltage(SECOND / 10 + n * 10_000)).collect();
    let lowest = voltages.iter().copied().fold(f64::INFINITY, f64::min);
    let highest = voltages.iter().copied().fold(0.0, f64::max);
    assert_near(lowest, 380.0, 0.5);
    assert_near(highest, 390.0, 0.5);
}

#[test]
fn the_heat_sink_warms_up_with_its_time_constant() {
    let mut settings = ideal();
    settings.inverter.voltage_drop = 2.0;
    settings.thermal = Thermal {
        // The windings stay as they are: 10 A all the time.
        winding: HeatedBody { capacity: 1e9, resistance: 0.4 },
        heat_sink: HeatedBody { capacity: 1.0, resistance: 0.5 },
        ambient: 30.0,
    };
    // 10 A: 10 V at 20 degrees Celsius, 3.9 % more at 30, and 4/3 * 2 V. The semiconductors take 2 V * 20 A.
    let mut machine = seized(settings, 10.0 * 1.0393 + 8.0 / 3.0, 0.0);
    for at in [1, 3, 5, 10].map(|at| at * SECOND / 10) {
        let expected = 30.0 + 20.0 * (1.0 - (-(at as f64) * 1e-9 / 0.5).exp());
        assert_near(machine.heat_sink_temperature(at), expected, 0.05);
    }
    // 47.29 and 30 degrees Celsius: 2 277 and 625.5 Ohm beside 2 200.
    assert_eq!(machine.temperature_samples(SECOND), [2_083, 907]);
    machine.set_ambient(10.0, SECOND);
    let warm = machine.heat_sink_temperature(SECOND);
    let expected = 30.0 + (warm - 30.0) * (-1.0_f64).exp();
    assert_near(machine.heat_sink_temperature(SECOND + SECOND / 2), expected, 0.05);
}

#[test]
fn the_winding_s_heat_follows_its_own_resistance() {
    let mut settings = ideal();
    settings.thermal.winding = HeatedBody { capacity: 0.5, resistance: 0.4 };
    let mut machine = seized(settings, 10.0, 0.0);
    // At the end 1.5 * 10 V * i = (T - 20) / 0.4 with i = 10 V / (1 + 0.00393 (T - 20))
    let rise = (-1.0 + (1.0_f64 + 4.0 * 0.003_93 * 60.0).sqrt()) / (2.0 * 0.003_93);
    assert_near(machine.winding_temperature(2 * SECOND), 20.0 + rise, 0.01);
    assert_near(machine.dq_currents(2 * SECOND)[0], 10.0 / (1.0 + 0.003_93 * rise), 0.001);
    // Warming up begins with 1.5 * 10² W / 0.5 J/K, 1.5 ms late; the mean loss falls a little until then.
    assert_near(machine_temperature_after(settings, 5 * MILLISECOND), 20.0 + 300.0 * 3.5e-3, 0.02);
    // Without current it cools with 0.2 s.
    machine.set_bridge(false, 2 * SECOND);
    let expected = 20.0 + rise * (-1.0_f64).exp();
    assert_near(machine.winding_temperature(2 * SECOND + SECOND / 5), expected, 0.02);
}

fn machine_temperature_after(settings: MachineSettings, at: u64) -> f64 {
    seized(settings, 10.0, 0.0).winding_temperature(at)
}

#[test]
fn the_resistor_of_the_drive_discharges_the_link_while_it_is_switched_on() {
    let mut settings = with_chopper();
    settings.supply.chopper = None;
    settings.supply.resistor = Some(50.0);
    let mut machine = Machine::new(settings);
    // Without mains: 1 mF and 50 ohm are 50 ms.
    machine.set_supply(0.0, 0);
    machine.set_bus_voltage(400.0, 1_000_000);
    machine.set_chopper(true, 2_000_000);
    machine.set_chopper(false, 22_000_000);
    for (at, expected) in [
        (1_900_000, 400.0),
        (12_000_000, 400.0 * f64::exp(-0.2)),
        (22_000_000, 400.0 * f64::exp(-0.4)),
        (60_000_000, 400.0 * f64::exp(-0.4)),
    ] {
        let voltage = machine.bus_voltage(at);
        assert!((voltage / expected - 1.0).abs() < 1e-5, "{voltage} V at {at} ns, expected {expected}");
    }
    // Nothing is there to be switched.
    settings.supply.resistor = None;
    let mut machine = Machine::new(settings);
    machine.set_supply(0.0, 0);
    machine.set_chopper(true, 0);
    assert!((machine.bus_voltage(50_000_000) - BUS).abs() < 1e-9);
}
