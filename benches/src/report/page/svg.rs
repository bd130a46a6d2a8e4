//! A plot as SVG, in colours that the page's style sheet gives.

use anyhow::{Result, anyhow};
use plotters::coord::ranged1d::{KeyPointHint, NoDefaultFormatting, Ranged};
use plotters::prelude::{ChartBuilder, Circle, DrawingArea, IntoDrawingArea, PathElement, RGBColor, SVGBackend};
use plotters::style::{Color, IntoFont, ShapeStyle, TextStyle};

use super::axis::Scale;
use crate::report::model::{Plot, Point, Series};

/// Width and height in pixels, for screens that are wide and for phones.
pub(super) const SIZES: [(&str, [u32; 2]); 2] = [("wide", [860, 420]), ("narrow", [312, 320])];

/// Height of letters as the drawing library counts it; browsers show four fifths of it.
const FONT_SIZE: u32 = 15;

/// Colours that stand for those of the style sheet, which selects them by their value.
const INK: RGBColor = RGBColor(1, 1, 1);
const GRID: RGBColor = RGBColor(2, 2, 2);

/// Colours of the style sheet; further series take the same in hollow marks.
pub(super) const N_COLORS: usize = 7;

/// Where a series' mark stands in the palette, and whether it is hollow.
pub(super) fn mark(series: usize) -> (usize, bool) {
    (series % N_COLORS, (series / N_COLORS) % 2 == 1)
}

fn color(series: usize) -> RGBColor {
    #[expect(clippy::cast_possible_truncation, reason = "below the number of colours")]
    let number = mark(series).0 as u8;
    RGBColor(3, 3, 10 + number)
}

/// An axis over exponents or plain numbers, with its own ticks.
struct Ticked {
    scale: Scale,
    ticks: Vec<f64>,
}

impl Ranged for Ticked {
    type FormatOption = NoDefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, (low, high): (i32, i32)) -> i32 {
        let place = f64::from(low) + self.scale.place(*value) * f64::from(high - low);
        #[expect(clippy::cast_possible_truncation, reason = "pixels of a picture")]
        let pixel = place.round() as i32;
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

/// Draws a plot.
pub(super) fn svg(plot: &Plot, [width, height]: [u32; 2]) -> Result<String> {
    let mut out = String::new();
    let area = SVGBackend::with_string(&mut out, (width, height)).into_drawing_area();
    draw(plot, &area, width).map_err(|error| anyhow!("cannot draw '{}': {error}", plot.title))?;
    drop(area);
    Ok(out)
}

fn draw(plot: &Plot, area: &DrawingArea<SVGBackend, plotters::coord::Shift>, width: u32) -> Result<()> {
    let points = || plot.series.iter().flat_map(|series| &series.points);
    let [x, y] = [
        Scale::over(points().flat_map(|point| point.x.range()), plot.x.is_log),
        Scale::over(points().flat_map(|point| point.y.range()), plot.y.is_log),
    ];
    let [columns, rows] = [width / 90, 6];
    let mut chart = ChartBuilder::on(area)
        .margin(6)
        .margin_right(18)
        .x_label_area_size(46)
        .y_label_area_size(64)
        .build_cartesian_2d(Ticked { ticks: x.ticks(columns), scale: x }, Ticked { ticks: y.ticks(rows), scale: y })
        .map_err(|error| anyhow!("{error}"))?;
    let text = TextStyle::from(("sans-serif", FONT_SIZE).into_font()).color(&INK);
    chart
        .configure_mesh()
        .axis_style(INK)
        .bold_line_style(GRID)
        .light_line_style(GRID)
        .label_style(text.clone())
        .axis_desc_style(text)
        .x_desc(&plot.x.label)
        .y_desc(&plot.y.label)
        .draw()
        .map_err(|error| anyhow!("{error}"))?;
    for (number, series) in plot.series.iter().enumerate() {
        chart.draw_series(bars(series, color(number))).map_err(|error| anyhow!("{error}"))?;
        if series.is_joined {
            let line = series.points.iter().map(place).collect::<Vec<_>>();
            chart
                .draw_series([PathElement::new(line, color(number).stroke_width(2))])
                .map_err(|error| anyhow!("{error}"))?;
        }
        let style = ShapeStyle { color: color(number).to_rgba(), filled: !mark(number).1, stroke_width: 2 };
        let marks = series.points.iter().map(|point| Circle::new(place(point), 4, style));
        chart.draw_series(marks).map_err(|error| anyhow!("{error}"))?;
    }
    area.present().map_err(|error| anyhow!("{error}"))
}

fn place(point: &Point) -> (f64, f64) {
    (point.x.median(), point.y.median())
}

/// From least to greatest, along both axes.
fn bars(series: &Series, color: RGBColor) -> impl Iterator<Item = PathElement<(f64, f64)>> {
    series.points.iter().flat_map(move |point| {
        let ((x, y), [left, right], [low, high]) = (place(point), point.x.range(), point.y.range());
        [vec![(left, y), (right, y)], vec![(x, low), (x, high)]]
            .map(|ends| PathElement::new(ends, color.stroke_width(1)))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::model::Axis;

    #[test]
    fn every_point_is_a_circle() {
        let point = |x: f64| Point { label: String::new(), x: x.into(), y: vec![x, 2.0 * x].into() };
        let series = |n: i32| Series {
            name: "a".to_owned(),
            points: (1..=n).map(|x| point(f64::from(x))).collect(),
            is_joined: n > 2,
        };
        let plot =
            Plot { title: "t".to_owned(), x: Axis::log("x"), y: Axis::linear("y"), series: vec![series(3), series(1)] };
        for (_, size) in SIZES {
            let svg = svg(&plot, size).unwrap();
            assert_eq!(svg.matches("<circle").count(), 4);
            assert!(svg.starts_with("<svg") && svg.ends_with("</svg>\n"), "{svg}");
        }
    }
}
