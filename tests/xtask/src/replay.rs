//! Replays: a recording of a real master against our drives.

use crate::Verdict;
use crate::firmware::{self, Firmware};
use crate::progress::PhaseBars;
use crate::report::data::{Platform, Progress, ReplayReport};
use crate::report::text;
use crate::setup::{self, Installing};
use anyhow::{Context, Result, anyhow, bail};
use ring::capture::{CaptureError, Recording};
use std::path::Path;

/// Plays the recording and prints a line a drive, or JSON.
pub(crate) fn run(file: &Path, on: Platform, json: bool, installing: Installing) -> Result<Verdict> {
    // Read first: with a bad recording there is nothing to install or build for.
    let recording = read(file)?;
    let firmware = match on {
        Platform::Host => None,
        Platform::Qemu => {
            setup::qemu(installing)?;
            Some(firmware::build(installing)?)
        }
    };
    let mut bars = PhaseBars::new();
    let report = play(&recording, firmware.as_ref(), &mut |progress| bars.show(progress));
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

fn play(
    _recording: &Recording,
    _firmware: Option<&Firmware>,
    _progress: &mut dyn FnMut(&Progress),
) -> Result<ReplayReport> {
    bail!("the bench is not built yet")
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
