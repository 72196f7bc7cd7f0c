//! The velocity loop on the machine, with the real current loop under it.

use std::f64::consts::TAU;

use crate::machine_bench::master::{of_radians, rpm, to_rpm};
use crate::machine_bench::measure::{
    Phasor, Step, decibels, deviation, highest, largest, lowest, mean, whole_periods, within,
};
use crate::machine_bench::setup::{Setup, acceleration};
use crate::machine_bench::{Bench, Seen, TICKS_PER_SECOND};
use plant::ReferenceAxis;
use servo::axis::{Limiting, Mode, VelocityRate, velocity_gains};
use servo::units::{CurrentFraction, Jerk};

/// Commands every 500 us.
fn precise() -> Setup {
    Setup::of(ReferenceAxis::precise()).with_cycle(4)
}

fn with_velocity_loop(setup: &Setup) -> Bench {
    let mut bench = Bench::new(setup);
    bench.start(Mode::Velocity);
    bench
}

/// At a speed in rpm, settled.
fn turning(setup: &Setup, speed: f64) -> Bench {
    let mut bench = with_velocity_loop(setup);
    bench.axis.command_velocity(rpm(speed));
    bench.run(0.4);
    bench
}

fn speeds(seen: &[Seen]) -> Vec<f64> {
    seen.iter().map(|seen| of_radians(seen.velocity)).collect()
}

/// From the command of the velocity loop to the velocity of the motor, around 100 rpm.
fn response(setup: &Setup, hertz: f64) -> Phasor {
    let mut bench = turning(setup, 100.0);
    let length = 1_600;
    let hertz = whole_periods(hertz, length, TICKS_PER_SECOND);
    let (mut commanded, mut measured) = (Vec::new(), Vec::new());
    for cycle in 0..(400 + length) / 4 {
        let command = 100.0 + 8.0 * (TAU * hertz * f64::from(cycle as u32) * 4.0 / TICKS_PER_SECOND).sin();
        for seen in bench.velocity_cycle(rpm(command)) {
            assert!(seen.limiting.is_empty(), "the test is of small signals");
            commanded.push(to_rpm(seen.output.velocity_command));
            measured.push(of_radians(seen.velocity));
        }
    }
    let swing = |values: &[f64]| Phasor::of(&values[400..], hertz, TICKS_PER_SECOND);
    swing(&measured).over(swing(&commanded))
}

#[test]
fn the_velocity_loop_of_the_precise_axis_reaches_200_hertz_and_peaks_below_3_decibels() {
    let frequencies = [10.0, 25.0, 50.0, 75.0, 100.0, 150.0, 200.0, 250.0, 300.0, 350.0, 400.0, 500.0, 700.0];
    let gains = frequencies.map(|hertz| decibels(response(&precise(), hertz).amplitude()));
    println!("{gains:.2?} dB");
    let after = gains.iter().position(|&gain| gain < -3.0).unwrap();
    let share = (gains[after - 1] + 3.0) / (gains[after - 1] - gains[after]);
    let corner = frequencies[after - 1] + share * (frequencies[after] - frequencies[after - 1]);
    within("-3 dB at Hz", corner, 350.0..400.0);
    within("highest gain in dB", highest(gains), 1.8..2.6);
}

/// What P-0-0220 makes of the data of this axis at this bandwidth: its encoder is fine enough to do without filter.
fn computed(bandwidth: u32) -> Setup {
    let mut setup = precise().with_current_bandwidth(2_000);
    let current_loop = 5e-3 / f64::from(setup.current.proportional_gain) * 1e9;
    let small_times = current_loop as u32 + VelocityRate::TwiceATick.delay(false);
    let gains = velocity_gains(24_000, 1_200_000, bandwidth, small_times).unwrap();
    setup.axis.velocity_gain = gains.proportional;
    setup.axis.integral_time = gains.integral_time;
    setup.axis.velocity_filter = 0;
    setup
}

#[test]
fn the_velocity_loop_without_filter_crosses_at_300_hertz_with_its_phase_margin() {
    let setup = computed(300);
    // The integral part moves the crossing to 309 Hz. There |H| is 1 / (2 sin(margin / 2)).
    let margin = 2.0 * (0.5 / response(&setup, 309.0).amplitude()).asin().to_degrees();
    within("phase margin in degrees", margin, 45.0..56.0);
    let frequencies = [100.0, 200.0, 300.0, 400.0, 500.0, 600.0, 700.0];
    let gains = frequencies.map(|hertz| decibels(response(&setup, hertz).amplitude()));
    println!("{gains:.2?} dB");
    let after = gains.iter().position(|&gain| gain < -3.0).unwrap();
    let share = (gains[after - 1] + 3.0) / (gains[after - 1] - gains[after]);
    within("-3 dB at Hz", frequencies[after - 1] + share * 100.0, 450.0..620.0);
    within("highest gain in dB", highest(gains), 1.5..4.0);
    let mut bench = turning(&setup, 100.0);
    bench.axis.command_velocity(rpm(110.0));
    let step = Step::of(&speeds(&bench.run(0.1)), 100.0, 110.0);
    within("overshoot", step.overshoot, 0.15..0.5);
    within("settling in ms", step.settling / 8.0, 2.0..8.0);
}

#[test]
fn the_gains_of_the_precise_axis_are_those_of_its_data() {
    let setup = precise();
    // 0.0024 kg m^2, 1.2 Nm/A, 190 Hz; filter of 100 us and a current loop of 138 us.
    let current_loop = 5e-3 / f64::from(setup.current.proportional_gain) * 1e9;
    within("time of the current loop in us", current_loop, 130.0..145.0);
    let small_times = 100 + current_loop as u32 + VelocityRate::TwiceATick.delay(true);
    let gains = velocity_gains(24_000, 1_200_000, 191, small_times).unwrap();
    within("gain", f64::from(setup.axis.velocity_gain) / f64::from(gains.proportional), 0.99..1.01);
    within("integral time", f64::from(setup.axis.integral_time) / f64::from(gains.integral_time), 0.98..1.02);
}

#[test]
fn a_step_rises_in_a_millisecond_and_settles_in_ten() {
    let mut bench = turning(&precise(), 100.0);
    bench.axis.command_velocity(rpm(120.0));
    let step = Step::of(&speeds(&bench.run(0.1)), 100.0, 120.0);
    within("rise in ms", step.rise / 8.0, 0.6..1.1);
    within("overshoot", step.overshoot, 0.2..0.35);
    within("settling in ms", step.settling / 8.0, 4.0..9.0);
}

#[test]
fn the_suggested_gains_of_every_axis_give_a_step_that_settles() {
    for (axis, rise, overshoot) in [
        (ReferenceAxis::press(), 3.5..6.0, 0.1..0.25),
        (ReferenceAxis::small_cnc(), 1.5..2.6, 0.15..0.35),
        (ReferenceAxis::catalogue(), 3.5..6.0, 0.12..0.35),
    ] {
        let mut bench = turning(&Setup::of(axis).with_cycle(4), 100.0);
        bench.axis.command_velocity(rpm(120.0));
        let seen = bench.run(0.3);
        let step = Step::of(&speeds(&seen), 100.0, 120.0);
        println!("{}", axis.name);
        within("rise in ms", step.rise / 8.0, rise);
        within("overshoot", step.overshoot, overshoot);
        within("rest in rpm", mean(&speeds(&seen[1_600..])) - 120.0, -0.05..0.05);
    }
}

/// Largest and last deviation in rpm on a ramp of 1 000 rad/s^2 from 100 rpm for 100 ms.
fn ramp(setup: &Setup) -> (f64, f64) {
    let mut bench = turning(setup, 100.0);
    let mut lags = Vec::new();
    for cycle in 0..200 {
        let command = 100.0 + of_radians(1_000.0 * f64::from(cycle) * 500e-6);
        for seen in bench.velocity_cycle(rpm(command)) {
            lags.push(to_rpm(seen.output.velocity_command) - of_radians(seen.velocity));
        }
    }
    (largest(lags.iter().copied()), mean(&lags[600..]))
}

#[test]
fn a_ramp_is_followed_with_the_lag_of_the_integral_part_and_without_it_with_feed_forward() {
    let (peak, last) = ramp(&precise());
    // 1 000 rad/s^2 / 1 200 1/s = 8 rpm, less what the integral part has gained meanwhile.
    within("largest lag in rpm", peak, 5.0..7.0);
    // The velocity is known 160 us late (half a tick less 2.2 us, and the filter), and the command of a tick holds from its middle on, 62.5 us:
    // by the rest the motor is ahead, 0.93 rpm.
    within("lag at the end in rpm", last, -1.03..-0.83);
    let (peak, last) = ramp(&precise().with_acceleration_feed_forward());
    within("largest lag with feed-forward in rpm", peak, 1.6..3.8);
    within("lag at the end with feed-forward in rpm", last, -1.03..-0.83);
}

#[test]
fn a_sine_of_20_hertz_is_followed() {
    let response = response(&precise(), 20.0);
    within("gain", response.amplitude(), 1.02..1.08);
    within("phase in degrees", response.phase(), -1.0..2.0);
}

/// Largest deviation in rpm on the way from 10 rpm to -10 rpm and back with 1 000 rpm/s.
fn reversal(setup: &Setup) -> f64 {
    let mut bench = turning(setup, 10.0);
    let mut worst = 0.0_f64;
    for cycle in 0..400 {
        let phase = f64::from(cycle) / 100.0;
        let command = 10.0 * ((phase.rem_euclid(2.0) - 1.0).abs() * 2.0 - 1.0);
        for seen in bench.velocity_cycle(rpm(command)) {
            worst = worst.max((to_rpm(seen.output.velocity_command) - of_radians(seen.velocity)).abs());
        }
    }
    worst
}

#[test]
fn friction_compensation_takes_most_of_the_reversal_spike_away() {
    let mut setup = precise().with_acceleration_feed_forward();
    setup.reference.machine.mechanics.coulomb_friction = 0.5;
    let without = reversal(&setup);
    let with = reversal(&setup.with_friction_compensation());
    within("spike without compensation in rpm", without, 0.2..3.0);
    within("spike with compensation in rpm", with, 0.05..0.8);
    within("ratio", without / with, 1.5..10.0);
}

/// What a load of 5 Nm does at 100 rpm: largest deviation in rpm and milliseconds until it stays within a tenth of that.
fn stiffness(setup: &Setup) -> (f64, f64) {
    let mut bench = turning(setup, 100.0);
    bench.machine().set_load_torque(-5.0, bench.time);
    let deviations: Vec<f64> = speeds(&bench.run(0.1)).iter().map(|speed| speed - 100.0).collect();
    let worst = largest(deviations.iter().copied());
    let last = deviations.iter().rposition(|deviation| deviation.abs() > 0.1 * worst).unwrap_or(0);
    (worst, last as f64 / 8.0)
}

#[test]
fn a_load_step_is_held_within_the_momentum_of_a_millisecond() {
    let (worst, recovery) = stiffness(&precise());
    // 5 Nm / 0.0024 kg m^2 = 2 083 rad/s^2, for about 1 / 1 200 s.
    within("largest deviation in rpm", worst, 13.0..18.5);
    within("recovery in ms", recovery, 5.0..10.0);
    let mut softer = precise();
    softer.axis.velocity_gain /= 2;
    let (half, _) = stiffness(&softer);
    within("with half the gain", half / worst, 1.4..1.7);
}

#[test]
fn velocity_commands_beyond_the_acceleration_limits_become_ramps() {
    let mut setup = precise();
    setup.axis.velocity_ramp = Some((acceleration(1_000.0), acceleration(2_000.0)));
    let mut bench = with_velocity_loop(&setup);
    bench.axis.command_velocity(rpm(1_000.0));
    let up = speeds(&bench.run(0.15));
    bench.axis.command_velocity(rpm(0.0));
    let down = speeds(&bench.run(0.15));
    let slope = |speeds: &[f64], from: usize, to: usize| {
        (speeds[to] - speeds[from]) * TAU / 60.0 / ((to - from) as f64 / TICKS_PER_SECOND)
    };
    within("acceleration in rad/s^2", slope(&up, 200, 600), 995.0..1_005.0);
    within("deceleration in rad/s^2", slope(&down, 80, 320), -2_010.0..-1_990.0);
    within("rest in rpm", down[1_100], -0.1..0.1);
}

#[test]
fn a_limited_jerk_rounds_the_corners_of_the_ramp() {
    let overshoot = |jerk: Option<Jerk>| {
        let mut setup = precise();
        setup.axis.velocity_ramp = Some((acceleration(1_000.0), acceleration(1_000.0)));
        setup.axis.jerk = jerk;
        let mut bench = with_velocity_loop(&setup);
        bench.axis.command_velocity(rpm(500.0));
        let seen = bench.run(0.2);
        let commands: Vec<f64> = seen.iter().map(|seen| to_rpm(seen.output.velocity_command) * TAU / 60.0).collect();
        let steepest = largest(commands.windows(3).map(|v| (v[2] - 2.0 * v[1] + v[0]) * TICKS_PER_SECOND.powi(2)));
        (highest(speeds(&seen)) - 500.0, steepest)
    };
    let (smooth, jerk) = overshoot(Some(Jerk::from_milliradians_per_second_cubed(50_000_000)));
    let (hard, _) = overshoot(None);
    within("jerk of the command in rad/s^3", jerk, 49_000.0..50_500.0);
    within("overshoot with limited jerk in rpm", smooth, 0.6..1.8);
    within("overshoot without in rpm", hard, 6.0..9.5);
}

#[test]
fn each_sign_of_the_torque_has_its_own_limit() {
    let mut bench = with_velocity_loop(&precise());
    bench.limit_torque(0.5, -0.25, 1.0);
    bench.axis.command_velocity(rpm(1_500.0));
    let up = bench.run(0.02);
    bench.axis.command_velocity(rpm(-1_500.0));
    let down = bench.run(0.04);
    let torques = |seen: &[Seen]| seen.iter().map(|seen| seen.torque).collect::<Vec<_>>();
    // 24 Nm peak; gains of the sensors are 0.5 % off, the noise of the current on top.
    within("driving torque in Nm", mean(&torques(&up[40..])), 11.9..12.1);
    within("braking torque in Nm", mean(&torques(&down[40..])), -6.05..-5.95);
    assert!(up[80].limiting.contains(Limiting::TORQUE_POSITIVE));
    assert!(down[80].limiting.contains(Limiting::TORQUE_NEGATIVE));
}

#[test]
fn out_of_the_torque_limit_the_velocity_overshoots_no_more_than_a_small_step() {
    let mut bench = with_velocity_loop(&precise());
    bench.limit_torque(1.0, -1.0, 0.2);
    bench.axis.command_velocity(rpm(1_000.0));
    let seen = bench.run(0.2);
    let limited = seen.iter().filter(|seen| seen.limiting.contains(Limiting::TORQUE_BIPOLAR)).count();
    // 104.7 rad/s with (4.8 - 0.1) Nm / 0.0024 kg m^2: 53 ms.
    within("limited for ms", limited as f64 / 8.0, 52.0..55.0);
    within("overshoot in rpm", highest(speeds(&seen)) - 1_000.0, 1.0..4.0);
}

#[test]
fn the_velocity_limit_holds_whatever_is_commanded() {
    let mut setup = precise();
    setup.axis.velocity_limits = servo::axis::VelocityLimits::new(rpm(500.0), Some(rpm(300.0)), None);
    let mut bench = turning(&setup, 1_000.0);
    let seen = bench.run(0.1);
    within("limited speed in rpm", mean(&speeds(&seen)), 299.9..300.1);
    assert!(seen[0].limiting.contains(Limiting::VELOCITY_POSITIVE));
    bench.axis.command_velocity(rpm(-1_000.0));
    bench.run(0.3);
    let seen = bench.run(0.1);
    within("the other way", mean(&speeds(&seen)), -500.1..-499.9);
    assert!(seen[0].limiting.contains(Limiting::VELOCITY_BIPOLAR));
}

/// Mean less command, standard deviation and peak deviation in rpm, of 0.8 s at a speed.
fn ripple(setup: &Setup, speed: f64, bias: f64, deviates: std::ops::Range<f64>, peaks: std::ops::Range<f64>) {
    let speeds = speeds(&turning(setup, speed).run(0.8));
    let mean = mean(&speeds);
    println!("{speed} rpm");
    within("bias in rpm", mean - speed, -bias..bias);
    within("ripple in rpm rms", deviation(&speeds), deviates);
    within("ripple in rpm peak", largest(speeds.iter().map(|speed| speed - mean)), peaks);
}

#[test]
fn at_1_rpm_the_precise_axis_turns_within_a_tenth_of_it() {
    ripple(&precise(), 1.0, 0.001, 0.01..0.03, 0.03..0.1);
}

#[test]
fn at_10_rpm_the_precise_axis_turns_within_one_percent() {
    ripple(&precise(), 10.0, 0.001, 0.015..0.04, 0.04..0.12);
}

#[test]
fn at_100_rpm_the_precise_axis_turns_within_a_thousandth_and_a_half() {
    ripple(&precise(), 100.0, 0.001, 0.015..0.035, 0.05..0.14);
}

#[test]
fn at_1000_rpm_the_precise_axis_turns_within_three_ten_thousandths() {
    ripple(&precise(), 1_000.0, 0.001, 0.018..0.04, 0.06..0.15);
}

#[test]
fn a_coarse_encoder_costs_smoothness_but_no_bias() {
    ripple(&Setup::of(ReferenceAxis::small_cnc()).with_cycle(4), 100.0, 0.02, 0.2..0.45, 0.5..1.4);
}

#[test]
fn at_zero_speed_the_axis_stands_still_in_its_friction() {
    let mut bench = turning(&precise(), 50.0);
    bench.axis.command_velocity(rpm(0.0));
    bench.run(0.3);
    let seen = bench.run(0.3);
    within("creep in revolutions", seen[2_399].angle - seen[0].angle, -2e-6..2e-6);
    assert!(seen.iter().all(|seen| seen.output.standstill));
}

#[test]
fn a_vertical_load_is_taken_over_from_its_brake_without_a_fall() {
    let fall = |preloaded: bool| {
        let mut bench = with_velocity_loop(&Setup::of(ReferenceAxis::vertical()).with_cycle(4));
        if preloaded {
            // 1.5 Nm of 15 Nm.
            bench.axis.preload(CurrentFraction::from_num(0.1));
        }
        bench.machine().set_brake(true, bench.time);
        let start = bench.machine().angle(bench.time);
        let seen = bench.run(0.3);
        (start - lowest(seen.iter().map(|seen| seen.angle))) * 360.0
    };
    within("fall in degrees, preloaded", fall(true), 0.0..0.005);
    within("fall in degrees, not preloaded", fall(false), 2.0..5.0);
}

#[test]
fn the_resonance_of_the_shaft_is_not_excited() {
    let mut bench = turning(&precise(), 300.0);
    let speeds = speeds(&bench.run(0.2));
    // 2 180 Hz with the rotor free against the table.
    let resonance = highest((2_000..2_400).step_by(20).map(|hertz| {
        let hertz = whole_periods(f64::from(hertz), speeds.len(), TICKS_PER_SECOND);
        Phasor::of(&speeds, hertz, TICKS_PER_SECOND).amplitude()
    }));
    within("amplitude at the resonance in rpm", resonance, 0.001..0.015);
}
