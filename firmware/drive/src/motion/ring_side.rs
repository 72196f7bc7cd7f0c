//! The cyclic half of the bus: what one communication cycle brings, what is lost of it, what it takes along.

use sercon816::layout::MST_ERRORS;
use sercon816::{Bus, CommandPort, FeedbackPort};
use sercos::Phase;
use sercos::loss_counter::{LossCounter, Reception};
use sercos::phase::PhaseError;
use servo::units::{CurrentFraction, Position, Velocity};

use crate::limits::CyclicLimits;
use crate::operation_mode::Polarity;
use crate::settings::MotionSettings;
use crate::signal::command::{Command, CommandValue, CommandValues};
use crate::signal::feedback::Feedback;
use crate::signal::record::{Datum, Records};
use crate::state::ERROR_BIT;

/// So long a lost telegram is a warning, in ticks of the supervision: one second.
const LOSS_SHOWN_TICKS: u16 = 2_000;

// Bits of [`RingSide::passed_on`]: S-0-0258 and S-0-0145.
const TARGET: u8 = 1 << 0;
const SIGNALS: u8 = 1 << 1;

impl CommandValues {
    /// S-0-0036 with S-0-0037.
    #[inline]
    pub(super) fn velocity(&self, settings: &MotionSettings) -> Velocity {
        let Polarity { command, additive, .. } = settings.velocity_polarity;
        let signed = |value: i32, reversed: bool| {
            // Most drives have no additive command, and many none of a velocity.
            if value == 0 {
                return Velocity::ZERO;
            }
            let velocity = settings.velocity.to_velocity(value);
            if reversed { -velocity } else { velocity }
        };
        signed(self.velocity, command) + signed(self.additive_velocity, additive)
    }

    /// S-0-0080 with S-0-0081.
    #[inline]
    pub(super) fn torque(&self, settings: &MotionSettings) -> CurrentFraction {
        let Polarity { command, additive, .. } = settings.torque_polarity;
        let signed = |value: i16, reversed: bool| i64::from(value).wrapping_mul(if reversed { -1 } else { 1 });
        let sum = signed(self.torque, command).wrapping_add(signed(self.additive_torque, additive));
        settings.torque.current_of(sum)
    }

    /// S-0-0047 with S-0-0048, within `0 ..` range of the data.
    #[inline]
    pub(super) fn position(&self, settings: &MotionSettings) -> Position {
        let coordinates = &settings.coordinates;
        coordinates.range.reduce(coordinates.place(self.position) + self.additive_position(settings))
    }

    /// S-0-0048, with bit 1 of S-0-0055.
    #[inline]
    pub(super) fn additive_position(&self, settings: &MotionSettings) -> Position {
        let value = self.additive_position;
        // Most drives have no additive command.
        if value == 0 {
            return Position::ZERO;
        }
        let position = settings.position.to_position(value);
        if settings.position_polarity.additive { -position } else { position }
    }
}

/// What a communication cycle was.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Cycle {
    /// One with commands for the drive.
    WithCommands,
    /// One without: before CP4, or its MDT was lost.
    WithoutCommands,
    /// One too many without telegrams.
    Lost(PhaseError),
}

/// Telegrams of the cycle, and the phase in which they come.
#[derive(Debug)]
pub(super) struct RingSide<B> {
    phase: Phase,
    /// CP3 was entered in this cycle.
    entered_cyclic: bool,
    /// Cycles since a command value was last handed to the axis.
    cycles_since_command: u16,
    /// What the MDT carries that somebody else has to act on, a bit each.
    passed_on: u8,
    command_port: CommandPort<B>,
    feedback_port: FeedbackPort<B>,
    mst: MstMonitor<B>,
    losses: LossCounter,
    /// The error that has ended the phase, until it is told.
    lost: Option<PhaseError>,
    /// Ticks of the supervision for which a lost telegram is still a warning.
    loss_shown: u16,
    commands: CommandValues,
    records: Records,
}

impl<B: Bus + Clone> RingSide<B> {
    /// In CP0, with nothing received.
    pub(super) fn new(bus: B, address: u8) -> Self {
        Self {
            phase: Phase::Cp0,
            entered_cyclic: false,
            cycles_since_command: 0,
            passed_on: 0,
            command_port: CommandPort::new(bus.clone(), address),
            feedback_port: FeedbackPort::new(bus.clone()),
            mst: MstMonitor::new(bus),
            losses: LossCounter::new(),
            lost: None,
            loss_shown: 0,
            commands: CommandValues::default(),
            records: Records::default(),
        }
    }

    /// Enters a communication phase. CP3 clears the counters of losses; every phase takes the command values away.
    pub(super) fn enter(&mut self, phase: Phase) {
        self.phase = phase;
        self.commands = CommandValues::default();
        self.cycles_since_command = 0;
        self.entered_cyclic = phase == Phase::Cp3;
        match phase {
            Phase::Cp3 => {
                self.mst.restart();
                let _ = self.command_port.take_cyclic();
                self.losses.clear();
            }
            Phase::Cp4 => {}
            Phase::Cp2 => {
                self.loss_shown = 0;
                self.losses.end_bursts();
            }
            _ => self.losses.end_bursts(),
        }
    }

    /// The communication phase.
    #[inline]
    pub(super) const fn phase(&self) -> Phase {
        self.phase
    }

    /// Which values the cyclic records carry; before CP3.
    pub(super) fn set_records(&mut self, records: Records) {
        let bit = |value, bit| if records.carry(value) { bit } else { 0 };
        self.passed_on = bit(CommandValue::TargetPosition, TARGET) | bit(CommandValue::SignalControl, SIGNALS);
        self.records = records;
    }

    /// The MDT carries commands that somebody else has to act on.
    #[inline]
    pub(super) const fn passes_on(&self) -> bool {
        self.passed_on != 0
    }

    /// The MDT carries S-0-0258.
    #[inline]
    pub(super) const fn carries_target(&self) -> bool {
        self.passed_on & TARGET != 0
    }

    /// The MDT carries S-0-0145.
    #[inline]
    pub(super) const fn carries_signals(&self) -> bool {
        self.passed_on & SIGNALS != 0
    }

    /// The values of the AT, one after the other.
    #[inline]
    pub(super) fn feedback(&self, index: usize) -> Option<Datum<Feedback>> {
        self.records.feedback.get(index).copied()
    }

    /// The AT's status word.
    #[inline]
    pub(super) fn show_status(&mut self, status: u16) {
        self.feedback_port.set_status(status);
    }

    /// Whether the master sees, or has seen, an error that there is now: in CP3 and CP4 the AT tells it from the next t4 on. One bus access.
    pub(super) fn shows_error(&mut self) -> bool {
        !matches!(self.phase, Phase::Cp3 | Phase::Cp4) || self.feedback_port.status() & ERROR_BIT != 0
    }

    /// One value of the AT, from this word on and so many long; returns the word after it.
    #[inline]
    pub(super) fn show(&mut self, word: u16, words: u16, value: u32) -> u16 {
        if words == 2 {
            self.feedback_port.set_double_word(word, value);
        } else {
            self.feedback_port.set_word(word, (value & 0xFFFF) as u16);
        }
        word.wrapping_add(words)
    }

    /// CP1, CP2: arms the one AT that answers an MDT to this drive.
    #[inline]
    pub(super) fn answer(&mut self) {
        let addressed = self.command_port.take_initial();
        self.command_port.answer_once(addressed);
    }

    /// CP1, CP2: the status word of that AT.
    #[inline]
    pub(super) fn show_initial_status(&mut self, status: u16) {
        self.feedback_port.set_initial_status(status);
    }

    /// The end of a communication cycle, or its time without an event: what of it has been received.
    #[inline]
    pub(super) fn take_cycle(&mut self) -> Cycle {
        let mst_missed = self.mst.take_missed();
        let received = self.command_port.take_cyclic();
        // The chip was moved to the cyclic telegrams within this cycle: what came before that says nothing.
        if core::mem::take(&mut self.entered_cyclic) {
            return Cycle::WithoutCommands;
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
        if let Err(lost) = self.losses.cycle(mst, mdt) {
            return Cycle::Lost(lost);
        }
        if self.phase == Phase::Cp4 && received { Cycle::WithCommands } else { Cycle::WithoutCommands }
    }

    /// Control word and command values of this drive's record, in their order; the limits among them go to `limits`. Returns whether there
    /// is a new point of the path among them.
    #[inline]
    pub(super) fn take_commands(&mut self, cycles_per_command: u16, limits: &mut CyclicLimits) -> bool {
        self.commands.control_word = self.command_port.control_word();
        let mut changed = false;
        let mut word = 0_u16;
        for index in 0..self.records.commands.len() {
            let Some(&Datum { signal: command, words }) = self.records.commands.get(index) else { break };
            let raw = match words {
                2 => self.command_port.double_word(word),
                _ => u32::from(self.command_port.word(word)),
            };
            changed |= self.put_command(command, raw, limits);
            word = word.wrapping_add(words);
        }
        self.cycles_since_command = self.cycles_since_command.saturating_add(1);
        // A control unit slower than the ring repeats its values; a repeated value is no new point of the path.
        let fresh = changed || self.cycles_since_command >= cycles_per_command;
        if fresh {
            self.cycles_since_command = 0;
        }
        fresh
    }

    /// One command value, of the MDT or of the service channel. Returns whether it changes the point of the path.
    #[inline]
    pub(super) fn put_command(&mut self, command: Command, raw: u32, limits: &mut CyclicLimits) -> bool {
        match command {
            Command::Value(value) => self.commands.put(value, raw),
            Command::Limit(limit) => {
                limits.take(limit, raw);
                false
            }
        }
    }

    /// The command values as they came last.
    #[inline]
    pub(super) const fn commands(&self) -> &CommandValues {
        &self.commands
    }

    /// S-0-0047 is this from now on, until the MDT says otherwise.
    pub(super) const fn replace_position(&mut self, data: i32) {
        self.commands.position = data;
    }

    /// S-0-0258 is this from now on, until the MDT says otherwise.
    pub(super) const fn replace_target(&mut self, data: i32) {
        self.commands.target_position = data;
    }

    /// The phase has ended in an error.
    #[inline]
    pub(super) const fn lose(&mut self, error: PhaseError) {
        self.lost = Some(error);
    }

    /// The phase has ended in an error that nobody has been told of.
    #[inline]
    pub(super) const fn is_lost(&self) -> bool {
        self.lost.is_some()
    }

    /// That error, once.
    pub(super) const fn take_loss(&mut self) -> Option<PhaseError> {
        self.lost.take()
    }

    /// One tick of the supervision: whether the loss of a telegram is still a warning.
    #[inline]
    pub(super) const fn shows_loss(&mut self) -> bool {
        self.loss_shown = self.loss_shown.saturating_sub(1);
        self.loss_shown > 0
    }

    /// S-0-0028 and S-0-0029.
    pub(super) const fn errors(&self) -> [u16; 2] {
        [self.losses.mst_errors(), self.losses.mdt_errors()]
    }
}

/// Watches NMSTERR, the counter of missed MSTs that the chip keeps in its RAM. Only differences count, and it begins anew with every run-up:
/// its start value and its behaviour at the end of its range are not known (G27).
#[derive(Debug)]
struct MstMonitor<B> {
    bus: B,
    counted: u16,
}

impl<B: Bus> MstMonitor<B> {
    /// A monitor that has seen nothing yet.
    const fn new(bus: B) -> Self {
        Self { bus, counted: 0 }
    }

    /// Forgets what was counted and sets the counter to 0; before the supervision of CP3 begins. One bus access.
    fn restart(&mut self) {
        self.bus.write_ram(MST_ERRORS, 0);
        self.counted = 0;
    }

    /// Whether an MST is missing in the cycle that this call stands for. One bus access.
    ///
    /// Takes one miss a call and keeps the rest for the next ones: a call that comes late (the flywheel stands in for t3
    /// when the next MST is missing already) must not make one of two.
    fn take_missed(&mut self) -> bool {
        let missed = self.bus.read_ram(MST_ERRORS) != self.counted;
        if missed {
            self.counted = self.counted.wrapping_add(1);
        }
        missed
    }
}
