//! Phase currents from shunts in the low-side emitters, which show nothing while the low side is on for too short a time; and what finds a sensor
//! that is wrong, there and in the lines.

use std::f64::consts::TAU;

use crate::machine_bench::master::{of_radians, rpm};
use crate::machine_bench::measure::{deviation, highest, largest, mean, within};
use crate::machine_bench::setup::Setup;
use crate::machine_bench::{Bench, CYCLES_PER_SECOND, Kind, OnShunts};
use plant::ReferenceAxis;
use servo::axis::{Limiting, Mode};
use servo::current::Trip;
use servo::motor::{BoardKind, MotorFault, MotorFaults};

/// At a speed in rpm that nothing changes, without a current.
fn turning<B: BoardKind>(setup: Setup, rpm: f64) -> Bench<B> {
    let mut bench = Bench::on_board(&setup.with_flywheel());
    bench.machine().set_velocity(rpm * TAU / 60.0, bench.time);
    bench.current_cycles([0.0; 2], 800);
    bench
}

/// The press on its shunts.
fn press() -> Setup {
    Setup::of(ReferenceAxis::press()).with_shunts()
}

fn quadrature(currents: &[[f64; 2]]) -> Vec<f64> {
    currents.iter().map(|current| current[1]).collect()
}

#[test]
fn the_press_carries_its_load_on_shunts_as_with_sensors_in_the_lines() {
    // At 2 000 rpm 0.1 of peak is 0.91 of the longest vector, and the peak current needs more than there is.
    for (speed, current, reached) in [
        (1_480.0, 0.15, 0.150),
        (1_480.0, 1.0, 1.0),
        (2_000.0, 0.1, 0.1),
        (2_000.0, 0.5, 0.5),
        (2_000.0, 1.0, 0.617),
        (-2_000.0, 1.0, 1.0),
    ] {
        let mut on_shunts = turning::<OnShunts>(press(), speed);
        let mut in_line = turning::<Kind>(Setup::of(ReferenceAxis::press()), speed);
        let flowing = |bench: &mut dyn FnMut([f64; 2], usize) -> Vec<[f64; 2]>| {
            bench([0.0, current], 1_600);
            quadrature(&bench([0.0, current], 1_600))
        };
        let seen = flowing(&mut |reference, cycles| on_shunts.current_cycles(reference, cycles));
        let expected = flowing(&mut |reference, cycles| in_line.current_cycles(reference, cycles));
        println!("{speed} rpm, {current} of peak");
        assert_eq!((on_shunts.trip, on_shunts.faults), (None, MotorFaults::NONE));
        assert_eq!((in_line.trip, in_line.faults), (None, MotorFaults::NONE));
        // At the limit of the voltage the two differ by 5 % of what it leaves; an amplifier that has just settled misses 1 %.
        within("current on shunts", mean(&seen), reached - 0.02..reached + 0.02);
        within("current in the lines", mean(&expected), reached - 0.02..reached + 0.02);
        within("ripple on shunts in % of peak", deviation(&seen) * 100.0, 0.02..0.4);
        within("ripple in the lines in % of peak", deviation(&expected) * 100.0, 0.02..0.45);
    }
}

#[test]
fn without_the_board_fact_the_same_shunts_trip_the_sum() {
    let mut bench = turning::<Kind>(press(), 1_480.0);
    bench.current_cycles([0.0, 0.15], 1_600);
    assert_eq!(bench.trip, Some(Trip::CurrentSum));
}

/// The press without its ink train, to 3 000 rpm with the field weakened: its speed, d current and voltage in the end.
fn weakened<B: BoardKind>(mut setup: Setup) -> [f64; 3] {
    setup.weakening = 6_000;
    setup.reference.machine.mechanics.rotor_inertia = 0.03;
    setup.axis.velocity_gain /= 5;
    let mut bench = Bench::<B>::on_board(&setup);
    bench.start(Mode::Velocity);
    bench.axis.command_velocity(rpm(3_000.0));
    let seen = bench.run(0.6);
    assert_eq!((bench.trip, bench.faults), (None, MotorFaults::NONE));
    let length = largest(seen.iter().map(|seen| seen.current[0].hypot(seen.current[1])));
    within("longest current as share of peak", length, 0.98..1.05);
    let last = &seen[3_200..];
    assert!(last.iter().all(|seen| seen.limiting.contains(Limiting::FIELD_WEAKENING)));
    let end = [
        mean(&last.iter().map(|seen| of_radians(seen.velocity)).collect::<Vec<_>>()),
        mean(&last.iter().map(|seen| seen.current[0]).collect::<Vec<_>>()),
        mean(&last.iter().map(|seen| seen.voltage).collect::<Vec<_>>()),
    ];
    bench.axis.command_velocity(rpm(-3_000.0));
    bench.run(1.2);
    assert_eq!((bench.trip, bench.faults), (None, MotorFaults::NONE));
    let speed = of_radians(bench.machine().velocity(bench.time));
    within("speed in the other direction in rpm", speed, -3_005.0..-2_995.0);
    end
}

#[test]
fn field_weakening_takes_the_press_over_its_base_speed_on_shunts_as_in_the_lines() {
    let on_shunts = weakened::<OnShunts>(press());
    let in_line = weakened::<Kind>(Setup::of(ReferenceAxis::press()));
    for ([speed, direct, voltage], sensors) in [(on_shunts, "shunts"), (in_line, "in line")] {
        println!("{sensors}");
        within("speed in rpm", speed, 2_999.5..3_000.5);
        within("d current as share of peak", direct, -0.58..-0.5);
        within("voltage as share of the longest", voltage, 0.925..0.935);
    }
    within("difference of the d currents", on_shunts[1] - in_line[1], -0.01..0.01);
}

/// To the maximum speed in a second, in two through zero to that in the other direction, and to a stand; largest share of the longest vector.
fn driven<B: BoardKind>(mut setup: Setup) -> f64 {
    setup.weakening = 6_000;
    let full = f64::from(setup.reference.maximum_speed);
    let mut bench = Bench::<B>::on_board(&setup);
    bench.start(Mode::Velocity);
    let now = bench.time;
    bench.machine().set_brake(true, now);
    let mut voltage = 0.0_f64;
    for step in 1..=400 {
        let share = f64::from(step) / 100.0;
        let command = full * if step <= 300 { 1.0 - (share - 1.0).abs() } else { share - 4.0 };
        bench.axis.command_velocity(rpm(command));
        voltage = voltage.max(highest(bench.run(0.01).iter().map(|seen| seen.voltage)));
        let name = setup.reference.name;
        assert_eq!((bench.trip, bench.faults), (None, MotorFaults::NONE), "{name} at {command} rpm");
        if step % 100 == 0 && step % 200 != 0 {
            let seen = bench.run(0.2);
            let speed = mean(&seen[1_200..].iter().map(|seen| of_radians(seen.velocity)).collect::<Vec<_>>());
            within("share of the speed that is asked for", speed / command, 0.99..1.01);
        }
    }
    voltage
}

#[test]
fn no_reference_axis_trips_from_standstill_to_full_speed_and_back_on_shunts_or_in_the_lines() {
    for axis in ReferenceAxis::ALL {
        let setup = Setup::of(axis());
        println!("{}", setup.reference.name);
        within("longest vector in the lines", driven::<Kind>(setup), 0.7..1.02);
        within("longest vector on shunts", driven::<OnShunts>(setup.with_shunts()), 0.7..1.02);
    }
}

/// Milliseconds until sensors switch off that are broken at this moment, at a speed in rpm and a share of the peak current.
fn found<B: BoardKind>(setup: &Setup, [speed, current]: [f64; 2], fail: impl FnOnce(&mut Bench<B>)) -> f64 {
    let mut bench = turning::<B>(*setup, speed);
    assert_eq!((bench.trip, bench.faults), (None, MotorFaults::NONE), "before it fails");
    bench.current_cycles([0.0, current], 32);
    fail(&mut bench);
    let cycle = (1..=16_000_u32).find(|_| {
        bench.current_cycle([0.0, current]);
        bench.trip == Some(Trip::CurrentSum) || bench.faults.contains(MotorFault::CurrentSensor)
    });
    let cycle = cycle.unwrap_or_else(|| panic!("not found in a second at {speed} rpm, {current} of peak"));
    f64::from(cycle) / CYCLES_PER_SECOND * 1e3
}

/// Longest times in ms until a sensor is found whose gain is 5 % off, whose zero has moved by 85 counts of 2 048, and that is dead: whichever it is,
/// and in whichever direction.
fn times<B: BoardKind>(setup: &Setup, state: [f64; 2]) -> [f64; 3] {
    let mut longest = [0.0_f64; 3];
    for phase in 0..3 {
        for sign in [1.0, -1.0] {
            let mut gain = *setup;
            gain.reference.machine.current_sensors.gain_error[phase] = 0.05 * sign;
            let gain = found::<B>(&gain, state, |_| {});
            let shifted = found::<B>(setup, state, |bench| {
                let at = bench.time;
                bench.machine().shift_current_sensor(phase, (sign * 85.0) as i32, at);
            });
            longest = [longest[0].max(gain), longest[1].max(shifted), longest[2]];
        }
        let dead = found::<B>(setup, state, |bench| {
            let at = bench.time;
            bench.machine().fail_current_sensor(phase, Some(2_048), at);
        });
        longest[2] = longest[2].max(dead);
    }
    longest
}

#[test]
fn a_sensor_with_a_wrong_gain_or_zero_and_one_that_is_dead_is_found_on_shunts_and_in_the_lines() {
    // rpm and share of peak: slowly, at half and at full speed with peak load, and up to 0.99 of the longest vector.
    for (state, in_line, on_shunts) in [
        ([30.0, 0.4], [224.0, 25.0, 0.06], [224.0, 25.0, 0.06]),
        ([600.0, 0.4], [186.0, 25.0, 0.06], [186.0, 25.0, 0.06]),
        ([1_480.0, 1.0], [68.0, 25.0, 0.06], [70.0, 35.0, 1.0]),
        ([2_000.0, 0.5], [130.0, 25.0, 0.19], [331.0, 73.0, 2.4]),
        ([2_100.0, 0.35], [232.0, 25.0, 0.81], [884.0, 110.0, 2.1]),
    ] {
        for (sensors, found, expected) in [
            ("in the lines", times::<Kind>(&Setup::of(ReferenceAxis::press()), state), in_line),
            ("on shunts", times::<OnShunts>(&press(), state), on_shunts),
        ] {
            println!("{} rpm, {} of peak, {sensors}", state[0], state[1]);
            // Where in a mean the sensor breaks shifts it by a part of that mean.
            for (what, (found, expected)) in ["gain", "zero", "dead"].into_iter().zip(found.into_iter().zip(expected)) {
                within(&format!("{what}, found after ms"), found, expected * 0.65..expected * 1.5);
            }
        }
    }
}

#[test]
fn a_motor_that_charges_the_link_through_the_diodes_moves_no_zero_of_the_shunts() {
    // 3 000 rpm make 725 V, of which the chopper burns what is above 680 V.
    let mut bench = turning::<OnShunts>(press(), 1_000.0);
    let ripple = |bench: &mut Bench<OnShunts>| {
        bench.current_cycles([0.0, 0.1], 800);
        deviation(&quadrature(&bench.current_cycles([0.0, 0.1], 1_600))) * 100.0
    };
    let before = ripple(&mut bench);
    bench.open(8);
    let at = bench.time;
    bench.machine().set_velocity(3_000.0 * TAU / 60.0, at);
    bench.open(4_000);
    let at = bench.time;
    let largest_current = largest(bench.machine().phase_currents(at));
    within("current into the link in A", largest_current, 2.0..70.0);
    within("bus in V", bench.machine().bus_voltage(at), 650.0..700.0);
    bench.machine().set_velocity(1_000.0 * TAU / 60.0, at);
    bench.open(160);
    bench.close();
    let after = ripple(&mut bench);
    assert_eq!((bench.trip, bench.faults), (None, MotorFaults::NONE));
    within("ripple in % of peak", before, 0.01..0.06);
    within("and afterwards", after, before * 0.8..before * 1.2);
}
