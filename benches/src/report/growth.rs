//! Growth: how build and tracing grow with the number of triangles and of threads, beside a peer.
//!
//! Exponents are slopes of least squares through logarithms.

use anyhow::{Context, Result};

use super::effort::Effort;
use super::fits;
use super::model::{Axis, Cell, Chapter, Plot, Point, Series, Table};
use super::samples::Samples;
use super::subjects;
use crate::clock::{self, Seconds};
use crate::models::Model;
use crate::options::Options;
use crate::wide::{duel, engine::Entry, entries, growth, sets};

/// Engines whose names contain none of these grow with the others: the careful ones take minutes at the end.
const TOO_CAREFUL: [&str; 3] = ["quality", "high", "robust"];

/// Seconds of one engine at one size.
struct Took {
    build: Samples,
    /// Nanoseconds a camera ray.
    ray: Samples,
}

/// Measures the chapter.
pub(super) fn chapter(effort: Effort) -> Result<Chapter> {
    let mut chapter = Chapter { id: "growth", title: "Growth: time over triangles and threads", ..Chapter::default() };
    let log2s: Vec<u32> = effort.pick(vec![8, 10], vec![10, 12, 14, 16], (10..=24).step_by(2).collect());
    let mut says = vec![];
    for (scene, generate) in growth::SCENES {
        let mut names = vec![];
        let mut sizes = vec![];
        for &log2 in &log2s {
            let model = subjects::of_mesh(generate(log2));
            let n_triangles = model.mesh.triangles.len();
            let entries = growing(&model)?;
            names = entries.iter().map(|entry| entry.name.clone()).collect();
            sizes.push((n_triangles, measure(&model, &entries, effort)?));
        }
        says.push(show(&mut chapter, scene, &names, &sizes));
    }
    says.push(threads(&mut chapter, effort)?);
    chapter.tell(says);
    chapter.method = METHOD.map(str::to_owned).to_vec();
    Ok(chapter)
}

const METHOD: [&str; 3] = [
    "Scaffolds of crossing struts and grids of terrain come in every size; a denser scaffold has more struts in each ray's way. \
     Builds on one thread and camera rays in thread seconds, engines in turn every few milliseconds.",
    "Exponents are of triangles, fitted by least squares to logarithms with the standard error that the line leaves: a build of \
     exponent 1 is linear.",
    "The chart of Silva's study that is lost, seconds over primitives with a hierarchy, is this one; builds on \
     several threads are timed by the clock on the wall.",
];

fn growing(model: &Model) -> Result<Vec<Entry<'_>>> {
    let mut entries = entries::growing(model, &Options::read(std::iter::empty())?);
    entries.retain(|entry| !TOO_CAREFUL.iter().any(|word| entry.name.contains(word)));
    Ok(entries)
}

/// Seconds of each build on a number of threads, so often.
fn builds(entry: &Entry<'_>, n_threads: usize, repeats: usize) -> Result<Vec<Seconds>> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build()?;
    let mut seconds = vec![];
    for _ in 0..repeats {
        let (built, took) = pool.install(|| clock::time(|| (entry.build)(n_threads).map(drop)));
        built.with_context(|| format!("cannot build {}", entry.name))?;
        seconds.push(took);
    }
    Ok(seconds)
}

/// Thread seconds of each build on one thread, which a neighbour does not lengthen.
pub(super) fn build_seconds(entry: &Entry<'_>, repeats: usize) -> Result<Samples> {
    Ok(builds(entry, 1, repeats)?.iter().map(|seconds| seconds.cpu).collect::<Vec<_>>().into())
}

#[expect(clippy::cast_precision_loss, reason = "rays are counted in thousands")]
fn measure(model: &Model, entries: &[Entry<'_>], effort: Effort) -> Result<Vec<Took>> {
    let repeats = if model.mesh.triangles.len() <= 1 << 20 { effort.pick(2, 3, 5) } else { 2 };
    let (mut engines, mut builds) = (vec![], vec![]);
    for entry in entries {
        // The tree that is kept is the same on any number of threads, and warms the caches for those that are timed.
        engines.push((entry.build)(rayon::current_num_threads())?);
        builds.push(build_seconds(entry, repeats)?);
    }
    let camera = sets::camera(model, effort.pick(16, 64, 128));
    let (seconds, _) = duel::closest(&engines, &camera, effort.pick(2, 5, 7));
    let each = |rounds: &Vec<Seconds>| -> Samples {
        rounds.iter().map(|seconds| seconds.cpu * 1e9 / camera.len() as f64).collect::<Vec<_>>().into()
    };
    Ok(builds.into_iter().zip(&seconds).map(|(build, rounds)| Took { build, ray: each(rounds) }).collect())
}

#[expect(clippy::cast_precision_loss, reason = "triangles are fewer than 2^53")]
fn show(chapter: &mut Chapter, scene: &str, names: &[String], sizes: &[(usize, Vec<Took>)]) -> String {
    type Pick = fn(&Took) -> &Samples;
    const PICKS: [(&str, &str, Pick); 2] =
        [("build", "s", |took| &took.build), ("a camera ray", "ns", |took| &took.ray)];
    let mut table = Table::new(format!("{scene}: exponents"), &["engine", "build ~ triangles^", "ray ~ triangles^"]);
    let exponent = |engine: usize, pick: Pick| {
        let point = |(n, tooks): &(usize, Vec<Took>)| (Samples::from(*n as f64), pick(&tooks[engine]).median());
        fits::exponent(&sizes.iter().map(point).collect::<Vec<_>>())
    };
    for (engine, name) in names.iter().enumerate() {
        let cells = PICKS.map(|(_, _, pick)| Cell::text(fits::told(exponent(engine, pick))));
        table.rows.push([vec![Cell::text(name.clone())], cells.to_vec()].concat());
    }
    for (what, unit, pick) in PICKS {
        let series = names.iter().enumerate().map(|(engine, name)| Series {
            name: name.clone(),
            points: sizes
                .iter()
                .map(|(n, tooks)| Point {
                    label: format!("{n} triangles"),
                    x: (*n as f64).into(),
                    y: pick(&tooks[engine]).clone(),
                })
                .collect(),
            is_joined: true,
        });
        chapter.plots.push(Plot {
            title: format!("{scene}: {what} over triangles"),
            x: Axis::log("triangles"),
            y: Axis::log(format!("{what}, {unit}")),
            series: series.collect(),
        });
        let mut sizes_table = Table::new(format!("{scene}: {what}"), &["triangles"]);
        sizes_table.head.extend(names.iter().cloned());
        for (n, tooks) in sizes {
            let cells = tooks.iter().map(|took| Cell::measured(pick(took).clone(), unit));
            sizes_table.rows.push([Cell::text(n.to_string())].into_iter().chain(cells).collect());
        }
        chapter.tables.push(sizes_table);
    }
    chapter.tables.push(table);
    let [ours, peer] = [0, names.len() - 1].map(|engine| (&names[engine], exponent(engine, PICKS[0].2)));
    if let Ok(line) = ours.1 {
        chapter.claims.insert(format!("{scene}.build-exponent"), format!("{:.2}", line.slope));
    }
    let noise = match (ours.1, peer.1) {
        (Ok(a), Ok(b)) if (a.slope - b.slope).abs() <= a.error + b.error => "; that they differ is noise",
        _ => "",
    };
    format!(
        "On {scene} the exponent of triangles is {} for builds of '{}', and {} for those of '{}'{noise}.",
        fits::told(ours.1),
        ours.0,
        fits::told(peer.1),
        peer.0
    )
}

/// Builds of one size on one thread, two, four … and all.
#[expect(clippy::cast_precision_loss, reason = "threads are few")]
fn threads(chapter: &mut Chapter, effort: Effort) -> Result<String> {
    let all = std::thread::available_parallelism().map_or(1, usize::from);
    let mut counts: Vec<usize> = (0..).map(|log2| 1 << log2).take_while(|&n| n < all).collect();
    counts.push(all);
    let (scene, generate) = growth::SCENES[0];
    let model = subjects::of_mesh(generate(effort.pick(10, 16, 20)));
    let n_triangles = model.mesh.triangles.len();
    let entries: Vec<_> = growing(&model)?.into_iter().filter(|entry| entry.is_parallel).collect();
    let mut series = vec![];
    let mut table = Table::new(format!("{scene}, {n_triangles} triangles: builds by threads"), &["engine"]);
    table.head.extend(counts.iter().map(|n| format!("{n} threads")));
    let mut says = vec![];
    for entry in &entries {
        let mut took = vec![];
        for &n in &counts {
            let seconds = builds(entry, n, effort.pick(2, 5, 7))?;
            took.push(Samples::from(seconds.iter().map(|seconds| seconds.wall).collect::<Vec<_>>()));
        }
        let cells = took.iter().map(|seconds| Cell::measured(seconds.scaled(1e3), "ms"));
        table.rows.push([Cell::text(entry.name.clone())].into_iter().chain(cells).collect());
        says.push(super::samples::faster(("all threads", &took[counts.len() - 1]), ("one", &took[0])));
        let points = counts.iter().zip(took).map(|(&n, seconds)| Point {
            label: format!("{n} threads"),
            x: (n as f64).into(),
            y: seconds.scaled(1e3),
        });
        series.push(Series { name: entry.name.clone(), points: points.collect(), is_joined: true });
    }
    chapter.tables.push(table);
    chapter.plots.push(Plot {
        title: format!("{scene}, {n_triangles} triangles: build over threads"),
        x: Axis::log("threads"),
        y: Axis::log("build, ms"),
        series,
    });
    Ok(format!("Building '{}' on {all} threads: {}.", entries[0].name, says[0]))
}
