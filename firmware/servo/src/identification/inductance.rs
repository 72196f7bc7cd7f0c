//! The inductances of d and q axis, from the out-of-phase part of an alternating voltage.
//!
//! On a standing d current, a sine is added as feed-forward voltage, first along d and then along q. Its amplitude grows until the ripple of
//! the current is reached. Voltage and current are demodulated over 128 ms, at 500 Hz (16 ticks) and at 250 Hz (32 ticks), after
//! [`super::interval`] has accounted for the delays of readings and voltages. The current loop works on, against the ripple; what it adds is
//! in its readings and does no harm.
//!
//! * Dead time makes no error where the standing current keeps the phases away from zero. That is best at 0, 60, 120 ... degrees. Around
//!   30, 90, 150 ... degrees a phase crosses zero with the ripple, and the compensation comes a cycle late: `L_q` is then up to a tenth
//!   too high, the more the smaller ripple and inductance are for the bus voltage.
//! * A ripple along q shivers the rotor, and the voltage that this induces looks like a capacitance in series with the inductance: it
//!   lowers it by 1.5 (pole pairs * flux)^2 / (inertia * speed of the sine^2). At half the frequency this is four times as much, and so
//!   a third of the difference between the two is added again.
//!
//! The caller holds the angle still: the rotor turns there, or a brake holds it where it is. With a brake, the angle must be that of the
//! rotor. Movement: one electrical revolution at most, while the standing current builds up; the shivering is below one
//! electrical degree at usual inertias. Takes 2.0 to 2.7 s.

use super::interval::Interval;
use super::phasor::Phasor;
use super::window::{WINDOW, Window};
use super::{
    CURRENT_BITS, CurrentRequest, IdentificationError, IdentificationInputs, IdentificationOutput,
    IdentificationParameters, IdentificationState, Progress, Range, believed,
};
use crate::arithmetic::division::divide_rounding;
use crate::arithmetic::trigonometry::{Rotation, high_product};
use crate::current::readings::CurrentReadings;
use crate::current::settings::PwmFrequency;
use crate::error::SettingsError;
use crate::units::{LOOP_PERIOD_MICROSECONDS, Position};

/// Settings of the sequence.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct InductanceSettings {
    peak_current: u32,
    frequency: PwmFrequency,
    /// 2^-26 of peak.
    current: i32,
    ripple: i32,
    /// Of the current in a tick.
    step: i32,
    revolution: Position,
    progress: Progress,
}

impl InductanceSettings {
    /// Uses currents, pole pairs and rate of the parameters; the standing current is three quarters of the highest. Divides.
    ///
    /// # Errors
    /// [`SettingsError::OutOfRange`].
    pub fn new(parameters: &IdentificationParameters) -> Result<Self, SettingsError> {
        parameters.checked_currents()?;
        let current = parameters.scaled(parameters.current).wrapping_mul(3) / 4;
        Ok(Self {
            peak_current: parameters.peak_current,
            frequency: parameters.frequency,
            current,
            ripple: parameters.scaled(parameters.ripple),
            step: current.max(RAMP) / RAMP,
            revolution: parameters.electrical_revolution(),
            progress: Progress::over(TICKS),
        })
    }
}

const RAMP: i32 = 1_024;
/// Until the rotor has come to rest.
const SETTLING: u32 = 8_192;
const BIAS: u32 = SETTLING + WINDOW;
/// An amplitude is tried for 4 periods after 2 of settling.
const TRIAL_SETTLING: u32 = 32;
const TRIAL_BITS: u32 = 6;
const TRIAL: u32 = TRIAL_SETTLING + (1 << TRIAL_BITS);
/// From 1/1024 of the longest voltage to all of it, a quarter more each time.
const TRIALS: u32 = 32;
const FIRST_AMPLITUDE_SHIFT: u32 = 10;
/// 64 and 32 periods, after 16 and 8 of settling.
const MEASURING_SETTLING: u32 = 256;
const MEASURING_BITS: u32 = 10;
const MEASURING: u32 = MEASURING_SETTLING + (1 << MEASURING_BITS);
const AXIS: u32 = TRIALS * TRIAL + 2 * MEASURING;
const TICKS: u32 = BIAS + 2 * AXIS;

/// Phase of the sine in a tick: 2^32 / 16.
const FAST: u32 = 1 << 28;
const SLOW: u32 = 1 << 27;
/// Change of a sine in a tick over its value half way, 2 tan(phase / 2), in 10^-9.
const FAST_CHANGE: i128 = 397_824_735;
const SLOW_CHANGE: i128 = 196_982_807;

/// Voltage and current at one frequency.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
struct Response {
    voltage: Phasor,
    current: Phasor,
}

/// Response of an axis at both frequencies.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
struct Responses {
    fast: Response,
    slow: Response,
}

/// What was measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct InductanceMeasurement {
    peak_current: u32,
    direct: Responses,
    quadrature: Responses,
}

/// Inductances of a phase in uH.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Inductances {
    /// Along the magnets.
    pub direct: u32,
    /// Across them.
    pub quadrature: u32,
}

impl InductanceMeasurement {
    /// The inductances. Divides.
    ///
    /// # Errors
    /// [`IdentificationError::OutOfRange`] below 10 uH and above 1 H.
    pub fn inductances(&self) -> Result<Inductances, IdentificationError> {
        let inductance = |responses: &Responses| {
            let fast = self.apparent(&responses.fast, FAST_CHANGE);
            let slow = self.apparent(&responses.slow, SLOW_CHANGE);
            let three_times = i128::from(fast).saturating_mul(4).saturating_sub(slow.into());
            believed(divide_rounding(three_times, 3_000), 10, 1_000_000)
        };
        Ok(Inductances { direct: inductance(&self.direct)?, quadrature: inductance(&self.quadrature)? })
    }

    /// In nH.
    fn apparent(&self, response: &Response, change: i128) -> i64 {
        // Volt 2^-14 over 2^-26 of a current in mA, in a tick of 125 us: nH are 10^3 us V / (10^3 mA) * 10^3.
        let (numerator, denominator) = response.voltage.reactive_ratio(response.current);
        let unit = i128::from(LOOP_PERIOD_MICROSECONDS).saturating_mul(1_000_000) << (CURRENT_BITS - 14);
        let ohms_by_time = divide_rounding(
            numerator.saturating_mul(unit),
            (denominator >> 10).saturating_mul(self.peak_current.into()),
        );
        divide_rounding(i128::from(ohms_by_time).saturating_mul(1_000_000_000), change << 10)
    }
}

/// State of the sequence.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct InductanceIdentification {
    settings: InductanceSettings,
    range: Range,
    state: IdentificationState<InductanceMeasurement>,
    stage: Stage,
    /// Ticks since the start, and where they would be with all trials; ticks in the stage.
    elapsed: u32,
    in_stage: u32,
    /// 2^-26 of peak.
    bias: i32,
    /// Volt 2^-14.
    amplitude: i32,
    injected: i32,
    interval: Interval,
    response: Response,
    window: Window,
    responses: Responses,
    direct: Responses,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
enum Stage {
    Bias,
    Trial(Axis),
    Fast(Axis),
    Slow(Axis),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
enum Axis {
    Direct,
    Quadrature,
}

impl Stage {
    /// Axis of the injection.
    #[inline]
    const fn axis(self) -> Axis {
        match self {
            Self::Bias => Axis::Direct,
            Self::Trial(axis) | Self::Fast(axis) | Self::Slow(axis) => axis,
        }
    }

    /// Ticks before this stage when all trials are needed.
    #[inline]
    const fn begin(self) -> u32 {
        let of_axis = match self.axis() {
            Axis::Direct => BIAS,
            Axis::Quadrature => BIAS + AXIS,
        };
        match self {
            Self::Bias => 0,
            Self::Trial(_) => of_axis,
            Self::Fast(_) => of_axis.wrapping_add(TRIALS * TRIAL),
            Self::Slow(_) => of_axis.wrapping_add(TRIALS * TRIAL + MEASURING),
        }
    }
}

impl InductanceIdentification {
    /// Begins at this position, the bridge on and without current.
    #[must_use]
    pub fn start(settings: InductanceSettings, position: Position) -> Self {
        Self {
            settings,
            range: Range { origin: position, maximum: settings.revolution },
            state: IdentificationState::Running { percent: 0 },
            stage: Stage::Bias,
            elapsed: 0,
            in_stage: 0,
            bias: 0,
            amplitude: 0,
            injected: 0,
            interval: Interval::new(settings.frequency),
            response: Response::default(),
            window: Window::default(),
            responses: Responses::default(),
            direct: Responses::default(),
        }
    }

    /// One tick.
    #[inline]
    pub fn tick(
        &mut self,
        inputs: &IdentificationInputs,
    ) -> IdentificationOutput<CurrentRequest, InductanceMeasurement> {
        if let IdentificationState::Running { .. } = self.state {
            self.elapsed = self.elapsed.wrapping_add(1);
            self.state = match self.run(inputs) {
                Ok(None) => IdentificationState::Running { percent: self.settings.progress.percent(self.elapsed) },
                Ok(Some(measurement)) => IdentificationState::Done(measurement),
                Err(error) => IdentificationState::Failed(error),
            };
        }
        let request = match self.state {
            IdentificationState::Running { .. } => self.request(),
            IdentificationState::Done(_) | IdentificationState::Failed(_) => CurrentRequest::default(),
        };
        IdentificationOutput { request, state: self.state }
    }

    #[inline]
    fn request(&self) -> CurrentRequest {
        let (direct_voltage, quadrature_voltage) = match self.stage.axis() {
            Axis::Direct => (self.injected, 0),
            Axis::Quadrature => (0, self.injected),
        };
        let direct = CurrentReadings::fraction(self.bias);
        CurrentRequest { direct, direct_voltage, quadrature_voltage, ..CurrentRequest::default() }
    }

    #[inline]
    fn run(&mut self, inputs: &IdentificationInputs) -> Result<Option<InductanceMeasurement>, IdentificationError> {
        self.range.check(inputs.position)?;
        let readings = &inputs.readings;
        let highest = self.settings.current.wrapping_add(self.settings.ripple).wrapping_mul(2);
        if readings.direct.wrapping_abs().max(readings.quadrature.wrapping_abs()) > highest {
            return Err(IdentificationError::Unstable);
        }
        let tick = self.in_stage;
        self.in_stage = tick.wrapping_add(1);
        let phase_step = match self.stage {
            Stage::Bias => {
                self.build_up(inputs, tick)?;
                return Ok(None);
            }
            Stage::Trial(_) | Stage::Fast(_) => FAST,
            Stage::Slow(_) => SLOW,
        };
        if inputs.is_at_voltage_limit() {
            return Err(IdentificationError::VoltageLimit);
        }
        let phase = Rotation::by(tick.wrapping_mul(phase_step));
        let (current, voltage) = match self.stage.axis() {
            Axis::Direct => (readings.direct, readings.direct_voltage),
            Axis::Quadrature => (readings.quadrature, readings.quadrature_voltage),
        };
        let (mean_voltage, mean_current) = self.interval.next(current, voltage, self.injected);
        let (settling, length) = match self.stage {
            Stage::Bias | Stage::Trial(_) => (TRIAL_SETTLING, TRIAL),
            Stage::Fast(_) | Stage::Slow(_) => (MEASURING_SETTLING, MEASURING),
        };
        if tick >= settling {
            self.response.voltage.add(mean_voltage, phase);
            self.response.current.add(mean_current, phase);
        }
        self.injected = high_product(self.amplitude, phase.cosine).wrapping_shl(1);
        if self.in_stage < length { Ok(None) } else { self.evaluate(inputs) }
    }

    #[inline]
    fn build_up(&mut self, inputs: &IdentificationInputs, tick: u32) -> Result<(), IdentificationError> {
        self.bias = self.bias.wrapping_add(self.settings.step).min(self.settings.current);
        if tick < SETTLING {
            return Ok(());
        }
        if let Some(means) = self.window.add(inputs) {
            means.check_current(self.settings.current)?;
            self.begin_trials(Axis::Direct, inputs);
        }
        Ok(())
    }

    #[inline]
    fn begin_trials(&mut self, axis: Axis, inputs: &IdentificationInputs) {
        self.enter(Stage::Trial(axis));
        self.amplitude = (inputs.longest_voltage >> FIRST_AMPLITUDE_SHIFT).max(1);
        self.interval = Interval::new(self.settings.frequency);
        self.injected = 0;
    }

    #[inline]
    fn enter(&mut self, stage: Stage) {
        self.stage = stage;
        self.elapsed = self.elapsed.max(stage.begin());
        self.in_stage = 0;
        self.response = Response::default();
    }

    /// At the end of a trial or a measurement.
    #[inline]
    fn evaluate(
        &mut self,
        inputs: &IdentificationInputs,
    ) -> Result<Option<InductanceMeasurement>, IdentificationError> {
        let response = self.response;
        match self.stage {
            Stage::Bias => {}
            Stage::Trial(axis) if response.current.amplitude(TRIAL_BITS) >= self.settings.ripple => {
                self.enter(Stage::Fast(axis));
            }
            Stage::Trial(_) => {
                self.amplitude = self.amplitude.wrapping_add(self.amplitude >> 2).wrapping_add(1);
                if self.amplitude > inputs.longest_voltage {
                    // The voltage that is read does not have it, or the limit would have been met before.
                    let (actual, expected) = (response.current.amplitude(TRIAL_BITS), self.settings.ripple);
                    return Err(IdentificationError::CurrentNotReached { actual, expected });
                }
                self.in_stage = 0;
                self.response = Response::default();
            }
            Stage::Fast(axis) => {
                let amplitude = response.current.amplitude(MEASURING_BITS);
                if amplitude < self.settings.ripple >> 1 || amplitude > self.settings.ripple.wrapping_mul(2) {
                    return Err(IdentificationError::Unstable);
                }
                self.responses.fast = response;
                self.amplitude >>= 1;
                self.enter(Stage::Slow(axis));
            }
            Stage::Slow(Axis::Direct) => {
                self.direct = Responses { slow: response, ..self.responses };
                self.begin_trials(Axis::Quadrature, inputs);
            }
            Stage::Slow(Axis::Quadrature) => {
                let quadrature = Responses { slow: response, ..self.responses };
                let peak_current = self.settings.peak_current;
                return Ok(Some(InductanceMeasurement { peak_current, direct: self.direct, quadrature }));
            }
        }
        Ok(None)
    }
}
