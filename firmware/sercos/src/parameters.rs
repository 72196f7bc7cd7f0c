//! The values of all data blocks with [`Location::Parameter`], in RAM.

use crate::data_block::{DataBlock, Location, Selection};
use crate::dictionary::{self, ROWS};
use crate::idn::Idn;
use crate::service::ServiceError;
use crate::telegram_type::TelegramType;
use heapless::{String, Vec};

/// Most entries of a list parameter (S-0-0016, S-0-0024).
pub const LIST_ENTRIES: usize = 16;

/// Most bytes of a text parameter (S-0-0141, S-0-0142).
pub const TEXT_BYTES: usize = 40;

/// Values, lists and texts, and which of them the master has written since CP2 began.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Parameters {
    cells: [u32; COUNTS.cells],
    lists: [Vec<Idn, LIST_ENTRIES>; COUNTS.lists],
    texts: [String<TEXT_BYTES>; COUNTS.texts],
    written: [u32; ROWS.len().div_ceil(32)],
}

impl Default for Parameters {
    fn default() -> Self {
        Self::new()
    }
}

impl Parameters {
    /// All values as the table gives them; lists and texts empty; nothing written.
    pub const fn new() -> Self {
        Self {
            cells: DEFAULTS,
            lists: [const { Vec::new() }; COUNTS.lists],
            texts: [const { String::new() }; COUNTS.texts],
            written: [0; ROWS.len().div_ceil(32)],
        }
    }

    /// A parameter of fixed length, as it is transmitted (two-byte values in the low half).
    ///
    /// 0 for an IDN that is no such parameter, which is a mistake of the caller: debug builds panic.
    pub fn get(&self, idn: Idn) -> u32 {
        let value = self.cell(idn);
        debug_assert!(value.is_some(), "{idn} is not a parameter of fixed length");
        value.unwrap_or(0)
    }

    /// Like [`Parameters::get`], with the sign that the attribute gives the value.
    pub fn get_signed(&self, idn: Idn) -> i64 {
        let raw = self.get(idn);
        dictionary::find(idn).map_or(0, |block| block.attribute.value_of(raw))
    }

    /// Like [`Parameters::get`] for two-byte parameters.
    pub fn get_word(&self, idn: Idn) -> u16 {
        (self.get(idn) & 0xFFFF) as u16
    }

    /// A list parameter; empty for an IDN that is none (debug builds panic).
    pub fn list(&self, idn: Idn) -> &[Idn] {
        let list = match storage_of(idn) {
            Storage::List(index) => self.lists.get(usize::from(index)),
            _ => None,
        };
        debug_assert!(list.is_some(), "{idn} is not a list parameter");
        list.map_or(&[], |list| list.as_slice())
    }

    /// A text parameter; empty for an IDN that is none (debug builds panic).
    pub fn text(&self, idn: Idn) -> &str {
        let text = match storage_of(idn) {
            Storage::Text(index) => self.texts.get(usize::from(index)),
            _ => None,
        };
        debug_assert!(text.is_some(), "{idn} is not a text parameter");
        text.map_or("", |text| text.as_str())
    }

    /// Sets a parameter of fixed length on behalf of the drive (stored values, automatic choices); does not count as
    /// written by the master, and ignores write protection.
    ///
    /// # Errors
    /// [`ServiceError::BelowMinimum`], [`ServiceError::AboveMaximum`]; [`ServiceError::IdnNotAvailable`] for an IDN
    /// that is no such parameter. Nothing is changed then.
    pub fn set(&mut self, idn: Idn, raw: u32) -> Result<(), ServiceError> {
        let block = dictionary::find(idn).ok_or(ServiceError::IdnNotAvailable)?;
        check_limits(block, raw)?;
        let Storage::Cell(index) = storage_of(idn) else {
            return Err(ServiceError::IdnNotAvailable);
        };
        let cell = self.cells.get_mut(usize::from(index)).ok_or(ServiceError::IdnNotAvailable)?;
        *cell = if block.fixed_bytes() == Some(2) { raw & 0xFFFF } else { raw };
        Ok(())
    }

    /// Sets a list parameter; otherwise like [`Parameters::set`].
    ///
    /// # Errors
    /// [`ServiceError::InvalidData`] if the list is too long or names an IDN that cannot be configured in its
    /// telegram; [`ServiceError::IdnNotAvailable`] if there is no such list parameter.
    pub fn set_list(&mut self, idn: Idn, entries: &[Idn]) -> Result<(), ServiceError> {
        let Storage::List(index) = storage_of(idn) else {
            return Err(ServiceError::IdnNotAvailable);
        };
        let list = self.lists.get_mut(usize::from(index)).ok_or(ServiceError::IdnNotAvailable)?;
        let selection = match idn {
            Idn::AT_LIST => Selection::ConfigurableInAt,
            Idn::MDT_LIST => Selection::ConfigurableInMdt,
            _ => Selection::All,
        };
        let is_known = |entry: &Idn| dictionary::find(*entry).is_some_and(|block| block.is_in(selection));
        if !entries.iter().all(is_known) {
            return Err(ServiceError::InvalidData);
        }
        *list = Vec::from_slice(entries).map_err(|_| ServiceError::InvalidData)?;
        Ok(())
    }

    /// Sets a text parameter; otherwise like [`Parameters::set`].
    ///
    /// # Errors
    /// [`ServiceError::InvalidData`] if the text is too long or not UTF-8; [`ServiceError::IdnNotAvailable`] if there
    /// is no such text parameter.
    pub fn set_text(&mut self, idn: Idn, bytes: &[u8]) -> Result<(), ServiceError> {
        let Storage::Text(index) = storage_of(idn) else {
            return Err(ServiceError::IdnNotAvailable);
        };
        let text = self.texts.get_mut(usize::from(index)).ok_or(ServiceError::IdnNotAvailable)?;
        let bytes = Vec::from_slice(bytes).map_err(|_| ServiceError::InvalidData)?;
        *text = String::from_utf8(bytes).map_err(|_| ServiceError::InvalidData)?;
        Ok(())
    }

    /// True if the master has written the data block since [`Parameters::forget_written`].
    pub fn is_written(&self, idn: Idn) -> bool {
        written_bit(idn).is_some_and(|(word, mask)| self.written.get(word).is_some_and(|bits| bits & mask != 0))
    }

    /// To be called on entering CP2: S-0-0127 wants certain data to be written anew.
    pub fn forget_written(&mut self) {
        self.written.fill(0);
    }

    pub(crate) fn mark_written(&mut self, idn: Idn) {
        if let Some((word, mask)) = written_bit(idn) {
            if let Some(bits) = self.written.get_mut(word) {
                *bits |= mask;
            }
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

    fn cell(&self, idn: Idn) -> Option<u32> {
        match storage_of(idn) {
            Storage::Cell(index) => self.cells.get(usize::from(index)).copied(),
            _ => None,
        }
    }
}

/// Checks a value of fixed length against the limits of its data block.
pub(crate) fn check_limits(block: &DataBlock, raw: u32) -> Result<(), ServiceError> {
    let value = block.attribute.value_of(raw);
    if block.minimum.is_some_and(|minimum| value < minimum) {
        return Err(ServiceError::BelowMinimum);
    }
    if block.maximum.is_some_and(|maximum| value > maximum) {
        return Err(ServiceError::AboveMaximum);
    }
    Ok(())
}

fn written_bit(idn: Idn) -> Option<(usize, u32)> {
    let index = dictionary::index_of(idn)?;
    let bit = u32::try_from(index & 31).ok()?;
    Some((index >> 5, 1u32.checked_shl(bit)?))
}

/// Where in [`Parameters`] a data block has its value.
#[derive(Clone, Copy)]
enum Storage {
    None,
    Cell(u8),
    List(u8),
    Text(u8),
}

struct Counts {
    cells: usize,
    lists: usize,
    texts: usize,
}

const LAYOUT: ([Storage; ROWS.len()], Counts) = lay_out();
const COUNTS: Counts = LAYOUT.1;
static STORAGE: [Storage; ROWS.len()] = LAYOUT.0;
const DEFAULTS: [u32; COUNTS.cells] = defaults();

fn storage_of(idn: Idn) -> Storage {
    let storage = dictionary::index_of(idn).and_then(|index| STORAGE.get(index));
    storage.copied().unwrap_or(Storage::None)
}

#[allow(clippy::indexing_slicing, clippy::arithmetic_side_effects, reason = "evaluated by the compiler only")]
const fn lay_out() -> ([Storage; ROWS.len()], Counts) {
    let mut storage = [Storage::None; ROWS.len()];
    let mut counts = Counts { cells: 0, lists: 0, texts: 0 };
    let mut row = 0;
    while row < ROWS.len() {
        let block = &ROWS[row];
        if matches!(block.location, Location::Parameter) {
            if block.fixed_bytes().is_some() {
                storage[row] = Storage::Cell(counts.cells as u8);
                counts.cells += 1;
            } else if block.is_text() {
                storage[row] = Storage::Text(counts.texts as u8);
                counts.texts += 1;
            } else {
                storage[row] = Storage::List(counts.lists as u8);
                counts.lists += 1;
            }
        }
        row += 1;
    }
    assert!(counts.cells < 256, "Storage::Cell holds a byte");
    (storage, counts)
}

#[allow(clippy::indexing_slicing, clippy::arithmetic_side_effects, reason = "evaluated by the compiler only")]
const fn defaults() -> [u32; COUNTS.cells] {
    let mut cells = [0; COUNTS.cells];
    let mut row = 0;
    while row < ROWS.len() {
        if let Storage::Cell(index) = LAYOUT.0[row] {
            let block = &ROWS[row];
            let raw = match block.fixed_bytes() {
                Some(2) => block.default as u32 & 0xFFFF,
                _ => block.default as u32,
            };
            assert!(block.attribute.value_of(raw) == block.default, "a default does not fit its format");
            cells[index as usize] = raw;
        }
        row += 1;
    }
    cells
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_defaults_come_from_the_table() {
        let parameters = Parameters::new();
        assert_eq!(parameters.get(Idn::standard(2)), 2_000);
        assert_eq!(parameters.get(Idn::standard(46)), 0xFFFC);
        assert_eq!(parameters.get_signed(Idn::standard(46)), -4);
        assert_eq!(parameters.list(Idn::AT_LIST), []);
        assert_eq!(parameters.text(Idn::standard(141)), "");
    }

    #[test]
    fn every_parameter_has_a_place_of_its_own() {
        let mut parameters = Parameters::new();
        let blocks = || dictionary::select(Selection::All).filter(|block| block.location == Location::Parameter);
        let fixed = || blocks().filter(|block| block.fixed_bytes().is_some());
        for (block, value) in fixed().zip(1..) {
            let value = block.maximum.map_or(value, |maximum| maximum as u32 - value);
            parameters.set(block.idn, value).unwrap();
        }
        for (block, value) in fixed().zip(1..) {
            let value = block.maximum.map_or(value, |maximum| maximum as u32 - value);
            let value = if block.fixed_bytes() == Some(2) { value & 0xFFFF } else { value };
            assert_eq!(parameters.get(block.idn), value, "{}", block.idn);
        }
        parameters.set_list(Idn::AT_LIST, &[Idn::POSITION_FEEDBACK]).unwrap();
        assert_eq!(parameters.list(Idn::MDT_LIST), []);
        parameters.set_text(Idn::standard(142), b"folder").unwrap();
        assert_eq!((parameters.text(Idn::standard(141)), parameters.text(Idn::standard(142))), ("", "folder"));
    }

    #[test]
    fn a_value_outside_its_limits_is_refused_and_changes_nothing() {
        let mut parameters = Parameters::new();
        let before = parameters.clone();
        assert_eq!(parameters.set(Idn::standard(2), 499), Err(ServiceError::BelowMinimum));
        assert_eq!(parameters.set(Idn::standard(2), 65_001), Err(ServiceError::AboveMaximum));
        assert_eq!(parameters.set(Idn::standard(46), 33), Err(ServiceError::AboveMaximum));
        assert_eq!(parameters.set(Idn::standard(46), 0xFF00), Err(ServiceError::BelowMinimum));
        assert_eq!(parameters.set(Idn::standard(11), 0), Err(ServiceError::IdnNotAvailable));
        assert_eq!(parameters.set_list(Idn::AT_LIST, &[Idn::VELOCITY_COMMAND]), Err(ServiceError::InvalidData));
        assert_eq!(parameters.set_list(Idn::MDT_LIST, &[Idn::VELOCITY_COMMAND; 17]), Err(ServiceError::InvalidData));
        assert_eq!(parameters.set_text(Idn::standard(141), &[b'x'; 41]), Err(ServiceError::InvalidData));
        assert_eq!(parameters.set_text(Idn::standard(141), &[0xFF]), Err(ServiceError::InvalidData));
        assert_eq!(parameters, before);
    }

    #[test]
    fn two_byte_parameters_keep_two_bytes() {
        let mut parameters = Parameters::new();
        parameters.set(Idn::product(19), 0x1_0005).unwrap();
        assert_eq!(parameters.get(Idn::product(19)), 5);
    }

    #[test]
    fn what_the_master_has_written_is_forgotten_when_cp2_begins() {
        let mut parameters = Parameters::new();
        parameters.mark_written(Idn::standard(2));
        parameters.mark_written(Idn::product(19));
        assert!(parameters.is_written(Idn::standard(2)) && parameters.is_written(Idn::product(19)));
        assert!(!parameters.is_written(Idn::standard(1)));
        parameters.forget_written();
        assert!(!parameters.is_written(Idn::standard(2)) && !parameters.is_written(Idn::product(19)));
    }
}
