//! The last metre of the flashed ELF: whatever ends the program, bridge and brake go off at once, the record of it is there after the reset, and the drive
//! comes back.

mod boot;
mod record;
mod rig;
mod table;
mod watchdog;
