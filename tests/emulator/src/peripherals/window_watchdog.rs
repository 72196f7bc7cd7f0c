//! The window watchdog (RM0090 chapter 22).

use ring::Nanoseconds;

use crate::clock::{clocks_at, time_of_clocks};

const RUNS: u32 = 0x80;
const INTERRUPT: u32 = 1 << 9;
const LOWEST: u32 = 0x40;
/// Cycles of APB1 that a count takes undivided.
const CYCLES: u64 = 4_096;

/// Window watchdog: its counter falls by one a count.
#[derive(Clone, Debug)]
pub(crate) struct WindowWatchdog {
    runs: bool,
    configuration: u32,
    early: bool,
    hertz: u64,
    /// Counts of the prescaler, from the start of the simulation, at which the counter was or would be 0.
    zero_at: u64,
    /// The counter while it does not run.
    held: u32,
    /// It was fed too early, or with a counter that is over.
    at_once: Option<Nanoseconds>,
}

impl WindowWatchdog {
    pub(crate) fn new() -> Self {
        Self {
            runs: false,
            configuration: 0x7F,
            early: false,
            hertz: 16_000_000,
            zero_at: 0,
            held: 0x7F,
            at_once: None,
        }
    }

    fn cycles(&self) -> u64 {
        CYCLES << (self.configuration >> 7 & 3)
    }

    fn counts(&self, now: Nanoseconds) -> u64 {
        clocks_at(now, self.hertz) / self.cycles()
    }

    fn counter(&self, now: Nanoseconds) -> u32 {
        if self.runs { self.zero_at.saturating_sub(self.counts(now)) as u32 } else { self.held }
    }

    fn time_at(&self, counter: u32) -> Nanoseconds {
        time_of_clocks((self.zero_at - u64::from(counter)) * self.cycles(), self.hertz)
    }

    /// APB1 changes; the counter goes on from where it stands.
    pub(crate) fn set_clock(&mut self, hertz: u64, now: Nanoseconds) {
        let counter = self.counter(now);
        self.hertz = hertz;
        self.zero_at = self.counts(now) + u64::from(counter);
    }

    /// When it resets the processor.
    pub(crate) fn expires(&self) -> Option<Nanoseconds> {
        self.at_once.or_else(|| self.runs.then(|| self.time_at(LOWEST - 1)))
    }

    /// When it interrupts.
    pub(crate) fn next_event(&self) -> Option<Nanoseconds> {
        let awaited = self.runs && !self.early && self.configuration & INTERRUPT != 0;
        awaited.then(|| self.time_at(LOWEST))
    }

    pub(crate) fn advance(&mut self, now: Nanoseconds) {
        self.early |= self.runs && self.counter(now) <= LOWEST;
    }

    pub(crate) fn line(&self) -> bool {
        self.early && self.configuration & INTERRUPT != 0
    }

    pub(crate) fn read(&self, offset: u32, now: Nanoseconds) -> Option<u32> {
        Some(match offset {
            0 => u32::from(self.runs) << 7 | self.counter(now) & 0x7F,
            4 => self.configuration,
            8 => self.early.into(),
            _ => return None,
        })
    }

    pub(crate) fn write(&mut self, offset: u32, value: u32, now: Nanoseconds) -> Option<()> {
        match offset {
            0 => {
                let counter = value & 0x7F;
                let too_early = self.runs && self.counter(now) > self.configuration & 0x7F;
                self.runs |= value & RUNS != 0;
                self.held = counter;
                self.zero_at = self.counts(now) + u64::from(counter);
                if self.runs && (too_early || counter < LOWEST) {
                    self.at_once = Some(now);
                }
            }
            4 => {
                let counter = self.counter(now);
                self.configuration = value & 0x3FF | self.configuration & INTERRUPT;
                self.zero_at = self.counts(now) + u64::from(counter);
            }
            8 => self.early &= value & 1 != 0,
            _ => return None,
        }
        Some(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn started() -> WindowWatchdog {
        let mut watchdog = WindowWatchdog::new();
        watchdog.set_clock(42_000_000, Nanoseconds::ZERO);
        watchdog.write(4, 0x7F | INTERRUPT, Nanoseconds::ZERO);
        watchdog.write(0, RUNS | 0x7F, Nanoseconds::ZERO);
        watchdog
    }

    #[test]
    fn the_interrupt_comes_at_40h_and_the_reset_a_count_later() {
        let mut watchdog = started();
        // 63 and 64 counts of 97.52 us.
        assert_eq!(watchdog.next_event(), Some(Nanoseconds(6_144_000)));
        assert_eq!(watchdog.expires(), Some(Nanoseconds(6_241_524)));
        watchdog.advance(Nanoseconds(6_143_999));
        assert!(!watchdog.line());
        watchdog.advance(Nanoseconds(6_144_000));
        assert!(watchdog.line());
        watchdog.write(8, 0, Nanoseconds(6_144_001));
        assert!(!watchdog.line());
    }

    #[test]
    fn feeding_neither_starts_nor_stops_it() {
        let mut watchdog = WindowWatchdog::new();
        watchdog.write(0, 0x4C, Nanoseconds::ZERO);
        assert_eq!((watchdog.expires(), watchdog.next_event()), (None, None));
        let mut watchdog = started();
        watchdog.write(0, 0x4C, Nanoseconds(1_000_000));
        // At count 10 of the prescaler: 13 more.
        assert!(watchdog.expires().unwrap().0.abs_diff(23 * 97_524) < 30);
        assert_eq!(watchdog.read(0, Nanoseconds(1_000_000)), Some(RUNS | 0x4C));
    }

    #[test]
    fn a_counter_that_is_over_and_one_fed_within_the_window_reset_at_once() {
        let mut watchdog = started();
        watchdog.write(0, 0x3F, Nanoseconds(500));
        assert_eq!(watchdog.expires(), Some(Nanoseconds(500)));
        let mut watchdog = started();
        watchdog.write(4, 0x50 | INTERRUPT, Nanoseconds(500));
        watchdog.write(0, 0x7F, Nanoseconds(600));
        assert_eq!(watchdog.expires(), Some(Nanoseconds(600)));
    }
}
