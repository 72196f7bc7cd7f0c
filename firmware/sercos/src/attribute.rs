//! Element 3 of a data block: length, format, decimal places and write protection of its operation data.

use crate::phase::Phase;
use arbitrary_int::u4;
use bitbybit::{bitenum, bitfield};

/// The attribute (sercos2.md 3.7). Bits 23 and 31 are reserved.
#[bitfield(u32, default = 0x0000_0001)]
#[derive(PartialEq, Eq, Debug)]
pub struct Attribute {
    /// Bits 15 to 0: conversion factor, what the number is multiplied with to be read with its decimal places; 1 but for a scaling factor
    /// that is not 1.
    #[bits(0..=15, rw)]
    conversion_factor: u16,
    /// Bits 18 to 16: length.
    #[bits(16..=18, rw)]
    length: Length,
    /// Bit 19: the data block is a procedure command.
    #[bit(19, rw)]
    command: bool,
    /// Bits 22 to 20: display format.
    #[bits(20..=22, rw)]
    format: Format,
    /// Bits 27 to 24: decimal places.
    #[bits(24..=27, rw)]
    decimal_places: u4,
    /// Bit 28: write-protected in CP2.
    #[bit(28, rw)]
    protected_in_cp2: bool,
    /// Bit 29: write-protected in CP3.
    #[bit(29, rw)]
    protected_in_cp3: bool,
    /// Bit 30: write-protected in CP4.
    #[bit(30, rw)]
    protected_in_cp4: bool,
}

/// Length of the operation data.
#[bitenum(u3, exhaustive = true)]
#[derive(PartialEq, Eq, Debug)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Length {
    /// Not used.
    Reserved = 0,
    /// Two bytes.
    Two = 1,
    /// Four bytes.
    Four = 2,
    /// Eight bytes.
    Eight = 3,
    /// A list of one-byte items.
    ListOfBytes = 4,
    /// A list of two-byte items.
    ListOfTwo = 5,
    /// A list of four-byte items.
    ListOfFour = 6,
    /// A list of eight-byte items.
    ListOfEight = 7,
}

impl Length {
    /// Length in bytes if it is fixed (2, 4 or 8), `None` for a list.
    pub const fn fixed_bytes(self) -> Option<u16> {
        match self {
            Length::Two => Some(2),
            Length::Four => Some(4),
            Length::Eight => Some(8),
            _ => None,
        }
    }

    /// Length of an item in bytes if it is a list (1, 2, 4 or 8), `None` for data of fixed length.
    pub const fn item_bytes(self) -> Option<u16> {
        match self {
            Length::ListOfBytes => Some(1),
            Length::ListOfTwo => Some(2),
            Length::ListOfFour => Some(4),
            Length::ListOfEight => Some(8),
            _ => None,
        }
    }
}

/// Display format of the operation data; also says whether a number has a sign.
#[bitenum(u3, exhaustive = true)]
#[derive(PartialEq, Eq, Debug)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Format {
    /// Single bits.
    Binary = 0,
    /// Unsigned decimal.
    Unsigned = 1,
    /// Signed decimal, two's complement.
    Signed = 2,
    /// Hexadecimal.
    Hexadecimal = 3,
    /// Text.
    Text = 4,
    /// Ident number.
    Idn = 5,
    /// Floating point.
    Float = 6,
    /// Not used.
    Reserved = 7,
}

impl Attribute {
    /// True if the master may never write the data block.
    pub const fn is_read_only(self) -> bool {
        self.protected_in_cp2() && self.protected_in_cp3() && self.protected_in_cp4()
    }

    /// True if the data block must not be written in this phase. CP0 and CP1 have no service channel and count as CP2.
    pub const fn is_protected_in(self, phase: Phase) -> bool {
        match phase {
            Phase::Cp0 | Phase::Cp1 | Phase::Cp2 => self.protected_in_cp2(),
            Phase::Cp3 => self.protected_in_cp3(),
            Phase::Cp4 => self.protected_in_cp4(),
        }
    }

    /// The value of a datum of fixed length with the sign that the format gives it. Unsigned data of eight bytes must stay
    /// below 2^63; those of this drive have no limits and are never asked for as a number.
    pub const fn value_of(self, raw: u64) -> i64 {
        match (self.format(), self.length()) {
            (Format::Signed, Length::Two) => raw as u16 as i16 as i64,
            (Format::Signed, Length::Four) => raw as u32 as i32 as i64,
            (_, Length::Two) => raw as u16 as i64,
            (_, Length::Eight) => raw as i64,
            _ => raw as u32 as i64,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_patterns_of_a_real_drive_are_read_right() {
        let time = Attribute::new_with_raw_value(0x6011_0001);
        assert_eq!(time.length().fixed_bytes(), Some(2));
        assert_eq!(time.format(), Format::Unsigned);
        assert!(
            !time.is_protected_in(Phase::Cp2) && time.is_protected_in(Phase::Cp3) && time.is_protected_in(Phase::Cp4)
        );
        assert!(!time.is_read_only());

        let position = Attribute::new_with_raw_value(0x7422_0001);
        assert_eq!(position.length(), Length::Four);
        assert_eq!(position.decimal_places(), u4::new(4));
        assert!(position.is_read_only());

        let check = Attribute::new_with_raw_value(0x5009_0001);
        assert!(check.command() && check.is_protected_in(Phase::Cp2) && !check.is_protected_in(Phase::Cp3));
    }

    #[test]
    fn the_format_gives_the_sign() {
        let signed = Attribute::new_with_raw_value(0x0021_0001);
        let unsigned = Attribute::new_with_raw_value(0x0011_0001);
        assert_eq!(signed.value_of(0xFFFF), -1);
        assert_eq!(unsigned.value_of(0xFFFF), 65_535);
        let four = u64::from(u32::MAX);
        assert_eq!(Attribute::new_with_raw_value(0x0022_0001).value_of(four), -1);
        assert_eq!(Attribute::new_with_raw_value(0x0012_0001).value_of(four), 4_294_967_295);
        assert_eq!(Attribute::new_with_raw_value(0x0023_0001).value_of(u64::MAX), -1);
    }
}
