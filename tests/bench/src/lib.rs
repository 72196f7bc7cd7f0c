//! Drives on a simulated ring: the world that joins ring, chips, processors and motors, and the runs that are made in it.
//!
//! * [`world`], [`processor`]: one simulated time for all.
//! * [`host_drive`], [`motor_side`]: the drive's portable tasks on this computer, beside a motor.
//! * [`measure`], [`report`]: what a run tells.
#![forbid(unsafe_code)]

pub mod host_drive;
pub mod measure;
pub mod motor_side;
pub mod processor;
pub mod report;
pub mod world;

pub use host_drive::{HostDrive, Latency};
pub use processor::{Processor, ProcessorError};
pub use world::World;
