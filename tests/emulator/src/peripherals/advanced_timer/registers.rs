//! The registers of TIM1: what a read answers, what a write does, and what is refused (RM0090 17.4).

use ring::Nanoseconds;

use super::super::break_and_dead_time::refuse_locked;
use super::{AdvancedTimer, BREAK, COMPARES, ENABLE, RELOAD_PRELOADED, TimerEvent, UPDATE, UPDATE_DISABLE};

pub(crate) const CR1: u32 = 0x00;
pub(crate) const CR2: u32 = 0x04;
pub(crate) const SMCR: u32 = 0x08;
pub(crate) const DIER: u32 = 0x0C;
pub(crate) const SR: u32 = 0x10;
pub(crate) const EGR: u32 = 0x14;
pub(crate) const CCMR1: u32 = 0x18;
pub(crate) const CCMR2: u32 = 0x1C;
pub(crate) const CCER: u32 = 0x20;
pub(crate) const CNT: u32 = 0x24;
pub(crate) const PSC: u32 = 0x28;
pub(crate) const ARR: u32 = 0x2C;
pub(crate) const RCR: u32 = 0x30;
pub(crate) const CCR1: u32 = 0x34;
pub(crate) const CCR4: u32 = 0x40;
pub(crate) const BDTR: u32 = 0x44;

const UPDATE_BY_OVERFLOW_ONLY: u32 = 1 << 2;
pub(super) const DOWN: u32 = 1 << 4;

impl AdvancedTimer {
    pub(crate) fn read(&self, offset: u32, now: Nanoseconds) -> Option<u32> {
        Some(match offset {
            CR1 => self.control & !DOWN | if self.counter.is_down() { DOWN } else { 0 },
            CR2 => self.control_2,
            SMCR | EGR => 0,
            DIER => self.interrupts,
            SR => self.status,
            CCMR1 => self.modes[0],
            CCMR2 => self.modes[1],
            CCER => self.enables,
            CNT => self.counter.count(now),
            PSC => self.prescaler,
            ARR => self.reload,
            RCR => self.repetitions,
            CCR1..=CCR4 => self.compare[(offset - CCR1) as usize / 4],
            BDTR => self.protection.value(),
            _ => return None,
        })
    }

    /// `Err` tells what is not modelled or would fail on the part.
    pub(crate) fn write(
        &mut self,
        offset: u32,
        value: u32,
        now: Nanoseconds,
        events: &mut Vec<TimerEvent>,
    ) -> Option<Result<(), String>> {
        let done = match offset {
            CR1 => self.write_control(value, now),
            CR2 => self.write_control_2(value),
            SMCR => refuse("slave mode", value),
            DIER => {
                self.interrupts = value & (UPDATE | COMPARES | BREAK);
                refuse("interrupt or DMA request", value & !self.interrupts)
            }
            SR => {
                self.status &= value;
                self.apply_break();
                Ok(())
            }
            EGR => self.generate(value, now, events),
            CCMR1 | CCMR2 => self.write_modes(usize::from(offset == CCMR2), value),
            CCER => self.write_enables(value),
            CNT => self.write_count(value & 0xFFFF, now),
            PSC => {
                self.prescaler = value & 0xFFFF;
                Ok(())
            }
            ARR => self.write_reload(value & 0xFFFF, now),
            RCR => {
                self.repetitions = value & 0xFF;
                Ok(())
            }
            CCR1..=CCR4 => {
                let channel = (offset - CCR1) as usize / 4;
                self.compare[channel] = value & 0xFFFF;
                if !self.is_preloaded(channel) {
                    self.compare_in_force[channel] = value & 0xFFFF;
                }
                Ok(())
            }
            BDTR => {
                let done = self.protection.write(value);
                self.apply_break();
                done
            }
            _ => return None,
        };
        self.settle(now, events);
        Some(done.and_then(|()| self.check_outputs()))
    }

    fn write_control(&mut self, value: u32, now: Nanoseconds) -> Result<(), String> {
        const CENTRED: u32 = 3 << 5;
        const CLOCK_DIVISION: u32 = 3 << 8;
        const MODELLED: u32 =
            ENABLE | UPDATE_DISABLE | UPDATE_BY_OVERFLOW_ONLY | DOWN | CENTRED | RELOAD_PRELOADED | CLOCK_DIVISION;
        if value & CLOCK_DIVISION == CLOCK_DIVISION {
            return Err("CKD = 3 is reserved".into());
        }
        if value & ENABLE != 0 && value & CENTRED == 0 {
            return Err(format!("edge-aligned counting (CR1 = {value:#x}) is not modelled for TIM1"));
        }
        // DIR belongs to the counter as long as the mode is centre-aligned.
        self.control = value & MODELLED & !DOWN;
        self.counter.run(value & ENABLE != 0, now);
        refuse("CR1", value & !MODELLED)
    }

    fn write_control_2(&mut self, value: u32) -> Result<(), String> {
        const IDLE_LEVELS: u32 = 0x7F00;
        const TRIGGER: u32 = 7 << 4;
        let locked = if self.protection.lock() >= 1 { IDLE_LEVELS } else { 0 };
        let refused = (value ^ self.control_2) & locked;
        self.control_2 = self.control_2 & locked | value & !locked & (IDLE_LEVELS | TRIGGER);
        refuse("CR2", value & !(IDLE_LEVELS | TRIGGER))?;
        if matches!(value >> 4 & 7, 1 | 3) {
            return Err("TRGO from counter enable or compare pulse (MMS = 1, 3) is not modelled".into());
        }
        refuse_locked("CR2", refused, self.protection.lock())
    }

    fn write_modes(&mut self, register: usize, value: u32) -> Result<(), String> {
        const SELECTIONS: u32 = 0x0303;
        const CLEARED_BY_ETRF: u32 = 0x8080;
        const MODES_AND_PRELOAD: u32 = 0x7878;
        let locked = if self.protection.lock() >= 3 { MODES_AND_PRELOAD } else { 0 };
        let refused = (value ^ self.modes[register]) & locked;
        self.modes[register] = self.modes[register] & locked | value & !locked & 0xFFFF;
        refuse("capture on a channel", value & SELECTIONS)?;
        refuse("OCxCE", value & CLEARED_BY_ETRF)?;
        for channel in 2 * register..2 * register + 2 {
            if !self.is_preloaded(channel) {
                self.compare_in_force[channel] = self.compare[channel];
            }
            if matches!(self.mode(channel), 1..=3) {
                return Err(format!("output mode OC{}M = {} is not modelled", channel + 1, self.mode(channel)));
            }
        }
        refuse_locked("CCMR", refused, self.protection.lock())
    }

    fn write_enables(&mut self, value: u32) -> Result<(), String> {
        const POLARITIES: u32 = 0x2AAA;
        let locked = if self.protection.lock() >= 2 { POLARITIES } else { 0 };
        let refused = (value ^ self.enables) & locked;
        self.enables = self.enables & locked | value & !locked & 0x3FFF;
        refuse_locked("CCER", refused, self.protection.lock())
    }

    fn write_count(&mut self, count: u32, now: Nanoseconds) -> Result<(), String> {
        if count > self.counter.reload() {
            return Err(format!("count {count} written beyond the reload {}", self.counter.reload()));
        }
        self.counter.set_count(count, now);
        Ok(())
    }

    fn write_reload(&mut self, reload: u32, now: Nanoseconds) -> Result<(), String> {
        self.reload = reload;
        if self.control & RELOAD_PRELOADED != 0 {
            return Ok(());
        }
        let count = self.counter.count(now);
        if self.counter.moves() && count > reload {
            return Err(format!("reload {reload} written without preload while the count is {count}"));
        }
        self.counter.set_reload(reload, now);
        Ok(())
    }

    fn generate(&mut self, value: u32, now: Nanoseconds, events: &mut Vec<TimerEvent>) -> Result<(), String> {
        if value & UPDATE != 0 {
            if self.control & UPDATE_DISABLE == 0 {
                let flagged = self.control & UPDATE_BY_OVERFLOW_ONLY == 0;
                self.update(flagged, now, events);
                self.counter.restart(self.reload, self.divider(), now);
            } else {
                self.counter.restart(self.counter.reload(), self.counter.divider(), now);
            }
        }
        self.status |= value & COMPARES;
        if value & BREAK != 0 {
            self.protection.trip();
            self.status |= BREAK;
        }
        refuse("event generation", value & !(UPDATE | COMPARES | BREAK))
    }
}

fn refuse(what: &str, bits: u32) -> Result<(), String> {
    if bits == 0 { Ok(()) } else { Err(format!("{what}, bits {bits:#x} of TIM1, is not modelled")) }
}
