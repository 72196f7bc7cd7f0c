//! Identification of the motor: what the loops need to know of it, measured with the drive's own currents and voltages.
//!
//! | sequence | asks for | result | movement |
//! |---|---|---|---|
//! | [`ResistanceIdentification`] | three d currents | phase resistance | the rotor turns to the angle of the current |
//! | [`InductanceIdentification`] | d current, alternating voltage | inductances of d and q axis | as above, then it shivers |
//! | [`FluxIdentification`] | two velocities | flux linkage, torque constant | revolutions, in one direction |
//! | [`InertiaIdentification`] | two velocities, ramps between them | inertia and friction | revolutions, in one direction |
//!
//! Each is ticked like the loops, every 125 us, and ends with a measurement or with an [`IdentificationError`]. A measurement carries what
//! was summed up; its result takes divisions and is therefore asked for outside the tick. When a sequence has ended it asks for no current,
//! no voltage and velocity zero; a drive whose sequence has failed in motion stops the motor as it does after any other error.
//!
//! Movement is bounded: when the motor leaves the place where it started by more than is stated for the sequence, it fails with
//! [`IdentificationError::TooMuchMovement`].
//!
//! All quantities are those of a phase, from terminal to star point, and of amplitudes: a d or q current of 1 A is a phase current with an
//! amplitude of 1 A.

mod flux;
mod inductance;
mod inertia;
mod interval;
mod phasor;
mod resistance;
mod velocity_ramp;
mod window;

use core::fmt;

pub use flux::{Flux, FluxIdentification, FluxMeasurement, FluxSettings};
pub use inductance::{InductanceIdentification, InductanceMeasurement, InductanceSettings, Inductances};
pub use inertia::{Inertia, InertiaIdentification, InertiaMeasurement, InertiaSettings};
pub use resistance::{ResistanceIdentification, ResistanceMeasurement, ResistanceSettings};

use crate::arithmetic::division::divide_rounding;
use crate::current::readings::CurrentReadings;
use crate::current::settings::PwmFrequency;
use crate::error::{SettingsError, in_range};
use crate::units::{Acceleration, CurrentFraction, Position, Velocity};

/// Why a sequence gave no result.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum IdentificationError {
    /// The result is not that of a motor which the drive can control.
    OutOfRange {
        /// In the unit of the result.
        actual: i64,
        /// Smallest value that is believed.
        minimum: i64,
        /// Largest value that is believed.
        maximum: i64,
    },
    /// The current did not come, although voltage was left: bridge off, current limited elsewhere, gain too low.
    CurrentNotReached {
        /// In 2^-26 of peak.
        actual: i32,
        /// In 2^-26 of peak.
        expected: i32,
    },
    /// The motor does not turn: axis blocked, brake closed, or the current limit too low for the load.
    NoMovement,
    /// The bus voltage is too low for the current or speed: winding open, or the limit set too high for this motor.
    VoltageLimit,
    /// Current, voltage or speed do not settle, or do not go in proportion: loops not damped, a load that varies, a loose connection.
    Unstable,
    /// The motor turned further than the sequence may.
    TooMuchMovement {
        /// Way from the start, in 2^-32 revolution.
        actual: i64,
        /// Limit, in 2^-32 revolution.
        maximum: i64,
    },
}

impl fmt::Display for IdentificationError {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::OutOfRange { actual, minimum, maximum } => {
                write!(formatter, "identification gives {actual}, expected {minimum} to {maximum}")
            }
            Self::CurrentNotReached { actual, expected } => {
                write!(formatter, "current of {actual} in 2^-26 of peak, expected {expected}")
            }
            Self::NoMovement => formatter.write_str("the motor does not turn"),
            Self::VoltageLimit => formatter.write_str("the bus voltage is too low for the identification"),
            Self::Unstable => formatter.write_str("current, voltage or speed do not settle"),
            Self::TooMuchMovement { actual, maximum } => {
                write!(formatter, "the motor turned by {actual} in 2^-32 revolution, expected at most {maximum}")
            }
        }
    }
}

impl core::error::Error for IdentificationError {}

/// How far a sequence has come; `M` is its measurement.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum IdentificationState<M> {
    /// Under way.
    Running {
        /// 0 to 99; never falls.
        percent: u8,
    },
    /// Measured; the result is for the taking.
    Done(M),
    /// Given up.
    Failed(IdentificationError),
}

/// What a sequence looks at in a tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct IdentificationInputs {
    /// Of the current loop's cycle that started this tick.
    pub readings: CurrentReadings,
    /// Longest voltage vector, volt 2^-14 ([`crate::current::BusScale::longest`]).
    pub longest_voltage: i32,
    /// Position of the motor.
    pub position: Position,
}

impl IdentificationInputs {
    /// The voltage is within an eighth of what the bus gives.
    #[inline]
    fn is_at_voltage_limit(&self) -> bool {
        let square = |value: i32| i64::from(value).wrapping_mul(i64::from(value));
        let voltage = square(self.readings.direct_voltage).wrapping_add(square(self.readings.quadrature_voltage));
        // A voltage is below 2^25 in these units.
        voltage.wrapping_mul(64) >= square(self.longest_voltage).wrapping_mul(49)
    }
}

/// Currents and feed-forward voltages until the next tick, at the angle that the caller holds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CurrentRequest {
    /// Reference of the d axis.
    pub direct: CurrentFraction,
    /// Reference of the q axis.
    pub quadrature: CurrentFraction,
    /// Feed-forward of the d axis, volt 2^-14; takes the place of any other.
    pub direct_voltage: i32,
    /// Feed-forward of the q axis, volt 2^-14; takes the place of any other.
    pub quadrature_voltage: i32,
}

/// What a sequence asks for until the next tick, and its state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct IdentificationOutput<R, M> {
    /// Currents and voltages ([`CurrentRequest`]), or a [`Velocity`].
    pub request: R,
    /// State after this tick.
    pub state: IdentificationState<M>,
}

/// How hard and how far the motor may be driven for its identification.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct IdentificationParameters {
    /// Amplitude of the amplifier peak current S-0-0110 in mA: the unit of all current data.
    pub peak_current: u32,
    /// Highest standing d current in mA, from 1/32 of peak. Every phase should carry more than the band of the dead-time compensation at half
    /// of it; the continuous current of the motor is a good value.
    pub current: u32,
    /// Amplitude of the alternating current in mA, from 1/256 of peak up to half of `current`.
    pub ripple: u32,
    /// Pole pairs of the motor, 1 to 64.
    pub pole_pairs: u8,
    /// Highest velocity, forwards from 1 rpm or backwards. At half of it the motor must turn evenly.
    pub velocity: Velocity,
    /// Acceleration of the ramps; from standstill to `velocity` in at most 30 s.
    pub acceleration: Acceleration,
    /// How far the motor may turn from where it stands, for the sequences that turn it; up to 2^20 revolutions.
    pub movement: Position,
    /// Rate of the current loop.
    pub frequency: PwmFrequency,
}

impl IdentificationParameters {
    /// A current in 2^-26 of peak. Divides.
    fn scaled(&self, current: u32) -> i32 {
        let bits = divide_rounding(i128::from(current) << CURRENT_BITS, i128::from(self.peak_current));
        // At most 2^26, see `checked_currents`.
        bits as i32
    }

    /// The range of the currents.
    fn checked_currents(&self) -> Result<(), SettingsError> {
        let peak = in_range("amplifier peak current S-0-0110", self.peak_current, 256, 10_000_000)?;
        in_range("current of the identification", self.current, peak / 32, peak)?;
        in_range("ripple of the identification", self.ripple, peak / 256, self.current / 2)?;
        self.checked_pole_pairs().map(|_| ())
    }

    fn checked_pole_pairs(&self) -> Result<u32, SettingsError> {
        in_range("pole pairs", self.pole_pairs.into(), 1, 64)
    }

    /// An electrical revolution.
    fn electrical_revolution(&self) -> Position {
        Position::from_bits(divide_rounding(1 << 32, self.pole_pairs.into()))
    }
}

/// 2^26 steps are the peak current, as in the current loop.
const CURRENT_BITS: u32 = 26;

/// Where the sequence began and how far it may lead away from there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
struct Range {
    origin: Position,
    maximum: Position,
}

impl Range {
    #[inline]
    fn check(&self, position: Position) -> Result<(), IdentificationError> {
        let way = position - self.origin;
        if way.abs() > self.maximum {
            let (actual, maximum) = (way.to_bits(), self.maximum.to_bits());
            return Err(IdentificationError::TooMuchMovement { actual, maximum });
        }
        Ok(())
    }
}

/// Share of a time that has passed, without a division.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
struct Progress {
    /// Percent in a tick, in 2^-32.
    step: u32,
}

impl Progress {
    /// Divides.
    fn over(ticks: u32) -> Self {
        let step = divide_rounding(100 << 32, ticks.into());
        Self { step: u32::try_from(step).unwrap_or(u32::MAX) }
    }

    #[inline]
    fn percent(self, elapsed: u32) -> u8 {
        let percent = u64::from(self.step).wrapping_mul(u64::from(elapsed)) >> 32;
        percent.min(99) as u8
    }
}

/// A result within its range.
fn believed(actual: i64, minimum: u32, maximum: u32) -> Result<u32, IdentificationError> {
    let (minimum, maximum) = (i64::from(minimum), i64::from(maximum));
    if actual < minimum || actual > maximum {
        return Err(IdentificationError::OutOfRange { actual, minimum, maximum });
    }
    // Within the range of u32.
    Ok(actual as u32)
}
