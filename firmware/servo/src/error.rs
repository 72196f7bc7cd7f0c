//! Why settings are refused.

use core::fmt;

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
        /// Amplitude of S-0-0110 in mA.
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
    /// The encoder must not make more increments a second than its inputs count.
    EncoderRate {
        /// Increments a second at S-0-0113.
        actual: u32,
        /// What the board counts for certain.
        maximum: u32,
    },
    /// The magnets must not induce more than the DC link bears when field weakening ends.
    InducedVoltage {
        /// Peak voltage between two phases at S-0-0113, in V.
        actual: u32,
        /// P-0-0239 in V.
        maximum: u32,
    },
    /// The shut-down temperature must not be above the hottest that the sensor shows.
    BeyondSensor {
        /// Shut-down temperature in 0.1 degree C.
        actual: u16,
        /// Hottest that the sensor shows, in 0.1 degree C.
        hottest: u16,
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
                write!(
                    formatter,
                    "measuring range of {actual} mA, expected 1 to 8 times {peak} mA, the amplitude of S-0-0110"
                )
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
            Self::EncoderRate { actual, maximum } => {
                write!(formatter, "{actual} increments of the encoder a second, expected at most {maximum}")
            }
            Self::InducedVoltage { actual, maximum } => {
                write!(
                    formatter,
                    "magnets induce {actual} V between two phases at this speed, expected at most P-0-0239 of {maximum} V"
                )
            }
            Self::BeyondSensor { actual, hottest } => {
                write!(
                    formatter,
                    "shut-down temperature of {actual} in 0.1 degree C, the sensor shows {hottest} at most"
                )
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
