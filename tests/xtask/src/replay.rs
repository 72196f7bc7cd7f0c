//! Replays: a recording of a real master against our drives.

use crate::Verdict;
use crate::firmware;
use crate::progress::PhaseBars;
use crate::report::data::{Platform, ReplayReport};
use crate::report::text;
use crate::setup::Installing;
use anyhow::{Context, Result, anyhow};
use bench::ReplayOptions;
use ring::capture::{CaptureError, Recording};
use std::path::Path;

/// Plays the recording and prints a line a drive, or JSON.
pub(crate) fn run(file: &Path, on: Platform, json: bool, installing: Installing) -> Result<Verdict> {
    // Read first: with a bad recording there is nothing to install or build for.
    let recording = read(file)?;
    let options = ReplayOptions { executor: firmware::executor(on, installing)?, ..ReplayOptions::on_host() };
    let mut bars = PhaseBars::new();
    let report = bench::replay(recording, &options, &mut |progress| bars.show(progress));
    bars.finish();
    conclude(&report?, json)
}

fn read(file: &Path) -> Result<Recording> {
    Recording::open(file).map_err(|error| match error {
        // It names the file itself.
        CaptureError::File { .. } => anyhow!("cannot read the recording {error}"),
        error => anyhow!("{} is no recording, {error}; the README says what one looks like", file.display()),
    })
}

fn conclude(report: &ReplayReport, json: bool) -> Result<Verdict> {
    if json {
        println!("{}", serde_json::to_string_pretty(report).context("the report cannot be written as JSON")?);
    } else {
        print!("{}", text::replay(report));
    }
    Ok(if text::replay_passed(report) { Verdict::Passed } else { Verdict::Failed })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::examples;

    #[test]
    fn the_verdict_is_the_same_with_and_without_json() {
        let good = examples::replay();
        let mut bad = examples::replay();
        bad.drives[3].phase = 3;
        for json in [false, true] {
            assert_eq!(conclude(&good, json).unwrap(), Verdict::Passed);
            assert_eq!(conclude(&bad, json).unwrap(), Verdict::Failed);
        }
    }
}
