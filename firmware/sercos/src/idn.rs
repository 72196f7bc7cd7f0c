//! Ident numbers (IDN): the names of the data blocks.

use core::fmt;
use core::str::FromStr;

/// An ident number as it is transmitted: bit 15 product-specific, bits 14..12 parameter set, bits 11..0 data block
/// (sercos2.md 3.8).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Idn(pub u16);

impl Idn {
    /// The standard data block `S-0-number`, 0..=4095; higher bits are ignored.
    pub const fn standard(number: u16) -> Self {
        Self(number & 0x0FFF)
    }

    /// The product-specific data block `P-0-number`, 0..=4095; higher bits are ignored.
    pub const fn product(number: u16) -> Self {
        Self(0x8000 | (number & 0x0FFF))
    }

    // Those that the protocol itself acts on.

    /// S-0-0001: interval of new command values.
    pub const CONTROL_UNIT_CYCLE: Self = Self::standard(1);
    /// S-0-0002: distance of two MSTs.
    pub const CYCLE: Self = Self::standard(2);
    /// S-0-0015.
    pub const TELEGRAM_TYPE: Self = Self::standard(15);
    /// S-0-0016.
    pub const AT_LIST: Self = Self::standard(16);
    /// S-0-0024.
    pub const MDT_LIST: Self = Self::standard(24);
    /// S-0-0026.
    pub const SIGNAL_STATUS_LIST: Self = Self::standard(26);
    /// S-0-0027.
    pub const SIGNAL_CONTROL_LIST: Self = Self::standard(27);
    /// S-0-0036.
    pub const VELOCITY_COMMAND: Self = Self::standard(36);
    /// S-0-0040.
    pub const VELOCITY_FEEDBACK: Self = Self::standard(40);
    /// S-0-0047.
    pub const POSITION_COMMAND: Self = Self::standard(47);
    /// S-0-0051.
    pub const POSITION_FEEDBACK: Self = Self::standard(51);
    /// S-0-0037.
    pub const ADDITIVE_VELOCITY_COMMAND: Self = Self::standard(37);
    /// S-0-0048.
    pub const ADDITIVE_POSITION_COMMAND: Self = Self::standard(48);
    /// S-0-0053.
    pub const POSITION_FEEDBACK_2: Self = Self::standard(53);
    /// S-0-0080.
    pub const TORQUE_COMMAND: Self = Self::standard(80);
    /// S-0-0099.
    pub const RESET_CLASS_1_DIAGNOSTIC: Self = Self::standard(99);
    /// S-0-0270.
    pub const SELECTED_BACKUP: Self = Self::standard(270);
    /// S-0-0127.
    pub const CP3_TRANSITION_CHECK: Self = Self::standard(127);
    /// S-0-0128.
    pub const CP4_TRANSITION_CHECK: Self = Self::standard(128);
    /// S-0-0301: what control word bit 6 drives.
    pub const REAL_TIME_CONTROL_BIT_1: Self = Self::standard(301);
    /// S-0-0303: what control word bit 7 drives.
    pub const REAL_TIME_CONTROL_BIT_2: Self = Self::standard(303);
    /// S-0-0305: what status word bit 6 shows.
    pub const REAL_TIME_STATUS_BIT_1: Self = Self::standard(305);
    /// S-0-0307: what status word bit 7 shows.
    pub const REAL_TIME_STATUS_BIT_2: Self = Self::standard(307);

    /// Data block number, 0..=4095.
    pub const fn number(self) -> u16 {
        self.0 & 0x0FFF
    }

    /// Parameter set, 0..=7.
    pub const fn parameter_set(self) -> u16 {
        (self.0 >> 12) & 7
    }

    /// True for a product-specific data block (P), false for a standard one (S).
    pub const fn is_product(self) -> bool {
        self.0 & 0x8000 != 0
    }
}

impl fmt::Display for Idn {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let letter = if self.is_product() { 'P' } else { 'S' };
        write!(f, "{letter}-{}-{:04}", self.parameter_set(), self.number())
    }
}

/// A text that is not an ident number of the form `S-0-0127` or `P-0-0019`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct InvalidIdn;

impl fmt::Display for InvalidIdn {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("not an ident number (S-0-0000 to S-7-4095, P-0-0000 to P-7-4095)")
    }
}

impl core::error::Error for InvalidIdn {}

impl FromStr for Idn {
    type Err = InvalidIdn;

    fn from_str(text: &str) -> Result<Self, InvalidIdn> {
        let mut parts = text.split('-');
        let product = match parts.next() {
            Some("S" | "s") => 0,
            Some("P" | "p") => 0x8000,
            _ => return Err(InvalidIdn),
        };
        let mut number = |maximum: u16| -> Result<u16, InvalidIdn> {
            let digits = parts.next().ok_or(InvalidIdn)?;
            // `parse` would also take a sign.
            if !digits.bytes().all(|byte| byte.is_ascii_digit()) {
                return Err(InvalidIdn);
            }
            let number = digits.parse().map_err(|_| InvalidIdn)?;
            if number <= maximum { Ok(number) } else { Err(InvalidIdn) }
        };
        let parameter_set = number(7)?;
        let data_block = number(0x0FFF)?;
        match parts.next() {
            None => Ok(Self(product | (parameter_set << 12) | data_block)),
            Some(_) => Err(InvalidIdn),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::string::ToString;

    #[test]
    fn the_product_specific_idn_of_the_recorded_master_is_8013_hex() {
        assert_eq!(Idn::product(19).0, 0x8013);
        assert_eq!(Idn::product(19).to_string(), "P-0-0019");
        assert_eq!(Idn::standard(127).to_string(), "S-0-0127");
        assert_eq!(Idn(0x7FFF).to_string(), "S-7-4095");
    }

    #[test]
    fn texts_that_are_no_idn_are_refused() {
        for text in ["", "S", "S-0", "S-0-4096", "S-8-0001", "X-0-0001", "S-0-0001-1", "S-0-+1", "S-0-", "S-0-99999"] {
            assert_eq!(text.parse::<Idn>(), Err(InvalidIdn), "{text}");
        }
    }

    proptest! {
        #[test]
        fn every_idn_survives_its_own_text(raw: u16) {
            prop_assert_eq!(Idn(raw).to_string().parse(), Ok(Idn(raw)));
        }
    }
}
