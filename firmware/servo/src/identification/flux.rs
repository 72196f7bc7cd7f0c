//! The flux linkage of the magnets, from the quadrature voltage at two speeds.
//!
//! `v_q = R i_q + w (L_d i_d + flux)`, with `w` the electrical speed. What dead time and transistors take is the same at both speeds, when
//! the load is, and cancels in the difference. A motor that turns with less current than the band of the dead-time compensation loses a voltage that
//! goes with the current: with a high bus voltage and little friction the flux comes out up to a percent too high.
//!
//! The caller's velocity loop turns the motor, without feed-forward of voltages being needed; its current loop turns the voltage ahead to
//! where it acts. Movement: revolutions in the direction of the velocity, up to
//! [`IdentificationParameters::movement`]. With `v` the velocity and `a` the acceleration the way is `v^2 / a + 0.77 s v`. Takes
//! 1.02 s and the ramps.

use super::velocity_ramp::{Motion, VelocityRamp};
use super::window::{Means, WINDOW, Window};
use super::{
    CURRENT_BITS, IdentificationError, IdentificationInputs, IdentificationOutput, IdentificationParameters,
    IdentificationState, Progress, Range, believed,
};
use crate::arithmetic::division::{TEN_TO_15, TWO_PI_TIMES_TEN_TO_15, divide_rounding};
use crate::error::SettingsError;
use crate::units::{LOOP_TICKS_PER_SECOND, Position, Velocity};

/// Settings of the sequence.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct FluxSettings {
    motion: Motion,
    motor: Motor,
    progress: Progress,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
struct Motor {
    peak_current: u32,
    pole_pairs: u32,
    /// Milliohm.
    resistance: u32,
    /// uH.
    direct_inductance: u32,
}

impl FluxSettings {
    /// Uses velocity, acceleration, movement, pole pairs and peak current of the parameters; resistance in milliohm and direct inductance in uH
    /// are those of the sequences before. Divides.
    ///
    /// # Errors
    /// [`SettingsError::OutOfRange`].
    pub fn new(
        parameters: &IdentificationParameters,
        resistance: u32,
        direct_inductance: u32,
    ) -> Result<Self, SettingsError> {
        let motion = Motion::new(parameters)?;
        let ticks = motion.ramp.saturating_mul(4).saturating_add(2 * SETTLING + 2 * WINDOW);
        Ok(Self {
            motion,
            motor: Motor {
                peak_current: parameters.peak_current,
                pole_pairs: parameters.checked_pole_pairs()?,
                resistance,
                direct_inductance,
            },
            progress: Progress::over(ticks),
        })
    }
}

/// From the end of a ramp to the window.
const SETTLING: u32 = 2_048;

/// What was measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct FluxMeasurement {
    motor: Motor,
    low: Means,
    high: Means,
}

/// The magnets of a motor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Flux {
    /// Flux linkage in uVs: amplitude of the phase voltage over the electrical speed.
    pub linkage: u32,
    /// Torque in uNm per ampere of the amplitude of the current, 1.5 * pole pairs * linkage.
    pub torque_constant: u32,
}

impl FluxMeasurement {
    /// Flux linkage and torque constant. Divides.
    ///
    /// # Errors
    /// [`IdentificationError::OutOfRange`] for a linkage below 100 uVs or from 2.5 Vs.
    pub fn flux(&self) -> Result<Flux, IdentificationError> {
        let motor = &self.motor;
        // Milliampere; electrical speed in 10^-6 rad/s; voltages in uV.
        let current = |bits: i32| i128::from(bits).saturating_mul(motor.peak_current.into());
        let speed = |means: &Means| radians(means.velocity).saturating_mul(motor.pole_pairs.into());
        let voltage = |means: &Means| {
            let given = i128::from(means.quadrature_voltage).saturating_mul(1_000_000) >> 14;
            let resistive = current(means.quadrature).saturating_mul(motor.resistance.into()) >> CURRENT_BITS;
            let linked = current(means.direct).saturating_mul(motor.direct_inductance.into()) >> CURRENT_BITS;
            let induced = divide_rounding(linked.saturating_mul(speed(means)), 1_000_000_000);
            given.saturating_sub(resistive).saturating_sub(induced.into())
        };
        let difference = voltage(&self.high).saturating_sub(voltage(&self.low)).saturating_mul(1_000_000);
        let linkage = divide_rounding(difference, speed(&self.high).saturating_sub(speed(&self.low)));
        let linkage = believed(linkage, 100, 2_499_999)?;
        // At most 2.4e8.
        let torque_constant = linkage.saturating_mul(motor.pole_pairs).saturating_mul(3) / 2;
        Ok(Flux { linkage, torque_constant })
    }
}

/// A velocity in 10^-6 rad/s. Divides.
pub(super) fn radians(velocity: Velocity) -> i128 {
    let numerator = i128::from(velocity.to_bits())
        .saturating_mul(TWO_PI_TIMES_TEN_TO_15)
        .saturating_mul(i128::from(LOOP_TICKS_PER_SECOND).saturating_mul(1_000_000));
    divide_rounding(numerator >> 36, TEN_TO_15).into()
}

/// State of the sequence.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct FluxIdentification {
    settings: FluxSettings,
    range: Range,
    state: IdentificationState<FluxMeasurement>,
    stage: Stage,
    elapsed: u32,
    /// Ticks until the window of this stage.
    settling: u32,
    ramp: VelocityRamp,
    window: Window,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
enum Stage {
    Low,
    High { low: Means },
    Stop { measurement: FluxMeasurement },
}

impl FluxIdentification {
    /// Begins at this position; the motor stands, the velocity loop is closed.
    #[must_use]
    pub fn start(settings: FluxSettings, position: Position) -> Self {
        Self {
            settings,
            range: Range { origin: position, maximum: settings.motion.movement },
            state: IdentificationState::Running { percent: 0 },
            stage: Stage::Low,
            elapsed: 0,
            settling: settings.motion.ramp.wrapping_add(SETTLING),
            ramp: VelocityRamp::default(),
            window: Window::default(),
        }
    }

    /// One tick.
    #[inline]
    pub fn tick(&mut self, inputs: &IdentificationInputs) -> IdentificationOutput<Velocity, FluxMeasurement> {
        if let IdentificationState::Running { .. } = self.state {
            self.elapsed = self.elapsed.wrapping_add(1);
            self.state = match self.run(inputs) {
                Ok(None) => IdentificationState::Running { percent: self.settings.progress.percent(self.elapsed) },
                Ok(Some(measurement)) => IdentificationState::Done(measurement),
                Err(error) => IdentificationState::Failed(error),
            };
        }
        let motion = &self.settings.motion;
        let request = match (self.state, self.stage) {
            (IdentificationState::Running { .. }, Stage::Low) => self.ramp.tick(motion, motion.low()),
            (IdentificationState::Running { .. }, Stage::High { .. }) => self.ramp.tick(motion, motion.high),
            (IdentificationState::Running { .. }, Stage::Stop { .. }) => self.ramp.tick(motion, Velocity::ZERO),
            (IdentificationState::Done(_) | IdentificationState::Failed(_), _) => Velocity::ZERO,
        };
        IdentificationOutput { request, state: self.state }
    }

    #[inline]
    fn run(&mut self, inputs: &IdentificationInputs) -> Result<Option<FluxMeasurement>, IdentificationError> {
        self.range.check(inputs.position)?;
        if self.settling > 0 {
            self.settling = self.settling.wrapping_sub(1);
            return Ok(None);
        }
        if let Stage::Stop { measurement } = self.stage {
            return Ok(Some(measurement));
        }
        let Some(means) = self.window.add(inputs) else { return Ok(None) };
        self.window = Window::default();
        let motion = &self.settings.motion;
        if let Stage::High { low } = self.stage {
            means.check_velocity(motion.high)?;
            let measurement = FluxMeasurement { motor: self.settings.motor, low, high: means };
            self.stage = Stage::Stop { measurement };
            self.settling = motion.ramp.wrapping_mul(2);
        } else {
            means.check_velocity(motion.low())?;
            self.stage = Stage::High { low: means };
            self.settling = motion.ramp.wrapping_add(SETTLING);
        }
        Ok(None)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 10 A peak, 3 pole pairs, 2 ohm, 10 mH, 0.1 Vs; currents in A, velocity in rad/s.
    fn means(direct: f64, quadrature: f64, velocity: f64) -> Means {
        let speed = 3.0 * velocity;
        let volts = 2.0 * quadrature + speed * (0.01 * direct + 0.1) + 3.0;
        let current = |amperes: f64| (amperes / 10.0 * f64::from(1 << CURRENT_BITS)) as i32;
        let velocity = velocity / core::f64::consts::TAU / 8_000.0 * 2_f64.powi(36);
        let velocity = Velocity::from_bits(velocity as i32);
        Means::steady(current(direct), current(quadrature), (volts * 16_384.0) as i32, velocity)
    }

    #[test]
    fn the_parts_of_resistance_and_inductance_are_taken_off_and_a_constant_cancels() {
        let motor = Motor { peak_current: 10_000, pole_pairs: 3, resistance: 2_000, direct_inductance: 10_000 };
        for (low, high) in [
            (means(0.0, 1.0, 50.0), means(0.0, 1.0, 100.0)),
            (means(0.0, 1.0, 50.0), means(0.0, 4.0, 100.0)),
            (means(-3.0, 1.0, 50.0), means(-3.0, 1.0, 100.0)),
            (means(2.0, -1.0, -50.0), means(-3.0, -2.0, -100.0)),
        ] {
            let flux = FluxMeasurement { motor, low, high }.flux().unwrap();
            assert!((99_990..=100_010).contains(&flux.linkage), "{flux:?}");
            assert!((449_950..=450_050).contains(&flux.torque_constant), "{flux:?}");
        }
    }
}
