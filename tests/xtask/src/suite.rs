//! The tests, all of them in one run of one test runner.
//!
//! Tests that need QEMU and the ELF are marked `#[ignore]`, so that a plain `cargo test` works anywhere; they find the
//! programs by the variables `PRODUCT_ELF`, `BUS_PLUGIN` and, the trial of the board's flash, `FLASH_ELF`, which are set here. Nothing else may be marked so.

use crate::firmware;
use crate::setup::{self, Installing, TestRunner};
use crate::{Verdict, process, workspace};
use anyhow::{Context, Result};
use std::process::Command;
use std::thread;

/// Which tests to run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Selection {
    /// Those that run on this computer.
    Host,
    /// Those that run the ELF in QEMU.
    Qemu,
    /// Both.
    All,
}

impl Selection {
    /// No flag means everything.
    pub(crate) fn from_flags(host: bool, qemu: bool) -> Self {
        match (host, qemu) {
            (true, false) => Self::Host,
            (false, true) => Self::Qemu,
            _ => Self::All,
        }
    }
}

/// Where tests that found no recording of a real master leave their names (`tests/recordings/find.rs`).
const SKIPPED: &str = "SKIPPED_RECORDINGS";

/// Runs the tests; the last things printed are the test runner's own summary and what was skipped.
pub(crate) fn run(selection: Selection, installing: Installing) -> Result<Verdict> {
    let runner = setup::test_runner();
    let mut tests = tests(runner, selection);
    if selection != Selection::Host {
        let version = setup::qemu(installing)?;
        eprintln!("QEMU {version}");
        // The linker of the ELF keeps one core busy for long, the tests' programs keep the others.
        let firmware = thread::scope(|scope| {
            let firmware = scope.spawn(|| {
                let firmware = firmware::build(installing)?;
                Ok::<_, anyhow::Error>((firmware, firmware::build_flash_trial(installing)?))
            });
            let compiled = process::watch(&mut compilation(runner));
            let firmware = firmware.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))?;
            Ok::<_, anyhow::Error>((compiled? == Verdict::Passed).then_some(firmware))
        })?;
        let Some((firmware, flash_trial)) = firmware else { return Ok(Verdict::Failed) };
        tests.env("PRODUCT_ELF", firmware.product).env("BUS_PLUGIN", firmware.bus).env("FLASH_ELF", flash_trial);
    }
    if selection != Selection::Qemu && process::watch(&mut examples_in_documentation())? == Verdict::Failed {
        return Ok(Verdict::Failed);
    }
    let skipped = workspace::target_folder()?.join("skipped-recordings.txt");
    if skipped.exists() {
        std::fs::remove_file(&skipped).with_context(|| format!("cannot remove {}", skipped.display()))?;
    }
    let verdict = process::watch(tests.env(SKIPPED, &skipped))?;
    if skipped.exists() {
        let names = std::fs::read_to_string(&skipped).with_context(|| format!("cannot read {}", skipped.display()))?;
        eprintln!("{}", told(&names));
    }
    Ok(verdict)
}

/// What was skipped, from the names that the tests have left.
fn told(names: &str) -> String {
    let names: std::collections::BTreeSet<_> = names.lines().collect();
    format!(
        "SKIPPED: {} tests played the recording of our own master alone, for that of a real master is not here (SERCOS_CAPTURES names its folder): {}",
        names.len(),
        names.into_iter().collect::<Vec<_>>().join(", ")
    )
}

/// The tests' programs, compiled and not run.
fn compilation(runner: TestRunner) -> Command {
    let mut command = process::cargo();
    command.current_dir(workspace::root());
    match runner {
        TestRunner::Nextest => command.args(["nextest", "run", "--no-run"]),
        TestRunner::CargoTest => command.args(["test", "--no-run", "--lib", "--bins", "--tests"]),
    };
    command
}

/// Examples in the documentation, which nextest does not run.
fn examples_in_documentation() -> Command {
    let mut command = process::cargo();
    command.current_dir(workspace::root()).args(["test", "--quiet", "--doc"]);
    command
}

fn tests(runner: TestRunner, selection: Selection) -> Command {
    let mut command = process::cargo();
    command.current_dir(workspace::root());
    match runner {
        TestRunner::Nextest => {
            let ignored = match selection {
                Selection::Host => "default",
                Selection::Qemu => "only",
                Selection::All => "all",
            };
            command.args(["nextest", "run", "--no-fail-fast", "--run-ignored", ignored]);
        }
        TestRunner::CargoTest => {
            command.args(["test", "--no-fail-fast", "--lib", "--bins", "--tests"]);
            match selection {
                Selection::Host => {}
                Selection::Qemu => drop(command.args(["--", "--ignored"])),
                Selection::All => drop(command.args(["--", "--include-ignored"])),
            }
        }
    }
    command
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_skipped_is_counted_and_named() {
        let line = told("replay::b\nreplay::a\nreplay::b\n");
        assert!(line.starts_with("SKIPPED: 2 tests "), "{line}");
        assert!(line.ends_with(": replay::a, replay::b"), "{line}");
    }

    #[test]
    fn no_flag_means_every_test() {
        assert_eq!(Selection::from_flags(false, false), Selection::All);
        assert_eq!(Selection::from_flags(true, false), Selection::Host);
        assert_eq!(Selection::from_flags(false, true), Selection::Qemu);
    }

    /// Cargo builds the programs that are named; a file that none of them names would be forgotten without a word.
    #[test]
    fn every_file_beside_a_test_program_is_part_of_it() {
        let folders = [
            "tests",
            "tests/bench/tests",
            "tests/emulator/tests",
            "tests/plant/tests",
            "tests/ring/tests",
            "firmware/sercos/tests",
            "firmware/servo/tests",
        ];
        for folder in folders {
            let folder = workspace::root().join(folder);
            let program = std::fs::read_to_string(folder.join("tests.rs")).unwrap();
            let mut files = 0;
            for entry in std::fs::read_dir(&folder).unwrap() {
                let path = entry.unwrap().path();
                let name = path.file_stem().unwrap().to_str().unwrap();
                if path.extension().is_none_or(|extension| extension != "rs") || ["tests", "lib"].contains(&name) {
                    continue;
                }
                let line = format!("mod {name};");
                assert!(program.lines().any(|found| found == line), "{}: {line} is missing", folder.display());
                files += 1;
            }
            assert!(files > 2, "{}", folder.display());
        }
    }

    #[test]
    fn both_runners_are_told_the_same_selection() {
        for (selection, nextest, cargo_test) in [
            (Selection::Host, "--run-ignored default", "--tests"),
            (Selection::Qemu, "--run-ignored only", "-- --ignored"),
            (Selection::All, "--run-ignored all", "-- --include-ignored"),
        ] {
            assert!(process::words(&super::tests(TestRunner::Nextest, selection)).ends_with(nextest));
            assert!(process::words(&super::tests(TestRunner::CargoTest, selection)).ends_with(cargo_test));
        }
    }
}
