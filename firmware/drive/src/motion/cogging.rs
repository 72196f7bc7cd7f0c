//! The compensation of the cogging: what the tasks of low priority ask of it, each under one short lock.

use sercon816::Bus;
use servo::axis::{COGGING_POINTS, Cogging};
use servo::identification::{Bin, CoggingRecord};
use servo::scope::SCOPE_POINTS;

use super::Motion;
use crate::hardware::Hardware;

/// Points of a table, or bins of a record, that are handed over under one lock.
pub(crate) const PART: usize = 32;

const _: () = assert!(COGGING_POINTS <= SCOPE_POINTS, "what P-0-0250 sums up lies in the memory of the oscilloscope");

impl<B: Bus + Clone, H: Hardware> Motion<B, H> {
    /// The compensation.
    pub(crate) const fn cogging(&mut self) -> &mut Cogging {
        &mut self.cogging
    }

    /// Empties [`PART`] bins from one on, before P-0-0250 begins: they lie in the memory of the oscilloscope, and what that has recorded is gone.
    pub(crate) fn clear_bins(&mut self, from: usize) {
        CoggingRecord::new(self.oscilloscope.lend()).clear(from, PART);
    }

    /// [`PART`] bins from one on, after P-0-0250.
    pub(crate) fn bins(&mut self, from: usize) -> [Bin; PART] {
        let record = CoggingRecord::new(self.oscilloscope.lend());
        core::array::from_fn(|bin| record.bin(from.saturating_add(bin)))
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
