//! The state of the hot tasks at one instant, for the log.

use sercos::diagnostic::Class1;

use crate::state::DriveState;

/// Taken under one short lock, read without.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Snapshot {
    /// State of the drive.
    pub state: DriveState,
    /// S-0-0011.
    pub class_1: Class1,
}
