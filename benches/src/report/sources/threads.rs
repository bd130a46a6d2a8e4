//! One to twice all threads, and a device with and without transfers: what Silva's lost charts of threads and rates showed.

use std::time::Instant;

use anyhow::Result;
use canted_gpu::{AdapterKind, Choice, Gpu, SceneInput, TracedScene};
use canted_trace::{Hit, Ray, Watertight};
use canted_wide::{Config, Preset, TriangleBvh};

use super::builders::scaffold;
use super::orders::Found;
use crate::clock;
use crate::report::{
    effort::Effort,
    model::{Axis, Cell, Chapter, Plot, Point, Series, Table},
    samples::{Samples, number},
};
use crate::wide::sets;

/// Rays of one job.
const CHUNK: usize = 1024;

pub(super) fn add(chapter: &mut Chapter, effort: Effort) -> Result<Found> {
    let all = std::thread::available_parallelism().map_or(1, usize::from);
    let counts: Vec<usize> = (1..=2 * all).collect();
    let mut table = Table::new(
        "Threads, and a device with transfers (Silva's charts)",
        &["triangles", "on", "build", "camera rays", "M rays/s", "transfer", "M rays/s with transfer"],
    );
    let (mut series, mut best) = (vec![], vec![]);
    let gpu = Gpu::open(&Choice::Best);
    if let Err(error) = &gpu {
        chapter.skipped.push(format!("Transfers to a device (Silva's rates): {error}."));
    }
    for &log2 in effort.pick(&[8][..], &[11, 14, 17], &[11, 14, 17]) {
        let model = scaffold(log2);
        let rays = sets::camera(&model, effort.pick(16, 128, 256));
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
        #[expect(clippy::cast_precision_loss, reason = "threads are few")]
        let point = |(took, &threads): (&[Samples; 2], &usize)| Point {
            label: format!("{threads} threads"),
            x: (threads as f64).into(),
            y: took[1].clone(),
        };
        let points = took.iter().zip(&counts).map(point).collect();
        series.push(Series { name: format!("{n} triangles"), points, is_joined: true });
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
    chapter.plots.push(Plot {
        title: "Camera rays over threads, 1 to twice all (Silva's chart)".to_owned(),
        x: Axis::linear("threads"),
        y: Axis::log("camera rays, ms"),
        series,
    });
    Ok(Found::default())
}

#[expect(clippy::cast_precision_loss, reason = "counts of rays")]
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
            let build = || TriangleBvh::<Watertight>::build(&mesh.positions, &mesh.triangles, &config);
            let (bvh, built) = clock::time(|| pool.install(build));
            let bvh = bvh?;
            let trace = || {
                let chunks = rays.par_chunks(CHUNK).zip(hits.par_chunks_mut(CHUNK));
                chunks.for_each(|(rays, hits)| bvh.closest_hits(rays, hits));
            };
            let ((), traced) = clock::time(|| pool.install(trace));
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
    let (bvh, built) = clock::time(|| TriangleBvh::<Watertight>::build(&mesh.positions, &mesh.triangles, &config));
    let bvh = bvh?;
    let (mut transfer, mut trace) = (f64::NAN, f64::NAN);
    for _ in 0..effort.pick(1, 2, 3) {
        let start = Instant::now();
        let scene = TracedScene::new(gpu, SceneInput::upload([&bvh]))?;
        transfer = start.elapsed().as_secs_f64() * 1e3;
        let start = Instant::now();
        scene.closest_hits(gpu, rays)?;
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
