//! Who may have a word programmed into the flash, and when.

use core::sync::atomic::{AtomicU8, Ordering};

/// Says when [`ParameterFlash`](crate::parameter_flash::ParameterFlash) may program: always, or one word at each grant.
///
/// A word stops the processor for 16 us, 100 us at most. Whoever knows that nothing is due for so long grants one just before the future that writes
/// is polled, and withdraws what is left behind it. Neither waits: these are single atomic operations on one byte, for a static.
#[derive(Debug)]
pub struct Permit(AtomicU8);

const NONE: u8 = 0;
const ONE_WORD: u8 = 1;
const ALWAYS: u8 = 2;

impl Permit {
    /// Nothing is permitted.
    #[must_use]
    pub const fn new() -> Self {
        Self(AtomicU8::new(NONE))
    }

    /// From now on words are programmed and sectors erased whenever they are asked for: at start, before the drive takes part in a ring.
    pub fn always(&self) {
        self.0.store(ALWAYS, Ordering::Relaxed);
    }

    /// From now on a word needs a grant, and no sector is erased.
    pub fn only_when_granted(&self) {
        self.0.store(NONE, Ordering::Relaxed);
    }

    /// One word may be programmed, now. Granting twice permits one; where everything is permitted it changes nothing.
    pub fn grant(&self) {
        self.replace(NONE, ONE_WORD);
    }

    /// Takes a grant back. `true`: it was used.
    pub fn withdraw(&self) -> bool {
        !self.replace(ONE_WORD, NONE)
    }

    /// May sectors be erased?
    #[must_use]
    pub fn is_always(&self) -> bool {
        self.0.load(Ordering::Relaxed) == ALWAYS
    }

    /// Uses a grant up. `false`: there is none.
    pub(crate) fn take(&self) -> bool {
        self.is_always() || self.replace(ONE_WORD, NONE)
    }

    fn replace(&self, old: u8, new: u8) -> bool {
        self.0.compare_exchange(old, new, Ordering::Relaxed, Ordering::Relaxed).is_ok()
    }
}

impl Default for Permit {
    fn default() -> Self {
        Self::new()
    }
}
