//! The answer of the axis to a sine of the current, at one frequency, while it turns and its velocity loop is closed.
//!
//! The axis turns at a constant velocity, so that its friction is a constant. A sine is added to the current behind the velocity loop and its
//! filters. Three signals are correlated with it over whole periods: what the loop itself asks for, what flows in all, and the movement of
//! each tick.
//!
//! ```text
//!                      sine
//!                       |
//! velocity loop --own---+---total---> current loop, motor, shaft, encoder ---movement--+
//!       ^                                                                              |
//!       +------------------------------------------------------------------------------+
//!
//! axis = movement / total      open loop = - own / total
//! ```
//!
//! All three have the same sine in them, so that each ratio is right however much the loop takes back, and noise that has nothing to do
//! with the sine falls out of it. All delays are in it: those of the encoder, the ticks and the current loop.
//!
//! Sine and correlation are those of [`Rotation`] and [`Phasor`]: 32 bits of phase, a table, two products a signal. The lock-in of `idsp` has an
//! IIR behind the mixer, which has to settle; a sum over whole periods has an end, and a constant adds nothing to it.
//!
//! Movement: `v * (window + 0.2 s) + v^2 / a` in the direction of the velocity.

use super::phasor::Phasor;
use super::velocity_ramp::{Motion, VelocityRamp};
use super::{
    IdentificationError, IdentificationInputs, IdentificationOutput, IdentificationParameters, IdentificationState,
    Range,
};
use crate::arithmetic::division::divide_rounding;
use crate::arithmetic::response::{Response, scaled};
use crate::arithmetic::trigonometry::Rotation;
use crate::error::{SettingsError, in_range};
use crate::units::{CurrentFraction, LOOP_TICKS_PER_SECOND, Position, Velocity};

/// A frequency of which whole periods fill a window of the loop's ticks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ExcitationFrequency {
    periods: u32,
    /// The window has 2^so many ticks.
    bits: u32,
}

/// The shortest window is 256 ms, the longest 1 s.
const SHORTEST: u32 = 11;
const LONGEST: u32 = 13;
/// Frequencies of a sweep.
pub const SWEEP: u8 = 44;
/// 10 Hz.
const LOWEST: u32 = 1_000;
/// 2^16 times the logarithm of 200 to the base of 2, over 43.
const SWEEP_STEP: i32 = 11_650;
/// Frequencies around one.
pub const CLOSE_LOOK: u8 = 9;
/// 3.2 %.
const CLOSE_STEP: i32 = 2_949;
/// Half of the ticks: above 2.4 kHz the samples of a period are too few.
const HIGHEST: u32 = 240_000;

impl ExcitationFrequency {
    /// The nearest to one in 0.01 Hz that has at least so many periods in its window, which is 256 ms to 1 s long; at most 2.4 kHz. Divides.
    #[must_use]
    pub fn near(hundredths: u32, periods: u32) -> Self {
        let rate = i128::from(LOOP_TICKS_PER_SECOND).saturating_mul(100);
        let hundredths = i128::from(hundredths.min(HIGHEST));
        let in_window = |bits: u32| divide_rounding(hundredths << bits, rate).max(1) as u32;
        let bits = (SHORTEST..LONGEST).find(|&bits| in_window(bits) >= periods).unwrap_or(LONGEST);
        Self { periods: in_window(bits), bits }
    }

    /// Those of a sweep from 10 Hz to 2 kHz, each 13 % above the last one. Divides.
    #[must_use]
    pub fn of_sweep(index: u8) -> Self {
        Self::near(scaled(LOWEST, i32::from(index).saturating_mul(SWEEP_STEP)), 8)
    }

    /// Nine around one in 0.01 Hz, from 12 % below to 13 % above, for a look at what lies between those of the sweep. Divides.
    #[must_use]
    pub fn around(hundredths: u32, index: u8) -> Self {
        Self::near(scaled(hundredths, i32::from(index).saturating_sub(4).saturating_mul(CLOSE_STEP)), 32)
    }

    /// In 0.01 Hz, to the nearest. Divides.
    #[must_use]
    pub fn hundredths(self) -> u32 {
        let rate = i128::from(LOOP_TICKS_PER_SECOND).saturating_mul(100);
        divide_rounding(rate.saturating_mul(self.periods.into()), 1 << self.bits) as u32
    }

    /// Ticks of the window.
    #[must_use]
    pub const fn ticks(self) -> u32 {
        1 << self.bits
    }
}

/// Settings of the sequence.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ExcitationSettings {
    motion: Motion,
    frequency: ExcitationFrequency,
    amplitude: CurrentFraction,
    /// Where the first of several sequences began; `None`: where this one begins.
    origin: Option<Position>,
}

impl ExcitationSettings {
    /// Uses velocity, acceleration and movement of the parameters: from `origin`, or from where the sequence begins. `amplitude` is that of the
    /// sine. Divides.
    ///
    /// # Errors
    /// [`SettingsError::OutOfRange`], also where the way does not fit into the movement.
    pub fn new(
        parameters: &IdentificationParameters,
        frequency: ExcitationFrequency,
        amplitude: CurrentFraction,
        origin: Option<Position>,
    ) -> Result<Self, SettingsError> {
        let motion = Motion::new(parameters)?;
        in_range("amplitude of the excitation", amplitude.to_bits().max(0).unsigned_abs().into(), 1, 16_384)?;
        let settings = Self { motion, frequency, amplitude, origin };
        let hundredths = |way: i64| u32::try_from(way.saturating_mul(100) >> 32).unwrap_or(u32::MAX);
        let room = hundredths(parameters.movement.to_bits());
        in_range("way of the excitation in 0.01 revolutions", hundredths(settings.way().to_bits()), 0, room)?;
        Ok(settings)
    }

    /// What the axis turns by, without what it needs to be stopped.
    #[must_use]
    pub fn way(&self) -> Position {
        let ticks = self.frequency.ticks().saturating_add(SETTLING).saturating_add(self.ramp().saturating_mul(2));
        let bits = i64::from(self.motion.high.abs().to_bits()).saturating_mul(ticks.into());
        // 2^-36 to 2^-32 of a revolution.
        Position::from_bits(bits >> 4)
    }

    /// Ticks of a ramp.
    const fn ramp(&self) -> u32 {
        self.motion.ramp.saturating_mul(2)
    }
}

/// From the end of the ramp to the window, with the sine: 200 ms, in which a loop of 5 Hz forgets the ramp.
const SETTLING: u32 = 1_600;
/// From the end of the last ramp to that of the sequence: 100 ms.
const RESTING: u32 = 800;

/// What the velocity loop and the excitation have made of the last tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Commanded {
    /// Current of the loop, behind its filters.
    pub own: CurrentFraction,
    /// With the excitation.
    pub total: CurrentFraction,
    /// A limit has held one of them back.
    pub is_limited: bool,
}

impl Commanded {
    /// Nothing.
    pub const NONE: Self = Self { own: CurrentFraction::ZERO, total: CurrentFraction::ZERO, is_limited: false };
}

/// What is asked for until the next tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ExcitationRequest {
    /// Command of the velocity loop.
    pub velocity: Velocity,
    /// To be added to the current.
    pub current: CurrentFraction,
}

/// What was measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ExcitationMeasurement {
    frequency: ExcitationFrequency,
    own: Phasor,
    total: Phasor,
    movement: Phasor,
}

impl ExcitationMeasurement {
    /// Its frequency.
    #[must_use]
    pub const fn frequency(&self) -> ExcitationFrequency {
        self.frequency
    }

    /// From the current, in shares of peak, to the movement, in 2^-10 revolution a tick. Divides.
    ///
    /// # Errors
    /// [`IdentificationError::NoMovement`] where nothing has answered.
    pub fn axis(&self) -> Result<Response, IdentificationError> {
        let [movement, total] = [self.movement, self.total].map(of_phasor);
        Ok(movement?.over(total?))
    }

    /// Of the velocity loop. Divides.
    ///
    /// # Errors
    /// [`IdentificationError::NoMovement`] where nothing has answered.
    pub fn open_loop(&self) -> Result<Response, IdentificationError> {
        let [own, total] = [self.own, self.total].map(of_phasor);
        Ok(own?.over(total?).negated())
    }
}

fn of_phasor(phasor: Phasor) -> Result<Response, IdentificationError> {
    Response::of_vector(phasor.real, phasor.imaginary).ok_or(IdentificationError::NoMovement)
}

/// State of the sequence.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ExcitationIdentification {
    settings: ExcitationSettings,
    range: Range,
    state: IdentificationState<ExcitationMeasurement>,
    stage: Stage,
    /// Ticks until the end of the stage.
    left: u32,
    ramp: VelocityRamp,
    phase: u32,
    /// Of the last tick, if that was in the window.
    last: Option<Rotation>,
    position: Position,
    start: Position,
    is_limited: bool,
    own: Phasor,
    total: Phasor,
    movement: Phasor,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
enum Stage {
    Ramp,
    Settling,
    Window,
    Stop,
}

impl ExcitationIdentification {
    /// Begins at this position; the motor stands, the velocity loop is closed.
    #[must_use]
    pub fn start(settings: ExcitationSettings, position: Position) -> Self {
        let origin = settings.origin.unwrap_or(position);
        Self {
            settings,
            range: Range { origin, maximum: settings.motion.movement },
            state: IdentificationState::Running { percent: 0 },
            stage: Stage::Ramp,
            left: settings.ramp(),
            ramp: VelocityRamp::default(),
            phase: 0,
            last: None,
            position,
            start: position,
            is_limited: false,
            own: Phasor::default(),
            total: Phasor::default(),
            movement: Phasor::default(),
        }
    }

    /// One tick, before that of the loops; `commanded` is what they made of the last one.
    #[inline]
    pub fn tick(
        &mut self,
        inputs: &IdentificationInputs,
        commanded: &Commanded,
    ) -> IdentificationOutput<ExcitationRequest, ExcitationMeasurement> {
        let mut request = ExcitationRequest { velocity: Velocity::ZERO, current: CurrentFraction::ZERO };
        if let IdentificationState::Running { .. } = self.state {
            match self.run(inputs, commanded) {
                Ok(None) => request = self.request(),
                Ok(Some(measurement)) => self.state = IdentificationState::Done(measurement),
                Err(error) => self.state = IdentificationState::Failed(error),
            }
        }
        IdentificationOutput { request, state: self.state }
    }

    /// The velocity of this tick, and the sine of the phase that [`Self::run`] has correlated with.
    #[inline]
    fn request(&mut self) -> ExcitationRequest {
        let motion = &self.settings.motion;
        let target = if self.stage == Stage::Stop { Velocity::ZERO } else { motion.high };
        let velocity = self.ramp.tick(motion, target);
        let is_excited = matches!(self.stage, Stage::Settling | Stage::Window);
        let amplitude = if is_excited { i64::from(self.settings.amplitude.to_bits()) } else { 0 };
        let sine = i64::from(Rotation::by(self.phase).sine);
        let current = amplitude.wrapping_mul(sine).wrapping_add(1 << 30) >> 31;
        if is_excited {
            let frequency = self.settings.frequency;
            // Less than a half of 2^32.
            self.phase = self.phase.wrapping_add(frequency.periods.wrapping_shl(32_u32.wrapping_sub(frequency.bits)));
        }
        ExcitationRequest { velocity, current: CurrentFraction::from_bits(current as i16) }
    }

    #[inline]
    fn run(
        &mut self,
        inputs: &IdentificationInputs,
        commanded: &Commanded,
    ) -> Result<Option<ExcitationMeasurement>, IdentificationError> {
        self.range.check(inputs.position)?;
        let moved = Velocity::of_a_tick(inputs.position - self.position);
        self.position = inputs.position;
        self.is_limited |= inputs.is_at_voltage_limit();
        if let Some(rotation) = self.last.take() {
            // 2^-15 to 2^-26 of peak.
            let current = |current: CurrentFraction| i32::from(current.to_bits()) << 11;
            self.own.add(current(commanded.own), rotation);
            self.total.add(current(commanded.total), rotation);
            self.is_limited |= commanded.is_limited;
        }
        if self.left == 0 {
            let settings = &self.settings;
            (self.stage, self.left) = match self.stage {
                Stage::Ramp => (Stage::Settling, SETTLING),
                Stage::Settling => {
                    self.start = inputs.position;
                    (Stage::Window, settings.frequency.ticks())
                }
                Stage::Window => {
                    self.look_at_the_way(inputs.position)?;
                    (Stage::Stop, settings.ramp().wrapping_add(RESTING))
                }
                Stage::Stop => return Ok(Some(self.measurement())),
            };
        }
        self.left = self.left.wrapping_sub(1);
        if self.stage == Stage::Window {
            let rotation = Rotation::by(self.phase);
            self.movement.add(moved.to_bits(), rotation);
            self.last = Some(rotation);
        }
        Ok(None)
    }

    /// The axis has turned as it should, within a quarter, and no limit has bent the sine.
    #[inline]
    fn look_at_the_way(&self, position: Position) -> Result<(), IdentificationError> {
        if self.is_limited {
            return Err(IdentificationError::CurrentLimit);
        }
        let settings = &self.settings;
        let expected = i64::from(settings.motion.high.to_bits()) << settings.frequency.bits.wrapping_sub(4);
        let way = (position - self.start).to_bits();
        let along = if expected < 0 { way.wrapping_neg() } else { way };
        let whole = expected.wrapping_abs();
        if along < whole >> 2 {
            return Err(IdentificationError::NoMovement);
        }
        if along.wrapping_sub(whole).wrapping_abs() > whole >> 2 {
            return Err(IdentificationError::Unstable);
        }
        Ok(())
    }

    #[inline]
    fn measurement(&self) -> ExcitationMeasurement {
        ExcitationMeasurement {
            frequency: self.settings.frequency,
            own: self.own,
            total: self.total,
            movement: self.movement,
        }
    }
}

#[cfg(test)]
mod tests;
