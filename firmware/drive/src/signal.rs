//! What telegrams and bits carry: the drive's signals, each with its data block.

pub(crate) mod bits;
pub(crate) mod command;
pub(crate) mod control_bits;
pub(crate) mod feedback;
pub(crate) mod limit;
pub(crate) mod record;
pub(crate) mod word;
