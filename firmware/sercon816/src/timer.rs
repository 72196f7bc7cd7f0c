//! The chip's timers, as far as the drive needs them.

use crate::bus::Register;

/// A timer: the register that holds its time and the bit of 05H that it sets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Timer {
    /// Takes the time in us after the MST.
    pub register: Register,
    /// Bit of 05H, 8 to 15.
    pub bit: u8,
}

impl Timer {
    /// The bit as a mask for 05H.
    #[must_use]
    pub const fn mask(self) -> u16 {
        1_u16.wrapping_shl(self.bit as u32)
    }
}

/// The two timers that the drive needs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct TimerMap {
    /// The timer for t3, S-0-0008.
    pub command_valid: Timer,
    /// The timer for t4, S-0-0007.
    pub capture_feedback: Timer,
    /// Bits of 05H that recur in every cycle by themselves; a hint that a new cycle began.
    pub cycle_bits: u16,
}
