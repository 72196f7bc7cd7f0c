//! Clippy over everything, warnings denied.

use crate::setup::{self, Installing};
use crate::{Verdict, process, workspace};
use anyhow::Result;

/// Crates that exist only for the target.
const TARGET_CRATES: [&str; 2] = ["app", "board"];

/// Checks the host crates, then the target's.
pub(crate) fn run(installing: Installing) -> Result<Verdict> {
    let mut host = process::cargo();
    host.current_dir(workspace::root()).args(["clippy", "--all-targets", "--", "--deny", "warnings"]);
    if process::watch(&mut host)? == Verdict::Failed {
        return Ok(Verdict::Failed);
    }
    let compiler = setup::target_compiler(installing)?;
    if !compiler.has_clippy() {
        eprintln!("the compiler for the target comes without clippy: {} are not checked", TARGET_CRATES.join(", "));
        return Ok(Verdict::Passed);
    }
    let mut target = compiler.cargo("clippy");
    for package in TARGET_CRATES {
        target.args(["--package", package]);
    }
    target.args(["--", "--deny", "warnings"]);
    process::watch(&mut target)
}
