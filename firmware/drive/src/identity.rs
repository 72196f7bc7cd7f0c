//! Who this drive is in the ring, how its ring controller is wired, and what it was built as.

use core::fmt;

use sercon816::{BitRate, MasterClock, Transceiver};

use crate::production::Production;

/// A drive address, 1 to 254 (sercos2.md 1.2).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct DriveAddress(u8);

impl DriveAddress {
    /// The address, `None` for 0 (a repeater without a drive) and 255 (broadcast).
    #[must_use]
    pub const fn new(address: u8) -> Option<Self> {
        match address {
            0 | 255 => None,
            _ => Some(Self(address)),
        }
    }

    /// 1 to 254.
    #[must_use]
    pub const fn get(self) -> u8 {
        self.0
    }
}

impl fmt::Display for DriveAddress {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(formatter)
    }
}

/// What the address switches, the board and the works tell about this drive.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Identity {
    /// Drive address, from the switches.
    pub address: DriveAddress,
    /// Bit rate of the ring, from the switches.
    pub bit_rate: BitRate,
    /// Frequency at the ring controller's MCLK pin.
    pub master_clock: MasterClock,
    /// Polarities of the optical transceiver.
    pub transceiver: Transceiver,
    /// What the works have written.
    pub production: Production,
}
