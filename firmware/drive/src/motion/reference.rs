//! Whether the zero of the positions is known (S-0-0403), and the position limits S-0-0049 and S-0-0050, which mean nothing without.

use servo::monitor::{Commanded, RangeMonitor, TravelRange};
use servo::units::{Modulo, Position};

/// What is known of where the axis is.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Reference {
    /// S-0-0403 bit 0.
    known: bool,
    /// S-0-0049 and S-0-0050, while they are in force.
    monitor: Option<RangeMonitor>,
    /// Where the axis was at the last look of the monitor.
    seen: Option<Position>,
}

impl Reference {
    /// S-0-0403 bit 0.
    #[inline]
    pub(super) const fn is_known(&self) -> bool {
        self.known
    }

    /// The axis is homed.
    pub(super) const fn set(&mut self) {
        self.known = true;
    }

    /// Nobody knows any more where the axis is, or nobody is to know.
    pub(super) const fn forget(&mut self) {
        self.known = false;
    }

    /// The zero has moved: where the axis stands now is nothing that a command has led to.
    pub(super) const fn zero_has_moved(&mut self) {
        self.monitor = None;
        self.seen = None;
    }

    /// What the monitor is shown of a position with the zero of the data. Where these end an axis that trembles would be at their other end with every
    /// second look; it stays at the end where it was seen, as far as it may swing.
    #[inline]
    pub(super) fn beside_the_last(self, data: Modulo, position: Position, swing: Position) -> Position {
        let within = data.around_zero(position);
        let Some(last) = self.seen else { return within };
        let beside = last + data.around_zero(data.reduce(within - last));
        let end = Position::from_bits(data.value().to_bits() >> 1);
        if beside.abs() <= end + swing { beside } else { within }
    }

    /// One look: whether a command leads the axis beyond its limits, or further beyond them. The way back is free, and so is holding the axis
    /// where it is: S-0-0099 and a command inwards bring it home. `look`: the measured position and what is commanded.
    #[inline]
    pub(super) fn is_left(
        &mut self,
        limits: Option<TravelRange>,
        look: impl FnOnce() -> (Position, Commanded),
    ) -> bool {
        let Some(range) = limits.filter(|_| self.known) else {
            self.zero_has_moved();
            return false;
        };
        let (measured, commanded) = look();
        let mut monitor = match self.monitor {
            Some(monitor) if *monitor.range() == range => monitor,
            _ => RangeMonitor::new(range, measured),
        };
        let left = monitor.look(measured, commanded);
        self.monitor = Some(monitor);
        self.seen = Some(measured);
        left.is_some()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_axis_that_trembles_at_the_end_of_the_data_stays_there_and_one_that_goes_on_is_at_the_other_end() {
        // A revolution of 2 048 steps.
        let data = Modulo::from_ratio(1, 1).unwrap();
        let steps = |steps: i64| Position::from_bits(steps << 21);
        let look = |reference: &Reference, at: i64| reference.beside_the_last(data, data.reduce(steps(at)), steps(5));
        let mut reference = Reference::default();
        for (at, shown) in [
            (1_022, 1_022),
            (1_025, 1_025),
            (1_023, 1_023),
            (1_029, 1_029),
            (1_030, -1_018),
            (1_025, -1_023),
            (1_014, 1_014),
        ] {
            let seen = look(&reference, at);
            assert_eq!(seen, steps(shown), "{at}");
            reference.seen = Some(seen);
        }
        reference.zero_has_moved();
        assert_eq!(look(&reference, 1_025), steps(-1_023));
    }
}
