//! What libFuzzer prints, taken apart.

/// What came of a run so far.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Outcome {
    /// Executions done.
    pub(super) executions: u64,
    /// The message of the panic, or libFuzzer's own word for what happened.
    pub(super) failure: Option<String>,
    /// The file with the input that failed.
    pub(super) artifact: Option<String>,
    /// The next line is the message of a panic.
    message_follows: bool,
}

/// What a line is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Line {
    /// How many executions are done.
    Progress,
    /// Of no interest.
    Noise,
    /// Worth showing.
    News,
}

impl Outcome {
    /// Takes a line of stderr.
    pub(super) fn take(&mut self, line: &str) -> Line {
        if std::mem::take(&mut self.message_follows) {
            self.failure = Some(line.to_owned());
            return Line::News;
        }
        let counted = line.strip_prefix('#').or_else(|| line.strip_prefix("stat::number_of_executed_units:"));
        if let Some(executions) = counted.and_then(|rest| rest.split_whitespace().next()?.parse().ok()) {
            self.executions = executions;
            return Line::Progress;
        }
        if line.contains("' panicked at ") || line.contains(") panicked at ") {
            self.message_follows = self.failure.is_none();
            return Line::News;
        }
        if let Some((_, error)) = line.split_once("ERROR: libFuzzer: ") {
            self.failure.get_or_insert_with(|| error.to_owned());
            return Line::News;
        }
        if let Some((_, path)) = line.split_once("Test unit written to ") {
            self.artifact = Some(path.to_owned());
            return Line::News;
        }
        if self.failure.is_some() { Line::News } else { Line::Noise }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn executions_are_counted_from_status_lines_and_from_the_last_one() {
        let mut outcome = Outcome::default();
        assert_eq!(outcome.take("INFO: Running with entropic power schedule (0xFF, 100)."), Line::Noise);
        assert_eq!(outcome.take("#8192\tpulse  cov: 1133 ft: 5879 corp: 1301/33Kb lim: 80"), Line::Progress);
        assert_eq!(outcome.executions, 8_192);
        assert_eq!(outcome.take("###### Recommended dictionary. ######"), Line::Noise);
        assert_eq!(outcome.take("stat::number_of_executed_units: 10000"), Line::Progress);
        assert_eq!(outcome, Outcome { executions: 10_000, ..Outcome::default() });
    }

    #[test]
    fn a_panic_is_told_by_its_message_and_its_file() {
        let mut outcome = Outcome::default();
        for line in [
            "thread '<unnamed>' (7) panicked at firmware/sercos/src/phase.rs:1:2:",
            "a permission outlives its phase",
            "==7== ERROR: libFuzzer: deadly signal",
            "Test unit written to fuzz/artifacts/service_channel/crash-0123",
        ] {
            assert_eq!(outcome.take(line), Line::News);
        }
        assert_eq!(outcome.failure.as_deref(), Some("a permission outlives its phase"));
        assert_eq!(outcome.artifact.as_deref(), Some("fuzz/artifacts/service_channel/crash-0123"));
    }

    #[test]
    fn a_hang_is_a_failure_without_a_panic() {
        let mut outcome = Outcome::default();
        outcome.take("==7== ERROR: libFuzzer: timeout after 10 seconds");
        assert_eq!(outcome.failure.as_deref(), Some("timeout after 10 seconds"));
    }
}
