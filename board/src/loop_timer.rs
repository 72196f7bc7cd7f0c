//! Tick of the control loops: TIM6 update interrupt every 125 us, trimmed to the cycle of the ring.

use drive::LOOP_PERIOD_MICROSECONDS;
use stm32f4xx_hal::{
    pac,
    rcc::{Enable, Rcc},
};

use crate::clocks::APB1_TIMER_HZ;

/// Timer counts in an untrimmed period: 84 MHz x 125 us = 10 500, one count is 11.9 ns.
pub const COUNTS: u16 = {
    let counts = APB1_TIMER_HZ / 1_000_000 * LOOP_PERIOD_MICROSECONDS as u32;
    assert!(counts == 10_500);
    counts as u16
};

/// Largest trim in either direction, in counts: 5 % of the period. Pulls a phase error of half a period in within ten
/// ticks, and no error of the caller can make the tick outrun the control loop.
pub const LARGEST_TRIM: i16 = 525;

/// Reads the phase of the timer and trims its period.
#[derive(Debug)]
pub struct LoopTimer {
    timer: pac::TIM6,
}

/// Acknowledges the interrupt; owned by the handler, apart from [`LoopTimer`] so that it needs no lock.
#[derive(Debug)]
pub struct LoopTick(());

impl LoopTimer {
    /// Starts the timer. The first tick comes after one full period.
    pub(crate) fn new(timer: pac::TIM6, rcc: &mut Rcc) -> (Self, LoopTick) {
        pac::TIM6::enable(rcc);
        timer.psc().write(|w| w.psc().set(0));
        timer.arr().write(|w| w.arr().set(reload(0)));
        // URS keeps the forced update, which loads PSC and ARR, from raising the interrupt. ARPE: a new period holds from the next
        // tick on; without it a shorter one could be written after the counter has passed it.
        timer.cr1().write(|w| w.arpe().enabled().urs().counter_only());
        timer.egr().write(|w| w.ug().update());
        timer.sr().write(|w| w.uif().clear());
        timer.dier().write(|w| w.uie().enabled());
        timer.cr1().modify(|_, w| w.cen().enabled());
        (Self { timer }, LoopTick(()))
    }

    /// Counts since the last tick, 0 to one below the period.
    #[inline(always)]
    pub fn phase(&self) -> u16 {
        self.timer.cnt().read().cnt().bits()
    }

    /// Sets the period to [`COUNTS`] + `counts` from the next tick on, limited to +-[`LARGEST_TRIM`].
    #[inline(always)]
    pub fn trim(&mut self, counts: i16) {
        self.timer.arr().write(|w| w.arr().set(reload(counts)));
    }
}

impl LoopTick {
    /// Clears the update flag; to be called first in the handler.
    #[inline(always)]
    pub fn acknowledge(&mut self) {
        // SAFETY: the update flag is the only writable bit of TIM6_SR; a single store, and no other code writes this register.
        unsafe { (*pac::TIM6::ptr()).sr().write(|w| w.uif().clear()) };
    }
}

/// Value of ARR: the counter runs from 0 to ARR, so a period is one count longer.
const fn reload(trim: i16) -> u16 {
    let limited = if trim > LARGEST_TRIM {
        LARGEST_TRIM
    } else if trim < -LARGEST_TRIM {
        -LARGEST_TRIM
    } else {
        trim
    };
    COUNTS.wrapping_sub(1).wrapping_add_signed(limited)
}

const _: () = {
    assert!(reload(0) == 10_499);
    assert!(reload(i16::MAX) == 10_499 + 525);
    assert!(reload(i16::MIN) == 10_499 - 525);
};
