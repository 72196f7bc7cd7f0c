//! The controller of the swaying, and what its output tells about the motor.

use super::super::{DEGREE, limited_angle};

/// The current is turned away from the estimate by no more than this: more would not give more torque.
const LARGEST_TURN: i32 = 75 * DEGREE;

/// Products of two angles are formed without their last bits, so that their sum over a period stays within 64 bits.
const PRODUCT_SHIFT: u32 = 12;

/// Position control with the direction of the current: the torque goes with the sine of its turn.
///
/// With `w²` the acceleration per radian of turn, the swing of the pulses has set `w T` to 0.16 to 0.35. The gains 4 and 16 T give a
/// controller with `2 w` and a damping of 0.7 to 1.4, at any inertia and current.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub(super) struct Controller {
    /// Low-pass of the movement with T/2, in 2^-8 of an angle step: what the movement is ahead of it is the velocity.
    lag: i64,
    integral: i64,
}

impl Controller {
    /// At rest at this movement.
    pub(super) const fn at(moved: i32) -> Self {
        Self { lag: (moved as i64) << 8, integral: 0 }
    }

    /// The deviation that was left is made up for elsewhere now.
    pub(super) fn forget(&mut self) {
        self.integral = 0;
    }

    /// Follows the movement; gives what it is ahead of its low-pass.
    #[inline]
    pub(super) fn follow(&mut self, moved: i32, scale: u32) -> i64 {
        let fine = i64::from(moved) << 8;
        self.lag = self.lag.wrapping_add(fine.wrapping_sub(self.lag) >> scale.wrapping_sub(1));
        fine.wrapping_sub(self.lag) >> 8
    }

    /// Turn of the current for this deviation, the integral part as it is.
    #[inline]
    pub(super) fn without_integral(&mut self, moved: i32, target: i32, scale: u32) -> i32 {
        let ahead = self.follow(moved, scale);
        let deviation = i64::from(moved).wrapping_sub(i64::from(target));
        let wanted = (deviation << 2).wrapping_add(ahead << 5).wrapping_add(self.integral >> scale.wrapping_add(2));
        limited_angle(wanted.wrapping_neg(), LARGEST_TURN)
    }

    /// Turn of the current that brings the rotor to `target`. `T` is 2^scale ticks.
    #[inline]
    pub(super) fn tick(&mut self, moved: i32, target: i32, scale: u32) -> i32 {
        let limit = i64::from(LARGEST_TURN) << scale.wrapping_add(2);
        let deviation = i64::from(moved).wrapping_sub(i64::from(target));
        self.integral = self.integral.wrapping_add(deviation).min(limit).max(limit.wrapping_neg());
        self.without_integral(moved, target, scale)
    }
}

/// Sums over a period of the swaying, of turn and movement and their products.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub(super) struct Sums {
    turn: i64,
    moved: i64,
    turn_moved: i64,
    moved_moved: i64,
    least: i32,
    most: i32,
}

/// What a period tells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Means {
    pub(super) turn: i32,
    pub(super) range: i32,
    pub(super) counted: Counted,
}

/// How the direction of the current turns with the angle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Counted {
    /// With the encoder.
    Forwards,
    /// Not at all.
    Not,
    /// Against the encoder.
    Backwards,
}

impl Sums {
    /// With one tick more.
    #[inline]
    pub(super) fn with(self, turn: i32, moved: i32) -> Self {
        let (t, m) = (i64::from(turn >> PRODUCT_SHIFT), i64::from(moved >> PRODUCT_SHIFT));
        let begins = self == Self::default();
        Self {
            turn: self.turn.wrapping_add(t),
            moved: self.moved.wrapping_add(m),
            turn_moved: self.turn_moved.wrapping_add(t.wrapping_mul(m)),
            moved_moved: self.moved_moved.wrapping_add(m.wrapping_mul(m)),
            least: if begins { moved } else { self.least.min(moved) },
            most: if begins { moved } else { self.most.max(moved) },
        }
    }

    /// Over 2^shift ticks.
    #[inline]
    pub(super) fn means(&self, shift: u32) -> Means {
        let with_turn = self.turn_moved.wrapping_sub(self.turn.wrapping_mul(self.moved) >> shift);
        let with_itself = self.moved_moved.wrapping_sub(self.moved.wrapping_mul(self.moved) >> shift);
        Means {
            turn: ((self.turn << PRODUCT_SHIFT) >> shift) as i32,
            range: self.most.wrapping_sub(self.least),
            // Inertia gives a slope of -0.45 to 0; to that come -1 with a phase missing, -2 with two of them swapped.
            counted: if with_turn < with_itself.wrapping_mul(7).wrapping_neg() >> 2 {
                Counted::Backwards
            } else if with_turn < with_itself.wrapping_mul(11).wrapping_neg() >> 4 {
                Counted::Not
            } else {
                Counted::Forwards
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_slope_of_turn_over_movement_tells_how_the_current_turns() {
        for (hundredths, expected) in [
            (50, Counted::Forwards),
            (0, Counted::Forwards),
            (-65, Counted::Forwards),
            (-72, Counted::Not),
            (-170, Counted::Not),
            (-180, Counted::Backwards),
            (-300, Counted::Backwards),
        ] {
            let mut sums = Sums::default();
            for tick in 0..256 {
                let moved = (tick - 100) * (DEGREE / 40);
                // Both have means that have nothing to do with the slope.
                sums = sums.with(moved / 100 * hundredths + 20 * DEGREE, moved);
            }
            let means = sums.means(8);
            assert_eq!(means.counted, expected, "{hundredths}");
            assert_eq!(means.range, 255 * (DEGREE / 40));
            // The movement has a mean of 27.5 fortieths of a degree.
            let turn = 20 * DEGREE + (DEGREE / 40 * 55 / 2) / 100 * hundredths;
            assert!((means.turn - turn).abs() < DEGREE / 500, "{} {turn}", means.turn);
        }
    }

    #[test]
    fn the_turn_is_proportional_damped_integrated_and_limited() {
        let mut controller = Controller::at(DEGREE);
        assert_eq!(controller.without_integral(DEGREE, 0, 3), -4 * DEGREE);
        assert_eq!(controller.without_integral(DEGREE, 2 * DEGREE, 3), 4 * DEGREE);
        // One degree further in a tick: a quarter of it is followed at once with T = 8 ticks.
        let turn = controller.without_integral(2 * DEGREE, 2 * DEGREE, 3);
        assert!((turn + 24 * DEGREE).abs() < 100, "{turn}");
        assert_eq!(controller.without_integral(20 * DEGREE, 0, 3), -LARGEST_TURN);

        // A deviation of one degree for 16 T: the integral part has the size of the proportional one.
        let mut controller = Controller::at(DEGREE);
        let turn = (0..128).map(|_| controller.tick(DEGREE, 0, 3)).last().unwrap();
        assert!((turn + 8 * DEGREE).abs() < 100, "{turn}");
        controller.forget();
        assert_eq!(controller.without_integral(DEGREE, 0, 3), -4 * DEGREE);
        for _ in 0..10_000 {
            controller.tick(DEGREE, 0, 3);
        }
        // What was integrated beyond the limit would have to be taken back first.
        let turn = controller.without_integral(DEGREE, 2 * DEGREE, 3);
        assert_eq!(turn, 4 * DEGREE - LARGEST_TURN);
    }
}
