//! A recording of the drive's oscilloscope: as text, as a table, and drawn on a page.

use super::numbers::{counted, thousands};
use super::page::escape;
use super::plot::{Axis, Curve, Plot};
use crate::scope::Recording;
use std::fmt::Write;

const STYLE: &str = include_str!("page.css");

/// Class of each channel's curve in the style sheet, identifier and name of its drawing.
const LOOKS: [(&str, &str, &str); 4] = [
    ("velocity", "channel-1", "channel 1"),
    ("current", "channel-2", "channel 2"),
    ("error", "channel-3", "channel 3"),
    ("command", "channel-4", "channel 4"),
];

/// Time in units of 0.1 us.
fn tenths(time: i64) -> String {
    let sign = if time < 0 { "-" } else { "" };
    let time = time.unsigned_abs();
    format!("{sign}{}.{}", time / 10, time % 10)
}

/// How many points there are, and where they lie.
fn extent(recording: &Recording) -> String {
    let last = recording.len().saturating_sub(1);
    let milliseconds = |time: i64| format!("{:.4} ms", time as f64 / 10_000.0);
    format!(
        "{}, {} every {} us, from {} to {} around the trigger",
        counted(recording.channels.len() as u64, "signal"),
        counted(recording.len() as u64, "point"),
        tenths(recording.interval.into()),
        milliseconds(recording.time(0)),
        milliseconds(recording.time(last)),
    )
}

/// One line, and one more a channel.
pub(crate) fn text(recording: &Recording) -> String {
    let mut text = format!("{}\n", extent(recording));
    for (number, channel) in recording.channels.iter().enumerate() {
        let scaled = || channel.points.iter().map(|&point| channel.signal.scaled(point));
        let (low, high) =
            scaled().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)));
        // Writing to a String cannot fail, here and below.
        let _ = writeln!(
            text,
            "  {}  {:<9} {:<40} {low:.4} to {high:.4} {}",
            number + 1,
            channel.signal.to_string(),
            channel.signal.name,
            channel.signal.unit
        );
    }
    text.replace(" \n", "\n")
}

/// Columns with a head: time in us, zero at the trigger, then the signals in their units.
pub(crate) fn csv(recording: &Recording) -> String {
    let mut csv = String::from("time us");
    for channel in &recording.channels {
        let _ = write!(csv, ",{} {}", channel.signal, channel.signal.unit);
        csv.truncate(csv.trim_end().len());
    }
    csv.push('\n');
    for index in 0..recording.len() {
        csv.push_str(&tenths(recording.time(index)));
        for channel in &recording.channels {
            let value = channel.points.get(index).map_or(0.0, |&point| channel.signal.scaled(point));
            // Nine places tell neighbouring increments apart in every unit there is.
            let written = format!("{value:.9}");
            let shortest = written.trim_end_matches('0').trim_end_matches('.');
            let _ = write!(csv, ",{shortest}");
        }
        csv.push('\n');
    }
    csv
}

/// A page with a drawing for each channel, on one time axis; the same bytes for the same recording.
pub(crate) fn html(recording: &Recording) -> String {
    let seconds = |index: usize| recording.time(index) as f64 / 1e7;
    let last = recording.len().saturating_sub(1);
    let time = Axis::of_time(seconds(0), seconds(last));
    let before: Vec<(f64, f64)> =
        if seconds(0) < 0.0 { vec![(seconds(0), seconds(last).min(0.0))] } else { Vec::new() };
    let mut plots = String::new();
    for (number, (channel, (class, id, name))) in recording.channels.iter().zip(LOOKS).enumerate() {
        let level = recording.trigger.filter(|(of, _)| *of == number).map(|(_, level)| channel.signal.scaled(level));
        let limits: Vec<f64> = level.into_iter().collect();
        let points = channel.points.iter().enumerate();
        let plot = Plot {
            id,
            // Beside the axis there is room for no more; the heading has it too.
            unit: if channel.signal.unit.len() <= 6 { channel.signal.unit } else { "" },
            height: 200.0,
            curves: vec![Curve {
                class,
                name,
                points: points.map(|(index, &point)| (seconds(index), channel.signal.scaled(point))).collect(),
            }],
            bands: &before,
            limits: &limits,
        };
        let legend = if limits.is_empty() { "" } else { "<i class=\"limit\"></i>trigger level" };
        let _ = write!(
            plots,
            "<h2>{} {}{}<span class=\"legend\"><i class=\"{class}\"></i>{name}{legend}</span></h2>{}",
            channel.signal,
            escape(channel.signal.name),
            if channel.signal.unit.is_empty() { String::new() } else { format!(" [{}]", escape(channel.signal.unit)) },
            plot.svg(&time)
        );
    }
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <title>Oscilloscope of the drive</title>\n<style>\n{STYLE}</style>\n</head>\n<body>\n\
         <header><div><h1>Recorded in the drive</h1><p>{}</p></div></header>\n\
         <section class=\"panel plots\">{plots}<p class=\"note\">Shaded: before the trigger, which is at zero.</p></section>\n\
         <footer>{} values, read over the service channel on a simulated ring. SERCOS is a trademark; this drive is not certified.\
         </footer>\n</body>\n</html>\n",
        extent(recording),
        thousands((recording.len() * recording.channels.len()) as u64),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scope::Channel;

    fn recording() -> Recording {
        let channel = |text: &str, points: &[i32]| Channel { signal: text.parse().unwrap(), points: points.to_vec() };
        Recording {
            interval: 625,
            pre_trigger: 2,
            trigger: Some((1, 150_000)),
            channels: vec![
                channel("F006", &[0, 0, 8_192, -32_768]),
                channel("S-0-0040", &[-5_000, 0, 150_001, 3_000_000]),
                channel("S-0-0332", &[0, 0, 0, 1]),
            ],
        }
    }

    #[test]
    fn the_table_has_the_time_from_the_trigger_and_the_signals_in_their_units() {
        assert_eq!(
            csv(&recording()),
            "time us,F006 of S-0-0110,S-0-0040 rpm,S-0-0332\n\
             -125.0,0,-0.5,0\n\
             -62.5,0,0,0\n\
             0.0,0.25,15.0001,0\n\
             62.5,-1,300,1\n"
        );
    }

    #[test]
    fn the_text_tells_extent_and_ranges() {
        let text = text(&recording());
        assert!(
            text.starts_with("3 signals, 4 points every 62.5 us, from -0.1250 ms to 0.0625 ms around the trigger\n"),
            "{text}"
        );
        assert!(text.contains("-1.0000 to 0.2500 of S-0-0110\n"), "{text}");
        assert!(text.contains("  2  S-0-0040  Velocity feedback value 1 "), "{text}");
        assert!(text.contains("-0.5000 to 300.0000 rpm\n"), "{text}");
        assert!(text.ends_with("0.0000 to 1.0000\n"), "a signal without unit: {text}");
    }

    #[test]
    fn the_page_has_a_drawing_for_each_channel_and_the_level_in_that_of_the_trigger() {
        let page = html(&recording());
        assert_eq!(page, html(&recording()));
        assert_eq!(page.matches("<svg ").count(), 3);
        assert_eq!(page.matches("class=\"limit\" d=").count(), 1);
        let second = page.split("<svg ").nth(2).unwrap();
        assert!(second.contains("id=\"channel-2\"") && second.contains("class=\"limit\" d="), "{second}");
        assert_eq!(page.matches("class=\"band\"").count(), 3, "the time before the trigger is shaded");
        assert!(page.contains("S-0-0332 Status n_feedback &lt; nx"), "names are text, not markup");
        assert_eq!(page.matches("class=\"curve ").count(), 3);
    }

    #[test]
    fn without_a_trigger_edge_and_pre_trigger_nothing_is_marked() {
        let page = html(&Recording { pre_trigger: 0, trigger: None, ..recording() });
        assert!(!page.contains("class=\"limit\" d=") && !page.contains("class=\"band\""));
    }

    #[test]
    fn a_curve_stands_where_its_points_say() {
        let page = html(&Recording { trigger: None, ..recording() });
        let third = page.split("<path class=\"curve error\" d=\"").nth(1).unwrap();
        let path = third.split('"').next().unwrap();
        // 66 to 986 in three steps; 0 at the bottom and 1 at the top, with air of 6 %.
        assert_eq!(path, "M66.0 167.0L372.7 167.0L679.3 167.0L986.0 17.0");
    }
}
