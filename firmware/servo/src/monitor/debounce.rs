//! A condition that must hold for a while before it counts.

use crate::units::SUPERVISION_PERIOD_MICROSECONDS;

/// Ticks of the supervision in a millisecond.
const TICKS_PER_MILLISECOND: u32 = 1_000 / SUPERVISION_PERIOD_MICROSECONDS;

/// Ticks of the supervision in so many milliseconds; saturates after 24 days.
pub(crate) const fn ticks_of(milliseconds: u32) -> u32 {
    milliseconds.saturating_mul(TICKS_PER_MILLISECOND)
}

/// Whole milliseconds in so many ticks of the supervision.
#[inline]
pub(crate) const fn milliseconds_of(ticks: u32) -> u32 {
    ticks / TICKS_PER_MILLISECOND
}

/// Counts the ticks in a row in which a condition was met.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub(crate) struct Debounce {
    ticks: u32,
}

impl Debounce {
    /// No tick so far.
    pub(crate) const fn new() -> Self {
        Self { ticks: 0 }
    }

    /// Takes the condition of this tick; true from the `limit`th tick in a row on. A limit of 0 counts as 1.
    #[inline]
    pub(crate) fn holds(&mut self, condition: bool, limit: u32) -> bool {
        self.ticks = if condition { self.ticks.saturating_add(1) } else { 0 };
        condition && self.ticks >= limit
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_condition_counts_from_its_last_needed_tick_on_and_starts_again_after_a_gap() {
        let mut debounce = Debounce::new();
        let seen = [true, true, true, true, false, true, true, true].map(|condition| debounce.holds(condition, 3));
        assert_eq!(seen, [false, false, true, true, false, false, false, true]);
        assert!(!debounce.holds(false, 0), "a condition that is not met never counts");
        assert!(debounce.holds(true, 0));
    }

    #[test]
    fn a_millisecond_has_two_ticks() {
        assert_eq!(ticks_of(125), 250);
        assert_eq!(milliseconds_of(251), 125);
        assert_eq!(ticks_of(u32::MAX), u32::MAX);
    }
}
