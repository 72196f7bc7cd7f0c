//! The incremental encoder on the motor shaft, and what a counter makes of it.

use crate::turn::{Turn, floor};

/// In increments: what lies so near below an edge of the tracks is the edge, for fractions that binary numbers only approach.
const ON_THE_EDGE: f64 = 1e-6;

/// An incremental encoder with index. Angles are those of the motor shaft, in revolutions from the lower edge of the increment in which
/// it stands at time zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Encoder {
    /// Increments (edges) per revolution.
    pub increments_per_revolution: u32,
    /// The counter at time zero.
    pub initial_count: u32,
    /// Where in a revolution the index pulse begins, 0 .. 1; it is one increment wide.
    pub index_at: f64,
    /// The angle by which the d axis leads the encoder, in revolutions of the shaft: at angle zero it is so far ahead of the axis of the
    /// first phase.
    pub electrical_zero: f64,
}

/// State of the counter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Counter {
    /// Counts that were lost or came from nowhere; wraps.
    slip: u32,
    /// The count at which the tracks are frozen.
    frozen: Option<u32>,
    /// The count at the last rising edge of the index.
    latch: Option<u32>,
    /// Number of rising edges; wraps.
    pulses: u32,
}

impl Counter {
    pub(crate) fn new() -> Self {
        Self { slip: 0, frozen: None, latch: None, pulses: 0 }
    }

    pub(crate) fn latch(&self) -> Option<u32> {
        self.latch
    }

    pub(crate) fn pulses(&self) -> u32 {
        self.pulses
    }
}

impl Encoder {
    pub(crate) fn check(&self) {
        assert!(self.increments_per_revolution > 0, "the encoder needs increments");
        assert!((0.0..1.0).contains(&self.index_at), "the index lies within a revolution");
    }

    pub(crate) fn count(&self, counter: Counter, turn: Turn) -> u32 {
        let count = turn.count(self.increments_per_revolution).wrapping_add(self.initial_count);
        counter.frozen.unwrap_or(count.wrapping_add(counter.slip))
    }

    /// The counter after a movement without reversal.
    pub(crate) fn pass(&self, counter: Counter, from: Turn, to: Turn, muted: bool) -> Counter {
        let resolution = f64::from(self.increments_per_revolution);
        let pulse = [self.index_at, self.index_at + 1.0 / resolution];
        if stays_beside(pulse, from, to) {
            return counter;
        }
        let [_, end] = pulse;
        let begin = self.index_at * resolution;
        // In positive direction the pulse rises at its begin, in negative direction at its end. The count at an edge of the tracks that
        // coincides with it is the one after the edge.
        let forward = last_passed(to, self.index_at);
        let backward = last_passed(from, end);
        let (revolution, increment) = if forward > last_passed(from, self.index_at) {
            (forward, begin + ON_THE_EDGE)
        } else if last_passed(to, end) < backward {
            (backward, begin + 1.0 - ON_THE_EDGE)
        } else {
            return counter;
        };
        if muted {
            return counter;
        }
        let increments = revolution.wrapping_mul(i64::from(self.increments_per_revolution));
        let count = increments.wrapping_add(floor(increment)) as u32;
        let count = self.initial_count.wrapping_add(count).wrapping_add(counter.slip);
        Counter { latch: Some(counter.frozen.unwrap_or(count)), pulses: counter.pulses.wrapping_add(1), ..counter }
    }

    /// The counter when the tracks freeze or come back; what was missed meanwhile stays lost.
    pub(crate) fn freeze(&self, counter: Counter, turn: Turn, frozen: bool) -> Counter {
        let count = self.count(counter, turn);
        if frozen {
            return Counter { frozen: Some(count), ..counter };
        }
        let thawed = Counter { frozen: None, ..counter };
        let missed = self.count(thawed, turn).wrapping_sub(count);
        Counter { slip: counter.slip.wrapping_sub(missed), ..thawed }
    }

    /// The counter after counts that no movement has caused.
    pub(crate) fn slip(counter: Counter, counts: i32) -> Counter {
        let counts = counts as u32;
        Counter {
            slip: counter.slip.wrapping_add(counts),
            frozen: counter.frozen.map(|count| count.wrapping_add(counts)),
            ..counter
        }
    }
}

/// Neither end of the pulse is passed, as nearly always: what [`last_passed`] would say of a movement within a revolution.
fn stays_beside(pulse: [f64; 2], from: Turn, to: Turn) -> bool {
    let within = from.whole == to.whole && from.part < 1.0 && to.part < 1.0 && pulse[1] < 1.0;
    within && pulse.iter().all(|end| (from.part >= *end) == (to.part >= *end))
}

/// The revolution in which the angle `at`, given in a revolution, was passed last on the way from far below.
fn last_passed(turn: Turn, at: f64) -> i64 {
    turn.whole + floor(turn.part - at)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_movement_beside_the_pulse_passes_neither_of_its_ends() {
        let parts = [0.0, 0.1, 0.25_f64.next_down(), 0.25, 0.26, 0.5, 0.999, 1.0_f64.next_down(), 1.0];
        let (mut beside, mut passed) = (0, 0);
        for begin in [0.0, 0.25, 0.999] {
            let pulse = [begin, begin + 0.01];
            for (from, to) in parts.iter().flat_map(|from| parts.map(|to| (*from, to))) {
                for whole in [-1, 0] {
                    let (from, to) = (Turn { whole: 0, part: from }, Turn { whole, part: to });
                    let same = pulse.iter().all(|end| last_passed(from, *end) == last_passed(to, *end));
                    let quick = stays_beside(pulse, from, to);
                    assert!(same || !quick, "{pulse:?} {from:?} {to:?}");
                    beside += u32::from(quick);
                    passed += u32::from(!same);
                }
            }
        }
        assert!(beside > 70 && passed > 200, "{beside} {passed}");
    }
}
