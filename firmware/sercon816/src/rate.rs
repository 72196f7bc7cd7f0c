//! Bit rates, clocks, and the register that divides one to the other.

use bitbybit::bitfield;

/// Bit rate of the ring.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum BitRate {
    /// 2 Mbit/s.
    Mbit2,
    /// 4 Mbit/s.
    Mbit4,
    /// 8 Mbit/s; chosen by the pins SBAUD and SBAUD16 (G14).
    Mbit8,
    /// 16 Mbit/s; chosen by the pins SBAUD and SBAUD16 (G14).
    Mbit16,
}

impl BitRate {
    /// Every bit rate of SERCOS II.
    pub const ALL: [Self; 4] = [Self::Mbit2, Self::Mbit4, Self::Mbit8, Self::Mbit16];

    /// In 1/1600 us.
    pub(crate) const fn bit_time(self) -> i32 {
        match self {
            Self::Mbit2 => 800,
            Self::Mbit4 => 400,
            Self::Mbit8 => 200,
            Self::Mbit16 => 100,
        }
    }
}

/// Frequency of the chip's clock input MCLK.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum MasterClock {
    /// 16 MHz.
    Mhz16,
    /// 32 MHz, the highest permitted.
    Mhz32,
}

impl MasterClock {
    pub(crate) const fn megahertz(self) -> i32 {
        match self {
            Self::Mhz16 => 16,
            Self::Mhz32 => 32,
        }
    }

    /// In 1/1600 us.
    pub(crate) const fn period(self) -> i32 {
        match self {
            Self::Mhz16 => 100,
            Self::Mhz32 => 50,
        }
    }
}

/// 0EH: divider of MCLK to the 1 us tick (sercon816.md 5.7); [`crate::Timing::clock_divider`] computes it.
#[bitfield(u16, default = 0, debug)]
#[derive(PartialEq, Eq)]
pub struct ClockDivider {
    /// MCLKDIV: MCLK in MHz, less 1.
    #[bits(0..=7, rw)]
    divider: u8,
    /// MCLKST: preset of the divider at the MST.
    #[bits(8..=15, rw)]
    preset: u8,
}
