//! Inverter and sensors of a board.

use super::facts::BoardKind;

/// Inverter and sensors, as the current loop sees them.
///
/// Every call is a few register accesses; none may wait.
pub trait PowerStage {
    /// The board that it is on.
    type Board: BoardKind;

    /// To be called first in a cycle: acknowledges the interrupt, and tells which cycle this is.
    fn begin(&mut self) -> Cycle;

    /// What the converters measured for this cycle.
    fn samples(&mut self) -> Samples;

    /// Temperatures of heat sink and motor, 12 bits each.
    fn temperatures(&mut self) -> [u32; 2];

    /// The encoder counter now.
    fn encoder_count(&mut self) -> u32;

    /// Compare values of the three phases, 0 (low side) to the reload value or more (high side); they act from the next bottom of the
    /// period on.
    fn set_compare(&mut self, counts: [u16; 3]);

    /// Lengthens loop ticks by so many counts of [`Facts::loop_timer_counts`](crate::motor::Facts::loop_timer_counts) from the next period on; set in every cycle.
    fn trim(&mut self, counts: i32);

    /// Switches all six transistors off, at once.
    fn switch_off(&mut self);

    /// Resistor across the DC link, on or off. Off at start, and after whatever ends the program.
    fn set_chopper(&mut self, on: bool);

    /// The current loop runs, and has a new order of the control loop: once in a loop tick, while both are well. A board that does not hear it for some
    /// ticks ends the program.
    fn is_alive(&mut self);
}

/// Which cycle of the current loop this is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Cycle {
    /// The first of a loop tick.
    pub first: bool,
    /// The bottom of the period has passed: what is set now acts a period too late.
    pub late: bool,
}

/// Results of the converters, 12 bits each, in the whole words that they are read and worked with.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Samples {
    /// Phase currents, 2 048 at zero; positive flows into the motor.
    pub currents: [u32; 3],
    /// Bus voltage.
    pub bus: u32,
}
