//! Gains from the data of a motor, and an axis that follows a master's positions with them: how far it lags, and what it costs.
//!
//! `cargo run -p servo-axis --example position_loop`

use servo::axis::{
    Axis, AxisParameters, AxisSettings, CurrentFilterSettings, FilterSection, FrictionSettings, Limiting, Mode,
    TorqueLimits, VelocityEstimate, VelocityFilter, VelocityLimits, VelocityRate, position_gain, velocity_gains,
};
use servo::encoder::{Encoder, EncoderSettings};
use servo::path::Interpolation;
use servo::units::{Acceleration, CurrentFraction, LOOP_TICKS_PER_SUPERVISION, Position, Velocity};

/// Increments of the encoder in a revolution.
const INCREMENTS: u32 = 65_536;
/// 0.001 kg m², 0.5 Nm/A, 20 A at most.
const INERTIA: f64 = 0.001;
const TORQUE_CONSTANT: f64 = 0.5;
const PEAK_CURRENT: f64 = 20.0;
/// Loop ticks in a second, and in a cycle of the control unit of 1 ms.
const TICKS_PER_SECOND: f64 = 8_000.0;
const TICKS_PER_CYCLE: u16 = 8;
/// Bandwidth of the velocity loop in Hz.
const BANDWIDTH: u32 = 50;
/// Filter of the measured velocity in us.
const FILTER: u16 = 250;

/// A shaft that turns under torque, without friction.
#[derive(Default)]
struct Shaft {
    /// In revolutions.
    angle: f64,
    /// In rad/s.
    speed: f64,
}

impl Shaft {
    fn turn(&mut self, current: CurrentFraction) {
        let torque = current.to_num::<f64>() * PEAK_CURRENT * TORQUE_CONSTANT;
        self.speed += torque / INERTIA / TICKS_PER_SECOND;
        self.angle += self.speed / std::f64::consts::TAU / TICKS_PER_SECOND;
    }

    fn count(&self) -> u32 {
        (self.angle * f64::from(INCREMENTS)).floor() as i64 as u32
    }
}

fn revolutions(value: f64) -> Position {
    Position::from_bits((value * 4_294_967_296.0).round() as i64)
}

fn parameters(feed_forward: u16) -> AxisParameters {
    let small_times = u32::from(FILTER).saturating_add(VelocityRate::EachTick.delay(true));
    let gains = velocity_gains(10_000, 500_000, BANDWIDTH, small_times).expect("a motor that such a loop can hold");
    AxisParameters {
        ticks_per_cycle: TICKS_PER_CYCLE,
        modulo: None,
        position_gain: position_gain(BANDWIDTH).expect("a bandwidth that such a loop can have"),
        feed_forward,
        velocity_gain: gains.proportional,
        integral_time: gains.integral_time,
        velocity_rate: VelocityRate::EachTick,
        velocity_filter: FILTER,
        peak_current: 20_000,
        acceleration_gain: 0,
        acceleration_smoothing: 0,
        friction: FrictionSettings::OFF,
        filter: CurrentFilterSettings::new([FilterSection::Off; 2], VelocityRate::EachTick).expect("no filter"),
        velocity_limits: VelocityLimits::new(Velocity::from_ten_thousandths_rpm(30_000_000), None, None),
        deceleration: Acceleration::from_milliradians_per_second_squared(1_000_000),
        halt_deceleration: Acceleration::from_bits(0),
        jerk: None,
        velocity_ramp: None,
        interpolation: Interpolation::Linear,
        standstill_window: Velocity::from_ten_thousandths_rpm(100_000),
        monitoring_window: revolutions(0.1),
        largest_step: Position::ZERO,
    }
}

/// Follows 2 s of a master that accelerates to 10 revolutions a second in half a second, and gives the lag at the end in degrees.
fn follow(feed_forward: u16) -> f64 {
    let mut shaft = Shaft::default();
    let mut encoder = Encoder::new(EncoderSettings::new(INCREMENTS).expect("within 4 to 2^31"), shaft.count());
    let settings = AxisSettings::new(&parameters(feed_forward)).expect("settings that the loops can work with");
    let mut axis = Axis::new(settings, encoder.position());
    let limits = TorqueLimits::symmetrical(CurrentFraction::MAX, Limiting::TORQUE_BIPOLAR);
    axis.set_mode(Mode::Position);
    let mut estimate = VelocityEstimate::new(encoder.position());
    let unfiltered = VelocityFilter::from_microseconds(0);
    let (mut commanded, mut speed, mut lag) = (0.0, 0.0_f64, 0.0);
    println!("feed-forward {} %:", feed_forward / 100);
    for cycle in 1..=2_000 {
        speed = (speed + 0.02).min(10.0);
        commanded += speed / 1_000.0;
        axis.command_position(revolutions(commanded)).expect("a step that the axis can make");
        for tick in 0..TICKS_PER_CYCLE {
            let position = encoder.update(shaft.count());
            let output = axis.tick(position, estimate.update(&unfiltered, position), &limits);
            shaft.turn(output.current);
            lag = output.following_error.to_bits() as f64 / 4_294_967_296.0 * 360.0;
            if u32::from(tick).is_multiple_of(LOOP_TICKS_PER_SUPERVISION) {
                assert!(!axis.supervise(), "the shaft is where nobody wants it");
            }
        }
        if cycle % 250 == 0 {
            println!(
                "  {cycle:>4} ms  {:>6.1} rpm  lag {lag:>7.3} degrees",
                shaft.speed * 60.0 / std::f64::consts::TAU
            );
        }
    }
    lag
}

pub(crate) fn main() {
    let gains = parameters(0);
    println!(
        "Kp {} mA s/rad, Tn {} in 0.1 ms, Kv {} in 0.01 * 1000/min",
        gains.velocity_gain, gains.integral_time, gains.position_gain
    );
    // Without feed-forward the axis lags by v / Kv: 10 revolutions a second by Kv of 78.5 1/s are 45.8 degrees.
    let lag = follow(0);
    assert!((45.7..46.0).contains(&lag), "{lag} degrees");
    let lag = follow(10_000);
    assert!(lag.abs() < 0.1, "{lag} degrees");
}
