//! Switch of the brake chopper: PF11, 1 = the resistor is across the DC link.
//!
//! It is off through reset, with a broken wire, and from whatever place the program comes to a standstill ([`off`]). The driver's input has a
//! pull-down, the pin table drives the output low before anything else. A processor that hangs with the resistor on is reset by the window
//! watchdog after 1.2 ms: it is the task that switches which feeds it.

use stm32f4xx_hal::pac;

use crate::pins;

const SWITCH: u32 = pins::CHOPPER.mask();

/// Address of BSRR of the switch's port, for handlers that have no stack.
pub const BSRR: u32 = 0x4002_1418;
/// What takes the resistor off there.
pub const OFF: u32 = SWITCH << 16;

/// Takes the resistor off the DC link: for fault and panic handlers, which own nothing.
pub fn off() {
    // SAFETY: a single store that can only switch the resistor off; right at any time, whoever owns the port.
    unsafe { (*pac::GPIOF::ptr()).bsrr().write(|w| w.bits(OFF)) };
}

/// The output to the switch.
#[derive(Debug)]
pub struct Chopper(());

impl Chopper {
    /// The pin table has already driven the output low.
    pub(crate) const fn new() -> Self {
        Self(())
    }

    /// Switches the resistor across the DC link, or off it.
    #[inline(always)]
    pub fn set(&mut self, on: bool) {
        if on {
            // SAFETY: every value is valid for BSRR; this one sets the switch's pin and leaves the others alone.
            unsafe { (*pac::GPIOF::ptr()).bsrr().write(|w| w.bits(SWITCH)) };
        } else {
            off();
        }
    }
}
