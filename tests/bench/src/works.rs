//! The works: what they write into a drive that they have built around an amplifier.

use drive::Amplifier;
use drive::production::{ProductionRecord, RECORD_BYTES};
use plant::{MachineSettings, ReferenceAxis};

/// What the works have done with a drive.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum Works {
    /// Built it around the amplifier of its axis, and measured that.
    #[default]
    OfItsAxis,
    /// Written nothing: it is the board as it comes.
    Blank,
    /// Written this.
    Written(ProductionRecord),
    /// Written this, which may be anything.
    Bytes([u8; RECORD_BYTES]),
}

impl Works {
    /// Built it around the amplifier of its axis, but for this.
    #[must_use]
    pub fn but_for(axis: &ReferenceAxis, change: impl FnOnce(&mut Amplifier)) -> Self {
        let mut record = record_of(axis);
        change(&mut record.amplifier);
        Self::Written(record)
    }

    /// The sector of the production record.
    #[must_use]
    pub fn sector(&self, axis: &ReferenceAxis) -> [u8; RECORD_BYTES] {
        match self {
            Self::OfItsAxis => record_of(axis).emit(),
            Self::Blank => [0xFF; RECORD_BYTES],
            Self::Written(record) => record.emit(),
            Self::Bytes(bytes) => *bytes,
        }
    }
}

/// The record of a drive that was built around the amplifier of this axis.
///
/// # Panics
/// Never: the texts fit.
#[must_use]
pub fn record_of(axis: &ReferenceAxis) -> ProductionRecord {
    ProductionRecord {
        hardware: "bench".try_into().expect("it fits"),
        serial_number: "1".try_into().expect("it fits"),
        amplifier: amplifier_of(axis),
    }
}

/// What the builder of this amplifier knows of it, and has measured on it.
#[must_use]
pub fn amplifier_of(axis: &ReferenceAxis) -> Amplifier {
    let MachineSettings { supply, current_sensors, bus_range, .. } = &axis.machine;
    let milliamperes = |amperes: f64| (amperes * 1_000.0).round() as u32;
    let peak = f64::from(axis.peak_current) / 1_000.0 * core::f64::consts::FRAC_1_SQRT_2;
    let volts = |volts: f64| volts.round() as u16;
    let overvoltage = volts(supply.voltage * 1.4);
    Amplifier {
        peak_current: milliamperes(peak),
        continuous_current: milliamperes(peak / 2.0),
        trip_current: milliamperes(peak * 1.25),
        current_range: milliamperes(current_sensors.range),
        dead_time_band: 200,
        bus_range: volts(*bus_range),
        undervoltage: volts(supply.voltage / 2.0),
        overvoltage,
        // Transistors of 600 V on mains of 230 V, of 1 200 V on mains of 400 V, and capacitors that go with them.
        withstand_voltage: if overvoltage <= 600 { 600 } else { 1_200 },
        least_resistance: 50,
        warning_temperature: 800,
        shutdown_temperature: 900,
        thermal_time_constant: 5_000,
    }
}
