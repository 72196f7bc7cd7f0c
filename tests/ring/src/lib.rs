//! A SERCOS II ring in software, from the bits on the fibre to the dialogue of a master station.
//!
//! * [`time`]: simulated time.
//! * [`wire`]: flags, zero insertion, NRZI and the frame check sequence; what a telegram can suffer on its way.
//! * [`chip`]: the SERCON816 at register and RAM level.
#![forbid(unsafe_code)]

pub mod chip;
pub mod time;
pub mod wire;

pub use time::Nanoseconds;
