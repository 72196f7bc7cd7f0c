//! Movements that the drive makes by itself, over the ring: homing in all its ways, positioning, probes.

use crate::running::{ADDRESS, Bench, script};
use bench::DriveSetup;
use ring::Nanoseconds;
use ring::ident::{Idn, Value};
use ring::master::{CommandValues, MasterScript, Motion, Telegram};

/// Where the press axis has its index, in degrees, and where these tests put the home switch.
const INDEX: f64 = 0.250_007 * 360.0;
const SWITCH_BEGINS: f64 = 40.0;
const SWITCH_ENDS: f64 = 400.0;

/// A drive in operation in this mode, at standstill, with these data blocks written before.
fn in_operation(mode: u16, mdt: &[Idn], parameters: Vec<(Idn, Value)>) -> Bench {
    let mut drive = script().drives.remove(0).with(Idn::OPERATION_MODE, Value::Word(mode)).with_all(parameters);
    drive.telegram = Telegram::application(&[Idn(51), Idn(40)], mdt);
    // Homing takes its time, and commands are not followed meanwhile.
    let motion =
        Motion { patience: 100_000, ..Motion::new(1_000_000, |point| CommandValues::at_position(point.start)) };
    let script = MasterScript { motion: Some(motion), stops_at_refusals: false, ..MasterScript::new(vec![drive]) };
    let mut bench = Bench::new(DriveSetup::new(ADDRESS), script);
    bench.run_to_operation();
    bench.run(Nanoseconds::from_millis(100));
    bench
}

fn degrees(bench: &mut Bench) -> f64 {
    let now = bench.world.now().0;
    bench.drive.motor_side.borrow_mut().machine().angle(now) * 360.0
}

fn position(bench: &mut Bench) -> f64 {
    f64::from(bench.number(51) as u32 as i32) / 10_000.0
}

/// Milliseconds with the home switch where the motor's angle puts it; stops early when the command has ended.
fn run_with_switch(bench: &mut Bench, milliseconds: u32) {
    for step in 0..milliseconds * 4 {
        let on = (SWITCH_BEGINS..SWITCH_ENDS).contains(&degrees(bench));
        bench.drive.motor_side.borrow_mut().change_inputs(|inputs| inputs.home_switch = on);
        bench.run(Nanoseconds::from_microseconds(250));
        if step % 400 == 399 && bench.number(148) & 0xF != 7 {
            return;
        }
    }
}

/// Homes with this S-0-0147 at 30 rpm; gives (data status of S-0-0148, angle of the reference point in degrees, angle of the motor).
fn home(bench: &mut Bench, way: u16) -> (u64, f64, f64) {
    bench.write(147, Value::Word(way)).unwrap();
    bench.write(148, Value::Word(3)).unwrap();
    run_with_switch(bench, 30_000);
    run_with_switch(bench, 400);
    let status = bench.number(148);
    let angle = degrees(bench);
    let zero = angle - position(bench);
    (status, zero, angle)
}

fn homing_bench() -> Bench {
    let parameters = vec![
        (Idn(41), Value::Long(300_000)),
        (Idn(42), Value::Long(50_000)),
        // One revolution.
        (Idn(278), Value::Long(3_600_000)),
    ];
    in_operation(3, &[Idn::POSITION_COMMAND], parameters)
}

#[test]
fn homing_to_the_marker_behind_the_switch_gives_the_marker_the_reference_position() {
    let mut bench = homing_bench();
    bench.write(52, Value::Long(100_000)).unwrap();
    let (status, zero, _) = home(&mut bench, 0b100);
    assert_eq!(status, 3, "{}", bench.text(0x8003));
    // The index behind the switch at 40 degrees is the one at 90; it reads 10 degrees.
    assert!((zero - (INDEX - 10.0)).abs() < 0.02, "{zero}");
    assert_eq!((bench.number(403), bench.number(408)), (1, 1));
    assert_eq!(bench.status() & 1 << 3, 0, "held until the command is cancelled");
}

#[test]
fn homing_to_the_switch_alone_gives_its_edge_the_reference_position_and_a_missing_switch_is_told() {
    let mut bench = homing_bench();
    let (status, zero, _) = home(&mut bench, 0b100_0100);
    assert_eq!(status, 3);
    // 30 rpm are 0.0225 degrees in a tick, and this test moves the switch every 250 us.
    assert!((zero - SWITCH_BEGINS).abs() < 0.1, "{zero}");
    // In the negative direction there is no switch below 40 degrees: the travel limit ends the search.
    let mut bench = homing_bench();
    let (status, _, _) = home(&mut bench, 0b100_0101);
    assert_eq!(status & 0xF, 0xF);
    assert!(bench.text(0x8003).starts_with("home switch not found"), "{}", bench.text(0x8003));
}

#[test]
fn homing_to_the_marker_alone_and_stopping_at_the_reference_point() {
    for (way, expected) in [(0b1010_0000, INDEX), (0b1010_0001, INDEX - 360.0)] {
        let mut bench = homing_bench();
        let (status, zero, angle) = home(&mut bench, way);
        assert_eq!(status, 3, "{way:b}: {}", bench.text(0x8003));
        assert!((zero - expected).abs() < 0.02, "{way:b}: {zero}");
        assert!((angle - expected).abs() < 0.05, "stops at the reference point: {angle}");
    }
}

#[test]
fn an_axis_that_starts_on_the_switch_leaves_it_first_and_meets_its_edge_in_the_homing_direction() {
    let mut bench = in_operation(
        2,
        &[Idn::VELOCITY_COMMAND],
        vec![(Idn(41), Value::Long(300_000)), (Idn(42), Value::Long(50_000))],
    );
    // To the switch, past its edge by the braking distance.
    let (status, _, angle) = home(&mut bench, 0b100_0100);
    assert_eq!(status, 3);
    assert!((SWITCH_BEGINS + 5.0..SWITCH_ENDS).contains(&angle), "{angle}");
    bench.write(148, Value::Word(0)).unwrap();
    bench.run(Nanoseconds::from_millis(100));
    bench.write(147, Value::Word(0b100_0100)).unwrap();
    bench.write(148, Value::Word(3)).unwrap();
    for _ in 0..17 {
        run_with_switch(&mut bench, 10);
    }
    let lowest = degrees(&mut bench);
    assert!((SWITCH_BEGINS - 12.0..SWITCH_BEGINS - 4.0).contains(&lowest), "goes back first: {lowest}");
    run_with_switch(&mut bench, 20_000);
    assert_eq!(bench.number(148), 3);
    let zero = degrees(&mut bench) - position(&mut bench);
    assert!((zero - SWITCH_BEGINS).abs() < 0.1, "{zero}");
}

#[test]
fn a_missing_marker_ends_homing_with_its_reason() {
    let mut bench = homing_bench();
    let now = bench.world.now().0;
    bench.drive.motor_side.borrow_mut().machine().mute_index(true, now);
    bench.write(147, Value::Word(0b10_0000)).unwrap();
    bench.write(148, Value::Word(3)).unwrap();
    run_with_switch(&mut bench, 10_000);
    assert_eq!(bench.number(148) & 0xF, 0xF);
    assert!(bench.text(0x8003).starts_with("no marker on a way of 1.5"), "{}", bench.text(0x8003));
    assert_eq!(bench.number(403), 0);
}

#[test]
fn halt_pauses_homing_and_a_cancelled_homing_has_no_reference() {
    let mut bench = homing_bench();
    bench.write(147, Value::Word(0b10_0000)).unwrap();
    bench.write(148, Value::Word(3)).unwrap();
    bench.run(Nanoseconds::from_millis(100));
    assert!((20.0..40.0).contains(&bench.rpm()), "{} rpm", bench.rpm());
    bench.write(148, Value::Word(0)).unwrap();
    bench.run(Nanoseconds::from_millis(300));
    assert_eq!(bench.number(403), 0);
}

#[test]
fn the_drive_goes_to_its_target_by_itself_within_velocity_and_acceleration() {
    let parameters = vec![(Idn(259), Value::Long(1_200_000)), (Idn(260), Value::Long(200_000))];
    let mut bench = in_operation(0x1B, &[Idn::VELOCITY_COMMAND], parameters);
    let before = position(&mut bench);
    bench.write(258, Value::Long((7_200_000_f64 + before * 10_000.0) as u32)).unwrap();
    let mut fastest = 0.0_f64;
    for _ in 0..150 {
        bench.run(Nanoseconds::from_millis(10));
        fastest = fastest.max(bench.rpm());
    }
    assert!((117.0..126.0).contains(&fastest), "{fastest} rpm");
    let travelled = position(&mut bench) - before;
    assert!((travelled - 720.0).abs() < 0.05, "{travelled} degrees");
    assert!(bench.rpm().abs() < 0.5);
    // Back, and half the way there the target changes.
    bench.write(258, Value::Long((before * 10_000.0) as i32 as u32)).unwrap();
    bench.run(Nanoseconds::from_millis(300));
    bench.write(258, Value::Long((7_200_000_f64 + before * 10_000.0) as u32)).unwrap();
    bench.run(Nanoseconds::from_millis(1_500));
    let travelled = position(&mut bench) - before;
    assert!((travelled - 720.0).abs() < 0.05, "{travelled} degrees");
}

#[test]
fn a_linear_axis_behind_a_gear_counts_metres_of_its_load() {
    // Two turns of the motor move 5 mm; position data in 0.1 um, velocity data in 1 um/min.
    let parameters = vec![
        (Idn(76), Value::Word(0x41)),
        (Idn(44), Value::Word(0x41)),
        (Idn(121), Value::Long(2)),
        (Idn(122), Value::Long(1)),
        (Idn(123), Value::Long(50_000)),
        (Idn(259), Value::Long(600_000)),
        (Idn(260), Value::Long(400_000)),
    ];
    let mut bench = in_operation(0x1B, &[Idn::VELOCITY_COMMAND], parameters);
    let increments = |bench: &mut Bench, idn: u16| i64::from(bench.number(idn) as u32 as i32);
    let (before, angle) = (increments(&mut bench, 51), degrees(&mut bench));
    bench.write(258, Value::Long((before + 100_000) as u32)).unwrap();
    bench.run(Nanoseconds::from_millis(500));
    assert!((237.0..243.0).contains(&bench.rpm()), "0.6 m/min are 240 rpm: {}", bench.rpm());
    let velocity = increments(&mut bench, 40);
    assert!((590_000..610_000).contains(&velocity), "{velocity} um/min");
    bench.run(Nanoseconds::from_millis(1_500));
    let travelled = degrees(&mut bench) - angle;
    assert!((travelled - 1_440.0).abs() < 0.05, "10 mm are four turns: {travelled} degrees");
    let shown = increments(&mut bench, 51) - before;
    assert!((shown - 100_000).abs() <= 5, "{shown} increments of 0.1 um; one of the encoder is 2.5");
}

#[test]
fn a_feedrate_override_slows_positioning_down_and_zero_stops_it() {
    let parameters = vec![(Idn(259), Value::Long(1_200_000)), (Idn(260), Value::Long(200_000))];
    let mut bench = in_operation(0x13, &[Idn::VELOCITY_COMMAND], parameters);
    bench.write(108, Value::Word(5_000)).unwrap();
    bench.write(258, Value::Long(72_000_000)).unwrap();
    bench.run(Nanoseconds::from_millis(500));
    assert!((58.0..62.0).contains(&bench.rpm()), "{} rpm", bench.rpm());
    bench.write(108, Value::Word(0)).unwrap();
    bench.run(Nanoseconds::from_millis(500));
    assert!(bench.rpm().abs() < 0.5, "{} rpm", bench.rpm());
}

#[test]
fn a_probe_takes_the_position_of_its_edge_once_for_each_arming() {
    let parameters =
        vec![(Idn(259), Value::Long(600_000)), (Idn(260), Value::Long(200_000)), (Idn(169), Value::Word(3))];
    let mut bench = in_operation(0x1B, &[Idn::VELOCITY_COMMAND], parameters);
    bench.write(170, Value::Word(3)).unwrap();
    assert_eq!(bench.number(170) & 0xF, 7, "the command goes on until it is cancelled");
    bench.write(405, Value::Word(1)).unwrap();
    bench.write(258, Value::Long(72_000_000)).unwrap();
    bench.run(Nanoseconds::from_millis(300));
    let mut edges = Vec::new();
    for level in [true, false, true, false] {
        bench.run(Nanoseconds::from_microseconds(33_333));
        // The encoder starts at zero with the motor, and nothing has homed the axis.
        edges.push(degrees(&mut bench));
        bench.drive.motor_side.borrow_mut().change_inputs(|inputs| inputs.probe_1 = level);
    }
    bench.run(Nanoseconds::from_millis(10));
    let taken = [130, 131].map(|idn| f64::from(bench.number(idn) as u32 as i32) / 10_000.0);
    // One increment is 0.0055 degrees.
    assert!((taken[0] - edges[0]).abs() < 0.01, "{taken:?} {edges:?}");
    assert!((taken[1] - edges[1]).abs() < 0.01, "{taken:?} {edges:?}");
    assert_eq!((bench.number(179), bench.number(409), bench.number(410), bench.number(411)), (3, 1, 1, 0));
    bench.write(170, Value::Word(0)).unwrap();
    assert_eq!(bench.number(170) & 0xF, 0);
}

#[test]
fn edges_of_a_probe_that_are_selected_while_the_command_runs_are_taken() {
    let mut bench = in_operation(0x1B, &[Idn::VELOCITY_COMMAND], vec![(Idn(169), Value::Word(0))]);
    bench.write(170, Value::Word(3)).unwrap();
    bench.write(405, Value::Word(1)).unwrap();
    let pulse = |bench: &mut Bench| {
        for level in [true, false] {
            bench.drive.motor_side.borrow_mut().change_inputs(|inputs| inputs.probe_1 = level);
            bench.run(Nanoseconds::from_millis(3));
        }
        bench.number(179)
    };
    assert_eq!(pulse(&mut bench), 0);
    bench.write(169, Value::Word(2)).unwrap();
    assert_eq!(pulse(&mut bench), 2);
    bench.write(169, Value::Word(1)).unwrap();
    assert_eq!(pulse(&mut bench), 3, "what was taken stays until the probe is armed anew");
    bench.write(405, Value::Word(0)).unwrap();
    bench.write(405, Value::Word(1)).unwrap();
    assert_eq!(pulse(&mut bench), 1);
}

#[test]
fn a_homed_axis_stops_when_it_leaves_its_range() {
    // 100 degrees both ways, switched on by bit 4 of S-0-0055.
    let parameters = vec![
        (Idn(49), Value::Long(1_000_000)),
        (Idn(50), Value::Long(-1_000_000_i32 as u32)),
        (Idn(55), Value::Word(1 << 4)),
        (Idn(259), Value::Long(300_000)),
    ];
    let mut bench = in_operation(0x1B, &[Idn::VELOCITY_COMMAND], parameters);
    bench.write(258, Value::Long(2_000_000)).unwrap();
    bench.run(Nanoseconds::from_millis(1_500));
    let angle = degrees(&mut bench);
    assert!((199.0..201.0).contains(&angle), "without reference there is no range: {angle}");
    bench.write(52, Value::Long(0)).unwrap();
    bench.write(148, Value::Word(3)).unwrap();
    bench.write(148, Value::Word(0)).unwrap();
    bench.write(258, Value::Long(2_000_000)).unwrap();
    bench.run(Nanoseconds::from_millis(1_500));
    let beyond = degrees(&mut bench) - angle;
    assert!((100.0..108.0).contains(&beyond), "stopped {beyond} degrees from the reference");
    assert!(!bench.has_torque());
}
