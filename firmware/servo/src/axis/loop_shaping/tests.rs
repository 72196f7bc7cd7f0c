//! Loops of formulas in f64: what is found keeps what was asked for, and nothing faster does.

use super::*;
use crate::axis::filter::{CurrentFilter, CurrentFilterSettings};
use core::f64::consts::TAU;

type Complex = (f64, f64);

fn product(a: Complex, b: Complex) -> Complex {
    (a.0 * b.0 - a.1 * b.1, a.0 * b.1 + a.1 * b.0)
}

fn quotient(a: Complex, b: Complex) -> Complex {
    let square = b.0 * b.0 + b.1 * b.1;
    ((a.0 * b.0 + a.1 * b.1) / square, (a.1 * b.0 - a.0 * b.1) / square)
}

/// A load that swings; the axis alone crosses at this many Hz with a gain of 1 000.
#[derive(Clone, Copy)]
struct Axis {
    crossing: f64,
    delay: f64,
    resonance: f64,
    damping: f64,
}

const RIGID: Axis = Axis { crossing: 20.0, delay: 450e-6, resonance: 0.0, damping: 0.0 };

impl Axis {
    /// With a gain in mA s/rad and an integral action time in 0.1 ms.
    fn open(&self, hertz: f64, gain: f64, integral_time: f64) -> Complex {
        let s = TAU * hertz;
        let swing = |at: f64| (1.0 - (hertz / at).powi(2), 2.0 * self.damping * hertz / at);
        let elastic = match self.resonance {
            0.0 => (1.0, 0.0),
            at => quotient(swing(0.7 * at), swing(at)),
        };
        let gain = gain / 1_000.0 * self.crossing / hertz;
        let late = ((-s * self.delay).cos(), (-s * self.delay).sin());
        let controller = product((0.0, -gain), (1.0, -1.0 / (s * integral_time * 1e-4)));
        product(product(controller, late), elastic)
    }

    fn measured(&self) -> LoopResponse {
        let mut measured = LoopResponse::default();
        for n in 0..48 {
            let hertz = 10.0 * 200_f64.powf(f64::from(n) / 47.0);
            let of = |(real, imaginary): Complex| {
                let in_bits = |part: f64| (part * 1_099_511_627_776.0) as i64;
                Response::of_vector(in_bits(real), in_bits(imaginary)).unwrap().over(Response::new(40 << 16, 0))
            };
            let open = of(self.open(hertz, 1_000.0, 400.0));
            let axis = of(self.open(hertz, 1_000.0, 1e9));
            assert!(measured.insert(LoopPoint { frequency: (hertz * 100.0).round() as u32, axis, open }));
        }
        measured
    }
}

fn request() -> ShapingRequest {
    ShapingRequest {
        phase_margin: 45,
        gain_margin: 80,
        gain: 1_000,
        integral_time: 400,
        rate: VelocityRate::EachTick,
        differences: 8_000,
        increments: 1 << 20,
        peak_current: 60_000,
        exchanged: Some(FilterSection::Off),
        has_room: true,
    }
}

fn shaped(request: ShapingRequest, axis: &Axis) -> Option<Shaped> {
    let measured = axis.measured();
    let mut shaping = Shaping::new(request, &measured);
    for _ in 0..500 {
        if let Some(found) = shaping.step(&measured) {
            return found;
        }
    }
    panic!("the search has no end");
}

/// Phase margin in degrees and gain margin in dB of the loop in f64.
fn margins(axis: &Axis, shaped: &Shaped) -> (f64, f64) {
    let open = |hertz: f64| {
        let filters = [shaped.low_pass, shaped.notch].map(|section| {
            let response = of_section(section, (hertz * 100.0).round() as u32, VelocityRate::EachTick);
            let gain = (f64::from(response.gain()) / 65_536.0).exp2();
            let angle = f64::from(response.phase()) / 4_294_967_296.0 * TAU;
            (gain * angle.cos(), gain * angle.sin())
        });
        let open = axis.open(hertz, shaped.gain.into(), shaped.integral_time.into());
        product(product(open, filters[0]), filters[1])
    };
    let hertz = (0..20_000).map(|n| 10.0 * 200_f64.powf(f64::from(n) / 20_000.0));
    let (mut phase, mut gain) = (f64::MAX, f64::MAX);
    let mut before: Option<Complex> = None;
    for hertz in hertz {
        let now = open(hertz);
        let angle = now.1.atan2(now.0).to_degrees();
        if let Some(last) = before {
            let crosses = (last.0.hypot(last.1) >= 1.0) != (now.0.hypot(now.1) >= 1.0);
            if crosses {
                phase = phase.min((angle + 180.0).rem_euclid(360.0).min(180.0));
            }
            if last.1 < 0.0 && now.1 >= 0.0 && now.0 < 0.0 {
                gain = gain.min(-20.0 * now.0.hypot(now.1).log10());
            }
        }
        before = Some(now);
    }
    (phase, gain)
}

#[test]
fn a_rigid_axis_is_made_as_fast_as_its_delay_lets_it() {
    let found = shaped(request(), &RIGID).unwrap();
    let (phase, gain) = margins(&RIGID, &found);
    // A candidate faster would be six per cent beyond one of the two.
    assert!((44.9..50.0).contains(&phase) && gain >= 7.9, "{phase} degrees, {gain} dB: {found:?}");
    let reported = f64::from(found.margins.phase) / 4_294_967_296.0 * 360.0;
    assert!((reported - phase).abs() < 0.5, "{reported} and {phase} degrees");
    let reported = f64::from(found.margins.gain) / 65_536.0 * 6.0206;
    assert!((reported - gain).abs() < 0.2, "{reported} and {gain} dB");
    assert_eq!((found.notch, found.low_pass), (FilterSection::Off, FilterSection::Off));
    // 45 degrees are 90 - atan(1/4) - 360 f 450 us.
    let crossing = f64::from(found.margins.crossing) / 100.0;
    assert!((178.0..195.0).contains(&crossing), "{crossing} Hz");
}

#[test]
fn more_margin_is_a_slower_loop() {
    let asked = |phase_margin, gain_margin| {
        shaped(ShapingRequest { phase_margin, gain_margin, ..request() }, &RIGID).unwrap().margins.crossing
    };
    let [loose, phase, gain] = [asked(45, 60), asked(60, 60), asked(45, 140)];
    assert!(loose > phase * 5 / 4 && loose > gain * 5 / 4, "{loose}, {phase}, {gain}");
}

#[test]
fn a_resonance_gets_a_notch_where_that_makes_the_loop_faster_and_room_is_left() {
    let axis = Axis { resonance: 500.0, damping: 0.04, ..RIGID };
    let with = shaped(request(), &axis).unwrap();
    let FilterSection::Notch { frequency, .. } = with.notch else { panic!("{with:?}") };
    assert!((4_780..5_220).contains(&frequency), "{frequency}");
    let without = shaped(ShapingRequest { has_room: false, ..request() }, &axis).unwrap();
    assert_eq!(without.notch, FilterSection::Off);
    assert!(with.margins.crossing > without.margins.crossing * 11 / 10, "{with:?} {without:?}");
    for found in [with, without] {
        let (phase, gain) = margins(&axis, &found);
        assert!(phase > 42.0 && gain > 6.5, "{phase} degrees, {gain} dB: {found:?}");
    }
}

#[test]
fn a_coarse_encoder_gets_a_low_pass_and_no_more_than_a_quarter_of_the_peak_current_for_a_count() {
    let coarse = ShapingRequest { increments: 10_000, peak_current: 200_000, ..request() };
    let found = shaped(coarse, &RIGID).unwrap();
    assert!(matches!(found.low_pass, FilterSection::LowPass { .. }), "{found:?}");
    let (phase, gain) = margins(&RIGID, &found);
    assert!(phase > 44.0 && gain > 7.8, "{phase} degrees, {gain} dB: {found:?}");
    let loud = ShapingRequest { peak_current: 20_000, ..coarse };
    let quiet = shaped(loud, &RIGID).unwrap();
    let step = f64::from(quiet.gain) * TAU / 10_000.0 / 125e-6 / 20_000.0;
    assert!((0.23..0.25).contains(&step), "{step} of the peak current for a count");
    let kept = shaped(ShapingRequest { exchanged: None, ..coarse }, &RIGID).unwrap();
    assert_eq!(kept.low_pass, FilterSection::Off, "both sections are somebody's own");
}

#[test]
fn an_axis_that_nothing_holds_is_told_of() {
    assert_eq!(shaped(request(), &Axis { delay: 0.02, ..RIGID }), None);
}

const RATES: [VelocityRate; 2] = [VelocityRate::EachTick, VelocityRate::TwiceATick];

#[test]
fn a_section_is_what_the_filter_makes_of_a_sine() {
    for section in [
        FilterSection::LowPass { frequency: 2_000, damping: 707 },
        FilterSection::Notch { frequency: 5_000, width: 2_500, depth: 2_000 },
    ] {
        for (hertz, rate) in [50.0, 180.0, 470.0, 1_200.0].into_iter().flat_map(|hertz| RATES.map(|rate| (hertz, rate)))
        {
            let settings = CurrentFilterSettings::new([section, FilterSection::Off], rate).unwrap();
            let second = rate.hertz();
            let mut filter = CurrentFilter::new();
            let (mut real, mut imaginary) = (0.0, 0.0);
            for step in 0..2 * second {
                let angle = TAU * hertz * f64::from(step) / f64::from(second);
                let output = f64::from(filter.tick(&settings, (4e8 * angle.cos()) as i32)) / 4e8;
                if step >= second {
                    real += output * angle.cos() * 2.0 / f64::from(second);
                    imaginary -= output * angle.sin() * 2.0 / f64::from(second);
                }
            }
            let response = of_section(section, (hertz * 100.0) as u32, rate);
            let gain = (f64::from(response.gain()) / 65_536.0).exp2();
            let angle = f64::from(response.phase()) / 4_294_967_296.0 * TAU;
            let off = (gain * angle.cos() - real).hypot(gain * angle.sin() - imaginary);
            assert!(off < 1e-3, "{section:?} at {hertz} Hz: {off}");
        }
    }
}
