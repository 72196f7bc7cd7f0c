use super::*;
use flash::Speed;

const LATENCY_AND_CACHES: u32 = 0x0000_0705;
const BY_WORDS: u32 = 2 << 8;

fn open() -> FlashController {
    let mut controller = FlashController::default();
    for key in KEYS {
        controller.write(KEY, key).unwrap().unwrap();
    }
    controller
}

fn set(controller: &mut FlashController, control: u32) -> Result<(), String> {
    controller.write(CONTROL, control).unwrap()
}

fn status(controller: &mut FlashController) -> u32 {
    let status = controller.read(STATUS).unwrap();
    controller.write(STATUS, status).unwrap().unwrap();
    assert_eq!(controller.read(STATUS), Some(0), "a one clears its flag");
    status
}

fn erase(number: u32) -> u32 {
    BY_WORDS | SECTOR_ERASE | number << 3
}

fn at(offset: usize) -> u32 {
    PARAMETER_FLASH + offset as u32
}

#[test]
fn only_the_two_keys_in_their_order_open_it_and_a_wrong_one_jams_it_until_the_reset() {
    let is_locked = |keys: &[u32]| {
        let mut controller = FlashController::default();
        for key in keys {
            controller.write(KEY, *key).unwrap().unwrap();
        }
        controller.read(CONTROL).unwrap() & LOCK != 0
    };
    assert!(is_locked(&[]) && is_locked(&KEYS[..1]));
    assert!(!is_locked(&KEYS));
    for wrong in [[KEYS[1], KEYS[0]], [KEYS[0], KEYS[0]], [1, 2]] {
        assert!(is_locked(&[&wrong[..], &KEYS[..]].concat()), "{wrong:x?}");
    }
    assert!(is_locked(&[&KEYS[..], &KEYS[..1]].concat()), "a key too many");
    let mut controller = open();
    set(&mut controller, LOCK).unwrap();
    assert_eq!(controller.read(CONTROL), Some(LOCK));
}

#[test]
fn a_word_is_programmed_where_everything_is_set_up_for_it() {
    let mut controller = open();
    set(&mut controller, BY_WORDS | PROGRAM).unwrap();
    controller.program(at(8), 4, 0x1234_5678).unwrap();
    let takes = Duration::from_micros(16);
    assert_eq!(controller.take_begun(), Some(Operation { changed: 8..12, takes, is_cut: false }));
    assert_eq!(controller.take_begun(), None);
    assert_eq!((status(&mut controller), controller.sectors.value(8, Width::Word)), (0, 0x1234_5678));
    // The last word of the second sector.
    controller.program(0x080F_FFFC, 4, 0).unwrap();
    assert_eq!(controller.sectors.contents()[2 * SECTOR_BYTES - 4..], [0; 4]);
}

#[test]
fn a_write_that_is_not_set_up_changes_nothing_and_sets_the_flag_of_its_error() {
    let flagged = |control: Option<u32>, offset: usize, bytes: u32| {
        let mut controller = if control.is_some() { open() } else { FlashController::default() };
        set(&mut controller, control.unwrap_or(BY_WORDS | PROGRAM)).unwrap();
        controller.program(at(offset), bytes, 0).unwrap();
        assert_eq!(controller.take_begun(), None);
        assert!(controller.sectors.contents().iter().all(|byte| *byte == 0xFF));
        status(&mut controller)
    };
    assert_eq!(flagged(None, 0, 4), SEQUENCE_ERROR, "locked");
    assert_eq!(flagged(Some(BY_WORDS), 0, 4), SEQUENCE_ERROR, "PG is 0");
    assert_eq!(flagged(Some(BY_WORDS | PROGRAM | SECTOR_ERASE), 0, 4), SEQUENCE_ERROR, "two at once");
    assert_eq!(flagged(Some(BY_WORDS | PROGRAM), 0, 2), PARALLELISM_ERROR, "a half-word");
    assert_eq!(flagged(Some(PROGRAM), 0, 4), PARALLELISM_ERROR, "PSIZE is a byte");
    assert_eq!(flagged(Some(BY_WORDS | PROGRAM), 2, 4), PARALLELISM_ERROR, "not aligned");
    assert_eq!(flagged(Some(BY_WORDS | PROGRAM), 13, 4), ALIGNMENT_ERROR, "across a row");
}

#[test]
fn a_sector_of_the_parameters_is_erased_and_no_other() {
    let mut controller = open();
    controller.sectors = FlashModel::with_contents(&[0; 2 * SECTOR_BYTES]).unwrap();
    set(&mut controller, erase(11)).unwrap();
    assert_eq!(controller.take_begun(), None, "not started yet");
    set(&mut controller, erase(11) | START).unwrap();
    let begun = controller.take_begun().unwrap();
    assert_eq!((begun.changed, begun.takes), (SECTOR_BYTES..2 * SECTOR_BYTES, Duration::from_secs(1)));
    assert_eq!(controller.sectors.erases(), [0, 1]);
    assert_eq!(controller.read(CONTROL), Some(erase(11)), "STRT has fallen");
    for (control, what) in [(erase(9), "sector 9"), (erase(12), "sector 12"), (MASS_ERASE, "whole flash")] {
        let refused = set(&mut controller, control | START).unwrap_err();
        assert!(refused.contains(what), "{refused}");
    }
    set(&mut open(), 1 << 24).unwrap_err();
    let mut without = open();
    set(&mut without, BY_WORDS | START).unwrap();
    assert_eq!((status(&mut without), without.take_begun()), (SEQUENCE_ERROR, None));
    let mut too_wide = open();
    set(&mut too_wide, 3 << 8 | SECTOR_ERASE | 10 << 3 | START).unwrap_err();
    set(&mut too_wide, 3 << 8 | PROGRAM).unwrap();
    too_wide.program(at(0), 4, 0).unwrap_err();
}

#[test]
fn longest_times_and_the_width_of_an_erase_are_those_of_the_data_sheet() {
    let mut controller = open();
    controller.sectors.set_speed(Speed::Longest);
    for (width, millis) in [(0, 4_000), (1, 2_600), (2, 2_000)] {
        controller.stale = 0;
        set(&mut controller, width << 8 | SECTOR_ERASE | 10 << 3 | START).unwrap();
        assert_eq!(controller.take_begun().unwrap().takes.as_millis(), millis);
    }
}

#[test]
fn behind_an_erase_both_caches_are_reset_before_anything_else() {
    const ENABLES: u32 = 3 << 9;
    const RESETS: u32 = 3 << 11;
    let mut controller = open();
    let access = |controller: &mut FlashController, value| controller.write(ACCESS_CONTROL, value).unwrap();
    access(&mut controller, LATENCY_AND_CACHES).unwrap();
    set(&mut controller, erase(10) | START).unwrap();
    set(&mut controller, BY_WORDS | PROGRAM).unwrap();
    assert!(controller.program(at(0), 4, 0).unwrap_err().contains("caches"));
    assert!(access(&mut controller, LATENCY_AND_CACHES | RESETS).unwrap_err().contains("enabled"));
    access(&mut controller, LATENCY_AND_CACHES & !ENABLES).unwrap();
    access(&mut controller, LATENCY_AND_CACHES & !ENABLES | CACHES[1].1).unwrap();
    assert!(controller.program(at(0), 4, 0).is_err(), "one of two");
    access(&mut controller, LATENCY_AND_CACHES & !ENABLES | CACHES[0].1).unwrap();
    access(&mut controller, LATENCY_AND_CACHES).unwrap();
    controller.program(at(0), 4, 0).unwrap();
    assert_eq!(controller.latency(), 5);
}

#[test]
fn an_operation_in_which_the_supply_goes_is_marked_and_ends_early() {
    let mut controller = open();
    controller.sectors.cut_in(2, 5);
    set(&mut controller, BY_WORDS | PROGRAM).unwrap();
    controller.program(at(0), 4, 0).unwrap();
    assert!(!controller.take_begun().unwrap().is_cut);
    controller.program(at(4), 4, 0).unwrap();
    let begun = controller.take_begun().unwrap();
    assert!(begun.is_cut && begun.takes < Duration::from_micros(16), "{begun:?}");
}

#[test]
fn behind_a_reset_it_is_locked_and_holds_what_it_held() {
    let mut controller = open();
    set(&mut controller, BY_WORDS | PROGRAM).unwrap();
    controller.program(at(0), 4, 7).unwrap();
    let after = FlashController::after_reset(controller.sectors);
    assert_eq!((after.read(CONTROL), after.sectors.value(0, Width::Word)), (Some(LOCK), 7));
}

#[test]
fn registers_of_the_option_bytes_are_unknown() {
    for offset in [0x08, 0x14] {
        assert_eq!(FlashController::default().read(offset), None);
        assert!(FlashController::default().write(offset, 0).is_none());
    }
}
