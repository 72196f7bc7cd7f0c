//! Temperature sensors against five and more points of their data sheets, and the divider before them.

use plant::{Machine, MachineSettings, Ntc, ThermalResistor, Thermometer, ThermometerFailure};

use crate::common::{MILLISECOND, assert_near, ideal};

/// Resistances within so many per cent of a data sheet's.
#[track_caller]
fn assert_sheet(resistor: ThermalResistor, points: &[(f64, f64)], per_cent: f64) {
    for (celsius, expected) in points {
        let resistance = resistor.resistance(*celsius);
        let off = 100.0 * (resistance / expected - 1.0);
        assert!(off.abs() <= per_cent, "{resistance} instead of {expected} Ohm at {celsius} degrees Celsius");
    }
}

#[test]
fn a_kty84_has_the_resistances_of_its_data_sheet() {
    // NXP KTY84, table 1.
    let points = [
        (-40.0, 359.0),
        (0.0, 498.0),
        (25.0, 603.0),
        (50.0, 722.0),
        (100.0, 1_000.0),
        (150.0, 1_334.0),
        (200.0, 1_722.0),
    ];
    assert_sheet(ThermalResistor::Kty84, &points, 0.2);
}

#[test]
fn a_pt1000_has_the_resistances_of_iec_60751() {
    let points =
        [(-40.0, 842.71), (0.0, 1_000.0), (50.0, 1_193.97), (100.0, 1_385.06), (150.0, 1_573.25), (200.0, 1_758.56)];
    assert_sheet(ThermalResistor::Pt1000, &points, 0.001);
}

#[test]
fn resistors_with_negative_coefficients_have_the_resistances_of_their_tables() {
    // Murata NCP18XH103, 1 % of which are 0.3 K.
    let chip = [(0.0, 27_219.0), (25.0, 10_000.0), (50.0, 4_161.0), (85.0, 1_452.0), (100.0, 974.0), (125.0, 531.0)];
    assert_sheet(ThermalResistor::Ntc(Ntc::CHIP_10K), &chip, 0.6);
    // Infineon's B25/80 of 3 411 K, 493 Ohm at 100 degrees Celsius, and Semikron's B100/125 of 3 550 K.
    let module = [(25.0, 5_000.0), (50.0, 2_082.8), (80.0, 841.7), (100.0, 493.0), (125.0, 271.3)];
    assert_sheet(ThermalResistor::Ntc(Ntc::MODULE_5K), &module, 0.4);
}

#[test]
fn a_ptc_is_as_weak_as_its_standard_lets_it_be_and_a_switch_is_closed_or_open() {
    let ptc = ThermalResistor::Ptc { response: 130.0, in_series: 1 };
    assert_sheet(ptc, &[(25.0, 100.0), (110.0, 100.0), (125.0, 550.0), (135.0, 1_330.0), (145.0, 4_000.0)], 1e-9);
    // On the way between two demands and beyond the last one.
    assert_sheet(ptc, &[(130.0, 940.0), (150.0, 5_335.0)], 1e-9);
    assert_sheet(ThermalResistor::Ptc { response: 130.0, in_series: 3 }, &[(125.0, 1_650.0)], 1e-9);
    let switch = ThermalResistor::Switch { opens_at: 140.0 };
    assert_eq!([139.0, 140.0].map(|celsius| switch.resistance(celsius)), [2.0, f64::INFINITY]);
    assert_eq!(ThermalResistor::Absent.resistance(20.0), f64::INFINITY);
}

#[test]
fn the_divider_shares_its_supply_between_pull_up_and_sensor() {
    let thermometer = Thermometer { resistor: ThermalResistor::Pt1000, pull_up: 3_000.0, supply: 5.0, reference: 2.5 };
    assert_near(thermometer.voltage(0.0, None), 1.25, 1e-12);
    assert_near(thermometer.voltage(0.0, Some(ThermometerFailure::BrokenWire)), 5.0, 1e-12);
    assert_near(thermometer.voltage(0.0, Some(ThermometerFailure::ShortCircuit)), 0.0, 1e-12);
    let machine = |ambient: f64| {
        let mut settings: MachineSettings = ideal();
        settings.thermometers = [thermometer, Thermometer { supply: 2.4, ..thermometer }];
        settings.thermal.ambient = ambient;
        Machine::new(settings)
    };
    assert_eq!(machine(0.0).temperature_samples(0), [2_048, 983], "0.6 V of 2.5 V are 983.04 counts");
    let mut machine = machine(0.0);
    machine.fail_temperature_sensor(0, Some(ThermometerFailure::BrokenWire), MILLISECOND);
    machine.fail_temperature_sensor(1, Some(ThermometerFailure::BrokenWire), MILLISECOND);
    machine.fail_temperature_sensor(1, Some(ThermometerFailure::ShortCircuit), 2 * MILLISECOND);
    machine.fail_temperature_sensor(0, None, 3 * MILLISECOND);
    let samples = [0, 1, 2, 3].map(|at| machine.temperature_samples(at * MILLISECOND));
    assert_eq!(samples, [[2_048, 983], [4_095, 3_932], [4_095, 0], [2_048, 0]]);
}

#[test]
fn a_divider_of_no_resistance_is_refused() {
    let mut settings = ideal();
    settings.thermometers[1].pull_up = 0.0;
    let refused = std::panic::catch_unwind(|| Machine::new(settings)).unwrap_err();
    assert_eq!(
        *refused.downcast_ref::<&str>().unwrap(),
        "pull-up, supply and reference of a thermometer must be positive"
    );
}
