//! What a [`super::ScriptedMaster`] tells: where it is, what it has seen, why it stopped.

use std::fmt;

use serde::Serialize;
use thiserror::Error;

use crate::ident::Idn;
use crate::service_client::{Finished, ServiceError};
use crate::slots::{DriveTimes, SlotError, Slots};
use crate::time::Nanoseconds;

/// Where a master is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MasterState {
    /// Phase of the last MST.
    pub phase: u8,
    /// Number of MSTs sent.
    pub cycle: u64,
    /// What it is doing.
    pub activity: Activity,
}

impl fmt::Display for MasterState {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "CP{}, cycle {}: {}", self.phase, self.cycle, self.activity)
    }
}

/// What a master is doing.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Activity {
    /// Waiting for its MSTs to come back.
    ClosingRing {
        /// Good ones in a row.
        good: u32,
    },
    /// Asking an address for an answer in CP1.
    Identifying {
        /// The drive's address.
        address: u8,
    },
    /// In dialogue over the service channel: with one drive in CP2, with all in CP3.
    Service {
        /// The drive's address, `None` with all of them.
        address: Option<u8>,
        /// The request in hand.
        request: String,
    },
    /// Nothing but cyclic telegrams until the next phase.
    Settling,
    /// Waiting for the drives to report power and to follow their commands.
    Enabling,
    /// The profile is running.
    Moving {
        /// Cycles done.
        done: u64,
        /// Cycles in all.
        of: u64,
    },
    /// The drives are being switched off.
    Stopping,
    /// The script is done; cyclic operation goes on.
    Finished,
    /// Something went wrong; the master sends MSTs of CP0.
    Failed(MasterError),
}

impl fmt::Display for Activity {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::ClosingRing { good } => write!(formatter, "closing the ring, {good} MSTs returned"),
            Self::Identifying { address } => write!(formatter, "identifying drive {address}"),
            Self::Service { address: Some(address), request } => write!(formatter, "drive {address}: {request}"),
            Self::Service { address: None, request } => write!(formatter, "all drives: {request}"),
            Self::Settling => write!(formatter, "settling"),
            Self::Enabling => write!(formatter, "enabling"),
            Self::Moving { done, of } => write!(formatter, "moving, {done} of {of} cycles"),
            Self::Stopping => write!(formatter, "stopping"),
            Self::Finished => write!(formatter, "finished"),
            Self::Failed(error) => write!(formatter, "failed: {error}"),
        }
    }
}

/// Why a master stopped.
#[derive(Clone, Debug, PartialEq, Eq, Error, Serialize)]
pub enum MasterError {
    /// The MST does not come back.
    #[error("ring open: MST not returned in {cycles} cycles")]
    RingOpen {
        /// Cycles without a good MST.
        cycles: u32,
    },
    /// A drive did not answer in CP1.
    #[error("drive {address} did not answer in CP1 ({tries} MDTs sent)")]
    NoAnswer {
        /// Its address.
        address: u8,
        /// How often it was asked.
        tries: u32,
    },
    /// A request over the service channel failed.
    #[error("drive {address} in CP{phase}: {error}")]
    Service {
        /// Its address.
        address: u8,
        /// The phase.
        phase: u8,
        /// What happened.
        error: ServiceError,
    },
    /// S-0-0127 or S-0-0128 was refused.
    #[error("drive {address} refused the transition check: {error}; invalid data: {}", list(invalid))]
    CheckRefused {
        /// Its address.
        address: u8,
        /// What happened.
        error: ServiceError,
        /// S-0-0021 or S-0-0022, read back.
        invalid: Vec<Idn>,
    },
    /// The drives' telegrams do not fit into the cycle.
    #[error(transparent)]
    Slots(#[from] SlotError),
    /// The AT of a drive was missed or invalid twice in a row in CP3 or CP4 (sercos2.md 2.4).
    #[error("drive {address}: two ATs lost in a row in CP{phase}, cycle {cycle}")]
    AtLost {
        /// Its address.
        address: u8,
        /// The phase.
        phase: u8,
        /// The cycle of the second.
        cycle: u64,
    },
    /// A drive did not reach a state in time.
    #[error("drive {address}: {expected} expected within {cycles} cycles, status word is {status:#06x}")]
    NotInTime {
        /// Its address.
        address: u8,
        /// What was waited for.
        expected: &'static str,
        /// How long.
        cycles: u64,
        /// The last status word.
        status: u16,
    },
    /// A drive shut down while it was to move.
    #[error("drive {address} shut down in cycle {cycle}: status word {status:#06x}")]
    ShutDown {
        /// Its address.
        address: u8,
        /// The cycle.
        cycle: u64,
        /// The status word.
        status: u16,
    },
}

fn list(idns: &[Idn]) -> String {
    if idns.is_empty() {
        return String::from("none listed");
    }
    idns.iter().map(Idn::to_string).collect::<Vec<_>>().join(", ")
}

/// The begin of a phase.
#[derive(Copy, Clone, Debug, PartialEq, Eq, Serialize)]
pub struct PhaseRecord {
    /// 0 to 4.
    pub phase: u8,
    /// The cycle of its first MST.
    pub cycle: u64,
    /// When that MST ended, ns.
    #[serde(serialize_with = "nanoseconds")]
    pub time: Nanoseconds,
}

fn nanoseconds<S: serde::Serializer>(time: &Nanoseconds, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_u64(time.0)
}

/// One drive in one cycle of motion.
#[derive(Copy, Clone, Debug, PartialEq, Eq, Serialize)]
pub struct FeedbackSample {
    /// The cycle, counted from the master's first MST.
    pub cycle: u64,
    /// End of the cycle's MST, ns.
    #[serde(serialize_with = "nanoseconds")]
    pub time: Nanoseconds,
    /// Index of the drive in the script.
    pub drive: usize,
    /// Cycles of the profile done before this one; `None` while the drives are being switched on or off.
    pub profile_cycle: Option<u64>,
    /// S-0-0047 sent in this cycle's MDT, valid from its t3.
    pub position_command: i32,
    /// S-0-0036 sent in this cycle's MDT.
    pub velocity_command: i32,
    /// Status word of this cycle's AT; its feedback was captured at t4 of the cycle before.
    pub status: Option<u16>,
    /// S-0-0051 of this cycle's AT.
    pub position: Option<i32>,
    /// S-0-0040 of this cycle's AT.
    pub velocity: Option<i32>,
    /// S-0-0189 of this cycle's AT.
    pub following_distance: Option<i32>,
}

/// What the master has seen of one drive.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct DriveRecord {
    /// Its address.
    pub address: u8,
    /// The times it asked for.
    pub times: DriveTimes,
    /// ATs that were expected and did not come, but for the first of CP3.
    pub missed_ats: u64,
    /// The AT of the first cycle of CP3 did not come: the slave learns of CP3 in this very cycle. One AT may be missed
    /// (sercos2.md 2.4), a second in a row counts like any other.
    pub missed_first_at: bool,
    /// ATs that came at a wrong time or with a wrong length; they count as missed, too.
    pub invalid_ats: u64,
    /// Valid ATs.
    pub ats: u64,
    /// All requests over the service channel.
    pub services: Vec<Finished>,
}

impl DriveRecord {
    /// Steps over the service channel.
    pub fn steps(&self) -> usize {
        self.services.iter().map(|service| service.steps.len()).sum()
    }

    /// The slowest step, in cycles.
    pub fn slowest_step(&self) -> u32 {
        self.services.iter().flat_map(|service| &service.steps).map(|step| step.cycles).max().unwrap_or(0)
    }
}

/// Everything a master has to tell.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct MasterReport {
    /// Every phase that was reached, in order.
    pub phases: Vec<PhaseRecord>,
    /// The drives, in the order of the script.
    pub drives: Vec<DriveRecord>,
    /// t1 to t4, once they are known.
    pub slots: Option<Slots>,
    /// One entry a drive and cycle from the beginning of CP4's work to its end.
    pub samples: Vec<FeedbackSample>,
    /// Bursts that came back and were no telegram.
    pub line_errors: u64,
    /// Why it stopped, if it did.
    pub error: Option<MasterError>,
}
