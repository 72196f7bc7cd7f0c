//! Stops and starts, over the ring: a stop never makes the shaft faster, and nothing starts by itself.

use crate::led::{Axis, FOLLOW, HALT, OFF};
use crate::running::{ADDRESS, Bench, VELOCITY, script};
use bench::{DriveSetup, product};
use ring::Nanoseconds;
use ring::fibre::TelegramKind;
use ring::ident::{Idn, Value};
use ring::master::{CommandValues, MasterScript, Motion};
use ring::service_client::control;

/// Control word bits 9 and 8: the fourth mode, S-0-0035, which no test sets.
const UNSET_MODE: u16 = 0x0300;

/// S-0-0138 of the press axis in rad/s².
const DECELERATION: f64 = 400.0;
/// What the press axis makes of its peak current less its friction, in rad/s².
const AT_THE_LIMIT: f64 = (120.0 - 6.0) / 0.15;
/// S-0-0104 of the press axis in 1/s.
const KV: f64 = 62.5;
/// rad/s in rpm.
const RPM: f64 = 60.0 / std::f64::consts::TAU;

/// What takes a drive that follows out of operation.
#[derive(Clone, Copy, Debug)]
enum Stop {
    Halt,
    Off,
    LostRing,
    Error,
}

const STOPS: [Stop; 4] = [Stop::Halt, Stop::Off, Stop::LostRing, Stop::Error];

impl Stop {
    fn begin(self, axis: &mut Axis) {
        match self {
            Self::Halt => axis.switches(HALT),
            Self::Off => axis.switches(OFF),
            Self::LostRing => axis.bench.lose(TelegramKind::Mst, 3),
            // A mode that S-0-0035 does not set: an error that leaves the power stage as it is.
            Self::Error => axis.switches(FOLLOW | UNSET_MODE),
        }
    }
}

#[test]
fn no_stop_makes_an_axis_faster_that_is_still_far_from_its_velocity_command() {
    for stop in STOPS {
        for direction in [1, -1] {
            let mut axis = Axis::in_mode(2);
            axis.velocity(2_000 * direction);
            axis.run(10);
            let before = axis.bench.rpm().abs();
            assert!((10.0..80.0).contains(&before), "{before} rpm on the way to 2 000");
            stop.begin(&mut axis);
            let from = axis.degrees();
            let time = axis.run_to_standstill();
            // Until the drive sees it: the cycle that runs and the next, two lost telegrams more, and a millisecond; the sensor's time.
            let notice: f64 = if matches!(stop, Stop::LostRing) { 11.0 } else { 5.0 };
            let allowed = before + AT_THE_LIMIT * notice * 1e-3 * RPM + 6.0;
            assert!(axis.fastest < allowed, "{stop:?}: {} rpm after {before}", axis.fastest);
            // The way of the ramp from there, the way until it was seen, and what the loop lags.
            let speed = allowed / RPM;
            let degrees = (axis.degrees() - from).abs();
            // HALT holds a position: the axis comes to it with the lag of the position loop, whose last millimetres take five times as long.
            let lag = if matches!(stop, Stop::Halt) { 1.0 / KV } else { 0.0 };
            let way = speed * speed / (2.0 * DECELERATION) + speed * ((notice + 5.0) * 1e-3 + lag);
            assert!(
                (2.0..way.to_degrees()).contains(&degrees),
                "{stop:?}: {degrees} degrees, {} allowed",
                way.to_degrees()
            );
            let longest = speed / DECELERATION * 1e3 + notice + 25.0 + 5e3 * lag;
            assert!((10.0..longest).contains(&time), "{stop:?}: {time} ms, {longest} allowed");
        }
    }
}

#[test]
fn no_stop_makes_an_axis_faster_that_a_torque_command_accelerates() {
    for stop in STOPS {
        let mut axis = Axis::in_mode(1);
        // 100 Nm: 627 rad/s² less the friction.
        axis.torque(2_000);
        axis.run(30);
        stop.begin(&mut axis);
        let before = axis.bench.rpm();
        let _ = axis.run_to_standstill();
        let notice = if matches!(stop, Stop::LostRing) { 11.0 } else { 6.0 };
        // The current that accelerates ends with the command.
        let allowed = before + 627.0 * notice * 1e-3 * RPM;
        println!("{stop:?}: {} rpm after {before}, {allowed} allowed", axis.fastest);
        assert!(axis.fastest < allowed, "{stop:?}: {} rpm after {before}", axis.fastest);
        assert!(axis.bench.rpm().abs() < 1.0, "{stop:?}");
    }
}

#[test]
fn a_stop_of_an_axis_that_tracks_its_command_is_the_ramp_from_there() {
    for mode in [2, 3, 11] {
        for stop in STOPS {
            let mut axis = Axis::in_mode(mode);
            // 600 rpm: 7.2 degrees a cycle.
            for cycle in 1..=200 {
                axis.velocity(600.min(cycle * 6));
                axis.position(match cycle {
                    ..=100 => 7.2 * 0.005 * f64::from(cycle * cycle),
                    _ => 7.2 * (f64::from(cycle) - 50.0),
                });
                axis.run(2);
            }
            let from = axis.bench.rpm();
            assert!((590.0..610.0).contains(&from), "mode {mode}: {from}");
            stop.begin(&mut axis);
            let turned = axis.degrees();
            let mut cycle = 200.0;
            for _ in 0..130 {
                cycle += 1.0;
                axis.position(7.2 * (cycle - 50.0));
                axis.run(2);
            }
            assert!(axis.fastest < 612.0, "mode {mode}, {stop:?}: {} rpm", axis.fastest);
            assert!(axis.bench.rpm().abs() < 1.0, "mode {mode}, {stop:?}: 157 ms of ramp, and the loops");
            let way = axis.degrees() - turned;
            // 283 degrees of ramp, and until it begins: 3.6 degrees a millisecond.
            let (least, most) = match stop {
                Stop::LostRing => (283.0, 283.0 + 45.0),
                // With the lag of the position loop: 57.6 degrees.
                Stop::Halt if mode != 11 => (275.0 + 57.0, 283.0 + 58.0 + 30.0),
                _ => (275.0, 283.0 + 30.0),
            };
            assert!((least..most).contains(&way), "mode {mode}, {stop:?}: {way} degrees");
        }
    }
}

#[test]
fn an_error_with_p_0_0140_of_0_stops_at_the_torque_limit_and_with_2_on_the_ramp() {
    for (reaction, expected) in [(0, 125.0..165.0), (2, 2_050.0..2_150.0)] {
        // 1 000 rpm at 50 rad/s²: 2 094 ms; at 760 rad/s² and more: 138 ms.
        let mut axis = Axis::with(2, vec![(Idn(138), Value::Long(50_000)), (product(140), Value::Word(reaction))]);
        axis.velocity(1_000);
        axis.run(400);
        assert!((990.0..1_010.0).contains(&axis.bench.rpm()));
        Stop::Error.begin(&mut axis);
        let time = axis.run_to_standstill();
        assert!(expected.contains(&time), "P-0-0140 = {reaction}: {time} ms");
        axis.run(50);
        assert!(axis.fastest < 1_012.0 && axis.bench.rpm().abs() < 1.0 && !axis.bench.has_torque());
    }
}

#[test]
fn bit_15_brakes_on_the_ramp_whatever_p_0_0140_says_and_an_error_meanwhile_at_the_torque_limit() {
    let mut axis = Axis::with(2, vec![(Idn(138), Value::Long(50_000)), (product(140), Value::Word(0))]);
    axis.velocity(1_000);
    axis.run(400);
    Stop::Off.begin(&mut axis);
    axis.run(500);
    // 477 rpm a second.
    let rpm = axis.bench.rpm();
    assert!((755.0..775.0).contains(&rpm), "{rpm} rpm after half a second");
    Stop::Error.begin(&mut axis);
    let time = axis.run_to_standstill();
    assert!((95.0..135.0).contains(&time), "{time} ms");
}

#[test]
fn nothing_starts_under_switches_that_were_on_before_cp4() {
    // From the first MDT of CP4 on, after a run-up.
    let patient = || {
        let motion = Motion { patience: 100_000, ..Motion::new(1_000_000, |_| CommandValues::at_velocity(VELOCITY)) };
        MasterScript { motion: Some(motion), ..script() }
    };
    let mut bench = Bench::new(DriveSetup::new(ADDRESS), patient());
    bench.world.ring_mut().master_mut().hold_switches(Some(FOLLOW));
    for _ in 0..200 {
        bench.run(Nanoseconds::from_millis(10));
        assert!(!bench.has_torque(), "an edge that nobody has seen");
    }
    assert_eq!(bench.world.ring().master().phase(), 4);
    // 0 and then 1, both in CP4.
    for (bits, expected) in [(HALT & !control::ON, false), (FOLLOW, true)] {
        bench.world.ring_mut().master_mut().hold_switches(Some(bits));
        bench.run(Nanoseconds::from_millis(700));
        assert_eq!(bench.has_torque(), expected);
    }
    // The search for the commutation angle takes its time.
    bench.run(Nanoseconds::from_millis(2_000));
    assert!((299.0..301.0).contains(&bench.rpm()));
    // The ring is lost, runs up again, S-0-0099: the switches have been on all the time.
    bench.lose(TelegramKind::Mst, 3);
    bench.run(Nanoseconds::from_millis(500));
    assert!(!bench.has_torque());
    bench.world.ring_mut().master_mut().restart(patient());
    bench.world.ring_mut().master_mut().hold_switches(Some(FOLLOW));
    for _ in 0..200 {
        bench.run(Nanoseconds::from_millis(10));
        assert!(!bench.has_torque() && bench.rpm().abs() < 1.0, "S-0-0099 and a run-up started the motor");
    }
    assert_eq!((bench.world.ring().master().phase(), bench.number(11)), (4, 0));
}
