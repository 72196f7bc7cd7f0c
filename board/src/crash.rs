//! The record of a crash in memory that start-up does not touch, and what the fault handler finds out for it.
//!
//! The handler itself is in `app`: it switches bridge and brake off in its first instructions and has a stack of its own, so that it works whatever
//! has become of the program.

use core::sync::atomic::{AtomicU32, Ordering};

use drive::ResetCause;
use drive::crash::{CRASH_WORDS, CrashCause, CrashRecord, FILE_BYTES, end_of_file_name};
use stm32f4xx_hal::pac;

use crate::stack_guard;

/// In `.uninit`, which cortex-m-rt leaves alone: noise after power-on, the same as before after every other reset.
#[unsafe(link_section = ".uninit.crash")]
static mut RECORD: core::mem::MaybeUninit<[u32; CRASH_WORDS]> = core::mem::MaybeUninit::uninit();
/// Tasks that kept the watchdog from being fed, for the record of a reset that leaves no other trace.
#[unsafe(link_section = ".uninit.silent")]
static mut SILENT: core::mem::MaybeUninit<u32> = core::mem::MaybeUninit::uninit();

/// Line of the panic that is on its way to the fault handler; 0: none.
static PANIC_LINE: AtomicU32 = AtomicU32::new(0);
static PANIC_FILE: [AtomicU32; FILE_BYTES / 4] = [const { AtomicU32::new(0) }; FILE_BYTES / 4];

/// Registers as the fault handler finds them.
#[derive(Clone, Copy, Debug)]
pub struct Found {
    /// Stack pointer on entry: the frame of the exception lies there, if it could be stacked.
    pub stack: u32,
    /// EXC_RETURN.
    pub link: u32,
    /// r4 to r11.
    pub high_registers: [u32; 8],
}

/// What is in memory.
fn load() -> Option<CrashRecord> {
    let mut words = [0; CRASH_WORDS];
    let from = (&raw const RECORD).cast::<u32>();
    for (index, word) in words.iter_mut().enumerate() {
        // SAFETY: within the record, whose words may have any value; volatile, because nobody has written them in this run.
        *word = unsafe { from.add(index).read_volatile() };
    }
    CrashRecord::parse(&words)
}

fn store(record: &CrashRecord) {
    let to = (&raw mut RECORD).cast::<u32>();
    for (index, word) in record.emit().into_iter().enumerate() {
        // SAFETY: within the record; written at start, in idle or in the fault handler, of which none interrupts another unless it ends it.
        unsafe { to.add(index).write_volatile(word) };
    }
}

/// Keeps a crash, behind the one before it.
pub fn keep(record: CrashRecord) {
    store(&record.after(load().as_ref()));
}

/// The last crash since the supply came on; once at every start. From the next start on it has been told of. A reset by the watchdog is one.
#[must_use]
pub fn last(cause: ResetCause) -> Option<CrashRecord> {
    let fresh = load().is_some_and(|record| !record.told);
    if cause == ResetCause::Watchdog && !fresh {
        // SAFETY: any word is a value of it; volatile, because it was written before the reset.
        let silent = unsafe { (&raw const SILENT).cast::<u32>().read_volatile() };
        keep(CrashRecord { detail: silent, ..CrashRecord::new(CrashCause::Watchdog) });
    }
    suspect(0);
    let record = load()?;
    store(&CrashRecord { told: true, ..record });
    Some(record)
}

/// Everything has run for a while: crashes until here are none in a row with one that comes.
pub fn well() {
    if let Some(record) = load().filter(|record| record.in_a_row > 0) {
        store(&CrashRecord { in_a_row: 0, ..record });
    }
}

/// These tasks keep the watchdog from being fed.
pub(crate) fn suspect(tasks: u32) {
    // SAFETY: one word; written at start and in idle only.
    unsafe { (&raw mut SILENT).cast::<u32>().write_volatile(tasks) };
}

/// The place of a panic, before it raises its hard fault.
pub fn note_panic(file: &str, line: u32) {
    for (slot, bytes) in PANIC_FILE.iter().zip(end_of_file_name(file).as_chunks::<4>().0) {
        slot.store(u32::from_le_bytes(*bytes), Ordering::Relaxed);
    }
    PANIC_LINE.store(line.max(1), Ordering::Relaxed);
}

/// What the registers and the system control block tell.
#[must_use]
pub fn examine(found: &Found) -> CrashRecord {
    const STACKING_FAILED: u32 = 1 << 4 | 1 << 12;
    const FLOATING_POINT_STACKED: u32 = 1 << 4;
    const PADDED: u32 = 1 << 9;
    // SAFETY: the registers of the system control block can be read at any time.
    let system = unsafe { &*cortex_m::peripheral::SCB::PTR };
    let status = [system.cfsr.read(), system.hfsr.read(), system.mmfar.read(), system.bfar.read()];
    let mut record = CrashRecord { status, ..CrashRecord::new(cause(&status)) };
    if let Some(slots) = record.registers.get_mut(4..12) {
        slots.copy_from_slice(&found.high_registers);
    }
    record.sp = found.stack;
    match stacked(found.stack).filter(|_| status[0] & STACKING_FAILED == 0) {
        Some([r0, r1, r2, r3, r12, lr, pc, xpsr]) => {
            (record.lr, record.pc, record.xpsr) = (lr, pc, xpsr);
            for (slot, value) in record.registers.iter_mut().zip([r0, r1, r2, r3]) {
                *slot = value;
            }
            if let Some(slot) = record.registers.last_mut() {
                *slot = r12;
            }
            let frame = if found.link & FLOATING_POINT_STACKED == 0 { 104 } else { 32 };
            let padding = if xpsr & PADDED != 0 { 4 } else { 0 };
            record.sp = found.stack.wrapping_add(frame).wrapping_add(padding);
            record.exception = (xpsr & 0x1FF) as u16;
        }
        None => record.exception = innermost_interrupt(),
    }
    if record.cause == CrashCause::Panic {
        record.detail = PANIC_LINE.load(Ordering::Relaxed);
        for (bytes, word) in record.file.as_chunks_mut::<4>().0.iter_mut().zip(&PANIC_FILE) {
            *bytes = word.load(Ordering::Relaxed).to_le_bytes();
        }
    }
    record
}

fn cause(status: &[u32; 4]) -> CrashCause {
    const HARD_FAULT: u32 = 3;
    const NON_MASKABLE: u32 = 2;
    const DATA_ACCESS: u32 = 1 << 1;
    const STACKING: u32 = 1 << 4;
    const ADDRESS_VALID: u32 = 1 << 7;
    let [memory, _, address, _] = *status;
    let guarded = stack_guard::range();
    let touched = memory & ADDRESS_VALID != 0 && memory & DATA_ACCESS != 0 && guarded.contains(&address);
    const LOOPS_STOPPED: u32 = 16 + pac::Interrupt::WWDG as u32;
    // SAFETY: as in `examine`.
    match unsafe { (*cortex_m::peripheral::SCB::PTR).icsr.read() } & 0x1FF {
        LOOPS_STOPPED => CrashCause::ControlStopped,
        HARD_FAULT if memory & STACKING != 0 || touched => CrashCause::StackOverflow,
        HARD_FAULT if PANIC_LINE.load(Ordering::Relaxed) != 0 => CrashCause::Panic,
        HARD_FAULT => CrashCause::Fault,
        // SAFETY: a register that can be read at any time.
        NON_MASKABLE if unsafe { (*pac::RCC::ptr()).cir().read().cssf().bit_is_set() } => CrashCause::Clock,
        _ => CrashCause::Unbound,
    }
}

/// The eight words of an exception's frame, if they can be there.
fn stacked(at: u32) -> Option<[u32; 8]> {
    const RAM: core::ops::RangeInclusive<u32> = 0x2000_0000..=0x2002_0000 - 32;
    if !RAM.contains(&at) || !at.is_multiple_of(4) {
        return None;
    }
    let from = core::ptr::with_exposed_provenance::<u32>(at as usize);
    let mut words = [0; 8];
    for (index, word) in words.iter_mut().enumerate() {
        // SAFETY: aligned, and within the RAM of the part; the guard is open in a fault handler.
        *word = unsafe { from.add(index).read_volatile() };
    }
    Some(words)
}

/// The active interrupt of the highest priority, as an exception number, when the frame that tells it could not be stacked; 0: none.
fn innermost_interrupt() -> u16 {
    const FIRST_INTERRUPT: u16 = 16;
    // SAFETY: the registers of the interrupt controller can be read at any time.
    let controller = unsafe { &*cortex_m::peripheral::NVIC::PTR };
    let active = |number: &u16| {
        let word = controller.iabr.get(usize::from(number >> 5));
        word.is_some_and(|word| word.read() >> (number & 31) & 1 != 0)
    };
    let priority = |number: &u16| controller.ipr.get(usize::from(*number)).map_or(u8::MAX, |priority| priority.read());
    (0..96).filter(active).min_by_key(priority).map_or(0, |number| number.wrapping_add(FIRST_INTERRUPT))
}
