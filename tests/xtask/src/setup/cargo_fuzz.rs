//! cargo-fuzz, and the C++ compiler that its libFuzzer is built with.

use super::Installing;
use super::system::PackageManager;
use crate::{Verdict, process, workspace};
use anyhow::{Result, bail};

/// What a user types to install it.
const BY_HAND: &str = "cargo install cargo-fuzz --locked";

/// Finds both, and installs what is missing.
pub(super) fn ensure(installing: Installing) -> Result<()> {
    let mut version = process::cargo();
    version.args(["fuzz", "--version"]).current_dir(workspace::root());
    if process::ask(&mut version).is_none() {
        let missing = "cargo-fuzz is not installed";
        if installing == Installing::Never {
            bail!("{missing}; install it with: {BY_HAND}");
        }
        eprintln!("{missing}; installing it with {BY_HAND}");
        let mut install = process::cargo();
        install.args(["install", "cargo-fuzz", "--locked", "--quiet"]).stdout(std::io::stderr());
        if process::watch(&mut install)? == Verdict::Failed {
            bail!("{missing}, and installing it failed; try by hand: {BY_HAND}");
        }
    }
    if std::env::var_os("CXX").is_none() && process::find("c++").is_none() {
        let missing = "there is no C++ compiler, which libFuzzer is built with";
        PackageManager::of_this_machine().install(&["g++"], missing, installing)?;
    }
    Ok(())
}
