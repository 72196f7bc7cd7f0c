//! Coil of the holding brake: PC5, 1 = energised, the brake is released.
//!
//! Without current the brake holds: through reset, with a broken wire, and from whatever place the program comes to a standstill
//! ([`apply`]). The coil driver's input has a pull-down, the pin table drives the output low before anything else.

use stm32f4xx_hal::pac;

use crate::pins;

const COIL: u32 = pins::BRAKE_COIL.mask();

/// Address of BSRR of the coil's port, for handlers that have no stack.
pub const BSRR: u32 = 0x4002_0818;
/// What takes the current off the coil there.
pub const APPLY: u32 = COIL << 16;

/// Takes the current off the coil: for fault and panic handlers, which own nothing.
pub fn apply() {
    // SAFETY: a single store that can only apply the brake; right at any time, whoever owns the port.
    unsafe { (*pac::GPIOC::ptr()).bsrr().write(|w| w.bits(APPLY)) };
}

/// The output to the coil.
#[derive(Debug)]
pub struct BrakeCoil(());

impl BrakeCoil {
    /// The pin table has already driven the output low.
    pub(crate) const fn new() -> Self {
        Self(())
    }

    /// Energises the coil (the brake is released) or takes the current off it.
    #[inline(always)]
    pub fn set_energised(&mut self, on: bool) {
        if on {
            // SAFETY: every value is valid for BSRR; this one sets the coil's pin and leaves the others alone.
            unsafe { (*pac::GPIOC::ptr()).bsrr().write(|w| w.bits(COIL)) };
        } else {
            apply();
        }
    }
}
