//! The emulated machine: its processor, its memory, its interrupt controller. Nothing here changes once the machine is ready.

use std::ffi::c_int;
use std::sync::OnceLock;

use emulator_link::protocol::{PARAMETER_FLASH, PARAMETER_FLASH_END};

use crate::qemu::{Functions, Opaque, RegionOperations, Section};
use crate::{bus, system};

const RAM: u32 = 0x2000_0000;
const RAM_BYTES: u64 = 0x2_0000;
const FLASH: u32 = 0x0800_0000;
const FLASH_BYTES: u64 = 0x10_0000;
/// First address of NVIC, SCB and SysTick.
pub(crate) const SYSTEM: u32 = 0xE000_E000;
pub(crate) const SYSTEM_BYTES: u64 = 0x1000;
/// Peripherals and external bus: what the product finds there is the emulator's.
const WINDOWS: [(u32, u64); 2] = [(0x4000_0000, 0x4000_0000), (0xA000_0000, 0x2000_0000)];
/// Above everything that QEMU puts there, bit bands included.
const PRIORITY: c_int = 100;

/// What is to be pended.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Raised {
    /// A bit for each interrupt: pended whatever its handler does.
    pub(crate) edges: [u32; 3],
    /// Pended unless its handler is active.
    pub(crate) levels: [u32; 3],
    /// NMI.
    pub(crate) non_maskable: bool,
}

/// Memory of the machine, mapped.
struct Memory {
    at: *const u8,
    bytes: u64,
}

/// The machine that runs the product.
pub(crate) struct Machine {
    qemu: &'static Functions,
    cpu: Opaque,
    nvic: Opaque,
    space: Opaque,
    system: Section,
    ram: Memory,
    flash: Memory,
}

// SAFETY: the pointers are QEMU's own and stay valid as long as the process; QEMU's functions are called in its main thread until the machine is
// ready and in the thread of the only processor afterwards.
unsafe impl Send for Machine {}
// SAFETY: as above.
unsafe impl Sync for Machine {}

static MACHINE: OnceLock<Machine> = OnceLock::new();

static BUS: RegionOperations = RegionOperations::new(bus::region_read, bus::region_write);
static FLASH_REGION: RegionOperations = RegionOperations::new(bus::flash_read, bus::region_write);
static SYSTEM_REGION: RegionOperations = RegionOperations::new(system::region_read, system::region_write);

/// The machine; there is one as soon as anything is executed.
pub(crate) fn machine() -> &'static Machine {
    let Some(machine) = MACHINE.get() else {
        eprintln!("emulator bus: an instruction was executed before the machine was ready");
        std::process::abort();
    };
    machine
}

/// Takes the machine that QEMU has just made over and lays the bus over it. The error says what is not as expected.
pub(crate) fn take_over(qemu: &'static Functions) -> Result<(), &'static str> {
    let null: Opaque = std::ptr::null_mut();
    // SAFETY: the functions as declared; the machine is complete, nothing is executed yet, and this is QEMU's main thread, which holds its lock.
    let (cpu, nvic) = unsafe { ((qemu.cpu)(0), (qemu.resolve)(c"".as_ptr(), c"armv7m_nvic".as_ptr(), null.cast())) };
    if cpu.is_null() || nvic.is_null() {
        return Err("this machine is no ARMv7-M");
    }
    // SAFETY: as above, with the processor just found.
    let (container, space) = unsafe { ((qemu.link)(cpu, c"memory".as_ptr(), null), (qemu.space)(cpu, 0)) };
    if container.is_null() || space.is_null() {
        return Err("this machine's processor has no memory");
    }
    let memory = |first: u32, bytes: u64, written: bool| {
        let mut mapped = bytes;
        // SAFETY: as above; memory that is mapped once stays where it is.
        let at = unsafe { (qemu.map)(space, first.into(), &raw mut mapped, written, 0) };
        (!at.is_null() && mapped == bytes).then_some(Memory { at, bytes })
    };
    let missing = "this machine has no 128 KiB of RAM at 2000_0000 or no 1 MiB of flash at 0800_0000";
    let ram = memory(RAM, RAM_BYTES, true).ok_or(missing)?;
    let flash = memory(FLASH, FLASH_BYTES, false).ok_or(missing)?;
    // SAFETY: as above; asked for before the bus lies over it.
    let system = unsafe { (qemu.find_region)(container, SYSTEM.into(), 4) };
    if system.region.is_null() {
        return Err("this machine has no interrupt controller at E000_E000");
    }
    let overlay = |operations: &'static RegionOperations, first: u32, bytes: u64| {
        // Larger than any version's MemoryRegion, aligned as malloc would.
        let region: Opaque = Box::into_raw(Box::new([0_u128; 256])).cast();
        // SAFETY: as above; the region and its operations live as long as the process.
        unsafe {
            (qemu.init_io)(region, null, operations, first as usize as Opaque, c"emulator-bus".as_ptr(), bytes);
            (qemu.add_overlap)(container, first.into(), region, PRIORITY);
        }
    };
    for (first, bytes) in WINDOWS {
        overlay(&BUS, first, bytes);
    }
    overlay(&SYSTEM_REGION, SYSTEM, SYSTEM_BYTES);
    overlay(&FLASH_REGION, PARAMETER_FLASH, u64::from(PARAMETER_FLASH_END - PARAMETER_FLASH));
    let machine = Machine { qemu, cpu, nvic, space, system, ram, flash };
    for address in (PARAMETER_FLASH..PARAMETER_FLASH_END).step_by(4) {
        machine.plant(address, u32::MAX);
    }
    MACHINE.set(machine).map_err(|_| "this QEMU made two machines")
}

/// A part of the system control space.
impl Machine {
    /// Reads a register of NVIC or SCB. QEMU's lock must be held.
    pub(crate) fn system_read(&self, offset: u64, bytes: u32) -> u32 {
        let mut value = 0;
        // SAFETY: the region that was found there, within it.
        unsafe {
            (self.qemu.dispatch_read)(
                self.system.region,
                self.system.offset + offset,
                &raw mut value,
                exponent(bytes),
                0,
            )
        };
        value as u32
    }

    /// Writes a register of NVIC or SCB. QEMU's lock must be held.
    pub(crate) fn system_write(&self, offset: u64, value: u32, bytes: u32) {
        // SAFETY: the region that was found there, within it.
        unsafe {
            (self.qemu.dispatch_write)(
                self.system.region,
                self.system.offset + offset,
                value.into(),
                exponent(bytes),
                0,
            )
        };
    }

    /// Pends exceptions. QEMU's lock must be held.
    pub(crate) fn pend(&self, raised: &Raised) {
        const ACTIVE: u64 = 0x300;
        const FIRST_INTERRUPT: u32 = 16;
        const NON_MASKABLE: c_int = 2;
        if raised.non_maskable {
            // SAFETY: the NVIC that was found, and an exception that every one has.
            unsafe { (self.qemu.set_pending)(self.nvic, NON_MASKABLE, false) };
        }
        for (number, (edges, levels)) in raised.edges.iter().zip(&raised.levels).enumerate() {
            let mut pending = *edges;
            if *levels != 0 {
                pending |= levels & !self.system_read(ACTIVE + 4 * number as u64, 4);
            }
            while pending != 0 {
                let exception = FIRST_INTERRUPT + 32 * number as u32 + pending.trailing_zeros();
                // SAFETY: the NVIC that was found, and an interrupt that it has.
                unsafe { (self.qemu.set_pending)(self.nvic, exception as c_int, false) };
                pending &= pending - 1;
            }
        }
    }

    /// Does something under QEMU's lock, which a callback of an instruction does not hold.
    pub(crate) fn locked<T>(&self, work: impl FnOnce() -> T) -> T {
        // SAFETY: the thread does not hold the lock; the name and line are for QEMU's own messages.
        unsafe { (self.qemu.lock)(c"emulator-bus".as_ptr(), 0) };
        let done = work();
        // SAFETY: locked above.
        unsafe { (self.qemu.unlock)() };
        done
    }
}

/// A part of memory, and the processor.
impl Machine {
    /// The word at an address of memory or of a register, without side effects in memory. 0 where nothing is.
    pub(crate) fn word(&self, address: u32) -> u32 {
        for (first, memory) in [(RAM, &self.ram), (FLASH, &self.flash)] {
            let offset = u64::from(address.wrapping_sub(first));
            if offset + 4 <= memory.bytes {
                // SAFETY: within the mapping; the only processor stands still meanwhile.
                return unsafe { memory.at.add(offset as usize).cast::<u32>().read_unaligned() };
            }
        }
        let mut value = 0_u32;
        // SAFETY: four bytes of ours; QEMU takes its lock itself where it needs it.
        unsafe { (self.qemu.read)(self.space, address.into(), 0, (&raw mut value).cast(), 4) };
        value
    }

    /// Writes a word of memory, flash included; what was translated from there is translated anew.
    pub(crate) fn plant(&self, address: u32, value: u32) {
        if (PARAMETER_FLASH..PARAMETER_FLASH_END - 3).contains(&address) {
            let offset = (address - FLASH) as usize;
            // SAFETY: within the mapping of a memory that is written nowhere else; nothing is executed from there, and the only processor stands
            // still meanwhile.
            unsafe { self.flash.at.add(offset).cast_mut().cast::<u32>().write_unaligned(value) };
            return;
        }
        // SAFETY: as in `word`.
        unsafe { (self.qemu.write_rom)(self.space, address.into(), 0, (&raw const value).cast(), 4) };
    }

    /// Writes a word as the processor would.
    pub(crate) fn set_word(&self, address: u32, value: u32) {
        // SAFETY: as in `word`.
        unsafe { (self.qemu.write)(self.space, address.into(), 0, (&raw const value).cast(), 4) };
    }

    /// A vector of the product.
    pub(crate) fn vector(&self, exception: u32) -> u32 {
        self.word(FLASH + 4 * exception) & !1
    }

    /// From now on a block is one instruction, or as many as QEMU likes.
    pub(crate) fn set_one_instruction(&self, one: bool) {
        // SAFETY: a variable of QEMU's that is read at every look for a block; of the thread that looks. On a little-endian machine its first
        // byte is its value.
        unsafe { (*self.qemu.one_instruction).store(one.into(), std::sync::atomic::Ordering::Relaxed) };
    }

    /// Leaves the block that is being executed; the instruction whose callback or access is at `at_host` is looked for anew.
    pub(crate) fn leave_block(&self, at_host: usize) -> ! {
        self.set_one_instruction(true);
        // SAFETY: called within that instruction. QEMU leaves by a long jump, which runs no destructors: no frame of ours in between has any.
        unsafe { (self.qemu.exit_restore)(self.cpu, at_host) }
    }

    /// The processor's registers as QEMU prints them for people; empty where it does not.
    pub(crate) fn registers_as_text(&self) -> String {
        let (mut text, mut bytes) = (std::ptr::null_mut(), 0);
        // SAFETY: the stream writes into memory of its own, whose place and length it leaves here when it is closed; it is copied and freed.
        unsafe {
            let stream = libc::open_memstream(&raw mut text, &raw mut bytes);
            if stream.is_null() {
                return String::new();
            }
            (self.qemu.dump_state)(self.cpu, stream, 0);
            libc::fclose(stream);
            let copy = String::from_utf8_lossy(std::slice::from_raw_parts(text.cast(), bytes)).into_owned();
            libc::free(text.cast());
            copy
        }
    }
}

fn exponent(bytes: u32) -> c_int {
    bytes.trailing_zeros() as c_int
}
