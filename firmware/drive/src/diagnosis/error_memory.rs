//! The last errors and when they came (S-0-0375, P-0-0004).

use heapless::Deque;

/// Errors that are kept.
pub const ERRORS: usize = 32;

/// One error.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ErrorRecord {
    /// S-0-0390.
    pub number: u16,
    /// Seconds of operation (P-0-0015).
    pub seconds: u32,
}

/// The errors, the newest first.
#[derive(Clone, Debug, Default)]
pub struct ErrorMemory {
    records: Deque<ErrorRecord, ERRORS>,
}

impl ErrorMemory {
    /// Empty.
    #[must_use]
    pub const fn new() -> Self {
        Self { records: Deque::new() }
    }

    /// Keeps one more error; the oldest goes when there is no room.
    pub fn add(&mut self, record: ErrorRecord) {
        if self.records.is_full() {
            let _ = self.records.pop_back();
        }
        // There is room now.
        let _ = self.records.push_front(record);
    }

    /// The newest first.
    pub fn newest_first(&self) -> impl Iterator<Item = ErrorRecord> + '_ {
        self.records.iter().copied()
    }
}

/// Whole seconds of a time in us; after 136 years it stands.
pub(crate) fn seconds(microseconds: u64) -> u32 {
    u32::try_from(microseconds / 1_000_000).unwrap_or(u32::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_32_are_kept_with_the_newest_first() {
        let mut memory = ErrorMemory::new();
        for number in 0..40 {
            memory.add(ErrorRecord { number, seconds: u32::from(number) * 10 });
        }
        let numbers: std::vec::Vec<u16> = memory.newest_first().map(|record| record.number).collect();
        assert_eq!(numbers, (8..40).rev().collect::<std::vec::Vec<_>>());
        assert_eq!(memory.newest_first().next().unwrap().seconds, 390);
    }
}
