//! The range that an axis may be commanded to (S-0-0049, S-0-0050), and an axis that is found outside it.
//!
//! Only a command that leads further out is an error. An axis that was outside when it was switched on, homed there, or given a narrower range,
//! may be held where it is and may go back; on its way back the range closes behind it. What takes the axis over has read its position a while ago:
//! a load that sags inwards when its brake opens, or is halted while it turns, may be held where it was then.
//!
//! What takes over an axis that moves begins with a set-point that moves with it, and ahead of it by its lag: a load that sags outwards is not
//! commanded to. Where a set-point is led to counts as well as where it is, and one that is led nowhere brakes.

use crate::units::{Position, Velocity};

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
    /// How many looks old the position may be from which a command takes the axis over.
    pub looks_back: u16,
}

/// What the axis is told to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Commanded {
    /// Nothing that the range is about: no torque, or a stop.
    Nothing,
    /// Nothing but to come to rest: the set-point is on its way to where that will be.
    Rest(Position),
    /// To be at a position.
    At {
        /// The set-point.
        setpoint: Position,
        /// Where the command leads it.
        aim: Position,
    },
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
    /// Where the axis has been in the last looks that nothing led it, and in as many before them.
    been: [Been; 2],
    looks: u16,
    /// How many looks a command has led it since; until there were enough, the range does not close.
    led: u16,
}

/// Lowest and highest position of some looks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
struct Been {
    lowest: Position,
    highest: Position,
}

impl Been {
    const fn at(position: Position) -> Self {
        Self { lowest: position, highest: position }
    }

    fn and(self, other: Self) -> Self {
        Self { lowest: self.lowest.min(other.lowest), highest: self.highest.max(other.highest) }
    }
}

impl RangeMonitor {
    /// Begins with an axis at `measured`, inside or outside.
    #[must_use]
    pub fn new(range: TravelRange, measured: Position) -> Self {
        let been = [Been::at(measured); 2];
        let mut monitor = Self { range, lowest: range.lowest, highest: range.highest, been, looks: 0, led: 0 };
        monitor.stay(measured, measured);
        monitor.led = range.looks_back;
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
                self.stay(measured, measured);
                None
            }
            Commanded::Rest(setpoint) => {
                self.stay(measured, setpoint);
                None
            }
            Commanded::At { setpoint, aim } => self.follow(setpoint, aim),
            Commanded::Turn(velocity) => {
                self.stay(measured, measured);
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

    fn stay(&mut self, measured: Position, setpoint: Position) {
        self.led = 0;
        let here = Been::at(measured).and(Been::at(setpoint));
        let [now, _] = self.been;
        self.been = if self.looks < self.range.looks_back {
            self.looks = self.looks.wrapping_add(1);
            let [_, before] = self.been;
            [now.and(here), before]
        } else {
            self.looks = 0;
            [here, now]
        };
        let [now, before] = self.been;
        let been = now.and(before);
        // A swing is no reason to leave the range from inside.
        self.highest =
            if been.highest > self.range.highest { been.highest + self.range.swing } else { self.range.highest };
        self.lowest = if been.lowest < self.range.lowest { been.lowest - self.range.swing } else { self.range.lowest };
    }

    fn follow(&mut self, setpoint: Position, aim: Position) -> Option<RangeEnd> {
        if setpoint.min(aim) > self.highest + self.range.rounding {
            return Some(RangeEnd::Highest);
        }
        if setpoint.max(aim) < self.lowest - self.range.rounding {
            return Some(RangeEnd::Lowest);
        }
        if self.led < self.range.looks_back {
            self.led = self.led.wrapping_add(1);
            return None;
        }
        self.highest = self.range.highest.max(self.highest.min(setpoint + self.range.swing));
        self.lowest = self.range.lowest.min(self.lowest.max(setpoint - self.range.swing));
        // Led back, the axis has been nowhere else.
        self.been = [Been::at(setpoint); 2];
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn at(bits: i64) -> Position {
        Position::from_bits(bits)
    }

    /// A set-point that is where its command wants it.
    const fn to(bits: i64) -> Commanded {
        Commanded::At { setpoint: at(bits), aim: at(bits) }
    }

    const RANGE: TravelRange =
        TravelRange { lowest: at(-1_000), highest: at(1_000), rounding: at(2), swing: at(20), looks_back: 4 };

    fn ends<const N: usize>(start: i64, commands: [i64; N]) -> [Option<RangeEnd>; N] {
        let mut monitor = RangeMonitor::new(RANGE, at(start));
        commands.map(|command| monitor.look(at(start), to(command)))
    }

    #[test]
    fn a_position_is_remembered_for_as_many_looks_as_asked_for_and_for_no_more_than_twice_as_many() {
        let taken_over_after = |looks: u16| {
            let mut monitor = RangeMonitor::new(RANGE, at(1_500));
            for _ in 0..looks {
                assert_eq!(monitor.look(at(0), Commanded::Nothing), None);
            }
            monitor.look(at(0), to(1_500)).is_none()
        };
        for looks in 0..=2 * RANGE.looks_back {
            assert!(taken_over_after(looks), "{looks}");
        }
        assert!(!taken_over_after(2 * RANGE.looks_back + 1));
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
        assert_eq!(monitor.look(at(3_000), to(3_000)), None);
        assert_eq!(monitor.look(at(3_000), to(3_030)), Some(RangeEnd::Highest));
        for _ in 0..10 {
            assert_eq!(monitor.look(at(500), Commanded::Nothing), None);
        }
        assert_eq!(monitor.look(at(500), to(1_003)), Some(RangeEnd::Highest), "it has closed");
    }

    /// The end that a command passes that takes an axis over `looks` after it was at `outside`, and begins where it is.
    fn taken_over(outside: i64, looks: u32, command: i64) -> Option<RangeEnd> {
        let mut monitor = RangeMonitor::new(RANGE, at(0));
        for _ in 0..50 {
            monitor.look(at(outside), Commanded::Nothing);
        }
        for _ in 0..looks {
            monitor.look(at(0), Commanded::Nothing);
        }
        assert_eq!(monitor.look(at(0), to(0)), None);
        monitor.look(at(0), to(command))
    }

    #[test]
    fn an_axis_that_moves_inwards_by_itself_may_be_held_where_it_has_just_been() {
        for looks in 0..=4 {
            assert_eq!(taken_over(1_500, looks, 1_520), None, "{looks}");
            assert_eq!(taken_over(1_500, looks, 1_523), Some(RangeEnd::Highest), "{looks}");
            assert_eq!(taken_over(-1_500, looks, -1_520), None, "{looks}");
            assert_eq!(taken_over(-1_500, looks, -1_523), Some(RangeEnd::Lowest), "{looks}");
        }
    }

    #[test]
    fn a_set_point_that_runs_on_outwards_after_an_inward_command_is_no_command_outwards() {
        for (sign, end) in [(1, RangeEnd::Highest), (-1, RangeEnd::Lowest)] {
            let begun = |setpoint: i64, aim: i64| {
                let mut monitor = RangeMonitor::new(RANGE, at(sign * 1_500));
                let commanded = Commanded::At { setpoint: at(sign * setpoint), aim: at(sign * aim) };
                (monitor.look(at(sign * 1_500), commanded), monitor)
            };
            for (setpoint, aim) in [(1_900, 1_400), (1_900, 1_520), (1_400, 1_900), (1_900, 0), (900, 1_900)] {
                assert_eq!(begun(setpoint, aim).0, None, "{setpoint} {aim}");
            }
            assert_eq!(begun(1_523, 1_900).0, Some(end), "a command that goes out is found when the set-point is out");
            assert_eq!(begun(1_900, 1_523).0, Some(end));
            // Where the set-point has run to is no place for a later command.
            let (_, mut monitor) = begun(1_900, 1_400);
            assert_eq!(monitor.look(at(sign * 1_550), to(sign * 1_523)), Some(end));
        }
    }

    #[test]
    fn an_axis_that_comes_to_rest_outside_by_itself_may_be_held_there_and_no_further_out() {
        for (sign, end) in [(1, RangeEnd::Highest), (-1, RangeEnd::Lowest)] {
            let mut monitor = RangeMonitor::new(RANGE, at(0));
            for further in [0, 200, 300, 350] {
                let rest = Commanded::Rest(at(sign * (1_500 + further)));
                assert_eq!(monitor.look(at(sign * 1_400), rest), None);
            }
            assert_eq!(monitor.look(at(sign * 1_400), to(sign * 1_850)), None);
            assert_eq!(monitor.look(at(sign * 1_400), to(sign * 1_873)), Some(end));
        }
    }

    #[test]
    fn the_range_closes_behind_an_axis_that_was_taken_over_a_while_ago() {
        let mut monitor = RangeMonitor::new(RANGE, at(1_500));
        monitor.look(at(1_500), Commanded::Nothing);
        for _ in 0..=RANGE.looks_back {
            assert_eq!(monitor.look(at(1_200), to(1_200)), None);
        }
        assert_eq!(monitor.look(at(1_200), to(1_223)), Some(RangeEnd::Highest));
    }

    #[test]
    fn where_the_axis_was_long_ago_is_beyond_the_range() {
        assert_eq!(taken_over(1_500, 10, 1_003), Some(RangeEnd::Highest));
        assert_eq!(taken_over(-1_500, 10, -1_003), Some(RangeEnd::Lowest));
        assert_eq!(taken_over(1_500, 10, 1_002), None);
    }
}
