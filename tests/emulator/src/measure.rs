//! What a run cost and how fast the product answered, seen from outside.

use ring::Nanoseconds;

/// Something that starts or ends a latency.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Trigger {
    /// Any edge of INT0.
    Int0Edge,
    /// Any edge of INT1.
    Int1Edge,
    /// The product writes this address.
    Write(u32),
    /// The product reads this address.
    Read(u32),
    /// The rising edge of an interrupt line of the NVIC.
    Interrupt(u8),
}

/// A latency that is measured: from the first `start` to the next `stop`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Probe {
    /// For the report.
    pub name: String,
    /// What starts it; further starts before the stop are ignored.
    pub start: Trigger,
    /// What ends it.
    pub stop: Trigger,
    /// Results so far.
    pub latency: Latency,
    started: Option<Nanoseconds>,
}

impl Probe {
    /// A new probe.
    #[must_use]
    pub fn new(name: impl Into<String>, start: Trigger, stop: Trigger) -> Self {
        Self { name: name.into(), start, stop, latency: Latency::default(), started: None }
    }

    pub(crate) fn happened(&mut self, trigger: Trigger, time: Nanoseconds) {
        if trigger == self.stop
            && let Some(started) = self.started.take()
        {
            self.latency.add(time.saturating_sub(started));
        }
        if trigger == self.start && self.started.is_none() {
            self.started = Some(time);
        }
    }
}

/// Statistics of a latency.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Latency {
    /// How often.
    pub count: u64,
    /// Shortest.
    pub shortest: Nanoseconds,
    /// Longest.
    pub longest: Nanoseconds,
    /// All together.
    pub sum: Nanoseconds,
}

impl Latency {
    /// Takes one more in.
    pub fn add(&mut self, span: Nanoseconds) {
        self.shortest = if self.count == 0 { span } else { self.shortest.min(span) };
        self.longest = self.longest.max(span);
        self.sum += span;
        self.count += 1;
    }

    /// The mean, zero without any.
    #[must_use]
    pub fn mean(&self) -> Nanoseconds {
        Nanoseconds(self.sum.0.checked_div(self.count).unwrap_or(0))
    }
}

/// What a run has cost so far.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Measurements {
    /// Instructions of the product between its accesses, including the accesses. A segment that ends in WFI is not in it, because the
    /// start of the wait cannot be seen: the instructions from the last access of a task to the WFI are missing.
    pub instructions: u64,
    /// Questions and wake-ups, each one message both ways.
    pub exchanges: u64,
    /// Messages to fetch log output.
    pub log_exchanges: u64,
    /// Writes, all of them posted.
    pub writes: u64,
    /// Reads that the host was asked for.
    pub reads: u64,
    /// Reads answered from values that travelled with an earlier answer.
    pub prefetched_reads: u64,
    /// Wake-ups that found the product waiting in WFI.
    pub idle_wakes: u64,
    /// Those of them that had no interrupt for it, so that it was left to wait.
    pub slept_on: u64,
    /// Wake-ups that interrupted the product at work.
    pub busy_wakes: u64,
    /// Every access so far.
    pub trace: Trace,
    /// Latencies asked for.
    pub probes: Vec<Probe>,
    /// Accesses asked for, in their order.
    pub watched: Vec<Watched>,
}

/// An access of the product.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Watched {
    /// When.
    pub time: Nanoseconds,
    /// Where to, or from.
    pub address: u32,
    /// What.
    pub value: u32,
    /// By which instruction.
    pub pc: u32,
    /// A write, otherwise a read.
    pub writes: bool,
}

/// Every access of the product, its time to the nanosecond, its value and its instruction, folded into one number: two runs with the same
/// one have done the same.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Trace {
    /// How many.
    pub accesses: u64,
    /// What they were.
    pub hash: u64,
}

impl Trace {
    pub(crate) fn fold(&mut self, time: Nanoseconds, address: u32, value: u32, pc: u32) {
        // The golden ratio's bits: odd, and without a pattern.
        const SPREAD: u64 = 0x9E37_79B9_7F4A_7C15;
        self.accesses += 1;
        for word in [time.0, address.into(), value.into(), pc.into()] {
            self.hash = (self.hash ^ word).wrapping_mul(SPREAD).rotate_left(23);
        }
    }
}

impl core::fmt::Display for Trace {
    fn fmt(&self, formatter: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(formatter, "{:016x} over {} accesses", self.hash, self.accesses)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_trace_shows_every_part_of_an_access_and_their_order() {
        let of = |accesses: &[(u64, u32, u32, u32)]| {
            let mut trace = Trace::default();
            for (time, address, value, pc) in accesses {
                trace.fold(Nanoseconds(*time), *address, *value, *pc);
            }
            trace.hash
        };
        let (first, second) = ((1, 2, 3, 4), (5, 6, 7, 8));
        let hashes = [
            of(&[first, second]),
            of(&[second, first]),
            of(&[first]),
            of(&[(2, 2, 3, 4), second]),
            of(&[(1, 3, 3, 4), second]),
            of(&[(1, 2, 4, 4), second]),
            of(&[(1, 2, 3, 5), second]),
        ];
        for (number, hash) in hashes.iter().enumerate() {
            assert!(!hashes[..number].contains(hash), "{number}");
        }
        assert_eq!(of(&[first, second]), hashes[0]);
    }

    #[test]
    fn a_probe_measures_from_the_first_start_to_the_next_stop() {
        let mut probe = Probe::new("x", Trigger::Int0Edge, Trigger::Write(4));
        probe.happened(Trigger::Write(4), Nanoseconds(1));
        probe.happened(Trigger::Int0Edge, Nanoseconds(10));
        probe.happened(Trigger::Int0Edge, Nanoseconds(20));
        probe.happened(Trigger::Write(8), Nanoseconds(30));
        probe.happened(Trigger::Write(4), Nanoseconds(40));
        probe.happened(Trigger::Int0Edge, Nanoseconds(50));
        probe.happened(Trigger::Write(4), Nanoseconds(60));
        assert_eq!(probe.latency.count, 2);
        assert_eq!(probe.latency.longest, Nanoseconds(30));
        assert_eq!(probe.latency.shortest, Nanoseconds(10));
        assert_eq!(probe.latency.mean(), Nanoseconds(20));
    }
}
