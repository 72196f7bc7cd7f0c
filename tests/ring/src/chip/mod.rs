//! A SERCON816 at register and dual-port-RAM level, for slave and for master use.
//!
//! The behaviour is that of `sercon816.md` 4 to 8; where the public record stops, [`Alternatives`] chooses. A chip is driven
//! from two sides: a processor reads and writes registers and RAM ([`ChipBus`]), a ring hands it telegrams, calls
//! [`Chip::on_time`] at every [`Chip::next_event`], and sends what that returns.

mod alternatives;
mod bus;
mod headers;
mod interrupts;
mod master_service;
mod noise;
mod ram;
mod registers;
mod slave_service;
pub mod socket;
mod station;
mod timing;

pub use alternatives::{
    Alternatives, BlockSelect, BufferSense, CounterEnd, Delivery, EnableSense, EndOfBuffer, ErrorBit, EventMap,
    Handshake, InterruptOutput, OneShot, PhaseReadBack, PointerMeaning, ProcessingEnable, Rearm, ResetValues,
    RoutingSense, TelegramErrorFlag, TimerOrder, TimerZero, TimersWithoutMst, TransmitWithoutMst, UnknownStatusBits,
    UpperByte, WindowSign,
};
pub use bus::{ChipBus, SharedChip};
pub use interrupts::{InterruptPin, InterruptPins, PinEdge};
pub use station::ChipMaster;
pub use timing::Straps;

use std::cell::Cell;

use crate::time::Nanoseconds;
use crate::wire::{BROADCAST, LineError, Transmission, encode};
use headers::Walk;
use interrupts::Outputs;
use master_service::MasterService;
use noise::Noise;
use ram::{NMSTERR, Ram, WORDS};
use registers::{Effect, RegisterFile, status_0};
use slave_service::SlaveService;
use timing::TimeBase;

/// Value of a timer register that never fires, whatever 0 means.
const NEVER: u16 = 0xFFFF;
/// Missed MSTs in a row after which any MST is taken again.
const MISSES_UNTIL_UNSYNCHRONISED: u32 = 2;
/// A shorter TSCYC, in ticks, is no cycle (the data sheet's shortest is 62.5 us): no MST supervision, no MST sent.
const SHORTEST_CYCLE: u16 = 30;
/// When CON_CLK comes where it comes by itself, in ticks after the MST.
const CON_CLK_TIME: i32 = 50;

/// A telegram that this chip is sending.
#[derive(Copy, Clone, Debug)]
struct Sending {
    ends: Nanoseconds,
    is_mst: bool,
}

/// One SERCON816.
///
/// It is a master when its repeater is off (01H bit 3): then 03H bit 8 starts the cycle, an MST every TSCYC, until 03H is
/// written as 0000H, the repeater is switched on, or the chip is reset. Before that, each [`Chip::on_cycle_clock`] starts
/// one cycle. Otherwise it is a slave, whose timers stand still
/// until the first MST. A slave takes an MST outside its window as long as the phase in 0AH is below 3, or two MSTs have
/// been missed; else it ignores it, and misses it.
pub struct Chip {
    straps: Straps,
    alternatives: Alternatives,
    noise: Noise,
    registers: RegisterFile,
    ram: Ram,
    outputs: Outputs,
    now: Nanoseconds,
    signal: bool,

    /// The counter of the running cycle, `None` before the first MST.
    base: Option<TimeBase>,
    cycle_has_mst: bool,
    misses: u32,
    timer_done: [bool; 4],
    con_clk_done: bool,
    walk: Walk,
    slave_services: [SlaveService; 8],
    master_services: [MasterService; 8],

    sending: Option<Sending>,
    next_mst: Option<Nanoseconds>,
    /// 03H bit 8 has started a master's cycle: each MST is followed by the next.
    free_running: bool,
    /// End of the last MST that this master sent, and whether it has come back.
    own_mst: Option<(Nanoseconds, bool)>,
    /// The next event as worked out since the last change.
    next: Cell<Option<Option<Nanoseconds>>>,
}

impl Chip {
    /// A chip after power-up at 2 Mbit/s with 32 MHz at MCLK; `seed` decides what garbage it starts with.
    pub fn new(alternatives: Alternatives, seed: u64) -> Self {
        Self::with_straps(Straps::default(), alternatives, seed)
    }

    /// A chip after power-up; `seed` decides what garbage it starts with.
    pub fn with_straps(straps: Straps, alternatives: Alternatives, seed: u64) -> Self {
        let mut noise = Noise::new(seed);
        let ram = Ram::garbage(&mut noise);
        let registers = RegisterFile::reset(straps, &alternatives, &mut noise);
        let mut chip = Self {
            straps,
            alternatives,
            noise,
            registers,
            ram,
            outputs: Outputs::default(),
            now: Nanoseconds::ZERO,
            signal: true,
            base: None,
            cycle_has_mst: false,
            misses: 0,
            timer_done: [true; 4],
            con_clk_done: true,
            walk: Walk::default(),
            slave_services: Default::default(),
            master_services: Default::default(),
            sending: None,
            next_mst: None,
            free_running: false,
            own_mst: None,
            next: Cell::new(None),
        };
        chip.update_outputs(Nanoseconds::ZERO);
        chip
    }

    /// What this chip's G-numbers are.
    pub fn alternatives(&self) -> &Alternatives {
        &self.alternatives
    }

    /// Reads control register `word`; beyond 2AH there is nothing but 0.
    pub fn read_register(&mut self, now: Nanoseconds, word: u16) -> u16 {
        self.now = self.now.max(now);
        self.registers.read(word, &self.alternatives, &mut self.noise)
    }

    /// Writes control register `word`; read-only registers and those beyond 2AH ignore it.
    pub fn write_register(&mut self, now: Nanoseconds, word: u16, value: u16) {
        self.change_at(now);
        match self.registers.write(word, value, &self.alternatives) {
            Effect::None => {}
            Effect::SoftwareReset => self.reset(),
            Effect::Timer(index) => self.rearm_timer(now, index),
            Effect::Command => self.command_cycle(now),
        }
        if !self.signal {
            self.registers.raise_0(status_0::FIBBR);
        }
        self.update_outputs(now);
    }

    /// Reads RAM word `word`, modulo 2048.
    pub fn read_ram(&mut self, now: Nanoseconds, word: u16) -> u16 {
        self.now = self.now.max(now);
        self.ram.get(word)
    }

    /// Writes RAM word `word`, modulo 2048.
    pub fn write_ram(&mut self, now: Nanoseconds, word: u16, value: u16) {
        self.change_at(now);
        let word = word % WORDS;
        self.ram.set(word, value);
        self.walk.on_software_write(word);
        for number in 0..8 {
            let base = self.ram.service_container(number) % WORDS;
            let offset = word.wrapping_sub(base);
            self.slave_services[number].on_software_write(&mut self.ram, base, offset, &self.alternatives);
            self.master_services[number].on_software_write(offset);
        }
    }

    /// The next instant at which [`Chip::on_time`] has something to do; never before the last call or access.
    pub fn next_event(&self) -> Option<Nanoseconds> {
        let next = self.next.get().unwrap_or_else(|| self.work_out_next_event());
        self.next.set(Some(next));
        next.map(|time| time.max(self.now))
    }

    fn work_out_next_event(&self) -> Option<Nanoseconds> {
        let timers = (0..4).filter_map(|index| self.timer_due(index));
        [
            self.sending.map(|sending| sending.ends),
            self.next_mst,
            self.miss_due(),
            self.con_clk_due(),
            self.walk.next_event(),
            self.outputs.next_event(),
        ]
        .into_iter()
        .flatten()
        .chain(timers)
        .min()
    }

    /// Something may change now: what comes next must be worked out again.
    fn change_at(&mut self, now: Nanoseconds) {
        self.now = self.now.max(now);
        self.next.set(None);
    }

    /// Raises flags of 05H out of turn, for a test that wants an event at an instant of its own.
    pub fn raise(&mut self, now: Nanoseconds, flags: u16) {
        self.change_at(now);
        self.registers.raise_1(flags);
        self.update_outputs(now);
    }

    /// Does what is due; a returned transmission starts now.
    pub fn on_time(&mut self, now: Nanoseconds) -> Option<Transmission> {
        self.change_at(now);
        self.outputs.on_time(now, &self.alternatives);
        if let Some(sending) = self.sending.filter(|sending| sending.ends <= now) {
            self.sending = None;
            if sending.is_mst {
                self.own_mst = Some((sending.ends, false));
                self.start_cycle(sending.ends, now, true);
            }
        }
        if self.miss_due().is_some_and(|due| due <= now) {
            self.miss_mst(now);
        }
        for index in 0..4 {
            if self.timer_due(index).is_some_and(|due| due <= now) {
                self.timer_done[index] = true;
                self.registers.raise_1(self.alternatives.event_map.timer_bit(index));
            }
        }
        if self.con_clk_due().is_some_and(|due| due <= now) {
            self.con_clk_done = true;
            self.registers.raise_1(self.alternatives.event_map.con_clk_bit());
        }
        let mst = self.send_mst(now);
        let is_mst = mst.is_some();
        let may_send = !is_mst && self.sending.is_none();
        let transmission = mst.or(self.walk_on_time(now, may_send));
        if let Some(transmission) = &transmission {
            self.sending =
                Some(Sending { ends: now + self.straps.bit_rate.span(encode(&transmission.bytes).len()), is_mst });
        }
        self.update_outputs(now);
        transmission
    }

    /// The opening flag of a telegram begins.
    pub fn on_telegram_start(&mut self, now: Nanoseconds) {
        self.change_at(now);
        self.walk_on_start(now);
    }

    /// A telegram is complete: address and data without frame check sequence, or what was wrong with it. `start` is the
    /// begin of its opening flag, `end` the end of its closing flag and the present time.
    pub fn on_telegram(&mut self, start: Nanoseconds, end: Nanoseconds, frame: Result<&[u8], LineError>) {
        self.change_at(end);
        self.walk_on_end();
        match frame {
            Ok(&[BROADCAST, phase]) if self.registers.repeater_on() => self.on_mst(end, phase),
            Ok(&[BROADCAST, phase]) => self.on_own_mst(end, phase),
            _ => self.walk_on_telegram(start, end, frame),
        }
        self.update_outputs(end);
    }

    /// The receiver lost its signal (`false`) or has it back.
    pub fn on_signal(&mut self, now: Nanoseconds, present: bool) {
        self.change_at(now);
        if present != self.signal {
            self.registers.raise_0(status_0::RDIST);
        }
        self.signal = present;
        if !present {
            self.registers.raise_0(status_0::FIBBR);
        }
        self.update_outputs(now);
    }

    /// An edge at the pin CYC_CLK: starts one cycle of a master that does not run by itself. A slave takes no notice.
    ///
    /// sercon816.md 3.4: a cycle can be started by software or by this signal; a driver whose host clocks the cycles
    /// expects MSTs before it writes 03H.
    pub fn on_cycle_clock(&mut self, now: Nanoseconds) {
        self.change_at(now);
        if !self.registers.repeater_on() && !self.free_running {
            self.schedule_mst(now);
        }
    }

    /// Electrical levels of the interrupt outputs.
    pub fn interrupt_pins(&self) -> InterruptPins {
        self.outputs.levels(&self.alternatives)
    }

    /// The edges of the interrupt outputs since the last call, in order; the last 1024 at most.
    pub fn pin_edges(&mut self) -> Vec<PinEdge> {
        self.outputs.take_edges()
    }

    /// Whether [`Chip::pin_edges`] would return any.
    pub fn has_pin_edges(&self) -> bool {
        self.outputs.has_edges()
    }

    /// The chip is sending a telegram of its own.
    pub fn is_transmitting(&self) -> bool {
        self.sending.is_some()
    }

    /// The chip passes on what it receives: 01H bit 3 is set and it is not sending.
    pub fn repeater_on(&self) -> bool {
        self.registers.repeater_on() && self.sending.is_none()
    }

    /// TSCYC of the block in force, as time; `None` while it is too short to be a cycle.
    pub fn cycle_time(&self) -> Option<Nanoseconds> {
        let cycle = self.registers.cycle_time(&self.alternatives);
        (cycle >= SHORTEST_CYCLE).then(|| timing::ticks(self.straps, self.registers.clock_divider(), cycle))
    }

    /// A pulse at RSTN: registers at their reset values, nothing is sent or repeated any more until software has set it up again. The RAM keeps its
    /// words. How long the pin is low is not modelled.
    pub fn pulse_reset(&mut self, now: Nanoseconds) {
        self.change_at(now);
        self.reset();
        self.update_outputs(now);
    }

    fn reset(&mut self) {
        self.registers = RegisterFile::reset(self.straps, &self.alternatives, &mut self.noise);
        self.base = None;
        self.misses = 0;
        self.walk = Walk::default();
        self.slave_services = Default::default();
        self.master_services = Default::default();
        self.sending = None;
        self.next_mst = None;
        self.free_running = false;
        self.own_mst = None;
    }

    fn update_outputs(&mut self, now: Nanoseconds) {
        self.outputs.update(now, self.registers.flags(), &self.alternatives);
    }

    /// Starts the timers and the header chain; `end` is the end of the MST, or where it should have been.
    fn start_cycle(&mut self, end: Nanoseconds, now: Nanoseconds, with_mst: bool) {
        self.base =
            Some(TimeBase::new(end, self.straps, self.registers.clock_divider(), self.registers.counter_preset()));
        self.cycle_has_mst = with_mst;
        let timers_run = with_mst || self.alternatives.timers_without_mst == TimersWithoutMst::Fire;
        for index in 0..4 {
            let time = self.registers.timer(index, &self.alternatives);
            if timers_run && time == 0 && self.alternatives.timer_zero == TimerZero::FiresAtMst {
                self.registers.raise_1(self.alternatives.event_map.timer_bit(index));
            }
            self.timer_done[index] = !timers_run || time == 0 || time == NEVER;
        }
        self.con_clk_done = !with_mst || self.alternatives.event_map.con_clk_bit() == 0;
        self.start_walk(now);
    }

    /// A timer register was written: it fires in this cycle only if its time is still to come.
    fn rearm_timer(&mut self, now: Nanoseconds, index: usize) {
        let time = self.registers.timer(index, &self.alternatives);
        let silent = !self.cycle_has_mst && self.alternatives.timers_without_mst == TimersWithoutMst::Silent;
        self.timer_done[index] =
            time == 0 || time == NEVER || silent || self.base.is_none_or(|base| base.time_of(i32::from(time)) <= now);
    }

    fn timer_due(&self, index: usize) -> Option<Nanoseconds> {
        let time = self.registers.timer(index, &self.alternatives);
        self.base.filter(|_| !self.timer_done[index]).map(|base| base.time_of(i32::from(time)))
    }

    fn con_clk_due(&self) -> Option<Nanoseconds> {
        self.base.filter(|_| !self.con_clk_done).map(|base| base.time_of(CON_CLK_TIME))
    }

    /// TSCYC, and the counts between which the MST of a slave is in time.
    fn mst_window(&self) -> Option<(i32, i32, i32)> {
        let cycle = self.registers.cycle_time(&self.alternatives);
        let (lower, upper) = self.registers.mst_window();
        let ends = i32::from(cycle).min(i32::from(cycle) + i32::from(upper));
        // A cycle or window that ends before the counter's preset would be missed in the past, and so on without end.
        let reached = self.base.is_none_or(|base| base.reaches(ends));
        let supervised = cycle >= SHORTEST_CYCLE && reached && self.registers.repeater_on();
        let cycle = i32::from(cycle);
        supervised.then(|| (cycle, cycle + i32::from(lower), cycle + i32::from(upper)))
    }

    /// When a slave gives up waiting for the MST.
    fn miss_due(&self) -> Option<Nanoseconds> {
        let (_, _, upper) = self.mst_window()?;
        Some(self.base?.time_of(upper + 1))
    }

    fn miss_mst(&mut self, now: Nanoseconds) {
        let (Some(base), Some((cycle, _, upper))) = (self.base, self.mst_window()) else {
            return;
        };
        self.misses += 1;
        self.count_missed_mst();
        // A TSCYC that was written long after its time is missed once, not for every cycle that would have been since.
        let is_long_ago = base.time_of(cycle.saturating_add(upper).saturating_add(1)) < now;
        self.start_cycle(if is_long_ago { now } else { base.time_of(cycle) }, now, false);
    }

    fn count_missed_mst(&mut self) {
        self.registers.raise_0(status_0::MSTMISS);
        let count = self.ram.get(NMSTERR);
        let next = match self.alternatives.error_counter_end {
            CounterEnd::Saturates => count.saturating_add(1),
            CounterEnd::Wraps => count.wrapping_add(1),
        };
        self.ram.set(NMSTERR, next);
    }

    /// A slave receives an MST.
    fn on_mst(&mut self, end: Nanoseconds, phase: u8) {
        if let (Some(base), Some((cycle, lower, upper))) = (self.base, self.mst_window()) {
            let count = base.mst_count(end);
            let behind_a_missed_one = self.misses > 0 && count < cycle / 2;
            let late = count > upper || behind_a_missed_one;
            let early = count < lower && !late;
            if late {
                self.registers.raise_0(status_0::MSTLATE);
            }
            if early {
                self.registers.raise_0(status_0::MSTEARLY);
            }
            let synchronised = self.misses < MISSES_UNTIL_UNSYNCHRONISED;
            if (late || early) && synchronised && self.registers.phase() >= 3 {
                return;
            }
        }
        self.misses = 0;
        self.take_phase(phase);
        self.start_cycle(end, end, true);
    }

    /// A master's MST has gone round the ring.
    fn on_own_mst(&mut self, end: Nanoseconds, phase: u8) {
        if let (Some((sent, _)), Some(base)) = (self.own_mst, self.base) {
            self.registers.set_ring_delay(base.ticks_between(sent, end));
            self.own_mst = Some((sent, true));
        }
        self.take_phase(phase);
    }

    fn take_phase(&mut self, phase: u8) {
        self.registers.set_received_phase(phase);
        self.registers.raise_1(self.alternatives.event_map.mst_bit());
        if self.alternatives.unknown_status_bits == UnknownStatusBits::Noisy {
            self.registers.raise_0(self.noise.word() & status_0::UNKNOWN);
        }
    }

    /// 01H or 03H was written: starts or stops a master's cycle.
    fn command_cycle(&mut self, now: Nanoseconds) {
        if self.registers.repeater_on() || self.registers.command() == 0 {
            self.next_mst = None;
            self.free_running = false;
        } else if self.registers.start_commanded() && !self.free_running {
            self.free_running = true;
            self.schedule_mst(now);
        }
    }

    /// TCYCSTART from now, unless an MST is already to come.
    fn schedule_mst(&mut self, now: Nanoseconds) {
        let divider = self.registers.clock_divider();
        let delay = timing::ticks(self.straps, divider, self.registers.cycle_start_delay());
        self.next_mst.get_or_insert(now + delay);
    }

    /// A master's MST, when it is due.
    fn send_mst(&mut self, now: Nanoseconds) -> Option<Transmission> {
        let due = self.next_mst.filter(|&due| due <= now)?;
        self.next_mst = self.cycle_time().filter(|_| self.free_running).map(|cycle| due + cycle);
        self.free_running = self.next_mst.is_some();
        if self.own_mst.is_some_and(|(_, came_back)| !came_back) {
            self.count_missed_mst();
        }
        self.walk.stop();
        Some(Transmission { bytes: vec![BROADCAST, self.registers.phase()] })
    }
}
