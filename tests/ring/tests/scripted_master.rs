//! The scripted master against software slaves: run-up, motion, and everything that it has to notice.

use ring::fibre::{Effect, Fault, TelegramKind};
use ring::ident::{Idn, Value};
use ring::master::{
    Activity, CommandValues, DriveScript, LineShaft, MasterError, MasterScript, Motion, ScriptedMaster, Telegram,
};
use ring::service_client::{Pace, Request, ServiceError};
use ring::software_slave::Manners;
use ring::wire::BitRate;
use ring::{Nanoseconds, Ring, RingConfiguration, SoftwareSlave};

type SoftwareRing = Ring<ScriptedMaster, SoftwareSlave>;

fn application() -> Telegram {
    Telegram::application(&[Idn(51), Idn(40), Idn(189)], &[Idn(47)])
}

fn script(drives: u8) -> MasterScript {
    let drives = (1..=drives).map(|address| DriveScript::new(address, application()).with(Idn(32), Value::Word(3)));
    MasterScript { idle_in_cp3: 20, ..MasterScript::new(drives.collect()) }
}

fn ring_of(script: MasterScript, manners: &[Manners], faults: Vec<Fault>) -> SoftwareRing {
    let rate = script.bit_rate;
    let slaves: Vec<SoftwareSlave> = script
        .drives
        .iter()
        .enumerate()
        .map(|(index, drive)| {
            SoftwareSlave::new(drive.address).with_manners(manners.get(index).cloned().unwrap_or_default())
        })
        .collect();
    let configuration = RingConfiguration { faults, trace: true, ..RingConfiguration::new(slaves.len(), rate) };
    Ring::new(configuration, ScriptedMaster::new(script), slaves)
}

fn run(ring: &mut SoftwareRing) {
    for _ in 0..20_000 {
        ring.advance(ring.now() + Nanoseconds::from_millis(1));
        if ring.master().is_done() {
            return;
        }
    }
    panic!("not done: {}", ring.master().state());
}

fn error_of(script: MasterScript, manners: &[Manners], faults: Vec<Fault>) -> MasterError {
    let mut ring = ring_of(script, manners, faults);
    run(&mut ring);
    assert_eq!(ring.master().phase(), 0, "a master that has failed sends CP0");
    ring.master().report().error.clone().expect("the run must fail")
}

#[test]
fn a_ring_runs_up_at_every_bit_rate_and_with_one_to_eight_drives() {
    for (rate, drives) in [(BitRate::M2, 1), (BitRate::M4, 3), (BitRate::M8, 5), (BitRate::M16, 8), (BitRate::M2, 8)] {
        let mut ring = ring_of(MasterScript { bit_rate: rate, ..script(drives) }, &[], vec![]);
        run(&mut ring);
        ring.advance(ring.now() + Nanoseconds::from_millis(4));
        let report = ring.master().report();
        assert_eq!(report.error, None, "{rate:?}, {drives} drives");
        assert_eq!(report.phases.iter().map(|phase| phase.phase).collect::<Vec<_>>(), [0, 1, 2, 3, 4]);
        assert!(report.phases[1].cycle >= 10, "at least ten MSTs have to come back");
        assert!(
            report
                .drives
                .iter()
                .all(|drive| drive.missed_ats == 0 && drive.invalid_ats == 0 && drive.slowest_step() == 1)
        );
        assert!(
            ring.stations().iter().all(|slave| slave.phase() == 4 && slave.value(Idn(32)) == Some(&Value::Word(3)))
        );
        assert_eq!(ring.statistics().collisions, []);
        assert_eq!(report.line_errors, 0);
    }
}

#[test]
fn every_telegram_type_runs_up_and_places_its_data() {
    for kind in [0, 1, 2, 3, 4, 5, 6, 11, 12, 13] {
        let telegram = Telegram::standard(kind).expect("a standard type");
        let mut ring = ring_of(MasterScript::new(vec![DriveScript::new(7, telegram)]), &[], vec![]);
        run(&mut ring);
        assert_eq!(ring.master().report().error, None, "type {kind}");
        assert_eq!(ring.stations()[0].value(Idn::TELEGRAM_TYPE), Some(&Value::Word(kind)));
    }
}

#[test]
fn drives_follow_a_line_shaft_and_are_switched_off_again() {
    let shaft =
        LineShaft { velocity: 100_000, ramp: Nanoseconds::from_millis(100), constant: Nanoseconds::from_millis(200) };
    let cycles = shaft.duration().0 / Nanoseconds::from_millis(2).0 + 5;
    let profile = move |point: ring::master::ProfilePoint| {
        CommandValues::at_position(point.start + shaft.position(point.time) as i32)
    };
    let mut ring = ring_of(MasterScript { motion: Some(Motion::new(cycles, profile)), ..script(3) }, &[], vec![]);
    run(&mut ring);
    let report = ring.master().report();
    assert_eq!(report.error, None);
    assert_eq!(ring.master().state().activity, Activity::Finished);
    let moving: Vec<_> =
        report.samples.iter().filter(|sample| sample.drive == 1 && sample.profile_cycle.is_some()).collect();
    assert_eq!(moving.len() as u64, cycles);
    // The software slave stands where it is told at once: the AT of a cycle shows the command of the one before.
    assert!(moving.windows(2).all(|pair| pair[1].position == Some(pair[0].position_command)));
    assert_eq!(moving.last().map(|sample| sample.position_command), Some(30_000));
    let last = report.samples.last().and_then(|sample| sample.status).expect("the last AT came");
    assert_eq!(last >> 14, 2, "torque is off at the end");
}

#[test]
fn a_drive_that_is_slow_or_busy_only_costs_cycles() {
    let manners =
        [Manners { late: 3, busy: 0, command: 5, ..Manners::default() }, Manners { busy: 15, ..Manners::default() }];
    let mut ring = ring_of(script(2), &manners, vec![]);
    run(&mut ring);
    let report = ring.master().report();
    assert_eq!(report.error, None);
    assert_eq!(report.drives[0].slowest_step(), 4);
    assert_eq!(report.drives[1].slowest_step(), 16);
}

#[test]
fn a_drive_that_never_acknowledges_is_a_handshake_timeout() {
    let error = error_of(script(1), &[Manners { late: 10, ..Manners::default() }], vec![]);
    let MasterError::Service { address: 1, phase: 2, error: ServiceError::HandshakeTimeout { cycles, .. } } = error
    else {
        panic!("{error}")
    };
    assert_eq!(cycles, 10);
}

#[test]
fn an_address_that_nobody_has_is_reported() {
    let error = error_of(script(2), &[Manners::default(), Manners { mute: true, ..Manners::default() }], vec![]);
    assert_eq!(error.to_string(), "drive 2 did not answer in CP1 (10 MDTs sent)");
}

#[test]
fn a_refused_check_says_which_data_is_invalid() {
    let manners = Manners { invalid_for_cp3: vec![Idn(2), Idn(16)], ..Manners::default() };
    let error = error_of(script(1), &[manners], vec![]);
    assert_eq!(
        error.to_string(),
        "drive 1 refused the transition check: S-0-0127: command ended with data status 0xf after 1 polls, expected 3; \
         invalid data: S-0-0002, S-0-0016"
    );
}

#[test]
fn a_parameter_that_a_drive_does_not_have_is_refused_in_plain_words() {
    let mut script = script(1);
    script.drives[0].parameters.push((Idn(4000), Value::Word(1)));
    let error = error_of(script, &[], vec![]);
    assert_eq!(error.to_string(), "drive 1 in CP2: S-0-4000: open S-0-4000 refused with 0x1001 (IDN not available)");
}

#[test]
fn one_lost_at_is_forgiven_and_two_in_a_row_are_not() {
    let mut reference = ring_of(script(2), &[], vec![]);
    run(&mut reference);
    let cp4 = reference.master().report().phases[4].cycle;
    let lost = |cycles: std::ops::Range<u64>| {
        let drop = |cycle| Fault::once(cycle, 2, TelegramKind::At(1), Effect::Drop);
        let motion = Motion::new(100, |point| CommandValues::at_position(point.start));
        let mut ring = ring_of(MasterScript { motion: Some(motion), ..script(2) }, &[], cycles.map(drop).collect());
        run(&mut ring);
        ring.master().report().clone()
    };
    let single = lost(cp4 + 10..cp4 + 11);
    assert_eq!((single.error, single.drives[0].missed_ats), (None, 1));
    let double = lost(cp4 + 10..cp4 + 12);
    assert_eq!(double.error, Some(MasterError::AtLost { address: 1, phase: 4, cycle: cp4 + 11 }));
}

#[test]
fn an_at_at_the_wrong_time_is_invalid() {
    let mut reference = ring_of(script(1), &[], vec![]);
    run(&mut reference);
    let cp4 = reference.master().report().phases[4].cycle;
    let late = Effect::Delay(Nanoseconds::from_microseconds(5));
    let mut ring = ring_of(
        MasterScript { motion: Some(Motion::new(50, |point| CommandValues::at_position(point.start))), ..script(1) },
        &[],
        vec![Fault::once(cp4 + 20, 1, TelegramKind::At(1), late)],
    );
    run(&mut ring);
    let drive = &ring.master().report().drives[0];
    assert_eq!((drive.invalid_ats, drive.missed_ats), (1, 1));
}

#[test]
fn a_broken_ring_is_called_open() {
    let error = error_of(script(2), &[], vec![Fault::ring_break(0..100_000, 1)]);
    assert_eq!(error.to_string(), "ring open: MST not returned in 200 cycles");
}

#[test]
fn a_drive_without_power_is_waited_for_and_then_given_up() {
    let motion = Motion { patience: 30, ..Motion::new(10, |_| CommandValues::default()) };
    let error = error_of(
        MasterScript { motion: Some(motion), ..script(1) },
        &[Manners { readiness: Some(1), ..Manners::default() }],
        vec![],
    );
    assert_eq!(
        error.to_string(),
        "drive 1: power (status bits 15..14 = 2) expected within 30 cycles, status word is 0x4001"
    );
}

#[test]
fn the_service_channel_serves_beside_the_script() {
    let mut ring = ring_of(script(2), &[], vec![]);
    run(&mut ring);
    let service = ring.master_mut().service(1);
    service.request(Request::Write(Idn(103), Value::Long(3_600_000)));
    service.request(Request::Read(Idn(103)));
    service.request(Request::Read(Idn(30)));
    ring.advance(ring.now() + Nanoseconds::from_millis(100));
    let services = &ring.master().report().drives[1].services;
    let values: Vec<_> =
        services.iter().rev().take(2).map(|done| done.result.as_ref().expect("it can be read").value()).collect();
    assert_eq!(values[1], Some(&Value::Long(3_600_000)));
    assert_eq!(values[0].and_then(Value::as_text).as_deref(), Some("software slave"));
}

#[test]
fn a_master_that_lost_its_ring_runs_it_up_again() {
    let mut reference = ring_of(script(2), &[], vec![]);
    run(&mut reference);
    let cp4 = reference.master().report().phases[4].cycle;
    let dark = vec![Fault::ring_break(cp4 + 5..cp4 + 10, 1)];
    let mut ring = ring_of(script(2), &[], dark);
    run(&mut ring);
    ring.advance(ring.now() + Nanoseconds::from_millis(100));
    assert!(matches!(ring.master().report().error, Some(MasterError::AtLost { phase: 4, .. })));
    ring.master_mut().restart(script(2));
    run(&mut ring);
    let report = ring.master().report();
    assert_eq!(report.error, None);
    assert_eq!(report.phases.iter().map(|record| record.phase).collect::<Vec<_>>(), [0, 1, 2, 3, 4]);
    let gaps: Vec<u64> = mst_ends(&ring).windows(2).map(|pair| pair[1] - pair[0]).collect();
    assert!(gaps.iter().all(|gap| *gap == 2_000_000), "the rhythm of the MSTs is never broken");
}

/// Ends of all MSTs at the master, ns.
fn mst_ends(ring: &SoftwareRing) -> Vec<u64> {
    let length = |bytes: &[u8]| BitRate::M2.span(ring::wire::encode(bytes).len()).0;
    let msts = ring.trace().iter().filter(|entry| matches!(entry.bytes[..], [255, _]));
    msts.map(|entry| entry.time.0 + length(&entry.bytes)).collect()
}

#[test]
fn the_dialogue_of_a_run_up() {
    let mut script = MasterScript { pace: Pace::RECORDED, ..script(1) };
    script.drives[0].telegram = Telegram::application(&[Idn(11), Idn(51)], &[Idn(36)]);
    let mut ring = ring_of(script, &[], vec![]);
    run(&mut ring);
    let mut lines = Vec::new();
    let mut last = (Vec::new(), 0);
    for entry in ring.trace() {
        if entry.bytes == last.0 {
            last.1 += 1;
            continue;
        }
        if entry.sender == ring::ring::Sender::Master && entry.bytes.len() == 2 {
            continue;
        }
        if !last.0.is_empty() && entry.bytes[0] == last.0[0] {
            last.1 = 1;
        }
        let who = if entry.sender == ring::ring::Sender::Master { "MDT" } else { "AT " };
        let hex: Vec<String> = entry.bytes.iter().map(|byte| format!("{byte:02x}")).collect();
        let line = format!("{who} {}", hex.join(" "));
        if !lines.iter().rev().take(2).any(|earlier| *earlier == line) {
            lines.push(line);
        }
        last.0.clone_from(&entry.bytes);
    }
    insta::assert_snapshot!(lines.join("\n"));
}
