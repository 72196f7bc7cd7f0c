//! The flash that holds the parameters: what QEMU's memory shows of it, how long the processor stands, and the supply that goes meanwhile.

use std::time::Duration;

use emulator_link::protocol::{PARAMETER_FLASH, PRODUCTION_RECORD};
use flash::FlashModel;
use ring::Nanoseconds;

use super::{Guest, Reset};
use crate::{EmulatorError, Hold};

/// A sector in which the works have written nothing, as far as anybody looks.
pub(super) const BLANK_RECORD: [u8; 256] = [0xFF; 256];

/// What an operation has made of the product.
#[derive(Debug, Default)]
pub(super) struct State {
    /// An operation runs.
    runs: bool,
    /// At its end the supply goes.
    is_cut: bool,
    /// When it went.
    lost_supply: Option<Nanoseconds>,
}

impl State {
    pub(super) const fn has_lost_supply(&self) -> bool {
        self.lost_supply.is_some()
    }

    /// The operation has ended. Tells whether the supply goes with it.
    pub(super) fn ends(&mut self, now: Nanoseconds) -> bool {
        self.runs = false;
        if std::mem::take(&mut self.is_cut) {
            self.lost_supply = Some(now);
        }
        self.has_lost_supply()
    }
}

fn nanoseconds(duration: Duration) -> Nanoseconds {
    Nanoseconds(duration.as_nanos() as u64)
}

fn words(bytes: &[u8]) -> Vec<u32> {
    bytes.as_chunks().0.iter().map(|word| u32::from_le_bytes(*word)).collect()
}

/// What a test does to the flash. All of it between two runs.
impl Guest {
    /// The two sectors of the parameters, from which they can be read and which go over every reset.
    #[must_use]
    pub const fn flash(&self) -> &FlashModel {
        &self.peripherals.flash.sectors
    }

    /// Puts another flash in the place of the one that is there: with contents, longest times, or a cut to come.
    ///
    /// # Errors
    /// The end of QEMU.
    pub fn set_flash(&mut self, flash: FlashModel) -> Result<(), EmulatorError> {
        let before = std::mem::replace(&mut self.peripherals.flash.sectors, flash);
        self.copy_where_different(before.contents())
    }

    /// Puts the record of the works into its sector, where it stays over every reset.
    ///
    /// # Errors
    /// The end of QEMU.
    pub fn set_production_record(&mut self, mut bytes: Vec<u8>) -> Result<(), EmulatorError> {
        bytes.resize(bytes.len().next_multiple_of(4), 0xFF);
        self.production_record = bytes;
        self.copy_production_record()
    }

    /// The supply goes within the `nth` operation of the flash from now on, the next being the first; see [`FlashModel::cut_in`]. Then the product
    /// stands, its outputs are what they are without it, and [`Guest::lost_supply`] has the time, until a reset by [`Reset::PowerOn`].
    pub const fn cut_supply_in(&mut self, nth: u64, seed: u64) {
        self.peripherals.flash.sectors.cut_in(nth, seed);
    }

    /// When the supply went, if it has not come back.
    #[must_use]
    pub const fn lost_supply(&self) -> Option<Nanoseconds> {
        self.flash.lost_supply
    }
}

/// What the guest finds out in a run.
impl Guest {
    /// If the last access has begun an operation, the product stands until its end.
    pub(super) fn stands_by_flash(&mut self, time: Nanoseconds) -> Result<bool, EmulatorError> {
        let Some(operation) = self.peripherals.flash.take_begun() else { return Ok(false) };
        let first = operation.changed.start & !3;
        let changed = words(&self.flash().contents()[first..operation.changed.end.next_multiple_of(4)]);
        self.write_memory(PARAMETER_FLASH + first as u32, &changed)?;
        let end = time + nanoseconds(operation.takes);
        self.flash.runs = true;
        self.flash.is_cut = operation.is_cut;
        self.hold(Hold::Until(end));
        Ok(true)
    }

    /// The sectors behind a reset: an operation that ran is left undone, and a supply that comes is there.
    pub(super) fn flash_after(&mut self, reset: Reset, now: Nanoseconds) -> FlashModel {
        let mut sectors = std::mem::take(&mut self.peripherals.flash.sectors);
        if self.flash.runs && !self.flash.ends(now) {
            sectors.interrupt(self.measurements.instructions);
        }
        if let Reset::PowerOn(_) = reset {
            sectors.restore_supply();
            self.flash = State::default();
        }
        sectors
    }

    /// Shows a QEMU that has just started what the flash holds.
    pub(super) fn copy_flash(&mut self) -> Result<(), EmulatorError> {
        self.copy_production_record()?;
        self.copy_where_different(FlashModel::new().contents())
    }

    pub(super) fn copy_production_record(&mut self) -> Result<(), EmulatorError> {
        let record = words(&self.production_record);
        self.write_memory(PRODUCTION_RECORD, &record)
    }

    fn copy_where_different(&mut self, before: &[u8]) -> Result<(), EmulatorError> {
        const AT_ONCE: usize = 960;
        let parts = self.flash().contents().chunks(AT_ONCE).zip(before.chunks(AT_ONCE)).enumerate();
        let different: Vec<(u32, Vec<u32>)> = parts
            .filter(|(_, (now, before))| now != before)
            .map(|(index, (now, _))| ((index * AT_ONCE) as u32, words(now)))
            .collect();
        for (offset, part) in different {
            self.write_memory(PARAMETER_FLASH + offset, &part)?;
        }
        Ok(())
    }
}
