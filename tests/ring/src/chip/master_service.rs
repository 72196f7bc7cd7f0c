//! A service container in master use: the hardware's half of a transfer that the master's software has set up.
//! sercon816.md 6.4 and 8.5.
//!
//! Software fills the buffers and pointers and writes word 0 with M_BUSY = 0. The container then repeats its word in every
//! MDT until the AT acknowledges it, goes on to the next word, and stops with M_BUSY = 1 at the end of the buffer, on an
//! error of the slave, or on a timeout of 0DH. INT_SC_ERR is never set: no source says what sets it in a master.

use super::ram::Ram;

const HS_MDT: u16 = 1 << 0;
const WRITE: u16 = 1 << 1;
const END_MDT: u16 = 1 << 2;
/// Word 0: bits that go into the MDT's control word.
const MDT_BITS: u16 = 0x003F;
const SETEND: u16 = 1 << 6;
const M_BUSY: u16 = 1 << 7;
const INT_ERR: u16 = 1 << 12;
const INT_END_WRBUF: u16 = 1 << 13;
const INT_END_RDBUF: u16 = 1 << 14;

/// Word 1 and the AT's status word: handshake, busy, error.
const AT_BITS: u16 = 0x0007;
/// The command change bit of the AT's status word (sercos2.md 1.7), bit 3 of word 1.
const COMMAND_CHANGE: u16 = 1 << 5;
const HS_AT: u16 = 1 << 0;
const BUSY_AT: u16 = 1 << 1;
const ERR_AT: u16 = 1 << 2;
const CMD_AT: u16 = 1 << 3;
const RECERR: u16 = 1 << 7;
const NINFO: u16 = 0x0300;

/// Word 4: 0 while ERR_CNT counts handshake differences, 1 while it counts BUSY.
const BUSY_CNT: u16 = 1 << 8;
const INT_HS_TIMEOUT: u16 = 1 << 10;
const INT_BUSY_TIMEOUT: u16 = 1 << 11;
const INT_CMD: u16 = 1 << 12;

const BUFFERS: u16 = 5;

/// The state of a master container that is not in the RAM.
#[derive(Copy, Clone, Debug, Default)]
pub(super) struct MasterService {
    info: u16,
    /// The word in force has been sent at least once.
    sent: bool,
}

impl MasterService {
    /// The service bits (5..0) and the info word of the MDT that is being sent.
    pub(super) fn on_sending(&mut self, ram: &Ram, base: u16) -> (u16, u16) {
        let word = ram.get(base);
        if word & M_BUSY == 0 {
            self.sent = true;
            if word & WRITE != 0 {
                self.info = ram.get(base + BUFFERS + (ram.get(base + 2) & 0xFF));
            }
        }
        (word & MDT_BITS, self.info)
    }

    /// Takes the status and info words of an accepted AT; `true` asks for the interrupt.
    pub(super) fn on_at(&mut self, ram: &mut Ram, base: u16, status: u16, info: u16, timeouts: (u8, u8)) -> bool {
        let mut interrupt = false;
        let command_change = if status & COMMAND_CHANGE == 0 { 0 } else { CMD_AT };
        let status = status & AT_BITS | command_change;
        if status & !ram.get(base + 1) & CMD_AT != 0 {
            ram.change(base + 4, 0, INT_CMD);
            interrupt = true;
        }
        ram.change(base + 1, !NINFO, status);
        let word = ram.get(base);
        if word & M_BUSY != 0 || !self.sent {
            return interrupt;
        }
        if status & BUSY_AT != 0 {
            return self.count(ram, base, BUSY_CNT, timeouts) || interrupt;
        }
        if (status ^ word) & HS_AT != 0 {
            return self.count(ram, base, 0, timeouts) || interrupt;
        }
        ram.change(base + 4, 0x00FF | BUSY_CNT, 0);
        self.acknowledged(ram, base, word, status, info) || interrupt
    }

    /// No good AT came in the cycle; `true` asks for the interrupt.
    pub(super) fn on_missing_at(&mut self, ram: &mut Ram, base: u16, timeouts: (u8, u8)) -> bool {
        ram.change(base + 1, 0, RECERR);
        ram.get(base) & M_BUSY == 0 && self.sent && self.count(ram, base, 0, timeouts)
    }

    /// Software has written word `offset` of the container.
    pub(super) fn on_software_write(&mut self, offset: u16) {
        if offset == 0 {
            self.sent = false;
        }
    }

    /// The slave has taken the word, or delivered it.
    fn acknowledged(&mut self, ram: &mut Ram, base: u16, word: u16, status: u16, info: u16) -> bool {
        let read_position = ram.get(base + 3) & 0xFF;
        ram.set(base + BUFFERS + read_position, info);
        if status & ERR_AT != 0 {
            ram.change(base, 0, M_BUSY | INT_ERR);
            return true;
        }
        let (pointers, end_flag) =
            if word & WRITE != 0 { (base + 2, INT_END_WRBUF) } else { (base + 3, INT_END_RDBUF) };
        let (position, last) = (ram.get(pointers) & 0xFF, ram.get(pointers) >> 8);
        if position >= last || word & END_MDT != 0 {
            ram.change(base, 0, M_BUSY | end_flag);
            return true;
        }
        ram.change(pointers, 0x00FF, position + 1);
        let mut next = word ^ HS_MDT;
        if word & SETEND != 0 && position + 1 == last {
            next |= END_MDT;
        }
        ram.set(base, next);
        self.sent = false;
        false
    }

    /// Counts a cycle without progress.
    fn count(&mut self, ram: &mut Ram, base: u16, kind: u16, (handshake, busy): (u8, u8)) -> bool {
        let word = ram.get(base + 4);
        let counted = if word & BUSY_CNT == kind { (word & 0xFF) + 1 } else { 1 };
        let (limit, flag) =
            if kind == BUSY_CNT { (u16::from(busy), INT_BUSY_TIMEOUT) } else { (u16::from(handshake), INT_HS_TIMEOUT) };
        ram.change(base + 4, 0x00FF | BUSY_CNT, counted.min(0xFF) | kind);
        if limit == 0 || counted < limit {
            return false;
        }
        ram.change(base + 4, 0, flag);
        ram.change(base, 0, M_BUSY);
        true
    }
}
