//! The simulated machine against the textbook.
//!
//! One program, because each would be linked with everything for itself.

mod cable;
mod common;
mod contract;
mod electrics;
mod legs;
mod measurement;
mod mechanics;
mod reference_axes;
mod supply;
