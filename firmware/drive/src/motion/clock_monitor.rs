//! How well the loops keep their phase to the ring: P-0-0150 to P-0-0152.

/// Classes of the histogram: up to 50, 100, 200, 500, 1000, 2000 ns, and above.
pub(super) const PHASE_ERROR_CLASSES: usize = 7;

/// Upper ends of the classes but the last, in counts: 4 of them are 48 ns, 42 are 500 ns.
const ENDS: [u32; PHASE_ERROR_CLASSES - 1] = [4, 8, 16, 42, 84, 168];

/// One count of 84 MHz is 1000/84 ns, in 2^-16.
const NANOSECONDS_PER_COUNT: i64 = 780_190;

/// Statistics of the phase error at t3; in counts, because it is asked for much less often than it is taken.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct ClockMonitor {
    last: i32,
    highest: i32,
    lowest: i32,
    counts: [u32; PHASE_ERROR_CLASSES],
}

impl ClockMonitor {
    /// Takes the phase error of a t3 event in counts of 84 MHz; statistics only of a locked clock.
    #[inline]
    pub(crate) fn take(&mut self, counts: i32, locked: bool) {
        self.last = counts;
        if !locked {
            return;
        }
        if counts > self.highest {
            self.highest = counts;
        } else if counts < self.lowest {
            self.lowest = counts;
        }
        let magnitude = counts.unsigned_abs();
        let class = ENDS.iter().position(|&end| magnitude <= end).unwrap_or(ENDS.len());
        if let Some(count) = self.counts.get_mut(class) {
            *count = count.saturating_add(1);
        }
    }

    /// Last phase error in ns; positive: the tick came early.
    pub(crate) const fn last(&self) -> i32 {
        nanoseconds(self.last)
    }

    /// Largest magnitude in ns.
    pub(crate) fn largest(&self) -> u32 {
        nanoseconds(self.highest).unsigned_abs().max(nanoseconds(self.lowest).unsigned_abs())
    }

    /// How often each class occurred.
    pub(crate) const fn histogram(&self) -> [u32; PHASE_ERROR_CLASSES] {
        self.counts
    }
}

/// Within half a tick, 62 500 ns.
const fn nanoseconds(counts: i32) -> i32 {
    ((counts as i64).wrapping_mul(NANOSECONDS_PER_COUNT) >> 16) as i32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_classes_in_counts_are_those_in_nanoseconds() {
        for (end, limit) in ENDS.into_iter().zip([50, 100, 200, 500, 1_000, 2_000]) {
            let end = end.cast_signed();
            for counts in [end, -end] {
                assert!(nanoseconds(counts).unsigned_abs() <= limit, "{counts}");
                assert!(nanoseconds(counts + counts.signum()).unsigned_abs() > limit, "{counts}");
            }
        }
    }

    #[test]
    fn the_largest_error_may_be_to_either_side() {
        for (errors, largest) in [([84, -85], 1_012), ([85, -84], 1_011), ([-85, 1], 1_012), ([0, 85], 1_011)] {
            let mut monitor = ClockMonitor::default();
            errors.into_iter().for_each(|counts| monitor.take(counts, true));
            assert_eq!(monitor.largest(), largest, "{errors:?}");
        }
    }

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
