//! From ticks of the guest (instructions) to simulated time and back.

use ring::Nanoseconds;

/// Average cycles of the Cortex-M4 for one instruction, in tenths.
///
/// 1.5 is on the safe side for compiled integer code that runs from flash behind the ST accelerator (cache hits nearly always, loads two cycles
/// unless pipelined, taken branches two to four). Bus wait states of the external bus come on top, access by access.
pub const CYCLES_PER_INSTRUCTION_TENTHS: u64 = 15;

const FEMTOSECONDS: u128 = 1_000_000;

const NANOSECONDS: u64 = 1_000_000_000;

/// Whole clocks of a timer since the start of the simulation; seconds apart from the rest, so that 64 bits do.
pub(crate) fn clocks_at(now: Nanoseconds, hertz: u64) -> u64 {
    now.0 / NANOSECONDS * hertz + now.0 % NANOSECONDS * hertz / NANOSECONDS
}

/// The first nanosecond at which that many clocks have passed.
pub(crate) fn time_of_clocks(clocks: u64, hertz: u64) -> Nanoseconds {
    Nanoseconds(clocks / hertz * NANOSECONDS + (clocks % hertz * NANOSECONDS).div_ceil(hertz))
}

/// A division of 128 bits costs ten times one of 64, and five simulated hours fit in those.
fn quotient(dividend: u128, divisor: u128) -> u64 {
    match (u64::try_from(dividend), u64::try_from(divisor)) {
        (Ok(dividend), Ok(divisor)) => dividend / divisor,
        _ => u64::try_from(dividend / divisor).unwrap_or(u64::MAX),
    }
}

/// Simulated time of the guest at a known tick, kept in femtoseconds so that no rounding adds up.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TickClock {
    femtoseconds: u128,
    ticks: u32,
    femtoseconds_per_tick: u128,
}

impl TickClock {
    /// Starts at zero with a core clock of `hertz`.
    pub(crate) fn new(hertz: u64) -> Self {
        let mut clock = Self { femtoseconds: 0, ticks: 0, femtoseconds_per_tick: 0 };
        clock.set_frequency(hertz);
        clock
    }

    /// The core clock from now on.
    pub(crate) fn set_frequency(&mut self, hertz: u64) {
        let femtohertz = u128::from(hertz) * 10;
        self.femtoseconds_per_tick =
            (1_000_000_000_000_000 * u128::from(CYCLES_PER_INSTRUCTION_TENTHS) + femtohertz / 2) / femtohertz;
    }

    /// Simulated time of a tick not before the last one passed, without moving on.
    pub(crate) fn time_of(&self, ticks: u32) -> Nanoseconds {
        let since = u128::from(ticks.saturating_sub(self.ticks));
        let time = self.femtoseconds + since * self.femtoseconds_per_tick;
        Nanoseconds(quotient(time, FEMTOSECONDS))
    }

    /// Moves on to a tick.
    pub(crate) fn pass(&mut self, ticks: u32) {
        let since = u128::from(ticks.saturating_sub(self.ticks));
        self.femtoseconds += since * self.femtoseconds_per_tick;
        self.ticks = self.ticks.max(ticks);
    }

    /// Moves on to at least `time`.
    pub(crate) fn pull_up(&mut self, time: Nanoseconds) {
        self.femtoseconds = self.femtoseconds.max(u128::from(time.0) * FEMTOSECONDS);
    }

    /// It is exactly `time`, whatever the ticks say.
    pub(crate) fn settle(&mut self, time: Nanoseconds) {
        self.femtoseconds = u128::from(time.0) * FEMTOSECONDS;
    }

    /// The guest resumes here and counts its ticks from zero.
    pub(crate) fn resume(&mut self) {
        self.ticks = 0;
    }

    /// Ticks until `time`, rounded up, at least one: what begins before them, begins before `time`.
    pub(crate) fn ticks_until(&self, time: Nanoseconds) -> u32 {
        let until = (u128::from(time.0) * FEMTOSECONDS).saturating_sub(self.femtoseconds);
        let rounded_up = until + self.femtoseconds_per_tick - 1;
        quotient(rounded_up, self.femtoseconds_per_tick).clamp(1, i32::MAX as u64) as u32
    }

    /// Ticks that so many cycles of the core clock take.
    pub(crate) fn ticks_of_cycles(cycles: u32) -> u32 {
        ((u64::from(cycles) * 10 + CYCLES_PER_INSTRUCTION_TENTHS / 2) / CYCLES_PER_INSTRUCTION_TENTHS) as u32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_second_of_instructions_at_168_mhz_is_a_second() {
        let mut clock = TickClock::new(168_000_000);
        for _ in 0..112_000 {
            clock.pass(1_000);
            clock.resume();
        }
        let error = clock.time_of(0).0.abs_diff(1_000_000_000);
        assert!(error < 100, "off by {error} ns in a second");
    }

    #[test]
    fn whatever_begins_within_the_budget_begins_before_the_horizon() {
        let mut clock = TickClock::new(168_000_000);
        for horizon in [10, 17, 1_000, 125_000, 999_999_999] {
            let ticks = clock.ticks_until(Nanoseconds(horizon));
            assert!(clock.time_of(ticks).0 >= horizon.min(8), "{horizon}");
            assert!(ticks == 1 || clock.time_of(ticks - 1).0 < horizon, "{horizon}");
        }
        clock.pass(100);
        assert_eq!(clock.ticks_until(Nanoseconds(0)), 1);
    }

    #[test]
    fn a_wait_that_ended_late_leaves_no_trace() {
        let after = |ticks| {
            let mut clock = TickClock::new(168_000_000);
            clock.pass(ticks);
            clock.settle(Nanoseconds(125_000));
            clock.resume();
            clock.time_of(100)
        };
        assert_eq!(after(14_000), after(14_008));
        assert!(after(14_000) > Nanoseconds(125_000));
    }

    #[test]
    fn short_and_long_times_are_divided_alike() {
        let long = u128::from(u64::MAX) * 7 + 3;
        assert_eq!(quotient(long, 1 << 20), (long >> 20) as u64);
        assert_eq!(quotient(long >> 4, 1 << 20), (long >> 24) as u64);
        assert_eq!(quotient(u128::MAX, 1), u64::MAX);
    }

    #[test]
    fn clocks_and_their_times_are_those_of_long_division() {
        for hertz in [16_000_000, 84_000_000, 168_000_000, 48_000] {
            for now in [0, 1, 5_952, 999_999_999, 1_000_000_000, 3_600_123_456_789, 12_345_678_901] {
                let clocks = (u128::from(now) * u128::from(hertz) / 1_000_000_000) as u64;
                assert_eq!(clocks_at(Nanoseconds(now), hertz), clocks, "{now} ns at {hertz} Hz");
                for clocks in [clocks, clocks + 1] {
                    let time = (u128::from(clocks) * 1_000_000_000).div_ceil(hertz.into()) as u64;
                    assert_eq!(time_of_clocks(clocks, hertz).0, time, "{clocks} of {hertz} Hz");
                }
            }
        }
    }

    #[test]
    fn waits_are_whole_ticks() {
        assert_eq!(TickClock::ticks_of_cycles(92), 61);
        assert_eq!(TickClock::ticks_of_cycles(0), 0);
    }
}
