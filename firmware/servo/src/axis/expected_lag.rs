//! How far an undisturbed axis would be behind its position commands: what the following error is compared with (C1D bit 11).
//!
//! The position loop itself has no use for it. A deviation that hurts lasts for milliseconds, so it is looked for with the period of the
//! supervision, and the loops are spared.

use crate::arithmetic::division::divide_rounding;
use crate::arithmetic::wide::times_fraction;
use crate::axis::limits::VelocityLimits;
use crate::axis::position_loop::{FINE_BITS, PositionLoopSettings, fine, with_high_word, within_range};
use crate::path::setpoint::Setpoint;
use crate::units::{LOOP_TICKS_PER_SECOND, LOOP_TICKS_PER_SUPERVISION, Position, Velocity};

/// What is looked for, scaled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub(crate) struct DeviationSettings {
    /// In 2^-38 revolution; the largest value, which no deviation passes, when nothing is monitored.
    window: i64,
    /// Of a lag that is not the one of its velocity, what is gone a period later, in 2^-31.
    gone: i32,
}

impl DeviationSettings {
    /// `kv`: S-0-0104 in 0.01 * 1000/min; `window`: S-0-0159, where zero switches the monitoring off, and one beyond 2^24 revolutions is
    /// never left. Divides.
    pub(crate) fn new(kv: u16, window: Position) -> Self {
        // A tick leaves 1 - Kv * 125 us of it. Kv is in 1/6 1/s.
        let whole = i128::from(LOOP_TICKS_PER_SECOND).saturating_mul(6);
        let left = whole.saturating_sub(i128::from(kv)).saturating_pow(LOOP_TICKS_PER_SUPERVISION);
        let whole = whole.saturating_pow(LOOP_TICKS_PER_SUPERVISION);
        let gone = divide_rounding(whole.saturating_sub(left).saturating_mul(1 << 31), whole);
        Self {
            window: match window.abs().to_bits() {
                0 => i64::MAX,
                window => window.min(i64::MAX >> FINE_BITS) << FINE_BITS,
            },
            gone: i32::try_from(gone).unwrap_or(i32::MAX),
        }
    }
}

/// An undisturbed axis beside the real one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct ExpectedLag {
    /// Of the last tick.
    setpoint: Position,
    following_error: Position,
    /// Set-point of the last look.
    before: Position,
    /// In 2^-38 revolution.
    lag: i64,
}

impl ExpectedLag {
    /// An axis that follows with the lag of its velocity.
    pub(crate) fn new(settings: &PositionLoopSettings, setpoint: Setpoint) -> Self {
        let lag = settings.lag(setpoint.velocity);
        Self { setpoint: setpoint.position, following_error: lag, before: setpoint.position, lag: fine(lag) }
    }

    /// One tick: what the position loop had, and what it gave.
    #[inline]
    pub(crate) fn note(&mut self, setpoint: Position, following_error: Position) {
        self.setpoint = setpoint;
        self.following_error = following_error;
    }

    /// One period of the supervision: lets the undisturbed axis go along with the set-point, whose velocity this is, as fast as the limits let
    /// an axis go. Whether the real one is further from it than the window.
    ///
    /// The lag is about 64 revolutions at most, after a command that jumps or while a velocity limit is met for long.
    pub(crate) fn deviates(
        &mut self,
        settings: &DeviationSettings,
        position_loop: &PositionLoopSettings,
        limits: &VelocityLimits,
        velocity: Velocity,
    ) -> bool {
        let moved = fine(within_range(self.setpoint - self.before));
        let difference = self.lag.wrapping_sub(fine(position_loop.lag(velocity)));
        let gone = times_fraction(difference << 1, settings.gone);
        let way = moved.wrapping_add(gone).min(fine_way(limits.positive)).max(fine_way(limits.negative));
        let lag = self.lag.wrapping_add(moved).wrapping_sub(way);
        self.lag = with_high_word(lag, ((lag >> 32) as i32).clamp(-LAG_LIMIT, LAG_LIMIT - 1));
        self.before = self.setpoint;
        let deviation = fine(within_range(self.following_error)).wrapping_sub(self.lag);
        // The magnitude, of a negative one less the last of its steps.
        deviation ^ (deviation >> 63) > settings.window
    }

    /// Shifts the command by `difference` without a movement (homing).
    pub(crate) fn shift(&mut self, difference: Position) {
        self.setpoint = self.setpoint + difference;
        self.before = self.before + difference;
    }
}

/// Largest lag of the model, in the unit of the high word: 64 revolutions.
const LAG_LIMIT: i32 = 64 << FINE_BITS;

/// What a velocity moves in the period of the supervision, in 2^-38 revolution.
fn fine_way(velocity: Velocity) -> i64 {
    // A tick moves 2^-36 revolution.
    i64::from(velocity.to_bits()).wrapping_mul(4).wrapping_mul(LOOP_TICKS_PER_SUPERVISION.into())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Where the set-point goes, and the axis with it; what is found at each look.
    #[derive(Clone, Copy)]
    struct Watched {
        settings: DeviationSettings,
        position_loop: PositionLoopSettings,
        limits: VelocityLimits,
        lag: ExpectedLag,
    }

    impl Watched {
        fn new(kv: u16, feed_forward: u16, window: Position, velocity: Velocity) -> Self {
            let position_loop = PositionLoopSettings::new(kv, feed_forward).unwrap();
            Self {
                settings: DeviationSettings::new(kv, window),
                position_loop,
                limits: VelocityLimits::new(Velocity::MAX, None, None),
                lag: ExpectedLag::new(&position_loop, Setpoint::moving(Position::ZERO, velocity)),
            }
        }

        fn look(&mut self, setpoint: i64, following_error: i64, velocity: Velocity) -> bool {
            self.lag.note(Position::from_bits(setpoint), Position::from_bits(following_error));
            self.lag.deviates(&self.settings, &self.position_loop, &self.limits, velocity)
        }
    }

    /// What a velocity moves between two looks.
    fn way(velocity: Velocity) -> i64 {
        i64::from(velocity.to_bits()) * 4 / 16
    }

    #[test]
    fn the_deviation_is_counted_from_the_expected_lag_both_ways() {
        // Kv 62.5 1/s without feed-forward at 10 rev/s: 0.16 revolutions of lag, window 0.01.
        let velocity = Velocity::from_bits(((10_i64 << 36) / 8_000) as i32);
        let mut watched = Watched::new(375, 0, Position::from_bits((1 << 32) / 100), velocity);
        let lag = watched.position_loop.lag(velocity).to_bits();
        assert!((lag - ((1 << 32) * 16 / 100)).abs() < 1 << 12);
        for period in 1..1_000 {
            assert!(!watched.look(period * way(velocity), lag, velocity), "period {period}");
        }
        for (off, found) in [((1 << 32) / 101, false), ((1 << 32) / 99, true)] {
            for side in [-1, 1] {
                let mut watched = watched;
                assert_eq!(watched.look(1_000 * way(velocity), lag + side * off, velocity), found, "{off} {side}");
            }
        }
    }

    #[test]
    fn the_lag_of_another_velocity_comes_with_the_time_of_the_gain() {
        // Kv 62.5 1/s: after a step to 10 rev/s a lag of 0.16 (1 - e^(-62.5 t)); 4 looks are 2 ms, 40 are 20 ms. A discrete loop of 125 us is
        // faster by half its period.
        let velocity = Velocity::from_bits(((10_i64 << 36) / 8_000) as i32);
        let mut watched = Watched::new(375, 0, Position::from_bits(1), Velocity::ZERO);
        for (looks, seconds) in [(4_i64, 0.002), (40, 0.02), (200, 0.1)] {
            let mut lag = watched.lag;
            for period in 1..=looks {
                watched.look(period * way(velocity), 0, velocity);
            }
            core::mem::swap(&mut lag, &mut watched.lag);
            let found = lag.lag as f64 / (1_i64 << 38) as f64;
            let expected = 0.16 * (1.0 - (-62.5 * seconds as f64).exp());
            assert!((found / expected - 1.0).abs() < 0.006, "{seconds} s: {found} for {expected}");
        }
    }

    #[test]
    fn the_largest_gain_has_a_lag_that_settles() {
        let velocity = Velocity::from_bits(((10_i64 << 36) / 8_000) as i32);
        let mut watched = Watched::new(u16::MAX, 0, Position::from_bits((1 << 32) / 1_000), Velocity::ZERO);
        let lag = watched.position_loop.lag(velocity).to_bits();
        assert!((1..=20).map(|period| watched.look(period * way(velocity), lag, velocity)).skip(5).all(|found| !found));
    }

    #[test]
    fn an_axis_at_its_velocity_limit_is_expected_to_fall_behind() {
        let (velocity, limit) = (Velocity::from_bits(1 << 20), Velocity::from_bits(1 << 19));
        for side in [1, -1] {
            let velocity = if side > 0 { velocity } else { -velocity };
            let mut watched = Watched::new(375, 10_000, Position::from_bits(1 << 20), Velocity::ZERO);
            watched.limits = VelocityLimits::new(limit, None, None);
            for period in 1..100 {
                assert!(!watched.look(period * way(velocity), period * side * way(limit), velocity), "{side} {period}");
            }
        }
    }

    #[test]
    fn the_model_falls_behind_by_64_revolutions_at_most_on_the_side_of_the_command() {
        for (jump, side) in [(100_i64, 1_i64), (-100, -1), (1 << 20, 1), (-(1 << 20), -1)] {
            let mut watched = Watched::new(1, 0, Position::REVOLUTION, Velocity::ZERO);
            watched.limits = VelocityLimits::new(Velocity::from_bits(1 << 20), None, None);
            let mut look = |behind: i64| watched.look(jump << 32, behind << 32, Velocity::ZERO);
            assert!(!look(side * 64), "{jump}");
            assert!(look(jump) && look(side * 62), "{jump}");
        }
    }

    #[test]
    fn nothing_is_found_without_a_window_and_after_a_shift() {
        let mut watched = Watched::new(375, 10_000, Position::ZERO, Velocity::ZERO);
        assert!(!watched.look(0, 1 << 40, Velocity::ZERO));
        let mut watched = Watched::new(375, 10_000, Position::from_bits(1 << 20), Velocity::ZERO);
        watched.lag.shift(Position::from_bits(1 << 40));
        assert!(!watched.look(1 << 40, 0, Velocity::ZERO));
    }
}
