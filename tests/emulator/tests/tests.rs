//! The rig: programs of a few instructions, and the ELF at its boot.
//!
//! One program, because each would be linked with everything for itself.

mod boot;
mod bus;
mod flash;
mod program;
mod quiet;
mod survival;
mod trace;
