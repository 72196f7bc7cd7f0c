//! The file: TOML, a table for each data block, in the order of the IDNs.
//!
//! Two files of equal drives are equal byte for byte: nothing in them tells when or where they were written.

use super::value::Readable;
use anyhow::{Context, Result, anyhow, bail, ensure};
use sercos::Idn;
use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::collections::BTreeMap;
use std::path::Path;

/// Version of this form.
const FORM: u32 = 1;

const HEAD: &str = "\
# Parameters of a drive, written by `cargo xtask parameters save`.
# What counts for `load` are the IDN, the value and its unit; names and the table `saved_from` are for the reader.
";

/// What a file holds.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct ParameterFile {
    form: u32,
    /// The drive that it was saved from.
    pub(crate) saved_from: Origin,
    /// Data blocks in ascending order.
    #[serde(default)]
    parameters: BTreeMap<Key, Entry>,
}

/// What a drive says about itself.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Origin {
    /// S-0-0030.
    pub(crate) manufacturer_version: String,
    /// S-0-0140.
    pub(crate) controller_type: String,
    /// S-0-0142.
    pub(crate) application_type: String,
    /// S-0-0326.
    pub(crate) checksum: String,
}

/// A data block in a file.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Entry {
    /// Element 2.
    #[serde(default)]
    pub(crate) name: String,
    /// Element 4; empty where there is none.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub(crate) unit: String,
    /// Operation data.
    pub(crate) value: Readable,
}

impl Entry {
    /// The value with its unit.
    pub(crate) fn quantity(&self) -> String {
        if self.unit.is_empty() { self.value.to_string() } else { format!("{} {}", self.value, self.unit) }
    }

    /// Whether both say the same; a number with a unit may have more or fewer zeros behind its point.
    pub(crate) fn says_as(&self, other: &Self) -> bool {
        let short = |text: &str| match text.split_once('.') {
            Some((whole, fraction)) => format!("{whole}.{}", fraction.trim_end_matches('0')),
            None => format!("{text}."),
        };
        match (&self.value, &other.value) {
            (Readable::One(one), Readable::One(two)) if !self.unit.is_empty() && self.unit == other.unit => {
                short(one) == short(two)
            }
            (one, two) => one == two && self.unit == other.unit,
        }
    }
}

/// Orders as the IDN does: standard data blocks before those of the product.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Key(Idn);

impl Serialize for Key {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(&self.0)
    }
}

impl<'de> Deserialize<'de> for Key {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let text = String::deserialize(deserializer)?;
        let idn = text.parse().ok().filter(|idn: &Idn| idn.to_string() == text);
        idn.map(Key).ok_or_else(|| D::Error::custom(format!("'{text}' is no IDN; one reads S-0-0051 or P-0-0019")))
    }
}

impl ParameterFile {
    /// What a drive has.
    pub(crate) fn new(saved_from: Origin, entries: impl IntoIterator<Item = (Idn, Entry)>) -> Self {
        let parameters = entries.into_iter().map(|(idn, entry)| (Key(idn), entry)).collect();
        Self { form: FORM, saved_from, parameters }
    }

    /// The data blocks in ascending order.
    pub(crate) fn entries(&self) -> impl Iterator<Item = (Idn, &Entry)> {
        self.parameters.iter().map(|(key, entry)| (key.0, entry))
    }

    /// One of them.
    pub(crate) fn entry(&self, idn: Idn) -> Option<&Entry> {
        self.parameters.get(&Key(idn))
    }

    /// As it is written.
    pub(crate) fn text(&self) -> Result<String> {
        Ok(format!("{HEAD}{}", toml::to_string(self).context("the parameters cannot be written as TOML")?))
    }

    /// What a text holds.
    ///
    /// # Errors
    /// It is no such file: its line and why, in one line.
    pub(crate) fn of_text(text: &str) -> Result<Self> {
        // Looked at first: another form may have other words.
        let table: toml::Table = toml::from_str(text).map_err(|error| in_its_line(text, &error))?;
        match table.get("form").map(toml::Value::as_integer) {
            Some(Some(form)) if form == i64::from(FORM) => {}
            Some(form) => {
                let form = form.map_or("another".to_owned(), |form| form.to_string());
                bail!("form {form}, expected {FORM}; another version of `cargo xtask parameters` has written it");
            }
            None => bail!("no `form`, so it was not written by `cargo xtask parameters save`"),
        }
        let file: Self = toml::from_str(text).map_err(|error| in_its_line(text, &error))?;
        ensure!(!file.parameters.is_empty(), "it holds no data block");
        Ok(file)
    }

    /// Reads a file.
    ///
    /// # Errors
    /// It is not there, or [`ParameterFile::of_text`].
    pub(crate) fn read(path: &Path) -> Result<Self> {
        let text = std::fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
        Self::of_text(&text).with_context(|| format!("{} is no parameter file", path.display()))
    }
}

fn in_its_line(text: &str, error: &toml::de::Error) -> anyhow::Error {
    let message = crate::cli::one_line(error.message());
    match error.span().and_then(|span| text.get(..span.start)) {
        Some(before) => anyhow!("line {}: {message}", before.matches('\n').count() + 1),
        None => anyhow!("{message}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn entry(name: &str, unit: &str, value: Readable) -> Entry {
        Entry { name: name.to_owned(), unit: unit.to_owned(), value }
    }

    fn one(text: &str) -> Readable {
        Readable::One(text.to_owned())
    }

    fn example() -> ParameterFile {
        let origin = Origin {
            manufacturer_version: "servo 0.1.0".to_owned(),
            controller_type: "SERCOS II slave".to_owned(),
            application_type: "folder \"3\"".to_owned(),
            checksum: "0x1234ABCD".to_owned(),
        };
        let list = Readable::Many(vec!["S-0-0330".to_owned(), "P-0-0019".to_owned()]);
        let entries = [
            (Idn::product(7), entry("Application data", "", Readable::Many(vec![]))),
            (Idn::standard(41), entry("Homing velocity", "rpm", one("100.0000"))),
            (Idn::standard(26), entry("Configuration list for signal status word", "", list)),
        ];
        ParameterFile::new(origin, entries)
    }

    #[test]
    fn a_file_reads_like_this() {
        let text = "\
# Parameters of a drive, written by `cargo xtask parameters save`.
# What counts for `load` are the IDN, the value and its unit; names and the table `saved_from` are for the reader.
form = 1

[saved_from]
manufacturer_version = \"servo 0.1.0\"
controller_type = \"SERCOS II slave\"
application_type = 'folder \"3\"'
checksum = \"0x1234ABCD\"

[parameters.S-0-0026]
name = \"Configuration list for signal status word\"
value = [\"S-0-0330\", \"P-0-0019\"]

[parameters.S-0-0041]
name = \"Homing velocity\"
unit = \"rpm\"
value = \"100.0000\"

[parameters.P-0-0007]
name = \"Application data\"
value = []
";
        assert_eq!(example().text().unwrap(), text);
        assert_eq!(ParameterFile::of_text(text).unwrap(), example());
    }

    #[test]
    fn what_is_no_parameter_file_is_refused_in_one_line_with_its_place() {
        let good = example().text().unwrap();
        for (text, cause) in [
            (String::new(), "no `form`"),
            ("form = 2\n".to_owned(), "form 2, expected 1"),
            ("form = \"1\"\n".to_owned(), "form another, expected 1"),
            ("form = 1\n".to_owned(), "missing field `saved_from`"),
            (good.split("[parameters").next().unwrap().to_owned(), "it holds no data block"),
            (good.replace("\"100.0000\"", "\"100.0000"), "line 18: "),
            (good.replace("\"100.0000\"", "100.0"), "a value is a string in quotes or a list of such strings"),
            (good.replace("S-0-0041", "S-0-41"), "'S-0-41' is no IDN"),
            (good.replace("S-0-0041", "homing"), "'homing' is no IDN"),
            (good.replace("S-0-0041", "S-0-0026"), "line 15: "),
            (good.replace("unit =", "units ="), "unknown field `units`"),
            (good.replace("checksum", "checksun"), "unknown field `checksun`"),
            (good.replace("value = []\n", ""), "missing field `value`"),
        ] {
            let refusal = format!("{:#}", ParameterFile::of_text(&text).unwrap_err());
            assert!(refusal.contains(cause) && !refusal.contains('\n'), "{cause:?} expected in {refusal:?}");
        }
    }

    #[test]
    fn a_number_is_the_same_with_more_zeros_and_not_in_another_unit() {
        let rpm = |text: &str| entry("", "rpm", one(text));
        assert!(rpm("100").says_as(&rpm("100.0000")) && rpm("-1.50").says_as(&rpm("-1.5")));
        assert!(!rpm("100").says_as(&rpm("1000")) && !rpm("100.5").says_as(&rpm("100.05")));
        assert!(!rpm("100").says_as(&entry("", "mm/min", one("100"))));
        assert!(!entry("", "", one("1.0")).says_as(&entry("", "", one("1.00"))), "they may be texts");
        assert!(entry("old name", "", one("0x01")).says_as(&entry("new name", "", one("0x01"))));
    }

    proptest! {
        #[test]
        fn whatever_a_drive_says_comes_back_from_its_file(
            blocks in prop::collection::btree_map(any::<u16>(), (".{0,20}", ".{0,4}", ".{0,20}", prop::collection::vec(".{0,5}", 0..4), any::<bool>()), 1..20),
            origin in ".{0,30}",
        ) {
            let entries = blocks.into_iter().map(|(number, (name, unit, text, items, list))| {
                let value = if list { Readable::Many(items) } else { Readable::One(text) };
                (Idn(number), Entry { name, unit, value })
            });
            let file = ParameterFile::new(Origin { application_type: origin, ..Origin::default() }, entries);
            let text = file.text().unwrap();
            let back = ParameterFile::of_text(&text).unwrap();
            prop_assert_eq!(&back, &file);
            prop_assert_eq!(back.text().unwrap(), text);
        }
    }
}
