//! The record of a real board, over its debug port.

use crate::flash::CHIP;
use crate::{Verdict, process};
use anyhow::{Context, Result, anyhow, bail};
use drive::production::{Production, ProductionRecord, RECORD_BYTES};
use std::process::Command;
use tempfile::TempDir;

/// Sector 9, as memory.x has it.
const ADDRESS: &str = "0x080A0000";

/// What has become of a record.
pub(super) enum Written {
    /// It was there already.
    WasThere,
    /// It is there now.
    AndReadBack,
    /// probe-rs has said why not.
    Failed,
}

/// Writes the record where nothing is yet, or another one with `replace`, and reads it back.
pub(super) fn write(record: &ProductionRecord, probe: Option<&str>, replace: bool) -> Result<Written> {
    if process::find("probe-rs").is_none() {
        bail!("probe-rs is not installed; install it with: cargo install probe-rs-tools --locked");
    }
    let bytes = record.emit();
    match Production::read(&read(probe)?) {
        Production::Blank => {}
        Production::Record(there) if there == *record => return Ok(Written::WasThere),
        Production::Record(there) if !replace => bail!(
            "the board is {} number {} already; --replace makes another one of it",
            there.hardware,
            there.serial_number
        ),
        Production::Unreadable(error) if !replace => {
            bail!("there is something else ({error}); --replace overwrites it")
        }
        Production::Record(_) | Production::Unreadable(_) => {}
    }
    let folder = temporary_folder()?;
    let image = folder.path().join("record.bin");
    std::fs::write(&image, bytes).with_context(|| format!("cannot write {}", image.display()))?;
    let mut download = with_probe("download", probe);
    download.args(["--binary-format", "bin", "--base-address", ADDRESS]).arg(&image);
    if process::watch(&mut download)? == Verdict::Failed {
        return Ok(Written::Failed);
    }
    if read(probe)? != bytes {
        bail!("the board does not read back what was written; write it again, and if it stays, have it replaced");
    }
    // The program looks for it at its start.
    Ok(match process::watch(&mut with_probe("reset", probe))? {
        Verdict::Passed => Written::AndReadBack,
        Verdict::Failed => Written::Failed,
    })
}

/// What stands in the sector.
fn read(probe: Option<&str>) -> Result<[u8; RECORD_BYTES]> {
    let folder = temporary_folder()?;
    let image = folder.path().join("read.bin");
    let mut command = with_probe("read", probe);
    // To a file: what it prints has changed from version to version.
    command.args(["--format", "binary", "--output"]).arg(&image).args(["b8", ADDRESS, &RECORD_BYTES.to_string()]);
    let words = process::words(&command);
    process::ask(&mut command).with_context(|| {
        format!("`{words}` failed; run it by hand to see why (is the board on, and the probe connected?)")
    })?;
    let bytes = std::fs::read(&image).with_context(|| format!("`{words}` has written nothing"))?;
    let length = bytes.len();
    bytes.try_into().map_err(|_| anyhow!("`{words}` has read {length} bytes, expected {RECORD_BYTES}"))
}

fn temporary_folder() -> Result<TempDir> {
    tempfile::tempdir().context("no temporary folder (TMPDIR names where it shall be)")
}

fn with_probe(what: &str, probe: Option<&str>) -> Command {
    let mut command = Command::new("probe-rs");
    command.args([what, "--chip", CHIP]);
    if let Some(probe) = probe {
        command.args(["--probe", probe]);
    }
    command
}
