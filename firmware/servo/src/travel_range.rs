//! The range that an axis may be commanded to (S-0-0049, S-0-0050), and an axis that is found outside it.
//!
//! Only a command that leads further out is an error. An axis that was outside when it was switched on, homed there, or given a narrower range,
//! may be held where it is and may go back; on its way back the range closes behind it.

use crate::{Position, Velocity};

/// A range of positions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct TravelRange {
    /// Lowest position.
    pub lowest: Position,
    /// Highest position.
    pub highest: Position,
    /// Half an increment of the data: so much a command may be beyond by rounding.
    pub rounding: Position,
    /// So much the command of an axis that is held outside may swing: what the master reads of a standing encoder.
    pub swing: Position,
}

/// What the axis is told to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Commanded {
    /// Nothing that the range is about: no torque, or a stop.
    Nothing,
    /// To be at this position.
    At(Position),
    /// To turn at this velocity.
    Turn(Velocity),
}

/// The end of the range that a command passes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum RangeEnd {
    /// [`TravelRange::highest`].
    Highest,
    /// [`TravelRange::lowest`].
    Lowest,
}

/// How far out commands may lead.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct RangeMonitor {
    range: TravelRange,
    lowest: Position,
    highest: Position,
}

impl RangeMonitor {
    /// Begins with an axis at `measured`, inside or outside.
    #[must_use]
    pub fn new(range: TravelRange, measured: Position) -> Self {
        let mut monitor = Self { range, lowest: range.lowest, highest: range.highest };
        monitor.stay(measured);
        monitor
    }

    /// The range that it looks after.
    #[must_use]
    pub const fn range(&self) -> &TravelRange {
        &self.range
    }

    /// One look, at the measured position: the end of the range that the command passes.
    pub fn look(&mut self, measured: Position, commanded: Commanded) -> Option<RangeEnd> {
        match commanded {
            Commanded::Nothing => {
                self.stay(measured);
                None
            }
            Commanded::At(setpoint) => self.follow(setpoint),
            Commanded::Turn(velocity) => {
                self.stay(measured);
                if measured > self.range.highest && velocity > Velocity::ZERO {
                    Some(RangeEnd::Highest)
                } else if measured < self.range.lowest && velocity < Velocity::ZERO {
                    Some(RangeEnd::Lowest)
                } else {
                    None
                }
            }
        }
    }

    fn stay(&mut self, measured: Position) {
        self.highest = self.range.highest.max(measured + self.range.swing);
        self.lowest = self.range.lowest.min(measured - self.range.swing);
        // A swing is no reason to leave the range from inside.
        if measured <= self.range.highest {
            self.highest = self.range.highest;
        }
        if measured >= self.range.lowest {
            self.lowest = self.range.lowest;
        }
    }

    fn follow(&mut self, setpoint: Position) -> Option<RangeEnd> {
        if setpoint > self.highest + self.range.rounding {
            return Some(RangeEnd::Highest);
        }
        if setpoint < self.lowest - self.range.rounding {
            return Some(RangeEnd::Lowest);
        }
        self.highest = self.range.highest.max(self.highest.min(setpoint + self.range.swing));
        self.lowest = self.range.lowest.min(self.lowest.max(setpoint - self.range.swing));
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn at(bits: i64) -> Position {
        Position::from_bits(bits)
    }

    const RANGE: TravelRange = TravelRange { lowest: at(-1_000), highest: at(1_000), rounding: at(2), swing: at(20) };

    fn ends<const N: usize>(start: i64, commands: [i64; N]) -> [Option<RangeEnd>; N] {
        let mut monitor = RangeMonitor::new(RANGE, at(start));
        commands.map(|command| monitor.look(at(start), Commanded::At(at(command))))
    }

    #[test]
    fn from_inside_a_command_beyond_the_range_is_found_at_once_and_one_on_its_end_is_none() {
        assert_eq!(ends(0, [500, 1_000, 1_002, 1_003]), [None, None, None, Some(RangeEnd::Highest)]);
        assert_eq!(ends(0, [-500, -1_000, -1_002, -1_003]), [None, None, None, Some(RangeEnd::Lowest)]);
        assert_eq!(ends(1_000, [1_003]), [Some(RangeEnd::Highest)], "standing on the end is standing inside");
        assert_eq!(ends(-1_000, [-1_003]), [Some(RangeEnd::Lowest)]);
    }

    #[test]
    fn outside_the_axis_may_be_held_and_go_back_but_not_further_out() {
        assert_eq!(ends(1_500, [1_500, 1_520, 1_480, 1_500, 1_500]), [None; 5], "a command that swings holds");
        assert_eq!(ends(1_500, [1_500, 1_523]), [None, Some(RangeEnd::Highest)]);
        assert_eq!(ends(-1_500, [-1_500, -1_520, -1_480, -1_500]), [None; 4]);
        assert_eq!(ends(-1_500, [-1_500, -1_523]), [None, Some(RangeEnd::Lowest)]);
        // The other end counts as ever.
        assert_eq!(ends(1_500, [0, -1_003]), [None, Some(RangeEnd::Lowest)]);
    }

    #[test]
    fn the_range_closes_behind_an_axis_that_goes_back() {
        assert_eq!(ends(1_500, [1_300, 1_323]), [None, Some(RangeEnd::Highest)]);
        assert_eq!(ends(1_500, [900, 1_000, 1_003]), [None, None, Some(RangeEnd::Highest)]);
        assert_eq!(ends(-1_500, [-900, -1_003]), [None, Some(RangeEnd::Lowest)]);
    }

    #[test]
    fn a_velocity_outwards_is_an_error_outside_only_and_standstill_never() {
        let mut monitor = RangeMonitor::new(RANGE, at(0));
        let mut look =
            |measured: i64, velocity: i32| monitor.look(at(measured), Commanded::Turn(Velocity::from_bits(velocity)));
        assert_eq!([look(1_000, 5), look(1_001, 0), look(1_001, -5)], [None; 3]);
        assert_eq!(look(1_001, 1), Some(RangeEnd::Highest));
        assert_eq!([look(-1_000, -5), look(-1_001, 0), look(-1_001, 5)], [None; 3]);
        assert_eq!(look(-1_001, -1), Some(RangeEnd::Lowest));
    }

    #[test]
    fn without_torque_the_axis_may_be_moved_by_hand_and_held_where_it_is_then() {
        let mut monitor = RangeMonitor::new(RANGE, at(0));
        assert_eq!(monitor.look(at(3_000), Commanded::Nothing), None);
        assert_eq!(monitor.look(at(3_000), Commanded::At(at(3_000))), None);
        assert_eq!(monitor.look(at(3_000), Commanded::At(at(3_030))), Some(RangeEnd::Highest));
        assert_eq!(monitor.look(at(500), Commanded::Nothing), None);
        assert_eq!(monitor.look(at(500), Commanded::At(at(1_003))), Some(RangeEnd::Highest), "it has closed");
    }
}
