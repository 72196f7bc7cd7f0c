//! Amplitude and phase of one frequency in a series of samples.

use crate::arithmetic::trigonometry::Rotation;

/// Sum of samples, each turned back by the phase that the oscillation had at it. In 2^-15 of the unit of the samples; the amplitude is
/// twice the sum over the number of samples.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub(super) struct Phasor {
    pub(super) real: i64,
    pub(super) imaginary: i64,
}

impl Phasor {
    /// Takes a sample at this phase. Over whole periods a constant adds nothing.
    #[inline]
    pub(super) fn add(&mut self, sample: i32, phase: Rotation) {
        // Rounded: half a step of the cosine for all samples would let a constant through.
        let product = |factor: i32| i64::from(sample).wrapping_mul(i64::from(factor.saturating_add(1 << 15) >> 16));
        self.real = self.real.wrapping_add(product(phase.cosine));
        self.imaginary = self.imaginary.wrapping_sub(product(phase.sine));
    }

    /// Amplitude of the oscillation in `2^bits` samples, at most 12 % too high. In the unit of the samples, below 2^30.
    #[inline]
    pub(super) fn amplitude(&self, bits: u32) -> i32 {
        let part = |sum: i64| (sum >> bits.wrapping_add(14)).wrapping_abs() as i32;
        let (one, other) = (part(self.real), part(self.imaginary));
        one.max(other).wrapping_add(one.min(other) >> 1)
    }

    /// Imaginary part of the quotient `self / other` as numerator and denominator, which is not negative.
    pub(super) fn reactive_ratio(self, other: Self) -> (i128, i128) {
        let reduced = |value: i64| i128::from(value >> 12);
        let (a, b, c, d) = (reduced(self.real), reduced(self.imaginary), reduced(other.real), reduced(other.imaginary));
        (
            b.saturating_mul(c).saturating_sub(a.saturating_mul(d)),
            c.saturating_mul(c).saturating_add(d.saturating_mul(d)),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sum_has_amplitude_and_phase_of_the_oscillation_and_nothing_of_a_constant() {
        let mut phasor = Phasor::default();
        for tick in 0..64_u32 {
            let phase = f64::from(tick) * core::f64::consts::TAU / 16.0;
            let sample = 5e7 + 1e6 * (phase + 0.7).cos();
            phasor.add(sample as i32, Rotation::by(tick << 28));
        }
        let (real, imaginary) = (phasor.real as f64, phasor.imaginary as f64);
        let amplitude = 2.0 * real.hypot(imaginary) / 64.0 / 32_768.0;
        assert!((amplitude / 1e6 - 1.0).abs() < 5e-4, "{amplitude}");
        assert!((imaginary.atan2(real) - 0.7).abs() < 5e-4, "{}", imaginary.atan2(real));
        let rough = f64::from(phasor.amplitude(6)) / 1e6;
        assert!((0.999..1.12).contains(&rough), "{rough}");
    }

    #[test]
    fn the_reactive_part_is_that_of_the_quotient() {
        let current = Phasor { real: 3_000_000_000, imaginary: -1_000_000_000 };
        // times (2 + 0.5 j)
        let voltage = Phasor { real: 6_500_000_000, imaginary: -500_000_000 };
        let (numerator, denominator) = voltage.reactive_ratio(current);
        assert!((numerator as f64 / denominator as f64 - 0.5).abs() < 1e-5);
    }
}
