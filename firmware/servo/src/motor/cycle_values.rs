//! What an oscilloscope shows of the current loop.

use crate::units::CurrentFraction;

/// What the current loop had in one of its cycles (62.5 us).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CurrentLoopValues {
    /// Torque-producing current, measured.
    pub quadrature: CurrentFraction,
    /// Flux-producing current, commanded.
    pub direct_command: CurrentFraction,
    /// Flux-producing current, measured.
    pub direct: CurrentFraction,
    /// Phase currents U, V and W, positive into the motor.
    pub phases: [CurrentFraction; 3],
    /// Voltage command in the direction of the torque-producing current, volt 2^-14.
    pub quadrature_voltage: i32,
    /// Voltage command in the direction of the flux, volt 2^-14.
    pub direct_voltage: i32,
    /// Electrical angle of the rotor, 2^-16 of a turn.
    pub angle: u16,
    /// Bus voltage in mV.
    pub bus_voltage: i32,
}
