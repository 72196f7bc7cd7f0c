use super::*;
use sercos::Idn;
use sercos::Phase;
use sercos::attribute::{Format, Length};
use sercos::data_block::NeededFor;
use sercos::data_block::{Bits, Cyclic, Location, Selection};
use sercos::diagnostic::Class2;
use sercos::parameters::Parameters;
use sercos::unit::Unit;

use crate::signal::word::{SourceBit, Word};

#[test]
fn every_row_is_consistent() {
    for block in DICTIONARY.blocks() {
        let idn = block.idn;
        let attribute = block.attribute;
        assert_eq!(DICTIONARY.find(idn).map(|found| found.idn), Some(idn));
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
        let block = DICTIONARY.find(Idn::standard(number)).unwrap();
        assert_eq!(block.attribute.raw_value(), attribute, "{}", block.idn);
    }
}

#[test]
fn a_rating_of_the_amplifier_is_read_and_neither_written_nor_saved() {
    let [motor, amplifier] = [109, 110].map(|number| DICTIONARY.find(Idn::standard(number)).unwrap());
    // As a real drive has them.
    assert_eq!((motor.attribute.raw_value(), amplifier.attribute.raw_value()), (0x4312_0001, 0x7312_0001));
    let ratings: std::vec::Vec<Idn> =
        DICTIONARY.blocks().iter().filter(|block| is_rating(block)).map(|block| block.idn).collect();
    let expected = [110, 112, 200, 203].map(Idn::standard).into_iter();
    let expected = expected.chain((100..=106).chain([131, 234, 239]).map(Idn::product));
    assert_eq!(ratings, expected.collect::<std::vec::Vec<_>>());
    for idn in ratings {
        let block = DICTIONARY.find(idn).unwrap();
        assert!(block.attribute.is_read_only() && !block.is_in(Selection::Backup), "{idn}");
    }
}

#[test]
fn the_idn_lists_hold_what_the_reference_asks_for() {
    let numbers = |selection| -> std::vec::Vec<u16> {
        let selected: std::vec::Vec<u16> = DICTIONARY.select(selection).map(|block| block.idn.0).collect();
        let listed: std::vec::Vec<u16> = DICTIONARY.list(selection).iter().map(|idn| idn.0).collect();
        assert_eq!(listed, selected, "{selection:?}");
        selected
    };
    assert_eq!(numbers(Selection::NeededForCp3), [1, 2, 6, 7, 8, 9, 10, 15, 16, 24, 89]);
    assert_eq!(
        numbers(Selection::Commands),
        [99, 127, 128, 139, 148, 149, 170, 191, 262, 263, 264, 293, 447, 0x80DC, 0x80E0, 0x80E1, 0x80E2]
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
    assert_eq!(numbers(Selection::All).len(), DICTIONARY.blocks().len());
    assert!(!numbers(Selection::Backup).contains(&2));
}

#[test]
fn what_a_backup_of_another_drive_holds_takes_its_own_value_and_no_other() {
    let block = DICTIONARY.find(Idn::standard(208)).unwrap();
    assert_eq!((block.minimum, block.maximum, block.default), (Some(0), Some(0), 0));
    assert!([Phase::Cp2, Phase::Cp3, Phase::Cp4].iter().all(|&phase| !block.attribute.is_protected_in(phase)));
}

#[test]
fn no_at_may_be_asked_for_earlier_than_the_drive_can_send_it() {
    let [t1_min, t1] = [3, 6].map(|number| DICTIONARY.find(Idn::standard(number)).unwrap());
    assert_eq!((t1.minimum, t1.default), (Some(t1_min.default), t1_min.default));
}

#[test]
fn the_numbers_that_other_makers_controls_write_blindly_are_free() {
    // P-0-0005: the language of DIAX and ECODRIVE.
    assert!(DICTIONARY.find(Idn::product(5)).is_none());
}

#[test]
fn an_unknown_idn_is_not_found() {
    assert!(DICTIONARY.find(Idn::standard(0)).is_none());
    assert!(DICTIONARY.find(Idn(0x1002)).is_none(), "parameter set 1 does not exist");
    assert!(DICTIONARY.find(Idn::product(4095)).is_none());
}

/// What follows from the accessor must fit the row: a number is read as a number, a text as a text.
#[test]
fn every_accessor_fits_the_format_of_its_row() {
    for block in DICTIONARY.blocks() {
        let format = (block.attribute.length(), block.attribute.format());
        let fits = match access_of(block) {
            Access::Parameter => true,
            Access::Rating(_) => block.attribute.is_read_only() && block.default == 0 && !block.stored,
            Access::Limit(limit) => limit.idn() == block.idn && block.minimum.is_some() && block.maximum.is_some(),
            Access::Feedback(_) | Access::Command(_) | Access::Number(_) => {
                matches!(format.0, Length::Two | Length::Four)
            }
            Access::Word(_) | Access::Bit(..) | Access::Enable(_) => format.0 == Length::Two,
            Access::Text(_) => format == (Length::ListOfBytes, Format::Text),
            Access::List(_) => format == (Length::ListOfTwo, Format::Idn),
            Access::Words(_) => format.0 == Length::ListOfTwo,
            Access::Longs(_) => format.0 == Length::ListOfFour,
            Access::Procedure(procedure) => procedure.idn() == block.idn && block.attribute.command(),
        };
        assert!(fits, "{}: {:?} with {format:?}", block.idn, access_of(block));
    }
}

#[test]
fn every_data_block_that_the_table_lets_a_master_configure_can_be_carried() {
    for block in DICTIONARY.select(Selection::ConfigurableInAt) {
        assert!(access_of(block).feedback().is_some(), "{} in the AT", block.idn);
    }
    for block in DICTIONARY.select(Selection::ConfigurableInMdt) {
        assert!(access_of(block).command().is_some(), "{} in the MDT", block.idn);
    }
}

#[test]
fn every_data_block_that_the_table_lets_a_bit_show_has_a_source() {
    for block in DICTIONARY.select(Selection::BitSources) {
        assert!(source(block.idn).is_some(), "{}", block.idn);
    }
    assert_eq!(source(Idn::standard(2)), None);
    assert_eq!(source(Idn::product(11)), None);
    for block in DICTIONARY.select(Selection::BitTargets) {
        assert_ne!(source(block.idn).unwrap().target(0), 0, "{}", block.idn);
    }
}

#[test]
fn every_warning_has_a_data_block_of_its_own_and_stands_in_the_manual() {
    let manual = DICTIONARY.find(Idn::standard(12)).unwrap().documentation;
    // A drive without a fan of its own has no cooling warning; bit 15 stands for S-0-0181.
    for warning in Class2::all().difference(Class2::COOLING | Class2::MANUFACTURER).iter() {
        let bit = warning.bits().trailing_zeros() as u16;
        let idn = Idn::standard(310 + bit);
        assert!(DICTIONARY.find(idn).is_some_and(|block| block.is_in(Selection::BitSources)), "{idn}");
        assert_eq!(source(idn).unwrap().bit(0), Some(SourceBit { word: Word::Class2, mask: warning.bits() }));
        let mut words = manual.split([' ', ':', ',']);
        assert!(words.any(|word| word == std::format!("{bit}")), "bit {bit} is not in \"{manual}\"");
    }
}

#[test]
fn what_the_table_calls_the_default_is_what_the_default_scaling_makes() {
    let parameters = Parameters::new(&DICTIONARY);
    for block in DICTIONARY.blocks() {
        assert_eq!(block.scaled_attribute(&parameters), block.attribute, "{}", block.idn);
        assert_eq!(block.scaled_unit(&parameters), block.unit.preferred(), "{}", block.idn);
    }
}

/// Their places in the memory of the parameters are seen through the others'.
#[test]
fn every_stored_data_block_has_a_place_of_its_own_and_counts_in_the_checksum() {
    let fresh = Parameters::new(&DICTIONARY);
    for block in DICTIONARY.select(Selection::Backup).filter(|block| block.fixed_bytes().is_some()) {
        let mut other = fresh.clone();
        let now = u64::from(other.get(block.idn));
        let changed = other
            .set(block.idn, now + 1)
            .or_else(|_| other.set(block.idn, now.wrapping_sub(1)))
            .or_else(|_| other.set(block.idn, 11))
            .or_else(|_| other.set(block.idn, 0x8013));
        assert_eq!(changed, Ok(()), "{}", block.idn);
        assert_ne!(other.checksum(), fresh.checksum(), "{}", block.idn);
        let differ = DICTIONARY
            .blocks()
            .iter()
            .filter(|other| other.location == Location::Parameter && other.fixed_bytes().is_some())
            .filter(|each| other.get(each.idn) != fresh.get(each.idn));
        assert!(differ.map(|each| each.idn).eq([block.idn]), "{}", block.idn);
    }
}

#[test]
fn no_data_block_has_a_scaled_unit_of_its_own() {
    // The motor's own data and those of the identification do not follow a scaling; an angle in hundredths of a degree is electrical.
    let own = [Idn::standard(113), Idn::product(218), Idn::product(219)];
    for block in DICTIONARY.blocks().iter().filter(|block| !own.contains(&block.idn)) {
        let Unit::Fixed(unit) = block.unit else { continue };
        let decimals = block.attribute.decimal_places().value();
        let looks_scaled = matches!(
            (unit, decimals),
            ("deg", 4) | ("rpm", _) | ("rad/s^2" | "rad/s^3", _) | ("mm" | "mm/min" | "mm/s" | "mm/s^2", _)
        );
        assert!(!looks_scaled, "{} in {unit} must name what it measures", block.idn);
    }
}
