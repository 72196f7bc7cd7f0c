use super::*;
use crate::sample::DICTIONARY;
use proptest::prelude::*;

const CAPABILITIES: Capabilities =
    Capabilities { bit_rate: BitRate::Mbit2, operation_modes: &[1, 2, 3, 11], feedback_2: false };

fn set(parameters: &mut Parameters, number: u16, value: u32) {
    parameters.set(Idn::standard(number), value.into()).unwrap();
    parameters.mark_written(Idn::standard(number));
}

/// What the recorded master writes to drive 1.
fn recorded() -> Parameters {
    let mut parameters = Parameters::new(&DICTIONARY);
    for (number, value) in [(1, 2000), (2, 2000), (6, 92), (89, 1782), (8, 1965), (7, 1698), (9, 1), (10, 32), (15, 7)]
    {
        set(&mut parameters, number, value);
    }
    parameters.set_list(Idn::AT_LIST, &[Idn::standard(11), Idn::standard(51), Idn::product(19)]).unwrap();
    parameters.set_list(Idn::MDT_LIST, &[Idn::standard(36)]).unwrap();
    parameters
}

fn findings(parameters: &Parameters) -> std::vec::Vec<(u16, Reason)> {
    match check_cp3(parameters, &CAPABILITIES) {
        Ok(_) => std::vec![],
        Err(invalid) => invalid.findings().iter().map(|found| (found.idn.0, found.reason)).collect(),
    }
}

#[track_caller]
fn finds(change: impl FnOnce(&mut Parameters), number: u16, reason: Reason) {
    let mut parameters = recorded();
    change(&mut parameters);
    assert_eq!(findings(&parameters), [(number, reason)]);
}

#[test]
fn no_check_has_more_to_find_than_there_is_room_for() {
    for selection in [Selection::NeededForCp3, Selection::NeededForCp4] {
        assert!(DICTIONARY.select(selection).count() <= FINDINGS);
    }
}

#[test]
fn the_recorded_values_of_all_four_drives_pass() {
    for (t1, position) in [(92, 1), (336, 9), (580, 17), (824, 25)] {
        let mut parameters = recorded();
        set(&mut parameters, 6, t1);
        set(&mut parameters, 9, position);
        let (configuration, _) = check_cp3(&parameters, &CAPABILITIES).unwrap();
        assert_eq!(u32::from(configuration.t1_us), t1);
        assert_eq!(u32::from(configuration.record_position_bytes), position);
        assert_eq!((configuration.cycle_us, configuration.control_unit_cycle_us), (2000, 2000));
        assert_eq!((configuration.t2_us, configuration.t3_us, configuration.t4_us), (1782, 1965, 1698));
        let at: std::vec::Vec<_> =
            configuration.at.iter().map(|datum| (datum.idn.0, datum.offset_bytes, datum.bytes)).collect();
        assert_eq!(at, [(11, 0, 2), (51, 2, 4), (0x8013, 6, 2)]);
        assert_eq!((configuration.at_data_bytes(), configuration.mdt_data_bytes()), (8, 4));
    }
}

#[test]
fn the_tight_ring_passes() {
    let mut parameters = recorded();
    set(&mut parameters, 6, 17);
    assert_eq!(findings(&parameters), []);
}

#[test]
fn the_press_ring_passes_with_any_standard_telegram() {
    for telegram_type in [0, 1, 2, 3, 4, 5, 6] {
        let mut parameters = Parameters::new(&DICTIONARY);
        let length = 48 * 12;
        for (number, value) in
            [(2, 10_000), (6, 150), (89, 7_000), (9, 565), (10, length), (15, telegram_type), (8, 9_900), (7, 9_000)]
        {
            set(&mut parameters, number, value);
        }
        let (configuration, _) = check_cp3(&parameters, &CAPABILITIES).unwrap();
        assert_eq!(configuration.control_unit_cycle_us, 10_000, "S-0-0001 was not written");
        assert_eq!(parameters.get(Idn::standard(1)), 10_000);
    }
}

#[test]
fn what_the_master_must_write_is_asked_for() {
    let expected = [2, 6, 9, 10, 89].map(|number| (number, Reason::NeverWritten));
    let mut parameters = recorded();
    parameters.forget_written();
    assert_eq!(findings(&parameters), expected);
}

#[test]
fn the_control_unit_cycle_is_a_multiple_of_the_communication_cycle() {
    finds(|p| set(p, 1, 3000), 1, Reason::NotAMultiple);
    let mut parameters = recorded();
    set(&mut parameters, 2, 2250);
    set(&mut parameters, 1, 4500);
    assert_eq!(findings(&parameters), []);
}

#[test]
fn records_lie_on_words_inside_the_mdt() {
    finds(|p| set(p, 9, 2), 9, Reason::WrongParity);
    finds(|p| set(p, 10, 33), 10, Reason::WrongParity);
    finds(|p| set(p, 9, 27), 9, Reason::RecordOutsideMdt);
    finds(|p| set(p, 9, 65_531), 9, Reason::RecordOutsideMdt);
}

#[test]
fn telegram_types_and_lists_must_fit_the_drive() {
    for second_encoder in [11, 12, 13] {
        finds(|p| set(p, 15, second_encoder), 15, Reason::NoFeedback2);
        let mut parameters = recorded();
        set(&mut parameters, 15, second_encoder);
        let capabilities = Capabilities { feedback_2: true, ..CAPABILITIES };
        assert!(check_cp3(&parameters, &capabilities).is_ok());
    }
    for unknown in [8, 9, 10, 14, 15, 16] {
        finds(|p| set(p, 15, unknown), 15, Reason::NotSupported);
    }
    let feedback_2 = [Idn::POSITION_FEEDBACK_2];
    finds(|p| p.set_list(Idn::AT_LIST, &feedback_2).unwrap(), 16, Reason::NoFeedback2);
    let twice = [Idn::VELOCITY_COMMAND, Idn::VELOCITY_COMMAND];
    finds(|p| p.set_list(Idn::MDT_LIST, &twice).unwrap(), 24, Reason::NotConfigurable(Idn::VELOCITY_COMMAND));
}

#[test]
fn own_slots_are_checked_against_own_durations() {
    // AT of 8 bytes: 80 us; tATMT 10 us.
    finds(|p| set(p, 6, 1_693), 89, Reason::TooEarly { earliest_ns: 1_783_000 });
    // MDT of 32 bytes: 176 us; tMTSY 10 us.
    finds(
        |p| {
            set(p, 89, 1_815);
            set(p, 8, 0);
        },
        89,
        Reason::TooLate { latest_ns: 1_814_000 },
    );
    finds(|p| set(p, 7, 1_971), 7, Reason::TooLate { latest_ns: 1_970_000 });
    finds(|p| set(p, 8, 2_001), 8, Reason::TooLate { latest_ns: 2_000_000 });
}

#[test]
fn t3_is_refused_only_while_the_mdt_is_on_the_fibre() {
    for (t3, passes) in [(0, true), (1_782, true), (1_783, false), (1_959, false), (1_960, true), (2_000, true)] {
        let mut parameters = recorded();
        set(&mut parameters, 8, t3);
        assert_eq!(check_cp3(&parameters, &CAPABILITIES).is_ok(), passes, "{t3}");
    }
}

fn check_4(parameters: &Parameters) -> std::vec::Vec<(u16, Reason)> {
    let (configuration, _) = check_cp3(&recorded(), &CAPABILITIES).unwrap();
    match check_cp4(parameters, &CAPABILITIES, &configuration, true) {
        Ok(_) => std::vec![],
        Err(invalid) => invalid.findings().iter().map(|found| (found.idn.0, found.reason)).collect(),
    }
}

#[test]
fn cp4_needs_modes_with_command_values_and_known_scaling() {
    assert_eq!(check_4(&recorded()), []);
    for (number, value, reason) in [
        (32, 0, Reason::NotSupported),
        (32, 4, Reason::NotSupported),
        (32, 3, Reason::CommandValueMissing(Idn::POSITION_COMMAND)),
        (33, 11, Reason::CommandValueMissing(Idn::POSITION_COMMAND)),
        (35, 1, Reason::CommandValueMissing(Idn::TORQUE_COMMAND)),
        (284, 3, Reason::CommandValueMissing(Idn::POSITION_COMMAND)),
        (287, 4, Reason::NotSupported),
        (44, 0, Reason::NotSupported),
        (44, 3, Reason::NotSupported),
        (44, 0x12, Reason::NotSupported),
        (44, 0x82, Reason::NotSupported),
        (44, 0x21, Reason::NotSupported),
        (44, 0x61, Reason::NotSupported),
        (76, 0, Reason::NotSupported),
        (76, 3, Reason::NotSupported),
        (76, 0x12, Reason::NotSupported),
        (76, 0x22, Reason::NotSupported),
    ] {
        let mut parameters = recorded();
        set(&mut parameters, number, value);
        assert_eq!(check_4(&parameters), [(number, reason)]);
    }
    for (number, value) in [(44, 1), (44, 0x29), (44, 0x42), (44, 0x69), (76, 1), (76, 0x42), (76, 0x49), (76, 0xC2)] {
        let mut parameters = recorded();
        set(&mut parameters, number, value);
        assert_eq!(check_4(&parameters), [], "S-0-{number:04} = {value:X}");
    }
    let mut parameters = recorded();
    set(&mut parameters, 76, 0x8A);
    assert_eq!(check_4(&parameters), []);
    set(&mut parameters, 103, 0);
    assert_eq!(check_4(&parameters), [(103, Reason::OutOfRange)]);
}

#[test]
fn cp4_needs_synchronisation() {
    let (configuration, _) = check_cp3(&recorded(), &CAPABILITIES).unwrap();
    let refused = check_cp4(&recorded(), &CAPABILITIES, &configuration, false).unwrap_err();
    assert!(refused.not_synchronised && refused.findings().is_empty());
}

proptest! {
    #[test]
    fn whatever_passes_the_check_fits_into_the_cycle(
        cycle in 2u32..=260, t1 in 12u32..3_000, t2 in 0u32..3_000, t3 in 0u32..3_000, t4 in 0u32..3_000,
        position in 1u32..100, length in 4u32..200, telegram_type in 0u32..8, rate in 0usize..4,
    ) {
        let rate = [BitRate::Mbit2, BitRate::Mbit4, BitRate::Mbit8, BitRate::Mbit16][rate];
        let mut parameters = recorded();
        for (number, value) in [
            (2, cycle * 250), (1, cycle * 250), (6, t1), (89, t2), (8, t3), (7, t4),
            (9, position | 1), (10, length & !1), (15, telegram_type),
        ] {
            set(&mut parameters, number, value);
        }
        let capabilities = Capabilities { bit_rate: rate, ..CAPABILITIES };
        if let Ok((configuration, _)) = check_cp3(&parameters, &capabilities) {
            let at_end = t1 * 1_000 + rate.longest_nanoseconds(duration::at_bytes(configuration.at_data_bytes()));
            let mdt_end = t2 * 1_000 + rate.longest_nanoseconds(duration::mdt_bytes(configuration.mdt_length_bytes));
            prop_assert!(at_end < t2 * 1_000 && mdt_end < cycle * 250_000 && t4 < cycle * 250 && t3 <= cycle * 250);
            prop_assert!(t3 <= t2 || t3 * 1_000 > mdt_end);
            let record_end = configuration.record_position_bytes + 3 + configuration.mdt_data_bytes();
            prop_assert!(record_end <= configuration.mdt_length_bytes);
        }
    }
}

#[test]
fn every_finding_fits_into_the_text_of_the_service_channel_and_every_reason_has_a_code_of_its_own() {
    use std::string::ToString;
    let mut codes = std::collections::BTreeSet::new();
    for reason in Reason::ALL {
        let text = Invalid { idn: Idn(0xFFFF), reason }.to_string();
        assert!(text.len() <= crate::capacity::LIVE_TEXT_BYTES, "{text}");
        assert!(codes.insert(reason.code()), "{reason}");
    }
    let longest = Reason::TooLate { latest_ns: u32::MAX };
    assert!(Invalid { idn: Idn(0xFFFF), reason: longest }.to_string().len() <= crate::capacity::LIVE_TEXT_BYTES);
}
