use super::channel::ServiceChannel;
use super::fake_drive::FakeDrive;
use super::*;
use drive::oscilloscope::{LEVEL, PRE_TRIGGER, SAMPLING, SIGNALS, TRIGGER};

fn settings(signals: &[&str]) -> Settings {
    Settings {
        signals: signals.iter().map(|text| text.parse().unwrap()).collect(),
        trigger_channel: 1,
        edge: Edge::Rising,
        level: 1.0,
        pre_trigger: 128,
        sampling: 1,
        points: 2_048,
    }
}

/// Records a step to so many rpm with a drive that has the real oscilloscope.
fn recorded(drive: &mut FakeDrive, settings: &Settings, rpm: f64) -> Result<Recording, RecordError> {
    recorder::record(drive, settings, |channel| step(channel, rpm), &mut |_, _, _| {})
}

#[test]
fn a_step_is_recorded_with_the_time_before_it_and_read_window_by_window() {
    let mut drive = FakeDrive::new();
    let recording = recorded(&mut drive, &settings(&["F004", "F003", "S-0-0040"]), 300.0).unwrap();
    assert_eq!((recording.interval, recording.pre_trigger), (1_250, 128));
    assert_eq!((recording.time(0), recording.time(128)), (-160_000, 0));
    let [command, feedback, data_block] = &recording.channels[..] else { panic!("{}", recording.channels.len()) };
    let rpm = |channel: &Channel, index: usize| channel.signal.scaled(channel.points[index]);
    assert!(recording.channels.iter().all(|channel| channel.points.len() == 2_048));
    for index in 0..2_048 {
        let expected = if index < 128 { 0.0 } else { 300.0 };
        assert!((rpm(command, index) - expected).abs() < 1e-4, "{index}: {}", rpm(command, index));
        assert!((rpm(feedback, index) - rpm(data_block, index)).abs() < 1e-3, "{index}");
    }
    // A time constant of 64 ticks: 63 % after it, all but nothing missing at the end.
    assert!((185.0..195.0).contains(&rpm(feedback, 128 + 63)), "{}", rpm(feedback, 128 + 63));
    assert!((299.9..300.1).contains(&rpm(feedback, 2_047)));
}

#[test]
fn the_settings_reach_the_drive_as_its_data_blocks_want_them() {
    let mut drive = FakeDrive::new();
    let order = Settings {
        trigger_channel: 2,
        edge: Edge::Falling,
        level: -12.5,
        pre_trigger: 2_000,
        sampling: 3,
        points: 70,
        ..settings(&["F000", "S-0-0040"])
    };
    let recording = recorded(&mut drive, &order, -100.0).unwrap();
    let written = [SIGNALS[0], SIGNALS[1], SIGNALS[2], SIGNALS[3], TRIGGER, LEVEL, PRE_TRIGGER, SAMPLING];
    let level = u64::from((-125_000_i32).cast_unsigned());
    assert_eq!(written.map(|idn| drive.written(idn).unwrap()), [0xF000, 40, 0, 0, 0x0201, level, 2_000, 3]);
    assert_eq!(recording.trigger, Some((1, -125_000)));
    assert_eq!(recording.interval, 3_750);
    assert_eq!(recording.channels.iter().map(|channel| channel.points.len()).collect::<Vec<_>>(), [70, 70]);
}

#[test]
fn without_an_edge_the_level_does_not_matter() {
    let mut drive = FakeDrive::new();
    let order = Settings { edge: Edge::Immediate, level: 1e300, points: 1, ..settings(&["F003"]) };
    let recording = recorded(&mut drive, &order, 10.0).unwrap();
    assert_eq!((recording.trigger, drive.written(LEVEL), recording.len()), (None, Some(0), 1));
}

#[test]
fn a_trigger_that_never_comes_is_said_with_its_remedy() {
    let error = recorded(&mut FakeDrive::new(), &Settings { level: 400.0, ..settings(&["F003"]) }, 300.0).unwrap_err();
    assert_eq!(error, RecordError::Stuck { state: 2 });
    assert!(error.to_string().contains("--edge immediate"), "{error}");
}

#[test]
fn a_recording_that_nobody_samples_is_stuck_before_its_trigger() {
    // The fake drive has no current loop.
    let error = recorded(&mut FakeDrive::new(), &Settings { sampling: 0, ..settings(&["F003"]) }, 300.0).unwrap_err();
    assert_eq!(error, RecordError::Stuck { state: 1 });
}

#[test]
fn a_drive_without_oscilloscope_or_without_the_signal_refuses_by_name() {
    let mut drive = FakeDrive::new();
    drive.has_scope = false;
    let error = recorded(&mut drive, &settings(&["F003"]), 300.0).unwrap_err();
    assert_eq!(error, RecordError::Channel(ChannelError::Refused { idn: 0x80D1, code: 0x1001 }));
    assert!(error.to_string().starts_with("P-0-0209: the drive has no such data block"), "{error}");
    let error = recorded(&mut FakeDrive::new(), &settings(&["F003", "S-0-0017"]), 300.0).unwrap_err();
    assert_eq!(error.to_string(), "P-0-0202: the drive refused with 7008H");
}

#[test]
fn lists_that_are_too_short_are_not_taken_for_a_recording() {
    let mut drive = FakeDrive::new();
    drive.withheld = 1;
    let error = recorded(&mut drive, &settings(&["F003"]), 300.0).unwrap_err();
    assert_eq!(error, RecordError::Points { channel: 1, start: 0, expected: 32, actual: 31 });
}

#[test]
fn a_recording_becomes_a_page_and_a_table() {
    let folder = tempfile::tempdir().unwrap();
    let recording = recorded(&mut FakeDrive::new(), &settings(&["F004", "F003"]), 300.0).unwrap();
    let table = folder.path().join("step.csv");
    assert_eq!(conclude(&recording, Some(&table), folder.path()).unwrap(), Verdict::Passed);
    let csv = std::fs::read_to_string(table).unwrap();
    assert_eq!(csv.lines().count(), 1 + 2_048);
    assert!(csv.lines().nth(129).unwrap().starts_with("0.0,300.0000002"), "{:?}", csv.lines().nth(129));
    assert!(std::fs::read_to_string(folder.path().join("index.html")).unwrap().contains("channel-2"));
}

#[test]
fn an_access_to_the_fake_drive_takes_time() {
    let mut drive = FakeDrive::new();
    drive.write(37, 3_000_000).unwrap();
    assert!(matches!(drive.read(40), Err(ChannelError::Refused { idn: 40, code: 0x1001 })));
}
