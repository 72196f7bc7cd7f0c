//! What the oscilloscope records of the motor side.

use sercon816::Bus;
use servo::motor::CurrentLoopValues;
use servo::scope::SCOPE_CHANNELS;
use servo::units::Position;

use super::Motion;
use crate::hardware::Hardware;
use crate::oscilloscope::{LoopValues, Oscilloscope, Signal, SignalValues, Task, sample_source};
use crate::signal::command::Command;
use crate::signal::feedback::Feedback;
use crate::signal::word::Source;

/// All values of one instant.
struct Values<'a, B, H: Hardware> {
    motion: &'a Motion<B, H>,
    loops: LoopValues,
    current_loop: CurrentLoopValues,
}

impl<B: Bus + Clone, H: Hardware> Motion<B, H> {
    /// The oscilloscope, to be set, armed and read.
    pub const fn oscilloscope(&mut self) -> &mut Oscilloscope<'static> {
        &mut self.oscilloscope
    }

    /// Gives the oscilloscope the values of this tick, if it wants any. A recording of the current loop takes both cycles since the last
    /// tick, with the values of this tick's loops.
    #[inline]
    pub(super) fn record(&mut self, position: Position) {
        if !self.oscilloscope.is_recording() {
            return;
        }
        let loops = LoopValues { position, output: self.output };
        if let Some(signals) = self.oscilloscope.wanted(Task::ControlLoop) {
            let points = self.points(signals, loops, self.motor.cycle_values());
            self.oscilloscope.record(&points);
        }
        if let Some(signals) = self.oscilloscope.wanted(Task::CurrentLoop) {
            for current_loop in self.motor.last_cycles() {
                let points = self.points(signals, loops, current_loop);
                self.oscilloscope.record(&points);
            }
        }
    }

    #[inline]
    fn points(
        &self,
        signals: [Signal; SCOPE_CHANNELS],
        loops: LoopValues,
        current_loop: CurrentLoopValues,
    ) -> [i32; SCOPE_CHANNELS] {
        let values = Values { motion: self, loops, current_loop };
        signals.map(|signal| sample_source(signal, &values))
    }
}

impl<B: Bus + Clone, H: Hardware> SignalValues for Values<'_, B, H> {
    fn command(&self, command: Command) -> u32 {
        match command {
            Command::Value(value) => self.motion.command_data(value),
            Command::Limit(limit) => self.motion.cyclic_limits.values().get(limit).cast_unsigned(),
        }
    }

    fn feedback(&self, feedback: Feedback) -> u32 {
        self.motion.signal(feedback)
    }

    fn bits(&self, source: Source) -> u16 {
        self.motion.source_value(source)
    }

    fn loops(&self) -> &LoopValues {
        &self.loops
    }

    fn current_loop(&self) -> &CurrentLoopValues {
        &self.current_loop
    }
}
