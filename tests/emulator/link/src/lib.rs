//! What the emulator and the bus inside QEMU share: a page of memory, whose turn it is, and the words that travel.
//!
//! * [`Page`]: a file that both have mapped. One of them works while the other waits; a message hands the turn over.
//! * [`protocol`]: the meaning of the words.
//!
//! A futex wakes the other side, and only if it sleeps: 6 us for both ways on one CPU. Neither side spins: it would take the CPU from the
//! one that it waits for.

mod page;
pub mod protocol;

pub use page::{Page, PageError, Side};
