//! What is saved is found again, and pages turn without anything being lost.

use embassy_futures::block_on;
use flash::FlashModel;
use memory::{Condition, Error, Log, MOST_BYTES, Memory, RESERVE};

use crate::{BUFFER, amend, load, save, set, started};

#[test]
fn a_blank_flash_holds_nothing_and_is_not_written() {
    let (mut memory, condition) = started(FlashModel::new()).unwrap();
    assert_eq!((condition, load(&mut memory)), (Condition::Empty, None));
    assert_eq!(memory.flash().operations(), 0);
}

#[test]
fn the_last_set_is_found_again_whatever_its_length() {
    let (mut memory, _) = started(FlashModel::new()).unwrap();
    for (number, length) in [(1, 4), (2, 5), (3, 6), (4, 7), (5, 1_800), (6, MOST_BYTES), (7, 100)] {
        save(&mut memory, &set(number, length)).unwrap();
        let (mut after, condition) = started(memory.flash().clone()).unwrap();
        assert_eq!((condition, load(&mut after)), (Condition::Whole, Some(set(number, length))));
    }
}

#[test]
fn a_set_that_is_too_long_is_refused_and_the_one_before_stays() {
    let (mut memory, _) = started(FlashModel::new()).unwrap();
    save(&mut memory, &set(1, 100)).unwrap();
    assert_eq!(save(&mut memory, &set(2, BUFFER)), Err(Error::TooLong));
    let (mut after, _) = started(memory.flash().clone()).unwrap();
    assert_eq!(load(&mut after), Some(set(1, 100)));
}

#[test]
fn a_set_is_changed_where_it_lies_whatever_its_length_and_becomes() {
    let (mut memory, _) = started(FlashModel::new()).unwrap();
    save(&mut memory, &set(1, 1_800)).unwrap();
    let lengths = [1_800, 4, 5, 1_801, MOST_BYTES, 7, MOST_BYTES];
    for (number, pair) in (1..).zip(lengths.windows(2)) {
        assert_eq!(amend(&mut memory, &set(number, pair[0]), &set(number + 1, pair[1])), Ok(true));
        let (mut after, condition) = started(memory.flash().clone()).unwrap();
        assert_eq!((condition, load(&mut after)), (Condition::Whole, Some(set(number + 1, pair[1]))));
    }
}

#[test]
fn a_change_that_does_not_fit_or_has_nothing_to_change_leaves_what_there_is() {
    let (mut memory, _) = started(FlashModel::new()).unwrap();
    assert_eq!(amend(&mut memory, &[], &set(1, 100)), Ok(false));
    assert_eq!(memory.flash().operations(), 0);
    save(&mut memory, &set(1, 100)).unwrap();
    let before = memory.flash().operations();
    assert_eq!(amend(&mut memory, &set(1, 100), &set(2, BUFFER)), Err(Error::Refused));
    assert_eq!((load(&mut memory), memory.flash().operations()), (Some(set(1, 100)), before));
    let (_, condition) = started(memory.flash().clone()).unwrap();
    assert_eq!(condition, Condition::Whole, "nothing was begun, and nothing is cut");
    assert_eq!(amend(&mut memory, &set(1, 100), &set(2, 90)), Ok(true), "and the next one is done");
    let (mut after, _) = started(memory.flash().clone()).unwrap();
    assert_eq!(load(&mut after), Some(set(2, 90)));
}

/// A first save that was cut, and a set that cannot be read any more.
#[test]
fn there_is_nothing_to_change_where_a_start_finds_no_set_that_counts() {
    let mut flash = FlashModel::new();
    flash.cut_in(20, 1);
    let (mut memory, _) = started(flash).unwrap();
    assert!(save(&mut memory, &set(1, 100)).is_err());
    let mut cut = memory.flash().clone();
    cut.restore_supply();
    let (mut memory, condition) = started(cut).unwrap();
    assert_eq!((condition, amend(&mut memory, &[], &set(2, 100))), (Condition::Unfinished, Ok(false)));

    save(&mut memory, &set(3, 100)).unwrap();
    save(&mut memory, &set(4, 100)).unwrap();
    let mut flash = memory.flash().clone();
    let wanted = set(4, 100);
    let at = flash.contents().windows(100).rposition(|bytes| bytes == wanted).expect("the set that was saved");
    flash.contents_mut()[at + 50] ^= 4;
    let (mut memory, condition) = started(flash.clone()).unwrap();
    assert_eq!((condition, amend(&mut memory, &[], &set(5, 100))), (Condition::Damaged, Ok(false)));
}

/// The bit falls while the drive runs: what lies there now is the set before the last.
#[test]
fn a_set_that_is_damaged_since_the_start_is_not_changed() {
    let (mut memory, _) = started(FlashModel::new()).unwrap();
    save(&mut memory, &set(1, 100)).unwrap();
    save(&mut memory, &set(2, 100)).unwrap();
    let wanted = set(2, 100);
    let contents = memory.flash().contents_mut();
    let at = contents.windows(100).rposition(|bytes| bytes == wanted).expect("the set that was saved");
    contents[at + 50] ^= 4;
    assert_eq!(amend(&mut memory, &set(1, 100), &set(3, 100)), Err(Error::Damaged));
}

#[test]
fn nothing_is_erased_until_the_next_start_however_often_is_saved() {
    let mut flash = FlashModel::new();
    let (mut turns, mut number, mut fewest) = (0, 0, u32::MAX);
    for _ in 0..12 {
        let (mut memory, _) = started(flash).unwrap();
        let erased: u64 = memory.flash().erases().iter().sum();
        turns = erased;
        let mut saves = 0;
        let refused = loop {
            match save(&mut memory, &set(number + 1, 1_800)) {
                Ok(()) => (number, saves) = (number + 1, saves + 1),
                Err(error) => break error,
            }
        };
        assert!(matches!(refused, Error::Full { .. }), "{refused:?}");
        assert_eq!(memory.flash().erases().iter().sum::<u64>(), erased, "erased in operation");
        assert_eq!(load(&mut memory), Some(set(number, 1_800)));
        fewest = fewest.min(saves);
        flash = memory.flash().clone();
    }
    // A page holds two reserves and a half.
    assert!((4..=8).contains(&turns), "{turns} turns");
    // 1.8 KB and the frame of each, and what a save of the longest set needs behind the last.
    assert!((RESERVE / 1_900..=RESERVE / 1_830).contains(&fewest), "{fewest} saves");
}

#[test]
fn a_start_makes_room_for_what_the_docs_say_and_a_page_takes_forty_saves() {
    let (mut memory, _) = started(FlashModel::new()).unwrap();
    let mut saves = 0;
    while memory.flash().erases().iter().sum::<u64>() < 4 {
        save(&mut memory, &set(saves, 1_800)).unwrap();
        saves += 1;
        // Started anew after each save: the most turns that there can be.
        memory = started(memory.flash().clone()).unwrap().0;
        assert!(memory.room() >= RESERVE, "{} bytes after {saves}", memory.room());
    }
    // 80 KiB of each page: what the reserve leaves.
    assert!((4 * 40..4 * 46).contains(&saves), "{saves} saves in four turns");
}

#[test]
fn a_log_is_kept_beside_the_set_and_leaves_it_room() {
    let (mut memory, _) = started(FlashModel::new()).unwrap();
    save(&mut memory, &set(1, 1_800)).unwrap();
    let write = |memory: &mut Memory<FlashModel>, byte: u8| {
        block_on(memory.save_log(&mut [0; BUFFER], Log::Events, |buffer: &mut [u8]| {
            buffer.get_mut(..200)?.fill(byte);
            Some(200)
        }))
    };
    let mut last = 0;
    let refused = loop {
        last += 1_u8;
        if let Err(error) = write(&mut memory, last) {
            break error;
        }
        if memory.room() > 100 * 1_024 && last == 200 {
            last = 1;
        }
        if last == 250 {
            // Many small ones: the page is filled with sets instead.
            while memory.room() > 7_000 {
                save(&mut memory, &set(1, 1_800)).unwrap();
            }
        }
    };
    assert!(matches!(refused, Error::Full { .. }), "{refused:?}");
    save(&mut memory, &set(2, 1_800)).unwrap();
    let (mut after, _) = started(memory.flash().clone()).unwrap();
    let mut buffer = [0; BUFFER];
    let log = block_on(after.load_log(&mut buffer, Log::Events)).unwrap().unwrap().to_vec();
    assert_eq!((log.len(), log.iter().all(|byte| *byte == last - 1)), (200, true));
    assert_eq!(load(&mut after), Some(set(2, 1_800)));
}

#[test]
fn the_words_of_a_save_and_their_time_are_those_that_the_docs_say() {
    let (mut memory, _) = started(FlashModel::new()).unwrap();
    save(&mut memory, &set(1, 1_800)).unwrap();
    let (words, busy) = (memory.flash().operations(), memory.flash().busy());
    save(&mut memory, &set(2, 1_800)).unwrap();
    let words = memory.flash().operations() - words;
    let busy = memory.flash().busy() - busy;
    assert!((455..470).contains(&words), "{words} words");
    assert_eq!(busy.as_micros(), u128::from(words) * 16, "typically");
}
