//! Bytes taken one after the other.

/// What is left of an input.
pub(crate) struct Bytes<'a>(&'a [u8]);

impl<'a> Bytes<'a> {
    /// All of them.
    pub(crate) const fn new(bytes: &'a [u8]) -> Self {
        Self(bytes)
    }

    /// The next byte; `None` at the end.
    pub(crate) fn byte(&mut self) -> Option<u8> {
        let (&first, rest) = self.0.split_first()?;
        self.0 = rest;
        Some(first)
    }

    /// The next two bytes, low byte first; `None` where there is one only.
    pub(crate) fn word(&mut self) -> Option<u16> {
        let (first, rest) = self.0.split_first_chunk()?;
        self.0 = rest;
        Some(u16::from_le_bytes(*first))
    }

    /// Up to so many of the next bytes.
    pub(crate) fn up_to(&mut self, count: usize) -> &'a [u8] {
        let (first, rest) = self.0.split_at(count.min(self.0.len()));
        self.0 = rest;
        first
    }

    /// All that is left.
    pub(crate) fn rest(&mut self) -> &'a [u8] {
        self.up_to(usize::MAX)
    }
}

/// One of the items, chosen by a number.
///
/// # Panics
/// When there are none.
pub(crate) fn chosen<T: Copy>(items: &[T], number: usize) -> T {
    items[number % items.len()]
}
