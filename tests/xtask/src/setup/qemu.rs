//! QEMU, new enough for what the emulator rig relies on.

use super::Installing;
use super::system::PackageManager;
use crate::process;
use anyhow::{Result, bail};
use std::ffi::OsStr;
use std::fmt;
use std::process::Command;

/// The program that emulates the drive's processor, as the package managers call it.
const PROGRAM: &str = emulator::QEMU;

/// Oldest QEMU that the rig was tried with.
const OLDEST: Version = Version { major: 7, minor: 2 };

/// A version of QEMU.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Version {
    major: u32,
    minor: u32,
}

impl fmt::Display for Version {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{}.{}", self.major, self.minor)
    }
}

impl Version {
    /// Reads the answer to `qemu-system-arm --version`.
    fn parse(answer: &str) -> Option<Self> {
        let number = answer.split_once("version ")?.1;
        let mut parts = number.split(|character: char| !character.is_ascii_digit());
        Some(Self { major: parts.next()?.parse().ok()?, minor: parts.next()?.parse().ok()? })
    }
}

/// Finds QEMU, installs it where it is missing, and gives its version. One that the user names is taken as it is.
pub(super) fn ensure(installing: Installing) -> Result<Version> {
    if let Some(program) = std::env::var_os(emulator::QEMU_VARIABLE) {
        return check(&program, &format!("unset {} or give it another program", emulator::QEMU_VARIABLE));
    }
    let manager = PackageManager::of_this_machine();
    let packages: &[&str] = if manager == PackageManager::Brew { &["qemu"] } else { &[PROGRAM] };
    if process::find(PROGRAM).is_none() {
        manager.install(packages, &format!("QEMU ({PROGRAM}) is not installed"), installing)?;
    }
    check(PROGRAM.as_ref(), &format!("install QEMU again: {}", manager.command_by_hand(packages)))
}

fn check(program: &OsStr, remedy: &str) -> Result<Version> {
    let answer = process::ask(Command::new(program).arg("--version"));
    match answer.as_deref().and_then(Version::parse) {
        Some(version) if version >= OLDEST => Ok(version),
        Some(version) => {
            bail!(
                "QEMU {version} is too old, {OLDEST} or newer is needed; install a newer one and put it first in PATH"
            )
        }
        None => bail!("`{} --version` gives no version; {remedy}", program.display()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn versions_are_read_as_the_distributions_write_them() {
        let debian = "QEMU emulator version 7.2.22 (Debian 1:7.2+dfsg-7+deb12u18+b3)\nCopyright (c) 2003-2022";
        assert_eq!(Version::parse(debian), Some(Version { major: 7, minor: 2 }));
        assert_eq!(Version::parse("QEMU emulator version 10.1.0"), Some(Version { major: 10, minor: 1 }));
        assert_eq!(Version::parse("something else"), None);
    }

    #[test]
    fn versions_compare_as_numbers_not_as_text() {
        assert!(Version { major: 10, minor: 0 } > OLDEST);
        assert!(Version { major: 7, minor: 1 } < OLDEST);
        assert!(Version { major: 7, minor: 2 } >= OLDEST);
    }
}
