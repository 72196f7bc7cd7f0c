//! Microseconds since start: TIM5, 32 bit, free running; for log lines and latency figures, never for control.

use stm32f4xx_hal::{
    pac,
    rcc::{Enable, Rcc},
};

use crate::clocks::APB1_TIMER_HZ;

/// The running clock; copies read the same counter.
#[derive(Clone, Copy, Debug)]
pub struct Timestamp(());

impl Timestamp {
    pub(crate) fn new(timer: &pac::TIM5, rcc: &mut Rcc) -> Self {
        pac::TIM5::enable(rcc);
        timer.psc().write(|w| w.psc().set((APB1_TIMER_HZ / 1_000_000 - 1) as u16));
        timer.arr().write(|w| w.arr().set(u32::MAX));
        // The prescaler is only loaded by an update event.
        timer.egr().write(|w| w.ug().update());
        timer.cr1().write(|w| w.cen().enabled());
        Self(())
    }

    /// Microseconds since start, wrapping after 71 minutes.
    #[must_use]
    pub fn now(self) -> u32 {
        microseconds()
    }
}

/// As [`Timestamp::now`], for the logger, which has no place to keep a clock; 0 until the board is set up.
#[must_use]
pub fn microseconds() -> u32 {
    // SAFETY: reading TIM5_CNT has no side effect, and nobody writes it after set-up.
    unsafe { (*pac::TIM5::ptr()).cnt().read().bits() }
}
