//! The flash of the parameters, on a program of a few instructions that writes and copies what a table says.

use std::path::PathBuf;

use crate::program::Program;
use crate::quiet::Quiet;
use ::flash::{CAPACITY, FlashModel, SECTOR_BYTES, Speed, Width};
use emulator::{EmulatorError, Environment, Guest, GuestConfiguration, Reset, What, wiring};
use ring::Nanoseconds;

const START: u32 = 0x0800_0200;
const HANDLER: u32 = 0x0800_0240;
const TABLE: u32 = 0x0800_0280;
const RAM: u32 = 0x2000_1000;
const PARAMETERS: u32 = 0x080C_0000;
const CLOCK_ENABLES: u32 = 0x4002_3830;

/// An access of the program.
#[derive(Clone, Copy)]
enum Step {
    Write(u32, u32),
    /// From a word to a word.
    Copy(u32, u32),
}

const ACCESS_CONTROL: u32 = 0x4002_3C00;
const KEY: u32 = 0x4002_3C04;
const STATUS: u32 = 0x4002_3C0C;
const CONTROL: u32 = 0x4002_3C10;
const FIRST_KEY: Step = Step::Write(KEY, 0x4567_0123);
const SECOND_KEY: Step = Step::Write(KEY, 0xCDEF_89AB);
/// By words.
const PROGRAMS: Step = Step::Write(CONTROL, 0x201);
const LOCKS: Step = Step::Write(CONTROL, 1 << 31);
/// What the test sees the time of; the handler writes 0.
const fn mark(number: u32) -> Step {
    Step::Write(CLOCK_ENABLES, number << 16)
}

const fn program(offset: u32, word: u32) -> Step {
    Step::Write(PARAMETERS + offset, word)
}

const fn erase(sector: u32) -> [Step; 3] {
    [
        Step::Write(CONTROL, 0x202 | sector << 3),
        Step::Write(CONTROL, 0x1_0202 | sector << 3),
        // Both caches, which are off.
        Step::Write(ACCESS_CONTROL, 3 << 11),
    ]
}

fn program_of(steps: &[Step]) -> Program {
    const TIMER_5: u32 = 16 + 50;
    let pairs = steps.iter().flat_map(|step| match *step {
        Step::Write(address, value) => [address, value],
        Step::Copy(from, to) => [from | 1, to],
    });
    let table: Vec<u32> = pairs.chain([0, 0]).collect();
    Program::new(START)
        // ldr r4, [pc, #24]; next: ldm r4!, {r0, r1}; cmp r0, #0; beq done; lsrs r2, r0, #1; bhs copy; str r1, [r0]; b next
        .code(START, &[0x4c06, 0xcc03, 0x2800, 0xd007, 0x0842, 0xd201, 0x6001, 0xe7f8])
        // copy: subs r0, #1; ldr r2, [r0]; str r2, [r1]; b next; done: b done
        .code(START + 16, &[0x3801, 0x6802, 0x600a, 0xe7f4, 0xe7fe])
        .word(START + 28, TABLE)
        // ldr r0, [pc, #8]; movs r1, #0; str r1, [r0, #16]; ldr r0, [pc, #8]; str r1, [r0]; bx lr
        .code(HANDLER, &[0x4802, 0x2100, 0x6101, 0x4802, 0x6001, 0x4770])
        .word(HANDLER + 12, 0x4000_0C00)
        .word(HANDLER + 16, CLOCK_ENABLES)
        .vector(TIMER_5, HANDLER)
        .words(TABLE, &table)
}

/// Nothing is connected; the reset of the chip is looked at.
#[derive(Default)]
struct World {
    chip_reset: Vec<(Nanoseconds, bool)>,
}

impl Environment for World {
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
    fn set_chip_reset(&mut self, now: Nanoseconds, held: bool) {
        self.chip_reset.push((now, held));
    }
}

fn guest(steps: &[Step]) -> (tempfile::TempDir, Guest) {
    let bus = std::env::var_os("BUS_PLUGIN");
    let bus: PathBuf = bus.unwrap_or_else(|| panic!("BUS_PLUGIN is not set: run `cargo xtask test`")).into();
    let folder = tempfile::tempdir().unwrap();
    let product = program_of(steps).write(folder.path());
    let mut guest = Guest::start(&GuestConfiguration::new(product, bus)).unwrap();
    guest.watch_accesses(&[CLOCK_ENABLES]);
    (folder, guest)
}

fn run(guest: &mut Guest, world: &mut World, until: Nanoseconds) -> Result<(), EmulatorError> {
    while let Some(now) = guest.next_event().filter(|now| *now < until) {
        guest.run(world, now, until)?;
    }
    Ok(())
}

fn run_ms(guest: &mut Guest, millis: u64) -> Result<(), EmulatorError> {
    run(guest, &mut World::default(), Nanoseconds::from_millis(millis))
}

/// Times and numbers of the marks.
fn marks(guest: &Guest) -> Vec<(u64, u32)> {
    guest.measurements().watched.iter().map(|access| (access.time.0, access.value >> 16)).collect()
}

#[test]
#[ignore = "needs QEMU and the bus: cargo xtask test"]
fn the_product_reads_what_it_has_programmed_and_what_it_has_erased() {
    let mut steps = vec![Step::Copy(PARAMETERS, RAM), FIRST_KEY, SECOND_KEY, PROGRAMS];
    steps.extend([program(0, 0x1234_5678), program(CAPACITY as u32 - 4, 7), Step::Copy(PARAMETERS, RAM + 4)]);
    steps.extend([program(0, 0xFFFF_0000), Step::Copy(PARAMETERS, RAM + 8), LOCKS, program(4, 0)]);
    steps.extend([Step::Copy(PARAMETERS + 4, RAM + 12), Step::Copy(STATUS, RAM + 16), FIRST_KEY, SECOND_KEY]);
    steps.extend(erase(10));
    steps.extend([Step::Copy(PARAMETERS, RAM + 20), Step::Copy(PARAMETERS + CAPACITY as u32 - 4, RAM + 24)]);
    let (_folder, mut guest) = guest(&steps);
    run_ms(&mut guest, 1_100).unwrap();
    const SEQUENCE_ERROR: u32 = 1 << 7;
    let expected = [u32::MAX, 0x1234_5678, 0x1234_0000, u32::MAX, SEQUENCE_ERROR, u32::MAX, 7];
    assert_eq!(guest.read_memory(RAM, 7).unwrap(), expected);
    assert_eq!(guest.flash().value(CAPACITY - 4, Width::Word), 7);
    assert_eq!((guest.flash().operations(), guest.flash().erases()), (4, [1, 0]));
}

#[test]
#[ignore = "needs QEMU and the bus: cargo xtask test"]
fn the_processor_stands_for_as_long_as_the_data_sheet_says() {
    let mut steps = vec![FIRST_KEY, SECOND_KEY, PROGRAMS, mark(1), program(0, 0), mark(2)];
    steps.extend(erase(11));
    steps.push(mark(3));
    for (speed, word, sector) in [(Speed::Typical, 16_000, 1_000_000_000), (Speed::Longest, 100_000, 2_000_000_000)] {
        let (_folder, mut guest) = guest(&steps);
        let mut flash = FlashModel::new();
        flash.set_speed(speed);
        guest.set_flash(flash).unwrap();
        run_ms(&mut guest, 2_100).unwrap();
        let [first, second, third] = marks(&guest)[..] else { panic!("three marks expected") };
        // Seven instructions of 94 ns a step.
        assert!((word + 600..word + 1_700).contains(&(second.0 - first.0)), "{} ns", second.0 - first.0);
        assert!((sector + 1_000..sector + 4_000).contains(&(third.0 - second.0)), "{} ns", third.0 - second.0);
    }
}

/// A timer that interrupts every 10 us.
fn interrupts_every_10_us() -> [Step; 5] {
    const TIMER: u32 = 0x4000_0C00;
    [
        Step::Write(0x4002_3840, 1 << 3),
        Step::Write(TIMER + 0x2C, 159),
        Step::Write(TIMER + 0x0C, 1),
        Step::Write(0xE000_E104, 1 << 18),
        Step::Write(TIMER, 1),
    ]
}

#[test]
#[ignore = "needs QEMU and the bus: cargo xtask test"]
fn an_interrupt_comes_late_by_what_is_left_of_a_word() {
    let mut steps = interrupts_every_10_us().to_vec();
    steps.extend([FIRST_KEY, SECOND_KEY, PROGRAMS, mark(1), program(0, 0)]);
    let (_folder, mut guest) = guest(&steps);
    run(&mut guest, &mut World::default(), Nanoseconds::from_microseconds(200)).unwrap();
    let marks = marks(&guest);
    let begun = marks.iter().position(|(_, number)| *number == 1).unwrap();
    let handled: Vec<u64> = marks[begun + 1..].iter().map(|(time, _)| *time).collect();
    // The first that came meanwhile is served behind the word; those behind it are on the beat of the timer again.
    let late = handled[0] - marks[begun].0;
    assert!((16_000..19_000).contains(&late), "{late} ns: {marks:?}");
    let beat: Vec<u64> = handled[2..10].windows(2).map(|pair| pair[1] - pair[0]).collect();
    assert!(beat.iter().all(|period| period.abs_diff(10_000) < 300), "{beat:?}");
}

#[test]
#[ignore = "needs QEMU and the bus: cargo xtask test"]
fn contents_are_given_at_the_start_and_go_over_every_reset() {
    let mut given = vec![0x5A; CAPACITY];
    given[..4].copy_from_slice(&0x0102_0304_u32.to_le_bytes());
    let last = PARAMETERS + CAPACITY as u32 - 4;
    let steps = [
        Step::Copy(PARAMETERS, RAM),
        Step::Copy(last, RAM + 4),
        FIRST_KEY,
        SECOND_KEY,
        PROGRAMS,
        program(0, 0xFFFF_FF00),
        Step::Copy(PARAMETERS, RAM + 8),
    ];
    let (_folder, mut guest) = guest(&steps);
    guest.set_flash(FlashModel::with_contents(&given).unwrap()).unwrap();
    run_ms(&mut guest, 1).unwrap();
    assert_eq!(guest.read_memory(RAM, 3).unwrap(), [0x0102_0304, 0x5A5A_5A5A, 0x0102_0300]);
    for reset in [Reset::Pin, Reset::Watchdog, Reset::Software, Reset::BrownOut, Reset::PowerOn(3)] {
        let now = guest.next_event().unwrap();
        guest.reset(&mut World::default(), now, reset).unwrap();
        run(&mut guest, &mut World::default(), now + Nanoseconds::from_millis(1)).unwrap();
        assert_eq!(guest.read_memory(RAM, 3).unwrap(), [0x0102_0300, 0x5A5A_5A5A, 0x0102_0300], "{reset:?}");
    }
    assert_eq!(guest.flash().operations(), 6);
    // A flash that another one takes the place of is seen no more.
    guest.set_flash(FlashModel::new()).unwrap();
    assert_eq!(guest.read_memory(PARAMETERS, 2).unwrap(), [u32::MAX; 2]);
    assert_eq!(guest.read_memory(last, 1).unwrap(), [u32::MAX]);
}

#[test]
#[ignore = "needs QEMU and the bus: cargo xtask test"]
fn the_supply_goes_within_any_operation_and_the_product_finds_what_is_left() {
    let (port, pin) = wiring::CHIP_RESET;
    let port_registers = 0x4002_0000 + 0x400 * port as u32;
    let mut steps = vec![Step::Copy(PARAMETERS, RAM), Step::Write(CLOCK_ENABLES, 1 << port)];
    steps.extend([Step::Write(port_registers + 0x18, 1 << pin), Step::Write(port_registers, 1 << (2 * pin))]);
    steps.extend([FIRST_KEY, SECOND_KEY, PROGRAMS, program(0, 0x0F0F_0F0F), program(4, 0), program(8, 0)]);
    steps.extend(erase(11));
    steps.push(Step::Write(RAM + 4, 1));
    let mut partly = 0;
    for (seed, operation) in (1..=4).cycle().take(16).enumerate() {
        let (_folder, mut guest) = guest(&steps);
        let old = [vec![0xFF; SECTOR_BYTES], vec![0x5A; SECTOR_BYTES]].concat();
        guest.set_flash(FlashModel::with_contents(&old).unwrap()).unwrap();
        guest.cut_supply_in(operation, seed as u64);
        let mut world = World::default();
        run(&mut guest, &mut world, Nanoseconds::from_millis(1_100)).unwrap();
        let lost = guest.lost_supply().unwrap();
        assert_eq!(world.chip_reset.last(), Some(&(lost, true)), "its outputs go with it");
        assert_eq!(guest.next_event(), None);
        assert_ne!(guest.read_memory(RAM + 4, 1).unwrap(), [1], "it went on");
        let left = guest.flash().contents().to_vec();
        assert_eq!(guest.flash().operations(), operation);
        let in_operation = match operation {
            4 => left[SECTOR_BYTES..] != old[SECTOR_BYTES..],
            word => !matches!(guest.flash().value(4 * (word as usize - 1), Width::Word), 0 | u32::MAX | 0x0F0F_0F0F),
        };
        partly += u32::from(in_operation);
        // It comes back a second later, and finds what is left.
        let now = lost + Nanoseconds::from_millis(1_000);
        guest.reset(&mut World::default(), now, Reset::PowerOn(seed as u64)).unwrap();
        assert_eq!((guest.lost_supply(), guest.flash().contents() == left), (None, true));
        let words: Vec<u32> = left.as_chunks().0.iter().map(|word| u32::from_le_bytes(*word)).collect();
        assert_eq!(guest.read_memory(PARAMETERS, CAPACITY / 4).unwrap(), words);
        run(&mut guest, &mut World::default(), now + Nanoseconds::from_millis(1_100)).unwrap();
        assert_eq!(guest.read_memory(RAM, 2).unwrap(), [words[0], 1]);
    }
    assert!(partly > 5, "{partly}");
}

#[test]
#[ignore = "needs QEMU and the bus: cargo xtask test"]
fn a_watchdog_that_bites_in_an_erase_leaves_the_sector_undone() {
    const WATCHDOG: u32 = 0x4000_3000;
    let mut steps = vec![Step::Write(WATCHDOG, 0xCCCC), FIRST_KEY, SECOND_KEY];
    steps.extend(erase(10));
    // Behind the reset it comes there again and is bitten again.
    let (_folder, mut guest) = guest(&steps);
    guest.survive().unwrap();
    guest.set_flash(FlashModel::with_contents(&[0x5A; CAPACITY]).unwrap()).unwrap();
    let mut undone = 0;
    for bite in 1..6 {
        while guest.incidents().len() < bite {
            let now = guest.next_event().unwrap();
            guest.run(&mut World::default(), now, now + Nanoseconds::from_millis(1)).unwrap();
        }
        let first = &guest.flash().contents()[..SECTOR_BYTES];
        undone += u32::from(first.iter().any(|byte| *byte != 0xFF));
    }
    assert!(guest.incidents().iter().all(|incident| incident.what == What::Reset(Reset::Watchdog)));
    // 512 ms at 32 kHz: within the second of the erase.
    let times: Vec<u64> = guest.incidents().windows(2).map(|pair| pair[1].time.0 - pair[0].time.0).collect();
    assert!(times.iter().all(|time| time.abs_diff(512_000_000) < 1_000_000), "{times:?}");
    assert!(undone >= 3, "{undone} of 5");
}

#[test]
#[ignore = "needs QEMU and the bus: cargo xtask test"]
fn what_would_take_the_program_away_ends_the_run() {
    let mut steps = vec![FIRST_KEY, SECOND_KEY];
    steps.extend(erase(9));
    let (_folder, mut of_program) = guest(&steps);
    let error = run_ms(&mut of_program, 1).unwrap_err().to_string();
    assert!(error.contains("sector 9, which is the program's") && error.contains("0x40023c10"), "{error}");
    let (_folder, mut of_all) = guest(&[FIRST_KEY, SECOND_KEY, Step::Write(CONTROL, 0x1_0204)]);
    let error = run_ms(&mut of_all, 1).unwrap_err().to_string();
    assert!(error.contains("an erase of the whole flash"), "{error}");
}

#[test]
#[ignore = "needs QEMU and the bus: cargo xtask test"]
fn whole_blocks_and_blocks_of_one_instruction_program_alike() {
    let mut steps = interrupts_every_10_us().to_vec();
    steps.extend([FIRST_KEY, SECOND_KEY, PROGRAMS]);
    steps.extend((0..20).flat_map(|word| [mark(1), program(4 * word, word), Step::Copy(PARAMETERS + 4 * word, RAM)]));
    let trace = |whole_blocks| {
        let (folder, once) = guest(&steps);
        drop(once);
        let product = program_of(&steps).write(folder.path());
        let bus = std::env::var_os("BUS_PLUGIN").unwrap();
        let how = GuestConfiguration { whole_blocks, ..GuestConfiguration::new(product, PathBuf::from(bus)) };
        let mut guest = Guest::start(&how).unwrap();
        run_ms(&mut guest, 1).unwrap();
        assert_eq!(guest.flash().operations(), 20);
        (guest.measurements().trace, guest.measurements().instructions)
    };
    assert_eq!(trace(true), trace(false));
}

#[test]
#[ignore = "needs QEMU and the ELF: cargo xtask test"]
fn the_elf_has_the_sectors_where_they_are_and_nothing_in_them() {
    use object::{Object, ObjectSegment, ObjectSymbol};
    let elf =
        std::env::var_os("PRODUCT_ELF").unwrap_or_else(|| panic!("PRODUCT_ELF is not set: run `cargo xtask test`"));
    let elf = std::fs::read(elf).unwrap();
    let file = object::File::parse(&*elf).unwrap();
    let place = |name: &str| file.symbols().find(|symbol| symbol.name() == Ok(name)).map(|symbol| symbol.address());
    let sectors = u64::from(PARAMETERS)..u64::from(PARAMETERS) + CAPACITY as u64;
    assert_eq!(place("_parameter_flash_start"), Some(sectors.start));
    assert_eq!(place("_parameter_flash_end"), Some(sectors.end));
    for segment in file.segments() {
        let end = segment.address() + segment.size();
        assert!(end <= sectors.start || segment.address() >= sectors.end, "{segment:?}");
    }
}

#[test]
#[ignore = "needs QEMU and the board's example: cargo xtask test"]
fn the_boards_flash_does_what_it_is_permitted_and_names_every_error() {
    let elf = |name: &str| {
        std::env::var_os(name).unwrap_or_else(|| panic!("{name} is not set: run `cargo xtask test`, which builds it"))
    };
    let mut guest = Guest::start(&GuestConfiguration::new(elf("FLASH_ELF"), elf("BUS_PLUGIN"))).unwrap();
    let mut world = Quiet::new();
    let until = Nanoseconds::from_millis(3_100);
    while let Some(now) = guest.next_event().filter(|now| *now < until) {
        guest.run(&mut world, now, until).unwrap();
    }
    let mut lines: Vec<String> = guest.take_log().into_iter().map(|line| line.text).collect();
    let took = lines.iter().position(|line| line.starts_with("two words took")).expect("a time");
    let took = lines.remove(took);
    let microseconds: u32 = took.split_whitespace().find_map(|word| word.parse().ok()).unwrap();
    assert!((32..45).contains(&microseconds), "{took}");
    let expected = [
        "capacity 262144",
        "erase before it is permitted: Err(EraseNotPermitted)",
        "erase: Ok(())",
        "write: Ok(())",
        "read: Ok([2, 3, 4, 5])",
        "read a byte: Ok(()), [3]",
        "write zeros over it: Ok(())",
        "write ones over it: Err(NotWritten)",
        "write the last word: Ok(())",
        "read the last byte: Ok(()), [9]",
        "write beyond the end: Err(OutOfBounds)",
        "read beyond the end: Err(OutOfBounds)",
        "write off the words: Err(NotAligned)",
        "write half a word: Err(NotAligned)",
        "erase off the sectors: Err(NotAligned)",
        "erase backwards: Err(OutOfBounds)",
        "erase beyond the end: Err(OutOfBounds)",
        "erase the second sector: Ok(())",
        "read: Ok([5, 6, 7, 8]), Ok([255, 255, 255, 255])",
        "without a grant: ended false",
        "two grants at once: ended false",
        "without a second grant: ended false",
        "a grant that was withdrawn: ended false",
        "second grant: ended false",
        "third grant: ended true",
        "read: Ok([17, 17, 17, 17]), Ok([17, 17, 17, 17])",
        "erase in a ring: Err(EraseNotPermitted)",
    ];
    assert_eq!(lines, expected);
    // Three sectors; two words, two over the first, the last, three.
    assert_eq!((guest.flash().erases(), guest.flash().operations()), ([1, 2], 3 + 8));
}
