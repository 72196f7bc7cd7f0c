//! What the monitors of the motor side show.

use crate::units::CurrentFraction;

/// Values and warnings of the slow supervision.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Watched {
    /// Heat sink in 0.1 degrees C; -200.0 where there is no temperature.
    pub heat_sink: i16,
    /// Motor in 0.1 degrees C; -200.0 where there is no temperature.
    pub winding: i16,
    /// Load of the motor in 0.1 %.
    pub motor_load: u16,
    /// Load of the amplifier in 0.1 %.
    pub amplifier_load: u16,
    /// Bus voltage in V.
    pub bus: u16,
    /// Load of the chopper's resistor in 0.1 %.
    pub chopper_load: u16,
    /// The resistor is above its warning level.
    pub chopper_warning: bool,
    /// The resistor was too hot and is off until it has cooled down.
    pub chopper_off: bool,
    /// The DC link takes less than the loops would feed back, now or a short time ago.
    pub link_full: bool,
    /// Current that the thermal models of motor and amplifier allow.
    pub allowed: [CurrentFraction; 2],
    /// Motor or amplifier is above its warning level of load.
    pub overload: bool,
    /// The heat sink is above its warning level.
    pub heat_sink_warning: bool,
    /// The motor is.
    pub winding_warning: bool,
}
