//! What cargo-mutants makes of the safety files of the portable crates.
//!
//! In three steps, each slower than the one before and for fewer mutants: the file's own tests; for what they do not see all tests of the crate; for
//! what those do not see the laws of the axis over whole drives.

use super::programs::{self, Ended};
use super::scratch::Scratch;
use super::survivors::{self, Survivor};
use super::trial::UNOPTIMISED;
use crate::setup::{self, Installing};
use crate::{Verdict, process};
use anyhow::{Context, Result, bail, ensure};
use std::path::{Path, PathBuf};
use std::process::Command;

/// Viable mutants that must be seen, in per cent.
const SEEN_AT_LEAST: usize = 95;
/// Lives of random axes that look for a mutant.
const LIVES: &str = "500";

/// A file in which a mistake hurts somebody.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct SafetyFile {
    package: &'static str,
    path: &'static str,
    /// The test program with its own tests, as Cargo is told.
    program: &'static str,
    /// What the names of its own tests begin with.
    tests: &'static str,
}

const fn file(package: &'static str, path: &'static str, tests: &'static str) -> SafetyFile {
    SafetyFile { package, path, program: "--lib", tests }
}

/// The package in a folder of `firmware`.
fn package(folder: &'static str) -> &'static str {
    // Its own name belongs to somebody else on crates.io.
    if folder == "servo" { "servo-axis" } else { folder }
}

/// A file whose tests stand apart.
const fn tested_apart(package: &'static str, path: &'static str, tests: &'static str) -> SafetyFile {
    SafetyFile { package, path, program: "--test=tests", tests }
}

const FILES: [SafetyFile; 14] = [
    file("drive", "firmware/drive/src/state.rs", "state::"),
    file("drive", "firmware/drive/src/limits.rs", "limits::"),
    file("servo", "firmware/servo/src/current/protection.rs", "protection::"),
    file("servo", "firmware/servo/src/axis/limits.rs", "axis::limits::"),
    file("servo", "firmware/servo/src/path/stopping.rs", "stopping::"),
    tested_apart("servo", "firmware/servo/src/brake.rs", "brake::"),
    file("servo", "firmware/servo/src/monitor/travel_range.rs", "travel_range::"),
    file("servo", "firmware/servo/src/path/limits.rs", "path::limits::"),
    file("servo", "firmware/servo/src/encoder/monitor.rs", "encoder::monitor::"),
    file("servo", "firmware/servo/src/monitor/temperature.rs", "temperature::"),
    file("servo", "firmware/servo/src/monitor/bus_voltage.rs", "bus_voltage::"),
    file("servo", "firmware/servo/src/encoder/hidden_motion.rs", "hidden_motion::"),
    file("sercos", "firmware/sercos/src/loss_counter.rs", "loss_counter::"),
    file("sercos", "firmware/sercos/src/phase.rs", "phase::"),
];

/// A mutant that the tests of its file do not see.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Unseen {
    survivor: Survivor,
    package: &'static str,
    /// As a patch that applies.
    patch: String,
}

/// What became of the mutants of a file.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
struct Tally {
    viable: usize,
    unseen: Vec<Unseen>,
}

/// Tries all mutants of these files, all safety files if none is named, and holds what survives against the list.
pub(super) fn run(only: &[String], installing: Installing) -> Result<Verdict> {
    let files = chosen(only)?;
    setup::mutation_tester(installing)?;
    let scratch = Scratch::new()?;
    let listed = survivors::listed()?;
    let (mut viable, mut survived, mut wrong) = (0, 0, 0);
    for file in files {
        eprintln!("{}: its own tests", file.path);
        let tally = own_tests(&scratch, file)?;
        let mut survivors = Vec::new();
        for unseen in &tally.unseen {
            // What is listed has a reason why nobody can see it.
            if listed.contains(&unseen.survivor) || others_see_nothing(&scratch, unseen)? {
                survivors.push(unseen.survivor.clone());
            }
        }
        let (new, gone) = survivors::compare(&listed, &survivors, file.path);
        for survivor in &new {
            println!("SURVIVED: {survivor}");
        }
        for survivor in &gone {
            println!("SEEN, take it off the list: {survivor}");
        }
        println!("{}: {} of {} seen", file.path, tally.viable - survivors.len(), tally.viable);
        viable += tally.viable;
        survived += survivors.len();
        wrong += new.len() + gone.len();
    }
    let seen = viable - survived;
    println!("{seen} of {viable} mutants seen, {wrong} otherwise than docs/mutants.md has it");
    let enough = seen * 100 >= viable * SEEN_AT_LEAST;
    Ok(if enough && wrong == 0 { Verdict::Passed } else { Verdict::Failed })
}

fn chosen(only: &[String]) -> Result<Vec<SafetyFile>> {
    if let Some(unknown) = only.iter().find(|&name| FILES.iter().all(|file| !file.path.ends_with(name.as_str()))) {
        let paths = FILES.map(|file| file.path).join(", ");
        bail!("{unknown} is no safety file; they are {paths}");
    }
    let is_asked_for =
        |file: &SafetyFile| only.is_empty() || only.iter().any(|name| file.path.ends_with(name.as_str()));
    Ok(FILES.into_iter().filter(is_asked_for).collect())
}

/// The first step, by cargo-mutants.
fn own_tests(scratch: &Scratch, file: SafetyFile) -> Result<Tally> {
    let output = scratch.build_folder("cargo-mutants");
    let mut cargo = process::cargo();
    cargo.current_dir(scratch.root()).args(["mutants", "--in-place", "--baseline", "skip", "--no-shuffle"]);
    cargo.args(["--timeout", "60", "--file", file.path, "--package", package(file.package), "--cargo-arg"]);
    cargo.args([file.program, "--output"]).arg(&output).args(["--", file.tests]).envs(UNOPTIMISED);
    cargo.env("CARGO_TARGET_DIR", scratch.build_folder("host")).stdout(std::io::stderr());
    // It fails whenever a mutant survives; what counts is what it has written down.
    let status = cargo.status().with_context(|| format!("cannot start {}", process::words(&cargo)))?;
    let written = output.join("mutants.out");
    let text = std::fs::read_to_string(written.join("outcomes.json"));
    let text = text.with_context(|| format!("cargo-mutants ended with {status} and wrote down nothing"))?;
    tally(&serde_json::from_str(&text).context("cargo-mutants writes what nobody understands")?, file, |diff| {
        std::fs::read_to_string(written.join(diff)).with_context(|| format!("cannot read {diff}"))
    })
}

fn tally(outcomes: &serde_json::Value, file: SafetyFile, read: impl Fn(&str) -> Result<String>) -> Result<Tally> {
    let mut tally = Tally::default();
    let list = outcomes["outcomes"].as_array().context("cargo-mutants names no outcomes")?;
    for outcome in list {
        let Some(name) = outcome["scenario"]["Mutant"]["name"].as_str() else { continue };
        match outcome["summary"].as_str() {
            Some("Unviable") => continue,
            Some("CaughtMutant" | "Timeout") => {}
            Some("MissedMutant") => {
                let diff = read(outcome["diff_path"].as_str().context("a mutant without its diff")?)?;
                let survivor = Survivor::named(name).context("a mutant without a place")?;
                tally.unseen.push(Unseen { patch: patch(file.path, &diff)?, survivor, package: package(file.package) });
            }
            other => bail!("cargo-mutants says {other:?} of {name}"),
        }
        tally.viable += 1;
    }
    ensure!(tally.viable > 0, "{} has no mutants", file.path);
    Ok(tally)
}

/// Its diffs are to be read, and name what they do where the second file should be.
fn patch(path: &str, diff: &str) -> Result<String> {
    let hunks = diff.find("@@ ").context("a diff without a change")?;
    Ok(format!("diff --git a/{path} b/{path}\n--- a/{path}\n+++ b/{path}\n{}", &diff[hunks..]))
}

/// The second step and the third.
fn others_see_nothing(scratch: &Scratch, unseen: &Unseen) -> Result<bool> {
    let file = scratch.build_folder("mutant.patch");
    std::fs::write(&file, &unseen.patch).with_context(|| format!("cannot write {}", file.display()))?;
    if let Err(reason) = scratch.apply(&file)? {
        bail!("the diff of cargo-mutants does not apply: {reason}");
    }
    let seen = others_see(scratch, unseen);
    scratch.undo(&file)?;
    Ok(!seen?)
}

fn others_see(scratch: &Scratch, unseen: &Unseen) -> Result<bool> {
    eprintln!("{}: all tests of {}", unseen.survivor, unseen.package);
    let words = scratch.build_folder("words.txt");
    let mut tests = cargo(scratch, "host", &["test", "--quiet", "--package", unseen.package, "--lib", "--tests"]);
    if programs::watch(tests.envs(UNOPTIMISED), &words)? != Ended::Green {
        return Ok(true);
    }
    eprintln!("{}: the laws of the axis", unseen.survivor);
    // Whole drives run for seconds: optimised, as the tests are.
    let laws =
        ["test", "--quiet", "--package", "integration", "--test", "tests", "laws::", "faults::", "stops::", "power::"];
    let matrix = ["test", "--quiet", "--package", "fault_matrix"];
    for arguments in [&laws[..], &matrix] {
        if programs::watch(&mut cargo(scratch, "laws", arguments), &words)? != Ended::Green {
            return Ok(true);
        }
    }
    let lives = ["run", "--quiet", "--package", "explorer", "--", "lives", "1", "0", LIVES];
    let ended = programs::watch(&mut cargo(scratch, "laws", &lives), &words)?;
    Ok(ended != Ended::Green || broken_law(&words)?)
}

fn broken_law(words: &Path) -> Result<bool> {
    Ok(std::fs::read_to_string(words).context("cannot read what the lives have told")?.contains("{\"Broken\""))
}

fn cargo(scratch: &Scratch, folder: &str, arguments: &[&str]) -> Command {
    let folder: PathBuf = scratch.build_folder(folder);
    let mut cargo = process::cargo();
    cargo.current_dir(scratch.root()).args(arguments).env("CARGO_TARGET_DIR", folder);
    cargo
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::workspace;
    use serde_json::json;

    #[test]
    fn every_safety_file_is_there_and_has_tests_of_its_own() {
        for file in FILES {
            let module = file.tests.trim_end_matches("::").replace("::", "/");
            assert!(file.path.ends_with(&format!("/{module}.rs")), "{}", file.path);
            let path = if file.program == "--lib" {
                file.path.to_owned()
            } else {
                format!("firmware/{}/tests/{module}.rs", file.package)
            };
            let text = std::fs::read_to_string(workspace::root().join(path)).unwrap();
            assert!(text.contains("#[test]") || text.contains("mod tests;"), "{}", file.path);
        }
    }

    #[test]
    fn a_name_that_is_no_safety_file_is_refused() {
        let error = chosen(&["modulo.rs".into()]).unwrap_err().to_string();
        assert!(error.contains("modulo.rs is no safety file"), "{error}");
        assert_eq!(chosen(&["brake.rs".into()]).unwrap().len(), 1);
        assert_eq!(chosen(&[]).unwrap().len(), FILES.len());
    }

    #[test]
    fn what_cannot_be_compiled_does_not_count_and_what_is_missed_becomes_a_patch() {
        let outcome = |place: &str, summary: &str| json!({ "scenario": { "Mutant": { "name": format!("a/b.rs:{place}: replace + with -") } }, "summary": summary, "diff_path": "d" });
        let outcomes = json!({ "outcomes": [
            { "scenario": "Baseline", "summary": "Success" },
            outcome("1:2", "Unviable"), outcome("3:4", "CaughtMutant"), outcome("5:6", "Timeout"), outcome("7:8", "MissedMutant"),
        ] });
        let diff = |_: &str| Ok("--- a/b.rs\n+++ replace + with -\n@@ -1 +1 @@\n-x\n+y\n".to_owned());
        let tally = tally(&outcomes, file("p", "a/b.rs", "b::"), diff).unwrap();
        assert_eq!((tally.viable, tally.unseen.len()), (3, 1));
        let [unseen] = &tally.unseen[..] else { panic!() };
        assert_eq!(unseen.survivor.to_string(), "a/b.rs: replace + with -");
        assert_eq!(unseen.patch, "diff --git a/a/b.rs b/a/b.rs\n--- a/a/b.rs\n+++ b/a/b.rs\n@@ -1 +1 @@\n-x\n+y\n");
    }
}
