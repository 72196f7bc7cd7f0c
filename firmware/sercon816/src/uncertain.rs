//! Everything that the public record does not settle about the chip, one constant each (sercon816.md 14).
//!
//! Each entry says what the firmware does so that the value need not be right. A reference guide or a session at a
//! real chip corrects it here and nowhere else. Where the firmware's way is right whatever the chip does, there is no
//! value to correct:
//!
//! | no. | open question | what the firmware does |
//! |---|---|---|
//! | G8 | is the accepted phase to be written to 0AH | writes it, never reads it back |
//! | G16 | who takes back "send once" | rewrites word 0 of the AT header in every cycle of CP1 and CP2: once more, or off |
//! | G17 | does VAL fall by itself before the next telegram | clears VAL after reading it |
//! | G18 | bit 13 of a receive header | writes 0, ignores it on reading |
//! | G20 | HS_AT held or toggled with BUSY at an element change | the release writes HS_AT = HS_MDT, BUSY = 0, flags 0 |
//! | G21 | which buffer of a service container is sent | fills both alike until the chip has reported the end of one of them; receives into one cell that both pointers name |
//! | G24 | end of buffer reported with its last word or after it | the parity of the handshake tells, see [`crate::ServicePort`] |
//! | G27 | does NMSTERR saturate or wrap | uses differences |
//! | G29 | reaction in CP0 | transmit headers off, repeater on |
//! | G32 | an interrupt for telegram errors | compares the header's error counter |
//! | G33 | coherence of two-word values | the record is touched only between t3 and the next MDT, and outside the AT |
//!
//! The rest concerns the board's bus timing (G1), the zero bit stream (G6) and functions that this driver does not
//! use (G19: one buffer for each telegram).

use crate::bus::Register;
use crate::timer::{Timer, TimerMap};

/// 00H of the SERCON816. Settled; here because the chip's identity decides whether the rest of this file applies (G14).
pub const VERSION: u16 = 0x0010;

/// G2: interrupt lines may be active high or low, levels or pulses.
/// The board listens to both edges, and [`crate::Interrupts::take`] reads the status registers until they stay clear;
/// this bounds the rounds when a condition persists.
pub const INTERRUPT_ROUNDS: u8 = 4;

/// G3: 04H has unexplained bits. All are cleared, at start and whenever they show up; none has an effect.
pub const CLEAR_ALL: u16 = 0xFFFF;

/// G4: which bits of 05H the timers set. This is the assignment assumed until [`crate::Discovery`] has found the real one.
pub const ASSUMED_TIMERS: TimerMap = TimerMap {
    command_valid: Timer { register: Register::TIMER_2, bit: 10 },
    capture_feedback: Timer { register: Register::TIMER_3, bit: 11 },
    cycle_bits: 0x1000,
};

/// G5: whether 1 in 06H and 07H enables a source. [`crate::Discovery`] asks for the complement
/// when it sees flags but no interrupt.
pub const ENABLE_ALL: u16 = 0xFFFF;

/// G5: which value of 08H and 09H routes to which line. Both lines are served alike.
pub const ROUTING: u16 = 0x0000;

/// G6: 02H in normal operation; the published initial value, meaning of its bits not published.
pub const TRANSMITTER_NORMAL: u16 = 0x0383;

/// G6: 02H for continuous light, a test signal; never used in operation.
pub const TRANSMITTER_LIGHT: u16 = 0x03FF;

/// G7: whether 03H bit 2 selects the transmission block, and which pointer belongs to it.
/// Both block pointers and both cycle times always carry the values of the block in force, so any answer is right.
pub const BLOCK_SELECT_IN_CYCLIC_PHASES: bool = true;

/// G9: bits of 0BH that carry the phase; the others are masked.
pub const PHASE_RECEIVED_BITS: u16 = 0x00FF;

/// G10, G12: registers that no public source explains. They are neither read nor written.
pub const UNTOUCHED: [Register; 15] = [
    Register::at(0x0C),
    Register::at(0x12),
    Register::at(0x17),
    Register::at(0x1E),
    Register::at(0x1F),
    Register::at(0x20),
    Register::at(0x21),
    Register::at(0x22),
    Register::at(0x23),
    Register::at(0x24),
    Register::at(0x26),
    Register::at(0x27),
    Register::at(0x28),
    Register::at(0x29),
    Register::at(0x2A),
];

/// G11: a time that never comes, whether 0 means "off" or "at the MST": no cycle is longer than 65 000 us.
pub const TIMER_NEVER_US: u16 = 0xFFFF;

/// G13: 25H for CP0 to CP4; `None` keeps the reset value.
pub const PHASE_DEPENDENT: [Option<u16>; 5] = [None; 5];

/// G21, G22, G24: longest segment of a long element in words, one info word for each telegram (NINFO = 0).
pub const SEGMENT_WORDS: usize = 16;

/// G23: HS_AT on entry to CP2; afterwards it is carried along.
pub const INITIAL_HANDSHAKE: bool = false;

/// G25: times of CP1 and CP2 in us after the MST. The AT may start at 100 to 300 us (S-0-0006 is not yet known).
pub const INITIAL_AT_TIME_US: u16 = 150;
/// G25: earliest start of an MDT in CP1 and CP2, in us after the MST.
pub const INITIAL_MDT_TIME_US: u16 = 500;
/// G25: width of the span in which the master may start that MDT, in us.
pub const INITIAL_MDT_SPAN_US: u16 = 200;
/// G25: the instant at which the MDT of CP1 and CP2 is over at every bit rate, in us after the MST.
pub const INITIAL_COMMAND_VALID_US: u16 = 800;
/// G25: end of the block of CP1 and CP2, in us after the MST; below the shortest cycle time of these phases, 1 ms.
pub const INITIAL_END_US: u16 = 950;

/// G25, G28: TSCYC in CP0 to CP2, in us. The cycle time of these phases is the master's choice and not yet known:
/// the longest one keeps the chip from starting cycles of its own between two MSTs.
/// MSTEARLY is then set in every cycle and means nothing.
pub const INITIAL_CYCLE_US: u16 = 65_000;

/// G25: the constant in the formula of JTRDEL2 in us; one source prints 1, the other 2.
pub const TELEGRAM_WINDOW_MARGIN_US: u16 = 1;

/// G26: whether 18H is signed. It is never written below this value.
pub const LOWEST_TELEGRAM_WINDOW_START: i16 = 0;

/// G30: reset values and RAM contents are never relied upon: everything used is written, and the RAM read back, with these patterns.
pub const RAM_TEST_PATTERNS: [u16; 2] = [0xA5C3, 0x5A3C];

/// Not among the G-numbers, because sercon816.md 8.1 and sercos2.md 1.7 contradict each other: which bit of the AT's status
/// word the chip makes of a container's CMD_AT (word 0 bit 3). Bit 5 is where the protocol has it; bit 3 is "drive follows
/// its commands" there, which real drives with this chip do send, so the chip must leave it to the RAM.
///
/// This is the one unknown that the firmware cannot serve both ways: if the chip used bit 3, a master would see the
/// command change there. Settle it with a bus trace of a procedure command.
pub const COMMAND_CHANGE_IN_AT: u16 = 1 << 5;
