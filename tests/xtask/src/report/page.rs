//! The demonstration as one HTML page: no other files, no wall-clock time, the same bytes for the same report.

use super::checks;
use super::data::{DemoReport, MotionSegment, Platform};
use super::numbers::{counted, degrees, microseconds, seconds, thousands};
use super::plot::{Axis, Curve, LEFT, Plot, WIDTH, time_ticks};
use super::text::numbers_of_demo;
use std::fmt::Write;

const STYLE: &str = include_str!("page.css");
const SCRIPT: &str = include_str!("page.js");

/// Most instants whose values the page can tell under the pointer.
const READINGS: usize = 1_000;

/// The page.
pub(crate) fn html(report: &DemoReport) -> String {
    let platform = match report.platform {
        Platform::Host => "portable crates on the host",
        Platform::Qemu => "release ELF in QEMU",
    };
    let ring: Vec<String> = report.ring.iter().map(u8::to_string).collect();
    let subtitle = format!(
        "drive {} of the ring {} · {platform} · {} Mbit/s · S-0-0002 = {} us",
        report.address,
        ring.join("–"),
        report.megabits_per_second,
        thousands(report.cycle_us.into()),
    );
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <title>Line-shaft demonstration, drive {address}</title>\n<style>\n{STYLE}</style>\n</head>\n<body>\n\
         <header><div><h1>From CP0 to a following motor</h1><p>{subtitle}</p></div>{verdict}</header>\n\
         {cards}{timeline}{motion}<section class=\"columns\">{phases}{numbers}</section>\n{checks}{log}\
         <footer>All times are simulated time. SERCOS is a trademark; this drive is not certified.</footer>\n\
         <script>\nconst readings={readings};\n{SCRIPT}</script>\n</body>\n</html>\n",
        address = report.address,
        verdict = verdict(report),
        cards = cards(report),
        timeline = timeline(report),
        motion = motion(report),
        phases = phases(report),
        numbers = numbers(report),
        checks = check_list(report),
        log = log(report),
        readings = readings(report),
    )
}

fn verdict(report: &DemoReport) -> &'static str {
    if checks::of_demo(report).iter().all(|check| check.passed) {
        "<span class=\"verdict passed\">passed</span>"
    } else {
        "<span class=\"verdict failed\">failed</span>"
    }
}

/// The numbers that one looks for first.
fn cards(report: &DemoReport) -> String {
    let run_up = report
        .phases
        .iter()
        .find(|phase| phase.phase == 4)
        .map_or_else(|| "—".to_owned(), |phase| format!("{} s", seconds(phase.start_us)));
    let missed = report.missed.mst + report.missed.mdt + report.missed.at;
    let of = |count| match report.platform {
        Platform::Host => "assumed for the host".to_owned(),
        Platform::Qemu => format!("longest of {}", thousands(count)),
    };
    let longest = |durations: &super::data::Durations| {
        if durations.count == 0 { "—".to_owned() } else { microseconds(durations.longest_ns) }
    };
    let cards = [
        ("CP0 to CP4", run_up, "simulated time".to_owned()),
        (
            "following error",
            degrees(report.following.constant_speed_max_degrees),
            format!("max at constant speed; RMS {}", degrees(report.following.constant_speed_rms_degrees)),
        ),
        ("t4 interrupt to AT", longest(&report.interrupt_to_at), of(report.interrupt_to_at.count)),
        ("INT_SC to release", longest(&report.service_release), of(report.service_release.count)),
        (
            "missed telegrams",
            thousands(missed),
            format!("MST {}, MDT {}, AT {}", report.missed.mst, report.missed.mdt, report.missed.at),
        ),
    ];
    let mut html = String::from("<section class=\"cards\">");
    for (name, value, note) in cards {
        // Writing to a String cannot fail, here and below.
        let _ =
            write!(html, "<div class=\"card\"><span>{name}</span><strong>{value}</strong><small>{note}</small></div>");
    }
    html.push_str("</section>\n");
    html
}

/// Phases and parts of the motion as bars over the whole run.
fn timeline(report: &DemoReport) -> String {
    let time = Axis::of_time(0.0, in_seconds(report.end_us));
    let mut svg = format!("<svg viewBox=\"0 0 {WIDTH} 112\" role=\"img\" aria-label=\"phases and motion over time\">");
    svg.push_str(&time_ticks(&time, 8.0, 84.0));
    for (row, name) in [(12.0, "phase"), (50.0, "motion")] {
        let _ = write!(
            svg,
            "<text class=\"tick\" x=\"{}\" y=\"{}\" text-anchor=\"end\">{name}</text>",
            LEFT - 8.0,
            row + 19.0
        );
    }
    let mut bar = |row: f64, class: &str, name: &str, start_us: u64, end_us: u64| {
        let (from, to) = (time.place(in_seconds(start_us)), time.place(in_seconds(end_us)));
        let width = (to - from).max(1.0);
        let name = escape(name);
        let _ = write!(
            svg,
            "<g class=\"{class}\"><title>{name}: {} to {} s</title><rect x=\"{from:.1}\" y=\"{row}\" width=\"{width:.1}\" height=\"30\" rx=\"3\"/>",
            seconds(start_us),
            seconds(end_us),
        );
        // Some seven units a letter; a label that does not fit is in the title under the pointer.
        if width > 8.0 * name.chars().count() as f64 + 6.0 {
            let _ = write!(
                svg,
                "<text x=\"{:.1}\" y=\"{}\" text-anchor=\"middle\">{name}</text>",
                from + width / 2.0,
                row + 19.5
            );
        }
        svg.push_str("</g>");
    };
    for phase in &report.phases {
        bar(12.0, &format!("phase cp{}", phase.phase), &format!("CP{}", phase.phase), phase.start_us, phase.end_us);
    }
    for MotionSegment { name, start_us, end_us, constant_speed } in &report.segments {
        bar(50.0, if *constant_speed { "motion constant" } else { "motion" }, name, *start_us, *end_us);
    }
    svg.push_str("</svg>");
    format!("<section class=\"panel\"><h2>Run-up and motion</h2>{svg}</section>\n")
}

/// The plots over the motion, one below the other on one time axis.
fn motion(report: &DemoReport) -> String {
    let (Some(first), Some(last)) = (report.samples.first(), report.samples.last()) else {
        return "<section class=\"panel\"><h2>Motion</h2><p>The drive did not get as far as moving.</p></section>\n"
            .to_owned();
    };
    let time = Axis::of_time(in_seconds(first.time_us), in_seconds(last.time_us));
    let curve = |class, name, value: fn(&super::data::Sample) -> f64| Curve {
        class,
        name,
        points: report.samples.iter().map(|sample| (in_seconds(sample.time_us), value(sample))).collect(),
    };
    let bands: Vec<(f64, f64)> = report
        .segments
        .iter()
        .filter(|segment| segment.constant_speed)
        .map(|segment| (in_seconds(segment.start_us).max(time.from), in_seconds(segment.end_us).min(time.to)))
        .filter(|(from, to)| from < to)
        .collect();
    let limit = checks::FOLLOWING_ERROR_LIMIT_DEGREES;
    let plots = [
        (
            "Position of the shaft",
            Plot {
                id: "position",
                unit: "degrees",
                height: 240.0,
                curves: vec![
                    curve("feedback", "feedback", |sample| sample.feedback_degrees),
                    curve("command", "command", |sample| sample.command_degrees),
                ],
                bands: &bands,
                limits: &[],
            },
        ),
        (
            "Following error",
            Plot {
                id: "error",
                unit: "degrees",
                height: 220.0,
                curves: vec![curve("error", "command − feedback", |sample| sample.error_degrees)],
                bands: &bands,
                limits: &[-limit, limit],
            },
        ),
        (
            "Velocity",
            Plot {
                id: "velocity",
                unit: "1/min",
                height: 160.0,
                curves: vec![curve("velocity", "velocity", |sample| sample.velocity_rpm)],
                bands: &bands,
                limits: &[],
            },
        ),
        (
            "Torque-producing current",
            Plot {
                id: "current",
                unit: "% of peak",
                height: 160.0,
                curves: vec![curve("current", "command", |sample| sample.current_fraction * 100.0)],
                bands: &bands,
                limits: &[],
            },
        ),
    ];
    let mut html = String::from("<section class=\"panel plots\">");
    for (title, plot) in plots {
        let _ = write!(html, "<h2>{title}<span class=\"legend\">");
        for curve in &plot.curves {
            let _ = write!(html, "<i class=\"{}\"></i>{}", curve.class, curve.name);
        }
        if plot.id == "error" {
            let _ = write!(html, "<i class=\"limit\"></i>±{limit}° at constant speed");
        }
        let _ = write!(html, "</span><output for=\"{}\"></output></h2>{}", plot.id, plot.svg(&time));
    }
    html.push_str("<p class=\"note\">Shaded: constant speed.</p></section>\n");
    html
}

fn phases(report: &DemoReport) -> String {
    let mut html = String::from(
        "<div class=\"panel\"><h2>Phases</h2><table><tr><th>phase</th><th>from</th><th>to</th><th>lasted</th><th>service steps</th></tr>",
    );
    for phase in &report.phases {
        let _ = write!(
            html,
            "<tr><td>CP{}</td><td>{} s</td><td>{} s</td><td>{} s</td><td>{}</td></tr>",
            phase.phase,
            seconds(phase.start_us),
            seconds(phase.end_us),
            seconds(phase.end_us.saturating_sub(phase.start_us)),
            thousands(phase.service_steps),
        );
    }
    html.push_str("</table></div>");
    html
}

fn numbers(report: &DemoReport) -> String {
    let mut html = String::from("<div class=\"panel\"><h2>Numbers</h2><table>");
    for (name, value) in numbers_of_demo(report) {
        let _ = write!(html, "<tr><th>{name}</th><td>{}</td></tr>", escape(&value));
    }
    html.push_str("</table></div>");
    html
}

fn check_list(report: &DemoReport) -> String {
    let mut html = String::from("<section class=\"panel\"><h2>Checks</h2><ul class=\"checks\">");
    for check in checks::of_demo(report) {
        let class = if check.passed { "passed" } else { "failed" };
        let _ = write!(html, "<li class=\"{class}\">{}<b>{}</b></li>", check.what, escape(&check.found));
    }
    html.push_str("</ul></section>\n");
    html
}

fn log(report: &DemoReport) -> String {
    if report.log.is_empty() {
        return String::new();
    }
    let lines: Vec<String> = report.log.iter().map(|line| escape(line)).collect();
    format!(
        "<section class=\"panel\"><details><summary>Log of the drive, {}</summary><pre>{}</pre></details></section>\n",
        counted(lines.len() as u64, "line"),
        lines.join("\n")
    )
}

/// Values for the pointer: the time axis as the plots have it, and rows of time, command, feedback, error, velocity, current.
fn readings(report: &DemoReport) -> String {
    let every = report.samples.len().div_ceil(READINGS).max(1);
    let rows: Vec<String> = report
        .samples
        .iter()
        .step_by(every)
        .filter(|sample| {
            let values = [
                sample.command_degrees,
                sample.feedback_degrees,
                sample.error_degrees,
                sample.velocity_rpm,
                sample.current_fraction,
            ];
            values.iter().all(|value| value.is_finite())
        })
        .map(|sample| {
            format!(
                "[{},{:.3},{:.3},{:.4},{:.2},{:.2}]",
                seconds(sample.time_us),
                sample.command_degrees,
                sample.feedback_degrees,
                sample.error_degrees,
                sample.velocity_rpm,
                sample.current_fraction * 100.0,
            )
        })
        .collect();
    let time = match (report.samples.first(), report.samples.last()) {
        (Some(first), Some(last)) => Axis::of_time(in_seconds(first.time_us), in_seconds(last.time_us)),
        _ => Axis::of_time(0.0, 1.0),
    };
    format!(
        "{{left:{LEFT},right:{:.1},width:{WIDTH},from:{:.6},to:{:.6},rows:[{}]}}",
        time.place(time.to),
        time.from,
        time.to,
        rows.join(",")
    )
}

fn in_seconds(microseconds: u64) -> f64 {
    microseconds as f64 * 1e-6
}

/// Text that comes from the run, made safe for HTML.
pub(super) fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::examples;

    #[test]
    fn the_same_report_gives_the_same_bytes() {
        assert_eq!(html(&examples::demo()), html(&examples::demo()));
    }

    #[test]
    fn another_number_gives_another_page() {
        let mut report = examples::demo();
        report.samples[700].error_degrees += 0.01;
        assert_ne!(html(&report), html(&examples::demo()));
    }

    #[test]
    fn the_page_asks_for_no_other_file() {
        let page = html(&examples::demo());
        for foreign in ["http://", "https://", "src=", "href=", "@import", "url("] {
            assert!(!page.contains(foreign), "{foreign} asks for something outside the page");
        }
    }

    #[test]
    fn every_kind_of_plot_and_table_is_on_the_page() {
        let page = html(&examples::demo());
        for wanted in [
            "id=\"position\"",
            "id=\"error\"",
            "id=\"velocity\"",
            "id=\"current\"",
            "<h2>Phases</h2>",
            "<td>CP3</td>",
            "1 862",
            "t4 interrupt to AT",
            "3.4 us",
            "41.3 us",
            "verdict passed",
        ] {
            assert!(page.contains(wanted), "{wanted} is missing");
        }
    }

    #[test]
    fn what_the_drive_logs_is_text_and_not_markup() {
        let page = html(&examples::demo());
        assert!(page.contains("CP2 -&gt; CP3 &lt;accepted&gt;"));
        assert!(!page.contains("<accepted>"));
    }

    #[test]
    fn a_run_that_never_moved_still_makes_a_page() {
        let mut report = examples::demo();
        report.samples.clear();
        report.segments.clear();
        let page = html(&report);
        assert!(page.contains("did not get as far as moving"));
        assert!(page.contains("verdict failed"));
        assert!(!page.contains("NaN"));
    }
}
