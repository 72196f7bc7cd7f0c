//! Shunts in the emitters of the low-side transistors.

use crate::exponential::decay;
use crate::inverter::Inverter;

/// Natural logarithm of 100: so many time constants settle to 1 %.
const TO_ONE_PERCENT: f64 = 4.605_170_185_988_091;

/// Shunts through which a phase's current flows only while its low-side transistor conducts. The amplifier behind begins at zero with each
/// pulse; the converter holds its output in the middle of the pulse, as the board does, and needs it to stand still for the sampling time
/// before.
///
/// A current into the motor flows through the shunt in the dead time as well, by the lower diode; it is not counted on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LowSideShunts {
    /// Of the amplifier, from a step to 1 % of it, in seconds (data sheet, settling time). The amplifier is of first order, with a time constant of
    /// this over ln 100.
    pub settling_time: f64,
    /// Of the converter, in seconds.
    pub sampling_time: f64,
}

impl LowSideShunts {
    pub(crate) fn check(&self) {
        assert!(self.settling_time > 0.0, "the settling time of a shunt's amplifier must be positive");
        assert!(self.sampling_time >= 0.0, "the sampling time must not be negative");
    }

    /// Seconds that are left of the window: half the off time of the high side, less dead time, settling and sampling. Below zero the sample is
    /// of an amplifier that has not settled to 1 %.
    ///
    /// `share` is that of the period in which the high side is closed.
    #[must_use]
    pub fn window(&self, inverter: &Inverter, share: f64) -> f64 {
        self.before_sampling(inverter, share) - self.settling_time
    }

    /// Seconds from the low side's turning on to the begin of sampling.
    fn before_sampling(&self, inverter: &Inverter, share: f64) -> f64 {
        0.5 * (1.0 - share) * inverter.period - inverter.dead_time - self.sampling_time
    }

    /// The current in A that the converter is shown.
    pub(crate) fn shown(&self, inverter: &Inverter, bridge: bool, share: f64, current: f64) -> f64 {
        if !bridge {
            // A current into the motor comes through the lower diode, one out of it goes through the upper.
            return current.max(0.0);
        }
        let time = self.before_sampling(inverter, share).max(0.0);
        current * (1.0 - decay(time * TO_ONE_PERCENT / self.settling_time))
    }
}
