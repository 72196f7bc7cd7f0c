//! How much there is room for: the longest lists and texts, and the largest table of data blocks.
//!
//! All of it is memory of a [`Parameters`](crate::parameters::Parameters) or of a [`Server`](crate::service::Server). A table that needs more
//! does not compile.

/// Most entries of a parameter that is a list of two-byte items (S-0-0016, S-0-0024).
pub const LIST_ENTRIES: usize = 16;

/// Most entries of a parameter that is a list of four-byte items (P-0-0007).
pub const LONG_ENTRIES: usize = 8;

/// Most bytes of a text parameter (S-0-0141, S-0-0142).
pub const TEXT_BYTES: usize = 40;

/// Most bytes of a text that the drive itself puts together; one that lies in flash can have any length.
pub const LIVE_TEXT_BYTES: usize = 112;

/// Most entries of a list of two-byte items that the drive itself supplies.
pub const LIVE_LIST_ENTRIES: usize = 64;

/// Most entries of a list of four-byte items that the drive itself supplies.
pub const LIVE_LONG_ENTRIES: usize = 32;

/// Most words that are handed to the ring controller at once.
pub const SEGMENT_WORDS: usize = 16;

/// Most data blocks of a table.
pub(crate) const DATA_BLOCKS: usize = 512;

/// Most parameters of two or four bytes.
pub(crate) const VALUES: usize = 255;

/// Most parameters that are a list of IDNs.
pub(crate) const IDN_LISTS: usize = 5;

/// Most parameters that are a list of other two-byte items.
pub(crate) const WORD_LISTS: usize = 4;

/// Most parameters that are a list of four-byte items.
pub(crate) const LONG_LISTS: usize = 2;

/// Most text parameters.
pub(crate) const TEXTS: usize = 4;

/// Most procedure commands.
pub(crate) const COMMANDS: usize = 32;
