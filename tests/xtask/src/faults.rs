//! `docs/fault-matrix.md`: what the drive does about every fault, from simulated runs of the whole firmware.

use crate::{Verdict, workspace};
use anyhow::{Context, Result, bail};
use fault_matrix::{Cell, Expected, Outcome};

/// Where the page lives, from the repository's root.
const PAGE: &str = "docs/fault-matrix.md";

/// Runs all cells and writes the page, or only compares it. Cells in which the drive does not do what is expected are told, and nothing
/// is written then.
pub(crate) fn run(check: bool) -> Result<Verdict> {
    let expected = fault_matrix::cells();
    let cells: Vec<Cell> = expected.iter().map(|expected| expected.cell).collect();
    let outcomes = fault_matrix::run_all(&cells)?;
    let results: Vec<(&Expected, Outcome)> = expected.iter().zip(outcomes).collect();
    let wrong: Vec<String> = results.iter().filter_map(|(expected, outcome)| expected.contradiction(outcome)).collect();
    if !wrong.is_empty() {
        for line in &wrong {
            println!("{line}");
        }
        println!("{} of {} cells are not as expected; {PAGE} is left alone", wrong.len(), cells.len());
        return Ok(Verdict::Failed);
    }
    let path = workspace::root().join(PAGE);
    let page = fault_matrix::markdown(&results);
    if check {
        let present = std::fs::read_to_string(&path).with_context(|| format!("cannot read {PAGE}"))?;
        if present != page {
            bail!("{PAGE} is not what the drive does; run `cargo xtask faults` and commit it");
        }
        println!("{PAGE} is up to date");
        return Ok(Verdict::Passed);
    }
    workspace::write_whole(&path, &page)?;
    println!("{PAGE}: {} cells", cells.len());
    Ok(Verdict::Passed)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_page_in_the_repository_is_what_the_drive_does() {
        assert_eq!(run(true).unwrap(), Verdict::Passed);
    }
}
