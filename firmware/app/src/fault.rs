//! Where the program ends when it cannot go on: bridge off, brake closed, chopper off, the record of what happened, reset.
//!
//! | what | comes here by |
//! |---|---|
//! | hard fault, and every configurable fault: none is enabled | `HardFault` |
//! | stack that reaches its guard ([`board::stack_guard`]) | `HardFault` |
//! | panic | `panic`, then `HardFault` by `udf` |
//! | crystal that failed ([`board::clocks`]) | `NonMaskableInt` |
//! | loops that do not run (`board::loop_watchdog`) | `DefaultHandler` |
//! | interrupt that nobody is bound to | `DefaultHandler` |
//!
//! The handlers begin in assembly, because nothing of the program can be relied on, least of all its stack: off first, from constants, without memory.
//! Then the stack is one of their own. What hardware can do does not come here at all: break input, failed crystal and reset switch off by themselves.
//!
//! The drive resets itself instead of waiting for the watchdog. The ring controller sends the AT of a dead processor on and on, with a status that says
//! "in operation" and a position that stands; its reset, which comes with ours, takes that AT away, so that the master knows within two cycles. With a
//! debugger attached everything stays as it is, to be looked at.

use core::arch::naked_asm;
use core::panic::PanicInfo;

use board::crash::{self, Found};
use board::{brake_coil, bridge, chopper};
use cortex_m::peripheral::{DCB, SCB};

/// Bytes of the handlers' own stack; `cargo xtask budget` holds what they need against it.
const STACK_BYTES: usize = 2_048;

/// In `.uninit`: a stack needs no value.
#[repr(C, align(8))]
struct Stack(core::mem::MaybeUninit<[u8; STACK_BYTES]>);

#[unsafe(link_section = ".uninit.fault_stack")]
static mut FAULT_STACK: Stack = Stack(core::mem::MaybeUninit::uninit());

/// Bridge off with the fifth instruction, brake with the ninth, chopper with the thirteenth.
///
/// # Safety
/// The processor calls it, as the handler of an exception.
#[unsafe(naked)]
#[unsafe(no_mangle)]
#[allow(non_snake_case, reason = "the vector table looks for this name")]
pub(crate) unsafe extern "C" fn HardFault() -> ! {
    naked_asm!(
        // Nothing that would switch on again comes in between.
        "cpsid i",
        "movw r0, #{bridge_low}",
        "movt r0, #{bridge_high}",
        "movw r1, #{bridge_off}",
        "str r1, [r0]",
        "movw r0, #{brake_low}",
        "movt r0, #{brake_high}",
        "mov.w r1, #{brake_apply}",
        "str r1, [r0]",
        "movw r0, #{chopper_low}",
        "movt r0, #{chopper_high}",
        "mov.w r1, #{chopper_off}",
        "str r1, [r0]",
        "mov r0, sp",
        "mov r1, lr",
        "ldr r2, ={stack}",
        "add.w r2, r2, #{stack_bytes}",
        "mov sp, r2",
        "push {{r4-r11}}",
        "mov r2, sp",
        "bl {end}",
        "udf #0",
        ".ltorg",
        bridge_low = const bridge::BDTR & 0xFFFF,
        bridge_high = const bridge::BDTR >> 16,
        bridge_off = const bridge::OFF,
        brake_low = const brake_coil::BSRR & 0xFFFF,
        brake_high = const brake_coil::BSRR >> 16,
        brake_apply = const brake_coil::APPLY,
        chopper_low = const chopper::BSRR & 0xFFFF,
        chopper_high = const chopper::BSRR >> 16,
        chopper_off = const chopper::OFF,
        stack = sym FAULT_STACK,
        stack_bytes = const STACK_BYTES,
        end = sym end,
    )
}

/// As [`HardFault`].
///
/// # Safety
/// As of [`HardFault`].
#[unsafe(naked)]
#[unsafe(no_mangle)]
#[allow(non_snake_case, reason = "the vector table looks for this name")]
pub(crate) unsafe extern "C" fn NonMaskableInt() -> ! {
    naked_asm!("b.w {fault}", fault = sym HardFault)
}

/// As [`HardFault`].
///
/// # Safety
/// As of [`HardFault`].
#[unsafe(naked)]
#[unsafe(no_mangle)]
#[allow(non_snake_case, reason = "the vector table looks for this name")]
pub(crate) unsafe extern "C" fn DefaultHandler() -> ! {
    naked_asm!("b.w {fault}", fault = sym HardFault)
}

/// On the handlers' own stack: bridge, brake and chopper are off.
extern "C" fn end(stack: u32, link: u32, high_registers: &[u32; 8]) -> ! {
    crash::keep(crash::examine(&Found { stack, link, high_registers: *high_registers }));
    while DCB::is_debugger_attached() {
        cortex_m::asm::nop();
    }
    SCB::sys_reset()
}

/// Off first; what follows may fail and then ends in the hard fault as well.
#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    cortex_m::interrupt::disable();
    bridge::off();
    brake_coil::apply();
    chopper::off();
    if let Some(place) = info.location() {
        crash::note_panic(place.file(), place.line());
    }
    defmt::error!("{}", defmt::Display2Format(info));
    cortex_m::asm::udf()
}
