//! State and errors of the drive in plain words: S-0-0095 (text), S-0-0390 (number), and for the manual cause and remedy.

use sercos::Phase;
use sercos::diagnostic::Class1;
use sercos::phase::InterfaceStatus;

use crate::snapshot::Snapshot;
use crate::state::DriveState;

/// One diagnosis. Numbers A0xxH are states, F0xxH errors of communication, F1xxH errors of the drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Diagnosis {
    /// S-0-0390.
    pub number: u16,
    /// S-0-0095, at most 40 characters.
    pub text: &'static str,
    /// What leads to it.
    pub cause: &'static str,
    /// What to do about it; empty for a state that needs nothing.
    pub remedy: &'static str,
}

const fn diagnosis(number: u16, text: &'static str, cause: &'static str, remedy: &'static str) -> Diagnosis {
    assert!(text.len() <= 40);
    Diagnosis { number, text, cause, remedy }
}

const PHASES: [Diagnosis; 4] = [
    diagnosis(0xA000, "Communication phase 0", "The master closes the ring.", ""),
    diagnosis(0xA001, "Communication phase 1", "The master looks for its drives.", ""),
    diagnosis(0xA002, "Communication phase 2", "The master sets parameters.", ""),
    diagnosis(0xA003, "Communication phase 3", "Cyclic telegrams run, commands are not valid yet.", ""),
];
const NO_POWER: Diagnosis = diagnosis(
    0xA010,
    "Ready for main power",
    "The logic is ready; the DC link is not charged.",
    "Switch the main power on.",
);
const READY: Diagnosis =
    diagnosis(0xA011, "Power applied, torque-free", "The drive waits for bits 15 and 14 of the control word.", "");
const FOLLOWING: Diagnosis =
    diagnosis(0xA012, "In operation, following commands", "Torque is on and the command values are followed.", "");
const HALTED: Diagnosis = diagnosis(0xA013, "Drive halt", "Bit 13 of the control word is 0.", "");
const SWITCHING_OFF: Diagnosis =
    diagnosis(0xA014, "Stopping", "Bit 15 of the control word went to 0, or the master left CP4.", "");

const INVALID_PHASE: Diagnosis = diagnosis(
    0xF005,
    "Invalid communication phase",
    "An MST announced a phase above 4.",
    "Check the master; check the fibres for attenuation and distortion.",
);
const UPSHIFT: Diagnosis = diagnosis(
    0xF006,
    "Phase skipped upwards",
    "The master left out a communication phase.",
    "Run up again; check the master's configuration.",
);
const DOWNSHIFT: Diagnosis = diagnosis(
    0xF007,
    "Phase step back, not to 0",
    "The master went back to a phase other than 0.",
    "Run up again from CP0.",
);
const NOT_READY: Diagnosis = diagnosis(
    0xF008,
    "Phase switch without transition check",
    "CP3 or CP4 came without a positive S-0-0127 or S-0-0128.",
    "Read S-0-0021 or S-0-0022 and correct the data blocks listed there.",
);
const UNINITIALISED_MODE: Diagnosis = diagnosis(
    0xF009,
    "Operation mode not initialised",
    "Control word bits 11, 9, 8 ask for a mode that S-0-0032 to S-0-0035 do not set.",
    "Set the mode in CP2 or CP3, or correct the control word.",
);
const LIGHT_LOSS: Diagnosis = diagnosis(
    0xF001,
    "No light: MST and MDT missing",
    "Two MSTs and two MDTs in a row were not received.",
    "Check fibres, plugs and the supply of the station before this one.",
);
const MST_FAILURE: Diagnosis = diagnosis(
    0xF003,
    "Two MSTs missing",
    "Two master synchronisation telegrams in a row were missing or not in time.",
    "Check the fibres, the bit rate, and the cycle time S-0-0002 against the master.",
);
const MDT_FAILURE: Diagnosis = diagnosis(
    0xF004,
    "Two MDTs missing",
    "Two master data telegrams in a row were missing, damaged or not in time.",
    "Check the fibres, and S-0-0089 and S-0-0010 against the master.",
);

const ERRORS: [(Class1, Diagnosis); 4] = [
    (
        Class1::MANUFACTURER,
        diagnosis(
            0xF10F,
            "Amplifier fault",
            "The amplifier reported a fault and switched itself off while torque was on.",
            "Read the amplifier's own display; clear its fault, then S-0-0099.",
        ),
    ),
    (
        Class1::UNDERVOLTAGE,
        diagnosis(
            0xF109,
            "Main power lost",
            "The main power went away while torque was on.",
            "Check mains, contactor and the wire of the main-power input; then S-0-0099.",
        ),
    ),
    (
        Class1::EXCESSIVE_DEVIATION,
        diagnosis(
            0xF10B,
            "Excessive following distance",
            "The position was further from the command than S-0-0159 allows, or the command was, at switching on.",
            "Check for a blocked axis, torque limit S-0-0092 and gains; align S-0-0047 with S-0-0051 before switching on.",
        ),
    ),
    (
        Class1::COMMUNICATION,
        diagnosis(0xF10C, "Communication error", "See S-0-0014.", "Run up again from CP0, then S-0-0099."),
    ),
];

/// The diagnosis to show: an error before a state, the cause of a communication error before the fact.
#[must_use]
pub fn diagnose(snapshot: &Snapshot, phase: Phase, interface: InterfaceStatus) -> Diagnosis {
    let communication = [
        (interface.mst_failure() && interface.mdt_failure(), LIGHT_LOSS),
        (interface.mst_failure(), MST_FAILURE),
        (interface.mdt_failure(), MDT_FAILURE),
        (interface.invalid_phase(), INVALID_PHASE),
        (interface.upshift(), UPSHIFT),
        (interface.downshift(), DOWNSHIFT),
        (interface.not_ready(), NOT_READY),
        (interface.uninitialised_mode(), UNINITIALISED_MODE),
    ];
    let of_communication = communication.into_iter().find(|(present, _)| *present).map(|(_, diagnosis)| diagnosis);
    let of_drive = ERRORS.iter().find(|(bit, _)| snapshot.class_1.contains(*bit)).map(|(_, diagnosis)| *diagnosis);
    let only_communication = snapshot.class_1 == Class1::COMMUNICATION || snapshot.class_1.is_empty();
    let error = if only_communication { of_communication.or(of_drive) } else { of_drive };
    error.unwrap_or(match snapshot.state {
        DriveState::Following => FOLLOWING,
        DriveState::Halted => HALTED,
        DriveState::SwitchingOff => SWITCHING_OFF,
        _ => match PHASES.get(usize::from(phase.number())) {
            Some(diagnosis) => *diagnosis,
            None if snapshot.conditions.power => READY,
            None => NO_POWER,
        },
    })
}
