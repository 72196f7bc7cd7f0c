//! The processor's side of a chip: the driver's `Bus` on a chip that a simulation shares.

use std::cell::RefCell;
use std::rc::Rc;

use sercon816::{Bus, RamAddress, Register};

use super::Chip;
use crate::time::SharedClock;

/// A chip that the ring and its processor both hold.
pub type SharedChip = Rc<RefCell<Chip>>;

/// Access to a chip at the time that the shared clock shows; clones are further access paths to the same chip.
#[derive(Clone)]
pub struct ChipBus {
    chip: SharedChip,
    clock: SharedClock,
}

impl ChipBus {
    /// A bus to `chip`; every access happens at the time of `clock`.
    pub fn new(chip: SharedChip, clock: SharedClock) -> Self {
        Self { chip, clock }
    }

    /// The chip behind the bus.
    pub fn chip(&self) -> &SharedChip {
        &self.chip
    }
}

impl Bus for ChipBus {
    fn read_register(&mut self, register: Register) -> u16 {
        self.chip.borrow_mut().read_register(self.clock.get(), register.word())
    }

    fn write_register(&mut self, register: Register, value: u16) {
        self.chip.borrow_mut().write_register(self.clock.get(), register.word(), value);
    }

    fn read_ram(&mut self, address: RamAddress) -> u16 {
        self.chip.borrow_mut().read_ram(self.clock.get(), address.word())
    }

    fn write_ram(&mut self, address: RamAddress, value: u16) {
        self.chip.borrow_mut().write_ram(self.clock.get(), address.word(), value);
    }
}
