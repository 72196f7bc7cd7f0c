//! The set of parameters in the memory: a record for each data block of S-0-0192, each with its IDN.
//!
//! | bytes | what |
//! |---|---|
//! | 1 | version of this form, 1 |
//! | 1 | 0 |
//! | 2 | number of records |
//! | 2 | IDN of a record |
//! | 1 | bytes of its operation data |
//! | 1 | bytes until the next record: what the data block takes at most |
//! | n | operation data as the service channel carries them, least significant byte first, then zeros |
//!
//! A program that knows other data blocks than the one that has written the set takes what it knows and says what it does not.

use heapless::Vec;
use sercos::Idn;
use sercos::data_block::{DataBlock, Selection};
use sercos::dictionary::Dictionary;
use sercos::parameters::Parameters;

use crate::dictionary::{DICTIONARY, is_rating};

const VERSION: u8 = 1;
const HEAD_BYTES: usize = 4;
const RECORD_BYTES: usize = 4;
/// IDNs that are told of when a set does not fit.
pub(crate) const MOST_DROPPED: usize = 64;

/// Bytes of the set of this drive.
const MOST_SET_BYTES: usize = set_bytes(&DICTIONARY);

/// The memory takes it, with some room for what comes.
const _: () = assert!(MOST_SET_BYTES + 256 <= memory::MOST_BYTES, "the set does not fit into the memory");

const fn set_bytes(dictionary: &Dictionary) -> usize {
    let mut blocks = dictionary.blocks();
    let mut bytes = HEAD_BYTES;
    while let [block, rest @ ..] = blocks {
        if block.is_in(Selection::Backup) {
            bytes = bytes.saturating_add(RECORD_BYTES).saturating_add(block.most_bytes());
        }
        blocks = rest;
    }
    bytes
}

/// What a start has found of the parameters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Recollection<'a> {
    /// The set that was saved last.
    Set(&'a [u8]),
    /// The last save was cut, and not acknowledged: the set before it, where there is one.
    Unfinished(Option<&'a [u8]>),
    /// Nothing was ever saved.
    Empty,
    /// The set that was saved last cannot be read any more.
    Damaged,
}

/// Data blocks of a set that were not taken over: unknown, of another length, or out of today's range.
pub(crate) type Dropped = Vec<Idn, MOST_DROPPED>;

/// Puts the parameters of S-0-0192 into `buffer`, those that somebody has told or that are not their default; their number of bytes, or `None` if they do not fit.
pub fn write_set(parameters: &Parameters, buffer: &mut [u8]) -> Option<usize> {
    let mut records = 0_u16;
    let mut written = HEAD_BYTES;
    for block in parameters.dictionary().select(Selection::Backup).filter(|block| is_to_be_saved(parameters, block)) {
        written = written.checked_add(put_record(parameters, block, buffer.get_mut(written..)?)?)?;
        records = records.checked_add(1)?;
    }
    put_head(records, buffer)?;
    Some(written)
}

fn put_head(records: u16, buffer: &mut [u8]) -> Option<()> {
    let [low, high] = records.to_le_bytes();
    *buffer.first_chunk_mut::<HEAD_BYTES>()? = [VERSION, 0, low, high];
    Some(())
}

/// Its number of bytes, or `None` if it does not fit.
fn put_record(parameters: &Parameters, block: &DataBlock, out: &mut [u8]) -> Option<usize> {
    let bytes = parameters.bytes(block);
    let room = block.most_bytes();
    let length = RECORD_BYTES.checked_add(room)?;
    let (head, data) = out.get_mut(..length)?.split_first_chunk_mut::<RECORD_BYTES>()?;
    let [low, high] = block.idn.0.to_le_bytes();
    *head = [low, high, u8::try_from(bytes.len()).ok()?, u8::try_from(room).ok()?];
    data.fill(0);
    data.get_mut(..bytes.len())?.copy_from_slice(&bytes);
    Some(length)
}

/// Gives a set of `length` bytes at the beginning of `buffer` these parameters as they are, and leaves it everything else, also what this program does not
/// know; its number of bytes then. `None` if it is no set, or if there is no room: what lies there is of no use then.
pub(crate) fn amend_set(
    parameters: &Parameters,
    selected: &[Idn],
    buffer: &mut [u8],
    mut length: usize,
) -> Option<usize> {
    let records = Records::of(buffer.get(..length)?)?;
    let mut count = records.left;
    if !records.is_whole() {
        return None;
    }
    for idn in selected {
        if let Some((from, to)) = place_of(*idn, buffer.get(..length)?) {
            buffer.copy_within(to..length, from);
            length = from.checked_add(length.checked_sub(to)?)?;
            count = count.checked_sub(1)?;
        }
        let block = parameters.dictionary().find(*idn).filter(|block| block.is_in(Selection::Backup))?;
        if is_to_be_saved(parameters, block) {
            length = length.checked_add(put_record(parameters, block, buffer.get_mut(length..)?)?)?;
            count = count.checked_add(1)?;
        }
    }
    put_head(count, buffer)?;
    Some(length)
}

/// Where the record of a data block begins and ends in a set.
fn place_of(idn: Idn, set: &[u8]) -> Option<(usize, usize)> {
    let mut from = HEAD_BYTES;
    while let Some(&[low, high, _, room]) = set.get(from..).and_then(<[u8]>::first_chunk::<RECORD_BYTES>) {
        let to = from.saturating_add(RECORD_BYTES).saturating_add(room.into());
        if u16::from_le_bytes([low, high]) == idn.0 {
            return Some((from, to));
        }
        from = to;
    }
    None
}

/// A default that nobody has told would come back as if somebody had: it stays out. What the drive has worked out by itself is in.
fn is_to_be_saved(parameters: &Parameters, block: &DataBlock) -> bool {
    parameters.is_told(block.idn) || !parameters.is_default(block)
}

/// Takes a set over, on top of the defaults, and says what of it was not. `None` if the bytes are no set: nothing has changed then.
pub(crate) fn take_set(bytes: &[u8], parameters: &mut Parameters) -> Option<Dropped> {
    let all = || Records::of(bytes);
    // To the end, so that half a set is none.
    if !all()?.is_whole() {
        return None;
    }
    // Who asks for the defaults has told them; what a set does not hold nobody has.
    parameters.forget_told();
    parameters.load_defaults();
    let mut dropped = Dropped::new();
    for record in all()?.flatten() {
        let taken = match parameters.dictionary().find(record.idn) {
            Some(block) if block.is_in(Selection::Backup) => take(record.data, block, parameters),
            Some(block) if is_rating(block) => is_no_other(record.data, block, parameters),
            _ => false,
        };
        if !taken {
            // More than that are not told of.
            let _ = dropped.push(record.idn);
        }
    }
    Some(dropped)
}

/// The parameters that a set holds, on top of the defaults; `None` if the bytes are no set. For tools.
pub fn read_set(bytes: &[u8]) -> Option<Parameters> {
    let mut parameters = Parameters::new(&DICTIONARY);
    take_set(bytes, &mut parameters)?;
    Some(parameters)
}

/// Firmware up to 0.1.0 was told the ratings by its control. That a set was saved of this very amplifier is nothing to tell; that it was saved of another
/// one, or that a wrong record was written since, somebody has to look at.
fn is_no_other(data: &[u8], block: &DataBlock, parameters: &Parameters) -> bool {
    const FOLLOWS_THE_MOTOR: (Idn, &[u8]) = (Idn::product(106), &[0, 0, 0, 0]);
    const WITHSTAND_VOLTAGE: Idn = Idn::product(239);
    // P-0-0106 = 0 claimed nothing, and P-0-0239 was no voltage but a yes or no.
    let claims =
        (block.idn, data) != FOLLOWS_THE_MOTOR && !(block.idn == WITHSTAND_VOLTAGE && matches!(data, [0 | 1, 0]));
    !claims || parameters.bytes(block).as_slice() == data
}

fn take(data: &[u8], block: &DataBlock, parameters: &mut Parameters) -> bool {
    parameters.set_bytes(block, data).is_ok()
}

struct Record<'a> {
    idn: Idn,
    data: &'a [u8],
}

/// The records of a set; `None` once, where it ends too early.
struct Records<'a> {
    left: u16,
    bytes: &'a [u8],
}

impl<'a> Records<'a> {
    fn of(bytes: &'a [u8]) -> Option<Self> {
        let (&[version, _, low, high], bytes) = bytes.split_first_chunk::<HEAD_BYTES>()?;
        (version == VERSION).then_some(Self { left: u16::from_le_bytes([low, high]), bytes })
    }

    /// Each of them is there, and nothing behind the last.
    fn is_whole(&self) -> bool {
        let mut records = Self { ..*self };
        records.all(|record| record.is_some()) && records.bytes.is_empty()
    }

    fn record(&mut self) -> Option<Record<'a>> {
        let (&[low, high, length, room], rest) = self.bytes.split_first_chunk::<RECORD_BYTES>()?;
        let (data, rest) = rest.split_at_checked(room.into())?;
        let data = data.get(..length.into())?;
        self.bytes = rest;
        Some(Record { idn: Idn(u16::from_le_bytes([low, high])), data })
    }
}

impl<'a> Iterator for Records<'a> {
    type Item = Option<Record<'a>>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.left == 0 {
            return None;
        }
        let record = self.record();
        self.left = if record.is_some() { self.left.saturating_sub(1) } else { 0 };
        Some(record)
    }
}

/// These parameters, as if somebody had told each of them.
#[cfg(test)]
pub(crate) fn told(parameters: &Parameters) -> Parameters {
    let mut told = parameters.clone();
    DICTIONARY.select(Selection::Backup).for_each(|block| told.mark_written(block.idn));
    // Before CP2: told, and not written anew.
    told.forget_written();
    told
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec::Vec;

    const S: fn(u16) -> Idn = Idn::standard;

    fn written(parameters: &Parameters) -> Vec<u8> {
        let parameters = &told(parameters);
        let mut buffer = [0xEE; MOST_SET_BYTES];
        let length = write_set(parameters, &mut buffer).unwrap();
        buffer[..length].to_vec()
    }

    fn changed() -> Parameters {
        let mut parameters = Parameters::new(&DICTIONARY);
        parameters.set(S(41), 7_654_321).unwrap();
        parameters.set(S(32), 11).unwrap();
        parameters.set_text(S(142), b"folder 3").unwrap();
        parameters.set_list(Idn::SIGNAL_STATUS_LIST, &[S(330), S(331)]).unwrap();
        parameters.set_longs(Idn::product(7), &[u32::MAX, 0, 5]).unwrap();
        parameters
    }

    #[test]
    fn a_set_gives_back_every_parameter_and_is_as_long_as_is_said() {
        let mut taken = Parameters::new(&DICTIONARY);
        let set = written(&changed());
        assert_eq!(set.len(), MOST_SET_BYTES);
        assert_eq!(take_set(&set, &mut taken), Some(Dropped::new()));
        assert_eq!(taken.checksum(), changed().checksum());
        assert_eq!((taken.text(S(142)), taken.longs(Idn::product(7))), ("folder 3", [u32::MAX, 0, 5].as_slice()));
    }

    #[test]
    fn a_default_that_nobody_has_told_stays_untold_and_what_the_drive_has_worked_out_is_kept() {
        let mut parameters = Parameters::new(&DICTIONARY);
        parameters.set(S(100), 123).unwrap();
        parameters.mark_written(S(41));
        let mut buffer = [0; MOST_SET_BYTES];
        let length = write_set(&parameters, &mut buffer).unwrap();
        let mut taken = Parameters::new(&DICTIONARY);
        take_set(&buffer[..length], &mut taken).unwrap();
        assert_eq!((taken.get(S(100)), taken.is_told(S(100)), taken.is_told(S(41))), (123, true, true));
        assert!(!taken.is_told(S(109)), "the motor is still unknown");
    }

    #[test]
    fn what_is_not_in_a_set_is_the_default_afterwards() {
        let mut parameters = changed();
        assert_eq!(take_set(&[VERSION, 0, 0, 0], &mut parameters), Some(Dropped::new()));
        assert_eq!(parameters.checksum(), Parameters::new(&DICTIONARY).checksum());
    }

    #[test]
    fn a_buffer_that_is_too_small_and_bytes_that_are_no_set_change_nothing() {
        let told = told(&changed());
        let set = written(&changed());
        for length in 0..set.len() {
            assert_eq!(write_set(&told, &mut std::vec![0; length]), None);
            let mut parameters = Parameters::new(&DICTIONARY);
            assert_eq!(take_set(&set[..length], &mut parameters), None, "{length} bytes");
            assert_eq!(parameters, Parameters::new(&DICTIONARY));
        }
        let mut other = set;
        other[0] = 2;
        assert_eq!(take_set(&other, &mut Parameters::new(&DICTIONARY)), None);
    }

    /// A set that lies at the beginning of a page.
    fn page(set: &[u8]) -> Vec<u8> {
        let mut page = set.to_vec();
        page.resize(memory::MOST_BYTES, 0xEE);
        page
    }

    #[test]
    fn what_is_selected_is_changed_in_a_set_and_everything_else_stays_also_what_is_unknown_here() {
        let mut set = written(&changed());
        let [low, high] = Idn::product(4_000).0.to_le_bytes();
        set.extend([low, high, 2, 2, 0x34, 0x12]);
        let records = u16::from_le_bytes([set[2], set[3]]) + 1;
        set[2..4].copy_from_slice(&records.to_le_bytes());
        let mut now = Parameters::new(&DICTIONARY);
        now.set(S(41), 1).unwrap();
        now.set(S(32), 3).unwrap();
        now.set_text(S(142), b"another").unwrap();
        now.set_longs(Idn::product(7), &[9]).unwrap();
        let mut buffer = page(&set);
        // Twice, as a word that does not become what it should makes it.
        let mut length = set.len();
        for _ in 0..2 {
            length = amend_set(&told(&now), &[S(142), S(41), S(142)], &mut buffer, length).unwrap();
            assert_eq!(length, set.len(), "a record takes what its data block takes at most");
        }
        let mut taken = Parameters::new(&DICTIONARY);
        assert_eq!(take_set(&buffer[..length], &mut taken).unwrap().as_slice(), [Idn::product(4_000)]);
        assert_eq!((taken.get(S(41)), taken.text(S(142))), (1, "another"));
        assert_eq!((taken.get(S(32)), taken.longs(Idn::product(7))), (11, [u32::MAX, 0, 5].as_slice()));
    }

    #[test]
    fn what_a_set_does_not_hold_comes_into_it_and_a_default_that_nobody_has_told_goes_out_of_it() {
        let mut parameters = Parameters::new(&DICTIONARY);
        parameters.mark_written(S(109));
        let mut buffer = [0; memory::MOST_BYTES];
        let length = write_set(&parameters, &mut buffer).unwrap();
        let mut now = Parameters::new(&DICTIONARY);
        now.set(S(41), 77).unwrap();
        let longer = amend_set(&now, &[S(41)], &mut buffer, length).unwrap();
        assert_eq!(longer, length + RECORD_BYTES + 4);
        let length = amend_set(&now, &[S(109)], &mut buffer, longer).unwrap();
        let mut taken = Parameters::new(&DICTIONARY);
        take_set(&buffer[..length], &mut taken).unwrap();
        assert_eq!((taken.get(S(41)), taken.is_told(S(109))), (77, false));
    }

    #[test]
    fn bytes_that_are_no_set_and_a_page_without_room_are_not_amended() {
        let set = written(&changed());
        let now = told(&Parameters::new(&DICTIONARY));
        for length in 0..set.len() {
            assert_eq!(amend_set(&now, &[S(41)], &mut page(&set[..length]), length), None, "{length} bytes");
        }
        assert_eq!(amend_set(&now, &[S(41)], &mut page(&set), set.len() + 1), None, "something behind the last record");
        let mut empty = Parameters::new(&DICTIONARY);
        empty.set(S(41), 77).unwrap();
        let mut short = std::vec![VERSION, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0];
        assert_eq!(amend_set(&empty, &[S(41)], &mut short, HEAD_BYTES), None);
        short.push(0);
        assert_eq!(amend_set(&empty, &[S(41)], &mut short, HEAD_BYTES), Some(12));
    }

    /// A set as another program may have written it: 20 data blocks that are unknown here, 20 values that are out of today's range.
    #[test]
    fn what_a_program_does_not_know_or_does_not_take_is_dropped_and_named_and_the_rest_is_taken() {
        let mut set = written(&changed());
        let mut expected = Vec::new();
        let mut at = HEAD_BYTES;
        while at < set.len() && expected.len() < 20 {
            let idn = Idn(u16::from_le_bytes([set[at], set[at + 1]]));
            let block = DICTIONARY.find(idn).unwrap();
            let limit = block.maximum.filter(|maximum| *maximum < 0x7FFF && block.most_bytes() == 2);
            if let Some(maximum) = limit {
                set[at + 4..at + 6].copy_from_slice(&(maximum as u16 + 1).to_le_bytes());
                expected.push(idn);
            }
            at += RECORD_BYTES + usize::from(set[at + 3]);
        }
        for number in 0..20 {
            let idn = Idn::product(4_000 + number);
            let [low, high] = idn.0.to_le_bytes();
            set.extend([low, high, 2, 2, 0x34, 0x12]);
            expected.push(idn);
        }
        let records = u16::from_le_bytes([set[2], set[3]]) + 20;
        set[2..4].copy_from_slice(&records.to_le_bytes());
        let mut parameters = Parameters::new(&DICTIONARY);
        assert_eq!(take_set(&set, &mut parameters).unwrap().as_slice(), expected);
        assert_eq!(parameters.text(S(142)), "folder 3");
        for idn in &expected[..20] {
            assert_eq!(parameters.get(*idn), Parameters::new(&DICTIONARY).get(*idn), "{idn} is the default");
        }
    }
}
