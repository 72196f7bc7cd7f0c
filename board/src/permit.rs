//! Who may have a word programmed into the flash, and when.

use core::sync::atomic::{AtomicU8, AtomicU32, Ordering};

/// Says when [`ParameterFlash`](crate::parameter_flash::ParameterFlash) may program: always, or one word at each grant.
///
/// A word stops the processor for 16 us, 100 us at most. Whoever knows that nothing is due for so long grants one, for the few microseconds for which that
/// is true, just before the future that writes is polled: what the future does before its word, and what interrupts it, may take longer. None of this
/// waits: these are single atomic operations, for a static.
#[derive(Debug)]
pub struct Permit {
    state: AtomicU8,
    /// Until when a grant holds, in us as they come.
    until: AtomicU32,
}

const NONE: u8 = 0;
const ONE_WORD: u8 = 1;
const ALWAYS: u8 = 2;
/// Somebody has asked in vain.
const WANTED: u8 = 3;

impl Permit {
    /// Nothing is permitted.
    #[must_use]
    pub const fn new() -> Self {
        Self { state: AtomicU8::new(NONE), until: AtomicU32::new(0) }
    }

    /// From now on words are programmed and sectors erased whenever they are asked for: at start, before the drive takes part in a ring.
    pub fn always(&self) {
        self.state.store(ALWAYS, Ordering::Relaxed);
    }

    /// From now on a word needs a grant, and no sector is erased.
    pub fn only_when_granted(&self) {
        self.state.store(NONE, Ordering::Relaxed);
    }

    /// One word may be programmed before `until`, in us (they wrap). Granting twice permits one; where everything is permitted it changes nothing.
    pub fn grant(&self, until: u32) {
        self.until.store(until, Ordering::Relaxed);
        if !self.is_always() {
            self.state.store(ONE_WORD, Ordering::Relaxed);
        }
    }

    /// Takes a grant back that nobody has used.
    pub fn withdraw(&self) {
        let _ = self.replace(ONE_WORD, NONE);
    }

    /// May sectors be erased?
    #[must_use]
    pub fn is_always(&self) -> bool {
        self.state.load(Ordering::Relaxed) == ALWAYS
    }

    /// A word waits for a grant.
    #[must_use]
    pub fn is_wanted(&self) -> bool {
        self.state.load(Ordering::Relaxed) == WANTED
    }

    /// Uses a grant up at this time. `false`: there is none, or none any more.
    pub(crate) fn take(&self, now: u32) -> bool {
        if self.is_always() {
            return true;
        }
        let left = self.until.load(Ordering::Relaxed).wrapping_sub(now).cast_signed();
        let granted = self.replace(ONE_WORD, NONE) && left > 0;
        if !granted {
            self.state.store(WANTED, Ordering::Relaxed);
        }
        granted
    }

    fn replace(&self, old: u8, new: u8) -> bool {
        self.state.compare_exchange(old, new, Ordering::Relaxed, Ordering::Relaxed).is_ok()
    }
}

impl Default for Permit {
    fn default() -> Self {
        Self::new()
    }
}
