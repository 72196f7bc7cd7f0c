use super::*;
use crate::data_block::Location;
use crate::sample::DICTIONARY;

#[test]
fn the_defaults_come_from_the_table() {
    let parameters = Parameters::new(&DICTIONARY);
    assert_eq!(parameters.get(Idn::standard(2)), 2_000);
    assert_eq!(parameters.get(Idn::standard(46)), 0xFFFC);
    assert_eq!(parameters.get_signed(Idn::standard(46)), -4);
    assert_eq!(parameters.list(Idn::AT_LIST), []);
    assert_eq!(parameters.text(Idn::standard(141)), "");
}

#[test]
fn every_parameter_has_a_place_of_its_own() {
    let mut parameters = Parameters::new(&DICTIONARY);
    let blocks = || DICTIONARY.select(Selection::All).filter(|block| block.location == Location::Parameter);
    // Constants and allocations take few values; their places are seen through the others'.
    let fixed = || {
        blocks().filter(|block| {
            let range = block.maximum.unwrap_or(i64::MAX).saturating_sub(block.minimum.unwrap_or(0));
            block.fixed_bytes().is_some() && !block.restricted && range > 1_000
        })
    };
    for (block, value) in fixed().zip(1..) {
        parameters.set(block.idn, distinct(block, value)).unwrap();
    }
    for (block, value) in fixed().zip(1..) {
        assert_eq!(u64::from(parameters.get(block.idn)), distinct(block, value), "{}", block.idn);
    }
    parameters.set_list(Idn::AT_LIST, &[Idn::POSITION_FEEDBACK]).unwrap();
    assert_eq!(parameters.list(Idn::MDT_LIST), []);
    parameters.set_text(Idn::standard(142), b"folder").unwrap();
    assert_eq!((parameters.text(Idn::standard(141)), parameters.text(Idn::standard(142))), ("", "folder"));
    parameters.set_words(Idn::standard(328), &[15, 0]).unwrap();
    assert_eq!(
        (parameters.words(Idn::standard(328)), parameters.words(Idn::standard(329))),
        ([15, 0].as_slice(), [].as_slice())
    );
    parameters.set_longs(Idn::product(7), &[u32::MAX; LONG_ENTRIES]).unwrap();
    assert_eq!(parameters.longs(Idn::product(7)), [u32::MAX; LONG_ENTRIES]);
}

/// A value of its own for every data block, within its limits.
fn distinct(block: &DataBlock, number: u64) -> u64 {
    let value = match block.maximum {
        // Small ranges do not hold a value for each; their neighbours then differ all the same.
        Some(maximum) => {
            let minimum = block.minimum.unwrap_or(0);
            let span = maximum.abs_diff(minimum).saturating_add(1);
            (maximum - (number % span) as i64) as u64
        }
        None => number,
    };
    if block.fixed_bytes() == Some(2) { value & 0xFFFF } else { value & 0xFFFF_FFFF }
}

#[test]
fn a_value_outside_its_limits_is_refused_and_changes_nothing() {
    let mut parameters = Parameters::new(&DICTIONARY);
    let before = parameters.clone();
    assert_eq!(parameters.set(Idn::standard(2), 499), Err(ServiceError::BelowMinimum));
    assert_eq!(parameters.set(Idn::standard(2), 65_001), Err(ServiceError::AboveMaximum));
    assert_eq!(parameters.set(Idn::standard(46), 33), Err(ServiceError::AboveMaximum));
    assert_eq!(parameters.set(Idn::standard(46), 0xFF00), Err(ServiceError::BelowMinimum));
    assert_eq!(parameters.set(Idn::standard(11), 0), Err(ServiceError::IdnNotAvailable));
    assert_eq!(parameters.set_list(Idn::AT_LIST, &[Idn::VELOCITY_COMMAND]), Err(ServiceError::InvalidData));
    assert_eq!(parameters.set_list(Idn::MDT_LIST, &[Idn::VELOCITY_COMMAND; 17]), Err(ServiceError::InvalidData));
    assert_eq!(parameters.set_text(Idn::standard(141), &[b'x'; 41]), Err(ServiceError::InvalidData));
    assert_eq!(parameters.set_text(Idn::standard(141), &[0xFF]), Err(ServiceError::InvalidData));
    assert_eq!(parameters.set_words(Idn::standard(329), &[16]), Err(ServiceError::InvalidData));
    assert_eq!(parameters.set_longs(Idn::product(7), &[0; 9]), Err(ServiceError::InvalidData));
    assert_eq!(parameters, before);
}

#[test]
fn two_byte_parameters_keep_two_bytes() {
    let mut parameters = Parameters::new(&DICTIONARY);
    parameters.set(Idn::standard(97), 0x1_0005).unwrap();
    assert_eq!(parameters.get(Idn::standard(97)), 5);
}

#[test]
fn what_the_master_has_written_is_forgotten_when_cp2_begins() {
    let mut parameters = Parameters::new(&DICTIONARY);
    parameters.mark_written(Idn::standard(2));
    parameters.mark_written(Idn::product(7));
    assert!(parameters.is_written(Idn::standard(2)) && parameters.is_written(Idn::product(7)));
    assert!(!parameters.is_written(Idn::standard(1)));
    parameters.forget_written();
    assert!(!parameters.is_written(Idn::standard(2)) && !parameters.is_written(Idn::product(7)));
}

#[test]
fn a_real_time_bit_is_tied_to_something_that_has_bits_or_to_nothing() {
    let mut parameters = Parameters::new(&DICTIONARY);
    for (bit, idn, result) in [
        (301, 0x8013, Ok(())),
        (303, 11, Err(ServiceError::InvalidData)),
        (305, 11, Ok(())),
        (307, 2, Err(ServiceError::InvalidData)),
        (301, 4000, Err(ServiceError::IdnNotAvailable)),
        (305, 4000, Err(ServiceError::IdnNotAvailable)),
        (301, 0, Ok(())),
    ] {
        let before = parameters.clone();
        assert_eq!(parameters.set(Idn::standard(bit), idn), result, "S-0-{bit:04} = {idn:04X}H");
        if result.is_err() {
            assert_eq!(parameters, before);
        }
    }
    assert_eq!(parameters.get(Idn::standard(305)), 11);
}

#[test]
fn the_defaults_come_back_for_what_is_stored_and_for_nothing_else() {
    let mut parameters = Parameters::new(&DICTIONARY);
    parameters.set(Idn::standard(2), 4_000).unwrap();
    parameters.set(Idn::standard(104), 250).unwrap();
    parameters.set_text(Idn::standard(142), b"folder").unwrap();
    parameters.set_text(Idn::product(8), b"4711").unwrap();
    parameters.load_defaults();
    assert_eq!(parameters.get(Idn::standard(2)), 4_000);
    assert_eq!(parameters.get(Idn::standard(104)), 100);
    assert_eq!(parameters.text(Idn::standard(142)), "");
    assert_eq!(parameters.text(Idn::product(8)), "");
}

#[test]
fn the_control_unit_cycle_follows_the_communication_cycle_until_the_master_writes_it() {
    let cycles = |parameters: &Parameters| [1, 2].map(|number| parameters.get(Idn::standard(number)));
    let mut parameters = Parameters::new(&DICTIONARY);
    parameters.set(Idn::standard(2), 4_000).unwrap();
    assert_eq!(cycles(&parameters), [4_000, 4_000]);
    parameters.set(Idn::standard(1), 8_000).unwrap();
    parameters.mark_written(Idn::standard(1));
    parameters.set(Idn::standard(2), 1_000).unwrap();
    assert_eq!(cycles(&parameters), [8_000, 1_000]);
    // The next run-up need not write it.
    parameters.forget_written();
    assert_eq!(cycles(&parameters), [1_000, 1_000]);
}

#[test]
fn a_cycle_time_that_the_ring_cannot_have_is_refused() {
    for number in [1, 2] {
        let mut parameters = Parameters::new(&DICTIONARY);
        let before = parameters.clone();
        for microseconds in [501, 800, 1_125, 64_999] {
            let refused = parameters.set(Idn::standard(number), microseconds);
            assert_eq!(refused, Err(ServiceError::InvalidData), "S-0-{number:04} = {microseconds}");
        }
        assert_eq!(parameters, before);
        for microseconds in [500, 750, 65_000] {
            parameters.set(Idn::standard(number), microseconds).unwrap();
        }
    }
}

#[test]
fn the_checksum_sees_every_stored_data_block_and_no_other() {
    let fresh = Parameters::new(&DICTIONARY);
    let mut other = fresh.clone();
    other.set(Idn::standard(2), 4_000).unwrap();
    assert_eq!(other.checksum(), fresh.checksum());
    for block in DICTIONARY.select(Selection::Backup) {
        let mut other = fresh.clone();
        let changed = match block.place {
            Place::None | Place::Command(_) => panic!("{} is stored nowhere", block.idn),
            Place::Value(_) => {
                let now = u64::from(other.get(block.idn));
                other
                    .set(block.idn, now + 1)
                    .or_else(|_| other.set(block.idn, now.wrapping_sub(1)))
                    .or_else(|_| other.set(block.idn, 11))
                    .or_else(|_| other.set(block.idn, 0x8013))
            }
            Place::Idns(_) => other.set_list(block.idn, &[Idn::product(19)]),
            Place::Words(_) => other.set_words(block.idn, &[1]),
            Place::Longs(_) => other.set_longs(block.idn, &[1]),
            Place::Text(_) => other.set_text(block.idn, b"x"),
        };
        assert_eq!(changed, Ok(()), "{}", block.idn);
        assert_ne!(other.checksum(), fresh.checksum(), "{}", block.idn);
    }
}
