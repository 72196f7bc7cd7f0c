//! General purpose and basic timers: counting up, update interrupt, encoder mode, input capture (RM0090 chapters 18 and 20).
//!
//! The counter is worked out from the absolute number of timer clocks since the start of the simulation, so that a period of 10 500 clocks
//! never drifts. Output compare, PWM, DMA, slave modes other than the encoder and down-counting are not modelled.

use ring::Nanoseconds;

use super::input_filter::{self, InputFilter, PinEdge};
use crate::clock::{clocks_at, time_of_clocks};

const CR1: u32 = 0x00;
const CR2: u32 = 0x04;
const SMCR: u32 = 0x08;
const DIER: u32 = 0x0C;
const SR: u32 = 0x10;
const EGR: u32 = 0x14;
const CCMR1: u32 = 0x18;
const CCMR2: u32 = 0x1C;
const CCER: u32 = 0x20;
const CNT: u32 = 0x24;
const PSC: u32 = 0x28;
const ARR: u32 = 0x2C;
const CCR1: u32 = 0x34;
const CCR4: u32 = 0x40;
const OR: u32 = 0x50;

const ENABLE: u32 = 1;
const UPDATE_DISABLE: u32 = 1 << 1;
const UPDATE_BY_OVERFLOW_ONLY: u32 = 1 << 2;
const ONE_PULSE: u32 = 1 << 3;
const DOWN: u32 = 1 << 4;
const RELOAD_PRELOADED: u32 = 1 << 7;
const UPDATE: u32 = 1;
const CAPTURES: u32 = 0x1E;

/// One timer.
#[derive(Clone, Debug)]
pub(crate) struct Timer {
    bits: u32,
    channels: u32,
    clock_hz: u64,
    control: u32,
    control_2: u32,
    slave: u32,
    interrupts: u32,
    status: u32,
    capture_modes: [u32; 2],
    capture_enable: u32,
    capture: [u32; 4],
    inputs: [InputFilter; 4],
    option: u32,
    prescaler: u32,
    prescaler_in_force: u32,
    reload: u32,
    reload_in_force: u32,
    /// Timer clock at which the count was or would have been 0; only while counting.
    zero_at: u64,
    /// Count at which the counter wraps to 0: reload + 1, or 2^bits when the count was already past the reload.
    limit: u64,
    /// The count while it does not run; in encoder mode the difference between count and encoder.
    held: u32,
}

impl Timer {
    /// `bits` of the counter; basic timers have no channels, TIM9 and TIM12 two, the others four.
    pub(crate) fn new(bits: u32, channels: u32) -> Self {
        let full = u32::MAX >> (32 - bits);
        Self {
            bits,
            channels,
            clock_hz: 16_000_000,
            control: 0,
            control_2: 0,
            slave: 0,
            interrupts: 0,
            status: 0,
            capture_modes: [0; 2],
            capture_enable: 0,
            capture: [0; 4],
            inputs: [InputFilter::default(); 4],
            option: 0,
            prescaler: 0,
            prescaler_in_force: 0,
            reload: full,
            reload_in_force: full,
            zero_at: 0,
            limit: u64::from(full) + 1,
            held: 0,
        }
    }

    /// The timer clock changes; the count goes on from where it stands.
    pub(crate) fn set_clock(&mut self, hertz: u64, now: Nanoseconds) {
        if hertz == self.clock_hz {
            return;
        }
        let count = self.count(now, 0);
        self.clock_hz = hertz;
        if self.runs() {
            self.start_from(count, now);
        }
    }

    /// Whether the timer counts at all.
    pub(crate) fn is_enabled(&self) -> bool {
        self.control & ENABLE != 0
    }

    /// Whether TI1 and TI2 drive the counter.
    pub(crate) fn counts_encoder(&self) -> bool {
        matches!(self.slave & 7, 1..=3)
    }

    /// SR; reading it has no effect.
    pub(crate) fn status(&self) -> u32 {
        self.status
    }

    /// Is the interrupt line high?
    pub(crate) fn line(&self) -> bool {
        self.status & self.interrupts & 0x5F != 0
    }

    /// The lines of a timer that has one for the update and one for the captures.
    pub(crate) fn update_and_capture_lines(&self) -> [bool; 2] {
        [UPDATE, CAPTURES].map(|mask| self.status & self.interrupts & mask != 0)
    }

    /// Time of the next update, if it would raise the interrupt line.
    pub(crate) fn next_event(&self) -> Option<Nanoseconds> {
        let wanted = self.runs()
            && self.interrupts & UPDATE != 0
            && self.status & UPDATE == 0
            && self.control & UPDATE_DISABLE == 0;
        wanted.then(|| self.time_of(self.next_wrap()))
    }

    /// Lets the counter wrap as often as it did until `now`.
    pub(crate) fn advance(&mut self, now: Nanoseconds) {
        if self.filters() {
            self.pass_filters(now);
        }
        while self.runs() && self.time_of(self.next_wrap()) <= now {
            let wrap = self.next_wrap();
            self.zero_at = wrap;
            self.update_event();
            self.limit = u64::from(self.reload_in_force) + 1;
            self.status |= if self.control & UPDATE_DISABLE == 0 { UPDATE } else { 0 };
            if self.control & ONE_PULSE != 0 {
                self.control &= !ENABLE;
                self.held = 0;
            }
        }
    }

    /// The count at `now`; `encoder` is the position that TI1 and TI2 have counted.
    pub(crate) fn count(&self, now: Nanoseconds, encoder: u32) -> u32 {
        if !self.is_enabled() {
            self.held
        } else if self.counts_encoder() {
            encoder.wrapping_add(self.held) & self.full()
        } else {
            let clocks = self.clocks(now).saturating_sub(self.zero_at);
            (clocks / self.divider() % self.limit) as u32
        }
    }

    /// The pin of channel 1 to 4 changed its level. Behind its filter it feeds the channel itself and the other one of its pair (CCxS = 1, CCxS = 2).
    pub(crate) fn capture_edge(&mut self, channel: u8, rises: bool, now: Nanoseconds, encoder: u32) {
        self.pass_filters(now);
        self.inputs[usize::from(channel - 1)].take(PinEdge { at: now, rises, position: encoder });
        self.pass_filters(now);
    }

    /// An edge is still in a filter: the status may change by itself.
    pub(crate) fn filters(&self) -> bool {
        self.inputs.iter().any(InputFilter::waits)
    }

    /// Length of the filter behind the pin of channel 1 to 4.
    pub(crate) fn filter_of(&self, channel: u8) -> Nanoseconds {
        let input = usize::from(channel - 1);
        let code = self.capture_modes[input / 2] >> (8 * (input % 2) + 4);
        input_filter::length(code, self.control >> 8, self.clock_hz)
    }

    /// Captures what has stood for long enough.
    fn pass_filters(&mut self, now: Nanoseconds) {
        for channel in 1..=4 {
            let length = self.filter_of(channel);
            if let Some(edge) = self.inputs[usize::from(channel - 1)].passed(length, now) {
                self.capture(usize::from(channel - 1), edge);
            }
        }
    }

    fn capture(&mut self, input: usize, edge: PinEdge) {
        for (index, selected) in [(input, 1), (input ^ 1, 2)] {
            let polarity = self.capture_enable >> (4 * index);
            let selection = self.capture_modes[index / 2] >> (8 * (index % 2)) & 3;
            let (enabled, inverted, both) = (polarity & 1 != 0, polarity & 2 != 0, polarity & 0xA == 0xA);
            if !enabled || selection != selected || !(both || edge.rises != inverted) {
                continue;
            }
            self.capture[index] = self.count(edge.at, edge.position);
            let flag = 2 << index;
            if self.status & flag != 0 {
                self.status |= flag << 8;
            }
            self.status |= flag;
        }
    }

    pub(crate) fn read(&mut self, offset: u32, now: Nanoseconds, encoder: u32) -> Option<u32> {
        if !self.has(offset) {
            return None;
        }
        if self.filters() {
            self.pass_filters(now);
        }
        Some(match offset {
            CR1 => self.control,
            CR2 => self.control_2,
            SMCR => self.slave,
            DIER => self.interrupts,
            SR => self.status,
            EGR => 0,
            CCMR1 => self.capture_modes[0],
            CCMR2 => self.capture_modes[1],
            CCER => self.capture_enable,
            CNT => self.count(now, encoder),
            PSC => self.prescaler,
            ARR => self.reload,
            CCR1..=CCR4 => {
                let index = (offset - CCR1) / 4;
                self.status &= !(2 << index);
                self.capture[index as usize]
            }
            OR => self.option,
            _ => return None,
        })
    }

    /// `Err` tells what is not modelled.
    pub(crate) fn write(
        &mut self,
        offset: u32,
        value: u32,
        now: Nanoseconds,
        encoder: u32,
    ) -> Option<Result<(), String>> {
        if !self.has(offset) {
            return None;
        }
        let full = self.full();
        match offset {
            CR1 => {
                if value & (DOWN | 0x60) != 0 {
                    return Some(Err(format!("timer mode CR1 = {value:#x} is not modelled")));
                }
                let count = self.count(now, encoder);
                self.control = value & 0x3FF;
                self.set_count(count, now, encoder);
            }
            CR2 => self.control_2 = value,
            SMCR => {
                if value & 7 > 3 {
                    return Some(Err(format!("timer slave mode {value:#x} is not modelled")));
                }
                let count = self.count(now, encoder);
                self.slave = value;
                self.set_count(count, now, encoder);
            }
            DIER => self.interrupts = value,
            SR => self.status &= value,
            EGR => {
                if value & 1 != 0 {
                    self.update_event();
                    self.set_count(0, now, encoder);
                    if self.control & (UPDATE_BY_OVERFLOW_ONLY | UPDATE_DISABLE) == 0 {
                        self.status |= UPDATE;
                    }
                }
            }
            CCMR1 | CCMR2 => {
                // Channels used as outputs would need the compare unit.
                self.capture_modes[usize::from(offset == CCMR2)] = value;
            }
            CCER => self.capture_enable = value,
            CNT => self.set_count(value & full, now, encoder),
            PSC => self.prescaler = value & 0xFFFF,
            ARR => {
                self.reload = value & full;
                if self.control & RELOAD_PRELOADED == 0 {
                    let count = self.count(now, encoder);
                    self.reload_in_force = self.reload;
                    self.set_count(count, now, encoder);
                }
            }
            CCR1..=CCR4 => self.capture[(offset - CCR1) as usize / 4] = value,
            OR => self.option = value,
            _ => return None,
        }
        if self.counts_encoder() && self.is_enabled() && self.reload_in_force != full {
            return Some(Err(format!("encoder mode with reload {:#x} is not modelled", self.reload_in_force)));
        }
        Some(Ok(()))
    }

    fn has(&self, offset: u32) -> bool {
        match offset {
            CR1 | DIER | SR | EGR | CNT | PSC | ARR => true,
            CR2 => self.channels != 2,
            SMCR | CCMR1 | CCER => self.channels > 0,
            CCR1..=CCR4 => (offset - CCR1) / 4 < self.channels,
            _ => self.channels == 4,
        }
    }

    fn full(&self) -> u32 {
        u32::MAX >> (32 - self.bits)
    }

    fn runs(&self) -> bool {
        self.is_enabled() && !self.counts_encoder()
    }

    fn update_event(&mut self) {
        self.prescaler_in_force = self.prescaler;
        self.reload_in_force = self.reload;
    }

    fn set_count(&mut self, count: u32, now: Nanoseconds, encoder: u32) {
        if self.runs() {
            self.start_from(count, now);
        } else if self.is_enabled() {
            self.held = count.wrapping_sub(encoder);
        } else {
            self.held = count;
        }
    }

    fn start_from(&mut self, count: u32, now: Nanoseconds) {
        self.zero_at = self.clocks(now).saturating_sub(u64::from(count) * self.divider());
        self.limit = if count > self.reload_in_force { 1 << self.bits } else { u64::from(self.reload_in_force) + 1 };
    }

    fn divider(&self) -> u64 {
        u64::from(self.prescaler_in_force) + 1
    }

    fn next_wrap(&self) -> u64 {
        self.zero_at + self.limit * self.divider()
    }

    /// Timer clocks since the start of the simulation.
    fn clocks(&self, now: Nanoseconds) -> u64 {
        clocks_at(now, self.clock_hz)
    }

    /// The first nanosecond at which that many clocks have passed.
    fn time_of(&self, clocks: u64) -> Nanoseconds {
        time_of_clocks(clocks, self.clock_hz)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const START: Nanoseconds = Nanoseconds(1_000_003);

    fn loop_timer() -> Timer {
        let mut timer = Timer::new(16, 0);
        timer.set_clock(84_000_000, Nanoseconds::ZERO);
        for (offset, value) in [(ARR, 10_499), (CR1, 0x84), (EGR, 1), (SR, 0), (DIER, 1), (CR1, 0x85)] {
            timer.write(offset, value, START, 0).unwrap().unwrap();
        }
        timer
    }

    #[test]
    fn the_loop_timer_ticks_every_125_us_without_drift() {
        let mut timer = loop_timer();
        let mut ticks = 0;
        for _ in 0..8_000 {
            let event = timer.next_event().unwrap();
            timer.advance(event);
            assert!(timer.line());
            timer.write(SR, 0, event, 0);
            ticks += 1;
            let error = event.0.abs_diff(START.0 + ticks * 125_000);
            assert!(error <= 12, "tick {ticks} off by {error} ns");
        }
    }

    #[test]
    fn a_preloaded_period_holds_from_the_next_tick_on() {
        let mut timer = loop_timer();
        timer.write(ARR, 9_999, START + Nanoseconds(50_000), 0);
        let first = timer.next_event().unwrap();
        assert!(first.0.abs_diff(START.0 + 125_000) <= 12);
        timer.advance(first);
        timer.write(SR, 0, first, 0);
        let second = timer.next_event().unwrap();
        assert!(second.0.abs_diff(first.0 + 119_048) <= 12);
        assert_eq!(timer.count(first + Nanoseconds(11_905), 0), 1_000);
    }

    #[test]
    fn without_preload_a_shorter_period_behind_the_count_is_missed() {
        let mut timer = loop_timer();
        timer.write(CR1, 0x05, START, 0);
        timer.write(ARR, 100, START + Nanoseconds(50_000), 0);
        let event = timer.next_event().unwrap();
        assert!(event > START + Nanoseconds(700_000), "wraps only at 65536: {event}");
    }

    #[test]
    fn both_edges_latch_the_encoder() {
        let mut timer = Timer::new(32, 4);
        for (offset, value) in [(CCMR2, 0x3131), (CCER, 0xBB00), (SMCR, 3), (CNT, 0), (CR1, 1)] {
            timer.write(offset, value, START, 500).unwrap().unwrap();
        }
        assert_eq!(timer.count(START, 500), 0, "started at 0");
        // 8 samples at 16 MHz.
        let later = |microseconds| START + Nanoseconds::from_microseconds(microseconds);
        timer.capture_edge(3, false, later(0), 700);
        assert_eq!(timer.read(CCR1 + 8, later(0), 900), Some(0), "in the filter");
        assert_eq!(timer.read(CCR1 + 8, later(1), 900), Some(200));
        timer.capture_edge(3, true, later(2), 701);
        timer.capture_edge(4, true, later(2), 702);
        assert_eq!(timer.read(CCR1 + 8, later(3), 900), Some(201));
        assert_eq!(timer.read(CCR4, later(3), 900), Some(202));
        timer.capture_edge(3, true, later(4), 800);
        timer.capture_edge(3, false, later(5), 801);
        assert_eq!(timer.read(SR, later(6), 0), Some(0x0808), "flag and overcapture");
    }

    #[test]
    fn a_spike_shorter_than_the_filter_captures_nothing_and_without_a_filter_it_does() {
        for (modes, captured) in [(0x3131, 0), (0x0101, 20)] {
            let mut timer = Timer::new(32, 4);
            for (offset, value) in [(CCMR2, modes), (CCER, 0xBB00), (SMCR, 3), (CNT, 0), (CR1, 1)] {
                timer.write(offset, value, START, 0).unwrap().unwrap();
            }
            timer.capture_edge(3, false, START, 10);
            timer.capture_edge(3, true, START + Nanoseconds(400), 20);
            assert_eq!(timer.read(CCR1 + 8, START + Nanoseconds(2_000), 0), Some(captured));
        }
    }

    #[test]
    fn a_capture_of_one_polarity_ignores_the_other() {
        let mut timer = Timer::new(32, 4);
        for (offset, value) in [(CCMR2, 1), (CCER, 0x0100), (SMCR, 3), (CR1, 1)] {
            timer.write(offset, value, START, 0).unwrap().unwrap();
        }
        timer.capture_edge(3, false, START, 5);
        assert_eq!(timer.read(SR, START, 0), Some(0));
        timer.capture_edge(3, true, START, 6);
        assert_eq!(timer.read(CCR1 + 8, START, 0), Some(6));
    }

    #[test]
    fn a_16_bit_encoder_counter_wraps_with_the_low_half_of_the_position() {
        let mut timer = Timer::new(16, 4);
        for (offset, value) in [(SMCR, 3), (ARR, 0xFFFF), (CNT, 0), (CR1, 1)] {
            timer.write(offset, value, START, 0x0001_FFF0).unwrap().unwrap();
        }
        assert_eq!(timer.read(CNT, START, 0x0002_0010), Some(0x20));
        assert_eq!(timer.read(CNT, START, 0x0001_FFEF), Some(0xFFFF));
        assert_eq!(timer.read(CNT, START, 0x0003_0010), Some(0x20));
    }

    #[test]
    fn both_channels_of_a_pair_capture_one_pin_each_at_its_edge() {
        let mut timer = Timer::new(16, 4);
        // IC3 on TI3 rising, IC4 on TI3 falling.
        for (offset, value) in [(CCMR2, 0x0201), (CCER, 0x3100), (SMCR, 3), (CNT, 0), (CR1, 1)] {
            timer.write(offset, value, START, 0).unwrap().unwrap();
        }
        timer.capture_edge(3, true, START, 100);
        timer.capture_edge(3, false, START, 250);
        timer.capture_edge(4, true, START, 400);
        timer.capture_edge(4, false, START, 400);
        assert_eq!(timer.read(SR, START, 0), Some(0x18));
        assert_eq!(timer.read(CCR1 + 8, START, 0), Some(100));
        assert_eq!(timer.read(CCR4, START, 0), Some(250));
    }

    #[test]
    fn a_timer_of_two_channels_stamps_times_and_knows_no_more_registers() {
        let mut timer = Timer::new(16, 2);
        timer.set_clock(168_000_000, Nanoseconds::ZERO);
        for (offset, value) in [(CCMR1, 0x0101), (CCER, 0xBB), (CR1, 1)] {
            timer.write(offset, value, START, 0).unwrap().unwrap();
        }
        timer.capture_edge(1, false, START + Nanoseconds(100_000), 0);
        timer.capture_edge(2, true, START + Nanoseconds(500_000), 0);
        assert!(timer.read(CCR1, START, 0).unwrap().abs_diff(16_800) <= 1);
        assert!(timer.read(CCR1 + 4, START, 0).unwrap().abs_diff(84_000 - 65_536) <= 1);
        for offset in [CR2, CCMR2, CCR4, OR] {
            assert_eq!(timer.read(offset, START, 0), None);
        }
    }
}
