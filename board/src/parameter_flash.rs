//! The two sectors of flash that hold the parameters (RM0090 3.6).
//!
//! The part has one bank: while a word is programmed or a sector erased, no instruction is fetched and the processor stands.
//!
//! | operation | typical | at most (DocID022152, "Flash memory programming", 32 bits at once) |
//! |---|---|---|
//! | a word | 16 us | 100 us |
//! | a sector of 128 KiB | 1 s | 2 s |
//!
//! So a word waits for a [`Permit`], and a sector is erased at start only: the watchdogs must not run then. Every word and every erased sector is read
//! back, past the data cache: the controller writes into a line that is cached as well as into the cells (RM0090 3.6.4).
//!
//! `stm32f4xx_hal::flash` is not used: it programs and erases by bytes, which takes four times as long for a word and twice as long for a sector,
//! leaves old error flags and the caches as they are, panics where the controller stays locked, and waits inside a call for all the bytes.

use core::future::poll_fn;
use core::task::Poll;

use cortex_m::{asm, interrupt};
use embedded_storage_async::nor_flash::{
    ErrorType, MultiwriteNorFlash, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash,
};
use stm32f4xx_hal::pac;

pub use crate::permit::Permit;

/// When a word may be programmed; for whoever knows what is due.
pub static PERMIT: Permit = Permit::new();

/// Bytes of one of the two sectors.
pub const SECTOR_BYTES: u32 = 128 * 1024;

/// Why the flash did not do what it was asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, defmt::Format)]
pub enum ParameterFlashError {
    /// An offset or a length is no multiple of a word or of a sector.
    NotAligned,
    /// Beyond the two sectors.
    OutOfBounds,
    /// A sector is erased only while [`Permit::always`] holds.
    EraseNotPermitted,
    /// The controller did not take the keys: somebody has given wrong ones since the last reset.
    Locked,
    /// WRPERR: the option bytes protect the sector.
    WriteProtected,
    /// PGAERR: data across a row of 128 bits.
    Alignment,
    /// PGPERR: an access of another width than 32 bits.
    Parallelism,
    /// PGSERR: a write without the controller being set up for it.
    Sequence,
    /// OPERR, without one of the others.
    Operation,
    /// A word reads back otherwise than it was written: worn out, or a one was written over a zero.
    NotWritten,
    /// A sector does not read as ones behind its erase: worn out.
    NotErased,
}

impl NorFlashError for ParameterFlashError {
    fn kind(&self) -> NorFlashErrorKind {
        match self {
            Self::NotAligned => NorFlashErrorKind::NotAligned,
            Self::OutOfBounds => NorFlashErrorKind::OutOfBounds,
            _ => NorFlashErrorKind::Other,
        }
    }
}

/// The two sectors as one memory, from offset 0 on, and the controller of the whole flash, which nobody else has.
#[derive(Debug)]
pub struct ParameterFlash {
    registers: pac::FLASH,
}

/// Where the two sectors are: first address, and the one behind the last; from memory.x.
fn range() -> (u32, u32) {
    unsafe extern "C" {
        static _parameter_flash_start: u32;
        static _parameter_flash_end: u32;
    }
    ((&raw const _parameter_flash_start).addr() as u32, (&raw const _parameter_flash_end).addr() as u32)
}

/// The address of `bytes` bytes at an offset, which lie in the two sectors and are multiples of `unit`, as is the offset.
fn address(offset: u32, bytes: usize, unit: u32) -> Result<u32, ParameterFlashError> {
    let (start, end) = range();
    let out_of_bounds = ParameterFlashError::OutOfBounds;
    let bytes = u32::try_from(bytes).map_err(|_| out_of_bounds)?;
    if !offset.is_multiple_of(unit) || !bytes.is_multiple_of(unit) {
        return Err(ParameterFlashError::NotAligned);
    }
    let from = start.checked_add(offset).ok_or(out_of_bounds)?;
    let to = from.checked_add(bytes).ok_or(out_of_bounds)?;
    if to <= end { Ok(from) } else { Err(out_of_bounds) }
}

/// The word at an address of the two sectors.
fn word(address: u32) -> u32 {
    // SAFETY: the address is aligned and in the two sectors, which are there to be read; volatile, as they change.
    unsafe { core::ptr::with_exposed_provenance::<u32>(address as usize).read_volatile() }
}

impl ParameterFlash {
    /// Takes the controller over, locked as the reset left it. The wait states are [`crate::clocks`]'.
    pub(crate) const fn new(registers: pac::FLASH) -> Self {
        Self { registers }
    }

    /// Opens the controller, with no error of before in its status.
    fn unlock(&self) -> Result<(), ParameterFlashError> {
        const KEYS: [u32; 2] = [0x4567_0123, 0xCDEF_89AB];
        // A key that comes when it is open locks it until the next reset.
        if self.registers.cr().read().lock().is_locked() {
            for key in KEYS {
                self.registers.keyr().write(|w| w.key().set(key));
            }
        }
        if self.registers.cr().read().lock().is_locked() {
            return Err(ParameterFlashError::Locked);
        }
        self.registers.sr().write(|w| {
            w.operr().clear().wrperr().clear().pgaerr().clear().pgperr().clear().pgserr().clear().eop().clear()
        });
        Ok(())
    }

    /// Waits for the end of an operation, locks the controller again and drops what the data cache has from before.
    fn finish(&self) -> Result<(), ParameterFlashError> {
        asm::dsb();
        while self.registers.sr().read().bsy().is_busy() {}
        let status = self.registers.sr().read();
        self.registers.cr().modify(|_, w| w.pg().clear_bit().ser().clear_bit());
        self.registers.cr().modify(|_, w| w.lock().locked());
        let access = self.registers.acr();
        // Only a cache that is disabled can be reset.
        access.modify(|_, w| w.dcen().disabled());
        access.modify(|_, w| w.dcrst().set_bit());
        access.modify(|_, w| w.dcrst().clear_bit());
        access.modify(|_, w| w.dcen().enabled());
        asm::dsb();
        let errors = [
            (status.wrperr().bit_is_set(), ParameterFlashError::WriteProtected),
            (status.pgaerr().bit_is_set(), ParameterFlashError::Alignment),
            (status.pgperr().bit_is_set(), ParameterFlashError::Parallelism),
            (status.pgserr().bit_is_set(), ParameterFlashError::Sequence),
            (status.operr().bit_is_set(), ParameterFlashError::Operation),
        ];
        errors.into_iter().find(|(is_set, _)| *is_set).map_or(Ok(()), |(_, error)| Err(error))
    }

    /// Behind an erase (RM0090 3.6.4). Not behind a word: nothing is executed from there, and the tasks would find an empty cache.
    fn drop_cached_instructions(&self) {
        let access = self.registers.acr();
        access.modify(|_, w| w.icen().disabled());
        access.modify(|_, w| w.icrst().set_bit());
        access.modify(|_, w| w.icrst().clear_bit());
        access.modify(|_, w| w.icen().enabled());
    }

    /// Programs one word, which must lie in the two sectors, and reads it back.
    fn program(&self, address: u32, value: u32) -> Result<(), ParameterFlashError> {
        self.unlock()?;
        // 32 bits at once need 2.7 V at least; the board has 3.3 V.
        self.registers.cr().write(|w| w.lock().unlocked().psize().psize32().pg().program());
        // SAFETY: the address is aligned and in the two sectors, where the linker puts nothing: no code and no constant changes.
        unsafe { core::ptr::with_exposed_provenance_mut::<u32>(address as usize).write_volatile(value) };
        self.finish()?;
        if word(address) == value { Ok(()) } else { Err(ParameterFlashError::NotWritten) }
    }

    /// Erases the sector that begins at an address of the two sectors, and reads it back.
    fn erase_sector(&self, address: u32) -> Result<(), ParameterFlashError> {
        const FLASH: u32 = 0x0800_0000;
        /// Before the first sector of 128 KiB lie four of 16 KiB and one of 64 KiB, 128 KiB in all.
        const SMALLER_SECTORS: u32 = 5;
        let number = (address.wrapping_sub(FLASH) / SECTOR_BYTES).wrapping_add(SMALLER_SECTORS).wrapping_sub(1);
        self.unlock()?;
        let control = self.registers.cr();
        // SAFETY: the number of a sector of the parameters: no code and no constant lies there.
        control
            .write(|w| unsafe { w.lock().unlocked().psize().psize32().ser().sector_erase().snb().bits(number as u8) });
        control.modify(|_, w| w.strt().start());
        let finished = self.finish();
        self.drop_cached_instructions();
        finished?;
        let words = (address..address.wrapping_add(SECTOR_BYTES)).step_by(size_of::<u32>());
        if words.map(word).all(|word| word == u32::MAX) { Ok(()) } else { Err(ParameterFlashError::NotErased) }
    }
}

impl ErrorType for ParameterFlash {
    type Error = ParameterFlashError;
}

impl ReadNorFlash for ParameterFlash {
    const READ_SIZE: usize = 1;

    /// More than a few bytes wait for a permit, too: whoever reads a whole page, an item after the other, to check them, lets the watchdog be fed between them.
    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), ParameterFlashError> {
        const AT_ONCE: usize = 64;
        if bytes.len() > AT_ONCE {
            poll_fn(|_| if PERMIT.take(crate::timestamp::microseconds()) { Poll::Ready(()) } else { Poll::Pending })
                .await;
        }
        let from = core::ptr::with_exposed_provenance::<u8>(address(offset, bytes.len(), 1)? as usize);
        // SAFETY: so many bytes are there, in the two sectors; nobody changes them meanwhile, as that takes `self`, and the barrier behind each
        // operation lets no earlier read stand for this one.
        unsafe { core::ptr::copy_nonoverlapping(from, bytes.as_mut_ptr(), bytes.len()) };
        Ok(())
    }

    fn capacity(&self) -> usize {
        let (start, end) = range();
        end.wrapping_sub(start) as usize
    }
}

impl NorFlash for ParameterFlash {
    const WRITE_SIZE: usize = size_of::<u32>();
    const ERASE_SIZE: usize = SECTOR_BYTES as usize;

    /// Stops the processor for 1 s, 2 s at most, for each sector. Never waits: while it is not permitted it is refused.
    async fn erase(&mut self, from: u32, to: u32) -> Result<(), ParameterFlashError> {
        let bytes = to.checked_sub(from).ok_or(ParameterFlashError::OutOfBounds)?;
        let first = address(from, bytes as usize, SECTOR_BYTES)?;
        if !PERMIT.is_always() {
            return Err(ParameterFlashError::EraseNotPermitted);
        }
        for sector in (first..first.wrapping_add(bytes)).step_by(Self::ERASE_SIZE) {
            self.erase_sector(sector)?;
        }
        Ok(())
    }

    /// Waits for a permit before each word. Nobody wakes the future: whoever grants polls it.
    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), ParameterFlashError> {
        let first = address(offset, bytes.len(), size_of::<u32>() as u32)?;
        for (address, word) in (first..).step_by(Self::WRITE_SIZE).zip(bytes.as_chunks().0) {
            let value = u32::from_le_bytes(*word);
            poll_fn(|_| {
                // A grant is for now: what interrupts behind it would put the word off to where something is due. The processor stands anyway.
                interrupt::free(|_| match PERMIT.take(crate::timestamp::microseconds()) {
                    true => Poll::Ready(self.program(address, value)),
                    false => Poll::Pending,
                })
            })
            .await?;
        }
        Ok(())
    }
}

/// Words may be written over: "successive write operations are possible without the need of an erase operation when changing bits from 1 to 0"
/// (RM0090 3.6.4). The part has no error-correcting code that would forbid it.
impl MultiwriteNorFlash for ParameterFlash {}
