//! What this board is built with, for the firmware above it.

use drive::{BoardKind, Facts, TemperatureSensor};

use crate::{bridge, current_sense, encoder, loop_phase};

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
        // 500 counts at 0 degrees C, 10 counts a kelvin, -40 to 250 degrees C.
        temperature_sensor: TemperatureSensor {
            zero_counts: 500,
            millicounts_per_kelvin: 10_000,
            lowest_sample: 100,
            highest_sample: 3_000,
        },
    };
}
