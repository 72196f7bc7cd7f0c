//! A master that runs a ring up by itself and then moves its drives, telegram by telegram.
//!
//! Its MSTs *end* on an exact grid; every other instant is counted from there (sercos2.md 5.1). Within a cycle it
//! listens to the ATs, then decides what its MDT says, then, shortly before the next MST, sums up what was missed.

pub(crate) mod beat;
pub(crate) mod listener;
mod motion;
mod report;
mod script;
mod start_up;

use std::collections::BTreeMap;

use crate::ident::{Idn, Value};
use crate::service_client::{AtWords, ServiceClient, ServiceError, control};
use crate::slots::Slots;
use crate::station::Master;
use crate::time::Nanoseconds;
use crate::wire::{BROADCAST, LineError, Transmission};

use beat::{Act, Beat};
use listener::{Listener, at_words};
use motion::Stage;
use script::Layout;

pub use report::{Activity, DriveRecord, FeedbackSample, MasterError, MasterReport, MasterState, PhaseRecord};
pub use script::{
    CommandValues, DriveScript, LineShaft, MasterScript, Motion, Profile, ProfilePoint, SlotChoice, Telegram,
};

/// When the MDT starts in CP1 and CP2: in the middle of its window of 500 to 700 us (sercos2.md 2.1).
pub const START_UP_MDT: Nanoseconds = Nanoseconds::from_microseconds(600);
/// When an AT may start in CP1 and CP2 (sercos2.md 2.1).
pub const START_UP_AT_WINDOW: (Nanoseconds, Nanoseconds) =
    (Nanoseconds::from_microseconds(100), Nanoseconds::from_microseconds(300));
/// Address, status and info word: an AT without configurable data.
pub(crate) const SHORTEST_AT: usize = 5;

/// The master itself. See [`MasterScript`] for what it does and [`MasterReport`] for what it tells.
#[derive(Debug)]
pub struct ScriptedMaster {
    script: MasterScript,
    beat: Beat,
    phase: u8,
    cycle: u64,
    listener: Listener,
    /// Whom the MDT of the last cycle was for, in CP1 and CP2.
    addressed: Option<usize>,
    drives: Vec<Drive>,
    slots: Option<Slots>,
    work: Work,
    report: MasterReport,
    /// Switches in place of those of the script.
    switches: Option<u16>,
}

#[derive(Debug)]
struct Drive {
    address: u8,
    client: ServiceClient,
    at: Option<ReceivedAt>,
    lost_in_a_row: u32,
    layout: Layout,
    values: BTreeMap<Idn, Value>,
    /// A transition check that failed; the list of invalid data is being read.
    refused: Option<ServiceError>,
    commands: CommandValues,
    start: i32,
}

#[derive(Clone, Debug)]
struct ReceivedAt {
    words: AtWords,
    data: Vec<u8>,
}

/// What the master is at.
#[derive(Debug)]
enum Work {
    CloseRing { good: u32, without: u32 },
    Identify { drive: usize, tries: u32 },
    Dialogue { round: Round, drive: usize, loaded: bool },
    Settle { left: u32, phase: u8 },
    Synchronise { left: u32 },
    CheckForCp4,
    Move(Stage),
    Finished,
    Failed,
}

/// In CP2 every round is gone through with one drive after the other, as the recorded master does.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
enum Round {
    Read,
    Write,
    Reset,
    Check,
}

impl ScriptedMaster {
    /// A master before its first MST.
    pub fn new(script: MasterScript) -> Self {
        let drives = script.drives.iter().map(|drive| Drive {
            address: drive.address,
            client: ServiceClient::new(true, script.pace),
            at: None,
            lost_in_a_row: 0,
            layout: Layout::default(),
            values: BTreeMap::new(),
            refused: None,
            commands: CommandValues::default(),
            start: 0,
        });
        let records =
            script.drives.iter().map(|drive| DriveRecord { address: drive.address, ..DriveRecord::default() });
        Self {
            beat: Beat::new(script.bit_rate, script.start_up_microseconds()),
            phase: 0,
            cycle: 0,
            listener: Listener::default(),
            addressed: None,
            drives: drives.collect(),
            slots: None,
            work: Work::CloseRing { good: 0, without: 0 },
            report: MasterReport { drives: records.collect(), ..MasterReport::default() },
            switches: None,
            script,
        }
    }

    /// Begins again with CP0 and another script, in the rhythm of the MSTs so far; the report begins anew, too.
    pub fn restart(&mut self, script: MasterScript) {
        let beat = self.beat.clone();
        *self = Self::new(script);
        self.beat = beat;
        if let Act::Mst(_) = self.beat.act() {
            self.beat.mst_comes(0);
        }
    }

    /// What it has seen so far.
    pub fn report(&self) -> &MasterReport {
        &self.report
    }

    /// What it is doing.
    pub fn state(&self) -> MasterState {
        let activity = match &self.work {
            Work::CloseRing { good, .. } => Activity::ClosingRing { good: *good },
            Work::Identify { drive, .. } => {
                Activity::Identifying { address: self.drives[(*drive).min(self.drives.len() - 1)].address }
            }
            Work::Dialogue { drive, .. } => {
                let drive = &self.drives[(*drive).min(self.drives.len() - 1)];
                Activity::Service {
                    address: Some(drive.address),
                    request: format!("{}, {}", drive.client.idn(), drive.client.step()),
                }
            }
            Work::CheckForCp4 => Activity::Service { address: None, request: Idn::CHECK_FOR_CP4.to_string() },
            Work::Settle { .. } | Work::Synchronise { .. } => Activity::Settling,
            Work::Move(Stage::Power { .. } | Stage::Follow { .. }) => Activity::Enabling,
            Work::Move(Stage::Run { cycle }) => {
                Activity::Moving { done: *cycle, of: self.script.motion.as_ref().map_or(0, |motion| motion.cycles) }
            }
            Work::Move(Stage::Stop { .. }) => Activity::Stopping,
            Work::Finished => Activity::Finished,
            Work::Failed => match &self.report.error {
                Some(error) => Activity::Failed(error.clone()),
                None => Activity::Settling,
            },
        };
        MasterState { phase: self.phase, cycle: self.cycle, activity }
    }

    /// Whether the script has been run to its end, or has failed.
    pub fn is_done(&self) -> bool {
        let sent = self.report.phases.last().map(|record| record.phase);
        match self.work {
            Work::Failed => true,
            Work::Finished => sent == Some(4),
            _ => false,
        }
    }

    /// Phase of the last MST.
    pub fn phase(&self) -> u8 {
        self.phase
    }

    /// Number of MSTs sent.
    pub fn cycle(&self) -> u64 {
        self.cycle
    }

    /// The service channel of one drive, for requests beside the script in CP3 and CP4. Their results are added
    /// to the drive's record; a request that fails is recorded there and does not stop the master once it has finished.
    pub fn service(&mut self, drive: usize) -> &mut ServiceClient {
        &mut self.drives[drive].client
    }

    /// Sends these switches (bits 15 to 13 of the control word) in place of the script's while it moves its drives, whatever they answer:
    /// a drive that shuts down ends nothing. `None` ends that.
    pub fn hold_switches(&mut self, switches: Option<u16>) {
        self.switches = switches;
    }

    /// Sets the drives in motion once more, in CP4: they are switched on and follow.
    ///
    /// # Panics
    /// Before CP4, or after an error has ended the run.
    pub fn move_again(&mut self, motion: Motion) {
        assert!(self.phase == 4 && !matches!(self.work, Work::Failed), "{}", self.state());
        self.script.motion = Some(motion);
        self.work = Work::Move(Stage::Power { waited: 0 });
    }

    fn fail(&mut self, error: MasterError) {
        if self.report.error.is_none() {
            self.report.error = Some(error);
        }
        self.work = Work::Failed;
        self.phase = 0;
    }

    /// S-0-0002 governs from the first MST of CP3 on.
    fn cycle_time(&self) -> Nanoseconds {
        if self.phase < 3 {
            self.script.start_up_microseconds()
        } else {
            Nanoseconds::from_microseconds(u64::from(self.script.cycle))
        }
    }

    fn decide(&mut self) {
        if self.cycle > 0 {
            self.sum_up_cycle();
        }
        for drive in &mut self.drives {
            drive.at = None;
        }
        self.listener.begin_cycle();
    }

    /// What was missed in the cycle that ends, and the phase of the next.
    fn sum_up_cycle(&mut self) {
        let returned = self.listener.mst_has_returned();
        match &mut self.work {
            Work::CloseRing { good, without } => {
                *good = if returned { *good + 1 } else { 0 };
                *without = if returned { 0 } else { *without + 1 };
                let (good, without) = (*good, *without);
                if good >= self.script.good_msts {
                    self.phase = 1;
                    self.work = Work::Identify { drive: 0, tries: 0 };
                } else if without >= start_up::RING_OPEN_AFTER {
                    self.fail(MasterError::RingOpen { cycles: without });
                }
            }
            Work::Identify { drive, .. } if *drive == self.drives.len() => {
                self.phase = 2;
                self.work = Work::Dialogue { round: Round::Read, drive: 0, loaded: false };
            }
            Work::Settle { left, phase } => {
                *left = left.saturating_sub(1);
                if *left == 0 {
                    let phase = *phase;
                    self.count_ats();
                    if !matches!(self.work, Work::Failed) {
                        self.enter(phase);
                    }
                    return;
                }
            }
            Work::Synchronise { left } => *left = left.saturating_sub(1),
            _ => {}
        }
        self.count_ats();
    }

    fn enter(&mut self, phase: u8) {
        self.phase = phase;
        self.work = match phase {
            3 => Work::Synchronise { left: self.script.idle_in_cp3.max(1) },
            _ if self.script.motion.is_some() => Work::Move(Stage::Power { waited: 0 }),
            _ => Work::Finished,
        };
    }

    /// Valid ATs are counted where they are received; here those that did not come.
    fn count_ats(&mut self) {
        let phase = self.report.phases.last().map_or(0, |record| record.phase);
        if phase < 3 {
            // In CP1 and CP2 the dialogue itself notices.
            return;
        }
        let switched = self.report.phases.last().is_some_and(|record| phase == 3 && record.cycle + 1 == self.cycle);
        for index in 0..self.drives.len() {
            let drive = &mut self.drives[index];
            if drive.at.is_some() {
                drive.lost_in_a_row = 0;
                continue;
            }
            if switched {
                self.report.drives[index].missed_first_at = true;
            } else {
                self.report.drives[index].missed_ats += 1;
            }
            drive.lost_in_a_row += 1;
            if drive.lost_in_a_row >= 2 && !matches!(self.work, Work::Failed) {
                let address = drive.address;
                self.fail(MasterError::AtLost { address, phase, cycle: self.cycle - 1 });
            }
        }
    }

    fn mdt(&mut self, now: Nanoseconds) -> Option<Transmission> {
        let bytes = match self.phase {
            1 => self.identify(),
            2 => self.dialogue(),
            3 | 4 => Some(self.cyclic(now)),
            _ => None,
        }?;
        self.listener.mdt_sent(&bytes);
        Some(Transmission { bytes })
    }

    /// The MDT of CP3 and CP4: one record a drive.
    fn cyclic(&mut self, now: Nanoseconds) -> Vec<u8> {
        self.check_for_cp4();
        let control = self.motion_control(now);
        let synchronisation = if self.script.toggle_iposync {
            let units = self.cycle / u64::from(self.script.control_unit_cycles.max(1));
            if units % 2 == 1 { control::IPOSYNC } else { 0 }
        } else {
            0
        };
        let mut bytes = vec![BROADCAST];
        for index in 0..self.drives.len() {
            let drive = &mut self.drives[index];
            let words = drive.client.poll(drive.at.as_ref().map(|at| at.words));
            bytes.extend((words.control | control | synchronisation).to_le_bytes());
            bytes.extend(words.info.to_le_bytes());
            for (idn, length) in &drive.layout.mdt {
                bytes.extend(drive.commands.bytes_of(*idn, *length));
            }
            self.take_results(index);
        }
        bytes
    }

    fn receive_at(&mut self, start: Nanoseconds, bytes: &[u8]) {
        let Some(index) = self.drives.iter().position(|drive| drive.address == bytes[0]) else { return };
        let expected_length = SHORTEST_AT + if self.phase >= 3 { self.drives[index].layout.data().at_bytes } else { 0 };
        let in_time = self.listener.since_mst(start).is_some_and(|after| match (self.phase, &self.slots) {
            (1 | 2, _) => (START_UP_AT_WINDOW.0..=START_UP_AT_WINDOW.1).contains(&after),
            (_, Some(slots)) => {
                let t1 = Nanoseconds::from_microseconds(u64::from(slots.t1[index]));
                after.0.abs_diff(t1.0) <= self.script.at_tolerance.0
            }
            _ => false,
        });
        if !in_time || bytes.len() != expected_length {
            self.report.drives[index].invalid_ats += 1;
            return;
        }
        self.report.drives[index].ats += 1;
        self.drives[index].at = Some(ReceivedAt { words: at_words(bytes), data: bytes[SHORTEST_AT..].to_vec() });
    }
}

impl Master for ScriptedMaster {
    fn next_transmission(&self) -> Option<Nanoseconds> {
        Some(self.beat.time())
    }

    fn transmit(&mut self, now: Nanoseconds) -> Option<Transmission> {
        match self.beat.act() {
            Act::Decide => {
                self.decide();
                self.beat.mst_comes(self.phase);
                None
            }
            Act::Mst(phase) => {
                if self.report.phases.last().is_none_or(|last| last.phase != phase) {
                    self.report.phases.push(PhaseRecord { phase, cycle: self.cycle, time: self.beat.mark() });
                }
                self.cycle += 1;
                match (phase, &self.slots) {
                    (1 | 2, _) => self.beat.mdt_comes(START_UP_MDT),
                    (3 | 4, Some(slots)) => self.beat.mdt_comes(Nanoseconds::from_microseconds(u64::from(slots.t2))),
                    _ => self.beat.cycle_comes(self.cycle_time()),
                }
                Some(Transmission { bytes: vec![BROADCAST, phase] })
            }
            Act::Mdt => {
                let cycle = self.cycle_time();
                let transmission = self.mdt(now);
                self.beat.cycle_comes(cycle);
                transmission
            }
        }
    }

    fn receive(&mut self, start: Nanoseconds, end: Nanoseconds, frame: Result<&[u8], LineError>) {
        match frame {
            Err(_) => self.report.line_errors += 1,
            Ok(bytes) if self.listener.is_at(self.phase, end, bytes) => self.receive_at(start, bytes),
            Ok(_) => {}
        }
    }
}
