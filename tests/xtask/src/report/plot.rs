//! Plots over time as SVG, drawn to be read: round ticks, no more points than the eye can tell apart.

use std::fmt::Write;

/// Width of every plot in SVG units; the page scales it.
pub(super) const WIDTH: f64 = 1_000.0;
/// Room for the labels of the vertical axis.
pub(super) const LEFT: f64 = 66.0;
/// Room to the right of the plot.
const RIGHT: f64 = 14.0;
const TOP: f64 = 8.0;
const BOTTOM: f64 = 24.0;

/// A linear axis: values from `from` to `to`, drawn between two places.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Axis {
    pub(super) from: f64,
    pub(super) to: f64,
    start: f64,
    end: f64,
}

impl Axis {
    /// The time axis that all plots of a page share, in seconds.
    pub(super) fn of_time(from: f64, to: f64) -> Self {
        Self { from, to: if to > from { to } else { from + 1.0 }, start: LEFT, end: WIDTH - RIGHT }
    }

    /// A vertical axis around these values with a little air, upwards.
    fn of_values(values: impl Iterator<Item = f64>, height: f64) -> Self {
        let (low, high) = values
            .filter(|value| value.is_finite())
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)));
        let (low, high) = match high - low {
            span if span > 0.0 => (low, high),
            _ if low.is_finite() => (low - 1.0, low + 1.0),
            _ => (0.0, 1.0),
        };
        let air = (high - low) * 0.06;
        Self { from: low - air, to: high + air, start: height - BOTTOM, end: TOP }
    }

    /// Where a value is drawn.
    pub(super) fn place(&self, value: f64) -> f64 {
        self.start + (value - self.from) / (self.to - self.from) * (self.end - self.start)
    }

    /// Round values on this axis, `about` of them, and how many decimal places they need.
    fn ticks(&self, about: f64) -> (Vec<f64>, usize) {
        let rough = (self.to - self.from) / about;
        let magnitude = rough.log10().floor();
        let unit = 10_f64.powf(magnitude);
        let step = [1.0, 2.0, 5.0, 10.0]
            .into_iter()
            .map(|factor| factor * unit)
            .find(|step| *step >= rough * 0.75)
            .unwrap_or(unit);
        let first = (self.from / step).ceil() as i64;
        let last = (self.to / step).floor() as i64;
        // A step of 10^-2 needs two places; rounding guards against log10(0.01) being a hair below -2.
        let places = (-step.log10() - 1e-9).ceil().max(0.0) as usize;
        ((first..=last).map(|index| index as f64 * step).collect(), places)
    }
}

/// A line of a plot.
pub(super) struct Curve {
    /// Class in the style sheet.
    pub(super) class: &'static str,
    /// Name in the legend.
    pub(super) name: &'static str,
    /// Time in seconds and value, ascending in time.
    pub(super) points: Vec<(f64, f64)>,
}

/// A plot over time.
pub(super) struct Plot<'page> {
    /// Identifier of the drawing, for the reading under the pointer.
    pub(super) id: &'static str,
    /// Unit of the values, as the axis says it.
    pub(super) unit: &'static str,
    /// Height in SVG units.
    pub(super) height: f64,
    /// Lines, the first at the back.
    pub(super) curves: Vec<Curve>,
    /// Shaded stretches of time, in seconds.
    pub(super) bands: &'page [(f64, f64)],
    /// Horizontal limit lines.
    pub(super) limits: &'page [f64],
}

impl Plot<'_> {
    /// The drawing.
    pub(super) fn svg(&self, time: &Axis) -> String {
        let values = self.curves.iter().flat_map(|curve| curve.points.iter().map(|point| point.1));
        let vertical = Axis::of_values(values.chain(self.limits.iter().copied()), self.height);
        let mut svg = String::new();
        let bottom = self.height - BOTTOM;
        let right = WIDTH - RIGHT;
        // Writing to a String cannot fail, here and below.
        let _ = write!(
            svg,
            "<svg id=\"{}\" viewBox=\"0 0 {WIDTH} {}\" role=\"img\" aria-label=\"{}\">",
            self.id,
            self.height,
            self.curves.iter().map(|curve| curve.name).collect::<Vec<_>>().join(", ")
        );
        for (from, to) in self.bands {
            let (from, to) = (time.place(*from), time.place(*to));
            let _ = write!(
                svg,
                "<rect class=\"band\" x=\"{from:.1}\" y=\"{TOP}\" width=\"{:.1}\" height=\"{:.1}\"/>",
                to - from,
                bottom - TOP
            );
        }
        let (ticks, places) = vertical.ticks((self.height / 36.0).max(2.0));
        for tick in ticks {
            let y = vertical.place(tick);
            let class = if tick == 0.0 { "zero" } else { "grid" };
            let _ = write!(svg, "<path class=\"{class}\" d=\"M{LEFT} {y:.1}H{right}\"/>");
            let _ = write!(
                svg,
                "<text class=\"tick\" x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>",
                LEFT - 8.0,
                y + 4.0,
                // Rounding may leave -0, and a minus sign is wider than a hyphen.
                format!("{:.places$}", tick + 0.0).replace('-', "−")
            );
        }
        svg.push_str(&time_ticks(time, TOP, bottom));
        for limit in self.limits {
            let _ = write!(svg, "<path class=\"limit\" d=\"M{LEFT} {:.1}H{right}\"/>", vertical.place(*limit));
        }
        for curve in &self.curves {
            let _ =
                write!(svg, "<path class=\"curve {}\" d=\"{}\"/>", curve.class, path(&curve.points, time, &vertical));
        }
        let _ = write!(
            svg,
            "<text class=\"unit\" x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>",
            LEFT - 8.0,
            bottom + 18.0,
            self.unit
        );
        let _ = write!(svg, "<path class=\"pointer\" d=\"M0 {TOP}V{bottom}\"/></svg>");
        svg
    }
}

/// Vertical grid lines with the time below, in milliseconds where all of it is less than a second.
pub(super) fn time_ticks(time: &Axis, top: f64, bottom: f64) -> String {
    let mut svg = String::new();
    let (ticks, places) = time.ticks(9.0);
    let is_short = time.to - time.from < 1.0;
    let (factor, unit, places) = if is_short { (1e3, "ms", places.saturating_sub(3)) } else { (1.0, "s", places) };
    for tick in ticks {
        let x = time.place(tick);
        let _ = write!(svg, "<path class=\"grid\" d=\"M{x:.1} {top}V{bottom}\"/>");
        let _ = write!(
            svg,
            "<text class=\"tick\" x=\"{x:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{} {unit}</text>",
            bottom + 17.0,
            // As above.
            format!("{:.places$}", tick * factor + 0.0).replace('-', "−")
        );
    }
    svg
}

/// The curve with at most four points in each column one unit wide: first, lowest, highest, last.
fn path(points: &[(f64, f64)], time: &Axis, vertical: &Axis) -> String {
    let mut places: Vec<(f64, f64)> = Vec::new();
    let mut column: Vec<(f64, f64)> = Vec::new();
    let placed = points
        .iter()
        .filter(|point| point.0.is_finite() && point.1.is_finite())
        .map(|point| (time.place(point.0), vertical.place(point.1)));
    for place in placed {
        if column.first().is_some_and(|first| first.0.floor() != place.0.floor()) {
            places.extend(outline(&column));
            column.clear();
        }
        column.push(place);
    }
    places.extend(outline(&column));
    let mut path = String::new();
    for (index, (x, y)) in places.iter().enumerate() {
        let _ = write!(path, "{}{x:.1} {y:.1}", if index == 0 { 'M' } else { 'L' });
    }
    path
}

/// First, lowest, highest and last point of a column, in order of time, each once.
fn outline(column: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let extreme = |better: fn(f64, f64) -> bool| {
        (0..column.len()).reduce(|best, index| if better(column[index].1, column[best].1) { index } else { best })
    };
    let Some(last) = column.len().checked_sub(1) else { return Vec::new() };
    let mut kept: Vec<usize> =
        [Some(0), extreme(|a, b| a < b), extreme(|a, b| a > b), Some(last)].into_iter().flatten().collect();
    kept.sort_unstable();
    kept.dedup();
    kept.into_iter().map(|index| column[index]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn axis(from: f64, to: f64) -> Axis {
        Axis { from, to, start: 0.0, end: 100.0 }
    }

    #[test]
    fn ticks_are_round_and_inside_the_axis() {
        assert_eq!(axis(0.0, 10.0).ticks(5.0), (vec![0.0, 2.0, 4.0, 6.0, 8.0, 10.0], 0));
        let (ticks, places) = axis(-0.053, 0.053).ticks(5.0);
        assert_eq!(places, 2);
        assert_eq!(
            ticks.iter().map(|tick| format!("{tick:.2}")).collect::<Vec<_>>(),
            ["-0.04", "-0.02", "0.00", "0.02", "0.04"]
        );
        assert_eq!(axis(4.4, 9.4).ticks(9.0).1, 1);
        assert_eq!(axis(0.0, 9.0).ticks(9.0).1, 0);
        assert_eq!(axis(0.0, 0.01).ticks(1.0).1, 2);
    }

    #[test]
    fn values_without_span_still_make_an_axis() {
        let flat = Axis::of_values([3.0, 3.0].into_iter(), 100.0);
        assert!(flat.from < 3.0 && flat.to > 3.0);
        let empty = Axis::of_values(std::iter::empty(), 100.0);
        assert!(empty.place(0.5).is_finite());
    }

    #[test]
    fn a_column_keeps_its_peaks() {
        let points: Vec<(f64, f64)> =
            (0..10_000).map(|index| (f64::from(index) / 10_000.0, if index == 5_003 { 1.0 } else { 0.0 })).collect();
        let path = path(&points, &axis(0.0, 1.0), &Axis { from: 0.0, to: 1.0, start: 100.0, end: 0.0 });
        assert!(path.contains("L50.0 0.0"), "the only peak is drawn");
        assert!(path.matches(['M', 'L']).count() <= 4 * 101);
    }

    #[test]
    fn values_that_are_no_numbers_leave_gaps_not_garbage() {
        let points = [(0.0, 0.0), (0.5, f64::NAN), (1.0, 1.0)];
        assert_eq!(path(&points, &axis(0.0, 1.0), &axis(0.0, 1.0)), "M0.0 0.0L100.0 100.0");
    }
}
