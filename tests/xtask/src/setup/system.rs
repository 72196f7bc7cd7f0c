//! The system's package manager.

use super::Installing;
use crate::{Verdict, process};
use anyhow::{Result, bail};
use std::process::Command;

/// What installs packages here.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum PackageManager {
    /// Debian, Ubuntu and their kin.
    Apt,
    /// Homebrew.
    Brew,
    /// None that is known here.
    Unknown,
}

impl PackageManager {
    /// The one of this machine.
    pub(super) fn of_this_machine() -> Self {
        if process::find("apt-get").is_some() {
            Self::Apt
        } else if process::find("brew").is_some() {
            Self::Brew
        } else {
            Self::Unknown
        }
    }

    /// The command that installs these packages, as one types it; without a known manager, as on Debian.
    pub(super) fn command_by_hand(self, packages: &[&str]) -> String {
        let packages = packages.join(" ");
        match self {
            Self::Apt => format!("sudo apt-get update && sudo apt-get install -y {packages}"),
            Self::Brew => format!("brew install {packages}"),
            Self::Unknown => format!("sudo apt-get install -y {packages} (or what your system calls it)"),
        }
    }

    /// Installs packages, or fails with the command to run by hand.
    ///
    /// `missing` says what is missing, as the beginning of a sentence.
    pub(super) fn install(self, packages: &[&str], missing: &str, installing: Installing) -> Result<()> {
        let by_hand = self.command_by_hand(packages);
        let may = installing == Installing::Allowed
            && match self {
                Self::Apt => rustix::process::geteuid().is_root(),
                Self::Brew => true,
                Self::Unknown => false,
            };
        if !may {
            bail!("{missing}; install it with: {by_hand}");
        }
        eprintln!("{missing}; installing {} with {self:?}", packages.join(", "));
        for command in &mut self.commands(packages) {
            if process::watch(command)? == Verdict::Failed {
                bail!("{missing}, and installing it failed; try by hand: {by_hand}");
            }
        }
        Ok(())
    }

    fn commands(self, packages: &[&str]) -> Vec<Command> {
        match self {
            Self::Apt => {
                let mut update = Command::new("apt-get");
                update.args(["-qq", "update"]);
                let mut install = Command::new("apt-get");
                install
                    .env("DEBIAN_FRONTEND", "noninteractive")
                    .args(["-qq", "install", "-y", "--no-install-recommends"])
                    .args(packages);
                // What is printed here is progress, and stdout is for results.
                for command in [&mut update, &mut install] {
                    command.stdout(std::io::stderr());
                }
                vec![update, install]
            }
            Self::Brew => {
                let mut install = Command::new("brew");
                install.arg("install").args(packages).stdout(std::io::stderr());
                vec![install]
            }
            Self::Unknown => Vec::new(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn where_nothing_may_be_installed_the_error_is_the_command() {
        let refused =
            PackageManager::Apt.install(&["qemu-system-arm"], "QEMU is missing", Installing::Never).unwrap_err();
        assert_eq!(
            refused.to_string(),
            "QEMU is missing; install it with: sudo apt-get update && sudo apt-get install -y qemu-system-arm"
        );
        let refused = PackageManager::Brew.install(&["qemu"], "QEMU is missing", Installing::Never).unwrap_err();
        assert_eq!(refused.to_string(), "QEMU is missing; install it with: brew install qemu");
    }

    #[test]
    fn without_a_known_package_manager_nothing_is_tried() {
        assert!(PackageManager::Unknown.install(&["qemu"], "QEMU is missing", Installing::Allowed).is_err());
    }
}
