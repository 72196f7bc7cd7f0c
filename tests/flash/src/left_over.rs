//! What an operation leaves that the supply does not see to its end.
//!
//! RM0090 3.6: "the contents of the Flash memory are not guaranteed if a device reset occurs during a Flash memory operation". So anything the
//! operation could have touched may be anything; the ends, nothing done and all done, come often enough to be tested.

use crate::dice::Dice;

/// A word of `old` contents in which `value` was being programmed: no bit rises, and none falls that is not to.
pub(crate) const fn of_programming(old: u32, value: u32, dice: &mut Dice) -> u32 {
    let falls = match dice.below(4) {
        0 => 0,
        1 => u32::MAX,
        _ => dice.word() as u32,
    };
    old & (value | !falls)
}

/// Leaves in `sector` what an erase may have made of it.
pub(crate) fn of_erasing(sector: &mut [u8], dice: &mut Dice) {
    const ERASED: u8 = 0xFF;
    let way = dice.below(6);
    let border = dice.below(sector.len() as u64 + 1) as usize;
    for (index, byte) in sector.iter_mut().enumerate() {
        let noise = dice.word() as u8;
        *byte = match way {
            // It has not begun, or it has ended.
            0 => *byte,
            1 => ERASED,
            2 => noise,
            // Some bits have risen.
            3 => *byte | noise,
            // The controller programs zeros before it erases, so that all cells age alike.
            4 => *byte & noise,
            // One part has, the other has not.
            _ => {
                if index < border {
                    ERASED
                } else {
                    *byte
                }
            }
        };
    }
}
