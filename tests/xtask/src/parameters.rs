//! The parameters of a drive as a file that people read and put under version control: saved, loaded, compared, printed.

mod file;
mod link;
mod load;
mod ring_link;
mod table;
mod value;

use crate::progress::PhaseBars;
use crate::report::data::{Platform, Progress};
use crate::report::numbers::counted;
use crate::setup::Installing;
use crate::{Verdict, firmware, workspace};
use anyhow::{Context, Result, bail};
use bench::{DriveSetup, Executor};
use file::{Entry, ParameterFile};
use flash::FlashModel;
use link::{Drive, Failed, Link};
use load::Manner;
use ring_link::RingLink;
use sercos::Idn;
use std::cell::RefCell;
use std::path::{Path, PathBuf};

/// Which drive.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Which {
    /// Where it runs.
    pub(crate) on: Platform,
    /// What it remembers between two commands; `None`: the defaults, and it forgets everything behind the command.
    pub(crate) flash: Option<PathBuf>,
}

/// What is done.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Action {
    /// Into this file.
    Save(PathBuf),
    /// Out of this file.
    Load { file: PathBuf, no_store: bool, skip_unknown: bool },
    /// Of this file with the drive.
    CompareWithDrive(PathBuf),
    /// Of two files, without a drive.
    CompareFiles(PathBuf, PathBuf),
    /// Of these data blocks; none: of all that are saved.
    Print(Vec<Idn>),
}

/// Does it.
pub(crate) fn run(action: &Action, which: &Which, installing: Installing) -> Result<Verdict> {
    if let Action::CompareFiles(one, other) = action {
        let names = [one, other].map(|path| path.display().to_string());
        let files = [ParameterFile::read(one)?, ParameterFile::read(other)?];
        return Ok(show_differences(&files[0], &files[1], &names));
    }
    // Everything that can be known before a drive is started.
    let file = match action {
        Action::Load { file, .. } | Action::CompareWithDrive(file) => Some(ParameterFile::read(file)?),
        _ => None,
    };
    let flash = match &which.flash {
        Some(path) => read_flash(path)?,
        None => DriveSetup::new(1).flash,
    };
    let executor = firmware::executor(which.on, installing)?;
    let done = with_drive(&executor, flash, which.flash.as_deref(), |drive, tell| match (action, &file) {
        (Action::Save(path), _) => save(drive, path, tell),
        (Action::Load { file: path, no_store, skip_unknown }, Some(file)) => {
            let manner = Manner { store: !no_store, skip_unknown: *skip_unknown };
            load_and_tell(drive, file, path, manner, tell)
        }
        (Action::CompareWithDrive(path), Some(file)) => {
            let has = read_all(drive, tell)?;
            Ok(Done::Differences { file: file.clone(), drive: has, name: path.display().to_string() })
        }
        (Action::Print(idns), _) => print(drive, idns, tell),
        _ => bail!("a file is missing"),
    });
    match done {
        Ok(Done::Text(text)) => {
            print!("{text}");
            Ok(Verdict::Passed)
        }
        Ok(Done::Differences { file, drive, name }) => Ok(show_differences(&file, &drive, &[name, "drive".to_owned()])),
        // The run was possible and came to nothing: that is a result.
        Err(error) if error.is::<Failed>() => {
            eprintln!("failed: {}", crate::cli::one_line(&error.to_string()));
            Ok(Verdict::Failed)
        }
        Err(error) => Err(error),
    }
}

/// What a run with a drive leaves to be said.
enum Done {
    Text(String),
    Differences { file: ParameterFile, drive: ParameterFile, name: String },
}

/// Runs a drive up, does something with it, and keeps what it remembers, whatever came of it.
fn with_drive<T>(
    executor: &Executor,
    flash: FlashModel,
    kept_in: Option<&Path>,
    work: impl FnOnce(&mut Drive<RingLink>, load::Tell<'_>) -> Result<T>,
) -> Result<T> {
    let bars = RefCell::new(PhaseBars::new());
    let show = |phase: u8, time_us: u64, what: String| {
        bars.borrow_mut().show(&Progress { phase, what, done: 0, of: 0, time_us });
    };
    let link = RingLink::run_up(executor, flash, &mut |phase, time_us| {
        let what = ["closing the ring", "looking for the drive", "service channel"].get(usize::from(phase));
        show(phase, time_us, what.copied().unwrap_or_default().to_owned());
    });
    let done = link.and_then(|link| {
        let mut drive = Drive::new(link);
        let done = work(&mut drive, &mut |time_us, what, done, of| {
            let what = if of > 0 { format!("{what}, {done} of {of}") } else { what.to_owned() };
            show(2, time_us, what);
        });
        if let Some(path) = kept_in {
            let kept = workspace::write_beside(path, drive.link().flash().contents());
            kept.with_context(|| format!("what the drive has saved is lost: cannot write {}", path.display()))?;
        }
        done
    });
    bars.borrow_mut().finish();
    done
}

fn read_flash(path: &Path) -> Result<FlashModel> {
    let contents = match std::fs::read(path) {
        Ok(contents) => contents,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(FlashModel::new()),
        Err(error) => return Err(error).with_context(|| format!("cannot read {}", path.display())),
    };
    if contents.len() != flash::CAPACITY {
        bail!(
            "{} has {} bytes, the flash of a drive {}; give --flash a file that it has written, or a new name",
            path.display(),
            contents.len(),
            flash::CAPACITY
        );
    }
    FlashModel::with_contents(&contents).context("the contents do not fit into the flash")
}

/// Everything that the drive keeps, as a file.
fn read_all<L: Link>(drive: &mut Drive<L>, tell: load::Tell<'_>) -> Result<ParameterFile> {
    let kept = drive.backup_list()?;
    let origin = drive.origin()?;
    Ok(ParameterFile::new(origin, entries(drive, &kept, tell)?))
}

fn entries<L: Link>(drive: &mut Drive<L>, idns: &[Idn], tell: load::Tell<'_>) -> Result<Vec<(Idn, Entry)>> {
    let mut entries = Vec::new();
    for (index, idn) in idns.iter().enumerate() {
        tell(drive.link().time_us(), "reading", index + 1, idns.len());
        entries.push((*idn, drive.must_describe(*idn, true)?.entry()?));
    }
    Ok(entries)
}

fn save<L: Link>(drive: &mut Drive<L>, path: &Path, tell: load::Tell<'_>) -> Result<Done> {
    let file = read_all(drive, tell)?;
    workspace::write_beside(path, file.text()?)?;
    let blocks = counted(file.entries().count() as u64, "data block");
    Ok(Done::Text(format!("saved: {blocks}, checksum {}, in {}\n", file.saved_from.checksum, path.display())))
}

fn load_and_tell<L: Link>(
    drive: &mut Drive<L>,
    file: &ParameterFile,
    path: &Path,
    manner: Manner,
    tell: load::Tell<'_>,
) -> Result<Done> {
    let loaded = load::load(drive, file, manner, tell)?;
    let count = |number: usize| counted(number as u64, "data block");
    let mut text = String::new();
    for idn in &loaded.written {
        let entry = file.entry(*idn);
        let said = entry.map(|entry| format!("{} = {}", entry.name, entry.quantity())).unwrap_or_default();
        text += &format!("written: {idn} {said}\n");
    }
    for idn in &loaded.skipped {
        let name = file.entry(*idn).map_or("", |entry| &entry.name);
        text += &format!("left out: {idn} {name}, which the drive does not keep\n");
    }
    if loaded.left > 0 {
        text += &format!("left as they are: {} that the file does not have\n", count(loaded.left));
    }
    let stored = if manner.store { "saved with S-0-0264" } else { "not saved" };
    text += &format!(
        "loaded: {} of {}, {} written, {} alike; checksum {}, {}; {stored}\n",
        loaded.common,
        path.display(),
        loaded.written.len(),
        loaded.common - loaded.written.len(),
        loaded.checksum,
        if loaded.checksum == file.saved_from.checksum { "as in the file" } else { "another than in the file" },
    );
    Ok(Done::Text(text))
}

fn print<L: Link>(drive: &mut Drive<L>, idns: &[Idn], tell: load::Tell<'_>) -> Result<Done> {
    let idns = if idns.is_empty() { drive.backup_list()? } else { idns.to_vec() };
    Ok(Done::Text(table::of_entries(&entries(drive, &idns, tell)?)))
}

fn show_differences(one: &ParameterFile, other: &ParameterFile, names: &[String; 2]) -> Verdict {
    let differences = table::differences(one, other);
    if differences.is_empty() {
        println!("no difference in {}", counted(one.entries().count() as u64, "data block"));
        return Verdict::Passed;
    }
    print!("{}", table::of_differences(&differences, names.each_ref().map(String::as_str)));
    Verdict::Failed
}

#[cfg(test)]
mod tests;
