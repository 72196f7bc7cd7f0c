//! Ring, chips and processors in one simulated time.

use ring::chip::SharedChip;
use ring::{Master, Nanoseconds, Ring};

use crate::processor::{Processor, ProcessorError};

/// A ring of chips with one processor beside each.
///
/// The world goes from event to event: first the ring up to that instant, then every processor that is concerned.
/// The order is fixed, so a run repeats itself exactly.
pub struct World<M> {
    ring: Ring<M, SharedChip>,
    processors: Vec<Box<dyn Processor>>,
}

impl<M: Master> World<M> {
    /// One processor for each station of the ring, in ring order.
    ///
    /// # Panics
    /// When their numbers differ.
    pub fn new(ring: Ring<M, SharedChip>, processors: Vec<Box<dyn Processor>>) -> Self {
        assert_eq!(ring.stations().len(), processors.len(), "one processor for each station");
        Self { ring, processors }
    }

    /// The ring.
    pub fn ring(&self) -> &Ring<M, SharedChip> {
        &self.ring
    }

    /// The ring, to add faults or to give the master new work.
    pub fn ring_mut(&mut self) -> &mut Ring<M, SharedChip> {
        &mut self.ring
    }

    /// Simulated time.
    pub fn now(&self) -> Nanoseconds {
        self.ring.now()
    }

    /// Lets everything happen up to and including `until`.
    ///
    /// # Errors
    /// The first processor that can not go on.
    pub fn run_until(&mut self, until: Nanoseconds) -> Result<(), ProcessorError> {
        while let Some(now) = self.next_event().filter(|time| *time <= until) {
            self.ring.advance(now);
            for (station, processor) in self.processors.iter_mut().enumerate() {
                let ring = &self.ring;
                let horizon = || ring.next_event_at(station).map_or(until, |time| time.min(until)).max(now);
                processor.run(now, &horizon)?;
            }
        }
        self.ring.advance(until);
        Ok(())
    }

    fn next_event(&self) -> Option<Nanoseconds> {
        let processors = self.processors.iter().filter_map(|processor| processor.next_event());
        processors.chain(self.ring.next_event()).min().map(|time| time.max(self.now()))
    }
}
