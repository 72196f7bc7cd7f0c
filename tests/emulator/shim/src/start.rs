//! Reset: from QEMU's reset vector to the product's.

use core::arch::global_asm;

use crate::machine;
use crate::trap;

/// System exceptions and the 82 interrupts of the STM32F407, rounded up.
const VECTORS: usize = 112;
const HARD_FAULT: usize = 3;
const TIMER: usize = 16 + machine::TIMER_INTERRUPT as usize;
const PRODUCT_VECTORS: u32 = 0x0800_0000;

global_asm!(
    ".section .vectors, \"a\"",
    ".word shim_stack_top - 0x2000", // not the traps' stack, which starts anew at the top each time
    ".word shim_reset",
    ".word shim_hard_fault", // NMI: does not happen here
    ".word shim_hard_fault",
    ".section .text.shim_reset, \"ax\"",
    ".global shim_reset",
    ".thumb_func",
    "shim_reset:",
    "ldr r0, =shim_bss_start",
    "ldr r1, =shim_bss_end",
    "movs r2, #0",
    "0:",
    "cmp r0, r1",
    "bhs 1f",
    "str r2, [r0]",
    "adds r0, #4",
    "b 0b",
    "1:",
    "bl shim_start",
    "udf #9",
);

// SAFETY: both symbols are defined by the assembly of this crate; only their addresses are taken.
unsafe extern "C" {
    safe fn shim_hard_fault();
    safe fn shim_timer();
}

#[unsafe(link_section = ".ram_vectors")]
/// In its own section for the alignment that VTOR needs.
static VECTOR_TABLE: VectorTable = VectorTable(core::cell::UnsafeCell::new([0; VECTORS]));

#[repr(C, align(512))]
struct VectorTable(core::cell::UnsafeCell<[u32; VECTORS]>);

// SAFETY: written once before the product starts, by the only core; afterwards only the exception hardware reads it.
unsafe impl Sync for VectorTable {}

/// Everything between reset and the first instruction of the product.
#[unsafe(no_mangle)]
extern "C" fn shim_start() -> ! {
    let table = VECTOR_TABLE.0.get() as u32;
    for index in 0..VECTORS {
        let vector = match index {
            HARD_FAULT => shim_hard_fault as *const () as usize as u32,
            TIMER => shim_timer as *const () as usize as u32,
            _ => machine::read(PRODUCT_VECTORS + index as u32 * 4),
        };
        machine::write(table + index as u32 * 4, vector);
    }
    machine::set_vector_table(table);
    let timer_in_time = machine::start_timer();
    // SAFETY: both undefined instructions are caught by the shim's HardFault entry, which steps over them and keeps every register.
    unsafe {
        core::arch::asm!("udf #1", "udf #2");
    }
    trap::hello(timer_in_time);
    machine::close_peripherals();
    let stack = machine::read(PRODUCT_VECTORS);
    let reset = machine::read(PRODUCT_VECTORS + 4);
    // SAFETY: the product gets the processor as after its own reset: its stack, its entry, the rest of the registers unknown.
    // `udf #3` goes through the ordinary way out of a trap, which arms the timer.
    unsafe {
        core::arch::asm!(
            "msr msp, {stack}",
            "mov lr, #-1",
            "udf #3",
            "bx {reset}",
            stack = in(reg) stack,
            reset = in(reg) reset,
            options(noreturn)
        );
    }
}
