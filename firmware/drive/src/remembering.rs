//! What the drive remembers without supply: the parameters of S-0-0192, the error memory, the operating time and the last crash.
//!
//! [`Communication`](crate::Communication) knows what is to be kept and when; [`keep`] does it, word by word, whenever nothing else is to be done. What
//! is kept, and how it lies in the flash, is [`memory`]'s affair.

pub(crate) mod keeping;
pub(crate) mod log;
pub(crate) mod set;
mod task;

pub use set::{Recollection, read_set, write_set};
pub use task::{Forgetting, forget_lock, keep, recall};
