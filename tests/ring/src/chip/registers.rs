//! The control registers. sercon816.md 4 and 5.

use super::alternatives::{
    Alternatives, BlockSelect, PhaseReadBack, ProcessingEnable, ResetValues, TimerOrder, UpperByte,
};
use super::interrupts::Flags;
use super::noise::Noise;
use super::timing::Straps;
use crate::wire::BitRate;

/// Number of control registers, 00H to 2AH.
const COUNT: usize = 0x2B;

const VERSION: usize = 0x00;
const CONFIGURATION: usize = 0x01;
const COMMAND: usize = 0x03;
const STATUS_0: usize = 0x04;
const STATUS_1: usize = 0x05;
const PHASE: usize = 0x0A;
const RECEIVED_PHASE: usize = 0x0B;
const SERVICE_TIMEOUTS: usize = 0x0D;
const CLOCK_DIVIDER: usize = 0x0E;
const CYCLE_TIME: usize = 0x0F;
const RING_DELAY: usize = 0x11;
const COUNTER_PRESET: usize = 0x13;
const CYCLE_START: usize = 0x14;
const MST_WINDOW: usize = 0x15;
const TELEGRAM_WINDOW: usize = 0x18;
const TIMERS: usize = 0x1A;

/// 00H of the SERCON816.
const VERSION_VALUE: u16 = 0x0010;
/// 01H: reset flag.
const RSTFL: u16 = 1 << 0;
/// 01H: software reset.
const SWRST: u16 = 1 << 1;
/// 01H: repeater on.
const REPON: u16 = 1 << 3;
/// 01H: state of the pin SBAUD, read only.
const SBAUD: u16 = 1 << 11;
/// 03H: transmission block 1.
const BLOCK_1: u16 = 1 << 2;
/// 03H: start, processing enabled.
const START: u16 = 1 << 8;

/// Bits of 04H.
pub(super) mod status_0 {
    pub(in crate::chip) const RDIST: u16 = 1 << 0;
    pub(in crate::chip) const FIBBR: u16 = 1 << 1;
    pub(in crate::chip) const MSTEARLY: u16 = 1 << 7;
    pub(in crate::chip) const MSTLATE: u16 = 1 << 8;
    pub(in crate::chip) const MSTMISS: u16 = 1 << 9;
    /// What the alternative of G32 takes for "telegram error".
    pub(in crate::chip) const TELEGRAM_ERROR: u16 = 1 << 10;
    /// Bits without a known meaning.
    pub(in crate::chip) const UNKNOWN: u16 = 0xFC7C;
}

/// What a register write asks of the rest of the chip.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub(super) enum Effect {
    /// Nothing more.
    None,
    /// 01H bit 1.
    SoftwareReset,
    /// TINT `0` to `3` has a new time.
    Timer(usize),
    /// 03H or 01H changed: a master may have to start or stop its cycle.
    Command,
}

/// The registers themselves.
pub(super) struct RegisterFile {
    words: [u16; COUNT],
}

impl RegisterFile {
    /// The state after a reset. G30.
    pub(super) fn reset(straps: Straps, alternatives: &Alternatives, noise: &mut Noise) -> Self {
        let mut words = [0; COUNT];
        if alternatives.reset_values == ResetValues::Garbage {
            words.fill_with(|| noise.word());
            for cleared in [STATUS_0, STATUS_1, RECEIVED_PHASE, RING_DELAY] {
                words[cleared] = 0;
            }
        }
        words[VERSION] = VERSION_VALUE;
        words[CONFIGURATION] = RSTFL | REPON;
        if matches!(straps.bit_rate, BitRate::M2 | BitRate::M8) {
            words[CONFIGURATION] |= SBAUD;
        }
        Self { words }
    }

    pub(super) fn read(&self, register: u16, alternatives: &Alternatives, noise: &mut Noise) -> u16 {
        let Some(&stored) = self.words.get(usize::from(register)) else {
            return 0;
        };
        match usize::from(register) {
            PHASE if alternatives.phase_read_back == PhaseReadBack::Received => self.words[RECEIVED_PHASE],
            RECEIVED_PHASE if alternatives.received_phase_upper_byte == UpperByte::Garbage => {
                stored | noise.word() & 0xFF00
            }
            _ => stored,
        }
    }

    pub(super) fn write(&mut self, register: u16, value: u16, alternatives: &Alternatives) -> Effect {
        let index = usize::from(register);
        match index {
            VERSION | RECEIVED_PHASE | RING_DELAY | COUNT.. => Effect::None,
            CONFIGURATION if value & SWRST != 0 => Effect::SoftwareReset,
            CONFIGURATION => {
                self.words[index] = value & !SBAUD | self.words[index] & SBAUD;
                Effect::Command
            }
            STATUS_0 | STATUS_1 => {
                self.words[index] &= !value;
                Effect::None
            }
            COMMAND => {
                self.words[index] = value;
                Effect::Command
            }
            0x1A..=0x1D => {
                self.words[index] = value;
                Effect::Timer(timer_index(index - TIMERS, alternatives))
            }
            _ => {
                self.words[index] = value;
                Effect::None
            }
        }
    }

    pub(super) fn raise_0(&mut self, flags: u16) {
        self.words[STATUS_0] |= flags;
    }

    pub(super) fn raise_1(&mut self, flags: u16) {
        self.words[STATUS_1] |= flags;
    }

    pub(super) fn flags(&self) -> Flags {
        let pair = |low: usize| u32::from(self.words[low]) | u32::from(self.words[low + 1]) << 16;
        Flags { status: pair(0x04), enable: pair(0x06), routing: pair(0x08) }
    }

    /// A master switches its repeater off, a slave keeps it on.
    pub(super) fn repeater_on(&self) -> bool {
        self.words[CONFIGURATION] & REPON != 0
    }

    pub(super) fn start_commanded(&self) -> bool {
        self.words[COMMAND] & START != 0
    }

    pub(super) fn command(&self) -> u16 {
        self.words[COMMAND]
    }

    pub(super) fn processing_enabled(&self, alternatives: &Alternatives) -> bool {
        self.start_commanded() || alternatives.processing_enable == ProcessingEnable::Always
    }

    /// The transmission block in force, 0 or 1. G7.
    pub(super) fn block(&self, alternatives: &Alternatives) -> u16 {
        u16::from(match alternatives.block_select {
            BlockSelect::Bit2Of03H => self.words[COMMAND] & BLOCK_1 != 0,
            BlockSelect::PhaseIn0AH => self.phase() >= 3,
            BlockSelect::AlwaysBlock0 => false,
        })
    }

    /// Low byte of 0AH: the phase that a master sends.
    pub(super) fn phase(&self) -> u8 {
        self.words[PHASE] as u8
    }

    pub(super) fn set_received_phase(&mut self, phase: u8) {
        self.words[RECEIVED_PHASE] = u16::from(phase);
    }

    pub(super) fn set_ring_delay(&mut self, ticks: u16) {
        self.words[RING_DELAY] = self.words[COUNTER_PRESET].wrapping_add(ticks);
    }

    /// Cycles until a handshake timeout, and until a BUSY timeout; 0 is never.
    pub(super) fn service_timeouts(&self) -> (u8, u8) {
        let word = self.words[SERVICE_TIMEOUTS];
        (word as u8, (word >> 8) as u8)
    }

    pub(super) fn clock_divider(&self) -> u16 {
        self.words[CLOCK_DIVIDER]
    }

    pub(super) fn counter_preset(&self) -> u16 {
        self.words[COUNTER_PRESET]
    }

    pub(super) fn cycle_start_delay(&self) -> u16 {
        self.words[CYCLE_START]
    }

    /// TSCYC0 or TSCYC1 by the block in force, in ticks.
    pub(super) fn cycle_time(&self, alternatives: &Alternatives) -> u16 {
        self.words[CYCLE_TIME + usize::from(self.block(alternatives))]
    }

    /// JTSCYC1 and JTSCYC2.
    pub(super) fn mst_window(&self) -> (i16, i16) {
        (self.words[MST_WINDOW] as i16, self.words[MST_WINDOW + 1] as i16)
    }

    /// JTRDEL1 and JTRDEL2 as they stand.
    pub(super) fn telegram_window(&self) -> (u16, u16) {
        (self.words[TELEGRAM_WINDOW], self.words[TELEGRAM_WINDOW + 1])
    }

    /// The time of TINT `index`, 0 to 3.
    pub(super) fn timer(&self, index: usize, alternatives: &Alternatives) -> u16 {
        self.words[TIMERS + timer_index(index, alternatives)]
    }
}

/// From the position of a timer register to its TINT number, and back. G11.
fn timer_index(position: usize, alternatives: &Alternatives) -> usize {
    match alternatives.timer_order {
        TimerOrder::Ascending => position,
        TimerOrder::Descending => 3 - position,
    }
}
