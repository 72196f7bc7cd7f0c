//! TIM1 as the modulator of a three-phase bridge: centre-aligned PWM with complementary outputs, break and trigger (RM0090 chapter 17).
//!
//! What the outputs do is told as events ([`TimerEvent`]), because a share of a half takes effect at the over- or underflow that loads it and
//! a break at the instant of its edge, both without the processor. The board's gate drivers are active high, so that inverted outputs are
//! refused. Edge-aligned counting, captures, DMA, the slave modes and commutation are not modelled.

pub(crate) mod registers;

use ring::Nanoseconds;

use super::break_and_dead_time::BreakAndDeadTime;
use super::centred_counter::CentredCounter;

const ENABLE: u32 = 1;
const UPDATE_DISABLE: u32 = 1 << 1;
const RELOAD_PRELOADED: u32 = 1 << 7;
const UPDATE: u32 = 1;
const COMPARES: u32 = 0x1E;
const BREAK: u32 = 1 << 7;
/// MMS: TRGO is the update event; 4 to 7 are the references of the channels.
const TRIGGER_BY_UPDATE: u32 = 2;
/// CCxE and CCxNE of channels 1 to 3.
pub(crate) const ALL_SWITCHES: u32 = 0x0555;
/// CCxP and CCxNP of channels 1 to 3.
const INVERTED_SWITCHES: u32 = 0x0AAA;

/// What the power stage gets to see.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Bridge {
    /// All six outputs switch; otherwise all are off.
    pub(crate) on: bool,
    /// Share of each phase's high side, 0 to 1, without dead time.
    pub(crate) duties: [f64; 3],
    /// Dead time in nanoseconds.
    pub(crate) dead_time_ns: u32,
}

/// Something that the timer did by itself or at a write.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum TimerEvent {
    /// Rising edge of TRGO.
    Trigger(Nanoseconds),
    /// The outputs changed.
    Bridge(Nanoseconds, Bridge),
}

/// The timer.
#[derive(Clone, Debug)]
pub(crate) struct AdvancedTimer {
    control: u32,
    control_2: u32,
    interrupts: u32,
    status: u32,
    modes: [u32; 2],
    enables: u32,
    counter: CentredCounter,
    prescaler: u32,
    reload: u32,
    repetitions: u32,
    /// Over- and underflows that pass before the one that updates.
    repetitions_left: u32,
    compare: [u32; 4],
    compare_in_force: [u32; 4],
    protection: BreakAndDeadTime,
    /// Everything until here is done.
    passed: Nanoseconds,
    trigger_level: bool,
    told: Bridge,
}

impl AdvancedTimer {
    pub(crate) fn new() -> Self {
        Self {
            control: 0,
            control_2: 0,
            interrupts: 0,
            status: 0,
            modes: [0; 2],
            enables: 0,
            counter: CentredCounter::new(0xFFFF),
            prescaler: 0,
            reload: 0xFFFF,
            repetitions: 0,
            repetitions_left: 0,
            compare: [0; 4],
            compare_in_force: [0; 4],
            protection: BreakAndDeadTime::new(),
            passed: Nanoseconds::ZERO,
            trigger_level: false,
            told: Bridge { on: false, duties: [0.0; 3], dead_time_ns: 0 },
        }
    }

    /// The timer clock changes.
    pub(crate) fn set_clock(&mut self, hertz: u64, now: Nanoseconds) {
        self.counter.set_clock(hertz, now);
    }

    pub(crate) fn clock_hz(&self) -> u64 {
        self.counter.clock_hz()
    }

    /// The dead time in nanoseconds.
    pub(crate) fn dead_time_ns(&self) -> u32 {
        let clocks = u64::from(self.protection.dead_time()) << (self.control >> 8 & 3);
        let hertz = self.counter.clock_hz();
        ((clocks * 1_000_000_000 + hertz / 2) / hertz) as u32
    }

    /// Level of the break pin from `now` on.
    pub(crate) fn set_break_level(&mut self, level: bool, now: Nanoseconds, events: &mut Vec<TimerEvent>) {
        self.protection.set_level(level);
        self.apply_break();
        self.settle(now, events);
    }

    /// A failed clock is an event at the break input, whatever the pin says.
    pub(crate) fn break_by_clock(&mut self, now: Nanoseconds, events: &mut Vec<TimerEvent>) {
        self.protection.fail_clock();
        self.apply_break();
        self.settle(now, events);
    }

    /// Interrupt lines: break, update, compare.
    pub(crate) fn lines(&self) -> [bool; 3] {
        let active = self.status & self.interrupts;
        [BREAK, UPDATE, COMPARES].map(|mask| active & mask != 0)
    }

    /// Is any interrupt of the counter enabled?
    pub(crate) fn interrupts(&self) -> bool {
        self.interrupts & (UPDATE | COMPARES) != 0
    }

    /// The next instant at which something that can be seen from outside changes, TRGO apart.
    ///
    /// Every underflow is one, so that what a handler reads of the direction after the overflow is sure until then.
    pub(crate) fn next_event(&self) -> Option<Nanoseconds> {
        let end = self.counter.half_end()?;
        let updates = self.repetitions_left == 0 && self.control & UPDATE_DISABLE == 0;
        let awaited = self.interrupts & !self.status;
        let update_shows = updates && (awaited & UPDATE != 0 || self.is_load_pending() || self.protection.rearms());
        let half_matters = self.counter.is_down() || update_shows || awaited & COMPARES != 0;
        let compare = (0..4)
            .filter(|channel| awaited & 2 << channel != 0)
            .filter_map(|channel| self.match_in_half(channel))
            .map(|progress| self.counter.time_of_progress(progress))
            .filter(|time| *time > self.passed)
            .min();
        [half_matters.then_some(end), compare].into_iter().flatten().min()
    }

    /// The next rising edge of TRGO, if nothing is written until then.
    pub(crate) fn next_trigger(&self) -> Option<Nanoseconds> {
        if !matches!(self.master_mode(), TRIGGER_BY_UPDATE | 4..) {
            return None;
        }
        let mut ahead = self.clone();
        let mut events = Vec::new();
        // A period has two halves; an update every so many of them.
        for _ in 0..4 + self.repetitions_left {
            ahead.advance(ahead.counter.half_end()?, &mut events);
            let trigger = events.drain(..).find_map(|event| match event {
                TimerEvent::Trigger(at) => Some(at),
                TimerEvent::Bridge(..) => None,
            });
            if trigger.is_some() {
                return trigger;
            }
        }
        None
    }

    /// When the direction changes next.
    pub(crate) fn next_turn(&self) -> Option<Nanoseconds> {
        self.counter.half_end()
    }

    /// Lets the counter go on until `now`.
    pub(crate) fn advance(&mut self, now: Nanoseconds, events: &mut Vec<TimerEvent>) {
        while let Some(end) = self.counter.half_end().filter(|end| *end <= now) {
            self.pass_compares(end, events);
            self.turn(end, events);
        }
        self.pass_compares(now, events);
    }

    /// The counter reaches the reload or 0.
    fn turn(&mut self, at: Nanoseconds, events: &mut Vec<TimerEvent>) {
        let mut divider = self.counter.divider();
        let mut reload = self.counter.reload();
        if self.repetitions_left > 0 {
            self.repetitions_left -= 1;
        } else if self.control & UPDATE_DISABLE == 0 {
            self.update(true, at, events);
            divider = self.divider();
            reload = self.reload;
        }
        self.counter.turn(reload, divider);
        for channel in 0..4 {
            let beyond = self.counter.is_down() && self.compare_in_force[channel] > reload;
            let matches = self.match_in_half(channel) == Some(0);
            self.status |= u32::from(beyond || matches) << (1 + channel);
        }
        self.settle(at, events);
    }

    /// The update event: what was written becomes active.
    fn update(&mut self, flagged: bool, at: Nanoseconds, events: &mut Vec<TimerEvent>) {
        self.compare_in_force = self.compare;
        self.repetitions_left = self.repetitions;
        self.status |= if flagged { UPDATE } else { 0 };
        self.protection.rearm();
        if self.master_mode() == TRIGGER_BY_UPDATE {
            events.push(TimerEvent::Trigger(at));
        }
    }

    /// The compare matches behind `passed` up to `until`, within one half.
    fn pass_compares(&mut self, until: Nanoseconds, events: &mut Vec<TimerEvent>) {
        let is_due = |timer: &Self, progress| {
            let time = timer.counter.time_of_progress(progress);
            timer.counter.moves() && timer.passed < time && time <= until
        };
        for channel in 0..4 {
            if self.match_in_half(channel).is_some_and(|progress| is_due(self, progress)) {
                self.status |= 2 << channel;
            }
        }
        if let Some(channel) = self.trigger_source() {
            let switch = self.switch_in_half(channel);
            if (1..self.counter.reload()).contains(&switch) && is_due(self, switch) {
                self.settle_trigger(self.counter.time_of_progress(switch), events);
            }
        }
        self.passed = self.passed.max(until);
    }

    /// Progress at which the count meets the compare value in this half and CCxIF is set in this direction (CMS).
    fn match_in_half(&self, channel: usize) -> Option<u32> {
        const FLAGS_DOWN: u32 = 1 << 5;
        const FLAGS_UP: u32 = 1 << 6;
        let (compare, reload) = (self.compare_in_force[channel], self.counter.reload());
        let (flagged, met, progress) = if self.counter.is_down() {
            (FLAGS_DOWN, (1..=reload).contains(&compare), reload.wrapping_sub(compare))
        } else {
            (FLAGS_UP, compare < reload, compare)
        };
        (met && self.control & flagged != 0).then_some(progress)
    }

    /// Progress at which the reference of a channel switches in this half; at the ends of the range it does not.
    fn switch_in_half(&self, channel: usize) -> u32 {
        let reload = self.counter.reload();
        let compare = self.compare_in_force[channel].min(reload);
        if self.counter.is_down() { reload - compare } else { compare }
    }

    /// OCxREF: PWM mode 1 is active below the compare value, mode 2 above.
    fn reference(&self, channel: usize, now: Nanoseconds) -> bool {
        let behind_switch = self.counter.progress(now) >= self.switch_in_half(channel);
        let below = behind_switch == self.counter.is_down();
        match self.mode(channel) {
            5 => true,
            6 => below,
            7 => !below,
            _ => false,
        }
    }

    /// Channel whose reference is TRGO.
    fn trigger_source(&self) -> Option<usize> {
        self.master_mode().checked_sub(4).map(|channel| channel as usize)
    }

    /// MMS.
    fn master_mode(&self) -> u32 {
        self.control_2 >> 4 & 7
    }

    fn settle_trigger(&mut self, at: Nanoseconds, events: &mut Vec<TimerEvent>) {
        let level = self.trigger_source().is_some_and(|channel| self.reference(channel, at));
        if level && !std::mem::replace(&mut self.trigger_level, level) {
            events.push(TimerEvent::Trigger(at));
        }
        self.trigger_level = level;
    }

    fn settle(&mut self, at: Nanoseconds, events: &mut Vec<TimerEvent>) {
        self.settle_trigger(at, events);
        let bridge = self.bridge();
        if bridge != self.told {
            self.told = bridge;
            events.push(TimerEvent::Bridge(at, bridge));
        }
    }

    fn bridge(&self) -> Bridge {
        let share = |channel: usize| {
            let reload = self.counter.reload().max(1);
            let below = f64::from(self.compare_in_force[channel].min(reload)) / f64::from(reload);
            match self.mode(channel) {
                5 => 1.0,
                6 => below,
                7 => 1.0 - below,
                _ => 0.0,
            }
        };
        Bridge {
            on: self.protection.main_output()
                && self.counter.moves()
                && self.enables & ALL_SWITCHES == ALL_SWITCHES
                && self.check_outputs().is_ok(),
            duties: [0, 1, 2].map(share),
            dead_time_ns: self.dead_time_ns(),
        }
    }

    /// Combinations that would burn or that the plant has no model for.
    fn check_outputs(&self) -> Result<(), String> {
        let switches = self.enables & ALL_SWITCHES;
        if !self.protection.main_output() || switches == 0 {
            return Ok(());
        }
        let checks = [
            (switches == ALL_SWITCHES, "only some of the six switches are enabled (CCER)"),
            (self.enables & INVERTED_SWITCHES == 0, "an inverted output, the gate drivers are active high (CCER)"),
            ((0..3).all(|channel| self.mode(channel) >= 4), "a channel is frozen (OCxM = 0)"),
            (self.counter.moves(), "the counter stands still (CR1.CEN)"),
        ];
        let broken = checks.iter().find(|(fine, _)| !fine);
        broken.map_or(Ok(()), |(_, what)| Err(format!("bridge switched on, but {what}")))
    }

    /// The break acts on the level: MOE stays off and BIF set as long as it lasts.
    fn apply_break(&mut self) {
        if self.protection.is_broken() {
            self.protection.trip();
            self.status |= BREAK;
        }
    }

    fn is_load_pending(&self) -> bool {
        self.compare_in_force != self.compare
            || self.counter.reload() != self.reload
            || self.counter.divider() != self.divider()
    }

    fn mode(&self, channel: usize) -> u32 {
        self.modes[channel / 2] >> (8 * (channel % 2) + 4) & 7
    }

    fn is_preloaded(&self, channel: usize) -> bool {
        self.modes[channel / 2] & 8 << (8 * (channel % 2)) != 0
    }

    fn divider(&self) -> u64 {
        u64::from(self.prescaler) + 1
    }
}

#[cfg(test)]
mod tests;
