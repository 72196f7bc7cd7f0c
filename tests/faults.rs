//! What happens to the ring's telegrams and to the drive itself, and what the drive makes of it (sercos2.md 2.2 to 2.4, 4.3, 6.3).

use crate::running::{ADDRESS, Bench, script};
use bench::{Amplifier, DriveSetup};
use ring::Nanoseconds;
use ring::chip::{Alternatives, TimersWithoutMst};
use ring::fibre::{Effect, Fault, TelegramKind};
use ring::ident::{Idn, Value};
use ring::master::{CommandValues, DriveScript, MasterError, MasterScript, Motion, Telegram};
use ring::service_client::{Request, control};
use ring::slots::MdtPlace;

const CLASS_1: u16 = 11;
const INTERFACE: u16 = 14;
const DIAGNOSTIC_NUMBER: u16 = 390;
const COMMUNICATION: u16 = 1 << 12;

#[test]
fn a_single_lost_mst_or_mdt_rides_through_without_a_bump() {
    for kind in [TelegramKind::Mst, TelegramKind::Mdt] {
        let mut bench = Bench::running();
        bench.lose(kind, 1);
        for _ in 0..50 {
            bench.run(Nanoseconds::from_millis(2));
            let rpm = bench.rpm();
            assert!((299.0..301.0).contains(&rpm), "{kind:?}: {rpm} rpm");
        }
        assert!(bench.has_torque());
        let counted = bench.drive.missed_by_chip();
        assert!(counted.mst + counted.mdt >= 1, "{counted:?}");
    }
}

/// G28: without an MST neither timers nor telegrams. Then there is no t3 event, and the drive's own loop timer must notice.
fn silent_without_mst() -> Alternatives {
    Alternatives { timers_without_mst: TimersWithoutMst::Silent, ..Alternatives::default() }
}

#[test]
fn a_single_lost_mst_rides_through_on_a_chip_that_falls_silent_without_it() {
    for place in [MdtPlace::Early, MdtPlace::Late] {
        let mut bench = Bench::running_on(silent_without_mst(), place);
        bench.lose(TelegramKind::Mst, 1);
        for _ in 0..50 {
            bench.run(Nanoseconds::from_millis(2));
            let rpm = bench.rpm();
            assert!((299.0..301.0).contains(&rpm), "{rpm} rpm");
        }
        assert!(bench.has_torque());
        assert!(bench.drive.missed_by_chip().mst >= 1);
    }
}

#[test]
fn two_lost_msts_are_two_on_a_chip_that_falls_silent_without_them() {
    for place in [MdtPlace::Early, MdtPlace::Late] {
        let mut bench = Bench::running_on(silent_without_mst(), place);
        let from = bench.world.ring().cycle().unwrap() + 2;
        bench.lose(TelegramKind::Mst, 2);
        // The drive is not to see meanwhile that the master gives up: the supervision alone must find it.
        for cycle in from + 2..from + 14 {
            bench.world.ring_mut().add_fault(Fault::once(cycle, 0, TelegramKind::Mst, Effect::Phase(4)));
        }
        bench.run(Nanoseconds::from_millis(10));
        bench.assert_stopped();
        assert_eq!(bench.run_up_and_read(&[INTERFACE, CLASS_1]), [1 << 3 | 4, COMMUNICATION], "{place:?}");
    }
}

#[test]
fn a_dark_ring_stops_the_motor_on_a_chip_that_falls_silent_with_it() {
    let mut bench = Bench::running_on(silent_without_mst(), MdtPlace::Late);
    let from = bench.world.ring().cycle().unwrap() + 2;
    bench.world.ring_mut().add_fault(Fault::ring_break(from..from + 200, 0));
    // Two cycles of 2 ms and the flywheel's quarter of a cycle.
    bench.run(Nanoseconds::from_millis(10));
    bench.assert_stopped();
}

#[test]
fn a_run_up_starts_the_error_counters_anew() {
    for (kind, counter) in [(TelegramKind::Mst, 28), (TelegramKind::Mdt, 29)] {
        let mut bench = Bench::running();
        bench.lose(kind, 2);
        bench.run(Nanoseconds::from_millis(300));
        assert!(!bench.has_torque(), "{kind:?}");
        assert_eq!(bench.run_up_and_read(&[counter]), [0], "{kind:?}");
    }
}

#[test]
fn a_parameter_rewritten_after_s_0_0128_takes_the_permission_for_cp4_back() {
    let script = MasterScript { idle_before_cp4: 200, ..script() };
    let mut bench = Bench::new(DriveSetup::new(ADDRESS), script);
    for _ in 0..2_000 {
        bench.run(Nanoseconds::from_millis(10));
        let master = bench.world.ring().master();
        let checked = |service: &ring::service_client::Finished| service.request.idn() == Idn::CHECK_FOR_CP4;
        if master.report().drives[0].services.iter().any(checked) {
            break;
        }
    }
    assert_eq!(bench.world.ring().master().phase(), 3);
    bench.world.ring_mut().master_mut().service(0).request(Request::Write(Idn(76), Value::Word(2)));
    bench.run(Nanoseconds::from_millis(600));
    assert_eq!(bench.run_up_and_read(&[INTERFACE, CLASS_1]), [1 << 8 | 3, COMMUNICATION]);
}

#[test]
fn two_lost_msts_stop_the_motor_and_show_in_s_0_0014_bit_3() {
    let mut bench = Bench::running();
    bench.lose(TelegramKind::Mst, 2);
    bench.run(Nanoseconds::from_millis(8));
    bench.assert_stopped();
    let words = bench.run_up_and_read(&[INTERFACE, CLASS_1]);
    assert_eq!(words[0], 1 << 3 | 4, "bit 3, phase 4 frozen");
    assert_eq!(words[1], COMMUNICATION);
    bench.clear_errors();
    assert_eq!(bench.run_up_and_read(&[INTERFACE, CLASS_1]), [4, 0], "S-0-0099 has cleared them");
}

#[test]
fn two_lost_mdts_stop_the_motor_and_show_in_s_0_0014_bit_4() {
    let mut bench = Bench::running();
    bench.lose(TelegramKind::Mdt, 2);
    bench.run(Nanoseconds::from_millis(8));
    bench.assert_stopped();
    assert_eq!(bench.run_up_and_read(&[INTERFACE, CLASS_1]), [1 << 4 | 4, COMMUNICATION]);
}

#[test]
fn an_illegal_phase_stops_the_motor_and_says_which_rule_it_broke() {
    for (byte, bit) in [(1, 7), (2, 7), (3, 7), (5, 5), (7, 5)] {
        let mut bench = Bench::running();
        let cycle = bench.world.ring().cycle().unwrap() + 2;
        bench.world.ring_mut().add_fault(Fault::once(cycle, 0, TelegramKind::Mst, Effect::Phase(byte)));
        bench.run(Nanoseconds::from_millis(8));
        bench.assert_stopped();
        assert_eq!(bench.run_up_and_read(&[INTERFACE, CLASS_1]), [1 << bit | 4, COMMUNICATION], "phase {byte}");
    }
}

#[test]
fn a_phase_that_skips_upwards_ends_in_cp0() {
    // Nothing is told in CP2 that the next run-up could miss.
    let script = MasterScript {
        stops_at_refusals: false,
        ..MasterScript::new(vec![DriveScript::new(ADDRESS, Telegram::standard(2).unwrap())])
    };
    let mut bench = Bench::new(DriveSetup::catalogue(ADDRESS), script);
    for _ in 0..1_000 {
        bench.run(Nanoseconds::from_millis(2));
        if bench.world.ring().master().phase() == 2 {
            break;
        }
    }
    assert_eq!(bench.world.ring().master().phase(), 2);
    bench.run(Nanoseconds::from_millis(20));
    let cycle = bench.world.ring().cycle().unwrap() + 2;
    bench.world.ring_mut().add_fault(Fault::once(cycle, 0, TelegramKind::Mst, Effect::Phase(4)));
    bench.run(Nanoseconds::from_millis(20));
    assert_eq!(bench.run_up_and_read(&[INTERFACE, CLASS_1]), [1 << 6 | 2, COMMUNICATION]);
}

#[test]
fn a_broken_fibre_stops_the_motor_and_the_ring_runs_up_again_once_it_is_mended() {
    let mut bench = Bench::running();
    let cycle = bench.world.ring().cycle().unwrap() + 2;
    bench.world.ring_mut().add_fault(Fault::ring_break(cycle..cycle + 200, 0));
    bench.run(Nanoseconds::from_millis(8));
    bench.assert_stopped();
    bench.run(Nanoseconds::from_millis(500));
    let words = bench.run_up_and_read(&[INTERFACE, CLASS_1]);
    assert_eq!(words[0] & 1 << 3, 1 << 3, "{words:04x?}");
    assert_eq!(words[1], COMMUNICATION);
}

#[test]
fn ten_clean_cycles_and_a_run_up_follow_every_fault() {
    for (kind, effect) in [
        (TelegramKind::Mst, Effect::Delay(Nanoseconds::from_microseconds(40))),
        (TelegramKind::Mst, Effect::Duplicate(Nanoseconds::from_microseconds(100))),
        (TelegramKind::Mst, Effect::FlipBit(20)),
        (TelegramKind::Mdt, Effect::FlipBit(30)),
        (TelegramKind::Mdt, Effect::Delay(Nanoseconds::from_microseconds(60))),
        (TelegramKind::Mdt, Effect::Byte { index: 0, value: ADDRESS }),
    ] {
        let mut bench = Bench::running();
        let from = bench.world.ring().cycle().unwrap() + 2;
        for cycle in from..from + 5 {
            bench.world.ring_mut().add_fault(Fault::once(cycle, 0, kind, effect));
        }
        bench.run(Nanoseconds::from_millis(500));
        let words = bench.run_up_and_read(&[CLASS_1]);
        assert!(words[0] & !COMMUNICATION == 0, "{kind:?} {effect:?}: {words:04x?}");
        bench.clear_errors();
        assert_eq!(bench.run_up_and_read(&[CLASS_1]), [0], "{kind:?} {effect:?}");
    }
}

#[test]
fn an_amplifier_that_reports_a_fault_is_switched_off_at_once() {
    let mut bench = Bench::running();
    bench.drive.motor_side.borrow_mut().set_amplifier_inputs(Amplifier { main_power: true, fault: true });
    // One loop tick, and one to be sure.
    bench.run(Nanoseconds::from_microseconds(250));
    assert!(!bench.has_torque());
    assert_eq!(bench.run_up_and_read(&[CLASS_1, DIAGNOSTIC_NUMBER]), [1 << 15, 0xF10F]);
    bench.drive.motor_side.borrow_mut().set_amplifier_inputs(Amplifier { main_power: true, fault: false });
    bench.run(Nanoseconds::from_millis(100));
    assert!(!bench.has_torque(), "a fault that has gone by itself is still an error");
    bench.clear_errors();
    assert_eq!(bench.run_up_and_read(&[CLASS_1]), [0]);
}

#[test]
fn lost_main_power_is_an_undervoltage_with_a_stop_and_its_return_starts_nothing() {
    let mut bench = Bench::running();
    // A control that answers an error with a control word of zero would take ENABLE away.
    bench.world.ring_mut().master_mut().hold_switches(Some(control::ON | control::ENABLE | control::NO_HALT));
    bench.drive.motor_side.borrow_mut().set_amplifier_inputs(Amplifier { main_power: false, fault: false });
    bench.run(Nanoseconds::from_millis(8));
    bench.drive.motor_side.borrow_mut().set_amplifier_inputs(Amplifier { main_power: true, fault: false });
    bench.assert_stopped();
    bench.run(Nanoseconds::from_millis(100));
    assert!(!bench.has_torque());
    assert_eq!(bench.run_up_and_read(&[CLASS_1, DIAGNOSTIC_NUMBER]), [1 << 9, 0xF109]);
}

#[test]
fn a_position_command_that_jumps_beyond_the_monitoring_window_or_beyond_any_step_stops_the_motor() {
    // The default window S-0-0159 is 30 degrees, and 45 are the most that S-0-0091 allows in a cycle.
    for (step, farthest, diagnosis) in [(440_000, 44.0, [1 << 11, 0xF10B]), (900_000, 0.1, [1 << 15, 0xF11B])] {
        let drive = DriveScript { telegram: Telegram::standard(4).unwrap(), ..script().drives.remove(0) };
        let drive = drive.with(Idn::OPERATION_MODE, Value::Word(11));
        let jump = move |cycle: u64| if cycle < 50 { 0 } else { step };
        let motion = Motion::new(1_000_000, move |point| CommandValues::at_position(point.start + jump(point.cycle)));
        let script = MasterScript { motion: Some(motion), ..MasterScript::new(vec![drive]) };
        let mut bench = Bench::new(DriveSetup::new(ADDRESS), script);
        let mut before = 0.0;
        let angle = |bench: &mut Bench| {
            let now = bench.world.now().0;
            bench.drive.motor_side.borrow_mut().machine().angle(now) * 360.0
        };
        for _ in 0..1_000 {
            bench.run(Nanoseconds::from_millis(10));
            if bench.world.ring().master().is_done() {
                break;
            }
            if bench.is_in_operation() && before == 0.0 {
                before = angle(&mut bench);
            }
        }
        let error = bench.world.ring().master().report().error.clone();
        assert!(matches!(error, Some(MasterError::ShutDown { address: ADDRESS, .. })), "{error:?}");
        bench.run(Nanoseconds::from_millis(500));
        assert!(!bench.has_torque());
        let turned = angle(&mut bench) - before;
        assert!((-0.1..farthest).contains(&turned), "{turned} degrees towards the command before the stop");
        assert_eq!(bench.run_up_and_read(&[CLASS_1, DIAGNOSTIC_NUMBER]), diagnosis);
    }
}

/// The drive sees these bits 15 to 8 of its control word for so many cycles of 2 ms, whatever the master says.
fn command(bench: &mut Bench, bits: u8, cycles: u64) {
    // Byte 0 is the address; the only record begins behind it with the low byte of the control word.
    let effect = Effect::Byte { index: 2, value: bits };
    let from = bench.world.ring().cycle().unwrap() + 2;
    for cycle in from..from + cycles {
        bench.world.ring_mut().add_fault(Fault::once(cycle, 0, TelegramKind::Mdt, effect));
    }
    // The cycle that runs, the one before the first of them, and its t3.
    bench.run(Nanoseconds::from_millis(7));
}

const HALT: u8 = 0xC0;
const OFF: u8 = 0x60;
const DISABLED: u8 = 0xA0;

#[test]
fn halt_stops_the_motor_with_torque_and_its_end_lets_it_follow_again() {
    let mut bench = Bench::running();
    command(&mut bench, HALT, 200);
    // 79 ms of ramp, and the position loop's 16 ms five times over.
    bench.run(Nanoseconds::from_millis(250));
    assert!(bench.rpm().abs() < 1.0);
    assert!(bench.has_torque());
    bench.run(Nanoseconds::from_millis(400));
    assert!((299.0..301.0).contains(&bench.rpm()));
}

#[test]
fn drive_off_brakes_and_then_takes_the_torque_away() {
    let mut bench = Bench::running();
    command(&mut bench, OFF, 200);
    bench.assert_stopped();
}

#[test]
fn enable_taken_away_leaves_the_motor_to_coast_at_once() {
    let mut bench = Bench::running();
    command(&mut bench, DISABLED, 200);
    assert!(!bench.has_torque());
    bench.run(Nanoseconds::from_millis(60));
    // 6 Nm of friction on 0.15 kg m^2: 23 rpm less in 60 ms, not the 229 of the ramp.
    let rpm = bench.rpm();
    assert!((260.0..299.0).contains(&rpm), "{rpm} rpm");
}
