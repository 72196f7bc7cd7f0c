//! Whether the zero of the positions is known (S-0-0403), and the position limits S-0-0049 and S-0-0050, which mean nothing without.

use servo::monitor::{Commanded, RangeMonitor, TravelRange};
use servo::units::Position;

/// What is known of where the axis is.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Reference {
    /// S-0-0403 bit 0.
    known: bool,
    /// S-0-0049 and S-0-0050, while they are in force.
    monitor: Option<RangeMonitor>,
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
            self.monitor = None;
            return false;
        };
        let (measured, commanded) = look();
        let mut monitor = match self.monitor {
            Some(monitor) if *monitor.range() == range => monitor,
            _ => RangeMonitor::new(range, measured),
        };
        let left = monitor.look(measured, commanded);
        self.monitor = Some(monitor);
        left.is_some()
    }
}
