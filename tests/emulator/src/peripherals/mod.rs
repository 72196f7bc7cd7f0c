//! The STM32F407 around the core, as far as the product uses it: one model a peripheral, and the wiring between them.

pub(crate) mod adc;
pub(crate) mod advanced_timer;
pub(crate) mod break_and_dead_time;
mod centred_counter;
pub(crate) mod clocks;
pub(crate) mod encoder_counters;
pub(crate) mod flash_controller;
pub(crate) mod gpio;
mod input_filter;
pub(crate) mod interrupts;
mod map;
pub(crate) mod others;
pub(crate) mod power_stage;
pub(crate) mod timer;
pub(crate) mod window_watchdog;

use ring::Nanoseconds;

use crate::wiring;
use crate::{EmulatorError, Environment, Reset};
use clocks::{ClockTree, Power, Rcc};
use emulator_link::protocol::{EXTERNAL_BUS, EXTERNAL_BUS_END, PARAMETER_FLASH, PARAMETER_FLASH_END};
use encoder_counters::{Edge, EncoderCounters};
use flash::FlashModel;
use flash_controller::FlashController;
use gpio::{PinMode, Port};
use interrupts::{Exti, Syscfg};
use map::{
    ADC, BIT_BAND, BIT_BAND_END, ENCODER_COUNTERS, EXTERNAL_BYTES, EXTI, FLASH, FSMC, GPIO, GPIO_END, IWDG, PWR, RCC,
    SYSCFG, TIM1, TIM2, TIM5, WWDG, bit_band, clock_enable, counter_of, is_timer, port_of,
};
use others::{Fsmc, Watchdog};
use power_stage::PowerStage;
use timer::Timer;
use window_watchdog::WindowWatchdog;

/// An access of the product, for error messages.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Access {
    pub(crate) now: Nanoseconds,
    pub(crate) address: u32,
    pub(crate) width: u32,
    pub(crate) pc: u32,
}

impl Access {
    fn misuse(self, what: impl Into<String>) -> EmulatorError {
        EmulatorError::Misuse { time: self.now, what: what.into(), address: self.address, pc: self.pc }
    }

    fn unknown(self, direction: &'static str) -> EmulatorError {
        EmulatorError::UnknownRegister {
            time: self.now,
            direction,
            address: self.address,
            width: self.width,
            pc: self.pc,
        }
    }

    fn at(self, address: u32, width: u32) -> Self {
        Self { address, width, ..self }
    }
}

/// All peripherals and what they have told the world so far.
#[derive(Debug)]
pub(crate) struct Peripherals {
    pub(crate) rcc: Rcc,
    power: Power,
    pub(crate) flash: FlashController,
    pub(crate) ports: Vec<Port>,
    pub(crate) syscfg: Syscfg,
    pub(crate) exti: Exti,
    pub(crate) fsmc: Fsmc,
    pub(crate) counters: EncoderCounters,
    pub(crate) stage: PowerStage,
    pub(crate) tim5: Timer,
    pub(crate) watchdog: Watchdog,
    pub(crate) window_watchdog: WindowWatchdog,
    interrupt_levels: Option<(bool, bool)>,
    lines: u128,
    edges: u128,
    reset_held: bool,
    straps: (bool, bool),
    /// Accesses to a peripheral without its clock do nothing, as on the part; otherwise they are refused.
    unclocked_ignored: bool,
}

/// Resets, and what becomes of the outputs without the processor.
impl Peripherals {
    /// At their reset values, with these flags in RCC_CSR and what the flash holds.
    pub(crate) fn after_reset(flags: u32, has_crystal: bool, sectors: FlashModel) -> Self {
        let mut peripherals = Self { flash: FlashController::after_reset(sectors), ..Self::new() };
        peripherals.rcc.set_reset(flags, has_crystal);
        // RSTN has a pull-down, and no pin drives it yet.
        peripherals.reset_held = true;
        peripherals
    }

    /// All pins become inputs: the pull-downs at gate drivers, brake coil and RSTN of the chip take over.
    pub(crate) fn release<E: Environment + ?Sized>(&mut self, environment: &mut E, now: Nanoseconds) {
        self.stage.release(environment, now);
        if !std::mem::replace(&mut self.reset_held, true) {
            environment.set_chip_reset(now, true);
        }
    }

    /// The crystal stops. Tells whether the clock security system has noticed.
    pub(crate) fn fail_crystal<E: Environment + ?Sized>(
        &mut self,
        environment: &mut E,
        now: Nanoseconds,
    ) -> Result<bool, EmulatorError> {
        self.advance(environment, now)?;
        let noticed = self.rcc.fail_crystal();
        if noticed {
            self.stage.break_by_clock(&self.ports, environment, now).map_err(|what| by_itself(now, what))?;
        }
        let tree = self.rcc.tree();
        self.tim5.set_clock(tree.apb1_timers, now);
        self.window_watchdog.set_clock(tree.apb1, now);
        self.counters.set_clocks(&tree, now);
        self.stage.set_clocks(&tree, now);
        self.update_lines();
        Ok(noticed)
    }

    /// When a watchdog resets the processor, and which; that of APB1 stands while its clock does.
    pub(crate) fn bite(&self) -> Option<(Nanoseconds, Reset)> {
        let window = self.window_watchdog.expires().filter(|_| !self.rcc.is_without_clock());
        let independent = self.watchdog.expires().map(|time| (time, Reset::Watchdog));
        let bites = [independent, window.map(|time| (time, Reset::WindowWatchdog))];
        bites.into_iter().flatten().min_by_key(|(time, _)| *time)
    }

    /// See [`Peripherals::unclocked_ignored`].
    pub(crate) fn ignore_unclocked(&mut self) {
        self.unclocked_ignored = true;
    }
}

impl Peripherals {
    pub(crate) fn new() -> Self {
        Self {
            rcc: Rcc::new(),
            power: Power::new(),
            flash: FlashController::default(),
            ports: (0..9).map(Port::new).collect(),
            syscfg: Syscfg::default(),
            exti: Exti::default(),
            fsmc: Fsmc::new(),
            counters: EncoderCounters::new(),
            stage: PowerStage::new(),
            tim5: Timer::new(32, 4),
            watchdog: Watchdog::new(),
            window_watchdog: WindowWatchdog::new(),
            interrupt_levels: None,
            lines: 0,
            edges: 0,
            reset_held: false,
            straps: (false, false),
            unclocked_ignored: false,
        }
    }

    pub(crate) fn clock_tree(&self) -> ClockTree {
        self.rcc.tree()
    }

    /// The next instant at which a peripheral does something by itself.
    pub(crate) fn next_event(&self) -> Option<Nanoseconds> {
        let events = [
            self.tim5.next_event(),
            self.counters.next_event(),
            self.stage.next_event(),
            self.window_watchdog.next_event(),
            self.bite().map(|(time, _)| time),
        ];
        events.into_iter().flatten().min()
    }

    /// The next instant at which a peripheral may interrupt by itself: until then, a processor that waits for an interrupt need not be asked.
    pub(crate) fn next_interrupt(&self) -> Option<Nanoseconds> {
        let events = [
            self.tim5.next_event(),
            self.counters.next_event(),
            self.stage.next_interrupt(),
            self.window_watchdog.next_event(),
            self.bite().map(|(time, _)| time),
        ];
        events.into_iter().flatten().min()
    }

    /// Does what is due until `now`.
    pub(crate) fn advance<E: Environment + ?Sized>(
        &mut self,
        environment: &mut E,
        now: Nanoseconds,
    ) -> Result<(), EmulatorError> {
        if let Some((time, reset)) = self.bite().filter(|(expires, _)| *expires <= now) {
            let name = if reset == Reset::Watchdog { "independent" } else { "window" };
            return Err(EmulatorError::Watchdog { time, name });
        }
        self.window_watchdog.advance(now);
        self.stage.advance(&self.ports, environment, now).map_err(|what| by_itself(now, what))?;
        self.counters.advance(now);
        self.tim5.advance(now);
        self.update_lines();
        Ok(())
    }

    /// Takes the levels of the input pins over; returns the edges of (INT0, INT1).
    pub(crate) fn sample<E: Environment + ?Sized>(
        &mut self,
        environment: &mut E,
        now: Nanoseconds,
    ) -> Result<[Option<bool>; 2], EmulatorError> {
        self.stage.sample(&self.ports, environment, now).map_err(|what| by_itself(now, what))?;
        self.counters.sample(&self.ports, environment, now);
        self.drive_inputs(environment);
        let (int0, int1) = environment.interrupt_pins();
        let before = self.interrupt_levels.replace((int0, int1)).unwrap_or((int0, int1));
        self.drive(wiring::INT0, int0);
        self.drive(wiring::INT1, int1);
        let edges = [(before.0 != int0).then_some(int0), (before.1 != int1).then_some(int1)];
        for (level, (port, number), edge) in
            [(edges[0], wiring::INT0, Edge::Int0), (edges[1], wiring::INT1, Edge::Int1)]
        {
            let Some(rises) = level else { continue };
            if self.syscfg.port(number) == port {
                self.exti.edge(number, rises);
            }
            self.counters.edge(edge, rises, &self.ports, environment, now);
        }
        self.update_lines();
        Ok(edges)
    }

    fn drive_inputs<E: Environment + ?Sized>(&mut self, environment: &E) {
        let inputs = environment.digital_inputs();
        for (pin, level) in [
            (wiring::MAIN_POWER, inputs.main_power),
            (wiring::STO_1, inputs.sto_1),
            (wiring::STO_2, inputs.sto_2),
            (wiring::HOME_SWITCH, inputs.home_switch),
            (wiring::BRAKE_FEEDBACK, inputs.brake_feedback),
            (wiring::PROBE_1, inputs.probe_1),
            (wiring::PROBE_2, inputs.probe_2),
            (wiring::BREAK, environment.break_input()),
        ] {
            self.drive(pin, level);
        }
    }

    /// Sets the switches, which do not move while the drive runs.
    pub(crate) fn set_switches<E: Environment + ?Sized>(&mut self, environment: &E) {
        let contacts = wiring::ADDRESS_SWITCHES.iter().enumerate();
        for (bit, pin) in contacts {
            if environment.address_switches() & 1 << bit != 0 {
                self.drive(*pin, false);
            }
        }
        for (bit, pin) in wiring::BIT_RATE_SWITCHES.iter().enumerate() {
            if environment.bit_rate_switches() & 1 << bit != 0 {
                self.drive(*pin, false);
            }
        }
    }

    /// Edges of interrupt lines since last asked, and the lines that are high now.
    pub(crate) fn take_interrupts(&mut self) -> (u128, u128) {
        self.update_lines();
        (std::mem::take(&mut self.edges), self.lines)
    }

    /// Has an interrupt line of the NVIC had an edge since last asked?
    pub(crate) fn has_raised(&mut self, interrupt: u8) -> bool {
        self.update_lines();
        self.edges & 1 << interrupt != 0
    }

    /// Does an interrupt wait to be taken, by its edge or by its level?
    pub(crate) fn interrupts_wait(&mut self) -> bool {
        self.update_lines();
        (self.edges, self.lines) != (0, 0)
    }

    /// What a read at `now` would answer, where that is sure not to change by itself until `until` and has no side effect.
    pub(crate) fn peek<E: Environment + ?Sized>(
        &self,
        environment: &mut E,
        address: u32,
        now: Nanoseconds,
        until: Nanoseconds,
    ) -> Option<u32> {
        const INPUT_DATA: u32 = 0x10;
        const COUNT: u32 = 0x24;
        let access = Access { now, address, width: 4, pc: 0 };
        let (page, offset) = (address & !0x3FF, address & 0x3FF);
        if matches!(page, TIM1 | ADC) || ENCODER_COUNTERS.contains(&page) {
            self.check_clock(access).ok()?;
            return match page {
                TIM1 => self.stage.peek_timer(offset, now, until),
                ADC => self.stage.peek_converters(offset, until),
                TIM2 if offset == COUNT => self.counters.peek_position(&self.ports, environment, now, until),
                _ => self.counters.peek_captured(counter_of(page), offset),
            };
        }
        if (GPIO..GPIO_END).contains(&address) && address & 0x3FF == INPUT_DATA {
            let port = port_of(address & !0x3FF);
            let clocked = self.rcc.is_enabled(0x30, port as u32);
            return self.ports[port].read(INPUT_DATA).filter(|_| clocked);
        }
        let offset = address.checked_sub(EXTERNAL_BUS)?;
        let clocked = self.rcc.is_enabled(0x38, 0);
        if offset >= EXTERNAL_BYTES || !offset.is_multiple_of(2) || !clocked || self.fsmc.obstacle().is_some() {
            return None;
        }
        environment.external_peek(offset).map(u32::from)
    }

    /// What a read of a running counter will answer at an instant before the next event.
    pub(crate) fn foretell<E: Environment + ?Sized>(
        &self,
        environment: &mut E,
        address: u32,
        at: Nanoseconds,
    ) -> Option<u32> {
        const COUNT: u32 = 0x24;
        let page = address & !0x3FF;
        self.check_clock(Access { now: at, address, width: 4, pc: 0 }).ok()?;
        match page {
            _ if address != page + COUNT => None,
            TIM1 => self.stage.foretell_count(at),
            page if ENCODER_COUNTERS.contains(&page) => {
                self.counters.foretell_count(counter_of(page), &self.ports, environment, at)
            }
            _ => None,
        }
    }

    pub(crate) fn read<E: Environment + ?Sized>(
        &mut self,
        environment: &mut E,
        access: Access,
    ) -> Result<u32, EmulatorError> {
        let Access { address, width, .. } = access;
        if (EXTERNAL_BUS..EXTERNAL_BUS_END).contains(&address) {
            return self.read_external(environment, access);
        }
        if (BIT_BAND..BIT_BAND_END).contains(&address) {
            let (word, bit) = bit_band(address);
            let value = self.read_word(environment, access.at(word, 4))?;
            return Ok(value >> bit & 1);
        }
        if !address.is_multiple_of(width) {
            return Err(access.misuse("unaligned access to a peripheral"));
        }
        let value = self.read_word(environment, access.at(address & !3, width))?;
        let shifted = value >> (8 * (address & 3));
        Ok(shifted & (u32::MAX >> (32 - 8 * width)))
    }

    pub(crate) fn write<E: Environment + ?Sized>(
        &mut self,
        environment: &mut E,
        access: Access,
        value: u32,
    ) -> Result<(), EmulatorError> {
        let Access { address, width, .. } = access;
        if (EXTERNAL_BUS..EXTERNAL_BUS_END).contains(&address) {
            return self.write_external(environment, access, value);
        }
        if (PARAMETER_FLASH..PARAMETER_FLASH_END).contains(&address) {
            return self.flash.program(address, width, value).map_err(|what| access.misuse(what));
        }
        if (BIT_BAND..BIT_BAND_END).contains(&address) {
            let (word, bit) = bit_band(address);
            let access = access.at(word, 4);
            let old = self.read_word(environment, access)?;
            let new = old & !(1 << bit) | (value & 1) << bit;
            return self.write_word(environment, access, new);
        }
        if !address.is_multiple_of(width) {
            return Err(access.misuse("unaligned access to a peripheral"));
        }
        let word = address & !3;
        let merged = if width == 4 {
            value
        } else {
            let shift = 8 * (address & 3);
            let mask = (u32::MAX >> (32 - 8 * width)) << shift;
            let old = self.kept_by_narrow_write(environment, access.at(word, width))?;
            old & !mask | value << shift & mask
        };
        self.write_word(environment, access.at(word, width), merged)
    }

    /// The bits beside a narrow write: what is there, ones where writing 0 clears, zeros where writing 1 acts.
    fn kept_by_narrow_write<E: Environment + ?Sized>(
        &mut self,
        environment: &mut E,
        access: Access,
    ) -> Result<u32, EmulatorError> {
        const TIMER_STATUS: u32 = 0x10;
        match access.address {
            address if is_timer(address & !0x3FF) => match address & 0x3FF {
                TIMER_STATUS => Ok(u32::MAX),
                0x34..=0x40 => Ok(0),
                _ => self.read_word(environment, access),
            },
            GPIO..GPIO_END => match access.address & 0x3FF {
                0x18 => Ok(0),
                _ => self.read_word(environment, access),
            },
            address if [IWDG, WWDG].contains(&(address & !0x3FF)) => self.read_word(environment, access),
            _ => Err(access.misuse("byte or half-word write to a register that needs words")),
        }
    }

    fn read_word<E: Environment + ?Sized>(
        &mut self,
        environment: &mut E,
        access: Access,
    ) -> Result<u32, EmulatorError> {
        let Access { now, address, .. } = access;
        self.check_clock(access)?;
        let offset = address & 0x3FF;
        let value = match address & !0x3FF {
            page if ENCODER_COUNTERS.contains(&page) => {
                self.counters.read(counter_of(page), offset, &self.ports, environment, now)
            }
            TIM1 => self.stage.timer.read(offset, now),
            ADC => self.stage.converters.read(offset),
            TIM5 => self.tim5.read(offset, now, 0),
            IWDG => self.watchdog.read(offset, now),
            WWDG => self.window_watchdog.read(offset, now),
            PWR => self.power.read(offset),
            SYSCFG => self.syscfg.read(offset),
            EXTI => self.exti.read(offset),
            RCC => self.rcc.read(offset, now),
            FLASH => self.flash.read(offset),
            FSMC => self.fsmc.read(offset),
            page @ GPIO..GPIO_END => self.ports[port_of(page)].read(offset),
            _ => None,
        };
        self.update_lines();
        value.ok_or_else(|| access.unknown("read"))
    }

    fn write_word<E: Environment + ?Sized>(
        &mut self,
        environment: &mut E,
        access: Access,
        value: u32,
    ) -> Result<(), EmulatorError> {
        let Access { now, address, .. } = access;
        match self.check_clock(access) {
            Err(_) if self.unclocked_ignored => return Ok(()),
            checked => checked?,
        }
        let offset = address & 0x3FF;
        let fine = |done: Option<()>| done.map(Ok);
        let done = match address & !0x3FF {
            page if ENCODER_COUNTERS.contains(&page) => {
                self.counters.write(counter_of(page), (offset, value), &self.ports, environment, now)
            }
            TIM1 => self.stage.write_timer((offset, value), &self.ports, environment, now),
            ADC => self.stage.converters.write(offset, value, now),
            TIM5 => self.tim5.write(offset, value, now, 0),
            IWDG => fine(self.watchdog.write(offset, value, now)),
            WWDG => fine(self.window_watchdog.write(offset, value, now)),
            PWR => fine(self.power.write(offset, value)),
            SYSCFG => fine(self.syscfg.write(offset, value)),
            EXTI => fine(self.exti.write(offset, value)),
            RCC => self.rcc.write(offset, value, now, self.flash.latency()),
            FLASH => self.flash.write(offset, value),
            FSMC => fine(self.fsmc.write(offset, value)),
            page @ GPIO..GPIO_END => fine(self.ports[port_of(page)].write(offset, value)),
            _ => None,
        };
        done.ok_or_else(|| access.unknown("write"))?.map_err(|what| access.misuse(what))?;
        if address & !0x3FF == RCC {
            let tree = self.rcc.tree();
            self.tim5.set_clock(tree.apb1_timers, now);
            self.window_watchdog.set_clock(tree.apb1, now);
            self.counters.set_clocks(&tree, now);
            self.stage.set_clocks(&tree, now);
        }
        self.tell(environment, now);
        self.update_lines();
        Ok(())
    }

    fn read_external<E: Environment + ?Sized>(
        &mut self,
        environment: &mut E,
        access: Access,
    ) -> Result<u32, EmulatorError> {
        let offset = self.check_external(access)?;
        let mut value = 0;
        for half in 0..access.width / 2 {
            let word = environment.external_read(access.now, offset + 2 * half);
            value |= u32::from(word) << (16 * half);
        }
        Ok(value)
    }

    fn write_external<E: Environment + ?Sized>(
        &mut self,
        environment: &mut E,
        access: Access,
        value: u32,
    ) -> Result<(), EmulatorError> {
        let offset = self.check_external(access)?;
        if !self.fsmc.is_writable() {
            return Err(access.misuse("write to a bank with writing disabled (FSMC_BCR1.WREN)"));
        }
        for half in 0..access.width / 2 {
            let word = (value >> (16 * half)) as u16;
            environment.external_write(access.now, offset + 2 * half, word);
        }
        Ok(())
    }

    fn check_external(&self, access: Access) -> Result<u32, EmulatorError> {
        if !self.rcc.is_enabled(0x38, 0) {
            return Err(access.misuse("external bus used without the clock of the FSMC"));
        }
        if let Some(obstacle) = self.fsmc.obstacle() {
            return Err(access.misuse(obstacle));
        }
        if access.width == 1 || !access.address.is_multiple_of(access.width) {
            return Err(access.misuse("the external bus has no byte lanes"));
        }
        let offset = access.address - EXTERNAL_BUS;
        if offset + access.width > EXTERNAL_BYTES {
            return Err(access.misuse("beyond the twelve address lines of the external bus"));
        }
        Ok(offset)
    }

    /// A peripheral without its clock ignores writes and reads as 0: never what was meant.
    fn check_clock(&self, access: Access) -> Result<(), EmulatorError> {
        let Some((register, bit)) = clock_enable(access.address) else {
            return Ok(());
        };
        if self.rcc.is_enabled(register, bit) {
            Ok(())
        } else {
            Err(access.misuse(format!(
                "peripheral used while bit {bit} of its clock enable register (RCC + {register:#x}) is 0"
            )))
        }
    }

    /// Tells the world about outputs that changed.
    fn tell<E: Environment + ?Sized>(&mut self, environment: &mut E, now: Nanoseconds) {
        self.stage.tell(&self.ports, environment, now);
        // A pin that does not drive leaves it to the pull-down.
        let held = !self.drives_high(wiring::CHIP_RESET);
        if std::mem::replace(&mut self.reset_held, held) != held {
            environment.set_chip_reset(now, held);
        }
        let straps = (self.drives_high(wiring::SBAUD), self.drives_high(wiring::SBAUD16));
        if std::mem::replace(&mut self.straps, straps) != straps {
            environment.set_bit_rate_straps(now, straps.0, straps.1);
        }
    }

    fn drive(&mut self, (port, number): wiring::Pin, level: bool) {
        self.ports[port].drive(number, level);
    }

    fn is_output(&self, (port, number): wiring::Pin) -> bool {
        self.ports[port].mode(number) == PinMode::Output
    }

    fn drives_high(&self, pin: wiring::Pin) -> bool {
        self.is_output(pin) && self.ports[pin.0].output(pin.1)
    }

    fn update_lines(&mut self) {
        let mut lines = self.exti.lines() | self.counters.lines() | self.stage.lines();
        lines |= u128::from(self.tim5.line()) << 50 | u128::from(self.window_watchdog.line());
        self.edges |= lines & !self.lines;
        self.lines = lines;
    }
}

/// A failure that no access causes; the address tells where to look.
fn by_itself(time: Nanoseconds, what: String) -> EmulatorError {
    EmulatorError::Misuse { time, what, address: ADC, pc: 0 }
}

#[cfg(test)]
pub(crate) mod tests;
