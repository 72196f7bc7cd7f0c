//! The resistance of a phase, from the direct voltage at three standing currents.
//!
//! The voltage that the current loop gives is not what arrives at the motor: dead time and transistors take a part that has the sign of the
//! phase current and hardly depends on its size. It is the same at all three currents and cancels in the slope. The current in the middle
//! tells whether it does: the three points must lie on a line within an eighth of the way.
//!
//! The caller holds the angle still, of its own choice: the rotor turns there, or a brake holds it. Movement: one electrical
//! revolution at most, half of it and the overshoot when the rotor stands opposite the current. Takes 2.8 s.

use super::window::{Means, WINDOW, Window};
use super::{
    CURRENT_BITS, CurrentRequest, IdentificationError, IdentificationInputs, IdentificationOutput,
    IdentificationParameters, IdentificationState, Progress, Range, believed,
};
use crate::arithmetic::division::divide_rounding;
use crate::current::readings::CurrentReadings;
use crate::error::SettingsError;
use crate::units::{CurrentFraction, Position};

/// Settings of the sequence.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ResistanceSettings {
    peak_current: u32,
    /// A quarter of the highest current, 2^-26 of peak.
    quarter: i32,
    /// Of the current in a tick.
    step: i32,
    revolution: Position,
    progress: Progress,
}

impl ResistanceSettings {
    /// Uses currents and pole pairs of the parameters. Divides.
    ///
    /// # Errors
    /// [`SettingsError::OutOfRange`].
    pub fn new(parameters: &IdentificationParameters) -> Result<Self, SettingsError> {
        parameters.checked_currents()?;
        let quarter = parameters.scaled(parameters.current) / 4;
        Ok(Self {
            peak_current: parameters.peak_current,
            quarter,
            step: quarter.max(RAMP) / RAMP,
            revolution: parameters.electrical_revolution(),
            progress: Progress::over(TICKS),
        })
    }

    /// A load that takes more than this to be held turns the rotor away from the standing current, which begins at zero: an eighth of the
    /// highest one. Friction and the noise of the loops take less.
    #[must_use]
    pub fn largest_load(&self) -> CurrentFraction {
        CurrentReadings::fraction(self.quarter / 2)
    }

    /// Current of a level.
    #[inline]
    const fn current(&self, level: Level) -> i32 {
        let quarters = match level {
            Level::Half => 2,
            Level::ThreeQuarters => 3,
            Level::Full => 4,
        };
        self.quarter.wrapping_mul(quarters)
    }
}

/// A quarter of the current in this many ticks: 32 ms.
const RAMP: i32 = 256;
/// From the start of a level to its window. The first one waits until the rotor has come to rest.
const FIRST_SETTLING: u32 = 8_192;
const SETTLING: u32 = 4_096;
const TICKS: u32 = FIRST_SETTLING + 2 * SETTLING + 3 * WINDOW;

/// What was measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ResistanceMeasurement {
    peak_current: u32,
    /// Between the outer currents: volt 2^-14, and 2^-26 of peak.
    voltage: i32,
    current: i32,
}

impl ResistanceMeasurement {
    /// Resistance of a phase in milliohm. Divides.
    ///
    /// # Errors
    /// [`IdentificationError::OutOfRange`] below 5 milliohm and above 1 kiloohm.
    pub fn resistance(&self) -> Result<u32, IdentificationError> {
        let current = i128::from(self.current).saturating_mul(self.peak_current.into());
        let voltage = i128::from(self.voltage).saturating_mul(1_000_000) << (CURRENT_BITS - 14);
        believed(divide_rounding(voltage, current), 5, 1_000_000)
    }
}

/// State of the sequence.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ResistanceIdentification {
    settings: ResistanceSettings,
    range: Range,
    state: IdentificationState<ResistanceMeasurement>,
    elapsed: u32,
    level: Level,
    /// Ticks until the window of this level.
    settling: u32,
    /// 2^-26 of peak.
    current: i32,
    window: Window,
    half: Means,
    three_quarters: Means,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
enum Level {
    Half,
    ThreeQuarters,
    Full,
}

impl ResistanceIdentification {
    /// Begins at this position, the bridge on and without current.
    #[must_use]
    pub fn start(settings: ResistanceSettings, position: Position) -> Self {
        Self {
            settings,
            range: Range { origin: position, maximum: settings.revolution },
            state: IdentificationState::Running { percent: 0 },
            elapsed: 0,
            level: Level::Half,
            settling: FIRST_SETTLING,
            current: 0,
            window: Window::default(),
            half: Means::default(),
            three_quarters: Means::default(),
        }
    }

    /// One tick.
    #[inline]
    pub fn tick(
        &mut self,
        inputs: &IdentificationInputs,
    ) -> IdentificationOutput<CurrentRequest, ResistanceMeasurement> {
        if let IdentificationState::Running { .. } = self.state {
            self.elapsed = self.elapsed.wrapping_add(1);
            self.state = match self.run(inputs) {
                Ok(None) => IdentificationState::Running { percent: self.settings.progress.percent(self.elapsed) },
                Ok(Some(measurement)) => IdentificationState::Done(measurement),
                Err(error) => IdentificationState::Failed(error),
            };
        }
        let direct = match self.state {
            IdentificationState::Running { .. } => CurrentReadings::fraction(self.current),
            IdentificationState::Done(_) | IdentificationState::Failed(_) => CurrentFraction::ZERO,
        };
        IdentificationOutput { request: CurrentRequest { direct, ..CurrentRequest::default() }, state: self.state }
    }

    #[inline]
    fn run(&mut self, inputs: &IdentificationInputs) -> Result<Option<ResistanceMeasurement>, IdentificationError> {
        self.range.check(inputs.position)?;
        let target = self.settings.current(self.level);
        self.current = self.current.wrapping_add(self.settings.step).min(target);
        if self.settling > 0 {
            self.settling = self.settling.wrapping_sub(1);
            return Ok(None);
        }
        let Some(means) = self.window.add(inputs) else { return Ok(None) };
        means.check_current(target)?;
        self.window = Window::default();
        self.settling = SETTLING;
        match self.level {
            Level::Half => {
                self.half = means;
                self.level = Level::ThreeQuarters;
                Ok(None)
            }
            Level::ThreeQuarters => {
                self.three_quarters = means;
                self.level = Level::Full;
                Ok(None)
            }
            Level::Full => self.slope(&means).map(Some),
        }
    }

    #[inline]
    fn slope(&self, full: &Means) -> Result<ResistanceMeasurement, IdentificationError> {
        let voltage = full.direct_voltage.wrapping_sub(self.half.direct_voltage);
        let lower = self.three_quarters.direct_voltage.wrapping_sub(self.half.direct_voltage);
        let bend = lower.wrapping_mul(2).wrapping_sub(voltage);
        if bend.wrapping_abs() > (voltage.wrapping_abs() >> 3).wrapping_add(BEND) {
            return Err(IdentificationError::Unstable);
        }
        let current = full.direct.wrapping_sub(self.half.direct);
        Ok(ResistanceMeasurement { peak_current: self.settings.peak_current, voltage, current })
    }
}

/// Departure from the line that tells nothing: 10 mV.
const BEND: i32 = 164;
