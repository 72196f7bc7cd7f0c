//! Single bits that the control sets, over real-time bits, signal bits or the service channel.
//!
//! They lie in one word of 32 bits with the application word P-0-0019, which has the low half.

/// A single bit that the control sets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Enable {
    /// S-0-0407.
    Homing,
    /// S-0-0405.
    Probe1,
    /// S-0-0406.
    Probe2,
    /// S-0-0400, where S-0-0147 bit 2 says that the control has the switch.
    HomeSwitch,
}

impl Enable {
    /// Where it lies.
    #[must_use]
    pub const fn mask(self) -> u32 {
        match self {
            Self::Homing => 1 << 16,
            Self::Probe1 => 1 << 17,
            Self::Probe2 => 1 << 18,
            Self::HomeSwitch => 1 << 19,
        }
    }

    /// Its bit in the word of the signals ([`Word::Signals`](super::word::Word::Signals)).
    pub(crate) const fn signal(self) -> u8 {
        match self {
            Self::HomeSwitch => 0,
            Self::Probe1 => 8,
            Self::Probe2 => 9,
            Self::Homing => 10,
        }
    }
}
