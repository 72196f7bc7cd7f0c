//! Bits that are no longer what they were.

use flash::FlashModel;
use memory::{Condition, Error};

use crate::{Small, load, save, set, started};

/// After some saves, all that is left of them in the flash.
fn saved(saves: u32) -> Small {
    let (mut memory, _) = started(Small(FlashModel::new())).unwrap();
    for number in 1..=saves {
        save(&mut memory, &set(number, 40)).unwrap();
    }
    memory.flash().clone()
}

#[test]
fn every_single_bit_of_the_memory_that_is_damaged_is_found_or_does_no_harm() {
    for saves in [1, 3] {
        let whole = saved(saves);
        let end = whole.0.contents().iter().rposition(|byte| *byte != 0xFF).unwrap();
        let (mut found, mut harmless, mut refusals) = (0, 0, 0);
        // And some erased words behind the last item.
        for bit in 0..(end + 40) * 8 {
            let mut flash = whole.clone();
            flash.0.contents_mut()[bit / 8] ^= 1 << (bit % 8);
            let (mut memory, condition) = started(flash).unwrap();
            let last = Some(set(saves, 40));
            match condition {
                Condition::Whole => assert_eq!(
                    load(&mut memory),
                    last,
                    "bit {bit} of {saves} saves is damaged, and another set is taken"
                ),
                Condition::Damaged => assert_eq!(load(&mut memory), None),
                // Told, too: the set before is in force.
                Condition::Unfinished => assert_ne!(load(&mut memory), last),
                Condition::Empty => panic!("bit {bit} of {saves} saves: nothing is found, and nothing is told"),
            }
            if condition == Condition::Whole {
                harmless += 1
            } else {
                found += 1
            }
            // The next save mends it, or it is refused and a start does.
            let refused = save(&mut memory, &set(9, 40));
            let (mut again, condition) = started(memory.flash().clone()).unwrap();
            if let Err(error) = refused {
                assert_eq!((error, condition), (Error::Damaged, Condition::Damaged), "bit {bit}");
                refusals += 1;
                save(&mut again, &set(9, 40)).unwrap();
                again = started(again.flash().clone()).unwrap().0;
            } else {
                assert_eq!(condition, Condition::Whole, "bit {bit}");
            }
            assert_eq!(load(&mut again), Some(set(9, 40)), "bit {bit}");
        }
        // 56 bytes of the last set with its header, and nothing else, must be whole.
        println!("{saves} saves: {found} found, {harmless} harmless, {refusals} refused the next save");
        assert!((300..500).contains(&found) && harmless > 500 && refusals < 4, "{found}, {harmless}, {refusals}");
    }
}

#[test]
fn a_flash_that_is_not_ours_is_told_and_taken_over() {
    for byte in [0x00, 0x5A] {
        let mut flash = FlashModel::new();
        flash.contents_mut().fill(byte);
        let (mut memory, condition) = started(flash).unwrap();
        assert_eq!((condition, load(&mut memory)), (Condition::Damaged, None));
        save(&mut memory, &set(1, 40)).unwrap();
        assert_eq!(load(&mut started(memory.flash().clone()).unwrap().0), Some(set(1, 40)));
    }
}

/// The markers of a page say that it is erased, and it is not: an erase that was cut, or a bit.
#[test]
fn a_spare_page_that_is_not_erased_is_erased_before_it_is_needed() {
    for dirt in [16, 300, Small::PAGE - 9] {
        let (mut memory, _) = started(Small(FlashModel::new())).unwrap();
        let mut number = 1;
        save(&mut memory, &set(number, 120)).unwrap();
        let mut flash = memory.flash().clone();
        flash.0.contents_mut()[flash::SECTOR_BYTES + dirt] = 0x5A;
        while flash.0.erases() == [0, 0] || number < 60 {
            let (mut memory, condition) = started(flash).unwrap();
            assert_eq!((condition, load(&mut memory)), (Condition::Whole, Some(set(number, 120))), "dirt at {dirt}");
            number += 1;
            save(&mut memory, &set(number, 120)).unwrap();
            flash = memory.flash().clone();
        }
        // The spare, because it was dirty, and the page that was full.
        assert_eq!(flash.0.erases(), [1, 1], "dirt at {dirt}");
    }
}
