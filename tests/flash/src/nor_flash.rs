//! The model as the drive's parameter memory sees its flash: words of 32 bits, each read back.

use embedded_storage_async::nor_flash::{
    ErrorType, MultiwriteNorFlash, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash,
};

use crate::{CAPACITY, FlashModel, SECTOR_BYTES, Width};

/// Why an operation failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum FlashError {
    /// An offset or a length is no multiple of a word or of a sector.
    #[error("an offset or a length is no multiple of what is written or erased at once")]
    NotAligned,
    /// Beyond the two sectors.
    #[error("beyond the {CAPACITY} bytes of the two sectors")]
    OutOfBounds,
    /// A word reads back otherwise than it was written: a one was written over a zero.
    #[error("a word reads back otherwise than it was written")]
    NotWritten,
    /// The supply has gone; nothing is answered until [`FlashModel::restore_supply`].
    #[error("the supply has gone")]
    NoSupply,
}

impl NorFlashError for FlashError {
    fn kind(&self) -> NorFlashErrorKind {
        match self {
            Self::NotAligned => NorFlashErrorKind::NotAligned,
            Self::OutOfBounds => NorFlashErrorKind::OutOfBounds,
            Self::NotWritten | Self::NoSupply => NorFlashErrorKind::Other,
        }
    }
}

impl ErrorType for FlashModel {
    type Error = FlashError;
}

impl ReadNorFlash for FlashModel {
    const READ_SIZE: usize = 1;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), FlashError> {
        let from = offset as usize;
        let contents = self.contents().get(from..from + bytes.len()).ok_or(FlashError::OutOfBounds)?;
        if !self.is_supplied() {
            return Err(FlashError::NoSupply);
        }
        bytes.copy_from_slice(contents);
        Ok(())
    }

    fn capacity(&self) -> usize {
        CAPACITY
    }
}

impl NorFlash for FlashModel {
    const WRITE_SIZE: usize = Width::Word.bytes();
    const ERASE_SIZE: usize = SECTOR_BYTES;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), FlashError> {
        let (from, to) = (from as usize, to as usize);
        check(from, to, SECTOR_BYTES)?;
        for sector in from / SECTOR_BYTES..to / SECTOR_BYTES {
            FlashModel::erase(self, sector, Width::Word).map_err(|_| FlashError::NoSupply)?;
        }
        Ok(())
    }

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), FlashError> {
        let from = offset as usize;
        check(from, from + bytes.len(), Self::WRITE_SIZE)?;
        for (index, word) in bytes.as_chunks().0.iter().enumerate() {
            let (offset, value) = (from + 4 * index, u32::from_le_bytes(*word));
            self.program(offset, value, Width::Word).map_err(|_| FlashError::NoSupply)?;
            if self.value(offset, Width::Word) != value {
                return Err(FlashError::NotWritten);
            }
        }
        Ok(())
    }
}

/// Words may be written over: RM0090 3.6.4, "successive write operations are possible without the need of an erase operation when changing bits
/// from 1 to 0". The part has no error-correcting code that would forbid it.
impl MultiwriteNorFlash for FlashModel {}

const fn check(from: usize, to: usize, unit: usize) -> Result<(), FlashError> {
    if !from.is_multiple_of(unit) || !to.is_multiple_of(unit) {
        Err(FlashError::NotAligned)
    } else if from > to || to > CAPACITY {
        Err(FlashError::OutOfBounds)
    } else {
        Ok(())
    }
}
