//! What has happened, in the memory: the error memory, the operating time, the last crash, where the axis was, and the lock S-0-0267.

use crate::crash::{CRASH_WORDS, CrashRecord};
use crate::diagnosis::error_memory::{ERRORS, ErrorMemory, ErrorRecord};
use crate::service::access::{Access, LONGEST_PASSWORD};

const VERSION: u8 = 1;
const HEAD_BYTES: usize = 8;
const RECORD_BYTES: usize = 6;
const CRASH_BYTES: usize = 4 * CRASH_WORDS;
const POSITION_BYTES: usize = 8;

/// In the head: there is a position, there is a lock.
const WITH_POSITION: u8 = 1 << 0;
const WITH_LOCK: u8 = 1 << 1;

/// Bytes of the log at most: a head (version, number of errors, 1 with a crash, what else there is, seconds of operation), the errors (number, seconds), the
/// crash, the position (S-0-0051, seconds), the password of the lock.
const MOST_LOG_BYTES: usize = HEAD_BYTES + ERRORS * RECORD_BYTES + CRASH_BYTES + POSITION_BYTES + LONGEST_PASSWORD;

const _: () = assert!(MOST_LOG_BYTES <= memory::MOST_BYTES, "the log does not fit into the memory");

/// Where the axis was, and when.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct KeptPosition {
    /// S-0-0051, in the weight that it had.
    pub(crate) position: i32,
    /// Seconds of operation, all starts together.
    pub(crate) seconds: u32,
}

/// When something is kept, and where the axis is then.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Moment {
    /// Seconds of operation, all starts together.
    pub(crate) seconds: u32,
    /// The last one that meant anything.
    pub(crate) position: Option<KeptPosition>,
}

/// What is kept of the past.
#[derive(Clone, Debug, Default)]
pub(crate) struct Log {
    /// Seconds of operation, all starts together.
    pub(crate) seconds: u32,
    pub(crate) errors: ErrorMemory,
    pub(crate) crash: Option<CrashRecord>,
    /// Of a firmware that has kept none there is none.
    pub(crate) position: Option<KeptPosition>,
    pub(crate) access: Access,
}

impl Log {
    /// Puts it into `buffer`; the number of bytes, or `None` if it does not fit.
    pub(crate) fn write(
        moment: &Moment,
        errors: &ErrorMemory,
        crash: Option<&CrashRecord>,
        access: &Access,
        buffer: &mut [u8],
    ) -> Option<usize> {
        let (head, mut rest) = buffer.split_first_chunk_mut::<HEAD_BYTES>()?;
        let mut count = 0_u8;
        let mut written = HEAD_BYTES;
        for error in errors.newest_first() {
            let (record, behind) = core::mem::take(&mut rest).split_first_chunk_mut::<RECORD_BYTES>()?;
            let [low, high] = error.number.to_le_bytes();
            let [first, second, third, fourth] = error.seconds.to_le_bytes();
            *record = [low, high, first, second, third, fourth];
            rest = behind;
            count = count.checked_add(1)?;
            written = written.checked_add(RECORD_BYTES)?;
        }
        if let Some(crash) = crash {
            let words = crash.emit();
            let (record, behind) = core::mem::take(&mut rest).split_first_chunk_mut::<CRASH_BYTES>()?;
            for (bytes, word) in record.chunks_exact_mut(4).zip(words) {
                bytes.copy_from_slice(&word.to_le_bytes());
            }
            rest = behind;
            written = written.checked_add(CRASH_BYTES)?;
        }
        if let Some(KeptPosition { position, seconds }) = moment.position {
            let (record, behind) = core::mem::take(&mut rest).split_first_chunk_mut::<POSITION_BYTES>()?;
            let ([a, b, c, d], [e, f, g, h]) = (position.to_le_bytes(), seconds.to_le_bytes());
            *record = [a, b, c, d, e, f, g, h];
            rest = behind;
            written = written.checked_add(POSITION_BYTES)?;
        }
        let [first, second, third, fourth] = moment.seconds.to_le_bytes();
        if access.is_locked() {
            *rest.first_chunk_mut()? = access.emit();
            written = written.checked_add(LONGEST_PASSWORD)?;
        }
        let known = if moment.position.is_some() { WITH_POSITION } else { 0 };
        let locked = if access.is_locked() { WITH_LOCK } else { 0 };
        *head = [VERSION, count, crash.is_some().into(), known | locked, first, second, third, fourth];
        Some(written)
    }

    /// The same past without its lock, as [`Log::write`].
    pub(crate) fn write_unlocked(&self, buffer: &mut [u8]) -> Option<usize> {
        let moment = Moment { seconds: self.seconds, position: self.position };
        Self::write(&moment, &self.errors, self.crash.as_ref(), &Access::default(), buffer)
    }

    /// `None` for bytes that are no log.
    pub(crate) fn parse(bytes: &[u8]) -> Option<Self> {
        let (&[version, count, crashed, more, a, b, c, d], rest) = bytes.split_first_chunk::<HEAD_BYTES>()?;
        if version != VERSION || usize::from(count) > ERRORS {
            return None;
        }
        let (records, rest) = rest.split_at_checked(usize::from(count).checked_mul(RECORD_BYTES)?)?;
        let mut errors = ErrorMemory::new();
        // The oldest first, as they came.
        for &[low, high, a, b, c, d] in records.as_chunks::<RECORD_BYTES>().0.iter().rev() {
            let number = u16::from_le_bytes([low, high]);
            errors.add(ErrorRecord { number, seconds: u32::from_le_bytes([a, b, c, d]) });
        }
        let (crash, rest) = if crashed == 0 {
            (None, rest)
        } else {
            let mut words = [0; CRASH_WORDS];
            let (bytes, rest) = rest.split_first_chunk::<CRASH_BYTES>()?;
            for (word, bytes) in words.iter_mut().zip(bytes.as_chunks::<4>().0) {
                *word = u32::from_le_bytes(*bytes);
            }
            (Some(CrashRecord::parse(&words)?), rest)
        };
        let (position, rest) = if more & WITH_POSITION == 0 {
            (None, rest)
        } else {
            let (&[a, b, c, d, e, f, g, h], rest) = rest.split_first_chunk::<POSITION_BYTES>()?;
            let (position, seconds) = (i32::from_le_bytes([a, b, c, d]), u32::from_le_bytes([e, f, g, h]));
            (Some(KeptPosition { position, seconds }), rest)
        };
        let access = if more & WITH_LOCK == 0 { Access::default() } else { Access::parse(rest.first_chunk()?) };
        Some(Self { seconds: u32::from_le_bytes([a, b, c, d]), errors, crash, position, access })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::crash::CrashCause;
    use std::vec::Vec;

    const THERE: KeptPosition = KeptPosition { position: -1_234_567, seconds: 70_000 };

    fn locked(text: &str) -> Access {
        let mut access = Access::default();
        access.write(text.as_bytes()).unwrap();
        access
    }

    fn written(errors: usize, crash: Option<&CrashRecord>, position: Option<KeptPosition>, access: &Access) -> Vec<u8> {
        let mut memory = ErrorMemory::new();
        for number in 0..errors as u16 {
            memory.add(ErrorRecord { number: 0xF100 + number, seconds: u32::from(number) * 70_000 });
        }
        let mut buffer = [0; MOST_LOG_BYTES];
        let moment = Moment { seconds: 123_456_789, position };
        let length = Log::write(&moment, &memory, crash, access, &mut buffer).unwrap();
        buffer[..length].to_vec()
    }

    #[test]
    fn what_was_written_is_read_and_half_of_it_is_nothing() {
        let crash = CrashRecord { pc: 0x0800_1234, told: true, ..CrashRecord::new(CrashCause::Panic) };
        let crashes = [(0, None), (3, None), (ERRORS, Some(&crash)), (0, Some(&crash))];
        let more = [(None, ""), (Some(THERE), ""), (None, "press 3"), (Some(THERE), "0123456789")];
        for ((errors, crash), (position, password)) in
            crashes.into_iter().flat_map(|case| more.map(|more| (case, more)))
        {
            let access = locked(password);
            let bytes = written(errors, crash, position, &access);
            let log = Log::parse(&bytes).unwrap();
            assert_eq!((log.seconds, log.crash.as_ref(), log.position), (123_456_789, crash, position));
            assert_eq!(log.access, access);
            let numbers: Vec<u16> = log.errors.newest_first().map(|error| error.number).collect();
            assert_eq!(numbers, (0..errors as u16).rev().map(|number| 0xF100 + number).collect::<Vec<_>>());
            assert!(log.errors.newest_first().next().is_none_or(|error| error.seconds == (errors as u32 - 1) * 70_000));
            let mut unlocked = [0; MOST_LOG_BYTES];
            let length = log.write_unlocked(&mut unlocked).unwrap();
            assert_eq!(unlocked[..length], written(errors, crash, position, &Access::default()));
            assert_eq!(log.write_unlocked(&mut unlocked[..length - 1]), None);
            for length in 0..bytes.len() {
                assert!(Log::parse(&bytes[..length]).is_none(), "{length} of {} bytes", bytes.len());
                let moment = Moment { seconds: log.seconds, position };
                assert_eq!(
                    Log::write(&moment, &log.errors, crash, &access, &mut std::vec![0; length]),
                    None,
                    "{length}"
                );
            }
        }
        assert_eq!(written(ERRORS, Some(&crash), Some(THERE), &locked("abc")).len(), MOST_LOG_BYTES);
    }

    /// 5bec346 has written it: a head, one error, no crash.
    #[test]
    fn a_log_of_a_firmware_that_kept_no_position_has_none() {
        let log = Log::parse(&[1, 1, 0, 0, 0x39, 0x30, 0, 0, 0x1D, 0xF1, 7, 0, 0, 0]).unwrap();
        assert_eq!((log.seconds, log.position, log.access.is_locked()), (12_345, None, false));
        assert_eq!(log.errors.newest_first().next(), Some(ErrorRecord { number: 0xF11D, seconds: 7 }));
    }

    #[test]
    fn a_damaged_crash_or_another_version_is_no_log() {
        let bytes = written(1, Some(&CrashRecord::new(CrashCause::Fault)), None, &Access::default());
        for place in [0, 1, bytes.len() - 1, bytes.len() - 60] {
            let mut other = bytes.clone();
            other[place] ^= 0x40;
            assert!(Log::parse(&other).is_none(), "byte {place}");
        }
    }
}
