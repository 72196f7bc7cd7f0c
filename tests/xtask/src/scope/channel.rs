//! The service channel of one drive, as much as an oscilloscope needs of it.

/// Reads and writes the operation data of a drive.
pub(crate) trait ServiceChannel {
    /// Reads operation data of fixed length, as it is transmitted.
    fn read(&mut self, idn: u16) -> Result<u64, ChannelError>;

    /// Reads a list of four-byte items with sign.
    fn read_list(&mut self, idn: u16) -> Result<Vec<i32>, ChannelError>;

    /// Writes operation data of fixed length; the drive's attribute says how long it is.
    fn write(&mut self, idn: u16, value: u64) -> Result<(), ChannelError>;

    /// Lets so many microseconds pass.
    fn wait(&mut self, microseconds: u64) -> Result<(), ChannelError>;
}

/// Why the service channel did not do what it was asked for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum ChannelError {
    /// The drive refused, with its error code.
    Refused { idn: u16, code: u16 },
    /// The data block is another kind of data than expected.
    Format { idn: u16, expected: &'static str },
    /// The ring or the drive did not go on.
    Broken(String),
}

impl std::error::Error for ChannelError {}

impl std::fmt::Display for ChannelError {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Refused { idn, code: 0x1001 } => {
                write!(formatter, "{}: the drive has no such data block or signal (1001H)", sercos::Idn(*idn))
            }
            Self::Refused { idn, code } => {
                write!(formatter, "{}: the drive refused with {code:04X}H", sercos::Idn(*idn))
            }
            Self::Format { idn, expected } => write!(formatter, "{} is not {expected}", sercos::Idn(*idn)),
            Self::Broken(cause) => formatter.write_str(cause),
        }
    }
}
