//! The simulated machine against the textbook.
//!
//! One program, because each would be linked with everything for itself.

mod cable;
mod cogging;
mod common;
mod contract;
mod electrics;
mod encoder_errors;
mod legs;
mod measurement;
mod mechanics;
mod reference_axes;
mod shunts;
mod stiction;
mod supply;
mod thermometers;
