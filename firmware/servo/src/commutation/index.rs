//! The first index pulse after the alignment: the commutation angle becomes that of the stored parameter.
//!
//! An alignment is right within a few degrees; the index pulse is right within one increment. The electrical angle of the rotor at the
//! index is a property of the motor with its encoder: measured once, and stored.

use core::fmt;

use super::DEGREE;

/// A larger deviation between alignment and stored angle is no inaccuracy of the alignment but a fault: 30 electrical degrees.
const LARGEST_DEVIATION: i32 = 30 * DEGREE;

/// The angle is turned by so much in a tick of the supervision: 30 degrees take 5 ms.
const SLEW: i32 = LARGEST_DEVIATION / 10;

/// The stored angle and the aligned one do not belong together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum IndexError {
    /// More than 30 electrical degrees apart. Encoder or motor changed without a new measurement, lost increments, wrong number of
    /// increments or pole pairs, a second index mark.
    Deviation {
        /// Electrical angle of the rotor at the index by the alignment; 2^32 is one revolution.
        actual: u32,
        /// The stored one.
        expected: u32,
    },
}

impl fmt::Display for IndexError {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let degrees = |angle: u32| u64::from(angle).wrapping_mul(360) >> 32;
        match self {
            Self::Deviation { actual, expected } => write!(
                formatter,
                "electrical angle of {} degrees at the index, stored are {}; more than 30 degrees apart",
                degrees(*actual),
                degrees(*expected)
            ),
        }
    }
}

impl core::error::Error for IndexError {}

/// How far the correction has come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum IndexState {
    /// No index pulse yet.
    Waiting,
    /// The angle is being turned.
    Correcting,
    /// The angle is that of the stored parameter.
    Corrected {
        /// What the alignment was off.
        deviation: i32,
    },
    /// Nothing was stored; this is to be stored.
    Found {
        /// Electrical angle of the rotor at the index; 2^32 is one revolution.
        angle: u32,
    },
    /// Not corrected.
    Failed(IndexError),
}

/// What the correction gives in a tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct IndexOutput {
    /// For [`crate::commutation::CommutationAngle::correct`], in this tick.
    pub correction: i32,
    /// State after this tick.
    pub state: IndexState,
}

/// Corrects the commutation angle at the first index pulse.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct IndexCorrection {
    stored: Option<u32>,
    deviation: i32,
    left: i32,
    state: IndexState,
}

impl IndexCorrection {
    /// Begins after an alignment. `stored` is the electrical angle of the rotor at the index; `None`: not measured yet.
    #[must_use]
    pub const fn start(stored: Option<u32>) -> Self {
        Self { stored, deviation: 0, left: 0, state: IndexState::Waiting }
    }

    /// One tick. `index` is the electrical angle, as it is believed now, of the position latched in hardware at the first index pulse;
    /// only the first `Some` is looked at.
    #[inline]
    pub fn tick(&mut self, index: Option<u32>) -> IndexOutput {
        if let (IndexState::Waiting, Some(actual)) = (self.state, index) {
            self.state = self.seen(actual);
        }
        let mut correction = 0;
        if self.state == IndexState::Correcting {
            correction = self.left.clamp(-SLEW, SLEW);
            self.left = self.left.wrapping_sub(correction);
            if self.left == 0 {
                self.state = IndexState::Corrected { deviation: self.deviation };
            }
        }
        IndexOutput { correction, state: self.state }
    }

    #[inline]
    fn seen(&mut self, actual: u32) -> IndexState {
        let Some(expected) = self.stored else { return IndexState::Found { angle: actual } };
        let deviation = expected.wrapping_sub(actual) as i32;
        if deviation.saturating_abs() > LARGEST_DEVIATION {
            return IndexState::Failed(IndexError::Deviation { actual, expected });
        }
        self.deviation = deviation;
        self.left = deviation;
        IndexState::Correcting
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_deviation_is_slewed_away_within_five_milliseconds() {
        for degrees in [-30, -7, -1, 0, 1, 12, 30] {
            let deviation = degrees * DEGREE;
            let stored = 0xFFFF_FF00_u32;
            let mut correction = IndexCorrection::start(Some(stored));
            for _ in 0..100 {
                assert_eq!(correction.tick(None), IndexOutput { correction: 0, state: IndexState::Waiting });
            }
            let mut angle = stored.wrapping_add_signed(-deviation);
            let mut index = Some(angle);
            let mut ticks = 0;
            loop {
                let output = correction.tick(index);
                // Later pulses, or the same one seen under the corrected angle, change nothing.
                index = Some(angle ^ 0x4000_0000);
                angle = angle.wrapping_add_signed(output.correction);
                assert!(output.correction.abs() <= 3 * DEGREE);
                ticks += 1;
                if output.state != IndexState::Correcting {
                    assert_eq!(output.state, IndexState::Corrected { deviation });
                    break;
                }
            }
            assert_eq!(angle, stored);
            let expected = (degrees.abs() + 2) / 3;
            assert!((expected.max(1)..=expected + 1).contains(&ticks), "{ticks} ticks for {degrees} degrees");
            assert_eq!(correction.tick(index).correction, 0, "once");
        }
    }

    #[test]
    fn more_than_thirty_degrees_is_an_error_and_corrects_nothing() {
        for (deviation, refused) in
            [(30 * DEGREE + 1, true), (-30 * DEGREE - 1, true), (i32::MIN, true), (-30 * DEGREE, false)]
        {
            let actual = 1_000_u32.wrapping_sub(deviation as u32);
            let mut correction = IndexCorrection::start(Some(1_000));
            let output = correction.tick(Some(actual));
            let expected = IndexState::Failed(IndexError::Deviation { actual, expected: 1_000 });
            assert_eq!(output.state == expected, refused, "{output:?}");
            assert_eq!(output.correction == 0, refused);
        }
    }

    #[test]
    fn without_a_stored_angle_the_found_one_is_reported() {
        let mut correction = IndexCorrection::start(None);
        let expected = IndexOutput { correction: 0, state: IndexState::Found { angle: 0x1234_5678 } };
        assert_eq!(correction.tick(Some(0x1234_5678)), expected);
        assert_eq!(correction.tick(Some(0x8765_4321)), expected);
    }
}
