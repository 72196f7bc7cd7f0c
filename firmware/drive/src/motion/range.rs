//! The position limits S-0-0049 and S-0-0050.

use sercon816::Bus;
use servo::axis::Mode;
use servo::monitor::{Commanded, RangeMonitor};
use servo::units::Velocity;

use super::Motion;
use crate::hardware::Hardware;

impl<B: Bus + Clone, H: Hardware> Motion<B, H> {
    /// Whether a command leads the axis beyond its limits, or further beyond them. The way back is free, and so is holding the axis where it
    /// is: S-0-0099 and a command inwards bring it home. Without reference the limits mean nothing.
    pub(super) fn watch_range(&mut self) -> bool {
        let Some(range) = self.settings.position_limits.filter(|_| self.referenced) else {
            self.range_monitor = None;
            return false;
        };
        let measured = self.place_around_zero();
        let mut monitor = match self.range_monitor {
            Some(monitor) if *monitor.range() == range => monitor,
            _ => RangeMonitor::new(range, measured),
        };
        let output = &self.output;
        let commanded = match self.axis.mode() {
            _ if !self.machine.state().is_in_operation() => Commanded::Nothing,
            // A stop leads nowhere, and a place is held where the axis has come to.
            Mode::Off | Mode::Stopping | Mode::Braking | Mode::Halt => Commanded::Nothing,
            Mode::Position | Mode::Travel => {
                Commanded::At(measured + (output.position_command - self.encoder.position()))
            }
            Mode::Velocity => Commanded::Turn(output.velocity_command),
            // No velocity is commanded, and the measured one of a standing axis is noise.
            Mode::Torque if output.standstill => Commanded::Turn(Velocity::ZERO),
            Mode::Torque => Commanded::Turn(output.velocity),
        };
        let left = monitor.look(measured, commanded);
        self.range_monitor = Some(monitor);
        left.is_some()
    }
}
