//! What a board is built with. The board says it once, and the compiler knows it wherever a loop depends on it.

use crate::current::sensing::{CurrentSensing, ShuntWindow};
use crate::current::settings::PwmFrequency;
use crate::monitor::thermometer::Thermometers;

/// A kind of board.
pub trait BoardKind: core::fmt::Debug + 'static {
    /// What it is built with.
    const FACTS: Facts;
}

/// What a board is built with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Facts {
    /// Rate of modulation and current loop.
    pub frequency: PwmFrequency,
    /// What the bridge puts between the two transistors of a phase, in ns.
    pub dead_time: u32,
    /// Where the phase currents are measured.
    pub current_sensing: CurrentSensing,
    /// Counts of the loop timer's clock in one untrimmed loop period, see [`LOOP_PERIOD_MICROSECONDS`].
    ///
    /// [`LOOP_PERIOD_MICROSECONDS`]: crate::units::LOOP_PERIOD_MICROSECONDS
    pub loop_timer_counts: u16,
    /// From the start of a loop tick, at the sample of the currents, to the reading of the encoder, in ns.
    pub sample_to_count: u16,
    /// Increments of the encoder a second that its inputs count for certain.
    pub encoder_rate: u32,
    /// What the samples of the temperatures mean, on the heat sink and for every sensor that a motor may have.
    pub thermometers: &'static Thermometers,
}

impl Facts {
    /// See [`CurrentSensing::window`].
    ///
    /// # Panics
    /// As that does: in a constant, when the board cannot work.
    #[must_use]
    pub const fn shunt_window(&self) -> Option<ShuntWindow> {
        self.current_sensing.window(self.frequency, self.dead_time)
    }

    /// The encoder is read twice in a loop tick, and a position belongs to the instant between the two.
    #[must_use]
    pub const fn reads_the_encoder_twice(&self) -> bool {
        self.frequency.cycles_per_tick() == 2
    }
}
