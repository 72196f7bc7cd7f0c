//! Torque-producing current command: DAC channel 1 on PA4, 12 bit offset binary.
//!
//! An operational amplifier behind the pin makes the usual command voltage of an analogue amplifier of it:
//!
//! | code | voltage at the terminal | current |
//! |---|---|---|
//! | 000H | -10 V | -100 % of peak |
//! | 800H | 0 V | none |
//! | FFFH | +9.995 V | +99.95 % of peak |
//!
//! One step is 4.88 mV. The code is written before the converter is switched on, so that it never shows anything but zero current.

use fixed::types::I1F15;
use stm32f4xx_hal::{
    pac,
    rcc::{Enable, Rcc},
};

/// Code of zero current.
pub const ZERO: u16 = 0x800;

/// The code for a fraction of the peak current, rounded to the nearest step and limited at the positive end.
#[must_use]
pub const fn code(fraction_of_peak: I1F15) -> u16 {
    const HALF_STEP: i16 = 8;
    let steps = fraction_of_peak.to_bits().saturating_add(HALF_STEP) >> 4;
    ZERO.wrapping_add_signed(steps)
}

/// The converter.
#[derive(Debug)]
pub struct CurrentCommand {
    converter: pac::DAC,
}

impl CurrentCommand {
    /// Switches the converter on at zero current.
    pub(crate) fn new(converter: pac::DAC, rcc: &mut Rcc) -> Self {
        pac::DAC::enable(rcc);
        converter.dhr12r1().write(|w| w.daccdhr().set(ZERO));
        converter.cr().write(|w| w.en1().enabled());
        Self { converter }
    }

    /// Puts the command out; the voltage follows within some microseconds.
    #[inline(always)]
    pub fn set(&mut self, fraction_of_peak: I1F15) {
        self.converter.dhr12r1().write(|w| w.daccdhr().set(code(fraction_of_peak)));
    }
}

// The ends, the middle and the two steps beside it; a target without a test runner checks them at compile time.
const _: () = {
    assert!(code(I1F15::MIN) == 0);
    assert!(code(I1F15::from_bits(-16)) == 0x7FF);
    assert!(code(I1F15::ZERO) == ZERO);
    assert!(code(I1F15::from_bits(16)) == 0x801);
    assert!(code(I1F15::MAX) == 0xFFF);
};
