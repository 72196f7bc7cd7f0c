//! Position control: proportional, with velocity feed-forward, and a model of the lag that is to be expected.

use crate::{Gain, LOOP_TICKS_PER_SECOND, Position, Setpoint, SettingsError, Velocity, VelocityLimits};

/// Gains of the position loop, scaled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct PositionLoopSettings {
    /// Position steps to velocity steps.
    proportional: Gain,
    feed_forward: Gain,
    /// Velocity steps to the position steps that the axis lags behind at constant speed.
    lag: Gain,
    monitoring_window: Position,
}

impl PositionLoopSettings {
    /// * `kv`: S-0-0104 in 0.01 * 1000/min, that is 1/6 1/s; at least 1.
    /// * `feed_forward`: share of the commanded velocity that is passed on, in 0.01 %, at most 10 000. 0 is position control
    ///   with lag, 10 000 without lag (S-0-0032 bit 3).
    /// * `monitoring_window`: S-0-0159; zero switches the monitoring off.
    ///
    /// # Errors
    /// [`SettingsError::Zero`] without gain, [`SettingsError::FeedForward`] above 100 %.
    pub fn new(kv: u16, feed_forward: u16, monitoring_window: Position) -> Result<Self, SettingsError> {
        if feed_forward > 10_000 {
            return Err(SettingsError::FeedForward { actual: feed_forward });
        }
        let zero = SettingsError::Zero { parameter: "position loop Kv-factor S-0-0104" };
        // v [2^-36 rev/tick] = e [2^-32 rev] * 2^4 * (kv / 6) / 8000
        let numerator = u128::from(kv) << 4;
        let denominator = u128::from(LOOP_TICKS_PER_SECOND).saturating_mul(6);
        let left = u128::from(10_000_u16.saturating_sub(feed_forward));
        Ok(Self {
            proportional: Gain::from_ratio(numerator, denominator).filter(|_| kv > 0).ok_or(zero)?,
            feed_forward: Gain::from_ratio(u128::from(feed_forward), 10_000).unwrap_or(Gain::ONE),
            lag: Gain::from_ratio(denominator.saturating_mul(left), numerator.saturating_mul(10_000)).ok_or(zero)?,
            monitoring_window: monitoring_window.abs(),
        })
    }

    /// How far the axis lags behind a command that moves with `velocity`: (1 - feed-forward) * velocity / Kv.
    #[inline]
    #[must_use]
    pub fn lag(&self, velocity: Velocity) -> Position {
        Position::from_bits(self.lag.apply(i64::from(velocity.to_bits())))
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
    /// The following error is further from the expected lag than the monitoring window (C1D bit 11).
    pub excessive_deviation: bool,
}

/// State of the position loop: the lag that an undisturbed axis would have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct PositionLoop {
    last_command: Position,
    /// In 2^-36 revolution.
    expected_lag: i64,
    /// Velocity of the model in the last tick.
    expected_velocity: Velocity,
}

impl PositionLoop {
    /// Starts at a setpoint, with the lag that belongs to its velocity.
    #[must_use]
    pub fn new(settings: &PositionLoopSettings, setpoint: Setpoint) -> Self {
        Self {
            last_command: setpoint.position,
            expected_lag: settings.lag(setpoint.velocity).to_bits() << 4,
            expected_velocity: setpoint.velocity,
        }
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
        let feed_forward = settings.feed_forward.apply(i64::from(setpoint.velocity.to_bits()));
        let wanted = settings.proportional.apply(following_error.to_bits()).saturating_add(feed_forward);

        let moved = (setpoint.position - self.last_command).to_bits().clamp(-LAG_LIMIT, LAG_LIMIT) << 4;
        self.last_command = setpoint.position;
        self.expected_lag = self
            .expected_lag
            .wrapping_add(moved)
            .wrapping_sub(i64::from(self.expected_velocity.to_bits()))
            .clamp(-(LAG_LIMIT << 4), LAG_LIMIT << 4);
        let expected_lag = self.expected_lag >> 4;
        self.expected_velocity = limits.limit(Velocity::saturating_from_bits(
            settings.proportional.apply(expected_lag).saturating_add(feed_forward),
        ));

        let deviation = following_error - Position::from_bits(expected_lag);
        PositionLoopOutput {
            velocity: limits.limit(Velocity::saturating_from_bits(wanted)),
            following_error,
            excessive_deviation: settings.monitoring_window > Position::ZERO
                && deviation.abs() > settings.monitoring_window,
        }
    }

    /// Shifts the command by `difference` without a movement (homing).
    pub fn shift(&mut self, difference: Position) {
        self.last_command = self.last_command + difference;
    }
}

/// Lags and command steps beyond 64 revolutions count as 64.
const LAG_LIMIT: i64 = 1 << 38;

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
    fn impossible_gains_are_refused() {
        assert_eq!(
            PositionLoopSettings::new(0, 0, Position::ZERO),
            Err(SettingsError::Zero { parameter: "position loop Kv-factor S-0-0104" })
        );
        assert_eq!(
            PositionLoopSettings::new(1, 10_001, Position::ZERO),
            Err(SettingsError::FeedForward { actual: 10_001 })
        );
        assert!(
            PositionLoopSettings::new(1, 0, Position::ZERO).is_ok()
                && PositionLoopSettings::new(u16::MAX, 0, Position::ZERO).is_ok()
        );
    }
}
