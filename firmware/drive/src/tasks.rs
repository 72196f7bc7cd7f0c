//! What a task asks the interrupt controller to start next.

use bitflags::bitflags;

bitflags! {
    /// Tasks to be started; the application pends the interrupt that each of them is bound to.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    #[must_use = "a task that is not started leaves the ring controller waiting"]
    pub struct Tasks: u8 {
        /// `command_valid`: the command values of this cycle are due (t3), or the MDT window of CP1/CP2 is over.
        const COMMAND_VALID = 1;
        /// `capture_feedback`: the feedback of this cycle was latched (t4).
        const CAPTURE_FEEDBACK = 2;
        /// `phase_change`: the MST carries another phase, or supervision wants CP0.
        const PHASE_CHANGE = 4;
        /// `service_channel`: the service container waits for the processor.
        const SERVICE_CHANNEL = 8;
        /// `control_loop`: a loop tick has begun.
        const CONTROL_LOOP = 16;
        /// `supervision`: every fourth loop tick.
        const SUPERVISION = 32;
        /// `velocity_loop`: the second half of a loop tick has begun.
        const VELOCITY_LOOP = 64;
    }
}

#[cfg(feature = "defmt")]
impl defmt::Format for Tasks {
    fn format(&self, formatter: defmt::Formatter<'_>) {
        defmt::write!(formatter, "Tasks({=u8:07b})", self.bits());
    }
}
