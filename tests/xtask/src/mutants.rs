//! Breaks the drive on purpose, one defect at a time, and says which of them no test sees.
//!
//! Two sorts: patches made by hand for what only hardware shows (`board`, `app`, the hand-over between tasks), and those that cargo-mutants makes of
//! the portable crates' safety files.

mod defect;
mod portable;
mod programs;
mod scratch;
mod survivors;
mod trial;

use crate::Verdict;
use crate::setup::Installing;
use anyhow::{Result, bail};
use defect::Defect;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::io::IsTerminal;
use std::time::Instant;
use trial::Bench;

/// What is to be done.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Order {
    /// Only say which defects there are.
    pub(crate) list: bool,
    /// Only these; all, if empty.
    pub(crate) only: Vec<String>,
    /// So many of them.
    pub(crate) sample: Option<usize>,
    pub(crate) sorts: Sorts,
}

/// Which sorts of defects.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Sorts {
    #[default]
    Both,
    Patches,
    Portable,
}

/// Tries what was ordered and prints a line for each.
pub(crate) fn run(order: &Order, installing: Installing) -> Result<Verdict> {
    let defects = chosen(defect::all()?, order)?;
    if order.list {
        for defect in &defects {
            println!("{}\n  {}\n  seen by {}", defect.name, defect.why, defect.expected);
        }
        println!("{} defects", defects.len());
        return Ok(Verdict::Passed);
    }
    let mut verdict = Verdict::Passed;
    if order.sorts != Sorts::Portable {
        verdict = patches(&defects, installing)?;
    }
    if order.sorts != Sorts::Patches && portable::run(&order.only, installing)? == Verdict::Failed {
        verdict = Verdict::Failed;
    }
    Ok(verdict)
}

/// The defects that were asked for; of a sample, as many as were asked for, spread evenly.
fn chosen(all: Vec<Defect>, order: &Order) -> Result<Vec<Defect>> {
    if order.sorts != Sorts::Portable
        && let Some(unknown) = order.only.iter().find(|&name| all.iter().all(|defect| defect.name != *name))
    {
        bail!("no defect is named {unknown}; `cargo xtask mutants --list` names them");
    }
    let asked = |defect: &Defect| order.only.is_empty() || order.only.contains(&defect.name);
    let chosen: Vec<Defect> = all.into_iter().filter(asked).collect();
    let Some(sample) = order.sample.filter(|&sample| sample < chosen.len()) else { return Ok(chosen) };
    let number = chosen.len();
    let is_taken = |place: usize| (place * sample) % number < sample;
    Ok(chosen.into_iter().enumerate().filter(|(place, _)| is_taken(*place)).map(|(_, defect)| defect).collect())
}

fn patches(defects: &[Defect], installing: Installing) -> Result<Verdict> {
    let begin = Instant::now();
    let mut bench = Bench::new(installing)?;
    bench.check(defects)?;
    let bar = bar(defects.len());
    let mut wrong = 0;
    for (place, defect) in defects.iter().enumerate() {
        bar.set_position(place as u64);
        bar.set_message(defect.name.clone());
        let start = Instant::now();
        let outcome = bench.try_out(defect)?;
        wrong += usize::from(!outcome.is_as_it_should_be());
        let (number, of) = (place + 1, defects.len());
        let line = format!("{number:>3} of {of}  {:>3} s  {}: {outcome}", start.elapsed().as_secs(), defect.name);
        bar.suspend(|| println!("{line}"));
    }
    bar.finish_and_clear();
    println!("{} defects in {} s, {wrong} of them not as they should be", defects.len(), begin.elapsed().as_secs());
    Ok(if wrong == 0 { Verdict::Passed } else { Verdict::Failed })
}

fn bar(length: usize) -> ProgressBar {
    let terminal = std::io::stderr().is_terminal();
    let target = if terminal { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() };
    let bar = ProgressBar::with_draw_target(Some(length as u64), target);
    if let Ok(style) = ProgressStyle::with_template("  {pos} of {len} {bar:32.cyan/blue} {eta} to go  {msg}") {
        bar.set_style(style.progress_chars("━╸─"));
    }
    bar
}

#[cfg(test)]
mod tests {
    use super::*;
    use defect::Expected;

    fn some(number: usize) -> Vec<Defect> {
        let one = |place| Defect {
            name: format!("{place:02}"),
            expected: Expected::Compiler(String::new()),
            why: String::new(),
            patch: "none".into(),
        };
        (0..number).map(one).collect()
    }

    fn names(order: &Order) -> Vec<String> {
        chosen(some(10), order).unwrap().into_iter().map(|defect| defect.name).collect()
    }

    #[test]
    fn a_sample_is_spread_over_all_and_as_large_as_asked_for() {
        assert_eq!(names(&Order { sample: Some(4), ..Order::default() }), ["00", "03", "05", "08"]);
        assert_eq!(names(&Order { sample: Some(20), ..Order::default() }).len(), 10);
        for sample in 1..=10 {
            assert_eq!(names(&Order { sample: Some(sample), ..Order::default() }).len(), sample);
        }
    }

    #[test]
    fn a_name_that_no_defect_has_is_refused() {
        let order = Order { only: vec!["03".into(), "11".into()], ..Order::default() };
        let error = chosen(some(10), &order).unwrap_err().to_string();
        assert!(error.contains("no defect is named 11"), "{error}");
        assert_eq!(names(&Order { only: vec!["03".into()], ..Order::default() }), ["03"]);
    }
}
