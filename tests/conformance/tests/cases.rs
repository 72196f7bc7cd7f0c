//! The cases of the slave report pass, and there are enough of them.

use conformance::sections::run;

#[test]
fn the_drive_passes_every_case_of_the_slave_report() {
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let report = run(&[], threads, &|_, _| {});
    let failed: Vec<String> = report
        .cases
        .iter()
        .filter_map(|case| Some(format!("{:?}: {}: {}", case.section, case.rule, case.failure.as_ref()?)))
        .collect();
    println!("{} cases", report.cases.len());
    assert!(failed.is_empty(), "{} of {} failed:\n{}", failed.len(), report.cases.len(), failed.join("\n"));
}
