//! Set-up: finds what the other commands need, installs what is missing, and says so before it does.
//!
//! Nothing that is there already is fetched again, so that a second run takes a fraction of a second.

mod cargo_fuzz;
mod cargo_mutants;
mod qemu;
mod system;
mod target;

pub(crate) use target::{TARGET, TargetCompiler};

use crate::{Verdict, process, workspace};
use anyhow::Result;

/// May something be installed?
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Installing {
    /// Yes, after saying what.
    Allowed,
    /// No: where something is missing, the command that installs it is the error.
    Never,
}

/// What runs the tests.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum TestRunner {
    /// cargo-nextest: all tests side by side, one summary.
    Nextest,
    /// `cargo test`, where nextest is not installed.
    CargoTest,
}

/// Sees to everything and prints what was found.
pub(crate) fn everything(installing: Installing) -> Result<Verdict> {
    let compiler = target_compiler(installing)?;
    println!("target     {TARGET}: {compiler}");
    let version = qemu(installing)?;
    println!("emulator   QEMU {version}");
    let runner = match test_runner() {
        TestRunner::Nextest => "cargo-nextest",
        TestRunner::CargoTest => "cargo test (cargo-nextest is faster: `cargo install cargo-nextest --locked`)",
    };
    println!("tests      {runner}");
    let probe = match process::find("probe-rs") {
        Some(_) => "probe-rs",
        None => "probe-rs is not installed; only `cargo xtask flash` needs it",
    };
    println!("hardware   {probe}");
    Ok(Verdict::Passed)
}

/// Sees to QEMU and gives its version.
pub(crate) fn qemu(installing: Installing) -> Result<qemu::Version> {
    qemu::ensure(installing)
}

/// Sees to a compiler for the drive's processor.
pub(crate) fn target_compiler(installing: Installing) -> Result<TargetCompiler> {
    target::ensure(installing)
}

/// Sees to cargo-fuzz and what it needs.
pub(crate) fn fuzzer(installing: Installing) -> Result<()> {
    cargo_fuzz::ensure(installing)
}

/// Sees to cargo-mutants.
pub(crate) fn mutation_tester(installing: Installing) -> Result<()> {
    cargo_mutants::ensure(installing)
}

/// The test runner that is there. nextest is a convenience, so it is not installed unasked.
pub(crate) fn test_runner() -> TestRunner {
    let mut nextest = process::cargo();
    nextest.args(["nextest", "--version"]).current_dir(workspace::root());
    match process::ask(&mut nextest) {
        Some(_) => TestRunner::Nextest,
        None => TestRunner::CargoTest,
    }
}
