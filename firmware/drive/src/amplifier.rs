//! What an amplifier is built for, which nobody but who has built it can know.

/// Ratings of an amplifier. Currents are RMS values of a phase where they are not said to be instantaneous.
///
/// Where they cannot be those of a drive, S-0-0128 finds it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Amplifier {
    /// Largest current of the bridge, in mA.
    pub peak_current: u32,
    /// Current that the bridge carries for ever, in mA.
    pub continuous_current: u32,
    /// Current at which the bridge is switched off, at the crest of a sine with this RMS value, in mA.
    pub trip_current: u32,
    /// Instantaneous phase current at full deflection of the sensors, in mA, as it was measured on this one.
    pub current_range: u32,
    /// Instantaneous phase current up to which the dead time is compensated in proportion, in mA; 0: no compensation.
    pub dead_time_band: u16,
    /// Bus voltage at the end of the converter's range, in V, as it was measured on this one.
    pub bus_range: u16,
    /// Bus voltage below which the bridge does not work, in V.
    pub undervoltage: u16,
    /// Bus voltage above which the bridge is switched off, in V.
    pub overvoltage: u16,
    /// Bus voltage that link and bridge bear while the bridge is off, in V.
    pub withstand_voltage: u16,
    /// Smallest resistor for the switch of the brake chopper, in 0.1 Ohm; 0: there is no such switch.
    pub least_resistance: u16,
    /// Temperature of the heat sink from which there is a warning, in 0.1 degrees Celsius.
    pub warning_temperature: u16,
    /// Temperature of the heat sink at which the bridge is switched off, in 0.1 degrees Celsius.
    pub shutdown_temperature: u16,
    /// Thermal time constant of the bridge, in ms.
    pub thermal_time_constant: u32,
}
