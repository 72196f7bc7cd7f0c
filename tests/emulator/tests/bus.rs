//! The bus inside QEMU, broken in every way that we could think of: one clear line each, and nothing is left running.

use std::ffi::OsString;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use crate::program::{Nothing, Program};
use crate::quiet::Quiet;
use emulator::{EmulatorError, Guest, GuestConfiguration, StopAt, Trace};
use ring::Nanoseconds;

const START: u32 = 0x0800_0200;
const HANDLER: u32 = 0x0800_0240;
const HARD_FAULT: u32 = 3;

fn bus() -> PathBuf {
    let path = std::env::var_os("BUS_PLUGIN");
    path.unwrap_or_else(|| panic!("BUS_PLUGIN is not set: run `cargo xtask test`, which builds it")).into()
}

fn configuration(product: PathBuf) -> GuestConfiguration {
    GuestConfiguration::new(product, bus())
}

/// Reads a register of the RCC for ever.
fn reader() -> Program {
    Program::new(START)
        // ldr r3, [pc, #4]; again: ldr r2, [r3]; b again
        .code(START, &[0x4b01, 0x681a, 0xe7fd, 0xbf00])
        .word(START + 8, 0x4002_3800)
}

/// Runs on until an error comes.
fn error_of(configuration: &GuestConfiguration) -> EmulatorError {
    match Guest::start(configuration) {
        Err(error) => error,
        Ok(mut guest) => run(&mut guest, 10_000).expect_err("nothing went wrong"),
    }
}

fn run(guest: &mut Guest, exchanges: usize) -> Result<(), EmulatorError> {
    for _ in 0..exchanges {
        let now = guest.next_event().unwrap();
        guest.run(&mut Nothing, now, now + Nanoseconds::from_millis(1))?;
    }
    Ok(())
}

/// The line is one, names the cause, and no child of this thread is left.
#[track_caller]
fn assert_one_line(error: &EmulatorError, causes: &[&str]) {
    let line = error.to_string();
    assert!(!line.contains('\n'), "{line}");
    for cause in causes {
        assert!(line.contains(cause), "{cause:?} expected in: {line}");
    }
    assert_eq!(children(), [0_u32; 0], "left running");
}

/// Processes that this thread has started.
fn children() -> Vec<u32> {
    let text = std::fs::read_to_string("/proc/thread-self/children").unwrap();
    text.split_whitespace().map(|number| number.parse().unwrap()).collect()
}

/// A test of this file in a process of its own.
fn once_more(test: &str) -> Command {
    let place = module_path!().split_once("::").map_or(String::new(), |(_, module)| format!("{module}::"));
    let mut command = Command::new(std::env::current_exe().unwrap());
    command.args(["--ignored", "--exact", "--nocapture"]).arg(place + test);
    command
}

/// It was found, and passed.
#[track_caller]
fn assert_ran(test: &std::process::Output) {
    let [stdout, stderr] = [&test.stdout, &test.stderr].map(|text| String::from_utf8_lossy(text));
    assert!(test.status.success() && stdout.contains("1 passed"), "{stdout}{stderr}");
}

/// A program in place of QEMU that does something first; `$page` is the shared page.
fn instead_of_qemu(folder: &Path, first: &str) -> OsString {
    let path = folder.join("qemu");
    let qemu = std::env::var("QEMU").unwrap_or_else(|_| "qemu-system-arm".into());
    let script =
        format!("#!/bin/sh\npage=$(echo \"$*\" | sed 's/.*,page=\\([^,]*\\),.*/\\1/')\n{first}\nexec {qemu} \"$@\"\n");
    std::fs::write(&path, script).unwrap();
    std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o755)).unwrap();
    path.into()
}

#[test]
#[ignore = "needs QEMU and the bus: cargo xtask test"]
fn a_qemu_that_is_killed_in_the_middle_is_named_with_its_signal() {
    let folder = tempfile::tempdir().unwrap();
    let mut guest = Guest::start(&configuration(reader().write(folder.path()))).unwrap();
    run(&mut guest, 100).unwrap();
    let [qemu] = children()[..] else { panic!("one child expected: {:?}", children()) };
    assert!(Command::new("kill").args(["-9", &qemu.to_string()]).status().unwrap().success());
    let error = run(&mut guest, 10).unwrap_err();
    drop(guest);
    assert_one_line(&error, &["QEMU ended unexpectedly", "signal: 9"]);
}

#[test]
#[ignore = "needs QEMU and the bus: cargo xtask test"]
fn no_qemu_is_left_behind_by_a_test_that_is_killed() {
    if let Some(product) = std::env::var_os("TEST_TO_BE_KILLED") {
        let _guest = Guest::start(&configuration(product.into())).unwrap();
        println!("QEMU is {}", children()[0]);
        std::thread::sleep(Duration::from_secs(60));
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let mut test = once_more("no_qemu_is_left_behind_by_a_test_that_is_killed");
    let mut test = test.env("TEST_TO_BE_KILLED", reader().write(folder.path())).stdout(Stdio::piped()).spawn().unwrap();
    let lines = std::io::BufRead::lines(std::io::BufReader::new(test.stdout.take().unwrap()));
    let qemu = lines.map_while(Result::ok).find_map(|line| Some(line.strip_prefix("QEMU is ")?.to_owned()));
    let qemu = PathBuf::from("/proc").join(qemu.expect("the test does not start its QEMU"));
    assert!(qemu.exists());
    test.kill().unwrap();
    test.wait().unwrap();
    let start = Instant::now();
    // Nobody may have waited for it: then it is there, and dead.
    let lives = || std::fs::read_to_string(qemu.join("stat")).is_ok_and(|stat| !stat.contains(") Z "));
    while lives() {
        assert!(start.elapsed() < Duration::from_secs(10), "QEMU lives on");
        std::thread::sleep(Duration::from_millis(10));
    }
}

#[test]
#[ignore = "needs QEMU and the bus: cargo xtask test"]
fn a_bus_of_another_version_is_refused_before_the_product_runs() {
    let folder = tempfile::tempdir().unwrap();
    let mut configuration = configuration(reader().write(folder.path()));
    let another = "printf '\\143\\0\\0\\0' | dd of=\"$page\" conv=notrunc status=none";
    configuration.qemu = instead_of_qemu(folder.path(), another);
    assert_one_line(&error_of(&configuration), &["protocol 99", "build both from the same sources"]);
}

#[test]
#[ignore = "needs QEMU and the bus: cargo xtask test"]
fn a_shared_page_that_cannot_be_opened_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let mut configuration = configuration(reader().write(folder.path()));
    configuration.qemu = instead_of_qemu(folder.path(), "rm \"$page\"");
    assert_one_line(&error_of(&configuration), &["no shared page at", "No such file"]);
    configuration.qemu = instead_of_qemu(folder.path(), "printf x > \"$page\"");
    assert_one_line(&error_of(&configuration), &["is no shared page", "it has 1 bytes"]);
}

#[test]
#[ignore = "needs QEMU and the bus: cargo xtask test"]
fn a_folder_that_takes_no_shared_page_is_named_with_what_to_do() {
    if let Some(product) = std::env::var_os("TEST_WITHOUT_FOLDER") {
        let error = Guest::start(&configuration(product.into())).unwrap_err();
        assert_one_line(&error, &["temporary", "TMPDIR"]);
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let product = reader().write(folder.path());
    let mut test = once_more("a_folder_that_takes_no_shared_page_is_named_with_what_to_do");
    // Nobody may make a file there, not even root.
    let test = test.env("TEST_WITHOUT_FOLDER", product).env("TMPDIR", "/proc/self").output().unwrap();
    assert_ran(&test);
}

#[test]
#[ignore = "needs QEMU and the bus: cargo xtask test"]
fn a_bus_that_is_missing_or_none_is_named_with_what_builds_it() {
    let folder = tempfile::tempdir().unwrap();
    let mut configuration = configuration(reader().write(folder.path()));
    configuration.bus = folder.path().join("not-there.so");
    assert_one_line(&error_of(&configuration), &["not-there.so", "missing", "cargo xtask build"]);
    let text = folder.path().join("text.so");
    std::fs::write(&text, "text").unwrap();
    configuration.bus = text;
    assert_one_line(&error_of(&configuration), &["text.so", "cargo xtask build"]);
}

#[test]
#[ignore = "needs QEMU and the bus: cargo xtask test"]
fn a_qemu_that_is_none_is_told_in_its_own_words() {
    let folder = tempfile::tempdir().unwrap();
    let mut configuration = configuration(reader().write(folder.path()));
    configuration.qemu = instead_of_qemu(folder.path(), "echo no plugins here >&2; exit 7");
    assert_one_line(&error_of(&configuration), &["QEMU ended unexpectedly", "exit status: 7", "no plugins here"]);
}

/// What QEMU does with a plugin, done by a program that exports nothing.
#[allow(unsafe_code, reason = "the library is loaded as QEMU loads it")]
fn load_as_qemu_does(arguments: &[String]) -> std::ffi::c_int {
    type Install =
        unsafe extern "C" fn(u64, *const (), std::ffi::c_int, *const *const std::ffi::c_char) -> std::ffi::c_int;
    let arguments: Vec<_> = arguments.iter().map(|text| std::ffi::CString::new(text.as_str()).unwrap()).collect();
    let pointers: Vec<_> = arguments.iter().map(|text| text.as_ptr()).collect();
    // SAFETY: the bus's initialisation looks for functions and nothing else, and its installation has this type.
    unsafe {
        let library = libloading::Library::new(bus()).unwrap();
        let install = library.get::<Install>(b"qemu_plugin_install\0").unwrap();
        install(0, std::ptr::null(), pointers.len() as std::ffi::c_int, pointers.as_ptr())
    }
}

#[test]
#[ignore = "needs QEMU and the bus: cargo xtask test"]
fn a_qemu_that_exports_nothing_is_told_what_is_missing_and_what_is_left() {
    if std::env::var_os("TEST_AS_QEMU").is_some() {
        let parent = format!("parent={}", std::os::unix::process::parent_id());
        let installed = load_as_qemu_does(&["page=/nowhere".into(), parent, "blocks=whole".into()]);
        assert_eq!(installed, -1);
        return;
    }
    let mut test = once_more("a_qemu_that_exports_nothing_is_told_what_is_missing_and_what_is_left");
    let output = test.env("TEST_AS_QEMU", "1").output().unwrap();
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert_ran(&output);
    let lines: Vec<&str> = stderr.lines().filter(|line| line.starts_with("emulator bus:")).collect();
    let [line] = lines[..] else { panic!("one line expected: {stderr}") };
    for part in ["does not export qemu_plugin_register_vcpu_tb_trans_cb", "built with modules", "--on host"] {
        assert!(line.contains(part), "{part:?} expected in: {line}");
    }
}

#[test]
#[ignore = "needs QEMU and the bus: cargo xtask test"]
fn a_product_that_touches_systick_is_refused_at_its_instruction() {
    let folder = tempfile::tempdir().unwrap();
    // movs r0, #1; ldr r3, [pc, #4]; then str r0, [r3] or ldr r0, [r3]; b .
    for access in [0x6018, 0x6818] {
        let product = Program::new(START).code(START, &[0x2001, 0x4b01, access, 0xe7fe]).word(START + 8, 0xE000_E010);
        let error = error_of(&configuration(product.write(folder.path())));
        assert_one_line(&error, &["SysTick", "0xe000e010", "pc 0x08000204", "use a timer of the part"]);
    }
}

#[test]
#[ignore = "needs QEMU and the bus: cargo xtask test"]
fn a_fault_of_the_product_is_reported_with_the_registers_before_it() {
    let folder = tempfile::tempdir().unwrap();
    let product = Program::new(START)
        // movs r0, #17; movs r4, #34; movs r7, #51; push {r0}; udf #1
        .code(START, &[0x2011, 0x2422, 0x2733, 0xb401, 0xde01])
        .code(HANDLER, &[0xe7fe])
        .vector(HARD_FAULT, HANDLER);
    let error = error_of(&configuration(product.write(folder.path())));
    let expected =
        ["pc 08000208 (code de01", "r0 00000011", "r4 00000022", "r7 00000033", "sp 20007ffc", "CFSR 00010000"];
    assert_one_line(&error, &expected);
}

#[test]
#[ignore = "needs QEMU and the bus: cargo xtask test"]
fn a_product_that_waits_in_a_handler_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    const SUPERVISOR_CALL: u32 = 11;
    let product = Program::new(START)
        // svc #0; in the handler wfi
        .code(START, &[0xdf00, 0xe7fe])
        .code(HANDLER, &[0xbf30, 0xe7fd])
        .vector(SUPERVISOR_CALL, HANDLER);
    let error = error_of(&configuration(product.write(folder.path())));
    assert_one_line(&error, &["waits for an interrupt in a handler", "08000240"]);
}

#[test]
#[ignore = "needs QEMU and the bus: cargo xtask test"]
fn an_instruction_of_several_accesses_makes_each_of_them_once() {
    // Three words a turn: the buffer of the posted ones is full in the middle of an instruction, and then the next event is so near that its
    // block must be left there.
    let folder = tempfile::tempdir().unwrap();
    let product = Program::new(START)
        // movs r0, #0; movs r1, #0; movs r2, #0; ldr r3, [pc, #8]; again: stm.w r3, {r0, r1, r2}; b again
        .code(START, &[0x2000, 0x2100, 0x2200, 0x4b02, 0xe883, 0x0007, 0xe7fc])
        .word(START + 16, 0x4002_3830);
    let mut guest = Guest::start(&configuration(product.write(folder.path()))).unwrap();
    for _ in 0..40_000 {
        let now = guest.next_event().unwrap();
        let far = guest.measurements().exchanges % 2 == 1;
        guest.run(&mut Nothing, now, now + Nanoseconds(if far { 1_000_000 } else { 10 })).unwrap();
    }
    let measured = guest.measurements();
    println!("{measured:?}");
    // Three accesses in two instructions, again and again.
    let turns = measured.writes / 3;
    assert!(turns > 300, "{measured:?}");
    assert!(measured.trace.accesses == measured.writes, "{measured:?}");
    assert!(measured.instructions.abs_diff(2 * turns) <= 8, "{measured:?}");
}

#[test]
#[ignore = "needs QEMU and the bus: cargo xtask test"]
fn a_stop_before_any_instruction_of_a_block_changes_nothing_of_what_the_product_does() {
    const REGISTER: u32 = 0x4002_3830;
    let folder = tempfile::tempdir().unwrap();
    let product = Program::new(START)
        // movs r0, #0; ldr r4, [pc, #12]; again: three times adds r0, #1; str r0, [r4]; b again
        .code(START, &[0x2000, 0x4c03, 0x3001, 0x3001, 0x3001, 0x6020, 0xe7fa, 0xbf00])
        .word(START + 16, REGISTER);
    let mut guest = Guest::start(&configuration(product.write(folder.path()))).unwrap();
    guest.watch_accesses(&[REGISTER]);
    run(&mut guest, 10).unwrap();
    for turn in 0..60 {
        // Of the loop's five instructions, and of those behind them.
        guest.stop_at(StopAt { address: START + 4 + 2 * (turn % 5), behind: turn % 3 }).unwrap();
        for _ in 0..4 {
            let now = guest.next_event().unwrap();
            guest.run(&mut Nothing, now, now + Nanoseconds::from_microseconds(2)).unwrap();
        }
    }
    let written: Vec<u32> = guest.measurements().watched.iter().map(|access| access.value).collect();
    assert!(written.len() > 100, "{}", written.len());
    for (turn, value) in (1..).zip(&written) {
        assert_eq!(*value, 3 * turn);
    }
}

/// Half of it passes before the loops run.
const BOOT: Nanoseconds = Nanoseconds::from_millis(40);

/// What the release ELF does in its first 40 ms.
fn boot(change: impl FnOnce(&mut GuestConfiguration)) -> (Trace, u64) {
    boot_in_steps(BOOT, change)
}

/// The same in a world that looks at it in steps.
fn boot_in_steps(step: Nanoseconds, change: impl FnOnce(&mut GuestConfiguration)) -> (Trace, u64) {
    let elf =
        std::env::var_os("PRODUCT_ELF").unwrap_or_else(|| panic!("PRODUCT_ELF is not set: run `cargo xtask test`"));
    let mut configuration = configuration(elf.into());
    change(&mut configuration);
    let mut guest = Guest::start(&configuration).unwrap();
    let mut world = Quiet::new();
    let mut end = Nanoseconds::ZERO;
    while end < BOOT {
        end = (end + step).min(BOOT);
        while let Some(now) = guest.next_event().filter(|now| *now < end) {
            guest.run(&mut world, now, end).unwrap();
        }
    }
    (guest.measurements().trace, guest.measurements().instructions)
}

#[test]
#[ignore = "needs QEMU and the ELF: cargo xtask test"]
fn how_often_the_world_looks_changes_no_access() {
    let never = boot(|_| {}).0;
    for step in [250_000, 37_123, 1_009] {
        assert_eq!(boot_in_steps(Nanoseconds(step), |_| {}).0, never, "every {step} ns");
    }
}

#[test]
#[ignore = "needs QEMU and the ELF: cargo xtask test"]
fn whole_blocks_and_blocks_of_one_instruction_make_the_same_trace() {
    let whole = boot(|_| {});
    println!("trace {}", whole.0);
    assert!(whole.0.accesses > 5_000, "{whole:?}");
    assert_eq!(boot(|configuration| configuration.whole_blocks = false), whole);
}

#[test]
#[ignore = "needs QEMU and the ELF: cargo xtask test"]
fn the_trace_is_the_same_on_one_cpu_on_any_and_under_load() {
    let alone = boot(|_| {});
    assert_eq!(boot(|configuration| configuration.one_cpu = false), alone);
    let busy = std::sync::atomic::AtomicBool::new(true);
    std::thread::scope(|scope| {
        for _ in 0..2 {
            scope.spawn(|| {
                while busy.load(std::sync::atomic::Ordering::Relaxed) {
                    std::hint::spin_loop();
                }
            });
        }
        let loaded = [boot(|_| {}), boot(|configuration| configuration.one_cpu = false)];
        busy.store(false, std::sync::atomic::Ordering::Relaxed);
        assert_eq!(loaded, [alone, alone]);
    });
}
