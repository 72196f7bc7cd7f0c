//! Simulated time, shared by every model of a run.

use std::cell::Cell;
use std::fmt;
use std::ops::{Add, AddAssign, Sub};
use std::rc::Rc;

/// An instant, counted from the start of the simulation, or a span between two of them; nanoseconds.
///
/// One type serves both because the models only ever add spans to instants; subtraction below zero panics.
#[derive(Copy, Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
pub struct Nanoseconds(pub u64);

/// The one clock of a simulation: [`crate::ring::Ring`] sets it, chips and processors read it.
pub type SharedClock = Rc<Cell<Nanoseconds>>;

impl Nanoseconds {
    /// The start of the simulation, or no time at all.
    pub const ZERO: Self = Self(0);

    /// `microseconds` as nanoseconds.
    pub const fn from_microseconds(microseconds: u64) -> Self {
        Self(microseconds * 1_000)
    }

    /// `milliseconds` as nanoseconds.
    pub const fn from_millis(milliseconds: u64) -> Self {
        Self(milliseconds * 1_000_000)
    }

    /// The number of whole microseconds.
    pub const fn as_microseconds(self) -> u64 {
        self.0 / 1_000
    }

    /// Seconds, for reports and plots only.
    pub fn as_seconds(self) -> f64 {
        self.0 as f64 / 1e9
    }

    /// `self - earlier`, or zero when `earlier` is later.
    pub const fn saturating_sub(self, earlier: Self) -> Self {
        Self(self.0.saturating_sub(earlier.0))
    }
}

impl Add for Nanoseconds {
    type Output = Self;
    fn add(self, span: Self) -> Self {
        Self(self.0 + span.0)
    }
}

impl AddAssign for Nanoseconds {
    fn add_assign(&mut self, span: Self) {
        self.0 += span.0;
    }
}

impl Sub for Nanoseconds {
    type Output = Self;
    fn sub(self, earlier: Self) -> Self {
        Self(self.0 - earlier.0)
    }
}

impl fmt::Display for Nanoseconds {
    /// Microseconds with three decimals: `1782.000 us`.
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{}.{:03} us", self.0 / 1_000, self.0 % 1_000)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_and_display() {
        assert_eq!(Nanoseconds::from_millis(2), Nanoseconds::from_microseconds(2_000));
        assert_eq!((Nanoseconds(1_500) + Nanoseconds(7)).to_string(), "1.507 us");
        assert_eq!(Nanoseconds(5).saturating_sub(Nanoseconds(6)), Nanoseconds::ZERO);
    }
}
