//! A current that is added to that of the loops, for as long as an identification asks for it, and what became of both.

use servo::axis::TorqueLimits;
use servo::identification::Commanded;
use servo::units::CurrentFraction;

/// The excitation of P-0-0240.
#[derive(Clone, Copy, Debug)]
pub(super) struct Excitation {
    /// Of this tick.
    current: CurrentFraction,
    /// Of the last one.
    commanded: Commanded,
}

impl Default for Excitation {
    fn default() -> Self {
        Self { current: CurrentFraction::ZERO, commanded: Commanded::NONE }
    }
}

impl Excitation {
    /// Nothing is added in this tick, unless somebody asks for it.
    #[inline]
    pub(super) const fn clear(&mut self) {
        self.current = CurrentFraction::ZERO;
    }

    /// This current is added in this tick.
    #[inline]
    pub(super) const fn ask(&mut self, current: CurrentFraction) {
        self.current = current;
    }

    /// What the loops made of the last tick.
    #[inline]
    pub(super) const fn commanded(&self) -> &Commanded {
        &self.commanded
    }

    /// Adds it to the current of the loops, within the limits.
    #[inline]
    pub(super) fn add_to(&mut self, own: CurrentFraction, limits: &TorqueLimits) -> CurrentFraction {
        let (total, met) = limits.apply(own.saturating_add(self.current));
        let is_limited = !met.is_empty() || !limits.met_by(own).is_empty();
        self.commanded = Commanded { own, total, is_limited };
        total
    }

    /// The same half a tick later, where the velocity loop runs twice: what became of the tick is the mean of both halves.
    pub(super) fn add_to_half(&mut self, own: CurrentFraction, limits: &TorqueLimits) -> CurrentFraction {
        let first = self.commanded;
        let total = self.add_to(own, limits);
        self.commanded = Commanded {
            own: mean(first.own, own),
            total: mean(first.total, total),
            is_limited: first.is_limited || self.commanded.is_limited,
        };
        total
    }
}

fn mean(one: CurrentFraction, other: CurrentFraction) -> CurrentFraction {
    CurrentFraction::from_bits((i32::from(one.to_bits()).wrapping_add(i32::from(other.to_bits())) >> 1) as i16)
}

#[cfg(test)]
mod tests {
    use super::*;
    use servo::axis::Limiting;

    #[test]
    fn what_is_added_stays_within_the_limits_and_is_told_of() {
        let fraction = CurrentFraction::from_bits;
        let limits = TorqueLimits::symmetrical(fraction(1_000), Limiting::TORQUE_BIPOLAR);
        let mut excitation = Excitation::default();
        assert_eq!(excitation.add_to(fraction(700), &limits), fraction(700));
        excitation.ask(fraction(-200));
        assert_eq!(excitation.add_to(fraction(700), &limits), fraction(500));
        let expected = Commanded { own: fraction(700), total: fraction(500), is_limited: false };
        assert_eq!(excitation.commanded(), &expected);
        assert_eq!(excitation.add_to(fraction(-900), &limits), fraction(-1_000));
        assert!(excitation.commanded().is_limited);
        assert_eq!(excitation.add_to(fraction(1_000), &limits), fraction(800));
        assert!(excitation.commanded().is_limited, "the loop itself is at its limit");
        excitation.clear();
        assert_eq!(excitation.add_to(fraction(3), &limits), fraction(3));
        excitation.ask(fraction(-200));
        assert_eq!(excitation.add_to_half(fraction(401), &limits), fraction(201));
        let expected = Commanded { own: fraction(202), total: fraction(102), is_limited: false };
        assert_eq!(excitation.commanded(), &expected, "the mean of both halves");
    }
}
