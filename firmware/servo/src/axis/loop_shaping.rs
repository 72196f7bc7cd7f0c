//! Gains of the velocity loop from its measured frequency response: the fastest loop that keeps the margins which were asked for.
//!
//! The loop that was measured has all delays in it, and all filters that stay. What is exchanged is a factor: the integral part of
//! before against that of a candidate, a filter that goes against one that comes, and the gain.
//!
//! A candidate crosses 1 at a frequency, with an integral action time of 4 / crossing as the rule of [`velocity_gains`](super::velocity_gains) has
//! it. It is taken where at every point that was measured
//!
//! * below half the crossing its phase has not fallen past -180 degrees,
//! * from there on its phase stays away from -180 degrees: by the phase margin where the loop is 1 and more, by nothing where it is less than the gain margin leaves,
//!   and by a line over the logarithm in between,
//! * and from twice the crossing on it is below 1.
//!
//! Candidates are tried from above, one a step: a step is some thousand instructions a point.

use super::filter::FilterSection;
use super::loop_response::{LoopPoint, LoopResponse, Margins, Resonance};
use super::tuning::{NOISE_DAMPING, is_felt, noise_filter};
use super::velocity_rate::VelocityRate;
use crate::arithmetic::division::{TEN_TO_15, TWO_PI_TIMES_TEN_TO_15, divide_rounding};
use crate::arithmetic::response::{Response, decibels, degrees, of_decibels, scaled};
use crate::arithmetic::trigonometry::Rotation;

/// What is known of an axis, and what is wanted of its velocity loop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ShapingRequest {
    /// Degrees, at least.
    pub phase_margin: u16,
    /// In 0.1 dB, at least.
    pub gain_margin: u16,
    /// S-0-0100 in mA s/rad while the loop was measured.
    pub gain: u32,
    /// S-0-0101 in 0.1 ms then; 0: without integral part.
    pub integral_time: u16,
    /// How often the velocity loop runs.
    pub rate: VelocityRate,
    /// Of the differences that the measured velocity is made of, in Hz: those of a tick behind a velocity filter, those of a step without.
    pub differences: u32,
    /// Increments of the encoder in a revolution, and the peak current in the unit of the gain.
    pub increments: u32,
    /// In mA.
    pub peak_current: u32,
    /// The section in force that may be exchanged for the low-pass of [`noise_filter`]; `None`: both are somebody's own.
    pub exchanged: Option<FilterSection>,
    /// A section is free for a notch.
    pub has_room: bool,
}

impl ShapingRequest {
    /// The margins that are asked for.
    #[must_use]
    pub fn margins(&self) -> Margins {
        let gain = of_decibels(i32::from(self.gain_margin).saturating_mul(10));
        Margins { phase: turn(self.phase_margin), gain, ..Margins::default() }
    }

    /// The same once more for a loop that works with `shaped` and falls short of the margins by so much, in the units of [`Margins`].
    #[must_use]
    pub fn with_more(&self, shaped: &Shaped, phase: i32, gain: i32) -> Self {
        let degrees = (degrees(phase.max(0)) / 100).saturating_add(2) as u16;
        let tenths = (decibels(gain.max(0)) / 10).saturating_add(5) as u16;
        Self {
            phase_margin: self.phase_margin.saturating_add(degrees),
            gain_margin: self.gain_margin.saturating_add(tenths),
            gain: shaped.gain,
            integral_time: shaped.integral_time,
            exchanged: self.exchanged.map(|_| shaped.low_pass),
            has_room: self.has_room && shaped.notch == FilterSection::Off,
            ..*self
        }
    }
}

/// What was found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Shaped {
    /// S-0-0100 in mA s/rad.
    pub gain: u32,
    /// S-0-0101 in 0.1 ms.
    pub integral_time: u16,
    /// In place of the section that could be exchanged.
    pub low_pass: FilterSection,
    /// [`FilterSection::Off`]: none is needed.
    pub notch: FilterSection,
    /// Of the loop that was worked out.
    pub margins: Margins,
}

impl Shaped {
    /// Makes of the loop that was measured for `request` the one that this is.
    pub fn put_into(&self, request: &ShapingRequest, measured: &mut LoopResponse) {
        let Self { integral_time, low_pass, notch, .. } = *self;
        let exchange = Exchange { request, integral_time, low_pass, notch };
        let raised = ratio(self.gain, request.gain);
        measured.reshape(|point| exchange.open(point.frequency, point.open).then(raised));
    }
}

/// The search, a candidate a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Shaping {
    request: ShapingRequest,
    /// Crossing of the next candidate in 0.01 Hz.
    candidate: u32,
    resonance: Option<Resonance>,
    notch: FilterSection,
    /// The best one without a notch.
    plain: Option<Shaped>,
}

/// From one candidate to the next: 2^(-1/12).
const STEP: i32 = -5_461;
/// No candidate is faster than 700 Hz, nor slower than 5 Hz.
const FASTEST: u32 = 70_000;
const SLOWEST: u32 = 500;

impl Shaping {
    /// Begins with the fastest candidate, without a notch.
    #[must_use]
    pub fn new(request: ShapingRequest, measured: &LoopResponse) -> Self {
        Self { request, candidate: FASTEST, resonance: measured.resonance(), notch: FilterSection::Off, plain: None }
    }

    /// Tries a candidate. `Some`: the search is over, with the best one, or with none that keeps the margins. Divides.
    pub fn step(&mut self, measured: &LoopResponse) -> Option<Option<Shaped>> {
        let found = self.try_candidate(measured);
        self.candidate = scaled(self.candidate, STEP);
        if found.is_none() && self.candidate >= SLOWEST {
            return None;
        }
        if self.notch != FilterSection::Off {
            // A notch has to be worth it.
            let faster = match (found, self.plain) {
                (Some(with), Some(without)) => {
                    let least = scaled(without.margins.crossing, WORTH);
                    if with.margins.crossing > least { Some(with) } else { Some(without) }
                }
                (with, without) => with.or(without),
            };
            return Some(faster);
        }
        self.plain = found;
        let Some(notch) = self.resonance.filter(|_| self.request.has_room).map(notch_of) else { return Some(found) };
        self.notch = notch;
        self.candidate = FASTEST;
        None
    }

    fn try_candidate(&self, measured: &LoopResponse) -> Option<Shaped> {
        let request = &self.request;
        let integral_time = integral_time_of(self.candidate);
        // Without the low-pass, whose gain at the crossing is 1 but for a few thousandths.
        let without = Exchange { request, integral_time, low_pass: FilterSection::Off, notch: self.notch };
        let rough = without.gain_for(measured, self.candidate);
        let low_pass = request.exchanged.map_or(FilterSection::Off, |_| {
            if is_felt(rough, request.increments, request.peak_current, request.differences) {
                FilterSection::LowPass { frequency: noise_filter(self.candidate / 100), damping: NOISE_DAMPING }
            } else {
                FilterSection::Off
            }
        });
        let exchange = Exchange { low_pass, ..without };
        let gain = exchange.gain_for(measured, self.candidate);
        if gain == 0 || gain > HIGHEST_GAIN || is_too_loud(gain, request) {
            return None;
        }
        let raised = ratio(gain, request.gain);
        let open = |point: &LoopPoint| exchange.open(point.frequency, point.open).then(raised);
        let keeps = measured.points().iter().all(|point| self.keeps_margins(point.frequency, open(point)));
        let margins = measured.margins(open)?;
        let asked = request.margins();
        let wanted = margins.phase >= asked.phase && margins.gain >= asked.gain;
        (keeps && wanted).then_some(Shaped { gain, integral_time, low_pass, notch: self.notch, margins })
    }

    fn keeps_margins(&self, frequency: u32, open: Response) -> bool {
        if frequency < self.candidate / 2 {
            // Two integrators with noise on them, but not beyond.
            return open.negated().phase() > turn(10).saturating_neg();
        }
        // The whole of it at 1 and above, and none of it where the gain margin begins.
        let Margins { phase, gain: margin, .. } = self.request.margins();
        let share = i64::from(open.gain().saturating_add(margin).clamp(0, margin));
        let kept = i64::from(phase).saturating_mul(share);
        let is_near = i64::from(open.negated().phase()).abs().saturating_mul(margin.into()) < kept;
        let is_behind = frequency >= self.candidate.saturating_mul(2);
        !is_near && (!is_behind || open.gain() < 0)
    }
}

/// A notch that makes the loop faster by less than a tenth is left out.
const WORTH: i32 = 9_011;
/// Of S-0-0100.
const HIGHEST_GAIN: u32 = 6_553_500;

/// At the resonance, as deep as that is high, and half as wide as it is far.
fn notch_of(resonance: Resonance) -> FilterSection {
    let tenths = (resonance.frequency.saturating_add(5) / 10).clamp(100, 35_000) as u16;
    let width = (tenths / 2).clamp(100, 20_000);
    let depth = scaled(10_000, resonance.height.saturating_neg()).clamp(500, 10_000) as u16;
    FilterSection::Notch { frequency: tenths, width, depth }
}

/// 4 / (2 pi f) in 0.1 ms, of 0.01 Hz.
fn integral_time_of(crossing: u32) -> u16 {
    let time = divide_rounding(
        TEN_TO_15.saturating_mul(4_000_000),
        TWO_PI_TIMES_TEN_TO_15.saturating_mul(crossing.max(1).into()),
    );
    time.clamp(1, u16::MAX.into()) as u16
}

/// One count of the encoder in a difference would make more than a quarter of the peak current.
fn is_too_loud(gain: u32, request: &ShapingRequest) -> bool {
    let step = i128::from(gain).saturating_mul(TWO_PI_TIMES_TEN_TO_15).saturating_mul(request.differences.into());
    let most = i128::from(request.peak_current).saturating_mul(request.increments.into()).saturating_mul(TEN_TO_15) / 4;
    step > most
}

/// Degrees in 2^-32 revolution.
fn turn(degrees: u16) -> i32 {
    ((i64::from(degrees) << 32) / 360).min(i32::MAX.into()) as i32
}

/// One gain against another.
fn ratio(gain: u32, before: u32) -> Response {
    let [gain, before] = [gain, before].map(|gain| Response::of_vector(gain.into(), 0).unwrap_or(Response::ONE));
    gain.over(before)
}

/// What takes the place of what was in the loop while it was measured.
struct Exchange<'a> {
    request: &'a ShapingRequest,
    integral_time: u16,
    low_pass: FilterSection,
    notch: FilterSection,
}

impl Exchange<'_> {
    /// The open loop with the gain of before.
    fn open(&self, frequency: u32, measured: Response) -> Response {
        let before =
            self.request.exchanged.map_or(Response::ONE, |section| of_section(section, frequency, self.request.rate));
        measured
            .over(of_integral(self.request.integral_time, frequency))
            .over(before)
            .then(of_integral(self.integral_time, frequency))
            .then(of_section(self.low_pass, frequency, self.request.rate))
            .then(of_section(self.notch, frequency, self.request.rate))
    }

    /// The gain that crosses here.
    fn gain_for(&self, measured: &LoopResponse, crossing: u32) -> u32 {
        let open = self.open(crossing, measured.open_at(crossing));
        scaled(self.request.gain, open.gain().saturating_neg())
    }
}

/// `1 + 1 / (s T)`, of a time in 0.1 ms and a frequency in 0.01 Hz.
fn of_integral(time: u16, frequency: u32) -> Response {
    if time == 0 {
        return Response::ONE;
    }
    // 2 pi f T in 2^-24, of 10^-6.
    let turned = i128::from(time).saturating_mul(frequency.into()).saturating_mul(TWO_PI_TIMES_TEN_TO_15) << 24;
    let real = divide_rounding(turned, TEN_TO_15.saturating_mul(1_000_000)).max(1);
    // (j x + 1) / (j x)
    let quarter = Response::new(0, 1 << 30);
    let above = Response::of_vector(1 << 24, real).unwrap_or(Response::ONE);
    above.over(Response::of_vector(real, 0).unwrap_or(Response::ONE)).over(quarter)
}

/// A section at a frequency in 0.01 Hz, transformed as `filter` does it. Frequencies of a section are in 0.1 Hz.
fn of_section(section: FilterSection, frequency: u32, rate: VelocityRate) -> Response {
    let half = |hundredths: u32| {
        let steps = i128::from(rate.hertz()).saturating_mul(200);
        Rotation::by(divide_rounding(i128::from(hundredths) << 32, steps) as u32)
    };
    let tangent = |rotation: Rotation| {
        divide_rounding(i128::from(rotation.sine) << 24, i128::from(rotation.cosine).max(1)).max(1)
    };
    let in_24 = |a: i64, b: i64| (i128::from(a).saturating_mul(b.into()) >> 24) as i64;
    let over = |a: i64, b: i64| divide_rounding(i128::from(a) << 24, b.into());
    let here = tangent(half(frequency));
    let vector = |real: i64, imaginary: i64| Response::of_vector(real, imaginary).unwrap_or(Response::ONE);
    const ONE: i64 = 1 << 24;
    match section {
        FilterSection::Off => Response::ONE,
        FilterSection::LowPass { frequency, damping } => {
            let x = over(here, tangent(half(u32::from(frequency).saturating_mul(10))));
            let damped = in_24(x, over(i64::from(damping).saturating_mul(2), 1_000));
            vector(ONE, 0).over(vector(ONE.saturating_sub(in_24(x, x)), damped))
        }
        FilterSection::Notch { frequency, width, depth } => {
            let [centre, wide] = [frequency, width].map(|tenths| tangent(half(u32::from(tenths).saturating_mul(10))));
            let x = over(here, centre);
            // Width (1 + w^2) / w.
            let band = over(in_24(wide, ONE.saturating_add(in_24(centre, centre))), centre);
            let damped = in_24(band, x);
            let kept = in_24(damped, over(depth.into(), 10_000));
            let real = ONE.saturating_sub(in_24(x, x));
            vector(real, kept).over(vector(real, damped))
        }
    }
}

#[cfg(test)]
mod tests;
