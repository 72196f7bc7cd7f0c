//! Torque mode, velocity limit and field weakening on the machine.

use std::f64::consts::TAU;

use crate::machine_bench::master::{of_radians, rpm};
use crate::machine_bench::measure::{Step, highest, largest, mean, within};
use crate::machine_bench::setup::Setup;
use crate::machine_bench::{Bench, Seen, TICKS_PER_SECOND};
use plant::ReferenceAxis;
use servo::axis::{Limiting, Mode, VelocityLimits};
use servo::units::CurrentFraction;

fn share(value: f64) -> CurrentFraction {
    CurrentFraction::saturating_from_num(value)
}

fn torques(seen: &[Seen]) -> Vec<f64> {
    seen.iter().map(|seen| seen.torque).collect()
}

fn speeds(seen: &[Seen]) -> Vec<f64> {
    seen.iter().map(|seen| of_radians(seen.velocity)).collect()
}

fn in_torque_mode(setup: &Setup) -> Bench {
    let mut bench = Bench::new(setup);
    bench.start(Mode::Torque);
    bench
}

/// Mean torque in Nm at a command, over five turns at 300 rpm that nothing changes.
fn torque_at(setup: &Setup, command: f64) -> f64 {
    let mut bench = in_torque_mode(&setup.with_flywheel());
    bench.machine().set_velocity(300.0 * TAU / 60.0, bench.time);
    bench.axis.command_torque(share(command));
    bench.run(0.05);
    mean(&torques(&bench.run(1.0)))
}

#[test]
fn the_torque_is_exact_to_a_thousandth_of_the_peak_with_sensors_that_are() {
    let setup = Setup::of(ReferenceAxis::precise()).with_exact_sensors();
    for command in [-0.8, -0.2, -0.01, 0.01, 0.2, 0.8] {
        let error = torque_at(&setup, command) / 24.0 - command;
        println!("at {command}");
        within("error in 0.1 % of peak", error * 1e3, -0.2..0.2);
    }
}

#[test]
fn gain_errors_of_the_sensors_enter_the_torque_with_their_mean() {
    let mut setup = Setup::of(ReferenceAxis::precise());
    setup.reference.machine.current_sensors.gain_error = [0.02, 0.01, 0.03];
    // The loop sees 2 % more than flows.
    let error = torque_at(&setup, 0.5) / 12.0 - 1.0;
    within("error in % of the torque", error * 100.0, -2.0..-1.9);
}

#[test]
fn a_torque_step_rises_within_the_tick_that_it_needs_to_arrive_and_the_current_loop() {
    let mut bench = Bench::new(&Setup::of(ReferenceAxis::precise()));
    bench.machine().block(true, bench.time);
    bench.start(Mode::Torque);
    bench.axis.command_torque(share(0.1));
    bench.run(0.02);
    bench.axis.command_torque(share(0.2));
    let step = Step::of(&torques(&bench.run(0.02)), 2.4, 4.8);
    within("rise in us", step.rise * 125.0, 160.0..240.0);
    within("settling in us", step.settling * 125.0, 250.0..500.0);
    within("overshoot", step.overshoot, -0.01..0.08);
}

#[test]
fn at_the_velocity_limit_the_velocity_loop_takes_over_without_a_kick_and_gives_back() {
    let mut setup = Setup::of(ReferenceAxis::precise());
    setup.axis.velocity_limits = VelocityLimits::new(rpm(300.0), None, None);
    let mut bench = in_torque_mode(&setup);
    bench.axis.command_torque(share(0.1));
    let up = bench.run(0.3);
    // 31.4 rad/s with (2.4 - 0.1) Nm / 0.0024 kg m^2: 33 ms.
    let reached = up.iter().position(|seen| of_radians(seen.velocity) > 297.0).unwrap() as f64 / 8.0;
    within("99 % of the limit after ms", reached, 31.5..34.0);
    within("fastest in rpm", highest(speeds(&up)), 300.0..303.0);
    within("speed at the limit in rpm", mean(&speeds(&up[1_600..])), 299.9..300.1);
    assert!(up[2_399].limiting.contains(Limiting::VELOCITY_BIPOLAR));
    assert!(!up[100].limiting.contains(Limiting::VELOCITY_BIPOLAR));
    // A load takes the axis off the limit: the torque is that of the command again.
    bench.machine().set_load_torque(-4.0, bench.time);
    let held = bench.run(0.02);
    within("torque off the limit in Nm", mean(&torques(&held[80..])), 2.38..2.42);
    assert!(!held[159].limiting.contains(Limiting::VELOCITY_BIPOLAR));
}

/// Fastest speed over the limit, in shares of it, and when the shaft stays within a twentieth of it for good, in ms.
fn passed(seen: &[Seen], limit: f64) -> (f64, f64) {
    let speeds = speeds(seen);
    let beyond = speeds.iter().rposition(|speed| *speed > 1.05 * limit).map_or(0, |last| last + 1);
    (highest(speeds) / limit - 1.0, beyond as f64 / 8.0)
}

#[test]
fn a_light_shaft_that_is_accelerated_with_all_its_torque_keeps_the_velocity_limit() {
    // 40 000, 10 000 and 900 rad/s^2: the light ones are at the limit within some ms.
    for (reference, limit) in [
        (ReferenceAxis::catalogue(), 300.0),
        (ReferenceAxis::catalogue(), 900.0),
        (ReferenceAxis::catalogue(), 2_500.0),
        (ReferenceAxis::small_cnc(), 900.0),
        (ReferenceAxis::precise(), 300.0),
        (ReferenceAxis::precise(), 1_000.0),
        (ReferenceAxis::press(), 300.0),
    ] {
        for share_of_peak in [1.0, -1.0, 0.3] {
            let mut setup = Setup::of(reference);
            setup.axis.velocity_limits = VelocityLimits::new(rpm(limit), None, None);
            let mut bench = in_torque_mode(&setup);
            bench.axis.command_torque(share(share_of_peak));
            let seen = bench.run(0.5);
            let seen: Vec<Seen> =
                seen.iter().map(|seen| Seen { velocity: seen.velocity * share_of_peak.signum(), ..*seen }).collect();
            let (over, beyond) = passed(&seen, limit);
            println!("{}, {limit} rpm, {share_of_peak}: {over:.3} over, beyond for {beyond:.1} ms", reference.name);
            assert!((-0.001..0.02).contains(&over), "{}, {limit} rpm: {over}", reference.name);
            within("speed at the limit", mean(&speeds(&seen[3_200..])) / limit, 0.99..1.002);
        }
    }
}

#[test]
fn a_shaft_whose_load_breaks_away_keeps_the_velocity_limit() {
    for (reference, load) in [(ReferenceAxis::catalogue(), 8.0), (ReferenceAxis::precise(), 12.0)] {
        let mut setup = Setup::of(reference);
        setup.axis.velocity_limits = VelocityLimits::new(rpm(2_000.0), None, None);
        let mut bench = in_torque_mode(&setup);
        bench.machine().set_velocity(1_000.0 * TAU / 60.0, bench.time);
        bench.machine().set_load_torque(-load, bench.time);
        bench.axis.command_torque(share(0.5));
        let drawn = bench.run(0.05);
        within("torque that draws", mean(&torques(&drawn[100..])) / load, 0.97..1.03);
        assert!(!drawn[399].limiting.contains(Limiting::VELOCITY_BIPOLAR));
        bench.machine().set_load_torque(0.0, bench.time);
        let (over, beyond) = passed(&bench.run(0.5), 2_000.0);
        println!("{}: {over:.3} over, beyond for {beyond:.1} ms", reference.name);
        assert!(over < 0.1, "{}: {over}", reference.name);
    }
}

#[test]
fn a_braking_torque_is_not_held_back_at_the_velocity_limit_of_the_other_way() {
    let mut setup = Setup::of(ReferenceAxis::precise());
    setup.axis.velocity_limits = VelocityLimits::new(rpm(300.0), None, None);
    let mut bench = in_torque_mode(&setup);
    bench.machine().set_velocity(400.0 * TAU / 60.0, bench.time);
    bench.axis.command_torque(share(-0.2));
    let seen = bench.run(0.01);
    within("torque in Nm", mean(&torques(&seen[16..])), -4.85..-4.75);
}

#[test]
fn torque_limits_hold_in_torque_mode_and_name_themselves() {
    let mut bench = Bench::new(&Setup::of(ReferenceAxis::press()));
    bench.machine().block(true, bench.time);
    bench.start(Mode::Torque);
    bench.limit_torque(0.3, -0.1, 1.0);
    for (command, expected, cause) in [(0.9, 36.0, Limiting::TORQUE_POSITIVE), (-0.9, -12.0, Limiting::TORQUE_NEGATIVE)]
    {
        bench.axis.command_torque(share(command));
        bench.run(0.02);
        let seen = bench.run(0.05);
        within("torque over what is allowed", mean(&torques(&seen)) / expected, 0.995..1.005);
        assert!(seen[0].limiting.contains(cause));
    }
}

/// The press at its velocity loop, driven towards 3 000 rpm; base speed is 2 310 rpm.
fn fast_press(weakening: u16) -> (Bench, Vec<Seen>) {
    let mut setup = Setup::of(ReferenceAxis::press());
    setup.weakening = weakening;
    // The ink train's friction falls away; otherwise the motor has no torque left for it without weakening.
    setup.reference.machine.mechanics.rotor_inertia = 0.03;
    setup.axis.velocity_gain /= 5;
    let mut bench = Bench::new(&setup);
    bench.start(Mode::Velocity);
    bench.axis.command_velocity(rpm(3_000.0));
    let seen = bench.run(0.6);
    assert_eq!(bench.trip, None);
    (bench, seen)
}

#[test]
fn field_weakening_takes_the_press_over_its_base_speed() {
    let (mut bench, seen) = fast_press(6_000);
    let last = &seen[3_200..];
    within("speed in rpm", mean(&speeds(last)), 2_999.5..3_000.5);
    let direct: Vec<f64> = last.iter().map(|seen| seen.current[0]).collect();
    within("d current as share of peak", mean(&direct), -0.58..-0.5);
    let voltages: Vec<f64> = last.iter().map(|seen| seen.voltage).collect();
    within("voltage as share of the longest", mean(&voltages), 0.925..0.935);
    assert!(last[0].limiting.contains(Limiting::FIELD_WEAKENING));
    let length = largest(seen.iter().map(|seen| seen.current[0].hypot(seen.current[1])));
    within("longest current as share of peak", length, 0.98..1.03);
    bench.axis.command_velocity(rpm(1_000.0));
    bench.run(0.6);
    let back = bench.run(0.05);
    within("d current at 1 000 rpm", largest(back.iter().map(|seen| seen.current[0])), 0.0..0.004);
    assert!(!back[0].limiting.contains(Limiting::FIELD_WEAKENING));
}

#[test]
fn without_field_weakening_the_voltage_ends_the_acceleration() {
    let (_, seen) = fast_press(0);
    let last = &seen[3_200..];
    within("speed in rpm", mean(&speeds(last)), 2_200.0..2_300.0);
    within("voltage as share of the longest", mean(&last.iter().map(|s| s.voltage).collect::<Vec<_>>()), 0.995..1.001);
}

#[test]
fn braking_feeds_the_bus_until_the_chopper_takes_it() {
    let mut bench = Bench::new(&Setup::of(ReferenceAxis::press()));
    bench.start(Mode::Velocity);
    bench.axis.command_velocity(rpm(1_200.0));
    bench.run(0.5);
    bench.axis.command_velocity(rpm(0.0));
    let seen = bench.run(0.4);
    assert_eq!(bench.trip, None);
    // 0.15 kg m^2 at 126 rad/s are 1 180 J, and the 1 mF from 560 V to 680 V takes 74 J.
    within("highest bus voltage in V", highest(seen.iter().map(|seen| seen.bus)), 678.0..683.0);
    let last = &seen[3_000..];
    within("speed in the end in rpm", largest(speeds(last)), 0.0..0.1);
    let braking = seen.iter().filter(|seen| seen.torque < -110.0).count() as f64 / TICKS_PER_SECOND;
    // 126 rad/s with 126 ... 132 Nm / 0.15 kg m^2: 147 ms.
    within("braking with all torque for s", braking, 0.138..0.148);
}
