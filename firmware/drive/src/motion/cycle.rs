//! What one communication cycle brings: supervision of MST and MDT, control word, command values.

use sercon816::Bus;
use sercos::Phase;
use sercos::diagnostic::Class1;
use sercos::phase::PhaseError;
use sercos::supervision::Reception;
use servo::units::{CurrentFraction, Velocity};

use super::Motion;
use crate::hardware::Hardware;
use crate::operation_mode::Polarity;
use crate::signal::command::{Command, CommandValue};
use crate::signal::record::Datum;
use crate::state::Switches;
use crate::work::Work;

/// So long a lost telegram is a warning, in ticks of the supervision: one second.
const LOSS_SHOWN_TICKS: u16 = 2_000;

/// Control word bits 11, 9, 8.
const MODE_BITS: u16 = 0x0B00;

impl<B: Bus + Clone, H: Hardware> Motion<B, H> {
    /// A t3 event that is overdue by a quarter of a cycle (at least two ticks) is stood in for, so that supervision and
    /// extrapolation go on at the ring's rhythm whatever the chip does without an MST (G28).
    #[inline]
    pub(super) fn flywheel(&mut self) -> Work {
        self.until_overdue = self.until_overdue.wrapping_sub(1);
        if self.until_overdue != 0 {
            return Work::empty();
        }
        self.until_overdue = self.settings.cycle.ticks_per_cycle;
        self.take_cycle()
    }

    /// What one communication cycle brought: supervision, control word, command values.
    pub(super) fn take_cycle(&mut self) -> Work {
        let mst_missed = self.mst.take_missed();
        let received = self.command_port.take_cyclic();
        // The chip was moved to the cyclic telegrams within this cycle: what came before that says nothing.
        if core::mem::take(&mut self.entered_cyclic) {
            return Work::empty();
        }
        let mst = if mst_missed { Reception::Failed } else { Reception::Valid };
        let mdt = match (received, mst_missed) {
            (true, _) => Reception::Valid,
            (false, false) => Reception::Failed,
            // Without an MST nobody knows when to listen for the MDT.
            (false, true) => Reception::Unknown,
        };
        if mst == Reception::Failed || mdt == Reception::Failed {
            self.loss_shown = LOSS_SHOWN_TICKS;
        }
        if let Err(lost) = self.supervision.cycle(mst, mdt) {
            self.lose(lost);
            return Work::PHASE_CHANGE;
        }
        if self.phase == Phase::Cp4 && received {
            return self.take_commands();
        }
        Work::empty()
    }

    fn take_commands(&mut self) -> Work {
        let before = self.commands;
        self.commands.control_word = self.command_port.control_word();
        self.take_record();
        self.controlled = self.settings.bits.apply_control_word(self.controlled, self.commands.control_word);
        let switches = Switches::from_control_word(self.commands.control_word);
        self.switches = Some(switches);
        let work = self.select_mode(switches);
        if self.machine.would_switch_on(switches, || self.conditions()) {
            self.look_before_switching_on();
        }
        self.update_state();
        if self.cyclic_limits.is_carried() {
            self.obey_limits();
        }
        if self.is_positioning() {
            self.position_to_target();
        }
        self.cycles_since_command = self.cycles_since_command.saturating_add(1);
        // A control unit slower than the ring repeats its values; a repeated value is no new point of the path.
        let fresh = before.path() != self.commands.path();
        if fresh || self.cycles_since_command >= self.settings.cycle.cycles_per_command {
            self.cycles_since_command = 0;
            self.axis.command_velocity(self.commanded_velocity());
            if let Err(jump) = self.axis.command_position(self.commanded_position()) {
                self.refuse(jump);
            }
        }
        // A torque command is no point of a path: nothing is interpolated.
        self.axis.command_torque(self.commanded_torque());
        work
    }

    /// Control word bits 11, 9, 8. A mode that is not set stays away; it is an error only of a control that wants the drive to switch on or
    /// to stay on (bits 15, 14).
    fn select_mode(&mut self, switches: Switches) -> Work {
        let selected = self.selected_mode();
        let mode = self.settings.modes.get(usize::from(selected)).copied().flatten();
        if mode.is_none() {
            return self.refuse_mode(selected, switches);
        }
        if mode != self.mode {
            self.change_mode(mode);
        }
        self.mode_bits = self.commands.control_word & MODE_BITS;
        self.uninitialised_mode = false;
        Work::empty()
    }

    /// The motor stops with C1D bit 12 and S-0-0014 bit 9, told once, and again after S-0-0099. The ring goes on.
    #[cold]
    fn refuse_mode(&mut self, selected: u8, switches: Switches) -> Work {
        let asked = switches.on || switches.enable;
        let told = self.uninitialised_mode && self.class_1.contains(Class1::COMMUNICATION);
        self.uninitialised_mode = asked;
        if !asked || told {
            return Work::empty();
        }
        self.lose(PhaseError::UninitialisedMode { selected });
        Work::PHASE_CHANGE
    }

    /// The command values of this drive's record, in their order.
    fn take_record(&mut self) {
        let mut word = 0_u16;
        for index in 0..self.records.commands.len() {
            let Some(&Datum { signal: command, words }) = self.records.commands.get(index) else { break };
            let raw = match words {
                2 => self.command_port.double_word(word),
                _ => u32::from(self.command_port.word(word)),
            };
            self.put_command(command, raw);
            if command == Command::Value(CommandValue::SignalControl) {
                self.apply_signal_control();
            }
            word = word.wrapping_add(words);
        }
    }

    pub(super) fn put_command(&mut self, command: Command, raw: u32) {
        let long = raw.cast_signed();
        let word = (raw & 0xFFFF) as u16;
        match command {
            Command::Value(CommandValue::Velocity) => self.commands.velocity = long,
            Command::Value(CommandValue::AdditiveVelocity) => self.commands.additive_velocity = long,
            Command::Value(CommandValue::Position) => self.commands.position = long,
            Command::Value(CommandValue::AdditivePosition) => self.commands.additive_position = long,
            Command::Value(CommandValue::Torque) => self.commands.torque = word.cast_signed(),
            Command::Value(CommandValue::AdditiveTorque) => self.commands.additive_torque = word.cast_signed(),
            Command::Value(CommandValue::SignalControl) => self.commands.signal_control = word,
            Command::Value(CommandValue::TargetPosition) => {
                self.commands.target_position = long;
                self.positioning.target_is_written();
            }
            Command::Value(CommandValue::PositioningValue) => self.commands.positioning_value = long,
            Command::Value(CommandValue::PositioningControl) => self.commands.positioning_control = word,
            Command::Limit(limit) => self.cyclic_limits.take(limit, raw),
        }
    }

    /// A command value as it is transmitted. S-0-0047 is the place where the axis is held, while homing holds it.
    pub(crate) fn command_data(&self, value: CommandValue) -> u32 {
        let commands = &self.commands;
        match value {
            CommandValue::Velocity => commands.velocity.cast_unsigned(),
            CommandValue::AdditiveVelocity => commands.additive_velocity.cast_unsigned(),
            CommandValue::Position => self.position_command_data().cast_unsigned(),
            CommandValue::AdditivePosition => commands.additive_position.cast_unsigned(),
            CommandValue::Torque => commands.torque.cast_unsigned().into(),
            CommandValue::AdditiveTorque => commands.additive_torque.cast_unsigned().into(),
            CommandValue::SignalControl => commands.signal_control.into(),
            CommandValue::TargetPosition => commands.target_position.cast_unsigned(),
            CommandValue::PositioningValue => commands.positioning_value.cast_unsigned(),
            CommandValue::PositioningControl => commands.positioning_control.into(),
        }
    }

    pub(super) fn apply_signal_control(&mut self) {
        self.controlled = self.settings.bits.apply_signal_control(self.controlled, self.commands.signal_control);
    }

    fn commanded_velocity(&self) -> Velocity {
        let Polarity { command, additive, .. } = self.settings.velocity_polarity;
        let signed = |value: i32, reversed: bool| {
            // Most drives have no additive command, and many none of a velocity.
            if value == 0 {
                return Velocity::ZERO;
            }
            let velocity = self.settings.velocity.to_velocity(value);
            if reversed { -velocity } else { velocity }
        };
        signed(self.commands.velocity, command) + signed(self.commands.additive_velocity, additive)
    }

    fn commanded_torque(&self) -> CurrentFraction {
        let Polarity { command, additive, .. } = self.settings.torque_polarity;
        let signed = |value: i16, reversed: bool| i64::from(value).wrapping_mul(if reversed { -1 } else { 1 });
        let sum = signed(self.commands.torque, command).wrapping_add(signed(self.commands.additive_torque, additive));
        self.settings.torque.current_of(sum)
    }

    /// Control word bits 11, 9, 8.
    fn selected_mode(&self) -> u8 {
        let word = self.commands.control_word;
        (((word & 0x0800) >> 9) | ((word & 0x0300) >> 8)) as u8
    }

    fn lose(&mut self, error: PhaseError) {
        self.lost = Some(error);
        self.class_1 |= Class1::COMMUNICATION;
        self.update_state();
    }
}
