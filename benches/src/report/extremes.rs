//! Extremes: the numerical contract, case by case, for us and for peers on the same input.

use anyhow::Result;
use canted_tests::{
    extremes::{self, Row},
    tracers,
};

use super::effort::Effort;
use super::model::{Axis, Cell, Chapter, Plot, Point, Series, Table};
use crate::wide;

/// Tests every promise.
pub(super) fn chapter(effort: Effort) -> Result<Chapter> {
    let mut chapter = Chapter { id: "extremes", title: "Extremes: the numerical contract", ..Chapter::default() };
    let (mut methods, missing) = tracers::ours();
    chapter.skipped.extend(extremes::not_tried(&missing).into_iter().map(|what| format!("{what}.")));
    chapter.skipped.extend(wide::skipped_peers().into_iter().map(|peer| format!("{peer}.")));
    methods.extend(wide::peers());
    let rows = extremes::rows(effort.pick(1, 1, 4), &methods);
    let ours: Vec<&Row> = rows.iter().filter(|row| row.is_promise()).collect();
    chapter.says = extremes::summary(&rows);
    chapter.method = METHOD.map(str::to_owned).to_vec();
    chapter.plots = vec![used(&ours)];
    let mut stages: Vec<&'static str> = vec![];
    for row in &rows {
        if !stages.contains(&row.promise.stage) {
            stages.push(row.promise.stage);
        }
    }
    for stage in stages {
        let head = ["case", "promise", "reference", "bound", "worst of ours", "peers"];
        let mut table = Table::new(stage, &head);
        let of_stage: Vec<Row> = rows.iter().filter(|row| row.promise.stage == stage).cloned().collect();
        let lines = extremes::lines(&of_stage);
        table.rows = lines.into_iter().map(|line| line[1..].iter().map(Cell::text).collect()).collect();
        chapter.tables.push(table);
    }
    Ok(chapter)
}

/// What a logarithmic axis shows for zero error.
const LEAST_SHARE: f64 = 1e-6;

/// The share of its bound that each promise uses, if the bound is not zero: at most one if kept.
fn used(ours: &[&Row]) -> Plot {
    let mut series: Vec<Series> = vec![];
    for row in ours.iter().filter(|row| row.promise.bound > 0.0) {
        let name = row.promise.stage;
        let point = Point {
            label: format!("{}: {}, {}", row.promise.case, row.promise.promise, row.routine),
            x: row.promise.bound.into(),
            y: (row.worst / row.promise.bound).max(LEAST_SHARE).into(),
        };
        match series.iter_mut().find(|series| series.name == name) {
            Some(series) => series.points.push(point),
            None => series.push(Series { name: name.to_owned(), points: vec![point], is_joined: false }),
        }
    }
    Plot {
        title: "Share of the bound that each promise uses".to_owned(),
        x: Axis::log("bound, in units of the promise"),
        y: Axis::log("worst over bound"),
        series,
    }
}

const METHOD: [&str; 2] = [
    "Each line is one promise on one kind of input, over the inputs that its reference decides with certainty. A count is \
     the number of failed inputs; any other value is the worst over all inputs, followed by the routines it belongs to. The \
     bound 'reported' promises nothing: the value is for information, or no input is certain. A test of the workspace \
     asserts every line of ours; no value depends on a clock.",
    "Peers promise nothing here: their values are shown because their users requested the same, and a peer may decide an \
     edge differently. Queries that the driver ended early on a device are answered by the CPU.",
];
