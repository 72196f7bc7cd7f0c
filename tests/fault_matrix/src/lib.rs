//! The fault matrix: every fault of drive, motor, brake, encoder, mains and ring, in the states and modes in which it can matter, and what
//! the drive does about it.
//!
//! A cell is a whole drive on a simulated ring ([`run`]): it is brought into its state, the fault is put in from outside (machine, board or
//! fibre, never a variable of the firmware), and what follows is measured on the bridge, the shaft and the service channel.
//! What has to follow stands in one table ([`cells`]).
#![forbid(unsafe_code)]

mod all;
mod cell;
mod difference;
mod expected;
mod fault;
mod outcome;
mod page;
mod rig;
mod target;

pub use all::run_all;
pub use cell::{Cell, run};
pub use difference::difference;
pub use expected::{Expected, cells};
pub use fault::Fault;
pub use outcome::{Afterwards, Outcome, Reaction};
pub use page::markdown;
pub use rig::{MatrixError, Mode, State};
pub use target::Target;
