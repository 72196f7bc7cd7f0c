//! What came of a replay.

use std::collections::BTreeMap;

use serde::Serialize;

use crate::ident::Idn;
use crate::service_client::{Reply, ServiceError};

/// The whole replay.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct ReplayReport {
    /// Cycles played, the read-back included.
    pub cycles: u64,
    /// Bursts that came back to the player and were no telegram.
    pub line_errors: u64,
    /// One entry a drive, in the order in which the recording addresses them.
    pub drives: Vec<DriveReport>,
}

impl ReplayReport {
    /// Whether every drive passed.
    pub fn passed(&self) -> bool {
        !self.drives.is_empty() && self.drives.iter().all(DriveReport::passed)
    }

    /// How many drives answer in CP4.
    pub fn in_cp4(&self) -> usize {
        self.drives.iter().filter(|drive| drive.reached_cp4()).count()
    }
}

/// What one drive made of the recording.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct DriveReport {
    /// Its address.
    pub address: u8,
    /// The highest phase in which it sent a valid AT; `None` if it never did.
    pub highest_phase: Option<u8>,
    /// Valid ATs by phase.
    pub ats: [u64; 5],
    /// ATs that were expected and did not come.
    pub missed_ats: u64,
    /// How often two ATs in a row were missed in CP3 or CP4: a real master would have gone to CP0.
    pub double_losses: u64,
    /// ATs outside their window; they count as missed, too.
    pub ats_at_wrong_time: u64,
    /// S-0-0127 was positively acknowledged in CP2.
    pub s0127: bool,
    /// S-0-0128 was positively acknowledged in CP3.
    pub s0128: bool,
    /// Whether S-0-0127 had been acknowledged when CP3 began, and S-0-0128 when CP4 began.
    pub acknowledged_before_switch: [Option<bool>; 2],
    /// Steps of the recording over the service channel.
    pub steps: u64,
    /// Steps that were answered with an error code.
    pub step_errors: Vec<StepError>,
    /// Steps that were not acknowledged when the master went on.
    pub fell_behind: Vec<FellBehind>,
    /// How long every step took.
    pub timings: Vec<StepTiming>,
    /// The words of the last complete write of every data block.
    pub written: BTreeMap<Idn, Vec<u16>>,
    /// Data blocks that were read back and are what was written, or are procedure commands.
    pub read_back: u64,
    /// Data blocks that are not.
    pub mismatches: Vec<Mismatch>,
}

/// A step that ended in an error.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct StepError {
    /// The cycle of the AT.
    pub cycle: u64,
    /// Its phase.
    pub phase: u8,
    /// The open data block.
    pub idn: Option<Idn>,
    /// The step.
    pub step: String,
    /// The info word.
    pub code: u16,
    /// The same in words.
    pub meaning: String,
}

/// A step that was too slow for the recorded master.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct FellBehind {
    /// The cycle in which the master went on.
    pub cycle: u64,
    /// Its phase.
    pub phase: u8,
    /// The open data block.
    pub idn: Option<Idn>,
    /// The step that was not acknowledged.
    pub step: String,
    /// Cycles that the recorded master gave it.
    pub allowed: u32,
}

/// How long a step took.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct StepTiming {
    /// The cycle in which the master began it.
    pub cycle: u64,
    /// The open data block.
    pub idn: Option<Idn>,
    /// The step.
    pub step: String,
    /// Cycles that the recorded master gave it.
    pub allowed: u32,
    /// Cycles until the AT that acknowledged it; `None` if none did before the next step.
    pub taken: Option<u32>,
}

/// A value that does not read back.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Mismatch {
    /// The data block.
    pub idn: Idn,
    /// The words that the recording wrote.
    pub written: Vec<u16>,
    /// The words that were read, if it could be read.
    pub read: Option<Vec<u16>>,
    /// Why it could not.
    pub error: Option<ServiceError>,
}

impl DriveReport {
    /// Whether this drive did all that the recorded one did: it answers in CP4, acknowledged S-0-0127 and S-0-0128
    /// before the switches, kept pace, never answered with an error, and knows everything that was written.
    pub fn passed(&self) -> bool {
        self.reached_cp4()
            && self.acknowledged_before_switch == [Some(true); 2]
            && self.double_losses == 0
            && self.step_errors.is_empty()
            && self.fell_behind.is_empty()
            && self.mismatches.is_empty()
            && !self.written.is_empty()
            && self.read_back == self.written.len() as u64
    }

    /// Whether it sent a valid AT in CP4.
    pub fn reached_cp4(&self) -> bool {
        self.highest_phase == Some(4)
    }

    /// The slowest acknowledged step, in cycles.
    pub fn slowest_step(&self) -> u32 {
        self.timings.iter().filter_map(|timing| timing.taken).max().unwrap_or(0)
    }

    pub(super) fn received(&mut self, phase: u8) {
        if let Some(count) = self.ats.get_mut(usize::from(phase)) {
            *count += 1;
        }
        self.highest_phase = self.highest_phase.max(Some(phase));
    }

    pub(super) fn switched_to(&mut self, phase: u8) {
        match phase {
            3 => self.acknowledged_before_switch[0] = Some(self.s0127),
            4 => self.acknowledged_before_switch[1] = Some(self.s0128),
            _ => {}
        }
    }

    pub(super) fn compare(&mut self, idn: Idn, written: &[u16], result: Result<Reply, ServiceError>) {
        match result {
            // A procedure command was cancelled in the end; what it shows then is its own affair.
            Ok(Reply::Data { attribute, .. }) if attribute.is_command() => self.read_back += 1,
            Ok(reply) if super::agrees(written, &reply) => self.read_back += 1,
            Ok(reply) => {
                let read = reply.value().map(|value| value.to_words());
                self.mismatches.push(Mismatch { idn, written: written.to_vec(), read, error: None });
            }
            Err(error) => {
                self.mismatches.push(Mismatch { idn, written: written.to_vec(), read: None, error: Some(error) })
            }
        }
    }
}
