//! Position control: proportional, with velocity feed-forward.

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
}

/// In 0.01 %: drives and controls have 120 % (S-0-0296 of the AX5000).
const LARGEST_FEED_FORWARD: u16 = 12_000;

impl PositionLoopSettings {
    /// * `kv`: S-0-0104 in 0.01 * 1000/min, that is 1/6 1/s; at least 1.
    /// * `feed_forward`: share of the commanded velocity that is passed on, in 0.01 %, at most 12 000. 0 is position control
    ///   with lag, 10 000 without lag (S-0-0032 bit 3); above it the axis leads.
    ///
    /// # Errors
    /// [`SettingsError::Zero`] without gain, [`SettingsError::FeedForward`] above 120 %.
    pub fn new(kv: u16, feed_forward: u16) -> Result<Self, SettingsError> {
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
        })
    }

    /// How far the axis lags behind a command that moves with `velocity`: (1 - feed-forward) * velocity / Kv.
    #[inline]
    #[must_use]
    pub fn lag(&self, velocity: Velocity) -> Position {
        let lag = Position::from_bits(self.lag.apply(i64::from(velocity.to_bits())));
        if self.leads { -lag } else { lag }
    }

    /// One tick: the velocity that leads to a set-point from where the axis is.
    #[inline]
    pub fn follow(&self, limits: &VelocityLimits, setpoint: Setpoint, measured: Position) -> PositionLoopOutput {
        let following_error = setpoint.position - measured;
        let fed_forward = self.feed_forward.of(setpoint.velocity.to_bits());
        let wanted = self.velocity(fine(within_range(following_error)), fed_forward);
        let (velocity, limiting) = limits.apply(wanted);
        PositionLoopOutput { velocity, following_error, limiting }
    }

    /// Between two ticks: the velocity of the last one, moved on by what the set-point has gained since.
    #[inline]
    pub(crate) fn moved_on(&self, limits: &VelocityLimits, velocity: Velocity, gained: Velocity) -> Velocity {
        limits.apply(velocity + Velocity::from_bits(self.feed_forward.of(gained.to_bits()))).0
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
}

/// Bits below a position step in which the gain has its fraction.
pub(crate) const FINE_BITS: u32 = 6;

/// In 2^-38 revolution, wrapping at 2^25 revolutions.
#[inline]
pub(crate) fn fine(position: Position) -> i64 {
    position.to_bits() << FINE_BITS
}

/// A way within 2^24 revolutions: longer ones are cut to some way between them and the limit, which asks for more than the highest velocity
/// with every gain.
#[inline]
pub(crate) fn within_range(way: Position) -> Position {
    let bits = way.to_bits();
    Position::from_bits(with_high_word(bits, ((bits >> 32) as i32).clamp(-(1 << 24), (1 << 24) - 1)))
}

#[inline]
pub(crate) fn with_high_word(value: i64, high: i32) -> i64 {
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
        let settings = PositionLoopSettings::new(100, 0).unwrap();
        let output = settings.follow(&up_to(Velocity::MAX), at(1 << 32, 0), Position::ZERO);
        assert!((9_999_999..=10_000_001).contains(&output.velocity.to_ten_thousandths_rpm()), "{output:?}");
        assert_eq!(output.following_error, Position::REVOLUTION);
    }

    #[test]
    fn the_velocity_limit_holds_and_far_errors_keep_their_sign() {
        let settings = PositionLoopSettings::new(65_535, 10_000).unwrap();
        let limit = Velocity::from_bits(1_000);
        for (setpoint, expected) in [(at(1 << 62, 0), 1_000), (at(-(1 << 62), 500), -1_000), (at(0, 2_000), 1_000)] {
            assert_eq!(settings.follow(&up_to(limit), setpoint, Position::ZERO).velocity.to_bits(), expected);
        }
    }

    #[test]
    fn an_axis_that_is_fed_more_than_its_velocity_is_expected_to_lead() {
        // Kv 62.5 1/s at 10 rev/s: 20 % too much are 0.032 revolutions, 20 % too little as many the other way.
        let lag = |feed_forward| {
            let settings = PositionLoopSettings::new(375, feed_forward).unwrap();
            settings.lag(Velocity::from_bits(((10_i64 << 36) / 8_000) as i32)).to_bits()
        };
        for (feed_forward, expected) in
            [(12_000, -(1 << 32) * 32 / 1_000), (8_000, (1 << 32) * 32 / 1_000), (10_000, 0)]
        {
            assert!((lag(feed_forward) - expected).abs() < 1 << 12, "{feed_forward}: {}", lag(feed_forward));
        }
    }

    #[test]
    fn impossible_gains_are_refused() {
        assert_eq!(
            PositionLoopSettings::new(0, 0),
            Err(SettingsError::Zero { parameter: "position loop Kv-factor S-0-0104" })
        );
        assert_eq!(PositionLoopSettings::new(1, 12_001), Err(SettingsError::FeedForward { actual: 12_001 }));
        assert!(PositionLoopSettings::new(1, 0).is_ok() && PositionLoopSettings::new(u16::MAX, 0).is_ok());
    }
}
