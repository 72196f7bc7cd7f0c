//! From status flags to the two interrupt pins.

use std::collections::VecDeque;

use super::alternatives::{Alternatives, EnableSense, InterruptOutput, RoutingSense};
use crate::time::Nanoseconds;

/// Length of a pulse where the outputs pulse (G2).
const PULSE: Nanoseconds = Nanoseconds::from_microseconds(1);

/// Edges that are kept for someone who asks late.
const KEPT_EDGES: usize = 1024;

/// Electrical levels of the interrupt outputs; `true` is high.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub struct InterruptPins {
    /// Pin INT0.
    pub int0: bool,
    /// Pin INT1.
    pub int1: bool,
}

/// One of the two interrupt outputs.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub enum InterruptPin {
    /// INT0.
    Int0,
    /// INT1.
    Int1,
}

/// A change of level of an interrupt output.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub struct PinEdge {
    /// When.
    pub time: Nanoseconds,
    /// Which output.
    pub pin: InterruptPin,
    /// The level after the edge; `true` is high.
    pub level: bool,
}

/// Status, enable and routing registers as one picture; 04H, 06H and 08H in the low half, 05H, 07H and 09H above.
#[derive(Copy, Clone)]
pub(super) struct Flags {
    pub(super) status: u32,
    pub(super) enable: u32,
    pub(super) routing: u32,
}

/// The two outputs and what they did.
#[derive(Default)]
pub(super) struct Outputs {
    pending: [u32; 2],
    pulse_end: [Option<Nanoseconds>; 2],
    active: [bool; 2],
    edges: VecDeque<PinEdge>,
}

impl Outputs {
    /// Follows a change of the flags.
    pub(super) fn update(&mut self, now: Nanoseconds, flags: Flags, alternatives: &Alternatives) {
        let enabled = match alternatives.enable_sense {
            EnableSense::OneEnables => flags.enable,
            EnableSense::ZeroEnables => !flags.enable,
        };
        let to_second = match alternatives.routing_sense {
            RoutingSense::ZeroIsInt0 => flags.routing,
            RoutingSense::OneIsInt0 => !flags.routing,
        };
        let raised = flags.status & enabled;
        for (line, pending) in [raised & !to_second, raised & to_second].into_iter().enumerate() {
            let fresh = pending & !self.pending[line] != 0;
            self.pending[line] = pending;
            let active = match alternatives.interrupt_output {
                InterruptOutput::ActiveLowLevel | InterruptOutput::ActiveHighLevel => pending != 0,
                InterruptOutput::ActiveLowPulse | InterruptOutput::ActiveHighPulse => {
                    if fresh {
                        self.pulse_end[line] = Some(now + PULSE);
                    }
                    self.pulse_end[line].is_some()
                }
            };
            self.drive(now, line, active, alternatives);
        }
    }

    /// Ends the pulses that are over.
    pub(super) fn on_time(&mut self, now: Nanoseconds, alternatives: &Alternatives) {
        for line in 0..2 {
            if self.pulse_end[line].is_some_and(|end| end <= now) {
                self.pulse_end[line] = None;
                self.drive(now, line, false, alternatives);
            }
        }
    }

    pub(super) fn next_event(&self) -> Option<Nanoseconds> {
        self.pulse_end.into_iter().flatten().min()
    }

    pub(super) fn levels(&self, alternatives: &Alternatives) -> InterruptPins {
        InterruptPins { int0: level(self.active[0], alternatives), int1: level(self.active[1], alternatives) }
    }

    pub(super) fn has_edges(&self) -> bool {
        !self.edges.is_empty()
    }

    pub(super) fn take_edges(&mut self) -> Vec<PinEdge> {
        self.edges.drain(..).collect()
    }

    fn drive(&mut self, now: Nanoseconds, line: usize, active: bool, alternatives: &Alternatives) {
        if self.active[line] == active {
            return;
        }
        self.active[line] = active;
        if self.edges.len() == KEPT_EDGES {
            self.edges.pop_front();
        }
        self.edges.push_back(PinEdge {
            time: now,
            pin: if line == 0 { InterruptPin::Int0 } else { InterruptPin::Int1 },
            level: level(active, alternatives),
        });
    }
}

fn level(active: bool, alternatives: &Alternatives) -> bool {
    match alternatives.interrupt_output {
        InterruptOutput::ActiveLowLevel | InterruptOutput::ActiveLowPulse => !active,
        InterruptOutput::ActiveHighLevel | InterruptOutput::ActiveHighPulse => active,
    }
}
