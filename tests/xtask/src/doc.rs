//! The documentation of every crate, warnings denied.

use crate::setup::{self, Installing};
use crate::{Verdict, process, workspace};
use anyhow::Result;

/// Crates that exist only for the target.
const TARGET_CRATES: [&str; 2] = ["app", "board"];

/// Makes the pages of the host crates, then those of the target's.
pub(crate) fn run(installing: Installing) -> Result<Verdict> {
    let mut host = process::cargo();
    host.current_dir(workspace::root()).args(["doc", "--no-deps", "--quiet"]);
    if process::watch(host.env("RUSTDOCFLAGS", "--deny warnings"))? == Verdict::Failed {
        return Ok(Verdict::Failed);
    }
    let mut target = setup::target_compiler(installing)?.cargo("doc");
    target.args(["--no-deps", "--quiet"]);
    for package in TARGET_CRATES {
        target.args(["--package", package]);
    }
    process::watch(target.env("RUSTDOCFLAGS", "--deny warnings"))
}
