//! The laws of the axis over an ordinary life: every one of them has something to look at, and none is broken.
//!
//! That each can be broken is shown beside it, in the crate `laws`; that every other test is a test of the laws too is the bench's doing.

use std::collections::BTreeMap;

use crate::led::{Axis, FOLLOW, HALT, OFF};
use crate::running::{ADDRESS, Bench};
use bench::{DriveSetup, Works, parameters_of};
use plant::ReferenceAxis;
use ring::Nanoseconds;
use ring::ident::{Idn, Value};
use ring::master::{CommandValues, DriveScript, MasterScript, Motion, Telegram};
use ring::service_client::Request;

fn armed(bench: &Bench, all: &mut BTreeMap<&'static str, u64>) {
    let laws = bench.drive.laws.borrow();
    assert_eq!(laws.broken(), None);
    for coverage in laws.coverage() {
        *all.entry(coverage.law).or_default() += coverage.armed;
    }
}

/// A homed press axis with position limits that follows, halts, is switched off and on, fails and comes back.
fn life_of_a_press() -> Bench {
    let mut axis = Axis::of(11, vec![(Idn(55), Value::Word(0x10))], |mut script| {
        script.drives[0].telegram = Telegram::application(
            &[Idn(51), Idn(189), Idn(403), Idn(390)],
            &[Idn::POSITION_COMMAND, Idn::VELOCITY_COMMAND, Idn::TORQUE_COMMAND],
        );
        script
    });
    for step in 0..200 {
        axis.position(f64::from(step));
        axis.run(2);
    }
    axis.run(200);
    axis.switches(HALT);
    axis.run(1_500);
    axis.switches(FOLLOW);
    axis.run(100);
    axis.switches(OFF);
    axis.run(500);
    let bench = &mut axis.bench;
    bench.write(52, Value::Long(1_990_000)).unwrap();
    assert!(bench.ask(Request::Command { idn: Idn(447), polls: 20 }).is_ok());
    assert_eq!(bench.read(51), Value::Long(1_990_000));
    bench.write(92, Value::Word(1_500)).unwrap();
    assert_eq!((bench.number(92), bench.number(79)), (1_500, 3_600_000));
    axis.command(|commands| commands.position = 1_990_000);
    axis.switches(FOLLOW);
    axis.run(300);
    let contactor = |bench: &Bench, main_power| {
        let amplifier = bench::Amplifier { main_power, fault: false };
        bench.drive.motor_side.borrow_mut().set_amplifier_inputs(amplifier);
    };
    contactor(&axis.bench, false);
    axis.run(50);
    contactor(&axis.bench, true);
    axis.switches(0);
    axis.run(700);
    axis.bench.clear_errors();
    axis.switches(FOLLOW);
    axis.run(300);
    assert!(axis.bench.has_torque());
    // Two and a half revolutions in a cycle.
    axis.command(|commands| commands.position += 9_000_000);
    axis.run(300);
    assert_ne!(axis.diagnosis().0, 0);
    axis.bench
}

/// A vertical axis whose torque is taken by bit 14.
fn life_of_a_vertical_axis() -> Bench {
    let mut bench = Bench::vertical(Works::OfItsAxis);
    bench.run_to_operation();
    bench.run(Nanoseconds::from_millis(300));
    bench.world.ring_mut().master_mut().hold_switches(Some(0));
    bench.run(Nanoseconds::from_millis(300));
    assert!(!bench.has_torque());
    bench
}

/// An axis that goes by itself: to a target, past a probe, and home.
fn life_of_an_axis_that_positions_itself() -> Bench {
    let drive = DriveScript::new(ADDRESS, Telegram::application(&[Idn(51), Idn(40)], &[Idn::VELOCITY_COMMAND]))
        .with(Idn::OPERATION_MODE, Value::Word(0x1B))
        .with_all(parameters_of(&ReferenceAxis::press()))
        .with(Idn(259), Value::Long(600_000))
        .with(Idn(260), Value::Long(200_000))
        .with(Idn(41), Value::Long(300_000))
        .with(Idn(42), Value::Long(50_000))
        .with(Idn(147), Value::Word(0x20))
        .with(Idn(169), Value::Word(1));
    let motion = Motion { patience: 100_000, ..Motion::new(1_000_000, |_| CommandValues::default()) };
    let script = MasterScript { motion: Some(motion), stops_at_refusals: false, ..MasterScript::new(vec![drive]) };
    let mut bench = Bench::new(DriveSetup::new(ADDRESS), script);
    bench.run_to_operation();
    bench.run(Nanoseconds::from_millis(600));
    let before = bench.number(51);
    assert_eq!(bench.number(124), 100_000);
    bench.write(170, Value::Word(3)).unwrap();
    bench.write(405, Value::Word(1)).unwrap();
    bench.run(Nanoseconds::from_millis(20));
    bench.drive.motor_side.borrow_mut().change_inputs(|inputs| inputs.probe_1 = true);
    bench.run(Nanoseconds::from_millis(20));
    assert!(bench.number(130).abs_diff(before) < 100);
    bench.write(170, Value::Word(0)).unwrap();
    bench.write(258, Value::Long(1_800_000)).unwrap();
    bench.run(Nanoseconds::from_millis(2_000));
    assert!(bench.number(51).abs_diff(1_800_000) < 100);
    // To the next marker, three quarters of a revolution further.
    bench.write(148, Value::Word(3)).unwrap();
    for _ in 0..100 {
        bench.run(Nanoseconds::from_millis(100));
        if bench.number(148) & 0xF != 7 {
            break;
        }
    }
    let status = bench.number(148);
    assert_eq!((status, bench.text(0x8003).as_str()), (3, ""));
    bench
}

#[test]
fn every_law_looks_at_an_ordinary_life_and_none_is_broken() {
    let mut all = BTreeMap::new();
    armed(&life_of_a_press(), &mut all);
    armed(&life_of_a_vertical_axis(), &mut all);
    armed(&life_of_an_axis_that_positions_itself(), &mut all);
    let blind: Vec<_> = all.iter().filter(|(_, armed)| **armed == 0).map(|(law, _)| law).collect();
    assert!(blind.is_empty(), "never looked: {blind:?}");
    assert!(all.len() >= 24, "{} laws", all.len());
}
