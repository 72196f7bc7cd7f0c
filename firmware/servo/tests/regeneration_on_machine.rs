//! What a motor gives back when it brakes: into a DC link that nothing empties, and into the resistor of the drive's own chopper.

use std::f64::consts::TAU;

use crate::machine_bench::master::rpm;
use crate::machine_bench::measure::{highest, within};
use crate::machine_bench::setup::Setup;
use crate::machine_bench::{Bench, Seen, TICKS_PER_SECOND};
use plant::ReferenceAxis;
use servo::axis::{Limiting, Mode};
use servo::motor::MotorFaults;

fn axes() -> [ReferenceAxis; 5] {
    [
        ReferenceAxis::press(),
        ReferenceAxis::small_cnc(),
        ReferenceAxis::precise(),
        ReferenceAxis::vertical(),
        // Faster, its magnets alone would charge the link beyond the threshold.
        ReferenceAxis { maximum_speed: 3_300, ..ReferenceAxis::catalogue() },
    ]
}

/// Share of the peak current that weakens the field, in 0.01 %.
fn weakening(reference: &ReferenceAxis) -> u16 {
    if reference.name.starts_with("press") { 9_000 } else { 5_000 }
}

/// The axis at its maximum speed; its brake, which this bench does not serve, is out of the way.
fn at_full_speed(reference: ReferenceAxis, change: impl FnOnce(&mut Setup)) -> (Bench, f64) {
    let mut setup = Setup { weakening: 9_000, ..Setup::of(reference) };
    change(&mut setup);
    let speed = f64::from(reference.maximum_speed) * 0.98;
    let mut bench = Bench::new(&setup);
    bench.machine().set_brake(true, 0);
    let now = bench.time;
    bench.machine().set_brake(true, now);
    bench.start(Mode::Velocity);
    bench.axis.command_velocity(rpm(speed));
    for _ in 0..80 {
        if bench.run(0.05).iter().all(|seen| (seen.velocity * 60.0 / TAU / speed - 1.0).abs() < 0.01) {
            return (bench, f64::from(setup.overvoltage()));
        }
    }
    panic!("{} does not come to {speed} rpm", reference.name);
}

/// Seconds until the shaft has come to rest.
fn seconds(seen: &[Seen]) -> f64 {
    let moving = seen.iter().rposition(|seen| seen.velocity.abs() > 0.5).unwrap();
    assert!(moving + 100 < seen.len(), "it never comes to rest");
    moving as f64 / TICKS_PER_SECOND
}

fn assert_sound(bench: &Bench, name: &str) {
    assert_eq!((bench.trip, bench.faults), (None, MotorFaults::NONE), "{name}");
}

#[test]
fn without_a_chopper_every_axis_stops_from_full_speed_with_all_its_torque_and_none_reaches_the_overvoltage() {
    // Shortest time of a stop with all the torque, and that which the link and the losses leave.
    for (axis, expected) in axes().into_iter().zip([2.0..12.0, 0.005..0.2, 0.01..0.5, 0.01..0.2, 0.01..0.6]) {
        let mut times = [0.0; 2];
        for (time, reference) in times.iter_mut().zip([axis, axis.without_chopper()]) {
            let (mut bench, overvoltage) = at_full_speed(reference, |setup| setup.weakening = weakening(&reference));
            bench.axis.set_mode(Mode::Braking);
            let seen = bench.run(13.0);
            assert_sound(&bench, axis.name);
            *time = seconds(&seen);
            let bus = highest(seen.iter().map(|seen| seen.bus));
            println!("{}: {:.3} s, {bus:.0} V of {overvoltage} V", axis.name, *time);
            assert!(bus < 0.99 * overvoltage, "{}: {bus} V", axis.name);
        }
        let [with, without] = times;
        assert!(without >= with * 0.98, "{}: {without} s without a chopper, {with} s with one", axis.name);
        assert!(expected.contains(&without), "{}: {without} s", axis.name);
    }
}

#[test]
fn a_press_that_brakes_without_a_chopper_fills_its_link_and_goes_on_with_what_friction_and_windings_take() {
    let (mut bench, overvoltage) = at_full_speed(ReferenceAxis::press().without_chopper(), |_| {});
    bench.axis.set_mode(Mode::Braking);
    let seen = bench.run(0.5);
    assert_sound(&bench, "press");
    let full = &seen[2_000..];
    // What flows in is what the windings burn: the link stands between the ends of the limit.
    within(
        "lowest voltage of the link",
        full.iter().map(|s| s.bus).fold(f64::MAX, f64::min),
        0.95 * overvoltage..0.99 * overvoltage,
    );
    within("highest voltage of the link", highest(seen.iter().map(|s| s.bus)), 0.95 * overvoltage..0.99 * overvoltage);
    assert!(full.iter().all(|seen| seen.limiting.contains(Limiting::VOLTAGE)), "P-0-0160 says so");
    assert!(bench.watched().link_full, "and a warning");
    assert!(full.iter().all(|seen| seen.torque < 0.5), "it never drives");
    // And it is over when there is nothing to be limited.
    bench.run(12.0);
    assert!(!bench.watched().link_full);
    let held = bench.run(0.1);
    within("velocity at rest", highest(held.iter().map(|s| s.velocity.abs())), 0.0..0.2);
}

#[test]
fn the_chopper_takes_what_the_motor_gives_back_and_its_load_is_that_of_the_energy() {
    let (mut bench, overvoltage) =
        at_full_speed(ReferenceAxis::press().with_resistor(15.0), |setup| setup.resistor_power = 1_500);
    let speed = bench.run(0.01)[0].velocity;
    assert_eq!(bench.watched().chopper_load, 0, "it has had nothing to do");
    bench.axis.set_mode(Mode::Braking);
    let seen = bench.run(1.0);
    assert_sound(&bench, "press");
    within("seconds of the stop", seconds(&seen), 0.33..0.42);
    within("highest voltage", highest(seen.iter().map(|s| s.bus)), 0.949 * overvoltage..0.96 * overvoltage);
    // 0.075 * v^2 less what friction and windings took on the way.
    let kinetic = 0.075 * speed * speed;
    let friction: f64 =
        seen.iter().map(|s| (6.0 + 0.05 * s.velocity.abs()) * s.velocity.abs() / TICKS_PER_SECOND).sum();
    let peak = bench.peak;
    let copper: f64 = seen
        .iter()
        .map(|s| 1.5 * 0.35 * peak * peak * (s.current[0].powi(2) + s.current[1].powi(2)) / TICKS_PER_SECOND)
        .sum();
    let link = 0.5e-3 * (seen.last().unwrap().bus.powi(2) - 560.0_f64.powi(2));
    let burned = kinetic - friction - copper - link;
    let expected = burned / (1_500.0 * 10.0);
    let load = f64::from(bench.watched().chopper_load) / 1_000.0;
    println!("{kinetic:.0} J - {friction:.0} J - {copper:.0} J - {link:.0} J: load {load}, expected {expected}");
    // Inverter losses, and what has cooled down in a second: together some per cent.
    assert!((0.80..1.03).contains(&(load / expected)), "{load} instead of {expected}");
}

#[test]
fn a_resistor_that_is_too_hot_is_switched_off_and_the_stop_goes_on_without_it() {
    let (mut bench, overvoltage) =
        at_full_speed(ReferenceAxis::press().with_resistor(15.0), |setup| setup.resistor_power = 100);
    bench.axis.set_mode(Mode::Braking);
    let seen = bench.run(0.5);
    assert_sound(&bench, "press");
    let watched = bench.watched();
    assert!(watched.chopper_off && watched.chopper_warning && watched.link_full, "{watched:?}");
    // 100 W for 10 s are 1 000 J of the 6 kJ.
    within("load in 0.1 %", f64::from(watched.chopper_load), 900.0..1_020.0);
    within("highest voltage", highest(seen.iter().map(|s| s.bus)), 0.95 * overvoltage..0.998 * overvoltage);
    let moving = seen.last().unwrap().velocity;
    assert!(moving > 100.0, "{moving}: it brakes no longer with all its torque");
    bench.run(12.0);
    assert_sound(&bench, "press");
    assert!(bench.run(0.1).iter().all(|seen| seen.velocity.abs() < 0.2), "and it stands in the end");
    assert!(!bench.watched().chopper_off, "it has cooled down");
}

#[test]
fn mains_that_are_too_high_are_burned_with_the_bridge_off_as_well() {
    let mut axis = ReferenceAxis::catalogue().with_resistor(47.0);
    axis.machine.supply.resistance = 20.0;
    let mut bench = Bench::new(&Setup { resistor_power: 1_000, ..Setup::of(axis) });
    bench.coast(4);
    let now = bench.time;
    bench.machine().set_supply(430.0, now);
    let mut highest = 0.0_f64;
    for _ in 0..40 {
        bench.coast(40);
        let at = bench.time;
        highest = highest.max(bench.machine().bus_voltage(at));
    }
    // 95 % of 448 V; 430 V less what 47 of 67 ohm leave of it.
    within("highest voltage", highest, 415.0..427.0);
    assert!(bench.watched().chopper_load > 0);
}

#[test]
fn a_hanging_load_is_held_and_lowered_with_a_link_that_is_full() {
    let reference = ReferenceAxis::vertical().without_chopper();
    let setup = Setup::of(reference);
    let mut bench = Bench::new(&setup);
    let now = bench.time;
    bench.machine().set_brake(true, now);
    bench.start(Mode::Velocity);
    bench.axis.command_velocity(rpm(0.0));
    bench.run(0.5);
    // Below the trip, above everything that the limit leaves to an axis without a brake.
    let full = 0.986 * f64::from(setup.overvoltage());
    for speed in [0.0, -20.0, -500.0] {
        bench.axis.command_velocity(rpm(speed));
        for _ in 0..500 {
            let now = bench.time;
            bench.machine().set_bus_voltage(full, now);
            let seen = bench.run(0.001);
            let fastest = seen.iter().map(|s| s.velocity * 60.0 / TAU).fold(f64::MAX, f64::min);
            assert!(fastest > 1.25 * speed - 30.0, "{fastest} rpm at {speed} rpm: it falls");
        }
        assert_sound(&bench, "vertical");
        let last = bench.run(0.01);
        within("speed in rpm", last.last().unwrap().velocity * 60.0 / TAU, speed - 3.0..speed + 3.0);
    }
    assert_sound(&bench, "vertical");
}
