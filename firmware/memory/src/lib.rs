//! What a drive remembers without supply.
//!
//! A [`Memory`] keeps one *set* (the parameters) and a few *logs* (the error memory) in two pages of any [`NorFlash`]: the two sectors that a processor
//! has to spare, or [`Fram`], a part on an SPI bus. Items, their checksums and the turn of the pages are those of `sequential-storage`; what is
//! added here is what a drive needs beyond it:
//!
//! * **A set is old or new.** It is one item, framed by two small ones: that it is to be written, and that it was. From the three a start knows
//!   whether the last save was finished, was cut by the supply, or was finished and cannot be read any more; see [`Condition`].
//! * **Nothing is erased in operation.** An erase stands a processor still for a second. [`Memory::start`] makes room for some saves
//!   ([`RESERVE`]), and whoever needs more of them than there is room for is refused ([`Error::Full`]) until the next start.
//! * **A word at a time.** All that waits is the flash: its `write` may be pending until a word may be programmed.
//!
//! # Wear
//!
//! A page of 128 KiB takes 40 sets of 1.8 KB before it turns, at worst, and bears 10 000 erases (STM32F40x, DocID022152): 800 000 saves over both
//! pages, one every ten minutes for fifteen years.
//!
//! [`NorFlash`]: embedded_storage_async::nor_flash::NorFlash
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

mod error;
mod fram;
mod memory;
mod set;

pub use error::{Error, FramError};
pub use fram::Fram;
pub use memory::{Log, MOST_BYTES, Memory, RESERVE};
pub use set::Condition;
