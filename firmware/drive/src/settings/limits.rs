//! From the limits in the increments of their scaling to those of the loops, for the parameters and for what the MDT carries in their place.

use sercos::Idn;
use sercos::parameters::Parameters;
use servo::SettingsError;
use servo::axis::{AxisMovements, CommandedTorqueLimits, VelocityLimits};
use servo::path::{FeedrateOverride, MotionLimits};
use servo::units::{Acceleration, Jerk, Velocity, VelocityScale};

use super::invalid::{InvalidSetting, invalid, signed};
use super::limit_values::LimitValues;
use super::scaling::DerivativeScale;
use super::torque::TorqueScale;
use crate::operation_mode::Polarity;
use crate::signal::limit::Limit;

/// Everything that turns limits into those of the loops.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct LimitScale {
    velocity: VelocityScale,
    torque: TorqueScale,
    derivatives: DerivativeScale,
    /// S-0-0113.
    fastest: Velocity,
    /// S-0-0372.
    halt_deceleration: Acceleration,
    /// S-0-0359; zero: as S-0-0260.
    positioning_deceleration: Acceleration,
    /// S-0-0108 up to 100 %.
    feedrate: FeedrateOverride,
    /// S-0-0108 from 100 % on, in 0.01 %: beyond it makes S-0-0259 more, within S-0-0091.
    beyond: u16,
    /// Bit 0 of S-0-0043 and of S-0-0085: commands, and their limits, count against the motor.
    reversed: Reversed,
    /// What S-0-0138 takes off a velocity in a communication cycle: so fast a lowered velocity limit meets an axis that is faster.
    pub(crate) step: Velocity,
}

/// Directions of commands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
struct Reversed {
    velocity: bool,
    torque: bool,
}

impl LimitScale {
    /// Divides.
    ///
    /// # Errors
    /// S-0-0108.
    pub(super) fn new(
        parameters: &Parameters,
        velocity: VelocityScale,
        torque: TorqueScale,
        derivatives: DerivativeScale,
        ticks_per_cycle: u16,
    ) -> Result<Self, InvalidSetting> {
        let stored = LimitValues::new(parameters);
        let deceleration = derivatives.acceleration(bits(&stored, Limit::BipolarAcceleration)).to_bits();
        // From 2^-48 revolution a tick squared to 2^-36 a tick.
        let step = deceleration.saturating_mul(ticks_per_cycle.into()) >> 12;
        let percent = parameters.get_word(Idn::standard(108));
        Ok(Self {
            velocity,
            torque,
            derivatives,
            fastest: Velocity::from_ten_thousandths_rpm(signed(parameters, 113)),
            halt_deceleration: derivatives.acceleration(parameters.get(Idn::standard(372))),
            positioning_deceleration: derivatives.acceleration(parameters.get(Idn::standard(359))),
            feedrate: FeedrateOverride::new(percent.min(FULL_OVERRIDE)).map_err(invalid(108))?,
            beyond: percent.max(FULL_OVERRIDE),
            reversed: Reversed { velocity: command_reversed(parameters, 43), torque: command_reversed(parameters, 85) },
            step: Velocity::from_bits(i32::try_from(step).unwrap_or(i32::MAX).max(1)),
        })
    }

    /// S-0-0113.
    pub(super) const fn fastest(&self) -> Velocity {
        self.fastest
    }

    /// S-0-0091, within S-0-0113.
    fn bipolar(&self, values: &LimitValues) -> Velocity {
        self.velocity.to_velocity(values.get(Limit::BipolarVelocity)).min(self.fastest)
    }

    /// The velocity that a path of commands may have: S-0-0091, or S-0-0113 where the MDT carries S-0-0091, which may then become as much.
    pub(super) fn fastest_command(&self, parameters: &Parameters, stored: &LimitValues) -> Velocity {
        let is_cyclic = parameters.cyclic_mdt().contains(&Limit::BipolarVelocity.idn());
        if is_cyclic { self.fastest } else { self.bipolar(stored) }
    }

    /// S-0-0038, S-0-0039, S-0-0091. Does not divide.
    pub(crate) fn velocity_limits(&self, values: &LimitValues) -> VelocityLimits {
        let one_sided = |limit| {
            let value = values.get(limit);
            (value != 0).then(|| self.velocity.to_velocity(value))
        };
        let limits = VelocityLimits::new(
            self.bipolar(values),
            one_sided(Limit::PositiveVelocity),
            one_sided(Limit::NegativeVelocity),
        );
        if self.reversed.velocity { limits.reversed() } else { limits }
    }

    /// S-0-0082, S-0-0083, S-0-0092. Does not divide.
    pub(crate) fn torque_limits(&self, values: &LimitValues) -> CommandedTorqueLimits {
        let current = |limit| self.torque.current_of(values.get(limit).into());
        CommandedTorqueLimits {
            positive: current(Limit::PositiveTorque),
            negative: current(Limit::NegativeTorque),
            bipolar: current(Limit::BipolarTorque),
            reversed: self.reversed.torque,
        }
    }

    /// S-0-0138.
    pub(super) fn deceleration(&self, values: &LimitValues) -> Acceleration {
        self.derivatives.acceleration(bits(values, Limit::BipolarAcceleration))
    }

    /// S-0-0372.
    pub(super) const fn halt_deceleration(&self) -> Acceleration {
        self.halt_deceleration
    }

    /// S-0-0349; `None` for 0.
    pub(super) fn jerk(&self, values: &LimitValues) -> Option<Jerk> {
        self.derivatives.jerk(bits(values, Limit::BipolarJerk))
    }

    /// S-0-0136 and S-0-0137; `None` where both are 0.
    pub(super) fn velocity_ramp(&self, values: &LimitValues) -> Option<(Acceleration, Acceleration)> {
        let ramp = [Limit::PositiveAcceleration, Limit::NegativeAcceleration]
            .map(|limit| self.derivatives.acceleration(bits(values, limit)));
        (ramp[0].to_bits() | ramp[1].to_bits() != 0).then_some((ramp[0], ramp[1]))
    }

    /// Ramps of halt, stop and velocity commands: S-0-0136, S-0-0137, S-0-0138, S-0-0349. Divides.
    ///
    /// # Errors
    /// What the loops cannot work with.
    pub(crate) fn movements(&self, values: &LimitValues) -> Result<AxisMovements, SettingsError> {
        AxisMovements::new(
            self.fastest,
            self.deceleration(values),
            self.halt_deceleration,
            self.velocity_ramp(values),
            self.jerk(values),
        )
    }

    /// Movements to S-0-0258 and S-0-0282: S-0-0091, S-0-0193, S-0-0259, S-0-0260. Divides.
    ///
    /// # Errors
    /// What the loops cannot work with.
    pub(crate) fn positioning(&self, values: &LimitValues) -> Result<MotionLimits, SettingsError> {
        let wanted = i64::from(self.velocity.to_velocity(values.get(Limit::PositioningVelocity)).to_bits());
        let wanted = wanted.saturating_mul(self.beyond.into()).checked_div(FULL_OVERRIDE.into());
        let velocity = Velocity::saturating_from_bits(wanted.unwrap_or(i64::MAX)).min(self.bipolar(values));
        let acceleration = self.derivatives.acceleration(bits(values, Limit::PositioningAcceleration));
        let jerk = self.derivatives.jerk(bits(values, Limit::PositioningJerk));
        let deceleration = match self.positioning_deceleration.to_bits() {
            0 => acceleration,
            _ => self.positioning_deceleration,
        };
        MotionLimits::new(velocity, acceleration, deceleration, jerk).map(|limits| limits.with_override(self.feedrate))
    }
}

/// S-0-0108 of 100 %.
const FULL_OVERRIDE: u16 = 10_000;

/// Bit 0 of a polarity parameter.
fn command_reversed(parameters: &Parameters, number: u16) -> bool {
    Polarity::from_parameter(parameters.get_word(Idn::standard(number))).command
}

/// A magnitude.
fn bits(values: &LimitValues, limit: Limit) -> u32 {
    values.get(limit).unsigned_abs()
}
