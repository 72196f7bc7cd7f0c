//! Writes the drive into a real board.

use crate::firmware;
use crate::setup::Installing;
use crate::{Verdict, process};
use anyhow::{Result, bail};
use std::process::Command;

/// The part, as probe-rs names it.
pub(crate) const CHIP: &str = "STM32F407ZGTx";

/// Builds, flashes, and shows the drive's log until interrupted.
pub(crate) fn run(probe: Option<&str>, installing: Installing) -> Result<Verdict> {
    // Asked for before anything is built: without a probe there is nothing to build for.
    if process::find("probe-rs").is_none() {
        bail!("probe-rs is not installed; install it with: cargo install probe-rs-tools --locked");
    }
    let firmware = firmware::build(installing)?;
    let mut command = Command::new("probe-rs");
    command.args(["run", "--chip", CHIP]);
    if let Some(probe) = probe {
        command.args(["--probe", probe]);
    }
    process::watch(command.arg(firmware.product))
}
