//! What braking gives back: without a chopper, with the drive's own, and with one that gets too hot, over the ring.

use crate::elf::on_qemu_on_any_cpu;
use crate::running::{ADDRESS, Bench, script};
use bench::{DriveSetup, Executor, product};
use plant::ReferenceAxis;
use ring::Nanoseconds;
use ring::ident::{Idn, Value};
use ring::master::{CommandValues, MasterScript, Motion};
use ring::service_client::control;

const DIAGNOSTIC_NUMBER: u16 = 390;
const BIT_15_OFF: u16 = control::ENABLE | control::NO_HALT;
/// P-0-0105 of the press axis.
const OVERVOLTAGE: f64 = 784.0;

/// The press axis in velocity mode at 1 400 rpm, with this supply and these data blocks.
fn turning(axis: ReferenceAxis, executor: Executor, parameters: Vec<(Idn, Value)>) -> Bench {
    let drive = script().drives.remove(0).with_all(parameters);
    let motion = Motion::new(1_000_000, |_| CommandValues::at_velocity(1_400 * 10_000));
    let script = MasterScript { motion: Some(motion), stops_at_refusals: false, ..MasterScript::new(vec![drive]) };
    let mut setup = DriveSetup::new(ADDRESS);
    setup.axis.machine.supply = axis.machine.supply;
    let mut bench = Bench::on(executor, setup, script);
    for _ in 0..2_000 {
        bench.run(Nanoseconds::from_millis(10));
        if bench.rpm() > 1_395.0 {
            bench.run(Nanoseconds::from_millis(100));
            return bench;
        }
    }
    panic!("{}", bench.world.ring().master().state());
}

fn bus(bench: &mut Bench) -> f64 {
    let now = bench.world.now().0;
    bench.drive.motor_side.borrow_mut().machine().bus_voltage(now)
}

/// Seconds until the shaft stands, and the highest voltage of the DC link on the way.
fn stop(bench: &mut Bench) -> (f64, f64) {
    bench.world.ring_mut().master_mut().hold_switches(Some(BIT_15_OFF));
    let from = bench.world.now();
    let mut highest = 0.0_f64;
    loop {
        bench.run(Nanoseconds::from_microseconds(500));
        highest = highest.max(bus(bench));
        let seconds = (bench.world.now() - from).as_seconds();
        if bench.rpm().abs() < 1.0 || seconds > 20.0 {
            return (seconds, highest);
        }
    }
}

/// At the torque limit, without a ramp.
fn at_the_limit() -> Vec<(Idn, Value)> {
    vec![(Idn(138), Value::Long(2_000_000))]
}

#[test]
fn without_a_chopper_a_stop_takes_longer_and_ends_without_an_error() {
    let (mut with, mut without) = (
        turning(ReferenceAxis::press(), Executor::Host, at_the_limit()),
        turning(ReferenceAxis::press().without_chopper(), Executor::Host, at_the_limit()),
    );
    let (quick, _) = stop(&mut with);
    let (slow, highest) = stop(&mut without);
    println!("{quick:.3} s with a chopper, {slow:.3} s and {highest:.0} V without one");
    // 147 rad/s with 130 Nm / 0.15 kg m^2.
    assert!((0.15..0.25).contains(&quick), "{quick} s");
    assert!((0.8..4.0).contains(&slow), "{slow} s");
    assert!((0.93 * OVERVOLTAGE..0.995 * OVERVOLTAGE).contains(&highest), "{highest} V");
    for bench in [&mut with, &mut without] {
        bench.run(Nanoseconds::from_millis(300));
        assert_eq!(bench.number(11), 0, "S-0-0011");
    }
}

#[test]
fn a_full_link_is_told_while_it_limits() {
    let mut bench = turning(ReferenceAxis::press().without_chopper(), Executor::Host, at_the_limit());
    assert_eq!(bench.number(181) & 0xE0, 0);
    bench.world.ring_mut().master_mut().hold_switches(Some(BIT_15_OFF));
    bench.run(Nanoseconds::from_millis(300));
    assert_eq!((bench.number(181) & 0xE0, bench.number(DIAGNOSTIC_NUMBER)), (1 << 5, 0xE006));
    assert_ne!(bench.number(0x8000 | 160) & 1 << 7, 0, "P-0-0160");
    bench.run(Nanoseconds::from_millis(10_000));
    assert_eq!(bench.number(181) & 0xE0, 0);
}

/// 15 ohm in the drive's hands.
fn with_resistor(watts: u32) -> Vec<(Idn, Value)> {
    let more = vec![(product(235), Value::Word(150)), (product(236), Value::Long(watts))];
    [at_the_limit(), more].concat()
}

#[test]
fn the_drive_s_own_chopper_takes_what_a_stop_gives_back() {
    let mut bench = turning(ReferenceAxis::press().with_resistor(15.0), Executor::Host, with_resistor(1_000));
    let (seconds, highest) = stop(&mut bench);
    assert!((0.15..0.25).contains(&seconds), "{seconds} s");
    assert!((0.945 * OVERVOLTAGE..0.965 * OVERVOLTAGE).contains(&highest), "{highest} V");
    // 1 610 J of movement, less friction, windings and what the link has taken, in 1 000 W * 10 s.
    let load = bench.number(0x8000 | 238);
    assert!((70..150).contains(&load), "{load}");
    bench.run(Nanoseconds::from_millis(300));
    assert_eq!(bench.number(11), 0, "S-0-0011");
}

#[test]
fn a_resistor_that_is_too_hot_is_told_and_the_stop_goes_on_without_it() {
    let mut bench = turning(ReferenceAxis::press().with_resistor(15.0), Executor::Host, with_resistor(50));
    let (seconds, highest) = stop(&mut bench);
    assert!((0.3..4.0).contains(&seconds), "{seconds} s");
    assert!((0.945 * OVERVOLTAGE..0.999 * OVERVOLTAGE).contains(&highest), "{highest} V");
    assert_eq!((bench.number(11), bench.number(DIAGNOSTIC_NUMBER)), (0, 0xE008));
    bench.run(Nanoseconds::from_millis(4_000));
    assert_eq!(bench.number(181) & 0xE0, 0, "it has cooled down");
}

#[test]
#[ignore = "needs QEMU and the ELF: cargo xtask test"]
fn the_pin_of_the_flashed_elf_switches_at_95_and_92_percent_and_is_off_in_the_end() {
    let axis = ReferenceAxis::press().with_resistor(15.0);
    let mut bench = turning(axis, on_qemu_on_any_cpu(), with_resistor(1_000));
    let elf = bench.drive.elf.clone().expect("it runs in QEMU");
    assert!(elf.tape.borrow().chopper.is_empty(), "nothing was to be burned");
    let (seconds, highest) = stop(&mut bench);
    assert!((0.15..0.25).contains(&seconds), "{seconds} s");
    assert!((0.945 * OVERVOLTAGE..0.965 * OVERVOLTAGE).contains(&highest), "{highest} V");
    let tape = elf.tape.borrow().chopper.clone();
    assert!(tape.len() > 10 && tape.iter().step_by(2).all(|(_, on)| *on), "{tape:?}");
    assert!(!tape.last().unwrap().1, "on in the end");
}
