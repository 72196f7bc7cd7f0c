//! The laws of the axis: what is true of every drive at every instant, in every test.
//!
//! The bench gives every drive an [`Observer`]. It hears the fibre of its drive as bytes, and sees pins, shaft and bridge; of the
//! firmware it knows nothing. What the drive is set to it learns from the dialogues of the service channel, as a listener.
//! A law that lacks what it needs to know is silent, and [`Observer::coverage`] counts how often each one spoke.
//!
//! * [`Wire`]: telegrams, switches, states, phases. [`Dialogue`] and [`Settings`]: the service channel and what it has told.
//! * [`Sight`]: pins, shaft and bridge at one instant. [`Scene`]: all of it together, which the laws look at.
//! * `laws`: one file a law.
#![forbid(unsafe_code)]

mod blocks;
mod broken;
mod dialogue;
mod lasting;
mod law;
mod laws;
mod observer;
mod scene;
mod settings;
mod sight;
mod units;
mod wire;

pub use broken::Broken;
pub use dialogue::{Dialogue, Heard};
pub use law::Coverage;
pub use observer::{Observer, SharedObserver};
pub use scene::Scene;
pub use settings::Settings;
pub use sight::Sight;
pub use units::Units;
pub use wire::Wire;
