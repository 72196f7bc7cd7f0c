//! What the drive is told to do and what it does: switches, operation mode, state machine, and the bridge that follows from them.

use servo::axis::Mode;

use super::function::Function;
use crate::diagnosis::faults::Findings;
use crate::diagnosis::words::Manufacturer1;
use crate::hardware::{Hardware, Inputs};
use crate::operation_mode::{OperationMode, Reaction};
use crate::state::{Conditions, DriveState, StateMachine, Switches};
use servo::motor::{Sequence, SequenceOutput};

/// So long the two channels of safe torque off may differ, in ticks of the supervision: relays do not switch at the same instant.
const CHANNELS_DIFFER_TICKS: u16 = 200;

/// Control word bits 11, 9, 8.
const MODE_BITS: u16 = 0x0B00;

/// The one owner of what state the drive is in.
///
/// Laid out as declared: what every loop tick touches comes first.
#[repr(C)]
#[derive(Debug, Default)]
pub(super) struct Operation {
    machine: StateMachine,
    /// The bridge as it was last set.
    bridge_on: bool,
    /// Switching on, or off, is done.
    released: bool,
    torque_off: bool,
    /// Of the last MDT; `None` until one has come in this phase.
    switches: Option<Switches>,
    mode: Option<OperationMode>,
    /// Control word bits 11, 9, 8 of the mode in force.
    mode_bits: u16,
    /// Ticks of the supervision for which the two channels of safe torque off have differed.
    channels_differ: u16,
    /// The control asks for a mode that is not set.
    uninitialised_mode: bool,
}

/// What came of the control word's bits 11, 9, 8.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Selection {
    /// The mode stays as it is.
    Kept,
    /// Another one is to be put into force.
    Changed(Option<OperationMode>),
    /// It is not set: the one before stays.
    Missing {
        /// Its number, 0 to 7.
        selected: u8,
    },
}

impl Operation {
    /// A communication phase begins: there are no switches until its first MDT.
    pub(super) const fn enter_phase(&mut self) {
        self.switches = None;
        self.uninitialised_mode = false;
        self.mode_bits = 0;
    }

    /// The state.
    #[inline]
    pub(super) const fn state(&self) -> DriveState {
        self.machine.state()
    }

    /// An MDT of this phase has brought switches.
    #[inline]
    pub(super) const fn has_switches(&self) -> bool {
        self.switches.is_some()
    }

    /// The control lets the drive follow.
    pub(super) fn may_run(&self) -> bool {
        self.switches.is_some_and(|switches| switches.run)
    }

    /// The control asks for torque: bits 15 and 14 of an MDT of this CP4.
    #[inline]
    pub(super) fn wants_torque(&self) -> bool {
        self.switches.is_some_and(|switches| switches.on && switches.enable)
    }

    /// A stop is under way that the control or an error has asked for, and the control has not asked for torque again since. The main
    /// contactor may open then: an emergency stop circuit does it.
    pub(super) fn is_stopping(&self, error: bool) -> bool {
        let requested = self.wants_torque();
        match self.machine.state() {
            DriveState::SwitchingOff => !requested,
            DriveState::Engaging => !requested || error,
            state => state == DriveState::FaultReaction,
        }
    }

    /// The switches and the mode of a control word, `modes` being those that are set. A mode that is not set stays away.
    #[inline]
    pub(super) fn take_control_word(&mut self, word: u16, modes: &[Option<OperationMode>; 8]) -> Selection {
        self.switches = Some(Switches::from_control_word(word));
        let selected = (((word & 0x0800) >> 9) | ((word & 0x0300) >> 8)) as u8;
        let mode = modes.get(usize::from(selected)).copied().flatten();
        if mode.is_none() {
            return Selection::Missing { selected };
        }
        self.mode_bits = word & MODE_BITS;
        self.uninitialised_mode = false;
        if mode == self.mode { Selection::Kept } else { Selection::Changed(mode) }
    }

    /// Whether a mode that is missing is an error now. It is one only of a control that wants the drive to switch on or to stay on (bits 15,
    /// 14), told once, and again when it is not `known` any more, after S-0-0099.
    pub(super) fn misses_its_mode(&mut self, known: bool) -> bool {
        let asked = self.switches.is_some_and(|switches| switches.on || switches.enable);
        let told = self.uninitialised_mode && known;
        self.uninitialised_mode = asked;
        asked && !told
    }

    /// The operation mode in force.
    #[inline]
    pub(super) const fn mode(&self) -> Option<OperationMode> {
        self.mode
    }

    /// Puts an operation mode into force; the state follows with [`Operation::step`].
    pub(super) const fn set_mode(&mut self, mode: Option<OperationMode>) {
        self.mode = mode;
    }

    /// The mode in force feeds the velocity forward.
    #[inline]
    pub(super) fn is_without_lag(&self) -> bool {
        self.mode.is_some_and(OperationMode::is_without_lag)
    }

    /// Bits 10, 9, 8 of the status word.
    #[inline]
    pub(super) const fn mode_bits(&self) -> u16 {
        (self.mode_bits & 0x0300) | ((self.mode_bits & 0x0800) >> 1)
    }

    /// The switches would bring torque on: the edge is there, and nothing stands in its way.
    #[inline]
    pub(super) fn would_switch_on(&self, conditions: impl FnOnce() -> Conditions) -> bool {
        self.machine.would_switch_on(self.switches.unwrap_or_default(), conditions)
    }

    /// Switching on is done, and there is no torque (any more): for [`Conditions`].
    #[inline]
    pub(super) const fn progress(&self) -> (bool, bool) {
        (self.released, self.torque_off)
    }

    /// Steps the state machine; `held`: as HALT does, a homing that is not cancelled holds the drive.
    #[inline]
    pub(super) fn step(&mut self, held: bool, conditions: Conditions) -> DriveState {
        let switches = self.switches.unwrap_or_default();
        let switches = Switches { run: switches.run && !held, ..switches };
        self.machine.update(switches, conditions)
    }

    /// What the axis is to do in this state. A function of the drive's own moves it in the place of what HALT or the mode say; `positions`: it
    /// goes to a target by itself.
    #[inline]
    pub(super) fn axis_mode(
        &self,
        commutates: bool,
        reaction: Reaction,
        function: &Function,
        positions: impl FnOnce() -> bool,
    ) -> Mode {
        match (self.machine.state(), self.mode) {
            (DriveState::Off | DriveState::Fault, _) => Mode::Off,
            // Without an angle there is no torque that a loop could use.
            (DriveState::SwitchingOn, _) if !commutates => Mode::Off,
            (DriveState::FaultReaction, _) if reaction == Reaction::TorqueLimit => Mode::Braking,
            (DriveState::SwitchingOff | DriveState::FaultReaction, _) => Mode::Stopping,
            (DriveState::SwitchingOn | DriveState::Engaging, _) => Mode::Halt,
            (DriveState::Halted, _) => function.axis_mode().unwrap_or(Mode::Halt),
            // An identification is over by then.
            (DriveState::Following, _) if function.is_travelling_home() => Mode::Travel,
            (DriveState::Following, Some(OperationMode::Torque)) => Mode::Torque,
            (DriveState::Following, Some(OperationMode::Velocity)) => Mode::Velocity,
            (DriveState::Following, _) if positions() => Mode::Travel,
            (DriveState::Following, _) => Mode::Position,
        }
    }

    /// What the state asks of bridge and brake.
    pub(super) const fn sequence(&self) -> Sequence {
        match self.machine.state() {
            DriveState::Off | DriveState::Fault => Sequence::Off,
            DriveState::Engaging => Sequence::Stop,
            _ => Sequence::Start,
        }
    }

    /// How far the sequence has come, and what it asks of bridge and brake.
    pub(super) fn take_progress(&mut self, progress: &SequenceOutput, hardware: &mut impl Hardware) {
        self.released = progress.released;
        self.torque_off = progress.torque_off;
        self.set_bridge(progress.bridge, hardware);
        hardware.set_brake(progress.brake);
    }

    /// Bridge and brake of a drive whose torque has gone.
    pub(super) fn switch_off(&mut self, hardware: &mut impl Hardware) {
        self.set_bridge(false, hardware);
        hardware.set_brake(false);
    }

    fn set_bridge(&mut self, on: bool, hardware: &mut impl Hardware) {
        if on == self.bridge_on {
            return;
        }
        self.bridge_on = on;
        if on {
            // A break without torque, as when the gate drivers had no supply yet, was nobody's error; one with torque is kept in C1D.
            hardware.reset_bridge();
        }
        hardware.set_bridge(on);
    }

    /// The bridge is set on, and switches.
    pub(super) fn bridge_is_on(&self, hardware: &mut impl Hardware) -> bool {
        self.bridge_on && hardware.bridge_is_on()
    }

    /// The bridge is set on, and does not switch.
    pub(super) fn bridge_is_lost(&self, hardware: &mut impl Hardware) -> bool {
        self.bridge_on && !hardware.bridge_is_on()
    }

    /// One look of the supervision at the two channels of safe torque off. They are observed, never relied on: the hardware behind them takes
    /// the torque away by itself.
    pub(super) fn watch_safe_torque_off(&mut self, inputs: &Inputs, torque: bool) -> Findings {
        let differ = inputs.safe_torque_1 != inputs.safe_torque_2;
        self.channels_differ = if differ { self.channels_differ.saturating_add(1) } else { 0 };
        let mut findings = Findings::default();
        if self.channels_differ >= CHANNELS_DIFFER_TICKS {
            findings.add_own(Manufacturer1::SAFE_TORQUE_CHANNELS, true);
        }
        if torque && !permits_torque(inputs) {
            findings.add_own(Manufacturer1::SAFE_TORQUE_OFF, true);
        }
        findings
    }
}

/// Both channels of safe torque off permit torque.
#[inline]
pub(super) const fn permits_torque(inputs: &Inputs) -> bool {
    inputs.safe_torque_1 && inputs.safe_torque_2
}

#[cfg(test)]
mod tests {
    use super::*;

    const MODES: [Option<OperationMode>; 8] =
        [Some(OperationMode::Velocity), Some(OperationMode::Torque), None, None, None, None, None, None];

    #[test]
    fn a_mode_that_is_not_set_leaves_the_one_before_and_is_told_once_to_whoever_wants_torque() {
        let mut operation = Operation::default();
        let mut take = |word| operation.take_control_word(word, &MODES);
        assert_eq!(take(0x0100), Selection::Changed(Some(OperationMode::Torque)));
        operation.set_mode(Some(OperationMode::Torque));
        assert_eq!(operation.take_control_word(0xC100, &MODES), Selection::Kept);
        assert_eq!(operation.take_control_word(0x0A00, &MODES), Selection::Missing { selected: 6 });
        assert!(!operation.misses_its_mode(false), "nobody wants torque");
        assert_eq!(operation.take_control_word(0x4A00, &MODES), Selection::Missing { selected: 6 });
        assert!(operation.misses_its_mode(false));
        assert!(!operation.misses_its_mode(true), "it was told");
        assert!(operation.misses_its_mode(false), "S-0-0099 has cleared it");
        assert_eq!((operation.mode(), operation.mode_bits()), (Some(OperationMode::Torque), 0x0100));
    }

    #[test]
    fn channels_of_safe_torque_off_may_differ_for_100_ms_and_either_takes_the_torque() {
        let mut operation = Operation::default();
        let both = Inputs { safe_torque_1: true, safe_torque_2: true, ..Inputs::default() };
        let one = Inputs { safe_torque_2: false, ..both };
        assert_eq!(operation.watch_safe_torque_off(&both, true), Findings::default());
        let found = operation.watch_safe_torque_off(&one, true);
        assert_eq!((found.manufacturer_1, found.fatal), (Manufacturer1::SAFE_TORQUE_OFF, true));
        assert_eq!(operation.watch_safe_torque_off(&both, true), Findings::default());
        let looks = (1..=300).find(|_| operation.watch_safe_torque_off(&one, false) != Findings::default());
        assert_eq!(looks, Some(200));
    }
}
