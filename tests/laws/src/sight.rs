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
    /// How often main power, gate drivers or a channel of safe torque off have come or gone so far: a pulse may lie between two looks.
    pub pin_changes: u32,
    /// Pins: both channels of safe torque off allow torque.
    pub safe_torque: bool,
    /// Pin: the home switch.
    pub home_switch: bool,
    /// Positive edges that the pin of probe 1 has had: two of them may come between two looks.
    pub probe_1_edges: u32,
    /// The processor is kept from its work.
    pub late: bool,
}

impl Sight {
    /// Something outside the drive is not as it should be; `supply` is the voltage of the mains.
    #[must_use]
    pub fn is_troubled(&self, supply: f64) -> bool {
        let machine = &self.machine;
        let power = !self.main_power || !self.bridge_ready || !self.safe_torque;
        let lies = machine.blind || machine.feverish || machine.encoder_frozen || machine.index_muted;
        let link = !(0.9 * supply..1.1 * supply).contains(&machine.bus_voltage);
        // What the defaults of S-0-0200 and S-0-0201 do not warn of.
        let hot = machine.temperatures[0] > 75.0 || machine.temperatures[1] > 110.0;
        power || lies || link || hot || machine.cable_broken || machine.seized || machine.brake_broken || self.late
    }

    /// Velocity of the shaft in rpm, for words.
    #[must_use]
    pub fn rpm(&self) -> f64 {
        self.machine.velocity * 60.0 / core::f64::consts::TAU
    }
}
