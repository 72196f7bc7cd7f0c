//! The loop clock, which counts in 32 bits and adds rates up, against its plain definition in 64 bits, to the bit.

use servo::clock::{LoopClock, LoopClockSettings};

/// The definition: trims, what is carried, and sums of their own, where nothing can overflow.
struct Wide {
    ticks_per_cycle: i64,
    counts: i64,
    target: i64,
    running: i64,
    next: i64,
    applied: i64,
    rate: i64,
    drift_rate: i64,
    budget: i64,
    residue: i64,
    phase: i64,
    drift: i64,
    ticks: i64,
    cycles: i64,
    events: i64,
    good: u32,
    bad: u32,
    outliers: u32,
    locked: bool,
}

impl Wide {
    fn new(counts: u16, ticks_per_cycle: u16, target: u16) -> Self {
        Self {
            ticks_per_cycle: ticks_per_cycle.into(),
            counts: counts.into(),
            target: target.into(),
            running: 0,
            next: 0,
            applied: 0,
            rate: 0,
            drift_rate: 0,
            budget: 0,
            residue: 0,
            phase: 0,
            drift: 0,
            ticks: 0,
            cycles: 0,
            events: 0,
            good: 0,
            bad: 0,
            outliers: 0,
            locked: false,
        }
    }

    fn wrapped(&self, fine: i64) -> i64 {
        let period = self.counts << 16;
        (0..2).fold(fine, |fine, _| match fine {
            late if late > period / 2 => late - period,
            early if early < -period / 2 => early + period,
            near => near,
        })
    }

    fn on_tick(&mut self) -> i16 {
        let largest = self.counts / 100;
        self.applied += self.running;
        self.running = self.next;
        self.residue += if self.budget > 0 { self.rate } else { self.drift_rate };
        self.budget = (self.budget - 1).max(0);
        self.next = ((self.residue + (1 << 15)) >> 16).clamp(-largest, largest);
        self.residue -= self.next << 16;
        self.ticks += 1;
        if self.ticks >= self.ticks_per_cycle {
            self.ticks = 0;
            self.cycles += 1;
        }
        self.next as i16
    }

    fn on_t3(&mut self, phase: u16) {
        let measured = self.wrapped((i64::from(phase) - self.target) << 16);
        if self.events == 0 || self.cycles > 4 {
            (self.phase, self.events) = (measured, 1);
        } else {
            self.estimate(measured);
        }
        if measured.abs() <= self.counts << 16 >> 6 {
            (self.good, self.bad) = (self.good + 1, 0);
        } else {
            (self.good, self.bad) = (0, self.bad + 1);
        }
        self.locked = self.good >= 4 || (self.locked && self.bad < 4);
        (self.applied, self.cycles, self.ticks) = (0, 0, self.ticks_per_cycle / 2);
        let limited = |rate: i64| rate.clamp(-(self.counts / 100) << 16, (self.counts / 100) << 16);
        let share = |ticks: i64| (1_i64 << 32) / ticks;
        let wanted = self.phase + self.drift - ((self.running + self.next) << 16) - self.residue;
        (self.rate, self.drift_rate) = (
            limited((wanted * share(self.ticks_per_cycle - 2)) >> 32),
            limited((self.drift * share(self.ticks_per_cycle)) >> 32),
        );
        self.budget = self.ticks_per_cycle - 2;
    }

    fn estimate(&mut self, measured: i64) {
        let grown = self.drift * self.cycles.max(1) - (self.applied << 16);
        let predicted = self.wrapped(self.phase + grown);
        let deviation = self.wrapped(measured - predicted);
        if self.locked && deviation.abs() > self.counts << 16 >> 4 {
            self.outliers += 1;
            self.phase = predicted;
            if self.outliers >= 3 {
                (self.phase, self.events, self.outliers, self.locked) = (measured, 1, 0, false);
            }
            return;
        }
        self.outliers = 0;
        let n = self.events + 1;
        let (of_phase, of_drift) = if n <= 31 {
            ((((2 * (2 * n - 1)) << 16) / (n * (n + 1))).min(65_535), ((6 << 16) / (n * (n + 1))).min(65_535))
        } else {
            (8_192, 256)
        };
        self.events = n.min(31);
        self.phase = predicted + ((deviation * of_phase) >> 16);
        let largest = ((self.counts * self.ticks_per_cycle) << 16) / 2_000;
        self.drift = (self.drift + ((deviation * of_drift) >> 16)).clamp(-largest, largest);
    }
}

struct Random(u64);

impl Random {
    fn below(&mut self, end: u64) -> u64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) % end
    }
}

/// Both at once between two crystals, with jitter, lost events, jumps of the ring and events that belong to nothing.
fn compare(counts: u16, ticks_per_cycle: u16, random: &mut Random) -> (usize, usize) {
    let target = random.below(u64::from(counts)) as u16;
    let settings = LoopClockSettings::new(counts, ticks_per_cycle, target).unwrap();
    let (mut clock, mut wide) = (LoopClock::new(settings), Wide::new(counts, ticks_per_cycle, target));
    let period = f64::from(counts);
    let crystals = 1.0 + (random.below(1_200) as f64 - 600.0) * 1e-6;
    let jitter = period / [2_000.0, 100.0, 20.0][random.below(3) as usize];
    // Counts since the last tick, at the last t3.
    let mut last = random.below(u64::from(counts)) as f64;
    let (mut preloaded, mut lengths) = (0, Vec::new());
    let (mut locked, mut unlocked) = (0, 0);
    for cycle in 0..400 {
        let quiet = (60..120).contains(&cycle) || cycle > 330;
        let lost = if quiet { 0 } else { random.below(12).saturating_sub(9) * random.below(3) };
        let jump = if quiet || random.below(40) != 0 { 0.0 } else { random.below(u64::from(counts)) as f64 };
        let noise = (random.below(2_000) as f64 / 1_000.0 - 1.0) * if quiet { period / 2_000.0 } else { jitter };
        let mut left = period * f64::from(ticks_per_cycle) * (lost + 1) as f64 * crystals + last + jump + noise;
        lengths.clear();
        while left >= period + f64::from(preloaded) {
            left -= period + f64::from(preloaded);
            let (trim, expected) = (clock.on_tick(), wide.on_tick());
            assert_eq!(trim, expected, "{counts} counts, {ticks_per_cycle} ticks, cycle {cycle}");
            preloaded = trim;
            lengths.push(trim);
        }
        last = left - noise;
        let phase = left.max(0.0) as u16;
        clock.on_t3(phase);
        wide.on_t3(phase);
        let state = (clock.phase_error().into(), clock.is_locked());
        assert_eq!(state, (wide.phase >> 16, wide.locked), "{counts} counts, {ticks_per_cycle} ticks, cycle {cycle}");
        if clock.is_locked() {
            locked += 1;
        } else {
            unlocked += 1;
        }
    }
    (locked, unlocked)
}

#[test]
fn the_clock_does_in_32_bits_to_the_bit_what_it_does_in_64() {
    let mut random = Random(1);
    let (mut locked, mut unlocked) = (0, 0);
    for counts in [200, 201, 1_000, 10_500, 20_001, 32_766, 32_767] {
        for ticks_per_cycle in [4, 5, 8, 16, 80, 519, 520] {
            for _ in 0..6 {
                let (more_locked, more_unlocked) = compare(counts, ticks_per_cycle, &mut random);
                locked += more_locked;
                unlocked += more_unlocked;
            }
        }
    }
    // Both lives of the clock are in it.
    assert!(locked > 20_000 && unlocked > 20_000, "{locked}, {unlocked}");
}
