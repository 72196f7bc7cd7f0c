//! Position control: proportional, with velocity feed-forward, and a model of the lag that is to be expected.

use crate::arithmetic::division::divide_rounding;
use crate::arithmetic::gain::Gain;
use crate::arithmetic::share::Share;
use crate::arithmetic::wide::{saturated, times_fraction};
use crate::axis::limits::{Limiting, VelocityLimits};
use crate::error::SettingsError;
use crate::path::setpoint::Setpoint;
use crate::units::{LOOP_TICKS_PER_SECOND, Position, Velocity};

/// Gains of the position loop, scaled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct PositionLoopSettings {
    /// Position steps to velocity steps, in 2^-26.
    proportional: i32,
    /// Of the commanded velocity.
    feed_forward: Share,
    /// Velocity steps to the position steps that the axis lags behind at constant speed.
    lag: Gain,
    /// It leads: more than the velocity is passed on.
    leads: bool,
    /// In 2^-38 revolution; the largest value, which no deviation passes, when nothing is monitored.
    monitoring_window: i64,
}

/// In 0.01 %: drives and controls have 120 % (S-0-0296 of the AX5000).
const LARGEST_FEED_FORWARD: u16 = 12_000;

impl PositionLoopSettings {
    /// * `kv`: S-0-0104 in 0.01 * 1000/min, that is 1/6 1/s; at least 1.
    /// * `feed_forward`: share of the commanded velocity that is passed on, in 0.01 %, at most 12 000. 0 is position control
    ///   with lag, 10 000 without lag (S-0-0032 bit 3); above it the axis leads.
    /// * `monitoring_window`: S-0-0159; zero switches the monitoring off, and one beyond 2^24 revolutions is never left.
    ///
    /// # Errors
    /// [`SettingsError::Zero`] without gain, [`SettingsError::FeedForward`] above 120 %.
    pub fn new(kv: u16, feed_forward: u16, monitoring_window: Position) -> Result<Self, SettingsError> {
        if feed_forward > LARGEST_FEED_FORWARD {
            return Err(SettingsError::FeedForward { actual: feed_forward });
        }
        let zero = SettingsError::Zero { parameter: "position loop Kv-factor S-0-0104" };
        // v [2^-36 rev/tick] = e [2^-32 rev] * 2^4 * (kv / 6) / 8000
        let numerator = u128::from(kv) << 4;
        let denominator = u128::from(LOOP_TICKS_PER_SECOND).saturating_mul(6);
        let left = u128::from(feed_forward.abs_diff(10_000));
        Ok(Self {
            // Below 22 of 32.
            proportional: divide_rounding(i128::from(kv) << 26, 3_000) as i32,
            feed_forward: Share::beyond_whole(feed_forward.into(), 10_000),
            leads: feed_forward > 10_000,
            lag: Gain::from_ratio(denominator.saturating_mul(left), numerator.saturating_mul(10_000)).ok_or(zero)?,
            monitoring_window: match monitoring_window.abs().to_bits() {
                0 => i64::MAX,
                window => window.min(i64::MAX >> FINE_BITS) << FINE_BITS,
            },
        })
    }

    /// How far the axis lags behind a command that moves with `velocity`: (1 - feed-forward) * velocity / Kv.
    #[inline]
    #[must_use]
    pub fn lag(&self, velocity: Velocity) -> Position {
        let lag = Position::from_bits(self.lag.apply(i64::from(velocity.to_bits())));
        if self.leads { -lag } else { lag }
    }

    /// What a way in 2^-38 revolution asks for, rounded down, with what is fed forward.
    #[inline]
    fn velocity(&self, way: i64, fed_forward: i32) -> Velocity {
        // A way is below 2^63 and the gain below 2^31: their product is 2^30 short of the range at least.
        let product = times_fraction(way, self.proportional);
        Velocity::from_bits(saturated(product.wrapping_add(i64::from(fed_forward))))
    }
}

/// What the position loop gives in a tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct PositionLoopOutput {
    /// Command of the velocity loop, within the velocity limit.
    pub velocity: Velocity,
    /// Commanded less measured position (S-0-0189).
    pub following_error: Position,
    /// The velocity limit that the command meets.
    pub limiting: Limiting,
    /// The following error is further from the expected lag than the monitoring window (C1D bit 11).
    pub excessive_deviation: bool,
}

/// State of the position loop: where an undisturbed axis would be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct PositionLoop {
    /// Place of the model in 2^-38 revolution; it wraps, its distance from the setpoint does not.
    place: i64,
    /// Velocity of the model in the last tick.
    velocity: Velocity,
}

impl PositionLoop {
    /// Starts at a setpoint, with the lag that belongs to its velocity.
    #[must_use]
    pub fn new(settings: &PositionLoopSettings, setpoint: Setpoint) -> Self {
        Self { place: fine(setpoint.position - settings.lag(setpoint.velocity)), velocity: setpoint.velocity }
    }

    /// One tick.
    #[inline]
    pub fn tick(
        &mut self,
        settings: &PositionLoopSettings,
        limits: &VelocityLimits,
        setpoint: Setpoint,
        measured: Position,
    ) -> PositionLoopOutput {
        let following_error = setpoint.position - measured;
        let error = fine(within_range(following_error));
        let fed_forward = settings.feed_forward.of(setpoint.velocity.to_bits());
        let wanted = settings.velocity(error, fed_forward);
        let lag = self.expected_lag(setpoint.position);
        let undisturbed = settings.velocity(lag, fed_forward);

        self.velocity = limits.limit(undisturbed);
        let (velocity, limiting) = limits.apply(wanted);
        let deviation = error.wrapping_sub(lag);
        // The magnitude, of a negative one less the last of its steps.
        let distance = deviation ^ (deviation >> 63);
        PositionLoopOutput {
            velocity,
            following_error,
            limiting,
            excessive_deviation: distance > settings.monitoring_window,
        }
    }

    /// Moves the model by a tick; how far it is behind the setpoint, in 2^-38 revolution.
    ///
    /// It falls behind by about 64 revolutions at most, after a command that jumps or while a velocity limit is met for long.
    #[inline]
    fn expected_lag(&mut self, setpoint: Position) -> i64 {
        let setpoint = fine(setpoint);
        let lag = setpoint.wrapping_sub(self.place.wrapping_add(fine_way(self.velocity)));
        let lag = with_high_word(lag, ((lag >> 32) as i32).clamp(-LAG_LIMIT, LAG_LIMIT - 1));
        self.place = setpoint.wrapping_sub(lag);
        lag
    }

    /// Shifts the command by `difference` without a movement (homing).
    pub fn shift(&mut self, difference: Position) {
        self.place = self.place.wrapping_add(fine(difference));
    }
}

/// Bits below a position step in which the model counts, and in which the gain has its fraction.
const FINE_BITS: u32 = 6;
/// Largest lag of the model, in the unit of the high word: 64 revolutions.
const LAG_LIMIT: i32 = 64 << FINE_BITS;

/// In 2^-38 revolution, wrapping at 2^25 revolutions.
#[inline]
fn fine(position: Position) -> i64 {
    position.to_bits() << FINE_BITS
}

/// What a velocity moves in a tick, in 2^-38 revolution.
#[inline]
fn fine_way(velocity: Velocity) -> i64 {
    let bits = velocity.to_bits();
    // Word by word: the compiler makes more of a shift in 64 bits.
    i64::from(bits >> 30) << 32 | i64::from(bits.cast_unsigned() << 2)
}

/// A way within 2^24 revolutions: longer ones are cut to some way between them and the limit, which asks for more than the highest velocity
/// with every gain.
#[inline]
fn within_range(way: Position) -> Position {
    let bits = way.to_bits();
    Position::from_bits(with_high_word(bits, ((bits >> 32) as i32).clamp(-(1 << 24), (1 << 24) - 1)))
}

#[inline]
fn with_high_word(value: i64, high: i32) -> i64 {
    i64::from(high) << 32 | value & 0xFFFF_FFFF
}

#[cfg(test)]
mod tests {
    use super::*;

    fn up_to(limit: Velocity) -> VelocityLimits {
        VelocityLimits::new(limit, None, None)
    }

    fn at(position: i64, velocity: i32) -> Setpoint {
        Setpoint::moving(Position::from_bits(position), Velocity::from_bits(velocity))
    }

    #[test]
    fn kv_of_one_turns_a_revolution_into_a_thousand_revolutions_a_minute() {
        let settings = PositionLoopSettings::new(100, 0, Position::ZERO).unwrap();
        let mut position_loop = PositionLoop::new(&settings, at(0, 0));
        let output = position_loop.tick(&settings, &up_to(Velocity::MAX), at(1 << 32, 0), Position::ZERO);
        assert!((9_999_999..=10_000_001).contains(&output.velocity.to_ten_thousandths_rpm()), "{output:?}");
        assert_eq!(output.following_error, Position::REVOLUTION);
    }

    #[test]
    fn the_velocity_limit_holds_and_far_errors_keep_their_sign() {
        let settings = PositionLoopSettings::new(65_535, 10_000, Position::ZERO).unwrap();
        let mut position_loop = PositionLoop::new(&settings, at(0, 0));
        let limit = Velocity::from_bits(1_000);
        for (setpoint, expected) in [(at(1 << 62, 0), 1_000), (at(-(1 << 62), 500), -1_000), (at(0, 2_000), 1_000)] {
            assert_eq!(
                position_loop.tick(&settings, &up_to(limit), setpoint, Position::ZERO).velocity.to_bits(),
                expected
            );
        }
    }

    #[test]
    fn an_axis_that_is_fed_more_than_its_velocity_is_expected_to_lead() {
        // Kv 62.5 1/s at 10 rev/s: 20 % too much are 0.032 revolutions, 20 % too little as many the other way.
        let lag = |feed_forward| {
            let settings = PositionLoopSettings::new(375, feed_forward, Position::ZERO).unwrap();
            settings.lag(Velocity::from_bits(((10_i64 << 36) / 8_000) as i32)).to_bits()
        };
        for (feed_forward, expected) in
            [(12_000, -(1 << 32) * 32 / 1_000), (8_000, (1 << 32) * 32 / 1_000), (10_000, 0)]
        {
            assert!((lag(feed_forward) - expected).abs() < 1 << 12, "{feed_forward}: {}", lag(feed_forward));
        }
    }

    #[test]
    fn the_deviation_is_counted_from_the_expected_lag() {
        // Kv 62.5 1/s without feed-forward at 10 rev/s: 0.16 revolutions of lag, window 0.01.
        let settings = PositionLoopSettings::new(375, 0, Position::from_bits((1 << 32) / 100)).unwrap();
        let velocity = (10_i64 << 36) / 8_000;
        let lag = settings.lag(Velocity::from_bits(velocity as i32)).to_bits();
        assert!((lag - ((1 << 32) * 16 / 100)).abs() < 1 << 12);
        let mut position_loop = PositionLoop::new(&settings, at(0, velocity as i32));
        for tick in 1..1_000 {
            let command = tick * velocity / 16;
            let output = position_loop.tick(
                &settings,
                &up_to(Velocity::MAX),
                at(command, velocity as i32),
                Position::from_bits(command - lag),
            );
            assert!(!output.excessive_deviation, "tick {tick}");
        }
        let command = 1_000 * velocity / 16;
        let stuck = Position::from_bits(command - lag - (1 << 32) / 99);
        assert!(
            position_loop
                .tick(&settings, &up_to(Velocity::MAX), at(command, velocity as i32), stuck)
                .excessive_deviation
        );
    }

    #[test]
    fn the_model_falls_behind_by_64_revolutions_at_most_on_the_side_of_the_command() {
        let settings = PositionLoopSettings::new(1, 0, Position::REVOLUTION).unwrap();
        for (jump, side) in [(100_i64, 1_i64), (-100, -1), (1 << 20, 1), (-(1 << 20), -1)] {
            let mut position_loop = PositionLoop::new(&settings, at(0, 0));
            let setpoint = at(jump << 32, 0);
            let mut tick = |behind: i64| {
                let measured = setpoint.position - Position::from_bits(behind << 32);
                position_loop.tick(&settings, &up_to(Velocity::from_bits(1 << 20)), setpoint, measured)
            };
            assert!(!tick(side * 64).excessive_deviation, "{jump}");
            assert!(tick(jump).excessive_deviation && tick(side * 62).excessive_deviation, "{jump}");
        }
    }

    #[test]
    fn impossible_gains_are_refused() {
        assert_eq!(
            PositionLoopSettings::new(0, 0, Position::ZERO),
            Err(SettingsError::Zero { parameter: "position loop Kv-factor S-0-0104" })
        );
        assert_eq!(
            PositionLoopSettings::new(1, 12_001, Position::ZERO),
            Err(SettingsError::FeedForward { actual: 12_001 })
        );
        assert!(
            PositionLoopSettings::new(1, 0, Position::ZERO).is_ok()
                && PositionLoopSettings::new(u16::MAX, 0, Position::ZERO).is_ok()
        );
    }
}
