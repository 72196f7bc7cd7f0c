//! The control word of the MDT record and the status word of the AT.

use arbitrary_int::u3;
use bitbybit::{bitenum, bitfield};

/// First word of the MDT record, mirrored in S-0-0134 (sercos2.md 1.6).
///
/// The low byte belongs to the service channel; a ring controller with a hardware service channel consumes it.
#[bitfield(u16, default = 0)]
#[derive(PartialEq, Eq, Debug)]
pub struct ControlWord {
    /// Bit 15, Drive ON. Falling: best possible deceleration, then torque off. Rising, with `enable`: torque on.
    #[bit(15, rw)]
    drive_on: bool,
    /// Bit 14, Drive ENABLE. Falling: torque off at once.
    #[bit(14, rw)]
    enable: bool,
    /// Bit 13, HALT/restart, false = halt: the drive stops with its own ramp and ignores the command values.
    #[bit(13, rw)]
    not_halt: bool,
    /// Bits 11, 9, 8 in this weight order: requested operation mode, 0 primary, 1 to 7 secondary.
    #[bits([8..=9, 11], rw)]
    operation_mode: u3,
    /// Bit 10, toggles once per control-unit cycle; several masters never toggle it.
    #[bit(10, rw)]
    control_unit_synchronisation: bool,
    /// Bit 7, real-time control bit 2.
    #[bit(7, rw)]
    real_time_2: bool,
    /// Bit 6, real-time control bit 1.
    #[bit(6, rw)]
    real_time_1: bool,
    /// Bits 5 to 3: service-channel element, 0 to 7.
    #[bits(3..=5, rw)]
    element: u3,
    /// Bit 2: last transmission of this element.
    #[bit(2, rw)]
    end: bool,
    /// Bit 1, L/S: the master writes.
    #[bit(1, rw)]
    write: bool,
    /// Bit 0, MHS: the master's handshake, toggles with each step.
    #[bit(0, rw)]
    handshake: bool,
}

impl ControlWord {
    /// Bits 15 to 13 all set: the drive is to follow its command values.
    pub const fn follows_commands(self) -> bool {
        self.drive_on() && self.enable() && self.not_halt()
    }
}

/// Bits 15 and 14 of the status word.
#[bitenum(u2, exhaustive = true)]
#[derive(PartialEq, Eq, Debug)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Readiness {
    /// Internal checks are not finished.
    NotReady = 0,
    /// The logic is ready for main power.
    ReadyForPower = 1,
    /// Main power is applied; free of torque.
    ReadyForOperation = 2,
    /// In operation, torque is active.
    InOperation = 3,
}

/// First word of the AT, mirrored in S-0-0135 (sercos2.md 1.7).
#[bitfield(u16, default = 0)]
#[derive(PartialEq, Eq, Debug)]
pub struct StatusWord {
    /// Bits 15 and 14: ready to operate.
    #[bits(14..=15, rw)]
    readiness: Readiness,
    /// Bit 13: drive shut-down error (C1D is not zero), latched until S-0-0099 succeeds.
    #[bit(13, rw)]
    shut_down_error: bool,
    /// Bit 12: an unmasked bit of S-0-0012 changed.
    #[bit(12, rw)]
    class_2_change: bool,
    /// Bit 11: an unmasked bit of S-0-0013 changed.
    #[bit(11, rw)]
    class_3_change: bool,
    /// Bits 10 to 8: actual operation mode, 0 primary, 1 to 7 secondary.
    #[bits(8..=10, rw)]
    operation_mode: u3,
    /// Bit 7, real-time status bit 2.
    #[bit(7, rw)]
    real_time_2: bool,
    /// Bit 6, real-time status bit 1.
    #[bit(6, rw)]
    real_time_1: bool,
    /// Bit 5: a procedure command has ended (sercos2.md 3.6).
    #[bit(5, rw)]
    command_change: bool,
    /// Bit 3: the drive follows the cyclic command values.
    #[bit(3, rw)]
    follows_commands: bool,
    /// Bit 2: service-channel error, the INFO word holds its code.
    #[bit(2, rw)]
    service_error: bool,
    /// Bit 1: the step is being processed.
    #[bit(1, rw)]
    busy: bool,
    /// Bit 0, AHS: the drive's handshake.
    #[bit(0, rw)]
    handshake: bool,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_recorded_drive_on_word_reads_as_on_enabled_not_halted_and_closed_channel() {
        let word = ControlWord::new_with_raw_value(0xE007);
        assert!(word.follows_commands());
        assert_eq!(word.operation_mode(), u3::new(0));
        assert_eq!((word.element(), word.end(), word.write(), word.handshake()), (u3::new(0), true, true, true));
    }

    #[test]
    fn the_operation_mode_skips_bit_10() {
        let word = ControlWord::DEFAULT.with_operation_mode(u3::new(0b101));
        assert_eq!(word.raw_value(), 0x0900);
        assert_eq!(ControlWord::new_with_raw_value(0x0400).operation_mode(), u3::new(0));
    }

    #[test]
    fn the_recorded_status_words_read_as_power_missing_and_power_applied() {
        let missing = StatusWord::new_with_raw_value(0x5801);
        assert_eq!(missing.readiness(), Readiness::ReadyForPower);
        assert!(missing.class_2_change() && missing.class_3_change() && missing.handshake());
        assert!(!missing.shut_down_error());
        assert_eq!(StatusWord::new_with_raw_value(0x9801).readiness(), Readiness::ReadyForOperation);
    }
}
