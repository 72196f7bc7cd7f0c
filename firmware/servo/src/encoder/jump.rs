//! Supervision of the motor encoder from one loop tick to the next: what no shaft can do.
//!
//! A jump, or a stop that no axis could make, is found here at the rate of the loops, before they turn it into torque. What takes longer to
//! tell (index, lost signal) is for [`crate::encoder::EncoderMonitor`].

use crate::encoder::monitor::{EncoderError, EncoderMonitorSettings};

/// Loop ticks that the counter must stand after its stop: an axis that hits something springs back.
const STOPPED_TICKS: u8 = 4;

/// State of the supervision.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct EncoderMotion {
    count: u32,
    /// Magnitudes of the changes in the last two ticks; the signal may be lost within one.
    changes: [u32; 2],
    /// Change in a tick before a stop that is too sudden, and the ticks since then.
    fastest: u32,
    standing: u8,
}

impl EncoderMotion {
    /// Starts with the counter at `count`, standing.
    #[must_use]
    pub const fn new(count: u32) -> Self {
        Self { count, changes: [0; 2], fastest: 0, standing: 0 }
    }

    /// One loop tick. An error is told once, in the tick in which it is found.
    #[inline]
    pub fn tick(&mut self, settings: &EncoderMonitorSettings, count: u32) -> Option<EncoderError> {
        let moved = count.wrapping_sub(self.count) as i32;
        self.count = count;
        let change = moved.unsigned_abs();
        let [last, before] = self.changes;
        self.changes = [change, last];
        // A track that has failed goes to and fro by one increment.
        if change > 1 {
            self.standing = 0;
            let jump = EncoderError::Jump { expected: settings.largest_jump, actual: moved };
            return (change > settings.largest_jump).then_some(jump);
        }
        if self.standing == 0 {
            self.fastest = last.max(before);
            self.standing = u8::from(self.fastest >= settings.fast);
            return None;
        }
        self.standing = self.standing.wrapping_add(1);
        if self.standing < STOPPED_TICKS {
            return None;
        }
        self.standing = 0;
        Some(EncoderError::SuddenStop { expected: self.fastest, actual: moved })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::encoder::monitor::EncoderMonitorParameters;
    use crate::units::Velocity;
    use proptest::prelude::*;

    /// 10 000 increments, 6000 rpm: 125 increments a loop tick.
    fn settings() -> EncoderMonitorSettings {
        EncoderMonitorSettings::new(&EncoderMonitorParameters {
            increments_per_revolution: 10_000,
            maximum_velocity: Velocity::from_bits((1_u64 << 36).div_ceil(80) as i32),
            pole_pairs: 4,
            flux: 133_333,
            dead_time_compensated: true,
            index_width: Some(1),
        })
        .unwrap()
    }

    #[test]
    fn a_jump_above_one_and_a_half_times_the_maximum_speed_is_found_in_both_directions_and_across_the_wrap() {
        for sign in [1_i32, -1] {
            let mut motion = EncoderMotion::new(u32::MAX);
            let mut count = u32::MAX.wrapping_add((188 * sign) as u32);
            assert_eq!(motion.tick(&settings(), count), None);
            count = count.wrapping_add((189 * sign) as u32);
            let error = motion.tick(&settings(), count);
            assert_eq!(error, Some(EncoderError::Jump { expected: 188, actual: 189 * sign }));
            count = count.wrapping_add((188 * sign) as u32);
            assert_eq!(motion.tick(&settings(), count), None, "told once");
        }
    }

    #[test]
    fn a_counter_that_stops_at_once_has_lost_its_signal_and_is_found_within_four_ticks() {
        // 13 increments a tick, and what is left of them in the tick in which the cable breaks.
        for (sign, rest, jitter) in [(1, 6, 0), (1, 6, 1), (-1, 12, 1)] {
            let mut motion = EncoderMotion::new(0);
            let mut count = 0_u32;
            let mut turn = |moved: i32| {
                count = count.wrapping_add_signed(moved * sign);
                motion.tick(&settings(), count)
            };
            for moved in [13, 13, rest, jitter, -jitter, jitter] {
                assert_eq!(turn(moved), None, "{sign} {rest} {jitter}");
            }
            let expected = EncoderError::SuddenStop { expected: 13, actual: -jitter * sign };
            assert_eq!(turn(-jitter), Some(expected));
            assert_eq!(turn(0), None, "told once");
        }
    }

    #[test]
    fn an_axis_that_brakes_hard_or_springs_back_has_its_signal() {
        for moves in [
            // 100 000 rad/s^2.
            &[13, 13, 10, 8, 5, 3, 0, 0, 0, 0, 0][..],
            // Against a stop.
            &[13, 13, 1, 0, -4, -6, -2, 1, 1, 0, 0, 0, 0],
            // Too slow for a proof.
            &[7, 7, 0, 0, 0, 0, 0, 0],
        ] {
            let mut motion = EncoderMotion::new(0);
            let mut count = 0_u32;
            for &moved in moves {
                count = count.wrapping_add_signed(moved);
                assert_eq!(motion.tick(&settings(), count), None, "{moves:?}");
            }
        }
    }

    proptest! {
        #[test]
        fn a_shaft_that_cannot_stop_at_once_is_never_blamed(start in any::<u32>(), changes in proptest::collection::vec(-3_i32..=3, 1..500)) {
            let mut motion = EncoderMotion::new(start);
            let (mut count, mut speed) = (start, 0_i32);
            for change in changes {
                speed = (speed + change).clamp(-188, 188);
                count = count.wrapping_add_signed(speed);
                prop_assert_eq!(motion.tick(&settings(), count), None);
            }
        }
    }
}
