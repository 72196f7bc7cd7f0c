//! SERCOS II (IEC 61491), the slave's side: telegrams, communication phases, service channel, data blocks, slot timing.
//!
//! The crate knows no ring controller and no motor. Where a controller does the service-channel handshake in hardware
//! (SERCON816), [`service::Server`] is called only for the steps that need the processor; a controller that does not
//! may call it for every step.
//!
//! | part | what it holds |
//! |---|---|
//! | [`phase`], [`supervision`], [`transition`] | CP0 to CP4, lost telegrams, the checks of S-0-0127 and S-0-0128 |
//! | [`telegram`], [`word`], [`telegram_type`], [`duration`] | what is on the fibre, and how long it takes |
//! | [`dictionary`], [`data_block`], [`attribute`], [`parameters`] | the table of all IDNs, which the product writes, and the values in RAM |
//! | [`service`], [`command`] | the service channel and its procedure commands |
//! | [`diagnostic`] | the bits of class 1, 2 and 3 diagnostics |
//!
//! Words, numbers and bit positions are those of the reference document of the project ("sercos2.md" with a section number).
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
pub mod parameters;
pub mod phase;
pub mod service;
pub mod supervision;
pub mod telegram;
pub mod telegram_type;
pub mod transition;
pub mod unit;
pub mod weighting;
pub mod word;

pub use idn::Idn;
pub use phase::{Phase, PhaseMachine};
pub use word::{ControlWord, StatusWord};
