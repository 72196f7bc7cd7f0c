//! The product in QEMU, seen as one more participant of the simulation: it has a next event and is run from event to event.

mod flash;
mod survival;

use std::cell::Cell;
use std::collections::VecDeque;
use std::ffi::OsString;
use std::path::{Path, PathBuf};

use object::{Object, ObjectSection, ObjectSymbol};
use ring::Nanoseconds;

use crate::clock::TickClock;
use crate::log::{Log, LogLine};
use crate::measure::{Measurements, Probe, Trigger, Watched};
use crate::peripherals::{Access, Peripherals};
use crate::prefetch::{Foretold, Place, Prefetch};
use crate::qemu::Qemu;
use crate::trace::{self, TraceSink};
use crate::{EmulatorError, Environment, Hold, StopAt, Stopped};
use emulator_link::protocol::trace::FILE;
use emulator_link::protocol::{VERSION, command, fault, header, message, post, prefetched, resume};

pub use survival::{Incident, Reset, What};

/// The emulator.
pub const QEMU: &str = "qemu-system-arm";
/// The environment variable that names another program to run instead.
pub const QEMU_VARIABLE: &str = "QEMU";

/// What to run.
#[derive(Clone, Debug)]
pub struct GuestConfiguration {
    /// The release ELF of the product.
    pub product: PathBuf,
    /// The bus inside QEMU, which answers its accesses: a library that QEMU loads.
    pub bus: PathBuf,
    /// The emulator; a name is looked up in the search path.
    pub qemu: OsString,
    /// How long a write may wait for the next exchange before the product is interrupted to deliver it. The write keeps its own time, and so
    /// does an edge that it causes on an interrupt pin; only the product's interrupt for that edge may come this much late.
    pub post_bound: Nanoseconds,
    /// QEMU and the thread that starts it share a CPU, which is faster and changes no result.
    pub one_cpu: bool,
    /// QEMU executes as many instructions at once as it can; otherwise one by one, which is slower and changes no result.
    pub whole_blocks: bool,
    /// Answers carry what is going to be read next, which is faster and changes no result.
    pub foretells: bool,
}

impl GuestConfiguration {
    /// The usual one, with the QEMU that [`QEMU_VARIABLE`] names.
    #[must_use]
    pub fn new(product: impl Into<PathBuf>, bus: impl Into<PathBuf>) -> Self {
        Self {
            product: product.into(),
            bus: bus.into(),
            qemu: std::env::var_os(QEMU_VARIABLE).unwrap_or_else(|| QEMU.into()),
            post_bound: Nanoseconds::from_microseconds(5),
            one_cpu: true,
            whole_blocks: true,
            foretells: true,
        }
    }
}

/// A write, or a read that the bus answered, not yet carried out on the models.
#[derive(Clone, Copy, Debug)]
struct Posted {
    ticks: u32,
    address: u32,
    value: u32,
    kind: u32,
    pc: u32,
}

/// What the bus waits for.
#[derive(Clone, Copy, Debug)]
struct Question {
    kind: u32,
    ticks: u32,
    address: u32,
    width: u32,
    pc: u32,
    watched: u32,
    idle: bool,
}

/// A running product.
///
/// The world advances to [`Guest::next_event`] and calls [`Guest::run`], again and again; the guest never gets ahead of the world.
#[derive(Debug)]
pub struct Guest {
    /// To start another QEMU after a reset.
    configuration: GuestConfiguration,
    qemu: Qemu,
    words: Vec<u32>,
    clock: TickClock,
    wake: Nanoseconds,
    posted: VecDeque<Posted>,
    question: Question,
    peripherals: Peripherals,
    prefetch: Prefetch,
    /// Most values that an answer carries.
    foretold: usize,
    post_bound: Nanoseconds,
    log: Log,
    lines: Vec<LogLine>,
    measurements: Measurements,
    /// Ticks of the last event of the current segment, for the instruction count.
    counted: u32,
    switches_set: bool,
    symbols: Vec<Symbol>,
    held: Option<Hold>,
    flash: flash::State,
    production_record: Vec<u8>,
    watched_addresses: Vec<u32>,
    /// The next event, once worked out between two runs.
    next: Cell<Option<Nanoseconds>>,
    survival: survival::Survival,
}

impl Guest {
    /// Starts QEMU and waits until the bus is up. The product has not executed an instruction yet.
    ///
    /// # Errors
    /// QEMU is missing, an ELF is not what it should be, or the bus does not come up.
    pub fn start(configuration: &GuestConfiguration) -> Result<Self, EmulatorError> {
        let product = read_elf(&configuration.product)?;
        check_product(configuration, &product)?;
        check_bus(&configuration.bus)?;
        let log = Log::new(&configuration.product, &product)?;
        let qemu = Qemu::start(configuration)?;
        let peripherals = Peripherals::new();
        let mut guest = Self {
            configuration: configuration.clone(),
            qemu,
            words: Vec::new(),
            clock: TickClock::new(peripherals.clock_tree().core),
            wake: Nanoseconds::ZERO,
            posted: VecDeque::new(),
            question: Question { kind: 0, ticks: 0, address: 0, width: 4, pc: 0, watched: 0, idle: false },
            peripherals,
            prefetch: Prefetch::default(),
            foretold: if configuration.foretells { resume::PREFETCH_CAPACITY } else { 0 },
            post_bound: configuration.post_bound,
            log,
            lines: Vec::new(),
            measurements: Measurements::default(),
            counted: 0,
            switches_set: false,
            symbols: symbols_of(configuration, &product)?,
            held: None,
            flash: flash::State::default(),
            production_record: flash::BLANK_RECORD.to_vec(),
            watched_addresses: Vec::new(),
            next: Cell::new(None),
            survival: survival::Survival::default(),
        };
        guest.greet()?;
        guest.copy_production_record()?;
        Ok(guest)
    }

    /// Waits until the bus is up.
    fn greet(&mut self) -> Result<(), EmulatorError> {
        self.receive()?;
        let hello = self.question;
        if hello.kind != message::HELLO || hello.address != VERSION {
            return Err(EmulatorError::Guest(format!(
                "it speaks protocol {}, expected {VERSION}; build it and the emulator from the same sources",
                hello.address
            )));
        }
        self.question.idle = false;
        Ok(())
    }

    /// The time of the guest's oldest unanswered access, question or wake-up, or of what its peripherals do by themselves before: a write
    /// that waited may have brought that forward.
    #[must_use]
    pub fn next_event(&self) -> Option<Nanoseconds> {
        if let Some(next) = self.next.get() {
            return Some(next);
        }
        if self.flash.has_lost_supply() {
            return None;
        }
        if self.stands_still() {
            return self.peripherals.watchdog.expires();
        }
        let guest = match (self.posted.front(), self.held) {
            (Some(first), _) => Some(self.clock.time_of(first.ticks)),
            (None, Some(Hold::Until(end))) => Some(end),
            // Peripherals or pins will move.
            (None, Some(Hold::Interrupt(_))) => None,
            (None, None) => Some(self.question_time()),
        };
        let next = self.peripherals.next_event().into_iter().chain(guest).min();
        self.next.set(next);
        next
    }

    /// Does what is due at `now` and, if that answers the guest's question, lets the guest run until it asks again: at `horizon` at the latest.
    ///
    /// The world must have been advanced to `now`, and `horizon` must not be later than the next instant at which anything in the world
    /// may change that the guest can see, above all the interrupt pins. The pins are sampled at `now`; to be called at each of their edges.
    ///
    /// # Errors
    /// Whatever the product does that the real part would not survive, and the end of QEMU.
    pub fn run<E: Environment + ?Sized>(
        &mut self,
        environment: &mut E,
        now: Nanoseconds,
        horizon: Nanoseconds,
    ) -> Result<(), EmulatorError> {
        self.next.set(None);
        if self.flash.has_lost_supply() || self.is_bitten(environment, now)? || self.stands_still() {
            return Ok(());
        }
        if !self.switches_set {
            self.switches_set = true;
            self.peripherals.set_switches(environment);
        }
        self.sample(environment, now)?;
        while let Some(first) = self.posted.front().copied() {
            let time = self.clock.time_of(first.ticks);
            if time > now {
                return Ok(());
            }
            self.posted.pop_front();
            self.clock.pass(first.ticks);
            self.carry_out(environment, first, time)?;
        }
        if let Some(hold) = self.held {
            return self.hold_on(environment, hold, now);
        }
        let time = self.question_time();
        if time > now {
            return Ok(());
        }
        self.clock.pass(self.question.ticks);
        if self.question.kind == message::RESET {
            return self.reset_by_itself(environment, time);
        }
        if self.question.kind == message::TIMER && self.question.idle {
            // QEMU ends a WFI a few ticks late, now so, now so, as the host's threads meet: no instruction was executed in them.
            self.clock.settle(time);
        } else {
            self.clock.pull_up(time);
        }
        let value = self.answer(environment, time)?;
        self.fetch_log(time)?;
        if self.stands_by_flash(time)? {
            return Ok(());
        }
        // Time goes on, if only by so little that no event of the peripherals is passed over.
        let mut horizon = horizon.max(time + Nanoseconds(1));
        if self.question.kind == message::STOPPED {
            self.stopped(environment, time)?;
            if self.held.is_some() {
                return Ok(());
            }
            // The horizon is from before whatever has been done to the world.
            horizon = time + Nanoseconds(1);
        }
        if self.sleeps_on(horizon) {
            return Ok(());
        }
        self.resume(environment, value, time, horizon)?;
        self.receive()
    }

    /// Lets go of a product that is held, once it is time.
    fn hold_on<E: Environment + ?Sized>(
        &mut self,
        environment: &mut E,
        hold: Hold,
        now: Nanoseconds,
    ) -> Result<(), EmulatorError> {
        let over = match hold {
            Hold::Until(end) => end <= now,
            Hold::Interrupt(interrupt) => self.peripherals.has_raised(interrupt),
        };
        if !over {
            return Ok(());
        }
        self.held = None;
        self.clock.settle(now);
        if self.flash.ends(now) {
            self.peripherals.release(environment, now);
            return Ok(());
        }
        self.resume(environment, 0, now, now + Nanoseconds(1))?;
        self.receive()
    }

    /// Tells the environment that the product has stopped, which may hold it or name the next stop.
    fn stopped<E: Environment + ?Sized>(&mut self, environment: &mut E, now: Nanoseconds) -> Result<(), EmulatorError> {
        const INTERRUPT_STATE: u32 = 0xE000_ED04;
        let pc = self.question.pc;
        let exception = (self.read_memory(INTERRUPT_STATE, 1)?[0] & 0x1FF) as u16;
        environment.stopped(self, Stopped { now, pc, exception })?;
        self.sample(environment, now)
    }

    /// A processor that waits for an interrupt and gets none need not be asked: it goes on waiting, without an exchange.
    fn sleeps_on(&mut self, horizon: Nanoseconds) -> bool {
        let waits = self.question.kind == message::TIMER && self.question.idle;
        if !waits || self.peripherals.interrupts_wait() || self.survival.non_maskable {
            return false;
        }
        self.restart_ticks();
        self.wake = self.peripherals.next_interrupt().map_or(horizon, |event| event.min(horizon));
        self.question.ticks = self.clock.ticks_until(self.wake);
        self.measurements.slept_on += 1;
        true
    }

    /// The guest's ticks count from here.
    fn restart_ticks(&mut self) {
        self.clock.resume();
        self.counted = 0;
        self.prefetch.resume();
    }

    /// Counters and latencies so far.
    #[must_use]
    pub fn measurements(&self) -> &Measurements {
        &self.measurements
    }

    /// Measures one more latency from now on; the result is in [`Measurements::probes`].
    pub fn add_probe(&mut self, probe: Probe) {
        self.measurements.probes.push(probe);
    }

    /// Log lines since last asked.
    pub fn take_log(&mut self) -> Vec<LogLine> {
        std::mem::take(&mut self.lines)
    }

    /// Stops the product once, before an instruction that it comes to: [`Environment::stopped`] is called then. To be called while the product waits
    /// for an answer; a stop that it has not come to yet is forgotten.
    ///
    /// # Errors
    /// The end of QEMU.
    pub fn stop_at(&mut self, stop: StopAt) -> Result<(), EmulatorError> {
        self.ask(&[command::STOP_AT, stop.address, stop.behind], 0)
    }

    /// Lets the product, which has just stopped, stand before its instruction, as behind a bus that does not answer. What interrupts it then comes
    /// behind that instruction, if its priority allows it.
    pub const fn hold(&mut self, hold: Hold) {
        self.held = Some(hold);
    }

    /// From now on [`Measurements::watched`] tells of the accesses to these addresses.
    pub fn watch_accesses(&mut self, addresses: &[u32]) {
        self.watched_addresses.extend_from_slice(addresses);
    }

    fn watch(&mut self, access: Access, value: u32, writes: bool) {
        if self.watched_addresses.contains(&access.address) {
            let Access { now, address, pc, .. } = access;
            self.measurements.watched.push(Watched { time: now, address, value, pc, writes });
        }
    }

    /// Address and bytes of a static or a function of the product: `board::bridge::TRIPPED`. Of several that are named so, the first.
    #[must_use]
    pub fn symbol(&self, path: &str) -> Option<(u32, u32)> {
        let mangled: String = path.split("::").map(|part| format!("{}{part}", part.len())).collect();
        let found = self.symbols.iter().find(|symbol| symbol.name.contains(&mangled))?;
        Some((found.address, found.bytes))
    }

    /// The handler of an interrupt of the NVIC, as the product's vector says.
    ///
    /// # Errors
    /// The end of QEMU.
    pub fn handler_of(&mut self, interrupt: u8) -> Result<u32, EmulatorError> {
        const VECTORS: u32 = 0x0800_0000;
        const FIRST_INTERRUPT: u32 = 16;
        Ok(self.read_memory(VECTORS + 4 * (FIRST_INTERRUPT + u32::from(interrupt)), 1)?[0] & !1)
    }

    /// From now on the bus inside QEMU writes down what the product executes, while it waits for an answer.
    ///
    /// # Errors
    /// The end of QEMU.
    pub fn begin_trace(&mut self) -> Result<(), EmulatorError> {
        self.ask(&[command::TRACE, 1], 0)
    }

    /// Ends the trace, while the product waits for an answer, and gives all of it to `sink`.
    ///
    /// # Errors
    /// The end of QEMU, or the trace cannot be read.
    pub fn end_trace(&mut self, sink: &mut impl TraceSink) -> Result<(), EmulatorError> {
        self.ask(&[command::TRACE, 0], 0)?;
        trace::read_file(&self.qemu.folder().join(FILE), sink)
    }

    /// A memory command and its answer, left in `words`.
    fn ask(&mut self, command: &[u32], expected: usize) -> Result<(), EmulatorError> {
        self.qemu.send(command)?;
        self.qemu.receive(&mut self.words)?;
        if self.words.first() == Some(&message::FAILED) {
            return Err(EmulatorError::Guest(text_of(self.words.get(header::WORDS..).unwrap_or_default())));
        }
        if self.words.first() != Some(&message::MEMORY) || self.words.len() != header::WORDS + expected {
            return Err(EmulatorError::Guest("wrong answer to a memory command".into()));
        }
        Ok(())
    }

    pub(crate) fn peripherals(&self) -> &Peripherals {
        &self.peripherals
    }

    fn question_time(&self) -> Nanoseconds {
        let time = self.clock.time_of(self.question.ticks);
        // However late a WFI ends, nothing was executed in it. One that was due at once takes one tick, so that time goes on.
        let waited = self.question.kind == message::TIMER && self.question.idle && time >= self.wake;
        match waited {
            true if self.wake > self.clock.time_of(0) => self.wake,
            true => self.clock.time_of(1),
            false => time,
        }
    }

    fn sample<E: Environment + ?Sized>(&mut self, environment: &mut E, now: Nanoseconds) -> Result<(), EmulatorError> {
        self.peripherals.advance(environment, now)?;
        let [int0, int1] = self.peripherals.sample(environment, now)?;
        if int0.is_some() {
            self.happened(Trigger::Int0Edge, now);
        }
        if int1.is_some() {
            self.happened(Trigger::Int1Edge, now);
        }
        Ok(())
    }

    fn happened(&mut self, trigger: Trigger, time: Nanoseconds) {
        for probe in &mut self.measurements.probes {
            probe.happened(trigger, time);
        }
    }

    fn count_instructions(&mut self, ticks: u32) {
        self.measurements.instructions += u64::from(ticks.saturating_sub(self.counted));
        self.counted = self.counted.max(ticks);
    }

    fn carry_out<E: Environment + ?Sized>(
        &mut self,
        environment: &mut E,
        posted: Posted,
        time: Nanoseconds,
    ) -> Result<(), EmulatorError> {
        self.count_instructions(posted.ticks);
        self.peripherals.advance(environment, time)?;
        let access = Access { now: time, address: posted.address, width: posted.kind & 0xFF, pc: posted.pc };
        if posted.kind & post::ENTERED != 0 {
            self.handler_begins(time, posted.value, posted.address);
            return Ok(());
        }
        self.survival.log_is_up = true;
        self.measurements.trace.fold(time, posted.address, posted.value, posted.pc);
        self.watch(access, posted.value, posted.kind & post::SERVED == 0);
        if posted.kind & post::SERVED != 0 {
            self.measurements.prefetched_reads += 1;
            self.prefetch.pass(Place::Read { pc: posted.pc, address: posted.address }, posted.ticks);
            self.happened(Trigger::Read(posted.address), time);
            return Ok(());
        }
        self.measurements.writes += 1;
        self.peripherals.write(environment, access, posted.value)?;
        self.clock.set_frequency(self.peripherals.clock_tree().core);
        self.happened(Trigger::Write(posted.address), time);
        self.sample(environment, time)
    }

    fn answer<E: Environment + ?Sized>(
        &mut self,
        environment: &mut E,
        time: Nanoseconds,
    ) -> Result<u32, EmulatorError> {
        let question = self.question;
        if question.kind == message::TIMER && question.idle {
            self.measurements.idle_wakes += 1;
        } else {
            self.count_instructions(question.ticks);
            self.measurements.busy_wakes += u64::from(question.kind == message::TIMER);
        }
        if question.kind != message::READ {
            return Ok(0);
        }
        self.measurements.reads += 1;
        self.survival.log_is_up = true;
        let access = Access { now: time, address: question.address, width: question.width, pc: question.pc };
        self.prefetch.pass(Place::Read { pc: question.pc, address: question.address }, question.ticks);
        let value = self.peripherals.read(environment, access)?;
        self.measurements.trace.fold(time, question.address, value, question.pc);
        self.watch(access, value, false);
        self.happened(Trigger::Read(question.address), time);
        self.sample(environment, time)?;
        Ok(value)
    }

    fn resume<E: Environment + ?Sized>(
        &mut self,
        environment: &mut E,
        value: u32,
        time: Nanoseconds,
        horizon: Nanoseconds,
    ) -> Result<(), EmulatorError> {
        let (edges, levels) = self.peripherals.take_interrupts();
        self.restart_ticks();
        self.measurements.exchanges += 1;
        for vector in (0..96_u8).filter(|vector| edges & 1 << vector != 0) {
            self.happened(Trigger::Interrupt(vector), time);
            self.prefetch.pass(Place::Interrupt(vector), 0);
        }
        // A processor that waits for an interrupt sees nothing of what happens before; one that is at work must not run past an event
        // that changes what it may read.
        let waits =
            self.question.kind == message::TIMER && self.question.idle && edges == 0 && !self.survival.non_maskable;
        let event = if waits { self.peripherals.next_interrupt() } else { self.peripherals.next_event() };
        self.wake = event.map_or(horizon, |event| event.min(horizon));
        let (clock, wake) = (self.clock, self.wake);
        let peripherals = &self.peripherals;
        let chain = self.prefetch.chain(self.foretold, |address, ticks| {
            if let Some(value) = peripherals.peek(environment, address, time, wake) {
                return Some(Foretold { address, value, at: prefetched::ANY });
            }
            let then = clock.time_of(ticks);
            let value = (ticks > 0 && then < wake).then(|| peripherals.foretell(environment, address, then))??;
            Some(Foretold { address, value, at: ticks })
        });
        let (read_cycles, write_cycles) = self.peripherals.fsmc.cycles();
        let frequency = self.peripherals.clock_tree().core;
        let bound = TickClock::new(frequency).ticks_until(self.post_bound);
        let budget = self.clock.ticks_until(self.wake);
        let mut words = [0; resume::WORDS + prefetched::WORDS * resume::PREFETCH_CAPACITY];
        words[resume::KIND] = command::RESUME;
        words[resume::VALUE] = value;
        words[resume::BUDGET] = budget;
        for word in 0..3 {
            words[resume::PEND + word] = (edges >> (32 * word)) as u32;
            words[resume::LEVEL + word] = (levels >> (32 * word)) as u32;
        }
        words[resume::WATCH] = self.log.watch();
        words[resume::READ_WAIT] = TickClock::ticks_of_cycles(read_cycles);
        words[resume::WRITE_WAIT] = TickClock::ticks_of_cycles(write_cycles);
        words[resume::POST_BOUND] = bound;
        words[resume::NON_MASKABLE] = u32::from(std::mem::take(&mut self.survival.non_maskable));
        words[resume::PREFETCHED] = chain.len() as u32;
        for (slot, foretold) in words[resume::WORDS..].chunks_exact_mut(prefetched::WORDS).zip(&chain) {
            slot[prefetched::ADDRESS] = foretold.address;
            slot[prefetched::VALUE] = foretold.value;
            slot[prefetched::AT] = foretold.at;
        }
        self.qemu.send(&words[..resume::WORDS + prefetched::WORDS * chain.len()])
    }

    fn receive(&mut self) -> Result<(), EmulatorError> {
        self.qemu.receive(&mut self.words)?;
        let words = &self.words;
        if words.len() < header::WORDS || words.len() != header::WORDS + words[header::PAYLOAD] as usize {
            return Err(EmulatorError::Guest(format!("message of {} words", words.len())));
        }
        self.question = Question {
            kind: words[header::KIND],
            ticks: words[header::TICKS],
            address: words[header::ADDRESS],
            width: words[header::WIDTH],
            pc: words[header::PC],
            watched: words[header::WATCHED],
            idle: words[header::FLAGS] & 1 != 0,
        };
        let payload = &words[header::WORDS..];
        if self.question.kind == message::FAILED {
            return Err(EmulatorError::Guest(text_of(payload)));
        }
        if self.question.kind == message::FAULT {
            let time = self.clock.time_of(self.question.ticks);
            let report = fault_report(payload);
            return Err(EmulatorError::Fault { time, report });
        }
        self.posted.extend(payload.chunks_exact(post::WORDS).map(|entry| Posted {
            ticks: entry[post::TICKS],
            address: entry[post::ADDRESS],
            value: entry[post::VALUE],
            kind: entry[post::KIND],
            pc: entry[post::PC],
        }));
        Ok(())
    }

    fn fetch_log(&mut self, time: Nanoseconds) -> Result<(), EmulatorError> {
        let write = self.question.watched;
        if !self.survival.log_is_up {
            // Behind a reset the memory of the log is what it was before.
            return Ok(());
        }
        let Some(block) = self.log.wants(write) else {
            return Ok(());
        };
        let descriptor = self.read_memory(block, 2)?;
        let (buffer, size) = (descriptor[0], descriptor[1]);
        if write >= size {
            // The control block is not initialised yet.
            return Ok(());
        }
        let start = self.log.read_index() as usize;
        let words = self.read_memory(buffer & !3, (size as usize).div_ceil(4) + 1)?;
        let skew = (buffer & 3) as usize;
        let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
        let ring = &bytes[skew..skew + size as usize];
        let end = write as usize;
        let fresh = if start <= end { ring[start..end].to_vec() } else { [&ring[start..], &ring[..end]].concat() };
        if let Some((address, index)) = self.log.fetched(write, &fresh) {
            self.write_memory(address, &[index])?;
        }
        self.measurements.log_exchanges += 3;
        let lines = self.log.lines(time);
        self.lines.extend(lines);
        Ok(())
    }
}

/// A name of the product's.
#[derive(Debug)]
struct Symbol {
    name: String,
    address: u32,
    bytes: u32,
}

fn symbols_of(configuration: &GuestConfiguration, elf: &[u8]) -> Result<Vec<Symbol>, EmulatorError> {
    let broken = |what: String| EmulatorError::Elf { path: configuration.product.clone(), what };
    let file = object::File::parse(elf).map_err(|error| broken(error.to_string()))?;
    let named = file.symbols().filter(|symbol| symbol.size() > 0);
    Ok(named
        .filter_map(|symbol| {
            Some(Symbol {
                name: symbol.name().ok()?.to_owned(),
                address: symbol.address() as u32 & !u32::from(symbol.kind() == object::SymbolKind::Text),
                bytes: symbol.size() as u32,
            })
        })
        .collect())
}

fn read_elf(path: &Path) -> Result<Vec<u8>, EmulatorError> {
    std::fs::read(path).map_err(|error| EmulatorError::Elf { path: path.to_owned(), what: error.to_string() })
}

/// The product's vector table must be where the processor looks for it.
fn check_product(configuration: &GuestConfiguration, elf: &[u8]) -> Result<(), EmulatorError> {
    const PRODUCT_VECTORS: u64 = 0x0800_0000;
    let broken = |what: &str| EmulatorError::Elf { path: configuration.product.clone(), what: what.into() };
    let file = object::File::parse(elf).map_err(|error| broken(&error.to_string()))?;
    let table = file
        .section_by_name(".vector_table")
        .ok_or_else(|| broken("no section .vector_table: not a firmware of cortex-m-rt"))?;
    if table.address() != PRODUCT_VECTORS {
        return Err(broken("the vector table is not at 0x0800_0000"));
    }
    Ok(())
}

/// QEMU's own words about a library that is not there name neither cause nor remedy.
fn check_bus(bus: &Path) -> Result<(), EmulatorError> {
    let missing = |what: String| EmulatorError::Elf { path: bus.to_owned(), what };
    let build = "build it with `cargo xtask build`";
    let content =
        std::fs::read(bus).map_err(|error| missing(format!("the bus inside QEMU is missing ({error}); {build}")))?;
    object::File::parse(&*content)
        .map(drop)
        .map_err(|error| missing(format!("this is not the bus inside QEMU ({error}); {build}")))
}

/// The text of a [`message::FAILED`].
fn text_of(payload: &[u32]) -> String {
    let bytes: Vec<u8> = payload.iter().flat_map(|word| word.to_le_bytes()).take_while(|byte| *byte != 0).collect();
    String::from_utf8_lossy(&bytes).into_owned()
}

fn fault_report(record: &[u32]) -> String {
    if record.len() < fault::WORDS {
        return "(record incomplete)".into();
    }
    let registers: Vec<String> =
        record[..13].iter().enumerate().map(|(number, value)| format!("r{number} {value:08x}")).collect();
    let (first, second) = (record[21] & 0xFFFF, record[21] >> 16);
    format!(
        "pc {:08x} (code {first:04x} {second:04x}), lr {:08x}, sp {:08x}, xpsr {:08x}, CFSR {:08x}, HFSR {:08x}, MMFAR {:08x}, BFAR {:08x}, {}",
        record[15],
        record[14],
        record[13],
        record[16],
        record[17],
        record[18],
        record[19],
        record[20],
        registers.join(" ")
    )
}
