//! Missed MSTs, from the counter that the chip keeps in its RAM.

use sercon816::Bus;
use sercon816::layout::MST_ERRORS;

/// Watches NMSTERR. Only differences count: its start value and its behaviour at the end of its range are not known (G27).
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

    /// Whether the chip has missed an MST since the last call. One bus access.
    pub(crate) fn missed_since_last_call(&mut self) -> bool {
        let counted = self.bus.read_ram(MST_ERRORS);
        let missed = counted != self.counted;
        self.counted = counted;
        missed
    }
}
