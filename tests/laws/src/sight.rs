//! What can be seen of an axis without the fibre: pins, bridge and shaft.

use plant::Glance;
use ring::Nanoseconds;

/// Pins, bridge and shaft at one instant.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sight {
    /// When.
    pub time: Nanoseconds,
    /// The machine.
    pub machine: Glance,
    /// The bridge switches.
    pub bridge: bool,
    /// The brake's coil has current.
    pub coil: bool,
    /// Pin: main power is applied.
    pub main_power: bool,
    /// Pin: the gate drivers are ready.
    pub bridge_ready: bool,
    /// Pins: both channels of safe torque off allow torque.
    pub safe_torque: bool,
    /// Pin: the home switch.
    pub home_switch: bool,
}

impl Sight {
    /// Velocity of the shaft in rpm, for words.
    #[must_use]
    pub fn rpm(&self) -> f64 {
        self.machine.velocity * 60.0 / core::f64::consts::TAU
    }
}
