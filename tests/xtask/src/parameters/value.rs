//! A value as people read it, and as the service channel carries it.
//!
//! Which is which says the attribute: numbers have its decimal places, bits and hexadecimal numbers begin with `0x`, ident numbers read
//! `S-0-0051`, a list is a list of these, and a text is itself.

use ring::ident::Value;
use sercos::Idn;
use sercos::attribute::{Attribute, Format};
use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;

/// A value for people.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(untagged, expecting = "a value is a string in quotes or a list of such strings")]
pub(crate) enum Readable {
    /// A number or a text.
    One(String),
    /// A list.
    Many(Vec<String>),
}

impl fmt::Display for Readable {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::One(text) => formatter.write_str(text),
            Self::Many(items) => write!(formatter, "[{}]", items.join(", ")),
        }
    }
}

impl Readable {
    /// The value of a data block with this attribute.
    ///
    /// # Errors
    /// A text that is none, or a value that is not as long as the attribute says; one line.
    pub(crate) fn of(value: &Value, attribute: Attribute) -> Result<Self, String> {
        let length = attribute.length();
        match (value, length.item_bytes()) {
            (Value::Bytes(bytes), _) if attribute.format() == Format::Text => {
                let text = String::from_utf8(bytes.clone()).map_err(|_| "its text is not UTF-8".to_owned())?;
                Ok(Self::One(text))
            }
            (Value::Bytes(bytes), Some(size)) if bytes.len().is_multiple_of(size.into()) => {
                let items = bytes.chunks(size.into()).map(|item| item_of(little_endian(item), size, attribute));
                Ok(Self::Many(items.collect()))
            }
            (value, None) => match (value.as_number(), length.fixed_bytes()) {
                (Some(number), Some(size)) => Ok(Self::One(item_of(number, size, attribute))),
                _ => Err(format!("its attribute {:08X}H gives it no length", attribute.raw_value())),
            },
            (_, Some(size)) => Err(format!("its list does not consist of items of {size} bytes")),
        }
    }

    /// What the service channel carries for it, in a data block with this attribute.
    ///
    /// # Errors
    /// It is another kind of value, or does not fit; one line.
    pub(crate) fn transmitted(&self, attribute: Attribute) -> Result<Value, String> {
        let length = attribute.length();
        match (self, length.item_bytes(), length.fixed_bytes()) {
            (Self::One(text), Some(_), _) if attribute.format() == Format::Text => {
                Ok(Value::Bytes(text.clone().into_bytes()))
            }
            (Self::Many(items), Some(size), _) if attribute.format() != Format::Text => {
                let numbers = items.iter().map(|item| number_of(item, size, attribute));
                let numbers = numbers.collect::<Result<Vec<u64>, String>>()?;
                let bytes = numbers.into_iter().flat_map(|number| number.to_le_bytes().into_iter().take(size.into()));
                Ok(Value::Bytes(bytes.collect()))
            }
            (Self::One(text), None, Some(size)) => {
                let number = number_of(text, size, attribute)?;
                Ok(match size {
                    2 => Value::Word((number & 0xFFFF) as u16),
                    4 => Value::Long((number & 0xFFFF_FFFF) as u32),
                    _ => Value::Quad(number),
                })
            }
            (Self::One(_), ..) => Err("the drive has a list here: write [\"...\", \"...\"]".to_owned()),
            (Self::Many(_), ..) => Err("the drive has no list here: write \"...\"".to_owned()),
        }
    }
}

fn little_endian(bytes: &[u8]) -> u64 {
    bytes.iter().rev().fold(0, |number, byte| number << 8 | u64::from(*byte))
}

/// A number of so many bytes.
fn item_of(raw: u64, size: u16, attribute: Attribute) -> String {
    match attribute.format() {
        Format::Unsigned => decimal(i128::from(raw), attribute),
        Format::Signed => decimal(signed(raw, size).into(), attribute),
        Format::Idn if size == 2 => Idn((raw & 0xFFFF) as u16).to_string(),
        _ => format!("0x{raw:0width$X}", width = 2 * usize::from(size)),
    }
}

fn number_of(text: &str, size: u16, attribute: Attribute) -> Result<u64, String> {
    let bits = 8 * u32::from(size);
    let does_not_fit = || format!("'{text}' does not fit into {size} bytes");
    let (least, most) = match attribute.format() {
        Format::Unsigned => (0, (1_i128 << bits) - 1),
        Format::Signed => (-(1_i128 << (bits - 1)), (1_i128 << (bits - 1)) - 1),
        Format::Idn if size == 2 => {
            return match Idn::from_str(text) {
                Ok(idn) => Ok(idn.0.into()),
                Err(_) => Err(format!("'{text}' is no IDN; one reads S-0-0051 or P-0-0019")),
            };
        }
        _ => {
            let digits = text.strip_prefix("0x").filter(|digits| digits.bytes().all(|digit| digit.is_ascii_hexdigit()));
            let digits = digits.filter(|digits| !digits.is_empty());
            let digits = digits.ok_or_else(|| format!("'{text}' is no hexadecimal number; one reads 0x01AF"))?;
            let number = u64::from_str_radix(digits, 16).map_err(|_| does_not_fit())?;
            return if bits == 64 || number >> bits == 0 { Ok(number) } else { Err(does_not_fit()) };
        }
    };
    let number = increments(text, attribute)?;
    if !(least..=most).contains(&number) {
        return Err(does_not_fit());
    }
    // Two's complement, cut to its bytes.
    let mask = if bits == 64 { u64::MAX } else { (1 << bits) - 1 };
    Ok(number as u64 & mask)
}

fn signed(raw: u64, size: u16) -> i64 {
    let unused = 64 - 8 * u32::from(size);
    (raw << unused).cast_signed() >> unused
}

fn places(attribute: Attribute) -> usize {
    usize::from(u8::from(attribute.decimal_places()))
}

/// With the decimal places of the attribute.
fn decimal(number: i128, attribute: Attribute) -> String {
    let number = number * i128::from(attribute.conversion_factor());
    let sign = if number < 0 { "-" } else { "" };
    let places = places(attribute);
    let digits = format!("{:0width$}", number.unsigned_abs(), width = places + 1);
    let (whole, fraction) = digits.split_at(digits.len() - places);
    if places == 0 { format!("{sign}{whole}") } else { format!("{sign}{whole}.{fraction}") }
}

/// The number whose [`decimal`] this is; decimal places may be left out, and zeros may stand for those that the attribute does not have.
fn increments(text: &str, attribute: Attribute) -> Result<i128, String> {
    let no_number = || format!("'{text}' is no number; one reads -12.5");
    let (sign, unsigned) = text.strip_prefix('-').map_or((1, text), |rest| (-1, rest));
    let (whole, fraction) = unsigned.split_once('.').unwrap_or((unsigned, "0"));
    let is_digits = |part: &str| !part.is_empty() && part.bytes().all(|digit| digit.is_ascii_digit());
    if !is_digits(whole) || !is_digits(fraction) {
        return Err(no_number());
    }
    let places = places(attribute);
    let fraction = fraction.trim_end_matches('0');
    if fraction.len() > places {
        return Err(format!("'{text}' has more decimal places than the {places} of the drive's scaling"));
    }
    let number = format!("{whole}{fraction:0<places$}").parse::<i128>().map_err(|_| no_number())?;
    let factor = i128::from(attribute.conversion_factor()).max(1);
    if number % factor != 0 {
        return Err(format!("'{text}' is no multiple of {}, the step of the drive's scaling", decimal(1, attribute)));
    }
    Ok(sign * number / factor)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Attribute of a length, format, decimal places and conversion factor.
    fn attribute(length: u32, format: u32, places: u32, factor: u32) -> Attribute {
        Attribute::new_with_raw_value(places << 24 | format << 20 | length << 16 | factor)
    }

    fn one(text: &str) -> Readable {
        Readable::One(text.to_owned())
    }

    fn many(items: &[&str]) -> Readable {
        Readable::Many(items.iter().map(|item| (*item).to_owned()).collect())
    }

    #[test]
    fn values_read_as_their_attributes_say() {
        for (value, attribute, readable) in [
            (Value::Long(1_000_000), attribute(2, 2, 4, 1), one("100.0000")),
            (Value::Long((-5_i32).cast_unsigned()), attribute(2, 2, 4, 1), one("-0.0005")),
            (Value::Long(u32::MAX), attribute(2, 1, 3, 1), one("4294967.295")),
            (Value::Word(0xFFFF), attribute(1, 2, 0, 1), one("-1")),
            (Value::Word(0x80), attribute(1, 0, 0, 1), one("0x0080")),
            (Value::Long(0xAF), attribute(2, 3, 0, 1), one("0x000000AF")),
            (Value::Word(0x8013), attribute(1, 5, 0, 1), one("P-0-0019")),
            (Value::Quad(u64::MAX), attribute(3, 1, 0, 1), one("18446744073709551615")),
            (Value::Quad(u64::MAX), attribute(3, 2, 1, 1), one("-0.1")),
            (Value::Word(7), attribute(1, 1, 1, 25), one("17.5")),
            (Value::Bytes(b"press 3 \"left\"".to_vec()), attribute(4, 4, 0, 1), one("press 3 \"left\"")),
            (Value::words(&[51, 0x8013]), attribute(5, 5, 0, 1), many(&["S-0-0051", "P-0-0019"])),
            (Value::Bytes(vec![5, 0, 0, 0]), attribute(6, 2, 2, 1), many(&["0.05"])),
            (Value::Bytes(vec![]), attribute(5, 1, 0, 1), many(&[])),
        ] {
            assert_eq!(Readable::of(&value, attribute), Ok(readable.clone()), "{attribute:?}");
            assert_eq!(readable.transmitted(attribute), Ok(value), "{readable}");
        }
    }

    #[test]
    fn a_number_may_have_fewer_places_than_the_attribute_and_zeros_behind_them() {
        let rpm = attribute(2, 2, 4, 1);
        for text in ["100", "100.0", "100.00000000"] {
            assert_eq!(one(text).transmitted(rpm), Ok(Value::Long(1_000_000)), "{text}");
        }
    }

    #[test]
    fn what_is_no_value_of_the_data_block_is_refused_with_the_reason() {
        let rpm = attribute(2, 2, 4, 1);
        let word = attribute(1, 1, 0, 1);
        for (readable, attribute, cause) in [
            (one("fast"), rpm, "'fast' is no number"),
            (one(""), rpm, "'' is no number"),
            (one("-"), rpm, "'-' is no number"),
            (one("1,5"), rpm, "'1,5' is no number"),
            (one("+1"), rpm, "'+1' is no number"),
            (one("1."), rpm, "'1.' is no number"),
            (one("0.00001"), rpm, "more decimal places than the 4"),
            (one("214748.3648"), rpm, "does not fit into 4 bytes"),
            (one("-1"), word, "does not fit into 2 bytes"),
            (one("65536"), word, "does not fit into 2 bytes"),
            (one("9".repeat(60).as_str()), word, "is no number"),
            (one("17.6"), super::tests::attribute(1, 1, 1, 25), "no multiple of 2.5"),
            (one("12"), super::tests::attribute(1, 0, 0, 1), "no hexadecimal number"),
            (one("0x"), super::tests::attribute(1, 0, 0, 1), "no hexadecimal number"),
            (one("0x10000"), super::tests::attribute(1, 0, 0, 1), "does not fit into 2 bytes"),
            (one("51"), super::tests::attribute(1, 5, 0, 1), "is no IDN"),
            (one("S-0-0051"), super::tests::attribute(5, 5, 0, 1), "has a list here"),
            (many(&["1"]), word, "has no list here"),
            (many(&["a"]), super::tests::attribute(4, 4, 0, 1), "has no list here"),
        ] {
            let refusal = readable.transmitted(attribute).unwrap_err();
            assert!(refusal.contains(cause) && !refusal.contains('\n'), "{cause:?} expected in {refusal}");
        }
        assert!(Readable::of(&Value::Bytes(vec![0xFF]), super::tests::attribute(4, 4, 0, 1)).is_err());
        assert!(Readable::of(&Value::Bytes(vec![1]), super::tests::attribute(5, 1, 0, 1)).is_err());
    }

    proptest! {
        #[test]
        fn every_value_comes_back_from_what_people_read(
            raw: u64, length in 1_u32..=7, format in prop::sample::select(vec![0_u32, 1, 2, 3, 5]), places in 0_u32..=15,
            factor in 1_u32..=0xFFFF, items in 0_usize..5,
        ) {
            let attribute = attribute(length, format, places, factor);
            let value = match length {
                1 => Value::Word(raw as u16),
                2 => Value::Long(raw as u32),
                3 => Value::Quad(raw),
                _ => Value::Bytes(raw.to_le_bytes().repeat(items)),
            };
            let readable = Readable::of(&value, attribute).unwrap();
            prop_assert_eq!(readable.transmitted(attribute), Ok(value));
        }

        #[test]
        fn no_text_at_all_makes_a_panic(text in ".{0,24}", length in 0_u32..=7, format in 0_u32..=7, places in 0_u32..=15) {
            let attribute = attribute(length, format, places, 1);
            if let Ok(value) = one(&text).transmitted(attribute) {
                prop_assert!(Readable::of(&value, attribute).is_ok());
            }
        }
    }
}
