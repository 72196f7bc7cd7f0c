//! Driver for the SERCON816 SERCOS II ring controller, slave side.
//!
//! The crate is `no_std`, allocates nothing and has no `unsafe`. Everything goes through one trait, [`Bus`]: single 16-bit accesses to 43
//! control registers and 2048 words of dual-port RAM. A bus that is `Clone` gives each task its own handle, so that no task waits for another:
//!
//! | task | handle | what |
//! |---|---|---|
//! | interrupt lines | [`Interrupts`] | reads, acknowledges and sorts the interrupt sources |
//! | loop timer, in CP0 | [`Discovery`] | finds out which timer sets which bit |
//! | phase change | [`Slave`] | initialisation, phases |
//! | service channel | [`ServicePort`] | one step of the master at a time |
//! | t3 | [`CommandPort`] | the record of the MDT |
//! | t4 | [`FeedbackPort`] | the record of the AT |
//!
//! # Example
//!
//! A bus is four functions. Here is one on which nobody answers, and what the driver says of it:
//!
//! ```
//! use sercon816::{BitRate, Bus, Configuration, MasterClock, RamAddress, Register, Slave, Transceiver};
//!
//! /// The data lines are pulled up.
//! struct Nobody;
//!
//! impl Bus for Nobody {
//!     fn read_register(&mut self, _: Register) -> u16 {
//!         0xFFFF
//!     }
//!     fn write_register(&mut self, _: Register, _: u16) {}
//!     fn read_ram(&mut self, _: RamAddress) -> u16 {
//!         0xFFFF
//!     }
//!     fn write_ram(&mut self, _: RamAddress, _: u16) {}
//! }
//!
//! let configuration = Configuration {
//!     address: 5,
//!     bit_rate: BitRate::Mbit2,
//!     clock: MasterClock::Mhz32,
//!     transceiver: Transceiver::STANDARD,
//! };
//! let refused = Slave::new(Nobody).initialise(&configuration).unwrap_err();
//! assert_eq!(refused.to_string(), "version register reads FFFFH, a SERCON816 has 0010H");
//! ```
//!
//! `examples/slave_on_a_bus.rs` sets a slave up on a bus that remembers, and shows what stands in the chip then.
//!
//! # Sources
//!
//! The chip's reference guide is not public. What is known, and how well, is in `docs/reference/sercon816.md` of the repository, which the code
//! cites as sercon816.md with a section number; what is not known is in [`uncertain`], together with the way in which the driver does without.
//!
//! SERCOS is a trademark of its owner, with whom this crate is not connected.
//!
//! # Licence
//!
//! MIT or Apache 2.0, at your choice.
#![no_std]
#![forbid(unsafe_code)]
#![cfg_attr(
    not(test),
    deny(
        clippy::unwrap_used,
        clippy::expect_used,
        clippy::indexing_slicing,
        clippy::arithmetic_side_effects,
        clippy::panic
    )
)]

#[cfg(test)]
extern crate std;

mod bus;
mod container;
mod discovery;
mod header;
mod interrupt;
pub mod layout;
mod port;
mod rate;
mod register;
pub mod service;
mod service_port;
mod slave;
mod status;
#[cfg(test)]
mod test_bus;
mod timer;
mod timing;
pub mod uncertain;

pub use bus::{Bus, RamAddress, Register};
pub use container::DataContainer;
pub use discovery::{Discovery, Observation, Orders};
pub use header::{END_MARKER, HeaderKind, ReceiveHeader, TransmitHeader, TransmitMode, header_kind};
pub use interrupt::{Events, Interrupts, Seen};
pub use layout::Block;
pub use port::{CommandPort, FeedbackPort};
pub use rate::{BitRate, ClockDivider, MasterClock};
pub use register::{SerialConfiguration, ServiceTimeouts, StartCommand, Transceiver};
pub use service_port::{Boundary, ServiceAnswer, ServicePort, ServiceStep};
pub use slave::{Configuration, CyclicConfiguration, CyclicError, EnterError, InitialiseError, Slave};
pub use status::{ErrorStatus, InterruptStatus};
pub use timer::{Timer, TimerMap};
pub use timing::{Timing, Window};
