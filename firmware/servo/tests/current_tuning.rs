//! The gains of `current_gains` in the real current loop, on a winding in f64: rise time, overshoot, bandwidth, phase margin.

use std::f64::consts::TAU;

use crate::current_bench::{Drive, MotorData};
use servo::axis::current_gains;
use servo::current::PwmFrequency;

/// 0.7 ohm, 3.5 mH.
const MOTOR: MotorData =
    MotorData { resistance: 0.7, inductance: 0.003_5, flux: 0.1, bus: 560, peak: 20.0, frequency: PwmFrequency::Khz16 };

/// A motor with a short time constant: 3.5 mH, 7 ohm.
#[test]
fn a_winding_of_eight_periods_has_its_bandwidth_too() {
    let gains = current_gains(7_000, 3_500, 1_500, PwmFrequency::Khz16).unwrap();
    let drive = || Drive::new(MotorData { resistance: 7.0, ..MOTOR }, gains.proportional, gains.integral_time);
    let gain = 20.0 * response(drive(), 1_500.0, PwmFrequency::Khz16).0.log10();
    assert!((-3.2..=-2.8).contains(&gain), "{gain} dB");
    let (rise, overshoot, end) = step_response(drive(), PwmFrequency::Khz16);
    println!("7 ohm: {gain:.2} dB, rise {rise:.0} us, overshoot {:.1} %", overshoot * 100.0);
    assert!((200.0..270.0).contains(&rise), "{rise} us");
    assert!((-0.01..0.03).contains(&overshoot) && end.abs() < 0.01, "{overshoot} {end}");
}

fn tuned(bandwidth: u32, frequency: PwmFrequency) -> Drive {
    let gains = current_gains(700, 3_500, bandwidth, frequency).unwrap();
    Drive::new(MotorData { frequency, ..MOTOR }, gains.proportional, gains.integral_time)
}

/// Microseconds from 10 % to 90 % of a step, between cycles interpolated, and overshoot and the error at the end as shares of it.
fn step_response(mut drive: Drive, frequency: PwmFrequency) -> (f64, f64, f64) {
    let size = 0.2;
    let mut reached = [None; 2];
    let mut last = 0.0;
    let mut highest = 0.0_f64;
    for cycle in 0..320 {
        drive.cycle(0.0, size, 0.0);
        let now = drive.current().1 / size;
        for (level, reached) in [0.1, 0.9].into_iter().zip(&mut reached) {
            if reached.is_none() && now >= level {
                *reached = Some(f64::from(cycle) + (level - last) / (now - last));
            }
        }
        last = now;
        highest = highest.max(now);
    }
    let rise = (reached[1].unwrap() - reached[0].unwrap()) / f64::from(frequency.hertz()) * 1e6;
    (rise, highest - 1.0, last - 1.0)
}

/// Gain of the closed loop, and its phase in degrees, from sine to sample.
fn response(mut drive: Drive, hertz: f64, rate: PwmFrequency) -> (f64, f64) {
    let amplitude = 0.1;
    // 0.3 s: whole periods of every multiple of 10/3 Hz.
    let periods = (hertz * 0.3).round();
    let cycles = f64::from(rate.hertz()) * 0.3;
    let (mut real, mut imaginary) = (0.0, 0.0);
    for cycle in 0..2 * cycles as u32 {
        let angle = TAU * periods * f64::from(cycle) / cycles;
        // The sample that belongs to this command is taken at the beginning of its cycle.
        let current = drive.current().1 / amplitude;
        drive.cycle(0.0, amplitude * angle.cos(), 0.0);
        if cycle >= cycles as u32 {
            real += current * angle.cos() * 2.0 / cycles;
            imaginary -= current * angle.sin() * 2.0 / cycles;
        }
    }
    (real.hypot(imaginary), imaginary.atan2(real).to_degrees())
}

#[test]
fn a_loop_for_1500_hertz_has_its_minus_3_decibels_there() {
    let drive = || tuned(1_500, PwmFrequency::Khz16);
    let gain = |hertz| 20.0 * response(drive(), hertz, PwmFrequency::Khz16).0.log10();
    println!("{:?}", [100.0, 500.0, 1_000.0, 1_500.0, 1_600.0, 2_000.0].map(gain));
    assert!((-3.2..=-2.8).contains(&gain(1_500.0)), "{} dB at 1500 Hz", gain(1_500.0));
    assert!((-3.0..=-0.1).contains(&gain(1_000.0)), "{} dB at 1000 Hz", gain(1_000.0));
    assert!(gain(1_650.0) < -3.2, "{} dB at 1650 Hz", gain(1_650.0));
    assert!(gain(100.0).abs() < 0.1, "{} dB at 100 Hz", gain(100.0));
}

#[test]
fn the_bandwidth_is_what_was_asked_for_at_either_rate_up_to_the_highest() {
    for (bandwidth, rate) in [
        (400, PwmFrequency::Khz16),
        (2_200, PwmFrequency::Khz16),
        (2_716, PwmFrequency::Khz16),
        (600, PwmFrequency::Khz8),
        (1_358, PwmFrequency::Khz8),
    ] {
        let gain = 20.0 * response(tuned(bandwidth, rate), f64::from(bandwidth), rate).0.log10();
        assert!((-3.4..=-2.6).contains(&gain), "{bandwidth} Hz {rate:?}: {gain} dB");
    }
}

#[test]
fn the_step_rises_as_fast_as_the_bandwidth_says_and_hardly_overshoots() {
    for (bandwidth, rate, overshoots) in [
        (1_500, PwmFrequency::Khz16, 0.0..0.03),
        (2_716, PwmFrequency::Khz16, 0.01..0.1),
        (1_358, PwmFrequency::Khz8, 0.01..0.1),
        (300, PwmFrequency::Khz16, -0.01..0.02),
    ] {
        let (rise, overshoot, end) = step_response(tuned(bandwidth, rate), rate);
        println!("{bandwidth} Hz: rise {rise:.0} us, overshoot {:.1} %, end {:.2} %", overshoot * 100.0, end * 100.0);
        let expected = 350_000.0 / f64::from(bandwidth);
        assert!((0.7..1.2).contains(&(rise / expected)), "{bandwidth} Hz {rate:?}: {rise} us, about {expected} us");
        assert!(overshoots.contains(&overshoot), "{bandwidth} Hz {rate:?}: {overshoot}");
        assert!(end.abs() < 0.01, "{bandwidth} Hz {rate:?}: {end}");
    }
}

#[test]
fn the_phase_margin_of_the_highest_bandwidth_is_60_degrees() {
    // At the crossing of the open loop, p = 30 degrees: 1 333 Hz. There |H| is 1 / (2 sin(margin / 2)), and its phase -(90 - margin / 2).
    let (gain, phase) = response(tuned(2_716, PwmFrequency::Khz16), 16_000.0 / 12.0, PwmFrequency::Khz16);
    let margin = 2.0 * (0.5 / gain).asin().to_degrees();
    println!("margin {margin:.1} degrees, phase {phase:.1}");
    assert!((59.0..63.0).contains(&margin), "{margin}");
    assert!((-62.0..-58.0).contains(&phase), "{phase}");
}
