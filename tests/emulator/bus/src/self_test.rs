//! Before the product runs: does this QEMU do what the bus relies on?
//!
//! A word goes through the window both ways, an interrupt is pended and cleared. That instructions are counted is proven on the product's first
//! three, see [`crate::blocks`].

use std::sync::atomic::{AtomicBool, AtomicU32, Ordering::Relaxed};

use crate::machine::{Raised, machine};

static RUNS: AtomicBool = AtomicBool::new(false);
static WORD: AtomicU32 = AtomicU32::new(0);

/// The last words of both windows: no peripheral is there.
const ADDRESSES: [u32; 2] = [0x7FFF_FFFC, 0xBFFF_FFFC];
const TEST_WORD: u32 = 0x5EC0_05A7;

/// The error says what does not work and what to do.
pub(crate) fn run() -> Result<(), String> {
    RUNS.store(true, Relaxed);
    let outcome = windows().and_then(|()| interrupt());
    RUNS.store(false, Relaxed);
    outcome.map_err(|what| format!("{what} in this QEMU; use QEMU 7.2, 10.0 or 11.1"))
}

fn windows() -> Result<(), String> {
    for address in ADDRESSES {
        WORD.store(0, Relaxed);
        machine().set_word(address, TEST_WORD);
        let (arrived, read) = (WORD.load(Relaxed), machine().word(address));
        if arrived != TEST_WORD ^ address || read != !TEST_WORD {
            return Err(format!("a word written to {address:08x} arrives as {arrived:08x}, and is read as {read:08x}"));
        }
    }
    Ok(())
}

/// The last interrupt of the machine, which the STM32F407 does not have.
fn interrupt() -> Result<(), String> {
    const SET_PENDING: u64 = 0x208;
    const CLEAR_PENDING: u64 = 0x288;
    const LAST: u32 = 1 << 31;
    let pending = machine().locked(|| {
        machine().pend(&Raised { edges: [0, 0, LAST], ..Raised::default() });
        let raised = machine().system_read(SET_PENDING, 4);
        machine().system_write(CLEAR_PENDING, LAST, 4);
        [raised, machine().system_read(SET_PENDING, 4)]
    });
    if pending == [LAST, 0] {
        return Ok(());
    }
    Err(format!("an interrupt that was pended and cleared is seen as {:08x} and {:08x}", pending[0], pending[1]))
}

/// The answer to a read of the test.
pub(crate) fn answer(address: u32) -> Option<u32> {
    RUNS.load(Relaxed).then(|| if ADDRESSES.contains(&address) { !TEST_WORD } else { 0 })
}

/// Takes a write of the test; `false`: it is none.
pub(crate) fn take(address: u32, value: u32, width: u32) -> bool {
    let runs = RUNS.load(Relaxed);
    if runs && width == 4 {
        WORD.store(value ^ address, Relaxed);
    }
    runs
}
