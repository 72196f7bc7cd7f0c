//! The data sheet of an amplifier: TOML, in the units that people use.

use anyhow::{Context, Result, anyhow, ensure};
use bench::motor_side::HostBoard;
use drive::dictionary::source;
use drive::production::{ProductionRecord, TEXT_BYTES, Text};
use drive::{Amplifier, BoardKind, DriveSettings, InvalidSetting, without_motor};
use serde::Deserialize;

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
            Some(Chopper { least_resistance: ohms }) => {
                let scaled = word("chopper.least_resistance", *ohms, 10.0)?;
                ensure!(scaled > 0, "chopper.least_resistance is {ohms} Ohm; without a chopper leave the table out");
                scaled
            }
            None => 0,
        },
        warning_temperature: word("heat_sink.warning", heat_sink.warning, 10.0)?,
        shutdown_temperature: word("heat_sink.shutdown", heat_sink.shutdown, 10.0)?,
        thermal_time_constant: long("heat_sink.time_constant", heat_sink.time_constant, 1_000.0)?,
    };
    check(&amplifier)?;
    Ok(ProductionRecord {
        hardware: text_of("hardware", &sheet.hardware)?,
        serial_number: text_of("serial_number", &sheet.serial_number)?,
        amplifier,
    })
}

/// What the firmware says of it, with the increments of the record: that is what S-0-0128 will look at.
fn check(amplifier: &Amplifier) -> Result<()> {
    let told = |invalid: InvalidSetting| anyhow!("the firmware does not take it: {invalid}");
    amplifier.check().map_err(told)?;
    let parameters = without_motor(amplifier, &HostBoard::FACTS, None);
    DriveSettings::new(&parameters, &HostBoard::FACTS, source).map(|_| ()).map_err(told)
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
            ("peak = 14.142", "peak = 0.0", "S-0-0110: peak current in mA of 0, expected 1 to 500000"),
            ("peak = 14.142", "peak = -1.0", "currents.peak is -1, expected 0 to 4294967.295"),
            (
                "peak = 14.142",
                "peak = 18.0",
                "P-0-0100: range of the current sensors in mA of 25000, expected 25456 to 203648",
            ),
            ("peak = 14.142", "peak = 2.0", "S-0-0112: continuous current in mA of 7071, expected 1 to 2000"),
            ("trip = 17.677", "trip = 17.7", "P-0-0106: trip current in mA of 17700, expected 14142 to 17679"),
            ("trip = 17.677", "trip = 14.0", "P-0-0106"),
            ("overvoltage = 440", "overvoltage = 500", "P-0-0105: overvoltage in V of 500, expected 1 to 490"),
            ("withstand = 600", "withstand = 430", "P-0-0105"),
            ("undervoltage = 150", "undervoltage = 400", "P-0-0104: undervoltage in V of 400, expected 1 to 391"),
            ("undervoltage = 150", "undervoltage = 0.4", "P-0-0104"),
            ("warning = 80.0", "warning = 90.0", "S-0-0200"),
            ("shutdown = 90.0", "shutdown = 400.0", "S-0-0203"),
            ("time_constant = 5.0", "time_constant = 5000.0", "P-0-0131"),
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

    /// The motor of the defaults goes with none of them: their own faults are found all the same.
    #[test]
    fn amplifiers_that_the_default_motor_does_not_fit_are_looked_at_as_well() {
        let sheet = |[peak, trip, range]: [f64; 3], [sensors, over, under]: [u16; 3], shutdown: f64| {
            let numbers =
                [("14.142", peak), ("17.677", trip), ("25.0", range), ("7.071", peak / 2.0), ("90.0", shutdown)];
            let text =
                numbers.iter().fold(SHEET.to_owned(), |text, (from, to)| text.replacen(from, &to.to_string(), 1));
            let volts = [("= 500 ", sensors), ("= 440", over), ("= 150", under), ("= 600", over)];
            volts.iter().fold(text, |text, (from, to)| text.replacen(from, &format!("= {to} "), 1))
        };
        for (currents, volts) in [
            ([14.142, 17.677, 25.0], [100, 75, 30]),
            ([45.0, 50.0, 80.0], [500, 440, 150]),
            ([2.0, 2.5, 4.0], [1_000, 800, 300]),
        ] {
            assert!(record(&sheet(currents, volts, 90.0)).is_ok(), "{currents:?} {volts:?}");
            let told = format!("{:#}", record(&sheet(currents, volts, 400.0)).unwrap_err());
            assert!(told.contains("S-0-0203"), "{told}");
        }
    }

    #[test]
    fn an_amplifier_without_a_chopper_has_no_least_resistance() {
        let without = SHEET.split("[chopper]").next().unwrap();
        assert_eq!(record(without).unwrap().amplifier.least_resistance, 0);
    }
}
