//! Random lives of random axes, held to the laws.
//!
//! A life ([`life::Life`]) is an axis (machine, ring, scaling, polarity, limits, modes, telegrams) and what happens to it in CP4: control
//! bits, commands, mode switches, services, lost telegrams, faults, loads, supply. It comes from a seed ([`generate::life_of`]), is lived on
//! the whole simulated drive ([`run::live`]), and ends with peace: everything is repaired, S-0-0099, a fresh edge, and the axis must come
//! back. A life that breaks a law is shrunk ([`shrink::shrink`]) until it reads like a sentence, and can be kept as a file.
#![forbid(unsafe_code)]

mod causes;
pub mod coverage;
pub mod dice;
pub mod generate;
pub mod life;
mod master;
mod peace;
mod rig;
pub mod run;
mod services;
pub mod shrink;
mod steps;
mod units;
mod words;
pub mod work;

pub use coverage::Coverage;
pub use generate::life_of;
pub use life::Life;
pub use run::{Ending, Outcome, live};
pub use shrink::shrink;
