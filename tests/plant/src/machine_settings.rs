//! All parameters of a machine.

use crate::{CurrentSensors, Effects, Encoder, HoldingBrake, Inverter, Mechanics, Supply, Thermal, Windings};

/// Parameters of a motor with its power stage, sensors and load, in SI units at the motor shaft.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MachineSettings {
    /// The windings of the motor.
    pub windings: Windings,
    /// The bridge that feeds them.
    pub inverter: Inverter,
    /// What feeds the bridge.
    pub supply: Supply,
    /// Sensors of the phase currents.
    pub current_sensors: CurrentSensors,
    /// Bus voltage in V at 4096 counts of its sample.
    pub bus_range: f64,
    /// Encoder on the motor shaft.
    pub encoder: Encoder,
    /// Masses, shaft and friction.
    pub mechanics: Mechanics,
    /// A holding brake on the motor shaft.
    pub brake: Option<HoldingBrake>,
    /// Heat of windings and heat sink.
    pub thermal: Thermal,
    /// What it has beside the textbook's machine.
    pub effects: Effects,
    /// Seed of the sensors' noise.
    pub seed: u64,
}

impl MachineSettings {
    pub(crate) fn check(&self) {
        self.windings.check();
        self.inverter.check();
        self.supply.check();
        self.current_sensors.check();
        assert!(self.bus_range > 0.0, "the range of the bus voltage must be positive");
        self.encoder.check();
        self.mechanics.check();
        if let Some(brake) = &self.brake {
            brake.check();
        }
        self.thermal.check();
        self.effects.check();
    }

    /// Torque constant in Nm per A of the phase current's amplitude, for a current across the magnet.
    #[must_use]
    pub fn torque_constant(&self) -> f64 {
        1.5 * f64::from(self.windings.pole_pairs) * self.windings.flux
    }
}
