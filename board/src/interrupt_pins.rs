//! Interrupt lines of the SERCON816: INT1 on PA2 (EXTI2), INT0 on PA3 (EXTI3).
//!
//! Polarity and shape of the lines are not public (sercon816.md G2), so both edges interrupt: the leading one when something happens,
//! the trailing one when the flags have been cleared; the handler reads the status either way and finds nothing the second time.
//! The same pins latch the encoder, see [`crate::encoder`]; EXTI sees a pin in its alternate function too.

use drive::InterruptLine;
use stm32f4xx_hal::{
    pac,
    rcc::{Enable, Rcc},
};

/// EXTI lines 2 (INT1) and 3 (INT0).
const INT1_BIT: u32 = 1 << 2;
const INT0_BIT: u32 = 1 << 3;

/// One of the two lines, owned by its interrupt handler.
#[derive(Debug)]
pub struct InterruptPin {
    line: InterruptLine,
}

impl InterruptPin {
    /// Which pin of the chip this is.
    #[must_use]
    pub const fn line(&self) -> InterruptLine {
        self.line
    }

    /// Clears the pending edge. To be called first in the handler, before the chip's status is read: an edge that
    /// comes while the status is being served then starts the handler once more instead of being lost.
    #[inline(always)]
    pub fn acknowledge(&mut self) {
        let bit = bit_of(self.line);
        // SAFETY: EXTI_PR is write-one-to-clear: a single store that touches no bit but this line's, so it cannot
        // race with the other handler.
        unsafe { (*pac::EXTI::ptr()).pr().write(|w| w.bits(bit)) };
    }
}

/// Whether the handler of this line has still to be started for an edge.
#[inline(always)]
pub(crate) fn edge_waits(line: InterruptLine) -> bool {
    // SAFETY: reading EXTI_PR changes nothing.
    let pending = unsafe { (*pac::EXTI::ptr()).pr().read().bits() };
    pending & bit_of(line) != 0
}

const fn bit_of(line: InterruptLine) -> u32 {
    match line {
        InterruptLine::Int0 => INT0_BIT,
        InterruptLine::Int1 => INT1_BIT,
    }
}

/// Routes port A to both EXTI lines and arms both edges; returns INT0 and INT1.
pub(crate) fn set_up(exti: &pac::EXTI, syscfg: &pac::SYSCFG, rcc: &mut Rcc) -> (InterruptPin, InterruptPin) {
    pac::SYSCFG::enable(rcc);
    syscfg.exticr1().modify(|_, w| w.exti2().pa().exti3().pa());
    exti.rtsr().modify(|_, w| w.tr2().enabled().tr3().enabled());
    exti.ftsr().modify(|_, w| w.tr2().enabled().tr3().enabled());
    exti.pr().write(|w| w.pr2().clear().pr3().clear());
    exti.imr().modify(|_, w| w.mr2().unmasked().mr3().unmasked());
    (InterruptPin { line: InterruptLine::Int0 }, InterruptPin { line: InterruptLine::Int1 })
}
