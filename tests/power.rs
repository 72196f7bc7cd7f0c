//! The main power goes: what the DC link is still good for, over the ring. The control is a stubborn one; only what it is told to it takes
//! back.

use crate::running::{ADDRESS, Bench, script};
use bench::{DriveSetup, Works};
use plant::ReferenceAxis;
use ring::Nanoseconds;
use ring::ident::{Idn, Value};
use ring::master::{CommandValues, MasterScript, Motion};
use ring::service_client::control;

const CLASS_1: u16 = 11;
const DIAGNOSTIC_NUMBER: u16 = 390;
const FOLLOW: u16 = control::ON | control::ENABLE | control::NO_HALT;
const BIT_15_OFF: u16 = control::ENABLE | control::NO_HALT;
const UNDERVOLTAGE: u64 = 1 << 9;

/// The press axis in velocity mode, turning with so many rpm, with these data blocks written before.
fn turning(rpm: i32) -> Bench {
    turning_on(Works::OfItsAxis, rpm, vec![])
}

/// The same on this amplifier, with these data blocks written before.
fn turning_on(works: Works, rpm: i32, parameters: Vec<(Idn, Value)>) -> Bench {
    let drive = script().drives.remove(0).with_all(parameters);
    let motion = Motion::new(1_000_000, move |_| CommandValues::at_velocity(rpm * 10_000));
    let script = MasterScript { motion: Some(motion), stops_at_refusals: false, ..MasterScript::new(vec![drive]) };
    let mut bench = Bench::new(DriveSetup { works, ..DriveSetup::new(ADDRESS) }, script);
    for _ in 0..2_000 {
        bench.run(Nanoseconds::from_millis(10));
        if bench.rpm() > f64::from(rpm) * 0.998 {
            hold(&mut bench, FOLLOW);
            bench.run(Nanoseconds::from_millis(300));
            return bench;
        }
    }
    panic!("{}", bench.world.ring().master().state());
}

/// The vertical axis with its brake open, held at zero velocity.
fn held_up() -> Bench {
    held_up_on(Works::OfItsAxis)
}

/// The same on this amplifier.
fn held_up_on(works: Works) -> Bench {
    let mut bench = Bench::vertical(works);
    for _ in 0..2_000 {
        bench.run(Nanoseconds::from_millis(10));
        if bench.is_in_operation() {
            hold(&mut bench, FOLLOW);
            bench.run(Nanoseconds::from_millis(300));
            return bench;
        }
    }
    panic!("{}", bench.world.ring().master().state());
}

fn hold(bench: &mut Bench, switches: u16) {
    bench.world.ring_mut().master_mut().hold_switches(Some(switches));
}

/// The main contactor opens or closes: the mains go, and the drive is told.
fn contactor(bench: &mut Bench, closed: bool) {
    bench.drive.motor_side.borrow_mut().change_inputs(|inputs| inputs.main_power = closed);
}

/// Revolutions of the motor.
fn revolutions(bench: &mut Bench) -> f64 {
    let now = bench.world.now().0;
    bench.drive.motor_side.borrow_mut().machine().angle(now)
}

fn bus(bench: &mut Bench) -> f64 {
    let now = bench.world.now().0;
    bench.drive.motor_side.borrow_mut().machine().bus_voltage(now)
}

/// How an axis came to its end.
#[derive(Debug)]
struct Stop {
    /// Revolutions since the beginning.
    turned: f64,
    /// Milliseconds until the shaft stood.
    milliseconds: f64,
    /// Speed in rpm at which the torque went.
    torque_off_at: Option<f64>,
    /// Highest speed on the way in rpm.
    fastest: f64,
    /// Lowest voltage of the DC link while there was torque.
    lowest_bus: f64,
    /// The status word contradicted the bridge: told of operation without torque, or of no operation with a turning shaft under torque.
    lied: bool,
}

/// What happens at which look.
type Action<'a> = (u32, &'a mut dyn FnMut(&mut Bench));

/// Watches until the shaft stands, at most 4 s; `step` acts once at each of these milliseconds.
fn watch(bench: &mut Bench, actions: &mut [Action<'_>]) -> Stop {
    let from = revolutions(bench);
    let mut stop =
        Stop { turned: 0.0, milliseconds: 0.0, torque_off_at: None, fastest: 0.0, lowest_bus: f64::MAX, lied: false };
    for step in 0..32_000_u32 {
        for (_, act) in actions.iter_mut().filter(|(at, _)| *at * 8 == step) {
            act(bench);
        }
        bench.run(Nanoseconds::from_microseconds(125));
        let rpm = bench.rpm().abs();
        stop.fastest = stop.fastest.max(rpm);
        if bench.has_torque() {
            stop.lowest_bus = stop.lowest_bus.min(bus(bench));
        } else if stop.torque_off_at.is_none() {
            stop.torque_off_at = Some(rpm);
        }
        if rpm > 1.0 {
            stop.milliseconds = f64::from(step + 1) * 0.125;
        } else if stop.torque_off_at.is_some() && step > 2_000 {
            break;
        }
        // A status word is as old as t4 and its way: two cycles.
        let told = bench.status() & 0xC000 == 0xC000;
        stop.lied |= step > 32 && told != bench.has_torque() && rpm > 30.0 && stop.torque_off_at.is_none();
    }
    stop.turned = (revolutions(bench) - from).abs();
    stop
}

/// 105 rad/s at 400 rad/s^2 are 262 ms and 13.7 rad, 2.19 revolutions; what is seen a cycle or two later costs 0.07 more.
fn assert_braked(stop: &Stop, what: &str) {
    assert!((2.1..2.35).contains(&stop.turned), "{what}: {stop:?}");
    assert!((255.0..285.0).contains(&stop.milliseconds), "{what}: {stop:?}");
    assert!(stop.torque_off_at.unwrap() < 10.0, "{what}: {stop:?}");
    assert!(stop.fastest < 1_005.0 && !stop.lied, "{what}: {stop:?}");
}

#[test]
fn an_emergency_stop_circuit_brakes_the_axis_out_of_the_dc_link_whichever_of_contactor_and_bit_15_is_first() {
    for (opens, taken_back, error) in
        [(1, 1, UNDERVOLTAGE), (1, 4, UNDERVOLTAGE), (1, 40, UNDERVOLTAGE), (8, 1, 0), (60, 1, 0), (250, 1, 0)]
    {
        let mut bench = turning(1_000);
        let stop = watch(
            &mut bench,
            &mut [(opens, &mut |bench| contactor(bench, false)), (taken_back, &mut |bench| hold(bench, BIT_15_OFF))],
        );
        let what = format!("contactor at {opens} ms, bit 15 at {taken_back} ms");
        assert_braked(&stop, &what);
        assert!(stop.lowest_bus > 500.0, "{what}: {stop:?}");
        // A stop that the control has asked for is none of an error; power that goes from an axis in operation is one.
        assert_eq!(bench.number(CLASS_1), error, "{what}");
        // 01: the logic waits for the main power. 2013H would be the error.
        assert_eq!(bench.status() & 0xC000, 0x4000, "{what}");
        let number = if error == 0 { 0xA010 } else { 0xF109 };
        assert_eq!(bench.number(DIAGNOSTIC_NUMBER), number, "{what}");
    }
}

#[test]
fn an_axis_in_operation_that_loses_its_mains_is_stopped_out_of_the_dc_link_and_says_why() {
    let mut bench = turning(1_000);
    let stop = watch(&mut bench, &mut [(1, &mut |bench| contactor(bench, false))]);
    assert_braked(&stop, "mains alone");
    assert_eq!((bench.number(CLASS_1), bench.number(DIAGNOSTIC_NUMBER)), (UNDERVOLTAGE, 0xF109));
    // The mains come back and start nothing; an edge after S-0-0099 does.
    contactor(&mut bench, true);
    bench.run(Nanoseconds::from_millis(300));
    assert!(!bench.has_torque());
    bench.clear_errors();
    bench.run(Nanoseconds::from_millis(100));
    assert!(!bench.has_torque(), "switches that were left on");
    hold(&mut bench, 0);
    bench.run(Nanoseconds::from_millis(20));
    hold(&mut bench, FOLLOW);
    bench.run(Nanoseconds::from_millis(600));
    assert!(bench.rpm() > 990.0);
}

#[test]
fn a_vertical_axis_whose_mains_go_is_held_by_its_torque_until_its_brake_has_closed() {
    for taken_back in [None, Some(1)] {
        let mut bench = held_up();
        let before = revolutions(&mut bench);
        contactor(&mut bench, false);
        if taken_back.is_some() {
            hold(&mut bench, BIT_15_OFF);
        }
        let mut lowest = 0.0_f64;
        let mut closed = None;
        for step in 0..4_000_u32 {
            bench.run(Nanoseconds::from_microseconds(125));
            let now = bench.world.now().0;
            let side = bench.drive.motor_side.clone();
            let load = side.borrow_mut().machine().load_angle(now);
            // 10 mm a revolution.
            lowest = lowest.max((before - load) * 10_000.0);
            if side.borrow_mut().machine().brake_holds(now) && closed.is_none() {
                closed = Some(step);
                assert!(bench.has_torque(), "the brake has just closed, the torque is still there");
            }
        }
        assert!(closed.is_some() && !bench.has_torque());
        // At rest the screw is wound up by 1.5 Nm / 8 000 Nm/rad: 0.3 um. 846 um were a fall of 25 ms.
        assert!((-1.0..20.0).contains(&lowest), "{taken_back:?}: {lowest} um");
    }
}

#[test]
fn mains_that_fail_behind_a_closed_contactor_leave_a_vertical_axis_the_torque_to_close_its_brake() {
    // 280 V: the drive takes the mains for gone a sixteenth above, 297 V, and has 5 J from there on; holding takes 4 W, the brake 85 ms.
    let mut bench = held_up_on(Works::but_for(&ReferenceAxis::vertical(), |amplifier| amplifier.undervoltage = 280));
    let before = revolutions(&mut bench);
    let now = bench.world.now().0;
    bench.drive.motor_side.borrow_mut().machine().set_supply(0.0, now);
    let mut closed = false;
    for _ in 0..6_000_u32 {
        bench.run(Nanoseconds::from_millis(1));
        let now = bench.world.now().0;
        let side = bench.drive.motor_side.clone();
        if !closed && side.borrow_mut().machine().brake_holds(now) {
            closed = true;
            assert!(bench.has_torque());
            let volts = bus(&mut bench);
            assert!((285.0..297.5).contains(&volts), "{volts} V");
        }
        if !bench.has_torque() {
            break;
        }
    }
    assert!(closed && !bench.has_torque());
    bench.run(Nanoseconds::from_millis(50));
    let lowest = (before - revolutions(&mut bench)) * 10_000.0;
    assert!((-1.0..20.0).contains(&lowest), "{lowest} um");
    assert_eq!((bench.number(CLASS_1), bench.number(DIAGNOSTIC_NUMBER)), (UNDERVOLTAGE, 0xF109));
}

#[test]
fn torque_goes_when_the_dc_link_falls_below_p_0_0104_before_the_axis_stands_and_says_why() {
    // 540 V are what the mains leave of 560 V at this speed: the first braking has to come out of a link that counts as empty.
    let mut bench = turning_on(
        Works::but_for(&ReferenceAxis::press(), |amplifier| amplifier.undervoltage = 490),
        1_000,
        vec![(Idn(138), Value::Long(30_000))],
    );
    let stop =
        watch(&mut bench, &mut [(1, &mut |bench| hold(bench, BIT_15_OFF)), (20, &mut |bench| contactor(bench, false))]);
    // 30 rad/s^2 are less than the friction takes: the link has to drive the axis, and 1 mF between 560 V and 490 V are 37 J.
    let off = stop.torque_off_at.unwrap();
    assert!((300.0..1_000.0).contains(&off), "{stop:?}");
    assert!((480.0..491.0).contains(&stop.lowest_bus), "{stop:?}");
    assert_eq!((bench.number(CLASS_1), bench.number(DIAGNOSTIC_NUMBER)), (UNDERVOLTAGE, 0xF109));
}

#[test]
fn without_main_power_nothing_is_switched_on_however_full_the_dc_link_is() {
    let mut bench = turning(300);
    hold(&mut bench, BIT_15_OFF);
    bench.run(Nanoseconds::from_millis(300));
    assert!(!bench.has_torque());
    contactor(&mut bench, false);
    bench.run(Nanoseconds::from_millis(10));
    assert!(bus(&mut bench) > 500.0, "the link is still charged");
    hold(&mut bench, FOLLOW);
    bench.run(Nanoseconds::from_millis(50));
    assert!(!bench.has_torque());
    assert_eq!(bench.number(CLASS_1), 0, "a warning is enough");
    // And in the middle of a stop: bit 15 comes again, the axis still comes to its rest.
    let mut bench = turning(1_000);
    let stop = watch(
        &mut bench,
        &mut [
            (1, &mut |bench| hold(bench, BIT_15_OFF)),
            (10, &mut |bench| contactor(bench, false)),
            (60, &mut |bench| hold(bench, FOLLOW)),
        ],
    );
    assert_braked(&stop, "bit 15 again");
    assert_eq!(bench.number(CLASS_1), UNDERVOLTAGE, "torque was asked for where there is no power");
}
