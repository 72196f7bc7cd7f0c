//! Inertia and friction of the axis, from ramps between two velocities.
//!
//! The motor is kept at half the velocity, accelerated to the whole velocity, kept there, and decelerated again. The current is summed up
//! from the end of one plateau to the begin of the next; with the torque constant this is the change of momentum, whatever the velocity loop
//! makes of the ramp. Up and down take the same number of ticks, so that Coulomb friction and a constant load cancel in the difference of
//! the sums:
//!
//! ```text
//! inertia * (change up + change down) = torque constant * (sum up - sum down - viscous * (way up - way down))
//! ```
//!
//! Viscous friction is the line through the currents of the plateaus. Then the motor turns back at half the velocity: of the currents of the
//! two directions half the difference is friction, and half the sum a constant load (gravity).
//!
//! Movement: revolutions in the direction of the velocity, up to [`IdentificationParameters::movement`]. With `v` the
//! velocity and `a` the acceleration the way is `v^2 / a + 1.02 s v`, of which a quarter is turned back. Takes 2.05 s and the ramps.

use super::flux::radians;
use super::velocity_ramp::{Motion, VelocityRamp};
use super::window::{Means, WINDOW, Window};
use super::{
    CURRENT_BITS, IdentificationError, IdentificationInputs, IdentificationOutput, IdentificationParameters,
    IdentificationState, Progress, Range, believed,
};
use crate::arithmetic::division::divide_rounding;
use crate::error::{SettingsError, in_range};
use crate::units::{LOOP_PERIOD_MICROSECONDS, Position, Velocity};

/// Settings of the sequence.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct InertiaSettings {
    motion: Motion,
    peak_current: u32,
    torque_constant: u32,
    progress: Progress,
}

impl InertiaSettings {
    /// Uses velocity, acceleration, movement and peak current of the parameters; `torque_constant` in uNm/A is that of [`super::Flux`]. The
    /// acceleration should take some times the current of the friction. Divides.
    ///
    /// # Errors
    /// [`SettingsError::OutOfRange`].
    pub fn new(parameters: &IdentificationParameters, torque_constant: u32) -> Result<Self, SettingsError> {
        let motion = Motion::new(parameters)?;
        in_range("torque constant in uNm/A", torque_constant, 1, 1_000_000_000)?;
        let ticks = motion.ramp.saturating_mul(6).saturating_add(4 * SETTLING + 4 * WINDOW);
        Ok(Self { motion, peak_current: parameters.peak_current, torque_constant, progress: Progress::over(ticks) })
    }
}

/// From the end of a ramp to the window.
const SETTLING: u32 = 2_048;

/// Current and way between two plateaus.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
struct Sums {
    /// 2^-26 of peak.
    current: i64,
    start: Position,
    way: Position,
    is_limited: bool,
}

/// What was measured.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct InertiaMeasurement {
    peak_current: u32,
    torque_constant: u32,
    low: Means,
    up: Sums,
    high: Means,
    down: Sums,
    low_again: Means,
    back: Means,
}

/// Inertia and friction of an axis at the motor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Inertia {
    /// Motor and load, in 10^-7 kg m^2.
    pub inertia: u32,
    /// Current against the friction at standstill, without a constant load, in mA; noise may leave it below zero.
    pub coulomb_friction: i32,
    /// Current for 1 000 rpm in uA.
    pub viscous_friction: i32,
}

impl InertiaMeasurement {
    /// Inertia and friction. Divides.
    ///
    /// # Errors
    /// [`IdentificationError::OutOfRange`] for an inertia below 10^-7 or above 100 kg m^2.
    pub fn inertia(&self) -> Result<Inertia, IdentificationError> {
        let bits = |velocity: Velocity| i128::from(velocity.to_bits());
        let (low, again, high) = (&self.low, &self.low_again, &self.high);
        let change = |from: &Means, to: &Means| bits(to.velocity).saturating_sub(bits(from.velocity));
        let changes = change(low, high).saturating_add(change(again, high));
        let currents = [high.quadrature, high.quadrature, low.quadrature, again.quadrature].map(i128::from);
        let [one, two, three, four] = currents;
        // Current per velocity, as a fraction of these two.
        let rise = one.saturating_add(two).saturating_sub(three).saturating_sub(four);
        let viscous = |velocity_bits: i128| i128::from(divide_rounding(rise.saturating_mul(velocity_bits), changes));
        let more_way = i128::from((self.up.way - self.down.way).to_bits()).saturating_mul(16);
        let sum = i128::from(self.up.current.saturating_sub(self.down.current)).saturating_sub(viscous(more_way));

        let milliamperes = |current: i128| current.saturating_mul(self.peak_current.into());
        // uNm/A * mA * us / (10^-6 rad/s) is 10^-9 kg m^2
        let impulse = milliamperes(sum)
            .saturating_mul(self.torque_constant.into())
            .saturating_mul(LOOP_PERIOD_MICROSECONDS.into());
        let radians_per_second = self.speed(low, high).saturating_add(self.speed(again, high));
        let inertia = divide_rounding(impulse >> CURRENT_BITS, radians_per_second.saturating_mul(100));

        // Half of what lies between the two directions: a constant load is in both.
        let back = i128::from(self.back.quadrature).saturating_mul(2);
        let lower = three.saturating_add(four).saturating_sub(back) / 4;
        let back_velocity = bits(self.back.velocity).saturating_mul(2);
        let lower_velocity = bits(low.velocity).saturating_add(bits(again.velocity)).saturating_sub(back_velocity) / 4;
        let direction = changes.signum();
        let scaled = |current: i128| {
            let value = divide_rounding(milliamperes(current), 1 << CURRENT_BITS);
            i32::try_from(value).unwrap_or(i32::MAX)
        };
        Ok(Inertia {
            inertia: believed(inertia, 1, 1_000_000_000)?,
            coulomb_friction: scaled(lower.saturating_sub(viscous(lower_velocity)).saturating_mul(direction)),
            viscous_friction: scaled(viscous(THOUSAND_RPM).saturating_mul(1_000)),
        })
    }

    fn speed(&self, from: &Means, to: &Means) -> i128 {
        radians(to.velocity).saturating_sub(radians(from.velocity))
    }
}

/// In bits of a [`Velocity`].
const THOUSAND_RPM: i128 = 143_165_577;

/// State of the sequence.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct InertiaIdentification {
    settings: InertiaSettings,
    range: Range,
    state: IdentificationState<InertiaMeasurement>,
    stage: Stage,
    elapsed: u32,
    /// Ticks until the window of this stage.
    settling: u32,
    ramp: VelocityRamp,
    window: Window,
    sums: Sums,
    measured: InertiaMeasurement,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
enum Stage {
    Low,
    High,
    LowAgain,
    Back,
    Stop,
}

impl InertiaIdentification {
    /// Begins at this position; the motor stands, the velocity loop is closed.
    #[must_use]
    pub fn start(settings: InertiaSettings, position: Position) -> Self {
        Self {
            settings,
            range: Range { origin: position, maximum: settings.motion.movement },
            state: IdentificationState::Running { percent: 0 },
            stage: Stage::Low,
            elapsed: 0,
            settling: settings.motion.ramp.wrapping_add(SETTLING),
            ramp: VelocityRamp::default(),
            window: Window::default(),
            sums: Sums::default(),
            measured: InertiaMeasurement {
                peak_current: settings.peak_current,
                torque_constant: settings.torque_constant,
                ..InertiaMeasurement::default()
            },
        }
    }

    /// One tick.
    #[inline]
    pub fn tick(&mut self, inputs: &IdentificationInputs) -> IdentificationOutput<Velocity, InertiaMeasurement> {
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
            (IdentificationState::Running { .. }, Stage::Low | Stage::LowAgain) => self.ramp.tick(motion, motion.low()),
            (IdentificationState::Running { .. }, Stage::High) => self.ramp.tick(motion, motion.high),
            (IdentificationState::Running { .. }, Stage::Back) => self.ramp.tick(motion, -motion.low()),
            (IdentificationState::Running { .. }, Stage::Stop) => self.ramp.tick(motion, Velocity::ZERO),
            (IdentificationState::Done(_) | IdentificationState::Failed(_), _) => Velocity::ZERO,
        };
        IdentificationOutput { request, state: self.state }
    }

    #[inline]
    fn run(&mut self, inputs: &IdentificationInputs) -> Result<Option<InertiaMeasurement>, IdentificationError> {
        self.range.check(inputs.position)?;
        if self.settling > 0 {
            self.settling = self.settling.wrapping_sub(1);
            self.sums.current = self.sums.current.wrapping_add(inputs.readings.quadrature.into());
            self.sums.is_limited |= inputs.is_at_voltage_limit();
            self.sums.way = inputs.position - self.sums.start;
            return Ok(None);
        }
        if self.stage == Stage::Stop {
            return Ok(Some(self.measured));
        }
        let Some(means) = self.window.add(inputs) else { return Ok(None) };
        self.plateau(means)?;
        self.window = Window::default();
        self.sums = Sums { start: inputs.position, ..Sums::default() };
        Ok(None)
    }

    #[inline]
    fn plateau(&mut self, means: Means) -> Result<(), IdentificationError> {
        let motion = &self.settings.motion;
        let settling = motion.ramp.wrapping_add(SETTLING);
        match self.stage {
            Stage::Low => {
                means.check_velocity(motion.low())?;
                self.measured.low = means;
                (self.stage, self.settling) = (Stage::High, settling);
            }
            Stage::High => {
                means.check_velocity(motion.high)?;
                self.measured.high = means;
                self.measured.up = self.sums;
                (self.stage, self.settling) = (Stage::LowAgain, settling);
            }
            Stage::LowAgain => {
                means.check_velocity(motion.low())?;
                self.measured.low_again = means;
                self.measured.down = self.sums;
                (self.stage, self.settling) = (Stage::Back, settling.wrapping_add(motion.ramp));
            }
            Stage::Back | Stage::Stop => {
                means.check_velocity(-motion.low())?;
                self.measured.back = means;
                (self.stage, self.settling) = (Stage::Stop, motion.ramp);
            }
        }
        if self.sums.is_limited {
            return Err(IdentificationError::VoltageLimit);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Means at a share of 1 000 rpm, with a current in 2^-26 of the peak.
    fn plateau(share: f64, current: i32) -> Means {
        Means::steady(0, current, 0, Velocity::from_bits((THOUSAND_RPM as f64 * share) as i32))
    }

    #[test]
    fn a_load_that_pulls_one_way_is_no_friction() {
        // 10 A of peak; friction 300 mA and 200 mA at 1 000 rpm.
        let unit = f64::from(1 << CURRENT_BITS) / 10_000.0;
        for sign in [1.0, -1.0] {
            for load in [0.0, 1_500.0, -1_500.0] {
                let at = |share: f64| {
                    let friction = 300.0 * share.signum() + 200.0 * share;
                    plateau(sign * share, ((sign * friction + load) * unit).round() as i32)
                };
                let measurement = InertiaMeasurement {
                    peak_current: 10_000,
                    torque_constant: 1_000_000,
                    low: at(0.5),
                    up: Sums { current: (sign * 1e12) as i64, ..Sums::default() },
                    high: at(1.0),
                    down: Sums::default(),
                    low_again: at(0.5),
                    back: at(-0.5),
                };
                let found = measurement.inertia().unwrap();
                assert!((299..=301).contains(&found.coulomb_friction), "{load}: {found:?}");
                assert!((199_900..=200_100).contains(&found.viscous_friction), "{load}: {found:?}");
            }
        }
    }
}
