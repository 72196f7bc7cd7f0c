//! The gains of `velocity_gains` in the real velocity loop, on an inertia in f64: frequency response, phase margin, step response.

use std::f64::consts::TAU;

use servo::axis::{
    FilteredVelocity, Limiting, TorqueLimits, VelocityFilter, VelocityLoop, VelocityLoopSettings, VelocityRate,
    velocity_gains,
};
use servo::units::{CurrentFraction, Velocity};

/// 0.001 kg m^2, 0.5 Nm/A, 20 A; current loop of 1/(2 pi 882 Hz).
const INERTIA: f64 = 0.001;
const TORQUE_CONSTANT: f64 = 0.5;
const PEAK: f64 = 20.0;
const CURRENT_LOOP: f64 = 180e-6;
/// Steps of the integration in a step of the velocity loop.
const STEPS: u32 = 16;

/// How a velocity loop runs: its rate, its velocity filter in us, what it delays in s, and the highest bandwidth in Hz with these small times.
#[derive(Clone, Copy)]
struct Kind {
    rate: VelocityRate,
    filter: u16,
    delay: f64,
    highest: u32,
}

/// The delays are half of the way that the velocity is the mean over, a period until the command is taken, and half of one in which it holds.
const KINDS: [Kind; 4] = [
    Kind { rate: VelocityRate::EachTick, filter: 250, delay: 250e-6, highest: 122 },
    Kind { rate: VelocityRate::EachTick, filter: 0, delay: 250e-6, highest: 193 },
    Kind { rate: VelocityRate::TwiceATick, filter: 250, delay: 156.25e-6, highest: 141 },
    Kind { rate: VelocityRate::TwiceATick, filter: 0, delay: 125e-6, highest: 273 },
];

struct Axis {
    kind: Kind,
    settings: VelocityLoopSettings,
    filter: VelocityFilter,
    velocity_loop: VelocityLoop,
    filtered: FilteredVelocity,
    /// rad: at the last two steps.
    before: [f64; 2],
    /// A, rad/s, rad.
    commanded: f64,
    current: f64,
    velocity: f64,
    angle: f64,
}

impl Axis {
    fn new(kind: Kind, bandwidth: u32) -> Self {
        let small_times = u32::from(kind.filter) + 180 + kind.rate.delay(kind.filter > 0);
        assert!(velocity_gains(10_000, 500_000, kind.highest + 1, small_times).is_err());
        let gains = velocity_gains(10_000, 500_000, bandwidth, small_times).unwrap();
        Self {
            kind,
            settings: VelocityLoopSettings::new(gains.proportional, gains.integral_time, 0, 20_000, kind.rate).unwrap(),
            filter: VelocityFilter::new(kind.filter, kind.rate),
            velocity_loop: VelocityLoop::new(),
            filtered: FilteredVelocity::new(Velocity::ZERO),
            before: [0.0; 2],
            commanded: 0.0,
            current: 0.0,
            velocity: 0.0,
            angle: 0.0,
        }
    }

    /// A step of the loop with a velocity command in rad/s; the current command takes effect a step after the position was sampled.
    fn step(&mut self, command: f64) {
        let bits = |radians_per_second: f64| {
            Velocity::from_bits((radians_per_second / TAU / 8_000.0 * 68_719_476_736.0) as i32)
        };
        let hertz = f64::from(self.kind.rate.hertz());
        let [before_last, last] = self.before;
        self.before = [last, self.angle];
        let spans_tick = matches!(self.kind.rate, VelocityRate::TwiceATick) && self.kind.filter > 0;
        let latest = if spans_tick { (self.angle - before_last) / 2.0 } else { self.angle - last } * hertz;
        let measured = self.filtered.update(&self.filter, bits(latest));
        let limits = TorqueLimits::symmetrical(CurrentFraction::MAX, Limiting::AMPLIFIER_PEAK);
        let output = self.velocity_loop.tick(&self.settings, &limits, bits(command), measured, 0);
        assert!(output.limiting.is_empty(), "the test is of small signals");
        self.run();
        self.commanded = output.current.to_num::<f64>() * PEAK;
    }

    fn run(&mut self) {
        let step = 1.0 / f64::from(self.kind.rate.hertz() * STEPS);
        for _ in 0..STEPS {
            self.current += (self.commanded - self.current) * step / CURRENT_LOOP;
            self.velocity += self.current * TORQUE_CONSTANT / INERTIA * step;
            self.angle += self.velocity * step;
        }
    }
}

/// Gain of the closed loop from command to velocity at the motor, over a second after a second of settling.
fn gain(kind: Kind, bandwidth: u32, hertz: u32) -> f64 {
    let mut axis = Axis::new(kind, bandwidth);
    let (amplitude, second) = (2.0, kind.rate.hertz());
    let (mut real, mut imaginary) = (0.0, 0.0);
    for step in 0..2 * second {
        let angle = TAU * f64::from(hertz) * f64::from(step) / f64::from(second);
        let velocity = axis.velocity;
        axis.step(amplitude * angle.cos());
        if step >= second {
            real += velocity * angle.cos() * 2.0 / f64::from(second) / amplitude;
            imaginary -= velocity * angle.sin() * 2.0 / f64::from(second) / amplitude;
        }
    }
    real.hypot(imaginary)
}

/// Of the loop on paper: an inertia, the gains of the closed form, current loop and filter of first order, the delay; the filter and the half
/// of the difference lie in the feedback.
fn gain_on_paper(kind: Kind, bandwidth: u32, hertz: u32) -> f64 {
    let (crossing, w) = (TAU * f64::from(bandwidth), TAU * f64::from(hertz));
    // wc / jw * (1 + wc / (4 jw))
    let integral = crossing / (4.0 * w);
    let lag = w * CURRENT_LOOP;
    let forward = crossing / w * 1_f64.hypot(integral) / 1_f64.hypot(lag);
    let filter = w * f64::from(kind.filter) * 1e-6;
    let open = forward / 1_f64.hypot(filter);
    let phase = -TAU / 4.0 - integral.atan() - lag.atan() - filter.atan() - w * kind.delay;
    forward / (1.0 + open * phase.cos()).hypot(open * phase.sin())
}

#[test]
fn the_loop_answers_like_the_one_on_paper_around_its_crossing() {
    for kind in KINDS {
        for bandwidth in [40, 80, kind.highest] {
            for hertz in [bandwidth / 4, bandwidth / 2, bandwidth, bandwidth * 2] {
                let (measured, expected) = (gain(kind, bandwidth, hertz), gain_on_paper(kind, bandwidth, hertz));
                println!("{bandwidth} Hz at {hertz} Hz: {measured:.3}, on paper {expected:.3}");
                assert!((measured / expected - 1.0).abs() < 0.04, "{bandwidth} at {hertz}: {measured} {expected}");
            }
        }
    }
}

#[test]
fn the_phase_margin_at_the_highest_bandwidth_is_45_degrees_and_more() {
    for kind in KINDS {
        // The integral part moves the crossing to 1.03 times the bandwidth. There |H| is 1 / (2 sin(margin / 2)).
        let margin = 2.0 * (0.5 / gain(kind, kind.highest, kind.highest * 103 / 100)).asin().to_degrees();
        println!("{} Hz: margin {margin:.1} degrees", kind.highest);
        assert!((45.0..50.0).contains(&margin), "{} Hz: {margin}", kind.highest);
    }
}

#[test]
fn a_step_overshoots_by_what_the_integral_part_costs_and_settles() {
    for kind in KINDS {
        for (bandwidth, least, most) in [(40, 0.10, 0.20), (kind.highest, 0.2, 0.4)] {
            let mut axis = Axis::new(kind, bandwidth);
            let mut highest = 0.0_f64;
            for _ in 0..kind.rate.hertz() / 2 {
                axis.step(2.0);
                highest = highest.max(axis.velocity);
            }
            let overshoot = highest / 2.0 - 1.0;
            println!("{bandwidth} Hz: overshoot {:.1} %", overshoot * 100.0);
            assert!((least..most).contains(&overshoot), "{bandwidth} Hz: {overshoot}");
            assert!((axis.velocity / 2.0 - 1.0).abs() < 0.005, "{}", axis.velocity);
        }
    }
}
