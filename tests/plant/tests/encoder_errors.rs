//! What a disk and its signals are wrong by, against the angle that they show.

use core::f64::consts::TAU;

use crate::common::{MILLISECOND, assert_near, ideal};
use plant::{Eccentricity, Machine, MachineSettings, QuadratureError};

/// 4 096 increments, one revolution in a second either way, and what each instant shows less what it should, in increments.
fn errors(settings: MachineSettings, direction: f64) -> Vec<(f64, f64)> {
    let mut machine = Machine::new(settings);
    machine.set_velocity(direction * TAU, 0);
    (0..2_000)
        .map(|n| {
            let at = n * MILLISECOND + 777;
            // The encoder stands in the middle of an increment at time zero.
            let angle = machine.angle(at) + 0.5 / 4_096.0;
            (angle, f64::from(machine.encoder_count(at) as i32) - angle * 4_096.0)
        })
        .collect()
}

/// A counter rounds down: what it shows lies less than an increment below.
#[track_caller]
fn assert_counts(errors: &[(f64, f64)], expected: impl Fn(f64) -> f64, tolerance: f64, seen: f64) {
    let mut largest: f64 = 0.0;
    for (angle, error) in errors {
        let expected = expected(*angle);
        largest = largest.max(expected.abs());
        let below = expected - error;
        assert!((-tolerance..=1.0 + tolerance).contains(&below), "{angle}: {error} instead of {expected}");
    }
    assert_near(largest, seen, 0.05 * seen);
}

#[test]
fn an_eccentric_disk_is_wrong_once_a_revolution() {
    for direction in [1.0, -1.0] {
        let mut settings = ideal();
        settings.effects.eccentricity = Some(Eccentricity { radians: 0.01, phase: 0.15 });
        // 0.01 rad are 6.5 increments.
        let expected = |angle: f64| 0.01 / TAU * 4_096.0 * ((angle + 0.15) * TAU).sin();
        assert_counts(&errors(settings, direction), expected, 1e-6, 6.52);
    }
}

#[test]
fn the_signals_errors_are_those_of_their_arc_tangent_within_each_period() {
    // A period has 512 increments, 81.5 in a radian: half the amplitude, the phase, the root of the offsets' squares.
    for (amplitude, phase, offset, seen) in
        [(0.05, 0.0, [0.0, 0.0], 2.04), (0.0, 0.06, [0.0, 0.0], 4.89), (0.0, 0.0, [0.04, 0.03], 4.07)]
    {
        let mut settings = ideal();
        let error = QuadratureError { periods_per_revolution: 8, amplitude, phase, offset };
        settings.effects.quadrature = Some(error);
        let expected = |angle: f64| {
            let p = 8.0 * angle * TAU;
            let (cosine, sine) = (p.cos() + offset[0], (1.0 + amplitude) * (p + phase).sin() + offset[1]);
            let shown = sine.atan2(cosine);
            let error = (shown - p + 0.5 * TAU).rem_euclid(TAU) - 0.5 * TAU;
            error / TAU / 8.0 * 4_096.0
        };
        // Of the second order are 0.06 rad squared.
        assert_counts(&errors(settings, 1.0), expected, 0.0036 * 81.5, seen);
    }
}

#[test]
fn the_index_stays_at_its_count_and_comes_where_the_tracks_show_it() {
    let mut settings = ideal();
    settings.effects.eccentricity = Some(Eccentricity { radians: 0.02, phase: 0.0 });
    // At a quarter of a revolution the disk shows 0.02 rad too much: the index comes so much before its place, and going backwards behind
    // it, there at the other end of its increment. The shaft starts half an increment above zero.
    for (direction, expected) in [(1.0, 0.25 - 0.02 / TAU - 0.5 / 4_096.0), (-1.0, 0.75 + 0.02 / TAU - 0.5 / 4_096.0)] {
        let mut machine = Machine::new(settings);
        machine.set_velocity(direction * TAU, 0);
        let at = (0..200_000).map(|n| n * 5_000).find(|at| machine.index_pulses(*at) > 0).unwrap();
        assert_near(at as f64 * 1e-9, expected, 1e-5);
        let count = machine.encoder_count(at);
        assert_eq!(machine.index_count(at), Some(count));
        assert_eq!(count, if direction > 0.0 { 1_024 } else { 1_024_u32.wrapping_sub(4_096) });
    }
}

#[test]
#[should_panic(expected = "the encoder would count backwards within a signal period")]
fn signals_that_count_backwards_make_no_sense() {
    let mut settings = ideal();
    let error = QuadratureError { periods_per_revolution: 8, amplitude: 0.5, phase: 0.5, offset: [0.0; 2] };
    settings.effects.quadrature = Some(error);
    let _ = Machine::new(settings);
}
