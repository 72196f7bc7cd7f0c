//! The record of a crash: what failed where, in memory that outlives the reset.
//!
//! The fault handler of the board writes it as words ([`CrashRecord::emit`]), the next start reads them ([`CrashRecord::parse`]). Memory holds
//! noise after power-on: only words with the right mark and checksum are a record.

use core::fmt;

use crate::diagnosis::table::{
    CLOCK_FAILED, CONTROL_STOPPED, Diagnosis, FIRMWARE_FAULT, FIRMWARE_PANIC, STACK_OVERFLOW, WATCHDOG_RESET,
};

/// Words of a record in memory.
pub const CRASH_WORDS: usize = 34;
/// Words of P-0-0013: those of a record without mark and checksum.
pub const SHOWN_WORDS: usize = CRASH_WORDS - 2;
/// Bytes of a file's name that are kept: its end, which tells more.
pub const FILE_BYTES: usize = 32;
/// After so many crashes in a row, without a time in between in which all was well, the drive stays out of the ring.
pub const MOST_CRASHES_IN_A_ROW: u8 = 3;

const MARK: u32 = 0xC4A5_11ED;
const FIRST_REGISTER: usize = 7;
const FIRST_STATUS: usize = 20;
const FIRST_OF_FILE: usize = 25;
const TOLD: u32 = 1 << 7;
const EXCEPTION: u32 = 0x1FF;

/// What ended the program.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum CrashCause {
    /// A hard fault, or one of the configurable faults that became one.
    Fault = 1,
    /// A panic of the program.
    Panic = 2,
    /// The stack reached its guard.
    StackOverflow = 3,
    /// The crystal failed: the clock security system took its place.
    Clock = 4,
    /// A non-maskable interrupt for another reason, or an interrupt that no task is bound to.
    Unbound = 5,
    /// The watchdog was not fed; nothing is known of the registers.
    Watchdog = 6,
    /// The current loop or the control loop did not run for a millisecond.
    ControlStopped = 7,
}

impl CrashCause {
    fn from_code(code: u32) -> Option<Self> {
        use CrashCause::{Clock, ControlStopped, Fault, Panic, StackOverflow, Unbound, Watchdog};
        [Fault, Panic, StackOverflow, Clock, Unbound, Watchdog, ControlStopped]
            .into_iter()
            .find(|cause| *cause as u32 == code)
    }

    /// What the error memory shows.
    #[must_use]
    pub const fn diagnosis(self) -> &'static Diagnosis {
        match self {
            Self::Fault | Self::Unbound => &FIRMWARE_FAULT,
            Self::Panic => &FIRMWARE_PANIC,
            Self::StackOverflow => &STACK_OVERFLOW,
            Self::Clock => &CLOCK_FAILED,
            Self::Watchdog => &WATCHDOG_RESET,
            Self::ControlStopped => &CONTROL_STOPPED,
        }
    }
}

/// What is known of a crash. Registers are those of the interrupted program; where they were lost, 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct CrashRecord {
    /// What ended the program.
    pub cause: CrashCause,
    /// A start has told of it: it is shown, and no news.
    pub told: bool,
    /// Crashes without a time in between in which all was well, this one included.
    pub in_a_row: u8,
    /// Number of the exception that was served (ARMv7-M: 16 is interrupt 0), 0: none, the idle task or the start.
    pub exception: u16,
    /// Crashes since the supply came on, this one included.
    pub count: u32,
    /// Program counter.
    pub pc: u32,
    /// Link register.
    pub lr: u32,
    /// Stack pointer.
    pub sp: u32,
    /// Program status.
    pub xpsr: u32,
    /// r0 to r12.
    pub registers: [u32; 13],
    /// CFSR, HFSR, MMFAR, BFAR: what kind of fault, and at which address.
    pub status: [u32; 4],
    /// Line of a panic; for the watchdog the tasks that were started and had not begun (bits of [`crate::Tasks`]).
    pub detail: u32,
    /// End of the name of the file of a panic, zeros behind it.
    pub file: [u8; FILE_BYTES],
}

impl CrashRecord {
    /// The first crash, of which nothing else is known.
    #[must_use]
    pub const fn new(cause: CrashCause) -> Self {
        Self {
            cause,
            told: false,
            in_a_row: 1,
            exception: 0,
            count: 1,
            pc: 0,
            lr: 0,
            sp: 0,
            xpsr: 0,
            registers: [0; 13],
            status: [0; 4],
            detail: 0,
            file: [0; FILE_BYTES],
        }
    }

    /// The same, after the last one.
    #[must_use]
    pub fn after(self, last: Option<&Self>) -> Self {
        let (count, in_a_row) = last.map_or((0, 0), |last| (last.count, last.in_a_row));
        Self { count: count.saturating_add(1), in_a_row: in_a_row.saturating_add(1), ..self }
    }

    /// As words.
    #[must_use]
    pub fn emit(&self) -> [u32; CRASH_WORDS] {
        let told = if self.told { TOLD } else { 0 };
        let first =
            self.cause as u32 | told | u32::from(self.in_a_row) << 8 | (u32::from(self.exception) & EXCEPTION) << 16;
        let mut file = [0; FILE_BYTES / 4];
        for (word, bytes) in file.iter_mut().zip(self.file.as_chunks::<4>().0) {
            *word = u32::from_le_bytes(*bytes);
        }
        let known = [MARK, first, self.count, self.pc, self.lr, self.sp, self.xpsr].into_iter();
        let known = known.chain(self.registers).chain(self.status).chain([self.detail]).chain(file);
        let mut words = [0; CRASH_WORDS];
        for (slot, word) in words.iter_mut().zip(known) {
            *slot = word;
        }
        let [kept @ .., sum] = &mut words;
        *sum = checksum(kept);
        words
    }

    /// From words; `None`: they are none, as after power-on.
    #[must_use]
    pub fn parse(words: &[u32; CRASH_WORDS]) -> Option<Self> {
        let [kept @ .., sum] = words;
        let [MARK, first, count, pc, lr, sp, xpsr, ..] = *words else { return None };
        if checksum(kept) != *sum {
            return None;
        }
        let mut file = [0; FILE_BYTES];
        for (bytes, word) in file.as_chunks_mut::<4>().0.iter_mut().zip(words.iter().skip(FIRST_OF_FILE)) {
            *bytes = word.to_le_bytes();
        }
        Some(Self {
            cause: CrashCause::from_code(first & 0x7F)?,
            told: first & TOLD != 0,
            in_a_row: first.to_le_bytes()[1],
            exception: (first >> 16 & EXCEPTION) as u16,
            count,
            pc,
            lr,
            sp,
            xpsr,
            registers: *words.get(FIRST_REGISTER..)?.first_chunk()?,
            status: *words.get(FIRST_STATUS..)?.first_chunk()?,
            detail: *words.get(FIRST_OF_FILE.wrapping_sub(1))?,
            file,
        })
    }

    /// The entries of P-0-0013.
    #[must_use]
    pub fn shown(&self) -> [u32; SHOWN_WORDS] {
        let mut shown = [0; SHOWN_WORDS];
        for (slot, word) in shown.iter_mut().zip(self.emit().into_iter().skip(1)) {
            *slot = word;
        }
        shown
    }

    /// In plain words; `task` is what the application calls the one that failed. At most 112 bytes with names of up to 16.
    #[must_use]
    pub const fn told_of(&self, task: &'static str) -> Crash<'_> {
        Crash { record: self, task }
    }
}

/// The last crash and the name of its task.
pub(crate) type LastCrash = (CrashRecord, &'static str);

/// No sum of noise, and none of zeros.
fn checksum(words: &[u32]) -> u32 {
    words.iter().fold(0x5EED_0001, |sum: u32, word| (sum.rotate_left(5) ^ word).wrapping_mul(0x9E37_79B1))
}

/// The end of a file's name, as a record keeps it.
#[must_use]
pub fn end_of_file_name(name: &str) -> [u8; FILE_BYTES] {
    let mut file = [0; FILE_BYTES];
    let skipped = name.len().saturating_sub(FILE_BYTES);
    for (slot, byte) in file.iter_mut().zip(name.bytes().skip(skipped)) {
        *slot = byte;
    }
    file
}

/// A record with the name of its task, to be shown: P-0-0012 and the log.
#[derive(Clone, Copy, Debug)]
pub struct Crash<'a> {
    record: &'a CrashRecord,
    task: &'static str,
}

impl fmt::Display for Crash<'_> {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let CrashRecord { cause, pc, lr, sp, status: [cfsr, hfsr, mmfar, bfar], detail, ref file, .. } = *self.record;
        let task = self.task;
        match cause {
            CrashCause::Panic => {
                write!(formatter, "panic in {task} at ")?;
                // The bytes that are cut off may have left half a character.
                for byte in file.iter().take_while(|byte| **byte != 0) {
                    let shown = if byte.is_ascii_graphic() { char::from(*byte) } else { '?' };
                    write!(formatter, "{shown}")?;
                }
                write!(formatter, ":{detail}")
            }
            CrashCause::Watchdog if detail == 0 => write!(formatter, "watchdog: a task did not end, or none ran"),
            CrashCause::Watchdog => write!(formatter, "watchdog: tasks {detail:02x}H did not begin or went silent"),
            CrashCause::ControlStopped => {
                write!(formatter, "control stopped in {task}, pc {pc:08x} lr {lr:08x}")
            }
            CrashCause::Clock => write!(formatter, "crystal failed in {task}, pc {pc:08x}"),
            CrashCause::StackOverflow => {
                write!(formatter, "stack overflow in {task}, pc {pc:08x} lr {lr:08x} sp {sp:08x} at {mmfar:08x}")
            }
            CrashCause::Unbound => write!(formatter, "interrupt without a task in {task}, pc {pc:08x}"),
            CrashCause::Fault => {
                let at = if cfsr & 0xFF != 0 { mmfar } else { bfar };
                write!(
                    formatter,
                    "fault in {task}, pc {pc:08x} lr {lr:08x} CFSR {cfsr:08x} HFSR {hfsr:08x} at {at:08x}"
                )
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::string::ToString;

    use proptest::prelude::*;
    use sercos::capacity::LIVE_TEXT_BYTES;

    use super::*;

    fn record() -> CrashRecord {
        CrashRecord {
            told: true,
            in_a_row: 2,
            exception: 0x1FF,
            count: 77,
            pc: 0x0800_1234,
            lr: 0x0800_4321,
            sp: 0x2001_FF00,
            xpsr: 0x2100_0000,
            registers: core::array::from_fn(|number| 0x1000 + number as u32),
            status: [0x0001_0000, 0x4000_0000, 0xE000_ED34, 0xE000_ED38],
            detail: 4_711,
            file: end_of_file_name("firmware/drive/src/motion/supervision.rs"),
            ..CrashRecord::new(CrashCause::Panic)
        }
    }

    #[test]
    fn what_was_emitted_is_parsed_for_every_cause() {
        for code in 0..=127 {
            let Some(cause) = CrashCause::from_code(code) else { continue };
            for told in [false, true] {
                let record = CrashRecord { cause, told, ..record() };
                assert_eq!(CrashRecord::parse(&record.emit()), Some(record));
            }
        }
    }

    #[test]
    fn every_changed_bit_makes_it_no_record() {
        let words = record().emit();
        for bit in 0..32 * CRASH_WORDS {
            let mut changed = words;
            changed[bit / 32] ^= 1 << (bit % 32);
            assert_eq!(CrashRecord::parse(&changed), None, "bit {bit}");
        }
    }

    #[test]
    fn zeros_and_ones_are_no_record() {
        assert_eq!(CrashRecord::parse(&[0; CRASH_WORDS]), None);
        assert_eq!(CrashRecord::parse(&[u32::MAX; CRASH_WORDS]), None);
    }

    proptest! {
        #[test]
        fn noise_is_no_record(words: [u32; CRASH_WORDS]) {
            prop_assert_eq!(CrashRecord::parse(&words), None);
            // Not even with the right mark.
            let mut marked = words;
            marked[0] = MARK;
            prop_assert_eq!(CrashRecord::parse(&marked), None);
        }
    }

    #[test]
    fn a_checksum_does_not_make_an_unknown_cause_a_record() {
        let mut words = record().emit();
        words[1] = words[1] & !0x7F | 0x55;
        words[CRASH_WORDS - 1] = checksum(&words[..CRASH_WORDS - 1]);
        assert_eq!(CrashRecord::parse(&words), None);
    }

    #[test]
    fn crashes_are_counted_and_those_in_a_row_end_with_a_time_in_which_all_was_well() {
        let first = CrashRecord::new(CrashCause::Fault).after(None);
        let second = CrashRecord::new(CrashCause::Panic).after(Some(&first));
        let well = CrashRecord { in_a_row: 0, ..second };
        let third = CrashRecord::new(CrashCause::Panic).after(Some(&well));
        let counts = [first, second, third].map(|record| (record.count, record.in_a_row));
        assert_eq!(counts, [(1, 1), (2, 2), (3, 1)]);
        let many = CrashRecord { count: u32::MAX, in_a_row: u8::MAX, ..first };
        assert_eq!(CrashRecord::new(CrashCause::Panic).after(Some(&many)).count, u32::MAX);
    }

    #[test]
    fn of_a_long_name_the_end_is_kept() {
        let text = |name: &str| std::string::String::from_utf8(end_of_file_name(name).to_vec()).unwrap();
        assert_eq!(text("firmware/drive/src/motion/supervision.rs"), "e/drive/src/motion/supervision.rs"[1..]);
        assert_eq!(text("a.rs").trim_end_matches('\0'), "a.rs");
    }

    #[test]
    fn every_text_fits_and_names_task_and_place() {
        let longest = "capture_feedback";
        for cause in (0..=127).filter_map(CrashCause::from_code) {
            let record = CrashRecord { cause, detail: u32::MAX, ..record() };
            let text = record.told_of(longest).to_string();
            assert!(text.len() <= LIVE_TEXT_BYTES && text.is_ascii(), "{text}");
            assert!(cause == CrashCause::Watchdog || text.contains(longest), "{text}");
        }
        let panic = record();
        assert_eq!(panic.told_of("idle").to_string(), "panic in idle at /drive/src/motion/supervision.rs:4711");
        let silent = CrashRecord { detail: 0x10, ..CrashRecord::new(CrashCause::Watchdog) };
        assert_eq!(silent.told_of("").to_string(), "watchdog: tasks 10H did not begin or went silent");
    }

    #[test]
    fn p_0_0013_shows_everything_but_mark_and_checksum() {
        let shown = record().shown();
        assert_eq!(shown[2], 0x0800_1234);
        assert_eq!(shown[..], record().emit()[1..CRASH_WORDS - 1]);
        const { assert!(SHOWN_WORDS <= sercos::capacity::LIVE_LONG_ENTRIES) };
    }
}
