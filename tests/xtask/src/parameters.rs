//! The parameters of a drive as a file that people read and put under version control: saved, loaded, compared, printed.

mod arguments;
mod file;
mod link;
mod load;
mod ring_link;
mod table;
mod value;

pub(crate) use arguments::ParametersCommand;

use crate::progress::PhaseBars;
use crate::report::data::{Platform, Progress};
use crate::report::numbers::counted;
use crate::setup::Installing;
use crate::{Verdict, firmware, workspace};
use anyhow::{Context, Result, bail};
use bench::{DriveSetup, Executor, Works};
use file::ParameterFile;
use flash::FlashModel;
use link::{Described, Drive, Failed, Link};
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
    /// Data sheet of its amplifier; `None`: that of the board as it comes.
    pub(crate) identity: Option<PathBuf>,
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

/// What was done, for the user.
struct Done {
    text: String,
    verdict: Verdict,
}

/// What is done with a drive that has been run up.
type Work<'a> = &'a mut dyn FnMut(&mut Drive<RingLink>, load::Tell<'_>) -> Result<Done>;

/// Does it.
pub(crate) fn run(action: &Action, which: &Which, installing: Installing) -> Result<Verdict> {
    match act(action, which, installing) {
        Ok(Done { text, verdict }) => {
            print!("{text}");
            Ok(verdict)
        }
        // The run was possible and came to nothing: that is a result.
        Err(error) if error.is::<Failed>() => {
            eprintln!("failed: {}", crate::cli::one_line(&error.to_string()));
            Ok(Verdict::Failed)
        }
        Err(error) => Err(error),
    }
}

/// The files are looked at before anything is built or started.
fn act(action: &Action, which: &Which, installing: Installing) -> Result<Done> {
    let with_drive = |work: Work<'_>| {
        let kept_in = which.flash.as_deref();
        let flash = kept_in.map_or_else(|| Ok(DriveSetup::new(1).flash), read_flash)?;
        let works = which
            .identity
            .as_deref()
            .map_or(Ok(Works::Blank), |path| crate::identity::read(path).map(Works::Written))?;
        let setup = DriveSetup { flash, works, ..DriveSetup::catalogue(ring_link::ADDRESS) };
        with_drive(&firmware::executor(which.on, installing)?, setup, kept_in, work)
    };
    match action {
        Action::Save(path) => with_drive(&mut |drive, tell| save(drive, path, tell)),
        Action::Load { file: path, no_store, skip_unknown } => {
            let file = ParameterFile::read(path)?;
            let manner = Manner { store: !no_store, skip_unknown: *skip_unknown };
            with_drive(&mut |drive, tell| load_and_tell(drive, &file, path, manner, tell))
        }
        Action::CompareWithDrive(path) => {
            let file = ParameterFile::read(path)?;
            with_drive(&mut |drive, tell| {
                let has = read_like(drive, &file, tell)?;
                Ok(differences(&file, &has, [&path.display().to_string(), "drive"]))
            })
        }
        Action::CompareFiles(one, other) => {
            let files = [ParameterFile::read(one)?, ParameterFile::read(other)?];
            Ok(differences(&files[0], &files[1], [&one.display().to_string(), &other.display().to_string()]))
        }
        Action::Print(idns) => with_drive(&mut |drive, tell| print(drive, idns, tell)),
    }
}

/// Runs a drive up, does something with it, and keeps what it remembers, whatever came of it.
fn with_drive(executor: &Executor, setup: DriveSetup, kept_in: Option<&Path>, work: Work<'_>) -> Result<Done> {
    let bars = RefCell::new(PhaseBars::new());
    let show = |phase: u8, time_us: u64, what: String| {
        bars.borrow_mut().show(&Progress { phase, what, done: 0, of: 0, time_us });
    };
    let link = RingLink::run_up(executor, setup, &mut |phase, time_us| {
        let what = if phase == 0 { "closing the ring" } else { "looking for the drive" };
        show(phase, time_us, what.to_owned());
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
    let entries = described(drive, &kept, tell)?.into_iter().map(|block| Ok((block.idn, block.entry()?)));
    Ok(ParameterFile::new(origin, entries.collect::<Result<Vec<_>>>()?))
}

/// The same in the words of another file, where they mean what the drive has: `0x2` for `0x0002`.
fn read_like<L: Link>(drive: &mut Drive<L>, file: &ParameterFile, tell: load::Tell<'_>) -> Result<ParameterFile> {
    let kept = drive.backup_list()?;
    let origin = drive.origin()?;
    let entries = described(drive, &kept, tell)?.into_iter().map(|block| {
        let entry = block.entry()?;
        let same = file.entry(block.idn).filter(|filed| {
            filed.unit == entry.unit && filed.value.transmitted(block.attribute).as_ref() == Ok(&block.value)
        });
        Ok((block.idn, same.cloned().unwrap_or(entry)))
    });
    Ok(ParameterFile::new(origin, entries.collect::<Result<Vec<_>>>()?))
}

fn described<L: Link>(drive: &mut Drive<L>, idns: &[Idn], tell: load::Tell<'_>) -> Result<Vec<Described>> {
    let mut blocks = Vec::new();
    for (index, idn) in idns.iter().enumerate() {
        tell(drive.link().time_us(), "reading", index + 1, idns.len());
        blocks.push(drive.must_describe(*idn, true)?);
    }
    Ok(blocks)
}

fn save<L: Link>(drive: &mut Drive<L>, path: &Path, tell: load::Tell<'_>) -> Result<Done> {
    let file = read_all(drive, tell)?;
    workspace::write_beside(path, &file.text()?)?;
    let blocks = counted(file.entries().count() as u64, "data block");
    let text = format!("saved: {blocks}, checksum {}, in {}\n", file.saved_from.checksum, path.display());
    Ok(Done { text, verdict: Verdict::Passed })
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
    Ok(Done { text, verdict: Verdict::Passed })
}

fn print<L: Link>(drive: &mut Drive<L>, idns: &[Idn], tell: load::Tell<'_>) -> Result<Done> {
    let overview = idns.is_empty();
    let idns = if overview { drive.backup_list()? } else { idns.to_vec() };
    let entries = described(drive, &idns, tell)?.into_iter().map(|block| Ok((block.idn, block.entry()?)));
    let text = table::of_entries(&entries.collect::<Result<Vec<_>>>()?, overview);
    Ok(Done { text, verdict: Verdict::Passed })
}

fn differences(one: &ParameterFile, other: &ParameterFile, names: [&str; 2]) -> Done {
    let differences = table::differences(one, other);
    if differences.is_empty() {
        let text = format!("no difference in {}\n", counted(one.entries().count() as u64, "data block"));
        return Done { text, verdict: Verdict::Passed };
    }
    Done { text: table::of_differences(&differences, names), verdict: Verdict::Failed }
}

#[cfg(test)]
mod tests;
