//! What is to be kept, and when.

use heapless::Vec;
use sercos::Idn;
use sercos::capacity::LIST_ENTRIES;
use sercos::error::ServiceError;

use super::set::Dropped;
use crate::dictionary::is_rating_of;
use crate::dictionary::procedures::Procedure;

/// Work for the memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub(crate) enum Keep {
    /// The parameters.
    Save,
    /// Of the parameters those that S-0-0270 named.
    Selected,
    /// The parameters are to be what was saved.
    Load,
    /// What has happened.
    Log,
}

/// Why something was not kept or found, for P-0-0003.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub(crate) enum MemoryFailure {
    /// The page is full until the next start.
    Full,
    /// The flash refuses, or keeps something else than what is written.
    Flash,
    /// There is no set, or none that can be read.
    NoSet,
    /// Of the set that there is S-0-0293 cannot make another one.
    Refused,
    /// The drive has no memory.
    NoMemory,
    /// S-0-0263 was overtaken by CP4.
    InOperation,
}

impl MemoryFailure {
    /// In words.
    pub(crate) const fn words(self) -> &'static str {
        match self {
            Self::Full => "the memory is full until the next start: switch the supply off and on, then save",
            Self::Flash => {
                "the flash does not keep what is written; once more, and if it stays, have the board replaced"
            }
            Self::NoSet => "nothing was saved, or it cannot be read any more: write the parameters, then S-0-0264",
            Self::Refused => "what was saved has another form, or no room for S-0-0270: save everything with S-0-0264",
            Self::InOperation => "S-0-0262 and S-0-0263 change what is protected in CP4",
            Self::NoMemory => "this drive has no memory for parameters",
        }
    }
}

/// After the last write the parameters are kept when so many us have passed without another (S-0-0269 = 0).
const QUIET: u64 = 250_000;
/// And at the latest so long after the first of them.
const PATIENCE: u64 = 2_000_000;
/// At least so many us lie between two times at which what has happened is kept.
const LOG_INTERVAL: u64 = 2_000_000;
/// The operating time is kept so often, in us.
const TIME_INTERVAL: u64 = 3_600_000_000;

/// What S-0-0270 names.
pub(crate) type Selected = Vec<Idn, LIST_ENTRIES>;

/// What waits to be kept.
#[derive(Debug, Default)]
pub(crate) struct Keeping {
    /// There is somebody who keeps.
    present: bool,
    /// The command that waits for its end.
    command: Option<Procedure>,
    /// It has not been begun yet.
    due: bool,
    /// S-0-0270 as S-0-0293 has found it.
    pub(crate) selected: Selected,
    /// What is being done.
    running: Option<Keep>,
    /// When the first and the last parameter was written that is not kept yet (S-0-0269 = 0).
    written: Option<(u64, u64)>,
    /// The same of what is just being kept.
    in_work: Option<(u64, u64)>,
    /// Something has happened that is not kept yet.
    happened: bool,
    /// Of it the lock S-0-0267: not kept yet, and just being kept.
    lock: bool,
    lock_in_work: bool,
    /// When it was kept last; `None`: not since the start, and what a start finds is kept at once.
    logged: Option<u64>,
    /// P-0-0014.
    pub(crate) dropped: Dropped,
}

impl Keeping {
    /// There is a memory, and somebody who calls [`super::keep`].
    pub(crate) fn with_memory() -> Self {
        Self { present: true, ..Self::default() }
    }

    pub(crate) const fn has_memory(&self) -> bool {
        self.present
    }

    /// Of what was not restored the ratings of another amplifier.
    pub(crate) fn disputed(&self) -> impl Iterator<Item = Idn> {
        self.dropped.iter().copied().filter(|idn| is_rating_of(*idn))
    }

    /// Somebody has looked at them, and says that this is the amplifier.
    pub(crate) fn settle(&mut self) {
        self.dropped.retain(|idn| !is_rating_of(*idn));
    }

    /// S-0-0263, S-0-0264 or S-0-0293.
    ///
    /// # Errors
    /// One of them goes on, or there is no memory.
    pub(crate) fn start(&mut self, procedure: Procedure) -> Result<(), ServiceError> {
        if !self.present || self.command.is_some() {
            return Err(ServiceError::CommandNotExecutableNow);
        }
        (self.command, self.due) = (Some(procedure), true);
        Ok(())
    }

    /// A command is cancelled: what has been begun comes to its end without it.
    pub(crate) fn cancel(&mut self, procedure: Procedure) {
        if self.command == Some(procedure) {
            self.forget_command();
        }
    }

    /// The same for whichever there is: its phase has ended.
    pub(crate) const fn forget_command(&mut self) {
        (self.command, self.due) = (None, false);
    }

    /// A parameter was written that is to be kept.
    pub(crate) fn note_write(&mut self, now: u64) {
        self.written = Some((self.written.map_or(now, |(first, _)| first), now));
    }

    /// Something has happened that is to be kept.
    pub(crate) const fn note_event(&mut self) {
        self.happened = true;
    }

    /// The lock S-0-0267 has changed: of what has happened the one thing that a master has asked for.
    pub(crate) const fn note_lock(&mut self) {
        (self.happened, self.lock) = (true, true);
    }

    /// Something was written that is not kept yet.
    pub(crate) const fn has_unsaved(&self) -> bool {
        self.written.is_some() || self.lock
    }

    /// The next thing to be kept; `torque`: nothing is begun then.
    pub(crate) fn next(&mut self, now: u64, torque: bool) -> Option<Keep> {
        if torque {
            return None;
        }
        let keep = if core::mem::take(&mut self.due) {
            match self.command {
                Some(Procedure::LoadParameters) => Keep::Load,
                Some(Procedure::SaveSelected) => Keep::Selected,
                _ => Keep::Save,
            }
        } else if self
            .written
            .is_some_and(|(first, last)| now.saturating_sub(last) >= QUIET || now.saturating_sub(first) >= PATIENCE)
            // It would be as if somebody had looked at the ratings of another amplifier.
            && self.disputed().next().is_none()
        {
            Keep::Save
        } else if self.happened && self.logged.is_none_or(|then| now.saturating_sub(then) >= LOG_INTERVAL)
            || now.saturating_sub(self.logged.unwrap_or(0)) >= TIME_INTERVAL
        {
            Keep::Log
        } else {
            return None;
        };
        self.running = Some(keep);
        match keep {
            // What is written from here on may be in the set or not.
            Keep::Save | Keep::Load => self.in_work = self.written.take(),
            // What else was written still waits.
            Keep::Selected => {}
            Keep::Log => {
                (self.happened, self.logged) = (false, Some(now));
                self.lock_in_work = core::mem::take(&mut self.lock);
            }
        }
        Some(keep)
    }

    /// It was kept, or not; the command that has ended with it.
    pub(crate) fn done(&mut self, now: u64, kept: bool) -> Option<Procedure> {
        let keep = self.running.take()?;
        let in_work = self.in_work.take();
        let lock = core::mem::take(&mut self.lock_in_work);
        if !kept {
            match keep {
                // Once more, and not at once.
                Keep::Save | Keep::Load => {
                    if in_work.is_some() {
                        self.note_write(now);
                    }
                }
                Keep::Selected => {}
                Keep::Log => (self.happened, self.lock) = (true, self.lock || lock),
            }
        }
        // One that was given since then has its own turn.
        if keep != Keep::Log && !self.due { self.command.take() } else { None }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_command_is_done_once_without_torque_and_ends_with_what_was_done() {
        let mut keeping = Keeping::with_memory();
        keeping.start(Procedure::SaveParameters).unwrap();
        assert_eq!(keeping.start(Procedure::LoadParameters), Err(ServiceError::CommandNotExecutableNow));
        assert_eq!(keeping.next(0, true), None);
        assert_eq!(keeping.next(0, false), Some(Keep::Save));
        assert_eq!(keeping.next(0, false), None);
        assert_eq!(keeping.done(0, true), Some(Procedure::SaveParameters));
        keeping.start(Procedure::LoadParameters).unwrap();
        assert_eq!(keeping.next(0, false), Some(Keep::Load));
        assert_eq!(keeping.done(0, false), Some(Procedure::LoadParameters));
    }

    #[test]
    fn what_is_selected_is_kept_by_itself_and_everything_that_was_written_afterwards() {
        let mut keeping = Keeping::with_memory();
        keeping.note_write(0);
        keeping.start(Procedure::SaveSelected).unwrap();
        assert_eq!(keeping.next(1_000, true), None);
        assert_eq!(keeping.next(1_000, false), Some(Keep::Selected));
        assert_eq!(keeping.done(2_000, true), Some(Procedure::SaveSelected));
        assert!(keeping.has_unsaved());
        assert_eq!(keeping.next(250_000, false), Some(Keep::Save));
        assert_eq!(keeping.done(260_000, true), None);
        keeping.start(Procedure::SaveSelected).unwrap();
        assert_eq!(keeping.next(260_000, false), Some(Keep::Selected));
        assert_eq!(keeping.done(270_000, false), Some(Procedure::SaveSelected));
        assert!(!keeping.has_unsaved(), "what failed was asked for, and is not tried again by itself");
    }

    #[test]
    fn a_drive_without_memory_says_so() {
        assert_eq!(Keeping::default().start(Procedure::SaveParameters), Err(ServiceError::CommandNotExecutableNow));
    }

    #[test]
    fn a_cancelled_command_is_told_nothing_and_the_next_one_is_done_anew() {
        let mut keeping = Keeping::with_memory();
        keeping.start(Procedure::SaveParameters).unwrap();
        keeping.cancel(Procedure::LoadParameters);
        keeping.cancel(Procedure::SaveParameters);
        assert_eq!(keeping.next(0, false), None);
        keeping.start(Procedure::SaveParameters).unwrap();
        assert_eq!(keeping.next(0, false), Some(Keep::Save));
        keeping.cancel(Procedure::SaveParameters);
        keeping.start(Procedure::SaveParameters).unwrap();
        assert_eq!(keeping.done(0, true), None, "that was the first one's");
        assert_eq!(keeping.next(0, false), Some(Keep::Save));
        assert_eq!(keeping.done(0, true), Some(Procedure::SaveParameters));
    }

    #[test]
    fn writes_are_kept_when_they_have_come_to_an_end_and_once_more_where_that_failed() {
        let mut keeping = Keeping::with_memory();
        for now in [0, 200_000, 400_000] {
            keeping.note_write(now);
            assert_eq!(keeping.next(now + 100_000, false), None);
        }
        assert!(keeping.has_unsaved());
        assert_eq!(keeping.next(650_000, true), None, "not with torque");
        assert_eq!(keeping.next(650_000, false), Some(Keep::Save));
        keeping.note_write(651_000);
        assert_eq!(keeping.done(660_000, false), None);
        assert_eq!(keeping.next(700_000, false), None);
        assert_eq!(keeping.next(910_000, false), Some(Keep::Save));
        assert_eq!(keeping.done(920_000, true), None);
        assert!(!keeping.has_unsaved());
    }

    #[test]
    fn to_cancel_one_command_leaves_the_other_alone() {
        let mut keeping = Keeping::with_memory();
        keeping.start(Procedure::SaveParameters).unwrap();
        keeping.cancel(Procedure::LoadParameters);
        assert_eq!(keeping.next(0, false), Some(Keep::Save));
        keeping.cancel(Procedure::LoadParameters);
        assert_eq!(keeping.done(0, true), Some(Procedure::SaveParameters));
    }

    #[test]
    fn a_command_that_fails_forgets_no_write_and_asks_for_none() {
        let mut keeping = Keeping::with_memory();
        keeping.note_write(0);
        for procedure in [Procedure::SaveParameters, Procedure::LoadParameters] {
            keeping.start(procedure).unwrap();
            assert!(keeping.next(0, false).is_some());
            assert_eq!(keeping.done(1_000, false), Some(procedure));
            assert!(keeping.has_unsaved());
        }
        let mut keeping = Keeping::with_memory();
        keeping.start(Procedure::SaveParameters).unwrap();
        assert_eq!(keeping.next(0, false), Some(Keep::Save));
        keeping.cancel(Procedure::SaveParameters);
        assert_eq!(keeping.done(0, false), None);
        assert!(!keeping.has_unsaved());
    }

    #[test]
    fn writes_that_never_end_are_kept_all_the_same() {
        let mut keeping = Keeping::with_memory();
        let saves = (0..100).filter(|step| {
            let now = step * 100_000;
            keeping.note_write(now);
            let saved = keeping.next(now, false) == Some(Keep::Save);
            if saved {
                let _ = keeping.done(now, true);
            }
            saved
        });
        assert_eq!(saves.count(), 4);
    }

    #[test]
    fn a_lock_is_unsaved_until_a_log_is_kept_that_has_it() {
        let mut keeping = Keeping::with_memory();
        keeping.note_event();
        assert!(!keeping.has_unsaved(), "nobody waits for an error to be kept");
        assert_eq!(keeping.next(0, false), Some(Keep::Log));
        // Of this one nobody knows whether it is in the log that is being written.
        keeping.note_lock();
        assert_eq!(keeping.done(1_000, true), None);
        assert!(keeping.has_unsaved());
        assert_eq!(keeping.next(2_000_000, true), None, "not with torque");
        for kept in [false, true] {
            let now = keeping.logged.unwrap() + LOG_INTERVAL;
            assert!(keeping.has_unsaved());
            assert_eq!(keeping.next(now, false), Some(Keep::Log));
            assert_eq!(keeping.done(now, kept), None);
        }
        assert!(!keeping.has_unsaved());
        // To keep the parameters does not keep the lock.
        keeping.note_lock();
        keeping.start(Procedure::SaveParameters).unwrap();
        assert_eq!(keeping.next(4_000_000, false), Some(Keep::Save));
        assert_eq!(keeping.done(4_000_000, true), Some(Procedure::SaveParameters));
        assert!(keeping.has_unsaved());
    }

    #[test]
    fn events_are_kept_not_too_often_and_the_operating_time_every_hour() {
        let mut keeping = Keeping::with_memory();
        assert_eq!(keeping.next(0, false), None);
        keeping.note_event();
        assert_eq!(keeping.next(2_000_000, true), None, "not with torque");
        assert_eq!(keeping.next(2_000_000, false), Some(Keep::Log), "the first one at once");
        assert_eq!(keeping.done(2_000_000, true), None);
        keeping.note_event();
        assert_eq!(keeping.next(3_999_999, false), None);
        assert_eq!(keeping.next(4_000_000, false), Some(Keep::Log));
        assert_eq!(keeping.next(3_600_000_000, false), None);
        assert_eq!(keeping.next(3_604_000_000, false), Some(Keep::Log));
    }
}
