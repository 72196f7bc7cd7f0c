//! What the processor does, written down: each instruction once, the accesses, the exceptions that begin and end.
//!
//! QEMU tells nobody when an exception begins or ends. The number of the one that is being served stands in ICSR, and it changes between blocks only:
//! looked at before the first instruction of a block, it shows every change, and whether the one that was served before is still active shows whether
//! it was interrupted or has ended.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

use emulator_link::protocol::trace;

use crate::blocks::Instruction;
use crate::machine::machine;

/// A trace that is being written.
pub(crate) struct Trace {
    file: BufWriter<File>,
    exceptions: Exceptions,
}

impl Trace {
    /// Begins behind the instruction that is being executed.
    pub(crate) fn begin(path: &Path) -> std::io::Result<Self> {
        Ok(Self { file: BufWriter::with_capacity(1 << 16, File::create(path)?), exceptions: Exceptions::now() })
    }

    /// An instruction that is executed now.
    pub(crate) fn instruction(&mut self, this: Instruction) -> std::io::Result<()> {
        let Self { file, exceptions } = self;
        if this.index() == 0 {
            exceptions.look(this.pc(), |kind, exception| word(file, kind | u32::from(exception) << trace::NUMBER))?;
        }
        exceptions.last = this.pc();
        word(file, this.pc())
    }

    /// The instruction accesses a peripheral or the external bus.
    pub(crate) fn access(&mut self, address: u32) -> std::io::Result<()> {
        word(&mut self.file, trace::ACCESS)?;
        word(&mut self.file, address)
    }

    /// Everything is in the file.
    pub(crate) fn end(mut self) -> std::io::Result<()> {
        self.file.flush()
    }
}

fn word(file: &mut impl Write, word: u32) -> std::io::Result<()> {
    file.write_all(&word.to_le_bytes())
}

/// The exceptions that are being served.
struct Exceptions {
    /// The innermost last.
    open: Vec<u16>,
    /// Were active when the trace began and have not been looked at since: they do not begin when they go on.
    older: Vec<u16>,
    /// The instruction before.
    last: u32,
}

/// Exceptions that ARMv7-M can have.
const NUMBERS: u16 = 256;

impl Exceptions {
    fn now() -> Self {
        let current = served();
        let older = (1..NUMBERS).filter(|number| *number != current && is_active(*number)).collect();
        Self { open: Vec::from_iter((current != 0).then_some(current)), older, last: 0 }
    }

    /// Before the first instruction of a block, at `pc`.
    fn look(&mut self, pc: u32, mut tell: impl FnMut(u32, u16) -> std::io::Result<()>) -> std::io::Result<()> {
        let current = served();
        if self.open.last().copied().unwrap_or(0) == current {
            // One that ends and begins again at once, with no instruction in between.
            if current != 0 && pc == machine().vector(current.into()) && is_return(machine().word(self.last)) {
                tell(trace::LEFT, current)?;
                tell(trace::ENTERED, current)?;
            }
            return Ok(());
        }
        let goes_on = self.open.contains(&current);
        while let Some(innermost) =
            self.open.pop_if(|innermost| *innermost != current && (goes_on || !is_active(*innermost)))
        {
            tell(trace::LEFT, innermost)?;
        }
        if current == 0 || goes_on {
            return Ok(());
        }
        self.open.push(current);
        match self.older.iter().position(|older| *older == current) {
            Some(known) => drop(self.older.swap_remove(known)),
            None => tell(trace::ENTERED, current)?,
        }
        Ok(())
    }
}

/// The exception that is being served; 0: none.
fn served() -> u16 {
    const INTERRUPT_STATE: u32 = 0xE000_ED04;
    (machine().word(INTERRUPT_STATE) & 0x1FF) as u16
}

/// Is an exception active, served or interrupted? The faults and NMI are said not to be: the product ends with them.
fn is_active(exception: u16) -> bool {
    const ACTIVE: u32 = 0xE000_E300;
    const SYSTEM_HANDLERS: u32 = 0xE000_ED24;
    let (address, bit) = match exception {
        16.. => (ACTIVE + 4 * u32::from((exception - 16) / 32), (exception - 16) % 32),
        // SVC, PendSV.
        11 => (SYSTEM_HANDLERS, 7),
        14 => (SYSTEM_HANDLERS, 10),
        _ => return false,
    };
    machine().word(address) >> bit & 1 != 0
}

/// May this instruction, both half-words of it, end an exception: `bx`, `pop {.., pc}`, `ldm` and `ldr` with pc (ARM DDI 0403E B1.5.8)?
const fn is_return(code: u32) -> bool {
    code & 0xFF87 == 0x4700
        || code & 0xFF00 == 0xBD00
        || code & 0x8000_FE50 == 0x8000_E810
        || code & 0xF000_FFF0 == 0xF000_F850
        || code & 0xF000_FFF0 == 0xF000_F8D0
}
