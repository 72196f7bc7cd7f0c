//! The current loop: from three phase currents and an angle to three compare values.
//!
//! ```text
//! samples -> Clarke -> Park -> PI (d, q) + feed-forward -> voltage limit -> inverse Park -> space vector -> compare values
//! ```
//!
//! | quantity | unit in the loop |
//! |---|---|
//! | phase current | ADC counts, 2^-3 |
//! | d, q current | peak current S-0-0110, 2^-26 |
//! | voltage | volt, 2^-14 |
//! | angle | electrical revolution, 2^-32 |
//! | output | counts of the timer, 0 to the reload value or just beyond |
//!
//! A cycle multiplies 32 by 32 bits and keeps the high half, which is one instruction; it divides nowhere, and no data makes it longer than
//! a limit does, by some instructions. What changes slower than the cycle comes from outside: gains when a parameter changes
//! ([`CurrentLoopSettings`]), reference, feed-forward and bus voltage once a loop tick ([`CurrentCommand`]).

pub(crate) mod command;
pub(crate) mod control;
pub(crate) mod modulator;
pub(crate) mod protection;
pub(crate) mod readings;
pub(crate) mod sensing;
pub(crate) mod settings;
pub(crate) mod shared;
pub(crate) mod weakening;

pub use command::{BusScale, CurrentCommand, MotorModel};
pub use control::CurrentLoop;
pub use modulator::DeadTimeCompensation;
pub use protection::{Offsets, Protection, Trip};
pub use readings::CurrentReadings;
pub use sensing::{CurrentSensing, Hidden, ShuntWindow};
pub use settings::{CurrentLoopParameters, CurrentLoopSettings, PwmFrequency};
pub use shared::{SharedCommand, SharedReadings};
pub use weakening::{FieldWeakening, FieldWeakeningParameters, FieldWeakeningSettings, WeakeningOutput};
