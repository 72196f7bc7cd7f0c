//! The laws of TIM1, one test each.

use super::registers::*;
use super::*;

const HALF: u64 = 31_250;
const START: Nanoseconds = Nanoseconds(1_000_000);
const SET_UP: [(u32, u32); 11] = [
    (CR1, 0xA0),
    (PSC, 0),
    (ARR, 5_250),
    (CCMR1, 0x6868),
    (CCMR2, 0x7868),
    (CCR4, 5_226),
    (CCER, ALL_SWITCHES),
    (BDTR, 0x1C94),
    (EGR, 1),
    (SR, 0),
    (CR2, 0x70),
];

/// A timer and everything that it has told.
struct Bench {
    timer: AdvancedTimer,
    events: Vec<TimerEvent>,
}

impl Bench {
    /// Set up as a drive does (16 kHz, dead time 168 clocks), break input high, but neither running nor switched on.
    fn new() -> Self {
        let mut timer = AdvancedTimer::new();
        timer.set_clock(168_000_000, Nanoseconds::ZERO);
        let mut bench = Self { timer, events: Vec::new() };
        bench.break_level(true, START);
        for (offset, value) in SET_UP {
            bench.write(offset, value, START);
        }
        bench
    }

    fn running() -> Self {
        let mut bench = Self::new();
        bench.write(CR1, 0xA1, START);
        bench
    }

    /// Running, bridge on, events so far forgotten.
    fn switched_on() -> Self {
        let mut bench = Self::running();
        bench.write(BDTR, 0x9C94, START);
        bench.events.clear();
        bench
    }

    fn try_write(&mut self, offset: u32, value: u32, now: Nanoseconds) -> Result<(), String> {
        self.timer.write(offset, value, now, &mut self.events).unwrap()
    }

    fn write(&mut self, offset: u32, value: u32, now: Nanoseconds) {
        self.try_write(offset, value, now).unwrap();
    }

    fn advance(&mut self, now: Nanoseconds) {
        self.timer.advance(now, &mut self.events);
    }

    fn break_level(&mut self, level: bool, now: Nanoseconds) {
        self.timer.set_break_level(level, now, &mut self.events);
    }

    fn read(&self, offset: u32, now: Nanoseconds) -> u32 {
        self.timer.read(offset, now).unwrap()
    }

    fn triggers(&self) -> Vec<u64> {
        let at = |event: &TimerEvent| match event {
            TimerEvent::Trigger(at) => Some(at.0 - START.0),
            TimerEvent::Bridge(..) => None,
        };
        self.events.iter().filter_map(at).collect()
    }

    fn bridges(&self) -> Vec<(u64, Bridge)> {
        let told = |event: &TimerEvent| match event {
            TimerEvent::Bridge(at, bridge) => Some((at.0 - START.0, *bridge)),
            TimerEvent::Trigger(_) => None,
        };
        self.events.iter().filter_map(told).collect()
    }
}

fn after(nanoseconds: u64) -> Nanoseconds {
    START + Nanoseconds(nanoseconds)
}

#[test]
fn the_count_goes_up_and_down_and_the_direction_can_be_read() {
    let mut bench = Bench::running();
    for (time, count, down) in [
        (10_000, 1_680, false),
        (HALF - 6, 5_248, false),
        (HALF, 5_250, true),
        (HALF + 10_000, 3_570, true),
        (2 * HALF, 0, false),
        (7 * HALF + 10_000, 3_570, true),
    ] {
        bench.advance(after(time));
        assert_eq!(bench.read(CNT, after(time)), count, "at {time}");
        assert_eq!(bench.read(CR1, after(time)) & DOWN != 0, down, "at {time}");
    }
}

#[test]
fn the_direction_cannot_be_written() {
    let mut bench = Bench::running();
    bench.write(CR1, 0xB1, after(1_000));
    assert_eq!(bench.read(CR1, after(1_000)), 0xA1);
    assert_eq!(bench.read(CNT, after(2_000)), 336);
}

#[test]
fn preloaded_compare_values_load_at_overflow_and_underflow() {
    let mut bench = Bench::switched_on();
    bench.write(CCR1, 1_050, after(10_000));
    assert!(bench.bridges().is_empty(), "not before the overflow");
    assert_eq!(bench.timer.next_event(), Some(after(HALF)));
    bench.advance(after(HALF));
    bench.write(CCR1 + 8, 2_100, after(HALF + 1_000));
    bench.advance(after(3 * HALF));
    let duties: Vec<_> = bench.bridges().iter().map(|(at, bridge)| (*at, bridge.duties)).collect();
    assert_eq!(duties, [(HALF, [0.2, 0.0, 0.0]), (2 * HALF, [0.2, 0.0, 0.4])]);
}

#[test]
fn without_preload_a_compare_value_acts_at_once() {
    let mut bench = Bench::switched_on();
    bench.write(CCMR1, 0x6860, after(9_000));
    bench.write(CCR1, 1_050, after(10_000));
    assert_eq!(bench.bridges(), [(10_000, Bridge { on: true, duties: [0.2, 0.0, 0.0], dead_time_ns: 1_000 })]);
}

#[test]
fn a_preloaded_reload_holds_from_the_next_half_on() {
    let mut bench = Bench::running();
    bench.write(ARR, 4_200, after(10_000));
    bench.advance(after(HALF));
    assert_eq!(bench.read(CNT, after(HALF)), 4_200, "the way down begins at the new reload");
    assert_eq!(bench.timer.next_event(), Some(after(HALF + 25_000)));
}

#[test]
fn a_reload_without_preload_must_not_fall_behind_the_count() {
    let mut bench = Bench::running();
    bench.write(CR1, 0x21, after(9_000));
    let error = bench.try_write(ARR, 1_000, after(10_000)).unwrap_err();
    assert!(error.contains("while the count is 1680"), "{error}");
}

#[test]
fn an_odd_repetition_count_updates_at_every_underflow() {
    let mut bench = Bench::new();
    bench.write(RCR, 1, START);
    bench.write(EGR, 1, START);
    bench.write(SR, 0, START);
    bench.write(CR1, 0xA1, START);
    bench.write(BDTR, 0x9C94, START);
    bench.events.clear();
    bench.write(CCR1, 1_050, after(1_000));
    bench.advance(after(HALF + 5));
    assert_eq!(bench.read(SR, after(HALF + 5)) & UPDATE, 0, "no update at the overflow");
    bench.advance(after(2 * HALF + 5));
    assert_eq!(bench.read(SR, after(2 * HALF + 5)) & UPDATE, 1);
    bench.write(CCR1, 2_100, after(2 * HALF + 1_000));
    bench.advance(after(9 * HALF));
    let times: Vec<u64> = bench.bridges().iter().map(|(at, _)| *at).collect();
    assert_eq!(times, [2 * HALF, 4 * HALF]);
}

#[test]
fn a_repetition_count_written_behind_the_start_updates_at_every_overflow() {
    let mut bench = Bench::running();
    bench.write(RCR, 1, after(1_000));
    let mut updates = Vec::new();
    for half in 1..=5 {
        bench.advance(after(half * HALF));
        if bench.read(SR, after(half * HALF)) & UPDATE != 0 {
            updates.push(half);
            bench.write(SR, 0, after(half * HALF));
        }
    }
    assert_eq!(updates, [1, 3, 5]);
}

#[test]
fn the_update_interrupt_comes_at_over_and_underflow() {
    let mut bench = Bench::running();
    bench.write(DIER, UPDATE, START);
    for half in 1..=4 {
        assert_eq!(bench.timer.next_event(), Some(after(half * HALF)));
        assert_eq!(bench.timer.lines(), [false; 3]);
        bench.advance(after(half * HALF));
        assert_eq!(bench.timer.lines(), [false, true, false]);
        bench.write(SR, !UPDATE, after(half * HALF));
    }
}

#[test]
fn the_compare_interrupt_follows_the_direction_that_cms_selects() {
    for (modes, expected) in [(0xA1, HALF + 143), (0xC1, HALF - 142), (0xE1, HALF - 142)] {
        let mut bench = Bench::new();
        bench.write(CR1, modes, START);
        bench.write(DIER, 1 << 4, START);
        while bench.timer.lines() == [false; 3] {
            let event = bench.timer.next_event().unwrap();
            assert!(event <= after(expected), "CR1 {modes:#x}");
            bench.advance(event);
        }
        assert_eq!(bench.timer.passed, after(expected), "CR1 {modes:#x}");
        assert_eq!(bench.timer.lines(), [false, false, true]);
    }
}

#[test]
fn trgo_rises_where_reference_4_does_in_pwm_mode_2() {
    let mut bench = Bench::running();
    // 5226 clocks of 168 MHz are 31 107.1 ns.
    assert_eq!(bench.timer.next_trigger(), Some(after(31_108)));
    bench.advance(after(4 * HALF));
    assert_eq!(bench.triggers(), [31_108, 31_108 + 2 * HALF]);
    assert_eq!(bench.timer.next_trigger(), Some(after(31_108 + 4 * HALF)));
}

#[test]
fn trgo_rises_behind_the_peak_in_pwm_mode_1() {
    let mut bench = Bench::new();
    bench.write(CCMR2, 0x6868, START);
    bench.write(CR1, 0xA1, START);
    assert_eq!(bench.timer.next_trigger(), Some(after(HALF + 143)));
    bench.events.clear();
    bench.advance(after(2 * HALF));
    assert_eq!(bench.triggers(), [HALF + 143]);
}

#[test]
fn a_reference_that_never_switches_triggers_nothing() {
    for compare in [0, 5_250, 6_000] {
        let mut bench = Bench::new();
        bench.write(CCR4, compare, START);
        bench.write(EGR, 1, START);
        bench.events.clear();
        bench.write(CR1, 0xA1, START);
        assert_eq!(bench.timer.next_trigger(), None, "CCR4 = {compare}");
        bench.advance(after(6 * HALF));
        assert!(bench.triggers().is_empty(), "CCR4 = {compare}");
    }
}

#[test]
fn the_update_as_trgo_comes_twice_a_period() {
    let mut bench = Bench::running();
    bench.write(CR2, 0x20, START);
    assert_eq!(bench.timer.next_trigger(), Some(after(HALF)));
    bench.advance(after(3 * HALF));
    assert_eq!(bench.triggers(), [HALF, 2 * HALF, 3 * HALF]);
}

#[test]
fn duties_are_the_share_of_the_reference() {
    let mut bench = Bench::switched_on();
    bench.write(CCMR1, 0x5878, START);
    for (channel, value) in [(0, 1_050), (1, 9), (2, 6_000)] {
        bench.write(CCR1 + 4 * channel, value, START);
    }
    bench.events.clear();
    bench.advance(after(HALF));
    let (at, bridge) = bench.bridges()[0];
    assert_eq!((at, bridge.duties), (HALF, [0.8, 1.0, 1.0]));
}

#[test]
fn dead_time_follows_the_clock_division() {
    let mut bench = Bench::new();
    assert_eq!(bench.timer.dead_time_ns(), 1_000);
    bench.write(CR1, 0x1A0, START);
    assert_eq!(bench.timer.dead_time_ns(), 2_000);
    bench.write(CR1, 0x2A0, START);
    assert_eq!(bench.timer.dead_time_ns(), 4_000);
}

#[test]
fn a_break_switches_off_without_the_processor() {
    let mut bench = Bench::switched_on();
    bench.write(DIER, BREAK, START);
    bench.advance(after(12_345));
    bench.break_level(false, after(12_345));
    let (at, bridge) = bench.bridges()[0];
    assert_eq!((at, bridge.on), (12_345, false));
    assert_eq!(bench.timer.lines(), [true, false, false]);
    assert_eq!(bench.read(BDTR, after(12_345)) & 0x8000, 0);
}

#[test]
fn while_the_break_lasts_it_can_be_neither_overridden_nor_acknowledged() {
    let mut bench = Bench::switched_on();
    bench.break_level(false, after(100));
    bench.write(BDTR, 0x9C94, after(200));
    bench.write(SR, 0, after(300));
    assert_eq!(bench.read(BDTR, after(300)), 0x1C94);
    assert_eq!(bench.read(SR, after(300)) & BREAK, BREAK);
    bench.break_level(true, after(400));
    assert_eq!(bench.read(SR, after(400)) & BREAK, BREAK, "stays until it is cleared");
    bench.write(SR, 0, after(500));
    assert_eq!(bench.read(SR, after(500)) & BREAK, 0);
    bench.advance(after(6 * HALF));
    assert_eq!(bench.bridges().len(), 1, "off until MOE is set again");
    bench.write(BDTR, 0x9C94, after(6 * HALF));
    assert!(bench.bridges()[1].1.on);
}

#[test]
fn with_aoe_the_bridge_comes_back_at_the_next_update() {
    let mut bench = Bench::switched_on();
    bench.write(BDTR, 0xDC94, START);
    bench.break_level(false, after(1_000));
    bench.advance(after(HALF + 1_000));
    assert_eq!(bench.bridges().len(), 1, "not while the break lasts");
    bench.break_level(true, after(HALF + 2_000));
    assert_eq!(bench.timer.next_event(), Some(after(2 * HALF)));
    bench.advance(after(2 * HALF));
    let states: Vec<_> = bench.bridges().iter().map(|(at, bridge)| (*at, bridge.on)).collect();
    assert_eq!(states, [(1_000, false), (2 * HALF, true)]);
}

#[test]
fn a_break_that_is_not_enabled_is_ignored() {
    let mut bench = Bench::switched_on();
    bench.write(BDTR, 0x8C94, START);
    bench.break_level(false, after(1_000));
    assert!(bench.bridges().is_empty());
    assert_eq!(bench.read(SR, after(1_000)) & BREAK, 0);
}

#[test]
fn a_break_by_software_acts_as_the_pin_does() {
    let mut bench = Bench::switched_on();
    bench.write(EGR, BREAK, after(700));
    assert_eq!(bench.bridges().iter().map(|(at, bridge)| (*at, bridge.on)).collect::<Vec<_>>(), [(700, false)]);
    assert_eq!(bench.read(SR, after(700)) & BREAK, BREAK);
}

#[test]
fn lock_levels_protect_register_by_register() {
    // Level, register, value that changes a protected bit.
    for (level, offset, value) in [(1, CR2, 0x170), (2, CCER, 0x557), (3, CCMR1, 0x6860), (3, CCMR2, 0x7078)] {
        for tried in 1..=3 {
            let mut bench = Bench::new();
            bench.timer.protection = BreakAndDeadTime::new();
            bench.break_level(true, START);
            bench.write(BDTR, 0x1C94 | tried << 8, START);
            let before = bench.read(offset, START);
            let done = bench.try_write(offset, value, START);
            let protected = tried >= level;
            assert_eq!(done.is_err(), protected, "{offset:#x} at level {tried}: {done:?}");
            assert_eq!(
                bench.read(offset, START),
                if protected { before } else { value },
                "{offset:#x} at level {tried}"
            );
        }
    }
}

#[test]
fn a_bridge_that_would_burn_is_refused() {
    for (offset, value, what) in
        [(CCER, 0x155, "only some"), (CCER, 0x55D, "inverted"), (CCMR1, 0x6808, "frozen"), (CR1, 0xA0, "stands still")]
    {
        let mut bench = Bench::switched_on();
        let error = bench.try_write(offset, value, START).unwrap_err();
        assert!(error.contains(what), "{error}");
        assert!(!bench.bridges()[0].1.on, "{what}");
    }
}

#[test]
fn what_is_not_modelled_is_refused() {
    for (offset, value) in [
        (CR1, 0x01),
        (CR1, 0x3A0),
        (CR1, 0x1A8),
        (CR2, 0x10),
        (CR2, 1),
        (SMCR, 1),
        (DIER, 0x100),
        (CCMR1, 1),
        (CNT, 6_000),
    ] {
        assert!(Bench::new().try_write(offset, value, START).is_err(), "{offset:#x} = {value:#x}");
    }
}
