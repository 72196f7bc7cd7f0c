//! The axis closed over the simulated motor. Bounds are two-sided: a result that is too good means that the measurement broke.

use crate::bench::{
    Bench, Master, degrees, is_limited, largest, modulo_of, parameters, revolutions, rpm, to_rpm, up_to,
};
use plant::{Coupling, ReferenceAxis};
use servo::axis::{
    AxisOutput, AxisSettings, CurrentFilterSettings, FilterSection, Limiting, Mode, TorqueLimits, VelocityEstimate,
    VelocityFilter, VelocityRate,
};
use servo::path::CommandSource;
use servo::units::{Acceleration, CurrentFraction, LOOP_TICKS_PER_SUPERVISION, Modulo, Position, Velocity};

const TAU: f64 = std::f64::consts::TAU;

/// Runs a ramp to 10 rev/s in position mode and gives the outputs of the acceleration and of 2 s at constant speed.
fn ramp(bench: &mut Bench) -> (Vec<AxisOutput>, Vec<AxisOutput>) {
    bench.ticks(8);
    bench.axis.set_mode(Mode::Position);
    let mut master = Master::new(0.01);
    let accelerating = (0..150).flat_map(|_| bench.position_cycle(master.next(10.0, 10.0))).collect();
    let constant = (0..200).flat_map(|_| bench.position_cycle(master.next(10.0, 10.0))).collect();
    (accelerating, constant)
}

fn following_errors(outputs: &[AxisOutput]) -> impl Iterator<Item = f64> + '_ {
    outputs.iter().map(|output| degrees(output.following_error))
}

#[test]
fn with_full_feed_forward_the_press_follows_constant_speed_within_a_hundredth_of_a_degree() {
    let reference = ReferenceAxis::press();
    let mut bench = Bench::new(&reference, &parameters(&reference));
    let (accelerating, constant) = ramp(&mut bench);
    let worst = largest(following_errors(&constant));
    assert!((0.001..0.01).contains(&worst), "{worst} degrees at constant speed");
    let worst = largest(following_errors(&accelerating));
    assert!((0.05..0.3).contains(&worst), "{worst} degrees while starting against friction and accelerating");
    assert!(!bench.deviates && constant.iter().all(|output| !is_limited(output)));
    // Friction: (6 + 0.05 * 62.8) Nm of 120 Nm.
    let mean = constant.iter().map(|output| output.current.to_num::<f64>()).sum::<f64>() / constant.len() as f64;
    assert!((0.0755..0.0770).contains(&mean), "mean current {mean} of peak");
}

#[test]
fn the_small_machine_tool_axis_follows_within_one_increment_of_its_encoder() {
    let reference = ReferenceAxis::small_cnc();
    let mut bench = Bench::new(&reference, &parameters(&reference));
    let (_, constant) = ramp(&mut bench);
    let worst = largest(following_errors(&constant));
    assert!((0.005..0.036).contains(&worst), "{worst} degrees at constant speed");
}

#[test]
fn without_feed_forward_the_axis_lags_by_velocity_over_kv_and_the_monitoring_expects_it() {
    let reference = ReferenceAxis::press();
    let settings = servo::axis::AxisParameters {
        feed_forward: 0,
        monitoring_window: revolutions(1.0 / 360.0),
        ..parameters(&reference)
    };
    let mut bench = Bench::new(&reference, &settings);
    let (accelerating, constant) = ramp(&mut bench);
    // 10 rev/s / 62.5 1/s
    for error in following_errors(&constant) {
        assert!((57.59..57.61).contains(&error), "lag of {error} degrees");
    }
    assert!(!bench.deviates, "the lag is expected, at {} outputs", accelerating.len() + constant.len());
}

#[test]
fn a_blocked_axis_leaves_the_monitoring_window() {
    let reference = ReferenceAxis::press();
    let mut bench = Bench::new(&reference, &parameters(&reference));
    bench.ticks(8);
    bench.axis.set_mode(Mode::Position);
    bench.motor.set_load_torque(-1_000.0, bench.time);
    let mut master = Master::new(0.01);
    let error = (0..16_000)
        .map(|tick| {
            if tick % 80 == 0 {
                bench.axis.command_position(master.next(1.0, 1.0)).unwrap();
            }
            (bench.tick(), bench.deviates)
        })
        .find(|(_, deviates)| *deviates)
        .map(|(output, _)| degrees(output.following_error))
        .expect("the deviation is reported");
    assert!((29.9..60.0).contains(&error.abs()), "reported at {error} degrees, window 30");
}

/// At rest, with the velocity loop closed.
fn velocity_bench(reference: &ReferenceAxis, settings: &servo::axis::AxisParameters) -> Bench {
    let mut bench = Bench::new(reference, settings);
    bench.ticks(8);
    bench.axis.set_mode(Mode::Velocity);
    bench
}

#[test]
fn a_velocity_step_within_the_current_limit_rises_fast_and_settles() {
    let reference = ReferenceAxis::press();
    let settings = servo::axis::AxisParameters { ticks_per_cycle: 4, ..parameters(&reference) };
    let mut bench = velocity_bench(&reference, &settings);
    bench.axis.command_velocity(rpm(100.0));
    bench.ticks(1_600);
    bench.axis.command_velocity(rpm(120.0));
    let mut limited = false;
    let velocity: Vec<f64> = (0..800)
        .map(|_| {
            limited |= is_limited(&bench.tick());
            bench.velocity() / TAU * 60.0
        })
        .collect();
    assert!(!limited);
    let rise = velocity.iter().position(|&v| v > 118.0).unwrap() as f64 * 0.125;
    assert!((3.0..12.0).contains(&rise), "90 % after {rise} ms");
    let overshoot = largest(velocity.iter().map(|v| (v - 120.0).max(0.0))) / 20.0;
    assert!((0.02..0.30).contains(&overshoot), "overshoot {overshoot} of the step");
    let rest = largest(velocity[400..].iter().map(|v| v - 120.0));
    assert!((0.001..0.5).contains(&rest), "{rest} rpm off after 50 ms");
}

#[test]
fn saturation_of_the_current_does_not_wind_the_integrator_up() {
    let reference = ReferenceAxis::press();
    let settings = servo::axis::AxisParameters { ticks_per_cycle: 4, ..parameters(&reference) };
    let mut bench = velocity_bench(&reference, &settings);
    bench.axis.command_velocity(rpm(1_500.0));
    let mut limited = 0;
    let mut highest = 0.0_f64;
    for _ in 0..4_000 {
        limited += usize::from(is_limited(&bench.tick()));
        highest = highest.max(bench.velocity() / TAU * 60.0);
    }
    // 157 rad/s at (120 - 6 ... 14) Nm / 0.15 kg m²: 0.21 s
    let limited = limited as f64 * 0.125;
    assert!((200.0..220.0).contains(&limited), "limited for {limited} ms");
    assert!((1_500.5..1_515.0).contains(&highest), "highest speed {highest} rpm");
}

#[test]
fn the_current_stays_within_its_limit_and_drives_both_ways() {
    let reference = ReferenceAxis::press();
    let settings = servo::axis::AxisParameters { ticks_per_cycle: 4, ..parameters(&reference) };
    let mut bench = velocity_bench(&reference, &settings);
    bench.limit_torque(0.25);
    bench.axis.command_velocity(rpm(1_000.0));
    let up = bench.ticks(400);
    bench.axis.command_velocity(rpm(-1_000.0));
    let down = bench.ticks(400);
    assert_eq!(up.iter().map(|output| output.current).max(), Some(CurrentFraction::from_num(0.25)));
    assert_eq!(down.iter().map(|output| output.current).min(), Some(CurrentFraction::from_num(-0.25)));
}

#[test]
fn a_filter_that_is_switched_on_while_current_flows_makes_no_bump() {
    let reference = ReferenceAxis::press();
    let settings = servo::axis::AxisParameters { ticks_per_cycle: 4, ..parameters(&reference) };
    let mut bench = velocity_bench(&reference, &settings);
    bench.limit_torque(0.25);
    bench.axis.command_velocity(rpm(1_000.0));
    bench.ticks(100);
    let low_pass = FilterSection::LowPass { frequency: 1_000, damping: 707 };
    let filter = CurrentFilterSettings::new([low_pass, FilterSection::Off], VelocityRate::EachTick).unwrap();
    bench.axis.apply_settings(&AxisSettings::new(&servo::axis::AxisParameters { filter, ..settings }).unwrap());
    let currents = bench.ticks(20).into_iter().map(|output| output.current);
    assert_eq!(currents.min(), Some(CurrentFraction::from_num(0.25)));
}

#[test]
fn what_is_fed_forward_does_not_wait_for_the_filter() {
    let reference = ReferenceAxis::press();
    let ramp = Acceleration::from_milliradians_per_second_squared(300_000);
    // 0.15 kg m2 / 2 Nm/A; at 300 rad/s2 22.5 A of 60 A.
    let accelerating = servo::axis::AxisParameters {
        acceleration_gain: 75_000,
        velocity_ramp: Some((ramp, ramp)),
        ticks_per_cycle: 4,
        ..parameters(&reference)
    };
    let low_pass = FilterSection::LowPass { frequency: 200, damping: 707 };
    let filter = CurrentFilterSettings::new([low_pass, FilterSection::Off], VelocityRate::EachTick).unwrap();
    let [fast, filtered] = [accelerating, servo::axis::AxisParameters { filter, ..accelerating }].map(|settings| {
        let mut bench = velocity_bench(&reference, &settings);
        bench.axis.command_velocity(rpm(1_000.0));
        bench.ticks(24).into_iter().map(|output| output.current.to_num::<f64>()).collect::<Vec<_>>()
    });
    // A low-pass of 20 Hz would leave a twentieth of it in the first millisecond.
    assert!((0.37..0.40).contains(&fast[0]), "{fast:?}");
    let late = fast.iter().zip(&filtered).take(8).map(|(fast, filtered)| fast - filtered).fold(0.0, f64::max);
    assert!((0.01..0.1).contains(&late), "{late}: {fast:?} {filtered:?}");
}

#[test]
fn a_feed_forward_that_the_limit_cuts_leaves_no_torque_the_other_way_in_the_filter() {
    let reference = ReferenceAxis::press();
    let ramp = Acceleration::from_milliradians_per_second_squared(700_000);
    let low_pass = FilterSection::LowPass { frequency: 500, damping: 707 };
    let settings = servo::axis::AxisParameters {
        acceleration_gain: 75_000,
        velocity_ramp: Some((ramp, ramp)),
        ticks_per_cycle: 4,
        filter: CurrentFilterSettings::new([low_pass, FilterSection::Off], VelocityRate::EachTick).unwrap(),
        ..parameters(&reference)
    };
    let mut bench = velocity_bench(&reference, &settings);
    bench.limit_torque(0.3);
    // 700 rad/s2 ask for 88 % of peak, for 105 / 700 s; then the axis is still on its way.
    bench.axis.command_velocity(rpm(1_000.0));
    let currents: Vec<f64> = bench.ticks(1_600).into_iter().map(|output| output.current.to_num::<f64>()).collect();
    let lowest = currents.iter().copied().fold(1.0, f64::min);
    // What the velocity error asks for comes through the low-pass, from nothing.
    assert!((-0.001..0.1).contains(&lowest), "{lowest}");
    assert!((0.29..0.31).contains(&currents[1_599]), "{}", currents[1_599]);
}

#[test]
fn out_of_torque_mode_the_filter_begins_with_what_flows() {
    let reference = ReferenceAxis::press();
    let low_pass = FilterSection::LowPass { frequency: 500, damping: 707 };
    let settings = servo::axis::AxisParameters {
        ticks_per_cycle: 4,
        filter: CurrentFilterSettings::new([low_pass, FilterSection::Off], VelocityRate::EachTick).unwrap(),
        ..parameters(&reference)
    };
    let mut bench = velocity_bench(&reference, &settings);
    bench.axis.set_mode(Mode::Torque);
    // What friction and a load take of it, so that the shaft stands: 60 Nm of 120.
    bench.motor.set_load_torque(-60.0, bench.time);
    bench.axis.command_torque(CurrentFraction::from_num(0.5));
    bench.ticks(400);
    bench.axis.set_mode(Mode::Velocity);
    bench.axis.command_velocity(rpm(0.0));
    let currents: Vec<f64> = bench.ticks(80).into_iter().map(|output| output.current.to_num::<f64>()).collect();
    let (lowest, highest) =
        currents.iter().fold((1.0_f64, 0.0_f64), |(low, high), now| (low.min(*now), high.max(*now)));
    assert!(lowest > 0.4 && highest < 0.6, "{lowest} to {highest}: {currents:?}");
}

#[test]
fn stopping_takes_the_time_and_the_way_of_the_deceleration_limit() {
    let reference = ReferenceAxis::press();
    let mut bench = Bench::new(&reference, &parameters(&reference));
    ramp(&mut bench);
    let speed = bench.velocity();
    let start = bench.motor.angle(bench.time);
    bench.axis.set_mode(Mode::Stopping);
    let ticks = (0..8_000).find(|_| bench.tick().standstill).expect("standstill is reported");
    let way = (bench.motor.angle(bench.time) - start) * TAU;
    // 62.8 rad/s at 400 rad/s²: 157 ms, 4.93 rad; the standstill window is 10 rpm
    let time = f64::from(ticks) * 0.000_125;
    assert!((0.157..0.180).contains(&time), "{time} s from {speed} rad/s");
    assert!((4.90..5.15).contains(&way), "{way} rad");
    let rest = bench.ticks(2_000);
    assert!(rest.iter().all(|output| output.standstill), "stays at standstill");
    assert!(bench.velocity().abs() < 0.05);
}

#[test]
fn stopping_beyond_the_torque_brakes_with_all_of_it_and_does_not_swing_back() {
    let reference = ReferenceAxis::press();
    let settings = servo::axis::AxisParameters {
        deceleration: Acceleration::from_milliradians_per_second_squared(0),
        ..parameters(&reference)
    };
    let mut bench = Bench::new(&reference, &settings);
    ramp(&mut bench);
    bench.axis.set_mode(Mode::Stopping);
    let mut lowest = f64::MAX;
    let mut ticks = 0;
    while !bench.tick().standstill {
        ticks += 1;
        lowest = lowest.min(bench.velocity());
    }
    // 62.8 rad/s with (120 + 6 ... 9) Nm / 0.15 kg m²: 73 ms, then the filter of the standstill
    let time = f64::from(ticks) * 0.000_125;
    assert!((0.072..0.090).contains(&time), "{time} s");
    for _ in 0..2_000 {
        bench.tick();
        lowest = lowest.min(bench.velocity());
    }
    assert!(lowest > -2.0, "swings back with {lowest} rad/s");
}

#[test]
fn halt_ends_at_a_held_position_also_against_a_load() {
    let reference = ReferenceAxis::press();
    let mut bench = Bench::new(&reference, &parameters(&reference));
    ramp(&mut bench);
    let start = bench.motor.angle(bench.time);
    bench.axis.set_mode(Mode::Halt);
    let braking = bench.ticks(2_400);
    let way = (bench.motor.angle(bench.time) - start) * TAU;
    assert!((4.92..4.96).contains(&way), "{way} rad for 62.8 rad/s at 400 rad/s²");
    let worst = largest(following_errors(&braking));
    assert!((0.02..2.0).contains(&worst), "{worst} degrees while braking");
    let held = bench.motor.angle(bench.time);
    bench.motor.set_load_torque(-40.0, bench.time);
    bench.ticks(4_000);
    let yielded = (bench.motor.angle(bench.time) - held) * 360.0;
    assert!(yielded.abs() < 0.02, "yields {yielded} degrees to 40 Nm");
    assert!(bench.tick().standstill);
    // and back to position commands without a bump
    let before = bench.tick().current;
    let here = bench.tick().position_command;
    bench.axis.set_mode(Mode::Position);
    let after = bench.position_cycle(here);
    let bump = largest(after.iter().map(|output| (output.current - before).to_num::<f64>()));
    assert!(bump < 0.05, "bump of {bump} of peak current");
    assert!(largest(following_errors(&after)) < 0.02);
}

/// The speed in rpm before a stop and the highest behind it: the integral part pushes 60 Nm the way the shaft turns with 100 rpm when the load goes
/// and the command is -500 rpm, and the stop comes so many ticks later.
fn turning_back(stop: Mode, ticks: usize, sign: f64) -> [f64; 2] {
    let reference = ReferenceAxis::press();
    // A tenth of the gain: the error makes 1.88 A s/rad of 60 A.
    let settings = servo::axis::AxisParameters {
        ticks_per_cycle: 4,
        velocity_gain: 1_880,
        integral_time: 10_000,
        ..parameters(&reference)
    };
    let mut bench = velocity_bench(&reference, &settings);
    bench.axis.command_velocity(rpm(sign * 100.0));
    bench.motor.set_load_torque(-sign * 60.0, bench.time);
    bench.ticks(80_000);
    bench.motor.set_load_torque(0.0, bench.time);
    bench.axis.command_velocity(rpm(-sign * 500.0));
    bench.ticks(ticks);
    let speed = |bench: &mut Bench| bench.velocity() * sign * 60.0 / TAU;
    let before = speed(&mut bench);
    bench.axis.set_mode(stop);
    let mut fastest = f64::MIN;
    for _ in 0..4_000 {
        bench.tick();
        fastest = fastest.max(speed(&mut bench));
    }
    println!("{stop:?} {ticks} {sign}: {before:.1} rpm, then {fastest:.1} rpm");
    [before, fastest]
}

#[test]
fn a_stop_behind_a_command_to_turn_back_does_not_drive_the_shaft_on() {
    for sign in [1.0, -1.0] {
        for stop in [Mode::Stopping, Mode::Braking, Mode::Halt, Mode::Travel] {
            let [before, fastest] = turning_back(stop, 12, sign);
            assert!((50.0..105.0).contains(&before), "{stop:?}: {before} rpm");
            assert!(fastest < before + 5.0, "{stop:?}: {before} rpm, then {fastest} rpm");
        }
    }
}

#[test]
fn one_missing_command_is_extrapolated_and_hardly_seen() {
    let reference = ReferenceAxis::press();
    let mut bench = Bench::new(&reference, &parameters(&reference));
    ramp(&mut bench);
    let mut master = Master::new(0.01);
    master.position = bench.tick().position_command.to_bits() as f64 / 4_294_967_296.0 + 10.0 * 0.000_125 * 79.0;
    master.velocity = 10.0;
    bench.ticks(79);
    for _ in 0..10 {
        bench.position_cycle(master.next(10.0, 10.0));
    }
    master.next(10.0, 10.0);
    let alone = bench.cycle();
    assert!(alone.iter().all(|output| output.command_source == CommandSource::Extrapolated));
    let after = bench.position_cycle(master.next(10.0, 10.0));
    assert!(after.iter().all(|output| output.command_source == CommandSource::Interpolated));
    let worst = largest(following_errors(&alone).chain(following_errors(&after)));
    assert!((0.000_5..0.01).contains(&worst), "{worst} degrees around a missing command");
}

#[test]
fn without_commands_the_setpoint_stands_after_two_cycles() {
    let reference = ReferenceAxis::press();
    let mut bench = Bench::new(&reference, &parameters(&reference));
    ramp(&mut bench);
    let sources: Vec<_> = bench.ticks(400).iter().map(|output| output.command_source).collect();
    assert!(sources[..160].iter().all(|&source| source == CommandSource::Extrapolated));
    assert!(sources[160..].iter().all(|&source| source == CommandSource::Held));
}

#[test]
fn modulo_commands_go_on_through_the_wrap_for_a_load_behind_a_gear_of_seven_to_three() {
    let reference = ReferenceAxis::press();
    let modulo = Modulo::from_ratio(7, 3).unwrap();
    let settings = servo::axis::AxisParameters { modulo: Some(modulo), ..parameters(&reference) };
    for direction in [1.0, -1.0] {
        let mut bench = Bench::new(&reference, &settings);
        bench.ticks(8);
        bench.axis.set_mode(Mode::Position);
        let mut master = Master::new(0.01);
        let mut worst = 0.0_f64;
        let mut unbounded = 0.0_f64;
        for cycle in 0..2_000 {
            master.next(direction * 10.0, 10.0);
            // The master's own modulo is exact: thirds of a revolution.
            let command = revolutions(master.position.rem_euclid(7.0 / 3.0));
            let outputs = bench.position_cycle(command);
            if cycle > 150 {
                worst = worst.max(largest(following_errors(&outputs)));
            }
            unbounded = bench.motor.angle(bench.time);
            let cyclic = bench.axis.cyclic_position(bench.encoder.position());
            let expected = unbounded.rem_euclid(7.0 / 3.0);
            let difference = (cyclic.to_bits() as f64 / 4_294_967_296.0 - expected).abs();
            let difference = difference.min((difference - 7.0 / 3.0).abs());
            assert!(difference < 0.000_02, "cyclic position {difference} revolutions off in cycle {cycle}");
        }
        assert!((0.001..0.01).contains(&worst), "{worst} degrees over the wraps");
        assert!((190.0..200.0).contains(&unbounded.abs()), "{unbounded} revolutions: some 83 wraps");
    }
}

#[test]
fn mode_switches_at_speed_are_bumpless() {
    let reference = ReferenceAxis::press();
    for feed_forward in [10_000, 5_000, 0] {
        let settings = servo::axis::AxisParameters { feed_forward, ..parameters(&reference) };
        let mut bench = velocity_bench(&reference, &settings);
        bench.axis.command_velocity(rpm(600.0));
        bench.ticks(8_000);
        let steady = bench.ticks(800);
        let ripple = spread(&steady);
        let mut last = *steady.last().unwrap();
        for mode in MODES {
            bench.axis.set_mode(mode);
            let first = bench.tick();
            let bump = (first.current - last.current).to_num::<f64>().abs();
            assert!(bump <= ripple + 0.03, "{mode:?} with {feed_forward}: bump of {bump}, ripple {ripple}");
            let velocity = (to_rpm(first.velocity_command) - to_rpm(last.velocity_command)).abs();
            // In the modes that brake, the first step of the ramp: 400 rad/s² * 125 us = 0.5 rpm.
            assert!(velocity < 2.0, "{mode:?} with {feed_forward}: velocity command jumps by {velocity} rpm");
            if mode == Mode::Velocity {
                bench.axis.command_velocity(rpm(600.0));
                bench.ticks(8_000);
            }
            last = *bench.ticks(20).last().unwrap();
        }
    }
}

const MODES: [Mode; 8] = [
    Mode::Position,
    Mode::Velocity,
    Mode::Position,
    Mode::Halt,
    Mode::Position,
    Mode::Halt,
    Mode::Velocity,
    Mode::Stopping,
];

#[test]
fn switching_on_again_starts_without_the_current_of_last_time() {
    let reference = ReferenceAxis::press();
    let mut bench = Bench::new(&reference, &parameters(&reference));
    bench.motor.set_load_torque(-60.0, 0);
    bench.axis.set_mode(Mode::Velocity);
    let held = bench.ticks(4_000);
    assert!(held.last().unwrap().current > CurrentFraction::from_num(0.4), "holds 54 to 66 Nm of 120");
    bench.axis.set_mode(Mode::Off);
    bench.motor.set_load_torque(0.0, bench.time);
    bench.ticks(8_000);
    bench.axis.set_mode(Mode::Velocity);
    assert!(bench.tick().current.to_num::<f64>().abs() < 0.02);
}

fn spread(outputs: &[AxisOutput]) -> f64 {
    let currents = outputs.iter().map(|output| output.current.to_num::<f64>());
    currents.clone().fold(f64::MIN, f64::max) - currents.fold(f64::MAX, f64::min)
}

#[test]
fn switching_on_catches_a_turning_motor() {
    let reference = ReferenceAxis::press();
    let mut bench = Bench::new(&reference, &parameters(&reference));
    bench.motor.set_velocity(30.0, 0);
    bench.ticks(400);
    let caught = bench.velocity();
    bench.axis.set_mode(Mode::Velocity);
    let first = bench.tick();
    assert!(first.current.to_num::<f64>().abs() < 0.05, "{}", first.current);
    bench.ticks(4_000);
    let velocity = bench.velocity();
    assert!((velocity - caught).abs() < 0.3, "caught at {caught} rad/s, holds {velocity} rad/s");
    assert!((27.0..28.0).contains(&caught), "friction alone brakes until then: {caught} rad/s");
}

#[test]
fn off_gives_no_current_whatever_moves() {
    let reference = ReferenceAxis::press();
    let mut bench = Bench::new(&reference, &parameters(&reference));
    bench.motor.set_velocity(50.0, 0);
    bench.axis.command_position(revolutions(5.0)).unwrap();
    bench.axis.command_velocity(rpm(500.0));
    let outputs = bench.ticks(800);
    assert!(outputs.iter().all(|output| output.current == 0 && output.following_error == Position::ZERO));
    assert!(outputs.iter().skip(100).any(|output| !output.standstill));
}

#[test]
fn changed_gains_take_effect_while_the_axis_runs() {
    let reference = ReferenceAxis::press();
    let mut settings = parameters(&reference);
    let mut bench = Bench::new(&reference, &settings);
    let (_, constant) = ramp(&mut bench);
    settings.velocity_limits = up_to(rpm(300.0));
    bench.axis.apply_settings(&AxisSettings::new(&settings).unwrap());
    assert!(to_rpm(constant.last().unwrap().velocity_command) > 590.0);
    assert!(bench.ticks(100).iter().all(|output| output.velocity_command <= rpm(300.0)));
}

#[test]
fn an_elastic_load_is_followed_and_stays_quiet() {
    let mut reference = ReferenceAxis::press();
    // Rotor and cylinders apart, on a shaft with its resonance at 64 Hz with the rotor free.
    reference.motor.inertia = 0.03;
    reference.motor.coupling = Some(Coupling { load_inertia: 0.12, stiffness: 20_000.0, damping: 5.0 });
    let mut bench =
        Bench::new(&reference, &servo::axis::AxisParameters { velocity_gain: 6_000, ..parameters(&reference) });
    let (_, constant) = ramp(&mut bench);
    let worst = largest(following_errors(&constant));
    assert!((0.001..0.05).contains(&worst), "{worst} degrees with an elastic load");
    assert!(spread(&constant) < 0.2, "current ripple {}", spread(&constant));
}

#[test]
fn homing_shifts_the_zero_without_a_movement() {
    let reference = ReferenceAxis::press();
    let mut bench = Bench::new(&reference, &parameters(&reference));
    ramp(&mut bench);
    bench.axis.set_mode(Mode::Halt);
    bench.ticks(4_000);
    let before = bench.tick();
    let old = bench.encoder.position();
    bench.encoder.set_position(revolutions(-3.25));
    bench.shift(bench.encoder.position() - old);
    let after = bench.tick();
    assert!((degrees(after.following_error) - degrees(before.following_error)).abs() < 0.01);
    assert_eq!(after.velocity, Velocity::ZERO);
    assert!((after.current - before.current).to_num::<f64>().abs() < 0.05, "no movement is seen where there was none");
    bench.ticks(100);
    assert!(!bench.deviates);
    assert!((degrees(after.position_command) / 360.0 + 3.25).abs() < 0.000_1);
}

#[test]
fn two_runs_give_the_same_bits() {
    let run = || {
        let reference = ReferenceAxis::press();
        let mut bench = Bench::new(&reference, &parameters(&reference));
        let (mut outputs, constant) = ramp(&mut bench);
        outputs.extend(constant);
        outputs
    };
    assert_eq!(run(), run());
}

#[test]
fn the_integers_are_the_ones_that_every_machine_must_give() {
    // No floating point on the way: a checksum over the outputs for a made-up movement, to be the same on every host and target.
    let modulo = Modulo::from_ratio(7, 3).unwrap();
    let settings = servo::axis::AxisParameters {
        modulo: Some(modulo),
        feed_forward: 9_000,
        ticks_per_cycle: 16,
        ..parameters(&ReferenceAxis::press())
    };
    let mut axis = servo::axis::Axis::new(AxisSettings::new(&settings).unwrap(), Position::ZERO);
    let mut sum = 0xCBF2_9CE4_8422_2325_u64;
    let limits = TorqueLimits::symmetrical(CurrentFraction::MAX, Limiting::TORQUE_BIPOLAR);
    let mut noise = 1_u64;
    let mut measured = 0_i64;
    let mut estimate = VelocityEstimate::new(Position::ZERO);
    let mut deviates = false;
    for tick in 0..40_000_i64 {
        if tick % 16 == 0 {
            match tick / 16 {
                10 => axis.set_mode(Mode::Velocity),
                400 => axis.set_mode(Mode::Position),
                1_500 => axis.set_mode(Mode::Halt),
                2_000 => axis.set_mode(Mode::Stopping),
                _ => {}
            }
            axis.command_velocity(Velocity::from_bits(70_000_000));
            axis.command_position(modulo_of(&modulo, Position::from_bits(tick * 4_400_000))).unwrap();
        }
        noise = noise.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        measured += 4_375_000 + (noise >> 44) as i64 - (1 << 19);
        let position = Position::from_bits(measured);
        let latest = estimate.update(&VelocityFilter::from_microseconds(0), position);
        let output = axis.tick(position, latest, &limits);
        if tick % i64::from(LOOP_TICKS_PER_SUPERVISION) == 3 {
            deviates = axis.supervise();
        }
        for word in [
            i64::from(output.current.to_bits()),
            output.following_error.to_bits(),
            i64::from(output.velocity.to_bits()),
            axis.cyclic_position(Position::from_bits(measured)).to_bits(),
            i64::from(deviates),
        ] {
            sum = (sum ^ word as u64).wrapping_mul(0x0000_0100_0000_01B3);
        }
    }
    assert_eq!(sum, 0x8256_8351_E203_B123, "{sum:#018X}");
}
