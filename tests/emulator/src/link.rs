//! The way to the guest: a page shared with the bus inside QEMU, or two FIFOs to the shim beside the product.

use std::fs::{File, OpenOptions};
use std::io::{Read, Write};
use std::path::Path;
use std::time::Duration;

use emulator_link::protocol::{FROM_HOST, MESSAGE_WORDS, TO_HOST};
use emulator_link::{Page, Side};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::{CWD, FileType, Mode, OFlags, mknodat};

use crate::EmulatorError;

/// Name of the page in QEMU's folder.
pub(crate) const PAGE: &str = "page";

/// Either way.
#[derive(Debug)]
pub(crate) enum Link {
    /// Of the bus.
    Page(Page),
    /// Of the shim.
    Fifos { from_shim: File, to_shim: File, bytes: Vec<u8> },
}

impl Link {
    /// A page in this folder.
    pub(crate) fn page(folder: &Path) -> Result<Self, EmulatorError> {
        Ok(Self::Page(Page::create(&folder.join(PAGE))?))
    }

    /// Two FIFOs in this folder.
    pub(crate) fn fifos(folder: &Path) -> Result<Self, EmulatorError> {
        for name in [TO_HOST, FROM_HOST] {
            let mode = Mode::RUSR | Mode::WUSR;
            mknodat(CWD, folder.join(name), FileType::Fifo, mode, 0)
                .map_err(|error| EmulatorError::Io { what: "creating a FIFO", source: error.into() })?;
        }
        // Opened for both directions, so that neither open waits for QEMU.
        let open = |name: &str| {
            let path = folder.join(name);
            OpenOptions::new().read(true).write(true).open(path).map_err(EmulatorError::io("opening a FIFO"))
        };
        let (from_shim, to_shim) = (open(TO_HOST)?, open(FROM_HOST)?);
        rustix::fs::fcntl_setfl(&from_shim, OFlags::NONBLOCK)
            .map_err(|error| EmulatorError::Io { what: "FIFO mode", source: error.into() })?;
        Ok(Self::Fifos { from_shim, to_shim, bytes: vec![0; MESSAGE_WORDS * 4] })
    }

    /// Sends one command.
    pub(crate) fn send(&mut self, words: &[u32]) -> Result<(), EmulatorError> {
        match self {
            Self::Page(page) => page.send(Side::Host, words).map_err(EmulatorError::io("waking the bus")),
            Self::Fifos { to_shim, bytes, .. } => {
                for (bytes, word) in bytes.chunks_exact_mut(4).zip(words) {
                    bytes.copy_from_slice(&word.to_le_bytes());
                }
                to_shim.write_all(&bytes[..words.len() * 4]).map_err(EmulatorError::io("writing to the shim"))
            }
        }
    }

    /// Waits for one message, at most for `patience`. `false`: none has come.
    pub(crate) fn receive(&mut self, words: &mut Vec<u32>, patience: Duration) -> Result<bool, EmulatorError> {
        match self {
            Self::Page(page) => {
                if !page.wait(Side::Host, Some(patience)).map_err(EmulatorError::io("waiting for the bus"))? {
                    return Ok(false);
                }
                words.clear();
                words.extend(page.message(Side::Guest));
                Ok(true)
            }
            Self::Fifos { from_shim, bytes, .. } => {
                let Some(length) = read(from_shim, bytes, patience)? else { return Ok(false) };
                let word = |word: &[u8]| u32::from_le_bytes([word[0], word[1], word[2], word[3]]);
                words.clear();
                words.extend(bytes[..length].chunks_exact(4).map(word));
                Ok(true)
            }
        }
    }
}

/// One message of the shim in bytes.
fn read(from_shim: &mut File, bytes: &mut [u8], patience: Duration) -> Result<Option<usize>, EmulatorError> {
    loop {
        match from_shim.read(bytes) {
            Ok(length) => return Ok(Some(length)),
            Err(error) if error.kind() == std::io::ErrorKind::WouldBlock => {}
            Err(error) => return Err(EmulatorError::io("reading from the shim")(error)),
        }
        let mut files = [PollFd::new(&*from_shim, PollFlags::IN)];
        let patience = Timespec::try_from(patience).ok();
        match poll(&mut files, patience.as_ref()) {
            Ok(0) => return Ok(None),
            Ok(_) | Err(rustix::io::Errno::INTR) => {}
            Err(error) => return Err(EmulatorError::Io { what: "waiting for the shim", source: error.into() }),
        }
    }
}
