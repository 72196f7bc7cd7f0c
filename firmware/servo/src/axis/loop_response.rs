//! The open velocity loop as it was measured, frequency by frequency, and what can be read off it.

use crate::arithmetic::division::divide_rounding;
use crate::arithmetic::response::{FRACTION, Response, logarithm};

/// What was measured at one frequency.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct LoopPoint {
    /// In 0.01 Hz.
    pub frequency: u32,
    /// From the current to the movement of a tick.
    pub axis: Response,
    /// Of the open velocity loop with the gains and filters that were in force.
    pub open: Response,
}

/// Most frequencies of a sweep.
pub const LOOP_POINTS: usize = 64;

/// Points in the order of their frequencies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct LoopResponse {
    points: [LoopPoint; LOOP_POINTS],
    length: usize,
}

impl Default for LoopResponse {
    fn default() -> Self {
        Self { points: [LoopPoint::default(); LOOP_POINTS], length: 0 }
    }
}

/// The margins of an open loop.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Margins {
    /// Where the loop crosses 1 for the last time, in 0.01 Hz.
    pub crossing: u32,
    /// There against -180 degrees, in 2^-32 revolution.
    pub phase: i32,
    /// Where the phase passes -180 degrees behind it, in 0.01 Hz; 0: nowhere.
    pub turning: u32,
    /// What is left to 1 where the phase passes -180 degrees behind the crossing, as a logarithm to the base of 2 in 2^-16; the largest there is where it
    /// does not within the points.
    pub gain: i32,
}

/// A swing of the shaft against its load.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Resonance {
    /// In 0.01 Hz.
    pub frequency: u32,
    /// How far the axis answers more there than beside it, as a logarithm to the base of 2 in 2^-16.
    pub height: i32,
    /// Index of the point that is highest.
    pub index: usize,
}

impl LoopResponse {
    /// Takes a point; another one of the same frequency goes. One point too many is left out: `false`.
    pub fn insert(&mut self, point: LoopPoint) -> bool {
        let place = self.points().iter().position(|other| other.frequency >= point.frequency);
        let place = place.unwrap_or(self.length);
        if self.points().get(place).is_none_or(|other| other.frequency != point.frequency) {
            let Some(after) = self.points.get_mut(place..=self.length) else { return false };
            after.rotate_right(1);
            self.length = self.length.saturating_add(1);
        }
        if let Some(slot) = self.points.get_mut(place) {
            *slot = point;
        }
        true
    }

    /// The points.
    #[must_use]
    pub fn points(&self) -> &[LoopPoint] {
        self.points.get(..self.length).unwrap_or(&[])
    }

    /// The open loop at any frequency in 0.01 Hz; beyond the points that of the nearest.
    #[must_use]
    pub fn open_at(&self, frequency: u32) -> Response {
        let points = self.points();
        let after = points.iter().position(|point| point.frequency >= frequency);
        match after {
            Some(0) => points.first(),
            None => points.last(),
            Some(after) => {
                let pair = points.get(after.saturating_sub(1)).zip(points.get(after));
                let Some((low, high)) = pair else { return Response::ONE };
                return low.open.between(high.open, share(low.frequency, high.frequency, frequency));
            }
        }
        .map_or(Response::ONE, |point| point.open)
    }

    /// Exchanges the open loop for what `shaped` makes of it.
    pub fn reshape(&mut self, shaped: impl Fn(&LoopPoint) -> Response) {
        for point in self.points.iter_mut().take(self.length) {
            point.open = shaped(point);
        }
    }

    /// The margins of the open loop that `shaped` makes of the one at a point; `None`: it nowhere comes from above 1 to below.
    #[must_use]
    pub fn margins(&self, shaped: impl Fn(&LoopPoint) -> Response) -> Option<Margins> {
        let pairs = || self.points().windows(2).filter_map(|pair| Some((pair.first()?, pair.last()?)));
        let (low, high) = pairs().filter(|(low, high)| shaped(low).gain() >= 0 && shaped(high).gain() < 0).last()?;
        let (before, behind) = (shaped(low), shaped(high));
        let part = part(before.gain(), before.gain().saturating_sub(behind.gain()));
        let crossing = between(low.frequency, high.frequency, part);
        let phase = before.between(behind, part).negated().phase();
        let gain = pairs().filter(|(_, high)| high.frequency > crossing).find_map(|(low, high)| {
            // Above -180 degrees and below, the shorter way round.
            let [before, behind] = [shaped(low), shaped(high)];
            let [above, below] = [before, behind].map(|response| response.negated().phase());
            let passes = above >= 0 && below < 0 && above.wrapping_sub(below) >= 0;
            let share = crate::axis::loop_response::part(above, above.wrapping_sub(below));
            let left = || before.between(behind, share).gain().saturating_neg();
            passes.then(|| (between(low.frequency, high.frequency, share), left()))
        });
        let (turning, gain) = gain.unwrap_or((0, i32::MAX));
        Some(Margins { crossing, phase, turning, gain })
    }

    /// The first frequency at which the axis answers at least half as much again as beside it on either side, while its phase falls; `None`
    /// of a rigid one.
    ///
    /// What counts is its acceleration, which is the same at all frequencies of a rigid axis. The frequency is that of the parabola through the
    /// highest point and the two beside it.
    #[must_use]
    pub fn resonance(&self) -> Option<Resonance> {
        let points = self.points();
        let height = |index: usize| points.get(index).map_or(i32::MIN, accelerated);
        (1..points.len().saturating_sub(1)).find_map(|index| {
            let here = height(index);
            if height(index.saturating_sub(1)) >= here || height(index.saturating_add(1)) > here {
                return None;
            }
            // As far as nothing is higher.
            let least =
                |beside: &mut dyn Iterator<Item = usize>| beside.map(height).take_while(|&other| other <= here).min();
            let before = least(&mut (0..index).rev())?;
            let behind = least(&mut (index.saturating_add(1)..points.len()))?;
            let prominence = here.saturating_sub(before.max(behind));
            (prominence >= LEAST_HEIGHT && self.falls_around(index)).then(|| Resonance {
                frequency: self.peak(index),
                height: here.saturating_sub(before.max(behind)),
                index,
            })
        })
    }

    /// A resonance turns the phase by up to half a revolution; a wrong point in noise does not.
    fn falls_around(&self, index: usize) -> bool {
        let phase = |index: usize| self.points().get(index).map_or(0, |point| point.axis.phase());
        // From point to point it turns by less than a half, but not over both.
        let turn = |from: usize| i64::from(phase(from.saturating_add(1)).wrapping_sub(phase(from)));
        turn(index.saturating_sub(1)).saturating_add(turn(index)) < -LEAST_TURN
    }

    /// The vertex of the parabola through three points over the logarithm of the frequency, in 0.01 Hz.
    fn peak(&self, index: usize) -> u32 {
        let Some([low, middle, high]) =
            self.points().get(index.saturating_sub(1)..).and_then(|rest| rest.first_chunk())
        else {
            return 0;
        };
        let place = |point: &LoopPoint| i128::from(logarithm(point.frequency.into()).unwrap_or(0));
        let height = |point: &LoopPoint| i128::from(accelerated(point));
        let (left, right) = (place(middle).saturating_sub(place(low)), place(high).saturating_sub(place(middle)));
        let (down, up) = (height(middle).saturating_sub(height(low)), height(middle).saturating_sub(height(high)));
        // x = (down right^2 - up left^2) / (2 (down right + up left)), from the middle on.
        let numerator = down
            .saturating_mul(right)
            .saturating_mul(right)
            .saturating_sub(up.saturating_mul(left).saturating_mul(left));
        let denominator = down.saturating_mul(right).saturating_add(up.saturating_mul(left)).saturating_mul(2);
        let shift = divide_rounding(numerator, denominator) as i32;
        crate::arithmetic::response::scaled(middle.frequency, shift)
    }
}

/// 3.5 dB.
const LEAST_HEIGHT: i32 = 38_336;
/// 30 degrees.
const LEAST_TURN: i64 = 357_913_941;

/// What the axis makes of a current, as a logarithm of its acceleration.
fn accelerated(point: &LoopPoint) -> i32 {
    point.axis.gain().saturating_add(logarithm(point.frequency.into()).unwrap_or(0))
}

/// `part / whole` in 2^-16; of nothing it is all.
fn part(part: i32, whole: i32) -> i32 {
    if whole == 0 { 1 << FRACTION } else { divide_rounding(i128::from(part) << FRACTION, whole.into()) as i32 }
}

/// Where a frequency lies between two others, over the logarithm, in 2^-16.
fn share(low: u32, high: u32, frequency: u32) -> i32 {
    let [low, high, here] = [low, high, frequency].map(|frequency| logarithm(frequency.into()).unwrap_or(0));
    part(here.saturating_sub(low), high.saturating_sub(low))
}

/// The frequency at a share of the way between two others, over the logarithm.
fn between(low: u32, high: u32, share: i32) -> u32 {
    let [from, to] = [low, high].map(|frequency| logarithm(frequency.into()).unwrap_or(0));
    let way = i64::from(to.saturating_sub(from)).saturating_mul(share.into()) >> FRACTION;
    crate::arithmetic::response::scaled(low, way as i32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::f64::consts::{PI, TAU};

    fn response(real: f64, imaginary: f64) -> Response {
        let in_bits = |part: f64| (part * 1_099_511_627_776.0) as i64;
        Response::of_vector(in_bits(real), in_bits(imaginary)).unwrap().over(Response::new(40 << 16, 0))
    }

    fn quotient(a: (f64, f64), b: (f64, f64)) -> (f64, f64) {
        let square = b.0 * b.0 + b.1 * b.1;
        ((a.0 * b.0 + a.1 * b.1) / square, (a.1 * b.0 - a.0 * b.1) / square)
    }

    /// `crossing / s` late by `delay`, with a load that swings at `resonance` (0: none) and stands at 0.7 of it.
    fn measured(crossing: f64, delay: f64, resonance: f64, damping: f64) -> LoopResponse {
        let mut measured = LoopResponse::default();
        for n in 0..48 {
            let hertz = 10.0 * 200_f64.powf(f64::from(n) / 47.0);
            let s = TAU * hertz;
            let swing = |at: f64| {
                let w = TAU * at;
                (1.0 - s * s / (w * w), 2.0 * damping * s / w)
            };
            let elastic =
                if resonance == 0.0 { (1.0, 0.0) } else { quotient(swing(0.7 * resonance), swing(resonance)) };
            let (sine, cosine) = (-PI / 2.0 - s * delay).sin_cos();
            let gain = TAU * crossing / s;
            let rigid = (gain * cosine, gain * sine);
            let open = (rigid.0 * elastic.0 - rigid.1 * elastic.1, rigid.0 * elastic.1 + rigid.1 * elastic.0);
            let open = response(open.0, open.1);
            assert!(measured.insert(LoopPoint { frequency: (hertz * 100.0).round() as u32, axis: open, open }));
        }
        measured
    }

    #[test]
    fn the_margins_of_an_integrator_with_a_delay_are_those_of_its_formula() {
        for (crossing, delay) in [(50.0, 400e-6), (150.0, 400e-6), (30.0, 1.5e-3)] {
            let margins = measured(crossing, delay, 0.0, 0.0).margins(|point| point.open).unwrap();
            assert!((f64::from(margins.crossing) / 100.0 / crossing - 1.0).abs() < 2e-3, "{margins:?}");
            let phase = f64::from(margins.phase) / 4_294_967_296.0 * 360.0;
            assert!((phase - 90.0 + 360.0 * crossing * delay).abs() < 0.5, "{phase} degrees");
            // A quarter of a revolution late.
            let expected = (0.25 / delay / crossing).log2();
            assert!((f64::from(margins.gain) / 65_536.0 - expected).abs() < 0.02, "{margins:?}");
        }
        assert_eq!(measured(5.0, 0.0, 0.0, 0.0).margins(|point| point.open), None, "it crosses before the first point");
    }

    #[test]
    fn a_resonance_is_found_within_two_per_cent_and_a_rigid_axis_has_none() {
        for (resonance, damping) in [(60.0, 0.05), (137.0, 0.03), (420.0, 0.07), (900.0, 0.05), (1_500.0, 0.02)] {
            let found = measured(50.0, 400e-6, resonance, damping).resonance();
            let found = found.unwrap_or_else(|| panic!("{resonance} Hz"));
            let off = f64::from(found.frequency) / 100.0 / resonance - 1.0;
            assert!(off.abs() < 0.04, "{resonance} Hz: {found:?}");
        }
        assert_eq!(measured(50.0, 400e-6, 0.0, 0.0).resonance(), None);
        assert_eq!(measured(50.0, 400e-6, 300.0, 0.7).resonance(), None, "a swing that nobody sees");
    }

    #[test]
    fn points_lie_in_order_whatever_their_order_and_there_is_an_end_of_them() {
        let mut response = LoopResponse::default();
        let point = |frequency: u32| LoopPoint { frequency, ..LoopPoint::default() };
        for n in 0..LOOP_POINTS as u32 {
            assert!(response.insert(point(1 + n * 37 % 64)));
        }
        assert!(response.points().windows(2).all(|pair| pair[0].frequency < pair[1].frequency));
        assert!(response.insert(point(5)), "in the place of another");
        assert!(!response.insert(point(100)));
        assert_eq!(response.points().len(), LOOP_POINTS);
        let open = Response::new(1 << 16, 0);
        response = LoopResponse::default();
        response.insert(LoopPoint { open, ..point(100) });
        response.insert(LoopPoint { open: Response::ONE, ..point(400) });
        assert_eq!(response.open_at(200).gain(), 1 << 15);
        assert_eq!((response.open_at(10), response.open_at(1_000)), (open, Response::ONE));
    }
}
