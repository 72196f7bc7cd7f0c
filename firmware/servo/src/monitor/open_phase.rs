//! Whether each of the three phases of the motor carries its part of the current.
//!
//! With an open phase the current of the other two is the same with its sign turned round: it cannot turn with the rotor any more, whatever the
//! current loop is asked for. What flows in each phase is compared with what was asked for there, and with what flows in the other two: where all
//! of them fall short, as at the limit of the voltage, no phase is open.
//!
//! A phase of which nothing is asked says nothing, and costs nothing: it is found as soon as half a per cent of the peak current is to flow in it. A
//! rotor that stands with nothing in that phase is not found.
//!
//! A rotor that turns by a third of a revolution between two looks shows a phase at the same angles again and again, and a current that is turned
//! by a few degrees against what is asked has nothing there at one of them. While it turns fast an eighth of what the other phases are asked for
//! is therefore to flow in it.

use crate::arithmetic::trigonometry::{Rotation, high_product, sum_of_products};

/// What was asked of each phase, and what flowed. A look is at one of them, and they take turns.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct OpenPhase {
    phases: [Seen; 3],
    /// The angle of the phase that the next look is at, 2^-32 revolution.
    axis: u32,
    /// That of the d axis at the last look.
    before: u32,
}

/// Sums of magnitudes, 2^-18 of peak.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
struct Seen {
    looks: u32,
    asked: i32,
    flowed: i32,
    /// The same in the one of the other two that has more.
    asked_beside: i32,
    flowed_beside: i32,
}

/// A current of a d and a q axis, 2^-26 of peak.
type Vector = [i32; 2];

/// 0.5 % of peak, of what is asked: eight counts of the usual range. Less is noise and rest of the offset.
const LEAST: i32 = (1 << 18) / 200;
/// 0.3 % of peak.
const LEAST_SHARE: i64 = (1 << 18) * 3 / 1_000;
/// A 36th of a revolution in a look of 500 us: 56 electrical revolutions a second. A mean of slower ones is one of many angles.
const FAST: u32 = u32::MAX / 36;
/// Looks of a mean, of 1.5 ms each: longer than a loop takes to follow.
const LOOKS: u32 = 12;
/// A third of a revolution.
const THIRD: u32 = u32::MAX / 3;
/// sqrt(3) / 4 in 2^-32.
const QUARTER_ROOT_OF_THREE: i32 = 1_859_775_394;

impl OpenPhase {
    /// Takes a cycle: the currents that are asked for and that flow, and the angle of their d axis, 2^-32 revolution. Whether a phase is open.
    #[inline]
    pub fn tick(&mut self, asked: Vector, flowing: Vector, angle: u32) -> bool {
        let rotation = Rotation::by(angle.wrapping_sub(self.axis));
        let ((asked, asked_beside), (flowed, flowed_beside)) = (part(asked, rotation), part(flowing, rotation));
        let [first, second, third] = &mut self.phases;
        let (seen, next) = match self.axis {
            0 => (first, THIRD),
            THIRD => (second, 2 * THIRD),
            _ => (third, 0),
        };
        self.axis = next;
        let moved = angle.wrapping_sub(core::mem::replace(&mut self.before, angle)).cast_signed();
        let least = if moved.unsigned_abs() > FAST { LEAST.max(asked_beside >> 3) } else { LEAST };
        asked >= least && seen.add((asked, flowed), (asked_beside, flowed_beside))
    }
}

/// In the phase that lies along 0, and in the one of the other two that has more.
#[inline]
fn part([direct, quadrature]: Vector, at: Rotation) -> (i32, i32) {
    // 2^-25
    let along = sum_of_products(direct, at.cosine, quadrature.wrapping_neg(), at.sine);
    let across = sum_of_products(direct, at.sine, quadrature, at.cosine);
    let side = high_product(across, QUARTER_ROOT_OF_THREE).wrapping_shl(1).wrapping_abs();
    let along = along.wrapping_abs();
    (along >> 7, side.wrapping_add(along >> 1) >> 7)
}

/// Magnitudes in the three phases, 2^-18 of peak.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub(crate) struct Phases([i32; 3]);

/// Those of a current, 2^-26 of peak, whose d axis is at this angle.
#[inline]
pub(crate) fn phases([direct, quadrature]: Vector, angle: u32) -> Phases {
    Phases(magnitudes([direct, quadrature], Rotation::by(angle)))
}

impl Phases {
    pub(crate) fn add(&mut self, other: &Self) {
        for (sum, value) in self.0.iter_mut().zip(other.0) {
            *sum = sum.wrapping_add(value);
        }
    }

    /// One of them has less than a quarter of its share: of what is asked of it when the largest that flows is what the largest was to be. A share
    /// below 0.3 % of peak says nothing.
    pub(crate) fn lack_a_share_of(&self, asked: &Self) -> bool {
        let [largest, largest_asked] = [self, asked].map(|phases| i64::from(phases.largest()));
        // Sums of a few magnitudes, 2^20 each.
        let lacks = |(one, asked): (&i32, i32)| {
            let share = i64::from(asked).wrapping_mul(largest);
            let [one, least] =
                [i64::from(*one).wrapping_mul(4), LEAST_SHARE].map(|part| part.wrapping_mul(largest_asked));
            share >= least && one < share
        };
        self.0.iter().zip(asked.0).any(lacks)
    }

    /// The largest of them is a quarter of another one's, or more.
    pub(crate) fn are_a_quarter_of(&self, other: &Self) -> bool {
        self.largest().wrapping_mul(4) >= other.largest()
    }

    /// One of them is missing, of which enough is asked, and the others are not.
    pub(crate) fn lack_one_of(&self, asked: &Self) -> bool {
        let (most, most_asked) = (self.largest(), asked.largest());
        let missing = |(one, asked): (&i32, i32)| {
            one.wrapping_mul(4) < asked && one.wrapping_mul(8) < most && asked.wrapping_mul(4) >= most_asked
        };
        self.0.iter().zip(asked.0).any(missing) && most.wrapping_mul(100) >= most_asked
    }

    fn largest(&self) -> i32 {
        let [a, b, c] = self.0;
        a.max(b).max(c)
    }

    /// The largest of them is less than a sixteenth of another one's.
    pub(crate) fn are_nothing_beside(&self, other: &Self) -> bool {
        self.largest().wrapping_mul(16) < other.largest()
    }
}

#[inline]
fn magnitudes([direct, quadrature]: Vector, at: Rotation) -> [i32; 3] {
    // 2^-25
    let alpha = sum_of_products(direct, at.cosine, quadrature.wrapping_neg(), at.sine);
    let beta = sum_of_products(direct, at.sine, quadrature, at.cosine);
    let side = high_product(beta, QUARTER_ROOT_OF_THREE).wrapping_shl(1);
    let half = alpha >> 1;
    [alpha, side.wrapping_sub(half), half.wrapping_add(side)].map(|current| current.wrapping_abs() >> 7)
}

impl Seen {
    #[inline]
    fn add(&mut self, (asked, flowed): (i32, i32), (asked_beside, flowed_beside): (i32, i32)) -> bool {
        self.looks = self.looks.wrapping_add(1);
        self.asked = self.asked.wrapping_add(asked);
        self.flowed = self.flowed.wrapping_add(flowed);
        self.asked_beside = self.asked_beside.wrapping_add(asked_beside);
        self.flowed_beside = self.flowed_beside.wrapping_add(flowed_beside);
        if self.looks < LOOKS {
            return false;
        }
        // At most 12 times four times the peak current: 2^24.
        let seen = core::mem::take(self);
        let flowed = seen.flowed.wrapping_mul(4);
        flowed < seen.asked && flowed < seen.flowed_beside && seen.asked_beside < seen.flowed_beside.wrapping_mul(4)
    }
}

#[cfg(test)]
mod tests {
    use core::f64::consts::TAU;

    use super::*;

    const PEAK: f64 = 67_108_864.0;

    /// Looks until a phase is told to be open: of a motor that is asked for a q current as a share of peak, with an angle that goes on by a part of a
    /// revolution in each look, in which a part of it flows; `open` has none, and the other two what is left.
    fn told(asked: f64, turn: f64, start: f64, part: f64, open: Option<usize>) -> Option<u32> {
        told_of_a_turned_current(asked, turn, start, part, 0.0, open)
    }

    /// The same of a current that is ahead of the one that is asked for by a part of a revolution.
    fn told_of_a_turned_current(
        asked: f64,
        turn: f64,
        start: f64,
        part: f64,
        ahead: f64,
        open: Option<usize>,
    ) -> Option<u32> {
        let mut monitor = OpenPhase::default();
        let mut random = 1_u32;
        (1..=4_000).find(|&look| {
            let angle = (start + turn * f64::from(look)) * TAU;
            let axis = |phase: usize| phase as f64 * TAU / 3.0;
            let current = |phase: usize| -asked * part * (angle + ahead * TAU - axis(phase)).sin();
            let mut flowing = [0, 1, 2].map(current);
            if let Some(open) = open {
                let (one, other) = ((open + 1) % 3, (open + 2) % 3);
                let left = (flowing[one] - flowing[other]) / 2.0;
                (flowing[open], flowing[one], flowing[other]) = (0.0, left, -left);
            }
            // Up to 1.5 counts of a range of 1.25 of peak.
            let flowing = flowing.map(|current| {
                random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                current + (f64::from(random >> 8) / f64::from(1 << 23) - 1.0) * 1.5 / 2_048.0 * 1.25
            });
            let project = |ahead: f64| {
                let sum: f64 = (0..3).map(|phase| flowing[phase] * (angle + ahead - axis(phase)).cos()).sum();
                (sum * 2.0 / 3.0 * PEAK) as i32
            };
            let turns = (angle / TAU).rem_euclid(1.0) * 4_294_967_296.0;
            monitor.tick([0, (asked * PEAK) as i32], [project(0.0), project(TAU / 4.0)], turns as u32)
        })
    }

    const TURNS: [f64; 6] = [0.0, 1e-5, 0.003, 0.05, 0.2, -0.1];

    #[test]
    fn an_open_phase_is_told_of_as_soon_as_a_hundredth_of_the_peak_current_is_asked_for() {
        for open in 0..3 {
            for asked in [0.01, -0.05, 1.0] {
                for turn in [0.003, 0.05, 0.2, -0.1] {
                    let looks = told(asked, turn, 0.1, 1.0, Some(open)).unwrap();
                    assert!((34..300).contains(&looks), "{open} {asked} {turn}: {looks}");
                }
            }
        }
        // Where the rotor stands: at once, or never where nothing is asked of that phase.
        assert_eq!(told(0.1, 0.0, 0.1, 1.0, Some(0)), Some(34));
        assert_eq!(told(0.1, 0.0, 0.0, 1.0, Some(0)), None);
    }

    #[test]
    fn no_sound_motor_is_told_of_at_any_current_angle_and_speed() {
        for asked in [0.0, 0.004, 0.006, 0.01, -0.03, 0.5, -1.0] {
            for turn in TURNS {
                for start in [0.0, 0.01, 0.08, 0.25, 0.33] {
                    assert_eq!(told(asked, turn, start, 1.0, None), None, "{asked} {turn} {start}");
                }
            }
        }
    }

    #[test]
    fn a_current_of_which_little_or_nothing_flows_in_any_phase_is_no_open_one() {
        for part in [0.0, 0.01, 0.1, 0.2, 0.5] {
            for turn in TURNS {
                assert_eq!(told(1.0, turn, 0.1, part, None), None, "{part} {turn}");
            }
        }
    }

    #[test]
    fn no_current_that_is_turned_by_four_degrees_is_taken_for_an_open_phase_at_any_speed() {
        // A look every 500 us, one of three phases: at multiples of 333.3 Hz every look at a phase is at the same angle.
        let locked = [1.0, 2.0, 3.0, -1.0, -2.0].map(|sixths| sixths / 6.0);
        let thirds_of_a_look = [1.0, 2.0, 4.0, -1.0].map(|part| part / 18.0);
        for turn in locked.into_iter().chain(thirds_of_a_look).chain(TURNS).filter(|turn| turn.abs() > 0.028) {
            for asked in [0.1, 0.5, -1.0] {
                for ahead in [-4.0, -2.0, 2.0, 4.0] {
                    for start in 0..72 {
                        let start = f64::from(start) / 72.0;
                        let told = told_of_a_turned_current(asked, turn, start, 1.0, ahead / 360.0, None);
                        assert_eq!(
                            told, None,
                            "{asked} of peak, turned by {ahead} degrees, {turn} a look, from {start}"
                        );
                    }
                }
            }
        }
    }
}
