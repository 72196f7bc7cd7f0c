//! Two pages of flash: the set, the logs, and the room that is left.

use embedded_storage_async::nor_flash::NorFlash;
use sequential_storage::cache::{Cache, Uncached};
use sequential_storage::map::{MapConfig, MapStorage, SerializationError, Value};

use crate::error::Error;
use crate::set::{Condition, Saves, Written, numbered};

/// Most bytes of a set or a log.
pub const MOST_BYTES: usize = 3 * 1024;

/// Bytes that [`Memory::start`] leaves for what is kept until the next start; of a small page half.
pub const RESERVE: u32 = 48 * 1024;

/// Keys of the items.
const SET: u8 = 0;
const BEGUN: u8 = 1;
const FINISHED: u8 = 2;
/// Fills a page up, so that it turns.
const PADDING: u8 = 3;
const FIRST_LOG: u8 = 16;
/// Of a key; the value lies behind it, in the flash and in a buffer.
const KEY_BYTES: u32 = 1;

/// Of a page, in bytes.
const SMALLEST_PAGE: u32 = 16 * 1024;

/// Bytes of the longest item with its key, header and alignment.
const LONGEST_ITEM: u32 = MOST_BYTES as u32 + 32;
const SHORT_ITEM: u32 = 32;
/// What a save needs at most.
const SAVE: u32 = LONGEST_ITEM + 2 * SHORT_ITEM;
const PAGES: u32 = 2;
/// What an erased word reads.
const ERASED: u8 = 0xFF;

/// What is kept beside the set, each by itself: the newest that can be read counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Log {
    /// What has happened.
    Events = 0,
}

type Map<F> = MapStorage<u8, F, Cache<Uncached, Uncached, Uncached, u8>>;

/// Two pages of flash.
pub struct Memory<F: NorFlash> {
    map: Map<F>,
    saves: Saves,
    condition: Condition,
    /// Bytes left in the page that is being filled, at least.
    room: u32,
}

impl<F: NorFlash> Memory<F> {
    /// Of a flash that nothing is known of yet. Two pages: a flash of another size does not compile, or is refused by [`Memory::start`].
    pub const fn new(flash: F) -> Self {
        let config = MapConfig::new(0..Self::BYTES);
        let map = MapStorage::new(flash, config, Cache::new_uncached());
        Self { map, saves: Saves { begun: 0, set: 0, finished: 0 }, condition: Condition::Empty, room: 0 }
    }

    const PAGE: u32 = F::ERASE_SIZE as u32;
    /// What is written at once; items begin at its multiples.
    const WORD: u32 = if F::WRITE_SIZE > F::READ_SIZE { F::WRITE_SIZE as u32 } else { F::READ_SIZE as u32 };
    /// Of a page, the words that say how full it is.
    const FRAME: u32 = 2 * Self::WORD;
    const PADDING_BYTES: usize = if MOST_BYTES < F::ERASE_SIZE / 8 { MOST_BYTES } else { F::ERASE_SIZE / 8 };
    /// As many fill a page.
    const PADDINGS: usize = F::ERASE_SIZE / Self::PADDING_BYTES + 2;
    /// No log takes it.
    const OF_SETS: u32 = Self::RESERVE / 2 + LONGEST_ITEM;
    const OVERHEAD: u32 = Map::<F>::item_overhead_size();
    const BYTES: u32 = Self::PAGE.saturating_mul(PAGES);
    const RESERVE: u32 = {
        const { assert!(Self::PAGE >= SMALLEST_PAGE, "a page takes a set, the logs and what a save needs besides") };
        if RESERVE < Self::PAGE / 2 { RESERVE } else { Self::PAGE / 2 }
    };

    /// Finds out what is there, mends what a cut has left, and makes room. The only time at which a page is erased.
    ///
    /// Reads all of both pages; takes the time of an erase where one is due, and of 45 KB of words before it. `buffer`: [`MOST_BYTES`] and 32 more.
    ///
    /// # Errors
    /// [`Error::Flash`], or [`Error::Damaged`] where not even erasing helps.
    pub async fn start(&mut self, buffer: &mut [u8]) -> Result<Condition, Error<F::Error>> {
        let found = self.look(buffer).await;
        self.measure().await?;
        match found {
            Ok(()) => {}
            // No page is blank and none is being filled: these are not ours, or more is lost than one of them. A part is delivered erased. And what is
            // damaged may look like an item that is longer than all of ours.
            Err(Error::Damaged | Error::TooLong) => {
                self.map.erase_all().await?;
                self.saves = Saves::default();
                self.measure().await?;
                self.condition = Condition::Damaged;
                return Ok(self.condition);
            }
            Err(error) => return Err(error),
        }
        self.condition = self.saves.condition();
        let mended = if self.condition == Condition::Unfinished {
            self.number(buffer, BEGUN, self.saves.set.max(self.saves.finished)).await
        } else if self.condition == Condition::Whole && self.saves.finished < self.saves.set {
            self.number(buffer, FINISHED, self.saves.set).await
        } else {
            Ok(())
        };
        if mended.is_err() {
            // A page that keeps nothing any more.
            self.room = 0;
        }
        // What was cut or damaged may hide what lies behind it: it goes with its page.
        if self.room < Self::RESERVE || matches!(self.condition, Condition::Unfinished | Condition::Damaged) {
            // What is there is there, also where no room can be made: then nothing more is kept.
            if self.turn(buffer).await.is_err() {
                self.room = 0;
            }
        }
        Ok(self.condition)
    }

    /// Bytes that can be kept until the next start, at least.
    pub const fn room(&self) -> u32 {
        self.room
    }

    /// The flash below, for tests and tools.
    pub const fn flash(&mut self) -> &mut F {
        self.map.flash()
    }

    /// The set; `None` where there is none, or where the last one was damaged. Scans a page: for a start.
    ///
    /// # Errors
    /// [`Error::Flash`], [`Error::TooLong`] for a buffer that is too small.
    pub async fn load<'b>(&mut self, buffer: &'b mut [u8]) -> Result<Option<&'b [u8]>, Error<F::Error>> {
        if self.condition == Condition::Damaged {
            return Ok(None);
        }
        let bytes = self.map.fetch_item::<&[u8]>(buffer, &SET).await?;
        Ok(bytes.and_then(numbered).map(|(_, set)| set))
    }

    /// Keeps a set in place of the one before. `write` puts it into the buffer and says how long it is.
    ///
    /// Programs some 500 words, each when the flash permits it.
    ///
    /// # Errors
    /// All of [`Error`]; the set before is in force then, or, where only its last word was refused, this one.
    pub async fn save(
        &mut self,
        buffer: &mut [u8],
        mut write: impl FnMut(&mut [u8]) -> Option<usize>,
    ) -> Result<(), Error<F::Error>> {
        self.has_room(SAVE)?;
        let number = self.saves.next();
        self.number(buffer, BEGUN, number).await?;
        self.replace(buffer, number, &Written::new(Some(number), &mut write)).await
    }

    /// Keeps the set once more, changed: `edit` finds it at the beginning of what it is given, so many bytes long, and says how long it is afterwards, or that
    /// it cannot. It is asked once to know that it can, before anything is written, and then once more with the set, or twice, then with what it has made
    /// before. `false`: there is no set, and nothing has happened.
    ///
    /// Scans a page twice more than [`Memory::save`].
    ///
    /// # Errors
    /// [`Error::Refused`] where `edit` cannot: nothing was written. Those of [`Memory::save`]; the set before is in force then, whole, or, where only the last word was refused, the changed one.
    pub async fn amend(
        &mut self,
        buffer: &mut [u8],
        mut edit: impl FnMut(&mut [u8], usize) -> Option<usize>,
    ) -> Result<bool, Error<F::Error>> {
        self.has_room(SAVE)?;
        let Some(length) = self.last_set(buffer).await? else { return Ok(false) };
        let (before, number) = (self.saves.set, self.saves.next());
        let room = buffer.get_mut(KEY_BYTES as usize..).ok_or(Error::TooLong)?;
        match Written::over(before, number, &mut amending(&mut edit, length)).serialize_into(room) {
            Ok(_) => {}
            Err(SerializationError::BufferTooSmall) => return Err(Error::Refused),
            Err(_) => return Err(Error::Damaged),
        }
        self.number(buffer, BEGUN, number).await?;
        // It comes to lie where it is put together: a second buffer would be as long as this one.
        let length = self.last_set(buffer).await?.ok_or(Error::Damaged)?;
        self.replace(buffer, number, &Written::over(before, number, &mut amending(&mut edit, length))).await?;
        Ok(true)
    }

    /// Bytes of the set, which lies in the buffer then; `None` as with [`Memory::load`].
    async fn last_set(&mut self, buffer: &mut [u8]) -> Result<Option<usize>, Error<F::Error>> {
        if self.condition == Condition::Damaged {
            return Ok(None);
        }
        match self.map.fetch_item::<&[u8]>(buffer, &SET).await?.and_then(numbered) {
            Some((number, set)) if number == self.saves.set => Ok(Some(set.len())),
            // The last one can be read no more since the start.
            Some(_) => Err(Error::Damaged),
            None => Ok(None),
        }
    }

    /// The second and the third item of a save.
    async fn replace(&mut self, buffer: &mut [u8], number: u32, set: &Written<'_>) -> Result<(), Error<F::Error>> {
        self.store(buffer, SET, set).await?;
        // What is damaged behind the last item may hide the next one.
        let bytes = self.map.fetch_item::<&[u8]>(buffer, &SET).await;
        if !bytes.is_ok_and(|bytes| bytes.and_then(numbered).is_some_and(|(found, _)| found == number)) {
            return Err(Error::Damaged);
        }
        self.saves.set = number;
        self.number(buffer, FINISHED, number).await?;
        self.condition = Condition::Whole;
        Ok(())
    }

    /// A log, or `None`. Scans a page: for a start.
    ///
    /// # Errors
    /// [`Error::Flash`], [`Error::TooLong`] for a buffer that is too small.
    pub async fn load_log<'b>(&mut self, buffer: &'b mut [u8], log: Log) -> Result<Option<&'b [u8]>, Error<F::Error>> {
        Ok(self.map.fetch_item::<&[u8]>(buffer, &key(log)).await?)
    }

    /// Keeps a log in place of the one before, as [`Memory::save`] keeps a set. Half of [`RESERVE`] is left for sets.
    ///
    /// # Errors
    /// All of [`Error`]; the log before is there then.
    pub async fn save_log(
        &mut self,
        buffer: &mut [u8],
        log: Log,
        mut write: impl FnMut(&mut [u8]) -> Option<usize>,
    ) -> Result<(), Error<F::Error>> {
        self.has_room(Self::OF_SETS)?;
        self.store(buffer, key(log), &Written::new(None, &mut write)).await
    }

    const fn has_room(&self, needed: u32) -> Result<(), Error<F::Error>> {
        if self.room < needed { Err(Error::Full { left: self.room, needed }) } else { Ok(()) }
    }

    async fn look(&mut self, buffer: &mut [u8]) -> Result<(), Error<F::Error>> {
        self.saves = Saves::default();
        let mut items = self.map.fetch_all_items(buffer).await?;
        // The newest comes last.
        while let Some((key, value)) = items.next::<&[u8]>(buffer).await? {
            let Some((number, _)) = numbered(value) else { continue };
            match key {
                SET => self.saves.set = number,
                BEGUN => self.saves.begun = number,
                FINISHED => self.saves.finished = number,
                _ => {}
            }
        }
        Ok(())
    }

    async fn number(&mut self, buffer: &mut [u8], key: u8, number: u32) -> Result<(), Error<F::Error>> {
        self.store(buffer, key, &Written::new(Some(number), &mut |_: &mut [u8]| Some(0))).await?;
        match key {
            BEGUN => self.saves.begun = number,
            _ => self.saves.finished = number,
        }
        Ok(())
    }

    /// Fills the page up until it turns: what is in force goes over to the other one, and this one is erased.
    async fn turn(&mut self, buffer: &mut [u8]) -> Result<(), Error<F::Error>> {
        let before = self.filling().await?;
        if let Some(spare) = before.map(other)
            && self.erased_at_end(spare, Self::PAGE).await? < Self::PAGE
        {
            // It says that it is erased, and is not: an erase was cut, or a bit is damaged.
            let from = spare.saturating_mul(Self::PAGE);
            self.map.flash().erase(from, from.saturating_add(Self::PAGE)).await.map_err(Error::Flash)?;
        }
        for _ in 0..Self::PADDINGS {
            let length = Self::PADDING_BYTES;
            let mut padding = |room: &mut [u8]| {
                let room = room.get_mut(..length)?;
                room.fill(0);
                Some(length)
            };
            self.store(buffer, PADDING, &Written::new(None, &mut padding)).await?;
            if self.filling().await? != before {
                break;
            }
        }
        // Or it would go over with every turn.
        self.store(buffer, PADDING, &Written::new(None, &mut |_: &mut [u8]| Some(0))).await?;
        self.measure().await
    }

    async fn store(&mut self, buffer: &mut [u8], key: u8, value: &Written<'_>) -> Result<(), Error<F::Error>> {
        /// A word that does not become what it should is passed over.
        const ATTEMPTS: usize = 3;
        let mut last = Error::Damaged;
        for _ in 0..ATTEMPTS {
            let stored = self.map.store_item_generic(buffer, &key, value).await;
            // As much as was to be stored: what was cut lies there too.
            let data = value.length().saturating_add(KEY_BYTES).next_multiple_of(Self::WORD);
            self.room = self.room.saturating_sub(data.saturating_add(Self::OVERHEAD));
            match stored.map_err(Error::from) {
                Ok(()) => return Ok(()),
                Err(error @ Error::Flash(_)) if self.room >= LONGEST_ITEM => last = error,
                Err(error) => return Err(error),
            }
        }
        Err(last)
    }

    /// What is left of the page that is being filled, [`Self::RESERVE`] at most: a start has no time to look at more. 0 where the next item would have to
    /// erase the other page.
    async fn measure(&mut self) -> Result<(), Error<F::Error>> {
        let reserve = Self::RESERVE.saturating_add(Self::FRAME);
        let erased = match self.filling().await? {
            Some(page) => self.erased_at_end(page, reserve).await?,
            None if self.is_blank().await? => reserve,
            None => 0,
        };
        self.room = erased.saturating_sub(Self::FRAME);
        Ok(())
    }

    /// The page that is being filled: its first word is written, its last is not, and the other one says that it is erased.
    async fn filling(&mut self) -> Result<Option<u32>, Error<F::Error>> {
        for page in 0..PAGES {
            if self.marks(page).await? == (true, false) && self.marks(other(page)).await? == (false, false) {
                return Ok(Some(page));
            }
        }
        Ok(None)
    }

    async fn is_blank(&mut self) -> Result<bool, Error<F::Error>> {
        Ok(self.marks(0).await? == (false, false) && self.marks(1).await? == (false, false))
    }

    /// Whether something is written into the first word of a page, and into its last.
    async fn marks(&mut self, page: u32) -> Result<(bool, bool), Error<F::Error>> {
        const WORD: u32 = 4;
        let first = page.saturating_mul(Self::PAGE);
        let last = first.saturating_add(Self::PAGE).saturating_sub(WORD);
        let mut word = [[0; WORD as usize]; 2];
        for (word, at) in word.iter_mut().zip([first, last]) {
            self.map.flash().read(at, word).await.map_err(Error::Flash)?;
        }
        let [first, last] = word.map(|word| word != [ERASED; WORD as usize]);
        Ok((first, last))
    }

    /// Erased bytes at the end of a page, as far as `limit`. A drive starts behind it: whole chunks are compared at once, by words.
    async fn erased_at_end(&mut self, page: u32, limit: u32) -> Result<u32, Error<F::Error>> {
        const CHUNK: u32 = 256;
        let end = page.saturating_add(1).saturating_mul(Self::PAGE);
        let mut erased = 0_u32;
        let mut chunk = [0_u8; CHUNK as usize];
        while erased < limit {
            let from = end.saturating_sub(erased).saturating_sub(CHUNK);
            self.map.flash().read(from, &mut chunk).await.map_err(Error::Flash)?;
            if !chunk.as_chunks::<4>().0.iter().all(|word| u32::from_ne_bytes(*word) == u32::MAX) {
                let more = chunk.iter().rev().take_while(|byte| **byte == ERASED).count() as u32;
                return Ok(erased.saturating_add(more).min(limit));
            }
            erased = erased.saturating_add(CHUNK);
        }
        Ok(limit)
    }
}

/// What puts a set of `length` bytes into its place that lies there already.
fn amending(
    edit: &mut impl FnMut(&mut [u8], usize) -> Option<usize>,
    mut length: usize,
) -> impl FnMut(&mut [u8]) -> Option<usize> {
    move |set| {
        length = edit(set, length)?;
        Some(length)
    }
}

/// The other page.
const fn other(page: u32) -> u32 {
    PAGES.saturating_sub(1).saturating_sub(page)
}

const fn key(log: Log) -> u8 {
    FIRST_LOG.saturating_add(log as u8)
}
