//! Motor and load on the host: inertia, friction, torque limit, coupling and encoder.
//!
//! The model is driven by absolute simulated time in nanoseconds and is deterministic: the state is computed on a fixed grid of
//! 10 us and at the instants when the current command changes, and nothing else. How often it is queried does not matter,
//! and only additions, multiplications and divisions of IEEE 754 are used, so that every machine gives the same bits.
#![forbid(unsafe_code)]

mod motor;
mod reference_axis;

pub use motor::{Coupling, Motor, MotorSettings};
pub use reference_axis::{ReferenceAxis, SuggestedGains};
