//! Incremental encoder on TIM2: 32-bit count of four edges per line, latched in hardware by the interrupt lines of the SERCON816.
//!
//! | channel | pin | what |
//! |---|---|---|
//! | CH1, CH2 | PA0, PA1 | tracks A and B, encoder mode 3 (all four edges) |
//! | CH3 | PA2 | INT1 of the chip: copies the counter to CCR3 at every edge |
//! | CH4 | PA3 | INT0 of the chip: copies the counter to CCR4 at every edge |
//!
//! Both edges are captured because the polarity of the lines is not public (sercon816.md G2). A handler therefore has to read the latch
//! *before* it clears the chip's flags: clearing them makes the trailing edge, which captures again.
//!
//! All four inputs have the same filter, 8 equal samples at 84 MHz (95 ns): A and B then reach the counter, and INT0/INT1 the latch,
//! with the same delay, so that the latched count is the one that belongs to the edge on the pin. The filter keeps out ringing of
//! the line receivers. A track has to keep a level for nine samples, one more than the filter wants, to be seen for certain, and a level is
//! two increments long: [`INCREMENTS_PER_SECOND`], a hundred times what a motor with 2500 lines makes at 1000 revolutions a minute. S-0-0128 holds S-0-0113
//! and S-0-0116 against it.

use drive::InterruptLine;
use stm32f4xx_hal::{
    pac,
    rcc::{Enable, Rcc},
};

/// What the filters of both tracks pass, see above.
pub(crate) const INCREMENTS_PER_SECOND: u32 = 2 * (SAMPLES_PER_SECOND / (SAMPLES + 1));
const _: () = assert!(INCREMENTS_PER_SECOND / 100_000 == 186, "the text of S-0-0113 says 18.6 million");
/// Of the timer's clock.
const SAMPLES_PER_SECOND: u32 = 84_000_000;
/// Equal ones in a row, as `fck_int_n8` sets them.
const SAMPLES: u32 = 8;

/// Position now, as [`Encoder::count`]: for the counters that stand beside this one, see [`crate::edge_latches`].
#[inline(always)]
pub(crate) fn count() -> u32 {
    // SAFETY: reading TIM2_CNT has no side effect, and nobody writes it after set-up.
    unsafe { (*pac::TIM2::ptr()).cnt().read().bits() }
}

/// The encoder counter and its two latches.
#[derive(Debug)]
pub struct Encoder {
    timer: pac::TIM2,
}

impl Encoder {
    /// Starts counting from 0.
    pub(crate) fn new(timer: pac::TIM2, rcc: &mut Rcc) -> Self {
        pac::TIM2::enable(rcc);
        timer.ccmr1_input().write(|w| {
            w.cc1s().ti1().ic1f().fck_int_n8();
            w.cc2s().ti2().ic2f().fck_int_n8()
        });
        timer.ccmr2_input().write(|w| {
            w.cc3s().ti3().ic3f().fck_int_n8();
            w.cc4s().ti4().ic4f().fck_int_n8()
        });
        // CCxP and CCxNP both set is "both edges" for a capture; channels 1 and 2 stay non-inverted, as encoder mode wants.
        timer.ccer().write(|w| {
            w.cc3e().set_bit().cc3p().set_bit().cc3np().set_bit();
            w.cc4e().set_bit().cc4p().set_bit().cc4np().set_bit()
        });
        timer.smcr().write(|w| w.sms().encoder_mode_3());
        timer.arr().write(|w| w.arr().set(u32::MAX));
        timer.cnt().write(|w| w.cnt().set(0));
        timer.cr1().write(|w| w.cen().set_bit());
        Self { timer }
    }

    /// Position now, in increments, wrapping at 2^32.
    #[inline(always)]
    pub fn count(&self) -> u32 {
        self.timer.cnt().read().bits()
    }

    /// Position at the last edge of a line, in increments, wrapping at 2^32.
    #[inline(always)]
    pub fn latch(&self, line: InterruptLine) -> u32 {
        match line {
            InterruptLine::Int0 => self.timer.ccr4().read().bits(),
            InterruptLine::Int1 => self.timer.ccr3().read().bits(),
        }
    }
}
