//! What a run reports: plain numbers for the terminal, the HTML page and JSON.
//!
//! Everything here is simulated time and computed values: no wall-clock time, no host names, no random
//! identifiers, so that two runs give the same report, byte for byte.

use serde::Serialize;

/// Where a drive ran.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Platform {
    /// The portable crates, compiled for this computer.
    Host,
    /// The release ELF in QEMU.
    Qemu,
}

/// How far a run has come. Given to the progress callback some ten to a hundred times a phase.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Progress {
    /// Communication phase of the ring, 0 to 4.
    pub phase: u8,
    /// What happens now, a few words: "S-0-0127 on drive 2", "follow the line shaft".
    pub what: String,
    /// Cycles (or steps) of this phase done.
    pub done: u64,
    /// Cycles (or steps) of this phase in all; 0 where that is not known beforehand.
    pub of: u64,
    /// Simulated time since the run began, in microseconds.
    pub time_us: u64,
}

/// The stay in one communication phase.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct PhaseTime {
    /// Communication phase, 0 to 4.
    pub phase: u8,
    /// First MST of this phase, in microseconds since the run began.
    pub start_us: u64,
    /// First MST of the next phase, or the end of the run.
    pub end_us: u64,
    /// Service-channel steps (handshakes) of all drives in this phase.
    pub service_steps: u64,
}

/// A part of the motion, as the master commanded it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct MotionSegment {
    /// A few words: "accelerate", "constant speed", "press stroke", "stop".
    pub name: String,
    /// Start in microseconds since the run began.
    pub start_us: u64,
    /// End in microseconds since the run began.
    pub end_us: u64,
    /// The commanded velocity does not change here; these segments give the following error at constant speed.
    pub constant_speed: bool,
}

/// The motion at one instant.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Sample {
    /// Microseconds since the run began.
    pub time_us: u64,
    /// Where the line shaft was a cycle before: where the commands lead, in degrees of the load shaft.
    pub command_degrees: f64,
    /// True position of the shaft, in degrees.
    pub feedback_degrees: f64,
    /// Command minus feedback, in degrees.
    pub error_degrees: f64,
    /// Velocity of the shaft, in revolutions per minute.
    pub velocity_rpm: f64,
    /// Torque-producing current command, as a fraction of the amplifier's peak current, -1 to 1.
    pub current_fraction: f64,
}

/// The distance between command and feedback, in degrees.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct FollowingError {
    /// Largest magnitude in the segments of constant speed.
    pub constant_speed_max_degrees: f64,
    /// Root mean square in the segments of constant speed.
    pub constant_speed_rms_degrees: f64,
    /// Largest magnitude of the whole motion.
    pub overall_max_degrees: f64,
    /// Root mean square of the whole motion.
    pub overall_rms_degrees: f64,
}

/// How unsteady the motor's torque is: what leaves a straight line through it, in per cent of what the peak current makes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct TorqueRipple {
    /// Root mean square on the ramp up, from 0.3 s on.
    pub accelerating_rms_percent: f64,
    /// Highest less lowest, there.
    pub accelerating_peak_to_peak_percent: f64,
    /// Root mean square at constant speed.
    pub constant_speed_rms_percent: f64,
}

/// Many measurements of one duration, in nanoseconds of simulated time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Durations {
    /// How many were measured.
    pub count: u64,
    /// The shortest.
    pub shortest_ns: u64,
    /// The mean, rounded down.
    pub mean_ns: u64,
    /// The longest.
    pub longest_ns: u64,
}

/// Telegrams that did not arrive or were not valid.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct MissedTelegrams {
    /// MSTs that the drive missed (S-0-0028).
    pub mst: u64,
    /// MDTs that the drive missed (S-0-0029).
    pub mdt: u64,
    /// ATs of the drive that the master missed, but for the first of CP3.
    pub at: u64,
    /// The AT of the first cycle of CP3 was missed. The drive learns of CP3 from the MST of this very cycle, when its chip
    /// has begun with the telegrams of CP2; a master forgives one.
    pub first_at: bool,
}

/// A service-channel step that ended in an error.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct ServiceError {
    /// MST count at the step.
    pub cycle: u64,
    /// The data block, in words: "S-0-0127".
    pub idn: String,
    /// Element 1 to 7.
    pub element: u8,
    /// The error word of the AT (sercos2.md 3.5).
    pub code: u16,
}

/// The demonstration: one drive as the flashed ELF in a ring with others, run up and following a line shaft.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DemoReport {
    /// Where the drive under test ran.
    pub platform: Platform,
    /// Address of the drive under test.
    pub address: u8,
    /// Addresses of all drives of the ring, in ring order.
    pub ring: Vec<u8>,
    /// Bit rate of the ring in Mbit/s.
    pub megabits_per_second: u8,
    /// S-0-0002 in CP3 and CP4, in microseconds.
    pub cycle_us: u32,
    /// End of the run, in microseconds since its beginning.
    pub end_us: u64,
    /// Phase that each drive of `ring` had reached when the motion began.
    pub phases_reached: Vec<u8>,
    /// CP0 to CP4, in order.
    pub phases: Vec<PhaseTime>,
    /// Service-channel steps that ended in an error, all drives.
    pub service_errors: Vec<ServiceError>,
    /// From a step that needs the processor to its release, in the drive under test.
    pub service_release: Durations,
    /// Of the drive under test.
    pub missed: MissedTelegrams,
    /// From the chip's interrupt at t4 to the last word of the AT record, in the drive under test.
    pub interrupt_to_at: Durations,
    /// From the chip's interrupt at t3 to the command in force, in the drive under test.
    pub interrupt_to_command: Durations,
    /// Numbers of the whole motion, from all samples at loop rate (not only from `samples`).
    pub following: FollowingError,
    /// Likewise.
    pub torque_ripple: TorqueRipple,
    /// The motion's parts, in order.
    pub segments: Vec<MotionSegment>,
    /// The motion, equally spaced in time.
    pub samples: Vec<Sample>,
    /// All accesses of the drive under test folded into a number, and how many they were; `None` on the host.
    pub trace: Option<String>,
    /// Lines of the drive's log (defmt), as decoded.
    pub log: Vec<String>,
}

/// What became of a transition check.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Acknowledgement {
    /// The recording did not ask for it.
    NotAsked,
    /// Asked for, and not answered positively before the phase switch.
    Missing,
    /// Asked for and answered with an error.
    Negative,
    /// Acknowledged positively before the phase switch.
    Positive,
}

/// A value that the master wrote and the drive does not give back.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct ReadBackDifference {
    /// The data block, in words: "S-0-0016".
    pub idn: String,
    /// What the master wrote, as 16-bit words.
    pub written: Vec<u16>,
    /// What the drive gives back, as 16-bit words.
    pub read: Vec<u16>,
}

/// One drive's part in a replay.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct DriveReplay {
    /// Address of the drive.
    pub address: u8,
    /// Where it ran.
    pub platform: Platform,
    /// Phase at the end.
    pub phase: u8,
    /// S-0-0127 before CP3.
    pub check_127: Acknowledgement,
    /// S-0-0128 before CP4.
    pub check_128: Acknowledgement,
    /// Service-channel steps.
    pub service_steps: u64,
    /// Steps that ended in an error.
    pub service_errors: Vec<ServiceError>,
    /// How many data blocks the master wrote.
    pub written: u64,
    /// Those that do not read back as written.
    pub differences: Vec<ReadBackDifference>,
    /// From a step that needs the processor to its release; `None` where no step was measured.
    pub service_release: Option<Durations>,
    /// Telegrams missed.
    pub missed: MissedTelegrams,
    /// Why this drive failed, one line; `None` if it passed.
    pub failure: Option<String>,
}

/// A recording played against one drive per address found in it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct ReplayReport {
    /// Where drive 1 ran.
    pub platform: Platform,
    /// MSTs played.
    pub cycles: u64,
    /// The cycle time in force at the end, in microseconds.
    pub cycle_us: u32,
    /// Phases of the ring, in order.
    pub phases: Vec<PhaseTime>,
    /// One for each address, in ascending order.
    pub drives: Vec<DriveReplay>,
    /// Every drive reached CP4 and none failed.
    pub passed: bool,
}
