//! The state of the hot tasks at one instant, for the tasks that may take their time.

use sercos::diagnostic::{Class1, Class2, Class3};

use crate::diagnosis::words::{Manufacturer1, Manufacturer2, Manufacturer3};
use crate::signal::command::CommandValues;
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
    /// S-0-0012.
    pub class_2: Class2,
    /// S-0-0013.
    pub class_3: Class3,
    /// S-0-0129.
    pub manufacturer_1: Manufacturer1,
    /// S-0-0181.
    pub manufacturer_2: Manufacturer2,
    /// S-0-0182.
    pub manufacturer_3: Manufacturer3,
    /// S-0-0148 has set the reference and is not cancelled yet.
    pub homing: bool,
    /// S-0-0135 without the bits of the service channel.
    pub status_word: u16,
    /// S-0-0134 and the command values.
    pub commands: CommandValues,
    /// S-0-0028.
    pub mst_errors: u16,
    /// S-0-0029.
    pub mdt_errors: u16,
    /// Time since the processor was started, in us.
    pub operating_time: u64,
}
