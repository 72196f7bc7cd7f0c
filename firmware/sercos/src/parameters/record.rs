//! The operation data of a parameter as bytes, for a memory that keeps them.

use super::Parameters;
use crate::attribute::Length;
use crate::capacity::{LIST_ENTRIES, LONG_ENTRIES, TEXT_BYTES};
use crate::data_block::{DataBlock, Place};
use crate::error::{Element, ServiceError};
use crate::idn::Idn;
use heapless::Vec;

/// Bytes of the longest parameter.
pub const MOST_BYTES: usize = {
    let lists = if LIST_ENTRIES * 2 > LONG_ENTRIES * 4 { LIST_ENTRIES * 2 } else { LONG_ENTRIES * 4 };
    if lists > TEXT_BYTES { lists } else { TEXT_BYTES }
};

impl DataBlock {
    /// Bytes that the operation data of a parameter have at most; 0: it is none.
    pub const fn most_bytes(&self) -> usize {
        match self.place {
            Place::None | Place::Command(_) => 0,
            Place::Value(_) if matches!(self.attribute.length(), Length::Two) => 2,
            Place::Value(_) => 4,
            Place::Idns(_) | Place::Words(_) => LIST_ENTRIES * 2,
            Place::Longs(_) => LONG_ENTRIES * 4,
            Place::Text(_) => TEXT_BYTES,
        }
    }
}

impl Parameters {
    /// The operation data of a parameter as they are transmitted, the least significant byte first, without the length words of a list. Empty for a
    /// data block that is no parameter.
    pub fn bytes(&self, block: &DataBlock) -> Vec<u8, MOST_BYTES> {
        let mut bytes = Vec::new();
        // There is room for the longest.
        let mut put = |more: &[u8]| {
            let _ = bytes.extend_from_slice(more);
        };
        match block.place {
            Place::None | Place::Command(_) => {}
            Place::Value(_) => put(self.get(block.idn).to_le_bytes().get(..block.most_bytes()).unwrap_or(&[])),
            Place::Idns(_) => self.list(block.idn).iter().for_each(|entry| put(&entry.0.to_le_bytes())),
            Place::Words(_) => self.words(block.idn).iter().for_each(|entry| put(&entry.to_le_bytes())),
            Place::Longs(_) => self.longs(block.idn).iter().for_each(|entry| put(&entry.to_le_bytes())),
            Place::Text(_) => put(self.text(block.idn).as_bytes()),
        }
        bytes
    }

    /// True if a parameter is what the table gives it; a list or a text if it is empty.
    pub fn is_default(&self, block: &DataBlock) -> bool {
        match block.place {
            Place::Value(_) => u64::from(self.get(block.idn)) == block.default_as_transmitted() & 0xFFFF_FFFF,
            _ => self.bytes(block).is_empty(),
        }
    }

    /// Sets a parameter from [`Parameters::bytes`] of this program or of an older one; otherwise like [`Parameters::set`].
    ///
    /// # Errors
    /// Those of [`Parameters::set`] and of its siblings for lists and texts; [`ServiceError::TooShort`] or [`ServiceError::TooLong`] for a value of
    /// another length than the parameter has today. Nothing is changed then.
    pub fn set_bytes(&mut self, block: &DataBlock, bytes: &[u8]) -> Result<(), ServiceError> {
        self.put_bytes(block, bytes)?;
        self.told.set(block, true);
        Ok(())
    }

    fn put_bytes(&mut self, block: &DataBlock, bytes: &[u8]) -> Result<(), ServiceError> {
        match block.place {
            Place::None | Place::Command(_) => Err(ServiceError::IdnNotAvailable),
            Place::Value(_) => {
                let length = block.most_bytes();
                if bytes.len() < length {
                    return Err(ServiceError::TooShort(Element::Data));
                }
                if bytes.len() > length {
                    return Err(ServiceError::TooLong(Element::Data));
                }
                let value = bytes.iter().rev().fold(0, |value: u64, byte| value << 8 | u64::from(*byte));
                self.set(block.idn, value)
            }
            Place::Idns(_) => self.set_list(block.idn, &words_of(bytes, Idn)?),
            Place::Words(_) => self.set_words(block.idn, &words_of(bytes, |word| word)?),
            Place::Longs(_) => {
                let (entries, rest) = bytes.as_chunks::<4>();
                let longs = entries.iter().map(|bytes| u32::from_le_bytes(*bytes));
                self.set_longs(block.idn, &whole::<_, LONG_ENTRIES>(longs, rest)?)
            }
            Place::Text(_) => self.set_text(block.idn, bytes),
        }
    }
}

fn words_of<T>(bytes: &[u8], of: impl Fn(u16) -> T) -> Result<Vec<T, LIST_ENTRIES>, ServiceError> {
    let (entries, rest) = bytes.as_chunks::<2>();
    whole(entries.iter().map(|bytes| of(u16::from_le_bytes(*bytes))), rest)
}

/// All entries, if no byte is left and they are not too many.
fn whole<T, const N: usize>(entries: impl Iterator<Item = T>, rest: &[u8]) -> Result<Vec<T, N>, ServiceError> {
    if !rest.is_empty() {
        return Err(ServiceError::InvalidData);
    }
    let mut list = Vec::new();
    for entry in entries {
        list.push(entry).map_err(|_| ServiceError::TooLong(Element::Data))?;
    }
    Ok(list)
}
