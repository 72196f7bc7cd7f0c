//! Diagnostic words S-0-0011, S-0-0012 and S-0-0013 (sercos2.md 4.3), and the diagnostic numbers and texts.

use crate::phase::PhaseError;
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
        /// Manufacturer-specific status.
        const MANUFACTURER = 1 << 15;
    }
}

/// One row: documentation, name, number, text; cause and remedy for the manual.
macro_rules! diagnostics {
    ($(
        $name:ident = $number:literal, $text:literal, $class:expr;
        cause $cause:literal;
        remedy $remedy:literal;
    )+) => {
        /// A state or error of the drive as S-0-0390 and S-0-0095 show it.
        ///
        /// Numbers: 0xAxxx states, 0xCxxx procedure commands, 0xFxxx errors. The numbers are the drive's own.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[cfg_attr(feature = "defmt", derive(defmt::Format))]
        #[repr(u16)]
        pub enum Diagnostic {
            $(#[doc = concat!($text, ". Cause: ", $cause, " Remedy: ", $remedy)] $name = $number,)+
        }

        impl Diagnostic {
            /// All diagnostics, for the manual.
            pub const ALL: &'static [Diagnostic] = &[$(Diagnostic::$name),+];

            /// S-0-0095, at most 60 characters.
            pub const fn text(self) -> &'static str {
                match self {
                    $(Diagnostic::$name => $text,)+
                }
            }

            /// The bit of S-0-0011 that belongs to an error; empty for a state.
            pub const fn class_1(self) -> Class1 {
                match self {
                    $(Diagnostic::$name => $class,)+
                }
            }

            /// What leads to it.
            pub const fn cause(self) -> &'static str {
                match self {
                    $(Diagnostic::$name => $cause,)+
                }
            }

            /// What to do about it.
            pub const fn remedy(self) -> &'static str {
                match self {
                    $(Diagnostic::$name => $remedy,)+
                }
            }
        }
    };
}

diagnostics! {
    Phase0 = 0xA000, "Communication phase 0", Class1::empty();
    cause "The master closes the ring, or has not started it.";
    remedy "None; if it stays, look for an interruption of the fibre.";

    Phase1 = 0xA001, "Communication phase 1", Class1::empty();
    cause "The master looks for its drives.";
    remedy "None; if it stays, compare the drive addresses with the master's list.";

    Phase2 = 0xA002, "Communication phase 2", Class1::empty();
    cause "The master sets parameters.";
    remedy "None; if it stays, read S-0-0021 for what S-0-0127 found invalid.";

    Phase3 = 0xA003, "Communication phase 3", Class1::empty();
    cause "The master sets parameters, telegrams are cyclic.";
    remedy "None; if it stays, read S-0-0022 for what S-0-0128 found invalid.";

    Halt = 0xA010, "Drive halt", Class1::empty();
    cause "Bit 13 of the control word is 0 while the drive is on.";
    remedy "None.";

    ReadyForOperation = 0xA012, "Ready for operation, torque off", Class1::empty();
    cause "Main power is applied, the drive is not enabled.";
    remedy "None.";

    ReadyForPower = 0xA013, "Ready for main power", Class1::empty();
    cause "Phase 4, main power is missing.";
    remedy "Switch main power on.";

    TorqueControl = 0xA100, "Torque control", Class1::empty();
    cause "The drive follows the torque command.";
    remedy "None.";

    VelocityControl = 0xA101, "Velocity control", Class1::empty();
    cause "The drive follows the velocity command.";
    remedy "None.";

    PositionControl = 0xA102, "Position control", Class1::empty();
    cause "The drive follows the position command with following distance.";
    remedy "None.";

    PositionControlLagless = 0xA103, "Position control without lag", Class1::empty();
    cause "The drive follows the position command with velocity feed-forward.";
    remedy "None.";

    Cp3CheckFailed = 0xC101, "CP3 transition check failed", Class1::empty();
    cause "S-0-0127 found data that CP3 cannot work with.";
    remedy "Read S-0-0021, correct the data blocks listed there, repeat S-0-0127.";

    Cp4CheckFailed = 0xC201, "CP4 transition check failed", Class1::empty();
    cause "S-0-0128 found data that CP4 cannot work with, or the drive is not synchronised to the MST.";
    remedy "Read S-0-0022, correct the data blocks listed there, repeat S-0-0128.";

    ExcessiveDeviation = 0xF228, "Excessive following distance", Class1::EXCESSIVE_DEVIATION;
    cause "The following distance was larger than S-0-0159: a blocked axis, too little torque, or a jump in the command.";
    remedy "Look for the blockage; check S-0-0159, S-0-0092, S-0-0104 and the master's acceleration; then S-0-0099.";

    Feedback = 0xF229, "Motor feedback error", Class1::FEEDBACK;
    cause "The encoder's signals are missing or contradict each other.";
    remedy "Check encoder, cable and shield; then S-0-0099.";

    Undervoltage = 0xF226, "Main power lost in operation", Class1::UNDERVOLTAGE;
    cause "The amplifier reported that main power is missing while torque was on.";
    remedy "Check the supply and its contactor; switch the drive off before main power; then S-0-0099.";

    Amplifier = 0xF860, "Amplifier fault", Class1::MANUFACTURER;
    cause "The amplifier has reported a fault and switched itself off.";
    remedy "Check motor and motor cable for a short circuit, and the amplifier's own diagnosis; then S-0-0099.";

    MstFailure = 0xF401, "Two consecutive MSTs failed", Class1::COMMUNICATION;
    cause "The master's synchronisation telegram was missing, late or damaged twice in a row (S-0-0028 counts).";
    remedy "Check fibre, plugs and transmitting power; run the ring up again; then S-0-0099.";

    MdtFailure = 0xF402, "Two consecutive MDTs failed", Class1::COMMUNICATION;
    cause "The master's data telegram was missing, late or damaged twice in a row (S-0-0029 counts).";
    remedy "Check fibre, plugs and transmitting power; run the ring up again; then S-0-0099.";

    InvalidPhase = 0xF403, "Invalid communication phase", Class1::COMMUNICATION;
    cause "The master announced a phase above 4.";
    remedy "Check the master; run the ring up again; then S-0-0099.";

    Upshift = 0xF404, "Communication phase skipped", Class1::COMMUNICATION;
    cause "The master skipped a phase on the way up.";
    remedy "Check the master; run the ring up again; then S-0-0099.";

    Downshift = 0xF405, "Communication phase stepped back", Class1::COMMUNICATION;
    cause "The master stepped back to another phase than 0.";
    remedy "Check the master; run the ring up again; then S-0-0099.";

    NotReady = 0xF406, "Phase switched without transition check", Class1::COMMUNICATION;
    cause "The master switched to phase 3 or 4 without a positive S-0-0127 or S-0-0128, or rewrote a checked parameter after it.";
    remedy "Repeat the check before the switch; run the ring up again; then S-0-0099.";

    UninitialisedMode = 0xF407, "Operation mode not initialised", Class1::COMMUNICATION;
    cause "The control word selects an operation mode whose parameter S-0-0033 to S-0-0035 is 0 or that does not exist.";
    remedy "Set the mode before S-0-0128, or select another; then S-0-0099.";

    LightLoss = 0xF408, "No light at the receiver", Class1::COMMUNICATION;
    cause "MST and MDT were missing twice in a row at the same time.";
    remedy "Check the fibre before this drive and the station before it; run the ring up again; then S-0-0099.";
}

impl Diagnostic {
    /// S-0-0390.
    pub const fn number(self) -> u16 {
        self as u16
    }
}

impl From<PhaseError> for Diagnostic {
    fn from(error: PhaseError) -> Self {
        match error {
            PhaseError::MstFailure => Diagnostic::MstFailure,
            PhaseError::MdtFailure => Diagnostic::MdtFailure,
            PhaseError::LightLoss => Diagnostic::LightLoss,
            PhaseError::InvalidPhase { .. } => Diagnostic::InvalidPhase,
            PhaseError::Upshift { .. } => Diagnostic::Upshift,
            PhaseError::Downshift { .. } => Diagnostic::Downshift,
            PhaseError::NotReady { .. } => Diagnostic::NotReady,
            PhaseError::UninitialisedMode => Diagnostic::UninitialisedMode,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::service::LIVE_TEXT_BYTES;

    #[test]
    fn every_diagnostic_has_its_own_number_a_text_that_fits_and_an_answer() {
        for (place, diagnostic) in Diagnostic::ALL.iter().enumerate() {
            assert!(diagnostic.text().is_ascii() && diagnostic.text().len() <= LIVE_TEXT_BYTES);
            assert!(diagnostic.cause().ends_with('.') && diagnostic.remedy().ends_with('.'));
            let is_error = diagnostic.number() >= 0xF000;
            assert_eq!(is_error, !diagnostic.class_1().is_empty(), "{diagnostic:?}");
            assert!(Diagnostic::ALL.iter().skip(place + 1).all(|other| other.text() != diagnostic.text()));
        }
    }

    #[test]
    fn communication_errors_belong_to_bit_12() {
        assert_eq!(Diagnostic::from(PhaseError::LightLoss).class_1().bits(), 0x1000);
        assert_eq!(Diagnostic::ExcessiveDeviation.class_1().bits(), 0x0800);
    }
}
