//! Who a drive is: the record that the works write once, beside the program.

mod probe;
mod sheet;

use crate::{Verdict, workspace};
use anyhow::{Context, Result};
use drive::production::ProductionRecord;
use probe::Written;
use std::path::{Path, PathBuf};

/// What is done with the record of a data sheet.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Action {
    /// It is written into this file, as the flash holds it.
    File(PathBuf),
    /// It is written into the board at this probe; `replace`: also over another one.
    Board { probe: Option<String>, replace: bool },
}

/// Does it.
pub(crate) fn run(path: &Path, action: &Action) -> Result<Verdict> {
    let record = read(path)?;
    match action {
        Action::File(output) => {
            workspace::write_beside(output, &record.emit())?;
            println!("{}: {}", output.display(), told(&record));
            Ok(Verdict::Passed)
        }
        Action::Board { probe, replace } => {
            let done = match probe::write(&record, probe.as_deref(), *replace)? {
                Written::WasThere => "there already",
                Written::AndReadBack => "written and read back",
                Written::Failed => return Ok(Verdict::Failed),
            };
            println!("{done}: {}", told(&record));
            Ok(Verdict::Passed)
        }
    }
}

/// The record of a data sheet.
///
/// # Errors
/// The file, or the first thing in it that is wrong.
pub(crate) fn read(path: &Path) -> Result<ProductionRecord> {
    let text = std::fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
    sheet::record(&text).with_context(|| path.display().to_string())
}

fn told(record: &ProductionRecord) -> String {
    let amplifier = &record.amplifier;
    format!(
        "{} number {}, {:.3} A for ever, {:.3} A at most, {} V",
        record.hardware,
        record.serial_number,
        f64::from(amplifier.continuous_current) / 1_000.0,
        f64::from(amplifier.peak_current) / 1_000.0,
        amplifier.overvoltage
    )
}
