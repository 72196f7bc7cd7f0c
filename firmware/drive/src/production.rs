//! What the works have written into a drive once: which amplifier it is. `cargo xtask identity` makes the record.
//!
//! | bytes | what, least significant byte first |
//! |---|---|
//! | 4 | `SDPR` |
//! | 2 | version of this form, 1 |
//! | 2 | 0 |
//! | 16 | hardware: ASCII, filled up with zeros |
//! | 16 | serial number: the same |
//! | 20 | peak, continuous and trip current, range of the current sensors in mA; thermal time constant in ms: 4 each |
//! | 16 | dead-time band in mA; bus range, undervoltage, overvoltage, withstand voltage in V; least resistance in 0.1 Ohm; warning and shut-down temperature in 0.1 degrees Celsius: 2 each |
//! | 4 | CRC-32 (ISO-HDLC) of all before |
//!
//! A drive without a record is the board as its crate describes it. One whose record cannot be read takes part in the ring, and S-0-0128 refuses it.

use core::fmt;

use crc::{CRC_32_ISO_HDLC, Crc, NoTable};
use heapless::String;

use crate::amplifier::Amplifier;

/// Bytes of a record.
pub const RECORD_BYTES: usize = 80;
/// Longest text in a record.
pub const TEXT_BYTES: usize = 16;

const MARK: [u8; 4] = *b"SDPR";
const VERSION: u16 = 1;
/// What a flash reads where nothing was written.
const ERASED: u8 = 0xFF;
/// Once in a start: slow and small.
const CHECKSUM: Crc<u32, NoTable> = Crc::<u32, NoTable>::new(&CRC_32_ISO_HDLC);

/// Hardware or serial number: printable ASCII.
pub type Text = String<TEXT_BYTES>;

/// What the works know of a drive.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ProductionRecord {
    /// Type and version of the hardware.
    pub hardware: Text,
    /// Serial number.
    pub serial_number: Text,
    /// The amplifier.
    pub amplifier: Amplifier,
}

/// What a drive has found of its production record.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Production {
    /// Nothing was written: the amplifier is that of the board.
    Blank,
    /// The record.
    Record(ProductionRecord),
    /// It cannot be read.
    Unreadable(RecordError),
}

/// Why a production record cannot be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum RecordError {
    /// It is shorter or longer.
    Length {
        /// [`RECORD_BYTES`].
        expected: usize,
        /// Bytes that there are.
        actual: usize,
    },
    /// Bytes have changed.
    Checksum {
        /// That of the bytes.
        expected: u32,
        /// That in the record.
        actual: u32,
    },
    /// It is no production record, or none that this program knows.
    Form {
        /// The version that this program knows.
        expected: u16,
        /// That of the record; 0 without its mark.
        actual: u16,
    },
    /// A text has other characters than printable ASCII.
    Text {
        /// The first of them.
        actual: u8,
    },
}

impl fmt::Display for RecordError {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("production record: ")?;
        match self {
            Self::Length { expected, actual } => write!(formatter, "{actual} bytes, expected {expected}"),
            Self::Checksum { expected, actual } => {
                write!(formatter, "checksum {actual:08X}H, expected {expected:08X}H; have it written again")
            }
            Self::Form { expected, actual } => {
                write!(
                    formatter,
                    "form {actual:04X}H, expected {expected:04X}H; have it written again, or newer firmware"
                )
            }
            Self::Text { actual } => write!(formatter, "character {actual:02X}H in a text; have it written again"),
        }
    }
}

impl core::error::Error for RecordError {}

impl Production {
    /// What stands in the flash.
    #[must_use]
    pub fn read(bytes: &[u8]) -> Self {
        if bytes.iter().all(|byte| *byte == ERASED) {
            return Self::Blank;
        }
        match ProductionRecord::parse(bytes) {
            Ok(record) => Self::Record(record),
            Err(error) => Self::Unreadable(error),
        }
    }

    /// The amplifier, on a board that has `of_board` where nothing tells of another one.
    #[must_use]
    pub const fn amplifier<'a>(&'a self, of_board: &'a Amplifier) -> &'a Amplifier {
        match self {
            Self::Record(record) => &record.amplifier,
            Self::Blank | Self::Unreadable(_) => of_board,
        }
    }

    /// Why nobody knows the amplifier.
    pub(crate) const fn error(&self) -> Option<RecordError> {
        match self {
            Self::Unreadable(error) => Some(*error),
            Self::Blank | Self::Record(_) => None,
        }
    }

    /// Empty where nobody has told.
    pub(crate) fn serial_number(&self) -> &str {
        self.record().map_or("", |record| record.serial_number.as_str())
    }

    /// Empty where nobody has told.
    pub(crate) fn hardware(&self) -> &str {
        self.record().map_or("", |record| record.hardware.as_str())
    }

    const fn record(&self) -> Option<&ProductionRecord> {
        if let Self::Record(record) = self { Some(record) } else { None }
    }
}

impl ProductionRecord {
    /// The record in these bytes.
    ///
    /// # Errors
    /// They are none.
    pub fn parse(bytes: &[u8]) -> Result<Self, RecordError> {
        let length = RecordError::Length { expected: RECORD_BYTES, actual: bytes.len() };
        let bytes: &[u8; RECORD_BYTES] = bytes.try_into().map_err(|_| length)?;
        let (contents, checksum) = bytes.split_last_chunk::<4>().ok_or(length)?;
        let (expected, actual) = (CHECKSUM.checksum(contents), u32::from_le_bytes(*checksum));
        if expected != actual {
            return Err(RecordError::Checksum { expected, actual });
        }
        let mut fields = Fields(contents);
        let (mark, actual, _) = (fields.take(), fields.word(), fields.word());
        let actual = if mark == MARK { actual } else { 0 };
        if actual != VERSION {
            return Err(RecordError::Form { expected: VERSION, actual });
        }
        Ok(Self {
            hardware: text(&fields.take())?,
            serial_number: text(&fields.take())?,
            amplifier: Amplifier {
                peak_current: fields.long(),
                continuous_current: fields.long(),
                trip_current: fields.long(),
                current_range: fields.long(),
                thermal_time_constant: fields.long(),
                dead_time_band: fields.word(),
                bus_range: fields.word(),
                undervoltage: fields.word(),
                overvoltage: fields.word(),
                withstand_voltage: fields.word(),
                least_resistance: fields.word(),
                warning_temperature: fields.word(),
                shutdown_temperature: fields.word(),
            },
        })
    }

    /// The bytes of this record.
    #[must_use]
    pub fn emit(&self) -> [u8; RECORD_BYTES] {
        let Amplifier {
            peak_current,
            continuous_current,
            trip_current,
            current_range,
            dead_time_band,
            bus_range,
            undervoltage,
            overvoltage,
            withstand_voltage,
            least_resistance,
            warning_temperature,
            shutdown_temperature,
            thermal_time_constant,
        } = self.amplifier;
        let texts = [&self.hardware, &self.serial_number]
            .into_iter()
            .flat_map(|text| text.bytes().chain(core::iter::repeat(0)).take(TEXT_BYTES));
        let longs = [peak_current, continuous_current, trip_current, current_range, thermal_time_constant];
        let words = [
            dead_time_band,
            bus_range,
            undervoltage,
            overvoltage,
            withstand_voltage,
            least_resistance,
            warning_temperature,
            shutdown_temperature,
        ];
        let contents = MARK
            .into_iter()
            .chain([VERSION, 0].into_iter().flat_map(u16::to_le_bytes))
            .chain(texts)
            .chain(longs.into_iter().flat_map(u32::to_le_bytes))
            .chain(words.into_iter().flat_map(u16::to_le_bytes));
        let mut bytes = [0; RECORD_BYTES];
        for (place, byte) in bytes.iter_mut().zip(contents) {
            *place = byte;
        }
        if let Some((contents, checksum)) = bytes.split_last_chunk_mut::<4>() {
            *checksum = CHECKSUM.checksum(contents).to_le_bytes();
        }
        bytes
    }
}

/// Printable ASCII, up to the first zero.
fn text(bytes: &[u8; TEXT_BYTES]) -> Result<Text, RecordError> {
    let mut text = Text::new();
    for byte in bytes.iter().copied().take_while(|byte| *byte != 0) {
        if !(byte.is_ascii_graphic() || byte == b' ') {
            return Err(RecordError::Text { actual: byte });
        }
        // As long as the longest text.
        let _ = text.push(char::from(byte));
    }
    Ok(text)
}

/// The fields of a record, one after the other; zeros behind its end, which a test rules out.
struct Fields<'a>(&'a [u8]);

impl Fields<'_> {
    fn take<const N: usize>(&mut self) -> [u8; N] {
        let Some((field, rest)) = self.0.split_first_chunk::<N>() else { return [0; N] };
        self.0 = rest;
        *field
    }

    fn word(&mut self) -> u16 {
        u16::from_le_bytes(self.take())
    }

    fn long(&mut self) -> u32 {
        u32::from_le_bytes(self.take())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::service::rig::AMPLIFIER;

    fn record() -> ProductionRecord {
        ProductionRecord {
            hardware: Text::try_from("SD 14-500 rev. B").unwrap(),
            serial_number: Text::try_from("2026-000017").unwrap(),
            amplifier: AMPLIFIER,
        }
    }

    #[test]
    fn a_record_gives_back_what_was_written_and_its_last_field_is_at_its_end() {
        let record = record();
        let bytes = record.emit();
        assert_eq!(ProductionRecord::parse(&bytes), Ok(record.clone()));
        assert_eq!(bytes[74..76], AMPLIFIER.shutdown_temperature.to_le_bytes());
        assert_eq!(Production::read(&bytes).hardware(), "SD 14-500 rev. B");
        let every = Amplifier {
            peak_current: 1,
            continuous_current: 2,
            trip_current: 3,
            current_range: 4,
            dead_time_band: 5,
            bus_range: 6,
            undervoltage: 7,
            overvoltage: 8,
            withstand_voltage: 9,
            least_resistance: 10,
            warning_temperature: 11,
            shutdown_temperature: 12,
            thermal_time_constant: 13,
        };
        let other = ProductionRecord { amplifier: every, ..record };
        assert_eq!(ProductionRecord::parse(&other.emit()), Ok(other));
    }

    #[test]
    fn every_bit_that_has_changed_is_found() {
        let bytes = record().emit();
        for bit in 0..RECORD_BYTES * 8 {
            let mut changed = bytes;
            changed[bit / 8] ^= 1 << (bit % 8);
            let error = ProductionRecord::parse(&changed).unwrap_err();
            assert!(matches!(error, RecordError::Checksum { .. }), "bit {bit}");
            assert!(matches!(Production::read(&changed), Production::Unreadable(_)), "bit {bit}");
        }
    }

    #[test]
    fn nothing_written_is_blank_and_less_or_other_than_a_record_is_none() {
        assert_eq!(Production::read(&[ERASED; RECORD_BYTES]), Production::Blank);
        assert_eq!(Production::Blank.amplifier(&AMPLIFIER), &AMPLIFIER);
        let bytes = record().emit();
        assert_eq!(ProductionRecord::parse(&bytes[1..]), Err(RecordError::Length { expected: 80, actual: 79 }));
        let with = |at: usize, value: u8| {
            let mut changed = bytes;
            changed[at] = value;
            let checksum = CHECKSUM.checksum(&changed[..76]);
            changed[76..].copy_from_slice(&checksum.to_le_bytes());
            ProductionRecord::parse(&changed).unwrap_err()
        };
        assert_eq!(with(4, 2), RecordError::Form { expected: 1, actual: 2 });
        assert_eq!(with(0, b'X'), RecordError::Form { expected: 1, actual: 0 });
        assert_eq!(with(24, 7), RecordError::Text { actual: 7 });
    }
}
