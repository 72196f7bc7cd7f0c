//! A set of data blocks, a bit for each row of the table.

use crate::capacity::DATA_BLOCKS;
use crate::data_block::DataBlock;

const BITS: usize = u32::BITS as usize;

/// Some of the data blocks of a table.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct BlockSet([u32; DATA_BLOCKS.div_ceil(BITS)]);

impl BlockSet {
    /// None of them.
    pub(super) const fn new() -> Self {
        Self([0; DATA_BLOCKS.div_ceil(BITS)])
    }

    pub(super) fn contains(&self, block: &DataBlock) -> bool {
        let (word, mask) = place(block);
        self.0.get(word).is_some_and(|bits| bits & mask != 0)
    }

    /// Puts a data block in, or takes it out.
    pub(super) fn set(&mut self, block: &DataBlock, contained: bool) {
        let (word, mask) = place(block);
        // A table that has more data blocks than there are bits is refused when it is made.
        if let Some(bits) = self.0.get_mut(word) {
            *bits = if contained { *bits | mask } else { *bits & !mask };
        }
    }
}

/// The word of a data block, and its bit in it.
const fn place(block: &DataBlock) -> (usize, u32) {
    let row = block.row();
    (row / BITS, 1_u32.rotate_left((row % BITS) as u32))
}
