//! Faults that run on, resets, and instructions that a test plants, on programs of a few instructions.

use std::path::PathBuf;

use crate::program::{Nothing, Program};
use emulator::{EmulatorError, Guest, GuestConfiguration, Reset, What};
use ring::Nanoseconds;

const START: u32 = 0x0800_0200;
const HANDLER: u32 = 0x0800_0240;
const HARD_FAULT: u32 = 3;
const RCC: u32 = 0x4002_3800;
const RESET_FLAGS: u32 = RCC + 0x74;
const COUNTER: u32 = 0x2000_1000;

fn guest(program: &Program) -> (tempfile::TempDir, Guest) {
    let bus = std::env::var_os("BUS_PLUGIN");
    let bus: PathBuf = bus.unwrap_or_else(|| panic!("BUS_PLUGIN is not set: run `cargo xtask test`")).into();
    let folder = tempfile::tempdir().unwrap();
    let guest = Guest::start(&GuestConfiguration::new(program.write(folder.path()), bus)).unwrap();
    (folder, guest)
}

fn run(guest: &mut Guest) -> Result<(), EmulatorError> {
    for _ in 0..50 {
        let now = guest.next_event().unwrap();
        guest.run(&mut Nothing, now, now + Nanoseconds::from_microseconds(10))?;
    }
    Ok(())
}

fn whats(guest: &Guest) -> Vec<What> {
    guest.incidents().iter().map(|incident| incident.what).collect()
}

/// Keeps the flags of the reset, counts a word of the RAM up, and reads the flags for ever.
fn counts_starts() -> Program {
    Program::new(START)
        // ldr r3, [pc, #16]; ldr r1, [pc, #20]; ldr r2, [r3]; str r2, [r1, #4]; ldr r0, [r1]; adds r0, #1; str r0, [r1];
        // again: ldr r2, [r3]; b again
        .code(START, &[0x4b04, 0x4905, 0x681a, 0x604a, 0x6808, 0x3001, 0x6008, 0x681a, 0xe7fd, 0xbf00])
        .word(START + 20, RESET_FLAGS)
        .word(START + 24, COUNTER)
}

/// SYSRESETREQ.
fn resets_itself() -> Program {
    Program::new(START)
        // ldr r3, [pc, #8]; ldr r2, [pc, #12]; str r2, [r3]; b .
        .code(START, &[0x4b02, 0x4a03, 0x601a, 0xe7fe, 0xbf00, 0xbf00])
        .word(START + 12, 0xE000_ED0C)
        .word(START + 16, 0x05FA_0004)
}

/// Reads a register for ever; so does its handler of the hard fault.
fn reads() -> Program {
    const CODE: [u16; 4] = [0x4b01, 0x681a, 0xe7fd, 0xbf00];
    Program::new(START)
        .vector(HARD_FAULT, HANDLER)
        .code(START, &CODE)
        .word(START + 8, RCC)
        .code(HANDLER, &CODE)
        .word(HANDLER + 8, RCC)
}

#[test]
#[ignore = "needs QEMU and the bus: cargo xtask test"]
fn every_reset_keeps_the_ram_but_that_of_the_supply_and_adds_its_flags() {
    const OF_THE_SUPPLY: u32 = 0x0E00_0000;
    let (_folder, mut guest) = guest(&counts_starts());
    run(&mut guest).unwrap();
    let mut expected = [1, OF_THE_SUPPLY];
    assert_eq!(guest.read_memory(COUNTER, 2).unwrap(), expected);
    for (reset, flags) in [
        (Reset::Pin, 0x0400_0000),
        (Reset::BrownOut, 0x0600_0000),
        (Reset::Watchdog, 0x2400_0000),
        (Reset::WindowWatchdog, 0x4400_0000),
        (Reset::Software, 0x1400_0000),
    ] {
        let now = guest.next_event().unwrap();
        guest.reset(&mut Nothing, now, reset).unwrap();
        run(&mut guest).unwrap();
        // Nobody has cleared the flags.
        expected = [expected[0] + 1, expected[1] | flags];
        assert_eq!(guest.read_memory(COUNTER, 2).unwrap(), expected, "{reset:?}");
    }
    let now = guest.next_event().unwrap();
    guest.reset(&mut Nothing, now, Reset::PowerOn(5)).unwrap();
    run(&mut guest).unwrap();
    let [counter, flags] = guest.read_memory(COUNTER, 2).unwrap()[..] else { panic!() };
    assert_eq!(flags, OF_THE_SUPPLY);
    assert!(!(1..100).contains(&counter), "{counter}: noise was expected");
    assert_eq!(guest.incidents().len(), 6);
}

#[test]
#[ignore = "needs QEMU and the bus: cargo xtask test"]
fn a_product_that_resets_itself_ends_the_run_and_one_that_may_starts_again() {
    let (_folder, mut once) = guest(&resets_itself());
    let error = run(&mut once).unwrap_err();
    assert!(matches!(error, EmulatorError::SoftwareReset { pc, .. } if pc == START + 4), "{error}");
    let (_folder, mut again) = guest(&resets_itself());
    again.survive().unwrap();
    for _ in 0..3 {
        let now = again.next_event().unwrap();
        again.run(&mut Nothing, now, now + Nanoseconds::from_microseconds(10)).unwrap();
        let now = again.next_event().unwrap();
        again.run(&mut Nothing, now, now + Nanoseconds::from_microseconds(10)).unwrap();
    }
    assert_eq!(whats(&again)[..2], [What::Reset(Reset::Software); 2]);
}

#[test]
#[ignore = "needs QEMU and the bus: cargo xtask test"]
fn an_instruction_is_planted_into_the_running_product_and_is_gone_after_a_reset() {
    const UNDEFINED: u16 = 0xDE00;
    for survives in [false, true] {
        let (_folder, mut guest) = guest(&reads());
        if survives {
            guest.survive().unwrap();
        }
        run(&mut guest).unwrap();
        // In the place of the jump back.
        guest.write_instruction(START + 4, UNDEFINED).unwrap();
        let outcome = run(&mut guest);
        if !survives {
            assert!(matches!(outcome, Err(EmulatorError::Fault { .. })), "{outcome:?}");
            continue;
        }
        outcome.unwrap();
        assert_eq!(whats(&guest), [What::Handler(HARD_FAULT)]);
        let now = guest.next_event().unwrap();
        guest.reset(&mut Nothing, now, Reset::Pin).unwrap();
        run(&mut guest).unwrap();
        assert_eq!(whats(&guest), [What::Handler(HARD_FAULT), What::Reset(Reset::Pin)]);
    }
}
