//! The loop timer on the ring's clock: every tick at a fixed phase to t3.
//!
//! At each t3 event the phase of the loop timer is read. A filter estimates phase error and drift (least squares over all events
//! since the start, later over the last sixteen or so), and the trims of the next periods take out the phase error within one cycle and the drift
//! for ever. The filter knows the trims that were in force, so a slew limit or a missing t3 does not mislead it.
//!
//! A trim is a whole number of timer counts per period; the fraction is carried from period to period. One count too much in each of
//! the 520 periods of a 65 ms cycle would be 6 us; carried, it stays below one count.
//!
//! Everything is in 32 bits: phases lie within half a period, 2^30 in 2^-16 count, and sums are taken modulo 2^32, which is more than a
//! period and thus more than two phases can differ.

use crate::error::SettingsError;

/// The loop timer and the cycle, scaled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct LoopClockSettings {
    ticks_per_cycle: u16,
    /// Ticks of a cycle whose trims are still free at t3.
    budget: u16,
    counts: i32,
    target_phase: i32,
    /// Per period, in 2^-16 count.
    largest_rate: i32,
    /// Per cycle, in 2^-16 count.
    largest_drift: i32,
    /// 2^32 / ticks.
    per_cycle: u32,
    /// 2^32 / (ticks - 2).
    per_budget: u32,
}

/// In 2^-16 count.
const FINE_BITS: u32 = 16;
/// Half a count.
const HALF_COUNT: i32 = 1 << (FINE_BITS - 1);
/// Whole counts of a sum.
const WHOLE_COUNTS: i32 = -1 << FINE_BITS;

impl LoopClockSettings {
    /// * `timer_counts`: counts in an untrimmed loop period (10 500 for 125 us at 84 MHz), 200 ..= 32 767.
    /// * `ticks_per_cycle`: loop ticks between two t3 events, 4 ..= 520.
    /// * `target_phase`: counts from the last tick to t3, below `timer_counts`. Keep the t3 event clear of the tick: an interrupt that has
    ///   to wait for the other reads a late phase. Three quarters of a period are good: the first tick with the new command comes 31 us after t3.
    ///
    /// # Errors
    /// [`SettingsError::LoopTimerCounts`], [`SettingsError::TicksPerCycle`].
    pub fn new(timer_counts: u16, ticks_per_cycle: u16, target_phase: u16) -> Result<Self, SettingsError> {
        let counts = i32::from(timer_counts);
        if !(200..=32_767).contains(&timer_counts) {
            return Err(SettingsError::LoopTimerCounts { actual: timer_counts });
        }
        let bad_ticks = SettingsError::TicksPerCycle { actual: ticks_per_cycle };
        if !(4..=520).contains(&ticks_per_cycle) {
            return Err(bad_ticks);
        }
        let budget = ticks_per_cycle.saturating_sub(PERIODS_UNDER_WAY);
        // Not for a divisor above 1, and both are.
        let share = |ticks: u16| (1_u64 << 32).checked_div(ticks.into()).and_then(|share| u32::try_from(share).ok());
        let cycle = i64::from(counts).saturating_mul(ticks_per_cycle.into());
        Ok(Self {
            ticks_per_cycle,
            budget,
            counts,
            target_phase: i32::from(target_phase).min(counts),
            largest_rate: (counts / 100) << FINE_BITS,
            // At most 26 % of a period.
            largest_drift: ((cycle << FINE_BITS) / LARGEST_DRIFT_DIVISOR) as i32,
            per_cycle: share(ticks_per_cycle).ok_or(bad_ticks)?,
            per_budget: share(budget).ok_or(bad_ticks)?,
        })
    }

    /// A period in 2^-16 count.
    #[inline]
    const fn period(&self) -> i32 {
        self.counts << FINE_BITS
    }
}

/// The distance to the nearest tick, in +- half a period; for distances of less than two periods.
#[inline]
fn wrapped(distance: i32, period: i32) -> i32 {
    let half = period >> 1;
    // Nearly always it is there already.
    if distance.wrapping_add(half).cast_unsigned() <= period.cast_unsigned() {
        return distance;
    }
    let mut wrapped = distance;
    for _ in 0..2 {
        if wrapped > half {
            wrapped = wrapped.wrapping_sub(period);
        } else if wrapped < half.wrapping_neg() {
            wrapped = wrapped.wrapping_add(period);
        }
    }
    wrapped
}

/// `value` limited to `-limit ..= limit`. Unlike `clamp` it has no panic for a negative limit.
#[inline]
fn limited(value: i32, limit: i32) -> i32 {
    value.min(limit).max(limit.wrapping_neg())
}

/// `value` times `fraction` in 2^-32, towards minus infinity.
#[inline]
const fn times(value: i32, fraction: u32) -> i32 {
    // The fraction is below 1: it fits.
    ((value as i64).wrapping_mul(fraction as i64) >> 32) as i32
}

/// `value` times `gain` in 2^-16, towards minus infinity.
#[inline]
const fn amplified(value: i32, gain: u16) -> i32 {
    // The gain is below 1: it fits.
    ((value as i64).wrapping_mul(gain as i64) >> 16) as i32
}

/// Drift is estimated up to 1/2000: 500 ppm.
const LARGEST_DRIFT_DIVISOR: i64 = 2_000;
/// At t3, the trims of the running period and of the one after it are already given out.
const PERIODS_UNDER_WAY: u16 = 2;
/// Phase error within 1/64 of a period (2 us) counts as good.
const GOOD_SHIFT: u32 = 6;
/// So many good or bad events in a row change the lock.
const LOCK_EVENTS: u8 = 4;
/// A deviation from the prediction of more than 1/16 of a period (8 us) is not believed ...
const OUTLIER_SHIFT: u32 = 4;
/// ... unless it comes so many times in a row.
const OUTLIERS: u8 = 3;

/// After more cycles than this without t3 the phase is no longer predicted but measured anew.
const LONGEST_GAP: u8 = 4;

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
    /// Sum of all rates since the start in 2^-16 count, rounded to the nearest by the half that it began with: its whole counts were given
    /// out as trims. So it stands now, and so it stood when the periods that end next and ended last began.
    given: i32,
    given_before: i32,
    ended: i32,
    /// The last of them at the last t3.
    ended_at_t3: i32,
    /// Trim per period for the periods of the budget, and after it, in 2^-16 count.
    rate: i32,
    drift_rate: i32,
    /// Estimates at the last t3: phase error, and its growth in a cycle without trim, in 2^-16 count.
    phase: i32,
    drift: i32,
    /// Since the last t3.
    ticks: u16,
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
            given: HALF_COUNT,
            given_before: HALF_COUNT,
            ended: HALF_COUNT,
            ended_at_t3: HALF_COUNT,
            rate: 0,
            drift_rate: 0,
            phase: 0,
            drift: 0,
            ticks: 0,
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
        let rate = if self.ticks < self.settings.budget { self.rate } else { self.drift_rate };
        self.ticks = self.ticks.saturating_add(1);
        let given = self.given.wrapping_add(rate);
        // A rate is within 1 % of at most 32 767 counts.
        let trim = (given >> FINE_BITS).wrapping_sub(self.given >> FINE_BITS) as i16;
        self.ended = self.given_before;
        self.given_before = self.given;
        self.given = given;
        trim
    }

    /// To be called at every t3 event with the counts since the last tick.
    #[inline]
    pub fn on_t3(&mut self, phase: u16) {
        let distance = i32::from(phase).wrapping_sub(self.settings.target_phase);
        // In half counts, as a phase of 2^-16 count would not fit before it is wrapped.
        let measured = wrapped(distance << 1, self.settings.counts << 1) << (FINE_BITS - 1);
        if self.events == 0 {
            self.phase = measured;
            self.events = 1;
        } else {
            self.estimate(measured);
        }
        self.judge_lock(measured);

        let settings = &self.settings;
        self.ended_at_t3 = self.ended;
        self.ticks = 0;
        // What is under way, and the fraction that was not given out yet.
        let given = self.given.wrapping_sub(self.ended & WHOLE_COUNTS).wrapping_sub(HALF_COUNT);
        let wanted = self.phase.wrapping_add(self.drift).wrapping_sub(given);
        self.rate = limited(times(wanted, settings.per_budget), settings.largest_rate);
        self.drift_rate = limited(times(self.drift, settings.per_cycle), settings.largest_rate);
    }

    /// The ticks have been within 2 us (1/64 of a period) of their place for four t3 events, and not off it for four since.
    #[must_use]
    pub const fn is_locked(&self) -> bool {
        self.locked
    }

    /// Estimated phase error at the last t3 in counts; positive: the ticks come early.
    #[must_use]
    pub const fn phase_error(&self) -> i32 {
        self.phase >> FINE_BITS
    }

    #[inline]
    fn estimate(&mut self, measured: i32) {
        let Some(drifted) = self.drifted() else {
            self.phase = measured;
            self.events = 1;
            return;
        };
        let period = self.settings.period();
        let applied = (self.ended & WHOLE_COUNTS).wrapping_sub(self.ended_at_t3 & WHOLE_COUNTS);
        let predicted = wrapped(self.phase.wrapping_add(drifted).wrapping_sub(applied), period);
        let deviation = wrapped(measured.wrapping_sub(predicted), period);
        if self.locked && deviation.abs() > period >> OUTLIER_SHIFT {
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
        let (of_phase, of_drift) = match GROWING.get(place) {
            Some(&growing) => {
                self.events = self.events.saturating_add(1);
                growing
            }
            None => STEADY,
        };
        self.phase = predicted.wrapping_add(amplified(deviation, of_phase));
        self.drift = limited(self.drift.wrapping_add(amplified(deviation, of_drift)), self.settings.largest_drift);
    }

    /// What the phase has drifted by since the last t3; `None` when that is too long ago.
    #[inline]
    fn drifted(&self) -> Option<i32> {
        let cycle = u32::from(self.settings.ticks_per_cycle);
        // Counted from half a cycle on, so that a tick more or less makes no difference.
        let mut left = u32::from(self.ticks).wrapping_add(cycle >> 1);
        let mut drifted = self.drift;
        let mut cycles = 1;
        while left >= cycle << 1 {
            left = left.wrapping_sub(cycle);
            drifted = drifted.wrapping_add(self.drift);
            cycles = 1_u8.wrapping_add(cycles);
            if cycles > LONGEST_GAP {
                return None;
            }
        }
        Some(drifted)
    }

    #[inline]
    fn judge_lock(&mut self, measured: i32) {
        if measured.abs() <= self.settings.period() >> GOOD_SHIFT {
            self.bad = 0;
            self.good = self.good.saturating_add(1).min(LOCK_EVENTS);
            if self.good == LOCK_EVENTS {
                self.locked = true;
            }
        } else {
            self.good = 0;
            self.bad = self.bad.saturating_add(1).min(LOCK_EVENTS);
            if self.bad == LOCK_EVENTS {
                self.locked = false;
            }
        }
    }
}
