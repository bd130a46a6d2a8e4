//! Tests of camera rays, with axis-aligned and oriented boxes, in one level and in two: the dissertation's figures 12 and 13.

use anyhow::Result;
use canted_bvh2::{BuildConfig, Bvh2};
use canted_lbvh::{Strategy, VolumeConfig};
use canted_obb::Affine;
use canted_tlas::{Blas, Instance, Tlas, TopConfig};
use canted_trace::{Counts, InstanceId, Ray, Watertight};
use canted_wide::{Config, Preset, TriangleBvh};

use super::{levels, orders::Found, scenes};
use crate::models::Model;
use crate::report::{
    effort::Effort,
    model::{Axis, Cell, Chapter, Plot, Point, Series, Table},
    samples::number,
};
use crate::wide::sets;

const STRATEGIES: [Strategy; 4] = [Strategy::Aabb, Strategy::PcaUnbounded, Strategy::PcaBounded, Strategy::Quaternion];

/// Points of a curve.
const STEPS: usize = 64;

/// Box and triangle tests of each ray, in one level and in two.
struct Row {
    name: String,
    counts: [Vec<Counts>; 2],
}

pub(super) fn add(chapter: &mut Chapter, effort: Effort) -> Result<Found> {
    let mut table = Table::new(
        "Tests of a camera ray in one level and in two",
        &[
            "scene",
            "meshes",
            "structure",
            "boxes, one level",
            "boxes, two",
            "two over one",
            "triangles, one level",
            "triangles, two",
        ],
    );
    let mut found = vec![];
    for (name, model) in scenes(effort, &["sponza"], chapter)? {
        let rays = sets::camera(&model, effort.pick(16, 128, 128));
        let (n_meshes, rows) = rows(name, &model, &rays)?;
        for row in &rows {
            let [boxes, triangles] = [(|c: &Counts| c.boxes) as fn(&Counts) -> u64, |c| c.triangles]
                .map(|of| row.counts.each_ref().map(|counts| mean(counts, of)));
            table.rows.push(
                [
                    name.to_owned(),
                    n_meshes.to_string(),
                    row.name.clone(),
                    number(boxes[0]),
                    number(boxes[1]),
                    number(boxes[1] / boxes[0]),
                    number(triangles[0]),
                    number(triangles[1]),
                ]
                .map(Cell::text)
                .to_vec(),
            );
            found.push(format!("{} {}", row.name, number(boxes[1] / boxes[0])));
        }
        let of = |row: &Row, level: usize| {
            curve(format!("{}, {}", row.name, ["one level", "two levels"][level]), &row.counts[level])
        };
        // Figure 12: the box tests of boxes of both kinds; figure 13: of one level and two.
        chapter.plots.push(plot(
            "Figure 12 as a plot: axis-aligned and oriented boxes",
            name,
            rows[..STRATEGIES.len()].iter().map(|row| of(row, 0)).collect(),
        ));
        let figure_13 = [&rows[0], &rows[STRATEGIES.len()]].into_iter().flat_map(|row| [of(row, 0), of(row, 1)]);
        chapter.plots.push(plot("Figure 13 as a plot: one level and two", name, figure_13.collect()));
    }
    table.says = format!(
        "The dissertation shows fewer box tests in two levels, where volumes are halved. Here, box tests in two levels relative to one: {}.",
        found.join(", ")
    );
    chapter.tables.push(table);
    Ok(Found::default())
}

#[expect(clippy::cast_precision_loss, reason = "counts of tests and rays")]
fn mean(counts: &[Counts], of: fn(&Counts) -> u64) -> f64 {
    counts.iter().map(of).sum::<u64>() as f64 / counts.len() as f64
}

/// Box tests of the rays in order, few to many.
#[expect(clippy::cast_precision_loss, reason = "counts of tests and rays")]
fn curve(name: String, counts: &[Counts]) -> Series {
    let mut boxes: Vec<u64> = counts.iter().map(|counts| counts.boxes).collect();
    boxes.sort_unstable();
    let last = boxes.len() - 1;
    let point = |step: usize| Point {
        label: String::new(),
        x: (100.0 * step as f64 / STEPS as f64).into(),
        y: (boxes[last * step / STEPS] as f64).into(),
    };
    Series { name, points: (0..=STEPS).map(point).collect(), is_joined: true }
}

fn plot(title: &str, scene: &str, series: Vec<Series>) -> Plot {
    Plot {
        title: format!("{title} ({scene})"),
        x: Axis::linear("camera rays with at most so many tests, %"),
        y: Axis::linear("box tests of a ray"),
        series,
    }
}

fn rows(name: &str, model: &Model, rays: &[Ray]) -> Result<(usize, Vec<Row>)> {
    let pieces = levels::meshes(name, model)?;
    let instances: Vec<Instance> =
        (0u32..).zip(&pieces).map(|(mesh, _)| Instance::new(mesh, Affine::IDENTITY)).collect();
    let mut rows = vec![];
    for strategy in STRATEGIES {
        let volumes = VolumeConfig { strategy, fallback: true };
        let config = BuildConfig { volumes, ..BuildConfig::default() };
        let one = Bvh2::<Watertight>::build(&model.mesh.positions, &model.mesh.triangles, &config)?;
        let blas = pieces.iter().map(|piece| Bvh2::<Watertight>::build(&piece.positions, &piece.triangles, &config));
        let two = Tlas::new(blas.collect::<Result<Vec<_>, _>>()?, &instances, TopConfig::Binary(volumes))?;
        rows.push(Row { name: format!("Bvh2, radix tree, {strategy:?}"), counts: counted(&one, &two, rays) });
    }
    let config = Config::preset(Preset::Balanced);
    let build = |positions: &[[f32; 3]], triangles: &[[u32; 3]]| {
        TriangleBvh::<Watertight>::build(positions, triangles, &config)
    };
    let one = build(&model.mesh.positions, &model.mesh.triangles)?;
    let blas = pieces.iter().map(|piece| build(&piece.positions, &piece.triangles));
    let two = Tlas::new(blas.collect::<Result<Vec<_>, _>>()?, &instances, TopConfig::Wide(config))?;
    rows.push(Row { name: "WideBvh, balanced".to_owned(), counts: counted(&one, &two, rays) });
    Ok((pieces.len(), rows))
}

/// Tests of each ray in one level and in two.
fn counted<B: Blas>(one: &B, two: &Tlas<B>, rays: &[Ray]) -> [Vec<Counts>; 2] {
    let of = |trace: &dyn Fn(&Ray, &mut Counts)| {
        let count = |ray: &Ray| {
            let mut counts = Counts::default();
            trace(ray, &mut counts);
            counts
        };
        rays.iter().map(count).collect()
    };
    [
        of(&|ray, counts| {
            let _ = one.closest_hit_with(ray, InstanceId(0), counts);
        }),
        of(&|ray, counts| {
            let _ = two.closest_hit_with(ray, counts);
        }),
    ]
}
