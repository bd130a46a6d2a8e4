//! Silva's study: vector instructions, rays with and without a hierarchy, threads, and a device with transfers.

use std::time::Instant;

use anyhow::Result;
use canted_fixtures::Mesh;
use canted_gpu::{AdapterKind, Choice, Gpu, Options, Source, TracedScene, block_on};
use canted_kdtree::{KdTree, KdTreeConfig};
use canted_tests::brute;
use canted_trace::{Counts, Hit, Intersect, Kernel, Ray, Watertight};
use canted_wide::{Config, Preset, SimdPath, TriangleBvh};

use super::{Found, exponent, one_thread, scaffold, scenes};
use crate::{
    models,
    report::{
        model::{Axis, Cell, Chapter, Effort, Point, Series, Table},
        samples::{Samples, faster, number},
    },
    timing,
    wide::{
        closest_seconds,
        engine::{self, Engine},
    },
};

/// Silva's values: four lanes over a scalar test that the compiler also vectorized, and a GPU over one core.
const THEIRS: [(&str, &str, &str); 4] = [
    ("triangles (Silva)", "SSE, 4 lanes", "1.32"),
    ("boxes (Silva)", "SSE, 4 lanes", "1.5"),
    ("spheres (Silva)", "SSE, 4 lanes", "below 1, no number"),
    ("tests alone (Silva)", "OpenCL, 128 lanes", "about 30"),
];

pub(super) fn paths(chapter: &mut Chapter, effort: Effort) -> Result<Found> {
    let mut table = Table::new(
        "Vector instructions (Silva's chart): WideBvh by path",
        &["scene", "path", "camera ray", "over scalar"],
    );
    let mut says = String::new();
    let (mut series, mut gains) = (vec![], vec![]);
    for (name, model) in scenes(effort, effort.pick(&[][..], &["truss"], &["truss", "bunny", "sponza"]), chapter)? {
        let mesh = &model.mesh;
        let paths: Vec<SimdPath> = SimdPath::ALL.into_iter().filter(|path| path.is_available()).collect();
        let tree = TriangleBvh::build_with(&mesh.positions, &mesh.triangles, Config::preset(Preset::Balanced))?;
        let trees = paths.iter().map(|&path| tree.clone().with_path(path)).collect();
        let rays = models::camera(&model, effort.pick(16, 128, 128));
        let seconds = one_thread(|| closest_seconds(trees, &rays, effort.pick(2, 5, 9)))?;
        let ns: Vec<Samples> = seconds.into_iter().map(|s| Samples::from(s).scaled(1e9 / rays.len() as f64)).collect();
        let mut points = vec![];
        for (i, path) in paths.iter().enumerate() {
            let gain = ns[0].median() / ns[i].median();
            table.rows.push(vec![
                Cell::text(name),
                Cell::text(format!("{path:?}")),
                Cell::measured(ns[i].clone(), "ns"),
                Cell::text(number(gain)),
            ]);
            let place = i as f64;
            points.push(Point { label: format!("{path:?}"), x: place.into(), y: ns[i].clone() });
            if i > 0 {
                gains.push(format!("{name} {path:?} {}", number(gain)));
            }
            if i + 1 == paths.len() && says.is_empty() {
                let name_of_path = format!("{path:?}");
                let finding = faster((&name_of_path, &ns[i]), ("the scalar path", &ns[0]));
                says = format!("On {name} {finding}.");
            }
        }
        let order = paths.iter().map(|path| format!("{path:?}")).collect::<Vec<_>>().join(", ");
        series.push(Series::line(format!("{name}: {order}"), points));
    }
    table.says = format!(
        "Silva's four lanes gain 1.32 on triangles and 1.5 on boxes alone. Here, eight lanes of whole rays gain, relative to the scalar path: {}.",
        gains.join(", ")
    );
    for (what, path, gain) in THEIRS {
        table.rows.push([what, path, "–", gain].map(Cell::text).to_vec());
    }
    chapter.tables.push(table);
    chapter.plot(
        "A camera ray through WideBvh, by path",
        Axis::linear("path, in the order of the legend"),
        Axis::linear("ns"),
        series,
    );
    Ok(says.into())
}

/// Tests every triangle in a loop.
struct Every(Vec<<Watertight as Kernel>::Record>);

impl Engine for Every {
    fn closest(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        for (ray, hit) in rays.iter().zip(hits) {
            *hit = brute::closest_hit::<Watertight>(&self.0, ray);
        }
    }

    fn occluded(&self, rays: &[Ray], occluded: &mut [bool]) {
        for (ray, occluded) in rays.iter().zip(occluded) {
            *occluded = brute::closest_hit::<Watertight>(&self.0, ray).is_some();
        }
    }

    fn n_bytes(&self) -> Option<usize> {
        Some(size_of_val(&self.0[..]))
    }
}

const NAMES: [&str; 2] = ["every triangle", "WideBvh, balanced"];

pub(super) fn hierarchy(chapter: &mut Chapter, effort: Effort) -> Result<Found> {
    let mut table = Table::new(
        "With and without a hierarchy (Silva's chart): a camera ray",
        &["triangles", NAMES[0], NAMES[1], "gain"],
    );
    let mut points: [Vec<(usize, Samples)>; 2] = Default::default();
    for &log2 in effort.pick(&[7, 8, 9][..], &[8, 10, 12], &[8, 10, 12, 14, 17, 20]) {
        let model = scaffold(log2);
        let mesh = &model.mesh;
        let n = mesh.triangles.len();
        let tree = TriangleBvh::build_with(&mesh.positions, &mesh.triangles, Config::preset(Preset::Balanced))?;
        let every = Every(brute::records::<Watertight>(&mesh.positions, &mesh.triangles));
        let engines: [Box<dyn Engine>; 2] = [Box::new(every), Box::new(tree)];
        // Fewer rays at more triangles: a loop over a million takes milliseconds a ray.
        let rays = models::camera(&model, effort.pick(8, 48, 48 >> (u32::saturating_sub(log2, 14) / 2)));
        let (seconds, _) = engine::closest(&engines, &rays, effort.pick(2, 5, 7));
        let ns = |i: usize| -> Samples {
            seconds[i].iter().map(|s| s.cpu * 1e9 / rays.len() as f64).collect::<Vec<_>>().into()
        };
        let gain = number(ns(0).median() / ns(1).median());
        table.rows.push(vec![
            Cell::text(n.to_string()),
            Cell::measured(ns(0), "ns"),
            Cell::measured(ns(1), "ns"),
            Cell::text(gain),
        ]);
        for (i, points) in points.iter_mut().enumerate() {
            points.push((n, ns(i)));
        }
    }
    let exponents = points.each_ref().map(|points| {
        let of_one: Vec<[f64; 2]> = points.iter().map(|(n, ns)| [*n as f64, ns.median()]).collect();
        exponent(&of_one)
    });
    table.rows.push(vec![
        Cell::text("exponent"),
        Cell::text(&exponents[0]),
        Cell::text(&exponents[1]),
        Cell::text("Silva: 'quadratic' and 'much more linear', without numbers"),
    ]);
    table.says = format!(
        "Silva calls the time without a hierarchy quadratic. It is not: with every triangle tested, the time of a ray grows as their number to the power {}, with \
         a BVH to the power {}.",
        exponents[0], exponents[1]
    );
    chapter.tables.push(table);
    let series = NAMES.into_iter().zip(points).map(|(name, points)| Series {
        name: name.to_owned(),
        points: points
            .into_iter()
            .map(|(n, ns)| Point { label: format!("{n} triangles"), x: (n as f64).into(), y: ns })
            .collect(),
        is_joined: true,
    });
    chapter.plot(
        "A camera ray over triangles, without a hierarchy and with one",
        Axis::log("triangles"),
        Axis::log("ns"),
        series.collect(),
    );
    let [every, tree] = exponents;
    Ok(Found::from(format!(
        "The time per ray grows as triangles to the power {every} without a hierarchy, and {tree} with a BVH."
    )))
}

/// Bonuses of planes that cut off empty space.
const BONUSES: [f64; 5] = [0.0, 0.2, 0.5, 0.8, 0.9];

/// Predicted cost, references and visits of kd-trees by the bonus of empty space, which Silva leaves to the reader.
pub(super) fn empty_space(chapter: &mut Chapter, effort: Effort) -> Result<Found> {
    let mut table = Table::new(
        "kd-trees by the bonus of planes that cut off empty space (Silva's cost function)",
        &["scene", "bonus", "SAH cost", "references per triangle", "nodes a ray", "triangles a ray"],
    );
    let mut least = vec![];
    for (name, model) in scenes(effort, effort.pick(&[][..], &["bunny"], &["bunny", "truss", "sponza"]), chapter)? {
        let Mesh { positions, triangles, .. } = &model.mesh;
        let rays = models::camera(&model, effort.pick(8, 64, 128));
        let mut best: Option<(f64, f64)> = None;
        for empty_bonus in BONUSES {
            let config = KdTreeConfig { empty_bonus, ..KdTreeConfig::default() };
            let tree = KdTree::build(positions, triangles, &config)?;
            let mut counts = Counts::default();
            for ray in &rays {
                tree.closest_hit_with(ray, &mut counts);
            }
            let a_ray = |n: u64| n as f64 / rays.len() as f64;
            let references = tree.nodes().n_references() as f64 / triangles.len() as f64;
            let cells = [tree.nodes().sah(&config), references, a_ray(counts.boxes), a_ray(counts.triangles)];
            // Both are tests of a ray.
            let tests = cells[2] + cells[3];
            if best.is_none_or(|(_, least)| tests < least) {
                best = Some((empty_bonus, tests));
            }
            let names = [Cell::text(name), Cell::text(number(empty_bonus))];
            table.rows.push(names.into_iter().chain(cells.map(|x| Cell::text(number(x)))).collect());
        }
        least.extend(best.map(|(bonus, _)| format!("{name} {}", number(bonus))));
    }
    table.says = format!("The bonus with the fewest nodes and triangles a ray: {}.", least.join(", "));
    let says = table.says.clone();
    chapter.tables.push(table);
    Ok(Found::from(says))
}

/// Rays of one job.
const CHUNK: usize = 1024;

pub(super) fn threads(chapter: &mut Chapter, effort: Effort) -> Result<Found> {
    let all = std::thread::available_parallelism().map_or(1, usize::from);
    let counts: Vec<usize> = (1..=2 * all).collect();
    let mut table = Table::new(
        "Threads, and a device with transfers (Silva's charts)",
        &["triangles", "on", "build", "camera rays", "M rays/s", "transfer", "M rays/s with transfer"],
    );
    let (mut series, mut best) = (vec![], vec![]);
    let gpu = block_on(Gpu::open(&Choice::Best));
    if let Err(error) = &gpu {
        chapter.skipped.push(format!("Transfers to a device (Silva's rates): {error}."));
    }
    for &log2 in effort.pick(&[8][..], &[11, 14, 17], &[11, 14, 17]) {
        let model = scaffold(log2);
        let rays = models::camera(&model, effort.pick(16, 128, 256));
        let n = model.mesh.triangles.len();
        let took = on_threads(&model.mesh, &rays, &counts, effort.pick(2, 3, 5))?;
        let fastest = took.iter().zip(&counts).min_by(|a, b| a.0[1].median().total_cmp(&b.0[1].median()));
        best.extend(fastest.map(|(_, threads)| format!("{threads} for {n} triangles")));
        for ([build, trace], threads) in took.iter().zip(&counts) {
            let cells = [n.to_string(), format!("{threads} threads")].map(Cell::text);
            let times = [build, trace].map(|ms| Cell::measured(ms.clone(), "ms"));
            let rate = rate(rays.len(), trace.median());
            table.rows.push(cells.into_iter().chain(times).chain([&rate, "0 ms", &rate].map(Cell::text)).collect());
        }
        let point = |(took, &threads): (&[Samples; 2], &usize)| Point {
            label: format!("{threads} threads"),
            x: (threads as f64).into(),
            y: took[1].clone(),
        };
        let points = took.iter().zip(&counts).map(point).collect();
        series.push(Series::line(format!("{n} triangles"), points));
        if let Ok(gpu) = &gpu {
            table.rows.push(on_device(gpu, &model.mesh, &rays, effort)?);
        }
    }
    table.says = format!(
        "Silva finds 3 threads best on two cores, 4 on four, and a GPU about 30 times as fast as a core, without stating transfers. Here, on {all} cores, camera \
         rays are fastest on {} threads (wall time; other processes were running).",
        best.join(", ")
    );
    chapter.tables.push(table);
    chapter.plot(
        "Camera rays over threads, 1 to twice all (Silva's chart)",
        Axis::linear("threads"),
        Axis::log("camera rays, ms"),
        series,
    );
    Ok(Found::default())
}

fn rate(n_rays: usize, ms: f64) -> String {
    number(n_rays as f64 * 1e-3 / ms)
}

/// Milliseconds of builds and of all rays, all numbers of threads in turn.
fn on_threads(
    mesh: &canted_fixtures::Mesh,
    rays: &[Ray],
    counts: &[usize],
    rounds: usize,
) -> Result<Vec<[Samples; 2]>> {
    use rayon::prelude::*;

    let pool = |&n: &usize| rayon::ThreadPoolBuilder::new().num_threads(n).build();
    let pools = counts.iter().map(pool).collect::<Result<Vec<_>, _>>()?;
    let mut hits: Vec<Option<Hit>> = vec![None; rays.len()];
    let mut ms = vec![[vec![], vec![]]; counts.len()];
    for round in 0..=rounds {
        for (pool, [builds, traces]) in pools.iter().zip(&mut ms) {
            let config = Config::preset(Preset::Balanced);
            let build = || TriangleBvh::build_with(&mesh.positions, &mesh.triangles, config);
            let (bvh, built) = timing::time(|| pool.install(build));
            let bvh = bvh?;
            let trace = || {
                let chunks = rays.par_chunks(CHUNK).zip(hits.par_chunks_mut(CHUNK));
                chunks.for_each(|(rays, hits)| bvh.closest_hits(rays, hits));
            };
            let ((), traced) = timing::time(|| pool.install(trace));
            if round > 0 {
                builds.push(built.wall * 1e3);
                traces.push(traced.wall * 1e3);
            }
        }
    }
    Ok(ms.into_iter().map(|times| times.map(Samples::from)).collect())
}

/// A BVH that is uploaded, rays that are uploaded, hits that are downloaded: the second run, after the driver compiled.
fn on_device(gpu: &Gpu, mesh: &canted_fixtures::Mesh, rays: &[Ray], effort: Effort) -> Result<Vec<Cell>> {
    // A software driver takes a second for 65,536 rays.
    let most = if gpu.info().kind == AdapterKind::Software { 1 << 14 } else { rays.len() };
    let rays = &rays[..most.min(rays.len())];
    let config = Config::preset(Preset::Balanced);
    let (bvh, built) = timing::time(|| TriangleBvh::build_with(&mesh.positions, &mesh.triangles, config));
    let bvh = bvh?;
    let (mut transfer, mut trace) = (f64::NAN, f64::NAN);
    for _ in 0..effort.pick(1, 2, 3) {
        let start = Instant::now();
        let scene = block_on(TracedScene::new(gpu, Source::wide(&bvh), Options::default()))?;
        transfer = start.elapsed().as_secs_f64() * 1e3;
        let start = Instant::now();
        block_on(scene.closest_hits(gpu, rays))?;
        trace = start.elapsed().as_secs_f64() * 1e3;
    }
    let texts = [
        mesh.triangles.len().to_string(),
        format!("device: {}, {} rays with their transfer", gpu.info().name, rays.len()),
        format!("{} ms on the CPU", number(built.wall * 1e3)),
        format!("{} ms", number(trace)),
        rate(rays.len(), trace),
        format!("{} ms of the BVH", number(transfer)),
        rate(rays.len(), trace + transfer),
    ];
    Ok(texts.map(Cell::text).to_vec())
}
