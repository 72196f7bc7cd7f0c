//! Where the drive under test runs.

use std::cell::RefCell;
use std::path::PathBuf;
use std::rc::Rc;

use ring::Nanoseconds;

use crate::measure::Stopwatch;
use crate::report::Platform;

/// What QEMU runs: the product as it is flashed, and what answers its accesses.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Elves {
    /// The release ELF of the product.
    pub product: PathBuf,
    /// The bus inside QEMU, a library that it loads.
    pub bus: PathBuf,
    /// See [`emulator::GuestConfiguration::one_cpu`]; like the next two it changes no result.
    pub one_cpu: bool,
    /// See [`emulator::GuestConfiguration::whole_blocks`].
    pub whole_blocks: bool,
    /// See [`emulator::GuestConfiguration::foretells`].
    pub foretells: bool,
}

impl Elves {
    /// Run the usual way, which is the fastest.
    #[must_use]
    pub fn new(product: impl Into<PathBuf>, bus: impl Into<PathBuf>) -> Self {
        Self { product: product.into(), bus: bus.into(), one_cpu: true, whole_blocks: true, foretells: true }
    }
}

/// Where the drive under test runs. The drives beside it always run on this computer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Executor {
    /// The portable tasks on this computer.
    Host,
    /// The flashed ELF in QEMU.
    Qemu(Elves),
}

impl Executor {
    /// For reports.
    #[must_use]
    pub const fn platform(&self) -> Platform {
        match self {
            Self::Host => Platform::Host,
            Self::Qemu(_) => Platform::Qemu,
        }
    }
}

/// What is measured on a drive from outside.
#[derive(Clone, Debug, Default)]
pub struct Measurements {
    /// From the chip's interrupt for a service step to the write that releases it.
    pub service: Stopwatch,
    /// When the service container was released last; only for a drive whose bus is watched (in QEMU).
    pub released: Option<Nanoseconds>,
    /// From the interrupt edge of t4 to the last word of the AT record.
    pub interrupt_to_at: Stopwatch,
    /// From the interrupt edge of t3 to the current command of the next loop tick that uses it.
    pub interrupt_to_command: Stopwatch,
    /// Every access of the processor; only for a drive in QEMU.
    pub trace: Option<emulator::Trace>,
    /// Decoded log lines.
    pub log: Vec<String>,
    /// When which task ran, by its name in `firmware/app`, and `INT_SC` where the chip asked for a step of the service channel; only for a drive on this computer, and where somebody asked for it.
    pub tasks: Option<Vec<(Nanoseconds, &'static str)>>,
}

impl Measurements {
    /// A task runs.
    pub(crate) fn note(&mut self, now: Nanoseconds, task: &'static str) {
        if let Some(tasks) = &mut self.tasks {
            tasks.push((now, task));
        }
    }
}

/// Measurements that a processor fills while it runs.
pub type SharedMeasurements = Rc<RefCell<Measurements>>;
