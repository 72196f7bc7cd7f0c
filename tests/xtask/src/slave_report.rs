//! The slave conformance test, as a table.

use crate::Verdict;
use anyhow::{Context, Result};
use conformance::{Section, SlaveReport, sections};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::fmt::Write;
use std::io::IsTerminal;

/// Columns of a rule; longer ones are broken.
const RULE_WIDTH: usize = 84;

/// Runs the cases and prints a line each, or JSON.
pub(crate) fn run(headings: &[Section], json: bool) -> Result<Verdict> {
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let bar = bar();
    let report = sections::run(headings, threads, &|done, of| {
        bar.set_length(of as u64);
        bar.set_position(done as u64);
    });
    bar.finish_and_clear();
    conclude(&report, json)
}

fn conclude(report: &SlaveReport, json: bool) -> Result<Verdict> {
    if json {
        println!("{}", serde_json::to_string_pretty(report).context("the report cannot be written as JSON")?);
    } else {
        print!("{}", text(report));
    }
    Ok(if report.passed() { Verdict::Passed } else { Verdict::Failed })
}

/// Shown on a terminal only; the cases take seconds.
fn bar() -> ProgressBar {
    let terminal = std::io::stderr().is_terminal();
    let target = if terminal { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() };
    let bar = ProgressBar::with_draw_target(Some(1), target);
    if let Ok(style) = ProgressStyle::with_template("  {bar:32.cyan/blue} {pos} of {len} cases") {
        bar.set_style(style.progress_chars("━╸─"));
    }
    bar
}

fn text(report: &SlaveReport) -> String {
    let mut text = String::new();
    let mut number = 0;
    for section in Section::ALL {
        let (passed, all) = report.count(section);
        if all == 0 {
            continue;
        }
        let _ = writeln!(text, "\n{}: {passed} of {all}", section.title());
        for case in report.cases.iter().filter(|case| case.section == section) {
            number += 1;
            let verdict = if case.passed { "pass" } else { "FAIL" };
            let mut lines = broken(&case.rule).into_iter();
            let first = lines.next().unwrap_or_default();
            let _ = writeln!(text, "{number:>5}  {verdict}  {first:<RULE_WIDTH$}  {}", case.source);
            for line in lines {
                let _ = writeln!(text, "             {line}");
            }
            for line in case.failure.iter().flat_map(|failure| broken(failure)) {
                let _ = writeln!(text, "           > {line}");
            }
        }
    }
    let _ = writeln!(text);
    for section in Section::ALL {
        let (passed, all) = report.count(section);
        if all > 0 {
            let mark = if passed == all { "ok" } else { "FAILED" };
            let _ = writeln!(text, "{:<22} {passed:>4} of {all:>4}  {mark}", section.title());
        }
    }
    let passed = report.cases.iter().filter(|case| case.passed).count();
    let _ = writeln!(text, "{:<22} {passed:>4} of {:>4}", "in all", report.cases.len());
    text
}

/// Lines of at most [`RULE_WIDTH`] characters, broken between words.
fn broken(text: &str) -> Vec<String> {
    let mut lines = vec![String::new()];
    for word in text.split_whitespace() {
        let Some(line) = lines.last_mut() else { break };
        if !line.is_empty() && line.chars().count() + 1 + word.chars().count() > RULE_WIDTH {
            lines.push(word.to_owned());
        } else {
            if !line.is_empty() {
                line.push(' ');
            }
            line.push_str(word);
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;
    use conformance::CaseReport;

    fn report(passed: bool) -> SlaveReport {
        let case = |section, rule: &str, passed: bool| CaseReport {
            section,
            rule: rule.to_owned(),
            source: "sercos2.md 2.1",
            passed,
            failure: (!passed).then(|| "AHS: expected 1, seen 0".to_owned()),
        };
        let long =
            "a rule of many words that goes on and on until it is certainly longer than a line of this table can be";
        SlaveReport {
            cases: vec![
                case(Section::Identification, "the drive answers", true),
                case(Section::PhaseSwitch, long, passed),
            ],
        }
    }

    #[test]
    fn a_failure_is_seen_in_its_row_its_heading_and_the_sum() {
        let text = text(&report(false));
        assert!(text.contains("    1  pass  the drive answers"), "{text}");
        assert!(text.contains("    2  FAIL  a rule of many words"), "{text}");
        assert!(text.contains("           > AHS: expected 1, seen 0"), "{text}");
        assert!(text.contains("Phase switch              0 of    1  FAILED"), "{text}");
        assert!(text.trim_end().ends_with("in all                    1 of    2"), "{text}");
        assert!(text.lines().all(|line| line.chars().count() <= 120), "{text}");
    }

    #[test]
    fn the_verdict_is_the_same_with_and_without_json() {
        for json in [false, true] {
            assert_eq!(conclude(&report(true), json).unwrap(), Verdict::Passed);
            assert_eq!(conclude(&report(false), json).unwrap(), Verdict::Failed);
        }
        assert_eq!(conclude(&SlaveReport { cases: Vec::new() }, false).unwrap(), Verdict::Failed);
    }
}
