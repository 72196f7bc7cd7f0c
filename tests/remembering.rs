//! What outlives the supply: parameters, errors, operating time; and what the drive does when there is nothing to remember.
//!
//! The supply is cut by starting another drive over the same flash. The flash of the host's drives takes no time; where a word waits and how long the
//! processor stands is shown with the ELF.

use bench::{DriveSetup, Executor, parameters_of, product, saved};
use drive::{DICTIONARY, NO_SAVED_PARAMETERS};
use flash::FlashModel;
use ring::Nanoseconds;
use ring::fibre::TelegramKind;
use ring::ident::{Idn, Value};
use ring::master::{CommandValues, DriveScript, MasterScript, Motion, Telegram};
use ring::service_client::{Reply, Request};
use sercos::parameters::Parameters;

use crate::elf::on_qemu;
use crate::kept::{
    axis, command, flash_of, in_cp4, only_communication, place_of, run_until_written, run_up, started, told,
};
use crate::running::{ADDRESS, Bench, VELOCITY};

const LOAD: u16 = 263;
const SAVE: u16 = 264;
const DIAGNOSTIC: u16 = 390;
const FINDING: u16 = 0x8003;
const NOT_RESTORED: u16 = 0x800E;
/// Two MSTs in a row, in S-0-0375.
const MSTS_LOST: u16 = 0xF003;

/// Why a drive that remembers this is refused CP4.
fn refused(flash: FlashModel, script: MasterScript) -> String {
    let setup = DriveSetup { axis: axis(), flash, ..DriveSetup::new(ADDRESS) };
    let mut bench = Bench::on(Executor::Host, setup, MasterScript { stops_at_refusals: true, ..script });
    for _ in 0..400 {
        bench.run(Nanoseconds::from_millis(10));
        assert!(!bench.has_torque());
    }
    bench.world.ring().master().report().error.as_ref().unwrap().to_string()
}

fn turns(bench: &mut Bench) -> bool {
    for _ in 0..400 {
        bench.run(Nanoseconds::from_millis(10));
        if (299.0..301.0).contains(&bench.rpm()) {
            return true;
        }
    }
    false
}

fn saves_and_turns_after_the_supply_was_cut(executor: &Executor) {
    let mut bench = told(executor.clone());
    assert_eq!(bench.number(DIAGNOSTIC), u64::from(NO_SAVED_PARAMETERS));
    assert_eq!(command(&mut bench, SAVE), Ok(3), "{}", bench.text(FINDING));
    let mut bench = started(executor.clone(), flash_of(&bench), true);
    assert!(turns(&mut bench), "{} rpm, {}", bench.rpm(), bench.world.ring().master().state());
    assert_eq!(bench.number(0x8000 | 110), u64::from(axis().machine.windings.pole_pairs));
    assert_eq!(bench.entries(NOT_RESTORED), Vec::<u16>::new());
}

#[test]
fn what_was_saved_turns_the_motor_after_the_supply_was_cut_though_the_master_writes_only_communication() {
    saves_and_turns_after_the_supply_was_cut(&Executor::Host);
}

#[test]
#[ignore = "needs QEMU and the ELF: cargo xtask test"]
fn the_elf_saves_in_cp4_and_turns_the_motor_after_the_supply_was_cut() {
    saves_and_turns_after_the_supply_was_cut(&on_qemu());
}

#[test]
fn a_drive_that_nobody_has_told_its_motor_does_not_reach_cp4_and_names_what_it_needs() {
    let mut damaged = saved(&Parameters::new(&DICTIONARY));
    damaged.contents_mut()[60] ^= 1;
    for flash in [FlashModel::new(), damaged] {
        let error = refused(flash, only_communication(true));
        // S-0-0109, 111, 113, 116, P-0-0110, P-0-0114.
        assert!(error.contains("S-0-0128"), "{error}");
        for idn in ["S-0-0109", "S-0-0111", "S-0-0113", "S-0-0116", "P-0-0110", "P-0-0114"] {
            assert!(error.contains(idn), "{idn}: {error}");
        }
    }
}

#[test]
fn a_drive_with_nothing_saved_has_no_torque_until_its_user_has_acknowledged_that() {
    let drive = DriveScript::new(ADDRESS, Telegram::standard(2).unwrap())
        .with(Idn::OPERATION_MODE, Value::Word(2))
        .with_all(parameters_of(&axis()));
    let motion = Some(Motion::new(1_000_000, |_| CommandValues::at_velocity(VELOCITY)));
    let script =
        MasterScript { motion, stops_at_refusals: false, reset_diagnostics: false, ..MasterScript::new(vec![drive]) };
    let setup = DriveSetup { axis: axis(), flash: FlashModel::new(), ..DriveSetup::new(ADDRESS) };
    let mut bench = Bench::on(Executor::Host, setup, script);
    assert!(!turns(&mut bench) && !bench.has_torque());
    assert_eq!(bench.number(DIAGNOSTIC), u64::from(NO_SAVED_PARAMETERS));
    assert_eq!(bench.status() & 0x2000, 0x2000, "C1D in the status word");
    assert!(bench.entries(375).contains(&NO_SAVED_PARAMETERS));
    bench.clear_errors();
    assert_ne!(bench.number(DIAGNOSTIC), u64::from(NO_SAVED_PARAMETERS));
}

#[test]
fn saving_under_torque_is_refused_with_the_reason() {
    let mut bench = Bench::running();
    assert_eq!(command(&mut bench, SAVE), Err(0x700C));
    assert_eq!(bench.text(FINDING), "S-0-0264 and S-0-0293 only without torque: the flash stops the processor");
    assert_eq!(command(&mut bench, LOAD), Err(0x7012));
    assert_eq!(bench.drive.flash.borrow().operations(), 0);
}

#[test]
fn loading_brings_back_what_was_saved_and_not_in_cp4() {
    let mut parameters = Parameters::new(&DICTIONARY);
    parameters.set(sercos::Idn::standard(41), 7_654_321).unwrap();
    let mut bench = in_cp4(Executor::Host, saved(&parameters));
    assert_eq!(bench.number(41), 7_654_321);
    bench.write(41, Value::Long(5)).unwrap();
    assert_eq!(command(&mut bench, LOAD), Err(0x7012));
    assert_eq!(bench.number(41), 5);

    // In CP2, behind what the control writes there.
    let mut script = only_communication(false);
    script.drives[0].parameters.push((Idn(41), Value::Long(5)));
    let setup = DriveSetup { axis: axis(), flash: saved(&parameters), ..DriveSetup::new(ADDRESS) };
    let mut bench = Bench::on(Executor::Host, setup, script);
    run_until_written(&mut bench, Idn(41));
    bench.world.ring_mut().master_mut().service(0).request(Request::Command { idn: Idn(LOAD), polls: 1_000 });
    bench.run(Nanoseconds::from_millis(1_500));
    let services = &bench.world.ring().master().report().drives[0].services;
    let loaded = services.iter().find(|service| service.request.idn() == Idn(LOAD)).map(|service| &service.result);
    assert!(matches!(loaded, Some(Ok(Reply::Command(outcome))) if outcome.status == 3), "{loaded:?}");
    assert_eq!(bench.number(41), 7_654_321);
}

#[test]
fn with_storage_mode_0_every_acknowledged_write_is_kept_and_a_bit_says_what_is_not_yet() {
    let flash = saved(&Parameters::new(&DICTIONARY));
    let before = flash.operations();
    let mut bench = in_cp4(Executor::Host, flash);
    bench.write(41, Value::Long(5)).unwrap();
    bench.run(Nanoseconds::from_millis(1_000));
    assert_eq!(bench.drive.flash.borrow().operations(), before, "S-0-0269 is 1");
    let unsaved = |bench: &mut Bench| bench.number(182) & 8 != 0;
    assert!(!unsaved(&mut bench));
    bench.write(269, Value::Word(0)).unwrap();
    bench.write(41, Value::Long(6)).unwrap();
    assert!(unsaved(&mut bench));
    bench.run(Nanoseconds::from_millis(400));
    assert!(!unsaved(&mut bench));
    let mut bench = in_cp4(Executor::Host, flash_of(&bench));
    assert_eq!((bench.number(41), bench.number(269)), (6, 0));
}

#[test]
fn writes_under_torque_wait_until_it_goes() {
    let mut bench = Bench::running();
    bench.write(269, Value::Word(0)).unwrap();
    bench.write(41, Value::Long(77)).unwrap();
    bench.run(Nanoseconds::from_millis(1_000));
    assert_eq!(bench.drive.flash.borrow().operations(), 0);
    assert_eq!(bench.number(182) & 8, 8);
    bench.world.ring_mut().master_mut().restart(only_communication(false));
    bench.run(Nanoseconds::from_millis(1_500));
    let setup = DriveSetup { flash: flash_of(&bench), ..DriveSetup::new(ADDRESS) };
    let mut bench = run_up(Bench::on(Executor::Host, setup, only_communication(false)));
    assert_eq!(bench.number(41), 77);
}

#[test]
fn errors_their_times_and_the_operating_time_outlive_the_supply() {
    let mut bench = Bench::running();
    bench.run(Nanoseconds::from_millis(3_000));
    let first = bench.number(0x800F);
    assert!((4..10).contains(&first), "{first} s");
    bench.drive.motor_side.borrow_mut().set_amplifier_inputs(bench::Amplifier { main_power: false, fault: false });
    bench.run(Nanoseconds::from_millis(6_000));
    bench.world.ring_mut().master_mut().restart(only_communication(false));
    bench.run(Nanoseconds::from_millis(3_000));
    let errors = bench.entries(375);
    assert!(errors.contains(&0xF109), "{errors:04X?}");
    let mut bench = in_cp4(Executor::Host, flash_of(&bench));
    assert_eq!(bench.entries(375)[..errors.len()], errors);
    let now = bench.number(0x800F);
    assert!((first..first + 4).contains(&now), "{now} s after {first} s");
}

/// P-0-0016: the position and how many seconds ago it was kept; nothing where none was.
fn kept_last(bench: &mut Bench) -> Vec<u32> {
    match bench.read(0x8010) {
        Value::Bytes(bytes) => bytes.chunks(4).map(|four| u32::from_le_bytes(four.try_into().unwrap())).collect(),
        other => panic!("{other}"),
    }
}

/// Two MSTs that are lost are an error, with which the past is kept.
fn fall_back(bench: &mut Bench) {
    bench.lose(TelegramKind::Mst, 4);
    bench.run(Nanoseconds::from_millis(3_000));
}

/// Each error is one that is kept: the control runs the ring up again behind it.
#[test]
fn a_position_that_was_kept_in_this_start_is_still_told_behind_the_next_when_the_zero_is_lost_meanwhile() {
    const CANCEL_REFERENCE: u16 = 191;
    const BEFORE: u32 = 77;
    const IN_THIS_START: u32 = 1_234_567;
    let homed = |bench: &mut Bench, position: u32| {
        bench.write(52, Value::Long(position)).unwrap();
        assert_eq!(command(bench, 447), Ok(3));
        fall_back(bench);
        bench.world.ring_mut().master_mut().restart(only_communication(false));
        bench.run(Nanoseconds::from_millis(3_000));
    };
    let mut bench = in_cp4(Executor::Host, saved(&Parameters::new(&DICTIONARY)));
    homed(&mut bench, BEFORE);
    let mut bench = in_cp4(Executor::Host, flash_of(&bench));
    homed(&mut bench, IN_THIS_START);
    assert_eq!(kept_last(&mut bench)[0], BEFORE, "P-0-0016 is of before this start");
    assert_eq!(kept_last(&mut in_cp4(Executor::Host, flash_of(&bench)))[0], IN_THIS_START);
    assert_eq!(command(&mut bench, CANCEL_REFERENCE), Ok(3));
    assert_eq!(bench.number(403), 0);
    let errors = bench.entries(375).len();
    fall_back(&mut bench);
    let mut behind = in_cp4(Executor::Host, flash_of(&bench));
    assert_eq!(behind.entries(375).len(), errors + 1, "the log behind the loss was kept");
    assert_eq!(kept_last(&mut behind)[0], IN_THIS_START);
}

/// S-0-0447 tells where the axis is; the two MSTs that are lost are an error, with which it is kept.
fn shows_where_the_axis_was(executor: &Executor) {
    const REFERENCE: u32 = 1_234_567;
    let mut bench = in_cp4(executor.clone(), saved(&Parameters::new(&DICTIONARY)));
    assert!(kept_last(&mut bench).is_empty(), "never kept");
    fall_back(&mut bench);
    // A drive that does not know its zero has kept its error, and no position.
    let mut bench = in_cp4(executor.clone(), flash_of(&bench));
    let errors = bench.entries(375);
    assert!(errors.contains(&MSTS_LOST) && kept_last(&mut bench).is_empty(), "{errors:04X?}");
    bench.write(52, Value::Long(REFERENCE)).unwrap();
    assert_eq!(command(&mut bench, 447), Ok(3));
    fall_back(&mut bench);
    let mut bench = in_cp4(executor.clone(), flash_of(&bench));
    let [position, first] = kept_last(&mut bench)[..] else { panic!("it was kept") };
    assert_eq!(position, REFERENCE, "0 is what an incremental encoder says now: {}", bench.number(51));
    // The operating time goes on where it was kept last.
    assert!(first < 2, "{first} s ago");
    bench.run(Nanoseconds::from_millis(3_000));
    let [_, first] = kept_last(&mut bench)[..] else { panic!("it was kept") };
    assert!((3..5).contains(&first), "{first} s ago");
    assert_eq!((bench.number(51), bench.number(403)), (0, 0), "nothing works with it");
    // An error of a drive that has not been homed does not take it away.
    fall_back(&mut bench);
    let mut bench = in_cp4(executor.clone(), flash_of(&bench));
    let [position, second] = kept_last(&mut bench)[..] else { panic!("it was kept") };
    assert_eq!(position, REFERENCE);
    assert!((first..first + 3).contains(&second), "{first} s, then {second} s ago");
}

#[test]
fn where_the_axis_was_when_it_last_knew_is_told_behind_the_supply_with_its_age_and_never_is_told_apart() {
    shows_where_the_axis_was(&Executor::Host);
}

#[test]
#[ignore = "needs QEMU and the ELF: cargo xtask test"]
fn the_elf_tells_behind_the_supply_where_its_axis_was_when_it_last_knew() {
    shows_where_the_axis_was(&on_qemu());
}

#[test]
fn a_set_of_another_firmware_gives_what_is_known_and_in_range_and_names_the_rest() {
    // The table as it is, but for a data block that exists no more, and one whose range has become smaller.
    let mut set = vec![0; 4_096];
    let parameters = bench::told(&Parameters::new(&DICTIONARY));
    let length = drive::remembering::write_set(&parameters, &mut set).unwrap();
    set.truncate(length);
    let language = place_of(&set, Idn(265));
    set[language + 4] = 9;
    let name = place_of(&set, product(7));
    set[name..name + 2].copy_from_slice(&(0x8000 | 3_000_u16).to_le_bytes());
    // The one that is out of range is asked for: nobody has told it for this firmware.
    let bench = refused(bench::saved_set(&set), only_communication(false));
    assert!(bench.ends_with("invalid data: S-0-0265"), "{bench}");
    let mut script = only_communication(false);
    script.drives[0].parameters.push((Idn(265), Value::Word(1)));
    let setup = DriveSetup { axis: axis(), flash: bench::saved_set(&set), ..DriveSetup::new(ADDRESS) };
    let mut bench = run_up(Bench::on(Executor::Host, setup, script));
    assert_eq!(bench.entries(NOT_RESTORED), [265, 0x8000 | 3_000]);
    assert_eq!(bench.number(265), 1);
}

/// The supply goes within the save, at its first word, its last, and some between.
#[test]
#[ignore = "needs QEMU and the ELF: cargo xtask test"]
fn the_elf_has_the_old_set_or_the_new_one_wherever_its_supply_is_cut() {
    for nth in [1, 5, 100, 335, 337] {
        let mut parameters = Parameters::new(&DICTIONARY);
        parameters.set(sercos::Idn::standard(41), 1_111).unwrap();
        let mut bench = in_cp4(on_qemu(), saved(&parameters));
        bench.write(41, Value::Long(2_222)).unwrap();
        let elf = bench.drive.elf.clone().unwrap();
        elf.guest.borrow_mut().cut_supply_in(nth, nth);
        bench.world.ring_mut().master_mut().service(0).request(Request::Command { idn: Idn(SAVE), polls: 20_000 });
        let mut lost = false;
        for _ in 0..1_000 {
            // A drive without supply breaks no law.
            if bench.world.run_until(bench.world.now() + Nanoseconds::from_millis(1)).is_err() {
                break;
            }
            lost = elf.guest.borrow().lost_supply().is_some();
            if lost {
                break;
            }
        }
        let mut flash = flash_of(&bench);
        flash.restore_supply();
        // What was cut goes with its page: an erase, for which the master has to wait.
        let setup = DriveSetup { axis: axis(), flash, ..DriveSetup::new(ADDRESS) };
        let mut bench =
            run_up(Bench::on(on_qemu(), setup, MasterScript { good_msts: 3_000, ..only_communication(false) }));
        let value = bench.number(41);
        println!("cut at word {nth} ({lost}): S-0-0041 = {value}");
        assert!(value == 1_111 || value == 2_222, "cut at word {nth}: {value}");
        assert!(lost || value == 2_222, "cut at word {nth}");
    }
}

/// S-0-0182 bit 2, and what a locked drive answers.
fn is_locked(bench: &mut Bench) -> bool {
    let bit = bench.number(182) & 4 != 0;
    let refused = bench.write(41, Value::Long(5)).is_err();
    assert_eq!((bit, bench.text(267) == "***"), (refused, refused));
    bit
}

/// This drive, locked.
fn locked(executor: Executor, flash: FlashModel) -> FlashModel {
    let mut bench = in_cp4(executor, flash);
    assert!(!is_locked(&mut bench));
    bench.write(267, Value::Bytes(b"press 3".to_vec())).unwrap();
    assert!(is_locked(&mut bench));
    bench.run(Nanoseconds::from_millis(2_500));
    assert_eq!(bench.number(182) & 8, 0, "the lock is kept");
    flash_of(&bench)
}

#[test]
fn a_lock_outlives_the_supply_and_its_password_opens_it_for_good() {
    let mut bench = in_cp4(Executor::Host, locked(Executor::Host, saved(&Parameters::new(&DICTIONARY))));
    assert!(is_locked(&mut bench));
    assert_eq!(bench.write(267, Value::Bytes(b"press 4".to_vec())), Err(0x7008));
    bench.write(267, Value::Bytes(b"press 3".to_vec())).unwrap();
    assert!(!is_locked(&mut bench));
    bench.run(Nanoseconds::from_millis(2_500));
    assert!(!is_locked(&mut in_cp4(Executor::Host, flash_of(&bench))));
}

#[test]
fn a_lock_that_waits_for_the_torque_to_go_is_shown_as_unsaved_until_it_is_kept() {
    let mut bench = Bench::running();
    let unsaved = |bench: &mut Bench| bench.number(182) & 8 != 0;
    assert!(!unsaved(&mut bench));
    bench.write(267, Value::Bytes(b"press 3".to_vec())).unwrap();
    bench.run(Nanoseconds::from_millis(3_000));
    assert!(unsaved(&mut bench));
    assert_eq!(bench.drive.flash.borrow().operations(), 0);
    bench.world.ring_mut().master_mut().restart(only_communication(false));
    bench.run(Nanoseconds::from_millis(3_000));
    assert!(!unsaved(&mut bench));
    assert!(bench.drive.flash.borrow().operations() > 0);
    assert!(is_locked(&mut in_cp4(Executor::Host, flash_of(&bench))));
}

#[test]
#[ignore = "needs QEMU and the ELF: cargo xtask test"]
fn a_start_of_the_elf_without_a_drive_address_forgets_a_password_that_nobody_knows_and_nothing_else() {
    // Errors, operating time, position and a parameter.
    let remembered = |bench: &mut Bench| {
        let [position, _] = kept_last(bench)[..] else { panic!("it was kept") };
        (bench.entries(375), bench.number(0x800F), position, bench.number(52))
    };
    let mut bench = in_cp4(on_qemu(), saved(&Parameters::new(&DICTIONARY)));
    bench.write(52, Value::Long(1_234_567)).unwrap();
    assert_eq!(command(&mut bench, SAVE), Ok(3));
    assert_eq!(command(&mut bench, 447), Ok(3));
    bench.run(Nanoseconds::from_millis(3_000));
    fall_back(&mut bench);
    let flash = locked(on_qemu(), flash_of(&bench));
    let mut bench = in_cp4(on_qemu(), flash.clone());
    assert!(is_locked(&mut bench));
    let before = remembered(&mut bench);
    assert!(before.0.contains(&MSTS_LOST) && before.1 > 2, "{before:04X?}");
    assert_eq!((before.2, before.3), (1_234_567, 1_234_567));
    let setup = DriveSetup { flash, ..DriveSetup::new(0) };
    let mut bench = Bench::on(on_qemu(), setup, only_communication(false));
    bench.run(Nanoseconds::from_millis(60));
    let mut bench = in_cp4(on_qemu(), flash_of(&bench));
    assert!(!is_locked(&mut bench));
    assert_eq!(remembered(&mut bench), before);
}
