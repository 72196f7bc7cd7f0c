//! SERCOS II (IEC 61491), the slave's side: telegrams, communication phases, service channel, data blocks, slot timing.
//!
//! The crate is `no_std`, allocates nothing and has no `unsafe`. It knows no ring controller and no motor. Where a controller does the
//! service-channel handshake in hardware (SERCON816), [`service::Server`] is called only for the steps that need the processor; a controller
//! that does not may call it for every step.
//!
//! | part | what it holds |
//! |---|---|
//! | [`phase`], [`loss_counter`], [`transition`] | CP0 to CP4, lost telegrams, the checks of S-0-0127 and S-0-0128 |
//! | [`telegram`], [`word`], [`telegram_type`], [`duration`] | what is on the fibre, and how long it takes |
//! | [`dictionary`](mod@dictionary), [`data_block`], [`attribute`], [`parameters`] | the table of all IDNs, which the product writes, and the values in RAM |
//! | [`service`], [`command`] | the service channel and its procedure commands |
//! | [`diagnostic`] | the bits of class 1, 2 and 3 diagnostics |
//!
//! # Example
//!
//! A slave follows the MSTs of its master. It takes part from the first MST of CP0 on, and falls back to CP0 when a phase is skipped:
//!
//! ```
//! use sercos::phase::PhaseError;
//! use sercos::telegram::{Mst, RecordPacket};
//! use sercos::{Phase, PhaseMachine};
//!
//! let mut machine = PhaseMachine::new();
//! for (telegram, phase) in [([0xFF, 0], Phase::Cp0), ([0xFF, 1], Phase::Cp1)] {
//!     machine.received(Mst::parse(&telegram)?.data).unwrap();
//!     assert_eq!(machine.current(), phase);
//! }
//! // CP3 needs CP2, and there a passed S-0-0127.
//! assert_eq!(machine.received(3), Err(PhaseError::Upshift { from: Phase::Cp1, to: Phase::Cp3 }));
//! assert_eq!(machine.interface_status().raw_value(), 1 << 6 | 1);
//!
//! // The record of an MDT: control word, INFO of the service channel, a command value of four bytes.
//! let record = RecordPacket::new_checked([0x07, 0xE0, 0x80, 0x00, 0x10, 0x27, 0x00, 0x00])?;
//! assert!(record.control().follows_commands());
//! assert_eq!(record.data_long(0), Some(10_000));
//! # Ok::<(), sercos::telegram::TelegramError>(())
//! ```
//!
//! `examples/service_request.rs` answers the steps of a service channel.
//!
//! # Sources
//!
//! The standard is not public. Words, numbers and bit positions are those of `docs/reference/sercos2.md` in the repository, which has been put
//! together from manuals, papers and recordings, with its sources; the code cites it as sercos2.md with a section number.
//!
//! SERCOS is a trademark of its owner, with whom this crate is not connected; it has passed no conformance test but its own.
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

// The tests' table of data blocks is written as any product's, by this name.
#[cfg(test)]
extern crate self as sercos;
#[cfg(test)]
#[path = "../examples/sample/mod.rs"]
mod sample;

pub mod attribute;
pub mod capacity;
pub mod command;
pub mod data_block;
pub mod diagnostic;
pub mod dictionary;
pub mod duration;
pub mod error;
pub mod idn;
pub mod loss_counter;
pub mod parameters;
pub mod phase;
pub mod service;
pub mod telegram;
pub mod telegram_type;
pub mod transition;
pub mod unit;
pub mod weighting;
pub mod word;

pub use idn::Idn;
pub use phase::{Phase, PhaseMachine};
pub use word::{ControlWord, StatusWord};
