//! A service container in slave use: the hardware's half of the service channel. sercon816.md 6.4, 8.1, 8.4.
//!
//! A step is an MDT whose handshake bit differs from that of the AT. A step within an element is answered at once from
//! the buffers ("silent"); all others wait for the processor ("held") until it writes container word 0 with BUSY = 0.

use super::alternatives::{Alternatives, BufferSense, EndOfBuffer, Handshake, PointerMeaning};
use super::ram::Ram;

/// Word 0: handshake bit of the AT.
const HS_AT: u16 = 1 << 0;
/// Word 0: waiting for the processor.
const BUSY_AT: u16 = 1 << 1;
/// Word 0: error bit of the AT.
const ERR_AT: u16 = 1 << 2;
/// Word 0: handshake, busy and error bits, in the same place in the AT.
const AT_BITS: u16 = 0x0007;
/// Word 0: command change bit, bit 5 of the AT (sercos2.md 1.7; sercon816.md 6.4 numbers the container's bits only).
const CMD_AT: u16 = 1 << 3;
/// The bits of an AT's status word that belong to the chip.
pub(super) const OVERLAID: u16 = 0x0027;
const INT_ELEM_CHANGE: u16 = 1 << 12;
const INT_END_WRBUF: u16 = 1 << 13;
const INT_END_RDBUF: u16 = 1 << 14;
const INT_END_MDT: u16 = 1 << 15;
/// Word 1: last MDT erroneous.
const RECERR: u16 = 1 << 7;
/// Word 1 and the MDT's control word: handshake, direction, end, element.
const MDT_BITS: u16 = 0x003F;
const HS_MDT: u16 = 1 << 0;
const WRITE: u16 = 1 << 1;
const END_MDT: u16 = 1 << 2;
/// Word 1: software's field NINFO_READ.
const NINFO: u16 = 0x0300;
/// Offset of the first buffer word.
const BUFFERS: u16 = 5;

/// A step that waits for the processor.
#[derive(Copy, Clone, Debug)]
struct Held {
    write: bool,
    transferred: bool,
}

/// The state of a slave container that is not in the RAM.
#[derive(Copy, Clone, Debug, Default)]
pub(super) struct SlaveService {
    info: u16,
    held: Option<Held>,
    /// Per pointer word (2 and 3): a transfer has been made since software wrote it.
    moved: [bool; 2],
}

/// The two directions of the dialogue, as the slave sees them.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
enum Direction {
    Sent,
    Received,
}

impl SlaveService {
    /// Takes the control and info words of an accepted MDT; `true` asks for the interrupt.
    pub(super) fn on_mdt(
        &mut self,
        ram: &mut Ram,
        base: u16,
        control: u16,
        info: u16,
        alternatives: &Alternatives,
    ) -> bool {
        ram.change(base + 1, !NINFO, control & MDT_BITS);
        let word = ram.get(base);
        if (word ^ control) & HS_AT == 0 || word & BUSY_AT != 0 {
            return false;
        }

        let write = control & WRITE != 0;
        let element = control >> 3 & 7;
        let same = element != 0 && element == word >> 4 & 7 && write == (word & 1 << 7 != 0);
        let direction = if write { Direction::Received } else { Direction::Sent };
        let buffer = Buffer::of(direction, alternatives);
        let position = self.position(ram, base, buffer, alternatives);
        let last = ram.get(base + buffer.word) >> 8;
        let at_end = match alternatives.end_of_buffer {
            EndOfBuffer::WithLast => position >= last,
            EndOfBuffer::AfterLast => position > last,
        };
        let end = control & END_MDT != 0;

        let mut transferred = false;
        if write {
            let position = position.min(last + 1);
            ram.set(base + BUFFERS + position, info);
            self.advance(ram, base, buffer, position, last, alternatives);
            transferred = true;
        } else if same && position <= last {
            self.info = ram.get(base + BUFFERS + position);
            self.advance(ram, base, buffer, position, last, alternatives);
            transferred = true;
        }

        if same && !at_end && !end {
            ram.set(base, word ^ HS_AT);
            return false;
        }
        let mut set = BUSY_AT;
        if !same {
            set |= INT_ELEM_CHANGE;
        } else if at_end {
            set |= buffer.end_flag;
        }
        if end {
            set |= INT_END_MDT;
        }
        let toggled = match alternatives.handshake {
            Handshake::HoldUntilReady => word,
            Handshake::AckThenBusy => word & !HS_AT | control & HS_MDT,
        };
        ram.set(base, toggled | set);
        self.held = Some(Held { write, transferred });
        true
    }

    /// An MDT for this container came damaged.
    pub(super) fn on_damaged_mdt(ram: &mut Ram, base: u16) {
        ram.change(base + 1, 0, RECERR);
    }

    /// Software has written word `offset` of the container.
    pub(super) fn on_software_write(&mut self, ram: &mut Ram, base: u16, offset: u16, alternatives: &Alternatives) {
        match offset {
            0 => self.on_word_0(ram, base, alternatives),
            2 | 3 => self.moved[usize::from(offset - 2)] = false,
            _ => {}
        }
    }

    /// The service bits of the AT's status word, within [`OVERLAID`].
    pub(super) fn at_bits(ram: &Ram, base: u16) -> u16 {
        let word = ram.get(base);
        (word & AT_BITS) | (word & CMD_AT) << 2
    }

    /// The service info word of the AT.
    pub(super) fn at_info(&self) -> u16 {
        self.info
    }

    /// Releases a held step when BUSY is 0.
    fn on_word_0(&mut self, ram: &mut Ram, base: u16, alternatives: &Alternatives) {
        let word = ram.get(base);
        if word & BUSY_AT != 0 {
            return;
        }
        let held = self.held.take();
        let answer_due = held.is_some_and(|step| step.write || !step.transferred);
        if !answer_due && word & ERR_AT == 0 {
            return;
        }
        let buffer = Buffer::of(Direction::Sent, alternatives);
        let position = self.position(ram, base, buffer, alternatives);
        self.info = ram.get(base + BUFFERS + position);
        if held.is_some_and(|step| !step.write && !step.transferred) {
            let last = ram.get(base + buffer.word) >> 8;
            self.advance(ram, base, buffer, position, last, alternatives);
        }
    }

    /// The buffer word that the next transfer uses.
    fn position(&self, ram: &Ram, base: u16, buffer: Buffer, alternatives: &Alternatives) -> u16 {
        let pointer = ram.get(base + buffer.word) & 0xFF;
        match alternatives.pointer_meaning {
            PointerMeaning::Last if self.moved[buffer.index()] => pointer + 1,
            PointerMeaning::Next | PointerMeaning::Last => pointer,
        }
    }

    /// Moves the pointer past `position`, at most one word past the end.
    fn advance(
        &mut self,
        ram: &mut Ram,
        base: u16,
        buffer: Buffer,
        position: u16,
        last: u16,
        alternatives: &Alternatives,
    ) {
        let pointer = match alternatives.pointer_meaning {
            PointerMeaning::Next => position + 1,
            PointerMeaning::Last => position,
        };
        ram.change(base + buffer.word, 0x00FF, pointer.min(last + 1).min(0xFF));
        self.moved[buffer.index()] = true;
    }
}

/// Where a direction's pointers stand and which flag its end sets. G21.
#[derive(Copy, Clone, Debug)]
struct Buffer {
    word: u16,
    end_flag: u16,
}

impl Buffer {
    fn of(direction: Direction, alternatives: &Alternatives) -> Self {
        let written = match alternatives.buffer_sense {
            BufferSense::WriteIsSent => Direction::Sent,
            BufferSense::WriteIsReceived => Direction::Received,
        };
        if direction == written {
            Self { word: 2, end_flag: INT_END_WRBUF }
        } else {
            Self { word: 3, end_flag: INT_END_RDBUF }
        }
    }

    fn index(self) -> usize {
        usize::from(self.word - 2)
    }
}
