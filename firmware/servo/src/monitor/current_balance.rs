//! Whether the sensors of the three phases agree: what is too little for the current loop to switch off at once, and still a wrong torque.
//!
//! The currents of the motor add up to nothing, the samples of three sensors do not: an offset stands in their sum, and a gain that is off makes it
//! go with the current. The phase with the largest current is the measure, because no gain error can hide in it: with three gains within 1.8 % of
//! each other's mean the sum stays below 3.6 % of that current at every angle of the rotor. Means over many samples leave the noise out.
//!
//! Where shunts of the low side hide a phase, the currents were made to add up to nothing, and say nothing. Those are left out.

/// What was seen of each phase while it had the largest current, and of all three together.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct CurrentBalance {
    phases: [Seen; 3],
    all: Seen,
}

/// Sums, in counts 2^-3.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
struct Seen {
    /// Of the sums of the phases, in the direction of the current.
    sum: i32,
    /// Of what they are measured by.
    measure: i32,
}

/// The range of a sensor.
const RANGE: i32 = 1 << 14;
/// A quarter of the range, below which noise and the rest of the offsets would be taken for a gain.
const LEAST: i32 = RANGE / 4;
/// A mean is taken over so much: 64 samples of half the range.
const ENOUGH: i32 = 32 * RANGE;
/// 3.75 %: more is an error.
const ERROR: i32 = 3;
const OF: i32 = 80;

impl CurrentBalance {
    /// Takes the currents of a cycle in counts 2^-3, offsets removed. Whether the sensors contradict each other.
    #[inline]
    pub fn tick(&mut self, [a, b, c]: [i32; 3]) -> bool {
        let sum = a.wrapping_add(b).wrapping_add(c);
        if sum == 0 {
            return false;
        }
        let [of_a, of_b, of_c] = &mut self.phases;
        let length = [a.wrapping_abs(), b.wrapping_abs(), c.wrapping_abs()];
        let [length_a, length_b, length_c] = length;
        let (seen, current, length) = if length_a >= length_b && length_a >= length_c {
            (of_a, a, length_a)
        } else if length_b >= length_c {
            (of_b, b, length_b)
        } else {
            (of_c, c, length_c)
        };
        let along = if current < 0 { sum.wrapping_neg() } else { sum };
        let gain = length >= LEAST && seen.add(along, length);
        self.all.add(sum, RANGE) || gain
    }
}

impl Seen {
    /// Whether there is enough for a mean, and it is too large.
    #[inline]
    fn add(&mut self, sum: i32, measure: i32) -> bool {
        self.sum = self.sum.wrapping_add(sum);
        self.measure = self.measure.wrapping_add(measure);
        if self.measure < ENOUGH {
            return false;
        }
        let Self { sum, measure } = core::mem::take(self);
        // At most 48 samples beyond the range each.
        sum.wrapping_abs().wrapping_mul(OF) > measure.wrapping_mul(ERROR)
    }
}

#[cfg(test)]
mod tests {
    use core::f64::consts::TAU;

    use super::*;

    /// Ticks until an error is told, of sensors with these gains and offsets in counts, at a current as a share of the range that turns by so many
    /// revolutions a tick; with noise of a count.
    fn told(gains: [f64; 3], offsets: [f64; 3], current: f64, turn: f64, start: f64) -> Option<u32> {
        let mut balance = CurrentBalance::default();
        let mut random = 1_u32;
        let mut noise = || {
            // Four even ones: a deviation of 1.15.
            (0..4).fold(0.0, |sum, _| {
                random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                sum + f64::from(random >> 8) / f64::from(1 << 23) - 1.0
            })
        };
        (1..=8_000).find(|&tick| {
            let sample = core::array::from_fn(|phase| {
                let angle = (start + turn * f64::from(tick) - phase as f64 / 3.0) * TAU;
                let counts = current * 2_048.0 * angle.cos() * (1.0 + gains[phase]) + offsets[phase] + noise();
                (counts.round() * 8.0) as i32
            });
            balance.tick(sample)
        })
    }

    /// Turns a tick: standing, slow, fast, and in step with the look.
    const TURNS: [f64; 6] = [0.0, 1e-4, 0.013, 0.1, 0.2, 1.0 / 3.0];

    #[test]
    fn sensors_of_parts_of_one_percent_and_a_half_are_never_told_of_at_any_current_and_angle() {
        for signs in 0..8_u32 {
            let gains = [0, 1, 2].map(|phase| if signs >> phase & 1 == 0 { 0.015 } else { -0.015 });
            for current in [0.0, 0.1, 0.25, 0.8, 1.0] {
                for (number, turn) in TURNS.into_iter().enumerate() {
                    let start = 0.137 * number as f64;
                    let told = told(gains, [3.0, -3.0, 2.0], current, turn, start);
                    assert_eq!(told, None, "{gains:?}, {current} at {turn}");
                }
            }
        }
    }

    #[test]
    fn a_gain_that_is_five_percent_off_is_told_of_within_a_third_of_a_second() {
        for phase in 0..3 {
            for error in [0.05, -0.05] {
                for current in [0.3, 0.8] {
                    let mut latest = 0;
                    // Where the rotor stands, another phase may have all the current.
                    for (number, turn) in TURNS[2..].iter().enumerate() {
                        let mut gains = [0.005, -0.003, -0.005];
                        gains[phase] = error;
                        let start = 0.09 * number as f64;
                        latest = latest.max(told(gains, [0.0; 3], current, *turn, start).unwrap());
                    }
                    assert!((20..600).contains(&latest), "{phase} {error} {current}: {latest} ticks");
                }
            }
        }
    }

    #[test]
    fn an_offset_of_four_percent_of_the_range_is_told_of_in_sixteen_milliseconds_without_a_current() {
        for offset in [85.0, -85.0] {
            let ticks = told([0.0; 3], [0.0, offset, 0.0], 0.0, 0.0, 0.0).unwrap();
            assert_eq!(ticks, 32, "of 0.5 ms");
        }
    }

    #[test]
    fn currents_of_which_one_follows_from_the_other_two_say_nothing() {
        let mut balance = CurrentBalance::default();
        for _ in 0..10_000 {
            assert!(!balance.tick([12_000, -7_000, -5_000]));
        }
        assert_eq!(balance, CurrentBalance::default());
    }
}
