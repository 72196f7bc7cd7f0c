//! When the lines of the SERCON816 had their edges: TIM9, 16 bit, free running at 168 MHz like TIM1, wraps every 390 us.
//!
//! | channel | pin | what |
//! |---|---|---|
//! | CH1 | PE5 | INT0 of the chip: copies the counter to CCR1 at every edge |
//! | CH2 | PE6 | INT1 of the chip: copies the counter to CCR2 at every edge |
//!
//! TIM9's other pins are PA2 and PA3, where TIM2 latches the encoder: a pin has one alternate function, so the board leads each line to
//! two pins. Both timers take both edges, and a handler reads the capture before it clears the chip's flags, see [`crate::encoder`].
//!
//! The filter is as long as that of the encoder, 95 ns: 8 equal samples at half of 168 MHz. Time and position of an edge then belong
//! together to one count of either clock.

use drive::InterruptLine;
use stm32f4xx_hal::{
    pac,
    rcc::{Enable, Rcc},
};

/// The free-running counter and its two captures.
#[derive(Debug)]
pub struct EdgeTime {
    timer: pac::TIM9,
}

impl EdgeTime {
    /// Starts the counter.
    pub(crate) fn new(timer: pac::TIM9, rcc: &mut Rcc) -> Self {
        pac::TIM9::enable(rcc);
        timer.ccmr1_input().write(|w| {
            w.cc1s().ti1().ic1f().fdts_div2_n8();
            w.cc2s().ti2().ic2f().fdts_div2_n8()
        });
        // CCxP and CCxNP both set is "both edges".
        timer.ccer().write(|w| {
            w.cc1e().set_bit().cc1p().set_bit().cc1np().set_bit();
            w.cc2e().set_bit().cc2p().set_bit().cc2np().set_bit()
        });
        timer.arr().write(|w| w.arr().set(u16::MAX));
        timer.cr1().write(|w| w.cen().set_bit());
        Self { timer }
    }

    /// Time of the last edge of a line, in counts of 168 MHz, wrapping at 2^16.
    #[inline(always)]
    pub fn capture(&self, line: InterruptLine) -> u16 {
        match line {
            InterruptLine::Int0 => self.timer.ccr1().read().ccr().bits(),
            InterruptLine::Int1 => self.timer.ccr2().read().ccr().bits(),
        }
    }
}

/// Time now, in counts of 168 MHz, wrapping at 2^16: for the current loop, which shares the clock with the handlers of the lines.
#[inline(always)]
pub(crate) fn now() -> u16 {
    register() as u16
}

/// [`now`] as the register has it: 0 above its 16 bits.
#[inline(always)]
pub(crate) fn register() -> u32 {
    // SAFETY: reading TIM9_CNT has no side effect, and nobody writes it after set-up.
    unsafe { (*pac::TIM9::ptr()).cnt().read().bits() }
}
