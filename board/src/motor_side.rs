//! The motor side of the board as `drive` sees it.

use drive::{Amplifier, Hardware, InterruptLine, ResetCause};
use fixed::types::I1F15;

use crate::{
    amplifier::AmplifierPort,
    current_command::CurrentCommand,
    encoder::Encoder,
    loop_timer::{self, LoopTimer},
};

/// Encoder, current command, amplifier lines and loop timer.
#[derive(Debug)]
pub struct MotorSide {
    encoder: Encoder,
    current_command: CurrentCommand,
    amplifier: AmplifierPort,
    loop_timer: LoopTimer,
    reset_cause: ResetCause,
}

impl MotorSide {
    pub(crate) fn new(
        encoder: Encoder,
        current_command: CurrentCommand,
        amplifier: AmplifierPort,
        loop_timer: LoopTimer,
        reset_cause: ResetCause,
    ) -> Self {
        Self { encoder, current_command, amplifier, loop_timer, reset_cause }
    }
}

impl Hardware for MotorSide {
    #[inline(always)]
    fn encoder_count(&mut self) -> u32 {
        self.encoder.count()
    }

    #[inline(always)]
    fn encoder_latch(&mut self, line: InterruptLine) -> u32 {
        self.encoder.latch(line)
    }

    #[inline(always)]
    fn set_current(&mut self, fraction_of_peak: I1F15) {
        self.current_command.set(fraction_of_peak);
    }

    #[inline(always)]
    fn set_amplifier(&mut self, on: bool) {
        self.amplifier.set_enable(on);
    }

    #[inline(always)]
    fn amplifier(&mut self) -> Amplifier {
        self.amplifier.read()
    }

    fn reset_cause(&self) -> ResetCause {
        self.reset_cause
    }

    #[inline(always)]
    fn loop_timer_phase(&mut self) -> u16 {
        self.loop_timer.phase()
    }

    #[inline(always)]
    fn trim_loop_timer(&mut self, counts: i16) {
        self.loop_timer.trim(counts);
    }

    const LOOP_TIMER_COUNTS: u16 = loop_timer::COUNTS;
}
