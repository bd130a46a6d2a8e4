//! Builds and camera rays of one size on 1, 2, 4 ... and all threads.

use anyhow::Result;
use canted_trace::{Hit, Ray};
use rayon::prelude::*;

use super::growing;
use crate::clock;
use crate::models::Model;
use crate::report::{
    builds,
    effort::Effort,
    model::{Axis, Cell, Chapter, Plot, Point, Series, Table},
    samples::{Samples, faster},
    subjects,
};
use crate::wide::{
    engine::{Engine, Entry},
    growth, sets,
};

/// Wall times of one engine by number of threads.
struct Course {
    name: String,
    took: Vec<Samples>,
}

/// Adds both and returns a sentence about the first engine.
pub(super) fn add(chapter: &mut Chapter, effort: Effort) -> Result<String> {
    let all = std::thread::available_parallelism().map_or(1, usize::from);
    let mut counts: Vec<usize> = (0..).map(|log2| 1 << log2).take_while(|&n| n < all).collect();
    counts.push(all);
    let (scene, generate) = growth::SCENES[0];
    let model = subjects::of_mesh(generate(effort.pick(10, 16, 20)));
    let rounds = effort.pick(2, 5, 7);
    let (entries, _) = growing(&model)?;
    let parallel: Vec<&Entry<'_>> = entries.iter().filter(|entry| entry.is_parallel).collect();
    let built = of_builds(&parallel, &counts, rounds)?;
    let traced = of_rays(&model, &entries, &counts, effort)?;
    let what = format!("{scene}, {} triangles", model.mesh.triangles.len());
    show(chapter, [&what, "builds", "build, ms"], "ms", &counts, &built);
    show(chapter, [&what, "camera rays", "ns per camera ray"], "ns", &counts, &traced);
    let gain = |[on_all, on_one]: [&str; 2], course: &Course| {
        faster((on_all, &course.took[counts.len() - 1]), (on_one, &course.took[0]))
    };
    Ok(format!(
        "For '{}' on {all} threads, {}; {}.",
        built[0].name,
        gain(["a build on all", "one on one"], &built[0]),
        gain(["tracing on all", "that on one"], &traced[0]),
    ))
}

/// Milliseconds of each build, all numbers of threads in turn.
fn of_builds(entries: &[&Entry<'_>], counts: &[usize], rounds: usize) -> Result<Vec<Course>> {
    let mut ms = vec![vec![vec![]; counts.len()]; entries.len()];
    for _ in 0..rounds {
        for (place, &n) in counts.iter().enumerate() {
            for (ms, took) in ms.iter_mut().zip(builds::builds(entries, n, 1)?) {
                ms[place].extend(took.iter().map(|seconds| seconds.wall * 1e3));
            }
        }
    }
    Ok(entries.iter().zip(ms).map(|(entry, ms)| Course::new(&entry.name, ms)).collect())
}

impl Course {
    fn new(name: &str, rounds: Vec<Vec<f64>>) -> Self {
        Self { name: name.to_owned(), took: rounds.into_iter().map(Samples::from).collect() }
    }
}

/// Rays that a thread takes at a time.
const CHUNK: usize = 1024;

/// All rays on the threads of the surrounding pool.
fn trace(engine: &(dyn Engine + Sync), rays: &[Ray], hits: &mut [Option<Hit>]) {
    rays.par_chunks(CHUNK).zip(hits.par_chunks_mut(CHUNK)).for_each(|(rays, hits)| engine.closest(rays, hits));
}

/// Nanoseconds of each camera ray, engines and numbers of threads in turn.
#[expect(clippy::cast_precision_loss, reason = "rays are counted in thousands")]
fn of_rays(model: &Model, entries: &[Entry<'_>], counts: &[usize], effort: Effort) -> Result<Vec<Course>> {
    let pool = |&n: &usize| rayon::ThreadPoolBuilder::new().num_threads(n).build();
    let pools = counts.iter().map(pool).collect::<Result<Vec<_>, _>>()?;
    let build = |entry: &Entry<'_>| (entry.build)(rayon::current_num_threads());
    let engines = entries.iter().map(build).collect::<Result<Vec<_>>>()?;
    let shared: Vec<_> =
        entries.iter().zip(&engines).filter_map(|(entry, engine)| Some((&entry.name, engine.shared()?))).collect();
    let rays = sets::camera(model, effort.pick(16, 128, 256));
    let mut hits = vec![None; rays.len()];
    let mut ns = vec![vec![vec![]; counts.len()]; shared.len()];
    // Round 0 warms caches.
    for round in 0..=effort.pick(2, 5, 7) {
        for (place, pool) in pools.iter().enumerate() {
            for ((_, engine), ns) in shared.iter().zip(&mut ns) {
                let ((), took) = clock::time(|| pool.install(|| trace(*engine, &rays, &mut hits)));
                if round > 0 {
                    ns[place].push(took.wall * 1e9 / rays.len() as f64);
                }
            }
        }
    }
    Ok(shared.into_iter().zip(ns).map(|((name, _), ns)| Course::new(name, ns)).collect())
}

#[expect(clippy::cast_precision_loss, reason = "threads are few")]
fn show(chapter: &mut Chapter, [scene, what, label]: [&str; 3], unit: &'static str, counts: &[usize], all: &[Course]) {
    let mut table = Table::new(format!("{scene}: {what} by threads"), &["engine"]);
    table.head.extend(counts.iter().map(|&n| of_threads(n)));
    let mut series = vec![];
    for Course { name, took } in all {
        let cells = took.iter().map(|took| Cell::measured(took.clone(), unit));
        table.rows.push([Cell::text(name)].into_iter().chain(cells).collect());
        let points = counts.iter().zip(took).map(|(&n, took)| Point {
            label: of_threads(n),
            x: (n as f64).into(),
            y: took.clone(),
        });
        series.push(Series { name: name.clone(), points: points.collect(), is_joined: true });
    }
    chapter.tables.push(table);
    chapter.plots.push(Plot {
        title: format!("{scene}: {what} over threads"),
        x: Axis::log("threads"),
        y: Axis::log(label),
        series,
    });
}

fn of_threads(n: usize) -> String {
    if n == 1 { "1 thread".to_owned() } else { format!("{n} threads") }
}

#[cfg(test)]
mod tests {
    use canted_fixtures::scaffold_of;

    use super::*;

    #[test]
    fn all_threads_together_trace_every_ray() {
        let model = subjects::of_mesh(scaffold_of(1, false, 3));
        let (entries, _) = growing(&model).unwrap();
        let rays = sets::camera(&model, 40);
        assert!(rays.len() > CHUNK);
        for entry in &entries {
            let engine = (entry.build)(1).unwrap();
            let [mut alone, mut together] = [vec![None; rays.len()], vec![None; rays.len()]];
            engine.closest(&rays, &mut alone);
            trace(engine.shared().unwrap(), &rays, &mut together);
            assert!(alone == together && alone.iter().any(Option::is_some), "{}", entry.name);
        }
    }
}
