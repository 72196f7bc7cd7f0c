//! The result as tables: aligned for a terminal, or as Markdown.

use super::verdict::{CHECKS, ChainReport, HandOver, PRICE, Report, TaskReport, load};
use crate::elf::Depth;
use emulator::Spread;

/// How tables are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Style {
    /// Columns under each other.
    Text,
    /// For the README.
    Markdown,
}

/// All tables.
pub(crate) fn tables(report: &Report, style: Style) -> String {
    let parts = [instructions(report), response_times(report), findings(report), stack(report)];
    parts.map(|rows| table(&rows, style)).join("\n")
}

type Rows = Vec<Vec<String>>;

fn row<const N: usize>(cells: [&str; N]) -> Vec<String> {
    cells.map(str::to_owned).to_vec()
}

fn instructions(report: &Report) -> Rows {
    let mut rows = vec![row(["task", "vector", "priority", "activations", "min", "mean", "max", "budget", "verdict"])];
    for TaskReport { task, count, found, .. } in &report.tasks {
        let own = count.map(|count| count.own);
        let verdict = verdict(found.is_some(), own, task.budget);
        let mut cells = row([task.name, task.vector, &task.priority.to_string()]);
        cells.extend(spread(own));
        cells.extend([task.budget.map_or("-".to_owned(), |budget| budget.to_string()), verdict.to_owned()]);
        rows.push(cells);
    }
    for ChainReport { chain, count } in &report.chains {
        let verdict = verdict(true, *count, Some(chain.budget));
        let mut cells = row([chain.name, "-", "-"]);
        cells.extend(spread(*count));
        cells.extend([chain.budget.to_string(), verdict.to_owned()]);
        rows.push(cells);
    }
    for function in &report.functions {
        let verdict = verdict(function.present, function.count, Some(function.budget));
        let mut cells = row([function.symbol, "-", "-"]);
        cells.extend(spread(function.count));
        cells.extend([function.budget.to_string(), verdict.to_owned()]);
        rows.push(cells);
    }
    rows
}

fn spread(spread: Option<Spread>) -> [String; 4] {
    match spread {
        Some(spread) => [spread.count, spread.least, spread.mean(), spread.most].map(|number| number.to_string()),
        None => [const { "-" }; 4].map(str::to_owned),
    }
}

fn verdict(present: bool, count: Option<Spread>, budget: Option<u64>) -> &'static str {
    match (count, budget) {
        _ if !present => "MISSING",
        (_, None) => "reported",
        (None, Some(_)) => "NOT RUN",
        (Some(count), Some(budget)) if count.most > budget => "TOO MANY",
        _ => "ok",
    }
}

/// Of the longest activation its instructions, bus accesses and time; of a cycle the most activations, and the time of all of them in the worst.
fn response_times(report: &Report) -> Rows {
    let mut rows = vec![row([
        "task",
        "priority",
        "period us",
        "instructions",
        "bus",
        "time us",
        "a cycle",
        "time us",
        "blocked us",
        "response us",
        "load %",
    ])];
    for TaskReport { task, count, timing, .. } in &report.tasks {
        let (Some(count), Some(timing)) = (count, timing) else { continue };
        let worst = count.worst;
        rows.push(vec![
            task.name.to_owned(),
            task.priority.to_string(),
            (timing.load.period / 1_000).to_string(),
            worst.activation.instructions.to_string(),
            worst.activation.bus.to_string(),
            microseconds(PRICE.nanoseconds(worst.activation)),
            format!("{} x", worst.activations),
            microseconds(PRICE.nanoseconds(worst.cycle)),
            microseconds(timing.blocking),
            timing.response.map_or("TOO LONG".to_owned(), microseconds),
            tenths(timing.share),
        ]);
    }
    if let Some(HandOver { longest, response }) = report.hand_over {
        let response = response.map_or("TOO LONG".to_owned(), microseconds);
        let name = "while settings are handed over";
        rows.push(row([name, "-", "-", "-", "-", "-", "-", "-", &microseconds(longest), &response, "-"]));
    }
    rows.push(row(["in all", "", "", "", "", "", "", "", "", "", &tenths(load(&report.tasks))]));
    rows
}

fn findings(report: &Report) -> Rows {
    let mut rows = vec![row(["reached from", "functions", "stack"])];
    rows[0].extend(CHECKS.map(|check| check.name().to_owned()));
    for TaskReport { task, found, .. } in &report.tasks {
        let Some(found) = found else { continue };
        let stack = match found.stack {
            Depth::Bytes(bytes) => bytes.to_string(),
            Depth::Unbounded => "unknown".to_owned(),
        };
        let mut cells = row([task.name, &found.functions.to_string(), &stack]);
        cells.extend(found.findings.iter().map(|(check, findings)| {
            match (findings.len(), task.forbidden.contains(check)) {
                (0, true) => "none".to_owned(),
                (number, true) => format!("{number} FORBIDDEN"),
                (number, false) => format!("({number})"),
            }
        }));
        rows.push(cells);
    }
    rows
}

/// Bytes of the worst nesting, level by level, beside what was measured and what there is.
fn stack(report: &Report) -> Rows {
    let mut rows = vec![row(["stack", "bytes"])];
    let Some(stack) = &report.stack else { return rows };
    rows.push(row(["start, interrupts off", &stack.start.to_string()]));
    for (priority, task, bytes) in &stack.levels {
        rows.push(row([&format!("priority {priority}: {task}"), &bytes.to_string()]));
    }
    let (function, frame) = &stack.largest_frame;
    for (what, bytes) in [
        ("worst nesting, with the frames of the exceptions", stack.bound()),
        ("measured", stack.measured.used),
        ("there, down to the guard", stack.measured.room),
        ("left", stack.measured.room.saturating_sub(stack.bound())),
        ("guard", stack.measured.guard),
        (&format!("largest frame: {function}"), *frame),
        ("fault handler", stack.fault_handler.0),
        ("its own stack", stack.fault_handler.1),
    ] {
        rows.push(row([what, &bytes.to_string()]));
    }
    rows
}

fn microseconds(nanoseconds: u64) -> String {
    tenths(nanoseconds.div_ceil(100))
}

fn tenths(number: u64) -> String {
    format!("{}.{}", number / 10, number % 10)
}

fn table(rows: &[Vec<String>], style: Style) -> String {
    let columns = rows.iter().map(Vec::len).max().unwrap_or(0);
    let width = |column: usize| rows.iter().filter_map(|row| row.get(column)).map(String::len).max().unwrap_or(0);
    let widths: Vec<usize> = (0..columns).map(width).collect();
    let mut text = String::new();
    for (number, row) in rows.iter().enumerate() {
        let line = match style {
            Style::Text => {
                // Names to the left, numbers to the right.
                let cells = row.iter().zip(&widths).enumerate().map(|(column, (cell, width))| match column {
                    0 => format!("{cell:<width$}"),
                    _ => format!("{cell:>width$}"),
                });
                cells.collect::<Vec<_>>().join("  ")
            }
            Style::Markdown => format!("| {} |", row.join(" | ")),
        };
        text += line.trim_end();
        text.push('\n');
        if style == Style::Markdown && number == 0 {
            text += &format!("|---|{}\n", "---:|".repeat(columns.saturating_sub(1)));
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::super::gates::{Rate, Task};
    use super::super::response::Load;
    use super::super::verdict::Timing;
    use super::*;
    use emulator::{Demand, TaskCount};

    #[test]
    fn a_table_is_aligned_for_the_terminal_and_plain_in_markdown() {
        let rows = [row(["task", "max"]), row(["control_loop", "7"])];
        assert_eq!(table(&rows, Style::Text), "task          max\ncontrol_loop    7\n");
        assert_eq!(table(&rows, Style::Markdown), "| task | max |\n|---|---:|\n| control_loop | 7 |\n");
    }

    #[test]
    fn every_way_to_fail_has_a_word_in_the_table() {
        let count = Some(Spread { count: 1, least: 9, most: 9, sum: 9 });
        assert_eq!(verdict(false, None, Some(1)), "MISSING");
        assert_eq!(verdict(true, None, Some(1)), "NOT RUN");
        assert_eq!(verdict(true, count, Some(8)), "TOO MANY");
        assert_eq!(verdict(true, count, Some(9)), "ok");
        assert_eq!(verdict(true, count, None), "reported");
    }

    #[test]
    fn a_row_has_the_longest_activation_and_the_longest_cycle() {
        let rate = Rate::EachCycle;
        let task = Task {
            name: "edge",
            vector: "EXTI3",
            priority: 4,
            rate,
            budget: None,
            deadline: None,
            in_turn_with: None,
            forbidden: &[],
        };
        let mut count = TaskCount::default();
        count.worst.activation = Demand { activations: 1, instructions: 1_000, bus: 2 };
        count.worst.cycle = Demand { activations: 2, instructions: 1_100, bus: 4 };
        count.worst.activations = 3;
        let load = Load { priority: 4, period: 500_000, demand: 0, locked: 0, ceiling: 4, in_turn_with: None };
        let timing = Timing { load, share: 25, blocking: 2_000, response: Some(40_100) };
        let task = TaskReport { task, count: Some(count), found: None, timing: Some(timing) };
        let rows = response_times(&Report {
            tasks: vec![task],
            chains: Vec::new(),
            functions: Vec::new(),
            stack: None,
            hand_over: Some(HandOver { longest: 8_400, response: Some(66_600) }),
            failures: Vec::new(),
        });
        let expected = ["edge", "4", "500", "1000", "2", "10.1", "3 x", "12.1", "2.0", "40.1", "2.5"];
        assert_eq!(rows[1], expected);
        assert!(rows.iter().all(|row| row.len() == rows[0].len()));
        assert_eq!(rows[2], ["while settings are handed over", "-", "-", "-", "-", "-", "-", "-", "8.4", "66.6", "-"]);
        assert_eq!(rows[3].last().unwrap(), "2.5");
    }

    #[test]
    fn times_are_rounded_up_to_a_tenth_of_a_microsecond() {
        assert_eq!(microseconds(1_000), "1.0");
        assert_eq!(microseconds(10_401), "10.5");
    }
}
