//! What the model of the flash must be like, seen from outside.

use std::collections::BTreeSet;
use std::time::Duration;

use embassy_futures::block_on;
use embedded_storage_async::nor_flash::{NorFlash, ReadNorFlash};
use flash::{CAPACITY, Cut, FlashError, FlashModel, SECTOR_BYTES, Speed, Width};

fn word(flash: &FlashModel, offset: usize) -> u32 {
    flash.value(offset, Width::Word)
}

#[test]
fn programming_turns_ones_into_zeros_only_and_touches_its_own_bytes() {
    let mut flash = FlashModel::new();
    flash.program(8, 0xF0F0_1234, Width::Word).unwrap();
    flash.program(8, 0x0FFF_FF0F, Width::Word).unwrap();
    assert_eq!(word(&flash, 8), 0x00F0_1204);
    flash.program(16, 0xAB, Width::Byte).unwrap();
    flash.program(18, 0xCDEF, Width::HalfWord).unwrap();
    assert_eq!(word(&flash, 16), 0xCDEF_FFAB);
    let untouched = flash.contents().iter().filter(|byte| **byte == 0xFF).count();
    assert_eq!(untouched, CAPACITY - 4 - 3);
}

#[test]
fn an_erase_makes_ones_of_one_sector_and_of_no_other() {
    let mut flash = FlashModel::with_contents(&[0x5A; CAPACITY]).unwrap();
    flash.erase(1, Width::Word).unwrap();
    let (first, second) = flash.contents().split_at(SECTOR_BYTES);
    assert!(first.iter().all(|byte| *byte == 0x5A) && second.iter().all(|byte| *byte == 0xFF));
    assert_eq!(flash.erases(), [0, 1]);
}

#[test]
fn operations_take_the_times_of_the_data_sheet() {
    let mut flash = FlashModel::new();
    let mut times = |speed| {
        flash.set_speed(speed);
        let erased =
            [Width::Byte, Width::HalfWord, Width::Word].map(|width| flash.erase(0, width).unwrap().as_millis());
        (flash.program(0, 0, Width::Word).unwrap(), erased)
    };
    assert_eq!(times(Speed::Typical), (Duration::from_micros(16), [2_000, 1_300, 1_000]));
    assert_eq!(times(Speed::Longest), (Duration::from_micros(100), [4_000, 2_600, 2_000]));
    assert_eq!((flash.operations(), flash.busy()), (8, Duration::from_micros(12_900_116)));
}

#[test]
fn the_supply_goes_in_the_nth_operation_and_nothing_is_done_until_it_is_back() {
    let mut flash = FlashModel::new();
    flash.program(0, 1, Width::Word).unwrap();
    flash.cut_in(3, 7);
    flash.program(4, 2, Width::Word).unwrap();
    flash.program(8, 3, Width::Word).unwrap();
    let Cut { after } = flash.program(12, 4, Width::Word).unwrap_err();
    assert!(after < Speed::Typical.programming(), "{after:?}");
    let left = flash.contents().to_vec();
    assert_eq!(flash.program(16, 0, Width::Word), Err(Cut { after: Duration::ZERO }));
    assert_eq!(flash.erase(0, Width::Word), Err(Cut { after: Duration::ZERO }));
    assert_eq!((flash.operations(), flash.is_supplied()), (4, false));
    assert_eq!(block_on(flash.read(0, &mut [0; 4])), Err(FlashError::NoSupply));
    flash.restore_supply();
    assert_eq!(flash.contents(), left);
    flash.program(16, 0, Width::Word).unwrap();
}

#[test]
fn a_word_that_was_being_programmed_keeps_any_subset_of_its_falling_bits() {
    const OLD: u32 = 0xFFF0_FFFF;
    const NEW: u32 = 0xFF00_00FF;
    let left = |seed| {
        let mut flash = FlashModel::new();
        flash.program(4, OLD, Width::Word).unwrap();
        flash.cut_in(1, seed);
        flash.program(4, NEW, Width::Word).unwrap_err();
        assert!(flash.contents()[8..].iter().all(|byte| *byte == 0xFF));
        word(&flash, 4)
    };
    let all: BTreeSet<u32> = (0..1_000).map(left).collect();
    assert_eq!(left(17), left(17));
    assert!(all.iter().all(|left| left & !OLD == 0 && left & (OLD & NEW) == OLD & NEW));
    assert!(all.contains(&OLD) && all.contains(&(OLD & NEW)) && all.len() > 100, "{}", all.len());
}

#[test]
fn a_sector_that_was_being_erased_is_old_new_or_anything_between() {
    let left = |seed| {
        let mut flash = FlashModel::with_contents(&[0x5A; CAPACITY]).unwrap();
        flash.cut_in(1, seed);
        flash.erase(0, Width::Word).unwrap_err();
        let (first, second) = flash.contents().split_at(SECTOR_BYTES);
        assert!(second.iter().all(|byte| *byte == 0x5A));
        first.to_vec()
    };
    let all: Vec<Vec<u8>> = (0..40).map(left).collect();
    let holds = |byte: u8| move |sector: &&Vec<u8>| sector.iter().all(|other| *other == byte);
    assert!(all.iter().any(|sector| holds(0x5A)(&sector)) && all.iter().any(|sector| holds(0xFF)(&sector)));
    // A border between erased and old bytes, and bits of all kinds.
    assert!(all.iter().any(|sector| sector[0] == 0xFF && sector[SECTOR_BYTES - 1] == 0x5A && !sector.contains(&0)));
    assert!(all.iter().any(|sector| sector.iter().any(|byte| byte & !0x5A != 0 && byte & 0x5A != 0x5A)));
    assert_eq!(all[3], left(3));
}

#[test]
fn the_parameter_memory_sees_words_and_sectors_and_what_it_may_not_do_is_refused() {
    let mut flash = FlashModel::new();
    let outcome = |flash: &mut FlashModel, offset, bytes: &[u8]| block_on(NorFlash::write(flash, offset, bytes));
    outcome(&mut flash, 4, &[1, 2, 3, 4, 5, 6, 7, 8]).unwrap();
    assert_eq!((word(&flash, 4), word(&flash, 8), flash.operations()), (0x0403_0201, 0x0807_0605, 2));
    let mut read = [0; 3];
    block_on(flash.read(5, &mut read)).unwrap();
    assert_eq!(read, [2, 3, 4]);
    assert_eq!(outcome(&mut flash, 2, &[0; 4]), Err(FlashError::NotAligned));
    assert_eq!(outcome(&mut flash, 0, &[0; 3]), Err(FlashError::NotAligned));
    assert_eq!(outcome(&mut flash, CAPACITY as u32 - 4, &[0; 8]), Err(FlashError::OutOfBounds));
    assert_eq!(outcome(&mut flash, 4, &[0xFF; 4]), Err(FlashError::NotWritten));
    assert_eq!(block_on(flash.read(CAPACITY as u32 - 1, &mut [0; 2])), Err(FlashError::OutOfBounds));
    let erase = |flash: &mut FlashModel, from, to| block_on(NorFlash::erase(flash, from, to));
    assert_eq!(erase(&mut flash, 0, 4), Err(FlashError::NotAligned));
    assert_eq!(erase(&mut flash, 0, 3 * SECTOR_BYTES as u32), Err(FlashError::OutOfBounds));
    assert_eq!(erase(&mut flash, SECTOR_BYTES as u32, 0), Err(FlashError::OutOfBounds));
    erase(&mut flash, 0, CAPACITY as u32).unwrap();
    assert_eq!((flash.erases(), word(&flash, 4)), ([1, 1], u32::MAX));
    assert!(FlashModel::with_contents(&[0; CAPACITY + 1]).is_err());
}

#[test]
fn a_write_that_is_cut_leaves_the_words_behind_it_alone() {
    let mut flash = FlashModel::new();
    flash.cut_in(2, 1);
    assert_eq!(block_on(NorFlash::write(&mut flash, 0, &[0; 16])), Err(FlashError::NoSupply));
    assert_eq!((word(&flash, 0), word(&flash, 8), word(&flash, 12)), (0, u32::MAX, u32::MAX));
}

#[test]
fn a_reset_in_the_middle_leaves_the_last_operation_undone_and_nothing_else() {
    let left = |seed| {
        let mut flash = FlashModel::new();
        flash.program(0, 0x1234_5678, Width::Word).unwrap();
        flash.program(4, 0, Width::Word).unwrap();
        flash.interrupt(seed);
        assert_eq!((word(&flash, 0), word(&flash, 8)), (0x1234_5678, u32::MAX));
        let left = word(&flash, 4);
        // It is left as it is, whatever comes.
        flash.interrupt(seed + 1);
        assert_eq!(word(&flash, 4), left);
        left
    };
    let all: BTreeSet<u32> = (0..100).map(left).collect();
    assert!(all.contains(&0) && all.contains(&u32::MAX) && all.len() > 30, "{}", all.len());
    let mut flash = FlashModel::with_contents(&[0x5A; CAPACITY]).unwrap();
    let mut kinds = BTreeSet::new();
    for seed in 0..40 {
        flash.contents_mut().fill(0x5A);
        flash.erase(1, Width::Word).unwrap();
        flash.interrupt(seed);
        let (first, second) = flash.contents().split_at(SECTOR_BYTES);
        assert!(first.iter().all(|byte| *byte == 0x5A));
        kinds.insert((second[0], second[SECTOR_BYTES - 1]));
    }
    assert!(kinds.contains(&(0x5A, 0x5A)) && kinds.contains(&(0xFF, 0xFF)) && kinds.len() > 5, "{kinds:?}");
}
