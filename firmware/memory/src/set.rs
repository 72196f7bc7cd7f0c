//! The three items of a save, and what can be said of them at a start.

use core::cell::Cell;

use sequential_storage::map::{SerializationError, Value};

/// What a start has found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Condition {
    /// Nothing was ever saved.
    Empty,
    /// The set of the last save is there.
    Whole,
    /// The last save was not finished, and nobody was told that it was: the set of the one before is there, if there was one.
    Unfinished,
    /// The set of the last save cannot be read any more. There may be an older one, which [`Memory::load`](crate::Memory::load) does not give.
    Damaged,
}

/// Numbers of the last save that was begun, that can be read, and that was finished; 0: none.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Saves {
    pub(crate) begun: u32,
    pub(crate) set: u32,
    pub(crate) finished: u32,
}

impl Saves {
    /// What became of the last save.
    pub(crate) fn condition(self) -> Condition {
        let Self { begun, set, finished } = self;
        if begun.max(set).max(finished) == 0 {
            Condition::Empty
        } else if set == 0 || set < finished {
            // A first save that was cut has left nothing to go back to, and was not acknowledged.
            if finished == 0 { Condition::Unfinished } else { Condition::Damaged }
        } else if begun > set {
            Condition::Unfinished
        } else {
            Condition::Whole
        }
    }

    /// The number of the next save.
    pub(crate) fn next(self) -> u32 {
        self.begun.max(self.set).max(self.finished).saturating_add(1)
    }
}

/// Puts a value into the buffer and says how long it is, or that it does not fit. Behind a pointer: whatever is stored takes the same way through the map.
pub(crate) type Write<'a> = dyn FnMut(&mut [u8]) -> Option<usize> + 'a;

/// A value that writes itself where it is to be stored, behind a number.
pub(crate) struct Written<'a> {
    number: Option<u32>,
    /// It is made of the value of this number, which lies in the buffer.
    over: Option<u32>,
    write: Cell<Option<&'a mut Write<'a>>>,
    length: Cell<u32>,
}

const NUMBER_BYTES: usize = 4;

impl<'a> Written<'a> {
    /// `write` may be asked twice.
    pub(crate) const fn new(number: Option<u32>, write: &'a mut Write<'a>) -> Self {
        Self { number, over: None, write: Cell::new(Some(write)), length: Cell::new(0) }
    }

    /// The same out of the value `before`, which lies in the buffer where this one is to be stored.
    pub(crate) const fn over(before: u32, number: u32, write: &'a mut Write<'a>) -> Self {
        Self { over: Some(before), ..Self::new(Some(number), write) }
    }

    /// Bytes that were stored, the number with them.
    pub(crate) const fn length(&self) -> u32 {
        self.length.get()
    }
}

impl Value<'_> for Written<'_> {
    fn serialize_into(&self, buffer: &mut [u8]) -> Result<usize, SerializationError> {
        // A repair of the map takes the buffer, too; asked twice, it finds what it has made itself.
        let lies_there = |number: Option<u32>| number.is_some() && numbered(buffer).map(|(number, _)| number) == number;
        if self.over.is_some() && !lies_there(self.over) && !lies_there(self.number) {
            return Err(SerializationError::InvalidData);
        }
        let (head, rest) = match self.number {
            Some(number) => {
                let (head, rest) =
                    buffer.split_first_chunk_mut::<NUMBER_BYTES>().ok_or(SerializationError::BufferTooSmall)?;
                *head = number.to_le_bytes();
                (NUMBER_BYTES, rest)
            }
            None => (0, buffer),
        };
        let write = self.write.take().ok_or(SerializationError::InvalidData)?;
        let length = write(rest);
        self.write.set(Some(write));
        let length = length.and_then(|length| length.checked_add(head)).ok_or(SerializationError::BufferTooSmall)?;
        self.length.set(u32::try_from(length).map_err(|_| SerializationError::InvalidData)?);
        Ok(length)
    }

    fn deserialize_from(_: &[u8]) -> Result<(Self, usize), SerializationError> {
        // It is read as bytes.
        Err(SerializationError::InvalidFormat)
    }
}

/// The number of a set and the set.
pub(crate) fn numbered(bytes: &[u8]) -> Option<(u32, &[u8])> {
    let (head, rest) = bytes.split_first_chunk::<NUMBER_BYTES>()?;
    Some((u32::from_le_bytes(*head), rest))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_became_of_the_last_save_is_known_from_its_three_items() {
        let of = |begun, set, finished| Saves { begun, set, finished }.condition();
        assert_eq!(of(0, 0, 0), Condition::Empty);
        assert_eq!(of(5, 5, 5), Condition::Whole);
        // Cut before the end: behind the set, within it, and the very first one.
        assert_eq!(of(5, 5, 4), Condition::Whole);
        assert_eq!(of(5, 4, 4), Condition::Unfinished);
        assert_eq!(of(1, 0, 0), Condition::Unfinished);
        // Finished, and not to be read any more.
        assert_eq!(of(5, 4, 5), Condition::Damaged);
        assert_eq!(of(1, 0, 1), Condition::Damaged);
        assert_eq!(of(5, 0, 4), Condition::Damaged);
        // What is damaged of the frame does not hurt the set.
        assert_eq!(of(4, 5, 5), Condition::Whole);
        assert_eq!(of(0, 1, 0), Condition::Whole);
        assert_eq!(Saves { begun: 5, set: 7, finished: 6 }.next(), 8);
    }
}
