//! Plays a recording as the master of a ring, and watches what the drives make of it.
//!
//! A recorded master waits for nobody: its telegrams come when they came, whatever the drives answer. So the player
//! only *follows* the dialogue: every change of a drive's handshake bit is a step, and the AT before the next step must
//! have acknowledged it. What the recording does not say about time it says about itself: S-0-0002 and S-0-0089 are
//! taken from its own writes. When it is over, the player goes on in CP4 and reads everything back that was written.

mod dialogue;
mod report;

use std::collections::BTreeMap;

use thiserror::Error;

use crate::capture::Recording;
use crate::ident::{Idn, Value};
use crate::master::beat::{Act, Beat};
use crate::master::listener::{Listener, at_words};
use crate::master::{START_UP_AT_WINDOW, START_UP_MDT};
use crate::service_client::{AtWords, MdtWords, Pace, Reply, Request, ServiceClient, control};
use crate::station::Master;
use crate::time::Nanoseconds;
use crate::wire::{BROADCAST, BitRate, LineError, Transmission};

use dialogue::{Dialogue, written_values};

pub use report::{DriveReport, FellBehind, Mismatch, ReplayReport, StepError, StepTiming};

/// MST period before CP3.
pub const CYCLE_BEFORE_CP3: Nanoseconds = Nanoseconds::from_millis(2);
/// How far an AT may start from t1 in CP3 and CP4.
const AT_TOLERANCE: Nanoseconds = Nanoseconds::from_microseconds(2);

/// Why a recording, though without a fault in itself, cannot be played.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum PlayError {
    /// No drive is ever addressed.
    #[error("the recording addresses no drive")]
    NoDrives,
    /// CP3 begins before a drive was told something that the player must know, too.
    #[error("drive {address}: CP3 begins without a write of {idn}")]
    NotWritten {
        /// The drive's address.
        address: u8,
        /// What is missing.
        idn: Idn,
    },
    /// Two drives were told different things where all must agree.
    #[error("{idn} is {actual} for drive {address}, expected {expected} as for the drives before it")]
    Different {
        /// The data block.
        idn: Idn,
        /// The drive's address.
        address: u8,
        /// Its value.
        actual: u16,
        /// The other drives' value.
        expected: u16,
    },
    /// A time that cannot be kept.
    #[error("{idn} = {value} us cannot be played: {reason}")]
    Time {
        /// The data block.
        idn: Idn,
        /// Its value.
        value: u16,
        /// What stands against it.
        reason: &'static str,
    },
    /// A record that lies outside the MDT.
    #[error("cycle {cycle}: MDT of {length} data bytes, drive {address} has its record at byte {position}")]
    Record {
        /// The cycle.
        cycle: u64,
        /// The drive's address.
        address: u8,
        /// Bytes of the MDT's data field.
        length: usize,
        /// S-0-0009.
        position: u16,
    },
}

/// What the recording tells about its own ring.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Plan {
    cycle: Nanoseconds,
    t2: Nanoseconds,
    /// t1 and S-0-0009 of every drive.
    drives: Vec<(Nanoseconds, u16)>,
}

/// Where the player is.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub enum Stage {
    /// In the recording.
    Playing,
    /// Behind it, reading back.
    ReadingBack,
    /// All done; the last MDT is repeated.
    Done,
}

/// The recording as a master.
#[derive(Debug)]
pub struct CapturePlayer {
    recording: Recording,
    plan: Option<Plan>,
    beat: Beat,
    cycle: u64,
    phase: u8,
    stage: Stage,
    listener: Listener,
    /// The last MDT of CP4, whose service words are replaced while reading back.
    pattern: Vec<u8>,
    /// Whom the MDT of the last cycle was for, in CP1 and CP2.
    addressed: Option<usize>,
    tracks: Vec<Track>,
    line_errors: u64,
}

#[derive(Debug)]
struct Track {
    dialogue: Dialogue,
    at: Option<AtWords>,
    at_expected: bool,
    lost_in_a_row: u32,
    client: Option<ServiceClient>,
    report: DriveReport,
}

impl CapturePlayer {
    /// A player before its first MST.
    ///
    /// # Errors
    ///
    /// When the recording does not say what is needed to play it.
    pub fn new(recording: Recording, rate: BitRate) -> Result<Self, PlayError> {
        let addresses = addresses(&recording);
        if addresses.is_empty() {
            return Err(PlayError::NoDrives);
        }
        let plan = plan(&recording, &addresses)?;
        let tracks = addresses.iter().map(|address| Track {
            dialogue: Dialogue::default(),
            at: None,
            at_expected: false,
            lost_in_a_row: 0,
            client: None,
            report: DriveReport { address: *address, ..DriveReport::default() },
        });
        Ok(Self {
            tracks: tracks.collect(),
            recording,
            plan,
            beat: Beat::new(rate, CYCLE_BEFORE_CP3),
            cycle: 0,
            phase: 0,
            stage: Stage::Playing,
            listener: Listener::default(),
            pattern: Vec::new(),
            addressed: None,
            line_errors: 0,
        })
    }

    /// The drives of the recording, in the order in which it addresses them.
    pub fn addresses(recording: &Recording) -> Vec<u8> {
        addresses(recording)
    }

    /// Whether recording and read-back are over.
    pub fn is_done(&self) -> bool {
        self.stage == Stage::Done
    }

    /// Where the player is.
    pub fn stage(&self) -> Stage {
        self.stage
    }

    /// Phase of the last MST.
    pub fn phase(&self) -> u8 {
        self.phase
    }

    /// Cycles played, and cycles of the recording.
    pub fn progress(&self) -> (u64, u64) {
        (self.cycle, self.recording.cycles.len() as u64)
    }

    /// What has been seen so far.
    pub fn report(&self) -> ReplayReport {
        ReplayReport {
            cycles: self.cycle,
            line_errors: self.line_errors,
            drives: self.tracks.iter().map(|track| track.report.clone()).collect(),
        }
    }

    /// The cycle that ends is summed up; the phase of the next comes out of the recording.
    fn decide(&mut self) {
        if self.cycle > 0 {
            self.count_missed_ats();
        }
        for track in &mut self.tracks {
            track.at = None;
        }
        self.listener.begin_cycle();
        match self.recording.cycles.get(self.cycle as usize) {
            Some(recorded) => {
                let phase = recorded.phase;
                if phase != self.phase {
                    self.tracks.iter_mut().for_each(|track| track.report.switched_to(phase));
                }
                self.phase = phase;
            }
            None if self.stage == Stage::Playing => self.begin_read_back(),
            None => {}
        }
    }

    fn count_missed_ats(&mut self) {
        for (index, track) in self.tracks.iter_mut().enumerate() {
            let expected = std::mem::take(&mut track.at_expected);
            if self.phase >= 3 {
                track.at_expected = true;
            } else {
                track.at_expected = self.addressed == Some(index);
            }
            if track.at.is_some() || !expected {
                track.lost_in_a_row = 0;
                continue;
            }
            track.report.missed_ats += 1;
            track.lost_in_a_row += 1;
            if track.lost_in_a_row == 2 && self.phase >= 3 {
                track.report.double_losses += 1;
            }
        }
        self.addressed = None;
    }

    fn begin_read_back(&mut self) {
        if self.phase != 4 || self.pattern.is_empty() {
            self.stage = Stage::Done;
            return;
        }
        self.stage = Stage::ReadingBack;
        for track in &mut self.tracks {
            let last = track.dialogue.last().unwrap_or(MdtWords { control: 0, info: 0 });
            let mut client = ServiceClient::taken_over(last, Pace::FASTEST);
            for idn in track.dialogue.written.keys() {
                client.request(Request::Read(*idn));
            }
            track.report.written = track.dialogue.written.clone();
            track.client = Some(client);
        }
    }

    fn mdt(&mut self) -> Option<Transmission> {
        let bytes = match self.recording.cycles.get(self.cycle as usize - 1) {
            Some(recorded) => {
                let bytes = recorded.mdt.clone()?;
                self.follow(&bytes);
                if self.phase == 4 {
                    self.pattern.clone_from(&bytes);
                }
                bytes
            }
            None => self.read_back(),
        };
        self.listener.mdt_sent(&bytes);
        Some(Transmission { bytes })
    }

    /// The recorded MDT as every drive sees it.
    fn follow(&mut self, mdt: &[u8]) {
        let cycle = self.cycle - 1;
        for index in 0..self.tracks.len() {
            let words = if self.phase < 3 {
                Some(mdt).filter(|mdt| mdt[0] == self.tracks[index].report.address).and_then(|mdt| words_at(mdt, 1))
            } else {
                self.plan.as_ref().and_then(|plan| words_at(mdt, usize::from(plan.drives[index].1)))
            };
            let Some(words) = words else { continue };
            if self.phase < 3 {
                self.addressed = Some(index);
            }
            let track = &mut self.tracks[index];
            track.dialogue.sent(words, cycle, self.phase, &mut track.report);
        }
    }

    fn read_back(&mut self) -> Vec<u8> {
        let mut bytes = self.pattern.clone();
        for (index, track) in self.tracks.iter_mut().enumerate() {
            let (Some(client), Some(plan)) = (&mut track.client, &self.plan) else { continue };
            let words = client.poll(track.at);
            let position = usize::from(plan.drives[index].1);
            let before = u16::from_le_bytes([bytes[position], bytes[position + 1]]);
            let control = before & !control::SERVICE | words.control;
            bytes[position..position + 2].copy_from_slice(&control.to_le_bytes());
            bytes[position + 2..position + 4].copy_from_slice(&words.info.to_le_bytes());
            while let Some(finished) = client.take_finished() {
                let idn = finished.request.idn();
                let written = track.report.written.get(&idn).cloned().unwrap_or_default();
                track.report.compare(idn, &written, finished.result);
            }
        }
        if self.tracks.iter().all(|track| track.client.as_ref().is_none_or(ServiceClient::is_idle)) {
            self.stage = Stage::Done;
        }
        bytes
    }

    fn receive_at(&mut self, start: Nanoseconds, bytes: &[u8]) {
        let Some(index) = self.tracks.iter().position(|track| track.report.address == bytes[0]) else { return };
        let in_time = self.listener.since_mst(start).is_some_and(|after| match (&self.plan, self.phase) {
            (Some(plan), 3 | 4) => after.0.abs_diff(plan.drives[index].0.0) <= AT_TOLERANCE.0,
            _ => (START_UP_AT_WINDOW.0..=START_UP_AT_WINDOW.1).contains(&after),
        });
        let track = &mut self.tracks[index];
        if !in_time {
            track.report.ats_at_wrong_time += 1;
            return;
        }
        let at = at_words(bytes);
        track.at = Some(at);
        track.report.received(self.phase);
        if self.stage == Stage::Playing {
            track.dialogue.received(at, self.cycle - 1, self.phase, &mut track.report);
        }
    }
}

impl Master for CapturePlayer {
    fn next_transmission(&self) -> Option<Nanoseconds> {
        Some(self.beat.time())
    }

    fn transmit(&mut self, _now: Nanoseconds) -> Option<Transmission> {
        let before_cp3 = self.phase < 3;
        let cycle = self.plan.as_ref().filter(|_| !before_cp3).map_or(CYCLE_BEFORE_CP3, |plan| plan.cycle);
        match self.beat.act() {
            Act::Decide => {
                self.decide();
                self.beat.mst_comes(self.phase);
                None
            }
            Act::Mst(phase) => {
                self.cycle += 1;
                let recorded = self.recording.cycles.get(self.cycle as usize - 1);
                let sends_mdt = recorded.map_or(!self.pattern.is_empty(), |recorded| recorded.mdt.is_some());
                if sends_mdt {
                    self.beat
                        .mdt_comes(self.plan.as_ref().filter(|_| !before_cp3).map_or(START_UP_MDT, |plan| plan.t2));
                } else {
                    self.beat.cycle_comes(cycle);
                }
                Some(Transmission { bytes: vec![BROADCAST, phase] })
            }
            Act::Mdt => {
                let transmission = self.mdt();
                self.beat.cycle_comes(cycle);
                transmission
            }
        }
    }

    fn receive(&mut self, start: Nanoseconds, end: Nanoseconds, frame: Result<&[u8], LineError>) {
        match frame {
            Err(_) => self.line_errors += 1,
            Ok(bytes) if self.listener.is_at(self.phase, end, bytes) => self.receive_at(start, bytes),
            Ok(_) => {}
        }
    }
}

fn words_at(mdt: &[u8], position: usize) -> Option<MdtWords> {
    let record = mdt.get(position..position + 4)?;
    Some(MdtWords {
        control: u16::from_le_bytes([record[0], record[1]]),
        info: u16::from_le_bytes([record[2], record[3]]),
    })
}

fn addresses(recording: &Recording) -> Vec<u8> {
    let mut addresses = Vec::new();
    for cycle in recording.cycles.iter().filter(|cycle| cycle.phase < 3) {
        if let Some(address) = cycle.mdt.as_ref().map(|mdt| mdt[0]).filter(|address| !addresses.contains(address)) {
            addresses.push(address);
        }
    }
    addresses
}

/// Times and places out of what the recording writes in CP2; `None` when it never gets to CP3.
fn plan(recording: &Recording, addresses: &[u8]) -> Result<Option<Plan>, PlayError> {
    let Some(cp3) = recording.cycles.iter().position(|cycle| cycle.phase >= 3) else { return Ok(None) };
    let written: Vec<BTreeMap<Idn, Vec<u16>>> =
        addresses.iter().map(|address| written_values(&recording.cycles[..cp3], *address)).collect();
    let word = |drive: usize, idn: Idn| {
        let missing = PlayError::NotWritten { address: addresses[drive], idn };
        written[drive].get(&idn).and_then(|words| words.first()).copied().ok_or(missing)
    };
    let common = |idn: Idn| {
        let expected = word(0, idn)?;
        for (drive, address) in addresses.iter().enumerate().skip(1) {
            let actual = word(drive, idn)?;
            if actual != expected {
                return Err(PlayError::Different { idn, address: *address, actual, expected });
            }
        }
        Ok(expected)
    };
    let (cycle, t2) = (common(Idn::CYCLE)?, common(Idn::T2)?);
    if cycle < 250 {
        return Err(PlayError::Time { idn: Idn::CYCLE, value: cycle, reason: "250 us is the shortest cycle" });
    }
    if t2 >= cycle {
        return Err(PlayError::Time { idn: Idn::T2, value: t2, reason: "the MDT starts after the cycle's end" });
    }
    let microseconds = |value: u16| Nanoseconds::from_microseconds(u64::from(value));
    let mut drives = Vec::new();
    for (drive, address) in addresses.iter().enumerate() {
        let position = word(drive, Idn::MDT_POSITION)?;
        for (cycle, recorded) in recording.cycles.iter().enumerate().skip(cp3) {
            let Some(mdt) = recorded.mdt.as_ref().filter(|_| recorded.phase >= 3) else { continue };
            if position == 0 || words_at(mdt, usize::from(position)).is_none() {
                return Err(PlayError::Record {
                    cycle: cycle as u64,
                    address: *address,
                    length: mdt.len() - 1,
                    position,
                });
            }
        }
        drives.push((microseconds(word(drive, Idn::T1)?), position));
    }
    Ok(Some(Plan { cycle: microseconds(cycle), t2: microseconds(t2), drives }))
}

/// Whether a value that was read is what was written; the maximum length of a list is the drive's own.
fn agrees(written: &[u16], reply: &Reply) -> bool {
    let Reply::Data { attribute, value } = reply else { return false };
    let read: Vec<u16> = Value::to_words(value);
    if attribute.is_variable() {
        return written.first() == read.first() && written.get(2..) == read.get(2..);
    }
    written == read
}
