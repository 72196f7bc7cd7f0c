//! The flash controller: access control, and programming and erasing of the two sectors that the parameters have (RM0090 3.9).
//!
//! While an operation runs the processor stands, as it does on the part, whose only bank it fetches from. What would erase or change the program is
//! refused. A write without programming being set up does what it does on the part: nothing, and its error flag is set.

use std::ops::Range;
use std::time::Duration;

use emulator_link::protocol::PARAMETER_FLASH;
use flash::{Cut, FlashModel, SECTOR_BYTES, SECTORS, Width};

const ACCESS_CONTROL: u32 = 0x00;
const KEY: u32 = 0x04;
const STATUS: u32 = 0x0C;
const CONTROL: u32 = 0x10;

const KEYS: [u32; 2] = [0x4567_0123, 0xCDEF_89AB];

/// FLASH_SR: flags that a one clears.
const ALIGNMENT_ERROR: u32 = 1 << 5;
const PARALLELISM_ERROR: u32 = 1 << 6;
const SEQUENCE_ERROR: u32 = 1 << 7;
const FLAGS: u32 = 0xF3;

/// FLASH_CR.
const PROGRAM: u32 = 1;
const SECTOR_ERASE: u32 = 1 << 1;
const MASS_ERASE: u32 = 1 << 2;
const START: u32 = 1 << 16;
const LOCK: u32 = 1 << 31;
/// PG, SER, MER, SNB, PSIZE.
const KEPT: u32 = 0x37F;

/// FLASH_ACR: each cache with its reset.
const CACHES: [(u32, u32); 2] = [(1 << 9, 1 << 11), (1 << 10, 1 << 12)];

/// Number of the first of the two sectors.
const FIRST_SECTOR: usize = 10;

/// How far the keys have come.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Access {
    #[default]
    Locked,
    FirstKey,
    Open,
    /// Until the next reset.
    Jammed,
}

/// What an access has begun.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Operation {
    /// Bytes of the two sectors that are different now.
    pub(crate) changed: Range<usize>,
    /// So long the processor stands.
    pub(crate) takes: Duration,
    /// Then the supply is gone.
    pub(crate) is_cut: bool,
}

/// Registers and contents.
#[derive(Clone, Debug, Default)]
pub(crate) struct FlashController {
    pub(crate) access_control: u32,
    status: u32,
    control: u32,
    access: Access,
    /// The caches may have what an erase has removed: each has its bit, as it is reset.
    stale: u32,
    pub(crate) sectors: FlashModel,
    begun: Option<Operation>,
}

impl FlashController {
    /// Behind a reset, with the contents of before.
    pub(crate) fn after_reset(sectors: FlashModel) -> Self {
        Self { sectors, ..Self::default() }
    }

    /// Nothing can be programmed or erased without the keys.
    pub(crate) fn is_locked(&self) -> bool {
        self.access != Access::Open
    }

    /// Wait states.
    pub(crate) fn latency(&self) -> u32 {
        self.access_control & 7
    }

    /// The operation that the last access has begun.
    pub(crate) fn take_begun(&mut self) -> Option<Operation> {
        self.begun.take()
    }

    pub(crate) fn read(&self, offset: u32) -> Option<u32> {
        Some(match offset {
            ACCESS_CONTROL => self.access_control,
            // BSY is never seen: the processor stands meanwhile.
            STATUS => self.status,
            CONTROL => self.control | if self.is_locked() { LOCK } else { 0 },
            _ => return None,
        })
    }

    pub(crate) fn write(&mut self, offset: u32, value: u32) -> Option<Result<(), String>> {
        Some(match offset {
            ACCESS_CONTROL => self.control_access(value),
            KEY => {
                self.take_key(value);
                Ok(())
            }
            STATUS => {
                self.status &= !(value & FLAGS);
                Ok(())
            }
            CONTROL => self.set_control(value),
            _ => return None,
        })
    }

    fn control_access(&mut self, value: u32) -> Result<(), String> {
        for (enable, reset) in CACHES {
            if value & reset != 0 && self.access_control & enable != 0 {
                return Err("a cache is reset while it is enabled (RM0090 3.9.1)".into());
            }
        }
        self.stale &= !value;
        self.access_control = value;
        Ok(())
    }

    fn take_key(&mut self, key: u32) {
        self.access = match self.access {
            Access::Locked if key == KEYS[0] => Access::FirstKey,
            Access::FirstKey if key == KEYS[1] => Access::Open,
            _ => Access::Jammed,
        };
    }

    fn set_control(&mut self, value: u32) -> Result<(), String> {
        if self.is_locked() {
            return Ok(());
        }
        if value & !(KEPT | START | LOCK) != 0 {
            return Err(format!("bits of FLASH_CR that are not modelled: {value:#010x}"));
        }
        self.control = value & KEPT;
        if value & LOCK != 0 {
            self.access = Access::Locked;
            return Ok(());
        }
        if value & MASS_ERASE != 0 {
            return Err("an erase of the whole flash".into());
        }
        if value & START != 0 { self.erase() } else { Ok(()) }
    }

    /// Of PSIZE; 64 bits need a voltage of their own.
    fn width(&self) -> Result<Width, String> {
        match self.control >> 8 & 3 {
            0 => Ok(Width::Byte),
            1 => Ok(Width::HalfWord),
            2 => Ok(Width::Word),
            _ => Err("64 bits at once (PSIZE = 3) need a supply at VPP, which the board has not".into()),
        }
    }

    fn erase(&mut self) -> Result<(), String> {
        if self.control & (SECTOR_ERASE | PROGRAM) != SECTOR_ERASE {
            self.status |= SEQUENCE_ERROR;
            return Ok(());
        }
        let number = (self.control >> 3 & 0xF) as usize;
        let sector = number.checked_sub(FIRST_SECTOR).filter(|sector| *sector < SECTORS);
        let Some(sector) = sector else {
            return Err(format!("an erase of sector {number}, which is the program's"));
        };
        self.check_caches()?;
        let width = self.width()?;
        let ended = self.sectors.erase(sector, width);
        self.stale = CACHES.iter().fold(0, |all, (_, reset)| all | reset);
        self.begin(sector * SECTOR_BYTES..(sector + 1) * SECTOR_BYTES, ended);
        Ok(())
    }

    /// A write at an address of the two sectors.
    pub(crate) fn program(&mut self, address: u32, bytes: u32, value: u32) -> Result<(), String> {
        let offset = (address - PARAMETER_FLASH) as usize;
        if self.is_locked() || self.control & (PROGRAM | SECTOR_ERASE) != PROGRAM {
            self.status |= SEQUENCE_ERROR;
            return Ok(());
        }
        let width = self.width()?;
        let bytes = bytes as usize;
        if offset % 16 + bytes > 16 {
            self.status |= ALIGNMENT_ERROR;
        } else if bytes != width.bytes() || !offset.is_multiple_of(bytes) {
            // The processor divides what is not aligned into narrower accesses.
            self.status |= PARALLELISM_ERROR;
        } else {
            self.check_caches()?;
            let ended = self.sectors.program(offset, value, width);
            self.begin(offset..offset + bytes, ended);
        }
        Ok(())
    }

    fn check_caches(&self) -> Result<(), String> {
        match self.stale {
            0 => Ok(()),
            _ => Err("the caches were not reset behind an erase (RM0090 3.6.4)".into()),
        }
    }

    fn begin(&mut self, changed: Range<usize>, ended: Result<Duration, Cut>) {
        let (takes, is_cut) = match ended {
            Ok(takes) => (takes, false),
            Err(Cut { after }) => (after, true),
        };
        self.begun = Some(Operation { changed, takes, is_cut });
    }
}

#[cfg(test)]
mod tests;
