//! The cases, one file a heading.

mod command_and_feedback;
mod compliance_classes;
mod error_handling;
mod identification;
mod phase_switch;
mod procedure_commands;
mod service_channel;
mod telegram_types;
mod time_slots;

use crate::case::{Case, CaseReport, Section, SlaveReport};

/// All cases, in the order of the report.
#[must_use]
pub fn cases() -> Vec<Case> {
    let mut cases: Vec<Case> = [
        identification::cases(),
        service_channel::cases(),
        procedure_commands::cases(),
        compliance_classes::cases(),
        telegram_types::cases(),
        error_handling::cases(),
        time_slots::cases(),
        phase_switch::cases(),
        command_and_feedback::cases(),
    ]
    .into_iter()
    .flatten()
    .collect();
    cases.sort_by_key(|case| case.section);
    cases
}

/// Runs the cases of some headings (all, if there are none), on as many threads as there are; `progress` is told how many are done.
pub fn run(sections: &[Section], threads: usize, progress: &(dyn Fn(usize, usize) + Sync)) -> SlaveReport {
    use std::sync::Mutex;
    use std::sync::atomic::{AtomicUsize, Ordering};

    let cases: Vec<Case> =
        cases().into_iter().filter(|case| sections.is_empty() || sections.contains(&case.section)).collect();
    let next = AtomicUsize::new(0);
    let reports: Mutex<Vec<(usize, CaseReport)>> = Mutex::new(Vec::new());
    let poisoned = "no case panics while it holds the lock";
    std::thread::scope(|scope| {
        for _ in 0..threads.clamp(1, cases.len().max(1)) {
            scope.spawn(|| {
                while let Some((index, case)) =
                    Some(next.fetch_add(1, Ordering::Relaxed)).and_then(|index| Some((index, cases.get(index)?)))
                {
                    let report = case.run();
                    let done = match reports.lock() {
                        Ok(mut reports) => {
                            reports.push((index, report));
                            reports.len()
                        }
                        Err(_) => unreachable!("{poisoned}"),
                    };
                    progress(done, cases.len());
                }
            });
        }
    });
    let mut reports = reports.into_inner().unwrap_or_default();
    reports.sort_by_key(|(index, _)| *index);
    SlaveReport { cases: reports.into_iter().map(|(_, report)| report).collect() }
}
