//! Recordings played against software slaves: the real one, and others made by the scripted master.

use crate::recordings::{self, Known};

use ring::capture::{Recording, write_capture};
use ring::ident::Idn;
use ring::master::{DriveScript, MasterScript, ScriptedMaster, SlotChoice, Telegram};
use ring::player::{CapturePlayer, PlayError, ReplayReport, Stage};
use ring::service_client::Pace;
use ring::slots::{DriveData, Slots, longest_microseconds};
use ring::software_slave::Manners;
use ring::wire::BitRate;
use ring::{Nanoseconds, Ring, RingConfiguration, SoftwareSlave};

/// The recordings that are here: our own master's, and that of a real one where it is found.
fn recordings() -> Vec<(Known, Recording)> {
    let open = |known: &Known| Recording::open(&known.path).unwrap_or_else(|error| panic!("{known:?}: {error}"));
    recordings::recordings().into_iter().map(|known| (known.clone(), open(&known))).collect()
}

fn replay(recording: Recording, rate: BitRate, manners: &[Manners]) -> ReplayReport {
    let addresses = CapturePlayer::addresses(&recording);
    let slaves: Vec<SoftwareSlave> = addresses
        .iter()
        .enumerate()
        .map(|(index, address)| {
            SoftwareSlave::new(*address).with_manners(manners.get(index).cloned().unwrap_or_default())
        })
        .collect();
    let player = CapturePlayer::new(recording, rate).expect("the recording can be played");
    let mut ring = Ring::new(RingConfiguration::new(slaves.len(), rate), player, slaves);
    for _ in 0..60_000 {
        ring.advance(ring.now() + Nanoseconds::from_millis(1));
        if ring.master().is_done() {
            assert_eq!(ring.statistics().collisions, []);
            return ring.master().report();
        }
    }
    panic!("not done: {:?} {:?}", ring.master().stage(), ring.master().progress());
}

/// A recording of the scripted master's run-up of software slaves.
fn recorded(script: MasterScript) -> Recording {
    let slaves: Vec<SoftwareSlave> = script.drives.iter().map(|drive| SoftwareSlave::new(drive.address)).collect();
    let configuration = RingConfiguration { trace: true, ..RingConfiguration::new(slaves.len(), script.bit_rate) };
    let mut ring = Ring::new(configuration, ScriptedMaster::new(script), slaves);
    while !ring.master().is_done() {
        ring.advance(ring.now() + Nanoseconds::from_millis(2));
        assert!(ring.now() < Nanoseconds::from_millis(60_000), "not done: {}", ring.master().state());
    }
    assert_eq!(ring.master().report().error, None);
    ring.advance(ring.now() + Nanoseconds::from_millis(50));
    Recording::of_trace(ring.trace()).expect("a run makes a recording")
}

fn script(drives: u8, pace: Pace) -> MasterScript {
    let telegram = Telegram::application(&[Idn(11), Idn(51), Idn(0x8013)], &[Idn(36)]);
    let drives = (1..=drives).map(|drive| DriveScript::new(3 * drive, telegram.clone()));
    MasterScript { pace, idle_in_cp3: 30, ..MasterScript::new(drives.collect()) }
}

/// The MDT ends at 1958 us of 2000, the first AT starts at 17 us: 59 us from one to the other.
fn tight(drives: u8, pace: Pace) -> MasterScript {
    let data = vec![DriveData { at_bytes: 8, mdt_bytes: 4 }; usize::from(drives)];
    let at = longest_microseconds(12, BitRate::M2) as u16 + 2;
    let mdt = longest_microseconds(Slots::mdt_length(&data), BitRate::M2) as u16;
    let slots =
        Slots { t1: (0..u16::from(drives)).map(|drive| 17 + drive * at).collect(), t2: 1958 - mdt, t3: 1979, t4: 1698 };
    MasterScript { slots: SlotChoice::Fixed(slots), ..script(drives, pace) }
}

#[test]
fn every_recording_brings_four_drives_to_cp4() {
    for (known, recording) in recordings() {
        brings_four_drives_to_cp4(&known, recording);
    }
}

fn brings_four_drives_to_cp4(known: &Known, recording: Recording) {
    let with_mdt = recording.cycles.iter().filter(|cycle| cycle.mdt.is_some()).count();
    assert_eq!((recording.cycles.len(), with_mdt), known.cycles, "{known:?}");
    let report = replay(recording, BitRate::M2, &[]);
    assert!(report.passed(), "{}", serde_json::to_string_pretty(&report).expect("a report is plain data"));
    assert_eq!(report.in_cp4(), 4);
    for (drive, t1) in report.drives.iter().zip(known.t1) {
        assert_eq!(drive.written.get(&Idn(6)), Some(&vec![t1]));
        assert_eq!(drive.written.get(&Idn(16)), Some(&vec![6, 6, 11, 51, 0x8013]));
        assert_eq!((drive.missed_ats, drive.double_losses, drive.ats_at_wrong_time), (0, 0, 0));
        // 11 communication parameters and three procedure commands.
        assert_eq!((drive.written.len() as u64, drive.read_back), (known.written, known.written));
        assert_eq!(drive.slowest_step(), 1);
    }
}

#[test]
fn what_is_written_as_a_recording_is_read_as_the_same() {
    for (known, recording) in recordings() {
        assert_eq!(
            Recording::parse(&recording.to_text()).expect("what is written can be read"),
            recording,
            "{known:?}"
        );
    }
}

#[test]
fn a_drive_slower_than_the_recorded_ones_falls_behind() {
    for (_, recording) in recordings() {
        let report = replay(recording, BitRate::M2, &[Manners::default(), Manners { late: 1, ..Manners::default() }]);
        assert!(!report.passed());
        assert!(report.drives[0].passed());
        let slow = &report.drives[1];
        // The attribute's first word is given one cycle only; a drive that is late there is out of step from then on.
        let first = &slow.fell_behind[0];
        assert_eq!((first.step.as_str(), first.allowed, first.idn), ("read Attribute", 1, Some(Idn(3))));
    }
}

#[test]
fn a_drive_that_forgets_a_write_does_not_pass() {
    for (known, recording) in recordings() {
        let report = replay(recording, BitRate::M2, &[Manners { forgets: vec![Idn(7)], ..Manners::default() }]);
        assert!(!report.drives[0].passed());
        let [mismatch] = &report.drives[0].mismatches[..] else { panic!("{:?}", report.drives[0].mismatches) };
        assert_eq!(
            (mismatch.idn, mismatch.written.clone(), mismatch.read.clone()),
            (Idn(7), vec![known.t4], Some(vec![0]))
        );
        assert!(report.drives[1].passed());
    }
}

#[test]
fn a_refused_check_is_seen_in_the_replay() {
    for (_, recording) in recordings() {
        let report = replay(recording, BitRate::M2, &[Manners { invalid_for_cp3: vec![Idn(2)], ..Manners::default() }]);
        assert_eq!(report.drives[0].acknowledged_before_switch, [Some(false), Some(true)]);
        assert!(!report.drives[0].passed());
    }
}

#[test]
fn a_drive_that_is_silent_reaches_no_phase() {
    for (_, recording) in recordings() {
        let report = replay(recording, BitRate::M2, &[Manners { mute: true, ..Manners::default() }]);
        assert_eq!(report.drives[0].highest_phase, None);
        assert!(!report.drives[0].passed() && report.drives[0].double_losses > 0);
        assert_eq!(report.in_cp4(), 3);
    }
}

#[test]
fn generated_recordings_with_one_to_eight_drives_pass() {
    for drives in [1, 2, 5, 8] {
        for script in [script(drives, Pace::RECORDED), tight(drives, Pace::RECORDED), tight(drives, Pace::FASTEST)] {
            let report = replay(recorded(script), BitRate::M2, &[]);
            assert!(report.passed(), "{drives} drives: {}", serde_json::to_string_pretty(&report).expect("plain data"));
            assert_eq!(report.in_cp4(), usize::from(drives));
        }
    }
}

#[test]
fn other_cycles_and_bit_rates_pass_too() {
    for (rate, cycle) in [(BitRate::M4, 1_000), (BitRate::M16, 500), (BitRate::M2, 10_000)] {
        let script = MasterScript { bit_rate: rate, cycle, ..script(3, Pace::RECORDED) };
        let report = replay(recorded(script), rate, &[]);
        assert!(report.passed(), "{rate:?} {cycle}: {report:?}");
    }
}

#[test]
fn a_recording_on_disk_is_the_recording() {
    let slave = SoftwareSlave::new(9);
    let configuration = RingConfiguration { trace: true, ..RingConfiguration::new(1, BitRate::M2) };
    let script = MasterScript::new(vec![DriveScript::new(9, Telegram::application(&[Idn(51)], &[Idn(47)]))]);
    let mut ring = Ring::new(configuration, ScriptedMaster::new(script), vec![slave]);
    ring.advance(Nanoseconds::from_millis(200));
    let file = std::env::temp_dir().join(format!("sercos-recording-{}.tsv", std::process::id()));
    write_capture(&file, ring.trace()).expect("the folder for temporary files can be written");
    let read = Recording::open(&file).expect("what was written can be read");
    std::fs::remove_file(&file).expect("the file was just written");
    assert_eq!(read, Recording::of_trace(ring.trace()).expect("a run makes a recording"));
    let missing = Recording::open(&file).expect_err("the file is gone").to_string();
    assert!(missing.contains("No such file"), "{missing}");
}

#[test]
fn a_recording_that_ends_before_cp4_is_played_and_not_passed() {
    let mut recording = recorded(script(1, Pace::FASTEST));
    recording.cycles.retain(|cycle| cycle.phase < 3);
    let report = replay(recording, BitRate::M2, &[]);
    assert!(!report.passed());
    assert_eq!((report.in_cp4(), report.drives[0].highest_phase), (0, Some(2)));
}

#[test]
fn a_recording_that_does_not_say_enough_is_refused() {
    let complete = recorded(script(2, Pace::FASTEST));
    let play = |recording: Recording| CapturePlayer::new(recording, BitRate::M2).map(|player| player.stage());
    assert_eq!(play(complete.clone()), Ok(Stage::Playing));

    let mut silent = complete.clone();
    silent.cycles.iter_mut().for_each(|cycle| cycle.mdt = None);
    assert_eq!(play(silent), Err(PlayError::NoDrives));

    let mut without_writes = complete.clone();
    without_writes.cycles.retain(|cycle| cycle.phase != 2);
    assert_eq!(play(without_writes), Err(PlayError::NotWritten { address: 3, idn: Idn(2) }));

    let mut short = complete;
    let last = short.cycles.iter_mut().rev().find_map(|cycle| cycle.mdt.as_mut()).expect("CP4 has MDTs");
    last.truncate(9);
    let refused = play(short).expect_err("the second drive's record is cut off").to_string();
    assert!(refused.ends_with("MDT of 8 data bytes, drive 6 has its record at byte 9"), "{refused}");
}
