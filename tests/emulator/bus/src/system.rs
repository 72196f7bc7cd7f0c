//! The system control space: interrupt controller and system control block are QEMU's own, SysTick is refused.

use std::sync::atomic::{AtomicBool, Ordering};

use crate::bus;
use crate::machine::{SYSTEM, machine};
use crate::qemu::{Address, Opaque};

/// SYST_CSR to SYST_CALIB.
const SYSTICK: core::ops::Range<u64> = 0x10..0x20;

/// QEMU's SysTick would count the host's time.
fn refuse_systick(offset: u64) {
    if SYSTICK.contains(&offset) {
        let pc = bus().blocks.current.pc();
        let address = u64::from(SYSTEM) + offset;
        bus().fail(&format!(
            "the product uses SysTick (access to {address:#010x}, pc {pc:#010x}), which does not follow simulated time; use a timer of the part"
        ));
    }
}

/// AIRCR.
const RESET_CONTROL: u64 = 0xD0C;
/// DHCSR.
const DEBUG_CONTROL: u64 = 0xDF0;

/// A debugger is attached (C_DEBUGEN).
static DEBUGGER: AtomicBool = AtomicBool::new(false);

pub(crate) fn attach_debugger(attached: bool) {
    DEBUGGER.store(attached, Ordering::Relaxed);
}

/// A read in the system control space. Not only the product comes here, but the bus itself, in the middle of its work: nothing of its state is
/// touched unless the product is at fault.
pub(crate) unsafe extern "C" fn region_read(_base: Opaque, offset: Address, width: u32) -> u64 {
    refuse_systick(offset);
    let debugger = offset == DEBUG_CONTROL && DEBUGGER.load(Ordering::Relaxed);
    u64::from(machine().system_read(offset, width)) | u64::from(debugger)
}

/// A write of the product: what it pends or enables acts behind this very instruction.
pub(crate) unsafe extern "C" fn region_write(_base: Opaque, offset: Address, value: u64, width: u32) {
    refuse_systick(offset);
    if offset == RESET_CONTROL && value >> 16 == 0x05FA && value & 1 << 2 != 0 {
        // SYSRESETREQ.
        bus().reset_requested();
    }
    let blocks = &mut bus().blocks;
    if !blocks.current.is_alone() {
        blocks.leave(0, None);
    }
    machine().system_write(offset, value as u32, width);
}
