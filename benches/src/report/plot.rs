//! Plots as SVG, drawn without a library: points with bars from least to greatest, lines, axes with round ticks, a legend.

use std::fmt::Write as _;

use super::{
    model::{Axis, Plot, Point, Series},
    samples::number,
};

/// Width and height of the picture, and the margins of the area of the points: left, top, right, bottom.
const SIZE: [f64; 2] = [860.0, 420.0];
const MARGINS: [f64; 4] = [70.0, 14.0, 14.0, 48.0];

/// Height of a line of the legend.
const LINE: f64 = 18.0;

/// Colors of series, from the Okabe-Ito palette; further series have hollow marks.
const COLORS: [&str; 7] = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00", "#000000"];

/// Draws a plot.
pub(super) fn svg(plot: &Plot) -> String {
    let [width, height] = SIZE;
    let [left, top, right, bottom] = MARGINS;
    let points = || plot.series.iter().flat_map(|series| shown(plot, series));
    let [x, y] = [
        Scale::over(points().flat_map(|point| point.x.range()), plot.x.is_log),
        Scale::over(points().flat_map(|point| point.y.range()), plot.y.is_log),
    ];
    let at_x = |value: f64| left + x.position(value) * (width - left - right);
    let at_y = |value: f64| height - bottom - y.position(value) * (height - top - bottom);
    let whole = height + LINE * plot.series.len() as f64 + 8.0;
    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {whole}\" font-family=\"sans-serif\" font-size=\"12\">\n\
         <rect width=\"{width}\" height=\"{whole}\" fill=\"white\"/>\n"
    );
    let line = |out: &mut String, [x1, y1, x2, y2]: [f64; 4], color: &str| {
        let _ = writeln!(out, "<line x1=\"{x1:.1}\" y1=\"{y1:.1}\" x2=\"{x2:.1}\" y2=\"{y2:.1}\" stroke=\"{color}\"/>");
    };
    let text = |out: &mut String, [x, y]: [f64; 2], attributes: &str, text: &str| {
        let _ = writeln!(out, "<text x=\"{x:.1}\" y=\"{y:.1}\" {attributes}>{}</text>", escaped(text));
    };
    for tick in x.ticks(9) {
        line(&mut out, [at_x(tick), top, at_x(tick), height - bottom], "#dddddd");
        text(&mut out, [at_x(tick), height - bottom + 16.0], "text-anchor=\"middle\"", &label(tick));
    }
    for tick in y.ticks(6) {
        line(&mut out, [left, at_y(tick), width - right, at_y(tick)], "#dddddd");
        text(&mut out, [left - 6.0, at_y(tick) + 4.0], "text-anchor=\"end\"", &label(tick));
    }
    line(&mut out, [left, top, left, height - bottom], "black");
    line(&mut out, [left, height - bottom, width - right, height - bottom], "black");
    let middle = [0.5 * (left + width - right), 0.5 * (top + height - bottom)];
    text(&mut out, [middle[0], height - 8.0], "text-anchor=\"middle\"", &plot.x.label);
    let turned = format!("text-anchor=\"middle\" transform=\"rotate(-90 16 {:.1})\"", middle[1]);
    text(&mut out, [16.0, middle[1]], &turned, &plot.y.label);
    for (number, series) in plot.series.iter().enumerate() {
        let color = COLORS[number % COLORS.len()];
        let fill = if (number / COLORS.len()).is_multiple_of(2) { color } else { "white" };
        if series.is_joined {
            let path: Vec<String> = shown(plot, series)
                .map(|point| format!("{:.1},{:.1}", at_x(point.x.median()), at_y(point.y.median())))
                .collect();
            let path = path.join(" ");
            let _ = writeln!(out, "<polyline points=\"{path}\" fill=\"none\" stroke=\"{color}\" stroke-width=\"2\"/>");
        }
        for point in shown(plot, series) {
            let (px, py) = (at_x(point.x.median()), at_y(point.y.median()));
            let ([x1, x2], [y1, y2]) = (point.x.range().map(at_x), point.y.range().map(at_y));
            line(&mut out, [x1, py, x2, py], color);
            line(&mut out, [px, y1, px, y2], color);
            let _ = writeln!(
                out,
                "<circle cx=\"{px:.1}\" cy=\"{py:.1}\" r=\"4\" fill=\"{fill}\" stroke=\"{color}\" \
                 stroke-width=\"2\"><title>{}</title></circle>",
                escaped(&title(plot, series, point))
            );
        }
        let y = height + LINE * (number as f64 + 0.5);
        let _ = writeln!(
            out,
            "<circle cx=\"{:.1}\" cy=\"{y:.1}\" r=\"4\" fill=\"{fill}\" stroke=\"{color}\" stroke-width=\"2\"/>",
            left + 4.0
        );
        text(&mut out, [left + 16.0, y + 4.0], "", &series.name);
    }
    out + "</svg>\n"
}

/// The points of a series that both axes can show.
fn shown<'a>(plot: &'a Plot, series: &'a Series) -> impl Iterator<Item = &'a Point> {
    let fits = |axis: &Axis, value: f64| is_shown(value, axis.is_log);
    series.points.iter().filter(move |point| fits(&plot.x, point.x.median()) && fits(&plot.y, point.y.median()))
}

/// Series name, label and both values of a point.
fn title(plot: &Plot, series: &Series, point: &Point) -> String {
    let label = if point.label.is_empty() { String::new() } else { format!(", {}", point.label) };
    format!("{}{label}: {} {}; {} {}", series.name, plot.x.label, point.x, plot.y.label, point.y)
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// Smallest value on a logarithmic axis: smaller ones come from underflow.
const LEAST: f64 = 1e-300;

/// Whether a value can be shown on an axis.
fn is_shown(value: f64, is_log: bool) -> bool {
    value.is_finite() && (!is_log || value >= LEAST)
}

/// The ends of an axis, slightly beyond its values.
struct Scale {
    low: f64,
    high: f64,
    is_log: bool,
}

impl Scale {
    /// The axis for `values`, ignoring those that cannot be shown.
    fn over(values: impl Iterator<Item = f64>, is_log: bool) -> Self {
        let shown = values.filter(|x| is_shown(*x, is_log)).map(|x| if is_log { x.log10() } else { x });
        let (low, high) = shown.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)));
        let (low, high) = if low <= high { (low, high) } else { (0.0, 1.0) };
        let margin = if high > low { 0.05 * (high - low) } else { 0.5 * low.abs().max(0.2) };
        Self { low: low - margin, high: high + margin, is_log }
    }

    /// 0 at the low end, 1 at the high end; clamped for values outside.
    fn position(&self, value: f64) -> f64 {
        let along = if self.is_log { value.max(LEAST).log10() } else { value };
        ((along - self.low) / (self.high - self.low)).clamp(0.0, 1.0)
    }

    /// The minimum and maximum value.
    fn ends(&self) -> [f64; 2] {
        [self.low, self.high].map(|x| if self.is_log { 10f64.powf(x) } else { x })
    }

    /// Round tick values, about `n` at most.
    fn ticks(&self, n: u32) -> Vec<f64> {
        let n = f64::from(n.max(2));
        let span = self.high - self.low;
        if self.is_log && span >= 1.5 {
            let step = (span / n).ceil();
            return steps(self.low, self.high, step).map(|exponent| 10f64.powf(exponent)).collect();
        }
        let [low, high] = self.ends();
        if self.is_log {
            // Within two powers of ten: 1, 2 and 5 of each.
            let decades = steps(self.low.floor(), self.high, 1.0);
            let all = decades.flat_map(|exponent| [1.0, 2.0, 5.0].map(|digit| digit * 10f64.powf(exponent)));
            let all: Vec<f64> = all.filter(|x| (low..=high).contains(x)).collect();
            if all.len() >= 2 {
                return all;
            }
        }
        let rough = (high - low) / n;
        let power = 10f64.powf(rough.log10().floor());
        let step = [1.0, 2.0, 5.0, 10.0].map(|digit| digit * power).into_iter().find(|step| *step >= rough);
        steps(low, high, step.unwrap_or(rough)).collect()
    }
}

/// Multiples of `step` from `low` to `high`.
fn steps(low: f64, high: f64, step: f64) -> impl Iterator<Item = f64> {
    let first = (low / step).ceil();
    (0..100).map(move |i| (first + f64::from(i)) * step).take_while(move |x| *x <= high)
}

/// A short tick label.
fn label(value: f64) -> String {
    let text = number(value);
    if let Some((digits, exponent)) = text.split_once('e') {
        return format!("{}e{exponent}", short(digits));
    }
    if value.abs() >= 100.0 { text } else { short(&text).to_owned() }
}

/// Removes trailing zeros after the decimal point.
fn short(text: &str) -> &str {
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_in_range() {
        let scale = Scale::over([1e-5, 3.0].into_iter(), true);
        assert_eq!(
            scale.ticks(7).iter().map(|x| label(*x)).collect::<Vec<_>>(),
            ["1e-5", "1e-4", "0.001", "0.01", "0.1", "1"]
        );
        let scale = Scale::over([0.0, 97.0].into_iter(), false);
        assert_eq!(scale.ticks(5), [0.0, 50.0, 100.0]);
        let scale = Scale::over([2.0, 3.0].into_iter(), true);
        assert!(scale.ticks(5).len() >= 2);
    }

    #[test]
    fn single_values_and_none_have_an_axis() {
        for values in [vec![], vec![0.0], vec![5.0]] {
            for is_log in [false, true] {
                let scale = Scale::over(values.iter().copied(), is_log);
                assert!(scale.position(1.0).is_finite() && !scale.ticks(4).is_empty(), "{values:?}");
            }
        }
    }

    #[test]
    fn values_off_the_axis_are_hidden_and_clamped() {
        for (value, is_log, shown) in [
            (1e-308, true, false),
            (-1.0, true, false),
            (0.0, true, false),
            (-1.0, false, true),
            (f64::NAN, false, false),
        ] {
            assert_eq!(is_shown(value, is_log), shown, "{value}");
        }
        let scale = Scale::over([1e-308, -2.0, 1.0, 100.0].into_iter(), true);
        assert!(scale.ends()[0] > 0.5, "{:?}", scale.ends());
        assert_eq!([1e-308, -2.0, 1e9].map(|x| scale.position(x)), [0.0, 0.0, 1.0]);
    }

    #[test]
    fn labels_are_short() {
        for (value, text) in [(0.5, "0.5"), (20.0, "20"), (1e-7, "1e-7"), (2e6, "2e6"), (1000.0, "1000")] {
            assert_eq!(label(value), text);
        }
    }

    fn point(x: f64) -> Point {
        Point { label: "<p>".to_owned(), x: x.into(), y: vec![x, 2.0 * x].into() }
    }

    #[test]
    fn every_point_on_the_axes_is_a_circle_with_a_title() {
        let points = [1.0, 2.0, -1.0, 1e-308].map(point).into();
        let series = vec![Series { name: "a".to_owned(), points, is_joined: true }];
        let svg = svg(&Plot { title: "t".to_owned(), x: Axis::log("n"), y: Axis::linear("s"), series });
        assert_eq!(svg.matches("<title>").count(), 2);
        assert!(svg.contains("<title>a, &lt;p&gt;: n 1.00; s 1.50 ±33.3%</title>"), "{svg}");
        assert!(svg.starts_with("<svg") && svg.ends_with("</svg>\n"), "{svg}");
    }
}
