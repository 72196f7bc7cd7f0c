//! Keeping and recalling: what waits for the flash.

use embedded_storage_async::nor_flash::NorFlash;
use memory::{Condition, Error, Log, Memory};
use rtic_core::Mutex;
use sercon816::Bus;

use super::keeping::{Keep, MemoryFailure};
use super::log;
use super::set::Recollection;
use crate::communication::Communication;
use crate::hardware::Hardware;
use crate::motion::Motion;

/// Looks for the parameters: mends the memory, makes room in it, and reads the set into `buffer` ([`memory::MOST_BYTES`] and 32 more).
///
/// For the start: it waits for nobody, takes some 10 ms, and 1 to 2 s with the erase that is due every 40 saves.
pub async fn recall<'b, F: NorFlash>(memory: &mut Memory<F>, buffer: &'b mut [u8]) -> Recollection<'b> {
    let Ok(condition) = memory.start(buffer).await else { return Recollection::Damaged };
    match (condition, memory.load(buffer).await) {
        (Condition::Empty, _) => Recollection::Empty,
        (Condition::Unfinished, Ok(set)) => Recollection::Unfinished(set),
        (Condition::Whole, Ok(Some(set))) => Recollection::Set(set),
        _ => Recollection::Damaged,
    }
}

/// What became of the lock S-0-0267 that was to be forgotten.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Forgetting {
    /// No start would find one.
    NoLock,
    /// There was one.
    Forgotten,
    /// The flash cannot be read, or does not keep what is written: whatever lock there was is there still.
    Failed,
}

/// Forgets the lock S-0-0267 of a drive whose password nobody knows any more, and keeps the rest of the past: for a start that takes no part in a ring.
pub async fn forget_lock<F: NorFlash>(memory: &mut Memory<F>, buffer: &mut [u8]) -> Forgetting {
    // Another start finds the lock also where this fails.
    let _ = memory.start(buffer).await;
    let past = match memory.load_log(buffer, Log::Events).await {
        Ok(past) => past.and_then(log::Log::parse),
        Err(_) => return Forgetting::Failed,
    };
    let Some(past) = past.filter(|past| past.access.is_locked()) else { return Forgetting::NoLock };
    match memory.save_log(buffer, Log::Events, |out| past.write_unlocked(out)).await {
        Ok(()) => Forgetting::Forgotten,
        Err(_) => Forgetting::Failed,
    }
}

/// Does one thing that waits to be kept, if there is one, and says whether there was.
///
/// For whoever has the lowest priority. It is pending wherever the flash does not permit a word; under lock it holds the background up for the 0.2 ms in
/// which a set is put together, and with S-0-0263 for the two milliseconds in which one is taken over; the tasks of the cycle for the hand-over of settings.
pub async fn keep<F: NorFlash, B: Bus + Clone, H: Hardware>(
    memory: &mut Memory<F>,
    buffer: &mut [u8],
    communication: &mut impl Mutex<T = Communication<B>>,
    motion: &mut impl Mutex<T = Motion<B, H>>,
) -> bool {
    let Some((work, moment)) = communication.lock(|communication| communication.next_to_keep(motion)) else {
        return false;
    };
    let result = match work {
        Keep::Save => {
            let write = |out: &mut [u8]| communication.lock(|communication| communication.write_set(out));
            memory.save(buffer, write).await.map_err(failure)
        }
        Keep::Selected => {
            // Of a command that is given meanwhile it is the next turn.
            let selected = communication.lock(|communication| communication.selected());
            let edit = |set: &mut [u8], length| {
                communication.lock(|communication| communication.amend_set(&selected, set, length))
            };
            match memory.amend(buffer, edit).await {
                Ok(true) => Ok(()),
                Ok(false) => Err(MemoryFailure::NoSet),
                Err(error) => Err(failure(error)),
            }
        }
        Keep::Log => {
            let write = |out: &mut [u8]| communication.lock(|communication| communication.write_log(&moment, out));
            memory.save_log(buffer, Log::Events, write).await.map_err(failure)
        }
        Keep::Load => match memory.load(buffer).await {
            Ok(Some(set)) => communication.lock(|communication| communication.load_set(set, motion)),
            Ok(None) => Err(MemoryFailure::NoSet),
            Err(error) => Err(failure(error)),
        },
    };
    communication.lock(|communication| communication.kept(result, motion));
    true
}

fn failure<E>(error: Error<E>) -> MemoryFailure {
    match error {
        Error::Full { .. } => MemoryFailure::Full,
        Error::Refused => MemoryFailure::Refused,
        _ => MemoryFailure::Flash,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::crash::{CrashCause, CrashRecord};
    use crate::diagnosis::error_memory::{ErrorMemory, ErrorRecord};
    use crate::remembering::log::{KeptPosition, Moment};
    use crate::service::access::Access;
    use embassy_futures::block_on;
    use embedded_storage_async::nor_flash::{ErrorType, ReadNorFlash};
    use flash::{FlashError, FlashModel};

    const BUFFER: usize = memory::MOST_BYTES + 32;

    /// A flash whose first reads are refused.
    struct Sleepy {
        flash: FlashModel,
        refusals: u32,
    }

    impl ErrorType for Sleepy {
        type Error = FlashError;
    }

    impl ReadNorFlash for Sleepy {
        const READ_SIZE: usize = FlashModel::READ_SIZE;

        async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), FlashError> {
            if self.refusals > 0 {
                self.refusals -= 1;
                return Err(FlashError::NotWritten);
            }
            self.flash.read(offset, bytes).await
        }

        fn capacity(&self) -> usize {
            self.flash.capacity()
        }
    }

    impl NorFlash for Sleepy {
        const WRITE_SIZE: usize = FlashModel::WRITE_SIZE;
        const ERASE_SIZE: usize = <FlashModel as NorFlash>::ERASE_SIZE;

        async fn erase(&mut self, from: u32, to: u32) -> Result<(), FlashError> {
            NorFlash::erase(&mut self.flash, from, to).await
        }

        async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), FlashError> {
            self.flash.write(offset, bytes).await
        }
    }

    /// With an error, a crash and a position, and locked with this, if it is something.
    fn past(password: &str) -> FlashModel {
        let mut errors = ErrorMemory::new();
        errors.add(ErrorRecord { number: 0xF11D, seconds: 7 });
        let mut access = Access::default();
        access.write(password.as_bytes()).unwrap();
        let seconds = 12_345;
        let moment = Moment { seconds, position: Some(KeptPosition { position: -77, seconds: 12_000 }) };
        let crash = CrashRecord { pc: 0x0800_1234, told: true, ..CrashRecord::new(CrashCause::Panic) };
        let mut memory = Memory::new(FlashModel::new());
        let mut buffer = [0; BUFFER];
        block_on(memory.start(&mut buffer)).unwrap();
        let write = |out: &mut [u8]| log::Log::write(&moment, &errors, Some(&crash), &access, out);
        block_on(memory.save_log(&mut buffer, Log::Events, write)).unwrap();
        memory.flash().clone()
    }

    fn forget<F: NorFlash>(flash: F) -> (Forgetting, Memory<F>) {
        let mut memory = Memory::new(flash);
        (block_on(forget_lock(&mut memory, &mut [0; BUFFER])), memory)
    }

    /// What the next start finds.
    fn found(flash: FlashModel) -> log::Log {
        let mut memory = Memory::new(flash);
        let mut buffer = [0; BUFFER];
        block_on(memory.start(&mut buffer)).unwrap();
        let bytes = block_on(memory.load_log(&mut buffer, Log::Events)).unwrap().unwrap();
        log::Log::parse(bytes).unwrap()
    }

    #[test]
    fn a_lock_is_forgotten_and_nothing_else_of_the_past_also_behind_a_start_that_fails() {
        for refusals in [0, 1] {
            let (result, mut memory) = forget(Sleepy { flash: past("press 3"), refusals });
            assert_eq!(result, Forgetting::Forgotten);
            let (found, before) = (found(memory.flash().flash.clone()), found(past("press 3")));
            assert_eq!((before.access.is_locked(), found.access.is_locked()), (true, false));
            assert_eq!((found.seconds, found.position, found.crash), (before.seconds, before.position, before.crash));
            assert!(found.errors.newest_first().eq(before.errors.newest_first()));
            assert_eq!(found.errors.newest_first().count(), 1);
        }
    }

    #[test]
    fn no_lock_is_told_apart_from_one_that_cannot_be_forgotten() {
        for unlocked in [FlashModel::new(), past("")] {
            let before = unlocked.operations();
            let (result, mut memory) = forget(unlocked);
            assert_eq!((result, memory.flash().operations()), (Forgetting::NoLock, before));
        }
        let mut dying = past("press 3");
        dying.cut_in(2, 1);
        let (result, mut memory) = forget(dying);
        assert_eq!(result, Forgetting::Failed);
        let mut flash = memory.flash().clone();
        flash.restore_supply();
        assert!(found(flash).access.is_locked());
        let (result, _) = forget(Sleepy { flash: past("press 3"), refusals: u32::MAX });
        assert_eq!(result, Forgetting::Failed, "it cannot be read");
    }
}
