//! A counter in centre-aligned mode, worked out from time (RM0090 17.3.2).
//!
//! A *half* is one way of the counter: up from 0 to reload - 1, or down from the reload to 1, each as many counts long as the reload that is
//! in force. The counter reaches the reload by the overflow that ends the way up, and 0 by the underflow that ends the way down. Position is
//! kept as the timer clock at which the half began, so that no rounding adds up.

use ring::Nanoseconds;

use crate::clock::{clocks_at, time_of_clocks};

/// The counter. It knows the reload and the divider in force; who owns it decides when these change.
#[derive(Clone, Debug)]
pub(crate) struct CentredCounter {
    clock_hz: u64,
    runs: bool,
    down: bool,
    /// Counts in a half.
    reload: u32,
    /// Timer clocks in a count.
    divider: u64,
    /// Timer clock at which the half began; only while it runs.
    began_at: u64,
    /// The count while it stands.
    held: u32,
}

impl CentredCounter {
    /// Stands at 0, directed up.
    pub(crate) fn new(reload: u32) -> Self {
        Self { clock_hz: 16_000_000, runs: false, down: false, reload, divider: 1, began_at: 0, held: 0 }
    }

    /// The timer clock changes; the count goes on from where it stands.
    pub(crate) fn set_clock(&mut self, hertz: u64, now: Nanoseconds) {
        if hertz != self.clock_hz {
            let count = self.count(now);
            self.clock_hz = hertz;
            self.set_count(count, now);
        }
    }

    pub(crate) fn clock_hz(&self) -> u64 {
        self.clock_hz
    }

    /// With a reload of 0 the counter is blocked.
    pub(crate) fn moves(&self) -> bool {
        self.runs && self.reload != 0
    }

    pub(crate) fn is_down(&self) -> bool {
        self.down
    }

    /// Counts in the half that runs.
    pub(crate) fn reload(&self) -> u32 {
        self.reload
    }

    /// Timer clocks in a count.
    pub(crate) fn divider(&self) -> u64 {
        self.divider
    }

    /// Counts since the half began; less than the reload.
    pub(crate) fn progress(&self, now: Nanoseconds) -> u32 {
        if !self.moves() {
            return if self.down { self.reload.saturating_sub(self.held) } else { self.held };
        }
        let counts = self.clocks(now).saturating_sub(self.began_at) / self.divider;
        counts.min(u64::from(self.reload) - 1) as u32
    }

    /// The count.
    pub(crate) fn count(&self, now: Nanoseconds) -> u32 {
        if !self.moves() {
            self.held
        } else if self.down {
            self.reload - self.progress(now)
        } else {
            self.progress(now)
        }
    }

    /// When the half that runs has made so many counts.
    pub(crate) fn time_of_progress(&self, counts: u32) -> Nanoseconds {
        let clocks = self.began_at + u64::from(counts) * self.divider;
        time_of_clocks(clocks, self.clock_hz)
    }

    /// The overflow or underflow that ends the half.
    pub(crate) fn half_end(&self) -> Option<Nanoseconds> {
        self.moves().then(|| self.time_of_progress(self.reload))
    }

    /// Passes the end of the half; the other one runs with this reload and divider.
    pub(crate) fn turn(&mut self, reload: u32, divider: u64) {
        self.began_at += u64::from(self.reload) * self.divider;
        self.down = !self.down;
        self.held = if self.down { reload } else { 0 };
        self.reload = reload;
        self.divider = divider;
    }

    /// Starts or stops counting where it stands.
    pub(crate) fn run(&mut self, on: bool, now: Nanoseconds) {
        let count = self.count(now);
        self.runs = on;
        self.set_count(count, now);
    }

    /// A count is written; the direction stays.
    pub(crate) fn set_count(&mut self, count: u32, now: Nanoseconds) {
        self.held = count;
        let progress = if self.down { self.reload.saturating_sub(count) } else { count };
        self.began_at = self.clocks(now).saturating_sub(u64::from(progress) * self.divider);
    }

    /// Reload and divider change in the middle of a half, without preload.
    pub(crate) fn set_reload(&mut self, reload: u32, now: Nanoseconds) {
        let count = self.count(now);
        self.reload = reload;
        self.set_count(count, now);
    }

    /// An update by software: begins again at 0, directed up.
    pub(crate) fn restart(&mut self, reload: u32, divider: u64, now: Nanoseconds) {
        self.down = false;
        self.reload = reload;
        self.divider = divider;
        self.set_count(0, now);
    }

    fn clocks(&self, now: Nanoseconds) -> u64 {
        clocks_at(now, self.clock_hz)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const START: Nanoseconds = Nanoseconds(1_000_000);

    fn running() -> CentredCounter {
        let mut counter = CentredCounter::new(5_250);
        counter.set_clock(168_000_000, Nanoseconds::ZERO);
        counter.run(true, START);
        counter
    }

    #[test]
    fn it_counts_up_to_the_reload_and_down_again() {
        let mut counter = running();
        assert_eq!(counter.count(START + Nanoseconds(10_000)), 1_680);
        assert_eq!(counter.half_end(), Some(START + Nanoseconds(31_250)));
        counter.turn(5_250, 1);
        assert!(counter.is_down());
        assert_eq!(counter.count(START + Nanoseconds(31_250)), 5_250);
        assert_eq!(counter.count(START + Nanoseconds(41_250)), 5_250 - 1_680);
        assert_eq!(counter.count(START + Nanoseconds(62_499)), 1);
        assert_eq!(counter.half_end(), Some(START + Nanoseconds(62_500)));
        counter.turn(5_250, 1);
        assert_eq!((counter.is_down(), counter.count(START + Nanoseconds(62_500))), (false, 0));
    }

    #[test]
    fn periods_do_not_drift() {
        let mut counter = CentredCounter::new(5_251);
        counter.set_clock(168_000_000, Nanoseconds::ZERO);
        counter.run(true, START);
        for _ in 0..32_000 {
            counter.turn(5_251, 1);
        }
        // 32 001 halves of 5251 clocks at 168 MHz.
        let expected = START.0 + 32_001 * 5_251 * 1_000 / 168;
        assert!(counter.half_end().unwrap().0.abs_diff(expected) <= 1);
    }

    #[test]
    fn a_stopped_counter_keeps_count_and_direction() {
        let mut counter = running();
        counter.turn(5_250, 1);
        let stopped = START + Nanoseconds(41_250);
        counter.run(false, stopped);
        assert_eq!(counter.half_end(), None);
        assert_eq!(counter.count(stopped + START), 3_570);
        counter.run(true, stopped + START);
        assert_eq!(counter.half_end(), Some(stopped + START + Nanoseconds(21_250)));
    }

    #[test]
    fn a_prescaler_stretches_every_count() {
        let mut counter = running();
        counter.restart(1_000, 4, START);
        assert_eq!(counter.count(START + Nanoseconds(2_381)), 100);
        assert_eq!(counter.half_end(), Some(START + Nanoseconds(23_810)));
    }
}
