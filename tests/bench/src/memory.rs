//! The memory of a drive on this computer: the model of its flash, behind the product's own keeper.

use std::cell::RefCell;
use std::rc::Rc;
use std::sync::OnceLock;

use drive::dictionary::{is_rating, parameters_on};
use drive::remembering::{Recollection, read_set, recall, write_set};
use drive::{Amplifier, BoardKind, DICTIONARY};
use embassy_futures::block_on;
use embedded_storage_async::nor_flash::{ErrorType, MultiwriteNorFlash, NorFlash, ReadNorFlash};
use flash::{FlashError, FlashModel};
use memory::{MOST_BYTES, Memory};
use ring::ident::Idn;
use sercos::data_block::{DataBlock, Selection};
use sercos::parameters::Parameters;

use crate::motor_side::HostBoard;

/// The flash of a drive, which outlives it.
pub type SharedFlash = Rc<RefCell<FlashModel>>;

/// Bytes of the buffer that a memory works in.
pub(crate) const BUFFER: usize = MOST_BYTES + 32;

/// These parameters, as if somebody had told a drive each of them: none of them is just a default.
pub fn told(parameters: &Parameters) -> Parameters {
    let mut told = parameters.clone();
    DICTIONARY.select(Selection::Backup).for_each(|block| told.mark_written(block.idn));
    told
}

/// A flash into which these parameters were saved.
///
/// # Panics
/// They do not fit, which the drive's own tests rule out.
pub fn saved(parameters: &Parameters) -> FlashModel {
    saved_often(parameters, 1)
}

/// The same, so many times.
///
/// # Panics
/// They do not fit.
pub fn saved_often(parameters: &Parameters, saves: u32) -> FlashModel {
    let told = told(parameters);
    kept(saves, |out| write_set(&told, out))
}

/// A flash into which this set was saved, as another firmware may have written it.
///
/// # Panics
/// It is longer than a memory takes.
pub fn saved_set(set: &[u8]) -> FlashModel {
    kept(1, |out| {
        out.get_mut(..set.len())?.copy_from_slice(set);
        Some(set.len())
    })
}

/// The set that a drive finds that is started over this flash; `None` where there is none.
pub fn set_in(flash: &FlashModel) -> Option<Vec<u8>> {
    let mut memory = Memory::new(flash.clone());
    let mut buffer = [0; BUFFER];
    match block_on(recall(&mut memory, &mut buffer)) {
        Recollection::Set(set) | Recollection::Unfinished(Some(set)) => Some(set.to_vec()),
        Recollection::Unfinished(None) | Recollection::Empty | Recollection::Damaged => None,
    }
}

/// What a drive remembers that is started over this flash, as its control would read it; nothing where there is no set.
pub(crate) fn remembered(flash: &FlashModel) -> Vec<(Idn, Vec<u16>)> {
    let Some(parameters) = set_in(flash).and_then(|set| read_set(&set)) else { return Vec::new() };
    values_of(&parameters, |block| block.is_in(Selection::Backup))
}

/// What the amplifier of a drive gives it, as its control would read it.
pub(crate) fn ratings(amplifier: &Amplifier) -> Vec<(Idn, Vec<u16>)> {
    let parameters = parameters_on(amplifier, &HostBoard::FACTS);
    values_of(&parameters, is_rating)
}

fn values_of(parameters: &Parameters, which: impl Fn(&DataBlock) -> bool) -> Vec<(Idn, Vec<u16>)> {
    let words = |bytes: &[u8]| bytes.chunks(2).map(|pair| u16::from_le_bytes([pair[0], pair[1]])).collect();
    let values = DICTIONARY.blocks().iter().filter(|block| block.fixed_bytes().is_some() && which(block));
    values.map(|block| (Idn(block.idn.0), words(&parameters.bytes(block)))).collect()
}

fn kept(saves: u32, mut write: impl FnMut(&mut [u8]) -> Option<usize>) -> FlashModel {
    let mut memory = Memory::new(FlashModel::new());
    let mut buffer = [0; BUFFER];
    for _ in 0..saves {
        // A start makes room for the next ones.
        block_on(memory.start(&mut buffer)).expect("the flash is fine");
        block_on(memory.save(&mut buffer, &mut write)).expect("a set fits");
    }
    memory.flash().clone()
}

/// The flash of a drive that somebody has put into operation: the defaults were saved.
pub(crate) fn saved_defaults() -> FlashModel {
    static CONTENTS: OnceLock<Vec<u8>> = OnceLock::new();
    let contents = CONTENTS.get_or_init(|| saved(&Parameters::new(&DICTIONARY)).contents().to_vec());
    FlashModel::with_contents(contents).expect("the contents of a flash")
}

/// A flash that others look at, too.
pub(crate) struct HostFlash(pub(crate) SharedFlash);

impl ErrorType for HostFlash {
    type Error = FlashError;
}

impl ReadNorFlash for HostFlash {
    const READ_SIZE: usize = FlashModel::READ_SIZE;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), FlashError> {
        block_on(self.0.borrow_mut().read(offset, bytes))
    }

    fn capacity(&self) -> usize {
        self.0.borrow().capacity()
    }
}

impl NorFlash for HostFlash {
    const WRITE_SIZE: usize = <FlashModel as NorFlash>::WRITE_SIZE;
    const ERASE_SIZE: usize = <FlashModel as NorFlash>::ERASE_SIZE;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), FlashError> {
        block_on(NorFlash::erase(&mut *self.0.borrow_mut(), from, to))
    }

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), FlashError> {
        block_on(self.0.borrow_mut().write(offset, bytes))
    }
}

impl MultiwriteNorFlash for HostFlash {}
