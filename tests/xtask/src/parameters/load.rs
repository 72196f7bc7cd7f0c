//! Loading: only what differs is written (of a drive that was never told anything, all), everything is read back, and what is refused leaves nothing half done.
//!
//! Scaling and mechanics come first, because numbers in a unit have a meaning only under them; a drive expresses what it is not told in the
//! new increments, so the rest is looked at behind them. Within each half the order is that of the IDNs: a drive takes any.

use super::file::{Entry, ParameterFile};
use super::link::{Described, Drive, Failed, Link, Refusal};
use super::value::Readable;
use anyhow::Result;
use drive::NO_SAVED_PARAMETERS;
use ring::ident::Value;
use sercos::Idn;
use sercos::attribute::Attribute;
use std::collections::BTreeSet;

const DIAGNOSTIC: Idn = Idn::standard(390);
/// P-0-0014.
const NOT_RESTORED: Idn = Idn::product(14);
const LOAD_DEFAULTS: Idn = Idn::standard(262);
const LOAD_SAVED: Idn = Idn::standard(263);
const SAVE: Idn = Idn::standard(264);
/// 0: the drive keeps every write by itself, so that S-0-0263 would bring back half a file.
const STORAGE_MODE: Idn = Idn::standard(269);
const KEEPS_NOTHING: Value = Value::Word(1);

/// Scaling types, factors and exponents; gear, feed constant, stall current and torque constant (P-0-0114). None of them has a unit of the
/// scaling itself, as the modulo value S-0-0103 has.
const SCALING: [u16; 18] =
    [44, 45, 46, 76, 77, 78, 79, 86, 93, 94, 111, 121, 122, 123, 160, 161, 162, Idn::product(114).0];

/// What is to be done beside writing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Manner {
    /// S-0-0264 in the end.
    pub(crate) store: bool,
    /// Data blocks that the drive does not keep are left out.
    pub(crate) skip_unknown: bool,
}

/// What was done.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Loaded {
    /// Written and read back.
    pub(crate) written: BTreeSet<Idn>,
    /// How many are in the file and on the drive.
    pub(crate) common: usize,
    /// In the file, and not kept by the drive.
    pub(crate) skipped: Vec<Idn>,
    /// How many the drive keeps that are not in the file.
    pub(crate) left: usize,
    /// S-0-0326 behind it.
    pub(crate) checksum: String,
}

/// How far it is: time in us, what is done, how much of it, of how much.
pub(crate) type Tell<'a> = &'a mut dyn FnMut(u64, &str, usize, usize);

/// Loads a file into a drive.
///
/// # Errors
/// [`Failed`]: the first thing that the drive refuses, or that does not read back, and what the drive has then. Any other: the ring does not
/// go on.
pub(crate) fn load<L: Link>(
    drive: &mut Drive<L>,
    file: &ParameterFile,
    manner: Manner,
    tell: Tell<'_>,
) -> Result<Loaded> {
    let kept: BTreeSet<Idn> = drive.backup_list()?.into_iter().collect();
    let (common, unknown): (Vec<_>, Vec<_>) = file.entries().partition(|(idn, _)| kept.contains(idn));
    if !unknown.is_empty() && !manner.skip_unknown {
        let named: Vec<String> = unknown.iter().map(|(idn, entry)| format!("{idn} \"{}\"", entry.name)).collect();
        return Err(Failed(format!(
            "the drive does not keep {} (not in its S-0-0192); nothing was written; --skip-unknown leaves them out",
            named.join(", ")
        ))
        .into());
    }
    let untold = untold(drive, &kept)?;
    let mut loading = Loading { drive, tell, untold, written: BTreeSet::new() };
    if let Err(error) = loading.all(&common, manner.store) {
        return Err(if error.is::<Failed>() { loading.undo(&error)? } else { error });
    }
    Ok(Loaded {
        written: loading.written,
        common: common.len(),
        skipped: unknown.into_iter().map(|(idn, _)| idn).collect(),
        left: kept.len() - common.len(),
        checksum: drive.checksum()?,
    })
}

/// Data blocks whose value nobody has told the drive: a default that is equal is written all the same, or S-0-0128 asks for it.
fn untold<L: Link>(drive: &mut Drive<L>, kept: &BTreeSet<Idn>) -> Result<BTreeSet<Idn>> {
    if drive.value(DIAGNOSTIC)?.as_number() == Some(NO_SAVED_PARAMETERS.into()) {
        return Ok(kept.clone());
    }
    let Value::Bytes(bytes) = drive.value(NOT_RESTORED)? else { return Ok(BTreeSet::new()) };
    Ok(bytes.chunks_exact(2).map(|pair| Idn(u16::from_le_bytes([pair[0], pair[1]]))).collect())
}

struct Loading<'a, L> {
    drive: &'a mut Drive<L>,
    tell: Tell<'a>,
    untold: BTreeSet<Idn>,
    written: BTreeSet<Idn>,
}

/// A data block with what it is to be.
struct Wanted<'a> {
    idn: Idn,
    entry: &'a Entry,
    attribute: Attribute,
    value: Value,
}

impl<L: Link> Loading<'_, L> {
    fn all(&mut self, common: &[(Idn, &Entry)], store: bool) -> Result<()> {
        let mode = common.iter().find(|(idn, _)| *idn == STORAGE_MODE);
        let rest = common.iter().filter(|(idn, _)| *idn != STORAGE_MODE);
        let (scaling, others): (Vec<_>, Vec<_>) = rest.partition(|(idn, _)| SCALING.contains(&idn.0));
        let before = self.keep_nothing()?;
        let mut wanted = self.write_what_differs(&scaling)?;
        wanted.extend(self.write_what_differs(&others)?);
        self.read_back(wanted)?;
        self.set_mode(mode.map(|(_, entry)| *entry), before)?;
        if store {
            self.tell("saving with S-0-0264", 0, 0);
            self.drive.command(SAVE)?.map_err(|refusal| Failed(format!("{SAVE} (save): {refusal}")))?;
        }
        Ok(())
    }

    /// From here on nothing is kept that was not saved with S-0-0264; the storage mode as it was, where there is one.
    fn keep_nothing(&mut self) -> Result<Option<Described>> {
        let mode = self.drive.describe(STORAGE_MODE, false)?;
        if mode.as_ref().is_some_and(|mode| mode.value != KEEPS_NOTHING) {
            let written = self.drive.write(STORAGE_MODE, KEEPS_NOTHING)?;
            written.map_err(|refusal| Failed(format!("{STORAGE_MODE} = {KEEPS_NOTHING}: {refusal}")))?;
            self.written.insert(STORAGE_MODE);
        }
        Ok(mode)
    }

    /// The storage mode is as the file says, or as it was.
    fn set_mode(&mut self, entry: Option<&Entry>, before: Option<Described>) -> Result<()> {
        let Some(before) = before else { return Ok(()) };
        self.written.remove(&STORAGE_MODE);
        let as_it_was = before.entry()?;
        let entry = entry.unwrap_or(&as_it_was);
        let value = transmitted(&before, entry)?;
        let differs = value != before.value;
        if value != KEEPS_NOTHING {
            self.write(&Wanted { idn: STORAGE_MODE, entry, attribute: before.attribute, value })?;
        }
        // What was there all the time counts as not written.
        if differs {
            self.written.insert(STORAGE_MODE)
        } else {
            self.written.remove(&STORAGE_MODE)
        };
        Ok(())
    }

    fn write_what_differs<'e>(&mut self, entries: &[&(Idn, &'e Entry)]) -> Result<Vec<Wanted<'e>>> {
        let mut all = Vec::new();
        let mut different = Vec::new();
        for (index, (idn, entry)) in entries.iter().enumerate() {
            self.tell("looking for what differs", index + 1, entries.len());
            let described = self.drive.must_describe(*idn, false)?;
            let value = transmitted(&described, entry)?;
            if value != described.value || self.untold.contains(idn) {
                different.push(index);
            }
            all.push(Wanted { idn: *idn, entry, attribute: described.attribute, value });
        }
        for (done, index) in different.iter().enumerate() {
            self.tell("writing what differs", done + 1, different.len());
            self.write(&all[*index])?;
        }
        Ok(all)
    }

    fn write(&mut self, wanted: &Wanted<'_>) -> Result<()> {
        let taken = self.drive.write(wanted.idn, wanted.value.clone())?;
        taken.map_err(|refusal: Refusal| Failed(format!("{}: {refusal}", said(wanted.idn, wanted.entry))))?;
        self.written.insert(wanted.idn);
        Ok(())
    }

    /// What the drive has changed behind a write of something else is written; what was written and does not stand is an error.
    fn read_back(&mut self, mut wanted: Vec<Wanted<'_>>) -> Result<()> {
        while !wanted.is_empty() {
            let mut moved = Vec::new();
            let of = wanted.len();
            for (index, one) in wanted.iter().enumerate() {
                self.tell("reading back", index + 1, of);
                let found = self.drive.value(one.idn)?;
                if found == one.value {
                    continue;
                }
                if self.written.contains(&one.idn) {
                    let found = Readable::of(&found, one.attribute).map_or_else(|cause| cause, |it| it.to_string());
                    return Err(Failed(format!("{} reads back as {found}", said(one.idn, one.entry))).into());
                }
                moved.push(index);
            }
            for index in &moved {
                self.write(&wanted[*index])?;
            }
            if moved.is_empty() {
                wanted.clear();
            }
        }
        Ok(())
    }

    /// Brings back what there was; the cause with what has become of it.
    fn undo(&mut self, cause: &anyhow::Error) -> Result<anyhow::Error> {
        if self.written.is_empty() {
            return Ok(Failed(format!("{cause}; nothing was written")).into());
        }
        self.tell("bringing back what was saved", 0, 0);
        let outcome = match self.drive.command(LOAD_SAVED)? {
            Ok(()) => "S-0-0263 has brought back what was saved".to_owned(),
            Err(refusal) => match self.drive.command(LOAD_DEFAULTS)? {
                Ok(()) => "S-0-0263 brings nothing back, so S-0-0262 has brought the defaults".to_owned(),
                Err(_) => format!(
                    "S-0-0263 does not bring back what was saved ({refusal}): {} data blocks stay written until the supply goes",
                    self.written.len()
                ),
            },
        };
        Ok(Failed(format!("{cause}; {outcome}")).into())
    }

    fn tell(&mut self, what: &str, done: usize, of: usize) {
        (self.tell)(self.drive.link().time_us(), what, done, of);
    }
}

/// `S-0-0041 "Homing velocity" = 100.0000 rpm`.
fn said(idn: Idn, entry: &Entry) -> String {
    format!("{idn} \"{}\" = {}", entry.name, entry.quantity())
}

fn transmitted(described: &Described, entry: &Entry) -> Result<Value> {
    let idn = described.idn;
    if entry.unit != described.unit {
        let unit = if described.unit.is_empty() { "no unit" } else { &described.unit };
        return Err(Failed(format!("{}: with its scaling the drive has {unit} here", said(idn, entry))).into());
    }
    let value = entry.value.transmitted(described.attribute);
    Ok(value.map_err(|cause| Failed(format!("{}: {cause}", said(idn, entry))))?)
}
