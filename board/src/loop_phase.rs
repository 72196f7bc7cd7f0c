//! Where in the tick of the control loops an edge of the SERCON816's lines came: what the clock recovery steers by.
//!
//! A tick of 125 us starts at a peak of TIM1's counter, in the middle of the low-side pulses, where the currents are sampled. At 16 kHz
//! every second peak starts one. TIM1 alone cannot tell which, nor can it be read together with the half-tick that software keeps:
//! between the peak and the current loop, 2 us later, the two contradict each other. So the current loop, which nothing interrupts, reads
//! TIM1 and TIM9 together and notes *in the time of TIM9* when the tick started (one store). From there on everything is
//! a difference of two times of one counter:
//!
//! | edge | difference | phase |
//! |---|---|---|
//! | in the tick | 0 to its length | the difference |
//! | in the tick before, its handler was held up | negative | + length of that tick, which is measured |
//! | behind the next peak, whose current loop has not run yet | above the length | - length |
//!
//! All three are right whenever the reader is interrupted: start and length come in one load, and the capture does not move by being
//! read late. An edge may be up to 195 us older than the start of the tick that is noted.
//!
//! Two reads, TIM1 and then TIM9, take some cycles of the bus: every phase is early by the same 30 ns or so.

use core::sync::atomic::{AtomicU32, Ordering};

use drive::InterruptLine;

use crate::edge_time::{self, EdgeTime};

/// Counts of a tick's phase, untrimmed: 84 MHz x 125 us.
pub const COUNTS: u16 = 10_500;

/// Length of an untrimmed tick in the clock of TIM1 and TIM9: 168 MHz x 125 us.
const LENGTH: u16 = 21_000;

/// More than two ticks in a row can differ from [`LENGTH`] by trimming: 5 %. Beyond, a current loop was missed.
const PLAUSIBLE: u16 = 1_050;

/// Start of the tick (low half-word) and length of the one before it.
static TICK: AtomicU32 = AtomicU32::new((LENGTH as u32) << 16);

/// Notes that a tick started, at a time of TIM9. The current loop is the only one that calls this.
#[inline(always)]
pub(crate) fn publish(start: u16) {
    TICK.store(next(TICK.load(Ordering::Relaxed), start), Ordering::Relaxed);
}

/// Measures the phase of the tick; for the tasks that serve the ring.
#[derive(Debug)]
pub struct LoopPhase {
    edge_time: EdgeTime,
}

impl LoopPhase {
    pub(crate) const fn new(edge_time: EdgeTime) -> Self {
        Self { edge_time }
    }

    /// From the start of a tick to the last edge of a line: 0 to [`COUNTS`] - 1, in counts of 84 MHz.
    ///
    /// To be called before the chip's flags are cleared, which makes another edge.
    #[inline(always)]
    pub fn at_edge(&self, line: InterruptLine) -> u16 {
        phase(TICK.load(Ordering::Relaxed), self.edge_time.capture(line))
    }

    /// From the start of the tick to now, as [`LoopPhase::at_edge`].
    #[inline(always)]
    pub fn now(&self) -> u16 {
        phase(TICK.load(Ordering::Relaxed), edge_time::now())
    }
}

/// What follows on `tick` when the next one starts.
const fn next(tick: u32, start: u16) -> u32 {
    let measured = start.wrapping_sub(tick as u16);
    let length = if measured.abs_diff(LENGTH) <= PLAUSIBLE { measured } else { LENGTH };
    (length as u32) << 16 | start as u32
}

/// Phase of a time of TIM9, in counts of 84 MHz.
const fn phase(tick: u32, time: u16) -> u16 {
    let length = (tick >> 16) as i32;
    let since_start = time.wrapping_sub(tick as u16) as i16 as i32;
    let in_tick = if since_start < 0 {
        since_start.wrapping_add(length)
    } else if since_start >= length {
        since_start.wrapping_sub(length)
    } else {
        since_start
    };
    // Outside the tick even so: the edge is older than anything that is asked about, or the tick is longer than nominal.
    let counts = if in_tick < 0 { 0 } else { in_tick >> 1 };
    if counts < COUNTS as i32 { counts as u16 } else { COUNTS.wrapping_sub(1) }
}

const fn tick(start: u16, length: u16) -> u32 {
    (length as u32) << 16 | start as u32
}

// A tick is as long as measured, across the wrap of the counter as well, and nominal when a current loop was missed.
const _: () = {
    assert!(next(tick(0, LENGTH), 21_000) == tick(21_000, 21_000));
    assert!(next(tick(60_000, LENGTH), 15_466) == tick(15_466, 21_002));
    assert!(next(tick(100, LENGTH), 20_050) == tick(20_050, 19_950));
    assert!(next(tick(100, LENGTH), 22_150) == tick(22_150, 22_050));
    assert!(next(tick(100, 20_900), 20_049) == tick(20_049, LENGTH));
    assert!(next(tick(100, 20_900), 22_151) == tick(22_151, LENGTH));
};

// In the tick, in the one before, behind the next peak; each at its ends, without and with a wrap of the counter in between.
const _: () = {
    let plain = tick(30_000, 21_000);
    assert!(phase(plain, 30_000) == 0 && phase(plain, 30_001) == 0 && phase(plain, 30_002) == 1);
    assert!(phase(plain, 40_500) == 5_250 && phase(plain, 50_999) == 10_499);
    assert!(phase(plain, 29_999) == 10_499 && phase(plain, 29_998) == 10_499 && phase(plain, 29_997) == 10_498);
    assert!(phase(plain, 9_000) == 0);
    assert!(phase(plain, 51_000) == 0 && phase(plain, 51_312) == 156);
    assert!(phase(plain, 0) == 0, "older than a tick");

    let wrapped = tick(60_000, 21_000);
    assert!(phase(wrapped, 0) == 2_768 && phase(wrapped, 15_463) == 10_499);
    assert!(phase(wrapped, 15_464) == 0 && phase(wrapped, 15_776) == 156);
    assert!(phase(tick(100, 21_000), 65_535) == 10_449);

    // As the current loop finds it: 2 us behind the peak, and behind the valley when it is late.
    assert!(phase(next(plain, 51_312u16.wrapping_sub(312)), 51_000) == 0);
    assert!(phase(next(plain, 51_312u16.wrapping_sub(312)), 50_998) == 10_499);

    // Trimmed: the tick before was 2 % longer, or shorter; its last count is that of its own length.
    assert!(phase(tick(30_000, 21_420), 51_000) == 10_499 && phase(tick(30_000, 21_420), 51_420) == 0);
    assert!(phase(tick(30_000, 21_420), 29_998) == 10_499 && phase(tick(30_000, 21_420), 8_580) == 0);
    assert!(phase(tick(30_000, 20_580), 29_998) == 10_289 && phase(tick(30_000, 20_580), 9_420) == 0);
};

// Every phase, from ticks that start anywhere: the same whether the edge is in the tick, a tick before or a tick behind.
#[allow(clippy::arithmetic_side_effects, reason = "evaluated by the compiler only")]
const _: () = {
    let mut start = 0u16;
    while start < 55_000 {
        let mut since = 0u16;
        while since < LENGTH {
            let time = start.wrapping_add(since);
            assert!(phase(tick(start, LENGTH), time) == since / 2);
            assert!(since == 0 || phase(tick(start.wrapping_add(LENGTH), LENGTH), time) == since / 2);
            assert!(since >= 11_000 || phase(tick(start.wrapping_sub(LENGTH), LENGTH), time) == since / 2);
            since += 167;
        }
        start += 9_973;
    }
};
