//! S-0-0293 saves what S-0-0270 names, and nothing else that is there.

use bench::{Executor, saved};
use drive::DICTIONARY;
use flash::FlashModel;
use ring::Nanoseconds;
use ring::ident::{Idn, Value};
use ring::service_client::Request;
use sercos::parameters::Parameters;

use crate::elf::on_qemu;
use crate::kept::{command, flash_of, in_cp4, only_communication, run_up, told, told_over};
use crate::running::Bench;

const SELECTION: u16 = 270;
const SAVE: u16 = 264;
const SAVE_SELECTED: u16 = 293;
const FINDING: u16 = 0x8003;
const UNFINISHED: u16 = 0xE00A;

fn select(bench: &mut Bench, idns: &[u16]) -> Result<(), u16> {
    bench.write(SELECTION, Value::words(idns))
}

/// In its memory S-0-0041 is 1 111, S-0-0125 is 1 111 and S-0-0142 "before"; in the drive they are 2 222, 2 222 and "behind".
fn changed(executor: Executor) -> Bench {
    let mut parameters = Parameters::new(&DICTIONARY);
    parameters.set(sercos::Idn::standard(41), 1_111).unwrap();
    parameters.set(sercos::Idn::standard(125), 1_111).unwrap();
    parameters.set_text(sercos::Idn::standard(142), b"before").unwrap();
    let mut bench = in_cp4(executor, saved(&parameters));
    bench.write(41, Value::Long(2_222)).unwrap();
    bench.write(125, Value::Long(2_222)).unwrap();
    bench.write(142, Value::Bytes(b"behind".to_vec())).unwrap();
    bench
}

fn kept(executor: Executor, flash: FlashModel) -> (u64, u64, String) {
    let mut bench = in_cp4(executor, flash);
    (bench.number(41), bench.number(125), bench.text(142))
}

fn saves_what_is_selected(executor: &Executor) {
    let mut bench = changed(executor.clone());
    select(&mut bench, &[41, 142]).unwrap();
    assert_eq!(command(&mut bench, SAVE_SELECTED), Ok(3), "{}", bench.text(FINDING));
    assert_eq!(bench.number(125), 2_222, "the drive works with what it was told");
    assert_eq!(kept(executor.clone(), flash_of(&bench)), (2_222, 1_111, "behind".to_owned()));
    // Once more, on top of the first.
    select(&mut bench, &[125]).unwrap();
    bench.write(41, Value::Long(3_333)).unwrap();
    assert_eq!(command(&mut bench, SAVE_SELECTED), Ok(3), "{}", bench.text(FINDING));
    assert_eq!(kept(executor.clone(), flash_of(&bench)), (2_222, 2_222, "behind".to_owned()));
}

#[test]
fn what_is_selected_is_kept_and_everything_else_stays_as_it_was_saved_last() {
    saves_what_is_selected(&Executor::Host);
}

#[test]
#[ignore = "needs QEMU and the ELF: cargo xtask test"]
fn the_elf_keeps_what_is_selected_and_everything_else_as_it_was_saved_last() {
    saves_what_is_selected(&on_qemu());
}

#[test]
fn an_empty_selection_and_what_is_not_saved_at_all_are_refused_with_their_reasons() {
    let mut bench = changed(Executor::Host);
    let before = bench.drive.flash.borrow().operations();
    assert_eq!(command(&mut bench, SAVE_SELECTED), Err(0x7013));
    assert_eq!(bench.text(FINDING), "S-0-0270 is empty: write what S-0-0293 is to save");
    // S-0-0051 is no parameter, S-0-0002 one that a control writes in every run-up.
    for wrong in [&[41, 51][..], &[2], &[4_000]] {
        assert_eq!(select(&mut bench, wrong), Err(0x7008), "{wrong:?}");
        assert_eq!(bench.text(FINDING), "S-0-0270: up to 16 IDNs, each of them one of S-0-0192");
        assert!(bench.entries(SELECTION).is_empty());
    }
    assert_eq!(select(&mut bench, &[41; 17]), Err(0x7003), "more than S-0-0270 has room for");
    assert_eq!(bench.drive.flash.borrow().operations(), before);
    select(&mut bench, &[41; 16]).unwrap();
    assert_eq!(command(&mut bench, SAVE_SELECTED), Ok(3));
    assert_eq!(kept(Executor::Host, flash_of(&bench)), (2_222, 1_111, "before".to_owned()));
}

#[test]
fn under_torque_nothing_selected_is_saved_and_the_reason_is_told() {
    let mut bench = Bench::running();
    select(&mut bench, &[41]).unwrap();
    assert_eq!(command(&mut bench, SAVE_SELECTED), Err(0x700C));
    assert_eq!(bench.text(FINDING), "S-0-0264 and S-0-0293 only without torque: the flash stops the processor");
    assert_eq!(bench.drive.flash.borrow().operations(), 0);
}

#[test]
fn where_nothing_was_saved_a_selection_is_not_kept_either_until_s_0_0264_has_saved_all() {
    let mut bench = told(Executor::Host);
    select(&mut bench, &[41]).unwrap();
    assert_eq!(command(&mut bench, SAVE_SELECTED), Ok(0xF));
    assert_eq!(
        bench.text(FINDING),
        "nothing was saved, or it cannot be read any more: write the parameters, then S-0-0264"
    );
    assert_eq!(command(&mut bench, SAVE), Ok(3));
    bench.write(41, Value::Long(4_444)).unwrap();
    assert_eq!(command(&mut bench, SAVE_SELECTED), Ok(3));
    assert_eq!(in_cp4(Executor::Host, flash_of(&bench)).number(41), 4_444);
}

/// A set that is none of today's form, and one in which another firmware has left no room; what a start finds of them is as it was.
#[test]
fn a_set_that_cannot_be_changed_is_left_as_it_is_with_the_reason_and_no_save_was_cut() {
    let mut page = vec![0; 4_096];
    let parameters = bench::told(&Parameters::new(&DICTIONARY));
    let length = drive::remembering::write_set(&parameters, &mut page).unwrap();
    page.truncate(length);
    let mut other_form = page.clone();
    other_form[0] = 2;
    // S-0-0273 is none of it any more, and everything behind it is of data blocks that this firmware does not know.
    let mut full = page;
    let mut at = 4;
    while full[at..at + 2] != 273_u16.to_le_bytes() {
        at += 4 + usize::from(full[at + 3]);
    }
    full.drain(at..at + 6);
    let mut records = u16::from_le_bytes([full[2], full[3]]) - 1;
    while full.len() < 3_096 {
        let room = (3_096 - full.len() - 4).min(200);
        full.extend([0xFF, 0xFF, room as u8, room as u8]);
        full.extend(vec![0; room]);
        records += 1;
    }
    full[2..4].copy_from_slice(&records.to_le_bytes());
    for set in [other_form, full] {
        let mut bench = told_over(Executor::Host, bench::saved_set(&set));
        select(&mut bench, &[273]).unwrap();
        bench.write(273, Value::Word(55)).unwrap();
        bench.run(Nanoseconds::from_millis(3_000));
        let before = bench.drive.flash.borrow().operations();
        assert_eq!(command(&mut bench, SAVE_SELECTED), Ok(0xF));
        assert_eq!(
            bench.text(FINDING),
            "what was saved has another form, or no room for S-0-0270: save everything with S-0-0264"
        );
        assert_eq!(bench.drive.flash.borrow().operations(), before);
        let flash = flash_of(&bench);
        assert_eq!(bench::set_in(&flash), Some(set));
        assert!(!told_over(Executor::Host, flash).entries(375).contains(&UNFINISHED));
        assert_eq!(command(&mut bench, SAVE), Ok(3), "that is the way out");
        assert_eq!(command(&mut bench, SAVE_SELECTED), Ok(3));
        assert_eq!(in_cp4(Executor::Host, flash_of(&bench)).number(273), 55);
    }
}

/// With S-0-0269 = 0 the rest is still kept afterwards, as every write is.
#[test]
fn a_selection_does_not_make_the_drive_forget_what_else_waits_to_be_kept() {
    let mut bench = changed(Executor::Host);
    bench.write(269, Value::Word(0)).unwrap();
    bench.write(125, Value::Long(5_555)).unwrap();
    select(&mut bench, &[41]).unwrap();
    assert_eq!(command(&mut bench, SAVE_SELECTED), Ok(3));
    bench.run(Nanoseconds::from_millis(400));
    assert_eq!(bench.number(182) & 8, 0);
    assert_eq!(kept(Executor::Host, flash_of(&bench)), (2_222, 5_555, "behind".to_owned()));
}

/// The supply goes within the set and at its last word; the host cuts a memory at every word (`firmware/memory/tests`).
#[test]
#[ignore = "needs QEMU and the ELF: cargo xtask test"]
fn the_elf_has_all_of_the_selection_or_nothing_of_it_wherever_its_supply_is_cut() {
    let mut seen = [false; 2];
    for nth in [150, 337] {
        let mut bench = changed(on_qemu());
        select(&mut bench, &[41, 142]).unwrap();
        let elf = bench.drive.elf.clone().unwrap();
        elf.guest.borrow_mut().cut_supply_in(nth, nth);
        let request = Request::Command { idn: Idn(SAVE_SELECTED), polls: 20_000 };
        bench.world.ring_mut().master_mut().service(0).request(request);
        // A drive without supply breaks no law.
        let lost = (0..1_000).any(|_| {
            let until = bench.world.now() + Nanoseconds::from_millis(1);
            bench.world.run_until(until).is_err() || elf.guest.borrow().lost_supply().is_some()
        });
        let mut flash = flash_of(&bench);
        flash.restore_supply();
        // What was cut goes with its page: an erase, for which the master has to wait.
        let setup =
            bench::DriveSetup { axis: crate::kept::axis(), flash, ..bench::DriveSetup::new(crate::running::ADDRESS) };
        let script = ring::master::MasterScript { good_msts: 3_000, ..only_communication(false) };
        let mut bench = run_up(Bench::on(on_qemu(), setup, script));
        let found = (bench.number(41), bench.number(125), bench.text(142));
        let unfinished = bench.entries(375).contains(&UNFINISHED);
        println!("cut at word {nth} ({lost}): {found:?}, told of a save that was cut: {unfinished}");
        let [old, new] = [(1_111, 1_111, "before".to_owned()), (2_222, 1_111, "behind".to_owned())];
        assert!(found == old || found == new, "cut at word {nth}: {found:?}");
        assert!(lost || found == new, "cut at word {nth}");
        seen[usize::from(found == new)] = true;
    }
    assert_eq!(seen, [true; 2], "both have come");
}
