//! The instants of the ring: when t3 is due, what the hardware latched at the edges of t3 and t4, and how well the loops keep their phase to
//! them (P-0-0150 to P-0-0152).

use sercos::Phase;
use servo::clock::{LoopClock, LoopClockSettings};

use crate::hardware::LOOP_PERIOD_MICROSECONDS;
use crate::settings::CycleSettings;

/// Keeps the loops in step with the ring.
///
/// Laid out as declared: what every loop tick touches comes first.
#[repr(C)]
#[derive(Debug)]
pub(super) struct RingClock {
    /// Loop ticks until a t3 event is overdue; 0 outside the cyclic phases.
    until_overdue: u16,
    /// Phase of the last edge of t3.
    edge_phase: u16,
    clock: LoopClock,
    /// Encoder count at the last edge of t4.
    latch: u32,
    /// Behind the last t3, or in CP1 and CP2 behind the last MDT, all that is due before the next one has been done.
    done: bool,
    /// Ticks of the supervision for which somebody still waits for the clock to lock.
    patience: u16,
}

impl RingClock {
    /// A clock that knows nothing of the ring, outside the cyclic phases.
    pub(super) const fn new(settings: LoopClockSettings) -> Self {
        Self { until_overdue: 0, edge_phase: 0, clock: LoopClock::new(settings), latch: 0, done: false, patience: 0 }
    }

    /// Begins without knowledge of phase and drift.
    pub(super) const fn restart(&mut self, settings: LoopClockSettings) {
        self.clock = LoopClock::new(settings);
    }

    /// A phase begins: so many loop ticks until a t3 event is overdue, 0: there is none.
    pub(super) const fn expect(&mut self, ticks_to_overdue: u16) {
        self.until_overdue = ticks_to_overdue;
        // Nothing is known of a cycle before its first t3.
        self.done = false;
    }

    /// Keeps the phase of an edge of t3.
    #[inline]
    pub(super) const fn take_edge(&mut self, phase: u16) {
        self.edge_phase = phase;
    }

    /// Keeps the encoder count of an edge of t4.
    #[inline]
    pub(super) const fn take_latch(&mut self, count: u32) {
        self.latch = count;
    }

    /// The encoder count at the last edge of t4.
    #[inline]
    pub(super) const fn latch(&self) -> u32 {
        self.latch
    }

    /// The last task of a cycle has been done: that of t4, or in CP1 and CP2 that of the MDT.
    #[inline]
    pub(super) const fn close_cycle(&mut self) {
        self.done = true;
    }

    /// The processor may stand still for the time of a word of flash, 100 us at most, before t3, t4 or the next MDT is due. In CP1 and CP2 once a cycle.
    ///
    /// How long ago t3 was is known to a tick, of which one may just have begun.
    pub(super) fn is_idle(&mut self, phase: Phase, cycle: &CycleSettings) -> bool {
        const TICK: u32 = LOOP_PERIOD_MICROSECONDS as u32;
        /// A word, and whoever was interrupted by the wake-up.
        const STAND: u32 = 110;
        match phase {
            Phase::Cp0 => true,
            Phase::Cp1 | Phase::Cp2 => core::mem::take(&mut self.done),
            Phase::Cp3 | Phase::Cp4 => {
                let ticks = cycle.ticks_to_overdue.saturating_sub(self.until_overdue);
                let free_at = u32::from(ticks).saturating_add(1).saturating_mul(TICK).saturating_add(STAND);
                let next = u32::from(cycle.ticks_per_cycle).saturating_mul(TICK);
                self.until_overdue != 0 && free_at < next && (self.done || free_at < u32::from(cycle.from_t3_to_t4))
            }
        }
    }

    /// A t3 event, at the edge that was taken.
    #[inline]
    pub(super) fn on_t3(&mut self, ticks_to_overdue: u16) {
        self.clock.on_t3(self.edge_phase);
        self.until_overdue = ticks_to_overdue;
        self.done = false;
    }

    /// The phase error of the last t3 event, in counts of the loop timer.
    #[inline]
    pub(super) const fn phase_error(&self) -> i32 {
        self.clock.phase_error()
    }

    /// A loop tick: by so many counts the period after the next is to be longer.
    #[inline]
    pub(super) fn on_tick(&mut self) -> i16 {
        self.clock.on_tick()
    }

    /// The end of a loop tick. A t3 event that is overdue by a quarter of a cycle (at least two ticks) is to be stood in for, so that
    /// supervision and extrapolation go on at the ring's rhythm whatever the chip does without an MST (G28).
    #[inline]
    pub(super) const fn is_overdue(&mut self, ticks_per_cycle: u16) -> bool {
        if self.until_overdue == 0 {
            return false;
        }
        self.until_overdue = self.until_overdue.wrapping_sub(1);
        if self.until_overdue != 0 {
            return false;
        }
        self.until_overdue = ticks_per_cycle;
        true
    }

    /// The loops run in a fixed phase to the ring.
    #[inline]
    pub(super) const fn is_locked(&self) -> bool {
        self.clock.is_locked()
    }

    /// Somebody waits for the clock to lock, for so many ticks of the supervision.
    pub(super) const fn wait_for_lock(&mut self, ticks: u16) {
        self.patience = ticks;
    }

    /// Somebody still waits.
    pub(super) const fn is_awaited(&self) -> bool {
        self.patience != 0
    }

    /// One tick of the supervision: whether a wait has ended in it, with a lock or without.
    #[inline]
    pub(super) const fn has_waited(&mut self) -> bool {
        if self.patience == 0 {
            return false;
        }
        self.patience = if self.clock.is_locked() { 0 } else { self.patience.saturating_sub(1) };
        self.patience == 0
    }
}

/// Classes of the histogram: up to 50, 100, 200, 500, 1000, 2000 ns, and above.
pub(super) const PHASE_ERROR_CLASSES: usize = 7;

/// Upper ends of the classes but the last, in counts: 4 of them are 48 ns, 42 are 500 ns.
const ENDS: [u32; PHASE_ERROR_CLASSES - 1] = [4, 8, 16, 42, 84, 168];

/// One count of 84 MHz is 1000/84 ns, in 2^-16.
const NANOSECONDS_PER_COUNT: i64 = 780_190;

/// Statistics of the phase error at t3; in counts, because it is asked for much less often than it is taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct ClockMonitor {
    last: i32,
    highest: i32,
    lowest: i32,
    counts: [u32; PHASE_ERROR_CLASSES],
}

impl ClockMonitor {
    pub(super) const fn new() -> Self {
        Self { last: 0, highest: 0, lowest: 0, counts: [0; PHASE_ERROR_CLASSES] }
    }

    /// Takes the phase error of a t3 event in counts of 84 MHz; statistics only of a locked clock.
    #[inline]
    pub(super) fn take(&mut self, counts: i32, locked: bool) {
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
    pub(super) const fn last(&self) -> i32 {
        nanoseconds(self.last)
    }

    /// Largest magnitude in ns.
    pub(super) fn largest(&self) -> u32 {
        nanoseconds(self.highest).unsigned_abs().max(nanoseconds(self.lowest).unsigned_abs())
    }

    /// How often each class occurred.
    pub(super) const fn histogram(&self) -> [u32; PHASE_ERROR_CLASSES] {
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
            let mut monitor = ClockMonitor::new();
            errors.into_iter().for_each(|counts| monitor.take(counts, true));
            assert_eq!(monitor.largest(), largest, "{errors:?}");
        }
    }

    #[test]
    fn errors_are_counted_in_their_class_once_the_clock_is_locked() {
        let mut monitor = ClockMonitor::new();
        monitor.take(84_000, false);
        assert_eq!((monitor.last(), monitor.largest()), (999_999, 0));
        for counts in [0, 4, -4, 5, 42, -84, 85, 200] {
            monitor.take(counts, true);
        }
        assert_eq!(monitor.histogram(), [3, 1, 0, 1, 1, 1, 1]);
        assert_eq!(monitor.largest(), 2_380);
        assert_eq!(monitor.last(), 2_380);
    }

    fn clock() -> RingClock {
        RingClock::new(LoopClockSettings::new(10_500, 8, 7_875).unwrap())
    }

    #[test]
    fn a_missing_t3_is_stood_in_for_when_it_is_overdue_and_then_once_a_cycle() {
        let mut clock = clock();
        assert!((0..1_000).all(|_| !clock.is_overdue(8)), "outside the cyclic phases none is due");
        clock.expect(10);
        let overdue: std::vec::Vec<u16> = (1..=30).filter(|_| clock.is_overdue(8)).collect();
        assert_eq!(overdue, [10, 18, 26]);
        clock.on_t3(10);
        assert_eq!((1..=30).find(|_| clock.is_overdue(8)), Some(10));
    }

    #[test]
    fn a_wait_for_a_lock_that_does_not_come_ends_once_and_in_time() {
        let mut clock = clock();
        assert!(!clock.has_waited());
        clock.wait_for_lock(3);
        let ends: std::vec::Vec<bool> = (0..5).map(|_| clock.has_waited()).collect();
        assert_eq!((ends.as_slice(), clock.is_awaited()), ([false, false, true, false, false].as_slice(), false));
    }
}
