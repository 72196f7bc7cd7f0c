//! What one communication cycle brings: supervision of MST and MDT, control word, command values.

use sercon816::Bus;
use sercos::Phase;
use sercos::diagnostic::Class1;
use sercos::phase::PhaseError;
use sercos::supervision::Reception;
use servo::{Position, Velocity};

use super::Motion;
use crate::hardware::Hardware;
use crate::record::Command;
use crate::settings::OperationMode;
use crate::state::Switches;
use crate::work::Work;

impl<B: Bus + Clone, H: Hardware> Motion<B, H> {
    /// A t3 event that is overdue by a quarter of a cycle (at least two ticks) is stood in for, so that supervision and
    /// extrapolation go on at the ring's rhythm whatever the chip does without an MST (G28).
    pub(super) fn flywheel(&mut self) -> Work {
        if self.phase < Phase::Cp3 {
            return Work::empty();
        }
        self.ticks_since_t3 = self.ticks_since_t3.saturating_add(1);
        let cycle = self.settings.ticks_per_cycle;
        let overdue = cycle.saturating_add((cycle >> 2).max(2));
        if self.ticks_since_t3 < overdue {
            return Work::empty();
        }
        self.ticks_since_t3 = self.ticks_since_t3.saturating_sub(cycle);
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
        let mut word = 0_u16;
        for command in &self.records.commands {
            let value = self.command_port.double_word(word).cast_signed();
            match command {
                Command::Velocity => self.commands.velocity = value,
                Command::Position => self.commands.position = value,
            }
            word = word.wrapping_add(2);
        }
        self.switches = Switches::from_control_word(self.commands.control_word);
        let mode = self.requested_mode();
        if mode.is_none() && !self.uninitialised_mode {
            self.uninitialised_mode = true;
            self.lose(PhaseError::UninitialisedMode);
            return Work::PHASE_CHANGE;
        }
        self.mode = mode;
        self.refuse_a_jump();
        self.update_state();
        self.cycles_since_command = self.cycles_since_command.saturating_add(1);
        // A control unit slower than the ring repeats its values; a repeated value is no new point of the path.
        let fresh = (before.position, before.velocity) != (self.commands.position, self.commands.velocity);
        if fresh || self.cycles_since_command >= self.settings.cycles_per_command {
            self.cycles_since_command = 0;
            self.axis.command_position(self.commanded_position());
            self.axis.command_velocity(self.commanded_velocity());
        }
        Work::empty()
    }

    fn commanded_velocity(&self) -> Velocity {
        let velocity = self.settings.velocity.to_velocity(self.commands.velocity);
        if self.settings.velocity_polarity.command { -velocity } else { velocity }
    }

    /// The mode of control word bits 11, 9, 8.
    fn requested_mode(&self) -> Option<OperationMode> {
        let word = self.commands.control_word;
        let selected = ((word & 0x0800) >> 9) | ((word & 0x0300) >> 8);
        self.settings.modes.get(usize::from(selected)).copied().flatten()
    }

    fn commanded_position(&self) -> Position {
        let position = self.settings.position.to_position(self.commands.position);
        match (self.settings.position_polarity.command, self.axis.settings().interpolator().modulo()) {
            (false, _) => position,
            (true, None) => -position,
            (true, Some(modulo)) => modulo.value() - position,
        }
    }

    /// A drive that is switched on far from its command would jump: the deviation is a fault before there is torque.
    fn refuse_a_jump(&mut self) {
        let starting = !self.machine.state().has_torque() && self.switches.on && self.switches.enable;
        let window = self.settings.monitoring_window;
        if !starting || self.mode == Some(OperationMode::Velocity) || window == Position::ZERO {
            return;
        }
        let mut distance = self.commanded_position() - self.axis.cyclic_position(self.encoder.position());
        if let Some(modulo) = self.axis.settings().interpolator().modulo() {
            let range = modulo.value();
            let half = Position::from_bits(range.to_bits() >> 1);
            if distance > half {
                distance = distance - range;
            } else if distance < -half {
                distance = distance + range;
            }
        }
        if distance.abs() > window {
            self.class_1 |= Class1::EXCESSIVE_DEVIATION;
        }
    }

    fn lose(&mut self, error: PhaseError) {
        self.lost = Some(error);
        self.class_1 |= Class1::COMMUNICATION;
        self.update_state();
    }
}
