//! A machine at one glance.

/// What is true of a machine at one instant, and what is done to it from outside.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Glance {
    /// The instant in nanoseconds.
    pub time: u64,
    /// Angle of the motor shaft since time zero in revolutions.
    pub angle: f64,
    /// Velocity of the motor shaft in rad/s.
    pub velocity: f64,
    /// Torque of the motor in Nm, without friction and brake.
    pub torque: f64,
    /// Currents along and across the magnet in A, amplitudes of the phase current.
    pub current: [f64; 2],
    /// In V.
    pub bus_voltage: f64,
    /// Temperatures of heat sink and windings in degrees Celsius.
    pub temperatures: [f64; 2],
    /// Torque in Nm that the brake can hold.
    pub brake_torque: f64,
    /// Torque in Nm with which the load is driven, gravity included.
    pub load_torque: f64,
    /// The motor shaft is seized.
    pub seized: bool,
    /// The brake has a failure.
    pub brake_broken: bool,
    /// A current sensor does not show the current.
    pub blind: bool,
    /// A wire of a thermometer is broken, or its wires touch.
    pub feverish: bool,
    /// The encoder does not count.
    pub encoder_frozen: bool,
    /// The index does not come.
    pub index_muted: bool,
    /// The motor cable has a bad contact, an open core or an earth fault.
    pub cable_broken: bool,
    /// How often so far the shaft was given a velocity.
    pub kicks: u32,
    /// How often so far the encoder was given counts that no movement had caused.
    pub slips: u32,
    /// What they add up to.
    pub slipped: i32,
}
