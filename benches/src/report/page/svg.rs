//! Plots as SVG, with colors from the page's style sheet.

use anyhow::{Context as _, Result, anyhow, ensure};
use plotters::coord::ranged1d::{KeyPointHint, NoDefaultFormatting, Ranged};
use plotters::prelude::{ChartBuilder, Circle, DrawingArea, IntoDrawingArea, PathElement, RGBColor, SVGBackend};
use plotters::style::{Color, IntoFont, ShapeStyle, TextStyle};

use super::{
    axis::{self, Scale},
    escaped, text,
};
use crate::report::model::{Plot, Point, Series};

/// Width and height in pixels, for screens that are wide and for phones.
pub(super) const SIZES: [(&str, [u32; 2]); 2] = [("wide", [860, 420]), ("narrow", [312, 320])];

/// Font size of the drawing library; browsers show four fifths of it.
const FONT_SIZE: u32 = 15;

/// Placeholder colors, which the style sheet selects by value.
const INK: RGBColor = RGBColor(1, 1, 1);
const GRID: RGBColor = RGBColor(2, 2, 2);

/// Number of series colors; further series use the same colors with hollow marks.
pub(super) const N_COLORS: usize = 7;

/// The color index of a series, and whether its mark is hollow.
pub(super) fn mark(series: usize) -> (usize, bool) {
    (series % N_COLORS, (series / N_COLORS) % 2 == 1)
}

fn color(series: usize) -> RGBColor {
    #[expect(clippy::cast_possible_truncation, reason = "below the number of colors")]
    let number = mark(series).0 as u8;
    RGBColor(3, 3, 10 + number)
}

/// A linear or logarithmic axis with its own ticks.
struct Ticked {
    scale: Scale,
    ticks: Vec<f64>,
}

impl Ranged for Ticked {
    type FormatOption = NoDefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, (low, high): (i32, i32)) -> i32 {
        let position = f64::from(low) + self.scale.position(*value) * f64::from(high - low);
        #[expect(clippy::cast_possible_truncation, reason = "pixels of a picture")]
        let pixel = position.round() as i32;
        pixel
    }

    fn key_points<H: KeyPointHint>(&self, hint: H) -> Vec<f64> {
        if hint.weight().allow_light_points() { vec![] } else { self.ticks.clone() }
    }

    fn range(&self) -> std::ops::Range<f64> {
        let [low, high] = self.scale.ends();
        low..high
    }
}

impl plotters::coord::ranged1d::ValueFormatter<f64> for Ticked {
    fn format(value: &f64) -> String {
        super::axis::label(*value)
    }
}

/// Whether a point can be shown on both axes.
pub(super) fn is_shown(plot: &Plot, point: &Point) -> bool {
    let (x, y) = position(point);
    axis::is_shown(x, plot.x.is_log) && axis::is_shown(y, plot.y.is_log)
}

/// The points of a series that are drawn.
fn shown<'a>(plot: &'a Plot, series: &'a Series) -> impl Iterator<Item = &'a Point> {
    series.points.iter().filter(|point| is_shown(plot, point))
}

/// Draws a plot.
pub(super) fn svg(plot: &Plot, size: [u32; 2]) -> Result<String> {
    let [width, height] = size;
    let mut out = String::new();
    let area = SVGBackend::with_string(&mut out, (width, height)).into_drawing_area();
    draw(plot, &area, width).map_err(|error| anyhow!("cannot draw '{}': {error}", plot.title))?;
    drop(area);
    text::fitted(&titled(plot, &out)?, size).with_context(|| format!("cannot draw '{}'", plot.title))
}

/// Adds a title to each circle, which browsers show as a tooltip; the drawing library does not support titles.
fn titled(plot: &Plot, svg: &str) -> Result<String> {
    let titles: Vec<String> =
        plot.series.iter().flat_map(|series| shown(plot, series).map(|point| title(plot, series, point))).collect();
    let mut pieces = svg.split("<circle");
    let mut out = pieces.next().unwrap_or_default().to_owned();
    let circles: Vec<(&str, &str)> = pieces.filter_map(|piece| piece.split_once("/>")).collect();
    ensure!(
        circles.len() == titles.len(),
        "'{}' has {} circles for {} points",
        plot.title,
        circles.len(),
        titles.len()
    );
    for ((attributes, rest), title) in circles.into_iter().zip(titles) {
        out += &format!("<circle{attributes}><title>{}</title></circle>{rest}", escaped(&title));
    }
    Ok(out)
}

/// Series name, label and both values of a point.
fn title(plot: &Plot, series: &Series, point: &Point) -> String {
    let label = if point.label.is_empty() { String::new() } else { format!(", {}", point.label) };
    format!("{}{label}: {} {}; {} {}", series.name, plot.x.label, point.x, plot.y.label, point.y)
}

fn draw(plot: &Plot, area: &DrawingArea<SVGBackend, plotters::coord::Shift>, width: u32) -> Result<()> {
    let points = || plot.series.iter().flat_map(|series| shown(plot, series));
    let [x, y] = [
        Scale::over(points().flat_map(|point| point.x.range()), plot.x.is_log),
        Scale::over(points().flat_map(|point| point.y.range()), plot.y.is_log),
    ];
    let [columns, rows] = [width / 90, 6];
    let mut chart = ChartBuilder::on(area)
        .margin(6)
        .margin_top(12)
        .margin_right(18)
        .x_label_area_size(46)
        .y_label_area_size(64)
        .build_cartesian_2d(Ticked { ticks: x.ticks(columns), scale: x }, Ticked { ticks: y.ticks(rows), scale: y })
        .map_err(|error| anyhow!("{error}"))?;
    let style = TextStyle::from(("sans-serif", FONT_SIZE).into_font()).color(&INK);
    chart
        .configure_mesh()
        .axis_style(INK)
        .bold_line_style(GRID)
        .light_line_style(GRID)
        .label_style(style.clone())
        .axis_desc_style(style)
        .x_desc(&plot.x.label)
        .y_desc(&plot.y.label)
        .draw()
        .map_err(|error| anyhow!("{error}"))?;
    for (number, series) in plot.series.iter().enumerate() {
        chart.draw_series(bars(shown(plot, series), color(number))).map_err(|error| anyhow!("{error}"))?;
        if series.is_joined {
            let line = shown(plot, series).map(position).collect::<Vec<_>>();
            chart
                .draw_series([PathElement::new(line, color(number).stroke_width(2))])
                .map_err(|error| anyhow!("{error}"))?;
        }
        let style = ShapeStyle { color: color(number).to_rgba(), filled: !mark(number).1, stroke_width: 2 };
        let marks = shown(plot, series).map(|point| Circle::new(position(point), 4, style));
        chart.draw_series(marks).map_err(|error| anyhow!("{error}"))?;
    }
    area.present().map_err(|error| anyhow!("{error}"))
}

fn position(point: &Point) -> (f64, f64) {
    (point.x.median(), point.y.median())
}

/// Bars from minimum to maximum along both axes.
fn bars<'a>(points: impl Iterator<Item = &'a Point>, color: RGBColor) -> impl Iterator<Item = PathElement<(f64, f64)>> {
    points.flat_map(move |point| {
        let ((x, y), [left, right], [low, high]) = (position(point), point.x.range(), point.y.range());
        [vec![(left, y), (right, y)], vec![(x, low), (x, high)]]
            .map(|ends| PathElement::new(ends, color.stroke_width(1)))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::model::Axis;

    fn point(x: f64) -> Point {
        Point { label: "<p>".to_owned(), x: x.into(), y: vec![x, 2.0 * x].into() }
    }

    fn plot(series: Vec<Series>) -> Plot {
        Plot { title: "t".to_owned(), x: Axis::log("n"), y: Axis::linear("s"), series }
    }

    #[test]
    fn every_point_is_a_circle_with_a_title() {
        let series = |n: i32| Series {
            name: "a".to_owned(),
            points: (1..=n).map(|x| point(f64::from(x))).collect(),
            is_joined: n > 2,
        };
        for (_, size) in SIZES {
            let svg = svg(&plot(vec![series(3), series(1)]), size).unwrap();
            assert_eq!(svg.matches("<circle").count(), 4);
            assert_eq!(svg.matches("<title>a, &lt;p&gt;: n 1.00; s 1.50 ±33.3%</title></circle>").count(), 2, "{svg}");
            assert!(svg.starts_with("<svg") && svg.ends_with("</svg>\n"), "{svg}");
        }
    }

    #[test]
    fn values_off_the_axes_are_not_drawn() {
        let points = [1.0, 2.0, -1.0, 1e-308].map(point).into();
        let plot = plot(vec![Series { name: "a".to_owned(), points, is_joined: true }]);
        let svg = svg(&plot, SIZES[0].1).unwrap();
        assert_eq!(svg.matches("<circle").count(), 2);
    }
}
