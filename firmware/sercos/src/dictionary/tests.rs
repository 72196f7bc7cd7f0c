use super::*;
use crate::attribute::{Format, Length};
use crate::data_block::Location;
use crate::phase::Phase;

#[test]
fn every_row_is_consistent() {
    for block in DICTIONARY {
        let idn = block.idn;
        let attribute = block.attribute;
        assert_eq!(find(idn).map(|found| found.idn), Some(idn));
        assert_eq!(attribute.conversion_factor(), 1, "{idn}");
        assert!(!block.name.is_empty() && block.name.is_ascii() && block.name.len() <= 60, "{idn}: {}", block.name);
        assert!(block.unit.preferred().is_ascii(), "{idn}");
        assert!(block.documentation.ends_with('.'), "{idn}: {}", block.documentation);
        assert_eq!(attribute.command(), block.location == Location::Command, "{idn}");
        match block.location {
            Location::Command => assert_eq!(attribute.length(), Length::Two, "{idn}"),
            Location::Dictionary(_) => {
                assert_eq!((attribute.format(), attribute.is_read_only()), (Format::Idn, true), "{idn}")
            }
            _ => {}
        }
        // What the service channel can handle.
        match attribute.length() {
            // Controls of the nineties know no eight bytes (sercos2.md 3.7).
            Length::Two | Length::Four => {}
            Length::ListOfBytes => assert_eq!(attribute.format(), Format::Text, "{idn}"),
            Length::ListOfTwo | Length::ListOfFour => assert_ne!(attribute.format(), Format::Text, "{idn}"),
            length => panic!("{idn}: {length:?}"),
        }
        for limit in [block.minimum, block.maximum].into_iter().flatten() {
            let raw = match attribute.length() {
                Length::Two => limit as u64 & 0xFFFF,
                _ => limit as u64 & 0xFFFF_FFFF,
            };
            assert_eq!(attribute.value_of(raw), limit, "{idn}: a limit does not fit the format");
            assert!(block.fixed_bytes().is_some(), "{idn}: a list has no limits");
        }
        if block.location == Location::Parameter && block.fixed_bytes().is_some() {
            assert!(block.minimum.is_none_or(|minimum| block.default >= minimum), "{idn}");
            assert!(block.maximum.is_none_or(|maximum| block.default <= maximum), "{idn}");
        }
        assert!(
            block.cyclic == Cyclic::Never || matches!(block.fixed_bytes(), Some(2 | 4)),
            "{idn}: only two and four bytes are cyclic"
        );
        assert!(block.bits == Bits::Never || block.fixed_bytes() == Some(2), "{idn}: bits are those of a word");
        assert!(
            block.bits != Bits::Target || !attribute.protected_in_cp4(),
            "{idn}: what a bit sets can be written in CP4"
        );
        assert!(!block.stored || (block.location == Location::Parameter && !attribute.is_read_only()), "{idn}");
        assert!(block.needed_for == NeededFor::Neither || block.location == Location::Parameter, "{idn}");
    }
}

#[test]
fn the_attributes_that_masters_know_by_heart_are_those_of_a_real_drive() {
    for (number, attribute) in [
        (1, 0x6011_0001u32),
        (3, 0x7011_0001),
        (11, 0x7001_0001),
        (15, 0x6001_0001),
        (16, 0x6055_0001),
        (17, 0x7055_0001),
        (26, 0x0055_0001),
        (30, 0x7044_0001),
        (32, 0x4001_0001),
        (46, 0x4021_0001),
        (47, 0x0422_0001),
        (51, 0x7422_0001),
        (53, 0x7422_0001),
        (77, 0x4011_0001),
        (78, 0x4021_0001),
        (79, 0x4012_0001),
        (80, 0x0121_0001),
        (84, 0x7121_0001),
        (86, 0x4001_0001),
        (93, 0x4011_0001),
        (94, 0x4021_0001),
        (96, 0x7031_0001),
        (97, 0x0001_0001),
        (99, 0x0009_0001),
        (103, 0x4422_0001),
        (109, 0x4312_0001),
        (113, 0x4412_0001),
        (121, 0x4012_0001),
        (122, 0x4012_0001),
        (123, 0x4422_0001),
        (127, 0x6009_0001),
        (128, 0x5009_0001),
        (139, 0x6009_0001),
        (144, 0x7001_0001),
        (145, 0x0001_0001),
        (147, 0x0001_0001),
        (148, 0x3009_0001),
        (149, 0x3009_0001),
        (160, 0x4001_0001),
        (161, 0x4011_0001),
        (162, 0x4021_0001),
        (191, 0x0009_0001),
        (256, 0x7012_0001),
        (262, 0x0009_0001),
        (265, 0x0011_0001),
        (267, 0x0044_0001),
        (277, 0x4001_0001),
        (301, 0x0011_0001),
        (328, 0x0015_0001),
        (330, 0x7001_0001),
        (375, 0x7035_0001),
        (399, 0x7055_0001),
        (403, 0x7001_0001),
        (141, 0x0044_0001),
        (188, 0x7055_0001),
        (292, 0x7035_0001),
        (390, 0x7031_0001),
    ] {
        let block = find(Idn::standard(number)).unwrap();
        assert_eq!(block.attribute.raw_value(), attribute, "{}", block.idn);
    }
}

#[test]
fn the_amplifiers_peak_current_is_as_writable_as_the_motors_for_the_builder_chooses_both() {
    // A real drive has 7312_0001H: its amplifier is built in.
    let [motor, amplifier] = [109, 110].map(|number| find(Idn::standard(number)).unwrap());
    assert_eq!(amplifier.attribute, motor.attribute);
    assert_eq!(amplifier.attribute.raw_value(), 0x4312_0001);
    assert!(amplifier.stored);
}

#[test]
fn the_idn_lists_hold_what_the_reference_asks_for() {
    let numbers = |selection| -> std::vec::Vec<u16> {
        let selected: std::vec::Vec<u16> = select(selection).map(|block| block.idn.0).collect();
        let listed: std::vec::Vec<u16> = list(selection).iter().map(|idn| idn.0).collect();
        assert_eq!(listed, selected, "{selection:?}");
        selected
    };
    assert_eq!(numbers(Selection::NeededForCp3), [1, 2, 6, 7, 8, 9, 10, 15, 16, 24, 89]);
    assert_eq!(
        numbers(Selection::Commands),
        [99, 127, 128, 139, 148, 149, 170, 191, 262, 447, 0x80DC, 0x80E0, 0x80E1, 0x80E2]
    );
    assert_eq!(
        numbers(Selection::ConfigurableInMdt),
        [36, 37, 38, 39, 47, 48, 80, 81, 82, 83, 91, 92, 136, 137, 138, 145, 193, 258, 259, 260, 282, 346, 349]
    );
    assert_eq!(
        numbers(Selection::ConfigurableInAt),
        [
            11, 12, 13, 14, 40, 51, 53, 84, 129, 130, 131, 132, 133, 144, 179, 181, 182, 189, 347, 380, 383, 384, 390,
            403, 430, 437, 0x8013, 0x80A0
        ]
    );
    assert_eq!(numbers(Selection::BitTargets), [400, 405, 406, 407, 0x8013]);
    assert!(numbers(Selection::ChangeableInCp4).contains(&104));
    assert!(!numbers(Selection::ChangeableInCp4).contains(&32));
    assert!(numbers(Selection::NeededForCp4).contains(&32));
    assert_eq!(numbers(Selection::All).len(), DICTIONARY.len());
    assert!(!numbers(Selection::Backup).contains(&2));
}

#[test]
fn what_a_backup_of_another_drive_holds_takes_its_own_value_and_no_other() {
    for (number, value) in [(208, 0), (269, 1)] {
        let block = find(Idn::standard(number)).unwrap();
        assert_eq!((block.minimum, block.maximum, block.default), (Some(value), Some(value), value));
        assert!([Phase::Cp2, Phase::Cp3, Phase::Cp4].iter().all(|&phase| !block.attribute.is_protected_in(phase)));
    }
}

#[test]
fn no_at_may_be_asked_for_earlier_than_the_drive_can_send_it() {
    let [t1_min, t1] = [3, 6].map(|number| find(Idn::standard(number)).unwrap());
    assert_eq!((t1.minimum, t1.default), (Some(t1_min.default), t1_min.default));
}

#[test]
fn the_numbers_that_other_makers_controls_write_blindly_are_free() {
    // P-0-0005: the language of DIAX and ECODRIVE.
    assert!(find(Idn::product(5)).is_none());
}

#[test]
fn an_unknown_idn_is_not_found() {
    assert!(find(Idn::standard(0)).is_none());
    assert!(find(Idn(0x1002)).is_none(), "parameter set 1 does not exist");
    assert!(find(Idn::product(4095)).is_none());
}
