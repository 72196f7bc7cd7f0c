//! Every sensor that a motor may have, on a whole drive: what the master sees of it, and what its heat and its wires do to a motor that turns.

use crate::running::{ADDRESS, Bench, script};
use bench::{DriveSetup, product};
use plant::{Ntc, ReferenceAxis, ThermalResistor, Thermometer, ThermometerFailure};
use ring::Nanoseconds;
use ring::ident::Value;
use ring::master::MasterScript;
use ring::service_client::control;

const CLASS_1: u16 = 11;
const MOTOR: u16 = 383;
const HEAT_SINK: u16 = 384;
const DIAGNOSTIC_NUMBER: u16 = 390;
const BROKEN: Option<ThermometerFailure> = Some(ThermometerFailure::BrokenWire);
const SHORT: Option<ThermometerFailure> = Some(ThermometerFailure::ShortCircuit);

/// A sensor, its number in P-0-0134, and whether it has degrees.
const SENSORS: [(u16, ThermalResistor, bool); 6] = [
    (0, ThermalResistor::Absent, false),
    (1, ThermalResistor::Kty84, true),
    (2, ThermalResistor::Pt1000, true),
    (3, ThermalResistor::Ntc(Ntc::CHIP_10K), true),
    (4, ThermalResistor::Ptc { response: 130.0, in_series: 3 }, false),
    (5, ThermalResistor::Switch { opens_at: 140.0 }, false),
];

/// The press axis at 300 rpm, with its heat sink at 60 and its motor at 90 degrees Celsius from the beginning.
fn turning(number: u16, resistor: ThermalResistor) -> Bench {
    let mut axis = ReferenceAxis::press();
    axis.machine.thermometers[1] = Thermometer::with(resistor);
    let drive = script().drives.remove(0).with(product(134), Value::Word(number));
    let script = MasterScript { drives: vec![drive], ..script() };
    let mut bench = Bench::new(DriveSetup { axis, ..DriveSetup::new(ADDRESS) }, script);
    bench.drive.motor_side.borrow_mut().machine().set_temperatures([60.0, 90.0], 0);
    for _ in 0..2_000 {
        bench.run(Nanoseconds::from_millis(10));
        if bench.rpm() > 299.0 {
            // A control that goes on asking when a drive has shut down.
            let follow = control::ON | control::ENABLE | control::NO_HALT;
            bench.world.ring_mut().master_mut().hold_switches(Some(follow));
            return bench;
        }
    }
    panic!("{}", bench.world.ring().master().state());
}

/// The wires of the heat sink's (0) or the motor's (1) sensor are so for half a second.
fn with_wires(bench: &mut Bench, sensor: usize, failure: Option<ThermometerFailure>) {
    let now = bench.world.now().0;
    bench.drive.motor_side.borrow_mut().machine().fail_temperature_sensor(sensor, failure, now);
    bench.run(Nanoseconds::from_millis(500));
}

fn degrees(bench: &mut Bench, idn: u16) -> f64 {
    f64::from((bench.number(idn) as u16).cast_signed()) / 10.0
}

/// The drive has stopped with this diagnosis, or goes on where there is none.
#[track_caller]
fn assert_diagnosis(bench: &mut Bench, number: u16, expected: Option<u64>) {
    let told = expected.map(|_| bench.number(DIAGNOSTIC_NUMBER));
    assert_eq!((told, bench.has_torque()), (expected, expected.is_none()), "P-0-0134 = {number}");
    assert_eq!(bench.number(CLASS_1) == 0, expected.is_none(), "P-0-0134 = {number}");
}

#[test]
fn s_0_0383_shows_the_motor_where_its_sensor_has_degrees_and_a_hot_motor_is_stopped_by_every_sensor() {
    for (number, resistor, has_degrees) in SENSORS {
        let mut bench = turning(number, resistor);
        let (heat_sink, motor) = (degrees(&mut bench, HEAT_SINK), degrees(&mut bench, MOTOR));
        assert!((heat_sink - 60.0).abs() < 2.0, "{heat_sink}");
        let expected = if has_degrees { 90.0 } else { -200.0 };
        assert!((motor - expected).abs() < 2.0, "P-0-0134 = {number}: {motor}");
        let now = bench.world.now().0;
        bench.drive.motor_side.borrow_mut().machine().set_temperatures([60.0, 160.0], now);
        // Of 2 s of the filter ln(70 / 30) pass until 130 degrees are reached.
        bench.run(Nanoseconds::from_millis(2_500));
        assert_diagnosis(&mut bench, number, (number != 0).then_some(0xF102));
    }
}

#[test]
fn a_broken_wire_of_the_motors_sensor_is_told_and_that_of_a_ptc_or_a_switch_is_a_hot_motor() {
    for (number, resistor, has_degrees) in SENSORS {
        let mut bench = turning(number, resistor);
        with_wires(&mut bench, 1, BROKEN);
        let expected = if has_degrees { 0xF117 } else { 0xF102 };
        assert_diagnosis(&mut bench, number, (number != 0).then_some(expected));
        assert_eq!(degrees(&mut bench, MOTOR), -200.0);
        assert!(degrees(&mut bench, HEAT_SINK) > 50.0);
    }
}

#[test]
fn a_short_circuit_of_the_motors_sensor_is_told_where_it_is_no_closed_switch() {
    for (number, resistor, _) in SENSORS {
        let mut bench = turning(number, resistor);
        with_wires(&mut bench, 1, SHORT);
        assert_diagnosis(&mut bench, number, (1..=4).contains(&number).then_some(0xF11E));
        assert_eq!(degrees(&mut bench, MOTOR), -200.0);
    }
}

#[test]
fn a_dead_sensor_of_the_heat_sink_is_told_by_s_0_0384_and_runs_again_after_its_repair() {
    for (failure, expected) in [(BROKEN, 0xF117), (SHORT, 0xF11E)] {
        let mut bench = turning(1, ThermalResistor::Kty84);
        with_wires(&mut bench, 0, failure);
        assert_diagnosis(&mut bench, 1, Some(expected));
        assert_eq!(degrees(&mut bench, HEAT_SINK), -200.0);
        let motor = degrees(&mut bench, MOTOR);
        assert!((motor - 90.0).abs() < 2.0, "{motor}");
        with_wires(&mut bench, 0, None);
        assert!((degrees(&mut bench, HEAT_SINK) - 60.0).abs() < 2.0);
        assert_eq!(bench.number(CLASS_1), 1 << 15, "an error that has gone by itself is still one");
        bench.clear_errors();
        assert_eq!(bench.number(CLASS_1), 0);
    }
}
