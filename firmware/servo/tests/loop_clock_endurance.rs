//! The loop clock for ten million cycles between two crystals that warm up, with jitter and lost events: pure loop clock, no loops.

use servo::clock::{LoopClock, LoopClockSettings};

const COUNTS: u16 = 10_500;
const TARGET: u16 = 7_875;
const PERIOD: f64 = 125_000.0;
const COUNT: f64 = PERIOD / COUNTS as f64;
const CYCLES: u64 = 10_000_000;

/// How the crystals of drive and ring differ, over time.
#[derive(Clone, Copy)]
struct Crystals {
    /// Difference of the two, in ppm.
    difference: f64,
    /// What the drive's crystal still gains while it warms up, in ppm, with a time constant of 300 s.
    warming: f64,
    /// Half of what the ring's crystal swings by with the air conditioning, in ppm, once in 600 s.
    swing: f64,
}

const CALM: Crystals = Crystals { difference: 0.0, warming: 0.0, swing: 0.0 };

impl Crystals {
    fn parts_per_million(&self, seconds: f64) -> f64 {
        self.difference
            + self.warming * (1.0 - (-seconds / 300.0).exp())
            + self.swing * (seconds * std::f64::consts::TAU / 600.0).sin()
    }
}

/// Loop timer and ring. Times in ns since the last t3.
struct Simulation {
    clock: LoopClock,
    crystals: Crystals,
    ticks_per_cycle: u32,
    /// Largest error of an event in ns.
    jitter: f64,
    /// One event of so many is lost, sometimes two in a row.
    loss: u64,
    last_tick: f64,
    next_tick: f64,
    preloaded: i16,
    ticks: u64,
    cycles: u64,
    random: u64,
}

impl Simulation {
    fn new(ticks_per_cycle: u16, crystals: Crystals, jitter: f64, start: f64) -> Self {
        let settings = LoopClockSettings::new(COUNTS, ticks_per_cycle, TARGET).unwrap();
        Self {
            clock: LoopClock::new(settings),
            crystals,
            ticks_per_cycle: u32::from(ticks_per_cycle),
            jitter,
            loss: u64::MAX,
            last_tick: -start,
            next_tick: PERIOD - start,
            preloaded: 0,
            ticks: 0,
            cycles: 0,
            random: start.to_bits() | 1,
        }
    }

    fn losing(self, loss: u64) -> Self {
        Self { loss, ..self }
    }

    fn random(&mut self) -> u64 {
        self.random = self.random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        self.random >> 11
    }

    fn run_ticks(&mut self, until: f64, count: f64) {
        while self.next_tick <= until {
            self.last_tick = self.next_tick;
            let in_force = core::mem::replace(&mut self.preloaded, self.clock.on_tick());
            self.next_tick += f64::from(i32::from(COUNTS) + i32::from(in_force)) * count;
            self.ticks += 1;
        }
    }

    /// One cycle of the ring; gives how far the last tick before its t3 is from its place, in us.
    fn cycle(&mut self) -> f64 {
        let length = PERIOD * f64::from(self.ticks_per_cycle);
        let seconds = self.cycles as f64 * length * 1e-9;
        let count = COUNT * (1.0 + self.crystals.parts_per_million(seconds) * 1e-6);
        self.cycles += 1;
        let seen = self.loss == u64::MAX || self.random() % self.loss > 1;
        let error = (self.random() as f64 / (1_u64 << 53) as f64 * 2.0 - 1.0) * self.jitter;
        // A tick lies 31 us from t3: an event of some jitter never sees another one.
        self.run_ticks(length, count);
        if seen {
            self.clock.on_t3(((length + error - self.last_tick) / count) as u16);
        }
        let place = (length - self.last_tick) / count - f64::from(TARGET);
        let half = f64::from(COUNTS) / 2.0;
        let place = if place > half {
            place - 2.0 * half
        } else if place < -half {
            place + 2.0 * half
        } else {
            place
        };
        self.last_tick -= length;
        self.next_tick -= length;
        place * COUNT / 1_000.0
    }

    fn settle(&mut self, cycles: u32) {
        for _ in 0..cycles {
            self.cycle();
        }
    }

    /// Until the lock; gives milliseconds since the first event.
    fn lock(&mut self) -> f64 {
        while !self.clock.is_locked() {
            self.cycle();
            assert!(self.cycles < 1_000, "no lock");
        }
        (self.cycles - 1) as f64 * f64::from(self.ticks_per_cycle) * PERIOD * 1e-6
    }
}

/// Ten million cycles with everything that a ring in order can do to the clock.
fn holds_for_ten_million_cycles(ticks_per_cycle: u16, peak: std::ops::Range<f64>) {
    for difference in [100.0, -100.0] {
        let crystals = Crystals { difference, warming: -30.0, swing: 10.0 };
        let mut simulation = Simulation::new(ticks_per_cycle, crystals, 1_000.0, 40_000.0).losing(1_000);
        simulation.lock();
        // The filter's memory of the beginning fades within 32 events.
        simulation.settle(40);
        let (ticks, cycles) = (simulation.ticks, simulation.cycles);
        let mut worst = 0.0_f64;
        for _ in 0..CYCLES {
            worst = worst.max(simulation.cycle().abs());
        }
        println!("{ticks_per_cycle} ticks a cycle, {difference} ppm: peak phase error {worst:.3} us");
        assert!(simulation.clock.is_locked());
        assert!(peak.contains(&worst), "{worst} us");
        let slips =
            (simulation.ticks - ticks) as i64 - (simulation.cycles - cycles) as i64 * i64::from(ticks_per_cycle);
        assert_eq!(slips, 0, "ticks more or less than cycles have");
    }
}

#[test]
fn at_500_us_the_phase_holds_a_microsecond_for_ten_million_cycles_without_a_slip() {
    holds_for_ten_million_cycles(4, 0.6..1.0);
}

#[test]
fn at_2_ms_the_phase_holds_a_microsecond_for_ten_million_cycles_without_a_slip() {
    holds_for_ten_million_cycles(16, 0.6..1.0);
}

#[test]
fn at_10_ms_the_phase_holds_a_microsecond_for_ten_million_cycles_without_a_slip() {
    holds_for_ten_million_cycles(80, 0.6..1.0);
}

#[test]
fn lock_comes_within_100_ms_of_the_first_event_at_every_cycle_time() {
    for (ticks, least) in [(4, 5.0), (16, 10.0), (80, 50.0)] {
        let mut longest = 0.0_f64;
        for start in 0..100 {
            for difference in [100.0, -100.0] {
                let crystals = Crystals { difference, ..CALM };
                longest =
                    longest.max(Simulation::new(ticks, crystals, 1_000.0, f64::from(start) * PERIOD / 100.0).lock());
            }
        }
        println!("{ticks} ticks a cycle: locked after {longest} ms at most");
        assert!((least..100.0).contains(&longest), "{longest} ms");
    }
}

#[test]
fn every_one_of_a_hundred_random_starts_ends_at_the_same_phase() {
    for ticks in [4, 16, 80] {
        let mut random = 12_345_u64;
        let mut places = Vec::new();
        for _ in 0..100 {
            random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            let start = (random >> 11) as f64 / (1_u64 << 53) as f64 * PERIOD;
            let crystals = Crystals { difference: (random >> 20) as f64 % 200.0 - 100.0, ..CALM };
            let mut simulation = Simulation::new(ticks, crystals, 1_000.0, start);
            simulation.lock();
            simulation.settle(200);
            places.push((0..200).map(|_| simulation.cycle()).sum::<f64>() / 200.0);
        }
        let highest = places.iter().copied().fold(f64::MIN, f64::max);
        let lowest = places.iter().copied().fold(f64::MAX, f64::min);
        println!("{ticks} ticks a cycle: mean phases from {lowest:.3} to {highest:.3} us");
        assert!((0.1..0.3).contains(&(highest - lowest)), "{lowest} to {highest} us");
        assert!(lowest > -0.2 && highest < 0.2, "{lowest} to {highest} us");
    }
}

#[test]
fn a_warming_crystal_is_followed_without_a_lag_that_counts() {
    let mean_place = |crystals: Crystals| {
        let mut simulation = Simulation::new(80, crystals, 0.0, 0.0);
        simulation.lock();
        simulation.settle(2_000);
        (0..2_000).map(|_| simulation.cycle()).sum::<f64>() / 2_000.0
    };
    // 30 ppm in 300 s are 0.1 ppm a second at first.
    let lag = mean_place(Crystals { warming: 30.0, ..CALM }) - mean_place(CALM);
    println!("lag behind 0.1 ppm a second: {:.1} ns", lag * 1e3);
    assert!((0.001..0.01).contains(&lag.abs()), "{lag} us");
}

#[test]
fn a_quarter_of_all_events_lost_costs_microseconds_but_no_slip_and_no_lock() {
    let mut simulation = Simulation::new(16, Crystals { difference: 60.0, ..CALM }, 1_000.0, 0.0);
    simulation.lock();
    simulation.settle(100);
    simulation.loss = 8;
    let (ticks, cycles) = (simulation.ticks, simulation.cycles);
    let mut worst = 0.0_f64;
    for _ in 0..100_000 {
        worst = worst.max(simulation.cycle().abs());
        assert!(simulation.clock.is_locked());
    }
    println!("peak phase error with three of four events: {worst:.3} us");
    assert!((1.0..6.0).contains(&worst), "{worst} us");
    assert_eq!(simulation.ticks - ticks, (simulation.cycles - cycles) * 16);
}
