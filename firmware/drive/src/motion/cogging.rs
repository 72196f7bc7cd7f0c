//! The compensation of the cogging: what the tasks of low priority ask of it, each under one short lock.

use sercon816::Bus;
use servo::axis::{Cogging, CoggingTables};
use servo::identification::{Bin, CoggingRecord};

use super::Motion;
use crate::hardware::Hardware;

/// Points of a table, or bins of a record, that are handed over under one lock.
pub(crate) const PART: usize = 32;

/// The memory of the compensation: two tables, and what is summed up of them. Keep one in a static and lend it.
#[derive(Debug, Default)]
pub struct CoggingMemory {
    tables: CoggingTables,
    /// Of P-0-0250.
    record: CoggingRecord,
}

impl CoggingMemory {
    /// Of nothing.
    #[must_use]
    pub const fn new() -> Self {
        Self { tables: CoggingTables::new(), record: CoggingRecord::new() }
    }

    pub(super) const fn lend(&mut self) -> (&mut CoggingTables, &mut CoggingRecord) {
        (&mut self.tables, &mut self.record)
    }
}

impl<B: Bus + Clone, H: Hardware> Motion<B, H> {
    /// The compensation.
    pub(crate) const fn cogging(&mut self) -> &mut Cogging {
        &mut self.cogging
    }

    /// Empties [`PART`] bins from one on, before P-0-0250 begins.
    pub(crate) fn clear_bins(&mut self, from: usize) {
        self.cogging_record.clear(from, PART);
    }

    /// [`PART`] bins from one on, after P-0-0250.
    pub(crate) fn bins(&self, from: usize) -> [Bin; PART] {
        core::array::from_fn(|bin| self.cogging_record.bin(from.saturating_add(bin)))
    }

    /// What the compensation gives at the index once its table acts, in 2^-25 of the peak current: for tests.
    #[cfg(test)]
    pub(crate) fn current_against_cogging(&mut self) -> i32 {
        use servo::units::{Position, Velocity};
        self.cogging.forget_index();
        (0..1_000).for_each(|_| self.cogging.supervise(Some(Position::ZERO)));
        let current = self.cogging.current(Position::ZERO, Velocity::ZERO);
        self.cogging.forget_index();
        current
    }
}
