//! A guard below the stack: the memory protection unit lets nobody touch it.
//!
//! The stack grows down from the end of the RAM; below it, behind a gap that nothing uses, lie the program's statics. The guard stands right above
//! them. A stack that has used the gap up reaches the guard before a static, and ends in a hard fault, in which the guard is open (HFNMIENA = 0), so
//! that whatever the exception could not stack is lost and nothing else.
//!
//! A function that takes a larger frame than the guard could step over it. `cargo xtask budget` looks for one.

use core::ops::Range;

use cortex_m::peripheral::MPU;

/// Bytes of the guard: the largest frame of a function that runs with the guard, and an exception on top of it.
pub const BYTES: u32 = 8 * 1024;

/// Bytes of each region that the guard is made of, a power of two. A region begins at a multiple of its size, so that one of 8 KiB would leave 4 KiB unused
/// below it on average; of the part's eight regions these take four.
const REGION_BYTES: u32 = 2 * 1024;

/// RASR of a region (ARM DDI 0403E B3.5.9): nobody reads, writes or executes.
const ATTRIBUTES: u32 = {
    const ENABLE: u32 = 1;
    const SIZE: u32 = (REGION_BYTES.trailing_zeros() - 1) << 1;
    const EXECUTE_NEVER: u32 = 1 << 28;
    ENABLE | SIZE | EXECUTE_NEVER
};

/// The memory that is guarded.
#[must_use]
pub fn range() -> Range<u32> {
    unsafe extern "C" {
        /// Behind the last static; from the linker script.
        static __sheap: u32;
    }
    let end_of_statics = (&raw const __sheap).addr() as u32;
    let start = end_of_statics.next_multiple_of(REGION_BYTES);
    start..start.wrapping_add(BYTES)
}

/// Sets the guard up. Everything else stays as without a protection unit.
pub fn start(unit: &MPU) {
    const ENABLE: u32 = 1;
    /// Of RBAR (B3.5.8): the region is the one that bits 3 to 0 name.
    const VALID: u32 = 1 << 4;
    /// Where no region is, the default memory map counts.
    const DEFAULT_MAP: u32 = 1 << 2;
    // SAFETY: the regions lie in RAM that neither statics nor, as long as all is well, the stack use: nothing that is accessed becomes
    // inaccessible.
    unsafe {
        for (number, start) in (0..).zip(range().step_by(REGION_BYTES as usize)) {
            unit.rbar.write(start | VALID | number);
            unit.rasr.write(ATTRIBUTES);
        }
        unit.ctrl.write(ENABLE | DEFAULT_MAP);
    }
    cortex_m::asm::dsb();
    cortex_m::asm::isb();
}

const _: () = assert!(BYTES.is_multiple_of(REGION_BYTES) && BYTES / REGION_BYTES <= 8);
const _: () = assert!(REGION_BYTES.is_power_of_two() && ATTRIBUTES == 0x1000_0015);
