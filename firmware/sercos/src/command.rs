//! Procedure commands: what the master writes, and the data status (command acknowledgement) it reads
//! (sercos2.md 3.6).

use crate::data_block::{DataBlock, Location};
use crate::dictionary::{self, ROWS};
use crate::idn::Idn;
use crate::phase::Phase;
use crate::service::ServiceError;

/// What the master wants of a procedure command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum CommandAction {
    /// Start, or go on after an interruption.
    Start,
    /// Pause.
    Interrupt,
    /// Stop for good, or, after the end, give up what the command holds. Asked for whenever the master cancels a command that is set.
    Cancel,
}

/// How far a procedure command is, as the drive tells it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum CommandState {
    /// Goes on; the end will be told through [`crate::service::Server::command_progress`].
    Executing,
    /// Done.
    Executed,
    /// Paused.
    Interrupted,
    /// Ended with an error.
    Failed,
}

/// The data status of a procedure command.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum CommandStatus {
    /// Not set in the drive.
    #[default]
    NotSet = 0,
    /// Set, execution not enabled.
    Set = 1,
    /// Executed correctly.
    Executed = 3,
    /// Interrupted.
    Interrupted = 5,
    /// Being executed.
    Executing = 7,
    /// Error, not executable or aborted.
    Failed = 0xF,
}

impl From<CommandState> for CommandStatus {
    fn from(state: CommandState) -> Self {
        match state {
            CommandState::Executing => CommandStatus::Executing,
            CommandState::Executed => CommandStatus::Executed,
            CommandState::Interrupted => CommandStatus::Interrupted,
            CommandState::Failed => CommandStatus::Failed,
        }
    }
}

/// All procedure commands of the dictionary.
#[derive(Clone, Debug)]
pub(crate) struct Commands {
    slots: [Slot; COUNT],
}

#[derive(Clone, Copy, Debug)]
struct Slot {
    status: CommandStatus,
    /// The command has ended and was not cancelled yet.
    change: bool,
}

impl Commands {
    pub(crate) const fn new() -> Self {
        Self { slots: [Slot { status: CommandStatus::NotSet, change: false }; COUNT] }
    }

    /// The command change bit: some command has ended and waits to be cancelled.
    pub(crate) fn change(&self) -> bool {
        self.slots.iter().any(|slot| slot.change)
    }

    pub(crate) fn status(&self, idn: Idn) -> CommandStatus {
        let slot = blocks().position(|block| block.idn == idn).and_then(|index| self.slots.get(index));
        slot.map_or(CommandStatus::NotSet, |slot| slot.status)
    }

    /// Takes what the master has written; `act` asks the drive.
    pub(crate) fn write(
        &mut self,
        idn: Idn,
        value: u16,
        act: impl FnOnce(CommandAction) -> Result<CommandState, ServiceError>,
    ) -> Result<(), ServiceError> {
        let slot = self.slot(idn).ok_or(ServiceError::IdnNotAvailable)?;
        use CommandStatus::{Executed, Executing, Failed, Interrupted, NotSet, Set};
        match (value, slot.status) {
            (0, status) => {
                if status != NotSet {
                    act(CommandAction::Cancel)?;
                }
                *slot = Slot { status: NotSet, change: false };
            }
            (1, NotSet | Set) => slot.status = Set,
            (1, Executing) => slot.take(act(CommandAction::Interrupt)?),
            // Already there, or the command has ended while the master was writing.
            (1, Interrupted | Executed | Failed) => {}
            (3, NotSet | Set | Interrupted) => slot.take(act(CommandAction::Start)?),
            // A new start needs a cancellation first; without it the master would take the old end for the new one.
            (3, Executing | Executed | Failed) => return Err(ServiceError::CommandActive),
            _ => return Err(ServiceError::InvalidData),
        }
        Ok(())
    }

    /// Takes news of a command that is executing or interrupted; others have no news.
    pub(crate) fn progress(&mut self, idn: Idn, state: CommandState) {
        if let Some(slot) = self.slot(idn)
            && matches!(slot.status, CommandStatus::Executing | CommandStatus::Interrupted)
        {
            slot.take(state);
        }
    }

    /// Forgets the commands that the master could not cancel in the new phase.
    pub(crate) fn phase_changed(&mut self, phase: Phase) {
        for (slot, block) in self.slots.iter_mut().zip(blocks()) {
            if phase < Phase::Cp2 || block.attribute.is_protected_in(phase) {
                *slot = Slot { status: CommandStatus::NotSet, change: false };
            }
        }
    }

    fn slot(&mut self, idn: Idn) -> Option<&mut Slot> {
        let index = blocks().position(|block| block.idn == idn)?;
        self.slots.get_mut(index)
    }
}

impl Slot {
    fn take(&mut self, state: CommandState) {
        self.status = state.into();
        self.change = matches!(state, CommandState::Executed | CommandState::Failed);
    }
}

fn blocks() -> impl Iterator<Item = &'static DataBlock> {
    dictionary::DICTIONARY.iter().filter(|block| block.location == Location::Command)
}

const COUNT: usize = count();

#[allow(clippy::indexing_slicing, clippy::arithmetic_side_effects, reason = "evaluated by the compiler only")]
const fn count() -> usize {
    let mut count = 0;
    let mut row = 0;
    while row < ROWS.len() {
        if matches!(ROWS[row].location, Location::Command) {
            count += 1;
        }
        row += 1;
    }
    count
}

#[cfg(test)]
mod tests {
    use super::*;

    const RESET: Idn = Idn::RESET_CLASS_1_DIAGNOSTIC;
    const CHECK: Idn = Idn::CP3_TRANSITION_CHECK;

    fn ends_with(state: CommandState) -> impl FnOnce(CommandAction) -> Result<CommandState, ServiceError> {
        move |_| Ok(state)
    }

    #[test]
    fn a_fast_command_goes_straight_to_3_and_sets_the_change_bit_until_it_is_cancelled() {
        let mut commands = Commands::new();
        commands.write(RESET, 3, ends_with(CommandState::Executed)).unwrap();
        assert_eq!(commands.status(RESET) as u16, 3);
        assert!(commands.change());
        let mut asked = None;
        let cancelled = commands.write(RESET, 0, |action| {
            asked = Some(action);
            Ok(CommandState::Executed)
        });
        assert_eq!((cancelled, asked), (Ok(()), Some(CommandAction::Cancel)));
        assert_eq!(commands.status(RESET) as u16, 0);
        assert!(!commands.change());
        commands.write(RESET, 0, |_| panic!("the command is not set")).unwrap();
    }

    #[test]
    fn the_change_bit_is_the_or_over_all_commands() {
        let mut commands = Commands::new();
        commands.write(RESET, 3, ends_with(CommandState::Executed)).unwrap();
        commands.write(CHECK, 3, ends_with(CommandState::Failed)).unwrap();
        commands.write(RESET, 0, ends_with(CommandState::Executed)).unwrap();
        assert!(commands.change());
        assert_eq!(commands.status(CHECK) as u16, 0xF);
        commands.write(CHECK, 0, ends_with(CommandState::Executed)).unwrap();
        assert!(!commands.change());
    }

    #[test]
    fn a_slow_command_can_be_interrupted_resumed_and_ends_by_progress() {
        let mut commands = Commands::new();
        commands.write(RESET, 3, ends_with(CommandState::Executing)).unwrap();
        assert_eq!((commands.status(RESET) as u16, commands.change()), (7, false));
        assert_eq!(commands.write(RESET, 3, ends_with(CommandState::Executing)), Err(ServiceError::CommandActive));
        commands.write(RESET, 1, ends_with(CommandState::Interrupted)).unwrap();
        assert_eq!((commands.status(RESET) as u16, commands.change()), (5, false));
        commands.write(RESET, 3, ends_with(CommandState::Executing)).unwrap();
        commands.progress(RESET, CommandState::Executed);
        assert_eq!((commands.status(RESET) as u16, commands.change()), (3, true));
    }

    #[test]
    fn a_refused_action_changes_nothing() {
        let mut commands = Commands::new();
        let refused = commands.write(CHECK, 3, |_| Err(ServiceError::CommandNotExecutableNow));
        assert_eq!(refused, Err(ServiceError::CommandNotExecutableNow));
        assert_eq!(commands.status(CHECK), CommandStatus::NotSet);

        commands.write(RESET, 3, ends_with(CommandState::Executing)).unwrap();
        let refused = commands.write(RESET, 0, |_| Err(ServiceError::CommandNotInterruptible));
        assert_eq!(refused, Err(ServiceError::CommandNotInterruptible));
        assert_eq!(commands.status(RESET), CommandStatus::Executing);
    }

    #[test]
    fn one_sets_a_command_without_starting_it_and_changes_nothing_of_one_that_has_ended() {
        let mut commands = Commands::new();
        for _ in 0..2 {
            commands.write(RESET, 1, |_| panic!("nothing is started")).unwrap();
            assert_eq!((commands.status(RESET), commands.change()), (CommandStatus::Set, false));
        }
        for (state, status) in [
            (CommandState::Executed, CommandStatus::Executed),
            (CommandState::Failed, CommandStatus::Failed),
            (CommandState::Interrupted, CommandStatus::Interrupted),
        ] {
            let mut commands = Commands::new();
            commands.write(RESET, 3, ends_with(state)).unwrap();
            commands.write(RESET, 1, |_| panic!("nothing is running")).unwrap();
            assert_eq!(commands.status(RESET), status);
        }
    }

    #[test]
    fn a_command_for_every_phase_outlives_the_way_to_cp2_and_up() {
        for phase in [Phase::Cp2, Phase::Cp3, Phase::Cp4] {
            let mut commands = Commands::new();
            commands.write(RESET, 3, ends_with(CommandState::Executed)).unwrap();
            commands.phase_changed(phase);
            assert_eq!(commands.status(RESET), CommandStatus::Executed, "{phase}");
        }
    }

    #[test]
    fn only_0_1_and_3_are_valid() {
        let mut commands = Commands::new();
        for value in (0..=u16::MAX).filter(|value| ![0, 1, 3].contains(value)) {
            assert_eq!(commands.write(RESET, value, ends_with(CommandState::Executed)), Err(ServiceError::InvalidData));
        }
    }

    #[test]
    fn news_of_a_command_that_is_not_running_are_ignored() {
        let mut commands = Commands::new();
        commands.progress(RESET, CommandState::Executed);
        assert_eq!((commands.status(RESET), commands.change()), (CommandStatus::NotSet, false));
    }

    #[test]
    fn an_uncancelled_check_does_not_keep_the_change_bit_in_the_next_phase() {
        let mut commands = Commands::new();
        commands.write(CHECK, 3, ends_with(CommandState::Executed)).unwrap();
        commands.write(RESET, 3, ends_with(CommandState::Executed)).unwrap();
        commands.phase_changed(Phase::Cp3);
        assert_eq!(commands.status(CHECK), CommandStatus::NotSet);
        assert_eq!(commands.status(RESET), CommandStatus::Executed);
        commands.phase_changed(Phase::Cp0);
        assert!(!commands.change());
    }
}
