//! What acted between the samples of two successive ticks: the mean voltage, and the current half way.
//!
//! A voltage that is computed with a sample is given half a cycle later, and for one cycle. Of the readings, only those of the cycle that
//! starts a tick are known; a feed-forward that is asked for in a tick acts from the next cycle on. At 16 kHz, in quarters of a tick:
//!
//! ```text
//! sample        k-1               k
//! time           |---|---|---|---|
//! voltage of      *    k-1     +      * the cycle before, + the cycle between, which also has the feed-forward of tick k-1 at +
//! ```
//!
//! The part of the feed-forward is therefore known exactly. What the controller adds is smooth, because its reference stands still; for the
//! cycles between it is taken as the mean of its neighbours. At 8 kHz every cycle is known.
//!
//! With the mean voltage `v`, the current half way `i` and its change `di` in a tick `T`, an inductance has `v = R i + L di / T` without any
//! delay, at every frequency.

use crate::current::settings::PwmFrequency;

/// The readings of one axis that are still needed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub(super) struct Interval {
    frequency: PwmFrequency,
    current: i32,
    /// Feed-forward within the last reading.
    injected: i32,
    /// What the controller gave: in the last reading, and in the one before.
    last: i32,
    older: i32,
}

impl Interval {
    pub(super) const fn new(frequency: PwmFrequency) -> Self {
        Self { frequency, current: 0, injected: 0, last: 0, older: 0 }
    }

    /// Takes the readings of a tick with the feed-forward that was asked for in the tick before. Gives mean voltage and current of the time
    /// since the last sample.
    #[inline]
    pub(super) fn next(&mut self, current: i32, voltage: i32, injected: i32) -> (i32, i32) {
        let controlled = voltage.wrapping_sub(injected);
        let mean_voltage = match self.frequency {
            PwmFrequency::Khz16 => {
                let injection = self.injected.wrapping_mul(3).wrapping_add(injected).wrapping_mul(2);
                let control = self.older.wrapping_add(self.last.wrapping_mul(6)).wrapping_add(controlled);
                injection.wrapping_add(control).wrapping_add(4) >> 3
            }
            PwmFrequency::Khz8 => self.older.wrapping_add(self.last).wrapping_add(1) >> 1,
        };
        let mean_current = self.current.wrapping_add(current) >> 1;
        self.current = current;
        self.older = self.last;
        (self.last, self.injected) = match self.frequency {
            PwmFrequency::Khz16 => (controlled, injected),
            PwmFrequency::Khz8 => (voltage, 0),
        };
        (mean_voltage, mean_current)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_feed_forward_acts_for_three_quarters_of_the_tick_after_its_reading_and_a_quarter_of_the_one_before() {
        let mut interval = Interval::new(PwmFrequency::Khz16);
        let mut voltages = [0; 4];
        for (tick, injected) in [0, 8_000, 0, 0].into_iter().enumerate() {
            voltages[tick] = interval.next(0, injected, injected).0;
        }
        assert_eq!(voltages, [0, 2_000, 6_000, 0]);
    }

    #[test]
    fn the_controllers_voltage_acts_half_a_tick_after_its_reading() {
        let mut interval = Interval::new(PwmFrequency::Khz16);
        let voltages = [8_000, 0, 0, 0].map(|voltage| interval.next(0, voltage, 0).0);
        assert_eq!(voltages, [1_000, 6_000, 1_000, 0]);
        let mut interval = Interval::new(PwmFrequency::Khz8);
        let voltages = [8_000, 0, 0, 0].map(|voltage| interval.next(0, voltage, 3_000).0);
        assert_eq!(voltages, [0, 4_000, 4_000, 0]);
    }

    #[test]
    fn the_current_is_that_half_way() {
        let mut interval = Interval::new(PwmFrequency::Khz16);
        interval.next(1_000, 0, 0);
        assert_eq!(interval.next(-3_000, 0, 0).1, -1_000);
    }
}
