//! What has happened, in the memory: the error memory, the operating time and the last crash.

use crate::crash::{CRASH_WORDS, CrashRecord};
use crate::diagnosis::error_memory::{ERRORS, ErrorMemory, ErrorRecord};

const VERSION: u8 = 1;
const HEAD_BYTES: usize = 8;
const RECORD_BYTES: usize = 6;
const CRASH_BYTES: usize = 4 * CRASH_WORDS;

/// Bytes of the log at most: a head (version, number of errors, 1 with a crash, 0, seconds of operation), the errors (number, seconds), the crash.
pub const MOST_LOG_BYTES: usize = HEAD_BYTES + ERRORS * RECORD_BYTES + CRASH_BYTES;

/// What is kept of the past.
#[derive(Clone, Debug, Default)]
pub(crate) struct Log {
    /// Seconds of operation, all starts together.
    pub(crate) seconds: u32,
    pub(crate) errors: ErrorMemory,
    pub(crate) crash: Option<CrashRecord>,
}

impl Log {
    /// Puts it into `buffer`; the number of bytes, or `None` if it does not fit.
    pub(crate) fn write(
        seconds: u32,
        errors: &ErrorMemory,
        crash: Option<&CrashRecord>,
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
            for (bytes, word) in rest.get_mut(..CRASH_BYTES)?.chunks_exact_mut(4).zip(words) {
                bytes.copy_from_slice(&word.to_le_bytes());
            }
            written = written.checked_add(CRASH_BYTES)?;
        }
        let [first, second, third, fourth] = seconds.to_le_bytes();
        *head = [VERSION, count, crash.is_some().into(), 0, first, second, third, fourth];
        Some(written)
    }

    /// `None` for bytes that are no log.
    pub(crate) fn parse(bytes: &[u8]) -> Option<Self> {
        let (&[version, count, crashed, _, a, b, c, d], rest) = bytes.split_first_chunk::<HEAD_BYTES>()?;
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
        let crash = if crashed == 0 {
            None
        } else {
            let mut words = [0; CRASH_WORDS];
            let bytes = rest.get(..CRASH_BYTES)?;
            for (word, bytes) in words.iter_mut().zip(bytes.as_chunks::<4>().0) {
                *word = u32::from_le_bytes(*bytes);
            }
            Some(CrashRecord::parse(&words)?)
        };
        Some(Self { seconds: u32::from_le_bytes([a, b, c, d]), errors, crash })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::crash::CrashCause;
    use std::vec::Vec;

    fn written(errors: usize, crash: Option<&CrashRecord>) -> Vec<u8> {
        let mut memory = ErrorMemory::new();
        for number in 0..errors as u16 {
            memory.add(ErrorRecord { number: 0xF100 + number, seconds: u32::from(number) * 70_000 });
        }
        let mut buffer = [0; MOST_LOG_BYTES];
        let length = Log::write(123_456_789, &memory, crash, &mut buffer).unwrap();
        buffer[..length].to_vec()
    }

    #[test]
    fn what_was_written_is_read_and_half_of_it_is_nothing() {
        let crash = CrashRecord { pc: 0x0800_1234, told: true, ..CrashRecord::new(CrashCause::Panic) };
        for (errors, crash) in [(0, None), (3, None), (ERRORS, Some(&crash)), (0, Some(&crash))] {
            let bytes = written(errors, crash);
            let log = Log::parse(&bytes).unwrap();
            assert_eq!((log.seconds, log.crash.as_ref()), (123_456_789, crash));
            let numbers: Vec<u16> = log.errors.newest_first().map(|error| error.number).collect();
            assert_eq!(numbers, (0..errors as u16).rev().map(|number| 0xF100 + number).collect::<Vec<_>>());
            assert!(log.errors.newest_first().next().is_none_or(|error| error.seconds == (errors as u32 - 1) * 70_000));
            for length in 0..bytes.len() {
                assert!(Log::parse(&bytes[..length]).is_none(), "{length} of {} bytes", bytes.len());
            }
        }
        assert_eq!(written(ERRORS, Some(&crash)).len(), MOST_LOG_BYTES);
        assert_eq!(Log::write(0, &ErrorMemory::new(), Some(&crash), &mut [0; CRASH_BYTES]), None);
    }

    #[test]
    fn a_damaged_crash_or_another_version_is_no_log() {
        let bytes = written(1, Some(&CrashRecord::new(CrashCause::Fault)));
        for place in [0, 1, bytes.len() - 1, bytes.len() - 60] {
            let mut other = bytes.clone();
            other[place] ^= 0x40;
            assert!(Log::parse(&other).is_none(), "byte {place}");
        }
    }
}
