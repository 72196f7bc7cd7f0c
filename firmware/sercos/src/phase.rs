//! Communication phases CP0 to CP4 and the rules for changing them.
//!
//! CP3 and CP4 need a token each, and only the transition checks ([`crate::transition`]) can make one: a phase switch
//! that was not checked cannot be written down.

use arbitrary_int::u3;
use bitbybit::bitfield;
use core::fmt;

/// A communication phase.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Phase {
    /// Closing the ring: the slave only repeats.
    #[default]
    Cp0 = 0,
    /// Identification: the slave answers when it is addressed.
    Cp1 = 1,
    /// Service channel without cyclic data.
    Cp2 = 2,
    /// Cyclic telegrams, command values not yet valid.
    Cp3 = 3,
    /// Normal operation.
    Cp4 = 4,
}

impl Phase {
    /// The phase that an MST announces in bits 2 to 0 of its data byte; `None` for 5 to 7.
    /// The other bits were always 0 in the recordings and are ignored (sercos2.md 1.3).
    pub const fn from_mst_data(data: u8) -> Option<Self> {
        match data & 7 {
            0 => Some(Phase::Cp0),
            1 => Some(Phase::Cp1),
            2 => Some(Phase::Cp2),
            3 => Some(Phase::Cp3),
            4 => Some(Phase::Cp4),
            _ => None,
        }
    }

    /// 0 to 4.
    pub const fn number(self) -> u8 {
        self as u8
    }
}

impl fmt::Display for Phase {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "CP{}", self.number())
    }
}

/// Proof that S-0-0127 was passed; made by [`crate::transition::check_cp3`] only.
///
/// ```compile_fail,E0423
/// let forged = sercos::phase::ReadyForCp3(());
/// ```
#[derive(Debug, PartialEq, Eq)]
pub struct ReadyForCp3(());

/// Proof that S-0-0128 was passed; made by [`crate::transition::check_cp4`] only.
///
/// ```compile_fail,E0423
/// let forged = sercos::phase::ReadyForCp4(());
/// ```
#[derive(Debug, PartialEq, Eq)]
pub struct ReadyForCp4(());

impl ReadyForCp3 {
    pub(crate) const fn new() -> Self {
        Self(())
    }
}

impl ReadyForCp4 {
    pub(crate) const fn new() -> Self {
        Self(())
    }
}

/// What an MST means for the slave.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum PhaseChange {
    /// Nothing to do.
    Unchanged,
    /// The slave is now in phase `to` and has to configure itself for it.
    Entered {
        /// Phase until now.
        from: Phase,
        /// Phase from now on.
        to: Phase,
    },
}

/// An error of communication: the bits of S-0-0014 (sercos2.md 2.4). All but [`PhaseError::UninitialisedMode`] end in CP0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum PhaseError {
    /// Bit 3: two MSTs in a row failed.
    MstFailure,
    /// Bit 4: two MDTs in a row failed.
    MdtFailure,
    /// Bits 3 and 4: both failed twice, probably no light.
    LightLoss,
    /// Bit 5: the MST announced phase 5, 6 or 7.
    InvalidPhase {
        /// Bits 2 to 0 of the MST.
        received: u8,
    },
    /// Bit 6: a phase was skipped upwards.
    Upshift {
        /// Phase of the slave.
        from: Phase,
        /// Phase of the MST.
        to: Phase,
    },
    /// Bit 7: a step back to another phase than CP0.
    Downshift {
        /// Phase of the slave.
        from: Phase,
        /// Phase of the MST.
        to: Phase,
    },
    /// Bit 8: CP3 or CP4 without a positive S-0-0127 or S-0-0128.
    NotReady {
        /// Phase of the MST.
        to: Phase,
    },
    /// Bit 9: switched to an operation mode that is not initialised.
    UninitialisedMode {
        /// Control word bits 11, 9, 8: 0 to 7, an index of [`crate::transition::OPERATION_MODES`].
        selected: u8,
    },
}

impl fmt::Display for PhaseError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            PhaseError::MstFailure => f.write_str("two consecutive MSTs failed"),
            PhaseError::MdtFailure => f.write_str("two consecutive MDTs failed"),
            PhaseError::LightLoss => f.write_str("two consecutive MSTs and MDTs failed: no light?"),
            PhaseError::InvalidPhase { received } => write!(f, "invalid phase {received} in the MST"),
            PhaseError::Upshift { from, to } => write!(f, "phase skipped: {from} to {to}"),
            PhaseError::Downshift { from, to } => write!(f, "step back from {from} to {to}, only CP0 is allowed"),
            PhaseError::NotReady { to } => write!(f, "switched to {to} without a positive transition check"),
            PhaseError::UninitialisedMode { selected } => {
                write!(f, "switched to operation mode {selected}, which is not initialised")
            }
        }
    }
}

impl core::error::Error for PhaseError {}

/// S-0-0014, interface status (sercos2.md 2.4).
///
/// Bit 10, another drive with the same address, stays 0: both answer in the same instant, and a station that sends does not listen. The
/// master sees it by an arrangement (S-0-0096) or a number of drives that is not what it expects.
#[bitfield(u16, default = 0)]
#[derive(PartialEq, Eq, Debug)]
pub struct InterfaceStatus {
    /// Bits 2 to 0: communication phase, frozen at the first error.
    #[bits(0..=2, rw)]
    phase: u3,
    /// Bit 3: MST failure.
    #[bit(3, rw)]
    mst_failure: bool,
    /// Bit 4: MDT failure.
    #[bit(4, rw)]
    mdt_failure: bool,
    /// Bit 5: invalid phase.
    #[bit(5, rw)]
    invalid_phase: bool,
    /// Bit 6: error in phase upshift.
    #[bit(6, rw)]
    upshift: bool,
    /// Bit 7: error in phase downshift.
    #[bit(7, rw)]
    downshift: bool,
    /// Bit 8: phase switch without ready acknowledgement.
    #[bit(8, rw)]
    not_ready: bool,
    /// Bit 9: switch to an uninitialised operation mode.
    #[bit(9, rw)]
    uninitialised_mode: bool,
}

impl InterfaceStatus {
    /// True if any of the error bits is set; C1D bit 12 follows it.
    pub const fn has_error(self) -> bool {
        self.raw_value() & !7 != 0
    }

    const fn with_error(self, error: PhaseError) -> Self {
        match error {
            PhaseError::MstFailure => self.with_mst_failure(true),
            PhaseError::MdtFailure => self.with_mdt_failure(true),
            PhaseError::LightLoss => self.with_mst_failure(true).with_mdt_failure(true),
            PhaseError::InvalidPhase { .. } => self.with_invalid_phase(true),
            PhaseError::Upshift { .. } => self.with_upshift(true),
            PhaseError::Downshift { .. } => self.with_downshift(true),
            PhaseError::NotReady { .. } => self.with_not_ready(true),
            PhaseError::UninitialisedMode { .. } => self.with_uninitialised_mode(true),
        }
    }
}

/// The slave's communication phase (sercos2.md 2.2).
///
/// Starts in CP0 and waits for an MST that announces CP0 before it follows the master: a drive that is switched on in a
/// running ring has done nothing wrong. The same wait follows every error, because the master goes on with its phase
/// until it notices.
#[derive(Debug, Default)]
pub struct PhaseMachine {
    current: Phase,
    /// An MST with phase 0 was seen since the start or the last error.
    follows_master: bool,
    cp3_permitted: bool,
    cp4_permitted: bool,
    /// Error bits and the phase of the first error, until [`PhaseMachine::clear_error`].
    error: Option<InterfaceStatus>,
}

impl PhaseMachine {
    /// In CP0, waiting for the master's CP0.
    pub const fn new() -> Self {
        Self { current: Phase::Cp0, follows_master: false, cp3_permitted: false, cp4_permitted: false, error: None }
    }

    /// The slave's phase.
    pub const fn current(&self) -> Phase {
        self.current
    }

    /// S-0-0014.
    pub const fn interface_status(&self) -> InterfaceStatus {
        match self.error {
            Some(status) => status,
            None => InterfaceStatus::DEFAULT.with_phase(phase_bits(self.current)),
        }
    }

    /// Takes the data byte of an MST.
    ///
    /// # Errors
    /// The switch is not allowed: the slave is in CP0 now, sends no AT, and S-0-0014 shows the error.
    pub fn received(&mut self, mst_data: u8) -> Result<PhaseChange, PhaseError> {
        let announced = Phase::from_mst_data(mst_data);
        if !self.follows_master {
            self.follows_master = announced == Some(Phase::Cp0);
            return Ok(PhaseChange::Unchanged);
        }
        let from = self.current;
        let Some(to) = announced else {
            return Err(self.fail(PhaseError::InvalidPhase { received: mst_data & 7 }));
        };
        let allowed = match (from, to) {
            (from, to) if from == to => return Ok(PhaseChange::Unchanged),
            (_, Phase::Cp0) | (Phase::Cp0, Phase::Cp1) | (Phase::Cp1, Phase::Cp2) => true,
            (Phase::Cp2, Phase::Cp3) => self.cp3_permitted,
            (Phase::Cp3, Phase::Cp4) => self.cp4_permitted,
            (from, to) if to < from => return Err(self.fail(PhaseError::Downshift { from, to })),
            (from, to) => return Err(self.fail(PhaseError::Upshift { from, to })),
        };
        if !allowed {
            return Err(self.fail(PhaseError::NotReady { to }));
        }
        self.current = to;
        self.withdraw();
        Ok(PhaseChange::Entered { from, to })
    }

    /// Latches a positive S-0-0127: the master may switch to CP3, however much later. Only has an effect in CP2.
    pub fn permit_cp3(&mut self, _proof: ReadyForCp3) {
        self.cp3_permitted = self.current == Phase::Cp2;
    }

    /// Latches a positive S-0-0128: the master may switch to CP4. Only has an effect in CP3.
    pub fn permit_cp4(&mut self, _proof: ReadyForCp4) {
        self.cp4_permitted = self.current == Phase::Cp3;
    }

    /// Drops what was permitted: a parameter that the check looked at was rewritten, or a later check failed.
    pub fn withdraw(&mut self) {
        self.cp3_permitted = false;
        self.cp4_permitted = false;
    }

    /// True if an MST with the next phase would be accepted in CP2 (CP3) or CP3 (CP4).
    pub const fn is_permitted(&self) -> bool {
        self.cp3_permitted || self.cp4_permitted
    }

    /// Falls back to CP0 with an error and hands the error back.
    ///
    /// The error bits add up until [`PhaseMachine::clear_error`]; the phase in S-0-0014 is that of the first one.
    pub fn fail(&mut self, error: PhaseError) -> PhaseError {
        self.note(error);
        self.current = Phase::Cp0;
        self.follows_master = false;
        self.withdraw();
        error
    }

    /// Shows an error that does not end the phase, [`PhaseError::UninitialisedMode`].
    pub fn note(&mut self, error: PhaseError) {
        self.error = Some(self.interface_status().with_error(error));
    }

    /// S-0-0099: forgets the error. Legal in every phase; a drive in CP0 needs no help of it to run up again.
    pub fn clear_error(&mut self) {
        self.error = None;
    }
}

const fn phase_bits(phase: Phase) -> u3 {
    match phase {
        Phase::Cp0 => u3::new(0),
        Phase::Cp1 => u3::new(1),
        Phase::Cp2 => u3::new(2),
        Phase::Cp3 => u3::new(3),
        Phase::Cp4 => u3::new(4),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn machine_in(phase: Phase) -> PhaseMachine {
        let mut machine = PhaseMachine::new();
        machine.received(0).unwrap();
        for number in 1..=phase.number() {
            if number == 3 {
                machine.permit_cp3(ReadyForCp3::new());
            }
            if number == 4 {
                machine.permit_cp4(ReadyForCp4::new());
            }
            machine.received(number).unwrap();
        }
        assert_eq!(machine.current(), phase);
        machine
    }

    const PHASES: [Phase; 5] = [Phase::Cp0, Phase::Cp1, Phase::Cp2, Phase::Cp3, Phase::Cp4];

    #[test]
    fn each_of_the_two_permissions_is_one_until_it_is_used_or_withdrawn() {
        let mut machine = machine_in(Phase::Cp2);
        assert!(!machine.is_permitted());
        machine.permit_cp3(ReadyForCp3::new());
        assert!(machine.is_permitted());
        machine.received(3).unwrap();
        assert!(!machine.is_permitted());
        machine.permit_cp4(ReadyForCp4::new());
        assert!(machine.is_permitted());
        machine.withdraw();
        assert!(!machine.is_permitted());
    }

    #[test]
    fn an_invalid_phase_is_told_as_it_came_without_the_other_bits() {
        for (data, received) in [(5, 5), (7, 7), (0xFE, 6)] {
            let mut machine = machine_in(Phase::Cp2);
            assert_eq!(machine.received(data), Err(PhaseError::InvalidPhase { received }));
        }
    }

    #[test]
    fn every_error_says_in_words_what_it_is() {
        use std::string::ToString;
        let step = PhaseError::Downshift { from: Phase::Cp4, to: Phase::Cp1 };
        assert_eq!(step.to_string(), "step back from CP4 to CP1, only CP0 is allowed");
        assert_eq!(PhaseError::InvalidPhase { received: 6 }.to_string(), "invalid phase 6 in the MST");
    }

    #[test]
    fn a_status_without_error_bits_has_no_error_and_every_bit_from_3_up_is_one() {
        assert!(!InterfaceStatus::new_with_raw_value(7).has_error());
        for bit in 3..=9 {
            assert!(InterfaceStatus::new_with_raw_value(1 << bit).has_error(), "{bit}");
        }
    }

    #[test]
    fn without_permission_every_pair_of_phases_ends_as_the_table_says() {
        for from in PHASES {
            for received in 0..8u8 {
                let mut machine = machine_in(from);
                let result = machine.received(received);
                let expected_bit = match (from.number(), received) {
                    (a, b) if a == b => None,
                    (_, 0) | (0, 1) | (1, 2) => None,
                    (2, 3) | (3, 4) => Some(8),
                    (_, 5..) => Some(5),
                    (a, b) if b < a => Some(7),
                    _ => Some(6),
                };
                match expected_bit {
                    None => {
                        assert!(result.is_ok(), "{from} {received}");
                        assert_eq!(machine.current().number(), received);
                        assert_eq!(machine.interface_status().raw_value(), u16::from(received));
                    }
                    Some(bit) => {
                        assert!(result.is_err(), "{from} {received}");
                        assert_eq!(machine.current(), Phase::Cp0);
                        assert_eq!(machine.interface_status().raw_value(), (1 << bit) | u16::from(from.number()));
                    }
                }
            }
        }
    }

    #[test]
    fn a_permission_survives_until_the_phase_changes_or_it_is_withdrawn() {
        let mut machine = machine_in(Phase::Cp2);
        machine.permit_cp3(ReadyForCp3::new());
        for _ in 0..200 {
            assert_eq!(machine.received(2), Ok(PhaseChange::Unchanged));
        }
        assert_eq!(machine.received(3), Ok(PhaseChange::Entered { from: Phase::Cp2, to: Phase::Cp3 }));
        assert_eq!(machine.received(4), Err(PhaseError::NotReady { to: Phase::Cp4 }));

        let mut machine = machine_in(Phase::Cp2);
        machine.permit_cp3(ReadyForCp3::new());
        machine.withdraw();
        assert_eq!(machine.received(3), Err(PhaseError::NotReady { to: Phase::Cp3 }));
    }

    #[test]
    fn a_permission_does_not_survive_a_new_run_up() {
        let mut machine = machine_in(Phase::Cp2);
        machine.permit_cp3(ReadyForCp3::new());
        for phase in [0, 1, 2] {
            machine.received(phase).unwrap();
        }
        assert_eq!(machine.received(3), Err(PhaseError::NotReady { to: Phase::Cp3 }));
    }

    #[test]
    fn a_permission_given_in_the_wrong_phase_is_void() {
        let mut machine = machine_in(Phase::Cp1);
        machine.permit_cp3(ReadyForCp3::new());
        machine.permit_cp4(ReadyForCp4::new());
        assert!(!machine.is_permitted());
        machine.received(2).unwrap();
        assert!(machine.received(3).is_err());
    }

    #[test]
    fn after_an_error_the_slave_waits_for_cp0_and_the_error_stays_until_reset() {
        let mut machine = machine_in(Phase::Cp4);
        machine.fail(PhaseError::LightLoss);
        for _ in 0..10 {
            assert_eq!(machine.received(4), Ok(PhaseChange::Unchanged));
        }
        assert_eq!(machine.interface_status().raw_value(), 0b1_1100);
        machine.received(0).unwrap();
        machine.received(1).unwrap();
        machine.received(2).unwrap();
        assert_eq!(machine.interface_status().raw_value(), 0b1_1100);
        machine.clear_error();
        assert_eq!(machine.interface_status().raw_value(), 2);
    }

    #[test]
    fn errors_add_up_and_the_phase_is_that_of_the_first() {
        let mut machine = machine_in(Phase::Cp4);
        machine.fail(PhaseError::MstFailure);
        machine.received(0).unwrap();
        machine.received(1).unwrap();
        assert!(machine.received(3).is_err());
        assert_eq!(machine.interface_status().raw_value(), 0b100_1100);
    }

    #[test]
    fn a_drive_that_is_switched_on_in_a_running_ring_waits_without_an_error() {
        let mut machine = PhaseMachine::new();
        assert_eq!(machine.received(4), Ok(PhaseChange::Unchanged));
        assert_eq!(machine.current(), Phase::Cp0);
        assert!(!machine.interface_status().has_error());
    }

    proptest! {
        #[test]
        fn no_sequence_of_msts_reaches_cp3_without_a_token(stream in prop::collection::vec(0u8..=255, 0..200)) {
            let mut machine = PhaseMachine::new();
            for data in stream {
                let _ = machine.received(data);
                prop_assert!(machine.current() <= Phase::Cp2);
            }
        }
    }
}
