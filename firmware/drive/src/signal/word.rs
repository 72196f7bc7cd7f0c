//! Words of single bits, and the bits in them.

use super::control_bits::Enable;

/// A word of the motion side that has bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Word {
    /// S-0-0011.
    Class1,
    /// S-0-0012.
    Class2,
    /// S-0-0013.
    Class3,
    /// S-0-0014.
    InterfaceStatus,
    /// S-0-0129.
    Manufacturer1,
    /// S-0-0181.
    Manufacturer2,
    /// S-0-0182.
    Manufacturer3,
    /// S-0-0134.
    Control,
    /// S-0-0135, real-time bits and service bits 0.
    Status,
    /// S-0-0403.
    PositionStatus,
    /// P-0-0019.
    Application,
    /// Home switch S-0-0400, probes S-0-0401 and S-0-0402, S-0-0408, S-0-0409 to S-0-0412.
    Signals,
    /// S-0-0179.
    ProbeStatus,
    /// S-0-0437, with S-0-0419 in bit 0.
    Positioning,
}

/// What bits can do with a data block: be shown, and some be set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Source {
    /// A word.
    Word(Word),
    /// One bit of a word, which the data block has in bit 0.
    Bit(Word, u8),
    /// The same of a bit that the control sets.
    Enable(Enable),
}

impl Source {
    /// Where bit `number` of the data block comes from; `None` for a bit that is always 0.
    #[must_use]
    pub const fn bit(self, number: u16) -> Option<SourceBit> {
        let bit = match (self.single(), number) {
            (Some(bit), 0) => bit,
            (None, 0..=15) => (number & 15) as u8,
            _ => return None,
        };
        Some(SourceBit { word: self.word(), mask: 1_u16.wrapping_shl(bit as u32) })
    }

    /// The mask of what bit `number` of the data block sets: any of P-0-0019, or bit 0 of an enable; 0 for everything else.
    #[must_use]
    pub const fn target(self, number: u16) -> u32 {
        match (self, number) {
            (Self::Word(Word::Application), 0..=15) => 1_u32.wrapping_shl(number as u32),
            (Self::Enable(enable), 0) => enable.mask(),
            _ => 0,
        }
    }

    /// The operation data, from the word's value.
    #[must_use]
    pub fn value(self, word: u16) -> u16 {
        self.single().map_or(word, |bit| word.wrapping_shr(bit.into()) & 1)
    }

    /// The word to ask for.
    #[must_use]
    pub const fn word(self) -> Word {
        match self {
            Self::Word(word) | Self::Bit(word, _) => word,
            Self::Enable(_) => Word::Signals,
        }
    }

    const fn single(self) -> Option<u8> {
        match self {
            Self::Word(_) => None,
            Self::Bit(_, bit) => Some(bit),
            Self::Enable(enable) => Some(enable.signal()),
        }
    }
}

/// One bit of a word.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct SourceBit {
    /// The word.
    pub word: Word,
    /// The bit in it.
    pub mask: u16,
}
