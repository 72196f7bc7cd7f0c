//! Chip, fibre, master and recordings.
//!
//! One program, because each would be linked with everything for itself.

mod chip_cycle;
mod chip_headers;
mod chip_interrupts;
mod chip_master_service;
mod chip_registers;
mod chip_rig;
mod chip_ring;
mod chip_slave_service;
mod chip_socket;
mod fibre_ring;
#[path = "../../recordings/find.rs"]
mod recordings;
mod replay;
mod scripted_master;
