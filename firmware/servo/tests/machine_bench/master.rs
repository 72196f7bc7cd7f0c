//! Commands of a master, and their units.

use servo::units::{Position, Velocity};

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
    /// At rest, with a cycle of so many ticks.
    pub(crate) fn new(ticks: u16) -> Self {
        Self { position: 0.0, velocity: 0.0, cycle: f64::from(ticks) * 125e-6 }
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

/// In revolutions.
pub(crate) fn turns(position: Position) -> f64 {
    position.to_bits() as f64 / 4_294_967_296.0
}

/// In counts of 2^20 a revolution.
pub(crate) fn counts(position: Position) -> f64 {
    turns(position) * 1_048_576.0
}

pub(crate) fn rpm(value: f64) -> Velocity {
    Velocity::from_ten_thousandths_rpm((value * 10_000.0).round() as i32)
}

pub(crate) fn to_rpm(velocity: Velocity) -> f64 {
    f64::from(velocity.to_bits()) * 480_000.0 / 68_719_476_736.0
}

/// rad/s in rpm.
pub(crate) fn of_radians(velocity: f64) -> f64 {
    velocity * 60.0 / std::f64::consts::TAU
}
