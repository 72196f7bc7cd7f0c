//! How far a position command may be from the one before it, or from the axis where following begins.

use core::fmt;

use crate::units::Position;

/// A position command that the axis does not take, because it would have to jump.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum CommandJump {
    /// The first command lies further from where the axis would be by then, if it went on as it does, than the monitoring window S-0-0159.
    FarFromAxis {
        /// From the axis to the command.
        actual: Position,
        /// The window.
        limit: Position,
    },
    /// The command lies further from the one before it than a control unit cycle, or as many as have gone by, allow; or the first one from
    /// the axis, where no window is monitored.
    Step {
        /// From one command to the next.
        actual: Position,
        /// Largest step.
        limit: Position,
    },
}

impl fmt::Display for CommandJump {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (what, actual, limit) = match self {
            Self::FarFromAxis { actual, limit } => ("command away from the axis", actual, limit),
            Self::Step { actual, limit } => ("step of the command", actual, limit),
        };
        let [actual, limit] = [actual, limit].map(|position| position.to_bits());
        write!(formatter, "{what} of {actual} in 2^-32 revolution, expected at most {limit}")
    }
}

impl core::error::Error for CommandJump {}

/// What a position command may ask for; see [`CommandJump`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct CommandLimits {
    /// In position steps.
    step: u64,
    window: u64,
}

impl CommandLimits {
    /// Everything is taken.
    pub const NONE: Self = Self { step: NOTHING_IS_FURTHER, window: NOTHING_IS_FURTHER };

    /// * `step`: what a command may be away from the one before it, a control unit cycle ago; zero: any distance.
    /// * `window`: what the first command may be away from the axis (S-0-0159); zero: a step.
    #[must_use]
    pub const fn new(step: Position, window: Position) -> Self {
        let step = match step.to_bits().unsigned_abs() {
            0 => NOTHING_IS_FURTHER,
            step => step,
        };
        Self { step, window: window.to_bits().unsigned_abs() }
    }

    /// Whether a command so far from the one before needs [`CommandLimits::look_at_step`].
    #[inline]
    pub(crate) const fn is_passed_by(&self, way: i64) -> bool {
        way.unsigned_abs() > self.step
    }

    /// Looks at a command `way` away from the one before it, `cycles` ago.
    pub(crate) fn look_at_step(&self, way: i64, cycles: u64) -> Result<(), CommandJump> {
        let limit = self.step.saturating_mul(cycles);
        if way.unsigned_abs() <= limit {
            return Ok(());
        }
        Err(CommandJump::Step { actual: Position::from_bits(way), limit: position(limit) })
    }

    /// Looks at the first command, `distance` away from where the axis would be.
    pub(crate) fn look_at_first(&self, distance: i64) -> Result<(), CommandJump> {
        match self.window {
            0 => self.look_at_step(distance, 1),
            window if distance.unsigned_abs() <= window => Ok(()),
            window => Err(CommandJump::FarFromAxis { actual: Position::from_bits(distance), limit: position(window) }),
        }
    }
}

/// The furthest that 64 bits can say.
const NOTHING_IS_FURTHER: u64 = 1 << 63;

fn position(steps: u64) -> Position {
    Position::from_bits(i64::try_from(steps).unwrap_or(i64::MAX))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_is_measured_by_the_cycles_that_it_took_and_the_first_command_by_the_window() {
        let limits = CommandLimits::new(Position::from_bits(100), Position::from_bits(30));
        for sign in [1, -1] {
            assert_eq!((limits.is_passed_by(100 * sign), limits.is_passed_by(101 * sign)), (false, true));
            assert_eq!(limits.look_at_step(200 * sign, 2), Ok(()));
            let [actual, limit] = [201 * sign, 200].map(Position::from_bits);
            assert_eq!(limits.look_at_step(201 * sign, 2), Err(CommandJump::Step { actual, limit }));
            assert_eq!(limits.look_at_first(30 * sign), Ok(()));
            let [actual, limit] = [31 * sign, 30].map(Position::from_bits);
            assert_eq!(limits.look_at_first(31 * sign), Err(CommandJump::FarFromAxis { actual, limit }));
        }
        let without_window = CommandLimits::new(Position::from_bits(100), Position::ZERO);
        assert_eq!(without_window.look_at_first(100), Ok(()));
        assert!(matches!(without_window.look_at_first(-101), Err(CommandJump::Step { .. })));
    }

    #[test]
    fn without_limits_the_furthest_command_is_taken() {
        for limits in [CommandLimits::NONE, CommandLimits::new(Position::ZERO, Position::ZERO)] {
            for way in [i64::MIN, i64::MAX] {
                assert!(!limits.is_passed_by(way));
                assert_eq!((limits.look_at_step(way, 1), limits.look_at_first(way)), (Ok(()), Ok(())));
            }
        }
    }
}
