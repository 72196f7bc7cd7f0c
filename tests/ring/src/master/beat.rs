//! When a master sends: the end of the MST is the mark, however long the MST itself is.

use crate::time::Nanoseconds;
use crate::wire::{BROADCAST, BitRate, encode};

/// An MST never has more line bits than this; the phase is decided so long before its end.
const MOST_MST_BITS: usize = 56;

/// What a master is about to do.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub(crate) enum Act {
    /// Decide on the phase of the coming cycle.
    Decide,
    /// Send the MST with this phase.
    Mst(u8),
    /// Send the MDT.
    Mdt,
}

/// The rhythm of a master.
#[derive(Clone, Debug)]
pub(crate) struct Beat {
    rate: BitRate,
    /// End of the MST that is due, or was sent last.
    mark: Nanoseconds,
    next: (Nanoseconds, Act),
}

impl Beat {
    /// The first MST ends after `lead`.
    pub(crate) fn new(rate: BitRate, lead: Nanoseconds) -> Self {
        let mark = lead.max(rate.span(MOST_MST_BITS));
        Self { rate, mark, next: (mark - rate.span(MOST_MST_BITS), Act::Decide) }
    }

    pub(crate) fn time(&self) -> Nanoseconds {
        self.next.0
    }

    pub(crate) fn act(&self) -> Act {
        self.next.1
    }

    /// The end of the MST that is due or was sent last.
    pub(crate) fn mark(&self) -> Nanoseconds {
        self.mark
    }

    /// When the phase of the next MST is decided, if its end comes one cycle after that of the last.
    pub(crate) fn decision_after(&self, cycle: Nanoseconds) -> Nanoseconds {
        self.mark + cycle - self.rate.span(MOST_MST_BITS)
    }

    /// An MST of this phase comes next; its end stands where it was planned.
    pub(crate) fn mst_comes(&mut self, phase: u8) {
        let bits = encode(&[BROADCAST, phase]).len();
        self.next = (self.mark - self.rate.span(bits), Act::Mst(phase));
    }

    /// The MDT comes next, so long after the end of the MST.
    pub(crate) fn mdt_comes(&mut self, after: Nanoseconds) {
        self.next = (self.mark + after, Act::Mdt);
    }

    /// A new cycle comes next; its MST ends one cycle after the last.
    pub(crate) fn cycle_comes(&mut self, cycle: Nanoseconds) {
        self.mark += cycle;
        self.next = (self.mark - self.rate.span(MOST_MST_BITS), Act::Decide);
    }
}
