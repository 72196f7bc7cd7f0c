//! The loop timer on the ring's clock: every tick at a fixed phase to t3.
//!
//! At each t3 event the phase of the loop timer is read. A filter estimates phase error and drift (least squares over all events
//! since the start, later over the last sixteen or so), and the trims of the next periods take out the phase error within one cycle and the drift
//! for ever. The filter knows the trims that were in force, so a slew limit or a missing t3 does not mislead it.
//!
//! A trim is a whole number of timer counts per period; the fraction is carried from period to period. One count too much in each of
//! the 520 periods of a 65 ms cycle would be 6 us; carried, it stays below one count.

use crate::{SettingsError, units::limited};

/// The loop timer and the cycle, scaled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct LoopClockSettings {
    ticks_per_cycle: u16,
    counts: i64,
    target_phase: i64,
    /// In counts.
    largest_trim: i64,
    /// Per cycle, in 2^-16 count.
    largest_drift: i64,
    /// 2^32 / ticks.
    per_cycle: i64,
    /// 2^32 / (ticks - 2).
    per_budget: i64,
}

/// In 2^-16 count.
const FINE_BITS: u32 = 16;

impl LoopClockSettings {
    /// * `timer_counts`: counts in an untrimmed loop period (10 500 for 125 us at 84 MHz), 200 ..= 32 767.
    /// * `ticks_per_cycle`: loop ticks between two t3 events, 4 ..= 520.
    /// * `target_phase`: counts from the last tick to t3, below `timer_counts`. Keep the t3 event clear of the tick: an interrupt that has
    ///   to wait for the other reads a late phase. Three quarters of a period are good: the first tick with the new command comes 31 us after t3.
    ///
    /// # Errors
    /// [`SettingsError::LoopTimerCounts`], [`SettingsError::TicksPerCycle`].
    pub fn new(timer_counts: u16, ticks_per_cycle: u16, target_phase: u16) -> Result<Self, SettingsError> {
        let counts = i64::from(timer_counts);
        let ticks = i64::from(ticks_per_cycle);
        if !(200..=32_767).contains(&timer_counts) {
            return Err(SettingsError::LoopTimerCounts { actual: timer_counts });
        }
        let bad_ticks = SettingsError::TicksPerCycle { actual: ticks_per_cycle };
        if !(4..=520).contains(&ticks_per_cycle) {
            return Err(bad_ticks);
        }
        Ok(Self {
            ticks_per_cycle,
            counts,
            target_phase: i64::from(target_phase).min(counts),
            largest_trim: counts / 100,
            largest_drift: (counts.saturating_mul(ticks) << FINE_BITS) / LARGEST_DRIFT_DIVISOR,
            per_cycle: (1_i64 << 32).checked_div(ticks).ok_or(bad_ticks)?,
            per_budget: (1_i64 << 32).checked_div(ticks.saturating_sub(PERIODS_UNDER_WAY)).ok_or(bad_ticks)?,
        })
    }

    /// The distance to the nearest tick, in +- half a period; for distances of less than two periods.
    #[inline]
    fn wrapped(&self, fine: i64) -> i64 {
        let period = self.counts << FINE_BITS;
        let half = period >> 1;
        let mut wrapped = fine;
        for _ in 0..2 {
            if wrapped > half {
                wrapped = wrapped.wrapping_sub(period);
            } else if wrapped < half.wrapping_neg() {
                wrapped = wrapped.wrapping_add(period);
            }
        }
        wrapped
    }

    #[inline]
    fn limited(&self, rate: i64) -> i64 {
        limited(rate, self.largest_trim << FINE_BITS)
    }
}

/// Drift is estimated up to 1/2000: 500 ppm.
const LARGEST_DRIFT_DIVISOR: i64 = 2_000;
/// At t3, the trims of the running period and of the one after it are already given out.
const PERIODS_UNDER_WAY: i64 = 2;
/// Phase error within 1/64 of a period (2 us) counts as good.
const GOOD_SHIFT: u32 = 6;
/// So many good or bad events in a row change the lock.
const LOCK_EVENTS: u8 = 4;
/// A deviation from the prediction of more than 1/16 of a period (8 us) is not believed ...
const OUTLIER_SHIFT: u32 = 4;
/// ... unless it comes so many times in a row.
const OUTLIERS: u8 = 3;

/// After more cycles than this without t3 the phase is no longer predicted but measured anew.
const LONGEST_GAP: u16 = 4;

/// Gains of the filter on the n-th event, n = 2 ..= 31: 2(2n-1)/(n(n+1)) and 6/(n(n+1)), the least-squares line through all events so far, in 2^-16.
const GROWING: [(u16, u16); 30] = growing_gains();
/// Gains from then on: 1/8 and 1/256, in 2^-16. Passes 28 % of the jitter of the t3 reading (standard deviation).
const STEADY: (u16, u16) = (8_192, 256);

#[allow(clippy::arithmetic_side_effects, clippy::indexing_slicing, reason = "evaluated by the compiler")]
const fn growing_gains() -> [(u16, u16); 30] {
    let mut gains = [(0, 0); 30];
    let mut n: u64 = 2;
    while n <= 31 {
        let divisor = n * (n + 1);
        let alpha = ((2 * (2 * n - 1)) << 16) / divisor;
        let beta = (6 << 16) / divisor;
        gains[n as usize - 2] =
            (if alpha > 65_535 { 65_535 } else { alpha as u16 }, if beta > 65_535 { 65_535 } else { beta as u16 });
        n += 1;
    }
    gains
}

/// Trims the loop timer so that t3 comes at the target phase.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct LoopClock {
    settings: LoopClockSettings,
    /// Trim of the period that runs now, and of the one after it.
    running: i16,
    next: i16,
    /// Trims of the periods that ended since the last t3, in counts.
    applied: i64,
    /// Trim per period for the periods of the budget, and after it, in 2^-16 count.
    rate: i64,
    drift_rate: i64,
    budget: u16,
    residue: i64,
    /// Estimates at the last t3: phase error, and its growth in a cycle without trim, in 2^-16 count.
    phase: i64,
    drift: i64,
    ticks: u16,
    cycles: u16,
    /// Events seen, up to the length of the table of gains.
    events: u8,
    good: u8,
    bad: u8,
    outliers: u8,
    locked: bool,
}

impl LoopClock {
    /// Begins without knowledge of phase and drift, trim zero.
    #[must_use]
    pub const fn new(settings: LoopClockSettings) -> Self {
        Self {
            settings,
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

    /// To be called in every tick of the loop timer; gives the trim in counts to be set now, which is to take effect with the *next*
    /// period (a preloaded reload register). Positive lengthens. At most 1 % of the period.
    #[inline]
    pub fn on_tick(&mut self) -> i16 {
        self.applied = self.applied.wrapping_add(i64::from(self.running));
        self.running = self.next;
        let rate = if self.budget > 0 {
            self.budget = self.budget.saturating_sub(1);
            self.rate
        } else {
            self.drift_rate
        };
        self.residue = self.residue.wrapping_add(rate);
        let rounded = self.residue.wrapping_add(1 << (FINE_BITS - 1)) >> FINE_BITS;
        let trim = limited(rounded, self.settings.largest_trim);
        self.residue = self.residue.wrapping_sub(trim << FINE_BITS);
        // Within 1 % of at most 32 767 counts.
        self.next = trim as i16;

        self.ticks = self.ticks.wrapping_add(1);
        if self.ticks >= self.settings.ticks_per_cycle {
            self.ticks = 0;
            self.cycles = self.cycles.saturating_add(1);
        }
        self.next
    }

    /// To be called at every t3 event with the counts since the last tick.
    #[inline]
    pub fn on_t3(&mut self, phase: u16) {
        let settings = self.settings;
        let measured = settings.wrapped(i64::from(phase).wrapping_sub(settings.target_phase) << FINE_BITS);
        if self.events == 0 {
            self.phase = measured;
            self.events = 1;
        } else {
            self.estimate(measured);
        }
        self.judge_lock(measured);

        self.applied = 0;
        self.cycles = 0;
        // Counting of cycles starts half a cycle on, so that a tick more or less before the next t3 makes no difference.
        self.ticks = settings.ticks_per_cycle >> 1;
        let under_way = i64::from(self.running).wrapping_add(i64::from(self.next)) << FINE_BITS;
        let wanted = self.phase.wrapping_add(self.drift).wrapping_sub(under_way).wrapping_sub(self.residue);
        self.rate = settings.limited(wanted.wrapping_mul(settings.per_budget) >> 32);
        self.drift_rate = settings.limited(self.drift.wrapping_mul(settings.per_cycle) >> 32);
        self.budget = settings.ticks_per_cycle.saturating_sub(PERIODS_UNDER_WAY as u16);
    }

    /// The ticks have been within 2 us (1/64 of a period) of their place for four t3 events, and not off it for four since.
    #[must_use]
    pub const fn is_locked(&self) -> bool {
        self.locked
    }

    /// Estimated phase error at the last t3 in counts; positive: the ticks come early.
    #[must_use]
    pub const fn phase_error(&self) -> i32 {
        (self.phase >> FINE_BITS) as i32
    }

    #[inline]
    fn estimate(&mut self, measured: i64) {
        let settings = &self.settings;
        if self.cycles > LONGEST_GAP {
            self.phase = measured;
            self.events = 1;
            return;
        }
        let cycles = i64::from(self.cycles.max(1));
        let grown = self.drift.wrapping_mul(cycles).wrapping_sub(self.applied << FINE_BITS);
        let predicted = settings.wrapped(self.phase.wrapping_add(grown));
        let deviation = settings.wrapped(measured.wrapping_sub(predicted));
        if self.locked && deviation.abs() > settings.counts << FINE_BITS >> OUTLIER_SHIFT {
            self.outliers = self.outliers.saturating_add(1);
            if self.outliers >= OUTLIERS {
                self.phase = measured;
                self.events = 1;
                self.outliers = 0;
                self.locked = false;
            } else {
                self.phase = predicted;
            }
            return;
        }
        self.outliers = 0;
        let place = usize::from(self.events.saturating_sub(1));
        let (of_phase, of_drift) = GROWING.get(place).copied().unwrap_or(STEADY);
        if place < GROWING.len() {
            self.events = self.events.saturating_add(1);
        }
        self.phase = predicted.wrapping_add(deviation.wrapping_mul(i64::from(of_phase)) >> 16);
        let drift = self.drift.wrapping_add(deviation.wrapping_mul(i64::from(of_drift)) >> 16);
        self.drift = limited(drift, settings.largest_drift);
    }

    #[inline]
    fn judge_lock(&mut self, measured: i64) {
        if measured.abs() <= self.settings.counts << FINE_BITS >> GOOD_SHIFT {
            self.good = self.good.saturating_add(1);
            self.bad = 0;
        } else {
            self.bad = self.bad.saturating_add(1);
            self.good = 0;
        }
        if self.good >= LOCK_EVENTS {
            self.locked = true;
        } else if self.bad >= LOCK_EVENTS {
            self.locked = false;
        }
    }
}
