//! Results for the terminal.

use super::checks::{self, Check};
use super::data::{Acknowledgement, DemoReport, DriveReplay, Platform, ReplayReport};
use super::numbers::{counted, degrees, microseconds, seconds, spread, thousands};
use std::fmt::Write;

/// A run of the demonstration.
pub(crate) fn demo(report: &DemoReport) -> String {
    let mut text = String::new();
    for phase in &report.phases {
        row(
            &mut text,
            &format!("CP{}", phase.phase),
            &format!(
                "{} s, from {} s; {}",
                seconds(phase.end_us.saturating_sub(phase.start_us)),
                seconds(phase.start_us),
                counted(phase.service_steps, "service-channel step"),
            ),
        );
    }
    for (name, value) in numbers_of_demo(report) {
        row(&mut text, name, &value);
    }
    if let Some(trace) = &report.trace {
        row(&mut text, "trace of the ELF", trace);
    }
    for Check { what, found, passed } in checks::of_demo(report) {
        let mark = if passed { "ok" } else { "FAILED" };
        row(&mut text, mark, &format!("{what}: {found}"));
    }
    text
}

/// Names and values of what a demonstration measured; the page shows the same.
pub(super) fn numbers_of_demo(report: &DemoReport) -> Vec<(&'static str, String)> {
    let steps: u64 = report.phases.iter().map(|phase| phase.service_steps).sum();
    let missed = report.missed;
    let following = report.following;
    let ripple = report.torque_ripple;
    // The host's processors take the time that the model gives them; only the ELF's times are measured.
    let assumed = if report.platform == Platform::Host { ", assumed" } else { "" };
    vec![
        (
            "service channel",
            format!("{}, {}", counted(steps, "step"), counted(report.service_errors.len() as u64, "error")),
        ),
        ("a step in CP2", step_in_cp2(report)),
        ("INT_SC to release", spread(&report.service_release) + assumed),
        ("t4 interrupt to AT", spread(&report.interrupt_to_at) + assumed),
        ("t3 to command", spread(&report.interrupt_to_command) + assumed),
        (
            "missed telegrams",
            format!(
                "{} MST, {} MDT, {} AT{}",
                thousands(missed.mst),
                thousands(missed.mdt),
                thousands(missed.at),
                if missed.first_at { "; the first AT of CP3, which a master forgives" } else { "" }
            ),
        ),
        (
            "error, constant speed",
            format!(
                "max {}, RMS {}",
                degrees(following.constant_speed_max_degrees),
                degrees(following.constant_speed_rms_degrees)
            ),
        ),
        (
            "error, whole motion",
            format!("max {}, RMS {}", degrees(following.overall_max_degrees), degrees(following.overall_rms_degrees)),
        ),
        (
            "torque ripple",
            format!(
                "RMS {:.2} % of peak on the ramp, {:.2} % at constant speed",
                ripple.accelerating_rms_percent, ripple.constant_speed_rms_percent
            ),
        ),
    ]
}

/// What makes CP2 last: the drives of the ring are parametrised side by side, each of them step by step.
fn step_in_cp2(report: &DemoReport) -> String {
    let cp2 = report.phases.iter().find(|phase| phase.phase == 2 && phase.service_steps > 0);
    let Some(cp2) = cp2 else { return "none was made".to_owned() };
    let lasted = cp2.end_us.saturating_sub(cp2.start_us);
    let of_a_drive = cp2.service_steps as f64 / report.ring.len().max(1) as f64;
    let step = lasted as f64 / of_a_drive;
    format!(
        "{:.1} ms or {:.1} cycles; {of_a_drive:.0} steps of each drive are the {} s",
        step / 1_000.0,
        step / f64::from(report.cycle_us.max(1)),
        seconds(lasted)
    )
}

fn row(text: &mut String, name: &str, value: &str) {
    // Writing to a String cannot fail.
    let _ = writeln!(text, "{name:<22} {value}");
}

/// A replay: a line a drive, and how many are in CP4.
pub(crate) fn replay(report: &ReplayReport) -> String {
    let mut text = String::new();
    for drive in &report.drives {
        let _ = writeln!(text, "{}", drive_line(drive));
    }
    let in_operation = report.drives.iter().filter(|drive| drive.phase == 4).count();
    let _ = writeln!(text, "{in_operation}/{} drives in CP4", report.drives.len());
    let elf = report.drives.iter().find(|drive| drive.platform == Platform::Qemu);
    if let Some(release) = elf.and_then(|drive| drive.service_release) {
        let _ = writeln!(text, "longest INT_SC to release of the ELF: {}", microseconds(release.longest_ns));
    }
    text
}

/// Whether every drive of a replay passed.
pub(crate) fn replay_passed(report: &ReplayReport) -> bool {
    report.passed
        && !report.drives.is_empty()
        && report.drives.iter().all(|drive| checks::failure_of_drive(drive).is_none())
}

fn drive_line(drive: &DriveReplay) -> String {
    let check = |check| match check {
        Acknowledgement::Positive => "acknowledged",
        Acknowledgement::Negative => "refused",
        Acknowledgement::Missing => "missing",
        Acknowledgement::NotAsked => "not asked",
    };
    let platform = match drive.platform {
        Platform::Host => "host",
        Platform::Qemu => "ELF in QEMU",
    };
    let read_back = drive.written.saturating_sub(drive.differences.len() as u64);
    let verdict = match checks::failure_of_drive(drive) {
        None => "ok".to_owned(),
        Some(failure) => format!("FAILED: {failure}"),
    };
    let (check_127, check_128) = (check(drive.check_127), check(drive.check_128));
    format!(
        "drive {} ({platform}): CP{}, S-0-0127 {check_127}, S-0-0128 {check_128}, {}, {}, {read_back}/{} values read back: {verdict}",
        drive.address,
        drive.phase,
        counted(drive.service_steps, "service-channel step"),
        counted(drive.service_errors.len() as u64, "error"),
        drive.written,
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::data::Durations;
    use crate::report::examples;

    #[test]
    fn a_replay_has_a_line_a_drive_and_counts_those_in_operation() {
        let report = examples::replay();
        let text = replay(&report);
        assert_eq!(
            text.lines().next().unwrap(),
            "drive 1 (host): CP4, S-0-0127 acknowledged, S-0-0128 acknowledged, 1 234 service-channel steps, 0 errors, \
             12/12 values read back: ok"
        );
        assert_eq!(text.lines().last().unwrap(), "4/4 drives in CP4");
        assert!(replay_passed(&report));
    }

    #[test]
    fn a_drive_that_falls_behind_fails_the_replay() {
        let mut report = examples::replay();
        report.drives[2].phase = 2;
        assert!(!replay_passed(&report));
        let text = replay(&report);
        assert!(text.contains("FAILED: ended in CP2"));
        assert!(text.contains("3/4 drives in CP4"));
    }

    #[test]
    fn a_replay_of_no_drives_proves_nothing() {
        let mut report = examples::replay();
        report.drives.clear();
        assert!(!replay_passed(&report));
    }

    #[test]
    fn the_longest_release_is_the_elfs_own() {
        let mut report = examples::replay();
        report.drives[0].platform = Platform::Qemu;
        report.drives[0].service_release = Some(Durations { count: 9, shortest_ns: 1, mean_ns: 2, longest_ns: 23_456 });
        assert!(replay(&report).ends_with("longest INT_SC to release of the ELF: 23.4 us\n"));
    }

    #[test]
    fn times_of_the_host_are_not_told_as_measured() {
        let mut report = examples::demo();
        report.platform = Platform::Host;
        assert!(demo(&report).contains("mean 14.9 us (246 times), assumed"));
        assert!(!demo(&examples::demo()).contains("assumed"));
    }

    #[test]
    fn the_demonstration_prints_phases_numbers_and_checks() {
        let text = demo(&examples::demo());
        for wanted in [
            "CP0                    0.300 s, from 0.000 s; 0 service-channel steps",
            // 2.48 s of CP2, 1 862 steps of three drives.
            "a step in CP2          4.0 ms or 0.4 cycles; 621 steps of each drive are the 2.480 s",
            "error, constant speed  max 0.00600°, RMS 0.004",
            "missed telegrams       0 MST, 0 MDT, 0 AT",
            "ok                     every drive of the ring in CP4: 3 of 3",
        ] {
            assert!(text.contains(wanted), "{wanted:?} is not in\n{text}");
        }
        assert!(!text.contains("FAILED"));
    }
}
