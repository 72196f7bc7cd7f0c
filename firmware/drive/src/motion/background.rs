//! What the tasks of low priority ask of the motor side, each under one short lock.

use sercon816::Bus;
use sercos::Phase;
use sercos::diagnostic::Class1;
use sercos::phase::PhaseError;
use servo::{Axis, Encoder, LoopClock};

use super::{CommandValues, Motion};
use crate::hardware::Hardware;
use crate::record::{Command, Records};
use crate::settings::MotionSettings;
use crate::snapshot::Snapshot;
use crate::state::Switches;

impl<B: Bus + Clone, H: Hardware> Motion<B, H> {
    /// Enters a communication phase that the slave has accepted.
    ///
    /// CP3 clears the supervision and fills the AT record, so that the first AT is complete. Every phase below CP4 takes the
    /// command values away: a motor that runs is stopped.
    pub fn enter_phase(&mut self, phase: Phase) {
        self.phase = phase;
        self.switches = Switches::default();
        self.commands = CommandValues::default();
        self.uninitialised_mode = false;
        self.ticks_since_t3 = 0;
        self.cycles_since_command = 0;
        self.entered_cyclic = phase == Phase::Cp3;
        match phase {
            Phase::Cp3 => {
                self.mst.restart();
                let _ = self.command_port.take_cyclic();
                self.supervision.clear();
                self.clock = LoopClock::new(self.settings.clock);
                self.latch_now();
                self.capture_feedback();
            }
            Phase::Cp4 => self.mode = self.settings.modes.first().copied().flatten(),
            _ => self.supervision.end_bursts(),
        }
        self.update_state();
    }

    /// Which values the cyclic records carry; before CP3.
    pub fn set_records(&mut self, records: Records) {
        self.records = records;
    }

    /// Settings from changed parameters. Another encoder resolution starts the position at zero again.
    pub fn apply_settings(&mut self, settings: MotionSettings) {
        let encoder = settings.encoder != self.settings.encoder;
        let clock = settings.clock != self.settings.clock;
        self.settings = settings;
        if clock {
            self.clock = LoopClock::new(settings.clock);
        }
        if encoder {
            self.encoder = Encoder::new(settings.encoder, self.hardware.encoder_count());
            self.axis = Axis::new(settings.with_lag, self.encoder.position());
        }
        self.apply_axis_settings();
    }

    /// The error that supervision has found, once.
    pub fn take_loss(&mut self) -> Option<PhaseError> {
        self.lost.take()
    }

    /// A communication error found elsewhere (an illegal phase): C1D bit 12 and best possible deceleration.
    pub fn communication_fault(&mut self) {
        self.class_1 |= Class1::COMMUNICATION;
        self.update_state();
    }

    /// S-0-0014 and S-0-0390, for the AT.
    pub fn set_diagnostics(&mut self, interface_status: u16, diagnostic_number: u16) {
        self.interface_status = interface_status;
        self.diagnostic_number = diagnostic_number;
    }

    /// S-0-0099: clears C1D unless a cause is still there or the error reaction still runs.
    ///
    /// Returns whether the drive is free of errors now.
    pub fn reset_class_1(&mut self) -> bool {
        let reacting = self.machine.state().has_torque() && !self.class_1.is_empty();
        if reacting || self.amplifier.fault {
            return false;
        }
        self.class_1 = Class1::empty();
        self.fatal = false;
        self.update_state();
        true
    }

    /// Asks for [`Work::SERVICE_CHANNEL`] when the loop clock has locked to the ring, or after so many loop ticks without.
    pub fn wait_for_lock(&mut self, ticks: u16) {
        self.lock_patience = ticks;
    }

    /// Whether the loops run in a fixed phase to the ring.
    pub fn is_synchronised(&self) -> bool {
        self.clock.is_locked()
    }

    /// What the service channel may ask for.
    pub fn snapshot(&mut self) -> Snapshot {
        if self.phase < Phase::Cp3 {
            self.refresh_values(self.encoder.position());
        }
        Snapshot {
            state: self.machine.state(),
            conditions: self.conditions(),
            class_1: self.class_1,
            class_3: self.class_3,
            status_word: self.status_word(),
            commands: self.commands,
            values: self.values,
            mst_errors: self.supervision.mst_errors(),
            mdt_errors: self.supervision.mdt_errors(),
        }
    }

    /// Ends the change bit of C3D: the master has read S-0-0013.
    pub fn clear_class_3_change(&mut self) {
        self.class_3_change = false;
    }

    /// S-0-0036 and S-0-0047 over the service channel, while they are not cyclic.
    pub fn set_command(&mut self, command: Command, value: i32) {
        match command {
            Command::Velocity => self.commands.velocity = value,
            Command::Position => self.commands.position = value,
        }
    }
}
