//! Digital lines to and from the amplifier.
//!
//! A broken wire, an unplugged connector or an unpowered amplifier must read as the safe state, so every line is active high with a
//! pull-down:
//!
//! | line | pin | level 1 | wire broken |
//! |---|---|---|---|
//! | enable (output) | PC14 | torque allowed | off: pull-down at the amplifier's input, which also holds through our reset |
//! | main power (input) | PC9 | DC link charged | no power |
//! | ready (input) | PC15 | no fault | fault |
//!
//! This is a command path, not a safety function: safe torque off belongs to the amplifier's own inputs.

use drive::Amplifier;
use stm32f4xx_hal::pac;

use crate::pins;

const ENABLE: u32 = pins::AMPLIFIER_ENABLE.mask();
const MAIN_POWER: u32 = pins::MAIN_POWER.mask();
const READY: u32 = pins::AMPLIFIER_READY.mask();

/// Forbids torque from wherever the program has come to a standstill: for fault and panic handlers, which own nothing.
pub fn off() {
    // SAFETY: a single store that can only switch off; right at any time, whoever owns the port.
    unsafe { (*pac::GPIOC::ptr()).bsrr().write(|w| w.bits(ENABLE << 16)) };
}

/// The amplifier's lines.
#[derive(Debug)]
pub struct AmplifierPort {
    port: pac::GPIOC,
}

impl AmplifierPort {
    /// Takes the port over; the pin table has already driven the enable output low.
    pub(crate) fn new(port: pac::GPIOC) -> Self {
        Self { port }
    }

    /// Allows or forbids torque.
    #[inline(always)]
    pub fn set_enable(&mut self, on: bool) {
        let bits = if on { ENABLE } else { ENABLE << 16 };
        // SAFETY: every value is valid for BSRR; this one sets or resets the enable pin and leaves the others alone.
        self.port.bsrr().write(|w| unsafe { w.bits(bits) });
    }

    /// Reads both inputs at the same instant.
    #[inline(always)]
    pub fn read(&self) -> Amplifier {
        let levels = self.port.idr().read().bits();
        Amplifier { main_power: levels & MAIN_POWER != 0, fault: levels & READY == 0 }
    }
}
