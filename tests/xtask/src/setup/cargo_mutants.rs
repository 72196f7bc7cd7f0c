//! cargo-mutants, of the version that the list of survivors was made with: another one makes other mutants.

use super::Installing;
use crate::{Verdict, process, workspace};
use anyhow::{Result, bail};

/// What a user types to install it.
const BY_HAND: &str = "cargo install cargo-mutants --locked --version 27.1.0";
/// What it says then.
const VERSION: &str = "cargo-mutants 27.1.0";

/// Finds it, or installs it.
pub(super) fn ensure(installing: Installing) -> Result<()> {
    let mut version = process::cargo();
    version.args(["mutants", "--version"]).current_dir(workspace::root());
    let missing = match process::ask(&mut version) {
        Some(version) if version == VERSION => return Ok(()),
        Some(other) => format!("{other} is installed, and {VERSION} is needed"),
        None => "cargo-mutants is not installed".to_owned(),
    };
    if installing == Installing::Never {
        bail!("{missing}; install it with: {BY_HAND}");
    }
    eprintln!("{missing}; installing it with {BY_HAND}");
    let mut install = process::cargo();
    install.args(BY_HAND.split(' ').skip(1)).arg("--quiet").stdout(std::io::stderr());
    if process::watch(&mut install)? == Verdict::Failed {
        bail!("{missing}, and installing it failed; try by hand: {BY_HAND}");
    }
    Ok(())
}
