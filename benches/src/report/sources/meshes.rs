//! What the size and the number of meshes change, as the dissertation claims: box passes by size (4.3 and 5), one dispatch over all meshes
//! (3.6.1), and rays by meshes per triangle (4.4).

use std::time::Instant;

use anyhow::{Result, ensure};
use canted_fixtures::Mesh;
use canted_gpu::{
    AdapterKind, Choice, Gpu, block_on,
    build::{self, BuildConfig, BuildEncoder, Built, Passes, Primitives},
};
use canted_lbvh::{Bits, Corners, Domain, Strategy, VolumeConfig};
use canted_obb::{Aabb, Affine};
use canted_tlas::{Instance, Tlas, TopConfig};
use canted_trace::{Counts, Intersect};
use canted_wide::{Config, Preset, TriangleBvh};

use super::{Found, dissertation, exponent, one_thread, scaffold, scenes};
use crate::{
    models::{self, Model},
    report::{
        model::{Axis, Cell, Chapter, Effort, Point, Series, Table},
        samples::{Samples, number},
    },
    timing,
    wide::engine::{self, Engine},
};

/// The boxes whose passes are timed: the dissertation's three, and as a control the axis-aligned ones.
const BOXES: [Strategy; 4] = [Strategy::Aabb, Strategy::PcaBounded, Strategy::Quaternion, Strategy::PcaUnbounded];

/// Milliseconds of the box pass of each of [`BOXES`], by number of triangles.
type BySize = Vec<(usize, [Samples; 4])>;

/// Box passes by size of mesh and kind of box, on the CPU and on a device.
pub(super) fn passes_by_size(chapter: &mut Chapter, effort: Effort) -> Result<Found> {
    let mut head = vec!["on", "triangles"];
    let names = BOXES.map(|strategy| format!("{strategy:?}"));
    head.extend(names.iter().map(|name| &name[..]));
    let mut table =
        Table::new("Box passes by size of mesh (the dissertation's 4.3 and 5): nanoseconds per triangle", &head);
    let sizes = effort.pick(&[6, 7, 8][..], &[11, 13, 15, 17], &[11, 13, 15, 17, 19]);
    let on_cpu = one_thread(|| sizes.iter().map(|&log2| on_cpu(log2, effort)).collect::<Result<BySize>>())??;
    let mut all = vec![("one thread".to_owned(), on_cpu)];
    match block_on(Gpu::open(&Choice::Best)) {
        Ok(gpu) => {
            let is_slow = gpu.info().kind == AdapterKind::Software;
            let sizes = if is_slow { &sizes[..3] } else { sizes };
            let by_size = sizes.iter().map(|&log2| on_device(&gpu, log2, effort)).collect::<Result<BySize>>()?;
            all.push((gpu.info().name.clone(), by_size));
        }
        Err(error) => chapter.skipped.push(format!("Box passes by size on a device: {error}.")),
    }
    let (mut series, mut found) = (vec![], vec![]);
    for (on, by_size) in &all {
        for (n, ms) in by_size {
            let mut row = vec![Cell::text(on.clone()), Cell::text(n.to_string())];
            row.extend(ms.iter().map(|ms| Cell::measured(ms.scaled(1e6 / *n as f64), "ns")));
            table.rows.push(row);
        }
        let exponents = [0, 1, 2, 3]
            .map(|i| exponent(&by_size.iter().map(|(n, ms)| [*n as f64, ms[i].median()]).collect::<Vec<_>>()));
        let mut row = vec![Cell::text(on.clone()), Cell::text("exponent")];
        row.extend(exponents.iter().map(Cell::text));
        table.rows.push(row);
        let of = names.iter().zip(&exponents).map(|(name, exponent)| format!("{name} {exponent}"));
        found.push(format!("on {on} {}", of.collect::<Vec<_>>().join(", ")));
        series.extend((0..BOXES.len()).map(|i| {
            let point =
                |(n, ms): &(usize, [Samples; 4])| Point::new(format!("{n} triangles"), *n as f64, ms[i].clone());
            Series::line(format!("{}, {on}", names[i]), by_size.iter().map(point).collect())
        }));
    }
    table.says = format!(
        "The dissertation finds the passes of bounded principal axes and of quaternions linear, and that of unbounded ones worse, without numbers. Here, the time \
         grows as the number of triangles to the power: {}.",
        found.join("; ")
    );
    chapter.tables.push(table);
    chapter.plot("Box passes by size of mesh", Axis::log("triangles"), Axis::log("box pass, ms"), series);
    Ok(Found::default())
}

fn on_cpu(log2: u32, effort: Effort) -> Result<(usize, [Samples; 4])> {
    let model = scaffold(log2);
    let (corners, bounds) = canted_lbvh::triangle_corners(&model.mesh.positions, &model.mesh.triangles)?;
    let codes = canted_lbvh::morton_codes(&Domain::new(&bounds, 3, Bits::B63), &corners);
    let tree = canted_lbvh::radix(canted_lbvh::sort_by_code(&codes, Bits::B63));
    let leaves = canted_lbvh::in_leaf_order(&corners, &tree.leaves);
    let mut ms: [Vec<f64>; 4] = Default::default();
    for round in 0..=effort.pick(1, 3, 5) {
        for (strategy, ms) in BOXES.into_iter().zip(&mut ms) {
            let config = VolumeConfig { strategy, fallback: true };
            let (_, took) = timing::time(|| canted_lbvh::volumes(&tree, &leaves, &config));
            if round > 0 {
                ms.push(took.cpu * 1e3);
            }
        }
    }
    Ok((corners.len(), ms.map(Samples::from)))
}

/// The fastest run; oriented boxes without the axis-aligned ones, which they also need.
fn on_device(gpu: &Gpu, log2: u32, effort: Effort) -> Result<(usize, [Samples; 4])> {
    let model = scaffold(log2);
    let (corners, _) = canted_lbvh::triangle_corners(&model.mesh.positions, &model.mesh.triangles)?;
    let items = Primitives::triangles(gpu, [&corners[..]])?;
    let passes = block_on(Passes::measure(gpu, &items, Bits::B63, effort.pick(1, 2, 5)))?;
    let ms = BOXES.map(|wanted| {
        let at = build::STRATEGIES.iter().position(|&strategy| strategy == wanted);
        Samples::from(at.and_then(|at| passes.boxes[at]).unwrap_or(f64::NAN))
    });
    Ok((corners.len(), ms))
}

/// The trees of all meshes by the same dispatches, compared with dispatches for each mesh.
pub(super) fn one_dispatch(chapter: &mut Chapter, effort: Effort) -> Result<Found> {
    let gpu = match block_on(Gpu::open(&Choice::Best)) {
        Ok(gpu) => gpu,
        Err(error) => {
            chapter.skipped.push(format!("One dispatch over all meshes (3.6.1): {error}."));
            return Ok(Found::default());
        }
    };
    let title = format!(
        "One dispatch over all meshes, and one a mesh (the dissertation's 3.6.1): builds on {}",
        gpu.info().name
    );
    let head =
        ["scene", "meshes", "triangles", "boxes", "all at once", "mesh by mesh", "mesh by mesh over all at once"];
    let mut table = Table::new(title, &head);
    let mut found = vec![];
    for (name, model) in scenes(effort, &["sponza"], chapter)? {
        let corners = dissertation::meshes(name, &model)?
            .iter()
            .take(effort.pick(4, 100, 1000))
            .map(|piece| Ok(canted_lbvh::triangle_corners(&piece.positions, &piece.triangles)?.0))
            .collect::<Result<Vec<Vec<Corners>>>>()?;
        let n: usize = corners.iter().map(Vec::len).sum();
        for strategy in [Strategy::Aabb, Strategy::PcaBounded] {
            let config = BuildConfig { bits: Bits::B63, strategy };
            let (mut at_once, mut by_mesh) = (vec![], vec![]);
            // In the first round, drivers compile.
            for round in 0..=effort.pick(1, 2, 5) {
                let all = [&corners[..]];
                let each: Vec<&[Vec<Corners>]> = corners.chunks(1).collect();
                for (groups, ms) in [(&all[..], &mut at_once), (&each[..], &mut by_mesh)] {
                    let took = built_in_groups(&gpu, groups, config)?;
                    if round > 0 {
                        ms.push(took);
                    }
                }
            }
            let [at_once, by_mesh] = [at_once, by_mesh].map(Samples::from);
            let ratio = number(by_mesh.median() / at_once.median());
            found.push(format!("{ratio} times ({} meshes, {strategy:?})", corners.len()));
            let texts = [name.to_owned(), corners.len().to_string(), n.to_string(), format!("{strategy:?}")];
            let mut row = texts.map(Cell::text).to_vec();
            row.extend([at_once, by_mesh].map(|ms| Cell::measured(ms, "ms")));
            row.push(Cell::text(ratio));
            table.rows.push(row);
        }
    }
    table.says = format!(
        "The dissertation builds the trees of all meshes with one dispatch, to fill the GPU better, and does not measure the gain. Here, a build mesh by mesh \
         takes {} as long, from corners on the device, submissions and waiting included.",
        found.join(", ")
    );
    chapter.tables.push(table);
    Ok(Found::default())
}

/// Milliseconds of the builds of groups of meshes, each group with its own dispatches.
fn built_in_groups(gpu: &Gpu, groups: &[&[Vec<Corners>]], config: BuildConfig) -> Result<f64> {
    let items = groups.iter().map(|group| Primitives::triangles(gpu, group.iter().map(|corners| &corners[..])));
    let items = items.collect::<Result<Vec<_>, _>>()?;
    block_on(gpu.finish())?;
    let start = Instant::now();
    let built = items.into_iter().map(|items| Built::new(&mut BuildEncoder::new(gpu), items, config));
    let built = built.collect::<Result<Vec<_>, _>>()?;
    block_on(gpu.finish())?;
    let ms = start.elapsed().as_secs_f64() * 1e3;
    drop(built);
    Ok(ms)
}

/// The same triangles in few and in many meshes, in two levels.
pub(super) fn per_triangle(chapter: &mut Chapter, effort: Effort) -> Result<Found> {
    let head = [
        "scene",
        "triangles",
        "meshes",
        "triangles a mesh",
        "box tests",
        "triangle tests",
        "camera ray",
        "over one mesh",
    ];
    let mut table = Table::new(
        "Camera rays by meshes per triangle (the dissertation's 4.4): the same triangles in two levels of WideBvh",
        &head,
    );
    let (mut series, mut found) = (vec![], vec![]);
    for (name, model) in scenes(effort, &["sponza"], chapter)? {
        let by_number = one_thread(|| by_number(name, &model, effort))??;
        let n = model.mesh.triangles.len();
        let one = by_number[0].2.median();
        for (n_meshes, [boxes, triangles], ns) in &by_number {
            let texts = [name.to_owned(), n.to_string(), n_meshes.to_string(), number(n as f64 / *n_meshes as f64)];
            let mut row = texts.map(Cell::text).to_vec();
            row.extend([boxes, triangles].map(|x| Cell::text(number(*x))));
            row.extend([Cell::measured(ns.clone(), "ns"), Cell::text(number(ns.median() / one))]);
            table.rows.push(row);
        }
        let times = by_number.iter().map(|(n_meshes, _, ns)| format!("{n_meshes}: {}", number(ns.median() / one)));
        found.push(format!("{name} {}", times.collect::<Vec<_>>().join(", ")));
        let point = |(n_meshes, _, ns): &(usize, [f64; 2], Samples)| {
            Point::new(format!("{n_meshes} meshes"), *n_meshes as f64, ns.clone())
        };
        series.push(Series::line(name, by_number.iter().map(point).collect()));
    }
    table.says = format!(
        "The dissertation says that scenes with more meshes per triangle are rendered faster; its scenes differ in all else as well. Here, with the same triangles \
         and hits, the time of a camera ray by number of meshes, relative to one mesh: {}.",
        found.join("; ")
    );
    chapter.tables.push(table);
    chapter.plot("Camera rays by number of meshes", Axis::log("meshes"), Axis::log("ns a camera ray"), series);
    Ok(Found::default())
}

/// Number of meshes, box and triangle tests of a camera ray, and its nanoseconds.
fn by_number(name: &str, model: &Model, effort: Effort) -> Result<Vec<(usize, [f64; 2], Samples)>> {
    let pieces = along_curve(dissertation::meshes(name, model)?);
    let rays = models::camera(model, effort.pick(16, 128, 128));
    let config = Config::preset(Preset::Balanced);
    let (mut numbers, mut tests, mut engines): (_, _, Vec<Box<dyn Engine>>) = (vec![], vec![], vec![]);
    for n_wanted in [1, 4, 16, 64, usize::MAX] {
        let groups: Vec<Mesh> = pieces.chunks(pieces.len().div_ceil(n_wanted)).map(joined).collect();
        if numbers.last() == Some(&groups.len()) {
            continue;
        }
        let instances: Vec<Instance> =
            (0u32..).zip(&groups).map(|(mesh, _)| Instance::new(mesh, Affine::IDENTITY)).collect();
        let blas = groups.iter().map(|mesh| TriangleBvh::build_with(&mesh.positions, &mesh.triangles, config));
        let tlas = Tlas::new(blas.collect::<Result<Vec<_>, _>>()?, &instances, TopConfig::Wide(config))?;
        let mut counts = Counts::default();
        for ray in &rays {
            tlas.closest_hit_with(ray, &mut counts);
        }
        numbers.push(groups.len());
        tests.push([counts.boxes, counts.triangles].map(|n| n as f64 / rays.len() as f64));
        engines.push(Box::new(tlas));
    }
    let (seconds, hits) = engine::closest(&engines, &rays, effort.pick(2, 5, 7));
    for (n, hits_of_number) in numbers.iter().zip(&hits) {
        // Primitives and instances have other numbers.
        let n_other =
            hits_of_number.iter().zip(&hits[0]).filter(|(a, b)| a.map(|hit| hit.t) != b.map(|hit| hit.t)).count();
        ensure!(n_other == 0, "{n_other} hits in {n} meshes differ from those in one");
    }
    let ns = seconds.iter().map(|seconds| Samples::from(engine::cpu(seconds)).scaled(1e9 / rays.len() as f64));
    Ok(numbers.into_iter().zip(tests).zip(ns).map(|((n, tests), ns)| (n, tests, ns)).collect())
}

/// Meshes in the order of their centers along a Morton curve, so that neighbors in the order are neighbors in space.
fn along_curve(pieces: Vec<Mesh>) -> Vec<Mesh> {
    let boxes: Vec<Aabb> = pieces.iter().map(|piece| Aabb::from_points(piece.positions.iter().copied())).collect();
    let bounds = boxes.iter().fold(Aabb::EMPTY, |all, aabb| all.union(*aabb));
    let codes = canted_lbvh::morton_codes_of_boxes(&Domain::new(&bounds, 2, Bits::B63), &boxes);
    let mut coded: Vec<(u64, Mesh)> = codes.into_iter().zip(pieces).collect();
    coded.sort_by_key(|(code, _)| *code);
    coded.into_iter().map(|(_, piece)| piece).collect()
}

/// One mesh of all.
fn joined(meshes: &[Mesh]) -> Mesh {
    let mut all = Mesh { positions: vec![], triangles: vec![] };
    for mesh in meshes {
        let first = all.positions.len() as u32;
        all.positions.extend(&mesh.positions);
        all.triangles.extend(mesh.triangles.iter().map(|triangle| triangle.map(|i| first + i)));
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn joined_meshes_keep_their_triangles_and_neighbors_follow_each_other() {
        let at = |x: f32| Mesh {
            positions: vec![[x, 0.0, 0.0], [x + 1.0, 0.0, 0.0], [x, 1.0, 0.0]],
            triangles: vec![[0, 1, 2]],
        };
        let ordered = along_curve(vec![at(8.0), at(0.0), at(9.0), at(1.0)]);
        assert_eq!(ordered.iter().map(|mesh| mesh.positions[0][0]).collect::<Vec<_>>(), [0.0, 1.0, 8.0, 9.0]);
        let all = joined(&ordered);
        assert_eq!((all.positions.len(), all.triangles[2]), (12, [6, 7, 8]));
        assert_eq!(all.positions[6], [8.0, 0.0, 0.0]);
    }
}
