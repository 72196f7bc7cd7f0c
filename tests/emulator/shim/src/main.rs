//! The shim: takes the reset in QEMU, traps every peripheral access of the product and asks the host for the answer.
//!
//! * Start: [`start::shim_start`] copies the product's vector table to RAM, puts its own HardFault and TIM5 entries into it,
//!   closes the peripheral and external bus space by the MPU and jumps to the product's reset.
//! * Trap: any access there ends in [`trap::shim_trap`], which decodes the instruction at the stacked program counter,
//!   posts a write or asks the host for a read, and steps over the instruction.
//! * Time: QEMU's own TIM5 runs at 1 GHz, which is one count an instruction under `-icount shift=0`. Its count is set to the
//!   product's own ticks on the way out of every trap, so that it measures the product and not the shim.
//!
//! Inside HardFault the MPU is off, so that the shim reaches QEMU's real TIM5 without a change of mapping; the TIM5 handler
//! executes an undefined instruction to get there too.
#![no_std]
#![no_main]

#[allow(dead_code, unreachable_pub, reason = "shared with the host, where it is public and used in full")]
#[path = "../../link/src/protocol.rs"]
mod protocol;
#[allow(unreachable_pub, reason = "shared with the host, where it is public")]
#[path = "../../src/thumb.rs"]
mod thumb;

mod link;
mod machine;
mod start;
mod trap;

use core::panic::PanicInfo;

/// A panic of the shim cannot be reported over the link it may have broken: QEMU ends, the host sees it end.
#[panic_handler]
fn panic(_: &PanicInfo<'_>) -> ! {
    link::exit()
}
