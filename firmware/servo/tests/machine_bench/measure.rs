//! What is read off a recording: sines, steps, ripple.

use std::f64::consts::TAU;

/// Part of a recording that swings with one frequency.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Phasor {
    pub(crate) real: f64,
    pub(crate) imaginary: f64,
}

impl Phasor {
    /// Of values that come `rate` times a second and last a whole number of periods of `hertz`.
    pub(crate) fn of(values: &[f64], hertz: f64, rate: f64) -> Self {
        let scale = 2.0 / values.len() as f64;
        let (mut real, mut imaginary) = (0.0, 0.0);
        for (n, value) in values.iter().enumerate() {
            let angle = TAU * hertz * n as f64 / rate;
            real += value * angle.cos() * scale;
            imaginary -= value * angle.sin() * scale;
        }
        Self { real, imaginary }
    }

    pub(crate) fn amplitude(self) -> f64 {
        self.real.hypot(self.imaginary)
    }

    /// In degrees.
    pub(crate) fn phase(self) -> f64 {
        self.imaginary.atan2(self.real).to_degrees()
    }

    pub(crate) fn over(self, other: Self) -> Self {
        let square = other.real * other.real + other.imaginary * other.imaginary;
        Self {
            real: (self.real * other.real + self.imaginary * other.imaginary) / square,
            imaginary: (self.imaginary * other.real - self.real * other.imaginary) / square,
        }
    }
}

pub(crate) fn decibels(gain: f64) -> f64 {
    20.0 * gain.log10()
}

/// A frequency near `hertz` of which whole periods fill `length` values at `rate`.
pub(crate) fn whole_periods(hertz: f64, length: usize, rate: f64) -> f64 {
    let seconds = length as f64 / rate;
    (hertz * seconds).round() / seconds
}

/// A response to a step, one value a sample.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Step {
    /// Samples from 10 % to 90 %, interpolated.
    pub(crate) rise: f64,
    /// Share of the step.
    pub(crate) overshoot: f64,
    /// Samples until the response stays within 5 %.
    pub(crate) settling: f64,
}

impl Step {
    /// Of values from the command on, that lead from one level to another.
    pub(crate) fn of(values: &[f64], from: f64, to: f64) -> Self {
        let share: Vec<f64> = values.iter().map(|value| (value - from) / (to - from)).collect();
        let reached = |level: f64| {
            let after = share.iter().position(|&value| value >= level).expect("the step gets there");
            if after == 0 {
                return 0.0;
            }
            after as f64 - (share[after] - level) / (share[after] - share[after - 1])
        };
        Self {
            rise: reached(0.9) - reached(0.1),
            overshoot: share.iter().copied().fold(f64::MIN, f64::max) - 1.0,
            settling: share.iter().rposition(|value| (value - 1.0).abs() > 0.05).map_or(0.0, |last| last as f64 + 1.0),
        }
    }
}

pub(crate) fn largest(values: impl IntoIterator<Item = f64>) -> f64 {
    values.into_iter().fold(0.0, |largest, value| largest.max(value.abs()))
}

pub(crate) fn highest(values: impl IntoIterator<Item = f64>) -> f64 {
    values.into_iter().fold(f64::MIN, f64::max)
}

pub(crate) fn lowest(values: impl IntoIterator<Item = f64>) -> f64 {
    values.into_iter().fold(f64::MAX, f64::min)
}

pub(crate) fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// Root of the mean square of what leaves the mean.
pub(crate) fn deviation(values: &[f64]) -> f64 {
    let mean = mean(values);
    mean_square(values.iter().map(|value| value - mean)).sqrt()
}

fn mean_square(values: impl ExactSizeIterator<Item = f64>) -> f64 {
    let number = values.len() as f64;
    values.map(|value| value * value).sum::<f64>() / number
}

/// Prints a measured figure and demands it within a range.
#[track_caller]
pub(crate) fn within(what: &str, value: f64, range: std::ops::Range<f64>) {
    println!("{what}: {value:.4}");
    assert!(range.contains(&value), "{what}: {value}, expected {range:?}");
}
