//! What the master knows about data blocks: their numbers, attributes and values.
//!
//! Written from sercos2.md 3 and not shared with the drive's own tables, so that the two check each other.

use std::fmt;

use serde::{Serialize, Serializer};

/// Ident number of a data block (sercos2.md 3.8): bit 15 product-specific, 14..12 parameter set, 11..0 number.
#[derive(Copy, Clone, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Idn(pub u16);

impl Idn {
    /// Control-unit cycle time tNcyc, us.
    pub const CONTROL_UNIT_CYCLE: Self = Self(1);
    /// Communication cycle time tScyc, us.
    pub const CYCLE: Self = Self(2);
    /// Shortest AT start t1min, us.
    pub const T1_MIN: Self = Self(3);
    /// Gap between own AT and MDT tATMT, us.
    pub const T_AT_MDT: Self = Self(4);
    /// Least time from feedback capture to the end of the next MST t5, us.
    pub const T5: Self = Self(5);
    /// AT start t1, us.
    pub const T1: Self = Self(6);
    /// Feedback capture t4, us.
    pub const T4: Self = Self(7);
    /// Command values valid t3, us.
    pub const T3: Self = Self(8);
    /// Byte position of the drive's record in the MDT, counted from 1.
    pub const MDT_POSITION: Self = Self(9);
    /// Bytes of the MDT's data field.
    pub const MDT_LENGTH: Self = Self(10);
    /// Class 1 diagnostic.
    pub const CLASS_1_DIAGNOSTIC: Self = Self(11);
    /// Telegram type.
    pub const TELEGRAM_TYPE: Self = Self(15);
    /// Configuration list of the AT.
    pub const AT_LIST: Self = Self(16);
    /// Invalid data after the check of S-0-0127.
    pub const INVALID_FOR_CP3: Self = Self(21);
    /// Invalid data after the check of S-0-0128.
    pub const INVALID_FOR_CP4: Self = Self(22);
    /// Configuration list of the MDT.
    pub const MDT_LIST: Self = Self(24);
    /// Primary operation mode.
    pub const OPERATION_MODE: Self = Self(32);
    /// Velocity command value.
    pub const VELOCITY_COMMAND: Self = Self(36);
    /// Velocity feedback value.
    pub const VELOCITY_FEEDBACK: Self = Self(40);
    /// Position command value.
    pub const POSITION_COMMAND: Self = Self(47);
    /// Position feedback value of the motor encoder.
    pub const POSITION_FEEDBACK: Self = Self(51);
    /// Position feedback value of the external encoder.
    pub const POSITION_FEEDBACK_2: Self = Self(53);
    /// Torque command value.
    pub const TORQUE_COMMAND: Self = Self(80);
    /// Gap between two ATs of one slave tATAT, us.
    pub const T_AT_AT: Self = Self(87);
    /// Gap between MDT and the next MST tMTSY, us.
    pub const T_MDT_MST: Self = Self(88);
    /// MDT start t2, us.
    pub const T2: Self = Self(89);
    /// Time from MDT end to usable command values tMTSG, us.
    pub const T_MDT_COMMAND: Self = Self(90);
    /// Slave arrangement.
    pub const SLAVE_ARRANGEMENT: Self = Self(96);
    /// Procedure command: reset of class 1 diagnostic.
    pub const RESET_CLASS_1: Self = Self(99);
    /// Procedure command: check for the transition to CP3.
    pub const CHECK_FOR_CP3: Self = Self(127);
    /// Procedure command: check for the transition to CP4.
    pub const CHECK_FOR_CP4: Self = Self(128);
    /// Following distance.
    pub const FOLLOWING_DISTANCE: Self = Self(189);
}

impl fmt::Display for Idn {
    /// `S-0-0051`, `P-0-0019`.
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let kind = if self.0 & 0x8000 == 0 { 'S' } else { 'P' };
        write!(formatter, "{kind}-{}-{:04}", self.0 >> 12 & 7, self.0 & 0x0FFF)
    }
}

impl Serialize for Idn {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

/// Element 3 of a data block (sercos2.md 3.7).
#[derive(Copy, Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Attribute(pub u32);

impl Attribute {
    /// Bytes of the operation data, `None` when it is a list or a text of variable length.
    pub const fn fixed_bytes(self) -> Option<usize> {
        match self.0 >> 16 & 7 {
            1 => Some(2),
            2 => Some(4),
            3 => Some(8),
            _ => None,
        }
    }

    /// Whether the operation data carries two length words in front; 0 in bits 18..16 is reserved and neither.
    pub const fn is_variable(self) -> bool {
        self.0 >> 16 & 7 >= 4
    }

    /// Whether the data block is a procedure command.
    pub const fn is_command(self) -> bool {
        self.0 >> 19 & 1 == 1
    }
}

/// Elements of a data block (sercos2.md 3.1).
#[derive(Copy, Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
#[repr(u8)]
pub enum Element {
    /// No element: the channel is closed.
    Close = 0,
    /// Ident number; writing it opens the channel.
    Idn = 1,
    /// Name.
    Name = 2,
    /// Attribute.
    Attribute = 3,
    /// Unit.
    Unit = 4,
    /// Minimum input value.
    Minimum = 5,
    /// Maximum input value.
    Maximum = 6,
    /// Operation data.
    Data = 7,
}

impl Element {
    /// From bits 5..3 of a control word.
    pub const fn of_control(control: u16) -> Self {
        match control >> 3 & 7 {
            0 => Self::Close,
            1 => Self::Idn,
            2 => Self::Name,
            3 => Self::Attribute,
            4 => Self::Unit,
            5 => Self::Minimum,
            6 => Self::Maximum,
            _ => Self::Data,
        }
    }
}

/// A value of an element as it goes over the service channel, low word first.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub enum Value {
    /// 2 bytes.
    Word(u16),
    /// 4 bytes.
    Long(u32),
    /// 8 bytes.
    Quad(u64),
    /// Bytes of variable length: a text, or a list packed low byte first.
    Bytes(Vec<u8>),
}

impl Value {
    /// A list of 2-byte items.
    pub fn words(items: &[u16]) -> Self {
        Self::Bytes(items.iter().flat_map(|item| item.to_le_bytes()).collect())
    }

    /// A list of ident numbers.
    pub fn idns(items: &[Idn]) -> Self {
        Self::Bytes(items.iter().flat_map(|item| item.0.to_le_bytes()).collect())
    }

    /// The words to be written: current and maximum length first when the length is variable (sercos2.md 3.2).
    pub fn to_words(&self) -> Vec<u16> {
        match self {
            Self::Word(word) => vec![*word],
            Self::Long(long) => vec![*long as u16, (long >> 16) as u16],
            Self::Quad(quad) => (0..4).map(|word| (quad >> (16 * word)) as u16).collect(),
            Self::Bytes(bytes) => {
                let length = bytes.len() as u16;
                let data =
                    bytes.chunks(2).map(|pair| u16::from(pair[0]) | u16::from(pair.get(1).copied().unwrap_or(0)) << 8);
                [length, length].into_iter().chain(data).collect()
            }
        }
    }

    /// What the words of an element mean; `variable` when the first two are lengths in bytes.
    pub fn of_words(words: &[u16], variable: bool) -> Self {
        match *words {
            _ if variable => {
                let bytes = words.iter().skip(2).flat_map(|word| word.to_le_bytes());
                Self::Bytes(bytes.take(usize::from(words.first().copied().unwrap_or(0))).collect())
            }
            [word] => Self::Word(word),
            [low, high] => Self::Long(u32::from(high) << 16 | u32::from(low)),
            _ => Self::Quad(words.iter().rev().fold(0, |quad, word| quad << 16 | u64::from(*word))),
        }
    }

    /// A fixed-length value as a number, zero-extended.
    pub fn as_number(&self) -> Option<u64> {
        match self {
            Self::Word(word) => Some(u64::from(*word)),
            Self::Long(long) => Some(u64::from(*long)),
            Self::Quad(quad) => Some(*quad),
            Self::Bytes(_) => None,
        }
    }

    /// A variable-length value as ident numbers.
    pub fn as_idns(&self) -> Option<Vec<Idn>> {
        match self {
            Self::Bytes(bytes) => {
                Some(bytes.chunks_exact(2).map(|pair| Idn(u16::from_le_bytes([pair[0], pair[1]]))).collect())
            }
            _ => None,
        }
    }

    /// A variable-length value as text; what is no character is shown as such.
    pub fn as_text(&self) -> Option<String> {
        match self {
            Self::Bytes(bytes) => Some(String::from_utf8_lossy(bytes).into_owned()),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_as_the_standard_writes_them() {
        assert_eq!(Idn(51).to_string(), "S-0-0051");
        assert_eq!(Idn(0x8013).to_string(), "P-0-0019");
        assert_eq!(Idn(0xA001).to_string(), "P-2-0001");
    }

    #[test]
    fn values_as_words() {
        // sercos2.md 3.2: the captured master writes 6, 6, 11, 51, 8013H; the maximum is its own guess.
        let list = Value::words(&[11, 51, 0x8013]);
        assert_eq!(list.to_words(), [6, 6, 11, 51, 0x8013]);
        assert_eq!(Value::of_words(&[6, 32, 11, 51, 0x8013], true), list);
        let text = Value::Bytes(b"rpm".to_vec());
        assert_eq!(text.to_words(), [3, 3, 0x7072, 0x006D]);
        assert_eq!(Value::of_words(&text.to_words(), true), text);
        for value in [Value::Word(0x1234), Value::Long(0x8765_4321), Value::Quad(0x0123_4567_89AB_CDEF)] {
            assert_eq!(Value::of_words(&value.to_words(), false), value);
        }
    }

    #[test]
    fn attributes() {
        assert_eq!(Attribute(0x7011_0001).fixed_bytes(), Some(2));
        assert_eq!(Attribute(0x7122_0001).fixed_bytes(), Some(4));
        assert!(Attribute(0x6055_0001).is_variable());
        assert!(Attribute(0x6009_0001).is_command());
    }
}
