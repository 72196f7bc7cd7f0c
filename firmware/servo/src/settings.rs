//! All settings of an axis: from the units of the IDNs to the scaled form of the loops.

use core::fmt;

use crate::trigonometry::high_product;
use crate::{
    Acceleration, CommandLimits, CurrentFilterSettings, FrictionSettings, Interpolation, InterpolatorSettings, Jerk,
    Modulo, MotionLimits, Position, PositionLoopSettings, Velocity, VelocityFilter, VelocityLimits,
    VelocityLoopSettings,
};

/// A parameter that the loops cannot work with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum SettingsError {
    /// This parameter must not be zero.
    Zero {
        /// Name and, where it has one, IDN.
        parameter: &'static str,
    },
    /// A control unit cycle must have 4 to 520 loop ticks (500 us to 65 ms).
    TicksPerCycle {
        /// Ticks asked for.
        actual: u16,
    },
    /// The velocity feed-forward must not exceed 120 % (12 000).
    FeedForward {
        /// In 0.01 %.
        actual: u16,
    },
    /// The velocity loop gain is too high for this integral time and peak current.
    VelocityGain {
        /// In mA s/rad.
        actual: u32,
    },
    /// The modulo value must be 1/16 to 2^30 revolutions of the motor.
    ModuloOutOfRange,
    /// The position data must have 4 to 2^31 increments per revolution of the motor.
    PositionScaleOutOfRange,
    /// An increment of the velocity data must be 10^-9 to 100 rpm.
    VelocityScaleOutOfRange,
    /// An increment of the torque data must be at most the peak current, and 32 767 of them at least 2^-15 of it.
    TorqueScaleOutOfRange,
    /// The measuring range of the phase currents must be 1 to 8 times the peak current.
    MeasuringRange {
        /// In mA.
        actual: u32,
        /// S-0-0110 in mA.
        peak: u32,
    },
    /// The current loop gain is too high for the peak current and the integral action time.
    CurrentGain {
        /// In mV/A.
        actual: u32,
    },
    /// The dead time must not exceed 10 us.
    DeadTime {
        /// In ns.
        actual: u32,
    },
    /// Flux linkage of the magnets, or inductance times peak current, must stay below 2.5 Vs.
    FluxLinkage,
    /// The loop timer must have 200 to 32 767 counts in a loop period.
    LoopTimerCounts {
        /// Counts given.
        actual: u16,
    },
    /// This parameter must lie within `minimum ..= maximum`.
    OutOfRange {
        /// Name and, where it has one, IDN.
        parameter: &'static str,
        /// Value given, in the unit of the parameter.
        actual: u32,
        /// Smallest value that the loops can work with.
        minimum: u32,
        /// Largest value that the loops can work with.
        maximum: u32,
    },
    /// The acceleration or jerk of a movement is too low: braking from its velocity limit takes more than 16 000 000 loop ticks (2000 s).
    BrakingTime {
        /// Loop ticks that it takes.
        actual: u64,
    },
    /// A jerk limit must be at least 0.74 rad/s³, and an acceleration limit four ticks of that.
    TooSmooth {
        /// The jerk in 2^-48 revolution per tick cubed, or a quarter of the acceleration.
        actual: u64,
    },
    /// The feedrate override must not exceed 100 % (10 000).
    FeedrateOverride {
        /// In 0.01 %.
        actual: u16,
    },
}

impl fmt::Display for SettingsError {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Zero { parameter } => write!(formatter, "{parameter} is zero"),
            Self::TicksPerCycle { actual } => {
                write!(formatter, "{actual} loop ticks per control unit cycle, expected 4 to 520")
            }
            Self::FeedForward { actual } => {
                write!(formatter, "velocity feed-forward of {actual} in 0.01 %, expected at most 12000")
            }
            Self::VelocityGain { actual } => write!(formatter, "velocity loop gain of {actual} mA s/rad is too high"),
            Self::ModuloOutOfRange => {
                formatter.write_str("modulo value is not within 1/16 to 2^30 revolutions of the motor")
            }
            Self::PositionScaleOutOfRange => {
                formatter.write_str("position scaling is not within 4 to 2^31 increments per revolution")
            }
            Self::VelocityScaleOutOfRange => {
                formatter.write_str("velocity scaling is not within 10^-9 to 100 rpm per increment")
            }
            Self::TorqueScaleOutOfRange => {
                formatter.write_str("torque scaling is not within 10^-9 to 1 of the peak current per increment")
            }
            Self::MeasuringRange { actual, peak } => {
                write!(formatter, "measuring range of {actual} mA, expected 1 to 8 times the peak current of {peak} mA")
            }
            Self::CurrentGain { actual } => write!(formatter, "current loop gain of {actual} mV/A is too high"),
            Self::DeadTime { actual } => write!(formatter, "dead time of {actual} ns, expected at most 10000"),
            Self::FluxLinkage => {
                formatter.write_str("flux linkage or inductance times peak current is not below 2.5 Vs")
            }
            Self::LoopTimerCounts { actual } => {
                write!(formatter, "{actual} counts per loop period, expected 200 to 32767")
            }
            Self::OutOfRange { parameter, actual, minimum, maximum } => {
                write!(formatter, "{parameter} of {actual}, expected {minimum} to {maximum}")
            }
            Self::BrakingTime { actual } => {
                write!(formatter, "braking takes {actual} loop ticks, expected at most 16000000")
            }
            Self::TooSmooth { actual } => {
                write!(formatter, "jerk of {actual} in 2^-48 revolution per tick cubed, expected at least 64")
            }
            Self::FeedrateOverride { actual } => {
                write!(formatter, "feedrate override of {actual} in 0.01 %, expected at most 10000")
            }
        }
    }
}

impl core::error::Error for SettingsError {}

/// `actual` when it lies within `minimum ..= maximum`, else [`SettingsError::OutOfRange`].
pub(crate) const fn in_range(
    parameter: &'static str,
    actual: u32,
    minimum: u32,
    maximum: u32,
) -> Result<u32, SettingsError> {
    if actual < minimum || actual > maximum {
        return Err(SettingsError::OutOfRange { parameter, actual, minimum, maximum });
    }
    Ok(actual)
}

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
    /// Velocity loop proportional gain S-0-0100 in mA s/rad at the motor (one increment of the IDN, 0.1 A s/rad, is 100).
    pub velocity_gain: u32,
    /// Velocity loop integral action time S-0-0101 in 0.1 ms, 0: no integral part.
    pub integral_time: u16,
    /// Time constant of the velocity feedback filter S-0-0392 in microseconds.
    pub velocity_filter: u16,
    /// Acceleration feed-forward S-0-0348 in uA s²/rad, 0: none.
    pub acceleration_gain: u32,
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
    pub(crate) velocity_loop: VelocityLoopSettings,
    pub(crate) velocity_filter: VelocityFilter,
    pub(crate) velocity_limits: VelocityLimits,
    pub(crate) deceleration: Acceleration,
    pub(crate) friction: FrictionSettings,
    pub(crate) filter: CurrentFilterSettings,
    pub(crate) halt: MotionLimits,
    pub(crate) velocity_ramp: Option<MotionLimits>,
    pub(crate) standstill_window: Velocity,
    /// From a velocity to what it moves from the measurement to the tick, in 2^-32.
    pub(crate) age: i32,
}

/// Ramps of an axis, scaled: what may be exchanged while it moves, see [`crate::Axis::set_movements`].
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

/// A quarter of a tick: from 2^-36 to 2^-32 revolution, and two bits more.
const A_QUARTER: i32 = 1 << 26;

const fn or_unlimited(acceleration: Acceleration) -> Acceleration {
    match acceleration.to_bits() {
        0 => Acceleration::from_bits(u64::MAX),
        _ => acceleration,
    }
}

impl AxisSettings {
    /// The same for positions that belong to an instant a quarter of a loop tick before the tick, see [`crate::TwiceReadEncoder`]. Without it
    /// they belong to the tick.
    #[must_use]
    pub const fn measured_a_quarter_tick_ago(self) -> Self {
        Self { age: A_QUARTER, ..self }
    }

    /// Of two velocities a tick apart, the one at the instant of the measurement.
    #[inline]
    pub(crate) fn as_measured(&self, before: Velocity, now: Velocity) -> Velocity {
        // From 2^-32 to the share of a tick: four bits more.
        let since = high_product((now - before).to_bits(), self.age << 4);
        Velocity::from_bits(now.to_bits().wrapping_sub(since))
    }

    /// What an axis moves with this velocity from the measurement to the tick.
    #[inline]
    pub(crate) fn moved_since_measured(&self, velocity: Velocity) -> Position {
        Position::from_bits(high_product(velocity.to_bits(), self.age).into())
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
            age: 0,
            friction: parameters.friction,
            filter: parameters.filter,
            halt: movements.halt,
            velocity_ramp: movements.velocity_ramp,
            interpolator: InterpolatorSettings::new(parameters.ticks_per_cycle, parameters.modulo)?
                .with_interpolation(parameters.interpolation)
                .with_limits(CommandLimits::new(parameters.largest_step, parameters.monitoring_window)),
            position_loop: PositionLoopSettings::new(
                parameters.position_gain,
                parameters.feed_forward,
                parameters.monitoring_window,
            )?,
            velocity_loop: VelocityLoopSettings::new(
                parameters.velocity_gain,
                parameters.integral_time,
                parameters.acceleration_gain,
                parameters.peak_current,
            )?,
            velocity_filter: VelocityFilter::from_microseconds(parameters.velocity_filter),
            velocity_limits: parameters.velocity_limits,
            deceleration: movements.deceleration,
            standstill_window: parameters.standstill_window.abs(),
        })
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
