//! Placeholder.
#![no_std]
#![forbid(unsafe_code)]
mod bus;
pub use bus::{Bus, RamAddress, Register};
