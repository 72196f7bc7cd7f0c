//! Settings of the current loop: from the units of the parameters to the factors of a cycle.

use crate::arithmetic::division::divide_rounding;
use crate::error::SettingsError;

use super::modulator::{DeadTimeCompensation, FRACTION};

/// How often the current loop runs. Centre-aligned modulation, one period a cycle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum PwmFrequency {
    /// 16 kHz: a cycle of 62.5 us, two in a loop tick.
    #[default]
    Khz16,
    /// 8 kHz: a cycle of 125 us, one in a loop tick; half the switching losses.
    Khz8,
}

impl PwmFrequency {
    /// Timer counts from the bottom to the peak of a period at 168 MHz: the compare value of a fully switched-on phase.
    #[must_use]
    pub const fn reload(self) -> u16 {
        match self {
            Self::Khz16 => 5_250,
            Self::Khz8 => 10_500,
        }
    }

    /// Cycles in a loop tick of 125 us.
    #[must_use]
    pub const fn cycles_per_tick(self) -> u8 {
        match self {
            Self::Khz16 => 2,
            Self::Khz8 => 1,
        }
    }

    /// Of a cycle, in ns.
    #[must_use]
    pub const fn nanoseconds(self) -> u32 {
        match self {
            Self::Khz16 => 62_500,
            Self::Khz8 => 125_000,
        }
    }

    /// Cycles in a second.
    #[must_use]
    pub const fn hertz(self) -> u32 {
        match self {
            Self::Khz16 => 16_000,
            Self::Khz8 => 8_000,
        }
    }
}

/// Parameters of the current loop in physical units.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CurrentLoopParameters {
    /// Amplitude of the amplifier peak current S-0-0110 in mA: the unit of all current data.
    pub peak_current: u32,
    /// Phase current at full deflection of the sensor (2 048 counts), in mA.
    pub measuring_range: u32,
    /// Proportional gain S-0-0106 in mV/A.
    pub proportional_gain: u32,
    /// Integral action time S-0-0107 in us; 0: no integral part.
    pub integral_time: u32,
    /// Rate of the loop.
    pub frequency: PwmFrequency,
    /// Dead time of the inverter in ns, 0: not compensated.
    pub dead_time: u32,
    /// Commanded phase current below which the dead time is compensated in proportion only, in mA; at least 1.
    pub dead_time_band: u32,
}

/// Factors of the current loop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct CurrentLoopSettings {
    /// From (2a - b - c), counts 2^-3, to the alpha current, 2^-27 of peak.
    pub(super) alpha: i32,
    /// From (b - c), counts 2^-3, to the beta current, 2^-27 of peak.
    pub(super) beta: i32,
    /// Current 2^-26 of peak to volt 2^-14, in 2^-32.
    pub(super) proportional: i32,
    /// Current 2^-26 of peak to volt 2^-18 per cycle, in 2^-32.
    pub(super) integral: i32,
    /// Half the compare value of a fully switched-on phase, in counts 2^-3.
    pub(super) middle: i32,
    pub(super) dead_time: DeadTimeCompensation,
}

/// Current in amplitude units: 2^26 steps are the peak current.
pub(super) const CURRENT_BITS: u32 = 26;
/// Largest factor of [`CurrentLoopSettings`], so that no product leaves 32 bits.
const LARGEST_FACTOR: i64 = i32::MAX as i64;

impl CurrentLoopSettings {
    /// Scales the parameters. Divides.
    ///
    /// # Errors
    /// [`SettingsError::Zero`] without peak current or measuring range, [`SettingsError::MeasuringRange`] when the range is not 1 to 8 times the
    /// peak current, [`SettingsError::CurrentGain`] when the proportional gain times the peak current is 2 047 V or more, or the integral part would
    /// grow by 127 V or more in a cycle at that current.
    pub fn new(parameters: &CurrentLoopParameters) -> Result<Self, SettingsError> {
        let peak = i128::from(parameters.peak_current);
        let range = i128::from(parameters.measuring_range);
        if peak == 0 {
            return Err(SettingsError::Zero { parameter: "amplifier peak current S-0-0110" });
        }
        if range < peak || range > peak.saturating_mul(8) {
            return Err(SettingsError::MeasuringRange {
                actual: parameters.measuring_range,
                peak: parameters.peak_current,
            });
        }
        let too_high = SettingsError::CurrentGain { actual: parameters.proportional_gain };
        let within = |value: i64| if value <= LARGEST_FACTOR { Ok(value as i32) } else { Err(too_high) };
        // counts 2^-3 -> 2^-27 of peak: range / peak * 2^27 / 2048 / 8
        let scale = range << (27 - 11 - 3);
        // millivolt per ampere times milliampere is 10^-6 V
        let microvolts = i128::from(parameters.proportional_gain).saturating_mul(peak);
        let integral = match i128::from(parameters.integral_time) {
            0 => 0,
            time => {
                // volt 2^-18 per cycle in 2^-32 of 2^-26: 2^24
                let cycles = time.saturating_mul(parameters.frequency.hertz().into());
                divide_rounding(microvolts << 24, cycles)
            }
        };
        Ok(Self {
            alpha: within(divide_rounding(scale, peak.saturating_mul(3)))?,
            // 1 / sqrt(3) in 2^-32
            beta: within(divide_rounding(scale.saturating_mul(ROOT_OF_A_THIRD), peak << 32))?,
            proportional: within(divide_rounding(microvolts << 20, 1_000_000))?,
            integral: within(integral)?,
            middle: i32::from(parameters.frequency.reload() / 2) << FRACTION,
            dead_time: DeadTimeCompensation::new(
                parameters.dead_time,
                parameters.dead_time_band,
                parameters.peak_current,
            )?,
        })
    }
}

impl CurrentLoopSettings {
    /// As words, for a mailbox; see [`CurrentLoopSettings::from_words`].
    #[must_use]
    pub const fn to_words(&self) -> [u32; 8] {
        let [dead_time_alpha, dead_time_side, dead_time] = self.dead_time.to_words();
        [
            self.alpha.cast_unsigned(),
            self.beta.cast_unsigned(),
            self.proportional.cast_unsigned(),
            self.integral.cast_unsigned(),
            self.middle.cast_unsigned(),
            dead_time_alpha,
            dead_time_side,
            dead_time,
        ]
    }

    /// From [`CurrentLoopSettings::to_words`].
    #[must_use]
    pub const fn from_words([alpha, beta, proportional, integral, middle, dead_time @ ..]: [u32; 8]) -> Self {
        Self {
            alpha: alpha.cast_signed(),
            beta: beta.cast_signed(),
            proportional: proportional.cast_signed(),
            integral: integral.cast_signed(),
            middle: middle.cast_signed(),
            dead_time: DeadTimeCompensation::from_words(dead_time),
        }
    }
}

/// 1 / sqrt(3) in 2^-32.
const ROOT_OF_A_THIRD: i128 = 2_479_700_525;
