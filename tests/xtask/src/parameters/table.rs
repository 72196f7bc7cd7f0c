//! Parameters and their differences as tables for the terminal.

use super::file::{Entry, ParameterFile};
use sercos::Idn;
use std::collections::BTreeSet;

/// Characters of a value beyond which an overview shows its beginning only.
const WIDEST: usize = 40;

/// A data block that two sides do not have alike.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Difference {
    pub(crate) idn: Idn,
    pub(crate) name: String,
    /// With its unit; `None`: one side does not have it.
    pub(crate) sides: [Option<String>; 2],
}

/// Where two sides differ, in the order of the IDNs.
pub(crate) fn differences(one: &ParameterFile, other: &ParameterFile) -> Vec<Difference> {
    let idns: BTreeSet<Idn> = one.entries().chain(other.entries()).map(|(idn, _)| idn).collect();
    let differ = idns.into_iter().filter_map(|idn| {
        let sides = [one.entry(idn), other.entry(idn)];
        if let [Some(one), Some(other)] = sides
            && one.says_as(other)
        {
            return None;
        }
        let name = sides.iter().flatten().map(|entry| entry.name.clone()).find(|name| !name.is_empty());
        Some(Difference { idn, name: name.unwrap_or_default(), sides: sides.map(|entry| entry.map(Entry::quantity)) })
    });
    differ.collect()
}

/// The differences of two sides with these names.
pub(crate) fn of_differences(differences: &[Difference], sides: [&str; 2]) -> String {
    let head = ["IDN", "name", sides[0], sides[1]].map(str::to_owned);
    let rows = differences.iter().map(|difference| {
        let [one, other] = difference.sides.clone().map(|side| side.unwrap_or_else(|| "-".to_owned()));
        [difference.idn.to_string(), difference.name.clone(), one, other]
    });
    aligned(&[head].into_iter().chain(rows).collect::<Vec<_>>())
}

/// IDN, name, value and unit; in an overview long lists and texts are cut.
pub(crate) fn of_entries(entries: &[(Idn, Entry)], overview: bool) -> String {
    let head = ["IDN", "name", "value", "unit"].map(str::to_owned);
    let shown = |value: String| match value.char_indices().nth(WIDEST) {
        Some((end, _)) if overview => format!("{}...", &value[..end]),
        _ => value,
    };
    let rows = entries
        .iter()
        .map(|(idn, entry)| [idn.to_string(), entry.name.clone(), shown(entry.value.to_string()), entry.unit.clone()]);
    aligned(&[head].into_iter().chain(rows).collect::<Vec<_>>())
}

/// Columns below each other, two spaces between them. Line breaks of a text would break its row.
fn aligned(rows: &[[String; 4]]) -> String {
    let cell = |text: &String| text.chars().map(|sign| if sign.is_control() { ' ' } else { sign }).collect();
    let rows: Vec<[String; 4]> = rows.iter().map(|row| row.each_ref().map(cell)).collect();
    let width = |column: usize| rows.iter().map(|row| row[column].chars().count()).max().unwrap_or(0);
    let widths = [width(0), width(1), width(2)];
    let line = |[idn, name, value, unit]: &[String; 4]| {
        let [first, second, third] = widths;
        let line = format!("{idn:<first$}  {name:<second$}  {value:<third$}  {unit}");
        line.trim_end().to_owned() + "\n"
    };
    rows.iter().map(line).collect()
}

#[cfg(test)]
mod tests {
    use super::super::file::Origin;
    use super::super::value::Readable;
    use super::*;

    fn entry(name: &str, unit: &str, value: &str) -> Entry {
        Entry { name: name.to_owned(), unit: unit.to_owned(), value: Readable::One(value.to_owned()) }
    }

    fn file(entries: Vec<(u16, Entry)>) -> ParameterFile {
        ParameterFile::new(Origin::default(), entries.into_iter().map(|(number, entry)| (Idn(number), entry)))
    }

    #[test]
    fn differences_stand_in_a_table_with_what_one_side_does_not_have() {
        let velocity = |value| (41, entry("Homing velocity", "rpm", value));
        let one = file(vec![velocity("100.0000"), (32, entry("Mode", "", "0x0002")), (104, entry("Kv", "", "1.00"))]);
        let other = file(vec![velocity("60"), (32, entry("Mode", "", "0x0002")), (142, entry("Type", "", "a\nb"))]);
        let expected = "\
IDN       name             press.toml    drive
S-0-0041  Homing velocity  100.0000 rpm  60 rpm
S-0-0104  Kv               1.00          -
S-0-0142  Type             -             a b
";
        assert_eq!(of_differences(&differences(&one, &other), ["press.toml", "drive"]), expected);
        assert_eq!(differences(&one, &one), vec![]);
    }

    #[test]
    fn parameters_stand_in_a_table_and_an_overview_cuts_long_values() {
        let rows =
            [(Idn(41), entry("Homing velocity", "rpm", "100.0000")), (Idn(142), entry("T", "", &"é".repeat(50)))];
        let table = |width: usize, last: &str| {
            let value = format!("{:<width$}", "value");
            let velocity = format!("{:<width$}", "100.0000");
            format!(
                "IDN       name             {value}  unit\nS-0-0041  Homing velocity  {velocity}  rpm\nS-0-0142  T                {last}\n"
            )
        };
        assert_eq!(of_entries(&rows, true), table(43, &format!("{}...", "é".repeat(40))));
        assert_eq!(of_entries(&rows, false), table(50, &"é".repeat(50)));
    }
}
