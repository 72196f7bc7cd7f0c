//! What a transition check finds: the data blocks to blame, and why.

use crate::idn::Idn;
use core::fmt;
use heapless::Vec;

/// Why a check failed on a data block.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Reason {
    /// The master has not written it since CP2 began.
    NeverWritten,
    /// Below its minimum or above its maximum.
    OutOfRange,
    /// A value, bit or combination that this drive does not support.
    NotSupported,
    /// Names an IDN that cannot be configured in this telegram, or one twice.
    NotConfigurable(Idn),
    /// The data do not fit into S-0-0185 or S-0-0186.
    DataTooLong {
        /// Bytes configured.
        bytes: u16,
        /// Bytes available.
        maximum: u16,
    },
    /// S-0-0001 is not a multiple of S-0-0002.
    NotAMultiple,
    /// S-0-0009 is even or S-0-0010 is odd.
    WrongParity,
    /// The record does not lie inside the MDT.
    RecordOutsideMdt,
    /// The instant is too early: the drive needs at least this, in ns.
    TooEarly {
        /// Earliest instant after the end of the MST.
        earliest_ns: u32,
    },
    /// The instant is too late: the drive needs at most this, in ns.
    TooLate {
        /// Latest instant after the end of the MST.
        latest_ns: u32,
    },
    /// An operation mode needs a command value that the MDT does not carry.
    CommandValueMissing(Idn),
    /// Does not go together with other parameters: the drive's own text says how (P-0-0003).
    NotTogether,
    /// Asks for position feedback 2, which this drive does not have (P-0-2705).
    NoFeedback2,
    /// Does not go together with this other data block.
    Contradicts(Idn),
    /// Bits 0 and 2 of a position polarity differ: S-0-0047 and S-0-0051 would count in opposite directions.
    MixedPolarity,
    /// Its value does not fit the new scaling, and nobody has written it anew.
    OldScaling,
    /// Nobody has ever told it: neither the master nor the memory.
    NeverTold,
}

impl Reason {
    /// The number of the reason, for P-0-0001 and P-0-0002.
    pub const fn code(self) -> u16 {
        match self {
            Reason::NeverWritten => 0x0001,
            Reason::OutOfRange => 0x0002,
            Reason::NotSupported => 0x0003,
            Reason::NotConfigurable(_) => 0x0004,
            Reason::DataTooLong { .. } => 0x0005,
            Reason::NotAMultiple => 0x0006,
            Reason::WrongParity => 0x0007,
            Reason::RecordOutsideMdt => 0x0008,
            Reason::TooEarly { .. } => 0x0009,
            Reason::TooLate { .. } => 0x000A,
            Reason::CommandValueMissing(_) => 0x000B,
            Reason::NoFeedback2 => 0x000C,
            Reason::Contradicts(_) => 0x000D,
            Reason::MixedPolarity => 0x000E,
            Reason::OldScaling => 0x000F,
            Reason::NotTogether => 0x0010,
            Reason::NeverTold => 0x0011,
        }
    }

    /// One of each kind, for the manual.
    pub const ALL: [Reason; 17] = [
        Reason::NeverWritten,
        Reason::OutOfRange,
        Reason::NotSupported,
        Reason::NotConfigurable(Idn::VELOCITY_COMMAND),
        Reason::DataTooLong { bytes: 36, maximum: 32 },
        Reason::NotAMultiple,
        Reason::WrongParity,
        Reason::RecordOutsideMdt,
        Reason::TooEarly { earliest_ns: 12_000 },
        Reason::TooLate { latest_ns: 1_970_000 },
        Reason::CommandValueMissing(Idn::POSITION_COMMAND),
        Reason::NoFeedback2,
        Reason::Contradicts(Idn::standard(50)),
        Reason::MixedPolarity,
        Reason::OldScaling,
        Reason::NotTogether,
        Reason::NeverTold,
    ];
}

impl fmt::Display for Reason {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Reason::NeverWritten => formatter.write_str("not written since CP2 began"),
            Reason::OutOfRange => formatter.write_str("outside its minimum and maximum"),
            Reason::NotSupported => formatter.write_str("a value this drive does not support"),
            Reason::NotConfigurable(idn) => write!(formatter, "{idn} cannot be configured, or is there twice"),
            Reason::DataTooLong { bytes, maximum } => write!(formatter, "{bytes} bytes of data, at most {maximum}"),
            Reason::NotAMultiple => formatter.write_str("no multiple of S-0-0002"),
            Reason::WrongParity => formatter.write_str("position must be odd, length even"),
            Reason::RecordOutsideMdt => formatter.write_str("the record ends behind the MDT (S-0-0010)"),
            Reason::TooEarly { earliest_ns } => {
                write!(formatter, "too early, at least {} us", earliest_ns.div_ceil(1_000))
            }
            Reason::TooLate { latest_ns } => write!(formatter, "too late, at most {} us", latest_ns / 1_000),
            Reason::CommandValueMissing(idn) => write!(formatter, "the MDT does not carry {idn}"),
            Reason::NotTogether => formatter.write_str("does not go together with other parameters"),
            Reason::NoFeedback2 => formatter.write_str("no position feedback 2, see P-0-2705"),
            Reason::Contradicts(idn) => write!(formatter, "contradicts {idn}"),
            Reason::MixedPolarity => formatter.write_str("bits 0 and 2, command and feedback, must be equal"),
            Reason::NeverTold => formatter.write_str("never told: neither written nor saved, and no default is right"),
            Reason::OldScaling => formatter.write_str("its value does not fit the new scaling, write it anew"),
        }
    }
}

/// One finding of a check.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Invalid {
    /// The data block to blame.
    pub idn: Idn,
    /// What is wrong with it.
    pub reason: Reason,
}

/// Most findings of one check: as many as it has data blocks to look at.
pub const FINDINGS: usize = 68;

/// The findings of a check that failed: the contents of S-0-0021 or S-0-0022.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct InvalidData {
    findings: Vec<Invalid, FINDINGS>,
    /// The drive was not synchronised to the MST (S-0-0128 only). No data block is to blame for that.
    pub not_synchronised: bool,
}

impl fmt::Display for Invalid {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{}: {}", self.idn, self.reason)
    }
}

impl InvalidData {
    /// The findings in the order of their IDN, one for each IDN.
    pub fn findings(&self) -> &[Invalid] {
        &self.findings
    }

    /// The IDNs in ascending order.
    pub fn idns(&self) -> impl Iterator<Item = Idn> {
        self.findings.iter().map(|invalid| invalid.idn)
    }

    /// The reason codes, in the order of [`InvalidData::idns`].
    pub fn codes(&self) -> impl Iterator<Item = u16> {
        self.findings.iter().map(|invalid| invalid.reason.code())
    }

    /// Keeps the first finding for each IDN; for what the drive itself finds beside the checks of this module.
    pub fn add(&mut self, idn: Idn, reason: Reason) {
        if let Err(place) = self.findings.binary_search_by_key(&idn, |invalid| invalid.idn) {
            // More findings than room: the check has failed anyway.
            let _ = self.findings.insert(place, Invalid { idn, reason });
        }
    }

    /// True if nothing is wrong.
    pub fn is_empty(&self) -> bool {
        self.findings.is_empty() && !self.not_synchronised
    }
}
