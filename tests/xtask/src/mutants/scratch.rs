//! A copy of the sources, in Cargo's target folder, that may be broken.
//!
//! The user's files are only read. A run that was killed in the middle leaves a broken copy behind, and the next run mends it.

use crate::{process, workspace};
use anyhow::{Context, Result, bail};
use std::collections::BTreeSet;
use std::fs::{self, File, TryLockError};
use std::path::{Path, PathBuf};
use std::process::Command;

/// The copy; nobody else has it as long as this lives.
pub(super) struct Scratch {
    folder: PathBuf,
    _lock: File,
}

impl Scratch {
    /// Copies what has changed since the last time.
    pub(super) fn new() -> Result<Self> {
        let folder = workspace::target_folder()?.join("mutants");
        fs::create_dir_all(&folder).with_context(|| format!("cannot make the folder {}", folder.display()))?;
        let lock = File::create(folder.join("lock")).context("cannot make the lock")?;
        match lock.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => bail!("another `cargo xtask mutants` is at work; wait for its end"),
            Err(TryLockError::Error(error)) => return Err(error).context("cannot lock the copy of the sources"),
        }
        copy(workspace::root(), &folder.join("sources"), &sources()?)?;
        Ok(Self { folder, _lock: lock })
    }

    /// Root of the copy.
    pub(super) fn root(&self) -> PathBuf {
        self.folder.join("sources")
    }

    /// Where something is built from the copy.
    pub(super) fn build_folder(&self, name: &str) -> PathBuf {
        self.folder.join(name)
    }

    /// Begins a build folder with what was built of the user's sources, as long as there is none: foreign packages are not compiled again.
    pub(super) fn begin_with(&self, name: &str, built: &Path) -> Result<()> {
        let folder = self.build_folder(name);
        if folder.exists() || !built.exists() {
            return Ok(());
        }
        // Under another name until it is whole.
        let partial = self.build_folder("partial");
        if partial.exists() {
            fs::remove_dir_all(&partial).with_context(|| format!("cannot remove {}", partial.display()))?;
        }
        copy_with_times(built, &partial)
            .and_then(|()| fs::rename(&partial, &folder))
            .with_context(|| format!("cannot copy {} to {}", built.display(), folder.display()))
    }

    /// Breaks the copy with a patch; the reason, if it does not apply.
    pub(super) fn apply(&self, patch: &Path) -> Result<Result<(), String>> {
        let output = self.git_apply(&[], patch)?;
        let reason = || String::from_utf8_lossy(&output.stderr).lines().next().unwrap_or_default().to_owned();
        Ok(if output.status.success() { Ok(()) } else { Err(reason()) })
    }

    /// Mends it again.
    pub(super) fn undo(&self, patch: &Path) -> Result<()> {
        if !self.git_apply(&["--reverse"], patch)?.status.success() {
            bail!("{} cannot be taken back; start again, which copies the sources anew", patch.display());
        }
        Ok(())
    }

    fn git_apply(&self, arguments: &[&str], patch: &Path) -> Result<std::process::Output> {
        let mut git = Command::new("git");
        git.arg("apply").args(arguments).arg(patch).current_dir(self.root());
        // The copy lies in the user's repository, and is none: without this git looks for the files there.
        git.env("GIT_CEILING_DIRECTORIES", &self.folder);
        git.output().context("cannot start git; install it")
    }
}

/// Copies a folder; the times of the files too, which tell Cargo what is newer than what.
fn copy_with_times(from: &Path, to: &Path) -> std::io::Result<()> {
    fs::create_dir_all(to)?;
    for entry in fs::read_dir(from)? {
        let entry = entry?;
        let (source, copy) = (entry.path(), to.join(entry.file_name()));
        if entry.file_type()?.is_dir() {
            copy_with_times(&source, &copy)?;
        } else {
            fs::copy(&source, &copy)?;
            File::options().write(true).open(&copy)?.set_modified(entry.metadata()?.modified()?)?;
        }
    }
    Ok(())
}

/// What git has, and what it would take: nothing that is built.
fn sources() -> Result<BTreeSet<PathBuf>> {
    let mut git = Command::new("git");
    git.args(["ls-files", "-z", "--cached", "--others", "--exclude-standard"]).current_dir(workspace::root());
    let names =
        process::ask(&mut git).context("`git ls-files` failed; this needs git, and a clone of the repository")?;
    let names = names.split('\0').filter(|name| !name.is_empty());
    Ok(names.map(PathBuf::from).filter(|name| workspace::root().join(name).is_file()).collect())
}

/// Makes `to` what `from` is, without touching what is the same: Cargo goes by the times of the files.
fn copy(from: &Path, to: &Path, names: &BTreeSet<PathBuf>) -> Result<()> {
    for name in names {
        let (source, copy) = (from.join(name), to.join(name));
        let content = fs::read(&source).with_context(|| format!("cannot read {}", source.display()))?;
        if fs::read(&copy).is_ok_and(|present| present == content) {
            continue;
        }
        let parent = copy.parent().context("a file needs a folder")?;
        fs::create_dir_all(parent)
            .and_then(|()| fs::write(&copy, &content))
            .with_context(|| format!("cannot write {}", copy.display()))?;
    }
    remove_others(to, Path::new(""), names)
}

fn remove_others(root: &Path, folder: &Path, names: &BTreeSet<PathBuf>) -> Result<()> {
    let here = root.join(folder);
    for entry in fs::read_dir(&here).with_context(|| format!("cannot read {}", here.display()))? {
        let entry = entry.with_context(|| format!("cannot read {}", here.display()))?;
        let name = folder.join(entry.file_name());
        if entry.file_type().is_ok_and(|kind| kind.is_dir()) {
            remove_others(root, &name, names)?;
        } else if !names.contains(&name) {
            fs::remove_file(root.join(&name)).with_context(|| format!("cannot remove {}", name.display()))?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_copy_is_mended_and_what_is_the_same_keeps_its_time() {
        let [from, to] = [tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap()];
        let names = BTreeSet::from(["a/one.rs".into(), "two.rs".into()]);
        fs::create_dir_all(from.path().join("a")).unwrap();
        fs::write(from.path().join("a/one.rs"), "one").unwrap();
        fs::write(from.path().join("two.rs"), "two").unwrap();
        copy(from.path(), to.path(), &names).unwrap();
        let time = |name: &str| fs::metadata(to.path().join(name)).unwrap().modified().unwrap();
        let before = time("two.rs");
        fs::write(to.path().join("a/one.rs"), "broken").unwrap();
        fs::write(to.path().join("a/three.rs"), "left over").unwrap();
        copy(from.path(), to.path(), &names).unwrap();
        assert_eq!(fs::read_to_string(to.path().join("a/one.rs")).unwrap(), "one");
        assert!(!to.path().join("a/three.rs").exists());
        assert_eq!(time("two.rs"), before);
    }

    #[test]
    fn a_folder_is_copied_with_the_times_of_its_files() {
        let [from, to] = [tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap()];
        fs::create_dir_all(from.path().join("a")).unwrap();
        let time = std::time::SystemTime::UNIX_EPOCH + std::time::Duration::from_secs(1_000_000_000);
        fs::write(from.path().join("a/one"), "one").unwrap();
        File::options().write(true).open(from.path().join("a/one")).unwrap().set_modified(time).unwrap();
        copy_with_times(from.path(), &to.path().join("b")).unwrap();
        let copy = to.path().join("b/a/one");
        assert_eq!(fs::read_to_string(&copy).unwrap(), "one");
        assert_eq!(fs::metadata(copy).unwrap().modified().unwrap(), time);
    }

    #[test]
    fn the_sources_are_those_of_the_repository_and_nothing_that_is_built() {
        let sources = sources().unwrap();
        assert!(sources.contains(Path::new("board/src/bridge.rs")) && sources.contains(Path::new("Cargo.lock")));
        assert!(!sources.iter().any(|name| name.starts_with("target")));
    }
}
