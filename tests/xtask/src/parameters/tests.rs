//! Files and drives: on this computer, and the ELF.

use super::file::{Origin, ParameterFile};
use super::link::{Drive, Failed, Link};
use super::load::{Loaded, Manner, load};
use super::ring_link::RingLink;
use super::value::Readable;
use super::{read_all, read_like, table};
use anyhow::Result;
use bench::{DriveSetup, Executor};
use flash::FlashModel;
use ring::ident::Value;
use ring::service_client::{Finished, Reply, Request};
use sercos::Idn;
use sercos::data_block::Selection;
use std::collections::BTreeSet;

const HOMING_VELOCITY: Idn = Idn::standard(41);
const APPLICATION_TYPE: Idn = Idn::standard(142);
const APPLICATION_DATA: Idn = Idn::product(7);
const SAVE: Idn = Idn::standard(264);
const STORAGE_MODE: Idn = Idn::standard(269);
const WHOLE: Manner = Manner { store: true, skip_unknown: false };

/// A drive whose master notes what it writes.
struct Noted {
    link: RingLink,
    written: Vec<Idn>,
    /// Writes of this data block are acknowledged and do nothing.
    lost: Option<Idn>,
}

impl Link for Noted {
    fn ask(&mut self, request: Request) -> Result<Finished> {
        if let Request::Write(idn, _) = &request {
            self.written.push(Idn(idn.0));
            if self.lost == Some(Idn(idn.0)) {
                return Ok(Finished { request, result: Ok(Reply::Done), steps: vec![] });
            }
        }
        self.link.ask(request)
    }

    fn time_us(&self) -> u64 {
        self.link.time_us()
    }
}

/// A drive that remembers this.
fn drive(executor: &Executor, flash: FlashModel) -> Drive<Noted> {
    let link = RingLink::run_up(
        executor,
        DriveSetup { flash, ..DriveSetup::catalogue(super::ring_link::ADDRESS) },
        &mut |_, _| (),
    )
    .unwrap();
    Drive::new(Noted { link, written: vec![], lost: None })
}

fn host(flash: FlashModel) -> Drive<Noted> {
    drive(&Executor::Host, flash)
}

fn flash_of(drive: &Drive<Noted>) -> FlashModel {
    drive.link().link.flash()
}

/// The defaults, saved.
fn defaults() -> FlashModel {
    DriveSetup::new(1).flash
}

fn file_of(drive: &mut Drive<Noted>) -> ParameterFile {
    read_all(drive, &mut |_, _, _, _| ()).unwrap()
}

fn load_into(drive: &mut Drive<Noted>, file: &ParameterFile, manner: Manner) -> Result<Loaded> {
    load(drive, file, manner, &mut |_, _, _, _| ())
}

/// The line with which loading has failed.
fn refusal(drive: &mut Drive<Noted>, file: &ParameterFile) -> String {
    let error = load_into(drive, file, WHOLE).unwrap_err();
    assert!(error.is::<Failed>(), "{error:?}");
    let line = error.to_string();
    assert!(!line.contains('\n'), "{line}");
    line
}

/// The file with other values.
fn with(file: &ParameterFile, changes: &[(Idn, &str)]) -> ParameterFile {
    let entries = file.entries().map(|(idn, entry)| {
        let mut entry = entry.clone();
        if let Some((_, value)) = changes.iter().find(|(changed, _)| *changed == idn) {
            entry.value = Readable::One((*value).to_owned());
        }
        (idn, entry)
    });
    ParameterFile::new(Origin { ..file.saved_from.clone() }, entries)
}

fn differing(one: &ParameterFile, other: &ParameterFile) -> Vec<Idn> {
    table::differences(one, other).into_iter().map(|difference| difference.idn).collect()
}

fn saves_changes_compares_loads_and_compares(executor: &Executor) {
    // Saved, and changed by somebody else.
    let mut first = drive(executor, defaults());
    let file = file_of(&mut first);
    assert_eq!(file.text().unwrap(), file_of(&mut host(defaults())).text().unwrap(), "wherever the drive runs");
    assert_eq!(file.entry(HOMING_VELOCITY).unwrap().quantity(), "100.0000 rpm");
    first.write(HOMING_VELOCITY, Value::Long(2_505_000)).unwrap().unwrap();
    first.write(APPLICATION_TYPE, Value::Bytes(b"folder 12".to_vec())).unwrap().unwrap();
    first.write(APPLICATION_DATA, Value::Bytes([5, 0, 0, 0, 0xFF, 0xFF, 0xFF, 0xFF].to_vec())).unwrap().unwrap();
    first.command(SAVE).unwrap().unwrap();
    let flash = flash_of(&first);
    drop(first);

    // Another day.
    let mut second = drive(executor, flash);
    let changed = file_of(&mut second);
    assert_eq!(changed.entry(HOMING_VELOCITY).unwrap().quantity(), "250.5000 rpm");
    let differ = [HOMING_VELOCITY, APPLICATION_TYPE, APPLICATION_DATA];
    assert_eq!(differing(&file, &changed), differ);
    let loaded = load_into(&mut second, &file, WHOLE).unwrap();
    assert_eq!(second.link().written, differ, "only what differs is written");
    assert_eq!(loaded.written, BTreeSet::from(differ));
    assert_eq!((loaded.common, loaded.left, &loaded.skipped), (file.entries().count(), 0, &vec![]));
    assert_eq!(loaded.checksum, file.saved_from.checksum);
    // There and back.
    load_into(&mut second, &changed, Manner { store: false, skip_unknown: false }).unwrap();
    assert_eq!(file_of(&mut second), changed);
    load_into(&mut second, &file, WHOLE).unwrap();
    let flash = flash_of(&second);
    drop(second);

    // And another.
    let again = file_of(&mut drive(executor, flash));
    assert_eq!(again.text().unwrap(), file.text().unwrap());
}

#[test]
fn a_drive_that_was_never_told_anything_is_told_all_of_a_file_also_what_is_its_default() {
    let file = file_of(&mut host(defaults()));
    let mut blank = host(FlashModel::new());
    let loaded = load_into(&mut blank, &file, WHOLE).unwrap();
    assert_eq!(loaded.written.len(), loaded.common - 1, "all but the storage mode, which is none of the axis");
    // Started anew it has a motor: nothing is left that S-0-0128 would ask for.
    let again = load_into(&mut host(flash_of(&blank)), &file, WHOLE).unwrap();
    assert_eq!(again.written.len(), 0, "{:?}", again.written);
}

#[test]
fn what_was_saved_and_then_changed_is_found_and_loaded_and_outlives_the_supply() {
    saves_changes_compares_loads_and_compares(&Executor::Host);
}

#[test]
#[ignore = "needs QEMU and the ELF: cargo xtask test"]
fn the_elf_has_its_parameters_saved_changed_compared_and_loaded() {
    let path = |name: &str| {
        std::env::var_os(name)
            .unwrap_or_else(|| panic!("{name} is not set: run `cargo xtask test`, which builds the ELF"))
    };
    let elves = bench::Elves::new(path("PRODUCT_ELF"), path("BUS_PLUGIN"));
    saves_changes_compares_loads_and_compares(&Executor::Qemu(elves));
}

#[test]
fn a_file_holds_every_data_block_of_the_backup_list_with_name_and_unit() {
    let file = file_of(&mut host(defaults()));
    let blocks: Vec<_> = ::drive::DICTIONARY.select(Selection::Backup).collect();
    let names: Vec<_> = blocks.iter().map(|block| (block.idn, block.name, block.unit.preferred())).collect();
    let found: Vec<_> = file.entries().map(|(idn, entry)| (idn, entry.name.as_str(), entry.unit.as_str())).collect();
    assert_eq!(found, names);
    assert_eq!(ParameterFile::of_text(&file.text().unwrap()).unwrap(), file);
}

#[test]
fn a_file_in_another_scaling_is_loaded_whichever_scaling_the_drive_has() {
    // Velocities and accelerations of the load in mm/min and mm/s^2, positions in um, torques in Nm.
    let mut machine = host(defaults());
    for (idn, word) in [(44, 1), (46, 0xFFFD), (76, 1), (78, 0xFFFA), (86, 2), (94, 0xFFFE), (160, 1), (162, 0xFFFD)] {
        machine.write(Idn::standard(idn), Value::Word(word)).unwrap().unwrap();
    }
    machine.write(HOMING_VELOCITY, Value::Long(123_456)).unwrap().unwrap();
    let file = file_of(&mut machine);
    let unit = &file.entry(HOMING_VELOCITY).unwrap().unit;
    assert!(unit != "rpm", "{unit}");

    let mut other = host(defaults());
    let before = file_of(&mut other);
    let differ = differing(&before, &file).len();
    assert!(differ > 20, "{differ} differ");
    let loaded = load_into(&mut other, &file, WHOLE).unwrap();
    assert_eq!(differing(&file_of(&mut other), &file), []);
    assert_eq!(loaded.checksum, file.saved_from.checksum);
    let mut restarted = host(flash_of(&other));
    assert_eq!(differing(&file_of(&mut restarted), &file), []);
    // And back.
    load_into(&mut restarted, &before, WHOLE).unwrap();
    assert_eq!(differing(&file_of(&mut restarted), &before), []);
}

#[test]
fn a_refused_value_is_named_and_the_drive_has_what_it_had_saved() {
    let mut first = host(defaults());
    let before = file_of(&mut first);
    let file = with(&before, &[(HOMING_VELOCITY, "42"), (Idn::standard(265), "7")]);
    let line = refusal(&mut first, &file);
    let expected = "S-0-0265 \"Language selection\" = 7: the drive refuses with 7007H, above maximum; \
        S-0-0263 has brought back what was saved";
    assert_eq!(line, expected);
    assert_eq!(first.link().written, [HOMING_VELOCITY, Idn::standard(265)]);
    assert_eq!(file_of(&mut first), before);
    assert_eq!(file_of(&mut host(flash_of(&first))), before);
}

#[test]
fn a_refused_value_leaves_a_drive_that_has_saved_nothing_with_its_defaults() {
    let mut blank = host(FlashModel::new());
    let before = file_of(&mut blank);
    let line = refusal(&mut blank, &with(&before, &[(HOMING_VELOCITY, "42"), (Idn::standard(265), "7")]));
    assert!(line.ends_with("; S-0-0263 brings nothing back, so S-0-0262 has brought the defaults"), "{line}");
    assert_eq!(file_of(&mut blank), before);
}

#[test]
fn what_cannot_be_a_value_of_the_drive_is_refused_before_anything_is_written() {
    let mut first = host(defaults());
    let before = file_of(&mut first);
    for (value, cause) in [
        ("fast", "S-0-0041 \"Homing velocity\" = fast rpm: 'fast' is no number; one reads -12.5; nothing was written"),
        ("0.00001", "more decimal places than the 4 of the drive's scaling; nothing was written"),
    ] {
        let line = refusal(&mut first, &with(&before, &[(HOMING_VELOCITY, value), (Idn::standard(32), "0x0001")]));
        assert!(line.ends_with(cause), "{line}");
    }
    let mut foreign = before.entries().map(|(idn, entry)| (idn, entry.clone())).collect::<Vec<_>>();
    for (idn, entry) in &mut foreign {
        if *idn == HOMING_VELOCITY {
            entry.unit = "mm/min".to_owned();
        }
    }
    let line = refusal(&mut first, &ParameterFile::new(Origin::default(), foreign));
    assert!(line.contains("= 100.0000 mm/min: with its scaling the drive has rpm here; nothing was written"), "{line}");
    assert_eq!(first.link().written, []);
}

#[test]
fn a_value_that_does_not_stand_is_found_by_reading_back() {
    let mut forgetful = host(defaults());
    let before = file_of(&mut forgetful);
    forgetful.link_mut().lost = Some(APPLICATION_TYPE);
    let line = refusal(&mut forgetful, &with(&before, &[(HOMING_VELOCITY, "42"), (APPLICATION_TYPE, "press")]));
    let expected = "S-0-0142 \"Application type\" = press reads back as ; S-0-0263 has brought back what was saved";
    assert_eq!(line, expected);
    assert_eq!(file_of(&mut forgetful), before);
}

#[test]
fn a_drive_that_keeps_every_write_by_itself_keeps_no_half_of_a_file() {
    let mut eager = host(defaults());
    eager.write(STORAGE_MODE, Value::Word(0)).unwrap().unwrap();
    eager.command(SAVE).unwrap().unwrap();
    let mut eager = host(flash_of(&eager));
    let before = file_of(&mut eager);
    // Found while it is read back, when a drive would have kept the rest long since.
    eager.link_mut().lost = Some(Idn::product(140));
    refusal(&mut eager, &with(&before, &[(HOMING_VELOCITY, "42"), (Idn::product(140), "1")]));
    assert_eq!(eager.value(STORAGE_MODE).unwrap(), Value::Word(0));
    assert_eq!(file_of(&mut host(flash_of(&eager))), before);

    eager.link_mut().lost = None;
    let file = with(&before, &[(HOMING_VELOCITY, "42")]);
    let loaded = load_into(&mut eager, &file, WHOLE).unwrap();
    assert_eq!(loaded.written, BTreeSet::from([HOMING_VELOCITY]));
    let mut restarted = host(flash_of(&eager));
    assert_eq!(restarted.value(STORAGE_MODE).unwrap(), Value::Word(0));
    assert_eq!(differing(&file_of(&mut restarted), &file), []);
}

#[test]
fn what_the_drive_does_not_keep_is_an_error_or_left_out_by_name() {
    let mut first = host(defaults());
    let before = file_of(&mut first);
    // One that it does not know, and one that no backup may bring.
    let foreign =
        [Idn::product(4_000), Idn::standard(36)].map(|idn| (idn, before.entry(HOMING_VELOCITY).unwrap().clone()));
    let entries = before.entries().map(|(idn, entry)| (idn, entry.clone())).chain(foreign);
    let file = with(&ParameterFile::new(Origin::default(), entries), &[(HOMING_VELOCITY, "42")]);
    let line = refusal(&mut first, &file);
    assert!(
        line.starts_with("the drive does not keep S-0-0036 \"Homing velocity\", P-0-4000 \"Homing velocity\""),
        "{line}"
    );
    assert!(line.contains("nothing was written; --skip-unknown leaves them out"), "{line}");
    assert_eq!(first.link().written, []);
    let loaded = load_into(&mut first, &file, Manner { store: false, skip_unknown: true }).unwrap();
    assert_eq!(loaded.skipped, [Idn::standard(36), Idn::product(4_000)]);
    assert_eq!(first.link().written, [HOMING_VELOCITY]);
    assert_eq!(file_of(&mut host(flash_of(&first))), before, "it was not to be saved");
}

#[test]
fn data_blocks_that_a_file_does_not_have_stay_as_they_are() {
    let mut first = host(defaults());
    let before = file_of(&mut first);
    let one = with(&before, &[(HOMING_VELOCITY, "42")]);
    let entries = one.entries().filter(|(idn, _)| *idn == HOMING_VELOCITY).map(|(idn, entry)| (idn, entry.clone()));
    let loaded = load_into(&mut first, &ParameterFile::new(Origin::default(), entries), WHOLE).unwrap();
    assert_eq!((loaded.common, loaded.left), (1, before.entries().count() - 1));
    assert_eq!(differing(&file_of(&mut first), &before), [HOMING_VELOCITY]);
}

#[test]
fn a_drive_that_cannot_save_says_why_and_works_with_what_it_had() {
    let mut flash = defaults();
    flash.cut_in(1, 7);
    let mut worn = host(flash);
    let before = file_of(&mut worn);
    let line = refusal(&mut worn, &with(&before, &[(HOMING_VELOCITY, "42")]));
    assert!(line.starts_with("S-0-0264 (save): the drive ends it with an error: the flash does not keep"), "{line}");
    assert!(line.contains("so S-0-0262 has brought the defaults"), "the flash cannot be read either: {line}");
    assert_eq!(file_of(&mut worn), before);
}

#[test]
fn a_value_in_other_words_is_no_difference_to_the_drive() {
    let mut first = host(defaults());
    let before = file_of(&mut first);
    let words = [(Idn::standard(32), "0x2"), (HOMING_VELOCITY, "100"), (Idn::product(172), "707")];
    let file = with(&before, &words);
    assert_ne!(file, before);
    let has = read_like(&mut first, &file, &mut |_, _, _, _| ()).unwrap();
    assert_eq!(differing(&file, &has), []);
    let file = with(&before, &[(Idn::standard(32), "0x1"), (HOMING_VELOCITY, "fast")]);
    let has = read_like(&mut first, &file, &mut |_, _, _, _| ()).unwrap();
    assert_eq!(differing(&file, &has), [Idn::standard(32), HOMING_VELOCITY]);
}

#[test]
fn a_drive_that_is_locked_with_a_password_is_told_and_stays_as_it_is() {
    let mut locked = host(defaults());
    let before = file_of(&mut locked);
    locked.write(Idn::standard(267), Value::Bytes(b"secret".to_vec())).unwrap().unwrap();
    let line = refusal(&mut locked, &with(&before, &[(HOMING_VELOCITY, "42")]));
    let expected = "S-0-0041 \"Homing velocity\" = 42 rpm: the drive refuses with 7009H, protected by password; \
        nothing was written";
    assert_eq!(line, expected);
    assert_eq!(file_of(&mut locked), before);
    // What is so already can be confirmed and saved.
    assert_eq!(load_into(&mut locked, &before, WHOLE).unwrap().written, BTreeSet::new());
}
