//! Filters of the torque-producing current command: two second-order sections between the velocity loop and the current loop.
//!
//! A low-pass takes away what the encoder's steps make of a high velocity gain, a notch the resonance of an elastic shaft.
//!
//! ```text
//! low-pass  H(s) = w^2 / (s^2 + 2 d w s + w^2)                        d: damping
//! notch     H(s) = (s^2 + k b s + w^2) / (s^2 + b s + w^2)            k: depth, b: width
//! ```
//!
//! Both are transformed bilinearly, so that the frequency, and the width of a notch whose depth is 0, are exact at the rate of the loop too.
//!
//! A section is the direct form 1 of [`idsp`] with 32 bits of the output's fraction fed back: rounding makes neither a dead band nor a
//! limit cycle. Samples pass it in 2^-28 of peak: that leaves the sum of its five products, at most 7 times peak, inside the accumulator,
//! and the limit to +-peak is applied to a true value, never to a wrapped one.

use dsp_fixedpoint::Q32;
use dsp_process::SplitProcess;
use idsp::iir::{Biquad, BiquadClamp, DirectForm1Wide};

use crate::arithmetic::division::divide_rounding;
use crate::arithmetic::trigonometry::Rotation;
use crate::axis::velocity_rate::VelocityRate;
use crate::error::{SettingsError, in_range};

/// A second-order section.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum FilterSection {
    /// Lets everything pass, bit for bit.
    #[default]
    Off,
    /// Lets low frequencies pass.
    LowPass {
        /// Frequency where the phase is -90 degrees, in 0.1 Hz, 100 ..= 35 000.
        frequency: u16,
        /// Damping in 0.001, 200 ..= 2 000; 707: the frequency is that of -3 dB, without peak.
        damping: u16,
    },
    /// Takes a band away.
    Notch {
        /// Centre frequency in 0.1 Hz, 100 ..= 35 000.
        frequency: u16,
        /// Width between the -3 dB points of a notch of depth 0, in 0.1 Hz, 100 ..= 20 000.
        width: u16,
        /// What the centre frequency keeps, in 0.01 %, 0 ..= 10 000.
        depth: u16,
    },
}

/// The coefficients of both sections.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct CurrentFilterSettings {
    /// One of the sections is on.
    is_active: bool,
    /// `None`: off.
    sections: [Option<Coefficients>; 2],
}

impl CurrentFilterSettings {
    /// Works out the coefficients. Divides. From 20 Hz on, frequencies and widths are at most 0.3 % off, at 10 Hz 0.6 %.
    ///
    /// # Errors
    /// [`SettingsError::OutOfRange`] names the first value outside the range that [`FilterSection`] states.
    pub fn new([first, second]: [FilterSection; 2], rate: VelocityRate) -> Result<Self, SettingsError> {
        let sections = [Coefficients::new(first, rate)?, Coefficients::new(second, rate)?];
        Ok(Self { is_active: sections.iter().any(Option::is_some), sections })
    }

    /// Whether a tick changes anything: while it does not, ticks may be left out until [`CurrentFilter::reset`].
    #[inline]
    #[must_use]
    pub const fn is_active(&self) -> bool {
        self.is_active
    }
}

/// State of both sections.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct CurrentFilter {
    sections: [SectionState; 2],
}

impl CurrentFilter {
    /// Starts at rest.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Goes on as if `current`, in 2^-31 of peak, had flowed for ever: the start of a command that is not zero makes no bump.
    pub fn reset(&mut self, current: i32) {
        self.sections = [SectionState::at_rest(current); 2];
    }

    /// One step of the velocity loop: a sample in and out, in 2^-31 of peak. What a section would raise above peak stays at peak.
    #[inline]
    pub fn tick(&mut self, settings: &CurrentFilterSettings, current: i32) -> i32 {
        let mut sample = current;
        for (section, state) in settings.sections.iter().zip(&mut self.sections) {
            if let Some(coefficients) = section {
                sample = state.tick(coefficients, sample);
            } else {
                // A section that is switched on while current flows finds it here.
                *state = SectionState::at_rest(sample);
            }
        }
        sample
    }
}

/// `[b0, b1, b2, a1, a2]` in 2^-29, the feedback with the sign in which it is added.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
struct Coefficients([i32; 5]);

/// Fraction bits of a coefficient: 2 must be representable.
const FRACTION: i8 = 29;
/// The factor 1 of a coefficient.
const UNIT: i64 = 1 << FRACTION;
/// Bits that a sample loses inside a section.
const HEADROOM: u32 = 3;
/// Peak current inside a section.
const PEAK: i32 = 1 << (31 - HEADROOM);

impl Coefficients {
    fn new(section: FilterSection, rate: VelocityRate) -> Result<Option<Self>, SettingsError> {
        let frequency_in_range = |frequency: u16| in_range("filter frequency", frequency.into(), 100, 35_000);
        Ok(match section {
            FilterSection::Off => None,
            FilterSection::LowPass { frequency, damping } => {
                let frequency = frequency_in_range(frequency)?;
                Some(Self::low_pass(frequency, in_range("filter damping", damping.into(), 200, 2_000)?, rate))
            }
            FilterSection::Notch { frequency, width, depth } => {
                let frequency = frequency_in_range(frequency)?;
                let width = in_range("filter width", width.into(), 100, 20_000)?;
                Some(Self::notch(frequency, width, in_range("filter depth", depth.into(), 0, 10_000)?, rate))
            }
        })
    }

    /// With s and c of half the angle that the frequency turns by in a step, and n = 1 + 2 d s c:
    /// b0 = b2 = s^2 / n, b1 = 2 b0, a2 = -(1 - 2 d s c) / n, and a1 such that all five add up to 1, the gain at 0 Hz.
    fn low_pass(frequency: u32, damping: u32, rate: VelocityRate) -> Self {
        let half = half_angle(frequency, rate);
        let one = 1_i128 << 62;
        let square = i128::from(half.sine).saturating_mul(half.sine.into());
        let product = i128::from(half.sine).saturating_mul(half.cosine.into());
        let damped = product.saturating_mul(damping.into()).saturating_mul(2) / 1_000;
        let denominator = one.saturating_add(damped);
        let b0 = coefficient(square, denominator);
        let a2 = coefficient(damped.saturating_sub(one), denominator);
        let a1 = UNIT.saturating_sub(b0.saturating_mul(4)).saturating_sub(a2);
        Self([b0, b0.saturating_mul(2), b0, a1, a2].map(|value| value as i32))
    }

    /// With s and c of half the angle of the width, w the angle of the frequency and n = c + s:
    /// b0 = (c + k s) / n, b2 = (c - k s) / n, b1 = -2 c cos w / n = -a1, and a2 such that all five add up to 1.
    fn notch(frequency: u32, width: u32, depth: u32, rate: VelocityRate) -> Self {
        let half = half_angle(frequency, rate);
        let width = half_angle(width, rate);
        let one = 1_i128 << 62;
        // 1 - 2 sin^2(w/2), because near 0 Hz the cosine itself has lost the frequency.
        let cosine = one.saturating_sub(i128::from(half.sine).saturating_mul(half.sine.into()).saturating_mul(2)) >> 31;
        let (pass, stop) = (i128::from(width.cosine), i128::from(width.sine));
        let kept = stop.saturating_mul(depth.into()) / 10_000;
        let denominator = pass.saturating_add(stop);
        let b0 = coefficient(pass.saturating_add(kept), denominator);
        let b2 = coefficient(pass.saturating_sub(kept), denominator);
        let a1 = coefficient(cosine.saturating_mul(pass).saturating_mul(2), denominator << 31);
        let a2 = UNIT.saturating_sub(b0).saturating_sub(b2);
        Self([b0, a1.saturating_neg(), b2, a1, a2].map(|value| value as i32))
    }
}

/// Half the angle by which a frequency in 0.1 Hz turns in a step.
fn half_angle(frequency: u32, rate: VelocityRate) -> Rotation {
    // Below a quarter of a revolution up to 4 kHz.
    Rotation::by(divide_rounding(i128::from(frequency) << 32, i128::from(rate.hertz()).saturating_mul(20)) as u32)
}

/// A quotient of magnitude 2 or less as a coefficient.
fn coefficient(numerator: i128, denominator: i128) -> i64 {
    divide_rounding(numerator << FRACTION, denominator)
}

/// The last two inputs in 2^-28 of peak and outputs in 2^-60 of peak, the newest first.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
struct SectionState {
    inputs: [i32; 2],
    outputs: [i64; 2],
}

impl SectionState {
    fn at_rest(current: i32) -> Self {
        let input = inside(current);
        Self { inputs: [input; 2], outputs: [i64::from(input) << 32; 2] }
    }

    #[inline]
    fn tick(&mut self, coefficients: &Coefficients, current: i32) -> i32 {
        let section = BiquadClamp {
            coeff: Biquad { ba: coefficients.0.map(Q32::<FRACTION>::from_bits) },
            u: 0,
            min: -PEAK,
            max: PEAK,
        };
        let mut state = DirectForm1Wide { x: self.inputs, y: self.outputs };
        section.process(&mut state, inside(current));
        *self = Self { inputs: state.x, outputs: state.y };
        let [newest, _] = state.y;
        let output = newest.wrapping_add(1 << (31 - HEADROOM)) >> (32 - HEADROOM);
        output.clamp(i32::MIN.into(), i32::MAX.into()) as i32
    }
}

/// A sample inside a section, to the nearest.
#[inline]
fn inside(current: i32) -> i32 {
    current.saturating_add(1 << (HEADROOM - 1)) >> HEADROOM
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::f64::consts::{PI, TAU};
    use proptest::prelude::*;

    const LOW_PASS: FilterSection = FilterSection::LowPass { frequency: 4_000, damping: 500 };
    const NOTCH: FilterSection = FilterSection::Notch { frequency: 6_500, width: 2_000, depth: 1_000 };
    const FREQUENCIES: [f64; 5] = [50.0, 300.0, 640.0, 1_200.0, 3_000.0];

    const RATES: [VelocityRate; 2] = [VelocityRate::EachTick, VelocityRate::TwiceATick];

    fn settings(first: FilterSection, second: FilterSection, rate: VelocityRate) -> CurrentFilterSettings {
        CurrentFilterSettings::new([first, second], rate).unwrap()
    }

    /// Real and imaginary part of the response to a sine of an amplitude, over a second that follows a second of settling.
    fn measured(settings: &CurrentFilterSettings, hertz: f64, rate: VelocityRate) -> (f64, f64) {
        let amplitude = 400_000_000.0;
        let mut filter = CurrentFilter::new();
        let (mut real, mut imaginary) = (0.0, 0.0);
        let second = rate.hertz();
        for step in 0..2 * second {
            let angle = TAU * hertz * f64::from(step) / f64::from(second);
            let output = f64::from(filter.tick(settings, (amplitude * angle.cos()) as i32));
            if step >= second {
                real += output * angle.cos() * 2.0 / f64::from(second) / amplitude;
                imaginary -= output * angle.sin() * 2.0 / f64::from(second) / amplitude;
            }
        }
        (real, imaginary)
    }

    /// (numerator, denominator) of the transfer function at the frequency that the bilinear transformation makes of `hertz`.
    fn ideal(section: FilterSection, hertz: f64, rate: VelocityRate) -> (f64, f64) {
        let warped = |hertz: f64| (PI * hertz / f64::from(rate.hertz())).tan();
        let s = warped(hertz);
        // (a + jb) / (c + jd)
        let (a, b, c, d) = match section {
            FilterSection::Off => (1.0, 0.0, 1.0, 0.0),
            FilterSection::LowPass { frequency, damping } => {
                let w = warped(f64::from(frequency) / 10.0);
                (w * w, 0.0, w * w - s * s, 2.0 * f64::from(damping) / 1_000.0 * w * s)
            }
            FilterSection::Notch { frequency, width, depth } => {
                let w = warped(f64::from(frequency) / 10.0);
                let b = warped(f64::from(width) / 10.0) * (1.0 + w * w);
                (w * w - s * s, f64::from(depth) / 10_000.0 * b * s, w * w - s * s, b * s)
            }
        };
        let square = c * c + d * d;
        ((a * c + b * d) / square, (b * c - a * d) / square)
    }

    fn assert_ideal(section: FilterSection, hertz: f64, tolerance: f64) {
        for rate in RATES {
            let (real, imaginary) = measured(&settings(section, FilterSection::Off, rate), hertz, rate);
            let (ideal_real, ideal_imaginary) = ideal(section, hertz, rate);
            let error = (real - ideal_real).hypot(imaginary - ideal_imaginary);
            assert!(
                error < tolerance,
                "{section:?} at {hertz} Hz, {rate:?}: {real} {imaginary}, not {ideal_real} {ideal_imaginary}"
            );
        }
    }

    #[test]
    fn a_low_pass_answers_sines_like_its_transfer_function_in_amplitude_and_phase() {
        for hertz in FREQUENCIES {
            assert_ideal(LOW_PASS, hertz, 5e-4);
        }
        for rate in RATES {
            let (real, imaginary) = measured(&settings(LOW_PASS, FilterSection::Off, rate), 400.0, rate);
            assert!(real.abs() < 1e-3 && (imaginary + 1.0).abs() < 1e-3, "a damping of 0.5: {real} {imaginary}");
        }
    }

    #[test]
    fn a_notch_answers_sines_like_its_transfer_function_in_amplitude_and_phase() {
        for hertz in FREQUENCIES {
            assert_ideal(NOTCH, hertz, 5e-4);
        }
        for rate in RATES {
            let (real, imaginary) = measured(&settings(NOTCH, FilterSection::Off, rate), 650.0, rate);
            assert!((real - 0.1).abs() < 1e-3 && imaginary.abs() < 1e-3, "a tenth is kept: {real} {imaginary}");
        }
        assert_ideal(FilterSection::Notch { frequency: 6_500, width: 100, depth: 0 }, 650.0, 5e-3);
    }

    #[test]
    fn at_the_ends_of_the_range_the_frequency_is_still_that_of_the_setting() {
        for (section, hertz, tolerance) in [
            (FilterSection::LowPass { frequency: 100, damping: 700 }, 10.0, 6e-3),
            (FilterSection::LowPass { frequency: 200, damping: 700 }, 20.0, 3e-3),
            (FilterSection::LowPass { frequency: 35_000, damping: 700 }, 3_500.0, 1e-3),
            (FilterSection::Notch { frequency: 35_000, width: 20_000, depth: 0 }, 3_000.0, 1e-3),
            (FilterSection::Notch { frequency: 100, width: 100, depth: 0 }, 16.0, 6e-3),
        ] {
            assert_ideal(section, hertz, tolerance);
        }
    }

    #[test]
    fn two_sections_multiply() {
        for (hertz, rate) in FREQUENCIES.into_iter().flat_map(|hertz| RATES.map(|rate| (hertz, rate))) {
            let (real, imaginary) = measured(&settings(LOW_PASS, NOTCH, rate), hertz, rate);
            let (a, b) = ideal(LOW_PASS, hertz, rate);
            let (c, d) = ideal(NOTCH, hertz, rate);
            let error = (real - (a * c - b * d)).hypot(imaginary - (a * d + b * c));
            assert!(error < 1e-3, "{hertz} Hz: {error}");
        }
    }

    #[test]
    fn a_constant_passes_exactly_from_either_side_and_does_not_swing() {
        let slow = FilterSection::LowPass { frequency: 100, damping: 200 };
        let narrow = FilterSection::Notch { frequency: 100, width: 100, depth: 0 };
        for section in [LOW_PASS, NOTCH, slow, narrow] {
            let settings = settings(section, FilterSection::Off, VelocityRate::TwiceATick);
            for (before, constant) in [(0, 800), (1_600, 800), (1 << 30, 8), (i32::MIN, 8), (0, 1_000_000_000)] {
                let mut filter = CurrentFilter::new();
                filter.reset(before);
                for _ in 0..32_000 {
                    filter.tick(&settings, constant);
                }
                for _ in 0..1_000 {
                    let output = filter.tick(&settings, constant);
                    assert!(output.abs_diff(constant) <= 1, "{section:?} from {before}: {output}, not {constant}");
                }
            }
        }
    }

    #[test]
    fn a_start_at_a_current_makes_no_bump() {
        let settings = settings(LOW_PASS, NOTCH, VelocityRate::TwiceATick);
        let mut filter = CurrentFilter::new();
        filter.reset(-1_234_567_890);
        for _ in 0..100 {
            assert!((filter.tick(&settings, -1_234_567_890) + 1_234_567_890).abs() <= 8);
        }
        let mut filter = CurrentFilter::new();
        filter.tick(&CurrentFilterSettings::default(), 1_000_000_000);
        assert_eq!(filter.tick(&settings, 1_000_000_000), 1_000_000_000, "nor does a section that is switched on");
    }

    #[test]
    fn a_resonant_low_pass_stands_at_peak_and_comes_back_like_one_that_was_never_limited() {
        let resonant = FilterSection::LowPass { frequency: 1_000, damping: 200 };
        let settings = settings(resonant, FilterSection::Off, VelocityRate::EachTick);
        let mut filter = CurrentFilter::new();
        let (mut highest, mut lowest) = (0, 0);
        for tick in 0..8_000 {
            let square = if tick / 40 % 2 == 0 { i32::MAX } else { i32::MIN };
            let output = filter.tick(&settings, square);
            assert!(tick < 40 || tick % 40 < 39 || (output > 0) == (square > 0), "{tick}: wrapped to {output}");
            highest = highest.max(output);
            lowest = lowest.min(output);
        }
        assert!(highest == i32::MAX && lowest == i32::MIN, "{highest} {lowest}");
        for _ in 0..2_000 {
            filter.tick(&settings, 0);
        }
        assert_eq!(filter.tick(&settings, 0), 0);
    }

    #[test]
    fn values_out_of_range_are_refused_by_name() {
        let refused =
            |section| CurrentFilterSettings::new([FilterSection::Off, section], VelocityRate::EachTick).unwrap_err();
        let out_of_range =
            |parameter, actual, minimum, maximum| SettingsError::OutOfRange { parameter, actual, minimum, maximum };
        assert_eq!(
            refused(FilterSection::LowPass { frequency: 99, damping: 700 }),
            out_of_range("filter frequency", 99, 100, 35_000)
        );
        assert_eq!(
            refused(FilterSection::LowPass { frequency: 100, damping: 199 }),
            out_of_range("filter damping", 199, 200, 2_000)
        );
        assert_eq!(
            refused(FilterSection::Notch { frequency: 100, width: 20_001, depth: 0 }),
            out_of_range("filter width", 20_001, 100, 20_000)
        );
        assert_eq!(
            refused(FilterSection::Notch { frequency: 100, width: 100, depth: 10_001 }),
            out_of_range("filter depth", 10_001, 0, 10_000)
        );
    }

    fn section() -> impl Strategy<Value = FilterSection> {
        prop_oneof![
            (100_u16..=35_000, 200_u16..=2_000)
                .prop_map(|(frequency, damping)| FilterSection::LowPass { frequency, damping }),
            (100_u16..=35_000, 100_u16..=20_000, 0_u16..=10_000)
                .prop_map(|(frequency, width, depth)| FilterSection::Notch { frequency, width, depth }),
        ]
    }

    proptest! {
        #[test]
        fn off_is_exact_to_the_bit(samples in proptest::collection::vec(any::<i32>(), 1..50)) {
            let mut filter = CurrentFilter::new();
            for sample in samples {
                prop_assert_eq!(filter.tick(&CurrentFilterSettings::default(), sample), sample);
            }
        }

        /// The same arithmetic without limits of width: what differs has overflowed.
        #[test]
        fn no_full_scale_input_overflows(
            section in section(), twice: bool, periods in proptest::collection::vec(1_usize..60, 1..40),
        ) {
            let settings = settings(section, FilterSection::Off, RATES[usize::from(twice)]);
            let Some(Coefficients(ba)) = settings.sections[0] else { unreachable!() };
            let [b0, b1, b2, a1, a2] = ba.map(|value| f64::from(value) / UNIT as f64);
            let mut filter = CurrentFilter::new();
            let (mut x, mut y) = ([0.0; 2], [0.0; 2]);
            for (index, period) in periods.into_iter().enumerate() {
                let square = if index % 2 == 0 { i32::MAX } else { i32::MIN };
                for _ in 0..period {
                    let input = f64::from(inside(square)) / f64::from(PEAK);
                    let exact = b0 * input + b1 * x[0] + b2 * x[1] + a1 * y[0] + a2 * y[1];
                    let limited = exact.clamp(-1.0, 1.0);
                    let output = f64::from(filter.tick(&settings, square)) / 2_147_483_648.0;
                    // Rounding adds up to some 1e-5 in a narrow section; an overflow is a whole.
                    prop_assert!((output - limited).abs() < 1e-4, "{} {}", output, limited);
                    x = [input, x[0]];
                    y = [limited, y[0]];
                }
            }
        }
    }
}
