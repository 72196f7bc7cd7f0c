//! `docs/fault-matrix.md`: what the drive does about every fault, from simulated runs of the whole firmware.

use crate::report::data::Platform;
use crate::setup::Installing;
use crate::{Verdict, firmware, workspace};
use anyhow::{Context, Result, bail};
use bench::Executor;
use fault_matrix::{Cell, Expected, Outcome, difference};

/// Where the page lives, from the repository's root.
const PAGE: &str = "docs/fault-matrix.md";

/// So many cells are run between two words about it.
const AT_ONCE: usize = 16;

/// Runs all cells and writes the page, or only compares it. Cells in which the drive does not do what is expected are told, and nothing
/// is written then.
pub(crate) fn run(check: bool) -> Result<Verdict> {
    let expected = fault_matrix::cells();
    let cells: Vec<Cell> = expected.iter().map(|expected| expected.cell).collect();
    let outcomes = fault_matrix::run_all(&cells, &Executor::Host)?;
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

/// Runs all cells with the flashed ELF as well, and tells where it does otherwise than the portable drive, or than it has to.
pub(crate) fn compare(installing: Installing) -> Result<Verdict> {
    let executor = firmware::executor(Platform::Qemu, installing)?;
    let expected = fault_matrix::cells();
    let cells: Vec<Cell> = expected.iter().map(|expected| expected.cell).collect();
    let host = fault_matrix::run_all(&cells, &Executor::Host)?;
    let (mut different, total) = (0, cells.len());
    // Some at a time: the flashed ELF is slow, and whoever waits for it sees what it has come to.
    let both = cells.chunks(AT_ONCE).zip(expected.chunks(AT_ONCE).zip(host.chunks(AT_ONCE)));
    for (number, (cells, (expected, host))) in both.enumerate() {
        let elf = fault_matrix::run_all(cells, &executor)?;
        for (cell, (expected, (host, elf))) in cells.iter().zip(expected.iter().zip(host.iter().zip(&elf))) {
            if let Some(line) = expected
                .contradiction_on_the_elf(elf)
                .or_else(|| Some(format!("{cell}: {}", difference(cell.fault, cell.state, host, elf)?)))
            {
                different += 1;
                println!("{line}");
            }
        }
        eprintln!("{} of {total} cells", number * AT_ONCE + cells.len());
    }
    println!("{different} of {total} cells are different on the flashed ELF");
    Ok(if different == 0 { Verdict::Passed } else { Verdict::Failed })
}
