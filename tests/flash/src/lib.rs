//! The two sectors of flash that hold the parameters, on the host: contents, times, and what is left when the supply goes.
//!
//! [`FlashModel`] is what the emulator answers the flash controller's registers from, and it is a
//! [`MultiwriteNorFlash`](embedded_storage_async::nor_flash::MultiwriteNorFlash) itself, so that the parameter memory is tested on the host over
//! the same behaviour. Offsets count from the first byte of the two sectors.
//!
//! What it is not: a cell whose charge is in between, and which reads now so, now so, is not modelled. A bit left by a supply that went is 0 or 1
//! and stays what it is.
#![forbid(unsafe_code)]

mod dice;
mod left_over;
mod model;
mod nor_flash;

pub use model::{CAPACITY, Cut, FlashModel, SECTOR_BYTES, SECTORS, Speed, Width};
pub use nor_flash::FlashError;
