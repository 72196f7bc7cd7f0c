//! The fuzz targets, one after the other: build, run, and say how far each came.

mod output;

use crate::report::numbers::thousands;
use crate::setup::{self, Installing};
use crate::{Verdict, process, workspace};
use anyhow::{Context, Result, bail};
use clap::ValueEnum;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use output::{Line, Outcome};
use std::io::{BufRead, BufReader, IsTerminal};
use std::process::{Command, Stdio};
use std::time::Instant;

/// Longest input in bytes: some sixty steps of the service channel, and short enough to be fast.
const LONGEST_INPUT: usize = 256;
/// An input that takes longer, in seconds, hangs: the usual one takes some ten microseconds.
const PATIENCE: u32 = 10;

/// A file of `fuzz/fuzz_targets`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
#[value(rename_all = "snake_case")]
pub(crate) enum Target {
    /// Steps, phases, commands and lost telegrams, then a run-up
    ServiceChannel,
    /// Values of parameters, then both transition checks and a run-up
    Configuration,
    /// What the works may have written, and whatever ratings of an amplifier
    ProductionRecord,
    /// Recordings, line levels, telegrams, and a chip that receives them
    Capture,
}

impl Target {
    const fn name(self) -> &'static str {
        match self {
            Self::ServiceChannel => "service_channel",
            Self::Configuration => "configuration",
            Self::ProductionRecord => "production_record",
            Self::Capture => "capture",
        }
    }
}

/// Runs one target or all of them; one line a target on stdout.
pub(crate) fn run(only: Option<Target>, runs: u64, installing: Installing) -> Result<Verdict> {
    setup::fuzzer(installing)?;
    let targets = match &only {
        Some(target) => std::slice::from_ref(target),
        None => Target::value_variants(),
    };
    for target in targets {
        let mut build = cargo_fuzz("build");
        if process::watch(build.arg(target.name()))? == Verdict::Failed {
            bail!("the fuzz target {} cannot be built; the compiler says above why", target.name());
        }
    }
    let mut verdict = Verdict::Passed;
    for target in targets {
        let (outcome, seconds) = fuzz(*target, runs)?;
        println!("{:<16} {}", target.name(), result_line(&outcome, seconds));
        if outcome.failure.is_some() || outcome.executions < runs {
            verdict = Verdict::Failed;
        }
    }
    Ok(verdict)
}

/// Without a sanitizer, because there is no unsafe code to watch, and so with a stable compiler; without traces of
/// comparisons, which take two thirds of the time and found nothing that coverage alone did not.
fn cargo_fuzz(command: &str) -> Command {
    let mut cargo = process::cargo();
    cargo.current_dir(workspace::root()).env("RUSTC_BOOTSTRAP", "1");
    cargo.args(["fuzz", command, "--sanitizer", "none", "--no-trace-compares"]);
    cargo
}

/// Runs one target until so many executions are done or one fails; gives the seconds that it took, too.
fn fuzz(target: Target, runs: u64) -> Result<(Outcome, u64)> {
    let name = target.name();
    let corpus = workspace::root().join("fuzz/corpus").join(name);
    std::fs::create_dir_all(&corpus).with_context(|| format!("cannot make the folder {}", corpus.display()))?;
    let mut command = cargo_fuzz("run");
    command.arg(name).arg(&corpus).arg(workspace::root().join("fuzz/seeds").join(name)).arg("--").args([
        format!("-runs={runs}"),
        format!("-max_len={LONGEST_INPUT}"),
        format!("-timeout={PATIENCE}"),
        "-print_final_stats=1".to_owned(),
    ]);
    let begin = Instant::now();
    let mut child = command
        .stdin(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .with_context(|| format!("cannot start {}", process::words(&command)))?;
    let stderr = child.stderr.take().context("the fuzzer's output cannot be read")?;
    let bar = bar(name, runs);
    let mut outcome = Outcome::default();
    for line in BufReader::new(stderr).split(b'\n') {
        let line = line.context("the fuzzer's output cannot be read")?;
        let line = String::from_utf8_lossy(&line);
        match outcome.take(&line) {
            Line::Progress => bar.set_position(outcome.executions.min(runs)),
            Line::Noise => {}
            Line::News => bar.suspend(|| eprintln!("{line}")),
        }
    }
    bar.finish_and_clear();
    let status = child.wait().context("the fuzzer does not end")?;
    if !status.success() && outcome.failure.is_none() {
        outcome.failure = Some(format!("the fuzzer ended with {status}"));
    }
    Ok((outcome, begin.elapsed().as_secs()))
}

fn bar(name: &str, runs: u64) -> ProgressBar {
    let terminal = std::io::stderr().is_terminal();
    let target = if terminal { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() };
    let bar = ProgressBar::with_draw_target(Some(runs), target);
    if let Ok(style) = ProgressStyle::with_template("  {prefix} {bar:32.cyan/blue} {percent:>3} %  {eta} to go") {
        bar.set_style(style.progress_chars("━╸─"));
    }
    bar.set_prefix(name.to_owned());
    bar
}

fn result_line(outcome: &Outcome, seconds: u64) -> String {
    let speed = thousands(outcome.executions / seconds.max(1));
    let done = format!("{} executions in {seconds} s, {speed} a second", thousands(outcome.executions));
    match (&outcome.failure, &outcome.artifact) {
        (None, _) => format!("{done}: nothing found"),
        (Some(failure), None) => format!("{done}: FAILED, {failure}"),
        (Some(failure), Some(artifact)) => format!("{done}: FAILED, {failure}; the input is {artifact}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_target_is_a_file_and_has_seeds() {
        for target in Target::value_variants() {
            let fuzz = workspace::root().join("fuzz");
            assert!(fuzz.join("fuzz_targets").join(target.name()).with_extension("rs").is_file());
            assert!(fuzz.join("seeds").join(target.name()).is_dir());
            assert_eq!(target.to_possible_value().unwrap().get_name(), target.name());
        }
    }

    #[test]
    fn the_result_says_how_far_how_fast_and_what_was_found() {
        let mut outcome = Outcome::default();
        outcome.take("stat::number_of_executed_units: 1000000");
        let [done, speed] = [1_000_000, 40_000].map(thousands);
        let expected = format!("{done} executions in 25 s, {speed} a second: nothing found");
        assert_eq!(result_line(&outcome, 25), expected);
        outcome.failure = Some("boom".to_owned());
        outcome.artifact = Some("fuzz/artifacts/x".to_owned());
        assert!(result_line(&outcome, 0).ends_with(": FAILED, boom; the input is fuzz/artifacts/x"));
    }
}
