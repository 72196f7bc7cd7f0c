//! The rotor's frame of reference: currents and voltages along the magnet (d) and across it (q).

use crate::turn::floor;

/// Half the square root of three.
const SINE_OF_THIRD: f64 = 0.866_025_403_784_438_6;

/// A quantity in the rotor's frame; its length is the amplitude of the phase quantity.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Dq {
    pub(crate) d: f64,
    pub(crate) q: f64,
}

impl Dq {
    /// Half way between two values.
    pub(crate) fn mean(self, other: Self) -> Self {
        Self { d: 0.5 * (self.d + other.d), q: 0.5 * (self.q + other.q) }
    }

    /// The square of the length.
    pub(crate) fn square(self) -> f64 {
        self.d * self.d + self.q * self.q
    }
}

/// Cosine and sine of the angle from each phase's axis to the d axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Frame {
    pub(crate) cosines: [f64; 3],
    pub(crate) sines: [f64; 3],
}

impl Frame {
    /// The frame when the d axis is so many electrical turns ahead of the axis of the first phase.
    pub(crate) fn at(turns: f64) -> Self {
        let (sine, cosine) = sine_and_cosine(turns);
        Self {
            cosines: [
                cosine,
                SINE_OF_THIRD * sine - 0.5 * cosine, //
                -SINE_OF_THIRD * sine - 0.5 * cosine,
            ],
            sines: [
                sine,
                -SINE_OF_THIRD * cosine - 0.5 * sine, //
                SINE_OF_THIRD * cosine - 0.5 * sine,
            ],
        }
    }

    /// The phases' share of a quantity.
    pub(crate) fn phases(&self, quantity: Dq) -> [f64; 3] {
        core::array::from_fn(|k| quantity.d * self.cosines[k] - quantity.q * self.sines[k])
    }

    /// A quantity of the phases, without what is common to all three.
    pub(crate) fn dq(&self, phases: [f64; 3]) -> Dq {
        let along = |axes: &[f64; 3]| 2.0 / 3.0 * (phases[0] * axes[0] + phases[1] * axes[1] + phases[2] * axes[2]);
        Dq { d: along(&self.cosines), q: -along(&self.sines) }
    }
}

/// Sine and cosine of an angle in turns, from additions and multiplications alone: the C library's differ in the last bit between machines.
/// The error is below 1e-15.
pub(crate) fn sine_and_cosine(turns: f64) -> (f64, f64) {
    let quarter = floor(4.0 * turns + 0.5);
    let x = (turns - 0.25 * quarter as f64) * core::f64::consts::TAU;
    let sine = x * series(x * x, &SINE_FACTORS);
    let cosine = series(x * x, &COSINE_FACTORS);
    // The remainder of a negative number by 4 is wanted positive.
    match quarter & 3 {
        0 => (sine, cosine),
        1 => (cosine, -sine),
        2 => (-sine, -cosine),
        _ => (-cosine, sine),
    }
}

/// Between the terms of the sine: 1 / (n (n + 1)) for even n.
const SINE_FACTORS: [f64; 8] = factors(2.0);
/// Between the terms of the cosine: the same for odd n.
const COSINE_FACTORS: [f64; 8] = factors(1.0);

const fn factors(first: f64) -> [f64; 8] {
    let mut factors = [0.0; 8];
    let (mut k, mut n) = (0, first);
    while k < 8 {
        factors[k] = 1.0 / (n * (n + 1.0));
        n += 2.0;
        k += 1;
    }
    factors
}

/// 1 - square f0 (1 - square f1 (1 - ...)).
fn series(square: f64, factors: &[f64; 8]) -> f64 {
    factors.iter().rev().fold(1.0, |inner, factor| 1.0 - square * factor * inner)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sine_and_cosine_are_those_of_the_library() {
        for n in -4_000..=4_000 {
            let turns = f64::from(n) / 1_000.0 + 0.000_3;
            let (sine, cosine) = sine_and_cosine(turns);
            let (expected_sine, expected_cosine) = (turns * core::f64::consts::TAU).sin_cos();
            // The library's argument is itself off by half a last bit of 25 rad.
            assert!((sine - expected_sine).abs() < 5e-15, "{turns}: {sine} instead of {expected_sine}");
            assert!((cosine - expected_cosine).abs() < 5e-15, "{turns}: {cosine} instead of {expected_cosine}");
        }
    }

    #[test]
    fn the_phases_follow_each_other_by_a_third_of_a_turn() {
        let frame = Frame::at(0.1);
        for (phase, axis) in [0.1, 0.1 - 1.0 / 3.0, 0.1 - 2.0 / 3.0].into_iter().enumerate() {
            let (sine, cosine) = (axis * core::f64::consts::TAU).sin_cos();
            assert!((frame.cosines[phase] - cosine).abs() < 1e-14, "phase {phase}");
            assert!((frame.sines[phase] - sine).abs() < 1e-14, "phase {phase}");
        }
    }

    #[test]
    fn there_and_back_is_the_same_and_what_is_common_falls_out() {
        let frame = Frame::at(0.37);
        let quantity = Dq { d: 3.0, q: -4.0 };
        let phases = frame.phases(quantity);
        assert!(phases.iter().sum::<f64>().abs() < 1e-14);
        let back = frame.dq(phases.map(|phase| phase + 100.0));
        assert!((back.d - 3.0).abs() < 1e-12 && (back.q + 4.0).abs() < 1e-12, "{back:?}");
    }
}
