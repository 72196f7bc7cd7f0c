//! One element on its way: where the words to be read come from, and whether the words written are complete.

use crate::attribute::Length;
use crate::capacity::{LIST_ENTRIES, LIVE_LIST_ENTRIES, LIVE_LONG_ENTRIES, LONG_ENTRIES, SEGMENT_WORDS, TEXT_BYTES};
use crate::data_block::DataBlock;
use crate::error::{Element, ServiceError};
use crate::idn::Idn;
use heapless::Vec;

/// Words of the longest element that is not read straight from flash: two length words and the longest list.
pub(super) const STAGING_WORDS: usize = LIVE_LIST_ENTRIES.saturating_add(2);

const _: () = assert!(LIVE_LONG_ENTRIES <= LIVE_LIST_ENTRIES / 2, "the staging buffer holds every list");

/// Operation data, or what the master has written of them so far.
pub(super) type Staging = Vec<u16, STAGING_WORDS>;

/// A transfer that has begun and whose END has not come.
#[derive(Clone, Copy, Debug)]
pub(super) struct Transfer {
    pub(super) element: Element,
    pub(super) state: State,
}

#[derive(Clone, Copy, Debug)]
pub(super) enum State {
    /// Words up to `position` were handed to the sender.
    Reading { source: Source, position: usize },
    /// The words are in the staging buffer.
    Writing,
    /// A step was refused: so are all that follow, until END or another element.
    Failed { error: ServiceError, write: bool },
}

impl State {
    pub(super) const fn is_write(self) -> bool {
        match self {
            State::Reading { .. } => false,
            State::Writing => true,
            State::Failed { write, .. } => write,
        }
    }
}

/// Where the words of an element come from.
#[derive(Clone, Copy, Debug)]
pub(super) enum Source {
    /// Read when the transfer began, so that values and lists are consistent.
    Staged,
    /// A name or unit.
    Text(&'static str),
    /// An IDN list that does not change.
    Idns(&'static [Idn]),
}

impl Source {
    /// Words of the element, length words included.
    pub(super) fn words(self, staging: &Staging) -> usize {
        match self {
            Source::Staged => staging.len(),
            Source::Text(text) => text.len().div_ceil(2).saturating_add(2),
            Source::Idns(idns) => idns.len().saturating_add(2),
        }
    }

    /// The words from `position` on, at most `limit` of them.
    pub(super) fn segment(self, staging: &Staging, position: usize, limit: usize) -> Vec<u16, SEGMENT_WORDS> {
        let mut segment = Vec::new();
        if let Source::Staged = self {
            append(&mut segment, from(staging, position), limit, |&word| word);
            return segment;
        }
        // Both length words of what is read from flash are the same: it can be neither longer nor shorter.
        let bytes = match self {
            Source::Text(text) => text.len(),
            Source::Idns(idns) => idns.len().saturating_mul(2),
            Source::Staged => 0,
        };
        let bytes = u16::try_from(bytes).unwrap_or(u16::MAX);
        append(&mut segment, from(&[bytes, bytes], position), limit, |&word| word);
        let (position, limit) = (position.saturating_sub(2), limit.saturating_sub(segment.len()));
        match self {
            Source::Text(text) => {
                let bytes = from(text.as_bytes(), position.saturating_mul(2));
                fill(&mut segment, bytes.chunks(2).map(packed).take(limit));
            }
            Source::Idns(idns) => append(&mut segment, from(idns, position), limit, |idn| idn.0),
            Source::Staged => {}
        }
        segment
    }
}

/// What is left of a slice from a place on.
fn from<T>(items: &[T], position: usize) -> &[T] {
    items.get(position..).unwrap_or(&[])
}

/// Appends as many as are wanted and fit, in one go.
fn append<T>(segment: &mut Vec<u16, SEGMENT_WORDS>, items: &[T], limit: usize, word: impl Fn(&T) -> u16) {
    let mut words = [0; SEGMENT_WORDS];
    for (place, item) in words.iter_mut().zip(items) {
        *place = word(item);
    }
    let free = SEGMENT_WORDS.saturating_sub(segment.len());
    let count = items.len().min(limit).min(free);
    // It fits.
    let _ = segment.extend_from_slice(words.get(..count).unwrap_or(&[]));
}

/// Appends what fits. The vector's own `extend` panics when it is full, and the bounds that rule this out are not for
/// the compiler to see.
pub(super) fn fill<T, const N: usize>(vector: &mut Vec<T, N>, items: impl IntoIterator<Item = T>) {
    for item in items {
        if vector.push(item).is_err() {
            break;
        }
    }
}

/// Stages a value of fixed length, low word first.
pub(super) fn stage_fixed(staging: &mut Staging, bytes: u16, raw: u64) {
    staging.clear();
    let words = [0, 16, 32, 48].map(|shift| (raw >> shift & 0xFFFF) as u16);
    fill(staging, words.into_iter().take(usize::from(bytes >> 1)));
}

/// Stages a list of two-byte items.
pub(super) fn stage_list(staging: &mut Staging, items: impl ExactSizeIterator<Item = u16>, maximum_items: usize) {
    staging.clear();
    let bytes = |items: usize| u16::try_from(items.saturating_mul(2)).unwrap_or(u16::MAX);
    fill(staging, [bytes(items.len()), bytes(maximum_items)].into_iter().chain(items));
}

/// Stages a list of four-byte items, low word first.
pub(super) fn stage_longs(staging: &mut Staging, items: &[u32], maximum_items: usize) {
    staging.clear();
    let bytes = |items: usize| u16::try_from(items.saturating_mul(4)).unwrap_or(u16::MAX);
    let words = items.iter().flat_map(|item| [(item & 0xFFFF) as u16, (item >> 16) as u16]);
    fill(staging, [bytes(items.len()), bytes(maximum_items)].into_iter().chain(words));
}

/// Stages a text.
pub(super) fn stage_text(staging: &mut Staging, text: &str, maximum_bytes: usize) {
    staging.clear();
    let word = |bytes: usize| u16::try_from(bytes).unwrap_or(u16::MAX);
    let pairs = text.as_bytes().chunks(2).map(packed);
    fill(staging, [word(text.len()), word(maximum_bytes)].into_iter().chain(pairs));
}

/// The value of fixed length that was written.
pub(super) fn written_value(staging: &Staging) -> u64 {
    staging.iter().take(4).rev().fold(0, |value, &word| value << 16 | u64::from(word))
}

/// The items of a list of four-byte items that was written.
pub(super) fn written_longs(staging: &Staging) -> Vec<u32, LONG_ENTRIES> {
    let mut written = Vec::new();
    let items = staging.get(2..).unwrap_or(&[]).chunks_exact(2);
    fill(&mut written, items.map(|item| item.iter().rev().fold(0, |value, &word| value << 16 | u32::from(word))));
    written
}

/// The bytes of a text that was written, without the padding of an odd length.
pub(super) fn written_bytes(staging: &Staging) -> Vec<u8, TEXT_BYTES> {
    let length = usize::from(staging.first().copied().unwrap_or(0));
    let mut written = Vec::new();
    fill(&mut written, staging.iter().skip(2).flat_map(|word| word.to_le_bytes()).take(length));
    written
}

/// Takes one more word of operation data that the master writes.
///
/// # Errors
/// [`ServiceError::TooLong`] as soon as it is certain; [`ServiceError::InvalidData`] for half an item.
pub(super) fn take_word(staging: &mut Staging, block: &DataBlock, word: u16) -> Result<(), ServiceError> {
    let too_long = ServiceError::TooLong(Element::Data);
    staging.push(word).map_err(|_| too_long)?;
    let length = block.attribute.length();
    match length.fixed_bytes() {
        Some(bytes) if staging.len() > usize::from(bytes >> 1) => Err(too_long),
        Some(_) => Ok(()),
        None => {
            let bytes = usize::from(staging.first().copied().unwrap_or(0));
            let (maximum, whole_items) = match length {
                Length::ListOfBytes => (TEXT_BYTES, true),
                Length::ListOfFour => (LONG_ENTRIES.saturating_mul(4), bytes & 3 == 0),
                _ => (LIST_ENTRIES.saturating_mul(2), bytes & 1 == 0),
            };
            if bytes > maximum || staging.len() > list_words(bytes) {
                Err(too_long)
            } else if !whole_items {
                Err(ServiceError::InvalidData)
            } else {
                Ok(())
            }
        }
    }
}

/// Checks at END that all words have come.
pub(super) fn is_complete(staging: &Staging, block: &DataBlock) -> bool {
    let words = match block.fixed_bytes() {
        Some(bytes) => usize::from(bytes >> 1),
        None => list_words(usize::from(staging.first().copied().unwrap_or(0))),
    };
    staging.len() == words
}

fn list_words(bytes: usize) -> usize {
    bytes.div_ceil(2).saturating_add(2)
}

fn packed(bytes: &[u8]) -> u16 {
    let byte = |index| u16::from(bytes.get(index).copied().unwrap_or(0));
    byte(0) | (byte(1) << 8)
}
