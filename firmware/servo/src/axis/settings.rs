//! All settings of an axis: from the units of the IDNs to the scaled form of the loops.

use crate::arithmetic::trigonometry::high_product;
use crate::axis::acceleration_gain::AccelerationSmoothing;
use crate::axis::expected_lag::DeviationSettings;
use crate::axis::filter::CurrentFilterSettings;
use crate::axis::friction::FrictionSettings;
use crate::axis::limits::VelocityLimits;
use crate::axis::position_loop::PositionLoopSettings;
use crate::axis::velocity_estimate::VelocityFilter;
use crate::axis::velocity_loop::VelocityLoopSettings;
use crate::axis::velocity_rate::VelocityRate;
use crate::error::SettingsError;
use crate::path::command_step::CommandLimits;
use crate::path::limits::MotionLimits;
use crate::path::settings::{Interpolation, InterpolatorSettings};
use crate::units::derivatives::Jerk;
use crate::units::modulo::Modulo;
use crate::units::{Acceleration, LOOP_PERIOD_MICROSECONDS, Position, Velocity};

/// Parameters of an axis in physical units, as the IDNs carry them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AxisParameters {
    /// Loop ticks of 125 us per control unit cycle (S-0-0001), 4 ..= 520.
    pub ticks_per_cycle: u16,
    /// Modulo value S-0-0103, or the range of the position data where they are absolute ([`Modulo::of_all_data`]); `None`: commands are
    /// unbounded positions.
    pub modulo: Option<Modulo>,
    /// Position loop Kv-factor S-0-0104 in 0.01 * 1000/min (1/6 1/s), 1 ..= 65 535.
    pub position_gain: u16,
    /// Velocity feed-forward in 0.01 %, 0 ..= 10 000 (10 000: without lag).
    pub feed_forward: u16,
    /// Velocity loop proportional gain S-0-0100 in mA s/rad at the motor (an increment of the IDN), RMS as `peak_current` is.
    pub velocity_gain: u32,
    /// Velocity loop integral action time S-0-0101 in 0.1 ms, 0: no integral part.
    pub integral_time: u16,
    /// How often the velocity loop runs.
    pub velocity_rate: VelocityRate,
    /// Time constant of the velocity feedback filter S-0-0392 in microseconds; 0: none.
    pub velocity_filter: u16,
    /// Acceleration feed-forward S-0-0348 in uA s²/rad, 0: none.
    pub acceleration_gain: u32,
    /// Time constant in us with which the acceleration feed-forward follows position commands, 0: at once.
    pub acceleration_smoothing: u16,
    /// Friction compensation of commanded velocities.
    pub friction: FrictionSettings,
    /// Filters of the current command.
    pub filter: CurrentFilterSettings,
    /// Amplifier peak current S-0-0110 in mA: the unit of the current command.
    pub peak_current: u32,
    /// Velocity limits S-0-0038, S-0-0039, S-0-0091.
    pub velocity_limits: VelocityLimits,
    /// Bipolar acceleration limit S-0-0138: brakes `Stopping`. Zero brakes without ramp, at the current limit.
    pub deceleration: Acceleration,
    /// Drive-halt acceleration S-0-0372; zero: as `deceleration`.
    pub halt_deceleration: Acceleration,
    /// Jerk limit S-0-0349 of `Halt` and of the velocity ramp; `None`: not limited.
    pub jerk: Option<Jerk>,
    /// Acceleration limits S-0-0136 and S-0-0137 of velocity commands; `None`: they are followed as they come.
    pub velocity_ramp: Option<(Acceleration, Acceleration)>,
    /// How position commands are joined.
    pub interpolation: Interpolation,
    /// Standstill window S-0-0124.
    pub standstill_window: Velocity,
    /// Monitoring window S-0-0159 for the deviation from the expected following error, and for the first position command; zero: not
    /// monitored.
    pub monitoring_window: Position,
    /// Largest step from a position command to the next, a control unit cycle later; zero: any.
    pub largest_step: Position,
}

/// Settings of an axis, scaled for the loops.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct AxisSettings {
    pub(crate) interpolator: InterpolatorSettings,
    pub(crate) position_loop: PositionLoopSettings,
    pub(crate) deviation: DeviationSettings,
    pub(crate) velocity_loop: VelocityLoopSettings,
    pub(crate) acceleration_smoothing: AccelerationSmoothing,
    pub(crate) velocity_rate: VelocityRate,
    pub(crate) velocity_filter: VelocityFilter,
    /// The measured velocity is the mean over a whole tick, else over a step of the velocity loop.
    pub(crate) spans_tick: bool,
    pub(crate) velocity_limits: VelocityLimits,
    pub(crate) deceleration: Acceleration,
    pub(crate) friction: FrictionSettings,
    pub(crate) filter: CurrentFilterSettings,
    pub(crate) halt: MotionLimits,
    pub(crate) velocity_ramp: Option<MotionLimits>,
    pub(crate) standstill_window: Velocity,
    /// From the instant of the measured position to that of the set-point which it is compared with, in 2^-28 tick.
    pub(crate) lead: i32,
    /// The same for what is made of the velocities of two ticks, in a tick and half a tick later: of lines not more than from one to the other.
    velocity_leads: [i32; 2],
}

/// Ramps of an axis, scaled: what may be exchanged while it moves, see [`crate::axis::Axis::set_movements`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct AxisMovements {
    pub(crate) deceleration: Acceleration,
    pub(crate) halt: MotionLimits,
    pub(crate) velocity_ramp: Option<MotionLimits>,
}

impl AxisMovements {
    /// * `fastest`: no velocity command is faster.
    /// * The others as in [`AxisParameters`].
    ///
    /// Divides.
    ///
    /// # Errors
    /// Those of [`MotionLimits::new`].
    pub fn new(
        fastest: Velocity,
        deceleration: Acceleration,
        halt_deceleration: Acceleration,
        velocity_ramp: Option<(Acceleration, Acceleration)>,
        jerk: Option<Jerk>,
    ) -> Result<Self, SettingsError> {
        let deceleration = or_unlimited(deceleration);
        let halt = match halt_deceleration.to_bits() {
            0 => deceleration,
            _ => halt_deceleration,
        };
        Ok(Self {
            deceleration,
            halt: MotionLimits::new(Velocity::MAX, halt, halt, jerk)?,
            velocity_ramp: match velocity_ramp {
                Some((up, down)) => Some(MotionLimits::new(fastest, or_unlimited(up), or_unlimited(down), jerk)?),
                None => None,
            },
        })
    }
}

/// In [`AxisSettings::lead`]: from 2^-36 to 2^-32 revolution are four bits.
const TICK: i32 = 1 << 28;

/// Of two velocities a tick apart, the one that is so long before the later one, in 2^-28 tick.
#[inline]
fn between(before: Velocity, now: Velocity, lead: i32) -> Velocity {
    // From 2^-32 of 2^28: four bits less, 0.0001 rpm.
    let since = high_product((now - before).to_bits(), lead);
    Velocity::from_bits(now.to_bits().wrapping_sub(since << 4))
}

const fn or_unlimited(acceleration: Acceleration) -> Acceleration {
    match acceleration.to_bits() {
        0 => Acceleration::from_bits(u64::MAX),
        _ => acceleration,
    }
}

impl AxisSettings {
    /// The same where the set-point of a tick belongs to an instant so many ns after that of the position which is measured in the tick; at
    /// most 999 000 either way, beyond it counts as that. Without it the two are of one instant.
    ///
    /// Between the ticks the set-point is a straight line: up to a tick that is exact on lines, and beyond it the velocity of the last tick
    /// goes on before or behind it. The velocity that is fed forward follows a cubic however far it is; of lines, whose velocity jumps, it is
    /// at most that of the tick before.
    #[must_use]
    pub const fn with_setpoint_ahead(self, nanoseconds: i32) -> Self {
        const PERIOD: i64 = LOOP_PERIOD_MICROSECONDS as i64 * 1_000;
        let limited = if nanoseconds > 999_000 {
            999_000
        } else if nanoseconds < -999_000 {
            -999_000
        } else {
            nanoseconds as i64
        };
        // Below 8 ticks.
        let lead = ((limited << 28) / PERIOD) as i32;
        // A velocity belongs to the middle of the way that it is the mean over: that of the set-point to half a tick before its position.
        let measured_before = match (self.velocity_rate, self.spans_tick) {
            (VelocityRate::EachTick, _) => [TICK / 2, 0],
            (VelocityRate::TwiceATick, true) => [TICK / 4, -TICK / 4],
            (VelocityRate::TwiceATick, false) => [0, -TICK / 2],
        };
        let [now, later] = measured_before;
        let velocity_leads = [
            self.within_path(lead.wrapping_sub(TICK / 2).wrapping_add(now)),
            self.within_path(lead.wrapping_sub(TICK / 2).wrapping_add(later)),
        ];
        Self { lead, velocity_leads, ..self }
    }

    /// Of lines, whose velocity jumps, no further than from one tick to the next.
    const fn within_path(&self, lead: i32) -> i32 {
        match self.interpolator.interpolation() {
            Interpolation::Linear if lead < 0 => 0,
            Interpolation::Linear if lead > TICK => TICK,
            _ => lead,
        }
    }

    /// Of the set-point's velocities in two ticks, the one that the axis is measured to have on it in the later tick.
    #[inline]
    pub(crate) fn as_measured(&self, before: Velocity, now: Velocity) -> Velocity {
        let [lead, _] = self.velocity_leads;
        between(before, now, lead)
    }

    /// And half a tick later.
    #[inline]
    pub(crate) fn as_measured_later(&self, before: Velocity, now: Velocity) -> Velocity {
        let [_, lead] = self.velocity_leads;
        between(before, now, lead)
    }

    /// What the set-point moves with this velocity from the instant of the measurement to its own.
    #[inline]
    pub(crate) fn moved_since_measured(&self, velocity: Velocity) -> Position {
        Position::from_bits(high_product(velocity.to_bits(), self.lead).into())
    }

    /// Scales the parameters. Divides: call it when a parameter changes, outside the loop.
    ///
    /// # Errors
    /// The first parameter that the loops cannot work with.
    pub fn new(parameters: &AxisParameters) -> Result<Self, SettingsError> {
        let fastest = parameters.velocity_limits.largest();
        if fastest <= Velocity::ZERO {
            return Err(SettingsError::Zero { parameter: "bipolar velocity limit S-0-0091" });
        }
        let movements = AxisMovements::new(
            fastest,
            parameters.deceleration,
            parameters.halt_deceleration,
            parameters.velocity_ramp,
            parameters.jerk,
        )?;
        Ok(Self {
            lead: 0,
            velocity_leads: [0; 2],
            velocity_rate: parameters.velocity_rate,
            spans_tick: matches!(parameters.velocity_rate, VelocityRate::TwiceATick) && parameters.velocity_filter > 0,
            friction: parameters.friction,
            filter: parameters.filter,
            halt: movements.halt,
            velocity_ramp: movements.velocity_ramp,
            interpolator: InterpolatorSettings::new(parameters.ticks_per_cycle, parameters.modulo)?
                .with_interpolation(parameters.interpolation)
                .with_limits(CommandLimits::new(parameters.largest_step, parameters.monitoring_window)),
            position_loop: PositionLoopSettings::new(parameters.position_gain, parameters.feed_forward)?,
            deviation: DeviationSettings::new(parameters.position_gain, parameters.monitoring_window),
            velocity_loop: VelocityLoopSettings::new(
                parameters.velocity_gain,
                parameters.integral_time,
                parameters.acceleration_gain,
                parameters.peak_current,
                parameters.velocity_rate,
            )?,
            acceleration_smoothing: AccelerationSmoothing::new(
                parameters.acceleration_smoothing,
                parameters.ticks_per_cycle,
            ),
            velocity_filter: VelocityFilter::new(parameters.velocity_filter, parameters.velocity_rate),
            velocity_limits: parameters.velocity_limits,
            deceleration: movements.deceleration,
            standstill_window: parameters.standstill_window.abs(),
        }
        .with_setpoint_ahead(0))
    }

    /// Limits of the velocity command in force.
    #[must_use]
    pub const fn velocity_limits(&self) -> VelocityLimits {
        self.velocity_limits
    }

    /// Ticks and modulo value of the command interpolation.
    #[must_use]
    pub const fn interpolator(&self) -> &InterpolatorSettings {
        &self.interpolator
    }
}
