#![allow(non_snake_case, reason = "S(2) and P(3) are how an ident number is written")]

use std::collections::BTreeSet;
use std::string::ToString;
use std::vec;
use std::vec::Vec;

use sercos::attribute::Length;
use sercos::capacity::LIVE_TEXT_BYTES;
use sercos::data_block::{DataBlock, Location, Selection};
use sercos::parameters::Parameters;
use sercos::service::Live;
use sercos::transition::Reason;
use sercos::{Idn, Phase};
use servo::SettingsError;

use super::finding::Finding;
use super::loops;
use super::rig::{FACTS, Rig, Still, words_of};
use crate::dictionary::DICTIONARY;
use crate::production::{Production, RecordError};
use crate::remembering::keeping::Keep;
use crate::settings::invalid::InvalidSetting;
use crate::settings::{CycleSettings, DriveSettings};

pub(super) const fn S(number: u16) -> Idn {
    Idn::standard(number)
}

pub(super) const fn P(number: u16) -> Idn {
    Idn::product(number)
}

fn settings(parameters: &Parameters) -> Result<DriveSettings, InvalidSetting> {
    loops::settings::<Still>(parameters)
}

/// The loops work with the parameters as they read, and in operation S-0-0128 would let them pass.
#[track_caller]
fn assert_in_effect(rig: &Rig, what: &str) {
    if rig.is_in_cp4() {
        assert_eq!(rig.check_for_cp4(), Ok(()), "{what}");
    }
    assert_eq!(Ok(rig.motion.settings()), settings(&rig.parameters), "{what}");
}

fn writable(phase: Phase) -> impl Iterator<Item = &'static DataBlock> {
    DICTIONARY
        .blocks()
        .iter()
        .filter(move |block| !block.attribute.is_protected_in(phase) && !block.attribute.command())
}

/// Values that a master may try, legal or not.
pub(super) fn attempts(block: &DataBlock) -> Vec<Vec<u16>> {
    if block.fixed_bytes().is_some() {
        let limits = [block.minimum, block.maximum].into_iter().flatten();
        let near = [-1, 1, 2, 10].map(|difference| block.default + difference);
        let others = [0, 1, 2, 3, 4, 8, 11, 13, 15, 100, 1_000, 2_000, 3_000, 5_000, 0x82, 0x8013];
        let values = limits.chain(near).chain(others).collect::<BTreeSet<i64>>();
        return values.into_iter().map(|value| words_of(block, value as u64)).collect();
    }
    match block.attribute.length() {
        Length::ListOfBytes => vec![vec![4, 4, 0x4141, 0x4141], vec![0, 0]],
        Length::ListOfTwo => {
            let entries = [3, 11, 51, 36, 32, 0x8013];
            entries.into_iter().map(|entry| vec![2, 2, entry]).chain([vec![0, 0]]).collect()
        }
        _ => vec![vec![4, 4, 1, 2]],
    }
}

#[test]
fn what_is_acknowledged_in_operation_is_in_effect_and_what_is_refused_has_changed_nothing() {
    let (mut refused, mut untold) = (BTreeSet::new(), BTreeSet::new());
    for block in writable(Phase::Cp4) {
        for words in attempts(block) {
            let mut rig = Rig::in_cp4(&[]);
            let before = rig.parameters.clone();
            let answer = rig.write(block.idn, &words);
            let what = std::format!("{} = {words:04X?}: {answer:04X?}", block.idn);
            assert_in_effect(&rig, &what);
            if answer.is_err() {
                assert_eq!(rig.parameters, before, "{what}");
            }
            if answer == Err(0x7008) {
                assert!(rig.finding().starts_with(['S', 'P']), "{what}: {}", rig.finding());
            }
            if answer == Err(0x7008) && !matches!(rig.checks.finding, Some(Finding::Value(..))) {
                refused.insert(block.idn.to_string());
                if !block.restricted {
                    untold.insert(block.idn.to_string());
                }
            }
        }
    }
    assert!(untold.is_empty(), "the table does not say that values of {untold:?} may be refused");
    assert!(["S-0-0193", "S-0-0201", "S-0-0204"].iter().all(|&idn| refused.contains(idn)), "{refused:?}");
}

#[test]
fn a_value_that_a_data_block_cannot_have_is_told_until_a_write_succeeds() {
    let mut rig = Rig::in_cp4(&[]);
    for (idn, words, told) in [
        (S(26), &[2, 2, 2][..], "S-0-0026: a list that is too long, or an entry that it cannot have"),
        (S(270), &[4, 4, 32, 51], "S-0-0270: up to 16 IDNs, each of them one of S-0-0192"),
        (S(270), &[2, 2, 4_000], "S-0-0270: up to 16 IDNs, each of them one of S-0-0192"),
        (S(329), &[2, 2, 16], "S-0-0329: a list that is too long, or an entry that it cannot have"),
        (S(99), &[2], "S-0-0099: a command takes 3 to start and 0 to cancel"),
        (S(267), &[1, 1, 0x41], "S-0-0267: no password, or not the one in force"),
        (S(301), &[11], "S-0-0301: a value that it does not have"),
    ] {
        assert_eq!(rig.write(idn, words), Err(0x7008), "{idn}");
        assert_eq!(rig.finding(), told);
    }
    rig.write(S(92), &[200]).unwrap();
    assert_eq!(rig.finding(), "");
}

#[test]
fn only_a_lock_that_has_changed_is_kept_and_shown_as_unsaved() {
    let mut rig = Rig::in_cp4(&[]);
    let mut now = 0;
    let mut write = |characters: &[u8]| {
        // As often as a log may be kept, and not so late that the operating time is.
        now += 3_000_000;
        let pairs = characters.chunks(2).map(|pair| u16::from_le_bytes([pair[0], pair.get(1).copied().unwrap_or(0)]));
        let length = characters.len() as u16;
        let answer = rig.write(S(267), &[length, length].into_iter().chain(pairs).collect::<Vec<u16>>());
        (answer, rig.keeping.has_unsaved(), rig.keeping.next(now, false))
    };
    assert_eq!(write(b""), (Ok(()), false, None), "there is no lock");
    assert_eq!(write(b"ab"), (Err(0x7008), false, None));
    assert_eq!(write(b"press 3"), (Ok(()), true, Some(Keep::Log)));
    assert_eq!(write(b"press 4"), (Err(0x7008), false, None));
    assert_eq!(write(b""), (Err(0x7008), false, None));
}

#[test]
fn what_is_selected_is_what_s_0_0270_names_when_s_0_0293_is_started() {
    let mut rig = Rig::in_cp4(&[]);
    rig.write(S(270), &[4, 4, 41, 142]).unwrap();
    rig.write(S(293), &[3]).unwrap();
    for later in [&[2, 2, 125][..], &[0, 0]] {
        rig.write(S(270), later).unwrap();
        assert_eq!(rig.keeping.selected, [S(41), S(142)]);
    }
    assert_eq!(rig.write(S(293), &[0]), Ok(()));
    assert_eq!(rig.write(S(293), &[3]), Err(0x7013), "nothing is selected now");
    assert_eq!(rig.keeping.next(0, false), None);
}

#[test]
fn a_write_that_the_loops_cannot_take_leaves_the_way_free_for_the_next() {
    let mut rig = Rig::in_cp4(&[]);
    for (idn, words, culprit) in [
        (S(201), &[1_400][..], "S-0-0201"),
        (S(204), &[1_100], "S-0-0201"),
        (S(193), &[1, 0], "S-0-0193"),
        (S(349), &[1, 0], "S-0-0349"),
        // S-0-0128 would not let it pass, whether the limits are switched on or not.
        (S(49), &[0, 0x8000], "S-0-0049"),
    ] {
        assert_eq!(rig.write(idn, words), Err(0x7008), "{idn}");
        let finding = rig.finding();
        assert!(finding.starts_with(culprit), "{idn}: {finding}");
        // An unheard refusal does not stand in the way.
        let torque = if rig.parameters.get(S(92)) == 100 { 200 } else { 100 };
        rig.write(S(92), &[torque]).unwrap();
        assert_eq!(rig.finding(), "");
        assert_in_effect(&rig, "S-0-0092");
    }
}

#[test]
fn magnets_that_make_more_than_the_overvoltage_at_s_0_0113_are_refused_unless_the_link_bears_it() {
    // 0.8 Nm per ampere of amplitude and 4 pole pairs are 0.13333 Vs; sqrt(3) times that at 6 000 rpm is 580.4 V, at 4 548 rpm 439.9 V.
    let magnets = (P(114), [0x436B, 0x0011]);
    let speed = |rpm: u32| (S(113), [(rpm * 10_000) as u16, ((rpm * 10_000) >> 16) as u16]);
    for (rpm, weakening, bears, refused) in [
        (6_000, 500, 440, true),
        (6_000, 0, 440, false),
        (6_000, 500, 600, false),
        (4_548, 500, 440, false),
        (4_550, 500, 440, true),
    ] {
        let mut rig = Rig::in_cp3(&[]);
        for (idn, words) in [magnets, speed(rpm)] {
            rig.write(idn, &words).unwrap();
        }
        rig.parameters.set(P(239), bears).unwrap();
        rig.write(P(107), &[weakening]).unwrap();
        let answer = settings(&rig.parameters).map_err(|setting| (setting.idn, std::format!("{setting}")));
        let Err((idn, text)) = answer else {
            assert!(!refused, "{rpm} rpm, {weakening}, {bears}");
            continue;
        };
        assert!(refused && idn == S(113), "{rpm} rpm, {weakening}, {bears}: {text}");
        let voltage = if rpm == 6_000 { 581 } else { 441 };
        let told = std::format!(
            "S-0-0113: magnets induce {voltage} V between two phases at this speed, expected at most P-0-0239 of 440 V"
        );
        assert_eq!(text, told);
    }
}

#[test]
fn a_drive_that_cannot_read_its_production_record_is_refused_cp4_with_the_reason() {
    let mut rig = Rig::in_cp3(&[]);
    rig.identity.production = Production::Unreadable(RecordError::Checksum { expected: 0x12, actual: 0xABCD });
    rig.write(Idn::CP4_TRANSITION_CHECK, &[3]).unwrap();
    assert_eq!(rig.finding(), "production record: checksum 0000ABCDH, expected 00000012H; have it written again");
    assert_eq!(rig.checks.invalid_for_cp4.findings()[0].idn, P(21));
    assert!(!rig.is_in_cp4());
}

#[test]
fn any_order_of_any_writes_leaves_the_loops_with_what_reads_back() {
    let mut rig = Rig::in_cp4(&[]);
    let mut seed = 1_u32;
    let mut random = move |below: usize| {
        seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (seed >> 8) as usize % below
    };
    let blocks: Vec<&DataBlock> = writable(Phase::Cp4).collect();
    let (mut taken, mut refused) = (0, 0);
    for _ in 0..20_000 {
        let block = blocks[random(blocks.len())];
        let attempts = attempts(block);
        match rig.write(block.idn, &attempts[random(attempts.len())]) {
            Ok(()) => taken += 1,
            Err(_) => refused += 1,
        }
        assert_in_effect(&rig, &block.idn.to_string());
    }
    assert!(taken > 5_000 && refused > 1_000, "{taken} taken, {refused} refused");
}

#[test]
fn before_s_0_0128_a_master_writes_in_any_order_and_after_it_only_what_goes_together() {
    let mut rig = Rig::in_cp3(&[(S(201), &[1_400])]);
    // Neither of them goes with the other.
    assert_eq!(settings(&rig.parameters).map_err(|setting| setting.idn), Err(S(201)));
    rig.write(S(204), &[1_500]).unwrap();
    assert_in_effect(&rig, "both are there");
    rig.pass_check_for_cp4();
    // S-0-0128 does not look at it: the permission stays, so that it must fit.
    assert_eq!(rig.write(S(193), &[1, 0]), Err(0x7008));
    assert_in_effect(&rig, "S-0-0193");
    // This one takes the permission back, and with it the need to fit.
    rig.write(S(201), &[1_500]).unwrap();
    rig.write(Idn::CP4_TRANSITION_CHECK, &[3]).unwrap();
    let found: Vec<(u16, Reason)> =
        rig.checks.invalid_for_cp4.findings().iter().map(|found| (found.idn.0, found.reason)).collect();
    assert_eq!(found, [(201, Reason::NotTogether)]);
    assert_eq!(rig.checks.invalid_for_cp4.codes().collect::<Vec<_>>(), [0x0010]);
    let finding = rig.finding();
    assert!(finding.starts_with("S-0-0201: ") && finding.contains("1500"), "{finding}");
}

#[test]
fn the_cycle_that_s_0_0127_accepts_counts_in_cp3_whatever_else_does_not_go_together() {
    let mut rig = Rig::in_cp3(&[(S(201), &[1_400]), (S(2), &[4_000])]);
    assert!(settings(&rig.parameters).is_err());
    assert_eq!(Ok(rig.motion.settings().motion.cycle), CycleSettings::new(&rig.parameters, FACTS.loop_timer_counts));
    assert_eq!(rig.motion.settings().motion.cycle.ticks_per_cycle, 32);
    rig.write(S(201), &[1_200]).unwrap();
    assert_in_effect(&rig, "all of it");
}

#[test]
fn every_cycle_that_can_be_written_is_one_that_the_loops_can_run_with() {
    for cycle in (500..=65_000).step_by(250) {
        let mut parameters = crate::service::rig::parameters();
        parameters.set(S(2), cycle).unwrap();
        for multiple in 1..=(65_000 / cycle) {
            parameters.set(S(1), cycle * multiple).unwrap();
            assert!(settings(&parameters).is_ok(), "S-0-0002 = {cycle}, S-0-0001 = {}", cycle * multiple);
        }
    }
}

#[test]
fn a_success_takes_the_old_failure_back() {
    let mut rig = Rig::in_cp4(&[]);
    rig.write(S(147), &[0x68]).unwrap();
    assert_eq!(rig.write(S(148), &[3]), Err(0x7013));
    assert!(rig.finding().starts_with("S-0-0147"), "{}", rig.finding());
    // A write that is taken says nothing about homing.
    rig.write(S(147), &[0x60]).unwrap();
    assert!(rig.finding().starts_with("S-0-0147"));
    // As the loops tell in their first tick.
    let _ = rig.motion.control_loop();
    rig.write(S(148), &[3]).unwrap();
    assert_eq!(rig.finding(), "");
    rig.write(S(148), &[0]).unwrap();
    assert_eq!(rig.write(S(262), &[3]), Err(0x7012));
    assert!(rig.finding().contains("S-0-0262"));
    assert_eq!(rig.write(S(201), &[1_400]), Err(0x7008));
    assert!(rig.finding().starts_with("S-0-0201"));
    rig.write(S(201), &[1_200]).unwrap();
    assert_eq!(rig.finding(), "");
}

#[test]
fn no_command_changes_in_cp4_what_cp4_protects() {
    let protected = |rig: &Rig| -> Vec<(Idn, u32)> {
        let fixed = DICTIONARY
            .blocks()
            .iter()
            .filter(|block| block.location == Location::Parameter && block.fixed_bytes().is_some());
        let protected = fixed.filter(|block| block.attribute.is_protected_in(Phase::Cp4));
        protected.map(|block| (block.idn, rig.parameters.get(block.idn))).collect()
    };
    for block in DICTIONARY.blocks().iter().filter(|block| block.attribute.command()) {
        // A value of its own wherever a default could come back.
        let mut rig = Rig::in_cp4(&[(S(79), &[0, 16]), (S(76), &[0x0A]), (S(109), &[17_000, 0]), (S(33), &[2])]);
        rig.write(S(104), &[250]).unwrap();
        let before = (protected(&rig), rig.motion.settings());
        let answer = rig.write(block.idn, &[3]);
        assert_eq!(protected(&rig), before.0, "{}: {answer:04X?}", block.idn);
        if answer.is_err() {
            assert_eq!(rig.motion.settings(), before.1, "{}", block.idn);
        }
        assert_in_effect(&rig, &block.idn.to_string());
    }
}

#[test]
fn what_a_command_may_change_can_be_written_wherever_the_command_may_run() {
    // S-0-0262, in CP2 and CP3.
    for block in DICTIONARY.select(Selection::Backup) {
        let protected = [Phase::Cp2, Phase::Cp3].map(|phase| block.attribute.is_protected_in(phase));
        assert_eq!(protected, [false; 2], "{}", block.idn);
    }
    // P-0-0220, P-0-0224 to P-0-0226.
    let computed = [100, 101, 104, 106, 107].map(S).into_iter().chain([111, 112, 113, 114, 221].map(P));
    for idn in computed {
        assert!(!DICTIONARY.find(idn).unwrap().attribute.is_protected_in(Phase::Cp4), "{idn}");
    }
}

#[test]
fn defaults_are_loaded_in_cp2_and_cp3_and_not_in_cp4() {
    let other: &[(Idn, &[u16])] = &[(S(104), &[250])];
    let loaded = |mut rig: Rig| (rig.write(S(262), &[3]), rig.parameters.get(S(104)));
    let mut rig = Rig::new();
    rig.write(S(104), &[250]).unwrap();
    assert_eq!(loaded(rig), (Ok(()), 100));
    assert_eq!(loaded(Rig::in_cp3(other)), (Ok(()), 100));
    assert_eq!(loaded(Rig::in_cp4(other)), (Err(0x7012), 250));
}

#[test]
fn an_error_that_no_at_has_told_of_is_not_reset() {
    let errors = |rig: &mut Rig| rig.motion.snapshot().class_1.bits();
    let reset = |rig: &mut Rig| {
        rig.write(S(99), &[3]).unwrap();
        let left = errors(rig);
        rig.write(S(99), &[0]).unwrap();
        left
    };
    for mut rig in [Rig::in_cp3(&[]), Rig::in_cp4(&[])] {
        rig.motion.capture_feedback();
        rig.motion.communication_fault();
        assert_eq!([reset(&mut rig), reset(&mut rig)], [1 << 12; 2], "the record of the AT is from before the error");
        rig.motion.capture_feedback();
        assert_eq!(reset(&mut rig), 0);
    }
    // Before CP3 there is no t4; whoever asks reads S-0-0011.
    let mut rig = Rig::new();
    rig.motion.communication_fault();
    assert_eq!(reset(&mut rig), 0);
}

#[test]
fn every_reason_fits_into_the_text_of_the_service_channel() {
    let parameter = "ramp of the identification in loop ticks";
    let out_of_range =
        |parameter| SettingsError::OutOfRange { parameter, actual: u32::MAX, minimum: u32::MAX, maximum: u32::MAX };
    for reason in [
        SettingsError::Zero { parameter },
        SettingsError::TicksPerCycle { actual: u16::MAX },
        SettingsError::FeedForward { actual: u16::MAX },
        SettingsError::VelocityGain { actual: u32::MAX },
        SettingsError::ModuloOutOfRange,
        SettingsError::PositionScaleOutOfRange,
        SettingsError::VelocityScaleOutOfRange,
        SettingsError::MeasuringRange { actual: u32::MAX, peak: u32::MAX },
        SettingsError::CurrentGain { actual: u32::MAX },
        SettingsError::DeadTime { actual: u32::MAX },
        SettingsError::FluxLinkage,
        SettingsError::LoopTimerCounts { actual: u16::MAX },
        out_of_range(parameter),
        SettingsError::BrakingTime { actual: u64::MAX },
        SettingsError::TooSmooth { actual: u64::MAX },
        SettingsError::FeedrateOverride { actual: u16::MAX },
    ] {
        let text = InvalidSetting { idn: P(4_095), reason: Some(reason) }.to_string();
        assert!((20..=LIVE_TEXT_BYTES).contains(&text.len()), "{}: {text}", text.len());
    }
    let text = InvalidSetting { idn: P(4_095), reason: None }.to_string();
    assert!((20..=LIVE_TEXT_BYTES).contains(&text.len()), "{text}");
}

#[test]
fn the_last_crash_is_told_in_words_and_as_a_record_and_nothing_is_shown_without_one() {
    use crate::crash::{CrashCause, CrashRecord};
    let mut rig = Rig::new();
    let show = |rig: &mut Rig| {
        rig.step(|_, parameters, context| {
            let (mut text, mut list) = (heapless::String::new(), heapless::Vec::new());
            assert_eq!(context.read_text(DICTIONARY.find(P(12)).unwrap(), parameters, &mut text), None);
            context.read_longs(DICTIONARY.find(P(13)).unwrap(), &mut list);
            (text.to_string(), list.to_vec())
        })
    };
    assert_eq!(show(&mut rig), (std::string::String::new(), vec![]));
    let record = CrashRecord { pc: 0x0800_1234, lr: 0x0800_4321, ..CrashRecord::new(CrashCause::ControlStopped) };
    rig.crash = Some((record, "supervision"));
    let text = "control stopped in supervision, pc 08001234 lr 08004321".to_string();
    assert_eq!(show(&mut rig), (text, record.shown().to_vec()));
}
