//! All parameters of a machine.

use crate::{
    CurrentSensors, Effects, Encoder, HeatedBody, HoldingBrake, Inverter, Mechanics, Supply, Thermal, Thermometer,
    Windings,
};

/// Increments of the textbook's encoder.
const TEXTBOOK_INCREMENTS: u32 = 1 << 20;

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
    /// Sensors of heat sink and windings.
    pub thermometers: [Thermometer; 2],
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
        for thermometer in &self.thermometers {
            thermometer.check();
        }
        self.effects.check();
    }

    /// A machine that obeys the textbook, to which each test adds what it is about: a bus in V that nothing moves, a bridge of 16 kHz without dead
    /// time and voltage drop, sensors of `current_range` A without fault and noise, 2^20 increments, copper that stays at 20 degrees Celsius, a
    /// rotor of 0.01 kg m² that nothing rubs. At time zero its d axis is that of the first phase.
    #[must_use]
    pub fn textbook(windings: Windings, bus: f64, current_range: f64) -> Self {
        let cool = HeatedBody { capacity: 1e12, resistance: 1.0 };
        Self {
            windings,
            inverter: Inverter { dead_time: 0.0, period: 62.5e-6, voltage_drop: 0.0 },
            supply: Supply { voltage: bus, resistance: 1e-3, capacitance: 1e6, chopper: None, resistor: None },
            current_sensors: CurrentSensors {
                range: current_range,
                offset: [0.0; 3],
                gain_error: [0.0; 3],
                noise: 0.0,
            },
            bus_range: 2.0 * bus,
            encoder: Encoder {
                increments_per_revolution: TEXTBOOK_INCREMENTS,
                initial_count: 0,
                index_at: 0.25,
                electrical_zero: -0.5 / f64::from(TEXTBOOK_INCREMENTS),
            },
            mechanics: Mechanics {
                rotor_inertia: 0.01,
                coulomb_friction: 0.0,
                viscous_friction: 0.0,
                load: None,
                gravity_torque: 0.0,
            },
            brake: None,
            thermal: Thermal { winding: cool, heat_sink: cool, ambient: 20.0 },
            thermometers: Thermometer::USUAL,
            effects: Effects::NONE,
            seed: 1,
        }
    }

    /// Torque constant in Nm per A of the phase current's amplitude, for a current across the magnet.
    #[must_use]
    pub fn torque_constant(&self) -> f64 {
        1.5 * f64::from(self.windings.pole_pairs) * self.windings.flux
    }
}
