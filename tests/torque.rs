//! Torque where the axis does not do what it is told: switched on while it turns, pressed against a stop. Over the ring.

use crate::running::{ADDRESS, Bench, script};
use bench::{DriveSetup, product};
use plant::{BrakeFailure, HoldingBrake, ReferenceAxis};
use ring::Nanoseconds;
use ring::ident::{Idn, Value};
use ring::master::{CommandValues, MasterScript, Motion};
use ring::service_client::control;

const CLASS_1: u16 = 11;
const DIAGNOSTIC_NUMBER: u16 = 390;
const FOLLOW: u16 = control::ON | control::ENABLE | control::NO_HALT;

fn hold(bench: &mut Bench, switches: u16) {
    bench.world.ring_mut().master_mut().hold_switches(Some(switches));
}

/// The press axis in velocity mode, turning with so many rpm, with these data blocks written before.
fn turning(axis: ReferenceAxis, rpm: i32, parameters: Vec<(Idn, Value)>) -> Bench {
    let drive = script().drives.remove(0).with_all(parameters);
    let motion = Motion::new(1_000_000, move |_| CommandValues::at_velocity(rpm * 10_000));
    let script = MasterScript { motion: Some(motion), stops_at_refusals: false, ..MasterScript::new(vec![drive]) };
    let mut bench = Bench::new(DriveSetup { axis, ..DriveSetup::new(ADDRESS) }, script);
    for _ in 0..3_000 {
        bench.run(Nanoseconds::from_millis(10));
        if bench.rpm() > f64::from(rpm) * 0.99 {
            hold(&mut bench, FOLLOW);
            bench.run(Nanoseconds::from_millis(300));
            return bench;
        }
    }
    panic!("{} at {} rpm", bench.world.ring().master().state(), bench.rpm());
}

/// ENABLE goes for 20 ms and comes again.
fn blink(bench: &mut Bench) {
    hold(bench, 0);
    bench.run(Nanoseconds::from_millis(20));
    assert!(!bench.has_torque());
    hold(bench, FOLLOW);
}

/// Watches an axis that is caught.
fn assert_caught(bench: &mut Bench, rpm: i32, slowest_allowed: f64, what: &str) {
    blink(bench);
    let (mut slowest, mut fastest) = (f64::MAX, 0.0_f64);
    for _ in 0..400 {
        bench.run(Nanoseconds::from_millis(1));
        slowest = slowest.min(bench.rpm());
        fastest = fastest.max(bench.rpm());
    }
    let rpm = f64::from(rpm);
    let what = format!("{what}, {rpm} rpm: {slowest} to {fastest} rpm");
    assert_eq!((bench.number(CLASS_1), bench.number(DIAGNOSTIC_NUMBER) & 0xF000), (0, 0xA000), "{what}");
    assert!(bench.has_torque() && bench.is_in_operation(), "{what}");
    assert!(fastest < rpm * 1.005 && slowest > rpm * slowest_allowed, "{what}");
    bench.run(Nanoseconds::from_millis(1_500));
    assert!((bench.rpm() / rpm - 1.0).abs() < 0.003, "{what}: {}", bench.rpm());
}

#[test]
fn an_axis_without_a_brake_is_caught_at_any_speed_without_complaint() {
    for (rpm, acceleration) in [(2_800, 50_000), (2_800, 400_000), (2_300, 50_000), (1_000, 50_000)] {
        let mut bench = turning(ReferenceAxis::press(), rpm, vec![(Idn(138), Value::Long(acceleration))]);
        // It coasts for 20 ms, with 20 Nm of friction on 0.15 kg m^2 at most, is held for some ms, and goes back to the command.
        assert_caught(&mut bench, rpm, 0.95, &format!("S-0-0138 {acceleration}"));
    }
}

#[test]
fn an_axis_whose_brake_is_released_by_hand_is_caught_as_well_once_its_torque_is_proven() {
    for rpm in [2_800, 2_300, 1_000] {
        let mut axis = ReferenceAxis::press();
        axis.machine.brake = Some(HoldingBrake { holding_torque: 60.0, release_delay: 0.04, engage_delay: 0.025 });
        let parameters = vec![
            (product(120), Value::Word(5)),
            (Idn(206), Value::Word(60)),
            (Idn(207), Value::Word(60)),
            (Idn(138), Value::Long(50_000)),
        ];
        let mut bench = turning(axis, rpm, parameters);
        let now = bench.world.now().0;
        bench.drive.motor_side.borrow_mut().machine().fail_brake(Some(BrakeFailure::StuckReleased), now);
        // 60 ms of S-0-0206 more, on the ramp of HALT.
        assert_caught(&mut bench, rpm, 0.93, "released by hand");
    }
}
