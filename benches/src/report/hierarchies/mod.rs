//! Hierarchies: build time against ray throughput of every builder and strategy, compared with the peers.

mod correlations;
mod external;
mod metrics;
mod overlap;
mod trees;

use anyhow::Result;

use super::builds;
use super::effort::Effort;
use super::model::{Axis, Cell, Chapter, Plot, Point, Series, Table};
use super::samples::{Samples, number};
use super::subjects;
use crate::models::Model;
use crate::wide::{
    alternate, closest_sets,
    engine::{Engine, Entry},
};
use metrics::{METRICS, Metrics};
use trees::{Family, Tree};

/// A measured BVH.
struct Measured {
    name: String,
    family: Family,
    build: Samples,
    /// Million rays per second.
    rate: Samples,
    /// `None` if the BVH does not report it.
    bytes_a_triangle: Option<f64>,
    metrics: Option<Metrics>,
}

/// Measures the chapter.
pub(super) fn chapter(effort: Effort) -> Result<Chapter> {
    let mut chapter = Chapter { id: "hierarchies", title: "Hierarchies: rays over build time", ..Chapter::default() };
    let names: &[&str] = effort.pick(
        &[subjects::SMALL],
        &["truss", "bunny"],
        &["truss", "scaffold", "hair_thin_tubes", "bunny", "sponza", "country_kitchen", "grid"],
    );
    if cfg!(not(feature = "peers")) {
        chapter
            .skipped
            .push("Embree and tinybvh: built without the feature `peers` (`cargo xtask report --peers`).".to_owned());
    }
    if cfg!(all(feature = "peers", not(target_feature = "avx2"))) {
        chapter
            .skipped
            .push("tinybvh: its bindings offer the wide BVH only if the compiler may assume AVX2.".to_owned());
    }
    let (mut standings, mut says) = (vec![], vec![]);
    for &name in names {
        match subjects::load(name)? {
            Some(model) => {
                let (standing, finding) = add(&mut chapter, name, &model, effort)?;
                standings.extend(standing);
                says.push(finding);
            }
            None => chapter.skipped.push(format!("{name}: the model is not available.")),
        }
    }
    says.insert(0, over_scenes(&standings));
    chapter.set_sentences(says);
    chapter.method = METHOD.map(str::to_owned).to_vec();
    chapter.method.insert(1, built(effort));
    Ok(chapter)
}

/// Meshes of more triangles are built fewer times, to keep a full report within an hour.
const LARGE: usize = 1 << 18;

/// Timed builds of each BVH.
fn n_builds(effort: Effort, n_triangles: usize) -> usize {
    effort.pick(2, 3, if n_triangles > LARGE { 3 } else { 5 })
}

/// How BVHs were built in this run.
fn built(effort: Effort) -> String {
    let flags = if cfg!(target_feature = "avx2") {
        "the same flags for AVX2 processors as ours"
    } else {
        "the same flags as ours, for the baseline of the processor family"
    };
    let (times, times_of_large) = (n_builds(effort, 0), n_builds(effort, usize::MAX));
    let fewer = if times_of_large < times {
        format!(" ({times_of_large} times above {LARGE} triangles)")
    } else {
        String::new()
    };
    format!(
        "Each BVH is built once without timing and then {times} times on one thread{fewer}, all in turn, in processor seconds of all \
         threads, because Embree builds on its own threads. `obvhs` is compiled with {flags}; Embree and ours select instructions at \
         run time. Bytes of Embree's BVHs are what its device allocates, without the meshes that it reads in place; BVHs of ours and \
         of `obvhs` include their triangles, and tinybvh does not report bytes."
    )
}

const METHOD: [&str; 5] = [
    "One run, one thread: all BVHs trace the same camera and diffuse rays, in turn every few milliseconds. Rates are per thread \
     second. BVHs of `obvhs` and other peers use their own traversal.",
    "The front consists of the BVHs that no other beats in both build time and rate.",
    "SAH cost, end-point overlap (Aila et al. 2013) and sums of area and volume are given for our binary BVHs, which share one \
     traversal. The correlation is that of the logarithms of a metric and of nanoseconds per ray over these BVHs, with the interval \
     of 95 in 100 resamplings. A metric known without tracing stands out if its interval overlaps no other. With several triangles \
     per leaf, sums of area and volume have fewer inner nodes. Tests are box and triangle tests.",
    "Other BVHs show what is available. WideBvh counts tests, all eight boxes of a node; its SAH cost is not comparable with that of \
     binary nodes. Binary BVHs of `obvhs` have public nodes, summed by the same formulas with one test per triangle of a leaf; their \
     traversal only reports triangle tests, and end-point overlap is defined for one unsplit triangle per leaf. Compressed BVHs of \
     `obvhs`, Embree and tinybvh expose neither nodes nor test counts.",
    "'midpoint' halves space and 'median' halves the count, both on a node's longest axis. Spatial splits (Stich et al. 2009) split \
     triangles by planes, at most as often as their names state: inner nodes bound the parts, leaves the unsplit triangles. \
     End-point overlap is undefined if several leaves contain a triangle.",
];

/// Our fastest BVH on a scene compared with the fastest peer.
struct Standing {
    scene: String,
    /// Rays per second, ours over theirs.
    ratio: f64,
    is_noise: bool,
}

/// On how many scenes ours is ahead, and by how much.
fn over_scenes(standings: &[Standing]) -> String {
    let [ahead, even, behind] = [
        |of: &Standing| !of.is_noise && of.ratio > 1.0,
        |of: &Standing| of.is_noise,
        |of: &Standing| !of.is_noise && of.ratio <= 1.0,
    ]
    .map(|is: fn(&Standing) -> bool| standings.iter().filter(|of| is(of)).count());
    let ratio = |a: &&Standing, b: &&Standing| a.ratio.total_cmp(&b.ratio);
    let (Some(most), Some(least)) = (standings.iter().max_by(ratio), standings.iter().min_by(ratio)) else {
        return String::new();
    };
    format!(
        "Compared with the fastest peer, our fastest BVH is ahead on {ahead} scenes, equal within noise on {even} and behind on \
         {behind}: it traces {} ({}) to {} ({}) times the rays.",
        number(least.ratio),
        least.scene,
        number(most.ratio),
        most.scene
    )
}

fn add(chapter: &mut Chapter, scene: &str, model: &Model, effort: Effort) -> Result<(Option<Standing>, String)> {
    let measured = measure(scene, model, effort)?;
    let front = front(&measured);
    plot(chapter, scene, &measured, &front);
    table(chapter, scene, &measured);
    let predicts = correlations::add(chapter, scene, &measured);
    for tree in measured.iter().filter(|tree| tree.family == Family::Wide) {
        chapter.claims.insert(format!("{scene}.{}", tree.name), number(tree.rate.median()));
    }
    let (standing, fastest) = fastest(scene, &measured, &front);
    if let Some(standing) = &standing {
        chapter.claims.insert(format!("{scene}.over-fastest-peer"), number(standing.ratio));
    }
    let names: Vec<String> = front.iter().map(|&i| format!("'{}'", measured[i].name)).collect();
    let finding = format!("On {scene} {fastest}; by build time the front is {}; {predicts}.", names.join(", "));
    Ok((standing, finding))
}

/// Our fastest BVH and the fastest peer, and how many of ours are on the front.
fn fastest(scene: &str, measured: &[Measured], front: &[usize]) -> (Option<Standing>, String) {
    let of = |is_ours: bool| {
        let rates = measured.iter().filter(|tree| tree.family.is_ours() == is_ours);
        rates.max_by(|a, b| a.rate.median().total_cmp(&b.rate.median()))
    };
    let n_ours = front.iter().filter(|&&i| measured[i].family.is_ours()).count();
    let on_front = format!("{n_ours} of {} BVHs on the front are ours", front.len());
    let (Some(ours), Some(peer)) = (of(true), of(false)) else { return (None, on_front) };
    let found = ours.rate.over(&peer.rate);
    let (ratio, is_noise) = (found.median, found.is_noise());
    let finding = if is_noise {
        format!("'{}' and '{}' are equally fast within noise, {on_front}", ours.name, peer.name)
    } else {
        let ratio = number(ratio);
        format!("'{}' traces {ratio} times the rays of the fastest peer, '{}', {on_front}", ours.name, peer.name)
    };
    (Some(Standing { scene: scene.to_owned(), ratio, is_noise }), finding)
}

#[expect(clippy::cast_precision_loss, reason = "rays and triangles are fewer than 2^53")]
fn measure(scene: &str, model: &Model, effort: Effort) -> Result<Vec<Measured>> {
    let trees = trees::all(scene, model);
    let n_triangles = model.mesh.triangles.len();
    let entries: Vec<&Entry<'_>> = trees.iter().map(|tree| &tree.entry).collect();
    let build = |entry: &&Entry<'_>| (entry.build)(rayon::current_num_threads());
    let engines = entries.iter().map(build).collect::<Result<Vec<Box<dyn Engine>>>>()?;
    let builds = builds::on_one_thread(&entries, n_builds(effort, n_triangles))?;
    let rays = closest_sets(model, &trees::any(&model.mesh)?, effort.pick(16, 128, 128)).concat();
    let (seconds, _) = alternate::closest(&engines, &rays, effort.pick(2, 5, 7));
    let mut measured = vec![];
    for (((Tree { entry, family, metrics }, engine), build), rounds) in
        trees.into_iter().zip(engines).zip(builds).zip(seconds)
    {
        measured.push(Measured {
            name: entry.name,
            family,
            build,
            rate: rounds.iter().map(|s| rays.len() as f64 / s.cpu * 1e-6).collect::<Vec<_>>().into(),
            bytes_a_triangle: engine.n_bytes().map(|n_bytes| n_bytes as f64 / n_triangles as f64),
            metrics: metrics.map(|metrics| metrics(&rays)).transpose()?,
        });
    }
    Ok(measured)
}

/// The BVHs that no other beats in both, by build time.
fn front(measured: &[Measured]) -> Vec<usize> {
    let beats = |a: &Measured, b: &Measured| {
        let (build, rate) = (a.build.median(), a.rate.median());
        build <= b.build.median() && rate >= b.rate.median() && (build < b.build.median() || rate > b.rate.median())
    };
    let mut front: Vec<usize> =
        (0..measured.len()).filter(|&i| !measured.iter().any(|other| beats(other, &measured[i]))).collect();
    front.sort_by(|&a, &b| measured[a].build.median().total_cmp(&measured[b].build.median()));
    front
}

fn plot(chapter: &mut Chapter, scene: &str, measured: &[Measured], front: &[usize]) {
    let point = |tree: &Measured| Point { label: tree.name.clone(), x: tree.build.scaled(1e3), y: tree.rate.clone() };
    let mut series: Vec<Series> = Family::ALL
        .iter()
        .map(|&family| Series {
            name: family.name().to_owned(),
            points: measured.iter().filter(|tree| tree.family == family).map(point).collect(),
            is_joined: false,
        })
        .filter(|series| !series.points.is_empty())
        .collect();
    let on_front = front.iter().map(|&i| point(&measured[i])).collect();
    series.push(Series { name: "front".to_owned(), points: on_front, is_joined: true });
    chapter.plots.push(Plot {
        title: format!("{scene}: rays per second over build time"),
        x: Axis::log("build on one thread, ms"),
        y: Axis::linear("million rays per second"),
        series,
    });
}

fn table(chapter: &mut Chapter, scene: &str, measured: &[Measured]) {
    let mut table = Table::new(format!("{scene}: BVHs"), &["BVH", "build", "M rays/s", "bytes per triangle"]);
    table.head.extend(METRICS.iter().map(|(name, _)| (*name).to_owned()));
    for tree in measured {
        let mut row = vec![
            Cell::text(tree.name.clone()),
            Cell::measured(tree.build.scaled(1e3), "ms"),
            Cell::measured(tree.rate.clone(), ""),
            Cell::text(tree.bytes_a_triangle.map_or("–".to_owned(), number)),
        ];
        row.extend(
            METRICS.iter().map(|(_, of)| Cell::text(tree.metrics.as_ref().map_or("–".to_owned(), |m| number(of(m))))),
        );
        table.rows.push(row);
    }
    chapter.tables.push(table);
}
