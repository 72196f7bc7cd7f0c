//! Where the axis is and where it is told to go, in the coordinates of the master.

use sercon816::Bus;
use servo::probe::{Edge, Probe};
use servo::units::Position;

use super::Motion;
use crate::hardware::Hardware;

impl<B: Bus + Clone, H: Hardware> Motion<B, H> {
    /// S-0-0047 with S-0-0048, within `0 ..` range of the data.
    #[inline]
    pub(super) fn commanded_position(&self) -> Position {
        let coordinates = &self.settings.coordinates;
        let command = coordinates.place(self.commands.position);
        coordinates.range.reduce(command + self.additive_position())
    }

    /// S-0-0048, with bit 1 of S-0-0055.
    #[inline]
    fn additive_position(&self) -> Position {
        let value = self.commands.additive_position;
        // Most drives have no additive command.
        if value == 0 {
            return Position::ZERO;
        }
        let position = self.settings.position.to_position(value);
        if self.settings.position_polarity.additive { -position } else { position }
    }

    /// S-0-0047, as the service channel and the oscilloscope read it. While S-0-0148 holds the axis it is what commands the place where the
    /// axis is held: a control that goes on from there moves nothing.
    pub(super) fn position_command_data(&self) -> i32 {
        if !self.homing {
            return self.commands.position;
        }
        let held = self.axis.cyclic_position(self.output.position_command) - self.additive_position();
        self.settings.coordinates.data(self.settings.coordinates.range.reduce(held))
    }

    /// S-0-0051.
    #[inline]
    pub(super) fn shown_position(&self) -> i32 {
        self.settings.coordinates.data(self.axis.cyclic_position(self.shown.position))
    }

    /// S-0-0189.
    pub(super) fn shown_following_distance(&self) -> i32 {
        self.settings.coordinates.difference(self.shown.following_error)
    }

    /// S-0-0130 to S-0-0133, in the coordinates of the instant of the edge.
    pub(super) fn probe_value(&self, probe: Probe, edge: Edge) -> i32 {
        self.settings.coordinates.data(self.probe_run.cycle.value(probe, edge))
    }

    /// The place where the motor stands is the position `value`, in the weight of S-0-0052, from now on. Divides.
    pub fn set_reference(&mut self, value: i32) {
        self.shift_zero(self.settings.coordinates.place(value) - self.encoder.position());
        self.referenced = true;
    }

    /// The axis in its own direction, but with the zero of the data: the nearer one of a modulo axis.
    pub(super) fn place_around_zero(&self) -> Position {
        let within = self.axis.cyclic_position(self.encoder.position());
        self.settings.coordinates.range.around_zero(within)
    }
}
