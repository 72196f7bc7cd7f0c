//! The values of all data blocks with [`Location::Parameter`](crate::data_block::Location::Parameter), in RAM.

use crate::capacity::{IDN_LISTS, LIST_ENTRIES, LONG_ENTRIES, LONG_LISTS, TEXT_BYTES, TEXTS, VALUES, WORD_LISTS};
use crate::data_block::{DataBlock, Place, Selection};
use crate::dictionary::Dictionary;
use crate::error::ServiceError;
use crate::idn::Idn;
use crate::telegram_type::TelegramType;
use heapless::{String, Vec};

mod block_set;
mod record;

use block_set::BlockSet;

pub use record::MOST_BYTES;

/// Highest bit number of a signal word's allocation (S-0-0328, S-0-0329): all data that have bits have two bytes.
pub const HIGHEST_BIT: u16 = 15;

/// Values, lists and texts, and which of them the master has written since CP2 began.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Parameters {
    dictionary: &'static Dictionary,
    values: [u32; VALUES],
    idns: [Vec<Idn, LIST_ENTRIES>; IDN_LISTS],
    words: [Vec<u16, LIST_ENTRIES>; WORD_LISTS],
    longs: [Vec<u32, LONG_ENTRIES>; LONG_LISTS],
    texts: [String<TEXT_BYTES>; TEXTS],
    written: BlockSet,
    told: BlockSet,
}

impl Parameters {
    /// All values as the table gives them; lists and texts empty; nothing written.
    pub fn new(dictionary: &'static Dictionary) -> Self {
        let mut parameters = Self {
            dictionary,
            values: [0; VALUES],
            idns: [const { Vec::new() }; IDN_LISTS],
            words: [const { Vec::new() }; WORD_LISTS],
            longs: [const { Vec::new() }; LONG_LISTS],
            texts: [const { String::new() }; TEXTS],
            written: BlockSet::new(),
            told: BlockSet::new(),
        };
        for block in dictionary.blocks() {
            if let Place::Value(index) = block.place
                && let Some(value) = parameters.values.get_mut(usize::from(index))
            {
                *value = (block.default_as_transmitted() & 0xFFFF_FFFF) as u32;
            }
        }
        parameters
    }

    /// The table whose parameters these are.
    pub const fn dictionary(&self) -> &'static Dictionary {
        self.dictionary
    }

    fn place_of(&self, idn: Idn) -> Place {
        self.dictionary.find(idn).map_or(Place::None, |block| block.place)
    }

    /// A parameter of two or four bytes, as it is transmitted (two-byte values in the low half).
    ///
    /// 0 for an IDN that is no such parameter, which is a mistake of the caller: debug builds panic.
    pub fn get(&self, idn: Idn) -> u32 {
        let value = match self.place_of(idn) {
            Place::Value(index) => self.values.get(usize::from(index)).copied(),
            _ => None,
        };
        debug_assert!(value.is_some(), "{idn} is not a parameter of two or four bytes");
        value.unwrap_or(0)
    }

    /// Like [`Parameters::get`], with the sign that the attribute gives the value.
    pub fn get_signed(&self, idn: Idn) -> i64 {
        let raw = self.get(idn);
        self.dictionary.find(idn).map_or(0, |block| block.attribute.value_of(raw.into()))
    }

    /// Like [`Parameters::get`] for two-byte parameters.
    pub fn get_word(&self, idn: Idn) -> u16 {
        (self.get(idn) & 0xFFFF) as u16
    }

    /// A list of IDNs; empty for an IDN that is none (debug builds panic).
    pub fn list(&self, idn: Idn) -> &[Idn] {
        let list = match self.place_of(idn) {
            Place::Idns(index) => self.idns.get(usize::from(index)),
            _ => None,
        };
        debug_assert!(list.is_some(), "{idn} is not a list of IDNs");
        list.map_or(&[], |list| list.as_slice())
    }

    /// A list of two-byte numbers; empty for an IDN that is none (debug builds panic).
    pub fn words(&self, idn: Idn) -> &[u16] {
        let list = match self.place_of(idn) {
            Place::Words(index) => self.words.get(usize::from(index)),
            _ => None,
        };
        debug_assert!(list.is_some(), "{idn} is not a list of two-byte numbers");
        list.map_or(&[], |list| list.as_slice())
    }

    /// A list of four-byte numbers; empty for an IDN that is none (debug builds panic).
    pub fn longs(&self, idn: Idn) -> &[u32] {
        let list = match self.place_of(idn) {
            Place::Longs(index) => self.longs.get(usize::from(index)),
            _ => None,
        };
        debug_assert!(list.is_some(), "{idn} is not a list of four-byte numbers");
        list.map_or(&[], |list| list.as_slice())
    }

    /// A text parameter; empty for an IDN that is none (debug builds panic).
    pub fn text(&self, idn: Idn) -> &str {
        let text = match self.place_of(idn) {
            Place::Text(index) => self.texts.get(usize::from(index)),
            _ => None,
        };
        debug_assert!(text.is_some(), "{idn} is not a text parameter");
        text.map_or("", |text| text.as_str())
    }

    /// Sets a parameter of fixed length on behalf of the drive (stored values, automatic choices); does not count as
    /// written by the master, and ignores write protection. S-0-0001 follows S-0-0002 until the master writes it.
    ///
    /// # Errors
    /// [`ServiceError::BelowMinimum`], [`ServiceError::AboveMaximum`]; for an allocation of a real-time bit
    /// [`ServiceError::IdnNotAvailable`] or [`ServiceError::InvalidData`] (sercos2.md 6.1), which a cycle time has too that is none
    /// (sercos2.md 5.5);
    /// [`ServiceError::IdnNotAvailable`] for an IDN that is no such parameter. Nothing is changed then.
    pub fn set(&mut self, idn: Idn, raw: u64) -> Result<(), ServiceError> {
        let block = self.dictionary.find(idn).ok_or(ServiceError::IdnNotAvailable)?;
        check_limits(block, raw)?;
        let low = (raw & 0xFFFF_FFFF) as u32;
        match self.place_of(idn) {
            Place::Value(index) => {
                self.check_allocation(idn, Idn((raw & 0xFFFF) as u16))?;
                check_cycle(idn, (raw & 0xFFFF) as u16)?;
                let cell = self.values.get_mut(usize::from(index)).ok_or(ServiceError::IdnNotAvailable)?;
                *cell = if block.fixed_bytes() == Some(2) { low & 0xFFFF } else { low };
                if idn == Idn::CYCLE {
                    self.follow_cycle();
                }
            }
            _ => return Err(ServiceError::IdnNotAvailable),
        }
        Ok(())
    }

    /// Sets a list of IDNs; otherwise like [`Parameters::set`].
    ///
    /// # Errors
    /// [`ServiceError::InvalidData`] if the list is too long or names an IDN that cannot stand in it;
    /// [`ServiceError::IdnNotAvailable`] if there is no such list parameter.
    pub fn set_list(&mut self, idn: Idn, entries: &[Idn]) -> Result<(), ServiceError> {
        let Place::Idns(index) = self.place_of(idn) else {
            return Err(ServiceError::IdnNotAvailable);
        };
        let list = self.idns.get_mut(usize::from(index)).ok_or(ServiceError::IdnNotAvailable)?;
        let selection = match idn {
            Idn::AT_LIST => Selection::ConfigurableInAt,
            Idn::MDT_LIST => Selection::ConfigurableInMdt,
            Idn::SIGNAL_STATUS_LIST => Selection::BitSources,
            Idn::SIGNAL_CONTROL_LIST => Selection::BitTargets,
            Idn::SELECTED_BACKUP => Selection::Backup,
            _ => Selection::All,
        };
        let is_known = |entry: &Idn| self.dictionary.find(*entry).is_some_and(|block| block.is_in(selection));
        if !entries.iter().all(is_known) {
            return Err(ServiceError::InvalidData);
        }
        *list = Vec::from_slice(entries).map_err(|_| ServiceError::InvalidData)?;
        Ok(())
    }

    /// Sets a list of two-byte numbers (the bit numbers of a signal word); otherwise like [`Parameters::set`].
    ///
    /// # Errors
    /// [`ServiceError::InvalidData`] if the list is too long or a number is above [`HIGHEST_BIT`];
    /// [`ServiceError::IdnNotAvailable`] if there is no such list parameter.
    pub fn set_words(&mut self, idn: Idn, entries: &[u16]) -> Result<(), ServiceError> {
        let Place::Words(index) = self.place_of(idn) else {
            return Err(ServiceError::IdnNotAvailable);
        };
        let list = self.words.get_mut(usize::from(index)).ok_or(ServiceError::IdnNotAvailable)?;
        if entries.iter().any(|&bit| bit > HIGHEST_BIT) {
            return Err(ServiceError::InvalidData);
        }
        *list = Vec::from_slice(entries).map_err(|_| ServiceError::InvalidData)?;
        Ok(())
    }

    /// Sets a list of four-byte numbers; otherwise like [`Parameters::set`].
    ///
    /// # Errors
    /// [`ServiceError::InvalidData`] if the list is too long; [`ServiceError::IdnNotAvailable`] if there is no such list
    /// parameter.
    pub fn set_longs(&mut self, idn: Idn, entries: &[u32]) -> Result<(), ServiceError> {
        let Place::Longs(index) = self.place_of(idn) else {
            return Err(ServiceError::IdnNotAvailable);
        };
        let list = self.longs.get_mut(usize::from(index)).ok_or(ServiceError::IdnNotAvailable)?;
        *list = Vec::from_slice(entries).map_err(|_| ServiceError::InvalidData)?;
        Ok(())
    }

    /// Sets a text parameter; otherwise like [`Parameters::set`].
    ///
    /// # Errors
    /// [`ServiceError::InvalidData`] if the text is too long or not UTF-8; [`ServiceError::IdnNotAvailable`] if there
    /// is no such text parameter.
    pub fn set_text(&mut self, idn: Idn, bytes: &[u8]) -> Result<(), ServiceError> {
        let Place::Text(index) = self.place_of(idn) else {
            return Err(ServiceError::IdnNotAvailable);
        };
        let text = self.texts.get_mut(usize::from(index)).ok_or(ServiceError::IdnNotAvailable)?;
        let bytes = Vec::from_slice(bytes).map_err(|_| ServiceError::InvalidData)?;
        *text = String::from_utf8(bytes).map_err(|_| ServiceError::InvalidData)?;
        Ok(())
    }

    /// What a parameter is, for [`Parameters::restore`].
    pub(crate) fn save(&self, idn: Idn) -> Saved {
        match self.place_of(idn) {
            Place::None | Place::Command(_) => Saved::Nothing,
            Place::Value(_) => Saved::Value(self.get(idn)),
            Place::Idns(index) => Saved::Idns(self.idns.get(usize::from(index)).cloned().unwrap_or_default()),
            Place::Words(index) => Saved::Words(self.words.get(usize::from(index)).cloned().unwrap_or_default()),
            Place::Longs(index) => Saved::Longs(self.longs.get(usize::from(index)).cloned().unwrap_or_default()),
            Place::Text(index) => Saved::Text(self.texts.get(usize::from(index)).cloned().unwrap_or_default()),
        }
    }

    /// Takes a write back.
    pub(crate) fn restore(&mut self, idn: Idn, saved: Saved) {
        // It was there before: nothing refuses it.
        let _ = match saved {
            Saved::Nothing => Ok(()),
            Saved::Value(value) => self.set(idn, value.into()),
            Saved::Idns(list) => self.set_list(idn, &list),
            Saved::Words(list) => self.set_words(idn, &list),
            Saved::Longs(list) => self.set_longs(idn, &list),
            Saved::Text(text) => self.set_text(idn, text.as_bytes()),
        };
    }

    /// S-0-0262: everything that a control saves (S-0-0192) goes back to the table's defaults. The communication parameters, which
    /// the master writes anew in every run-up, stay.
    pub fn load_defaults(&mut self) {
        for block in self.dictionary.select(Selection::Backup) {
            // A default within its limits is never refused; lists and texts are empty.
            let _ = match block.place {
                Place::None | Place::Command(_) => Ok(()),
                Place::Value(_) => self.set(block.idn, block.default_as_transmitted()),
                Place::Idns(_) => self.set_list(block.idn, &[]),
                Place::Words(_) => self.set_words(block.idn, &[]),
                Place::Longs(_) => self.set_longs(block.idn, &[]),
                Place::Text(_) => self.set_text(block.idn, &[]),
            };
        }
    }

    /// S-0-0326: a checksum over everything that a control saves (S-0-0327), in the order of the IDNs. Two drives with
    /// the same checksum have the same settings.
    pub fn checksum(&self) -> u32 {
        let cell = |index: u8| self.values.get(usize::from(index)).copied().unwrap_or(0);
        let mut sum = Checksum::new();
        for block in self.dictionary.select(Selection::Backup) {
            sum.add(block.idn.0.into());
            match block.place {
                Place::None | Place::Command(_) => {}
                Place::Value(index) => sum.add(cell(index)),
                Place::Idns(_) => self.list(block.idn).iter().for_each(|entry| sum.add(entry.0.into())),
                Place::Words(_) => self.words(block.idn).iter().for_each(|&entry| sum.add(entry.into())),
                Place::Longs(_) => self.longs(block.idn).iter().for_each(|&entry| sum.add(entry)),
                Place::Text(_) => self.text(block.idn).bytes().for_each(|byte| sum.add(byte.into())),
            }
        }
        sum.0
    }

    /// True if the master has written the data block since [`Parameters::forget_written`].
    pub fn is_written(&self, idn: Idn) -> bool {
        self.dictionary.find(idn).is_some_and(|block| self.written.contains(block))
    }

    /// True if somebody has told the drive this value since its start, or the memory has: it is not just the table's default.
    pub fn is_told(&self, idn: Idn) -> bool {
        self.dictionary.find(idn).is_some_and(|block| self.told.contains(block))
    }

    /// From here on nobody has told anything, whatever the values are.
    pub fn forget_told(&mut self) {
        self.told = BlockSet::new();
    }

    /// To be called on entering CP2: S-0-0127 wants certain data to be written anew.
    pub fn forget_written(&mut self) {
        self.written = BlockSet::new();
        self.follow_cycle();
    }

    /// Checks the IDN that a real-time bit is to be tied to; 0 unties it (sercos2.md 6.1).
    fn check_allocation(&self, bit: Idn, idn: Idn) -> Result<(), ServiceError> {
        let selection = match bit {
            Idn::REAL_TIME_CONTROL_BIT_1 | Idn::REAL_TIME_CONTROL_BIT_2 => Selection::BitTargets,
            Idn::REAL_TIME_STATUS_BIT_1 | Idn::REAL_TIME_STATUS_BIT_2 => Selection::BitSources,
            _ => return Ok(()),
        };
        if idn == Idn(0) {
            return Ok(());
        }
        let block = self.dictionary.find(idn).ok_or(ServiceError::IdnNotAvailable)?;
        if block.is_in(selection) { Ok(()) } else { Err(ServiceError::InvalidData) }
    }

    /// S-0-0001 is S-0-0002 as long as the master has not written it.
    fn follow_cycle(&mut self) {
        if !self.is_written(Idn::CONTROL_UNIT_CYCLE) {
            // They have the same limits.
            let _ = self.set(Idn::CONTROL_UNIT_CYCLE, self.get(Idn::CYCLE).into());
        }
    }

    /// One data block is no longer written by the master.
    pub fn forget(&mut self, idn: Idn) {
        if let Some(block) = self.dictionary.find(idn) {
            self.written.set(block, false);
        }
    }

    /// The master has written the data block.
    pub fn mark_written(&mut self, idn: Idn) {
        if let Some(block) = self.dictionary.find(idn) {
            self.told.set(block, true);
            self.written.set(block, true);
        }
    }

    /// The telegram type of S-0-0015; `None` if its value is not a type of sercos2.md 1.8.
    pub fn telegram_type(&self) -> Option<TelegramType> {
        TelegramType::from_parameter(self.get_word(Idn::TELEGRAM_TYPE))
    }

    /// IDNs in the AT, by telegram type or S-0-0016.
    pub fn cyclic_at(&self) -> &[Idn] {
        match self.telegram_type() {
            Some(telegram_type) => telegram_type.at().unwrap_or(self.list(Idn::AT_LIST)),
            None => &[],
        }
    }

    /// IDNs in this drive's MDT record, by telegram type or S-0-0024.
    pub fn cyclic_mdt(&self) -> &[Idn] {
        match self.telegram_type() {
            Some(telegram_type) => telegram_type.mdt().unwrap_or(self.list(Idn::MDT_LIST)),
            None => &[],
        }
    }
}

/// The value of one parameter, whatever its kind.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Saved {
    /// The data block is no parameter.
    Nothing,
    Value(u32),
    Idns(Vec<Idn, LIST_ENTRIES>),
    Words(Vec<u16, LIST_ENTRIES>),
    Longs(Vec<u32, LONG_ENTRIES>),
    Text(String<TEXT_BYTES>),
}

/// Checks a value of fixed length against the limits of its data block.
pub(crate) fn check_limits(block: &DataBlock, raw: u64) -> Result<(), ServiceError> {
    let value = block.attribute.value_of(raw);
    if block.minimum.is_some_and(|minimum| value < minimum) {
        return Err(ServiceError::BelowMinimum);
    }
    if block.maximum.is_some_and(|maximum| value > maximum) {
        return Err(ServiceError::AboveMaximum);
    }
    Ok(())
}

/// Cycle times are multiples of 250 us (sercos2.md 5.5).
fn check_cycle(idn: Idn, microseconds: u16) -> Result<(), ServiceError> {
    const STEP: u16 = 250;
    let is_cycle = matches!(idn, Idn::CONTROL_UNIT_CYCLE | Idn::CYCLE);
    if is_cycle && microseconds.checked_rem(STEP) != Some(0) { Err(ServiceError::InvalidData) } else { Ok(()) }
}

/// Each word turned into the sum and multiplied.
struct Checksum(u32);

impl Checksum {
    const fn new() -> Self {
        Self(0x811C_9DC5)
    }

    /// Every step can be undone, so that one other word is never the same sum; a whole word a step keeps S-0-0326 within the
    /// 100 us of a service step.
    const fn add(&mut self, word: u32) {
        self.0 = (self.0.rotate_left(5) ^ word).wrapping_mul(0x9E37_79B1);
    }
}

#[cfg(test)]
mod tests;
