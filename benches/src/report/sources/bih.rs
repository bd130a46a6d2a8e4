//! Structures rebuilt for every picture: the BIH thesis's table 1, and its two charts.

mod leaves;

use anyhow::Result;
use canted_kdtree::Traversal;
use canted_sah::Builder;
use canted_wide::Preset;

use super::builders::scaffold;
use super::orders::Found;
use super::scenes;
use super::structures::{Kind, SWEPT, Took, measure};
use crate::models::Model;
use crate::report::{
    effort::Effort,
    model::{Axis, Cell, Chapter, Plot, Point, Series, Table},
    samples::{Samples, first, number},
};

/// Table 1: scene, triangles, and build and trace milliseconds of a BIH with leaves of up to 1, 5 and 10, and of a
/// kd-tree with ropes.
const THEIRS: [(&str, usize, [[f64; 2]; 4]); 3] = [
    ("Hornbug", 1_800, [[1.7, 15.0], [0.8, 13.5], [0.6, 13.5], [12.3, 7.2]]),
    ("Alien", 32_000, [[30.5, 47.5], [14.5, 41.5], [11.7, 41.3], [180.0, 36.0]]),
    ("Dino", 107_000, [[120.0, 47.0], [67.0, 42.0], [54.0, 44.0], [672.0, 22.3]]),
];

const STRUCTURES: [&str; 4] = ["BIH, leaves of 1", "BIH, leaves of 5", "BIH, leaves of 10", "kd-tree with ropes"];

/// Our structures of table 1; the first four are theirs.
const OURS: [Kind; 10] = [
    Kind::Bih(1),
    Kind::Bih(5),
    Kind::Bih(10),
    Kind::KdTree(Traversal::Ropes),
    Kind::Bih(0),
    Kind::KdTree(Traversal::Stack),
    Kind::Binary(Builder::Lbvh),
    SWEPT,
    Kind::Wide(Preset::Dynamic),
    Kind::Wide(Preset::Balanced),
];

pub(super) fn add(chapter: &mut Chapter, effort: Effort) -> Result<Found> {
    let found = table_1(chapter, effort)?;
    leaves::charts(chapter, effort)?;
    Ok(found)
}

fn table_1(chapter: &mut Chapter, effort: Effort) -> Result<Found> {
    let head = ["source", "scene", "triangles", "structure", "build", "picture", "both", "pictures per second"];
    let bytes = ["nodes", "references", "triangles, bytes"];
    let mut table = Table::new(
        "Structures rebuilt for each picture (the BIH thesis's table 1)",
        &head.into_iter().chain(bytes).collect::<Vec<_>>(),
    );
    let mut row =
        |[source, scene, n, structure]: [&str; 4], [build, picture]: [Samples; 2], bytes: Option<[usize; 3]>| {
            let both = build.with(&picture, |a, b| a + b);
            let mut cells = [source, scene, n, structure].map(Cell::text).to_vec();
            let rate = number(1e3 / both.median());
            cells.extend([build, picture, both].map(|samples| Cell::measured(samples, "ms")));
            cells.push(Cell::text(rate));
            cells.extend((0..3).map(|i| Cell::text(bytes.map_or_else(|| "–".to_owned(), |bytes| megabytes(bytes[i])))));
            table.rows.push(cells);
        };
    let ours = OURS.iter().map(|kind| kind.name());
    let mut series: Vec<Series> = std::iter::once("BIH thesis".to_owned())
        .chain(ours)
        .map(|name| Series { name, points: vec![], is_joined: false })
        .collect();
    for (scene, n, structures) in THEIRS {
        for (structure, [build, picture]) in STRUCTURES.into_iter().zip(structures) {
            row(["BIH thesis", scene, &n.to_string(), structure], [build.into(), picture.into()], None);
            let label = format!("{scene}, {structure}");
            series[0].points.push(Point { label, x: build.into(), y: picture.into() });
        }
    }
    let (mut found, mut first_of, mut gains) = (Found::default(), vec![], vec![]);
    for (name, model, theirs) in subjects_of(chapter, effort)? {
        let n = model.mesh.triangles.len();
        let took = measure(&model, &OURS, effort)?;
        if let Some(theirs) = theirs {
            let pairs = |of: fn(&Took) -> f64, their: fn([f64; 2]) -> f64| {
                theirs.into_iter().zip(&took).map(|(theirs, took)| [their(theirs), of(took)]).collect::<Vec<_>>()
            };
            found.compared.extend([
                pairs(|took| took.build.median(), |[build, _]| build),
                pairs(|took| took.picture.median(), |[_, picture]| picture),
                pairs(|took| took.both().median(), |[build, picture]| build + picture),
            ]);
        }
        let [one, ropes] = [&took[0], &took[3]];
        gains.push(format!(
            "{} of {n} triangles {} and {} times",
            name,
            number(ropes.build.median() / one.build.median()),
            number(one.picture.median() / ropes.picture.median())
        ));
        let names: Vec<String> = took.iter().map(|took| took.kind.name()).collect();
        let both: Vec<(&str, Samples)> = names.iter().map(|name| &name[..]).zip(took.iter().map(Took::both)).collect();
        first_of.push(format!("{name} of {n} triangles with {} ({} among theirs)", first(&both), first(&both[..4])));
        for ((took, structure), series) in took.into_iter().zip(&names).zip(&mut series[1..]) {
            let label = format!("{name}, {n} triangles");
            series.points.push(Point { label, x: took.build.clone(), y: took.picture.clone() });
            row(["ours", name, &n.to_string(), structure], [took.build, took.picture], Some(took.bytes));
        }
    }
    found.says = format!("Rebuilt for each picture, fastest are {}; in the thesis the BIH.", first_of.join("; "));
    table.says = format!(
        "The thesis: a BIH with leaves of 1 builds 5.6 to 7.2 times as fast as a kd-tree with ropes and traces at most 2.1 times as slowly. Here, built so \
         much faster and traced so much slower: {}.",
        gains.join(", ")
    );
    chapter.tables.push(table);
    chapter.plots.push(Plot {
        title: "Structures rebuilt for each picture: picture over build".to_owned(),
        x: Axis::log("build, ms"),
        y: Axis::log("picture, ms"),
        series,
    });
    Ok(found)
}

fn megabytes(bytes: usize) -> String {
    #[expect(clippy::cast_precision_loss, reason = "bytes are fewer than 2^53")]
    let bytes = bytes as f64;
    format!("{} MB", number(bytes * 1e-6))
}

/// A scene, its model, and the thesis's times of a scene with as many triangles.
type Subject = (&'static str, Model, Option<[[f64; 2]; 4]>);

/// Scaffolds of their sizes, and their models that are available.
fn subjects_of(chapter: &mut Chapter, effort: Effort) -> Result<Vec<Subject>> {
    let sizes = effort.pick(&[8][..], &[11, 15, 17], &[11, 15, 17]);
    let mut all: Vec<Subject> =
        sizes.iter().zip(THEIRS).map(|(&log2, (.., theirs))| ("scaffold", scaffold(log2), Some(theirs))).collect();
    let names = effort.pick(&[][..], &["bunny"], &["bunny", "dragon_871k"]);
    if !names.is_empty() {
        all.extend(scenes(effort, names, chapter)?.into_iter().map(|(name, model)| (name, model, None)));
    }
    Ok(all)
}
