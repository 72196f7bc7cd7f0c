//! Telegrams as bytes: views that are checked once and never fail afterwards, and their owned forms.
//!
//! "Bytes" are address and data as they go over the fibre, without flags, zero insertion and FCS (sercos2.md 1.1);
//! words are low byte first.

use crate::phase::Phase;
use crate::word::{ControlWord, StatusWord};
use core::fmt;

/// Address of the MST and of the MDT in CP3 and CP4.
pub const BROADCAST: u8 = 255;

/// Bytes of control or status word and INFO at the start of each record.
pub const RECORD_HEADER_BYTES: usize = 4;

/// Bytes that are not the telegram they are taken for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum TelegramError {
    /// Fewer or more bytes than the telegram has.
    Length {
        /// Bytes that the telegram has, or has at least.
        expected: usize,
        /// Bytes given.
        actual: usize,
    },
    /// The bytes of a record are not whole words.
    OddLength {
        /// Bytes given.
        actual: usize,
    },
    /// Not the address of the telegram.
    Address {
        /// Address given.
        actual: u8,
    },
}

impl fmt::Display for TelegramError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            TelegramError::Length { expected, actual } => write!(f, "{actual} bytes instead of {expected}"),
            TelegramError::OddLength { actual } => write!(f, "{actual} bytes are not whole words"),
            TelegramError::Address { actual } => write!(f, "address {actual} does not fit the telegram"),
        }
    }
}

impl core::error::Error for TelegramError {}

/// Master synchronisation telegram: address 255 and one byte.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Mst {
    /// The data byte; bits 2 to 0 are the phase.
    pub data: u8,
}

impl Mst {
    /// Address and data.
    pub const BYTES: usize = 2;

    /// # Errors
    /// Not two bytes, or not for address 255.
    pub const fn parse(bytes: &[u8]) -> Result<Self, TelegramError> {
        match *bytes {
            [BROADCAST, data] => Ok(Self { data }),
            [actual, _] => Err(TelegramError::Address { actual }),
            _ => Err(TelegramError::Length { expected: Self::BYTES, actual: bytes.len() }),
        }
    }

    /// The MST of a phase.
    pub const fn of(phase: Phase) -> Self {
        Self { data: phase.number() }
    }

    /// Address and data.
    pub const fn emit(self) -> [u8; Self::BYTES] {
        [BROADCAST, self.data]
    }

    /// The phase, `None` for 5 to 7.
    pub const fn phase(self) -> Option<Phase> {
        Phase::from_mst_data(self.data)
    }
}

/// A data record: control or status word, INFO, configurable data.
///
/// In CP1 and CP2 the MDT holds one, in CP3 and CP4 one for each drive; the AT holds one always.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RecordPacket<B> {
    bytes: B,
}

impl<B: AsRef<[u8]>> RecordPacket<B> {
    /// # Errors
    /// Fewer than four bytes, or an odd number.
    pub fn new_checked(bytes: B) -> Result<Self, TelegramError> {
        let actual = bytes.as_ref().len();
        if actual < RECORD_HEADER_BYTES {
            Err(TelegramError::Length { expected: RECORD_HEADER_BYTES, actual })
        } else if actual & 1 != 0 {
            Err(TelegramError::OddLength { actual })
        } else {
            Ok(Self { bytes })
        }
    }

    /// First word, as the control word of an MDT record.
    pub fn control(&self) -> ControlWord {
        ControlWord::new_with_raw_value(self.word(0))
    }

    /// First word, as the status word of an AT record.
    pub fn status(&self) -> StatusWord {
        StatusWord::new_with_raw_value(self.word(0))
    }

    /// INFO word of the service channel.
    pub fn info(&self) -> u16 {
        self.word(2)
    }

    /// Configurable data.
    pub fn data(&self) -> &[u8] {
        self.bytes.as_ref().get(RECORD_HEADER_BYTES..).unwrap_or(&[])
    }

    /// Two bytes of configurable data from an offset; `None` past the end.
    pub fn data_word(&self, offset_bytes: usize) -> Option<u16> {
        let bytes = self.data().get(offset_bytes..offset_bytes.checked_add(2)?)?;
        Some(u16::from_le_bytes(bytes.try_into().ok()?))
    }

    /// Four bytes of configurable data from an offset; `None` past the end.
    pub fn data_long(&self, offset_bytes: usize) -> Option<u32> {
        let bytes = self.data().get(offset_bytes..offset_bytes.checked_add(4)?)?;
        Some(u32::from_le_bytes(bytes.try_into().ok()?))
    }

    /// A word of the header, whose length was checked.
    fn word(&self, offset: usize) -> u16 {
        let byte = |offset| u16::from(self.bytes.as_ref().get(offset).copied().unwrap_or(0));
        byte(offset) | (byte(offset.saturating_add(1)) << 8)
    }
}

impl<B: AsRef<[u8]> + AsMut<[u8]>> RecordPacket<B> {
    /// Writes the first word.
    pub fn set_first_word(&mut self, word: u16) {
        self.put(0, &word.to_le_bytes());
    }

    /// Writes the INFO word.
    pub fn set_info(&mut self, info: u16) {
        self.put(2, &info.to_le_bytes());
    }

    /// Writes configurable data at an offset; what does not fit is not written.
    pub fn set_data(&mut self, offset_bytes: usize, data: &[u8]) {
        self.put(offset_bytes.saturating_add(RECORD_HEADER_BYTES), data);
    }

    fn put(&mut self, offset: usize, bytes: &[u8]) {
        for (to, from) in self.bytes.as_mut().iter_mut().skip(offset).zip(bytes) {
            *to = *from;
        }
    }
}

/// A data record that is not bound to its bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RecordRepr<'a> {
    /// Control or status word.
    pub first_word: u16,
    /// INFO word of the service channel.
    pub info: u16,
    /// Configurable data; an even number of bytes.
    pub data: &'a [u8],
}

impl<'a> RecordRepr<'a> {
    /// Takes a record apart.
    pub fn parse<B: AsRef<[u8]>>(packet: &'a RecordPacket<B>) -> Self {
        Self { first_word: packet.word(0), info: packet.info(), data: packet.data() }
    }

    /// Bytes that the record needs.
    pub const fn buffer_length(&self) -> usize {
        self.data.len().saturating_add(RECORD_HEADER_BYTES)
    }

    /// Writes the record.
    ///
    /// # Errors
    /// The packet has not [`RecordRepr::buffer_length`] bytes; it is left as it was.
    pub fn emit<B: AsRef<[u8]> + AsMut<[u8]>>(&self, packet: &mut RecordPacket<B>) -> Result<(), TelegramError> {
        let actual = packet.bytes.as_ref().len();
        let expected = self.buffer_length();
        if actual != expected {
            return Err(TelegramError::Length { expected, actual });
        }
        packet.set_first_word(self.first_word);
        packet.set_info(self.info);
        packet.set_data(0, self.data);
        Ok(())
    }
}

/// The record of one drive in the data field of an MDT of CP3 and CP4.
///
/// `position_bytes` counts from 1 (S-0-0009); `length_bytes` is that of the record.
///
/// # Errors
/// The record does not lie inside the data field, or is not a record.
pub fn record_of(
    data_field: &[u8],
    position_bytes: u16,
    length_bytes: u16,
) -> Result<RecordPacket<&[u8]>, TelegramError> {
    let outside = TelegramError::Length {
        expected: usize::from(position_bytes).saturating_add(usize::from(length_bytes)),
        actual: data_field.len(),
    };
    let start = usize::from(position_bytes).checked_sub(1).ok_or(outside)?;
    let record = data_field.get(start..start.saturating_add(usize::from(length_bytes))).ok_or(outside)?;
    RecordPacket::new_checked(record)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_recorded_mst_of_each_phase_is_read_and_written() {
        for (bytes, phase) in [([0xFF, 0], Phase::Cp0), ([0xFF, 3], Phase::Cp3), ([0xFF, 4], Phase::Cp4)] {
            assert_eq!(Mst::parse(&bytes).unwrap().phase(), Some(phase));
            assert_eq!(Mst::of(phase).emit(), bytes);
        }
        assert_eq!(Mst::parse(&[1, 0]), Err(TelegramError::Address { actual: 1 }));
        assert_eq!(Mst::parse(&[255]), Err(TelegramError::Length { expected: 2, actual: 1 }));
        assert_eq!(Mst { data: 5 }.phase(), None);
    }

    #[test]
    fn the_recorded_mdt_of_four_drives_gives_drive_3_its_record() {
        let data_field = [
            0x07, 0x00, 0x80, 0x00, 0, 0, 0, 0, 0x07, 0x00, 0x80, 0x00, 0, 0, 0, 0, 0x07, 0xE0, 0x80, 0x00, 0x10, 0x27,
            0, 0, 0x07, 0x00, 0x80, 0x00, 0, 0, 0, 0,
        ];
        let record = record_of(&data_field, 17, 8).unwrap();
        assert!(record.control().follows_commands());
        assert_eq!(record.info(), 0x0080);
        assert_eq!(record.data_long(0), Some(10_000));
        assert_eq!(record.data_word(2), Some(0));
        assert_eq!(record.data_long(2), None);
        assert!(record_of(&data_field, 27, 8).is_err());
        assert!(record_of(&data_field, 0, 8).is_err());
        assert!(record_of(&data_field, u16::MAX, u16::MAX).is_err());
    }

    #[test]
    fn the_recorded_at_is_read() {
        let bytes = [0x01, 0x58, 0x00, 0x00, 0x00, 0x00, 0xE0, 0xDD, 0x01, 0x00, 0x02, 0x00];
        let record = RecordPacket::new_checked(bytes).unwrap();
        assert_eq!(record.status().raw_value(), 0x5801);
        assert_eq!((record.data_word(0), record.data_long(2), record.data_word(6)), (Some(0), Some(122_336), Some(2)));
    }

    proptest! {
        #[test]
        fn a_record_survives_emit_and_parse(first_word: u16, info: u16, words in prop::collection::vec(any::<u16>(), 0..20)) {
            let data: std::vec::Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
            let repr = RecordRepr { first_word, info, data: &data };
            let mut packet = RecordPacket::new_checked(std::vec![0xAAu8; repr.buffer_length()]).unwrap();
            repr.emit(&mut packet).unwrap();
            prop_assert_eq!(RecordRepr::parse(&packet), repr);
            let mut longer = RecordPacket::new_checked(std::vec![0xAAu8; repr.buffer_length() + 2]).unwrap();
            prop_assert!(repr.emit(&mut longer).is_err());
            prop_assert!(longer.bytes.iter().all(|&byte| byte == 0xAA));
        }

        #[test]
        fn no_bytes_make_the_views_panic(bytes in prop::collection::vec(any::<u8>(), 0..40), position: u16, length: u16, offset: usize) {
            let _ = Mst::parse(&bytes);
            let _ = record_of(&bytes, position, length);
            if let Ok(record) = RecordPacket::new_checked(&bytes) {
                let _ = (record.control(), record.status(), record.info(), record.data());
                let _ = (record.data_word(offset), record.data_long(offset));
            }
        }
    }
}
