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
    // Not all targets: there is no test harness for the target.
    target.args(["--lib", "--bins", "--examples", "--", "--deny", "warnings"]);
    process::watch(&mut target)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::process::{Command, Output};

    /// A library of this source, compiled as `.ci/run` has it done.
    fn compiled(source: &str, lint: &str) -> (Output, bool) {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("lib.rs");
        std::fs::write(&file, source).unwrap();
        let mut command = Command::new(workspace::root().join(".ci/rustc-and-clippy"));
        command.args([
            "rustc",
            "--crate-name",
            "some",
            "--edition=2024",
            "--crate-type",
            "lib",
            "--emit=metadata,link",
        ]);
        command.arg(&file).arg("--out-dir").arg(folder.path()).env("LINT", lint);
        let output = command.current_dir(folder.path()).output().unwrap();
        (output, folder.path().join("libsome.rlib").is_file())
    }

    #[test]
    fn what_clippy_finds_does_not_compile_in_ci_and_what_is_broken_on_purpose_does() {
        if process::find("clippy-driver").is_none() {
            eprintln!("clippy is not installed");
            return;
        }
        let (clean, built) = compiled("pub fn same(x: u32) -> u32 { x }", "on");
        assert!(clean.status.success() && built, "{clean:?}");
        let found = "pub fn same(x: u32) -> u32 { return x; }";
        let (denied, _) = compiled(found, "on");
        let words = String::from_utf8_lossy(&denied.stderr);
        assert!(!denied.status.success() && words.contains("needless_return"), "{words}");
        let (let_through, built) = compiled(found, "off");
        assert!(let_through.status.success() && built, "{let_through:?}");
    }
}
