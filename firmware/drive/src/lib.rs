//! Placeholder.
#![no_std]
#![forbid(unsafe_code)]
mod hardware;
pub use hardware::{Amplifier, Hardware, InterruptLine, LOOP_PERIOD_MICROSECONDS};
