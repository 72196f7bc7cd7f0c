//! What the converter of the board sees: 12 bit samples of currents and bus voltage; `thermometer` has those of the temperatures.

use crate::noise::Noise;
use crate::turn::floor;

/// The sample of 0 A without offset.
const MIDDLE: f64 = 2_048.0;
/// The largest sample.
const LARGEST: i64 = 4_095;

/// Sensors of the three phase currents, positive into the motor. A sample is
/// `2048 + offset + current * 2048 / range * (1 + gain_error) + noise`, rounded and clipped.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CurrentSensors {
    /// The current in A of 2048 counts.
    pub range: f64,
    /// Offset of each phase in counts.
    pub offset: [f64; 3],
    /// Relative error of each phase's gain.
    pub gain_error: [f64; 3],
    /// Standard deviation of a sample's noise in counts.
    pub noise: f64,
}

impl CurrentSensors {
    pub(crate) fn check(&self) {
        assert!(self.range > 0.0, "the range of the current sensors must be positive");
    }

    pub(crate) fn samples(&self, currents: [f64; 3], noise: Noise, instant: u64) -> [u16; 3] {
        core::array::from_fn(|k| {
            let current = currents[k] * (MIDDLE / self.range) * (1.0 + self.gain_error[k]);
            quantise(MIDDLE + self.offset[k] + current + self.noise * noise.at(k as u64, instant))
        })
    }
}

/// The sample of a bus voltage, with a sensor of so many V at 4096 counts.
pub(crate) fn bus_sample(voltage: f64, range: f64) -> u16 {
    quantise(voltage * 4_096.0 / range)
}

/// The sample of a level in counts.
pub(crate) fn quantise(counts: f64) -> u16 {
    floor(counts + 0.5).clamp(0, LARGEST) as u16
}
