//! Cogging of the magnets on the teeth, and an EMF that is no sine.

use crate::frame::{Dq, sine_and_cosine};

/// Torque of the magnets on the stator's teeth, with or without current: `amplitude * sin(2 pi (per_revolution * angle + phase))`, summed.
///
/// The angle is that of the motor shaft in revolutions, from where the encoder counts. Of `s` slots and `p` poles the first harmonic is the least
/// common multiple of both (Hanselman, Brushless Permanent Magnet Motor Design, cogging torque); a stator that is not round adds multiples
/// of the poles, an eccentric rotor those of the slots.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cogging {
    /// Harmonics over the mechanical revolution.
    pub harmonics: [TorqueHarmonic; 2],
}

/// A torque that comes again so many times a revolution.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TorqueHarmonic {
    /// Periods per revolution of the shaft.
    pub per_revolution: u32,
    /// In Nm.
    pub amplitude: f64,
    /// At angle zero, in periods.
    pub phase: f64,
}

/// Harmonics of the EMF: a phase's is `-w flux (sin a + fifth * sin 5a + seventh * sin 7a)` at the electrical angle `a` of its axis. With the same
/// currents they make the torque ripple of six periods an electrical revolution, and no power goes lost between the two.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EmfHarmonics {
    /// Amplitude of the fifth as a share of the fundamental's; negative turns its phase.
    pub fifth: f64,
    /// The same of the seventh.
    pub seventh: f64,
}

impl Cogging {
    /// A single harmonic of a motor with so many slots and poles, of an amplitude in Nm.
    ///
    /// # Panics
    /// Without slots or poles.
    #[must_use]
    pub fn of(slots: u32, poles: u32, amplitude: f64) -> Self {
        assert!(slots > 0 && poles > 0, "a motor has slots and poles");
        let (mut divisor, mut rest) = (slots, poles);
        while rest > 0 {
            (divisor, rest) = (rest, divisor % rest);
        }
        let first = TorqueHarmonic { per_revolution: slots / divisor * poles, amplitude, phase: 0.0 };
        Self { harmonics: [first, TorqueHarmonic { amplitude: 0.0, ..first }] }
    }

    /// In Nm, in counting direction.
    pub(crate) fn torque(&self, angle: f64) -> f64 {
        let harmonic = |h: &TorqueHarmonic| {
            let (sine, _) = sine_and_cosine(f64::from(h.per_revolution) * angle + h.phase);
            h.amplitude * sine
        };
        self.harmonics.iter().map(harmonic).sum()
    }
}

impl EmfHarmonics {
    /// What the harmonics add to the flux that induces along and across the magnet, in Vs, at an electrical angle in turns. Both meet as the
    /// sixth: the fifth runs against the rotor, the seventh with it.
    pub(crate) fn flux(&self, flux: f64, turns: f64) -> Dq {
        let (sine, cosine) = sine_and_cosine(6.0 * turns);
        Dq { d: -flux * (self.fifth + self.seventh) * sine, q: flux * (self.seventh - self.fifth) * cosine }
    }

    /// Torque in Nm of the harmonics with a current, for such a flux.
    pub(crate) fn torque(pole_pairs: u32, flux: Dq, current: Dq) -> f64 {
        1.5 * f64::from(pole_pairs) * (flux.d * current.d + flux.q * current.q)
    }
}
