//! The trace counts right: a program of known instructions, counted by the trace and by the clock of the rig.

mod program;

use std::path::{Path, PathBuf};

use emulator::{Activations, Guest, GuestConfiguration, Listing, Rig, Spread, Step, TraceSink, Tracer};
use program::Nothing;
use ring::Nanoseconds;

const CODE: std::ops::Range<u32> = 0x0800_0000..0x080C_0000;
const SUPERVISOR_CALL: u16 = 11;
const START: u32 = 0x0800_0200;
const HANDLER: u32 = 0x0800_0240;
const FUNCTION: u32 = 0x0800_0260;

/// The thread calls the handler for ever and reads a register of the RCC in between, so that the host sees it.
const THREAD: [u16; 6] = [
    0x4b02, //         ldr r3, [pc, #8]
    0x681a, // again:  ldr r2, [r3]
    0xdf00, //         svc #0
    0xe7fc, //         b again
    0xbf00, //         nop
    0xbf00, //         nop
];
const REGISTER: u32 = 0x4002_3800;
/// 1 + 1 + 1 + (1 + 50 * 2) + the function + 1.
const HANDLER_CODE: [u16; 9] = [
    0xb510, //         push {r4, lr}
    0x6818, //         ldr r0, [r3]: trapped
    0x2432, //         movs r4, #50
    0x3c01, // again:  subs r4, #1
    0xd1fd, //         bne again
    0xf000, 0xf809, // bl FUNCTION
    0xbd10, //         pop {r4, pc}
    0xbf00, //         nop
];
const CALL: u32 = HANDLER + 10;
/// 1 + 7 * 2 + 1.
const FUNCTION_CODE: [u16; 4] = [
    0x2007, //         movs r0, #7
    0x3801, // again:  subs r0, #1
    0xd1fd, //         bne again
    0x4770, //         bx lr
];
const OF_FUNCTION: u64 = 16;
const OF_HANDLER: u64 = 3 + 50 * 2 + 1 + OF_FUNCTION + 1;

fn product() -> program::Program {
    program::Program::new(START)
        .vector(SUPERVISOR_CALL.into(), HANDLER)
        .code(START, &THREAD)
        .word(START + 12, REGISTER)
        .code(HANDLER, &HANDLER_CODE)
        .code(FUNCTION, &FUNCTION_CODE)
}

fn path(name: &str) -> PathBuf {
    let path = std::env::var_os(name);
    path.unwrap_or_else(|| panic!("{name} is not set: run `cargo xtask test`, which builds the ELF")).into()
}

fn start<S: TraceSink>(product: &Path, tracer: &Tracer<S>) -> Guest {
    let configuration = GuestConfiguration::new(product, Rig::Shim(path("SHIM_ELF")));
    Guest::start(&GuestConfiguration { arguments: tracer.arguments(), ..configuration }).unwrap()
}

/// So many exchanges further.
fn exchanges(guest: &mut Guest, number: usize) {
    for _ in 0..number {
        let now = guest.next_event().unwrap();
        guest.run(&mut Nothing, now, now + Nanoseconds::from_millis(10)).unwrap();
    }
}

fn until_on<S: TraceSink>(guest: &mut Guest, tracer: &mut Tracer<S>) {
    tracer.switch_on().unwrap();
    for _ in 0..100_000 {
        if tracer.is_on() {
            return;
        }
        exchanges(guest, 1);
    }
    panic!("QEMU does not trace");
}

#[test]
#[ignore = "needs QEMU and the ELF: cargo xtask test"]
fn a_handler_of_known_instructions_is_counted_to_the_instruction() {
    let folder = tempfile::tempdir().unwrap();
    let product = product().write(folder.path());
    let listing = Listing {
        steps: [(CALL, Step::Call(CALL + 4))].into(),
        functions: [(FUNCTION, "function".to_owned())].into(),
        slow_bus: 0x4000_0000..0x5000_0000,
        ..Listing::default()
    };
    let mut tracer = Tracer::new(CODE, Activations::new(listing)).unwrap();
    let mut guest = start(&product, &tracer);
    exchanges(&mut guest, 10);
    let before = guest.measurements().instructions;
    exchanges(&mut guest, 100);
    let untraced = guest.measurements().instructions - before;
    until_on(&mut guest, &mut tracer);
    exchanges(&mut guest, 10);
    tracer.mark().unwrap();
    let before = guest.measurements().instructions;
    exchanges(&mut guest, 100);
    tracer.mark().unwrap();
    let by_the_rig = guest.measurements().instructions - before;
    drop(guest);
    let count = tracer.finish().unwrap();
    // Two exchanges a turn, and the first of the handlers began before the mark or the last ends after it.
    let handler = count.tasks()[&SUPERVISOR_CALL];
    assert!((49..=50).contains(&handler.own.count), "{handler:?}");
    let exactly =
        |value| Spread { count: handler.own.count, least: value, most: value, sum: value * handler.own.count };
    assert_eq!((handler.own, handler.bus), (exactly(OF_HANDLER), exactly(1)));
    assert_eq!(count.functions()["function"].least, OF_FUNCTION);
    assert_eq!(count.functions()["function"].most, OF_FUNCTION);
    // The rig counts by QEMU's clock, in which an instruction is a nanosecond.
    assert_eq!(by_the_rig, count.executed());
    assert_eq!(by_the_rig, untraced, "tracing changes the program's time");
    assert_eq!(count.executed() / 50, OF_HANDLER + 3);
}

/// What a program does in so many exchanges.
fn accesses_of(rig: Rig, product: &Path, number: usize) -> (emulator::Trace, u64) {
    let mut guest = Guest::start(&GuestConfiguration::new(product, rig)).unwrap();
    exchanges(&mut guest, number);
    (guest.measurements().trace, guest.measurements().instructions)
}

#[test]
#[ignore = "needs QEMU and the ELF: cargo xtask test"]
fn bus_and_shim_count_the_same_ticks() {
    let folder = tempfile::tempdir().unwrap();
    let product = product().write(folder.path());
    let with_bus = accesses_of(Rig::Bus(path("BUS_PLUGIN")), &product, 1_000);
    println!("trace {}, {} instructions", with_bus.0, with_bus.1);
    assert_eq!(accesses_of(Rig::Shim(path("SHIM_ELF")), &product, 1_000), with_bus);
}
