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

/// Forgets the lock S-0-0267 of a drive whose password nobody knows any more, and keeps the rest of the past: for a start that takes no part in a ring. Says
/// whether there was one.
pub async fn forget_lock<F: NorFlash>(memory: &mut Memory<F>, buffer: &mut [u8]) -> bool {
    if memory.start(buffer).await.is_err() {
        return false;
    }
    let past = memory.load_log(buffer, Log::Events).await.ok().flatten().and_then(log::Log::parse);
    let Some(past) = past.filter(|past| past.access.is_locked()) else { return false };
    memory.save_log(buffer, Log::Events, |out| past.write_unlocked(out)).await.is_ok()
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
            let edit =
                |set: &mut [u8], length| communication.lock(|communication| communication.amend_set(set, length));
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
        _ => MemoryFailure::Flash,
    }
}
