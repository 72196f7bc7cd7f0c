//! The words of `cargo xtask parameters`.

use super::{Action, Which};
use crate::cli::On;
use clap::{Args, Subcommand};
use sercos::Idn;
use std::path::PathBuf;

/// What `cargo xtask parameters` does.
#[derive(Debug, Subcommand)]
pub(crate) enum ParametersCommand {
    /// Write everything that the drive keeps (S-0-0192) into a file
    Save {
        /// TOML; replaced if it is there
        file: PathBuf,
        #[command(flatten)]
        drive: DriveArguments,
    },
    /// Write what differs from a file into the drive, read everything back, and save it there with S-0-0264
    ///
    /// Stops at the first refusal, with the drive's reason, and brings back what was saved (S-0-0263).
    Load {
        /// As `save` has written it; values may have been changed, and data blocks taken out
        file: PathBuf,
        #[command(flatten)]
        drive: DriveArguments,
        /// Leave S-0-0264 out: what was loaded goes with the supply
        #[arg(long)]
        no_store: bool,
        /// Leave out data blocks of the file that the drive does not keep, and say which
        #[arg(long)]
        skip_unknown: bool,
    },
    /// Print where a file and the drive differ, or two files; fails if they do
    Compare {
        /// As `save` has written it
        file: PathBuf,
        /// Another one, in place of a drive
        #[arg(value_name = "FILE", conflicts_with_all = ["on", "flash", "identity"])]
        other: Option<PathBuf>,
        #[command(flatten)]
        drive: DriveArguments,
    },
    /// Print IDN, name, value and unit
    Print {
        /// Only these data blocks, of whatever kind [default: everything that the drive keeps]
        #[arg(value_name = "IDN", value_parser = idn)]
        idns: Vec<Idn>,
        #[command(flatten)]
        drive: DriveArguments,
    },
}

/// Which drive has the parameters.
#[derive(Debug, Args)]
pub(crate) struct DriveArguments {
    /// Where the drive runs
    #[arg(long, value_enum, default_value_t = On::Host)]
    on: On,
    /// What the drive remembers from one command to the next, as its flash holds it; made if it is not there
    #[arg(long, value_name = "FILE")]
    flash: Option<PathBuf>,
    /// Data sheet of its amplifier, as docs/amplifier.toml [default: the board as it comes]
    #[arg(long, value_name = "FILE")]
    identity: Option<PathBuf>,
}

impl From<ParametersCommand> for (Action, Which) {
    fn from(command: ParametersCommand) -> Self {
        let (action, drive) = match command {
            ParametersCommand::Save { file, drive } => (Action::Save(file), drive),
            ParametersCommand::Load { file, drive, no_store, skip_unknown } => {
                (Action::Load { file, no_store, skip_unknown }, drive)
            }
            ParametersCommand::Compare { file, other: Some(other), drive } => {
                (Action::CompareFiles(file, other), drive)
            }
            ParametersCommand::Compare { file, other: None, drive } => (Action::CompareWithDrive(file), drive),
            ParametersCommand::Print { idns, drive } => (Action::Print(idns), drive),
        };
        (action, Which { on: drive.on.into(), flash: drive.flash, identity: drive.identity })
    }
}

/// The name of a data block.
fn idn(text: &str) -> Result<Idn, String> {
    text.parse().map_err(|_| format!("'{text}' is no IDN; one reads S-0-0051 or P-0-0019"))
}
