//! Numbers as people read them.

use super::data::Durations;

/// Microseconds as seconds with three places: `1.234`.
pub(crate) fn seconds(microseconds: u64) -> String {
    format!("{}.{:03}", microseconds / 1_000_000, microseconds / 1_000 % 1_000)
}

/// Nanoseconds as microseconds with one place: `12.3 us`.
pub(crate) fn microseconds(nanoseconds: u64) -> String {
    format!("{}.{} us", nanoseconds / 1_000, nanoseconds / 100 % 10)
}

/// An angle: `0.01234°`.
pub(crate) fn degrees(degrees: f64) -> String {
    format!("{degrees:.5}°")
}

/// Shortest, mean and longest, or that nothing was measured.
pub(crate) fn spread(durations: &Durations) -> String {
    if durations.count == 0 {
        return "not measured".to_owned();
    }
    format!(
        "{} to {}, mean {} ({} times)",
        microseconds(durations.shortest_ns).trim_end_matches(" us"),
        microseconds(durations.longest_ns),
        microseconds(durations.mean_ns),
        thousands(durations.count),
    )
}

/// A count with thin groups: `12 345`.
pub(crate) fn thousands(count: u64) -> String {
    let digits = count.to_string();
    let mut grouped = String::new();
    for (index, digit) in digits.chars().enumerate() {
        if index > 0 && (digits.len() - index).is_multiple_of(3) {
            grouped.push(' ');
        }
        grouped.push(digit);
    }
    grouped
}

/// One thing or several: `1 step`, `2 steps`.
pub(crate) fn counted(count: u64, noun: &str) -> String {
    let plural = if count == 1 { "" } else { "s" };
    format!("{} {noun}{plural}", thousands(count))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_written_for_people() {
        assert_eq!(seconds(1_234_567), "1.234");
        assert_eq!(seconds(999), "0.000");
        assert_eq!(microseconds(12_345), "12.3 us");
        assert_eq!(degrees(0.012_345_6), "0.01235°");
        assert_eq!(thousands(0), "0");
        assert_eq!(thousands(999), "999");
        assert_eq!(thousands(1_000), "1 000");
        assert_eq!(thousands(12_345_678), "12 345 678");
        assert_eq!(counted(1, "step"), "1 step");
        assert_eq!(counted(2_000, "step"), "2 000 steps");
    }

    #[test]
    fn a_spread_without_measurements_says_so() {
        assert_eq!(spread(&Durations::default()), "not measured");
        let durations = Durations { count: 3, shortest_ns: 1_000, mean_ns: 2_000, longest_ns: 3_500 };
        assert_eq!(spread(&durations), "1.0 to 3.5 us, mean 2.0 us (3 times)");
    }
}
