//! The loop clock against two crystals: a loop timer that runs at its own pace, t3 events that come at the ring's.

use servo::SettingsError;
use servo::clock::{LoopClock, LoopClockSettings};

const COUNTS: u16 = 10_500;
const COUNT_NANOSECONDS: f64 = 125_000.0 / 10_500.0;
const TARGET: u16 = 7_875;

/// When a trim that was returned in a tick takes effect.
#[derive(Clone, Copy)]
enum Effect {
    NextPeriod,
    ThisPeriod,
}

struct Simulation {
    clock: LoopClock,
    effect: Effect,
    ticks_per_cycle: u32,
    /// Real length of a count in nanoseconds.
    count: f64,
    /// Read errors of t3 lie within +- so many nanoseconds.
    jitter: f64,
    last_tick: f64,
    next_tick: f64,
    preloaded: i16,
    cycle: u64,
    random: u64,
    largest_trim: i16,
}

impl Simulation {
    fn new(ticks_per_cycle: u16, parts_per_million: f64, jitter: f64, start_phase: f64) -> Self {
        let settings = LoopClockSettings::new(COUNTS, ticks_per_cycle, TARGET).unwrap();
        Self {
            clock: LoopClock::new(settings),
            effect: Effect::NextPeriod,
            ticks_per_cycle: u32::from(ticks_per_cycle),
            count: COUNT_NANOSECONDS * (1.0 + parts_per_million * 1e-6),
            jitter,
            last_tick: -start_phase,
            next_tick: 125_000.0 - start_phase,
            preloaded: 0,
            cycle: 0,
            random: 7,
            largest_trim: 0,
        }
    }

    fn noise(&mut self) -> f64 {
        self.random = self.random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((self.random >> 11) as f64 / (1_u64 << 53) as f64 * 2.0 - 1.0) * self.jitter
    }

    fn run_ticks(&mut self, until: f64) {
        while self.next_tick <= until {
            self.last_tick = self.next_tick;
            let trim = self.clock.on_tick();
            self.largest_trim = self.largest_trim.max(trim.abs());
            let in_force = match self.effect {
                Effect::NextPeriod => core::mem::replace(&mut self.preloaded, trim),
                Effect::ThisPeriod => trim,
            };
            self.next_tick += f64::from(i32::from(COUNTS) + i32::from(in_force)) * self.count;
        }
    }

    /// One cycle; gives the true phase error at its t3 in microseconds.
    fn cycle(&mut self, seen: bool) -> f64 {
        // The time base moves with t3, so that the resolution of f64 lasts for any number of cycles.
        let length = 125_000.0 * f64::from(self.ticks_per_cycle);
        let read_at = if seen { self.noise() } else { 0.0 };
        self.cycle += 1;
        self.run_ticks(length + read_at.min(0.0));
        let exact_tick = self.last_tick;
        if seen {
            self.run_ticks(length + read_at);
            let phase = ((length + read_at - self.last_tick) / self.count) as u16;
            self.clock.on_t3(phase);
        }
        let mut error = (length - exact_tick) / self.count - f64::from(TARGET);
        if error > f64::from(COUNTS) / 2.0 {
            error -= f64::from(COUNTS);
        } else if error < -f64::from(COUNTS) / 2.0 {
            error += f64::from(COUNTS);
        }
        self.last_tick -= length;
        self.next_tick -= length;
        error * COUNT_NANOSECONDS / 1_000.0
    }

    fn worst(&mut self, cycles: usize) -> f64 {
        (0..cycles).map(|_| self.cycle(true).abs()).fold(0.0, f64::max)
    }
}

#[test]
fn the_ticks_stay_within_a_microsecond_for_a_million_cycles() {
    for parts_per_million in [100.0, -100.0] {
        let mut simulation = Simulation::new(4, parts_per_million, 1_000.0, 40_000.0);
        simulation.worst(200);
        let worst = simulation.worst(1_000_000);
        assert!(simulation.clock.is_locked());
        assert!((0.3..1.0).contains(&worst), "{worst} us at {parts_per_million} ppm with +-1 us of jitter");
    }
}

#[test]
fn every_cycle_time_from_500_us_to_65_ms_holds_a_microsecond_under_jitter() {
    for ticks in [4, 8, 16, 80, 520] {
        for parts_per_million in [100.0, -100.0, 0.3] {
            let mut simulation = Simulation::new(ticks, parts_per_million, 500.0, 90_000.0);
            simulation.worst(100);
            let worst = simulation.worst(4_000);
            assert!((0.05..0.6).contains(&worst), "{worst} us, {ticks} ticks a cycle, {parts_per_million} ppm");
        }
    }
}

#[test]
fn the_phase_is_right_all_through_a_long_cycle_not_only_at_its_end() {
    // 100.3 ppm is 1.053 counts a period: a constant whole trim would be 27 counts off after 520 periods.
    let mut simulation = Simulation::new(520, 100.3, 0.0, 31_250.0);
    simulation.worst(100);
    let length = 125_000.0 * 520.0;
    for tick in 0..520 {
        simulation.run_ticks(125_000.0 * f64::from(tick) + 62_500.0);
        let place = f64::from(tick) * 125_000.0 + 125_000.0 * (1.0 - f64::from(TARGET) / f64::from(COUNTS));
        let error = (simulation.last_tick - place + 62_500.0).rem_euclid(125_000.0) - 62_500.0;
        assert!(error.abs() < 40.0, "tick {tick} is {error} ns off");
    }
    simulation.run_ticks(length);
}

#[test]
fn lock_is_reached_within_100_ms_from_any_phase() {
    for (ticks, cycles) in [(4, 200), (16, 50), (80, 10)] {
        for start in 0..50 {
            for parts_per_million in [100.0, -100.0] {
                let mut simulation =
                    Simulation::new(ticks, parts_per_million, 500.0, 125_000.0 * f64::from(start) / 50.0);
                simulation.worst(cycles);
                assert!(
                    simulation.clock.is_locked(),
                    "not locked after {cycles} cycles of {ticks} ticks from {start}/50 at {parts_per_million} ppm"
                );
            }
        }
    }
}

#[test]
fn a_period_is_never_trimmed_by_more_than_one_percent() {
    let mut simulation = Simulation::new(4, 100.0, 1_000.0, 30_000.0);
    simulation.worst(1_000);
    assert_eq!(simulation.largest_trim, 105, "half a period away, the limit is reached, not passed");
}

#[test]
fn missing_t3_events_ride_through() {
    let mut simulation = Simulation::new(80, 100.0, 500.0, 0.0);
    simulation.worst(200);
    for _ in 0..200 {
        let lost = (0..2).map(|_| simulation.cycle(false).abs()).fold(0.0, f64::max);
        assert!(lost < 1.0, "{lost} us in lost cycles");
        let after = simulation.worst(7);
        assert!(after < 1.0, "{after} us after them");
        assert!(simulation.clock.is_locked());
    }
}

#[test]
fn a_single_wild_t3_is_not_believed_but_a_new_phase_is_taken_over() {
    let mut simulation = Simulation::new(16, 50.0, 200.0, 0.0);
    simulation.worst(200);
    simulation.clock.on_t3(TARGET - 3_000);
    let after = simulation.worst(20);
    assert!(after < 2.0, "{after} us after one wild event");
    // The master moves t3 by 40 us.
    simulation.last_tick -= 40_000.0;
    simulation.next_tick -= 40_000.0;
    simulation.worst(60);
    let settled = simulation.worst(100);
    assert!(settled < 0.5 && simulation.clock.is_locked(), "{settled} us after the master moved t3");
}

#[test]
fn the_lock_is_given_up_while_the_phase_is_off_and_comes_back() {
    let mut simulation = Simulation::new(16, 50.0, 200.0, 0.0);
    simulation.worst(200);
    // The master moves t3 by 5 us: believed, and taken out over several events.
    simulation.last_tick -= 5_000.0;
    simulation.next_tick -= 5_000.0;
    let locked: Vec<bool> = (0..100)
        .map(|_| {
            simulation.cycle(true);
            simulation.clock.is_locked()
        })
        .collect();
    assert!(locked[..3].iter().all(|&locked| locked), "three events are no verdict");
    assert!(locked[..20].iter().any(|&locked| !locked), "the lock is given up");
    assert!(locked[60..].iter().all(|&locked| locked), "and comes back");
}

#[test]
fn after_a_long_gap_the_first_t3_is_believed() {
    let mut simulation = Simulation::new(16, 100.0, 200.0, 0.0);
    simulation.worst(200);
    for _ in 0..50 {
        simulation.cycle(false);
    }
    simulation.last_tick -= 40_000.0;
    simulation.next_tick -= 40_000.0;
    // 40 us at 1.25 us a period are 32 periods: the two cycles and a half after the event.
    simulation.worst(3);
    let worst = simulation.worst(100);
    assert!((0.05..1.0).contains(&worst), "{worst} us");
}

#[test]
fn a_trim_that_takes_effect_at_once_locks_as_well() {
    let mut simulation = Simulation::new(4, 100.0, 500.0, 50_000.0);
    simulation.effect = Effect::ThisPeriod;
    simulation.worst(200);
    let worst = simulation.worst(10_000);
    assert!((0.05..1.0).contains(&worst), "{worst} us");
}

#[test]
fn impossible_timers_are_refused() {
    assert_eq!(LoopClockSettings::new(100, 80, 0), Err(SettingsError::LoopTimerCounts { actual: 100 }));
    assert_eq!(LoopClockSettings::new(40_000, 80, 0), Err(SettingsError::LoopTimerCounts { actual: 40_000 }));
    assert_eq!(LoopClockSettings::new(10_500, 3, 0), Err(SettingsError::TicksPerCycle { actual: 3 }));
}
