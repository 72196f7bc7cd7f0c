//! Stopwatches.

use bench::measure::Stopwatch;
use bench::report::Durations;
use ring::Nanoseconds;

#[test]
fn a_stopwatch_without_a_measurement_has_no_result() {
    let mut watch = Stopwatch::default();
    watch.stop(Nanoseconds(5));
    assert_eq!(watch.durations(), None);
}

#[test]
fn a_second_start_does_not_shorten_a_measurement() {
    let mut watch = Stopwatch::default();
    watch.start(Nanoseconds(10));
    watch.start(Nanoseconds(20));
    watch.stop(Nanoseconds(40));
    watch.record(Nanoseconds(10));
    let durations = watch.durations();
    assert_eq!(durations, Some(Durations { count: 2, shortest_ns: 10, mean_ns: 20, longest_ns: 30 }));
}
