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

/// The press drive on the ring, with the oscilloscope in its own firmware.
#[test]
fn a_velocity_step_of_a_drive_on_the_ring_is_recorded_and_read() {
    let mut channel = RingChannel::run_up(&mut |_| {}).unwrap();
    let order = Settings { points: 256, ..settings(&["F004", "F003", "F006", "S-0-0104"]) };
    let recording = recorder::record(&mut channel, &order, |channel| step(channel, 300.0), &mut |_, _, _| {}).unwrap();
    let scaled = |channel: usize, index: usize| {
        let channel = &recording.channels[channel];
        channel.signal.scaled(channel.points[index])
    };
    assert_eq!((recording.len(), recording.interval), (256, 1_250));
    assert!((0..128).all(|index| scaled(0, index).abs() < 1e-6), "the command is zero up to the trigger");
    // The command goes to 300 rpm within a cycle of 16 ticks; the motor needs 800 rad/s^2 at most, 39 ms.
    assert!((18.7..18.8).contains(&scaled(0, 128)), "{}", scaled(0, 128));
    assert!((128 + 15..256).all(|index| (scaled(0, index) - 300.0).abs() < 1e-3));
    assert!((50.0..150.0).contains(&scaled(1, 255)), "{} rpm after 16 ms", scaled(1, 255));
    assert!((0.8..0.9).contains(&scaled(2, 200)), "at the current limit: {}", scaled(2, 200));
    let gain = channel.read(104).unwrap() as f64 / 100.0;
    assert!((0..256).all(|index| (scaled(3, index) - gain).abs() < 1e-9), "a parameter does not move");
}

/// Both cycles of each tick, in their order: the currents, the angle that goes on with them, and what the currents and voltages must add up to.
#[test]
fn every_cycle_of_the_current_loop_is_recorded_in_its_order() {
    let mut channel = RingChannel::run_up(&mut |_| {}).unwrap();
    step(&mut channel, 300.0).unwrap();
    channel.wait(600_000).unwrap();
    let order =
        Settings { points: 512, sampling: 0, edge: Edge::Immediate, ..settings(&["F018", "F010", "F016", "F019"]) };
    let recording = recorder::record(&mut channel, &order, |_| Ok(()), &mut |_, _, _| {}).unwrap();
    assert_eq!((recording.len(), recording.interval), (512, 625));
    let scaled = |channel: usize| {
        let channel = &recording.channels[channel];
        channel.points.iter().map(|&point| channel.signal.scaled(point))
    };
    // 300 rpm and 4 pole pairs: 20 turns a second, 1/800 turn a cycle.
    let angles: Vec<f64> = scaled(0).collect();
    for pair in angles.windows(2) {
        let turned = (pair[1] - pair[0]).rem_euclid(1.0);
        assert!((0.9 / 800.0..1.1 / 800.0).contains(&turned), "{turned} of a turn in a cycle");
    }
    let mean = |values: Vec<f64>| values.iter().sum::<f64>() / values.len() as f64;
    // 6 Nm and 0.05 Nm s/rad of friction at 2 Nm/A, of 60 A.
    let current = mean(scaled(1).collect());
    assert!((0.060..0.067).contains(&current), "{current}");
    // 0.333 Vs at 125.7 rad/s and 0.35 Ohm with 3.8 A, and what dead time and transistors take.
    let voltage = mean(scaled(2).collect());
    assert!((42.0..47.0).contains(&voltage), "{voltage} V");
    let bus = mean(scaled(3).collect());
    assert!((555.0..565.0).contains(&bus), "{bus} V");

    let order = Settings { signals: settings(&["F013", "F014", "F015", "F010"]).signals, ..order };
    let phases = recorder::record(&mut channel, &order, |_| Ok(()), &mut |_, _, _| {}).unwrap();
    let order = Settings { signals: settings(&["F011", "F012"]).signals, points: 64, ..order };
    let direct = recorder::record(&mut channel, &order, |_| Ok(()), &mut |_, _, _| {}).unwrap();
    let scaled = |recording: &Recording, channel: usize, index: usize| {
        let channel = &recording.channels[channel];
        channel.signal.scaled(channel.points[index])
    };
    for index in 0..512 {
        let currents = [0, 1, 2].map(|phase| scaled(&phases, phase, index));
        assert!(currents.iter().sum::<f64>().abs() < 0.01, "{currents:?} at {index}");
        // Three sines with the amplitude of the torque-producing current: nothing flows along the flux.
        let amplitude = (currents.iter().map(|current| current * current).sum::<f64>() / 1.5).sqrt();
        let quadrature = scaled(&phases, 3, index);
        assert!((amplitude - quadrature.abs()).abs() < 0.008, "{amplitude} and {quadrature} at {index}");
    }
    for index in 0..64 {
        assert!(scaled(&direct, 0, index).abs() < 1e-9, "nothing weakens the field");
        assert!(scaled(&direct, 1, index).abs() < 0.02, "{}", scaled(&direct, 1, index));
    }
}
