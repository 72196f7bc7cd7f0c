//! The frequency response of an axis: as a table, as JSON, and drawn on a page.

use super::numbers::counted;
use crate::scope::Bode;
use std::fmt::Write;

const STYLE: &str = include_str!("page.css");

/// Size of a drawing, and the room around it, in SVG units.
const WIDTH: f64 = 1_000.0;
const HEIGHT: f64 = 300.0;
const LEFT: f64 = 66.0;
const RIGHT: f64 = 986.0;
const TOP: f64 = 10.0;
const BOTTOM: f64 = 272.0;

/// The margins in words.
fn margins(bode: &Bode) -> String {
    let gain = bode.gain_margin.map_or_else(|| "none to be measured".to_owned(), |gain| format!("{gain:.1} dB"));
    let resonance = match bode.resonance_hertz {
        Some(hertz) if bode.notch => format!("{hertz:.1} Hz, with a notch on it"),
        Some(hertz) => format!("{hertz:.1} Hz, without a notch"),
        None => "none".to_owned(),
    };
    format!(
        "crossing {:.1} Hz, phase margin {:.1} degrees, gain margin {gain}, first resonance {resonance}",
        bode.crossing_hertz, bode.phase_margin
    )
}

/// A line of the margins, and a table.
pub(crate) fn text(bode: &Bode) -> String {
    let mut text = format!("{}, {}\n", counted(bode.points.len() as u64, "frequency"), margins(bode));
    text.push_str("       Hz   axis dB   degrees   loop dB   degrees\n");
    for point in &bode.points {
        // Writing to a String cannot fail, here and below.
        let _ = writeln!(
            text,
            "{:9.2} {:9.2} {:9.2} {:9.2} {:9.2}",
            point.hertz, point.axis_decibels, point.axis_degrees, point.open_decibels, point.open_degrees
        );
    }
    text.replace("frequencys", "frequencies")
}

/// All of it, for programs.
pub(crate) fn json(bode: &Bode) -> String {
    serde_json::to_string_pretty(bode).map_or_else(|error| error.to_string(), |json| json + "\n")
}

/// A phase that goes on where it was at the point before, from -180 degrees on the way down.
fn unwrapped(degrees: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut last = -90.0;
    degrees
        .map(|degrees| {
            last = degrees + 360.0 * ((last - degrees) / 360.0_f64).round();
            last
        })
        .collect()
}

/// Where a frequency is drawn, from 10 Hz to 2 100 Hz.
fn across(hertz: f64) -> f64 {
    LEFT + (hertz / LOWEST).ln() / (HIGHEST / LOWEST).ln() * (RIGHT - LEFT)
}

const LOWEST: f64 = 9.0;
const HIGHEST: f64 = 2_200.0;

struct Drawing<'a> {
    id: &'static str,
    unit: &'static str,
    step: f64,
    /// Class and values.
    curves: [(&'static str, Vec<f64>); 2],
    hertz: &'a [f64],
    /// A level that counts.
    limit: f64,
    /// Frequency, from the limit to this value, and its words.
    marks: Vec<(f64, f64, String)>,
}

impl Drawing<'_> {
    fn svg(&self) -> String {
        let values = || self.curves.iter().flat_map(|(_, values)| values).copied().chain([self.limit]);
        let low = (values().fold(f64::INFINITY, f64::min) / self.step).floor() * self.step;
        let high = (values().fold(f64::NEG_INFINITY, f64::max) / self.step).ceil() * self.step;
        let up = |value: f64| BOTTOM - (value - low) / (high - low).max(1.0) * (BOTTOM - TOP);
        let mut svg = format!(
            "<svg id=\"{}\" viewBox=\"0 0 {WIDTH} {HEIGHT}\" role=\"img\" aria-label=\"axis and open loop in {}\">",
            self.id, self.unit
        );
        for hertz in [10.0, 20.0, 50.0, 100.0, 200.0, 500.0, 1_000.0, 2_000.0] {
            let x = across(hertz);
            let _ = write!(
                svg,
                "<path class=\"grid\" d=\"M{x:.1} {TOP}V{BOTTOM}\"/><text class=\"tick\" x=\"{x:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{hertz} Hz</text>",
                BOTTOM + 18.0
            );
        }
        let steps = ((high - low) / self.step).round() as i32;
        for n in 0..=steps {
            let value = low + f64::from(n) * self.step;
            let y = up(value);
            let _ = write!(
                svg,
                "<path class=\"grid\" d=\"M{LEFT} {y:.1}H{RIGHT}\"/><text class=\"tick\" x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>",
                LEFT - 8.0,
                y + 4.0,
                format!("{value:.0}").replace('-', "−")
            );
        }
        let _ = write!(svg, "<path class=\"limit\" d=\"M{LEFT} {:.1}H{RIGHT}\"/>", up(self.limit));
        for (class, values) in &self.curves {
            let mut path = String::new();
            for (n, (hertz, value)) in self.hertz.iter().zip(values).enumerate() {
                let _ = write!(path, "{}{:.1} {:.1}", if n == 0 { 'M' } else { 'L' }, across(*hertz), up(*value));
            }
            let _ = write!(svg, "<path class=\"curve {class}\" d=\"{path}\"/>");
        }
        for (hertz, value, words) in &self.marks {
            let x = across(*hertz);
            let (from, to) = (up(self.limit), up(*value));
            let _ = write!(
                svg,
                "<path class=\"curve error\" d=\"M{x:.1} {from:.1}V{to:.1}\"/><text class=\"tick\" x=\"{:.1}\" y=\"{:.1}\">{words}</text>",
                x + 6.0,
                (from + to) / 2.0 + 4.0
            );
        }
        let _ = write!(
            svg,
            "<text class=\"unit\" x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{}</text></svg>",
            LEFT - 8.0,
            BOTTOM + 18.0,
            self.unit
        );
        svg
    }
}

/// Of the open loop at a frequency, a line over the logarithm between two points.
fn open_at(hertz: &[f64], values: &[f64], at: f64) -> f64 {
    let after = hertz.iter().position(|&other| other >= at).unwrap_or(hertz.len()).clamp(1, hertz.len().max(2) - 1);
    let (Some(low), Some(high)) = (hertz.get(after - 1), hertz.get(after)) else { return 0.0 };
    let share = (at / low).ln() / (high / low).ln();
    values[after - 1] + share * (values[after] - values[after - 1])
}

/// Where the open loop passes -180 degrees behind its crossing.
fn turning(hertz: &[f64], phase: &[f64], crossing: f64) -> Option<f64> {
    (1..hertz.len()).find(|&n| hertz[n] > crossing && phase[n - 1] >= -180.0 && phase[n] < -180.0).map(|n| {
        let share = (phase[n - 1] + 180.0) / (phase[n - 1] - phase[n]);
        hertz[n - 1] * (hertz[n] / hertz[n - 1]).powf(share)
    })
}

/// A page with magnitude and phase; the same bytes for the same points.
pub(crate) fn html(bode: &Bode) -> String {
    let hertz: Vec<f64> = bode.points.iter().map(|point| point.hertz).collect();
    let column = |of: fn(&crate::scope::BodePoint) -> f64| bode.points.iter().map(of).collect::<Vec<_>>();
    let open_gain = column(|point| point.open_decibels);
    let open_phase = unwrapped(bode.points.iter().map(|point| point.open_degrees));
    let phase_mark = (
        bode.crossing_hertz,
        open_at(&hertz, &open_phase, bode.crossing_hertz),
        format!("{:.1} degrees", bode.phase_margin),
    );
    let gain_mark = turning(&hertz, &open_phase, bode.crossing_hertz).zip(bode.gain_margin);
    let gain_mark = gain_mark.map(|(at, gain)| (at, open_at(&hertz, &open_gain, at), format!("{gain:.1} dB")));
    let magnitude = Drawing {
        id: "magnitude",
        unit: "dB",
        step: 20.0,
        curves: [("velocity", column(|point| point.axis_decibels)), ("current", open_gain)],
        hertz: &hertz,
        limit: 0.0,
        marks: gain_mark.into_iter().collect(),
    };
    let phase = Drawing {
        id: "phase",
        unit: "degrees",
        step: 90.0,
        curves: [("velocity", unwrapped(bode.points.iter().map(|point| point.axis_degrees))), ("current", open_phase)],
        hertz: &hertz,
        limit: -180.0,
        marks: vec![phase_mark],
    };
    const LEGEND: &str = "<span class=\"legend\"><i class=\"velocity\"></i>axis, of 1 rad/s per A<i class=\"current\"></i>open velocity loop<i class=\"error\"></i>margin</span>";
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <title>Frequency response of the axis</title>\n<style>\n{STYLE}</style>\n</head>\n<body>\n\
         <header><div><h1>Measured by the drive</h1><p>{}</p></div></header>\n\
         <section class=\"panel plots\"><h2>Magnitude{LEGEND}</h2>{}<h2>Phase{LEGEND}</h2>{}\
         <p class=\"note\">From the current command to the movement of a tick, all delays included; P-0-0240 and P-0-0248.</p></section>\n\
         <footer>Read over the service channel on a simulated ring. SERCOS is a trademark; this drive is not certified.\
         </footer>\n</body>\n</html>\n",
        margins(bode),
        magnitude.svg(),
        phase.svg()
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scope::BodePoint;

    /// `100 Hz / (j f)`, late by 1 ms: 54 degrees at 100 Hz, and 8 dB at 250 Hz.
    fn bode() -> Bode {
        let points = (0..45).map(|n| {
            let hertz = 10.0 * 200_f64.powf(f64::from(n) / 44.0);
            let (decibels, degrees) = (20.0 * (100.0 / hertz).log10(), -90.0 - 0.36 * hertz);
            let degrees = (degrees + 180.0).rem_euclid(360.0) - 180.0;
            BodePoint {
                hertz,
                axis_decibels: decibels - 20.0,
                axis_degrees: degrees,
                open_decibels: decibels,
                open_degrees: degrees,
            }
        });
        Bode {
            phase_margin: 54.0,
            gain_margin: Some(7.96),
            crossing_hertz: 100.0,
            resonance_hertz: None,
            notch: false,
            points: points.collect(),
        }
    }

    #[test]
    fn the_table_has_the_margins_and_a_line_a_frequency() {
        let text = text(&bode());
        assert!(
            text.starts_with("45 frequencies, crossing 100.0 Hz, phase margin 54.0 degrees, gain margin 8.0 dB, first resonance none\n"),
            "{text}"
        );
        assert_eq!(text.lines().count(), 47);
        assert!(text.contains("    10.00      0.00    -93.60     20.00    -93.60\n"), "{text}");
    }

    #[test]
    fn the_margins_are_drawn_where_they_are() {
        let bode = bode();
        let page = html(&bode);
        assert_eq!(page, html(&bode));
        assert_eq!(page.matches("<svg ").count(), 2);
        let x = across(100.0);
        assert!(page.contains(&format!("<path class=\"curve error\" d=\"M{x:.1} ")), "{x}");
        let hertz: Vec<f64> = bode.points.iter().map(|point| point.hertz).collect();
        let phase = unwrapped(bode.points.iter().map(|point| point.open_degrees));
        assert!(phase.windows(2).all(|pair| pair[1] < pair[0]), "{phase:?}");
        let at = turning(&hertz, &phase, 100.0).unwrap();
        assert!((at / 250.0 - 1.0).abs() < 0.02, "{at} Hz");
        assert!(page.contains("54.0 degrees</text>") && page.contains("8.0 dB</text>"));
    }

    #[test]
    fn without_a_gain_margin_nothing_is_marked_and_the_json_has_none() {
        let none = Bode { gain_margin: None, resonance_hertz: Some(640.0), notch: true, ..bode() };
        assert_eq!(html(&none).matches("class=\"curve error\"").count(), 1);
        let read: serde_json::Value = serde_json::from_str(&json(&none)).unwrap();
        assert_eq!((&read["gain_margin"], &read["points"][0]["hertz"]), (&serde_json::Value::Null, &10.0.into()));
        assert!(text(&none).contains("first resonance 640.0 Hz, with a notch on it"));
    }
}
