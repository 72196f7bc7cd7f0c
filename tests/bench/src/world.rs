//! Ring, chips and processors in one simulated time.

use laws::SharedObserver;
use ring::chip::SharedChip;
use ring::{Master, Nanoseconds, Ring};

use crate::motor_side::SharedMotorSide;
use crate::processor::{Processor, ProcessorError};

/// A ring of chips with one processor beside each.
///
/// The world goes from event to event: first the ring up to that instant, then every processor that is concerned.
/// The order is fixed, so a run repeats itself exactly. Every drive is watched by an observer, which changes nothing: when a
/// law of the axis is broken, the world ends.
pub struct World<M> {
    ring: Ring<M, SharedChip>,
    stations: Vec<Inhabited>,
}

/// What stands beside a chip of the ring.
pub struct Inhabited {
    /// Runs the drive's tasks.
    pub processor: Box<dyn Processor>,
    /// Is moved by them.
    pub motor_side: SharedMotorSide,
    /// Watches both, and the fibre.
    pub laws: SharedObserver,
}

impl<M: Master> World<M> {
    /// What stands beside each chip of the ring, in ring order.
    ///
    /// # Panics
    /// When their numbers differ.
    pub fn new(mut ring: Ring<M, SharedChip>, stations: Vec<Inhabited>) -> Self {
        assert_eq!(ring.stations().len(), stations.len(), "one processor for each station");
        for (number, station) in stations.iter().enumerate() {
            ring.tap(number, station.laws.clone());
        }
        Self { ring, stations }
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
    /// The first processor that can not go on, or the first drive that has broken a law of the axis.
    pub fn run_until(&mut self, until: Nanoseconds) -> Result<(), ProcessorError> {
        while let Some(now) = self.next_event().filter(|time| *time <= until) {
            self.ring.advance(now);
            for (number, station) in self.stations.iter_mut().enumerate() {
                let ring = &self.ring;
                let horizon = || ring.next_event_at(number).map_or(until, |time| time.min(until)).max(now);
                station.processor.run(now, &horizon)?;
                station.look(now)?;
            }
        }
        self.ring.advance(until);
        Ok(())
    }

    fn next_event(&self) -> Option<Nanoseconds> {
        let processors = self.stations.iter().filter_map(|station| station.processor.next_event());
        processors.chain(self.ring.next_event()).min().map(|time| time.max(self.now()))
    }
}

impl Inhabited {
    fn look(&mut self, now: Nanoseconds) -> Result<(), ProcessorError> {
        let observer = &mut *self.laws.borrow_mut();
        if observer.next_look() > now {
            return Ok(());
        }
        observer.look(self.motor_side.borrow_mut().sight());
        observer.broken().map_or(Ok(()), |broken| Err(broken.clone().into()))
    }
}
