//! A cheap builder beside a careful one, build and picture: the BIH thesis's table 1 and Novak's tables.

use anyhow::Result;
use canted_fixtures::{scaffold_nodes, scaffold_of};
use canted_lbvh::Leaf;
use canted_obb::Aabb;
use canted_sah::{Builder, TopDownConfig};
use canted_tlas::{Blas, BuildConfig, MeshBlas};
use canted_trace::{InstanceId, Watertight};

use super::passes::one_thread;
use crate::clock;
use crate::models::Model;
use crate::report::{
    effort::Effort,
    model::{Axis, Cell, Chapter, Plot, Point, Series, Table},
    samples::{Samples, number},
    subjects,
};
use crate::wide::sets;

/// What the sources print: source, scene, triangles, cheap build and picture, careful build and picture, ms. Of the BIH thesis a BIH
/// of ten primitives a leaf and a kd-tree with ropes; of Novak's his GPU and CPU trees on machine 2.
const THEIRS: [(&str, &str, usize, [f64; 4]); 6] = [
    ("BIH thesis", "Hornbug", 1_800, [0.6, 13.5, 12.3, 7.2]),
    ("BIH thesis", "Alien", 32_000, [11.7, 41.3, 180.0, 36.0]),
    ("BIH thesis", "Dino", 107_000, [54.0, 44.0, 672.0, 22.3]),
    ("Novak", "scene 4", 1_099_995, [222.04, 5.82, 2241.39, 8.63]),
    ("Novak", "scene 5", 1_468_284, [181.62, 32.31, 3063.49, 44.55]),
    ("Novak", "scene 6", 2_880_000, [371.08, 368.45, 7263.72, 319.68]),
];

/// Ours: radix tree, and top-down with every split tried.
const BUILDERS: [Builder; 2] = [Builder::Lbvh, Builder::TopDown(TopDownConfig::SWEEP, None)];

pub(super) fn add(chapter: &mut Chapter, effort: Effort) -> Result<String> {
    let mut table = Table::new(
        "A cheap builder beside a careful one (the BIH thesis's table 1, Novak's tables)",
        &[
            "source",
            "scene",
            "triangles",
            "cheap: build",
            "picture",
            "careful: build",
            "picture",
            "build gain",
            "picture gain",
            "pictures until the careful one is ahead",
        ],
    );
    let mut row = |source: &str, scene: &str, n: usize, ms: [Samples; 4]| {
        let [build, picture, careful_build, careful_picture] = ms.each_ref().map(Samples::median);
        let gain = picture - careful_picture;
        let is_noise = ms[1].is_noise_beside(&ms[3]);
        let crossing = if gain > 0.0 && !is_noise {
            number(((careful_build - build) / gain).ceil())
        } else {
            "never, or noise".to_owned()
        };
        let [a, b, c, d] = ms.map(|samples| Cell::measured(samples, "ms"));
        table.rows.push(vec![
            Cell::text(source),
            Cell::text(scene),
            Cell::text(n.to_string()),
            a,
            b,
            c,
            d,
            Cell::text(number(careful_build / build)),
            Cell::text(number(picture / careful_picture)),
            Cell::text(crossing),
        ]);
        (careful_build / build, picture / careful_picture)
    };
    let mut series =
        ["BIH thesis", "Novak", "ours"].map(|name| Series { name: name.to_owned(), points: vec![], is_joined: false });
    for (source, scene, n, ms) in THEIRS {
        let gains = row(source, scene, n, ms.map(Samples::from));
        let place = usize::from(source == "Novak");
        series[place].points.push(Point { label: scene.to_owned(), x: gains.0.into(), y: gains.1.into() });
    }
    let mut last = (f64::NAN, f64::NAN);
    for log2 in effort.pick(&[8][..], &[11, 15, 17], &[11, 15, 17, 20, 21]) {
        let model = subjects::of_mesh(scaffold_of(1, false, scaffold_nodes(*log2)));
        let ms = one_thread(|| measure(&model, effort))??;
        last = row("ours", "scaffold", model.mesh.triangles.len(), ms);
        series[2].points.push(Point { label: "scaffold".to_owned(), x: last.0.into(), y: last.1.into() });
    }
    chapter.plots.push(Plot {
        title: "What a careful builder buys: picture gain over build cost".to_owned(),
        x: Axis::log("careful build over cheap build"),
        y: Axis::log("cheap picture over careful picture"),
        series: series.into(),
    });
    chapter.tables.push(table);
    Ok(format!(
        "A careful build of the largest scaffold takes {} times as long as the radix tree's and traces {} times as fast.",
        number(last.0),
        number(last.1)
    ))
}

/// Milliseconds of build and picture, cheap then careful.
fn measure(model: &Model, effort: Effort) -> Result<[Samples; 4]> {
    let (corners, bounds) = canted_lbvh::gather(&model.mesh.positions, &model.mesh.triangles)?;
    // Four views together have the pixels of one picture of 1024 x 1024.
    let rays = sets::camera(model, effort.pick(16, 128, 512));
    let mut ms: [Vec<f64>; 4] = Default::default();
    for repeat in 0..=effort.pick(2, 3, 5) {
        for (place, builder) in BUILDERS.iter().enumerate() {
            let (blas, build) = clock::time(|| {
                let boxes: Vec<Aabb> = corners.iter().map(Leaf::aabb).collect();
                let tree = canted_sah::build(&boxes, &bounds, builder);
                MeshBlas::<Watertight>::over(tree, &corners, &bounds, &BuildConfig::default())
            });
            let (_, picture) = clock::time(|| {
                for ray in &rays {
                    std::hint::black_box(blas.closest_hit(ray, InstanceId(0), &mut ()));
                }
            });
            if repeat > 0 {
                ms[2 * place].push(build.cpu * 1e3);
                ms[2 * place + 1].push(picture.cpu * 1e3);
            }
        }
    }
    Ok(ms.map(Samples::from))
}
