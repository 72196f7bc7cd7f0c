//! The service channel's behaviour, element by element and error by error.

use crate::sample::DICTIONARY;
use crate::support::{Boundary, Slave};
use sercos::Idn;
use sercos::command::CommandState;
use sercos::data_block::{Location, Selection};
use sercos::error::{Element, ServiceError};
use sercos::service::{ReadPosition, Reply, Step};

const fn s(number: u16) -> Idn {
    Idn::standard(number)
}

#[test]
fn every_element_of_every_data_block_reads_as_the_table_says_however_the_controller_buffers() {
    for boundary in [Boundary::WithLast, Boundary::AfterLast] {
        for segment_words in [1, 2, 3, 7, 16] {
            let mut slave = Slave::new(boundary, segment_words);
            for block in DICTIONARY.select(Selection::All) {
                slave.open(block.idn).unwrap();
                assert_eq!(slave.read(1, 1), Ok(vec![block.idn.0]));
                assert_eq!(text(&slave.read_list(2).unwrap()), block.name);
                let attribute = slave.read(3, 2).unwrap();
                assert_eq!(u32::from(attribute[0]) | u32::from(attribute[1]) << 16, block.attribute.raw_value());
                match block.unit.preferred() {
                    "" => assert_eq!(slave.read(4, 1), Err(ServiceError::NotAvailable(Element::Unit))),
                    unit => assert_eq!(text(&slave.read_list(4).unwrap()), unit),
                }
                for (element, limit) in [(5, block.minimum), (6, block.maximum)] {
                    let words = usize::from(block.fixed_bytes().unwrap_or(2) / 2);
                    match limit {
                        Some(limit) => assert_eq!(value(&slave.read(element, words).unwrap(), block), limit),
                        None => assert_eq!(slave.read(element, 1).unwrap_err().code(), u16::from(element) << 12 | 1),
                    }
                }
                match block.fixed_bytes() {
                    Some(bytes) => {
                        let data = value(&slave.read(7, usize::from(bytes / 2)).unwrap(), block);
                        if block.location == Location::Parameter {
                            assert_eq!(data, block.default, "{}", block.idn);
                        }
                    }
                    None => {
                        let words = slave.read_list(7).unwrap();
                        if let Location::Dictionary(selection) = block.location {
                            let expected: Vec<u16> = DICTIONARY.select(selection).map(|block| block.idn.0).collect();
                            assert_eq!(&words[2..], expected);
                        }
                    }
                }
            }
        }
    }
}

fn text(words: &[u16]) -> String {
    let bytes: Vec<u8> = words[2..].iter().flat_map(|word| word.to_le_bytes()).take(words[0].into()).collect();
    String::from_utf8(bytes).unwrap()
}

fn value(words: &[u16], block: &sercos::data_block::DataBlock) -> i64 {
    block.attribute.value_of(words.iter().rev().fold(0, |value, &word| value << 16 | u64::from(word)))
}

#[test]
fn a_long_list_needs_the_processor_once_a_segment() {
    let mut slave = Slave::in_cp2();
    slave.open(s(17)).unwrap();
    let before = slave.processor_steps;
    let words = slave.read_list(7).unwrap().len();
    // The first step, each time the sender's buffer is used up (the last two words have one of their own), and END.
    assert_eq!(slave.processor_steps - before, (words - 2).div_ceil(16) + 2);
}

#[test]
fn four_byte_data_go_low_word_first() {
    let mut slave = Slave::in_cp2();
    slave.set(s(79), &[0x1234, 0x0056]).unwrap();
    assert_eq!(slave.parameters.get(s(79)), 0x0056_1234);
    slave.open(s(79)).unwrap();
    assert_eq!(slave.read(7, 2), Ok(vec![0x1234, 0x0056]));
}

#[test]
fn lists_of_one_two_and_four_byte_items_survive() {
    let mut slave = Slave::in_cp2();
    for (idn, words) in [
        (s(141), vec![3, 40, u16::from_le_bytes(*b"ab"), u16::from(b'c')]),
        (s(328), vec![6, 32, 15, 0, 7]),
        (Idn::product(7), vec![8, 32, 0x1111, 0x2222, 0x3333, 0x4444]),
    ] {
        slave.set(idn, &words).unwrap();
        slave.open(idn).unwrap();
        assert_eq!(slave.read_list(7), Ok(words), "{idn}");
    }
    assert_eq!(slave.parameters.longs(Idn::product(7)), [0x2222_1111, 0x4444_3333]);
}

#[test]
fn a_text_of_the_drive_is_read_whole_wherever_it_lies() {
    let mut slave = Slave::in_cp2();
    slave.open(s(95)).unwrap();
    assert!(text(&slave.read_list(7).unwrap()).starts_with("a text that never changes, and longer"));
    slave.open(s(30)).unwrap();
    assert_eq!(text(&slave.read_list(7).unwrap()), "text of S-0-0030!");
    slave.open(Idn::product(4)).unwrap();
    let longs = slave.read_list(7).unwrap();
    assert_eq!((longs[0], longs.len()), (128, 66));
    assert_eq!(longs[2..6], [1, 0, 2, 1]);
}

#[test]
fn the_password_locks_what_is_stored_and_nothing_else() {
    let mut slave = Slave::in_cp2();
    slave.drive.locked = true;
    refused(&mut slave, s(104), &[200], 0x7009);
    refused(&mut slave, s(142), &[2, 2, 0x4141], 0x7009);
    slave.set(s(2), &[1000]).unwrap();
    slave.set(s(267), &[2, 2, 0x4141]).unwrap();
    assert_eq!(slave.drive.written_text, b"AA");
    slave.drive.locked = false;
    slave.set(s(104), &[200]).unwrap();
}

#[test]
fn a_text_of_odd_length_survives() {
    let mut slave = Slave::in_cp2();
    slave
        .set(s(142), &[5, 40, u16::from_le_bytes(*b"pr"), u16::from_le_bytes(*b"es"), u16::from_le_bytes(*b"s?")])
        .unwrap();
    assert_eq!(slave.parameters.text(s(142)), "press");
    slave.open(s(142)).unwrap();
    assert_eq!(text(&slave.read_list(7).unwrap()), "press");
}

#[test]
fn element_0_closes_with_any_bits_and_is_never_an_error() {
    for (write, end) in [(false, false), (false, true), (true, false), (true, true)] {
        let mut slave = Slave::in_cp2();
        slave.open(s(2)).unwrap();
        assert_eq!(slave.step(0, write, end, 0xFFFF), Ok(0));
        assert_eq!(slave.server.open_idn(), None);
        assert_eq!(slave.step(0, write, end, 0xFFFF), Ok(0), "closed already");
        assert_eq!(slave.read(7, 1), Err(ServiceError::ChannelNotOpen));
    }
}

#[test]
fn steps_on_a_closed_channel_are_refused() {
    let mut slave = Slave::in_cp2();
    for element in 1..=7 {
        assert_eq!(slave.step(element, false, true, 0).unwrap_err().code(), 0x0001);
    }
    for element in 2..=7 {
        assert_eq!(slave.step(element, true, true, 0).unwrap_err().code(), 0x0001);
    }
}

#[test]
fn an_unknown_idn_is_refused_and_leaves_the_channel_closed() {
    let mut slave = Slave::in_cp2();
    slave.open(s(2)).unwrap();
    assert_eq!(slave.open(s(4000)).unwrap_err().code(), 0x1001);
    assert_eq!(slave.read(7, 1).unwrap_err().code(), 0x0001);
}

#[test]
fn element_1_is_written_in_one_word() {
    let mut slave = Slave::in_cp2();
    assert_eq!(slave.step(1, true, false, 2).unwrap_err().code(), 0x1009);
    assert_eq!(slave.server.open_idn(), None);
}

#[test]
fn element_1_reads_as_the_idn_that_is_open_and_leaves_it_open() {
    let mut slave = Slave::in_cp2();
    for idn in [s(2), Idn::product(19)] {
        slave.open(idn).unwrap();
        assert_eq!(slave.read(1, 1), Ok(vec![idn.0]));
        assert_eq!(slave.read(1, 2).unwrap_err().code(), 0x1003, "it is one word");
        assert_eq!(slave.server.open_idn(), Some(idn));
        assert!(slave.read(7, 1).is_ok());
    }
}

#[test]
fn elements_2_to_6_cannot_be_written() {
    let mut slave = Slave::in_cp2();
    slave.open(s(2)).unwrap();
    for element in 2..=6 {
        assert_eq!(slave.step(element, true, true, 0).unwrap_err().code(), u16::from(element) << 12 | 4);
    }
    slave.open(s(16)).unwrap();
    for (element, code) in [(4, 0x4001), (5, 0x5001), (6, 0x6001)] {
        assert_eq!(slave.step(element, true, true, 0).unwrap_err().code(), code);
    }
}

/// Writes words with END at the last and expects an error that changes nothing.
#[track_caller]
fn refused(slave: &mut Slave, idn: Idn, words: &[u16], code: u16) {
    let before = slave.parameters.clone();
    assert_eq!(slave.set(idn, words).unwrap_err().code(), code);
    assert_eq!(slave.parameters, before);
    assert!(slave.server.open_idn().is_none());
}

#[test]
fn wrong_lengths_are_refused_and_change_nothing() {
    let slave = &mut Slave::in_cp2();
    refused(slave, s(79), &[1], 0x7002);
    refused(slave, s(2), &[1000, 1000], 0x7003);
    refused(slave, s(79), &[1, 2, 3], 0x7003);
    refused(slave, Idn::AT_LIST, &[4], 0x7002);
    refused(slave, Idn::AT_LIST, &[4, 4, 11], 0x7002);
    refused(slave, Idn::AT_LIST, &[4, 4, 11, 51, 40], 0x7003);
    refused(slave, Idn::AT_LIST, &[34, 34, 11], 0x7003);
    refused(slave, Idn::AT_LIST, &[3, 4, 11, 51], 0x7008);
    refused(slave, s(142), &[41, 41], 0x7003);
    refused(slave, s(142), &[0xFFFF, 0xFFFF], 0x7003);
    refused(slave, Idn::product(7), &[4, 4, 1], 0x7002);
    refused(slave, Idn::product(7), &[6, 6, 1, 2, 3], 0x7008);
    refused(slave, Idn::product(7), &[36, 36], 0x7003);
}

#[test]
fn a_write_that_the_drive_cannot_work_with_is_refused_and_leaves_everything_as_it_was() {
    let slave = &mut Slave::in_cp2();
    let written: [(Idn, &[u16], &[u16]); 6] = [
        (s(104), &[250], &[300]),
        (s(79), &[1, 2], &[3, 4]),
        (s(26), &[4, 4, 11, 13], &[2, 2, 12]),
        (s(328), &[4, 4, 1, 2], &[0, 0]),
        (Idn::product(7), &[8, 8, 1, 2, 3, 4], &[4, 4, 5, 6]),
        (s(142), &[2, 2, 0x4141], &[4, 4, 0x4242, 0x4242]),
    ];
    for (idn, first, second) in written {
        slave.set(idn, first).unwrap();
        slave.drive.after = Some(ServiceError::InvalidData);
        refused(slave, idn, second, 0x7008);
        slave.drive.after = None;
        slave.set(idn, second).unwrap();
    }
    // S-0-0127 asks whether it was written: a refused write does not count.
    slave.drive.after = Some(ServiceError::InvalidData);
    refused(slave, s(2), &[4000], 0x7008);
    assert!(!slave.parameters.is_written(s(2)));
}

#[test]
fn the_masters_idea_of_the_maximum_length_is_ignored() {
    let mut slave = Slave::in_cp2();
    slave.set(Idn::AT_LIST, &[2, 0xFFFF, 51]).unwrap();
    slave.set(Idn::AT_LIST, &[0, 0]).unwrap();
    assert_eq!(slave.parameters.list(Idn::AT_LIST), []);
}

#[test]
fn wrong_values_are_refused_and_change_nothing() {
    let slave = &mut Slave::in_cp2();
    refused(slave, s(2), &[499], 0x7006);
    refused(slave, s(2), &[65_001], 0x7007);
    refused(slave, s(46), &[33], 0x7007);
    refused(slave, s(46), &[(-33i16) as u16], 0x7006);
    refused(slave, Idn::AT_LIST, &[2, 2, 36], 0x7008);
    refused(slave, Idn::MDT_LIST, &[2, 2, 51], 0x7008);
    refused(slave, s(26), &[2, 2, 2], 0x7008);
    refused(slave, s(27), &[2, 2, 11], 0x7008);
    refused(slave, s(329), &[2, 2, 16], 0x7008);
    refused(slave, s(301), &[4000], 0x1001);
    refused(slave, s(301), &[11], 0x7008);
    refused(slave, Idn::RESET_CLASS_1_DIAGNOSTIC, &[2], 0x7008);
    let told = [Idn::AT_LIST, Idn::MDT_LIST, s(26), s(27), s(329), s(301), Idn::RESET_CLASS_1_DIAGNOSTIC];
    assert_eq!(slave.drive.not_taken, told, "the drive hears of each 7008H, to give its reason");
    slave.drive.refusal = Some(ServiceError::ProtectedBySettings);
    refused(slave, s(32), &[3], 0x700C);
    refused(slave, s(47), &[3, 0], 0x700C);
    assert!(!slave.drive.values.contains_key(&s(47)));
    // The limits come first: they can be told without asking the drive.
    refused(slave, s(2), &[499], 0x7006);
}

#[test]
fn write_protection_follows_the_phase() {
    let mut slave = Slave::in_cp2();
    refused(&mut slave, s(11), &[0], 0x7004);
    refused(&mut slave, s(3), &[0], 0x7004);
    refused(&mut slave, s(17), &[0, 0], 0x7004);
    refused(&mut slave, Idn::CP4_TRANSITION_CHECK, &[3], 0x7005);
    slave.set(s(32), &[3]).unwrap();
    let mut slave = Slave::in_cp4();
    refused(&mut slave, s(2), &[1000], 0x7005);
    refused(&mut slave, s(32), &[3], 0x7005);
    refused(&mut slave, Idn::CP3_TRANSITION_CHECK, &[3], 0x7005);
    slave.set(s(104), &[200]).unwrap();
}

#[test]
fn a_write_that_began_before_the_phase_switch_is_refused_after_it() {
    let mut slave = Slave::in_cp2();
    slave.configure();
    slave.set(Idn::CP3_TRANSITION_CHECK, &[3]).unwrap();
    slave.open(Idn::MDT_LIST).unwrap();
    for word in [2, 2] {
        slave.step(7, true, false, word).unwrap();
    }
    slave.mst(3).unwrap();
    let before = slave.parameters.clone();
    assert_eq!(slave.step(7, true, true, 47).unwrap_err().code(), 0x7005);
    assert_eq!(slave.parameters, before);
}

#[test]
fn what_comes_in_the_mdt_cannot_be_written_but_what_goes_out_in_the_at_can() {
    let mut slave = Slave::in_cp4();
    refused(&mut slave, s(36), &[1, 0], 0x700A);
    slave.set(s(47), &[1, 0]).unwrap();
    assert_eq!(slave.drive.values[&s(47)], 1);
    slave.set(Idn::product(19), &[7]).unwrap();
    assert_eq!(slave.drive.values[&Idn::product(19)], 7);
}

#[test]
fn an_idn_can_be_reopened_in_the_middle_of_a_transfer() {
    let mut slave = Slave::in_cp2();
    slave.open(s(79)).unwrap();
    slave.step(7, true, false, 0x1111).unwrap();
    slave.open(s(79)).unwrap();
    assert_eq!(slave.read(7, 2), Ok(vec![(3_600_000u32 & 0xFFFF) as u16, (3_600_000u32 >> 16) as u16]));
    slave.step(7, false, false, 0).unwrap();
    slave.write(&[1, 0]).unwrap();
    assert_eq!(slave.parameters.get(s(79)), 1);
    slave.step(3, false, false, 0).unwrap();
    assert_eq!(slave.open(s(2)), Ok(0));
    assert_eq!(slave.read(7, 1), Ok(vec![2000]));
}

#[test]
fn end_anywhere_before_the_last_word_is_too_short_however_the_controller_buffers() {
    for boundary in [Boundary::AfterLast, Boundary::WithLast] {
        for segment_words in [1, 2, 3, 7, 16] {
            let mut slave = Slave::new(boundary, segment_words);
            // A text of 21 words in all, and a list of many segments.
            for (idn, element) in [(s(186), 2), (s(17), 7)] {
                slave.open(idn).unwrap();
                let words = slave.read_list(element).unwrap().len();
                for end in 1..words {
                    let error = slave.read(element, end).unwrap_err();
                    assert_eq!(
                        error.code(),
                        u16::from(element) << 12 | 2,
                        "{boundary:?} {segment_words} {end} of {words}"
                    );
                }
                assert_eq!(slave.read(element, words).unwrap().len(), words);
                let late = slave.read(element, words + 1).unwrap_err();
                assert_eq!(late.code(), u16::from(element) << 12 | 3, "{boundary:?} {segment_words}");
            }
        }
    }
}

#[test]
fn reading_too_few_or_too_many_words_is_refused() {
    for boundary in [Boundary::AfterLast, Boundary::WithLast] {
        let mut slave = Slave::new(boundary, 16);
        slave.open(s(79)).unwrap();
        for (element, code) in [(7u8, 0x7000), (3, 0x3000)] {
            assert_eq!(slave.read(element, 1).unwrap_err().code(), code | 2);
            let too_many = (0..3).map(|_| slave.step(element, false, false, 0)).find_map(Result::err);
            assert_eq!(too_many.map(ServiceError::code), Some(code | 3));
            slave.step(element, false, true, 0).unwrap_err();
            assert_eq!(slave.read(element, 2).unwrap().len(), 2);
        }
    }
}

#[test]
fn after_an_error_the_rest_of_the_transfer_is_refused_alike_and_the_next_one_is_not() {
    let mut slave = Slave::in_cp2();
    slave.open(s(11)).unwrap();
    for _ in 0..3 {
        assert_eq!(slave.step(7, true, false, 1).unwrap_err().code(), 0x7004);
    }
    assert_eq!(slave.step(7, true, true, 1).unwrap_err().code(), 0x7004);
    assert_eq!(slave.read(7, 1), Ok(vec![0]));
}

#[test]
fn the_last_words_of_a_write_that_is_too_long_are_no_write_of_their_own() {
    let mut slave = Slave::in_cp2();
    slave.open(s(2)).unwrap();
    let mut word = |new_transfer, end, info| {
        let step = Step { element: 7, write: true, end, info, new_transfer, position: ReadPosition::Within };
        match slave.server.step(step, &mut slave.parameters, &mut slave.drive) {
            Reply::Error(error) => Err(error.code()),
            _ => Ok(slave.parameters.get(s(2))),
        }
    };
    let before = word(true, false, 3_000).unwrap();
    assert_eq!(word(false, false, 0), Err(0x7003));
    // The controller calls each step behind a refused one a new transfer.
    assert_eq!([word(true, false, 0), word(true, false, 0), word(true, true, 1_000)], [Err(0x7003); 3]);
    assert_eq!(word(true, false, 0), Ok(before), "nothing was written, and the next transfer begins");
}

#[test]
fn a_slow_command_shows_7_until_the_drive_tells_its_end() {
    let mut slave = Slave::in_cp2();
    slave.drive.slow = true;
    let reset = Idn::RESET_CLASS_1_DIAGNOSTIC;
    slave.set(reset, &[3]).unwrap();
    assert_eq!(slave.open(reset), Ok(7));
    assert_eq!(slave.read(7, 1), Ok(vec![7]));
    assert!(!slave.server.command_change());
    slave.server.command_progress(reset, CommandState::Failed);
    assert_eq!(slave.open(reset), Ok(0xF));
    assert!(slave.server.command_change());
    slave.write(&[0]).unwrap();
    assert_eq!(slave.open(reset), Ok(0));
    assert!(!slave.server.command_change());
}

#[test]
fn a_check_that_fails_lists_its_findings_and_permits_nothing() {
    let mut slave = Slave::in_cp2();
    slave.configure();
    slave.set(s(7), &[65_000]).unwrap();
    slave.set(s(9), &[2]).unwrap();
    slave.set(Idn::CP3_TRANSITION_CHECK, &[3]).unwrap();
    assert_eq!(slave.open(Idn::CP3_TRANSITION_CHECK), Ok(0xF));
    slave.open(s(21)).unwrap();
    assert_eq!(slave.read_list(7).unwrap()[2..], [7, 9]);
    assert!(slave.mst(3).is_err());
    assert_eq!(slave.drive.machine.interface_status().raw_value(), 0x0102);
}

#[test]
fn a_checked_parameter_that_is_rewritten_voids_the_check() {
    let mut slave = Slave::in_cp2();
    slave.configure();
    slave.set(Idn::CP3_TRANSITION_CHECK, &[3]).unwrap();
    slave.set(Idn::CP3_TRANSITION_CHECK, &[0]).unwrap();
    slave.set(s(104), &[200]).unwrap();
    assert!(slave.drive.machine.is_permitted(), "not a checked parameter");
    slave.set(s(6), &[93]).unwrap();
    assert!(!slave.drive.machine.is_permitted());
}

/// One step without the controller's hint that a transfer is new.
fn bare(slave: &mut Slave, element: u8, write: bool, end: bool, info: u16) -> Reply {
    let step = Step { element, write, end, info, new_transfer: false, position: ReadPosition::Within };
    slave.server.step(step, &mut slave.parameters, &mut slave.drive)
}

#[test]
fn a_transfer_after_end_is_new_without_the_controllers_hint() {
    let mut slave = Slave::in_cp2();
    slave.open(s(2)).unwrap();
    for value in [1000, 3000] {
        assert_eq!(bare(&mut slave, 7, true, true, value), Reply::Accept { info: 0 });
        assert_eq!(slave.parameters.get(s(2)), u32::from(value));
    }
    for _ in 0..2 {
        assert_eq!(bare(&mut slave, 7, false, true, 0), Reply::Send(heapless::Vec::from_slice(&[3000]).unwrap()));
    }
}

#[test]
fn words_for_one_idn_never_reach_another() {
    let mut slave = Slave::in_cp2();
    slave.open(s(79)).unwrap();
    assert_eq!(bare(&mut slave, 7, true, false, 0x1111), Reply::Accept { info: 0 });
    assert_eq!(bare(&mut slave, 1, true, true, 103), Reply::Accept { info: 0 });
    assert_eq!(bare(&mut slave, 7, true, true, 0x0022), Reply::Error(ServiceError::TooShort(Element::Data)));
    assert_eq!(slave.parameters.get(s(103)), 3_600_000);
}

#[test]
fn a_check_that_was_not_cancelled_does_not_hold_the_change_bit_in_the_next_phase() {
    let mut slave = Slave::in_cp2();
    slave.configure();
    slave.set(Idn::CP3_TRANSITION_CHECK, &[3]).unwrap();
    assert!(slave.server.command_change());
    slave.mst(3).unwrap();
    assert!(!slave.server.command_change());
}

#[test]
fn the_channel_stays_open_from_cp2_to_cp3_and_a_new_run_up_closes_it() {
    let mut slave = Slave::in_cp2();
    slave.configure();
    slave.set(Idn::CP3_TRANSITION_CHECK, &[3]).unwrap();
    slave.open(s(2)).unwrap();
    slave.mst(3).unwrap();
    assert_eq!(slave.read(7, 1), Ok(vec![2000]));
    slave.mst(0).unwrap();
    assert_eq!(slave.server.open_idn(), None);
}

#[test]
fn no_segment_is_longer_than_the_server_was_told_and_none_is_empty() {
    for (words, longest) in [(0, 1), (1, 1), (3, 3), (16, 16), (17, 16)] {
        let mut slave = Slave::new(Boundary::WithLast, words);
        for phase in 0..=2 {
            slave.mst(phase).unwrap();
        }
        slave.open(s(17)).unwrap();
        match bare(&mut slave, 7, false, false, 0) {
            Reply::Send(segment) => assert_eq!(segment.len(), longest, "{words}"),
            other => panic!("{other:?}"),
        }
    }
}

#[test]
fn the_server_tells_what_is_open_and_how_its_commands_are() {
    let mut slave = Slave::in_cp2();
    assert_eq!(slave.server.open_idn(), None);
    let reset = Idn::RESET_CLASS_1_DIAGNOSTIC;
    slave.open(reset).unwrap();
    assert_eq!(slave.server.open_idn(), Some(reset));
    slave.write(&[3]).unwrap();
    assert_eq!(slave.server.command_status(reset), sercos::command::CommandStatus::Executed);
}

#[test]
fn lists_and_texts_may_be_exactly_as_long_as_their_maximum() {
    let mut slave = Slave::in_cp2();
    let text: Vec<u16> = [40, 40].into_iter().chain([0x4141; 20]).collect();
    slave.set(s(142), &text).unwrap();
    assert_eq!(slave.parameters.text(s(142)).len(), 40);
    let list: Vec<u16> = [32, 32].into_iter().chain([51; 16]).collect();
    slave.set(Idn::AT_LIST, &list).unwrap();
    assert_eq!(slave.parameters.list(Idn::AT_LIST).len(), 16);
}

#[test]
fn an_error_says_its_code() {
    assert_eq!(ServiceError::TooShort(Element::Data).to_string(), "service channel error 7002H");
}
