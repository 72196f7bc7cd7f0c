//! What the drive does beside following its commands: torque mode, additive commands, homing, parking, bits, password, diagnosis.

use crate::running::{ADDRESS, Bench, VELOCITY, script};
use bench::{Amplifier, DriveSetup};
use ring::Nanoseconds;
use ring::ident::{Idn, Value};
use ring::master::{CommandValues, DriveScript, MasterScript, Motion, Telegram};

const P: u16 = 0x8000;

/// A drive that stands in CP4 with torque on and holds the position where it was switched on.
fn standing() -> Bench {
    let drive = script().drives.remove(0).with(Idn::OPERATION_MODE, Value::Word(11));
    let drive = DriveScript { telegram: Telegram::standard(4).unwrap(), ..drive };
    let motion = Motion::new(1_000_000, |point| CommandValues::at_position(point.start));
    let mut bench = Bench::new(
        DriveSetup::new(ADDRESS),
        MasterScript { motion: Some(motion), stops_at_refusals: false, ..MasterScript::new(vec![drive]) },
    );
    for _ in 0..1_000 {
        bench.run(Nanoseconds::from_millis(10));
        if bench.is_in_operation() && bench.world.ring().master().phase() == 4 {
            bench.run(Nanoseconds::from_millis(100));
            return bench;
        }
    }
    panic!("{}", bench.world.ring().master().state());
}

/// A drive in CP4 without torque.
fn idle() -> Bench {
    let script = MasterScript { motion: None, ..script() };
    let mut bench = Bench::new(DriveSetup::new(ADDRESS), script);
    for _ in 0..1_000 {
        bench.run(Nanoseconds::from_millis(10));
        if bench.world.ring().master().is_done() {
            return bench;
        }
    }
    panic!("{}", bench.world.ring().master().state());
}

fn signed(raw: u64) -> i32 {
    raw as u32 as i32
}

/// A drive in torque mode with this command, 50 ms after it went into operation.
fn in_torque_mode(command: i16, polarity: u16) -> Bench {
    let mut drive = script().drives.remove(0).with(Idn::OPERATION_MODE, Value::Word(1));
    drive.telegram = Telegram::application(&[Idn(84), Idn(40), Idn(13)], &[Idn::TORQUE_COMMAND]);
    drive = drive.with(Idn(91), Value::Long(500_000)).with(Idn(85), Value::Word(polarity));
    let command = CommandValues { torque: command, ..CommandValues::default() };
    let motion = Motion::new(1_000_000, move |_| command);
    let script = MasterScript { motion: Some(motion), stops_at_refusals: false, ..MasterScript::new(vec![drive]) };
    let mut bench = Bench::new(DriveSetup::new(ADDRESS), script);
    bench.run_to_operation();
    bench.run(Nanoseconds::from_millis(50));
    bench
}

#[test]
fn in_torque_mode_the_motor_accelerates_with_the_commanded_torque_up_to_the_velocity_limit() {
    // 20.0 % of 25 A.
    let mut bench = in_torque_mode(200, 0);
    let current = bench.drive.motor_side.borrow_mut().current();
    assert!((current - 5.0 / 60.0).abs() < 0.001, "20 % of 25 A on a 60 A amplifier, not {current}");
    assert!((195..=205).contains(&bench.number(84)), "{}", bench.number(84));
    bench.run(Nanoseconds::from_millis(3_000));
    let rpm = bench.rpm();
    assert!((49.0..51.0).contains(&rpm), "held at 50 rpm, not {rpm}");
    // Only a tick whose noise would brake by itself needs no limit.
    let seen = [(); 20].map(|()| {
        bench.run(Nanoseconds::from_millis(7));
        (bench.number(334), bench.number(335))
    });
    let limited = seen.iter().filter(|&&seen| seen == (0, 1)).count();
    assert!(limited >= 15, "it is the velocity that is limited, not the torque: {seen:?}");
}

#[test]
fn each_torque_polarity_turns_its_own_value_round() {
    for (polarity, turned, shown) in [(0, 1.0, 1), (1, -1.0, -1), (4, 1.0, -1), (5, -1.0, 1)] {
        let mut bench = in_torque_mode(200, polarity);
        let current = bench.drive.motor_side.borrow_mut().current() * turned;
        assert!((current - 5.0 / 60.0).abs() < 0.003, "S-0-0085 = {polarity}: {current}");
        let feedback = i32::from(bench.number(84) as u16 as i16) * shown;
        assert!((195..=205).contains(&feedback), "S-0-0085 = {polarity}: {feedback}");
    }
}

#[test]
fn an_additive_torque_command_is_added_with_its_own_polarity() {
    for (polarity, sum) in [(0, 3.0), (2, -1.0), (3, -3.0)] {
        let mut bench = in_torque_mode(100, polarity);
        bench.write(81, Value::Word(200)).unwrap();
        bench.run(Nanoseconds::from_millis(5));
        let current = bench.drive.motor_side.borrow_mut().current();
        assert!((current - sum * 2.5 / 60.0).abs() < 0.003, "S-0-0085 = {polarity}: {current}");
    }
}

#[test]
fn an_additive_velocity_command_is_added_and_its_polarity_turns_it_round() {
    let mut bench = Bench::running();
    bench.write(37, Value::Long(500_000)).unwrap();
    bench.run(Nanoseconds::from_millis(500));
    assert!((349.0..351.0).contains(&bench.rpm()), "{}", bench.rpm());
    bench.write(37, Value::Long((-500_000_i32) as u32)).unwrap();
    bench.run(Nanoseconds::from_millis(500));
    assert!((249.0..251.0).contains(&bench.rpm()), "{}", bench.rpm());
    assert_eq!(signed(bench.number(36)), VELOCITY);
}

#[test]
fn an_additive_position_command_turns_the_axis_by_its_angle() {
    let mut bench = standing();
    let before = signed(bench.number(51));
    for step in 1..=9 {
        bench.write(48, Value::Long(step * 100_000)).unwrap();
    }
    bench.run(Nanoseconds::from_millis(300));
    let turned = signed(bench.number(51)) - before;
    assert!((899_000..=901_000).contains(&turned), "90 degrees, not {turned} of 0.0001");
}

#[test]
fn homing_gives_the_standing_motor_a_new_position_and_holds_it_until_the_master_has_aligned_its_command() {
    let mut bench = standing();
    assert_eq!(bench.number(403), 0);
    bench.write(52, Value::Long(1_234_567)).unwrap();
    bench.write(148, Value::Word(3)).unwrap();
    assert_eq!(bench.number(148), 3);
    bench.run(Nanoseconds::from_millis(100));
    assert!(bench.has_torque() && bench.rpm().abs() < 0.5);
    let position = signed(bench.number(51));
    assert!((position - 1_234_567).abs() < 1_000, "{position}");
    assert_eq!(bench.number(403), 1);
    assert_eq!(bench.status() & 1 << 3, 0, "commands are not followed meanwhile");
    assert_eq!(bench.text(95), "Homing command active");
    // This master goes on with its old position: following it would be a jump of 123 degrees.
    bench.write(148, Value::Word(0)).unwrap();
    bench.run(Nanoseconds::from_millis(300));
    assert!(!bench.has_torque());
    let now = bench.world.now().0;
    let turned = bench.drive.motor_side.borrow_mut().machine().angle(now) * 360.0;
    assert!(turned.abs() < 1.0, "{turned} degrees");
    assert_eq!(bench.run_up_and_read(&[11, 390]), [1 << 11, 0xF10B]);
    bench.write(191, Value::Word(3)).unwrap();
    assert_eq!(bench.number(403), 0);
}

#[test]
fn homing_needs_a_way_that_is_built_and_a_motor_that_stands() {
    let mut bench = standing();
    for way in [0x68, 0x160] {
        bench.write(147, Value::Word(way)).unwrap();
        assert_eq!(bench.write(148, Value::Word(3)), Err(0x7013), "{way:04x}");
    }
    let mut bench = Bench::running();
    assert_eq!(bench.write(148, Value::Word(3)), Err(0x7012));
    assert_eq!(bench.number(148), 0);
}

#[test]
fn what_changes_the_whole_drive_is_refused_while_torque_is_on() {
    let mut bench = Bench::running();
    for command in [262, 447] {
        assert_eq!(bench.write(command, Value::Word(3)), Err(0x7012), "S-0-{command:04}");
    }
    assert_eq!(bench.write(139, Value::Word(3)), Err(0x7005), "parking belongs to CP2");
    let mut bench = idle();
    bench.write(104, Value::Word(333)).unwrap();
    bench.write(52, Value::Long(70_000)).unwrap();
    bench.write(447, Value::Word(3)).unwrap();
    assert!((signed(bench.number(51)) - 70_000).abs() < 1_000);
    // In CP4 it would change what the phase protects: it belongs to CP2 and CP3.
    assert_eq!(bench.write(262, Value::Word(3)), Err(0x7012));
    assert_eq!((bench.number(104), bench.number(52)), (333, 70_000));
}

#[test]
fn a_parked_axis_takes_no_torque_until_the_next_run_up() {
    let drive = script().drives.remove(0).with(Idn(139), Value::Word(3));
    let motion = Motion { patience: 100, ..Motion::new(1_000, |_| CommandValues::at_velocity(VELOCITY)) };
    let script = MasterScript { motion: Some(motion), stops_at_refusals: false, ..MasterScript::new(vec![drive]) };
    let mut bench = Bench::new(DriveSetup::new(ADDRESS), script);
    for _ in 0..300 {
        bench.run(Nanoseconds::from_millis(10));
        assert!(!bench.has_torque());
    }
    let error = bench.world.ring().master().report().error.clone();
    assert!(format!("{error:?}").contains("NotInTime"), "{error:?}");
    assert_eq!(bench.run_up_and_read(&[11])[0], 0);
    let mut bench = Bench::running();
    assert!(bench.has_torque());
    assert_eq!(bench.number(182) & 2, 0);
}

#[test]
fn status_bits_show_what_is_allocated_and_a_control_bit_writes_its_target() {
    let mut bench = Bench::running();
    bench.write(305, Value::Word(331)).unwrap();
    bench.write(307, Value::Word(13)).unwrap();
    bench.write(416, Value::Word(0)).unwrap();
    bench.run(Nanoseconds::from_millis(20));
    assert_eq!(bench.status() >> 6 & 3, 0b10, "not standing, velocity reached");
    assert_eq!((bench.number(304), bench.number(306)), (0, 1));
    assert_eq!(bench.write(305, Value::Word(4000)), Err(0x1001));
    assert_eq!(bench.write(305, Value::Word(2)), Err(0x7008));
    assert_eq!(bench.write(301, Value::Word(331)), Err(0x7008));
    // Control word bit 6 is 0: its target loses the bit that the service channel has set.
    bench.write(P | 19, Value::Word(0xFFFF)).unwrap();
    bench.write(301, Value::Word(P | 19)).unwrap();
    bench.write(413, Value::Word(4)).unwrap();
    bench.run(Nanoseconds::from_millis(20));
    assert_eq!(bench.number(P | 19) & 1 << 4, 0);
}

#[test]
fn signal_words_show_and_set_the_bits_of_their_lists() {
    let mut bench = Bench::running();
    bench.write(26, Value::words(&[13, 331, P | 19])).unwrap();
    bench.write(328, Value::words(&[0, 0, 9])).unwrap();
    bench.write(27, Value::words(&[P | 19])).unwrap();
    bench.write(329, Value::words(&[9])).unwrap();
    assert_eq!(bench.number(144), 0b001);
    bench.write(145, Value::Word(1)).unwrap();
    assert_eq!(bench.number(P | 19), 1 << 9);
    assert_eq!(bench.number(144), 0b101);
    assert_eq!(bench.write(26, Value::words(&[2])), Err(0x7008));
    assert_eq!(bench.write(328, Value::words(&[16])), Err(0x7008));
}

#[test]
fn a_password_locks_the_stored_parameters_and_says_so() {
    let mut bench = idle();
    let text = |text: &str| Value::Bytes(text.as_bytes().to_vec());
    bench.write(267, text("press")).unwrap();
    assert_eq!(bench.write(104, Value::Word(200)), Err(0x7009));
    assert_eq!(bench.write(262, Value::Word(3)), Err(0x7009));
    assert_eq!(bench.text(267), "***");
    assert_eq!(bench.number(182) & 4, 4);
    bench.write(36, Value::Long(1)).unwrap_err();
    assert_eq!(bench.write(267, text("folder")), Err(0x7008));
    bench.write(267, text("press")).unwrap();
    bench.write(104, Value::Word(200)).unwrap();
}

#[test]
fn an_error_is_told_in_words_with_cause_and_remedy_and_remembered_with_its_time() {
    let mut bench = Bench::running();
    let checksum = bench.number(326);
    bench.write(265, Value::Word(0)).unwrap();
    assert_ne!(bench.number(326), checksum);
    assert_eq!(bench.text(95), "In Betrieb, folgt den Sollwerten");
    bench.write(265, Value::Word(1)).unwrap();
    assert_eq!(bench.number(326), checksum);
    let before = bench.number(P | 6);
    bench.drive.motor_side.borrow_mut().set_amplifier_inputs(Amplifier { main_power: true, fault: true });
    bench.run(Nanoseconds::from_millis(300));
    assert_eq!(bench.run_up_and_read(&[390, 129]), [0xF10F, 1]);
    assert_eq!(bench.text(95), "Amplifier fault");
    assert!(bench.text(P | 10).starts_with("The gate drivers reported a fault"));
    assert!(bench.text(P | 11).contains("S-0-0099"));
    assert_eq!(bench.entries(375), [0xF10F]);
    let times = bench.entries(P | 4);
    assert_eq!(times.len(), 2, "one time of four bytes");
    let after = bench.number(P | 6);
    assert!((before..=after).contains(&u64::from(times[0])), "{before} {times:?} {after}");
    assert_eq!(bench.number(P | 9), 1);
    bench.drive.motor_side.borrow_mut().set_amplifier_inputs(Amplifier { main_power: true, fault: false });
    bench.clear_errors();
    assert_eq!(bench.text(95), "Power applied, torque-free");
    assert_eq!(bench.entries(375), [0xF10F], "clearing an error does not make it forgotten");
}

#[test]
fn warnings_come_and_go_with_their_cause_and_change_bit_12_tells_of_them() {
    let mut bench = idle();
    bench.number(12);
    bench.run(Nanoseconds::from_millis(10));
    let status = bench.number(135);
    assert_eq!(status & 1 << 12, 0);
    bench.drive.motor_side.borrow_mut().set_amplifier_inputs(Amplifier { main_power: true, fault: true });
    bench.run(Nanoseconds::from_millis(10));
    assert_eq!(bench.number(135) & 1 << 12, 1 << 12);
    assert_eq!(bench.number(390), 0xE003);
    assert_eq!((bench.number(12), bench.number(181)), (1 << 15, 1 << 2));
    assert_eq!(bench.number(135) & 1 << 12, 0, "reading S-0-0012 ends the change bit");
    bench.write(97, Value::Word(0)).unwrap();
    bench.drive.motor_side.borrow_mut().set_amplifier_inputs(Amplifier { main_power: true, fault: false });
    bench.run(Nanoseconds::from_millis(10));
    assert_eq!((bench.number(12), bench.number(135) & 1 << 12), (0, 0), "the mask S-0-0097 keeps the bit");
    assert_eq!(bench.number(11), 0);
}

#[test]
fn a_check_that_passes_takes_back_what_the_last_one_has_found() {
    let mut bench = idle();
    let drive = DriveScript::new(ADDRESS, Telegram::standard(2).unwrap()).with(Idn(33), Value::Word(3));
    bench.world.ring_mut().master_mut().restart(MasterScript::new(vec![drive]));
    for _ in 0..300 {
        bench.run(Nanoseconds::from_millis(10));
    }
    let error = bench.world.ring().master().report().error.as_ref().map(ToString::to_string);
    assert!(error.as_ref().is_some_and(|error| error.contains("S-0-0033")), "{error:?}");
    let drive = DriveScript::new(ADDRESS, Telegram::standard(2).unwrap()).with(Idn(33), Value::Word(0));
    bench.world.ring_mut().master_mut().restart(MasterScript::new(vec![drive]));
    for _ in 0..300 {
        bench.run(Nanoseconds::from_millis(10));
    }
    assert_eq!(bench.world.ring().master().phase(), 4);
    for list in [22, P | 2] {
        assert!(bench.entries(list).is_empty());
    }
    assert_eq!(bench.text(P | 3), "");
}

#[test]
fn an_operation_mode_that_is_not_initialised_is_named_in_s_0_0023_until_the_error_is_cleared() {
    let mut bench = Bench::running();
    let from = bench.world.ring().cycle().unwrap() + 2;
    bench.world.ring_mut().master_mut().hold_switches(Some(0xE000));
    // Control word bits 11, 9, 8 = 101: S-0-0285.
    let effect = ring::fibre::Effect::Byte { index: 2, value: 0xE0 | 0x08 | 0x01 };
    let mdt = ring::fibre::TelegramKind::Mdt;
    bench.world.ring_mut().add_fault(ring::fibre::Fault::once(from, 0, mdt, effect));
    bench.run(Nanoseconds::from_millis(8));
    bench.assert_stopped();
    // The ring goes on: it is told in CP4, and S-0-0099 clears it there.
    assert_eq!([14, 11, 390].map(|idn| bench.number(idn)), [1 << 9 | 4, 1 << 12, 0xF009]);
    assert_eq!(bench.entries(23), [285]);
    bench.clear_errors();
    assert!(bench.entries(23).is_empty());
    assert_eq!([14, 11].map(|idn| bench.number(idn)), [4, 0]);
    assert_eq!(bench.world.ring().master().report().error, None);
}
