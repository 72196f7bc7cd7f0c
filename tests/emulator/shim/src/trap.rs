//! The HardFault entry: decode, post or ask, step on.

use core::arch::global_asm;
use core::cell::UnsafeCell;

use crate::link::Link;
use crate::machine;
use crate::protocol::{
    self, EXTERNAL_BUS, EXTERNAL_BUS_END, MEMORY_WORDS, MESSAGE_WORDS, command, fault, header, message, post,
    prefetched, resume,
};
use crate::thumb::{self, Access, Direction, Transfer, Width};

// The tick counter is read by the second instruction and again shortly before the last, so that what lies between costs the product
// nothing and the rest is a constant, measured once (`udf #1`, `udf #2`).
global_asm!(
    ".section .text.shim_hard_fault, \"ax\"",
    ".global shim_hard_fault",
    ".thumb_func",
    "shim_hard_fault:",
    "ldr r0, ={count}",
    "ldr r0, [r0]",
    "mov r1, sp",
    "ldr r2, =shim_stack_top",
    "mov sp, r2",
    "push {{r1, lr}}",
    "push {{r4-r11}}",
    "mov r2, sp",
    "mov r3, lr",
    "bl shim_trap",
    "pop {{r4-r11}}",
    "pop.w {{r1, lr}}",
    "mov sp, r1",
    "ldr r1, ={count}",
    "ldr r2, =shim_left_at",
    "ldr r3, [r1]",
    "str r3, [r2]",
    "str r0, [r1, #{reload} - {count}]",
    "bx lr",
    ".ltorg",
    ".section .bss.shim_left_at, \"aw\", %nobits",
    ".balign 4",
    ".global shim_left_at",
    "shim_left_at:",
    ".space 4",
    ".section .text.shim_timer, \"ax\"",
    ".global shim_timer",
    ".thumb_func",
    "shim_timer:",
    "udf #0",
    "bx lr",
    count = const machine::TIMER_COUNT,
    reload = const machine::TIMER_RELOAD,
);

// SAFETY: defined by the assembly above as one aligned word, which only that assembly writes.
unsafe extern "C" {
    static shim_left_at: u32;
}

/// First address of the shim's own code.
const SHIM_CODE: u32 = 0x080F_0000;
const UNDEFINED: u16 = 0xDE00;
const TIMER_FIRED: u16 = UNDEFINED;
const CALIBRATION_STARTS: u16 = UNDEFINED + 1;
const CALIBRATION_ENDS: u16 = UNDEFINED + 2;
const PRODUCT_STARTS: u16 = UNDEFINED + 3;
const WAIT_FOR_INTERRUPT: u16 = 0xBF30;
/// A timer interrupt this many ticks before its time was armed for a deadline that no longer counts.
const SPURIOUS: u32 = 8;
const FARTHEST: u32 = i32::MAX as u32;

/// What the exception hardware stacks.
#[repr(C)]
struct Frame {
    low: [u32; 4],
    r12: u32,
    lr: u32,
    pc: u32,
    xpsr: u32,
}

const FRAME_BYTES: u32 = 32;
const FRAME_PC: u32 = 24;

struct State {
    link: Link,
    /// Counts between the way out and the next way in that are the shim's own.
    overhead: u32,
    /// Ticks of the product since the last resume, at the last way out.
    time: u32,
    /// Ticks since the last resume at which the product is interrupted.
    deadline: u32,
    posts: usize,
    /// Header and posted entries, ready to be sent.
    outgoing: [u32; MESSAGE_WORDS],
    incoming: [u32; MESSAGE_WORDS],
    prefetched: usize,
    prefetch: [[u32; prefetched::WORDS]; resume::PREFETCH_CAPACITY],
    watch: u32,
    read_wait: u32,
    write_wait: u32,
    post_bound: u32,
}

struct Shared(UnsafeCell<State>);

// SAFETY: only the start-up code and the HardFault entry use the state, on one core, and neither interrupts the other
// while it holds the reference (the start-up code traps only between its uses).
unsafe impl Sync for Shared {}

static STATE: Shared = Shared(UnsafeCell::new(State {
    link: Link::CLOSED,
    overhead: 0,
    time: 0,
    deadline: 0,
    posts: 0,
    outgoing: [0; MESSAGE_WORDS],
    incoming: [0; MESSAGE_WORDS],
    prefetched: 0,
    prefetch: [[0; prefetched::WORDS]; resume::PREFETCH_CAPACITY],
    watch: 0,
    read_wait: 0,
    write_wait: 0,
    post_bound: 0,
}));

/// Opens the link and lets the host speak before the product starts.
pub(crate) fn hello(timer_in_time: bool) {
    // SAFETY: see `Shared`; no trap can happen while the reference lives.
    let state = unsafe { &mut *STATE.0.get() };
    state.link = Link::open();
    let version = protocol::VERSION;
    state.exchange(message::HELLO, 0, version, 4, 0, u32::from(timer_in_time));
    state.time = 0;
}

/// Called by the assembly with the tick count, the stacked frame, r4 to r11 and the exception return value.
/// Returns the ticks after which the timer shall interrupt.
#[unsafe(no_mangle)]
extern "C" fn shim_trap(count: u32, frame: *mut Frame, saved: *mut [u32; 8], exception_return: u32) -> u32 {
    // SAFETY: see `Shared`.
    let state = unsafe { &mut *STATE.0.get() };
    // SAFETY: the assembly passes the address of the frame that the hardware has just stacked and of the eight registers it has
    // just pushed; both live on stacks that nothing else touches until this function returns.
    let (frame, saved) = unsafe { (&mut *frame, &mut *saved) };
    // SAFETY: see its declaration; the assembly does not run while this function does.
    let left_at = unsafe { core::ptr::read_volatile(&raw const shim_left_at) };
    let spent = count.wrapping_sub(left_at);
    let now = state.time.wrapping_add(spent.wrapping_sub(state.overhead));
    let first = machine::read_half(frame.pc);

    if frame.pc >= SHIM_CODE {
        state.time = match first {
            // Got here by an undefined instruction.
            TIMER_FIRED => state.timer_fired(now - 1, frame),
            CALIBRATION_ENDS => {
                // The undefined instruction is counted as executed; a load or store that is trapped is not.
                state.overhead = spent - 1;
                0
            }
            CALIBRATION_STARTS => {
                state.deadline = FARTHEST;
                0
            }
            // The jump to the product is counted, too.
            PRODUCT_STARTS => u32::MAX,
            _ => state.fail(now, frame, saved),
        };
        frame.pc += 2;
        return state.remaining();
    }

    const PROCESS_STACK: u32 = 1 << 2;
    if exception_return & PROCESS_STACK != 0 {
        state.fail(now, frame, saved);
    }
    let registers = all_registers(frame, saved);
    let second = machine::read_half(frame.pc + 2);
    let Some(access) = thumb::decode(first, second, &registers) else { state.fail(now, frame, saved) };
    if !is_trapped(access.address) {
        state.fail(now, frame, saved);
    }
    state.time = state.perform(now, &access, frame, saved, &registers);
    if let Some((register, value)) = access.write_back
        && !loads(&access, register)
    {
        set_register(frame, saved, register, value);
    }
    frame.pc += access.length;
    frame.xpsr = thumb::advance_it(frame.xpsr);
    state.remaining()
}

impl State {
    fn remaining(&self) -> u32 {
        // Before the product's first instruction the time is -1.
        let remaining = i64::from(self.deadline) - i64::from(self.time.cast_signed());
        remaining.clamp(1, FARTHEST.into()) as u32
    }

    /// Carries the access out and returns the ticks since the last resume after it.
    fn perform(
        &mut self,
        now: u32,
        access: &Access,
        frame: &mut Frame,
        saved: &mut [u32; 8],
        registers: &[u32; 16],
    ) -> u32 {
        let mut time = now;
        let mut address = access.address;
        for register in register_list(access.transfer) {
            let wait = self.wait(access.direction, address);
            match access.direction {
                Direction::Store => {
                    let value = access.cut(registers[usize::from(register & 15)]);
                    time = self.post(time, address, value, access.width.bytes(), frame.pc) + wait;
                }
                Direction::Load => {
                    let value = match self.prefetched(time, address, access.width) {
                        Some(value) => {
                            let kind = access.width.bytes() | post::SERVED;
                            time = self.post(time, address, value, kind, frame.pc) + wait;
                            value
                        }
                        None => {
                            let width = access.width.bytes();
                            let value = self.exchange(message::READ, time, address, width, frame.pc, 0);
                            time = wait;
                            value
                        }
                    };
                    set_register(frame, saved, register, access.extend(value));
                }
            }
            address = address.wrapping_add(4);
        }
        time + 1
    }

    fn wait(&self, direction: Direction, address: u32) -> u32 {
        match direction {
            _ if !(EXTERNAL_BUS..EXTERNAL_BUS_END).contains(&address) => 0,
            Direction::Load => self.read_wait,
            Direction::Store => self.write_wait,
        }
    }

    /// Prefetched values hold until the next event, unless the product wrote something that may change them; that of a running counter holds
    /// at its tick.
    fn prefetched(&self, time: u32, address: u32, width: Width) -> Option<u32> {
        let external = (EXTERNAL_BUS..EXTERNAL_BUS_END).contains(&address);
        let expected = if external { Width::Half } else { Width::Word };
        if width != expected || time >= self.deadline {
            return None;
        }
        let holds = |at: u32| at == prefetched::ANY || at == time;
        let entries = &self.prefetch[..self.prefetched];
        let entry = entries.iter().find(|entry| entry[prefetched::ADDRESS] == address && holds(entry[prefetched::AT]));
        entry.map(|entry| entry[prefetched::VALUE])
    }

    /// Keeps an entry for the next message. Returns its time: if the buffer was full, the product has been resumed there.
    fn post(&mut self, time: u32, address: u32, value: u32, kind: u32, pc: u32) -> u32 {
        let mut time = time;
        if kind & post::SERVED == 0 {
            if changes_inputs(address) {
                self.prefetched = 0;
            } else {
                self.forget(address);
            }
        }
        if self.posts == post::CAPACITY {
            self.exchange(message::FULL, time, 0, 0, pc, 0);
            time = 0;
        }
        if kind & post::SERVED == 0 {
            self.deadline = self.deadline.min(time.saturating_add(self.post_bound));
        }
        let start = header::WORDS + self.posts * post::WORDS;
        self.outgoing[start..start + post::WORDS].copy_from_slice(&[time, address, value, kind, pc]);
        self.posts += 1;
        time
    }

    /// What the product wrote itself is no longer what the host foretold: flags that it clears, for one.
    fn forget(&mut self, address: u32) {
        for entry in &mut self.prefetch[..self.prefetched] {
            if entry[prefetched::ADDRESS] == address & !3 {
                // Nothing is read at address 0.
                entry[prefetched::ADDRESS] = 0;
            }
        }
    }

    fn timer_fired(&mut self, now: u32, frame: &Frame) -> u32 {
        if now.wrapping_add(SPURIOUS) < self.deadline {
            return now;
        }
        // The frame of the product lies above the one that the undefined instruction of the timer handler stacked.
        const PADDED: u32 = 1 << 9;
        let own = core::ptr::from_ref(frame) as u32;
        let padding = if frame.xpsr & PADDED != 0 { 4 } else { 0 };
        let pc = machine::read(own + FRAME_BYTES + padding + FRAME_PC);
        let idle = machine::read_half(pc.wrapping_sub(2)) == WAIT_FOR_INTERRUPT;
        self.exchange(message::TIMER, now, 0, 0, pc, u32::from(idle));
        0
    }

    /// One message to the host, and its commands until the product may go on. Returns the value that the host answered.
    fn exchange(&mut self, kind: u32, ticks: u32, address: u32, width: u32, pc: u32, flags: u32) -> u32 {
        let watched = if self.watch == 0 { 0 } else { machine::read(self.watch) };
        let payload = self.posts * post::WORDS;
        self.outgoing[..header::WORDS].copy_from_slice(&[
            kind,
            ticks,
            address,
            width,
            pc,
            watched,
            flags,
            payload as u32,
        ]);
        self.link.send(&self.outgoing[..header::WORDS + payload]);
        self.posts = 0;
        self.obey()
    }

    fn obey(&mut self) -> u32 {
        loop {
            self.link.receive(&mut self.incoming);
            match self.incoming[0] {
                command::RESUME => return self.resume(),
                command::READ_MEMORY => {
                    let (address, words) = (self.incoming[1], self.incoming[2] as usize);
                    self.send_memory(address, words.min(MEMORY_WORDS));
                }
                command::WRITE_MEMORY => {
                    machine::write(self.incoming[1], self.incoming[2]);
                    self.send_memory(0, 0);
                }
                _ => crate::link::exit(),
            }
        }
    }

    fn send_memory(&mut self, address: u32, words: usize) {
        self.outgoing[..header::WORDS].fill(0);
        self.outgoing[header::KIND] = message::MEMORY;
        self.outgoing[header::PAYLOAD] = words as u32;
        for index in 0..words {
            let from = address.wrapping_add(index as u32 * 4);
            self.outgoing[header::WORDS + index] = machine::read(from);
        }
        self.link.send(&self.outgoing[..header::WORDS + words]);
    }

    fn resume(&mut self) -> u32 {
        let words = &self.incoming;
        self.watch = words[resume::WATCH];
        self.read_wait = words[resume::READ_WAIT];
        self.write_wait = words[resume::WRITE_WAIT];
        self.post_bound = words[resume::POST_BOUND];
        self.prefetched = (words[resume::PREFETCHED] as usize).min(resume::PREFETCH_CAPACITY);
        for (index, entry) in self.prefetch[..self.prefetched].iter_mut().enumerate() {
            let start = resume::WORDS + index * prefetched::WORDS;
            entry.copy_from_slice(&words[start..start + prefetched::WORDS]);
        }
        self.deadline = words[resume::BUDGET].clamp(1, FARTHEST);
        machine::write(machine::TIMER_RELOAD, u32::MAX);
        machine::drop_timer_interrupt();
        for word in 0..3 {
            machine::pend(word, words[resume::PEND + word as usize], words[resume::LEVEL + word as usize]);
        }
        words[resume::VALUE]
    }

    /// Reports what cannot be served and never lets the product go on.
    fn fail(&mut self, now: u32, frame: &Frame, saved: &[u32; 8]) -> ! {
        const FAULT_STATUS: [u32; 4] = [0xE000_ED28, 0xE000_ED2C, 0xE000_ED34, 0xE000_ED38];
        let registers = all_registers(frame, saved);
        let mut record = [0; fault::WORDS];
        record[..16].copy_from_slice(&registers);
        record[16] = frame.xpsr;
        for (slot, address) in record[17..21].iter_mut().zip(FAULT_STATUS) {
            *slot = machine::read(address);
        }
        if frame.pc < SHIM_CODE + 0x1_0000 {
            let first = u32::from(machine::read_half(frame.pc));
            record[21] = first | u32::from(machine::read_half(frame.pc + 2)) << 16;
        }
        if self.posts > 0 {
            self.exchange(message::FULL, now, 0, 0, frame.pc, 0);
        }
        self.outgoing[header::WORDS..header::WORDS + fault::WORDS].copy_from_slice(&record);
        self.outgoing[..header::WORDS].copy_from_slice(&[
            message::FAULT,
            now,
            0,
            0,
            frame.pc,
            0,
            0,
            fault::WORDS as u32,
        ]);
        self.link.send(&self.outgoing[..header::WORDS + fault::WORDS]);
        loop {
            self.obey();
        }
    }
}

/// Whether a write may change what the product reads of the ring controller or of its pins. A write to the peripherals on APB1
/// and APB2 (timers, converters, watchdog, interrupt routing) changes no more than its own register, one to the ports or the external bus
/// may.
fn changes_inputs(address: u32) -> bool {
    !(0x4000_0000..0x4002_0000).contains(&address)
}

fn is_trapped(address: u32) -> bool {
    matches!(address >> 28, 0x4..=0x7 | 0xA..=0xB)
}

fn loads(access: &Access, register: u8) -> bool {
    access.direction == Direction::Load && register_list(access.transfer).any(|loaded| loaded == register)
}

fn register_list(transfer: Transfer) -> impl Iterator<Item = u8> {
    let (first, second, mut list) = match transfer {
        Transfer::Single(register) => (Some(register), None, 0),
        Transfer::Pair(low, high) => (Some(low), Some(high), 0),
        Transfer::Multiple(list) => (None, None, list),
    };
    first.into_iter().chain(second).chain(core::iter::from_fn(move || {
        if list == 0 {
            return None;
        }
        let register = list.trailing_zeros() as u8;
        list &= list - 1;
        Some(register)
    }))
}

/// r0 to r15 as the trapped instruction saw them.
fn all_registers(frame: &Frame, saved: &[u32; 8]) -> [u32; 16] {
    const PADDED: u32 = 1 << 9;
    let padding = if frame.xpsr & PADDED != 0 { 4 } else { 0 };
    let mut registers = [0; 16];
    registers[..4].copy_from_slice(&frame.low);
    registers[4..12].copy_from_slice(saved);
    registers[12] = frame.r12;
    registers[13] = core::ptr::from_ref(frame) as u32 + FRAME_BYTES + padding;
    registers[14] = frame.lr;
    registers[15] = frame.pc;
    registers
}

fn set_register(frame: &mut Frame, saved: &mut [u32; 8], number: u8, value: u32) {
    match number {
        0..=3 => frame.low[usize::from(number & 3)] = value,
        4..=11 => saved[usize::from((number - 4) & 7)] = value,
        12 => frame.r12 = value,
        14 => frame.lr = value,
        // The decoder lets neither the stack pointer nor the program counter be loaded.
        _ => {}
    }
}
