//! A motor that turns faster than its voltage allows when the bridge is closed: its magnets alone make more than the DC link, and what weakens
//! the field has to flow from the first cycle on.

use std::f64::consts::TAU;

use crate::machine_bench::measure::{highest, within};
use crate::machine_bench::setup::Setup;
use crate::machine_bench::{Bench, Seen};
use plant::ReferenceAxis;
use servo::axis::Mode;
use servo::motor::MotorFaults;

/// In A and rad/s: the current of [`ReferenceAxis::catalogue`] that takes the flux of its magnets away.
const CANCELLING: f64 = 133.333e-3 / 6e-3;

/// The catalogue motor, driven by a load, at the speed with which the bridge is closed; 20 ms of what follows.
fn caught(rpm: f64, load: f64, weakening: u16, mode: Mode) -> (Bench, Vec<Seen>) {
    let mut bench = Bench::new(&Setup { weakening, ..Setup::of(ReferenceAxis::catalogue()) });
    let now = bench.time;
    bench.machine().set_velocity(rpm * TAU / 60.0, now);
    bench.machine().set_load_torque(load, now);
    bench.coast(40);
    let mut seen = bench.ticks(8);
    bench.axis.set_mode(mode);
    seen.extend(bench.ticks(152));
    (bench, seen)
}

#[test]
fn a_motor_that_is_faster_than_its_voltage_is_caught_without_an_overcurrent_with_and_without_a_load_that_drives_it() {
    for (rpm, load) in [(3_700.0, 0.0), (4_200.0, 6.4), (4_800.0, 6.4), (5_200.0, 0.0), (5_500.0, 3.0)] {
        for (sign, mode) in [(1.0, Mode::Velocity), (1.0, Mode::Stopping), (-1.0, Mode::Halt), (-1.0, Mode::Stopping)] {
            let (bench, seen) = caught(sign * rpm, sign * load, 9_000, mode);
            let what = format!("{} rpm, {load} Nm, {mode:?}", sign * rpm);
            assert_eq!((bench.trip, bench.faults), (None, MotorFaults::NONE), "{what}");
            let current = highest(seen.iter().map(|seen| seen.current[0].hypot(seen.current[1])));
            println!("{what}: {current:.3} of peak, {:.0} V", seen[0].bus);
            assert!(current < 0.75, "{what}: {current} of peak");
            assert!(seen[24..].iter().all(|seen| seen.voltage < 1.0), "{what}: within 3 ms there is voltage to spare");
        }
    }
}

#[test]
fn what_weakens_the_field_is_what_the_voltage_asks_for_and_no_more_than_its_limit() {
    let (_, seen) = caught(4_800.0, 0.0, 9_000, Mode::Velocity);
    let begun = &seen[8];
    let speed = begun.velocity * 4.0;
    let held = 0.93 * 0.98 * begun.bus / 3.0_f64.sqrt();
    let expected = -CANCELLING * (1.0 - held / (speed * 133.333e-3)) / 20.0;
    println!("{:.3} at {held:.0} V, expected {expected:.3}", begun.current[0]);
    within("d current by the data of the motor", begun.current[0] / expected, 0.8..1.25);
    let (_, limited) = caught(4_800.0, 0.0, 1_000, Mode::Velocity);
    within("d current at its limit", limited[80].current[0], -0.14..-0.06);
    let (_, slow) = caught(2_500.0, 0.0, 9_000, Mode::Velocity);
    assert!(slow.iter().all(|seen| seen.current[0].abs() < 0.05), "below the voltage nothing is weakened");
}
