//! Lists that the drive supplies.

use heapless::Vec;
use rtic_core::Mutex;
use sercon816::Bus;
use sercos::capacity::{LIVE_LIST_ENTRIES, LIVE_LONG_ENTRIES};

use super::context::Context;
use crate::diagnosis::error_memory::seconds;
use crate::dictionary::lists::{Longs, Words};
use crate::hardware::Hardware;
use crate::motion::Motion;
use crate::operation_mode::OperationMode;

/// Numbers of the languages of S-0-0095: German, English.
const LANGUAGES: [u16; 2] = [0, 1];

impl<B, H, M> Context<'_, B, M>
where
    B: Bus + Clone,
    H: Hardware,
    M: Mutex<T = Motion<B, H>>,
{
    pub(super) fn words(&mut self, words: Words, list: &mut Vec<u16, LIVE_LIST_ENTRIES>) {
        match words {
            Words::InvalidForCp3 => fill(list, self.checks.invalid_for_cp3.idns().map(|idn| idn.0)),
            Words::InvalidForCp4 => fill(list, self.checks.invalid_for_cp4.idns().map(|idn| idn.0)),
            Words::InvalidInCp4 => fill(list, self.checks.missing_mode.into_iter().map(|idn| idn.0)),
            Words::Languages => fill(list, LANGUAGES.into_iter()),
            Words::OperationModes => fill(list, OperationMode::SUPPORTED.into_iter()),
            Words::DiagnosticNumbers => fill(list, self.errors.newest_first().map(|error| error.number)),
            Words::ReasonsForCp3 => fill(list, self.checks.invalid_for_cp3.codes()),
            Words::NotRestored => fill(list, self.keeping.dropped.iter().map(|idn| idn.0)),
            Words::ReasonsForCp4 => fill(list, self.checks.invalid_for_cp4.codes()),
        }
    }

    pub(super) fn longs(&mut self, longs: Longs, list: &mut Vec<u32, LIVE_LONG_ENTRIES>) {
        match longs {
            Longs::ErrorTimes => fill(list, self.errors.newest_first().map(|error| error.seconds)),
            Longs::CrashRecord => fill(list, self.crash.iter().flat_map(|(record, _)| record.shown())),
            Longs::LastPosition => {
                let now = self.motion.lock(|motion| motion.operating_time());
                let now = self.total_seconds.saturating_add(seconds(now));
                let told = self.last_position.into_iter();
                fill(list, told.flat_map(|kept| [kept.position.cast_unsigned(), now.saturating_sub(kept.seconds)]));
            }
            Longs::PhaseErrorHistogram => {
                let histogram = self.motion.lock(|motion| motion.phase_error_histogram());
                fill(list, histogram.into_iter());
            }
            Longs::ScopePoints1 => self.points(0, list),
            Longs::ScopePoints2 => self.points(1, list),
            Longs::ScopePoints3 => self.points(2, list),
            Longs::ScopePoints4 => self.points(3, list),
        }
    }

    fn points(&mut self, channel: usize, list: &mut Vec<u32, LIVE_LONG_ENTRIES>) {
        self.motion.lock(|motion| fill(list, motion.oscilloscope().points(channel)));
    }
}

/// As many entries as there is room for; `extend` would panic on one more.
fn fill<T, const N: usize>(list: &mut Vec<T, N>, entries: impl Iterator<Item = T>) {
    for entry in entries {
        if list.push(entry).is_err() {
            break;
        }
    }
}
