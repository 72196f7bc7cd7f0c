//! Where the repository and Cargo's target folder are.

use crate::{Verdict, process};
use anyhow::{Context, Result, bail};
use std::path::{Path, PathBuf};

/// The root of the repository.
pub(crate) fn root() -> &'static Path {
    let manifest = Path::new(env!("CARGO_MANIFEST_DIR"));
    manifest.ancestors().nth(2).unwrap_or(manifest)
}

/// Cargo's target folder, wherever the user's configuration puts it.
pub(crate) fn target_folder() -> Result<PathBuf> {
    let mut command = process::cargo();
    command.args(["metadata", "--no-deps", "--format-version", "1"]).current_dir(root());
    let answer = process::ask(&mut command)
        .with_context(|| format!("`{}` failed; run it by hand to see why", process::words(&command)))?;
    let metadata: serde_json::Value = serde_json::from_str(&answer).context("Cargo's metadata cannot be read")?;
    let folder = metadata["target_directory"].as_str().context("Cargo's metadata names no target folder")?;
    Ok(folder.into())
}

/// Builds a part of a package of this computer as the tests have it, and gives its place.
///
/// This program is asked for beside it, so that both want the same features of what they share and Cargo compiles nothing twice.
pub(crate) fn build_like_tests(package: &str, part: &[&str], name: &str) -> Result<PathBuf> {
    let mut cargo = process::cargo();
    cargo.current_dir(root()).args(["build", "--quiet", "--package", package, "--package", "xtask"]).args(part);
    if process::watch(cargo.stdout(std::io::stderr()))? == Verdict::Failed {
        bail!("the package `{package}` does not build; the compiler's messages above say why");
    }
    let built = target_folder()?.join("debug").join(name);
    if !built.is_file() {
        bail!("the build of `{package}` left nothing at {}", built.display());
    }
    Ok(built)
}

/// Writes a file so that it is there completely or not at all.
///
/// # Errors
/// The folder cannot be made, or the file not be written; nothing is left behind then.
pub(crate) fn write_whole(path: &Path, content: &(impl AsRef<[u8]> + ?Sized)) -> Result<()> {
    let folder = path.parent().context("a file needs a folder")?;
    std::fs::create_dir_all(folder).with_context(|| format!("cannot make the folder {}", folder.display()))?;
    let partial = path.with_extension("partial");
    let written = std::fs::write(&partial, content).and_then(|()| std::fs::rename(&partial, path));
    if written.is_err() {
        // Best effort: the write's own error is the one to report.
        let _ = std::fs::remove_file(&partial);
    }
    written.with_context(|| format!("cannot write {}", path.display()))
}

/// The same for a path of the user's: a name alone lies in the present folder.
///
/// # Errors
/// As [`write_whole`].
pub(crate) fn write_beside(path: &Path, content: &(impl AsRef<[u8]> + ?Sized)) -> Result<()> {
    let beside = path.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
    write_whole(&beside.join(path.file_name().with_context(|| format!("{} names no file", path.display()))?), content)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_root_holds_the_workspace() {
        let manifest = std::fs::read_to_string(root().join("Cargo.toml")).unwrap();
        assert!(manifest.contains("[workspace]"));
    }

    #[test]
    fn a_file_that_cannot_be_written_leaves_nothing_behind() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("page.html");
        // A folder that is not empty stands where the file should go: the rename fails.
        std::fs::create_dir_all(path.join("inside")).unwrap();
        assert!(write_whole(&path, "text").is_err());
        let left: Vec<_> = std::fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().file_name()).collect();
        assert_eq!(left, ["page.html"]);
    }

    #[test]
    fn a_written_file_replaces_the_old_one_and_leaves_no_partial() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("new/page.html");
        write_whole(&path, "old").unwrap();
        write_whole(&path, "new").unwrap();
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "new");
        assert_eq!(std::fs::read_dir(path.parent().unwrap()).unwrap().count(), 1);
    }
}
