//! Placeholder.
#![no_std]
#![forbid(unsafe_code)]

mod hardware;
mod state;
mod work;

pub use hardware::{Amplifier, Hardware, InterruptLine, LOOP_PERIOD_MICROSECONDS};
pub use state::{Conditions, DriveState, StateMachine, Switches, status_bits};
pub use work::Work;
