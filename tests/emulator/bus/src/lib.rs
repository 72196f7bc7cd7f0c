//! The bus inside QEMU: a plugin that answers every peripheral access of the product from the emulator's models.
//!
//! QEMU loads this library (`-plugin`). It lays an I/O region over the peripherals and the external bus, is called before every instruction, and
//! speaks with the emulator over a shared page ([`emulator_link`]). The product boots from its own vectors and nothing stands beside it.
//!
//! * `qemu`: QEMU's functions, found by name when the library is loaded.
//! * `machine`: the emulated machine.
//! * `blocks`: exactly which instruction.
//! * `bus`: accesses, and the dialogue about them.
//! * `trace`: what was executed, for whoever counts instructions.
//! * `system`, `fault`, `self_test`: SysTick and NVIC, what a fault looked like, and whether this QEMU will do.
//!
//! Why runs repeat themselves: one thread executes the product, and it stands still while the emulator works. Time is executed instructions and the
//! waits that the emulator names. No timer of QEMU's runs: they lie under the region, and SysTick is refused. Interrupts enter within an exchange
//! or by the product's own write to the NVIC, each at its instruction.

mod blocks;
mod bus;
mod fault;
mod machine;
mod qemu;
mod self_test;
mod system;
mod trace;

use std::ffi::{CStr, c_char, c_int, c_void};
use std::path::Path;
use std::ptr::null_mut;
use std::sync::atomic::{AtomicPtr, Ordering};

use blocks::Instruction;
use bus::Bus;
use emulator_link::Page;
use machine::machine;
use qemu::{CALLBACK_USES_REGISTERS, Functions, Notifier, Opaque};
use rustix::process::{Pid, Signal, getppid, set_parent_process_death_signal};

static STATE: AtomicPtr<Bus> = AtomicPtr::new(null_mut());

/// The bus. Only callbacks of QEMU call this, each once and at its beginning or in its place.
fn bus() -> &'static mut Bus {
    // SAFETY: set at the installation, before anything can call back, and never freed. Callbacks come in the thread of the only processor. What the
    // bus calls of QEMU's leads back to the region of the system control space at most, which leaves this state alone (see `system`), or to the
    // windows during the self-test, which does too.
    unsafe { &mut *STATE.load(Ordering::Relaxed) }
}

/// The version of the plugin interface that this library follows. QEMU reads it before it installs the library, and
/// [`choose_version`] sets it before that, to one that the QEMU at hand takes.
#[unsafe(no_mangle)]
#[allow(non_upper_case_globals, reason = "QEMU looks for this name")]
#[doc(hidden)]
pub static qemu_plugin_version: Version = Version(std::sync::atomic::AtomicI32::new(1));

/// An `int` of C.
#[repr(transparent)]
#[derive(Debug)]
#[doc(hidden)]
pub struct Version(std::sync::atomic::AtomicI32);

#[used]
#[unsafe(link_section = ".init_array")]
static CHOOSE_VERSION: extern "C" fn() = choose_version;

/// Interface 1 came with QEMU 4.2, 2 with 9.0; QEMU 11 takes none below 7. What is used here is the same in all of them but for the arguments of
/// one callback, see [`translated`].
extern "C" fn choose_version() {
    let version = match qemu::major_version() {
        Some(11..) => 7,
        Some(9..) => 2,
        _ => 1,
    };
    qemu_plugin_version.0.store(version, Ordering::Relaxed);
}

/// Called by QEMU when it has loaded the library, with `page=PATH`, `parent=PID` and `blocks=whole` or `blocks=one` as arguments. 0: installed;
/// otherwise QEMU ends.
///
/// # Safety
/// For QEMU only.
#[unsafe(no_mangle)]
#[doc(hidden)]
pub unsafe extern "C" fn qemu_plugin_install(
    id: u64,
    _info: *const c_void,
    argc: c_int,
    argv: *const *const c_char,
) -> c_int {
    let arguments: Vec<String> = (0..argc.max(0) as usize)
        // SAFETY: QEMU gives so many strings.
        .map(|index| unsafe { CStr::from_ptr(*argv.add(index)) }.to_string_lossy().into_owned())
        .collect();
    match install(id, &arguments) {
        Ok(()) => 0,
        Err(what) => {
            eprintln!("emulator bus: {what}");
            -1
        }
    }
}

fn install(id: u64, arguments: &[String]) -> Result<(), String> {
    let argument = |name: &str| {
        let value = arguments.iter().find_map(|argument| argument.strip_prefix(name));
        value.ok_or_else(|| format!("the argument {name} is missing"))
    };
    let page = argument("page=")?;
    let parent: i32 = argument("parent=")?.parse().map_err(|_| "the argument parent= is no number".to_owned())?;
    let whole = match argument("blocks=")? {
        "whole" => true,
        "one" => false,
        other => return Err(format!("blocks={other} is neither whole nor one")),
    };
    die_with(parent)?;
    let qemu = Functions::find().map_err(|name| {
        format!(
            "this QEMU does not export {name}; use one that is built with modules, as Debian's is, or run without QEMU (--on host)"
        )
    })?;
    let path = Path::new(page);
    let folder = path.parent().ok_or_else(|| format!("page={page} lies in no folder"))?.to_owned();
    let page = Page::open(path).map_err(|error| error.to_string())?;
    let qemu: &'static Functions = Box::leak(Box::new(qemu));
    STATE.store(Box::into_raw(Box::new(Bus::new(page, folder, whole))), Ordering::Relaxed);
    let ready =
        Box::leak(Box::new(Ready { notifier: Notifier { notify: machine_ready, node: [null_mut(); 2] }, qemu }));
    QEMU.store(std::ptr::from_ref(qemu).cast_mut(), Ordering::Relaxed);
    // SAFETY: the functions as declared; the notifier lives as long as the process.
    unsafe {
        (qemu.add_ready_notifier)(&raw mut ready.notifier);
        (qemu.register_translation)(id, translated, null_mut());
    }
    Ok(())
}

/// A QEMU whose emulator is gone would wait for ever.
fn die_with(parent: i32) -> Result<(), String> {
    set_parent_process_death_signal(Some(Signal::KILL))
        .map_err(|error| format!("cannot end with its parent: {error}"))?;
    // It may have gone before.
    match Pid::from_raw(parent) {
        Some(parent) if getppid() == Some(parent) => Ok(()),
        _ => Err(format!("the process {parent} that wants it is not the one that started QEMU")),
    }
}

static QEMU: AtomicPtr<Functions> = AtomicPtr::new(null_mut());

/// A notifier and what it needs.
#[repr(C)]
struct Ready {
    notifier: Notifier,
    qemu: &'static Functions,
}

unsafe extern "C" fn machine_ready(notifier: *mut Notifier, _data: Opaque) {
    // SAFETY: the notifier is the first field of what was registered.
    let ready = unsafe { &*notifier.cast::<Ready>() };
    if let Err(what) = machine::take_over(ready.qemu) {
        eprintln!("emulator bus: {what}");
        // SAFETY: ends the process at once; nothing runs yet.
        unsafe { libc::_exit(3) };
    }
}

/// Every instruction of every block gets its callback.
///
/// Up to interface 6 the arguments are (id, block), from 7 on (block, user data), and the user data is null.
unsafe extern "C" fn translated(first: Opaque, second: Opaque) {
    /// NMI, hard fault, and one of the faults that nobody enables: where an interrupt without a task goes.
    const FAULTS: [u32; 3] = [2, 3, 4];
    const WAIT_FOR_INTERRUPT: u16 = 0xBF30;
    let block = if second.is_null() { first } else { second };
    // SAFETY: stored before this callback was registered, and never freed.
    let qemu = unsafe { &*QEMU.load(Ordering::Relaxed) };
    let faults = FAULTS.map(|exception| machine().vector(exception));
    // SAFETY: the functions as declared, with the block that is being translated.
    unsafe {
        let count = (qemu.instructions)(block);
        for index in 0..count {
            let instruction = (qemu.instruction)(block, index);
            let pc = (qemu.address)(instruction) as u32;
            let code = machine().word(pc) as u16;
            let data = Instruction::new(pc, code, index, count).number() as usize as Opaque;
            let call = |callback| (qemu.register_execution)(instruction, callback, CALLBACK_USES_REGISTERS, data);
            call(each);
            if code == WAIT_FOR_INTERRUPT {
                call(wait_for_interrupt);
            }
            if pc != 0 && faults.contains(&pc) {
                call(fault_begins);
            }
        }
    }
}

/// The callback of every instruction: hands on where in the translated code it was called, from which QEMU knows the instruction.
#[cfg(target_arch = "x86_64")]
#[unsafe(naked)]
unsafe extern "C" fn each(_processor: u32, _this: Opaque) {
    core::arch::naked_asm!("mov rdx, [rsp]", "jmp {each}", each = sym each_from)
}

/// The callback of every instruction: hands on where in the translated code it was called, from which QEMU knows the instruction.
#[cfg(target_arch = "aarch64")]
#[unsafe(naked)]
unsafe extern "C" fn each(_processor: u32, _this: Opaque) {
    core::arch::naked_asm!("mov x2, x30", "b {each}", each = sym each_from)
}

unsafe extern "C" fn each_from(_processor: u32, this: Opaque, at_host: usize) {
    bus().each(Instruction::from_number(this as usize as u64), at_host);
}

unsafe extern "C" fn wait_for_interrupt(_processor: u32, _this: Opaque) {
    bus().wait_for_interrupt();
}

unsafe extern "C" fn fault_begins(_processor: u32, this: Opaque) {
    const INTERRUPT_STATE: u32 = 0xE000_ED04;
    let exception = machine().word(INTERRUPT_STATE) & 0x1FF;
    let pc = Instruction::from_number(this as usize as u64).pc();
    bus().fault_begins(exception, machine().vector(exception) == pc);
}
