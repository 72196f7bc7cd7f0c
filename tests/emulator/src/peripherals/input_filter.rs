//! The filter of a timer's input: an edge counts once its level has stood for so many samples (RM0090 18.4.7, ICxF).
//!
//! An edge that counts does so with the time and the position that it had at the pin. The real counter is late by the filter's length, and so are the
//! tracks of an encoder behind filters of the same length: the audit asks for equal ones.

use ring::Nanoseconds;

/// An edge at a pin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct PinEdge {
    pub(crate) at: Nanoseconds,
    pub(crate) rises: bool,
    /// Of the encoder.
    pub(crate) position: u32,
}

/// What stands behind a pin.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct InputFilter {
    waiting: Option<PinEdge>,
}

impl InputFilter {
    /// Takes an edge behind everything that is [`InputFilter::passed`] by then: the one that ends a spike takes the spike away with it.
    pub(crate) fn take(&mut self, edge: PinEdge) {
        self.waiting = if self.waiting.is_some() { None } else { Some(edge) };
    }

    /// The edge whose level has stood for `length` until `now`, once.
    pub(crate) fn passed(&mut self, length: Nanoseconds, now: Nanoseconds) -> Option<PinEdge> {
        self.waiting.take_if(|edge| edge.at + length <= now)
    }

    /// An edge that may still count.
    pub(crate) const fn waits(&self) -> bool {
        self.waiting.is_some()
    }
}

/// How long a level must stand. `code` is ICxF, `division` the field CKD.
pub(crate) fn length(code: u32, division: u32, timer_hz: u64) -> Nanoseconds {
    /// Divider of the sampling clock and number of samples; the first four sample with the timer's clock, the others with that of CKD.
    const CODES: [(u64, u64); 16] = [
        (1, 0),
        (1, 2),
        (1, 4),
        (1, 8),
        (2, 6),
        (2, 8),
        (4, 6),
        (4, 8),
        (8, 6),
        (8, 8),
        (16, 5),
        (16, 6),
        (16, 8),
        (32, 5),
        (32, 6),
        (32, 8),
    ];
    let (divider, samples) = CODES[(code & 0xF) as usize];
    let division = if code & 0xF < 4 { 1 } else { 1 << (division & 3).min(2) };
    Nanoseconds(samples * divider * division * 1_000_000_000 / timer_hz)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_edge_counts_once_its_level_has_stood_and_a_spike_never_does() {
        let edge = |at, rises| PinEdge { at: Nanoseconds(at), rises, position: 7 };
        let length = Nanoseconds(95);
        let mut filter = InputFilter::default();
        filter.take(edge(1_000, true));
        assert_eq!(filter.passed(length, Nanoseconds(1_094)), None);
        assert_eq!(filter.passed(length, Nanoseconds(1_095)), Some(edge(1_000, true)));
        assert_eq!(filter.passed(length, Nanoseconds(9_000)), None);
        filter.take(edge(2_000, false));
        filter.take(edge(2_050, true));
        assert!(!filter.waits());
        assert_eq!(filter.passed(length, Nanoseconds(9_000)), None);
    }

    #[test]
    fn the_board_s_two_filters_are_equally_long() {
        assert_eq!(length(0b0011, 0, 84_000_000), Nanoseconds(95));
        assert_eq!(length(0b0101, 0, 168_000_000), Nanoseconds(95));
        assert_eq!(length(0, 2, 168_000_000), Nanoseconds::ZERO);
        assert_eq!(length(0b1111, 1, 84_000_000), Nanoseconds(6_095));
    }
}
