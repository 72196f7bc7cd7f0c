//! What a channel records, and what its numbers mean.

use drive::DICTIONARY;
use drive::LOOP_PERIOD_MICROSECONDS;
use drive::oscilloscope::INTERNAL_SIGNALS;
use sercos::Idn;
use sercos::attribute::Format;
use std::fmt;
use std::str::FromStr;

/// A signal with its name and the weight of its numbers.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Signal {
    /// What P-0-0201 to P-0-0204 call it.
    pub(crate) number: u16,
    /// For the reader.
    pub(crate) name: &'static str,
    /// Unit of the scaled value; may be empty.
    pub(crate) unit: &'static str,
    /// Scaled value of one increment.
    pub(crate) weight: f64,
}

impl Signal {
    /// The value in [`Signal::unit`].
    pub(crate) fn scaled(&self, raw: i32) -> f64 {
        f64::from(raw) * self.weight
    }

    /// The nearest recorded number of a scaled value, limited to what four bytes hold.
    pub(crate) fn raw(&self, scaled: f64) -> i32 {
        // The cast limits.
        (scaled / self.weight).round() as i32
    }

    fn of_internal(number: u16) -> Option<Self> {
        const TICKS_PER_MINUTE: f64 = 60e6 / LOOP_PERIOD_MICROSECONDS as f64;
        let row = INTERNAL_SIGNALS.iter().find(|row| row.signal.number() == number)?;
        let increment = (-f64::from(row.shift)).exp2();
        let (weight, unit) = match row.unit {
            // People think in these.
            "rev/tick" => (increment * TICKS_PER_MINUTE, "rpm"),
            "rev" => (increment * 360.0, "deg"),
            "mV" => (increment / 1_000.0, "V"),
            unit => (increment, unit),
        };
        Some(Self { number, name: row.name, unit, weight })
    }

    fn of_idn(idn: Idn) -> Option<Self> {
        let block = DICTIONARY.find(idn)?;
        let attribute = block.attribute;
        let decimals = i32::from(u8::from(attribute.decimal_places()));
        let is_number = matches!(attribute.format(), Format::Unsigned | Format::Signed);
        let weight = if is_number { 10_f64.powi(-decimals) } else { 1.0 };
        Some(Self { number: idn.0, name: block.name, unit: block.unit.preferred(), weight })
    }
}

impl fmt::Display for Signal {
    /// `S-0-0040` or `F003`.
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.number >= 0xF000 { write!(formatter, "{:04X}", self.number) } else { Idn(self.number).fmt(formatter) }
    }
}

impl FromStr for Signal {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let signal = match text.parse::<Idn>() {
            Ok(idn) => Self::of_idn(idn),
            Err(_) => u16::from_str_radix(text, 16).ok().and_then(Self::of_internal),
        };
        signal.ok_or_else(|| {
            let known: Vec<String> =
                INTERNAL_SIGNALS.iter().map(|row| format!("{:04X}", row.signal.number())).collect();
            format!("neither a data block of the drive (S-0-0040) nor an internal signal ({})", known.join(", "))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn signal(text: &str) -> Signal {
        text.parse().unwrap()
    }

    #[test]
    fn numbers_have_the_weight_of_their_data_block_or_of_the_table_of_internal_signals() {
        let velocity = signal("S-0-0040");
        assert_eq!((velocity.to_string().as_str(), velocity.unit), ("S-0-0040", "rpm"));
        assert!((velocity.scaled(3_000_000) - 300.0).abs() < 1e-9);
        assert_eq!(velocity.raw(-300.0), -3_000_000);
        let internal = signal("F003");
        assert_eq!((internal.to_string().as_str(), internal.unit), ("F003", "rpm"));
        // 480 000 ticks a minute: 1 rpm is 2^36 / 480 000.
        assert_eq!(internal.raw(1.0), 143_166);
        assert!((signal("f006").scaled(-16_384) + 0.5).abs() < 1e-12);
        assert!((signal("F000").scaled(1 << 24) - 360.0).abs() < 1e-9);
        assert!((signal("F019").scaled(560_000) - 560.0).abs() < 1e-9);
        assert!((signal("S-0-0013").scaled(2) - 2.0).abs() < 1e-12, "bits have no decimal places");
        assert_eq!(internal.raw(1e12), i32::MAX);
    }

    #[test]
    fn what_is_no_signal_is_refused_with_those_that_are() {
        for text in ["", "F007", "0", "S-0-4095", "S-0", "10000", "speed"] {
            let refusal = text.parse::<Signal>().unwrap_err();
            assert!(refusal.contains("F000") && refusal.contains("F019"), "{refusal}");
        }
    }
}
