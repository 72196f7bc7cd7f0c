//! Window watchdog: switches off and resets when the current loop or the control loop has not run for a millisecond.
//!
//! A current loop that hangs leaves its last voltage on the motor, a control loop that hangs its last current, and the independent watchdog takes 100 ms.
//! This one is fed by the current loop, once in a loop tick (125 us) in which it had a new order of the control loop. It runs from APB1.
//!
//! | since the last feeding | what |
//! |---|---|
//! | 1.07 to 1.17 ms | interrupt above every task: nobody is bound to it, so it ends in the fault handler: bridge off, brake closed, record of who ran, reset |
//! | 1.17 to 1.27 ms | reset, without the processor |
//!
//! The window is not used: too early is no fault.

use stm32f4xx_hal::{pac, rcc::Rcc};

/// T, without WDGA, which only a reset clears: feeding does not start it. The counter falls by one every 4 096 cycles of APB1 (97.5 us); at 40H comes the
/// interrupt, below it the reset.
const ALIVE: u8 = 0x4C;
/// WDGA, and the longest T: until the first feeding 6.2 ms.
const BEGIN: u8 = 0x80 | 0x7F;

/// Its clock; before the current loop runs.
pub(crate) fn enable(rcc: &mut Rcc) {
    rcc.apb1enr().modify(|_, w| w.wwdgen().enabled());
}

/// Starts it; cannot be stopped. The interrupts of the loops must begin within 6 ms.
pub(crate) fn start(watchdog: &pac::WWDG) {
    // SAFETY: every value is valid for CFR: no window, undivided, with its interrupt.
    watchdog.cfr().write(|w| unsafe { w.w().bits(0x7F) }.ewi().set_bit());
    // SAFETY: every value is valid for CR.
    watchdog.cr().write(|w| unsafe { w.bits(BEGIN.into()) });
    // SAFETY: its handler ends the program. No priority is set: 0 is above all that RTIC uses.
    unsafe { cortex_m::peripheral::NVIC::unmask(pac::Interrupt::WWDG) };
}

/// Feeds it, if it runs.
#[inline(always)]
pub(crate) fn feed() {
    // SAFETY: a single store that can only feed; the one who started it touches it no more.
    unsafe { (*pac::WWDG::ptr()).cr().write(|w| w.bits(ALIVE.into())) };
}

#[allow(clippy::arithmetic_side_effects, reason = "evaluated by the compiler only")]
const _: () = {
    // More than four ticks of the control loop, so that one that is late by two is none of this; and within a millisecond and a half.
    let shortest_us = (ALIVE - 0x40 - 1) as u32 * 4_096 / 42;
    let longest_us = (ALIVE - 0x40 + 1) as u32 * 4_096 / 42;
    assert!(shortest_us > 4 * 125 && longest_us < 1_500);
};
