//! The trace counts right: a program of known instructions, counted by the trace and by the clock of the rig.

use std::path::PathBuf;

use crate::program::{self, Nothing};
use emulator::{Activations, Guest, GuestConfiguration, Listing, Spread, Step, TraceEvent, TraceSink};
use ring::Nanoseconds;

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

/// So many exchanges further.
fn exchanges(guest: &mut Guest, number: usize) {
    for _ in 0..number {
        let now = guest.next_event().unwrap();
        guest.run(&mut Nothing, now, now + Nanoseconds::from_millis(10)).unwrap();
    }
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
    let mut guest = Guest::start(&GuestConfiguration::new(&product, path("BUS_PLUGIN"))).unwrap();
    exchanges(&mut guest, 10);
    let instructions = |guest: &Guest| guest.measurements().instructions;
    let before = instructions(&guest);
    exchanges(&mut guest, 100);
    let untraced = instructions(&guest) - before;
    guest.begin_trace().unwrap();
    let before = instructions(&guest);
    exchanges(&mut guest, 100);
    let by_the_rig = instructions(&guest) - before;
    let mut count = Activations::new(listing);
    guest.end_trace(&mut count).unwrap();
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

/// The first interrupt pends the second, which interrupts it, and then itself: it ends and begins again with no instruction in between.
#[test]
#[ignore = "needs QEMU and the ELF: cargo xtask test"]
fn handlers_that_interrupt_each_other_and_follow_themselves_are_told_apart() {
    const FIRST: u16 = 16;
    const SECOND: u16 = 17;
    const SECOND_HANDLER: u32 = FUNCTION;
    const LITERALS: u32 = START + 24;
    let thread = [
        0x4b05, // ldr r3, =NVIC_ISER0
        0x2203, // movs r2, #3
        0x601a, // str r2, [r3]
        0x4b05, // ldr r3, =NVIC_IPR0
        0x2280, // movs r2, #0x80
        0x601a, // str r2, [r3]: the first gives way to the second
        0x4c04, // ldr r4, =NVIC_ISPR0
        0x4d05, // ldr r5, =REGISTER
        0x2602, // movs r6, #2
        0x2701, // movs r7, #1
        0x6027, // str r7, [r4]
        0xe7fe, // b .
    ];
    let first = [
        0x6026, // str r6, [r4]: pends the second
        0xbf00, // nop
        0x6828, // ldr r0, [r5]
        0x6027, // str r7, [r4]: pends itself
        0x4770, // bx lr
    ];
    let second = [
        0x6828, // ldr r0, [r5]
        0x4770, // bx lr
    ];
    let folder = tempfile::tempdir().unwrap();
    let product = program::Program::new(START)
        .vector(FIRST.into(), HANDLER)
        .vector(SECOND.into(), SECOND_HANDLER)
        .code(START, &thread)
        .word(LITERALS, 0xE000_E100)
        .word(LITERALS + 4, 0xE000_E400)
        .word(LITERALS + 8, 0xE000_E200)
        .word(LITERALS + 12, REGISTER)
        .code(HANDLER, &first)
        .code(SECOND_HANDLER, &second)
        .write(folder.path());
    let mut guest = Guest::start(&GuestConfiguration::new(&product, path("BUS_PLUGIN"))).unwrap();
    exchanges(&mut guest, 100);
    guest.begin_trace().unwrap();
    exchanges(&mut guest, 100);
    let mut count = Activations::new(Listing::default());
    guest.end_trace(&mut count).unwrap();
    let [first, second] = [FIRST, SECOND].map(|exception| count.tasks()[&exception]);
    let exactly = |spread: Spread, value| {
        assert!(spread.count >= 20, "{spread:?}");
        assert_eq!((spread.least, spread.most), (value, value), "{spread:?}");
    };
    exactly(first.own, 5);
    exactly(first.with_preemption, 7);
    exactly(second.own, 2);
    assert!(first.own.count.abs_diff(second.own.count) <= 1, "{first:?}, {second:?}");
    // What is not whole lies at the two ends.
    assert!(count.executed() - first.own.sum - second.own.sum < 2 * 7, "{} executed", count.executed());
}

/// Counts events of the trace.
#[derive(Default)]
struct Instructions(u64);

impl TraceSink for Instructions {
    fn take(&mut self, event: TraceEvent) {
        self.0 += u64::from(matches!(event, TraceEvent::Instruction(_)));
    }
}

#[test]
#[ignore = "needs QEMU and the ELF: cargo xtask test"]
fn a_second_trace_begins_anew() {
    let folder = tempfile::tempdir().unwrap();
    let product = product().write(folder.path());
    let mut guest = Guest::start(&GuestConfiguration::new(&product, path("BUS_PLUGIN"))).unwrap();
    let [first, second] = [0; 2].map(|_| {
        guest.begin_trace().unwrap();
        exchanges(&mut guest, 100);
        let mut count = Instructions::default();
        guest.end_trace(&mut count).unwrap();
        count.0
    });
    assert!(first.abs_diff(second) <= OF_HANDLER && first > 49 * OF_HANDLER, "{first}, {second}");
}

#[test]
#[ignore = "needs QEMU and the ELF: cargo xtask test"]
fn ticks_are_those_that_were_counted_otherwise_before() {
    let folder = tempfile::tempdir().unwrap();
    let product = product().write(folder.path());
    let mut guest = Guest::start(&GuestConfiguration::new(&product, path("BUS_PLUGIN"))).unwrap();
    exchanges(&mut guest, 1_000);
    let measured = guest.measurements();
    // What QEMU's own count of instructions gave, with traps in the place of the bus.
    assert_eq!(measured.trace.to_string(), "5cd53ef1ef0690db over 999 accesses");
    assert_eq!(measured.instructions, 61_877);
}
