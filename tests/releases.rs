//! What an earlier release has saved, found by the drive as it is now: `tests/sets` holds a set of each.

use std::path::{Path, PathBuf};

use bench::{DriveSetup, Executor, Works, commissioned, parameters_of, product, saved_set, set_in};
use drive::DICTIONARY;
use drive::dictionary::is_rating_of;
use flash::FlashModel;
use plant::ReferenceAxis;
use ring::Nanoseconds;
use ring::ident::{Idn, Value};
use ring::master::{CommandValues, DriveScript, MasterScript, Motion, Telegram};
use ring::service_client::Request;
use sercos::data_block::{DataBlock, Selection};
use sercos::parameters::Parameters;

use crate::kept::{command, flash_of, place_of, records, run_until_written, run_up};
use crate::running::{ADDRESS, Bench};

const SAVE: u16 = 264;
const NOT_RESTORED: u16 = 0x800E;
const POSITION_WITHOUT_LAG: u16 = 11;
/// S-0-0141, S-0-0142.
const APPLICATION_TYPE: u16 = 142;
/// Of the axis: 0.0001 degree in a revolution.
const REVOLUTION: f64 = 3_600_000.0;

fn axis() -> ReferenceAxis {
    ReferenceAxis::press()
}

/// What nobody but this axis has, of each kind that a set holds; with the mode none of it is a default.
fn special() -> Vec<(Idn, Value)> {
    vec![
        (Idn::OPERATION_MODE, Value::Word(POSITION_WITHOUT_LAG)),
        (Idn(41), Value::Long(1_234_567)),
        (Idn(159), Value::Long(450_000)),
        (Idn(APPLICATION_TYPE), Value::Bytes(b"printing unit 3".to_vec())),
        (Idn(26), Value::idns(&[Idn(330), Idn(331)])),
        (Idn(328), Value::words(&[0, 0])),
        (product(7), Value::Bytes([7_u32, 0, u32::MAX].iter().flat_map(|long| long.to_le_bytes()).collect())),
    ]
}

/// Everything that a drive keeps, as the table gives it: a control that restores a backup tells a drive all of it.
fn everything() -> Vec<(Idn, Value)> {
    let defaults = Parameters::new(&DICTIONARY);
    let value = |block: &DataBlock| {
        let bytes = defaults.bytes(block).to_vec();
        match (block.fixed_bytes(), bytes.as_slice()) {
            (None, _) => Value::Bytes(bytes),
            (_, &[low, high]) => Value::Word(u16::from_le_bytes([low, high])),
            (_, &[a, b, c, d]) => Value::Long(u32::from_le_bytes([a, b, c, d])),
            other => panic!("{}: {other:?}", block.idn),
        }
    };
    DICTIONARY.select(Selection::Backup).map(|block| (Idn(block.idn.0), value(block))).collect()
}

/// In position mode, with these parameters; with a motion the shaft is brought to a turn in a second and goes on.
fn script(parameters: Vec<(Idn, Value)>, turns: bool) -> MasterScript {
    const STARTING: f64 = 1.0;
    let drive = DriveScript::new(ADDRESS, Telegram::standard(4).unwrap()).with_all(parameters);
    let motion = turns.then(|| {
        Motion::new(1_000_000, |point| {
            let seconds = point.time.as_seconds();
            let turned = if seconds < STARTING { seconds * seconds / 2.0 / STARTING } else { seconds - STARTING / 2.0 };
            CommandValues::at_position(point.start.wrapping_add((turned * REVOLUTION).round() as i32))
        })
    });
    MasterScript { motion, stops_at_refusals: false, reset_diagnostics: false, ..MasterScript::new(vec![drive]) }
}

/// What a commissioned axis saves today.
fn set_of_this_release() -> Vec<u8> {
    let parameters = [everything(), parameters_of(&axis()), commissioned(&axis()), special()].concat();
    let setup = DriveSetup { axis: axis(), flash: FlashModel::new(), ..DriveSetup::new(ADDRESS) };
    let mut bench = run_up(Bench::on(Executor::Host, setup, script(parameters, false)));
    assert_eq!(command(&mut bench, SAVE), Ok(3));
    set_in(&flash_of(&bench)).expect("what was just saved")
}

/// Loads a set into the drive as it is now: whatever of it still exists is there, the rest is named, and the axis turns. Gives what is named.
fn loads_and_turns(set: &[u8], name: &str) -> Vec<Idn> {
    let records = records(set);
    let known = |idn: &Idn| DICTIONARY.select(Selection::Backup).any(|block| block.idn.0 == idn.0);
    let (kept, gone): (Vec<_>, Vec<_>) = records.into_iter().partition(|(idn, _)| known(idn));
    // Firmware that was told them has saved the ratings of this very amplifier.
    let gone: Vec<Idn> = gone.into_iter().map(|(idn, _)| idn).filter(|idn| !is_rating_of(sercos::Idn(idn.0))).collect();

    let setup = DriveSetup { axis: axis(), flash: saved_set(set), ..DriveSetup::new(ADDRESS) };
    let mut bench = Bench::on(Executor::Host, setup, script(Vec::new(), true));
    let turns = (0..500).any(|_| {
        bench.run(Nanoseconds::from_millis(10));
        (59.0..61.0).contains(&bench.rpm())
    });
    assert!(turns, "{name}: {} rpm, {}", bench.rpm(), bench.world.ring().master().state());

    let named: Vec<Idn> = bench.entries(NOT_RESTORED).into_iter().map(Idn).collect();
    assert_eq!(named, gone, "{name}: what does not exist any more, and nothing else");
    for (idn, data) in &kept {
        let bytes = match bench.read(idn.0) {
            Value::Bytes(bytes) => bytes,
            number => number.to_words().into_iter().flat_map(u16::to_le_bytes).collect(),
        };
        assert_eq!(&bytes, data, "{name}: {idn}");
    }
    // Of those that every release has.
    for idn in [Idn(104), Idn(109), Idn(APPLICATION_TYPE), product(110)] {
        assert!(kept.iter().any(|(kept, _)| *kept == idn), "{name}: {idn} is gone");
    }
    assert_eq!(bench.text(APPLICATION_TYPE), "printing unit 3", "{name}");
    gone
}

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("sets")
}

/// `KEEP_SET=NAME` keeps it as `sets/NAME.set`, for the releases that come.
#[test]
fn the_set_of_this_release_is_found_whole_by_the_next_start() {
    let set = set_of_this_release();
    assert_eq!(loads_and_turns(&set, "today's"), []);
    let told: Vec<Idn> = records(&set).into_iter().map(|(idn, _)| idn).collect();
    assert_eq!(told, everything().into_iter().map(|(idn, _)| idn).collect::<Vec<_>>());
    if let Some(mut name) = std::env::var_os("KEEP_SET") {
        name.push(".set");
        let path = folder().join(name);
        assert!(!path.exists(), "{} is there: a release is saved once", path.display());
        std::fs::write(&path, &set).unwrap();
    }
}

#[test]
fn what_an_earlier_release_has_saved_is_taken_as_far_as_it_still_exists_and_the_axis_turns() {
    let mut sets: Vec<PathBuf> = std::fs::read_dir(folder()).unwrap().map(|entry| entry.unwrap().path()).collect();
    sets.retain(|path| path.extension().is_some_and(|extension| extension == "set"));
    assert!(!sets.is_empty(), "no set in {}", folder().display());
    for path in sets {
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        let gone = loads_and_turns(&std::fs::read(&path).unwrap(), &name);
        let names: Vec<String> = gone.iter().map(Idn::to_string).collect();
        println!("{name}: not restored: {}", if names.is_empty() { "nothing".to_owned() } else { names.join(", ") });
    }
}

/// An update in the field: the drive was told its amplifier by its control and had saved that; nobody has written a record. Without field weakening nothing
/// else would stand in the way of torque with a third of the currents and half of the voltage.
#[test]
fn a_set_that_names_another_amplifier_gives_no_cp4_until_somebody_has_saved_what_is_right() {
    let mut set = std::fs::read(folder().join("0.1.0-before-identity.set")).unwrap();
    // P-0-0107 = 0.
    let at = place_of(&set, product(107));
    set[at + 4..at + 6].fill(0);
    let refused = |flash: FlashModel| {
        let script = MasterScript { stops_at_refusals: true, ..script(Vec::new(), true) };
        let setup = DriveSetup { axis: axis(), works: Works::Blank, flash, ..DriveSetup::new(ADDRESS) };
        let mut bench = Bench::on(Executor::Host, setup, script);
        for _ in 0..300 {
            bench.run(Nanoseconds::from_millis(10));
            assert!(!bench.has_torque());
        }
        bench.world.ring().master().report().error.as_ref().map(ToString::to_string)
    };
    let error = refused(saved_set(&set)).unwrap();
    for idn in [Idn(110), product(100), product(101), product(105)] {
        assert!(error.contains(&idn.to_string()), "{error}");
    }

    // In CP2, where the control can look at it: S-0-0264 says that this is the amplifier. A write that keeps itself does not.
    let in_cp2 = |flash: FlashModel, request: Option<Request>| {
        let setup = DriveSetup { axis: axis(), works: Works::Blank, flash, ..DriveSetup::new(ADDRESS) };
        let script = script(vec![(Idn(269), Value::Word(0)), (Idn(41), Value::Long(77))], false);
        let mut bench = Bench::on(Executor::Host, setup, script);
        run_until_written(&mut bench, Idn(41));
        if let Some(request) = request {
            bench.world.ring_mut().master_mut().service(0).request(request);
        }
        bench.run(Nanoseconds::from_millis(3_000));
        flash_of(&bench)
    };
    let kept = in_cp2(saved_set(&set), None);
    assert!(refused(kept.clone()).unwrap().contains("P-0-0101"), "nobody has said anything");
    let save = Request::Command { idn: Idn(SAVE), polls: 1_000 };
    let confirmed = in_cp2(kept, Some(save));
    let names: Vec<Idn> = records(&set_in(&confirmed).unwrap()).into_iter().map(|(idn, _)| idn).collect();
    assert!(!names.contains(&Idn(110)) && names.contains(&Idn(109)));
    // It is believed now, whether it is true or not.
    let setup = DriveSetup { axis: axis(), works: Works::Blank, flash: confirmed, ..DriveSetup::new(ADDRESS) };
    let mut bench = run_up(Bench::on(Executor::Host, setup, script(Vec::new(), false)));
    assert_eq!((bench.world.ring().master().phase(), bench.number(181) & 1 << 8), (4, 0));
}
