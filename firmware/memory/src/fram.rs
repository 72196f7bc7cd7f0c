//! An FRAM on an SPI bus as the flash of a [`Memory`](crate::Memory): MB85RS, FM25, CY15 and the like with addresses of two or three bytes.
//!
//! A drive that is to keep every write of its control has one of these beside its processor: it bears 10^13 writes, each takes what the bus takes,
//! and the processor goes on meanwhile. It has no pages; here it is cut into two, and erasing one writes 0xFF into it.
//!
//! Commands (MB85RS64V data sheet, DS501-00015): WREN 06H before each write, WRITE 02H, READ 03H, the address, highest byte first.

use embedded_hal::spi::{Operation, SpiDevice};
use embedded_storage_async::nor_flash::{ErrorType, MultiwriteNorFlash, NorFlash, ReadNorFlash};

use crate::error::FramError;

const WRITE_ENABLE: u8 = 0x06;
const WRITE: u8 = 0x02;
const READ: u8 = 0x03;
const ERASED: u8 = 0xFF;
/// Bytes that are read back at once.
const CHUNK: usize = 32;

/// An FRAM of two pages of `PAGE` bytes each, with addresses of `ADDRESS` bytes.
#[derive(Debug)]
pub struct Fram<S, const PAGE: usize, const ADDRESS: usize> {
    spi: S,
}

impl<S: SpiDevice, const PAGE: usize, const ADDRESS: usize> Fram<S, PAGE, ADDRESS> {
    /// On this bus. The part has `2 * PAGE` bytes at least.
    pub const fn new(spi: S) -> Self {
        const { assert!(PAGE.is_multiple_of(CHUNK) && (ADDRESS == 2 && PAGE <= 1 << 15 || ADDRESS == 3 && PAGE <= 1 << 23)) };
        Self { spi }
    }

    /// The bus again.
    pub fn release(self) -> S {
        self.spi
    }

    fn check(offset: u32, length: usize) -> Result<(), FramError> {
        let end = (offset as usize).checked_add(length).ok_or(FramError::OutOfBounds)?;
        if end <= Self::CAPACITY { Ok(()) } else { Err(FramError::OutOfBounds) }
    }

    const CAPACITY: usize = PAGE.saturating_mul(2);

    fn command(code: u8, offset: u32) -> [u8; 4] {
        let [_, high, middle, low] = offset.to_be_bytes();
        if ADDRESS == 2 { [code, middle, low, 0] } else { [code, high, middle, low] }
    }

    fn head(command: &[u8; 4]) -> &[u8] {
        command.get(..ADDRESS.saturating_add(1)).unwrap_or(command)
    }

    fn read_bytes(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), FramError> {
        let command = Self::command(READ, offset);
        let mut operations = [Operation::Write(Self::head(&command)), Operation::Read(bytes)];
        self.spi.transaction(&mut operations).map_err(|_| FramError::Bus)
    }

    /// Writes and reads back: a part that is not there takes everything.
    fn write_bytes(&mut self, offset: u32, bytes: &[u8]) -> Result<(), FramError> {
        self.spi.write(&[WRITE_ENABLE]).map_err(|_| FramError::Bus)?;
        let command = Self::command(WRITE, offset);
        let mut operations = [Operation::Write(Self::head(&command)), Operation::Write(bytes)];
        self.spi.transaction(&mut operations).map_err(|_| FramError::Bus)?;
        let mut read = [0; CHUNK];
        for (index, written) in bytes.chunks(CHUNK).enumerate() {
            let read = read.get_mut(..written.len()).ok_or(FramError::OutOfBounds)?;
            // Within the part, which was checked.
            let from = offset.saturating_add(index.saturating_mul(CHUNK) as u32);
            self.read_bytes(from, read)?;
            if read != written {
                return Err(FramError::NotWritten);
            }
        }
        Ok(())
    }
}

impl<S: SpiDevice, const PAGE: usize, const ADDRESS: usize> ErrorType for Fram<S, PAGE, ADDRESS> {
    type Error = FramError;
}

impl<S: SpiDevice, const PAGE: usize, const ADDRESS: usize> ReadNorFlash for Fram<S, PAGE, ADDRESS> {
    const READ_SIZE: usize = 1;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), FramError> {
        Self::check(offset, bytes.len())?;
        self.read_bytes(offset, bytes)
    }

    fn capacity(&self) -> usize {
        Self::CAPACITY
    }
}

impl<S: SpiDevice, const PAGE: usize, const ADDRESS: usize> NorFlash for Fram<S, PAGE, ADDRESS> {
    const WRITE_SIZE: usize = 4;
    const ERASE_SIZE: usize = PAGE;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), FramError> {
        let length = to.checked_sub(from).ok_or(FramError::OutOfBounds)?;
        Self::check(from, length as usize)?;
        let page = PAGE as u32;
        if !from.is_multiple_of(page) || !to.is_multiple_of(page) {
            return Err(FramError::NotAligned);
        }
        for offset in (from..to).step_by(CHUNK) {
            self.write_bytes(offset, &[ERASED; CHUNK])?;
        }
        Ok(())
    }

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), FramError> {
        Self::check(offset, bytes.len())?;
        self.write_bytes(offset, bytes)
    }
}

impl<S: SpiDevice, const PAGE: usize, const ADDRESS: usize> MultiwriteNorFlash for Fram<S, PAGE, ADDRESS> {}
