//! The table against the cogging, from what was summed up.
//!
//! A bin is a mean over a point's width, and the table joins its points by lines: of a harmonic of `h` periods in `N` points they leave
//! `sinc(h / N)^3`, `1 - (pi h / N)^2 / 2`. Each point less an eighth of what its neighbours are above it makes that good but for the fourth
//! power: 99.9 % of 72 periods in 1 024 points, 98.8 % of 144, 91 % of 256.

use super::IdentificationError;
use super::cogging::{Bin, CoggingMeasurement};
use crate::axis::cogging::{COGGING_POINTS, CoggingScale, TABLE_BITS};

/// Points in 2^-17 of peak while they are put together.
#[derive(Debug)]
pub struct CoggingTable {
    points: [i16; COGGING_POINTS],
    taken: usize,
    /// Of the first bin: a load that pulls one way is not to fill the range of a point.
    first: i32,
    /// Sums over the points, less that of the first one, and over what differs between the directions.
    total: i64,
    differences: [i64; 2],
    /// Mean of both directions, and half their difference, of the last bin.
    last: Option<[i32; 2]>,
    fault: Option<IdentificationError>,
}

/// Least swing that tells of a load, in 2^-17 of peak: 0.1 % of it.
const NOISE: i64 = 131;

/// What may differ between the directions beside friction: 1 % of peak, rms.
const ROUGHNESS: i64 = 1_311;

impl CoggingTable {
    /// Of no bins yet.
    #[must_use]
    pub const fn new() -> Self {
        Self { points: [0; COGGING_POINTS], taken: 0, first: 0, total: 0, differences: [0; 2], last: None, fault: None }
    }

    /// Takes the next bin, from that of the index on. Divides.
    pub fn take(&mut self, bin: Bin) {
        let means = [false, true].map(|backwards| bin.mean(backwards, TABLE_BITS));
        let both = match means {
            [Some(there), Some(back)] => Some([there.saturating_add(back) >> 1, there.saturating_sub(back) >> 1]),
            // An encoder may have fewer increments than the table has points: then it is that of the point before.
            _ => self.last,
        };
        let Some([common, different]) = both else {
            self.fault = Some(IdentificationError::NoMovement);
            return;
        };
        self.last = both;
        if self.taken == 0 {
            self.first = common;
        }
        let above = common.saturating_sub(self.first);
        let point = i16::try_from(above).ok();
        if point.is_none() {
            self.fault = Some(out_of_range(above.into()));
        }
        if let Some(place) = self.points.get_mut(self.taken) {
            *place = point.unwrap_or(0);
        }
        self.total = self.total.saturating_add(above.into());
        let [sum, squares] = &mut self.differences;
        let different = i64::from(different);
        *sum = sum.saturating_add(different);
        *squares = squares.saturating_add(different.saturating_mul(different));
        self.taken = self.taken.saturating_add(1);
    }

    /// Puts the table together, in mA RMS for a scale; as many points as there are. Divides.
    ///
    /// # Errors
    /// * [`IdentificationError::OutOfRange`], in mA RMS, for cogging beyond a quarter of the peak current.
    /// * [`IdentificationError::UnevenLoad`] where the same place needed another current a revolution further, by an eighth of what cogging
    ///   was found and 0.1 % of peak, or where the two directions differ by more than cogging and 1 % of peak beside a constant.
    /// * [`IdentificationError::NoMovement`] where a bin is missing.
    pub fn finish(
        &mut self,
        measurement: &CoggingMeasurement,
        scale: &CoggingScale,
    ) -> Result<&[i16; COGGING_POINTS], IdentificationError> {
        const POINTS: i64 = COGGING_POINTS as i64;
        if let Some(fault) = self.fault {
            return Err(match fault {
                IdentificationError::OutOfRange { actual, .. } => in_milliamperes(actual, scale),
                fault => fault,
            });
        }
        if self.taken != COGGING_POINTS {
            return Err(IdentificationError::NoMovement);
        }
        let mean = (self.total / POINTS) as i32;
        self.look_at_the_load(measurement, mean)?;
        let widened = |point: i16| i32::from(point);
        let [first, .., last] = self.points;
        let (first, last) = (widened(first), widened(last));
        let (mut before, mut left) = (last, self.points.iter_mut().peekable());
        while let Some(place) = left.next() {
            let here = widened(*place);
            let after = left.peek().map_or(first, |next| widened(**next));
            let beside = before.saturating_add(after).saturating_sub(here.saturating_mul(2));
            // Rounded, in an eighth.
            let sharp = here.saturating_sub(beside.saturating_add(4) >> 3).saturating_sub(mean);
            let current = scale.milliamperes(sharp);
            if current.unsigned_abs() > u32::from(scale.largest()) {
                return Err(in_milliamperes(sharp.into(), scale));
            }
            before = here;
            *place = current as i16;
        }
        Ok(&self.points)
    }

    /// What is no cogging beside it.
    fn look_at_the_load(&self, measurement: &CoggingMeasurement, mean: i32) -> Result<(), IdentificationError> {
        const POINTS: i64 = COGGING_POINTS as i64;
        let (mut lowest, mut highest, mut power) = (i16::MAX, i16::MIN, 0_i64);
        for &point in &self.points {
            (lowest, highest) = (lowest.min(point), highest.max(point));
            let above = i64::from(point).saturating_sub(mean.into());
            power = power.saturating_add(above.saturating_mul(above) / POINTS);
        }
        let swing = i64::from(highest).saturating_sub(lowest.into());
        let [sum, squares] = self.differences;
        let constant = sum / POINTS;
        let differs = (squares / POINTS).saturating_sub(constant.saturating_mul(constant));
        let may_differ = power.saturating_add(ROUGHNESS.saturating_mul(ROUGHNESS));
        if measurement.unevenness() > (swing / 8).max(NOISE) || differs > may_differ {
            return Err(IdentificationError::UnevenLoad);
        }
        Ok(())
    }
}

impl Default for CoggingTable {
    fn default() -> Self {
        Self::new()
    }
}

/// In 2^-17 of peak, until the scale is known.
const fn out_of_range(actual: i64) -> IdentificationError {
    IdentificationError::OutOfRange { actual, minimum: 0, maximum: 0 }
}

fn in_milliamperes(point: i64, scale: &CoggingScale) -> IdentificationError {
    let largest = i64::from(scale.largest());
    let point = i32::try_from(point).unwrap_or(if point < 0 { i32::MIN } else { i32::MAX });
    IdentificationError::OutOfRange {
        actual: scale.milliamperes(point).into(),
        minimum: largest.wrapping_neg(),
        maximum: largest,
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::*;
    use std::f64::consts::TAU;
    use std::vec::Vec;

    /// Currents in shares of peak over an angle in revolutions, there and back, as bins of 400 samples.
    fn bins(current: impl Fn(f64, f64) -> f64) -> Vec<Bin> {
        (0..COGGING_POINTS)
            .map(|bin| {
                let sums = [1.0, -1.0].map(|direction| {
                    let sample = |n: i32| {
                        let place = (bin as f64 - 0.5 + (f64::from(n) + 0.5) / 400.0) / COGGING_POINTS as f64;
                        (current(place, direction) * 32_768.0).round()
                    };
                    (0..400).map(sample).sum::<f64>() as i32
                });
                Bin::new(sums, [400; 2])
            })
            .collect()
    }

    fn learnt(bins: &[Bin]) -> Result<[i16; COGGING_POINTS], IdentificationError> {
        let mut table = CoggingTable::new();
        bins.iter().for_each(|&bin| table.take(bin));
        table.finish(&CoggingMeasurement::default(), &scale()).copied()
    }

    /// Of 100 A, whose thousandth is 100 mA.
    fn scale() -> CoggingScale {
        CoggingScale::new(100_000).unwrap()
    }

    /// Amplitude of a harmonic of the lines between the points, in mA, over the sine that was given.
    fn harmonic(points: &[i16], periods: f64) -> f64 {
        let (mut sine, steps) = (0.0, 64);
        for place in 0..points.len() * steps {
            let (at, part) = (place / steps, (place % steps) as f64 / steps as f64);
            let value = f64::from(points[at]) * (1.0 - part) + f64::from(points[(at + 1) % points.len()]) * part;
            sine += value * (TAU * periods * place as f64 / (points.len() * steps) as f64).sin();
        }
        2.0 * sine / (points.len() * steps) as f64
    }

    #[test]
    fn friction_and_a_load_that_pulls_one_way_are_no_cogging() {
        for (load, friction) in [(0.0, 0.0), (0.35, 0.05), (-0.35, 0.1)] {
            let table = learnt(&bins(|place, direction| {
                load + friction * direction + 0.02 * (TAU * 36.0 * place).sin() + 0.01 * (TAU * place).sin()
            }))
            .unwrap();
            for (periods, milliamperes) in [(36.0, 2_000.0), (1.0, 1_000.0), (7.0, 0.0)] {
                let found = harmonic(&table, periods);
                assert!((found - milliamperes).abs() < 4.0, "{load}, {friction}, {periods} periods: {found} mA");
            }
            let mean = table.iter().map(|&point| f64::from(point)).sum::<f64>() / COGGING_POINTS as f64;
            assert!(mean.abs() < 2.0, "{mean} mA");
        }
    }

    #[test]
    fn what_bins_and_lines_take_of_a_harmonic_is_made_good() {
        for (periods, range) in [
            (1.0, 0.999..1.001),
            (24.0, 0.999..1.001),
            (72.0, 0.998..1.001),
            (144.0, 0.985..0.991),
            (256.0, 0.90..0.93),
        ] {
            let table = learnt(&bins(|place, _| 0.03 * (TAU * periods * place).sin())).unwrap();
            let kept = harmonic(&table, periods) / 3_000.0;
            assert!(range.contains(&kept), "{periods} periods: {kept}");
        }
    }

    #[test]
    fn cogging_of_more_than_a_quarter_of_the_peak_is_refused_with_its_current() {
        let found = learnt(&bins(|place, _| 0.26 * (TAU * 6.0 * place).sin()));
        assert!(
            matches!(
                found,
                Err(IdentificationError::OutOfRange {
                    actual: 25_000..=26_000 | -26_000..=-25_000,
                    minimum: -25_000,
                    maximum: 25_000,
                })
            ),
            "{found:?}"
        );
        assert!(learnt(&bins(|place, _| 0.24 * (TAU * 6.0 * place).sin())).is_ok());
    }

    #[test]
    fn a_load_that_is_another_one_in_the_other_direction_is_refused() {
        let rough =
            |amplitude: f64| learnt(&bins(|place, direction| direction * amplitude * (TAU * 3.0 * place).sin()));
        assert_eq!(rough(0.02).unwrap_err(), IdentificationError::UnevenLoad);
        assert!(rough(0.008).is_ok());
    }

    #[test]
    fn a_bin_without_a_visit_takes_the_point_before_and_none_at_all_is_no_movement() {
        let mut all = bins(|place, _| 0.02 * (TAU * 12.0 * place).sin());
        let whole = learnt(&all).unwrap();
        for missing in (5..COGGING_POINTS).step_by(9) {
            all[missing] = Bin::default();
        }
        let table = learnt(&all).unwrap();
        let worst = table.iter().zip(whole).map(|(one, other)| one.abs_diff(other)).max().unwrap();
        // A step of the steepest slope, 12 * 2 pi / 1024 of 2 A, and what the sharpening makes of it.
        assert!((100..200).contains(&worst), "{worst} mA");
        assert_eq!(learnt(&[Bin::default(); COGGING_POINTS]), Err(IdentificationError::NoMovement));
        assert_eq!(learnt(&all[..COGGING_POINTS - 1]), Err(IdentificationError::NoMovement));
    }
}
