//! Movements that the drive makes by itself: to a position or to a velocity, within limits of velocity, acceleration and jerk.
//!
//! A tick looks one step ahead: it takes the highest acceleration from which the movement can still stop at its target. There is no plan
//! that a new target or a new limit would invalidate; both may change in any tick.

use crate::arithmetic::wide::limited;
use crate::path::limits::{MotionLimits, Shape, Smooth};
use crate::path::setpoint::Setpoint;
use crate::path::stopping::{COARSE_POSITION, FAR, Slope, approach, approach_from, best_between, margin};
use crate::units::derivatives::SignedAcceleration;
use crate::units::{Position, Velocity};

/// A movement: where it is, and how it moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Trajectory {
    position: Position,
    /// Position below one step, in 2^-48 revolution: 0 .. 2^16.
    below: i64,
    /// The way of the last tick, in 2^-48 revolution.
    velocity: i64,
    /// What the last tick added to the velocity.
    acceleration: i64,
    finished: bool,
}

impl Trajectory {
    /// Begins at this setpoint, also in full run.
    #[must_use]
    pub fn start(setpoint: Setpoint) -> Self {
        Self {
            position: setpoint.position,
            below: 0,
            velocity: i64::from(setpoint.velocity.to_bits()) << 12,
            acceleration: limited(setpoint.acceleration.to_bits(), Slope::LARGEST),
            finished: false,
        }
    }

    /// One tick further to `target`, at most 2^31 revolutions away; the side that is nearer counts.
    ///
    /// A movement away from the target first comes to a stop. One that cannot stop in time passes the target, stops and comes back.
    #[inline]
    pub fn tick_to(&mut self, limits: &MotionLimits, target: Position) -> Setpoint {
        let (gap, backwards) = self.gap(target);
        let motion = Motion { velocity: self.velocity, acceleration: self.acceleration }.mirrored(backwards);
        let acceleration = match &limits.shape {
            Shape::Trapezoid { brake } => motion.straight_to(limits, *brake, gap),
            Shape::Smooth(smooth) => motion.smoothly_to(limits, smooth, gap),
        };
        self.advance(if backwards { acceleration.wrapping_neg() } else { acceleration });
        self.finished = self.velocity == 0 && self.acceleration == 0 && self.below == 0 && self.position == target;
        self.setpoint()
    }

    /// One tick further to the velocity `target`, or to the velocity limit when that is lower. A reversal goes through a stop.
    #[inline]
    pub fn tick_velocity(&mut self, limits: &MotionLimits, target: Velocity) -> Setpoint {
        let target = limited(i64::from(target.to_bits()) << 12, limits.velocity);
        let motion = Motion { velocity: self.velocity, acceleration: self.acceleration };
        self.advance(motion.to_velocity(limits, target));
        self.finished = self.velocity == target && self.acceleration == 0;
        self.setpoint()
    }

    /// Position, velocity and acceleration of the last tick.
    #[inline]
    #[must_use]
    pub fn setpoint(&self) -> Setpoint {
        Setpoint {
            position: self.position,
            velocity: Velocity::saturating_from_bits(self.velocity >> 12),
            acceleration: SignedAcceleration::from_bits(self.acceleration),
        }
    }

    /// The target of the last tick is reached: the position, at rest, or the velocity, without acceleration.
    #[inline]
    #[must_use]
    pub const fn is_finished(&self) -> bool {
        self.finished
    }

    /// Neither velocity nor acceleration.
    #[must_use]
    pub const fn is_at_rest(&self) -> bool {
        self.velocity == 0 && self.acceleration == 0
    }

    /// Whether [`Trajectory::tick_to`] stops at `target` from where it is now without passing it. A movement away from it comes back to it.
    #[must_use]
    pub fn stops_before(&self, limits: &MotionLimits, target: Position) -> bool {
        let (gap, backwards) = self.gap(target);
        let motion = Motion { velocity: self.velocity, acceleration: self.acceleration }.mirrored(backwards);
        motion.velocity <= 0
            || match &limits.shape {
                Shape::Trapezoid { brake } => margin(*brake, gap.coarse, motion.velocity, COARSE_POSITION) >= 0,
                Shape::Smooth(smooth) => {
                    let braking = motion.to_velocity_smoothly(limits, smooth.jerk, smooth.brake.release(), 0);
                    smooth.brake.margin(gap.coarse, motion.velocity, braking) >= 0
                }
            }
    }

    /// Shifts the position by `difference` without a movement (homing).
    pub fn shift(&mut self, difference: Position) {
        self.position = self.position + difference;
    }

    /// The way to `target`, and whether it leads backwards.
    #[inline]
    fn gap(&self, target: Position) -> (Gap, bool) {
        let steps = (target - self.position).to_bits();
        let backwards = steps < 0 || (steps == 0 && self.below > 0);
        // Rounded towards zero, so that both directions go the same way.
        let up = if backwards { 0 } else { (1 << COARSE_POSITION) - 1 };
        let fine = (limited(steps, FAR >> 16) << 16).wrapping_sub(self.below);
        let coarse =
            (limited(steps, FAR >> 12) << 12).wrapping_sub(self.below.wrapping_add(up).wrapping_shr(COARSE_POSITION));
        (Gap { fine: fine.wrapping_abs(), coarse: coarse.wrapping_abs() }, backwards)
    }

    #[inline]
    fn advance(&mut self, acceleration: i64) {
        self.acceleration = acceleration;
        self.velocity = self.velocity.wrapping_add(acceleration);
        let fine = self.below.wrapping_add(self.velocity);
        self.position = self.position + Position::from_bits(fine >> 16);
        self.below = fine & 0xFFFF;
    }
}

/// What is left of the way; neither is negative.
#[derive(Clone, Copy)]
struct Gap {
    /// In 2^-48 revolution, exact up to 2^14 revolutions and no more beyond.
    fine: i64,
    /// In 2^-44 revolution, up to 2^18 revolutions: more than any movement needs to stop.
    coarse: i64,
}

/// Velocity and acceleration, seen so that the target lies ahead.
#[derive(Clone, Copy)]
struct Motion {
    velocity: i64,
    acceleration: i64,
}

impl Motion {
    #[inline]
    const fn mirrored(self, mirror: bool) -> Self {
        if mirror {
            Self { velocity: self.velocity.wrapping_neg(), acceleration: self.acceleration.wrapping_neg() }
        } else {
            self
        }
    }

    /// Acceleration of the next tick towards a position ahead, without jerk limit.
    #[inline]
    fn straight_to(self, limits: &MotionLimits, brake: Slope, gap: Gap) -> i64 {
        let (lowest, highest) = self.reachable(limits);
        // The next tick ends at the target, and the one after it stands.
        let lands = (lowest..=highest).contains(&gap.fine) && gap.fine <= limits.deceleration;
        let next = if lands {
            gap.fine
        } else {
            approach_from(brake, gap.coarse, self.velocity, lowest, highest, COARSE_POSITION)
        };
        next.wrapping_sub(self.velocity)
    }

    /// Lowest and highest velocity of the next tick without jerk limit; braking ends at zero.
    #[inline]
    fn reachable(self, limits: &MotionLimits) -> (i64, i64) {
        let velocity = self.velocity;
        if velocity < 0 {
            let slower = velocity.wrapping_add(limits.deceleration).min(0);
            return (slower, slower);
        }
        let slower = velocity.wrapping_sub(limits.deceleration).max(0);
        (slower, velocity.wrapping_add(limits.acceleration).min(limits.velocity).max(slower))
    }

    /// Acceleration of the next tick towards a position ahead, with jerk limit.
    #[inline]
    fn smoothly_to(self, limits: &MotionLimits, smooth: &Smooth, gap: Gap) -> i64 {
        let Self { velocity, acceleration } = self;
        // The next tick ends at the target, the one after it stands, and the third one has no acceleration: three jerks within the limit.
        let landing = gap.fine.wrapping_sub(velocity);
        let jerks = [landing.wrapping_sub(acceleration), landing.wrapping_add(gap.fine), gap.fine];
        if jerks.iter().all(|jerk| jerk.wrapping_abs() <= smooth.jerk) && gap.fine <= limits.velocity.max(velocity) {
            return landing;
        }
        let hardest = self.to_velocity_smoothly(limits, smooth.jerk, smooth.release, 0);
        if velocity < 0 {
            return hardest;
        }
        let fastest = self.to_velocity_smoothly(limits, smooth.jerk, smooth.release, limits.velocity);
        // The brake as it is planned; harder only when the way does not suffice for it.
        let planned = self.to_velocity_smoothly(limits, smooth.jerk, smooth.brake.release(), 0).min(fastest);
        let margin = |next| smooth.brake.margin(gap.coarse, velocity, next);
        if margin(planned) >= 0 {
            best_between(planned, fastest, margin)
        } else {
            best_between(hardest.min(planned), planned, margin)
        }
    }

    /// Acceleration of the next tick towards a velocity.
    #[inline]
    fn to_velocity(self, limits: &MotionLimits, target: i64) -> i64 {
        match &limits.shape {
            Shape::Smooth(smooth) => self.to_velocity_smoothly(limits, smooth.jerk, smooth.release, target),
            Shape::Trapezoid { .. } => {
                let backwards = if self.velocity == 0 { target < 0 } else { self.velocity < 0 };
                let seen = self.mirrored(backwards);
                let target = if backwards { target.wrapping_neg() } else { target };
                let (lowest, highest) = seen.reachable(limits);
                let next = target.max(lowest).min(highest.max(lowest)).wrapping_sub(seen.velocity);
                if backwards { next.wrapping_neg() } else { next }
            }
        }
    }

    /// Acceleration of the next tick towards a velocity, with jerk limit.
    #[inline]
    fn to_velocity_smoothly(self, limits: &MotionLimits, jerk: i64, release: Slope, target: i64) -> i64 {
        // A reversal stops first: the limit of the acceleration may be another one there.
        let reverses = (self.velocity < 0 && target > 0) || (self.velocity > 0 && target < 0);
        let gap = if reverses { 0 } else { target }.wrapping_sub(self.velocity);
        let down = gap < 0;
        let seen = self.mirrored(down);
        let gap = gap.wrapping_abs();
        let limit = if seen.velocity < 0 { limits.deceleration } else { limits.acceleration };
        let lowest = seen.acceleration.wrapping_sub(jerk);
        let highest = seen.acceleration.wrapping_add(jerk).min(limit).max(lowest);
        // The next tick ends at the velocity, and the one after it has no acceleration.
        let lands = (lowest..=highest).contains(&gap) && gap <= jerk;
        let next = if lands { gap } else { approach(release, gap, lowest, highest, 0) };
        if down { next.wrapping_neg() } else { next }
    }
}
