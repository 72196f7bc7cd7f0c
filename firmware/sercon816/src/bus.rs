//! The one seam between this driver and the world: single 16-bit accesses.

/// Word address of a control register, 00H to 2AH (reference `sercon816.md` 5.1).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Register(u8);

impl Register {
    /// Address of the last register (data sheet S5: 43 registers).
    pub const LAST: Self = Self(0x2A);

    /// The register at a word address, `None` beyond [`Register::LAST`].
    #[must_use]
    pub const fn new(word: u16) -> Option<Self> {
        if word <= Self::LAST.0 as u16 { Some(Self(word as u8)) } else { None }
    }

    /// For the named registers of this crate; checked at compile time.
    pub(crate) const fn at(word: u8) -> Self {
        assert!(word <= 0x2A);
        Self(word)
    }

    /// The word address; a 16-bit bus puts twice this on its byte address lines.
    #[must_use]
    pub const fn word(self) -> u16 {
        self.0 as u16
    }
}

/// Word offset into the dual-port RAM, 0 to 7FFH (2048 words, reference `sercon816.md` 6).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct RamAddress(u16);

impl RamAddress {
    /// Number of 16-bit words in the RAM.
    pub const WORDS: u16 = 2048;

    /// The RAM word at an offset; offsets wrap at the end of the RAM as the address lines do.
    #[must_use]
    pub const fn new(word: u16) -> Self {
        Self(word % Self::WORDS)
    }

    /// The word offset.
    #[must_use]
    pub const fn word(self) -> u16 {
        self.0
    }

    /// The word `offset` words further on, wrapping at the end of the RAM.
    #[must_use]
    pub const fn offset(self, offset: u16) -> Self {
        Self::new(self.0.wrapping_add(offset))
    }
}

/// Single 16-bit accesses to one chip.
///
/// An access never fails and is never split: the bus hardware stretches it while the chip is busy (BUSYN).
/// A bus that is `Clone` hands out further access paths to the same chip; tasks of different priority each hold
/// one and keep to their own words, so that no lock is needed.
pub trait Bus {
    /// Reads a control register.
    fn read_register(&mut self, register: Register) -> u16;
    /// Writes a control register.
    fn write_register(&mut self, register: Register, value: u16);
    /// Reads a word of the dual-port RAM.
    fn read_ram(&mut self, address: RamAddress) -> u16;
    /// Writes a word of the dual-port RAM.
    fn write_ram(&mut self, address: RamAddress, value: u16);
}
