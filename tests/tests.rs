//! The whole drive.
//!
//! One program, because each would be linked with everything for itself.

mod amplifier;
mod blocked;
mod bridge_and_brake;
mod commissioning;
mod common;
mod coordinates;
mod demo;
#[path = "common/elf.rs"]
mod elf;
mod faults;
mod following;
mod functions;
mod hand_overs;
#[path = "common/kept.rs"]
mod kept;
mod last_metre;
mod latches;
mod laws;
#[path = "common/led.rs"]
mod led;
mod paths;
mod positioning;
mod power;
mod qemu;
mod recorded_start;
#[path = "recordings/find.rs"]
mod recordings;
mod recovery;
mod regeneration;
mod releases;
mod remembering;
mod replay;
mod run_up;
#[path = "common/running.rs"]
mod running;
mod saving;
mod selected_backup;
mod stops;
mod temperatures;
mod tension;
mod torque;
mod travel;
