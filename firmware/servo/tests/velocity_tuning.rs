//! The gains of `velocity_gains` in the real velocity loop, on an inertia in f64: frequency response, phase margin, step response.

use std::f64::consts::TAU;

use servo::axis::{
    Limiting, TorqueLimits, VelocityEstimate, VelocityFilter, VelocityLoop, VelocityLoopSettings, velocity_gains,
};
use servo::units::{CurrentFraction, Position, Velocity};

/// 0.001 kg m^2, 0.5 Nm/A, 20 A; velocity filter of 250 us, current loop of 1/(2 pi 882 Hz).
const INERTIA: f64 = 0.001;
const TORQUE_CONSTANT: f64 = 0.5;
const PEAK: f64 = 20.0;
const FILTER: u16 = 250;
const CURRENT_LOOP: f64 = 180e-6;
/// Highest bandwidth with these small times, in Hz.
const HIGHEST: u32 = 134;
/// Steps of the integration in a tick.
const STEPS: u32 = 16;

struct Axis {
    settings: VelocityLoopSettings,
    filter: VelocityFilter,
    velocity_loop: VelocityLoop,
    estimate: VelocityEstimate,
    /// A, rad/s, rad.
    commanded: f64,
    current: f64,
    velocity: f64,
    angle: f64,
}

impl Axis {
    fn new(bandwidth: u32) -> Self {
        let small_times = u32::from(FILTER) + 180;
        assert!(velocity_gains(10_000, 500_000, HIGHEST + 1, small_times).is_err());
        let gains = velocity_gains(10_000, 500_000, bandwidth, small_times).unwrap();
        Self {
            settings: VelocityLoopSettings::new(gains.proportional, gains.integral_time, 0, 20_000).unwrap(),
            filter: VelocityFilter::from_microseconds(FILTER),
            velocity_loop: VelocityLoop::new(),
            estimate: VelocityEstimate::new(Position::ZERO),
            commanded: 0.0,
            current: 0.0,
            velocity: 0.0,
            angle: 0.0,
        }
    }

    /// A tick with a velocity command in rad/s; the current command takes effect half a tick after the position was sampled.
    fn tick(&mut self, command: f64) {
        let position = Position::from_bits((self.angle / TAU * 4_294_967_296.0) as i64);
        let measured = self.estimate.update(&self.filter, position);
        let command = Velocity::from_bits((command / TAU / 8_000.0 * 68_719_476_736.0) as i32);
        let limits = TorqueLimits::symmetrical(CurrentFraction::MAX, Limiting::AMPLIFIER_PEAK);
        let output = self.velocity_loop.tick(&self.settings, &limits, command, measured, 0);
        assert!(output.limiting.is_empty(), "the test is of small signals");
        self.run();
        self.commanded = output.current.to_num::<f64>() * PEAK;
        self.run();
    }

    fn run(&mut self) {
        let step = 62.5e-6 / f64::from(STEPS);
        for _ in 0..STEPS {
            self.current += (self.commanded - self.current) * step / CURRENT_LOOP;
            self.velocity += self.current * TORQUE_CONSTANT / INERTIA * step;
            self.angle += self.velocity * step;
        }
    }
}

/// Gain of the closed loop from command to velocity at the motor, over a second after a second of settling.
fn gain(bandwidth: u32, hertz: u32) -> f64 {
    let mut axis = Axis::new(bandwidth);
    let amplitude = 5.0;
    let (mut real, mut imaginary) = (0.0, 0.0);
    for tick in 0..16_000 {
        let angle = TAU * f64::from(hertz) * f64::from(tick) / 8_000.0;
        let velocity = axis.velocity;
        axis.tick(amplitude * angle.cos());
        if tick >= 8_000 {
            real += velocity * angle.cos() / 4_000.0 / amplitude;
            imaginary -= velocity * angle.sin() / 4_000.0 / amplitude;
        }
    }
    real.hypot(imaginary)
}

/// Of the loop on paper: an inertia, the gains of the closed form, current loop and filter of first order, three half ticks as delays;
/// the filter and the half tick of the difference lie in the feedback.
fn gain_on_paper(bandwidth: u32, hertz: u32) -> f64 {
    let (crossing, w) = (TAU * f64::from(bandwidth), TAU * f64::from(hertz));
    // wc / jw * (1 + wc / (4 jw))
    let integral = crossing / (4.0 * w);
    let lag = w * CURRENT_LOOP;
    let forward = crossing / w * 1_f64.hypot(integral) / 1_f64.hypot(lag);
    let filter = w * f64::from(FILTER) * 1e-6;
    let open = forward / 1_f64.hypot(filter);
    let phase = -TAU / 4.0 - integral.atan() - lag.atan() - filter.atan() - w * 187.5e-6;
    forward / (1.0 + open * phase.cos()).hypot(open * phase.sin())
}

#[test]
fn the_loop_answers_like_the_one_on_paper_around_its_crossing() {
    for bandwidth in [40, 80, HIGHEST] {
        for hertz in [bandwidth / 4, bandwidth / 2, bandwidth, bandwidth * 2] {
            let (measured, expected) = (gain(bandwidth, hertz), gain_on_paper(bandwidth, hertz));
            println!("{bandwidth} Hz at {hertz} Hz: {measured:.3}, on paper {expected:.3}");
            assert!((measured / expected - 1.0).abs() < 0.04, "{bandwidth} at {hertz}: {measured} {expected}");
        }
    }
}

#[test]
fn the_phase_margin_at_the_highest_bandwidth_is_45_degrees_and_more() {
    // The integral part moves the crossing to 1.03 times the bandwidth. There |H| is 1 / (2 sin(margin / 2)).
    let margin = 2.0 * (0.5 / gain(HIGHEST, HIGHEST * 103 / 100)).asin().to_degrees();
    println!("margin {margin:.1} degrees");
    assert!((45.0..50.0).contains(&margin), "{margin}");
}

#[test]
fn a_step_overshoots_by_what_the_integral_part_costs_and_settles() {
    for (bandwidth, least, most) in [(40, 0.10, 0.20), (HIGHEST, 0.2, 0.4)] {
        let mut axis = Axis::new(bandwidth);
        let mut highest = 0.0_f64;
        for _ in 0..4_000 {
            axis.tick(5.0);
            highest = highest.max(axis.velocity);
        }
        let overshoot = highest / 5.0 - 1.0;
        println!("{bandwidth} Hz: overshoot {:.1} %", overshoot * 100.0);
        assert!((least..most).contains(&overshoot), "{bandwidth} Hz: {overshoot}");
        assert!((axis.velocity / 5.0 - 1.0).abs() < 0.005, "{}", axis.velocity);
    }
}
