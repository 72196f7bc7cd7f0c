//! Where a chip stands in the ring: as a drive's chip, or as that of the master station.

use super::{Chip, SharedChip};
use crate::station::{Master, Station};
use crate::time::Nanoseconds;
use crate::wire::{LineError, Transmission};

impl Station for Chip {
    fn next_event(&self) -> Option<Nanoseconds> {
        self.next_event()
    }

    fn on_time(&mut self, now: Nanoseconds) -> Option<Transmission> {
        self.on_time(now)
    }

    fn on_telegram_start(&mut self, now: Nanoseconds) {
        self.on_telegram_start(now);
    }

    fn on_telegram(&mut self, start: Nanoseconds, end: Nanoseconds, frame: Result<&[u8], LineError>) {
        self.on_telegram(start, end, frame);
    }

    fn on_signal(&mut self, now: Nanoseconds, present: bool) {
        self.on_signal(now, present);
    }

    /// The setting of 01H; while the chip sends, the ring keeps its repeater out by itself.
    fn repeats(&self) -> bool {
        self.registers.repeater_on()
    }
}

impl Station for SharedChip {
    fn next_event(&self) -> Option<Nanoseconds> {
        self.borrow().next_event()
    }

    fn on_time(&mut self, now: Nanoseconds) -> Option<Transmission> {
        self.borrow_mut().on_time(now)
    }

    fn on_telegram_start(&mut self, now: Nanoseconds) {
        self.borrow_mut().on_telegram_start(now);
    }

    fn on_telegram(&mut self, start: Nanoseconds, end: Nanoseconds, frame: Result<&[u8], LineError>) {
        self.borrow_mut().on_telegram(start, end, frame);
    }

    fn on_signal(&mut self, now: Nanoseconds, present: bool) {
        self.borrow_mut().on_signal(now, present);
    }

    fn repeats(&self) -> bool {
        Station::repeats(&*self.borrow())
    }
}

/// A chip in master use as the ring's master station.
#[derive(Clone)]
pub struct ChipMaster {
    chip: SharedChip,
}

impl ChipMaster {
    /// The master station of a ring around `chip`; software makes it a master by switching its repeater off.
    pub fn new(chip: SharedChip) -> Self {
        Self { chip }
    }

    /// The chip.
    pub fn chip(&self) -> &SharedChip {
        &self.chip
    }
}

impl Master for ChipMaster {
    fn next_transmission(&self) -> Option<Nanoseconds> {
        self.chip.borrow().next_event()
    }

    fn transmit(&mut self, now: Nanoseconds) -> Option<Transmission> {
        self.chip.borrow_mut().on_time(now)
    }

    fn receive(&mut self, start: Nanoseconds, end: Nanoseconds, frame: Result<&[u8], LineError>) {
        self.chip.borrow_mut().on_telegram(start, end, frame);
    }

    fn on_signal(&mut self, now: Nanoseconds, present: bool) {
        self.chip.borrow_mut().on_signal(now, present);
    }
}
