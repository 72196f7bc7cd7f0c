//! What can go wrong in a run, each with the values that tell why.

use std::path::PathBuf;

use ring::Nanoseconds;
use thiserror::Error;

/// Why a run in the emulator ended.
#[derive(Debug, Error)]
pub enum EmulatorError {
    /// The program `qemu-system-arm` is not installed.
    #[error(
        "qemu-system-arm was not found: install QEMU (Debian: apt-get install qemu-system-arm, macOS: brew install qemu)"
    )]
    QemuMissing,
    /// QEMU could not be started or talked to.
    #[error("QEMU: {what}: {source}")]
    Io {
        /// What was being done.
        what: &'static str,
        /// The cause.
        source: std::io::Error,
    },
    /// QEMU ended by itself.
    #[error("QEMU ended unexpectedly ({status}): {stderr} (which QEMU will do: docs/emulator.md)")]
    QemuEnded {
        /// Its exit status.
        status: String,
        /// What it printed.
        stderr: String,
    },
    /// QEMU did not answer for a long time: the product spins without touching a peripheral and without its timer interrupt.
    #[error("QEMU has not answered for {seconds} s")]
    Silent {
        /// How long was waited.
        seconds: u64,
    },
    /// What answers the product's accesses inside QEMU cannot go on: the product does what cannot be emulated, QEMU is not as expected, or
    /// both ends were built from different sources.
    #[error("the bus inside QEMU: {0}")]
    Guest(String),
    /// There is nothing to share with the bus inside QEMU.
    #[error("{0}; TMPDIR names where it shall be")]
    Page(#[from] emulator_link::PageError),
    /// An ELF file cannot be read or is not the expected one.
    #[error("{}: {what}", path.display())]
    Elf {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        what: String,
    },
    /// The product touched an address that no model answers for.
    #[error("{time}: unknown peripheral register: {direction} of {width} byte(s) at {address:#010x}, pc {pc:#010x}")]
    UnknownRegister {
        /// When.
        time: Nanoseconds,
        /// `read` or `write`.
        direction: &'static str,
        /// The address.
        address: u32,
        /// Bytes.
        width: u32,
        /// Where in the product.
        pc: u32,
    },
    /// The product used a peripheral in a way that fails on the real part.
    #[error("{time}: {what} (access to {address:#010x}, pc {pc:#010x})")]
    Misuse {
        /// When.
        time: Nanoseconds,
        /// What is wrong.
        what: String,
        /// The address.
        address: u32,
        /// Where in the product.
        pc: u32,
    },
    /// The product faulted.
    #[error("{time}: the product faulted: {report}")]
    Fault {
        /// When.
        time: Nanoseconds,
        /// Registers and fault status.
        report: String,
    },
    /// The product resets itself.
    #[error("{time}: the product resets itself (SYSRESETREQ), pc {pc:#010x}")]
    SoftwareReset {
        /// When.
        time: Nanoseconds,
        /// Where in the product.
        pc: u32,
    },
    /// The watchdog was not fed.
    #[error("{time}: the {name} watchdog reset the processor")]
    Watchdog {
        /// `independent` or `window`.
        name: &'static str,
        /// When.
        time: Nanoseconds,
    },
}

impl EmulatorError {
    pub(crate) fn io(what: &'static str) -> impl FnOnce(std::io::Error) -> Self {
        move |source| Self::Io { what, source }
    }
}
