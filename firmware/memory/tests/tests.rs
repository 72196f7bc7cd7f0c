//! The memory over the model of the drive's flash, and over a simulated FRAM.

#[path = "tests/cuts.rs"]
mod cuts;
#[path = "tests/damage.rs"]
mod damage;
#[path = "tests/fram.rs"]
mod fram;
#[path = "tests/saves.rs"]
mod saves;

use embassy_futures::block_on;
use embedded_storage_async::nor_flash::{ErrorType, NorFlash, ReadNorFlash};
use flash::{FlashError, FlashModel, SECTOR_BYTES};
use memory::{Condition, Error, MOST_BYTES, Memory};

const BUFFER: usize = MOST_BYTES + 32;

/// Starts a memory over what is in a flash.
fn started<F: NorFlash>(flash: F) -> Result<(Memory<F>, Condition), Error<F::Error>> {
    let mut memory = Memory::new(flash);
    let condition = block_on(memory.start(&mut [0; BUFFER]))?;
    Ok((memory, condition))
}

fn save<F: NorFlash>(memory: &mut Memory<F>, set: &[u8]) -> Result<(), Error<F::Error>> {
    block_on(memory.save(&mut [0; BUFFER], |buffer: &mut [u8]| {
        buffer.get_mut(..set.len())?.copy_from_slice(set);
        Some(set.len())
    }))
}

/// Makes a set out of the one before, which is looked at where it lies; whether there was one.
fn amend<F: NorFlash>(memory: &mut Memory<F>, before: &[u8], set: &[u8]) -> Result<bool, Error<F::Error>> {
    block_on(memory.amend(&mut [0; BUFFER], |buffer: &mut [u8], length| {
        let found = buffer.get(..length)?;
        assert!(
            found == before || found == set,
            "{length} bytes that are neither the set before nor what was made of it"
        );
        buffer.get_mut(..set.len())?.copy_from_slice(set);
        Some(set.len())
    }))
}

fn load<F: NorFlash>(memory: &mut Memory<F>) -> Option<Vec<u8>> {
    let mut buffer = [0; BUFFER];
    block_on(memory.load(&mut buffer)).ok().flatten().map(<[u8]>::to_vec)
}

/// A set that is unlike any other: its number and `length` bytes that follow from it.
fn set(number: u32, length: usize) -> Vec<u8> {
    let mut random = number.wrapping_mul(0x9E37_79B9) | 1;
    let bytes = (4..length).map(|_| {
        random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (random >> 24) as u8
    });
    number.to_le_bytes().into_iter().chain(bytes).collect()
}

/// The first [`Small::PAGE`] bytes of each sector: pages that turn after some twenty saves, and are looked through in no time.
#[derive(Clone)]
struct Small(FlashModel);

impl Small {
    const PAGE: usize = 16 * 1024;

    /// Where an offset lies in the model.
    const fn place(offset: u32) -> u32 {
        let page = offset / Self::PAGE as u32;
        page * SECTOR_BYTES as u32 + offset % Self::PAGE as u32
    }
}

impl ErrorType for Small {
    type Error = FlashError;
}

impl ReadNorFlash for Small {
    const READ_SIZE: usize = FlashModel::READ_SIZE;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), FlashError> {
        self.0.read(Self::place(offset), bytes).await
    }

    fn capacity(&self) -> usize {
        2 * Self::PAGE
    }
}

impl NorFlash for Small {
    const WRITE_SIZE: usize = FlashModel::WRITE_SIZE;
    const ERASE_SIZE: usize = Self::PAGE;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), FlashError> {
        let pages = (to - from) / Self::PAGE as u32;
        let from = Self::place(from);
        NorFlash::erase(&mut self.0, from, from + pages * SECTOR_BYTES as u32).await
    }

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), FlashError> {
        self.0.write(Self::place(offset), bytes).await
    }
}
