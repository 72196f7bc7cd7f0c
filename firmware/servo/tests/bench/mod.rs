//! An axis closed over the simulated motor, and commands for it.

use plant::{Motor, ReferenceAxis};
use servo::axis::{
    Axis, AxisOutput, AxisParameters, AxisSettings, CurrentFilterSettings, FilterSection, FrictionSettings, Limiting,
    TorqueLimits, VelocityEstimate, VelocityFilter, VelocityLimits, VelocityRate,
};
use servo::encoder::{Encoder, EncoderSettings};
use servo::path::Interpolation;
use servo::units::{Acceleration, CurrentFraction, LOOP_TICKS_PER_SUPERVISION, Modulo, Position, Velocity};

/// Nanoseconds of a loop period.
pub(crate) const PERIOD: u64 = 125_000;
/// From the tick to the current command that comes out of it, in nanoseconds.
const COMPUTING_TIME: u64 = 10_000;

/// Parameters that the reference axis suggests, at a 10 ms cycle, without modulo, 100 % feed-forward.
pub(crate) fn parameters(reference: &ReferenceAxis) -> AxisParameters {
    let gains = reference.gains;
    AxisParameters {
        ticks_per_cycle: 80,
        modulo: None,
        position_gain: gains.position_gain,
        feed_forward: 10_000,
        velocity_gain: u32::from(gains.velocity_gain) * 100,
        integral_time: gains.integral_time,
        velocity_rate: VelocityRate::EachTick,
        velocity_filter: gains.velocity_filter,
        peak_current: reference.peak_current,
        acceleration_gain: 0,
        acceleration_smoothing: 0,
        friction: FrictionSettings::OFF,
        filter: CurrentFilterSettings::new([FilterSection::Off; 2], VelocityRate::EachTick).unwrap(),
        velocity_limits: up_to(rpm(f64::from(reference.maximum_speed))),
        deceleration: Acceleration::from_milliradians_per_second_squared(gains.acceleration_limit),
        halt_deceleration: Acceleration::from_bits(0),
        jerk: None,
        velocity_ramp: None,
        interpolation: Interpolation::Linear,
        standstill_window: Velocity::from_ten_thousandths_rpm(100_000),
        monitoring_window: Position::from_bits((1 << 32) / 12),
        largest_step: Position::ZERO,
    }
}

pub(crate) struct Bench {
    pub(crate) motor: Motor,
    pub(crate) encoder: Encoder,
    estimate: VelocityEstimate,
    pub(crate) axis: Axis,
    pub(crate) time: u64,
    pub(crate) limits: TorqueLimits,
    /// The following error was outside of its window at some look.
    pub(crate) deviates: bool,
}

/// The same velocity limit both ways.
pub(crate) fn up_to(limit: Velocity) -> VelocityLimits {
    VelocityLimits::new(limit, None, None)
}

/// The current stands at a limit.
pub(crate) fn is_limited(output: &AxisOutput) -> bool {
    output.limiting.intersects(Limiting::TORQUE_BIPOLAR)
}

impl Bench {
    pub(crate) fn new(reference: &ReferenceAxis, parameters: &AxisParameters) -> Self {
        let mut motor = reference.motor();
        let encoder = EncoderSettings::new(reference.motor.increments_per_revolution).unwrap();
        let encoder = Encoder::new(encoder, motor.encoder_count(0));
        let axis = Axis::new(AxisSettings::new(parameters).unwrap(), encoder.position());
        let limits = TorqueLimits::symmetrical(CurrentFraction::MAX, Limiting::TORQUE_BIPOLAR);
        let estimate = VelocityEstimate::new(encoder.position());
        Self { motor, encoder, estimate, axis, time: 0, limits, deviates: false }
    }

    pub(crate) fn tick(&mut self) -> AxisOutput {
        self.time += PERIOD;
        let measured = self.encoder.update(self.motor.encoder_count(self.time));
        let latest = self.estimate.update(&VelocityFilter::from_microseconds(0), measured);
        let output = self.axis.tick(measured, latest, &self.limits);
        if (self.time / PERIOD).is_multiple_of(LOOP_TICKS_PER_SUPERVISION.into()) {
            self.deviates |= self.axis.supervise();
        }
        self.motor.set_current(f64::from(output.current.to_num::<f32>()), self.time + COMPUTING_TIME);
        output
    }

    /// Moves the zero without a movement.
    pub(crate) fn shift(&mut self, difference: Position) {
        self.axis.shift(difference);
        self.estimate.shift(difference);
    }

    pub(crate) fn ticks(&mut self, number: usize) -> Vec<AxisOutput> {
        (0..number).map(|_| self.tick()).collect()
    }

    /// One control unit cycle of ticks that starts with a position command.
    pub(crate) fn position_cycle(&mut self, command: Position) -> Vec<AxisOutput> {
        self.axis.command_position(command).unwrap();
        self.cycle()
    }

    /// One control unit cycle of ticks without command.
    pub(crate) fn cycle(&mut self) -> Vec<AxisOutput> {
        self.ticks(usize::from(self.axis.settings().interpolator().ticks_per_cycle()))
    }

    /// Limits the torque to this part of the peak both ways.
    pub(crate) fn limit_torque(&mut self, share: f64) {
        self.limits = TorqueLimits::symmetrical(CurrentFraction::saturating_from_num(share), Limiting::TORQUE_BIPOLAR);
    }

    /// Velocity of the motor in rad/s now.
    pub(crate) fn velocity(&mut self) -> f64 {
        self.motor.velocity(self.time)
    }
}

/// Positions of a master that accelerates to a speed and keeps it, one a cycle.
pub(crate) struct Master {
    /// In revolutions.
    pub(crate) position: f64,
    /// In revolutions per second.
    pub(crate) velocity: f64,
    /// In seconds.
    pub(crate) cycle: f64,
}

impl Master {
    pub(crate) fn new(cycle: f64) -> Self {
        Self { position: 0.0, velocity: 0.0, cycle }
    }

    /// The position one cycle later, on the way to `velocity` with `acceleration` (revolutions, seconds).
    pub(crate) fn next(&mut self, velocity: f64, acceleration: f64) -> Position {
        let change = (velocity - self.velocity).clamp(-acceleration * self.cycle, acceleration * self.cycle);
        self.position += (self.velocity + 0.5 * change) * self.cycle;
        self.velocity += change;
        revolutions(self.position)
    }
}

pub(crate) fn revolutions(value: f64) -> Position {
    Position::from_bits((value * 4_294_967_296.0).round() as i64)
}

pub(crate) fn modulo_of(modulo: &Modulo, position: Position) -> Position {
    Position::from_bits(position.to_bits().rem_euclid(modulo.value().to_bits()))
}

pub(crate) fn degrees(position: Position) -> f64 {
    position.to_bits() as f64 / 4_294_967_296.0 * 360.0
}

pub(crate) fn rpm(value: f64) -> Velocity {
    Velocity::from_ten_thousandths_rpm((value * 10_000.0) as i32)
}

pub(crate) fn to_rpm(velocity: Velocity) -> f64 {
    f64::from(velocity.to_ten_thousandths_rpm()) / 10_000.0
}

pub(crate) fn largest(values: impl Iterator<Item = f64>) -> f64 {
    values.fold(0.0, |largest, value| largest.max(value.abs()))
}
