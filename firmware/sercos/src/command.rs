//! Procedure commands: what the master writes, and the data status (command acknowledgement) it reads
//! (sercos2.md 3.6).

use crate::capacity;
use crate::data_block::{DataBlock, Place, Selection};
use crate::dictionary::Dictionary;
use crate::error::ServiceError;
use crate::phase::Phase;

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

/// All procedure commands of the dictionary, each in its place.
#[derive(Clone, Debug)]
pub(crate) struct Commands {
    status: [CommandStatus; capacity::COMMANDS],
    /// Commands that have ended and were not cancelled yet, a bit each: asked for at every step.
    ended: u32,
}

const _: () = assert!(capacity::COMMANDS <= u32::BITS as usize, "a command has a bit");

impl Commands {
    pub(crate) const fn new() -> Self {
        Self { status: [CommandStatus::NotSet; capacity::COMMANDS], ended: 0 }
    }

    /// The command change bit: some command has ended and waits to be cancelled.
    pub(crate) const fn change(&self) -> bool {
        self.ended != 0
    }

    pub(crate) fn status(&self, block: &DataBlock) -> CommandStatus {
        let status = place_of(block).and_then(|place| self.status.get(usize::from(place)));
        status.copied().unwrap_or_default()
    }

    /// Takes what the master has written; `act` asks the drive.
    pub(crate) fn write(
        &mut self,
        block: &DataBlock,
        value: u16,
        act: impl FnOnce(CommandAction) -> Result<CommandState, ServiceError>,
    ) -> Result<(), ServiceError> {
        let place = place_of(block).ok_or(ServiceError::IdnNotAvailable)?;
        use CommandStatus::{Executed, Executing, Failed, Interrupted, NotSet, Set};
        match (value, self.status(block)) {
            (0, status) => {
                if status != NotSet {
                    act(CommandAction::Cancel)?;
                }
                self.put(place, NotSet);
            }
            (1, NotSet | Set) => self.put(place, Set),
            (1, Executing) => self.put(place, act(CommandAction::Interrupt)?.into()),
            // Already there, or the command has ended while the master was writing.
            (1, Interrupted | Executed | Failed) => {}
            (3, NotSet | Set | Interrupted) => self.put(place, act(CommandAction::Start)?.into()),
            // A new start needs a cancellation first; without it the master would take the old end for the new one.
            (3, Executing | Executed | Failed) => return Err(ServiceError::CommandActive),
            _ => return Err(ServiceError::InvalidData),
        }
        Ok(())
    }

    /// Takes news of a command that is executing or interrupted; others have no news.
    pub(crate) fn progress(&mut self, block: &DataBlock, state: CommandState) {
        if let Some(place) = place_of(block)
            && matches!(self.status(block), CommandStatus::Executing | CommandStatus::Interrupted)
        {
            self.put(place, state.into());
        }
    }

    /// Forgets the commands that the master could not cancel in the new phase.
    pub(crate) fn phase_changed(&mut self, phase: Phase, dictionary: &Dictionary) {
        for block in dictionary.select(Selection::Commands) {
            if (phase < Phase::Cp2 || block.attribute.is_protected_in(phase))
                && let Some(place) = place_of(block)
            {
                self.put(place, CommandStatus::NotSet);
            }
        }
    }

    fn put(&mut self, place: u8, status: CommandStatus) {
        if let Some(slot) = self.status.get_mut(usize::from(place)) {
            *slot = status;
        }
        let bit = 1_u32.wrapping_shl(place.into());
        let ended = matches!(status, CommandStatus::Executed | CommandStatus::Failed);
        self.ended = if ended { self.ended | bit } else { self.ended & !bit };
    }
}

/// `None`: the data block is no command.
fn place_of(block: &DataBlock) -> Option<u8> {
    match block.place {
        Place::Command(place) => Some(place),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::idn::Idn;
    use crate::sample::DICTIONARY;

    const RESET: Idn = Idn::RESET_CLASS_1_DIAGNOSTIC;
    const CHECK: Idn = Idn::CP3_TRANSITION_CHECK;

    fn block(idn: Idn) -> &'static DataBlock {
        DICTIONARY.find(idn).unwrap()
    }

    fn ends_with(state: CommandState) -> impl FnOnce(CommandAction) -> Result<CommandState, ServiceError> {
        move |_| Ok(state)
    }

    #[test]
    fn a_fast_command_goes_straight_to_3_and_sets_the_change_bit_until_it_is_cancelled() {
        let mut commands = Commands::new();
        commands.write(block(RESET), 3, ends_with(CommandState::Executed)).unwrap();
        assert_eq!(commands.status(block(RESET)) as u16, 3);
        assert!(commands.change());
        let mut asked = None;
        let cancelled = commands.write(block(RESET), 0, |action| {
            asked = Some(action);
            Ok(CommandState::Executed)
        });
        assert_eq!((cancelled, asked), (Ok(()), Some(CommandAction::Cancel)));
        assert_eq!(commands.status(block(RESET)) as u16, 0);
        assert!(!commands.change());
        commands.write(block(RESET), 0, |_| panic!("the command is not set")).unwrap();
    }

    #[test]
    fn the_change_bit_is_the_or_over_all_commands() {
        let mut commands = Commands::new();
        commands.write(block(RESET), 3, ends_with(CommandState::Executed)).unwrap();
        commands.write(block(CHECK), 3, ends_with(CommandState::Failed)).unwrap();
        commands.write(block(RESET), 0, ends_with(CommandState::Executed)).unwrap();
        assert!(commands.change());
        assert_eq!(commands.status(block(CHECK)) as u16, 0xF);
        commands.write(block(CHECK), 0, ends_with(CommandState::Executed)).unwrap();
        assert!(!commands.change());
    }

    #[test]
    fn a_slow_command_can_be_interrupted_resumed_and_ends_by_progress() {
        let mut commands = Commands::new();
        commands.write(block(RESET), 3, ends_with(CommandState::Executing)).unwrap();
        assert_eq!((commands.status(block(RESET)) as u16, commands.change()), (7, false));
        assert_eq!(
            commands.write(block(RESET), 3, ends_with(CommandState::Executing)),
            Err(ServiceError::CommandActive)
        );
        commands.write(block(RESET), 1, ends_with(CommandState::Interrupted)).unwrap();
        assert_eq!((commands.status(block(RESET)) as u16, commands.change()), (5, false));
        commands.write(block(RESET), 3, ends_with(CommandState::Executing)).unwrap();
        commands.progress(block(RESET), CommandState::Executed);
        assert_eq!((commands.status(block(RESET)) as u16, commands.change()), (3, true));
    }

    #[test]
    fn a_refused_action_changes_nothing() {
        let mut commands = Commands::new();
        let refused = commands.write(block(CHECK), 3, |_| Err(ServiceError::CommandNotExecutableNow));
        assert_eq!(refused, Err(ServiceError::CommandNotExecutableNow));
        assert_eq!(commands.status(block(CHECK)), CommandStatus::NotSet);

        commands.write(block(RESET), 3, ends_with(CommandState::Executing)).unwrap();
        let refused = commands.write(block(RESET), 0, |_| Err(ServiceError::CommandNotInterruptible));
        assert_eq!(refused, Err(ServiceError::CommandNotInterruptible));
        assert_eq!(commands.status(block(RESET)), CommandStatus::Executing);
    }

    #[test]
    fn one_sets_a_command_without_starting_it_and_changes_nothing_of_one_that_has_ended() {
        let mut commands = Commands::new();
        for _ in 0..2 {
            commands.write(block(RESET), 1, |_| panic!("nothing is started")).unwrap();
            assert_eq!((commands.status(block(RESET)), commands.change()), (CommandStatus::Set, false));
        }
        for (state, status) in [
            (CommandState::Executed, CommandStatus::Executed),
            (CommandState::Failed, CommandStatus::Failed),
            (CommandState::Interrupted, CommandStatus::Interrupted),
        ] {
            let mut commands = Commands::new();
            commands.write(block(RESET), 3, ends_with(state)).unwrap();
            commands.write(block(RESET), 1, |_| panic!("nothing is running")).unwrap();
            assert_eq!(commands.status(block(RESET)), status);
        }
    }

    #[test]
    fn a_command_for_every_phase_outlives_the_way_to_cp2_and_up() {
        for phase in [Phase::Cp2, Phase::Cp3, Phase::Cp4] {
            let mut commands = Commands::new();
            commands.write(block(RESET), 3, ends_with(CommandState::Executed)).unwrap();
            commands.phase_changed(phase, &DICTIONARY);
            assert_eq!(commands.status(block(RESET)), CommandStatus::Executed, "{phase}");
        }
    }

    #[test]
    fn only_0_1_and_3_are_valid() {
        let mut commands = Commands::new();
        for value in (0..=u16::MAX).filter(|value| ![0, 1, 3].contains(value)) {
            assert_eq!(
                commands.write(block(RESET), value, ends_with(CommandState::Executed)),
                Err(ServiceError::InvalidData)
            );
        }
    }

    #[test]
    fn news_of_a_command_that_is_not_running_are_ignored() {
        let mut commands = Commands::new();
        commands.progress(block(RESET), CommandState::Executed);
        assert_eq!((commands.status(block(RESET)), commands.change()), (CommandStatus::NotSet, false));
    }

    #[test]
    fn an_uncancelled_check_does_not_keep_the_change_bit_in_the_next_phase() {
        let mut commands = Commands::new();
        commands.write(block(CHECK), 3, ends_with(CommandState::Executed)).unwrap();
        commands.write(block(RESET), 3, ends_with(CommandState::Executed)).unwrap();
        commands.phase_changed(Phase::Cp3, &DICTIONARY);
        assert_eq!(commands.status(block(CHECK)), CommandStatus::NotSet);
        assert_eq!(commands.status(block(RESET)), CommandStatus::Executed);
        commands.phase_changed(Phase::Cp0, &DICTIONARY);
        assert!(!commands.change());
    }
}
