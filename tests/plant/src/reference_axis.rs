//! Axes that tests and the demonstration are built on.
//!
//! No public source gives the motor data of a press drive; the values are those of ordinary catalogue motors of the class,
//! chosen by us, and the derived figures are written beside them.

use crate::{Motor, MotorSettings};

/// A complete axis: the plant, its amplifier, and parameters that suit it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReferenceAxis {
    /// Name for reports.
    pub name: &'static str,
    /// Motor, load and encoder.
    pub motor: MotorSettings,
    /// Amplifier peak current S-0-0110 in mA; gives `motor.peak_torque`.
    pub peak_current: u32,
    /// Motor continuous current at standstill S-0-0111 in mA.
    pub standstill_current: u32,
    /// Maximum speed S-0-0113 in rpm.
    pub maximum_speed: u32,
    /// Loop parameters that suit the axis.
    pub gains: SuggestedGains,
}

/// Loop parameters in the units of their IDNs (sercos2.md 4.2 and appendix A).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SuggestedGains {
    /// S-0-0100 velocity loop proportional gain, in 0.1 A s/rad.
    pub velocity_gain: u16,
    /// S-0-0101 velocity loop integral action time, in 0.1 ms.
    pub integral_time: u16,
    /// S-0-0104 position loop Kv-factor, in 0.01 * 1000/min.
    pub position_gain: u16,
    /// S-0-0392 velocity feedback filter, in microseconds.
    pub velocity_filter: u16,
    /// S-0-0138 bipolar acceleration limit, in 0.001 rad/s².
    pub acceleration_limit: u32,
}

impl ReferenceAxis {
    /// A printing unit of a shaftless newspaper press: a servo motor of the 10 kW class on a cylinder train.
    ///
    /// * Torque constant 2 Nm/A, 60 A peak: 120 Nm. Rotor 0.03 kg m² and cylinders 0.12 kg m² at the motor (ratio 4): 800 rad/s² at peak.
    /// * Friction 6 Nm + 0.05 Nm s/rad (the ink train): 9 Nm at 600 rpm.
    /// * Encoder 65 536 increments (2 048 sine periods, interpolated): 0.0055 degree.
    /// * Gains: velocity loop crossing at 250 rad/s: Kp = 250 * 0.15 / 2 = 18.8 A s/rad; Tn = 4 / 250 = 16 ms; Kv = 250 / 4 = 62.5 1/s = 3.75 * 1000/min.
    #[must_use]
    pub fn press() -> Self {
        Self {
            name: "press printing unit",
            motor: MotorSettings {
                peak_torque: 120.0,
                inertia: 0.15,
                coulomb_friction: 6.0,
                viscous_friction: 0.05,
                current_time_constant: 200e-6,
                increments_per_revolution: 65_536,
                initial_count: 0,
                coupling: None,
            },
            peak_current: 60_000,
            standstill_current: 25_000,
            maximum_speed: 3_000,
            gains: SuggestedGains {
                velocity_gain: 188,
                integral_time: 160,
                position_gain: 375,
                velocity_filter: 500,
                acceleration_limit: 400_000,
            },
        }
    }

    /// A feed axis of a small machine tool: a 400 W class motor on a ball screw.
    ///
    /// * Torque constant 0.48 Nm/A, 8 A peak: 3.84 Nm. Rotor 0.00003 kg m², screw and table 0.00007 kg m² at the motor: 38 400 rad/s² at peak.
    /// * Friction 0.15 Nm + 0.0002 Nm s/rad.
    /// * Encoder 10 000 increments (2 500 lines): 0.036 degree.
    /// * Gains: S-0-0100 has steps of 0.1 A s/rad; 0.1 gives a crossing at 0.1 * 0.48 / 0.0001 = 480 rad/s; Tn = 8.3 ms; Kv = 120 1/s = 7.20 * 1000/min.
    #[must_use]
    pub fn small_cnc() -> Self {
        Self {
            name: "small CNC feed axis",
            motor: MotorSettings {
                peak_torque: 3.84,
                inertia: 0.000_1,
                coulomb_friction: 0.15,
                viscous_friction: 0.000_2,
                current_time_constant: 100e-6,
                increments_per_revolution: 10_000,
                initial_count: 0,
                coupling: None,
            },
            peak_current: 8_000,
            standstill_current: 2_700,
            maximum_speed: 5_000,
            gains: SuggestedGains {
                velocity_gain: 1,
                integral_time: 83,
                position_gain: 720,
                velocity_filter: 500,
                acceleration_limit: 5_000_000,
            },
        }
    }

    /// A motor of this axis at rest.
    #[must_use]
    pub fn motor(&self) -> Motor {
        Motor::new(self.motor)
    }
}
