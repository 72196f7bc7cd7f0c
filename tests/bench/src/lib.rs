//! Drives on a simulated ring: the world that joins ring, chips, processors and motors, and the runs that are made in it.
//!
//! * [`world`], [`processor`]: one simulated time for all.
//! * [`host_drive`], [`motor_side`]: the drive's portable tasks on this computer, beside a motor.
//! * [`measure`], [`report`]: what a run tells.
//! * [`traced()`]: the ELF, counted instruction by instruction.
#![forbid(unsafe_code)]

mod axis;
mod crashing;
pub mod demo;
mod elf;
pub mod executor;
pub mod host_drive;
pub mod measure;
mod memory;
pub mod motor_side;
mod observer;
pub mod processor;
pub mod qemu_drive;
pub mod replay;
pub mod report;
pub mod ring_of_drives;
pub mod traced;
mod works;
pub mod world;

pub use axis::{commissioned, parameters_of, product};
pub use crashing::{Crashing, crashing_drive};
pub use demo::{DemoError, demo, demo_on, demo_with};
pub use elf::{Elf, LineEdge, Lines, OnStop, Tape};
pub use executor::{Elves, Executor};
pub use host_drive::{HostDrive, Latency};
pub use memory::{SharedFlash, saved, saved_often, saved_set, set_in, told};
pub use motor_side::Amplifier;
pub use processor::{Processor, ProcessorError};
pub use qemu_drive::QemuDrive;
pub use replay::{ReplayError, ReplayOptions, replay};
pub use ring_of_drives::{DriveHandle, DriveSetup, ring_of_drives, ring_of_drives_on};
pub use traced::{StackUse, TraceError, Traced, traced};
pub use works::{Works, amplifier_of, record_of};
pub use world::{Inhabited, World};
