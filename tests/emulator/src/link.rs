//! The way to the guest: a page shared with the bus inside QEMU.

use std::path::Path;
use std::time::Duration;

use emulator_link::{Page, Side};

use crate::EmulatorError;

/// Name of the page in QEMU's folder.
pub(crate) const PAGE: &str = "page";

/// The page.
#[derive(Debug)]
pub(crate) struct Link(Page);

impl Link {
    /// A page in this folder.
    pub(crate) fn in_folder(folder: &Path) -> Result<Self, EmulatorError> {
        Ok(Self(Page::create(&folder.join(PAGE))?))
    }

    /// Sends one command.
    pub(crate) fn send(&self, words: &[u32]) -> Result<(), EmulatorError> {
        self.0.send(Side::Host, words).map_err(EmulatorError::io("waking the bus"))
    }

    /// Waits for one message, at most for `patience`. `false`: none has come.
    pub(crate) fn receive(&self, words: &mut Vec<u32>, patience: Duration) -> Result<bool, EmulatorError> {
        if !self.0.wait(Side::Host, Some(patience)).map_err(EmulatorError::io("waiting for the bus"))? {
            return Ok(false);
        }
        words.clear();
        words.extend(self.0.message(Side::Guest));
        Ok(true)
    }
}
