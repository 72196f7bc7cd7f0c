//! Why something was not remembered.

use core::fmt;

use embedded_storage_async::nor_flash::{NorFlashError, NorFlashErrorKind};

/// Why something could not be kept or found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Error<E> {
    /// The flash refused an operation.
    Flash(E),
    /// So many bytes of the page are left, and more are needed: the next start makes room.
    Full {
        /// Bytes.
        left: u32,
        /// Bytes.
        needed: u32,
    },
    /// More than [`MOST_BYTES`](crate::MOST_BYTES), or than the buffer takes.
    TooLong,
    /// The set that is there cannot be changed as it was to be.
    Refused,
    /// What lies in the flash makes no sense, and could not be repaired.
    Damaged,
}

impl<E: fmt::Display> fmt::Display for Error<E> {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Flash(error) => write!(formatter, "the flash: {error}"),
            Self::Full { left, needed } => {
                write!(formatter, "{left} bytes are left of the page, and {needed} are needed; start the drive anew")
            }
            Self::TooLong => formatter.write_str("there is more to be kept than there is room for"),
            Self::Refused => formatter.write_str(
                "what was saved cannot be changed like this: it has another form, or there is no room in it; save all of it anew",
            ),
            Self::Damaged => formatter.write_str("the contents of the flash make no sense"),
        }
    }
}

impl<E: fmt::Debug + fmt::Display> core::error::Error for Error<E> {}

impl<E> From<sequential_storage::Error<E>> for Error<E> {
    fn from(error: sequential_storage::Error<E>) -> Self {
        use sequential_storage::Error as Cause;
        match error {
            Cause::Storage { value, .. } => Self::Flash(value),
            // Not what was there a moment before.
            Cause::SerializationError(sequential_storage::map::SerializationError::InvalidData) => Self::Damaged,
            Cause::BufferTooBig | Cause::BufferTooSmall(_) | Cause::SerializationError(_) | Cause::ItemTooBig => {
                Self::TooLong
            }
            // It was looked whether there is room.
            _ => Self::Damaged,
        }
    }
}

/// Why an FRAM did not do what it was told.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum FramError {
    /// The bus, or its chip select.
    Bus,
    /// Beyond the part.
    OutOfBounds,
    /// A page is erased as a whole.
    NotAligned,
    /// A byte reads back otherwise than it was written: no part, another part, or its write protection.
    NotWritten,
}

impl fmt::Display for FramError {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(match self {
            Self::Bus => "the bus of the FRAM failed",
            Self::OutOfBounds => "beyond the FRAM",
            Self::NotAligned => "the FRAM is erased by whole pages",
            Self::NotWritten => "the FRAM does not keep what is written",
        })
    }
}

impl core::error::Error for FramError {}

impl NorFlashError for FramError {
    fn kind(&self) -> NorFlashErrorKind {
        match self {
            Self::OutOfBounds => NorFlashErrorKind::OutOfBounds,
            Self::NotAligned => NorFlashErrorKind::NotAligned,
            Self::Bus | Self::NotWritten => NorFlashErrorKind::Other,
        }
    }
}
