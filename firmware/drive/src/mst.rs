//! Missed MSTs, from the counter that the chip keeps in its RAM.

use sercon816::Bus;
use sercon816::layout::MST_ERRORS;

/// Watches NMSTERR. Only differences count, and it begins anew with every run-up: its start value and its behaviour at the end of
/// its range are not known (G27).
#[derive(Debug)]
pub(crate) struct MstMonitor<B> {
    bus: B,
    counted: u16,
}

impl<B: Bus> MstMonitor<B> {
    /// A monitor that has seen nothing yet.
    pub(crate) const fn new(bus: B) -> Self {
        Self { bus, counted: 0 }
    }

    /// Forgets what was counted and sets the counter to 0; before the supervision of CP3 begins. One bus access.
    pub(crate) fn restart(&mut self) {
        self.bus.write_ram(MST_ERRORS, 0);
        self.counted = 0;
    }

    /// Whether an MST is missing in the cycle that this call stands for. One bus access.
    ///
    /// Takes one miss a call and keeps the rest for the next ones: a call that comes late (the flywheel stands in for t3
    /// when the next MST is missing already) must not make one of two.
    pub(crate) fn take_missed(&mut self) -> bool {
        let missed = self.bus.read_ram(MST_ERRORS) != self.counted;
        if missed {
            self.counted = self.counted.wrapping_add(1);
        }
        missed
    }
}
