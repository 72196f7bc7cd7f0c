//! The accesses of the product and the dialogue with the emulator about them.
//!
//! Writes are posted: they travel with the next message, each with its time. Reads are answered from what the last answer foretold, or asked.
//! The product stands still while the emulator thinks; time is what it executes and what the emulator names as bus waits, nothing else.

use std::path::PathBuf;

use emulator_link::protocol::{
    EXTERNAL_BUS, EXTERNAL_BUS_END, MEMORY_WORDS, MESSAGE_WORDS, VERSION, acts_at_once, command, header, message, post,
    prefetched, resume, trace,
};
use emulator_link::{Page, Side};

use crate::blocks::{Begin, Blocks, Instruction, Made};
use crate::bus;
use crate::machine::{Raised, SYSTEM, SYSTEM_BYTES, machine};
use crate::qemu::{Address, Opaque};
use crate::self_test;
use crate::trace::Trace;
use crate::{fault, system};

/// The state of the bus, used by the thread of the only processor.
pub(crate) struct Bus {
    page: Page,
    /// Where the page lies, and a trace.
    folder: PathBuf,
    /// Written only while somebody wants it: a look at this is all that it costs otherwise.
    trace: Option<Trace>,
    pub(crate) blocks: Blocks,
    /// The handlers of faults are entered; otherwise the product ends there.
    faults_run_on: bool,
    greeted: bool,
    outgoing: [u32; MESSAGE_WORDS],
    incoming: [u32; MESSAGE_WORDS],
    posts: usize,
    foretold: [[u32; prefetched::WORDS]; resume::PREFETCH_CAPACITY],
    foretold_count: usize,
    watch: u32,
    read_wait: u64,
    write_wait: u64,
    post_bound: u64,
    /// Interrupts that the current access has raised and that must wait until its block is left.
    raised: Option<Raised>,
}

/// Who asks: within an access QEMU's lock is held.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Lock {
    Held,
    Free,
}

impl Bus {
    pub(crate) const fn new(page: Page, folder: PathBuf, whole_blocks: bool) -> Self {
        Self {
            page,
            folder,
            trace: None,
            blocks: Blocks::new(whole_blocks),
            faults_run_on: false,
            greeted: false,
            outgoing: [0; MESSAGE_WORDS],
            incoming: [0; MESSAGE_WORDS],
            posts: 0,
            foretold: [[0; prefetched::WORDS]; resume::PREFETCH_CAPACITY],
            foretold_count: 0,
            watch: 0,
            read_wait: 0,
            write_wait: 0,
            post_bound: 0,
            raised: None,
        }
    }

    /// Before every instruction.
    #[inline]
    pub(crate) fn each(&mut self, this: Instruction, at_host: usize) {
        match self.blocks.begin(this, at_host) {
            Begin::Go => {}
            Begin::Again => return,
            Begin::Due => {
                self.due();
                self.blocks.go_on();
            }
            Begin::Wrong => {
                self.fail(&format!("QEMU executes {:08x} out of turn; use QEMU 7.2, 10.0 or 11.1", this.pc()))
            }
        }
        if self.blocks.stops() {
            self.stop();
        }
        if self.trace.is_some() {
            self.write_down(|trace| trace.instruction(this));
        }
    }

    /// Stops before the current instruction, which has taken its tick: what is pended now comes behind it.
    #[cold]
    fn stop(&mut self) {
        const INSTRUCTION: u64 = 1;
        self.exchange(message::STOPPED, self.blocks.ticks - INSTRUCTION, Question::NONE, Lock::Free);
        self.blocks.ticks = INSTRUCTION;
    }

    /// Writes into the trace, if there is one.
    #[cold]
    fn write_down(&mut self, write: impl FnOnce(&mut Trace) -> std::io::Result<()>) {
        if let Some(Err(error)) = self.trace.as_mut().map(write) {
            self.trace_fails(&error);
        }
    }

    fn trace_fails(&mut self, error: &std::io::Error) -> ! {
        let file = self.folder.join(trace::FILE);
        self.fail(&format!("the trace {} cannot be written ({error}); TMPDIR names where it shall be", file.display()))
    }

    fn due(&mut self) {
        if self.greeted {
            self.exchange(message::TIMER, self.blocks.ticks, Question::NONE, Lock::Free);
        } else {
            self.greeted = true;
            if let Err(what) = self_test::run() {
                self.fail(&what);
            }
            self.exchange(message::HELLO, 0, Question { address: VERSION, width: 4, idle: false }, Lock::Free);
        }
        self.blocks.ticks = 0;
    }

    /// A WFI stays before itself until an interrupt is pending; then it has nothing to wait for.
    pub(crate) fn wait_for_interrupt(&mut self) {
        const INTERRUPT_STATE: u32 = 0xE000_ED04;
        let state = machine().word(INTERRUPT_STATE);
        if state & 0x1FF != 0 {
            let pc = self.blocks.current.pc();
            self.fail(&format!(
                "the product waits for an interrupt in a handler (WFI at {pc:08x}); let only the idle task wait"
            ));
        }
        while machine().word(INTERRUPT_STATE) >> 12 & 0x1FF == 0 {
            let until = self.blocks.deadline.max(self.blocks.ticks);
            self.exchange(message::TIMER, until, Question { idle: true, ..Question::NONE }, Lock::Free);
            self.blocks.ticks = 0;
        }
    }

    /// The handler of a fault begins, or what they all come to: the run ends, or the emulator is told and the product goes on.
    pub(crate) fn fault_begins(&mut self, exception: u32, is_vector: bool) {
        if !self.faults_run_on {
            match fault::record() {
                Ok(record) => self.end_with(message::FAULT, &record),
                Err(what) => self.fail(&what),
            }
        }
        if is_vector {
            let at = self.blocks.current.pc();
            self.post(self.blocks.ticks - 1, at, exception, post::ENTERED, Lock::Free);
        }
    }

    /// The product resets itself: the emulator puts another QEMU in the place of this one.
    pub(crate) fn reset_requested(&mut self) -> ! {
        self.exchange(message::RESET, self.blocks.ticks - 1, Question::NONE, Lock::Held);
        self.fail("a product that has reset itself goes on")
    }

    /// The product has come to its end. Everything posted goes first.
    pub(crate) fn end_with(&mut self, kind: u32, payload: &[u32]) -> ! {
        if self.posts > 0 {
            self.exchange(message::FULL, self.blocks.ticks, Question::NONE, Lock::Free);
            self.blocks.ticks = 0;
        }
        let payload = &payload[..payload.len().min(MEMORY_WORDS)];
        self.outgoing[..header::WORDS].fill(0);
        self.outgoing[header::KIND] = kind;
        self.outgoing[header::TICKS] = self.blocks.ticks as u32;
        self.outgoing[header::PC] = self.blocks.current.pc();
        self.outgoing[header::PAYLOAD] = payload.len() as u32;
        self.outgoing[header::WORDS..header::WORDS + payload.len()].copy_from_slice(payload);
        loop {
            self.hand_over(header::WORDS + payload.len());
        }
    }

    /// Tells the emulator why there is no going on.
    pub(crate) fn fail(&mut self, why: &str) -> ! {
        self.posts = 0;
        let words: Vec<u32> = why
            .as_bytes()
            .chunks(4)
            .map(|bytes| bytes.iter().rev().fold(0, |word, byte| word << 8 | u32::from(*byte)))
            .collect();
        self.end_with(message::FAILED, &words)
    }

    /// Sends what lies in `outgoing` and waits for the answer, which lies in `incoming` then.
    fn hand_over(&mut self, words: usize) {
        let dialogue = self.page.send(Side::Guest, &self.outgoing[..words]);
        if let Err(error) = dialogue.and_then(|()| self.page.wait(Side::Guest, None)) {
            eprintln!("emulator bus: the shared page fails: {error}");
            // SAFETY: ends the process at once; QEMU's other threads have nothing to save.
            unsafe { libc::_exit(3) };
        }
        for (slot, word) in self.incoming.iter_mut().zip(self.page.message(Side::Host)) {
            *slot = word;
        }
    }

    /// One message to the emulator and its commands until the product may go on; gives the value that it answers.
    fn exchange(&mut self, kind: u32, ticks: u64, question: Question, lock: Lock) -> u32 {
        let payload = self.posts * post::WORDS;
        let watched = if self.watch == 0 { 0 } else { machine().word(self.watch) };
        self.outgoing[..header::WORDS].copy_from_slice(&[
            kind,
            ticks as u32,
            question.address,
            question.width,
            self.blocks.current.pc(),
            watched,
            u32::from(question.idle),
            payload as u32,
        ]);
        self.posts = 0;
        self.hand_over(header::WORDS + payload);
        loop {
            match self.incoming[0] {
                command::RESUME if kind == message::RESET => {
                    self.fail("the emulator resumes a product that has reset itself")
                }
                command::RESUME => return self.resume(lock),
                command::READ_MEMORY => {
                    let (from, words) = (self.incoming[1], (self.incoming[2] as usize).min(MEMORY_WORDS));
                    for index in 0..words {
                        self.outgoing[header::WORDS + index] = machine().word(from.wrapping_add(4 * index as u32));
                    }
                    self.answer(words);
                }
                command::WRITE_MEMORY => {
                    let (to, words) = (self.incoming[1], (self.incoming[2] as usize).min(MEMORY_WORDS));
                    for (index, word) in self.incoming[3..].iter().take(words).enumerate() {
                        plant(to.wrapping_add(4 * index as u32), *word, lock);
                    }
                    self.answer(0);
                }
                command::FAULTS_RUN_ON => {
                    self.faults_run_on = self.incoming[1] != 0;
                    self.answer(0);
                }
                command::DEBUGGER => {
                    system::attach_debugger(self.incoming[1] != 0);
                    self.answer(0);
                }
                command::TRACE => {
                    let begun =
                        (self.incoming[1] != 0).then(|| Trace::begin(&self.folder.join(trace::FILE))).transpose();
                    let ended =
                        begun.and_then(|begun| std::mem::replace(&mut self.trace, begun).map_or(Ok(()), Trace::end));
                    if let Err(error) = ended {
                        self.trace_fails(&error);
                    }
                    self.answer(0);
                }
                command::STOP_AT => {
                    self.blocks.stop_at(self.incoming[1], self.incoming[2]);
                    self.answer(0);
                }
                unknown => self.fail(&format!("the emulator gives command {unknown}, which the bus does not know")),
            }
        }
    }

    fn answer(&mut self, words: usize) {
        self.outgoing[..header::WORDS].fill(0);
        self.outgoing[header::KIND] = message::MEMORY;
        self.outgoing[header::PAYLOAD] = words as u32;
        self.hand_over(header::WORDS + words);
    }

    fn resume(&mut self, lock: Lock) -> u32 {
        let words = &self.incoming;
        self.watch = words[resume::WATCH];
        self.read_wait = words[resume::READ_WAIT].into();
        self.write_wait = words[resume::WRITE_WAIT].into();
        self.post_bound = words[resume::POST_BOUND].into();
        self.foretold_count = (words[resume::PREFETCHED] as usize).min(resume::PREFETCH_CAPACITY);
        let values = words[resume::WORDS..].chunks_exact(prefetched::WORDS);
        for (slot, value) in self.foretold[..self.foretold_count].iter_mut().zip(values) {
            slot.copy_from_slice(value);
        }
        self.blocks.deadline = words[resume::BUDGET].max(1).into();
        let value = words[resume::VALUE];
        let mut raised = Raised { non_maskable: words[resume::NON_MASKABLE] != 0, ..Raised::default() };
        raised.edges.copy_from_slice(&words[resume::PEND..resume::PEND + 3]);
        raised.levels.copy_from_slice(&words[resume::LEVEL..resume::LEVEL + 3]);
        if raised != Raised::default() {
            match lock {
                Lock::Free => machine().locked(|| machine().pend(&raised)),
                Lock::Held if self.blocks.current.is_alone() => machine().pend(&raised),
                // The block must be left first, or the interrupt would come at its end.
                Lock::Held => self.raised = Some(raised),
            }
        }
        value
    }

    /// Keeps an entry for the next message.
    fn post(&mut self, mut time: u64, address: u32, value: u32, kind: u32, lock: Lock) {
        let write = kind & (post::SERVED | post::ENTERED) == 0;
        if write {
            self.forget(address);
        }
        if self.posts == post::CAPACITY {
            self.exchange(message::FULL, time, Question::NONE, lock);
            self.blocks.ticks -= time;
            time = 0;
        }
        if write {
            self.blocks.deadline = self.blocks.deadline.min(time + self.post_bound);
        }
        let start = header::WORDS + self.posts * post::WORDS;
        let entry = [time as u32, address, value, kind, self.blocks.current.pc()];
        self.outgoing[start..start + post::WORDS].copy_from_slice(&entry);
        self.posts += 1;
    }

    /// What the product writes may change what was foretold. A register of APB1 or APB2 (timers, converters, watchdog, interrupt routing) changes
    /// no more than itself; a port or the external bus may change any input.
    fn forget(&mut self, address: u32) {
        if !(0x4000_0000..0x4002_0000).contains(&address) {
            self.foretold_count = 0;
        }
        for entry in &mut self.foretold[..self.foretold_count] {
            if entry[prefetched::ADDRESS] == address & !3 {
                // Nothing is read at address 0.
                entry[prefetched::ADDRESS] = 0;
            }
        }
    }

    /// Values that were foretold hold until the next event; that of a running counter holds at its tick.
    fn foretold(&self, time: u64, address: u32, width: u32) -> Option<u32> {
        let expected = if is_external(address) { 2 } else { 4 };
        if width != expected || time >= self.blocks.deadline {
            return None;
        }
        let holds = |at: u32| at == prefetched::ANY || u64::from(at) == time;
        let entries = &self.foretold[..self.foretold_count];
        let entry = entries.iter().find(|entry| entry[prefetched::ADDRESS] == address && holds(entry[prefetched::AT]));
        entry.map(|entry| entry[prefetched::VALUE])
    }

    /// An access begins. Gives the value if it was made before its block was left.
    fn begin_access(&mut self, address: u32) -> Option<u32> {
        if let Some(made) = self.blocks.made.take() {
            if made.address != address {
                let (pc, before) = (self.blocks.current.pc(), made.address);
                self.fail(&format!(
                    "the instruction at {pc:08x} accesses {before:08x} and, begun again, {address:08x}"
                ));
            }
            if let Some(raised) = made.raised {
                machine().pend(&raised);
            }
            return Some(made.value);
        }
        let current = self.blocks.current;
        if current.accesses_several() && !current.is_alone() {
            self.blocks.leave(0, None);
        }
        if self.trace.is_some() {
            self.write_down(|trace| trace.access(address));
        }
        None
    }

    fn end_access(&mut self, address: u32, value: u32) {
        let raised = self.raised.take();
        self.blocks.end_access(Made { address, value, raised });
    }

    fn read(&mut self, address: u32, width: u32) -> u32 {
        if let Some(value) = self.begin_access(address) {
            return value;
        }
        let time = self.blocks.ticks - 1;
        let value = match self.foretold(time, address, width) {
            Some(value) => {
                self.post(time, address, value, width | post::SERVED, Lock::Held);
                self.blocks.ticks += if is_external(address) { self.read_wait } else { 0 };
                value
            }
            None => {
                let wait = if is_external(address) { self.read_wait } else { 0 };
                let question = Question { address, width, idle: false };
                let value = self.exchange(message::READ, time, question, Lock::Held);
                self.blocks.ticks = 1 + wait;
                value
            }
        };
        self.end_access(address, value);
        value
    }

    fn write(&mut self, address: u32, value: u32, width: u32) {
        if self.begin_access(address).is_some() {
            return;
        }
        self.post(self.blocks.ticks - 1, address, value, width, Lock::Held);
        if acts_at_once(address) {
            self.exchange(message::ACTS, self.blocks.ticks - 1, Question::NONE, Lock::Held);
            self.blocks.ticks = 1;
        }
        self.blocks.ticks += if is_external(address) { self.write_wait } else { 0 };
        self.end_access(address, value);
    }
}

/// Writes a word of memory, or a register of NVIC or SCB.
fn plant(address: u32, value: u32, lock: Lock) {
    let offset = u64::from(address.wrapping_sub(SYSTEM));
    let in_system = || machine().system_write(offset, value, 4);
    match lock {
        _ if offset >= SYSTEM_BYTES => machine().plant(address, value),
        Lock::Free => machine().locked(in_system),
        Lock::Held => in_system(),
    }
}

/// What a message asks beside its kind.
#[derive(Clone, Copy)]
struct Question {
    address: u32,
    width: u32,
    idle: bool,
}

impl Question {
    const NONE: Self = Self { address: 0, width: 0, idle: false };
}

fn is_external(address: u32) -> bool {
    (EXTERNAL_BUS..EXTERNAL_BUS_END).contains(&address)
}

/// A read of the product in the flash that holds the parameters, which is memory; `base` is its first address.
pub(crate) unsafe extern "C" fn flash_read(base: Opaque, offset: Address, width: u32) -> u64 {
    let address = (base as usize as u64 + offset) as u32;
    // By bytes of whole words: a word that begins in the last one does not lie in the mapping, and would be looked for here again.
    (0..width).rev().fold(0, |value, byte| {
        let at = address + byte;
        value << 8 | u64::from(machine().word(at & !3) >> (8 * (at & 3)) & 0xFF)
    })
}

/// A read of the product in one of the windows; `base` is the window's first address.
pub(crate) unsafe extern "C" fn region_read(base: Opaque, offset: Address, width: u32) -> u64 {
    let address = (base as usize as u64 + offset) as u32;
    match self_test::answer(address) {
        Some(value) => value.into(),
        None => bus().read(address, width).into(),
    }
}

/// A write of the product in one of the windows; `base` is the window's first address.
pub(crate) unsafe extern "C" fn region_write(base: Opaque, offset: Address, value: u64, width: u32) {
    let address = (base as usize as u64 + offset) as u32;
    if !self_test::take(address, value as u32, width) {
        bus().write(address, value as u32, width);
    }
}
