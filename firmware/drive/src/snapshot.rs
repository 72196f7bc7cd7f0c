//! The state of the hot tasks at one instant, for the tasks that may take their time.

use sercos::diagnostic::{Class1, Class3};

use crate::feedback::FeedbackValues;
use crate::motion::CommandValues;
use crate::state::{Conditions, DriveState};

/// Taken under one short lock, read without.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Snapshot {
    /// State of the drive.
    pub state: DriveState,
    /// What the state machine knows of power, faults and standstill.
    pub conditions: Conditions,
    /// S-0-0011.
    pub class_1: Class1,
    /// S-0-0013.
    pub class_3: Class3,
    /// S-0-0135 without the bits of the service channel.
    pub status_word: u16,
    /// S-0-0134, S-0-0036, S-0-0047.
    pub commands: CommandValues,
    /// S-0-0051, S-0-0040, S-0-0084, S-0-0189.
    pub values: FeedbackValues,
    /// S-0-0028.
    pub mst_errors: u16,
    /// S-0-0029.
    pub mdt_errors: u16,
}
