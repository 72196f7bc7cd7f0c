//! The timers at the encoder and at the edges of the machine, with their pins: TIM2, TIM3, TIM4, TIM8 count, TIM9 stamps times.

use ring::Nanoseconds;

use super::clocks::ClockTree;
use super::gpio::{PinMode, Port};
use super::timer::Timer;
use crate::wiring::{self, Pin};
use crate::{Environment, IndexEdge};

/// TIM2.
pub(crate) const TIM2: usize = 0;
/// TIM3: latches the index.
pub(crate) const TIM3: usize = 1;
/// TIM4: latches probe 1.
pub(crate) const TIM4: usize = 2;
/// TIM8: latches probe 2.
pub(crate) const TIM8: usize = 3;
/// TIM9: times of INT0 and INT1.
pub(crate) const TIM9: usize = 4;

/// Offset of SR.
const STATUS: u32 = 0x10;

/// A pin at a channel: timer, pin, alternate function, channel.
type Input = (usize, Pin, u8, u8);

const INT0_INPUTS: [Input; 2] = [(TIM2, wiring::INT0, 1, 4), (TIM9, wiring::INT0_TIME, 3, 1)];
const INT1_INPUTS: [Input; 2] = [(TIM2, wiring::INT1, 1, 3), (TIM9, wiring::INT1_TIME, 3, 2)];
const INDEX: Input = (TIM3, wiring::INDEX, 2, 3);
const PROBE_1: Input = (TIM4, wiring::PROBE_1, 2, 3);
const PROBE_2: Input = (TIM8, wiring::PROBE_2, 3, 3);

/// An edge of an input of the board.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Edge {
    Int0,
    Int1,
}

/// The five timers.
#[derive(Debug)]
pub(crate) struct EncoderCounters {
    timers: [Timer; 5],
    probes: Option<(bool, bool)>,
    index: Option<u64>,
}

impl EncoderCounters {
    pub(crate) fn new() -> Self {
        let counter = || Timer::new(16, 4);
        Self {
            timers: [Timer::new(32, 4), counter(), counter(), counter(), Timer::new(16, 2)],
            probes: None,
            index: None,
        }
    }

    pub(crate) fn timer(&self, number: usize) -> &Timer {
        &self.timers[number]
    }

    pub(crate) fn set_clocks(&mut self, tree: &ClockTree, now: Nanoseconds) {
        for (number, timer) in self.timers.iter_mut().enumerate() {
            let hertz = if number >= TIM8 { tree.apb2_timers } else { tree.apb1_timers };
            timer.set_clock(hertz, now);
        }
    }

    pub(crate) fn next_event(&self) -> Option<Nanoseconds> {
        self.timers.iter().filter_map(Timer::next_event).min()
    }

    pub(crate) fn advance(&mut self, now: Nanoseconds) {
        for timer in &mut self.timers {
            timer.advance(now);
        }
    }

    /// Lines of the NVIC (bit n = interrupt n).
    pub(crate) fn lines(&self) -> u128 {
        let [update, capture] = self.timers[TIM8].update_and_capture_lines();
        let line = |number: usize| self.timers[number].line();
        [(line(TIM2), 28), (line(TIM3), 29), (line(TIM4), 30), (update, 44), (capture, 46), (line(TIM9), 24)]
            .into_iter()
            .fold(0, |lines, (high, vector)| lines | u128::from(high) << vector)
    }

    /// INT0 or INT1 of the SERCON816 changes.
    pub(crate) fn edge<E: Environment + ?Sized>(
        &mut self,
        edge: Edge,
        rises: bool,
        ports: &[Port],
        environment: &mut E,
        now: Nanoseconds,
    ) {
        let inputs = match edge {
            Edge::Int0 => INT0_INPUTS,
            Edge::Int1 => INT1_INPUTS,
        };
        for input in inputs {
            let encoder = position(input.0, ports, environment, now);
            self.capture(input, rises, ports, encoder, now);
        }
    }

    /// Takes the probes and the index over.
    pub(crate) fn sample<E: Environment + ?Sized>(&mut self, ports: &[Port], environment: &mut E, now: Nanoseconds) {
        let inputs = environment.digital_inputs();
        let levels = (inputs.probe_1, inputs.probe_2);
        let before = self.probes.replace(levels).unwrap_or(levels);
        for (input, before, level) in [(PROBE_1, before.0, levels.0), (PROBE_2, before.1, levels.1)] {
            if before != level {
                let encoder = position(input.0, ports, environment, now);
                self.capture(input, level, ports, encoder, now);
            }
        }
        let IndexEdge { number, count } = environment.index_count(now);
        let before = self.index.replace(number).unwrap_or(number);
        // However many edges there were, two show that one was lost.
        for _ in 0..number.saturating_sub(before).min(2) {
            let encoder = if is_connected(TIM3, ports) { count } else { 0 };
            self.capture(INDEX, true, ports, encoder, now);
        }
    }

    pub(crate) fn read<E: Environment + ?Sized>(
        &mut self,
        number: usize,
        offset: u32,
        ports: &[Port],
        environment: &mut E,
        now: Nanoseconds,
    ) -> Option<u32> {
        let encoder = position(number, ports, environment, now);
        self.timers[number].read(offset, now, encoder)
    }

    pub(crate) fn write<E: Environment + ?Sized>(
        &mut self,
        number: usize,
        (offset, value): (u32, u32),
        ports: &[Port],
        environment: &mut E,
        now: Nanoseconds,
    ) -> Option<Result<(), String>> {
        let encoder = position(number, ports, environment, now);
        self.timers[number].write(offset, value, now, encoder)
    }

    /// The count of TIM2, if it stays until then.
    pub(crate) fn peek_position<E: Environment + ?Sized>(
        &self,
        ports: &[Port],
        environment: &mut E,
        now: Nanoseconds,
        until: Nanoseconds,
    ) -> Option<u32> {
        let timer = &self.timers[TIM2];
        let steady = timer.counts_encoder() && environment.encoder_steady_until(now) >= until;
        steady.then(|| timer.count(now, position(TIM2, ports, environment, now)))
    }

    /// The status of a counter that captures only: edges come from the world, which stops at each of them.
    pub(crate) fn peek_captured(&self, number: usize, offset: u32) -> Option<u32> {
        let timer = &self.timers[number];
        (offset == STATUS && timer.counts_encoder() && !timer.filters()).then(|| timer.status())
    }

    /// The count of a timer at an instant before its next event.
    pub(crate) fn foretell_count<E: Environment + ?Sized>(
        &self,
        number: usize,
        ports: &[Port],
        environment: &mut E,
        at: Nanoseconds,
    ) -> Option<u32> {
        let timer = &self.timers[number];
        if !timer.counts_encoder() {
            return Some(timer.count(at, 0));
        }
        let encoder = if is_connected(number, ports) { environment.encoder_foretold(at)? } else { 0 };
        Some(timer.count(at, encoder))
    }

    fn capture(&mut self, input: Input, rises: bool, ports: &[Port], encoder: u32, now: Nanoseconds) {
        let (number, (port, pin), function, channel) = input;
        if ports[port].mode(pin) == PinMode::Alternate(function) {
            self.timers[number].capture_edge(channel, rises, now, encoder);
        }
    }
}

/// Are tracks A and B at the timer?
fn is_connected(number: usize, ports: &[Port]) -> bool {
    let (tracks, function) = match number {
        TIM2 => ([wiring::ENCODER_A, wiring::ENCODER_B], 1),
        TIM3 => (wiring::ENCODER_TIM3, 2),
        TIM4 => (wiring::ENCODER_TIM4, 2),
        TIM8 => (wiring::ENCODER_TIM8, 3),
        _ => return false,
    };
    tracks.iter().all(|(port, pin)| ports[*port].mode(*pin) == PinMode::Alternate(function))
}

fn position<E: Environment + ?Sized>(number: usize, ports: &[Port], environment: &mut E, now: Nanoseconds) -> u32 {
    if is_connected(number, ports) { environment.encoder_count(now) } else { 0 }
}
