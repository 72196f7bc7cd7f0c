//! The data sheet of an amplifier: TOML, in the units that people use.

use anyhow::{Context, Result, bail, ensure};
use bench::motor_side::HostBoard;
use drive::dictionary::{is_rating, parameters_on, source};
use drive::production::{ProductionRecord, TEXT_BYTES, Text};
use drive::{Amplifier, BoardKind, DriveSettings, InvalidSetting};
use serde::Deserialize;
use std::f64::consts::SQRT_2;

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Sheet {
    hardware: String,
    serial_number: String,
    currents: Currents,
    voltages: Voltages,
    heat_sink: HeatSink,
    chopper: Option<Chopper>,
}

/// In A.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Currents {
    peak: f64,
    continuous: f64,
    trip: f64,
    sensor_range: f64,
    dead_time_band: f64,
}

/// In V.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Voltages {
    sensor_range: f64,
    undervoltage: f64,
    overvoltage: f64,
    withstand: f64,
}

/// In degrees Celsius and s.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct HeatSink {
    warning: f64,
    shutdown: f64,
    time_constant: f64,
}

/// In Ohm.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Chopper {
    least_resistance: f64,
}

/// The record of a data sheet.
///
/// # Errors
/// The first thing that is wrong, in the words of the sheet.
pub(super) fn record(text: &str) -> Result<ProductionRecord> {
    let sheet: Sheet = toml::from_str(text).context("no data sheet of an amplifier")?;
    let Sheet { currents, voltages, heat_sink, .. } = &sheet;
    let amplifier = Amplifier {
        peak_current: long("currents.peak", currents.peak, 1_000.0)?,
        continuous_current: long("currents.continuous", currents.continuous, 1_000.0)?,
        trip_current: long("currents.trip", currents.trip, 1_000.0)?,
        current_range: long("currents.sensor_range", currents.sensor_range, 1_000.0)?,
        dead_time_band: word("currents.dead_time_band", currents.dead_time_band, 1_000.0)?,
        bus_range: word("voltages.sensor_range", voltages.sensor_range, 1.0)?,
        undervoltage: word("voltages.undervoltage", voltages.undervoltage, 1.0)?,
        overvoltage: word("voltages.overvoltage", voltages.overvoltage, 1.0)?,
        withstand_voltage: word("voltages.withstand", voltages.withstand, 1.0)?,
        least_resistance: match &sheet.chopper {
            Some(chopper) => word("chopper.least_resistance", chopper.least_resistance, 10.0)?,
            None => 0,
        },
        warning_temperature: word("heat_sink.warning", heat_sink.warning, 10.0)?,
        shutdown_temperature: word("heat_sink.shutdown", heat_sink.shutdown, 10.0)?,
        thermal_time_constant: long("heat_sink.time_constant", heat_sink.time_constant, 1_000.0)?,
    };
    check(&sheet)?;
    check_with_the_loops(&amplifier)?;
    Ok(ProductionRecord {
        hardware: text_of("hardware", &sheet.hardware)?,
        serial_number: text_of("serial_number", &sheet.serial_number)?,
        amplifier,
    })
}

/// What must go together.
fn check(sheet: &Sheet) -> Result<()> {
    let Sheet { currents, voltages, heat_sink, chopper, .. } = sheet;
    let Currents { peak, continuous, trip, sensor_range, .. } = *currents;
    ensure!(
        0.0 < continuous && continuous <= peak,
        "currents.continuous is {continuous} A, expected at most currents.peak, {peak} A"
    );
    ensure!(
        (1.0..=8.0).contains(&(sensor_range / (peak * SQRT_2))),
        "currents.sensor_range is {sensor_range} A, expected 1 to 8 times {:.3} A, the amplitude of currents.peak",
        peak * SQRT_2
    );
    ensure!(
        peak <= trip && trip * SQRT_2 <= sensor_range + 1e-3,
        "currents.trip is {trip} A, expected {peak} A, currents.peak, to {:.3} A, where currents.sensor_range ends",
        sensor_range / SQRT_2
    );
    let Voltages { sensor_range, undervoltage, overvoltage, withstand } = *voltages;
    ensure!(
        overvoltage <= sensor_range && overvoltage <= withstand,
        "voltages.overvoltage is {overvoltage} V, expected at most voltages.sensor_range, {sensor_range} V, and voltages.withstand, {withstand} V"
    );
    ensure!(
        0.0 < undervoltage && undervoltage * 1.125 < overvoltage,
        "voltages.undervoltage is {undervoltage} V, expected to leave an eighth of it to voltages.overvoltage, {overvoltage} V"
    );
    ensure!(
        heat_sink.warning < heat_sink.shutdown,
        "heat_sink.warning is {} C, expected below heat_sink.shutdown, {} C",
        heat_sink.warning,
        heat_sink.shutdown
    );
    ensure!(
        chopper.as_ref().is_none_or(|chopper| chopper.least_resistance >= 0.1),
        "chopper.least_resistance is 0 Ohm; without a chopper leave the table out"
    );
    Ok(())
}

/// What the firmware says of it, with the motor of its defaults: what it says of that does not matter.
fn check_with_the_loops(amplifier: &Amplifier) -> Result<()> {
    let parameters = parameters_on(amplifier, &HostBoard::FACTS);
    match DriveSettings::new(&parameters, &HostBoard::FACTS, source) {
        Err(invalid @ InvalidSetting { idn, .. }) if parameters.dictionary().find(idn).is_some_and(is_rating) => {
            bail!("the firmware does not take it: {invalid}")
        }
        _ => Ok(()),
    }
}

/// A number in its unit, and how many increments of the record one is.
fn long(name: &str, value: f64, increments: f64) -> Result<u32> {
    scaled(name, value, increments, u32::MAX.into()).map(|scaled| scaled as u32)
}

fn word(name: &str, value: f64, increments: f64) -> Result<u16> {
    scaled(name, value, increments, u16::MAX.into()).map(|scaled| scaled as u16)
}

fn scaled(name: &str, value: f64, increments: f64, most: f64) -> Result<f64> {
    let scaled = (value * increments).round();
    ensure!((0.0..=most).contains(&scaled), "{name} is {value}, expected 0 to {}", most / increments);
    Ok(scaled)
}

fn text_of(name: &str, text: &str) -> Result<Text> {
    let printable = !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_graphic() || byte == b' ');
    ensure!(
        printable && text.len() <= TEXT_BYTES,
        "{name} is '{text}', expected 1 to {TEXT_BYTES} printable characters of ASCII"
    );
    Text::try_from(text).with_context(|| format!("{name} does not fit"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use drive::Hardware;

    const SHEET: &str = include_str!("../../../../docs/amplifier.toml");

    fn refused(from: &str, to: &str) -> String {
        assert!(SHEET.contains(from), "{from}");
        format!("{:#}", record(&SHEET.replacen(from, to, 1)).unwrap_err())
    }

    #[test]
    fn the_data_sheet_in_the_documentation_is_that_of_the_board() {
        let record = record(SHEET).unwrap();
        assert_eq!(record.amplifier, bench::motor_side::MotorSide::AMPLIFIER);
        assert_eq!(ProductionRecord::parse(&record.emit()), Ok(record));
    }

    #[test]
    fn what_does_not_go_together_is_refused_in_the_words_of_the_sheet() {
        for (from, to, told) in [
            ("peak = 14.142", "peak = 0.0", "currents.continuous is 7.071 A, expected at most currents.peak, 0 A"),
            ("peak = 14.142", "peak = -1.0", "currents.peak is -1, expected 0 to 4294967.295"),
            ("peak = 14.142", "peak = 18.0", "currents.sensor_range is 25 A, expected 1 to 8 times 25.456 A"),
            ("peak = 14.142", "peak = 2.0", "currents.continuous is 7.071 A"),
            ("trip = 17.677", "trip = 17.7", "currents.trip is 17.7 A, expected 14.142 A, currents.peak, to 17.678 A"),
            ("trip = 17.677", "trip = 14.0", "currents.trip is 14 A"),
            ("overvoltage = 440", "overvoltage = 501", "voltages.overvoltage is 501 V"),
            ("withstand = 600", "withstand = 430", "voltages.overvoltage is 440 V"),
            ("undervoltage = 150", "undervoltage = 400", "voltages.undervoltage is 400 V"),
            ("warning = 80.0", "warning = 90.0", "heat_sink.warning is 90 C"),
            ("shutdown = 90.0", "shutdown = 400.0", "the firmware does not take it: S-0-0203"),
            ("time_constant = 5.0", "time_constant = 5000.0", "the firmware does not take it: P-0-0131"),
            ("least_resistance = 22.0", "least_resistance = 0.0", "chopper.least_resistance is 0 Ohm"),
            ("hardware = \"", "hardware = \"\u{e4}", "hardware is '"),
            ("serial_number = \"", "serial_number = \"0123456789abcdef", "serial_number is '"),
            ("[currents]", "[curents]", "no data sheet of an amplifier: "),
            ("peak = 14.142", "", "no data sheet of an amplifier: "),
        ] {
            let answer = refused(from, to);
            assert!(answer.contains(told), "{to}: {answer}");
        }
    }

    #[test]
    fn an_amplifier_without_a_chopper_has_no_least_resistance() {
        let without = SHEET.split("[chopper]").next().unwrap();
        assert_eq!(record(without).unwrap().amplifier.least_resistance, 0);
    }
}
