//! Current sensors that follow as fast as they can.

use crate::exponential::decay;

/// The bandwidth of the current sensors and their filters: a delay of first order.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SensorBandwidth {
    /// Frequency in Hz at which the amplitude has fallen by 3 dB (data sheet); the time constant is `1 / (2 pi f)`.
    pub hertz: f64,
}

impl SensorBandwidth {
    pub(crate) fn check(&self) {
        assert!(self.hertz > 0.0, "the bandwidth of the current sensors must be positive");
    }

    /// What a sensor shows after `dt` in which the current went evenly from one value to another; exact for that.
    pub(crate) fn follow(&self, shown: f64, from: f64, to: f64, dt: f64) -> f64 {
        let time_constant = 1.0 / (core::f64::consts::TAU * self.hertz);
        let lag = (to - from) * time_constant / dt;
        to - lag + (shown - from + lag) * decay(dt / time_constant)
    }
}
