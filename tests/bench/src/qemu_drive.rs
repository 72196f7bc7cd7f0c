//! The flashed ELF in QEMU, as a processor of the world.

use ring::Nanoseconds;
use ring::chip::SharedChip;
use ring::wire::BitRate;

use crate::executor::{Elves, SharedMeasurements};
use crate::motor_side::SharedMotorSide;
use crate::processor::{Processor, ProcessorError};

/// A drive that runs in QEMU.
pub struct QemuDrive;

impl QemuDrive {
    /// Boots the ELF.
    ///
    /// # Errors
    /// QEMU does not start.
    pub fn start(
        _elves: &Elves,
        _chip: &SharedChip,
        _motor_side: &SharedMotorSide,
        address: u8,
        _bit_rate: BitRate,
        _measurements: SharedMeasurements,
    ) -> Result<Self, ProcessorError> {
        Err(ProcessorError { address, cause: "the emulator is not joined to the bench yet".to_owned() })
    }
}

impl Processor for QemuDrive {
    fn next_event(&self) -> Option<Nanoseconds> {
        None
    }

    fn run(&mut self, _now: Nanoseconds, _horizon: &dyn Fn() -> Nanoseconds) -> Result<(), ProcessorError> {
        Ok(())
    }
}
