//! Where in [`super::Parameters`] each data block has its value: worked out by the compiler from the table.

use crate::attribute::{Format, Length};
use crate::data_block::{DataBlock, Location};
use crate::dictionary::{self, ROWS};
use crate::idn::Idn;

/// The place of one value.
#[derive(Clone, Copy)]
pub(super) enum Storage {
    /// The data block is no parameter.
    None,
    /// Two or four bytes: one cell.
    Cell(u8),
    /// A list of IDNs.
    Idns(u8),
    /// A list of two-byte numbers.
    Words(u8),
    /// A list of four-byte numbers.
    Longs(u8),
    /// A text.
    Text(u8),
}

/// How much of each kind there is.
pub(super) struct Counts {
    pub(super) cells: usize,
    pub(super) idns: usize,
    pub(super) words: usize,
    pub(super) longs: usize,
    pub(super) texts: usize,
}

const LAYOUT: ([Storage; ROWS.len()], Counts) = lay_out();
static STORAGE: [Storage; ROWS.len()] = LAYOUT.0;

pub(super) const COUNTS: Counts = LAYOUT.1;
pub(super) const DEFAULTS: [u32; COUNTS.cells] = defaults();

/// The place of a data block's value.
pub(super) fn storage_of(idn: Idn) -> Storage {
    let storage = dictionary::index_of(idn).and_then(|index| STORAGE.get(index));
    storage.copied().unwrap_or(Storage::None)
}

/// Every data block with the place of its value, in ascending order of the IDN: for those who want all and need not search.
pub(super) fn all() -> impl Iterator<Item = (&'static DataBlock, Storage)> {
    dictionary::DICTIONARY.iter().zip(STORAGE.iter().copied())
}

#[allow(clippy::panic, reason = "evaluated by the compiler only")]
const fn kind_of(block: &DataBlock, counts: &Counts) -> Storage {
    match (block.attribute.length(), block.attribute.format()) {
        (Length::Two | Length::Four, _) => Storage::Cell(counts.cells as u8),
        (Length::ListOfBytes, _) => Storage::Text(counts.texts as u8),
        (Length::ListOfTwo, Format::Idn) => Storage::Idns(counts.idns as u8),
        (Length::ListOfTwo, _) => Storage::Words(counts.words as u8),
        (Length::ListOfFour, _) => Storage::Longs(counts.longs as u8),
        (Length::Eight | Length::ListOfEight | Length::Reserved, _) => {
            panic!("a parameter of a length that has no place")
        }
    }
}

#[allow(clippy::indexing_slicing, clippy::arithmetic_side_effects, reason = "evaluated by the compiler only")]
const fn lay_out() -> ([Storage; ROWS.len()], Counts) {
    let mut storage = [Storage::None; ROWS.len()];
    let mut counts = Counts { cells: 0, idns: 0, words: 0, longs: 0, texts: 0 };
    let mut row = 0;
    while row < ROWS.len() {
        let block = &ROWS[row];
        if matches!(block.location, Location::Parameter) {
            let place = kind_of(block, &counts);
            match place {
                Storage::None => {}
                Storage::Cell(_) => counts.cells += 1,
                Storage::Idns(_) => counts.idns += 1,
                Storage::Words(_) => counts.words += 1,
                Storage::Longs(_) => counts.longs += 1,
                Storage::Text(_) => counts.texts += 1,
            }
            storage[row] = place;
        }
        row += 1;
    }
    assert!(counts.cells < 256, "a place holds a byte");
    (storage, counts)
}

#[allow(clippy::indexing_slicing, clippy::arithmetic_side_effects, reason = "evaluated by the compiler only")]
const fn defaults() -> [u32; COUNTS.cells] {
    let mut cells = [0; COUNTS.cells];
    let mut row = 0;
    while row < ROWS.len() {
        let block = &ROWS[row];
        if let Storage::Cell(index) = LAYOUT.0[row] {
            let raw = default_of(block);
            assert!(block.attribute.value_of(raw) == block.default, "a default does not fit its format");
            cells[index as usize] = raw as u32;
        }
        row += 1;
    }
    cells
}

/// The default as it is transmitted.
pub(super) const fn default_of(block: &DataBlock) -> u64 {
    match block.fixed_bytes() {
        Some(2) => block.default as u16 as u64,
        _ => block.default as u32 as u64,
    }
}
