//! How often the velocity loop runs: with every cycle of the current loop.

use crate::current::settings::PwmFrequency;
use crate::units::LOOP_TICKS_PER_SECOND;

/// How often the velocity loop runs in a loop tick of 125 us. The position loop, and all that makes set-points, run once.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum VelocityRate {
    /// Every 125 us, at 8 kHz.
    EachTick,
    /// Every 62.5 us, at 16 kHz: [`crate::axis::Axis::tick`] and half a tick later [`crate::axis::Axis::half_tick`].
    TwiceATick,
}

impl VelocityRate {
    /// That of a current loop of this frequency.
    #[must_use]
    pub const fn of(frequency: PwmFrequency) -> Self {
        match frequency {
            PwmFrequency::Khz8 => Self::EachTick,
            PwmFrequency::Khz16 => Self::TwiceATick,
        }
    }

    /// Steps of the velocity loop in a tick.
    #[must_use]
    pub const fn steps(self) -> u32 {
        match self {
            Self::EachTick => 1,
            Self::TwiceATick => 2,
        }
    }

    /// Steps of the velocity loop in a second.
    #[must_use]
    pub const fn hertz(self) -> u32 {
        LOOP_TICKS_PER_SECOND.saturating_mul(self.steps())
    }

    /// What the velocity loop itself delays, in us rounded up: half of the way that a measured velocity is the mean over, until the current loop
    /// takes the command one of its cycles later, and half of the time for which the command holds. `filtered`: there is a velocity filter
    /// S-0-0392, which takes the velocity over a whole tick, see [`crate::axis::VelocityFilter`].
    #[must_use]
    pub const fn delay(self, filtered: bool) -> u32 {
        match (self, filtered) {
            (Self::EachTick, _) => 250,
            (Self::TwiceATick, true) => 157,
            (Self::TwiceATick, false) => 125,
        }
    }
}
