//! A stop, whenever and from whatever it comes: the shaft is never made faster, and stands within what the deceleration takes.

use crate::bench::{Bench, parameters, revolutions, rpm};
use plant::ReferenceAxis;
use proptest::prelude::*;
use servo::axis::Mode;
use servo::path::{CommandJump, CommandLimits, Interpolator, InterpolatorSettings};
use servo::units::{CurrentFraction, Modulo, ModuloCounter, Position};

/// Of the press axis: S-0-0138 in rad/s², crossing of the velocity loop and Kv in 1/s.
const DECELERATION: f64 = 400.0;
const CROSSING: f64 = 250.0;
const KV: f64 = 62.5;

#[derive(Clone, Copy, Debug)]
enum Before {
    Velocity(f64),
    /// A step of so many revolutions.
    Position(f64),
    Torque(f64),
}

fn before() -> impl Strategy<Value = Before> {
    prop_oneof![
        (-2_500.0..2_500.0_f64).prop_map(Before::Velocity),
        (-3.0..3.0_f64).prop_map(Before::Position),
        (-1.0..1.0_f64).prop_map(Before::Torque),
    ]
}

const STOPS: [Mode; 4] = [Mode::Stopping, Mode::Braking, Mode::Halt, Mode::Travel];

/// How much faster a stop may make the shaft by the current that flows already, in rad/s.
///
/// The loop takes it away with its own time constant while the ramp goes down: a first-order system that begins with the acceleration.
fn by_the_current_there(acceleration: f64) -> f64 {
    let gain = acceleration / CROSSING - DECELERATION / CROSSING * (1.0 + acceleration / DECELERATION).ln();
    // The delay of the velocity filter, 500 us, and noise of the encoder.
    1.5 * gain + acceleration * 0.000_7 + 0.8
}

/// Runs an axis until `ticks` after its command, stops it, and once more in another way `second.0` ticks later.
fn stop(
    before: Before,
    ticks: usize,
    load: f64,
    feed_forward: u16,
    first: Mode,
    second: (usize, Mode),
) -> Result<(), TestCaseError> {
    let reference = ReferenceAxis::press();
    let settings = servo::axis::AxisParameters {
        ticks_per_cycle: 16,
        feed_forward,
        monitoring_window: Position::ZERO,
        ..parameters(&reference)
    };
    let mut bench = Bench::new(&reference, &settings);
    bench.motor.set_load_torque(load, 0);
    // The load is held by then.
    bench.axis.set_mode(Mode::Velocity);
    bench.ticks(2_000);
    match before {
        Before::Velocity(velocity) => bench.axis.command_velocity(rpm(velocity)),
        Before::Position(way) => {
            let here = bench.encoder.position();
            bench.axis.set_mode(Mode::Position);
            bench.axis.command_position(here + revolutions(way)).unwrap();
        }
        Before::Torque(torque) => {
            bench.axis.set_mode(Mode::Torque);
            bench.axis.command_torque(CurrentFraction::saturating_from_num(torque));
        }
    }
    bench.ticks(ticks);
    let earlier = bench.velocity();
    bench.ticks(8);
    let speed = bench.velocity();
    let forwards = if speed < 0.0 { -1.0 } else { 1.0 };
    let acceleration = ((speed - earlier) / 0.001 * forwards).max(0.0);
    let allowed = speed.abs() + by_the_current_there(acceleration);
    let from = bench.motor.angle(bench.time);
    bench.axis.set_mode(first);
    let longest = allowed / DECELERATION + 0.03 + 6.0 / KV;
    let mut ticks_left = (longest / 0.000_125) as usize;
    let mut way = 0.0_f64;
    let mut passed = 0;
    while ticks_left > 0 {
        ticks_left -= 1;
        passed += 1;
        if passed == second.0 {
            bench.axis.set_mode(second.1);
        }
        bench.tick();
        let now = bench.velocity() * forwards;
        prop_assert!(now < allowed, "{now} rad/s after {speed} with {acceleration} rad/s²");
        // Nor backwards: what the loop swings beyond standstill.
        prop_assert!(now > -3.0, "{now} rad/s backwards");
        way = way.max((bench.motor.angle(bench.time) - from) * forwards * std::f64::consts::TAU);
    }
    let rest = bench.velocity();
    prop_assert!(rest.abs() < 0.5, "{rest} rad/s after {longest} s");
    let longest_way = allowed * allowed / (2.0 * DECELERATION) + allowed * (0.012 + 1.5 / KV) + 0.05;
    prop_assert!(way < longest_way, "{way} rad, {longest_way} allowed");
    // The load is held: a tenth of a second later nothing has moved.
    let angle = bench.motor.angle(bench.time);
    bench.ticks(800);
    let moved = (bench.motor.angle(bench.time) - angle).abs() * 360.0;
    prop_assert!(moved < 1.0, "{moved} degrees");
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 150, ..ProptestConfig::default() })]

    #[test]
    fn no_stop_makes_the_shaft_faster_and_it_stands_within_what_the_deceleration_takes(
        before in before(), ticks in 0_usize..1_500, load in -40.0..40.0_f64, lag in any::<bool>(),
        first in 0_usize..4, after in 0_usize..1_000, second in 0_usize..4,
    ) {
        let feed_forward = if lag { 0 } else { 10_000 };
        stop(before, ticks, load, feed_forward, STOPS[first], (after, STOPS[second]))?;
    }

    /// A tracking axis begins its ramp where it is: no current jumps.
    #[test]
    fn a_tracking_axis_stops_without_a_bump(velocity in 100.0..2_000.0_f64, load in -30.0..30.0_f64, stop in 0_usize..3) {
        let reference = ReferenceAxis::press();
        let mut bench = Bench::new(&reference, &servo::axis::AxisParameters { ticks_per_cycle: 4, ..parameters(&reference) });
        bench.motor.set_load_torque(load, 0);
        bench.axis.set_mode(Mode::Velocity);
        bench.axis.command_velocity(rpm(velocity));
        bench.ticks(6_000);
        let steady = bench.ticks(100);
        let mean = steady.iter().map(|output| output.current.to_num::<f64>()).sum::<f64>() / 100.0;
        let noise = steady.iter().map(|output| (output.current.to_num::<f64>() - mean).abs()).fold(0.0, f64::max);
        bench.axis.set_mode([Mode::Stopping, Mode::Halt, Mode::Travel][stop]);
        let first = bench.tick().current.to_num::<f64>();
        // A tick of the ramp is 0.05 rad/s: 0.94 A of 60.
        prop_assert!((first - mean).abs() < 2.0 * noise + 0.02, "{first} after {mean}, noise {noise}");
    }

    #[test]
    fn a_path_within_the_step_limit_is_taken_also_over_gaps_and_a_jump_beyond_it_changes_nothing(
        ticks in 4_u16..100, start in -(1_i64 << 40)..1 << 40, first in -(STEP / 2)..=STEP / 2,
        path in prop::collection::vec((-STEP..=STEP, prop::bool::weighted(0.2)), 1..60),
        excess in 1..1_i64 << 31, modulo in any::<bool>(), backwards in any::<bool>(),
    ) {
        let turn = Modulo::from_ratio(1, 1).ok().filter(|_| modulo);
        let limits = CommandLimits::new(Position::from_bits(STEP), Position::from_bits(STEP / 2));
        let settings = InterpolatorSettings::new(ticks, turn).unwrap().with_limits(limits);
        let cyclic = |position: i64| match &turn {
            Some(turn) => turn.reduce(Position::from_bits(position)),
            None => Position::from_bits(position),
        };
        let ranges = |position: i64| match &turn {
            Some(turn) => ModuloCounter::containing(turn, Position::from_bits(position)),
            None => ModuloCounter::default(),
        };
        let mut interpolator = Interpolator::new(Position::ZERO, ranges(0));
        interpolator.start(&settings, Position::from_bits(start), servo::units::Velocity::ZERO, ranges(start));
        // Whatever comes first, beyond the window it is refused, and with it nothing changes.
        let fresh = interpolator;
        let sign = if backwards { -1 } else { 1 };
        // With a modulo of a revolution the other way round is nearer from a half on.
        let excess = if modulo { excess % (1 << 30) + 1 } else { excess };
        let far = sign * (STEP / 2 + excess);
        let [actual, limit] = [far, STEP / 2].map(Position::from_bits);
        prop_assert_eq!(
            interpolator.command(&settings, cyclic(start + far)),
            Err(CommandJump::FarFromAxis { actual, limit })
        );
        prop_assert_eq!((interpolator.position(), interpolator.target()), (fresh.position(), fresh.target()));
        let mut place = start + first;
        prop_assert_eq!(interpolator.command(&settings, cyclic(place)), Ok(()));
        let mut gap = 0;
        for (step, lost) in path {
            for _ in 0..ticks {
                interpolator.tick(&settings);
            }
            place += step;
            gap += 1;
            // The supervision stops the axis after two.
            if lost && gap < 3 {
                continue;
            }
            prop_assert_eq!(interpolator.command(&settings, cyclic(place)), Ok(()));
            gap = 0;
        }
        for _ in 0..ticks {
            interpolator.tick(&settings);
        }
        // Those that were lost last count as well.
        let last = interpolator.target().to_bits();
        let allowed = STEP * (gap + 1).min(3);
        let [actual, limit] = [sign * (allowed + excess), allowed].map(Position::from_bits);
        let before = interpolator;
        let jump = interpolator.command(&settings, cyclic(last + actual.to_bits()));
        prop_assert_eq!(jump, Err(CommandJump::Step { actual, limit }));
        prop_assert_eq!((interpolator.position(), interpolator.target()), (before.position(), before.target()));
    }
}

/// Largest step of the commands in position steps.
const STEP: i64 = 1_000_000;
