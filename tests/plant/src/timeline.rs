//! Time on a fixed grid, cut where inputs change.

use std::collections::VecDeque;

/// The instants at which a model computes its state: every multiple of `GRID` nanoseconds, and where an input begins to hold.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Timeline<I, const GRID: u64> {
    /// Instant of the model's state.
    time: u64,
    /// Inputs that lie ahead, in the order of their instants.
    inputs: VecDeque<(u64, I)>,
}

/// A stretch of time without change from outside, and what holds after it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Stretch<I> {
    pub(crate) nanoseconds: u64,
    pub(crate) input: Option<I>,
}

/// An instant at or behind that of the state, and the inputs passed on the way.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Place {
    pub(crate) time: u64,
    inputs: usize,
}

impl<I: Copy, const GRID: u64> Timeline<I, GRID> {
    /// Begins at time zero.
    pub(crate) fn new() -> Self {
        Self { time: 0, inputs: VecDeque::new() }
    }

    /// Queues an input for the instant `at`; what lies behind the last input or the state's instant holds from there.
    pub(crate) fn enter(&mut self, input: I, at: u64) {
        let earliest = self.inputs.back().map_or(self.time, |(last, _)| *last);
        self.inputs.push_back((at.max(earliest), input));
    }

    /// Passes the next stretch that ends at `to` or earlier; `None` leaves less than that to [`Self::beyond`].
    pub(crate) fn next(&mut self, to: u64) -> Option<Stretch<I>> {
        let mut place = self.place();
        let stretch = self.look(&mut place, to)?;
        self.time = place.time;
        if place.inputs > 0 {
            self.inputs.pop_front();
        }
        Some(stretch)
    }

    /// Passes the next whole or partial step of the grid that ends at `to` or earlier and at which no input begins to hold, and says how long
    /// it is: most of them, and an input is large to carry about.
    pub(crate) fn next_without_input(&mut self, to: u64) -> Option<u64> {
        let grid = self.grid_behind(self.time);
        let first = self.inputs.front().map_or(u64::MAX, |(at, _)| *at);
        if grid > to || first <= grid {
            return None;
        }
        let nanoseconds = grid - self.time;
        self.time = grid;
        Some(nanoseconds)
    }

    /// Passes all whole steps that end at `to` or earlier and before the one in which an input begins to hold.
    pub(crate) fn skip(&mut self, to: u64) {
        let first = self.inputs.front().map_or(u64::MAX, |(at, _)| *at);
        let end = to.min(first.saturating_sub(1)) / GRID * GRID;
        self.time = self.time.max(end);
    }

    const fn grid_behind(&self, time: u64) -> u64 {
        (time / GRID + 1) * GRID
    }

    /// The state's instant, to look ahead from.
    pub(crate) const fn place(&self) -> Place {
        Place { time: self.time, inputs: 0 }
    }

    /// The stretch behind a place that ends at `to` or earlier; the place moves to its end.
    pub(crate) fn look(&self, place: &mut Place, to: u64) -> Option<Stretch<I>> {
        let grid = self.grid_behind(place.time);
        let input = self.inputs.get(place.inputs).filter(|(at, _)| *at <= grid);
        let end = input.map_or(grid, |(at, _)| *at);
        if end > to {
            return None;
        }
        let nanoseconds = end - place.time;
        *place = Place { time: end, inputs: place.inputs + usize::from(input.is_some()) };
        Some(Stretch { nanoseconds, input: input.map(|(_, input)| *input) })
    }

    /// Instant of the model's state.
    pub(crate) const fn time(&self) -> u64 {
        self.time
    }

    /// Nanoseconds from the state's instant to `at`.
    pub(crate) fn beyond(&self, at: u64) -> u64 {
        at.saturating_sub(self.time)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stretches(timeline: &mut Timeline<char, 10>, to: u64) -> Vec<(u64, Option<char>)> {
        core::iter::from_fn(|| timeline.next(to)).map(|stretch| (stretch.nanoseconds, stretch.input)).collect()
    }

    #[test]
    fn the_grid_is_cut_where_inputs_begin() {
        let mut timeline = Timeline::new();
        timeline.enter('a', 13);
        timeline.enter('b', 20);
        assert_eq!(stretches(&mut timeline, 12), [(10, None)]);
        assert_eq!(timeline.beyond(12), 2);
        assert_eq!(stretches(&mut timeline, 31), [(3, Some('a')), (7, Some('b')), (10, None)]);
        assert_eq!(timeline.beyond(31), 1);
    }

    #[test]
    fn steps_without_an_input_end_where_one_begins() {
        let mut timeline = Timeline::<char, 10>::new();
        timeline.enter('a', 13);
        assert_eq!(timeline.next_without_input(9), None);
        assert_eq!(timeline.next_without_input(25), Some(10));
        assert_eq!(timeline.next_without_input(25), None, "an input lies in this step");
        assert_eq!(timeline.next(25), Some(Stretch { nanoseconds: 3, input: Some('a') }));
        assert_eq!(timeline.next_without_input(25), Some(7));
        assert_eq!((timeline.next_without_input(25), timeline.time()), (None, 20));
        timeline.enter('b', 30);
        assert_eq!(timeline.next_without_input(30), None, "an input at the end of this step");
    }

    #[test]
    fn steps_are_skipped_up_to_the_one_that_an_input_lies_in() {
        for (input, to, expected) in
            [(95, 57, 50), (95, 60, 60), (95, 95, 90), (95, 200, 90), (90, 200, 80), (3, 200, 0), (0, 200, 0)]
        {
            let mut one = Timeline::<char, 10>::new();
            one.enter('a', input);
            let mut other = one.clone();
            one.skip(to);
            while other.next_without_input(to).is_some() {}
            assert_eq!((one.time(), other.time()), (expected, expected), "input at {input}, to {to}");
        }
    }

    #[test]
    fn an_input_that_comes_late_holds_from_the_last_one() {
        let mut timeline = Timeline::new();
        timeline.enter('a', 7);
        timeline.enter('b', 3);
        assert_eq!(stretches(&mut timeline, 9), [(7, Some('a')), (0, Some('b'))]);
    }
}
