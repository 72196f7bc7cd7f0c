//! How well the loops keep their phase to the ring: P-0-0150 to P-0-0152.

/// Classes of the histogram: up to 50, 100, 200, 500, 1000, 2000 ns, and above.
pub(super) const PHASE_ERROR_CLASSES: usize = 7;

/// Upper ends of the classes but the last, in ns.
const ENDS: [u32; PHASE_ERROR_CLASSES - 1] = [50, 100, 200, 500, 1_000, 2_000];

/// One count of 84 MHz is 1000/84 ns, in 2^-16.
const NANOSECONDS_PER_COUNT: i64 = 780_190;

/// Statistics of the phase error at t3.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct ClockMonitor {
    last: i32,
    largest: u32,
    counts: [u32; PHASE_ERROR_CLASSES],
}

impl ClockMonitor {
    /// Takes the phase error of a t3 event in counts of 84 MHz; statistics only of a locked clock.
    #[inline]
    pub(crate) fn take(&mut self, counts: i32, locked: bool) {
        // Within half a tick: 62 500 ns.
        self.last = (i64::from(counts).wrapping_mul(NANOSECONDS_PER_COUNT) >> 16) as i32;
        if !locked {
            return;
        }
        let magnitude = self.last.unsigned_abs();
        self.largest = self.largest.max(magnitude);
        let class = ENDS.iter().position(|&end| magnitude <= end).unwrap_or(ENDS.len());
        if let Some(count) = self.counts.get_mut(class) {
            *count = count.saturating_add(1);
        }
    }

    /// Last phase error in ns; positive: the tick came early.
    pub(crate) const fn last(&self) -> i32 {
        self.last
    }

    /// Largest magnitude in ns.
    pub(crate) const fn largest(&self) -> u32 {
        self.largest
    }

    /// How often each class occurred.
    pub(crate) const fn histogram(&self) -> [u32; PHASE_ERROR_CLASSES] {
        self.counts
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_are_counted_in_their_class_once_the_clock_is_locked() {
        let mut monitor = ClockMonitor::default();
        monitor.take(84_000, false);
        assert_eq!((monitor.last(), monitor.largest()), (999_999, 0));
        for counts in [0, 4, -4, 5, 42, -84, 85, 200] {
            monitor.take(counts, true);
        }
        assert_eq!(monitor.histogram(), [3, 1, 0, 1, 1, 1, 1]);
        assert_eq!(monitor.largest(), 2_380);
        assert_eq!(monitor.last(), 2_380);
    }
}
