//! The trace counts right: a program of known instructions, counted by the trace and by the clock of the rig.

use std::path::{Path, PathBuf};

use emulator::{Activations, Environment, Guest, GuestConfiguration, Listing, Rig, Spread, Step, TraceSink, Tracer};
use ring::Nanoseconds;

/// A world in which nothing is connected.
struct Nothing;

impl Environment for Nothing {
    fn external_read(&mut self, _: Nanoseconds, _: u32) -> u16 {
        0
    }
    fn external_write(&mut self, _: Nanoseconds, _: u32, _: u16) {}
    fn interrupt_pins(&self) -> (bool, bool) {
        (true, true)
    }
    fn encoder_count(&mut self, _: Nanoseconds) -> u32 {
        0
    }
    fn address_switches(&self) -> u8 {
        2
    }
}

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

/// The smallest ELF that the rig accepts: one segment, which is the section `.vector_table`.
fn elf() -> Vec<u8> {
    let mut image = vec![0_u8; 0x280];
    let mut put = |address: u32, bytes: &[u8]| {
        let at = (address - CODE.start) as usize;
        image[at..at + bytes.len()].copy_from_slice(bytes);
    };
    put(CODE.start, &0x2000_8000_u32.to_le_bytes());
    put(CODE.start + 4, &(START | 1).to_le_bytes());
    put(CODE.start + 4 * u32::from(SUPERVISOR_CALL), &(HANDLER | 1).to_le_bytes());
    for (address, code) in [(START, &THREAD[..]), (HANDLER, &HANDLER_CODE), (FUNCTION, &FUNCTION_CODE)] {
        put(address, &code.iter().flat_map(|half| half.to_le_bytes()).collect::<Vec<_>>());
    }
    put(START + 12, &REGISTER.to_le_bytes());
    let names = b"\0.vector_table\0.names\0";
    let image_at = 52 + 32;
    let names_at = image_at + image.len() as u32;
    let sections_at = (names_at + names.len() as u32).next_multiple_of(4);
    let mut elf = b"\x7fELF\x01\x01\x01\0\0\0\0\0\0\0\0\0".to_vec();
    let mut words = |half: &[u16], words: &[u32], more: &[u16]| {
        elf.extend(half.iter().flat_map(|half| half.to_le_bytes()));
        elf.extend(words.iter().flat_map(|word| word.to_le_bytes()));
        elf.extend(more.iter().flat_map(|half| half.to_le_bytes()));
    };
    // Executable for ARM, EABI 5; one program header, three section headers, names in the last.
    words(&[2, 40], &[1, START | 1, 52, sections_at, 0x0500_0000], &[52, 32, 1, 40, 3, 2]);
    let size = image.len() as u32;
    words(&[], &[1, image_at, CODE.start, CODE.start, size, size, 5, 4], &[]);
    elf.extend(&image);
    elf.extend(names);
    elf.resize(sections_at as usize, 0);
    for section in [
        [0; 10],
        [1, 1, 6, CODE.start, image_at, size, 0, 0, 4, 0],
        [15, 3, 0, 0, names_at, names.len() as u32, 0, 0, 1, 0],
    ] {
        elf.extend(section.iter().flat_map(|word| word.to_le_bytes()));
    }
    elf
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
    let product = folder.path().join("known");
    std::fs::write(&product, elf()).unwrap();
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
    // The rig counts by QEMU's clock, in which an instruction is a nanosecond; an access that traps takes none there.
    assert_eq!(by_the_rig + 100, count.executed());
    assert_eq!(by_the_rig, untraced, "tracing changes the program's time");
    assert_eq!(count.executed() / 50, OF_HANDLER + 3);
}
