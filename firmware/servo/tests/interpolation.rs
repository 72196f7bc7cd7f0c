//! What the cubic interpolation gives over the linear one, measured on sine commands, and the laws that both keep. Bounds are
//! two-sided: a result that is too good means that the measurement broke.

use proptest::prelude::*;
use servo::path::{CommandSource, Interpolation, Interpolator, InterpolatorSettings};
use servo::units::{Modulo, ModuloCounter, Position, Velocity};

const TAU: f64 = std::f64::consts::TAU;
const REVOLUTION: f64 = 4_294_967_296.0;

fn settings(ticks: u16, interpolation: Interpolation) -> InterpolatorSettings {
    InterpolatorSettings::new(ticks, None).unwrap().with_interpolation(interpolation)
}

fn standing() -> Interpolator {
    Interpolator::new(Position::ZERO, ModuloCounter::default())
}

/// Largest errors against a sine that is one cycle late, in shares of its amplitudes.
#[derive(Debug)]
struct Errors {
    position: f64,
    velocity: f64,
    /// Largest jump of the velocity from one tick to the next.
    jump: f64,
    acceleration: f64,
}

/// Runs a sine of one revolution over three periods, the first one not counted.
fn sine(interpolation: Interpolation, hertz: f64, ticks: u16) -> Errors {
    let settings = settings(ticks, interpolation);
    let mut interpolator = standing();
    let omega = TAU * hertz / 8_000.0;
    let mut errors = Errors { position: 0.0, velocity: 0.0, jump: 0.0, acceleration: 0.0 };
    let mut before = 0.0;
    let mut tick = 0_u32;
    while f64::from(tick) < 3.0 * 8_000.0 / hertz {
        // Valid now, reached at the end of the cycle.
        let command = (omega * f64::from(tick)).sin() * REVOLUTION;
        interpolator.command(&settings, Position::from_bits(command.round() as i64)).unwrap();
        for _ in 0..ticks {
            tick += 1;
            let (setpoint, source) = interpolator.tick(&settings);
            assert_eq!(source, CommandSource::Interpolated);
            let time = omega * f64::from(tick) - omega * f64::from(ticks);
            let velocity = f64::from(setpoint.velocity.to_bits()) / 16.0 / REVOLUTION / omega;
            if f64::from(tick) > 8_000.0 / hertz {
                let position = setpoint.position.to_bits() as f64 / REVOLUTION;
                errors.position = errors.position.max((position - time.sin()).abs());
                // The velocity of a tick is that of its middle, the acceleration that of its end.
                errors.velocity = errors.velocity.max((velocity - (time - omega / 2.0).cos()).abs());
                errors.jump = errors.jump.max((velocity - before).abs());
                let acceleration = setpoint.acceleration.to_bits() as f64 / 65_536.0 / REVOLUTION / (omega * omega);
                errors.acceleration = errors.acceleration.max((acceleration + time.sin()).abs());
            }
            before = velocity;
        }
    }
    errors
}

#[test]
fn the_cubic_follows_a_sine_more_closely_and_more_smoothly_than_the_line() {
    // Errors in position and velocity, jump of the velocity, error of the acceleration: cubic, then linear.
    let measured = [
        ((1.0, 16), [6.3e-8, 4.3e-5, 7.9e-4, 0.0251], [1.97e-5, 5.9e-3, 0.0126]),
        ((1.0, 80), [7.96e-6, 1.27e-3, 7.9e-4, 0.1256], [4.93e-4, 0.031, 0.0628]),
        ((10.0, 16), [6.3e-5, 4.3e-3, 8.1e-3, 0.2505], [1.97e-3, 0.0589, 0.125]),
        // Ten commands in a period: the acceleration is that of the right direction and no more.
        ((10.0, 80), [8.4e-3, 0.122, 0.0132, 1.156], [0.0489, 0.305, 0.578]),
    ];
    for ((hertz, ticks), cubic, linear) in measured {
        let found = sine(Interpolation::Cubic, hertz, ticks);
        let found = [found.position, found.velocity, found.jump, found.acceleration];
        let straight = sine(Interpolation::Linear, hertz, ticks);
        let straight = [straight.position, straight.velocity, straight.jump];
        for (found, expected) in found.iter().chain(&straight).zip(cubic.iter().chain(&linear)) {
            let ratio = found / expected;
            assert!((0.97..1.03).contains(&ratio), "{found}, not {expected}, {hertz} Hz, {ticks} ticks");
        }
    }
}

#[test]
fn constant_acceleration_is_followed_exactly() {
    let settings = settings(10, Interpolation::Cubic);
    let mut interpolator = standing();
    for cycle in 1..=40_i64 {
        interpolator.command(&settings, Position::from_bits(cycle * cycle * 1_000_000)).unwrap();
        for tick in 1..=10 {
            let setpoint = interpolator.tick(&settings).0;
            if cycle > 3 {
                let ticks = (cycle - 1) * 10 + tick;
                assert!(
                    (setpoint.position.to_bits() - ticks * ticks * 10_000).abs() <= 1,
                    "cycle {cycle}, tick {tick}"
                );
                let acceleration = setpoint.acceleration.to_bits() - (20_000 << 16);
                assert!(acceleration.abs() < 1 << 16, "{acceleration} beside it");
            }
        }
    }
}

#[test]
fn a_sudden_stop_overshoots_by_the_bounded_share_of_the_last_way() {
    let settings = settings(100, Interpolation::Cubic);
    let mut interpolator = standing();
    let way = 1_000_000;
    let mut furthest = 0;
    for cycle in 1..=30_i64 {
        interpolator.command(&settings, Position::from_bits(cycle.min(20) * way)).unwrap();
        for _ in 0..100 {
            furthest = furthest.max(interpolator.tick(&settings).0.position.to_bits());
        }
    }
    assert_eq!(interpolator.position().to_bits(), 20 * way);
    assert_eq!(interpolator.velocity(), Velocity::ZERO);
    // u (1 - u)² + u² (1 - u) / 2 is at most 0.19.
    let overshoot = (furthest - 20 * way) as f64 / way as f64;
    assert!((0.19..0.193).contains(&overshoot), "{overshoot}");
}

#[test]
fn without_a_command_the_cubic_goes_on_with_its_last_velocity_for_two_cycles() {
    let settings = settings(8, Interpolation::Cubic);
    let mut interpolator = standing();
    for cycle in 1..=5_i64 {
        interpolator.command(&settings, Position::from_bits(cycle * 8_000)).unwrap();
        (0..8).for_each(|_| _ = interpolator.tick(&settings));
    }
    for tick in 1..=16 {
        let (setpoint, source) = interpolator.tick(&settings);
        assert_eq!((setpoint.position.to_bits(), source), (40_000 + tick * 1_000, CommandSource::Extrapolated));
    }
    let (setpoint, source) = interpolator.tick(&settings);
    assert_eq!((setpoint.position.to_bits(), setpoint.velocity, source), (56_000, Velocity::ZERO, CommandSource::Held));
}

#[test]
fn one_lost_command_of_a_steady_movement_is_not_seen() {
    let settings = settings(8, Interpolation::Cubic);
    let mut interpolator = standing();
    for cycle in 1..=20_i64 {
        if cycle != 10 {
            interpolator.command(&settings, Position::from_bits(cycle * 8_000)).unwrap();
        }
        for tick in 1..=8 {
            let setpoint = interpolator.tick(&settings).0;
            if cycle > 3 {
                assert_eq!(setpoint.position.to_bits(), (cycle - 1) * 8_000 + tick * 1_000, "cycle {cycle}");
            }
        }
    }
}

#[test]
fn ten_million_cycles_leave_no_drift() {
    let settings = settings(4, Interpolation::Cubic);
    let mut interpolator = standing();
    let (mut command, mut random) = (0_i64, 1_u64);
    for _ in 0..10_000_000 {
        random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        command += (random >> 40) as i64;
        interpolator.command(&settings, Position::from_bits(command)).unwrap();
        for _ in 0..4 {
            interpolator.tick(&settings);
        }
        assert_eq!(interpolator.position().to_bits(), command);
    }
}

proptest! {
    #[test]
    fn any_commands_are_reached_exactly_and_the_velocity_does_not_jump(
        ticks in 4_u16..=520, ways in proptest::collection::vec(-(1_i64 << 35)..1 << 35, 1..40),
    ) {
        let settings = settings(ticks, Interpolation::Cubic);
        let mut interpolator = standing();
        let mut command = 0;
        let n = i64::from(ticks);
        for window in [0, 0].iter().chain(&ways).copied().collect::<Vec<_>>().windows(3) {
            // The largest second derivative of the cubic, of changes of the way up to these: 4 + 2 halves of each.
            let change = (window[2] - window[1]).abs().max((window[1] - window[0]).abs()).max(1 << 36);
            command += window[2];
            interpolator.command(&settings, Position::from_bits(command)).unwrap();
            for _ in 0..ticks {
                let before = interpolator.setpoint();
                let setpoint = interpolator.tick(&settings).0;
                let jump = (i64::from(setpoint.velocity.to_bits()) - i64::from(before.velocity.to_bits())).abs() >> 4;
                prop_assert!(jump <= 9 * change / (n * n) + 2, "velocity jumps by {jump}, ways {window:?}");
                let moved = (setpoint.position - before.position).to_bits();
                let expected = i64::from(setpoint.velocity.to_bits() >> 4);
                // Both are rounded down, and the last tick takes what the slope was rounded by.
                let saturated = setpoint.velocity.abs() == Velocity::MAX;
                prop_assert!(saturated || (-1..=2).contains(&(moved - expected)), "moved {moved}, not {expected}");
            }
            prop_assert_eq!(interpolator.position().to_bits(), command);
        }
    }

    #[test]
    fn a_cycle_with_a_tick_more_or_less_bends_the_cubic_and_the_position_does_not_jump(
        cycles in proptest::collection::vec(9_u16..=11, 1..60),
    ) {
        let settings = settings(10, Interpolation::Cubic);
        let mut interpolator = standing();
        interpolator.start(&settings, Position::ZERO, Velocity::from_bits(16_000), ModuloCounter::default());
        for (cycle, ticks) in (1_i64..).zip(cycles) {
            interpolator.command(&settings, Position::from_bits(cycle * 10_000)).unwrap();
            for _ in 0..ticks {
                let before = interpolator.position();
                let step = (interpolator.tick(&settings).0.position - before).to_bits();
                prop_assert!((650..=1_350).contains(&step), "step of {step}");
            }
        }
    }

    #[test]
    fn modulo_commands_go_the_same_way_as_absolute_ones(
        ticks in 4_u16..=100, shares in proptest::collection::vec(-0.49_f64..0.49, 1..40),
    ) {
        let modulo = Modulo::from_ratio(7, 3).unwrap();
        let absolute = settings(ticks, Interpolation::Cubic);
        let wrapped = InterpolatorSettings::new(ticks, Some(modulo)).unwrap().with_interpolation(Interpolation::Cubic);
        let [mut one, mut other] = [standing(), standing()];
        let mut command = 0_i64;
        for share in shares {
            command += (share * modulo.value().to_bits() as f64) as i64;
            let position = Position::from_bits(command);
            one.command(&absolute, position).unwrap();
            other.command(&wrapped, ModuloCounter::containing(&modulo, position).wrap(&modulo, position)).unwrap();
            for _ in 0..ticks {
                prop_assert_eq!(one.tick(&absolute), other.tick(&wrapped));
            }
        }
    }
}

/// Largest error in position steps at the ends of the cycles of a steady movement whose commands come in a pattern.
fn gaps(pattern: &[bool]) -> i64 {
    let settings = settings(16, Interpolation::Cubic);
    let mut interpolator = standing();
    let mut worst = 0;
    // Not a whole number of steps a tick: something is always rounded.
    let step = 14_316_557;
    for cycle in 1..2_000_i64 {
        if cycle < 10 || pattern[cycle as usize % pattern.len()] {
            interpolator.command(&settings, Position::from_bits(step * cycle)).unwrap();
        }
        for _ in 0..16 {
            interpolator.tick(&settings);
        }
        if cycle > 4 {
            worst = worst.max((interpolator.position().to_bits() - step * cycle).abs());
        }
    }
    worst
}

#[test]
fn gaps_that_repeat_do_not_feed_on_their_own_extrapolations() {
    for pattern in [&[true, false][..], &[true, false, false], &[true, true, false], &[true, false, true, false, false]]
    {
        let worst = gaps(pattern);
        assert!((0..16).contains(&worst), "{worst} steps with {pattern:?}");
    }
    assert_eq!(gaps(&[true]), 0);
}
