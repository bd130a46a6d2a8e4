//! BVHs rebuilt for every picture: the BIH thesis's table 1 and its two charts, as far as their text survives.

use anyhow::Result;
use canted_trace::Watertight;
use canted_wide::{Config, Costs, Preset, TriangleBvh};

use super::builders::{MIDPOINT, RADIX, SWEPT, Took, measure, scaffold};
use super::orders::Found;
use super::passes::one_thread;
use crate::clock;
use crate::report::{
    effort::Effort,
    model::{Axis, Cell, Chapter, Plot, Point, Series, Table},
    samples::{Samples, first, number},
};
use crate::wide::{closest_seconds, sets};

/// Table 1: scene, triangles, and build and trace milliseconds of a BIH with leaves of up to 1, 5 and 10, and of a
/// kd-tree with ropes.
const THEIRS: [(&str, usize, [[f64; 2]; 4]); 3] = [
    ("Hornbug", 1_800, [[1.7, 15.0], [0.8, 13.5], [0.6, 13.5], [12.3, 7.2]]),
    ("Alien", 32_000, [[30.5, 47.5], [14.5, 41.5], [11.7, 41.3], [180.0, 36.0]]),
    ("Dino", 107_000, [[120.0, 47.0], [67.0, 42.0], [54.0, 44.0], [672.0, 22.3]]),
];

const STRUCTURES: [&str; 4] = ["BIH, leaves of 1", "BIH, leaves of 5", "BIH, leaves of 10", "kd-tree with ropes"];

/// The charts: scene, structure, maximum primitives per leaf, pictures per second, megabytes.
const CHARTS: [(&str, &str, &str, &str, &str); 10] = [
    ("Dino", "BIH", "1", "5.9", "–"),
    ("Dino", "BIH", "30", "11.1", "–"),
    ("Alien", "BIH", "1", "12.8", "–"),
    ("Alien", "BIH", "10", "18.9", "–"),
    ("Hornbug", "BIH", "1", "59.9", "–"),
    ("Hornbug", "BIH", "5", "69.9", "–"),
    ("Dragon", "BIH", "1", "–", "26.6"),
    ("Dragon", "BIH", "20", "–", "5.2"),
    ("Dragon", "kd-tree", "–", "–", "14"),
    ("Dragon", "kd-tree with ropes", "–", "–", "41"),
];

/// Our maximum triangles per leaf.
const MOST: [usize; 4] = [1, 4, 8, 32];

pub(super) fn add(chapter: &mut Chapter, effort: Effort) -> Result<Found> {
    let found = table_1(chapter, effort)?;
    charts(chapter, effort)?;
    Ok(found)
}

fn table_1(chapter: &mut Chapter, effort: Effort) -> Result<Found> {
    let mut table = Table::new(
        "BVHs rebuilt for each picture (the BIH thesis's table 1)",
        &["source", "scene", "triangles", "structure", "build", "picture", "both", "pictures per second"],
    );
    let mut row = |[source, scene, n, structure]: [&str; 4], build: Samples, picture: Samples| {
        let both = build.with(&picture, |a, b| a + b);
        let mut cells = [source, scene, n, structure].map(Cell::text).to_vec();
        let rate = number(1e3 / both.median());
        cells.extend([build, picture, both].map(|samples| Cell::measured(samples, "ms")));
        cells.push(Cell::text(rate));
        table.rows.push(cells);
    };
    let mut series: Vec<Series> = ["BIH thesis", MIDPOINT.0, RADIX.0, SWEPT.0]
        .map(|name| Series { name: name.to_owned(), points: vec![], is_joined: false })
        .into();
    for (scene, n, structures) in THEIRS {
        for (structure, [build, picture]) in STRUCTURES.into_iter().zip(structures) {
            row(["BIH thesis", scene, &n.to_string(), structure], build.into(), picture.into());
            let label = format!("{scene}, {structure}");
            series[0].points.push(Point { label, x: build.into(), y: picture.into() });
        }
    }
    let mut found = Found::default();
    for (&log2, (.., theirs)) in effort.pick(&[8][..], &[11, 15, 17], &[11, 15, 17]).iter().zip(THEIRS) {
        let model = scaffold(log2);
        let n = model.mesh.triangles.len();
        let took = measure(&model, &[MIDPOINT, RADIX, SWEPT], effort)?;
        let both = |took: &Took| (took.name, took.build.with(&took.picture, |build, picture| build + picture));
        // Their BIH with leaves of 1 is compared with midpoint splits, their kd-tree with a full SAH sweep.
        let compared = [(theirs[0], &took[0]), (theirs[3], &took[2])]
            .map(|([build, picture], took)| [[build, took.build.median()], [picture, took.picture.median()]]);
        let sum = |[build, picture]: [[f64; 2]; 2]| [build[0] + picture[0], build[1] + picture[1]];
        found.compared.extend([compared.map(|of| of[0]), compared.map(|of| of[1]), compared.map(sum)].map(Vec::from));
        found.says = format!(
            "Rebuilt for each picture, the scaffold of {n} triangles is fastest with {}; theirs with the BIH.",
            first(&took.iter().map(both).collect::<Vec<_>>())
        );
        for (took, series) in took.into_iter().zip(&mut series[1..]) {
            let label = format!("{n} triangles");
            series.points.push(Point { label, x: took.build.clone(), y: took.picture.clone() });
            row(["ours", "scaffold", &n.to_string(), took.name], took.build, took.picture);
        }
    }
    chapter.tables.push(table);
    chapter.plots.push(Plot {
        title: "BVHs rebuilt for each picture: picture over build".to_owned(),
        x: Axis::log("build, ms"),
        y: Axis::log("picture, ms"),
        series,
    });
    Ok(found)
}

/// Chart 1, pictures per second, and chart 2, memory, over the maximum primitives per leaf.
fn charts(chapter: &mut Chapter, effort: Effort) -> Result<()> {
    let mut table = Table::new(
        "Primitives per leaf (the BIH thesis's charts 1 and 2)",
        &["source", "scene", "structure", "maximum per leaf", "pictures per second", "memory"],
    );
    for (scene, structure, most, rate, megabytes) in CHARTS {
        let memory = if megabytes == "–" { megabytes.to_owned() } else { format!("{megabytes} MB") };
        table.rows.push(
            ["BIH thesis", scene, structure, most, rate].into_iter().chain([&memory[..]]).map(Cell::text).collect(),
        );
    }
    let model = scaffold(effort.pick(8, 15, 17));
    let mesh = &model.mesh;
    let usual = Config::preset(Preset::Fast);
    let rays = sets::camera(&model, effort.pick(16, 128, 128));
    let rounds = effort.pick(2, 3, 5);
    let (builds, trees) = one_thread(|| -> Result<_> {
        let (mut builds, mut trees) = (vec![], vec![]);
        for max_leaf in MOST {
            let config = Config { costs: Costs { max_leaf, ..usual.costs }, ..usual };
            let mut ms = vec![];
            for _ in 0..rounds {
                let (tree, took) =
                    clock::time(|| TriangleBvh::<Watertight>::build(&mesh.positions, &mesh.triangles, &config));
                ms.push(took.cpu * 1e3);
                if ms.len() == rounds {
                    trees.push(tree?);
                }
            }
            builds.push(Samples::from(ms));
        }
        Ok((builds, trees))
    })??;
    let bytes: Vec<usize> = trees.iter().map(TriangleBvh::n_bytes).collect();
    let pictures = one_thread(|| closest_seconds(trees, &rays, rounds))?;
    for (((max_leaf, build), picture), n_bytes) in MOST.into_iter().zip(builds).zip(pictures).zip(bytes) {
        let rate = build.with(&picture.into(), |ms, s| 1e3 / (ms + 1e3 * s));
        let mut row =
            ["ours".to_owned(), format!("scaffold, {} triangles", mesh.triangles.len()), "WideBvh, fast".to_owned()]
                .map(Cell::text)
                .to_vec();
        #[expect(clippy::cast_precision_loss, reason = "bytes are fewer than 2^53")]
        let memory = format!("{} MB", number(n_bytes as f64 * 1e-6));
        row.extend([Cell::text(max_leaf.to_string()), Cell::measured(rate, ""), Cell::text(memory)]);
        table.rows.push(row);
    }
    chapter.tables.push(table);
    Ok(())
}
