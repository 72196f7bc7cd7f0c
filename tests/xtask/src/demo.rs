//! The demonstration: the release ELF in a simulated press ring.

use crate::firmware;
use crate::progress::PhaseBars;
use crate::report::data::{DemoReport, Platform};
use crate::report::{checks, page, text};
use crate::setup::Installing;
use crate::{Verdict, workspace};
use anyhow::Result;
use bench::DemoError;
use std::path::{Path, PathBuf};

/// Runs it, prints its numbers, and writes the page.
pub(crate) fn run(on: Platform, output: Option<PathBuf>, installing: Installing) -> Result<Verdict> {
    let executor = firmware::executor(on, installing)?;
    let folder = output.map_or_else(|| workspace::target_folder().map(|folder| folder.join("demo")), Ok)?;
    let mut bars = PhaseBars::new();
    let report = bench::demo(&executor, &mut |progress| bars.show(progress));
    bars.finish();
    match report {
        Ok(report) => conclude(&report, &folder),
        // The run was possible and came to nothing: that is a result.
        Err(failure @ DemoError::Master(_)) => {
            eprintln!("failed: {failure}");
            Ok(Verdict::Failed)
        }
        Err(error) => Err(error.into()),
    }
}

/// Prints the numbers, writes the page, and judges.
fn conclude(report: &DemoReport, folder: &Path) -> Result<Verdict> {
    print!("{}", text::demo(report));
    let page = folder.join("index.html");
    workspace::write_whole(&page, &page::html(report))?;
    println!("report: {}", page.display());
    let passed = checks::of_demo(report).iter().all(|check| check.passed);
    Ok(if passed { Verdict::Passed } else { Verdict::Failed })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::examples;

    #[test]
    fn two_runs_with_the_same_numbers_leave_the_same_file() {
        let folder = tempfile::tempdir().unwrap();
        let read = || std::fs::read(folder.path().join("index.html")).unwrap();
        assert_eq!(conclude(&examples::demo(), folder.path()).unwrap(), Verdict::Passed);
        let first = read();
        assert_eq!(conclude(&examples::demo(), folder.path()).unwrap(), Verdict::Passed);
        assert_eq!(read(), first);
    }

    #[test]
    fn a_run_that_misses_a_check_fails_and_still_shows_its_page() {
        let folder = tempfile::tempdir().unwrap();
        let mut report = examples::demo();
        report.missed.mdt = 1;
        assert_eq!(conclude(&report, folder.path()).unwrap(), Verdict::Failed);
        assert!(folder.path().join("index.html").is_file());
    }
}
