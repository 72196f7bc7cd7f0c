//! Finding out, in CP0, which timer register raises which bit of 05H (G4, G5, G11).
//!
//! A timer that is programmed raises its bit once in every cycle; one at FFFFH never does, whatever 0 may mean.
//! So one register after the other is programmed alone, and what recurs is noted: bits that recur with every register belong
//! to the cycle itself (MST, CON_CLK), a bit that recurs with one register only is that register's. No bit needs to mark the
//! cycle, its period is measured on whatever recurs. Two registers are enough, and take about seven cycles.

use crate::bus::{Bus, Register};
use crate::timer::{Timer, TimerMap};
use crate::uncertain::{ENABLE_ALL, TIMER_NEVER_US};

impl TimerMap {
    /// Programs both timers in us after the MST, `None` for never, and switches the others off.
    pub fn program<B: Bus>(&self, bus: &mut B, command_valid_us: Option<u16>, capture_feedback_us: Option<u16>) {
        for register in Register::TIMERS {
            let time = if register == self.command_valid.register {
                command_valid_us
            } else if register == self.capture_feedback.register {
                capture_feedback_us
            } else {
                None
            };
            bus.write_register(register, time.unwrap_or(TIMER_NEVER_US));
        }
    }
}

/// What was seen since the last tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Observation {
    /// Time of this tick in us, wrapping. Ticks come every 125 us, give or take.
    pub time_us: u32,
    /// High byte of 05H: [`crate::Events::raw`] of this tick's poll and of all interrupts since the last tick.
    pub events: u8,
    /// Any flag was found by this tick's poll, in 04H or 05H.
    pub polled: bool,
    /// An interrupt of the chip arrived since the last tick, on either line.
    pub interrupted: bool,
}

/// What to do; [`crate::Interrupts::carry_out`] does it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Orders {
    /// Program this timer register alone.
    pub arm: Option<Register>,
    /// Write this to 06H and 07H.
    pub enable: Option<u16>,
    /// Discovery is finished with this result.
    pub found: Option<TimerMap>,
}

/// Order in which the registers are tried: first those that most likely are TINT2 and TINT3.
const CANDIDATES: [Register; 4] = [Register::TIMER_2, Register::TIMER_3, Register::TIMER_1, Register::TIMER_0];

/// Two ticks and a little: how far two intervals of one bit may differ.
const TOLERANCE_US: u32 = 300;
/// No cycle of CP0 is shorter than 1 ms.
const SHORTEST_CYCLE_US: u32 = 700;
const LONGEST_CYCLE_US: u32 = 65_000 + TOLERANCE_US;
/// Nothing recurs at all for so long: perhaps this register has no timer.
const PATIENCE_US: u32 = 4 * LONGEST_CYCLE_US;
/// Polls that find flags without an interrupt ever having come, before the sense of the enable bits is doubted.
const DOUBTFUL_POLLS: u8 = 4;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    /// Nothing programmed yet.
    Begin,
    /// A register is programmed, the cycle time is not known.
    Measure,
    /// The next register is programmed, what was on its way before is let pass.
    Settle,
    /// Noting what recurs.
    Collect,
    Done,
}

/// When one bit was seen.
#[derive(Clone, Copy, Debug, Default)]
struct History {
    /// Occurrences so far, at most 3.
    count: u8,
    last_us: u32,
    interval_us: u32,
}

impl History {
    /// Notes an occurrence; returns the period once two intervals in a row agree.
    fn note(&mut self, now: u32) -> Option<u32> {
        let interval = now.wrapping_sub(self.last_us);
        let agrees = self.count >= 2 && interval.abs_diff(self.interval_us) <= TOLERANCE_US;
        self.count = self.count.saturating_add(1).min(3);
        self.last_us = now;
        self.interval_us = interval;
        let plausible = (SHORTEST_CYCLE_US..=LONGEST_CYCLE_US).contains(&interval);
        (agrees && plausible).then_some(interval)
    }

    /// Not seen in the last cycle.
    fn is_old(&self, now: u32, period: u32) -> bool {
        self.count == 0 || now.wrapping_sub(self.last_us) > period.saturating_add(TOLERANCE_US)
    }

    /// Seen in both of the last two cycles.
    fn recurs(&self, now: u32, period: u32) -> bool {
        self.count >= 2 && self.interval_us <= period.saturating_add(TOLERANCE_US) && !self.is_old(now, period)
    }
}

/// The state machine; pure, fed by [`Discovery::tick`].
#[derive(Debug)]
pub struct Discovery {
    stage: Stage,
    /// Index into [`CANDIDATES`] of the register programmed now.
    candidate: usize,
    /// What recurred with each candidate so far.
    recurring: [Option<u8>; CANDIDATES.len()],
    histories: [History; 8],
    stage_since_us: u32,
    period_us: u32,
    interrupts_arrive: bool,
    doubtful_polls: u8,
    /// Values still to be tried for the enable registers.
    enable_attempts: u8,
}

impl Default for Discovery {
    fn default() -> Self {
        Self::new()
    }
}

impl Discovery {
    /// Nothing known.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            stage: Stage::Begin,
            candidate: 0,
            recurring: [None; CANDIDATES.len()],
            histories: [History { count: 0, last_us: 0, interval_us: 0 }; 8],
            stage_since_us: 0,
            period_us: 0,
            interrupts_arrive: false,
            doubtful_polls: 0,
            enable_attempts: 2,
        }
    }

    /// The result has been given.
    #[must_use]
    pub fn is_done(&self) -> bool {
        self.stage == Stage::Done
    }

    /// Begins again; what was learned about the enable bits stays.
    pub fn restart(&mut self) {
        self.stage = Stage::Begin;
        self.candidate = 0;
        self.recurring = [None; CANDIDATES.len()];
    }

    /// One tick. Once the result has been given, only the sense of the enable bits is still watched.
    pub fn tick(&mut self, seen: Observation) -> Orders {
        let mut orders = Orders { enable: self.doubt_enable(&seen), ..Orders::default() };
        if self.stage == Stage::Done {
            return orders;
        }
        if self.stage == Stage::Begin {
            self.begin_with(0, seen.time_us);
            orders.arm = CANDIDATES.first().copied();
            return orders;
        }
        let mut period = None;
        for (bit, history) in self.histories.iter_mut().enumerate() {
            if seen.events.checked_shr(bit as u32).unwrap_or(0) & 1 == 1 {
                period = period.max(history.note(seen.time_us));
            }
        }
        let elapsed = seen.time_us.wrapping_sub(self.stage_since_us);
        match (self.stage, period) {
            (Stage::Measure, Some(period)) => {
                self.period_us = period;
                // What came in the last cycle but not in the one before may only have begun: one cycle more will tell.
                if self
                    .histories
                    .iter()
                    .all(|history| history.is_old(seen.time_us, period) || history.recurs(seen.time_us, period))
                {
                    self.conclude(seen.time_us, &mut orders);
                }
            }
            (Stage::Measure, None) if elapsed > PATIENCE_US => {
                let next = if self.candidate < CANDIDATES.len().saturating_sub(1) {
                    self.candidate.saturating_add(1)
                } else {
                    0
                };
                self.begin_with(next, seen.time_us);
                orders.arm = CANDIDATES.get(next).copied();
            }
            // The chip ran by itself when the cycle time was measured, and now a ring does.
            (Stage::Settle | Stage::Collect, Some(period)) if period.saturating_mul(3) < self.period_us => {
                self.begin_with(0, seen.time_us);
                orders.arm = CANDIDATES.first().copied();
            }
            (Stage::Settle, _) if elapsed > self.period_us.saturating_add(TOLERANCE_US) => {
                self.enter(Stage::Collect, seen.time_us);
            }
            (Stage::Collect, _) if elapsed > self.period_us.saturating_add(TOLERANCE_US).saturating_mul(2) => {
                let regular = |history: &History| history.count == 0 || history.recurs(seen.time_us, self.period_us);
                if self.histories.iter().all(regular) {
                    self.conclude(seen.time_us, &mut orders);
                } else {
                    // The ring stopped, began or changed its cycle time.
                    self.begin_with(0, seen.time_us);
                    orders.arm = CANDIDATES.first().copied();
                }
            }
            _ => {}
        }
        orders
    }

    /// Measures the cycle time, beginning with one candidate.
    fn begin_with(&mut self, candidate: usize, now: u32) {
        self.candidate = candidate;
        self.recurring = [None; CANDIDATES.len()];
        self.enter(Stage::Measure, now);
    }

    fn enter(&mut self, stage: Stage, now: u32) {
        self.stage = stage;
        self.stage_since_us = now;
        self.histories = [History::default(); 8];
    }

    /// Notes what recurs with the present candidate, then is done, goes on to the next candidate, or begins again.
    fn conclude(&mut self, now: u32, orders: &mut Orders) {
        let mut bits = 0;
        for (bit, history) in (0_u32..).zip(&self.histories) {
            if history.recurs(now, self.period_us) {
                bits |= 1_u8.wrapping_shl(bit);
            }
        }
        if let Some(entry) = self.recurring.get_mut(self.candidate) {
            *entry = Some(bits);
        }
        if let Some(map) = self.result() {
            self.stage = Stage::Done;
            orders.found = Some(map);
            return;
        }
        let next = self.candidate.saturating_add(1);
        if let Some(&register) = CANDIDATES.get(next) {
            self.candidate = next;
            self.enter(Stage::Settle, now);
            orders.arm = Some(register);
        } else {
            self.begin_with(0, now);
            orders.arm = CANDIDATES.first().copied();
        }
    }

    /// Two registers with a bit of their own each, if the notes show them.
    fn result(&self) -> Option<TimerMap> {
        let noted = || self.recurring.iter().flatten().copied();
        if noted().count() < 2 {
            return None;
        }
        let cycle_bits = noted().fold(0xFF, |common, bits| common & bits);
        let mut timers = CANDIDATES.into_iter().zip(self.recurring).filter_map(|(register, bits)| {
            let own = bits? & !cycle_bits;
            own.is_power_of_two().then(|| Timer { register, bit: (own.trailing_zeros() as u8) | 8 })
        });
        let command_valid = timers.next()?;
        let capture_feedback = timers.find(|timer| timer.bit != command_valid.bit)?;
        Some(TimerMap { command_valid, capture_feedback, cycle_bits: u16::from_be_bytes([cycle_bits, 0]) })
    }

    /// The other sense of the enable bits, when polls find flags but no interrupt ever came; then once more the first one.
    fn doubt_enable(&mut self, seen: &Observation) -> Option<u16> {
        self.interrupts_arrive |= seen.interrupted;
        if self.interrupts_arrive || self.enable_attempts == 0 || !seen.polled {
            return None;
        }
        self.doubtful_polls = self.doubtful_polls.saturating_add(1);
        if self.doubtful_polls < DOUBTFUL_POLLS {
            return None;
        }
        self.doubtful_polls = 0;
        self.enable_attempts = self.enable_attempts.saturating_sub(1);
        Some(if self.enable_attempts == 1 { !ENABLE_ALL } else { ENABLE_ALL })
    }
}

#[cfg(test)]
mod tests;
