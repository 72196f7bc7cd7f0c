//! Diagnostic words S-0-0011, S-0-0012 and S-0-0013 (sercos2.md 4.3).
//!
//! Diagnostic numbers and texts (S-0-0390, S-0-0095) depend on the states of the drive and are the drive's own.

use bitflags::bitflags;

bitflags! {
    /// S-0-0011: errors. Any bit shuts the drive down and sets bit 13 of the status word.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    pub struct Class1: u16 {
        /// Overload (S-0-0114).
        const OVERLOAD = 1 << 0;
        /// Amplifier overtemperature.
        const AMPLIFIER_TEMPERATURE = 1 << 1;
        /// Motor overtemperature.
        const MOTOR_TEMPERATURE = 1 << 2;
        /// Cooling error.
        const COOLING = 1 << 3;
        /// Control voltage error.
        const CONTROL_VOLTAGE = 1 << 4;
        /// Feedback error.
        const FEEDBACK = 1 << 5;
        /// Commutation error.
        const COMMUTATION = 1 << 6;
        /// Overcurrent.
        const OVERCURRENT = 1 << 7;
        /// Overvoltage.
        const OVERVOLTAGE = 1 << 8;
        /// Undervoltage.
        const UNDERVOLTAGE = 1 << 9;
        /// Power supply phase error.
        const SUPPLY_PHASE = 1 << 10;
        /// Excessive following distance (S-0-0159).
        const EXCESSIVE_DEVIATION = 1 << 11;
        /// Communication error (S-0-0014).
        const COMMUNICATION = 1 << 12;
        /// Position limit exceeded.
        const POSITION_LIMIT = 1 << 13;
        /// Manufacturer-specific error: S-0-0390 says which.
        const MANUFACTURER = 1 << 15;
    }
}

bitflags! {
    /// S-0-0012: warnings, not latched.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    pub struct Class2: u16 {
        /// Overload warning.
        const OVERLOAD = 1 << 0;
        /// Amplifier overtemperature warning.
        const AMPLIFIER_TEMPERATURE = 1 << 1;
        /// Motor overtemperature warning.
        const MOTOR_TEMPERATURE = 1 << 2;
        /// Cooling warning.
        const COOLING = 1 << 3;
        /// Undervoltage in the DC link.
        const UNDERVOLTAGE = 1 << 9;
        /// Excessive velocity deviation.
        const VELOCITY_DEVIATION = 1 << 11;
        /// Manufacturer-specific warning.
        const MANUFACTURER = 1 << 15;
    }
}

bitflags! {
    /// S-0-0013: operation status.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    pub struct Class3: u16 {
        /// Velocity feedback equals velocity command (window S-0-0157).
        const VELOCITY_REACHED = 1 << 0;
        /// Standstill (window S-0-0124).
        const STANDSTILL = 1 << 1;
        /// Velocity feedback below threshold nx.
        const BELOW_THRESHOLD = 1 << 2;
        /// Torque at or above threshold Tx.
        const TORQUE_THRESHOLD = 1 << 3;
        /// Torque at its limit (S-0-0092).
        const TORQUE_LIMIT = 1 << 4;
        /// Velocity command above its limit (S-0-0091).
        const VELOCITY_LIMIT = 1 << 5;
        /// In position (window S-0-0057).
        const IN_POSITION = 1 << 6;
        /// Position feedback within S-0-0057 of the active target (S-0-0430).
        const AT_ACTIVE_TARGET = 1 << 8;
        /// Position feedback within S-0-0261 of the active target.
        const IN_COARSE_POSITION = 1 << 11;
        /// The drive's own position command has arrived at the active target.
        const TARGET_ATTAINED = 1 << 12;
        /// The drive's own position command stands.
        const INTERPOLATOR_HALTED = 1 << 13;
        /// Manufacturer-specific status.
        const MANUFACTURER = 1 << 15;
    }
}
