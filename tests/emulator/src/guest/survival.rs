//! What a product goes through that does not end with a fault: handlers of faults, resets, a crystal that fails, a debugger, and memory that a test writes.
//!
//! A reset is another QEMU: it has everything at its reset values, by whatever version, and the program as it was flashed. The RAM goes over to it, and so
//! does what the flash holds beside the program.

use std::collections::VecDeque;
use std::ops::Range;

use emulator_link::protocol::{MEMORY_WORDS, command, header};
use ring::Nanoseconds;

use super::Guest;
use crate::clock::TickClock;
use crate::peripherals::Peripherals;
use crate::prefetch::Prefetch;
use crate::qemu::Qemu;
use crate::{EmulatorError, Environment};

const RAM: u32 = 0x2000_0000;
const RAM_WORDS: usize = 128 * 1024 / 4;

/// What resets the part.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reset {
    /// The supply comes: the RAM holds noise, made from this seed.
    PowerOn(u64),
    /// The supply was below the level of the brown-out reset for a moment: the RAM is as before.
    BrownOut,
    /// The pin NRST.
    Pin,
    /// The independent watchdog.
    Watchdog,
    /// The window watchdog.
    WindowWatchdog,
    /// SYSRESETREQ.
    Software,
}

impl Reset {
    /// What it adds to RCC_CSR (RM0090 7.3.21).
    const fn flags(self) -> u32 {
        const PIN: u32 = 1 << 26;
        const BROWN_OUT: u32 = 1 << 25;
        const POWER_ON: u32 = 1 << 27;
        const SOFTWARE: u32 = 1 << 28;
        const WATCHDOG: u32 = 1 << 29;
        const WINDOW: u32 = 1 << 30;
        match self {
            Self::PowerOn(_) => POWER_ON | BROWN_OUT | PIN,
            Self::BrownOut => BROWN_OUT | PIN,
            Self::Pin => PIN,
            Self::Watchdog => WATCHDOG | PIN,
            Self::WindowWatchdog => WINDOW | PIN,
            Self::Software => SOFTWARE | PIN,
        }
    }
}

/// Something that happened to the processor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Incident {
    /// When.
    pub time: Nanoseconds,
    /// Instructions of the product until then.
    pub instructions: u64,
    /// What.
    pub what: What,
}

/// What happened.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum What {
    /// The first instruction of the handler of a fault, of NMI or of an unbound interrupt: the number of the exception.
    Handler(u32),
    /// A reset.
    Reset(Reset),
}

/// State of this part of the guest.
#[derive(Debug)]
pub(super) struct Survival {
    survives: bool,
    debugger: bool,
    incidents: Vec<Incident>,
    /// NMI is to be pended.
    pub(super) non_maskable: bool,
    /// The product has come to its first access: its memory is initialised.
    pub(super) log_is_up: bool,
}

impl Default for Survival {
    fn default() -> Self {
        Self { survives: false, debugger: false, incidents: Vec::new(), non_maskable: false, log_is_up: true }
    }
}

/// What a test does to the product. All of it between two runs.
impl Guest {
    /// From now on a fault is none of the run's: its handler runs, resets start the processor again. [`Guest::incidents`] has what happened.
    ///
    /// # Errors
    /// The end of QEMU.
    pub fn survive(&mut self) -> Result<(), EmulatorError> {
        self.survival.survives = true;
        self.peripherals.ignore_unclocked();
        self.ask(&[command::FAULTS_RUN_ON, 1], 0)
    }

    /// Handlers of faults that were entered, and resets, in their order.
    #[must_use]
    pub fn incidents(&self) -> &[Incident] {
        &self.survival.incidents
    }

    /// A debugger is attached to the core, or not; it halts nothing.
    ///
    /// # Errors
    /// The end of QEMU.
    pub fn attach_debugger(&mut self, attached: bool) -> Result<(), EmulatorError> {
        self.survival.debugger = attached;
        self.ask(&[command::DEBUGGER, u32::from(attached)], 0)
    }

    /// Reads words of the guest's memory or of its private peripheral bus (NVIC, SCB), while it waits for an answer.
    ///
    /// # Errors
    /// The end of QEMU.
    pub fn read_memory(&mut self, address: u32, words: usize) -> Result<Vec<u32>, EmulatorError> {
        let mut memory = Vec::with_capacity(words);
        while memory.len() < words {
            let count = (words - memory.len()).min(MEMORY_WORDS);
            let from = address + memory.len() as u32 * 4;
            self.ask(&[command::READ_MEMORY, from, count as u32], count)?;
            memory.extend_from_slice(&self.words[header::WORDS..]);
        }
        Ok(memory)
    }

    /// The memory that the protection unit lets nobody touch, while the guest waits for an answer: the highest region of it, and those right below.
    ///
    /// # Errors
    /// The end of QEMU.
    pub fn guard(&mut self) -> Result<Option<Range<u32>>, EmulatorError> {
        // ARM DDI 0403E B3.5.5 to B3.5.9.
        const TYPE_AND_CONTROL: u32 = 0xE000_ED90;
        const NUMBER: u32 = 0xE000_ED98;
        const BASE: u32 = 0xE000_ED9C;
        const ACCESS: u32 = 0b111 << 24;
        let [kind, control] = self.read_memory(TYPE_AND_CONTROL, 2)?[..] else {
            unreachable!("two words were asked for")
        };
        let mut forbidden = Vec::new();
        for region in 0..kind >> 8 & 0xFF {
            self.write_memory(NUMBER, &[region])?;
            let [base, attributes] = self.read_memory(BASE, 2)?[..] else { unreachable!("two words were asked for") };
            if control & attributes & 1 != 0 && attributes & ACCESS == 0 {
                let start = base & !0x1F;
                forbidden.push(start..start + (2 << (attributes >> 1 & 0x1F)));
            }
        }
        forbidden.sort_by_key(|region: &Range<u32>| std::cmp::Reverse(region.end));
        Ok(forbidden
            .into_iter()
            .reduce(|guard, below| if below.end == guard.start { below.start..guard.end } else { guard }))
    }

    /// Writes words of the guest's RAM or flash, or registers of its processor, while it waits for an answer. In the flash they last until the next reset.
    ///
    /// # Errors
    /// The end of QEMU.
    pub fn write_memory(&mut self, address: u32, words: &[u32]) -> Result<(), EmulatorError> {
        const COMMAND: usize = 3;
        let mut to = address;
        for part in words.chunks(MEMORY_WORDS - COMMAND) {
            let mut message = vec![command::WRITE_MEMORY, to, part.len() as u32];
            message.extend_from_slice(part);
            self.ask(&message, 0)?;
            to += 4 * part.len() as u32;
        }
        Ok(())
    }

    /// Writes a half-word, as an instruction; see [`Guest::write_memory`].
    ///
    /// # Errors
    /// The end of QEMU.
    pub fn write_instruction(&mut self, address: u32, code: u16) -> Result<(), EmulatorError> {
        let word = address & !3;
        let shift = 8 * (address & 2);
        let old = self.read_memory(word, 1)?[0];
        self.write_memory(word, &[old & !(0xFFFF << shift) | u32::from(code) << shift])
    }

    /// The crystal stops. With the clock security system the bridge's timer breaks and NMI comes; without it the processor stands still, and so do
    /// the timers.
    ///
    /// # Errors
    /// What the models refuse.
    pub fn fail_crystal<E: Environment + ?Sized>(
        &mut self,
        environment: &mut E,
        now: Nanoseconds,
    ) -> Result<(), EmulatorError> {
        self.next.set(None);
        if self.peripherals.fail_crystal(environment, now)? {
            self.survival.non_maskable = true;
            self.clock.set_frequency(self.peripherals.clock_tree().core);
            // A processor that waits for an interrupt gets one now.
            if self.question.idle {
                self.wake = now;
                self.question.ticks = self.clock.ticks_until(now).saturating_sub(1);
            }
        }
        Ok(())
    }

    /// Resets the part at `now`: outputs are what they are without the processor from this instant on.
    ///
    /// # Errors
    /// QEMU does not come up again.
    pub fn reset<E: Environment + ?Sized>(
        &mut self,
        environment: &mut E,
        now: Nanoseconds,
        reset: Reset,
    ) -> Result<(), EmulatorError> {
        self.next.set(None);
        let memory = match reset {
            Reset::PowerOn(seed) => noise(seed),
            _ => self.read_memory(RAM, RAM_WORDS)?,
        };
        let what = What::Reset(reset);
        self.survival.incidents.push(Incident { time: now, instructions: self.measurements.instructions, what });
        let kept = if matches!(reset, Reset::PowerOn(_)) { 0 } else { self.peripherals.rcc.reset_flags() };
        self.peripherals.release(environment, now);
        let sectors = self.flash_after(reset, now);
        let has_crystal = self.peripherals.rcc.has_crystal();
        self.peripherals = Peripherals::after_reset(kept | reset.flags(), has_crystal, sectors);
        self.clock = TickClock::new(self.peripherals.clock_tree().core);
        self.clock.settle(now);
        self.wake = now;
        self.posted = VecDeque::new();
        self.prefetch = Prefetch::default();
        self.counted = 0;
        self.held = None;
        self.switches_set = false;
        self.survival.non_maskable = false;
        self.survival.log_is_up = false;
        self.log.restart();
        self.qemu = Qemu::start(&self.configuration)?;
        self.greet()?;
        self.write_memory(RAM, &memory)?;
        self.copy_flash()?;
        self.ask(&[command::DEBUGGER, u32::from(self.survival.debugger)], 0)?;
        if self.survival.survives {
            self.survive()?;
        }
        Ok(())
    }

    /// Does the crystal work?
    #[must_use]
    pub fn has_crystal(&self) -> bool {
        self.peripherals.rcc.has_crystal()
    }

    /// The crystal works again.
    pub fn mend_crystal(&mut self, now: Nanoseconds) {
        self.next.set(None);
        self.peripherals.rcc.mend_crystal(now);
    }
}

/// What the guest finds out in a run.
impl Guest {
    pub(super) fn handler_begins(&mut self, time: Nanoseconds, exception: u32, _pc: u32) {
        let instructions = self.measurements.instructions;
        self.survival.incidents.push(Incident { time, instructions, what: What::Handler(exception) });
    }

    /// SYSRESETREQ.
    pub(super) fn reset_by_itself<E: Environment + ?Sized>(
        &mut self,
        environment: &mut E,
        time: Nanoseconds,
    ) -> Result<(), EmulatorError> {
        if !self.survival.survives {
            return Err(EmulatorError::SoftwareReset { time, pc: self.question.pc });
        }
        self.fetch_log(time)?;
        self.reset(environment, time, Reset::Software)
    }

    /// Resets a product that survives it, if its watchdog has run out.
    pub(super) fn is_bitten<E: Environment + ?Sized>(
        &mut self,
        environment: &mut E,
        now: Nanoseconds,
    ) -> Result<bool, EmulatorError> {
        let bite = self.peripherals.bite().filter(|(expires, _)| *expires <= now && self.survival.survives);
        let Some((expires, reset)) = bite else { return Ok(false) };
        self.reset(environment, expires, reset)?;
        Ok(true)
    }

    /// Its clock has stopped.
    pub(super) fn stands_still(&self) -> bool {
        self.peripherals.rcc.is_without_clock()
    }
}

/// What the RAM holds after power-on.
fn noise(seed: u64) -> Vec<u32> {
    let mut state = seed | 1;
    let mut next = || {
        // Xorshift (Marsaglia): nothing here needs more.
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 32) as u32
    };
    (0..RAM_WORDS).map(|_| next()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_repeats_itself_and_is_different_for_every_seed() {
        assert_eq!(noise(5), noise(5));
        assert_ne!(noise(5), noise(7));
        assert_eq!(noise(5).len() * 4, 128 * 1024);
    }

    #[test]
    fn every_reset_has_its_flags() {
        let all =
            [Reset::PowerOn(1), Reset::BrownOut, Reset::Pin, Reset::Watchdog, Reset::WindowWatchdog, Reset::Software];
        let flags = all.map(Reset::flags);
        assert_eq!(flags, [0x0E00_0000, 0x0600_0000, 0x0400_0000, 0x2400_0000, 0x4400_0000, 0x1400_0000]);
    }
}
