//! The feedback values of one instant, as the loops have them.

use servo::axis::AxisOutput;
use servo::units::{CurrentFraction, Position, Velocity};

/// What the AT shows: where the axis was at t4, and what the loops had given by then. Each value is weighted when it is asked for, as few of
/// them are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct ShownValues {
    pub(crate) position: Position,
    pub(crate) velocity: Velocity,
    pub(crate) velocity_deviation: Velocity,
    pub(crate) following_error: Position,
    pub(crate) current: CurrentFraction,
}

impl ShownValues {
    /// At this position, with what the loops gave last and the current that flows.
    #[inline]
    pub(crate) fn at(position: Position, output: &AxisOutput, current: CurrentFraction) -> Self {
        Self {
            position,
            velocity: output.velocity,
            velocity_deviation: output.velocity_command - output.velocity,
            following_error: output.following_error,
            current,
        }
    }
}

/// S-0-0084 as it is transmitted, limited to 16 bits.
pub(crate) fn torque_word(torque: i64) -> u32 {
    let limited = torque.clamp(i64::from(i16::MIN), i64::from(i16::MAX));
    (limited & 0xFFFF).cast_unsigned() as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_torque_beyond_16_bits_is_shown_as_the_largest() {
        for (torque, word) in [(0, 0), (-1, 0xFFFF), (32_767, 0x7FFF), (40_000, 0x7FFF), (-40_000, 0x8000)] {
            assert_eq!(torque_word(torque), word);
        }
    }
}
