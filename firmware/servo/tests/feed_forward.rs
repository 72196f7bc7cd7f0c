//! What the acceleration feed-forward S-0-0348 is worth on lines and on cubics, on the press with the real current loop under it.

use crate::machine_bench::master::{Master, revolutions, turns};
use crate::machine_bench::measure::{deviation, largest, within};
use crate::machine_bench::setup::Setup;
use crate::machine_bench::{Bench, Seen};
use plant::ReferenceAxis;
use servo::axis::{AxisSettings, Mode, acceleration_smoothing};
use servo::path::Interpolation::{self, Cubic, Linear};

/// From the position that is measured to the set-point of its tick, in ns, as the drive has it.
const AHEAD: i32 = 122_800;
/// Position data are in 0.0001 degrees.
const INCREMENTS: f64 = 3_600_000.0;

/// A ramp of a second from 0 to 393 rpm, and half a second at that: ripple of the torque on the ramp in % of peak, and largest following
/// error in degrees. Friction is fed forward.
fn ramp(path: Interpolation, ticks: u16, fed_forward: bool, smoothing: u16) -> (f64, f64) {
    let mut setup = Setup::of(ReferenceAxis::press()).with_cycle(ticks).with_friction_compensation();
    if fed_forward {
        setup = setup.with_acceleration_feed_forward();
    }
    setup.axis.acceleration_smoothing = smoothing;
    setup.axis.interpolation = path;
    let mut bench = Bench::new(&setup);
    bench.start(Mode::Position);
    bench.axis.apply_settings(&AxisSettings::new(&setup.axis).unwrap().with_setpoint_ahead(AHEAD));
    let mut master = Master::new(ticks);
    let mut seen = Vec::new();
    for _ in 0..12_000 / u32::from(ticks) {
        // No multiple of what a command is rounded to.
        let place = turns(master.next(6.543_21, 6.543_21));
        seen.extend(bench.position_cycle(revolutions((place * INCREMENTS).round() / INCREMENTS)));
    }
    assert_eq!(bench.trip, None);
    let peak = setup.reference.motor.peak_torque;
    let steady: Vec<f64> = seen[2_400..7_600].iter().map(|seen| seen.torque / peak * 100.0).collect();
    let error = largest(seen.iter().map(|seen: &Seen| turns(seen.output.following_error) * 360.0));
    println!("{path:?}, {ticks} ticks, {fed_forward}, {smoothing} us");
    (deviation(&steady), error)
}

#[test]
fn on_lines_it_takes_away_most_of_the_error_with_which_a_ramp_begins() {
    for (ticks, without, with) in [(4, 0.06..0.08, 0.006..0.011), (16, 0.06..0.08, 0.009..0.015)] {
        let (ripple, error) = ramp(Linear, ticks, false, 0);
        let (more_ripple, less_error) = ramp(Linear, ticks, true, 0);
        within("largest error without in degrees", error, without);
        within("largest error with it in degrees", less_error, with);
        within("ripple without in % of peak", ripple, 0.65..0.95);
        within("what it adds to the ripple", (more_ripple.powi(2) - ripple.powi(2)).max(0.0).sqrt(), 0.0..0.8);
    }
}

#[test]
fn its_smoothing_takes_the_rounding_of_the_commands_out_of_the_torque() {
    for (path, rough, smooth) in [(Linear, 0.9..1.1, 0.7..0.82), (Cubic, 1.2..1.5, 0.7..0.85)] {
        let (ripple, error) = ramp(path, 4, true, 0);
        let (smoothed, smooth_error) = ramp(path, 4, true, acceleration_smoothing(500));
        within("ripple at once in % of peak", ripple, rough);
        within("ripple smoothed in % of peak", smoothed, smooth);
        within("largest error at once in degrees", error, 0.006..0.011);
        within("largest error smoothed in degrees", smooth_error, 0.009..0.017);
    }
}

#[test]
fn at_10_ms_lines_shake_the_press_and_cubics_do_not() {
    let (lines, lines_error) = ramp(Linear, 80, true, acceleration_smoothing(10_000));
    let (cubics, cubics_error) = ramp(Cubic, 80, true, acceleration_smoothing(10_000));
    within("ripple of lines in % of peak", lines, 3.7..4.5);
    within("ripple of cubics in % of peak", cubics, 0.65..0.85);
    within("largest error of lines in degrees", lines_error, 0.025..0.05);
    within("largest error of cubics in degrees", cubics_error, 0.005..0.011);
}
