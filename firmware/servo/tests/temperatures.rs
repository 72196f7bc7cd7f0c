//! Temperatures from the data sheet's resistor through the divider's volts and the converter's 12 bits to what the drive shows and does.

use plant::{Machine, MachineSettings, Ntc, ReferenceAxis, ThermalResistor, Thermometer, ThermometerFailure};
use servo::monitor::{
    Characteristic, Divider, Temperature, TemperatureError, TemperatureOutput, TemperatureParameters,
    TemperatureSensor, TemperatureSettings,
};

/// As the machine has it, in the words of the firmware.
const DIVIDER: Divider = Divider { pull_up: 2_200, supply: 3_300, reference: 3_300 };
static KTY84: Characteristic = Characteristic::of(TemperatureSensor::Kty84, &DIVIDER);
static PT1000: Characteristic = Characteristic::of(TemperatureSensor::Pt1000, &DIVIDER);
static NTC_10K: Characteristic = Characteristic::of(TemperatureSensor::Ntc10k, &DIVIDER);
static NTC_5K: Characteristic = Characteristic::of(TemperatureSensor::Ntc5k, &DIVIDER);
static PTC: Characteristic = Characteristic::of(TemperatureSensor::Ptc, &DIVIDER);
static SWITCH: Characteristic = Characteristic::of(TemperatureSensor::Switch, &DIVIDER);

/// The supervision has two ticks in a millisecond, and believes what it sees for 200 ms.
const DEBOUNCE: u64 = 400;

/// A sensor in the windings of a machine, and the firmware's look at it.
struct Bench {
    machine: Machine,
    settings: TemperatureSettings,
    state: Temperature,
    at: u64,
}

impl Bench {
    fn new(resistor: ThermalResistor, sensor: &'static Characteristic) -> Self {
        let axis = ReferenceAxis::press().machine;
        let machine = MachineSettings { thermometers: [Thermometer::with(resistor); 2], ..axis };
        let parameters = TemperatureParameters { sensor, warning: 1_150, shutdown: 1_300, filter: 0, debounce: 200 };
        Self {
            machine: Machine::new(machine),
            settings: TemperatureSettings::new(&parameters).unwrap(),
            state: Temperature::new(),
            at: 0,
        }
    }

    /// Half a second at this temperature.
    fn hold(&mut self, celsius: f64) -> TemperatureOutput {
        let ticks = (0..1_000).map(|_| {
            self.at += 500_000;
            self.machine.set_temperatures([celsius; 2], self.at);
            self.state.tick(&self.settings, self.machine.temperature_samples(self.at)[1])
        });
        ticks.last().unwrap()
    }

    /// What is seen after so many ticks with its wires so.
    fn fail(&mut self, failure: ThermometerFailure, ticks: u64) -> TemperatureOutput {
        self.machine.fail_temperature_sensor(1, Some(failure), self.at);
        let ticks = (0..ticks).map(|_| self.state.tick(&self.settings, self.machine.temperature_samples(self.at)[1]));
        ticks.last().unwrap()
    }
}

/// Name and source, the machine's resistor, the firmware's table, and five points of the data sheet in degrees Celsius and Ohm.
type Sensor = (&'static str, ThermalResistor, &'static Characteristic, [(f64, f64); 5]);

/// Sensors with degrees.
fn with_degrees() -> [Sensor; 4] {
    [
        (
            "KTY84-130, NXP KTY84 table 1",
            ThermalResistor::Kty84,
            &KTY84,
            [(0.0, 498.0), (50.0, 722.0), (80.0, 882.0), (100.0, 1_000.0), (150.0, 1_334.0)],
        ),
        (
            "Pt1000, IEC 60751",
            ThermalResistor::Pt1000,
            &PT1000,
            [(0.0, 1_000.0), (50.0, 1_193.97), (80.0, 1_308.97), (100.0, 1_385.06), (150.0, 1_573.25)],
        ),
        (
            "NTC 10 kOhm, Murata NCP18XH103, and at 150 its B25/100",
            ThermalResistor::Ntc(Ntc::CHIP_10K),
            &NTC_10K,
            [(0.0, 27_219.0), (25.0, 10_000.0), (85.0, 1_452.0), (125.0, 531.0), (150.0, 308.0)],
        ),
        (
            "NTC 5 kOhm of a module, Infineon at 25, 50, 80, 100, Semikron at 125",
            ThermalResistor::Ntc(Ntc::MODULE_5K),
            &NTC_5K,
            [(25.0, 5_000.0), (50.0, 2_082.8), (80.0, 841.7), (100.0, 493.0), (125.0, 271.3)],
        ),
    ]
}

#[test]
fn every_sensor_is_read_within_two_kelvins_at_five_points_of_its_data_sheet_and_everywhere_between_0_and_150() {
    for (name, resistor, sensor, points) in with_degrees() {
        let shown = |celsius: f64| {
            let shown = Bench::new(resistor, sensor).hold(celsius).temperature.unwrap();
            f64::from(shown) / 10.0
        };
        for (celsius, resistance) in points {
            let modelled = resistor.resistance(celsius);
            assert!((modelled / resistance - 1.0).abs() < 0.007, "{name}: {modelled} instead of {resistance} Ohm");
            let shown = shown(celsius);
            println!("{name}: {celsius} shown as {shown}");
            assert!((shown - celsius).abs() <= 2.0, "{name}: {celsius} shown as {shown}");
        }
        let worst = (0..=150).map(f64::from).map(|celsius| (shown(celsius) - celsius).abs()).fold(0.0, f64::max);
        println!("{name}: at most {worst:.2} K off from 0 to 150");
        assert!(worst <= 2.0, "{name}: {worst}");
    }
}

#[test]
fn warning_and_shut_down_come_at_their_limits_whether_the_resistance_rises_or_falls() {
    for (name, resistor, sensor, _) in with_degrees() {
        let mut bench = Bench::new(resistor, sensor);
        let seen = [113.0, 117.0, 128.0, 132.0, 127.0, 123.0, 112.0, 108.0].map(|celsius| {
            let output = bench.hold(celsius);
            assert_eq!(output.error, None, "{name}");
            [output.warning, output.shutdown].map(u8::from)
        });
        assert_eq!(seen, [[0, 0], [1, 0], [1, 0], [1, 1], [1, 1], [1, 0], [1, 0], [0, 0]], "{name}");
    }
}

#[test]
fn a_broken_wire_and_a_short_circuit_are_told_apart_for_every_sensor_with_degrees() {
    for (name, resistor, sensor, _) in with_degrees() {
        for (failure, broken) in [(ThermometerFailure::BrokenWire, true), (ThermometerFailure::ShortCircuit, false)] {
            let mut bench = Bench::new(resistor, sensor);
            bench.hold(90.0);
            assert_eq!(bench.fail(failure, DEBOUNCE - 1).error, None, "{name}");
            let output = bench.fail(failure, 1);
            let told = matches!(output.error, Some(TemperatureError::BrokenWire { .. }));
            assert!(output.error.is_some() && told == broken, "{name}: {output:?}");
            assert_eq!((output.temperature, output.shutdown), (None, false), "{name}");
        }
    }
}

#[test]
fn cold_and_heat_of_a_sound_sensor_are_neither_a_broken_wire_nor_a_short_circuit() {
    for (name, resistor, sensor, _) in with_degrees() {
        for (celsius, tolerance) in [(-40.0, 6.0), (200.0, 2.0)] {
            let output = Bench::new(resistor, sensor).hold(celsius);
            let shown = f64::from(output.temperature.unwrap()) / 10.0;
            assert!(
                output.error.is_none() && (shown - celsius).abs() <= tolerance,
                "{name}: {celsius} shown as {shown}"
            );
        }
    }
}

#[test]
fn ptc_thermistors_trip_between_the_demands_of_their_standard_and_let_go_five_kelvins_below_their_temperature() {
    for in_series in [1, 3] {
        let mut bench = Bench::new(ThermalResistor::Ptc { response: 130.0, in_series }, &PTC);
        let seen = [25.0, 110.0, 125.0, 145.0, 150.0, 125.0, 25.0].map(|celsius| {
            let output = bench.hold(celsius);
            assert_eq!((output.temperature, output.warning, output.error), (None, false, None), "{in_series}");
            u8::from(output.shutdown)
        });
        assert_eq!(seen, [0, 0, 0, 1, 1, 0, 0], "{in_series}");
        assert!(bench.fail(ThermometerFailure::BrokenWire, DEBOUNCE).shutdown, "as a hot one");
        let output = bench.fail(ThermometerFailure::ShortCircuit, DEBOUNCE);
        assert!(matches!(output.error, Some(TemperatureError::ShortCircuit { .. })), "{output:?}");
    }
}

#[test]
fn a_switch_trips_when_it_opens() {
    let mut bench = Bench::new(ThermalResistor::Switch { opens_at: 140.0 }, &SWITCH);
    let seen = [0.0, 25.0, 139.0, 140.0, 150.0, 139.0].map(|celsius| {
        let output = bench.hold(celsius);
        assert_eq!((output.temperature, output.warning, output.error), (None, false, None));
        u8::from(output.shutdown)
    });
    assert_eq!(seen, [0, 0, 0, 1, 1, 0]);
}
