//! Durations, measured in simulated time.

use ring::Nanoseconds;

use crate::report::Durations;

/// Measures one kind of duration many times.
#[derive(Clone, Debug, Default)]
pub struct Stopwatch {
    since: Option<Nanoseconds>,
    count: u64,
    sum: u64,
    shortest: Option<u64>,
    longest: u64,
}

impl Stopwatch {
    /// Starts a measurement; one that already runs goes on.
    pub fn start(&mut self, now: Nanoseconds) {
        self.since.get_or_insert(now);
    }

    /// Ends the running measurement; without one nothing happens.
    pub fn stop(&mut self, now: Nanoseconds) {
        if let Some(since) = self.since.take() {
            self.record(now.saturating_sub(since));
        }
    }

    /// Adds a duration that was measured elsewhere.
    pub fn record(&mut self, duration: Nanoseconds) {
        self.count += 1;
        self.sum += duration.0;
        self.shortest = Some(self.shortest.map_or(duration.0, |shortest| shortest.min(duration.0)));
        self.longest = self.longest.max(duration.0);
    }

    /// The result; `None` before the first measurement.
    pub fn durations(&self) -> Option<Durations> {
        let shortest_ns = self.shortest?;
        Some(Durations { count: self.count, shortest_ns, mean_ns: self.sum / self.count, longest_ns: self.longest })
    }
}
