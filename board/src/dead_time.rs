//! Dead time of TIM1: the code of field DTG for a time in nanoseconds, and back.
//!
//! The eight bits hold a step and a count in one, finer for short times (RM0090 17.4.18). With tDTS = 1/168 MHz = 5.95 ns:
//!
//! | DTG | dead time | range | step |
//! |---|---|---|---|
//! | 0xxx xxxx | x tDTS | 0 to 756 ns | 6 ns |
//! | 10xx xxxx | (64 + x) 2 tDTS | 762 to 1512 ns | 12 ns |
//! | 110x xxxx | (32 + x) 8 tDTS | 1524 to 3000 ns | 48 ns |
//! | 111x xxxx | (32 + x) 16 tDTS | 3048 to 6000 ns | 95 ns |

use crate::clocks::APB2_TIMER_HZ;

/// Longest dead time, in counts of the timer: (32 + 31) 16.
const LONGEST: u64 = 1008;

/// Code of the shortest dead time that is not below `nanoseconds`. Refuses to compile above 6 us.
#[must_use]
pub const fn code(nanoseconds: u32) -> u8 {
    // Rounded up at every step: too short a dead time short-circuits the DC link, too long a one costs some voltage.
    let counts = (nanoseconds as u64).saturating_mul(APB2_TIMER_HZ as u64).div_ceil(1_000_000_000);
    assert!(counts <= LONGEST, "no dead time of this timer is as long as that");
    match counts {
        0..=127 => counts as u8,
        128..=254 => 0b1000_0000 | counts.div_ceil(2).wrapping_sub(64) as u8,
        255..=504 => 0b1100_0000 | counts.div_ceil(8).wrapping_sub(32) as u8,
        _ => 0b1110_0000 | counts.div_ceil(16).wrapping_sub(32) as u8,
    }
}

/// Dead time that belongs to a code, in counts of 1/168 MHz.
#[must_use]
pub const fn counts(code: u8) -> u16 {
    let code = code as u16;
    match code >> 5 {
        0b000..=0b011 => code,
        0b100 | 0b101 => (64 | code & 0x3F) << 1,
        0b110 => (32 | code & 0x1F) << 3,
        _ => (32 | code & 0x1F) << 4,
    }
}

// The ends of the four ranges, and what follows from a time that is just too long for one.
const _: () = {
    assert!(code(0) == 0x00 && code(1) == 0x01 && code(6) == 0x02 && code(755) == 0x7F);
    assert!(code(756) == 0x80 && code(1000) == 0x94 && code(1511) == 0xBF);
    assert!(code(1513) == 0xC0 && code(3000) == 0xDF);
    assert!(code(3001) == 0xE0 && code(6000) == 0xFF);
    assert!(counts(0x00) == 0 && counts(0x7F) == 127 && counts(0x80) == 128 && counts(0xBF) == 254);
    assert!(counts(0xC0) == 256 && counts(0xDF) == 504 && counts(0xE0) == 512 && counts(0xFF) == 1008);
};

// For every time there is: long enough, and the code below would be too short.
#[allow(clippy::arithmetic_side_effects, reason = "evaluated by the compiler only")]
const _: () = {
    let mut nanoseconds = 0;
    while nanoseconds <= 6000 {
        let wanted = nanoseconds as u64 * APB2_TIMER_HZ as u64;
        let code = code(nanoseconds);
        assert!(counts(code) as u64 * 1_000_000_000 >= wanted);
        assert!(code == 0 || (counts(code - 1) as u64 * 1_000_000_000) < wanted);
        nanoseconds += 1;
    }
};
