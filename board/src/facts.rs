//! What this board is built with, for the firmware above it.

use drive::{Amplifier, BoardKind, Divider, Facts, TemperatureSensor, Thermometers};

use crate::{bridge, current_sense, encoder, loop_phase};

/// Of both temperature inputs: 2.2 kOhm of 0.1 % to the 3.3 V that are the converters' reference, so that no error of a supply counts.
const DIVIDER: Divider = Divider { pull_up: 2_200, supply: 3_300, reference: 3_300 };

/// The amplifier that belongs to this board: 20 A for a moment, on rectified mains of 230 V. One of another size has a production record.
pub(crate) const AMPLIFIER: Amplifier = Amplifier {
    peak_current: 14_142,
    continuous_current: 7_071,
    trip_current: 17_677,
    current_range: 25_000,
    dead_time_band: 200,
    bus_range: 500,
    undervoltage: 150,
    overvoltage: 440,
    withstand_voltage: 600,
    least_resistance: 220,
    warning_temperature: 800,
    shutdown_temperature: 900,
    thermal_time_constant: 5_000,
};

/// This board.
#[derive(Debug)]
pub struct Kind;

impl BoardKind for Kind {
    const FACTS: Facts = Facts {
        frequency: bridge::PWM_FREQUENCY,
        dead_time: bridge::DEAD_TIME_NANOSECONDS,
        current_sensing: current_sense::SENSING,
        loop_timer_counts: loop_phase::COUNTS,
        sample_to_count: current_sense::HOLD_TO_COUNT_NANOSECONDS,
        encoder_rate: encoder::INCREMENTS_PER_SECOND,
        thermometers: &Thermometers::new(TemperatureSensor::Ntc5k, &DIVIDER, &DIVIDER),
    };
}
