//! Hierarchies: what a tree costs to build and what it buys in rays, every builder and strategy beside the peers.

mod metrics;
mod trees;

use anyhow::Result;

use super::effort::Effort;
use super::fits;
use super::growth;
use super::model::{Axis, Cell, Chapter, Plot, Point, Series, Table};
use super::samples::{Samples, number};
use super::subjects;
use crate::models::Model;
use crate::wide::{closest_sets, duel, engine::Engine};
use metrics::{METRICS, Metrics, N_KNOWN};
use trees::{Family, Tree};

/// One tree, measured.
struct Measured {
    name: String,
    family: Family,
    build: Samples,
    /// Million rays a second.
    rate: Samples,
    bytes_a_triangle: f64,
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
            .push("tinybvh: its bindings offer the wide tree only where the compiler may assume AVX2.".to_owned());
    }
    let (mut standings, mut says) = (vec![], vec![]);
    for &name in names {
        match subjects::load(name)? {
            Some(model) => {
                let (standing, finding) = add(&mut chapter, name, &model, effort)?;
                standings.extend(standing);
                says.push(finding);
            }
            None => chapter.skipped.push(format!("{name}: the model is not at hand.")),
        }
    }
    says.insert(0, over_scenes(&standings));
    chapter.tell(says);
    chapter.method = METHOD.map(str::to_owned).to_vec();
    Ok(chapter)
}

const METHOD: [&str; 3] = [
    "One run, one thread: each tree is built so often, then all answer the same camera and diffuse rays in turn every few \
     milliseconds. Rates are of thread seconds. Trees of `obvhs` and of other peers are walked by their own code.",
    "The front joins the trees that no other beats in both build time and rate.",
    "SAH cost, end-point overlap (Aila et al. 2013) and sums of area and volume are of binary trees, whose walk is the same; the \
     correlation is that of the logarithms of a metric and of nanoseconds a ray over these trees. Tests are boxes and triangles.",
];

/// Our fastest tree on a scene beside the fastest of the peers.
struct Standing {
    scene: String,
    /// Rays a second, ours over theirs.
    ratio: f64,
    is_noise: bool,
}

/// On how many scenes ours is ahead, and how far.
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
        "Beside the fastest tree of all peers our fastest is ahead on {ahead} scenes, even but for noise on {even} and behind on \
         {behind}: it traces from {} ({}) to {} ({}) times the rays.",
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
    let best = metric_table(chapter, scene, &measured);
    for tree in measured.iter().filter(|tree| tree.family == Family::Wide) {
        chapter.claims.insert(format!("{scene}.{}", tree.name), number(tree.rate.median()));
    }
    let predicts = best.map_or_else(String::new, |(name, r)| {
        format!("; of what is known without tracing {name} goes best with the time of binary trees (r = {r:.2})")
    });
    let (standing, fastest) = fastest(scene, &measured, &front);
    Ok((standing, format!("On {scene} {fastest}{predicts}.")))
}

/// The fastest tree of ours and of the peers, and how many stand on the front.
fn fastest(scene: &str, measured: &[Measured], front: &[usize]) -> (Option<Standing>, String) {
    let of = |is_ours: bool| {
        let rates = measured.iter().filter(|tree| tree.family.is_ours() == is_ours);
        rates.max_by(|a, b| a.rate.median().total_cmp(&b.rate.median()))
    };
    let n_ours = front.iter().filter(|&&i| measured[i].family.is_ours()).count();
    let on_front = format!("{n_ours} of {} trees on the front are ours", front.len());
    let (Some(ours), Some(peer)) = (of(true), of(false)) else { return (None, on_front) };
    let ratio = ours.rate.median() / peer.rate.median();
    let is_noise = ours.rate.is_noise_beside(&peer.rate);
    let told = if is_noise {
        format!("'{}' and '{}' trace as fast as each other but for noise, {on_front}", ours.name, peer.name)
    } else {
        let ratio = number(ratio);
        format!("'{}' traces {ratio} times the rays of the fastest peer, '{}', {on_front}", ours.name, peer.name)
    };
    (Some(Standing { scene: scene.to_owned(), ratio, is_noise }), told)
}

#[expect(clippy::cast_precision_loss, reason = "rays and triangles are fewer than 2^53")]
fn measure(scene: &str, model: &Model, effort: Effort) -> Result<Vec<Measured>> {
    let trees = trees::all(scene, model);
    let n_triangles = model.mesh.triangles.len();
    let (mut engines, mut builds): (Vec<Box<dyn Engine>>, _) = (vec![], vec![]);
    for tree in &trees {
        engines.push((tree.entry.build)(rayon::current_num_threads())?);
        builds.push(growth::build_seconds(&tree.entry, effort.pick(2, 3, 5))?);
    }
    let rays = closest_sets(model, &trees::any(&model.mesh)?, effort.pick(16, 48, 128)).concat();
    let (seconds, _) = duel::closest(&engines, &rays, effort.pick(2, 5, 7));
    let mut measured = vec![];
    for (((Tree { entry, family, metrics }, engine), build), rounds) in
        trees.into_iter().zip(engines).zip(builds).zip(seconds)
    {
        measured.push(Measured {
            name: entry.name,
            family,
            build,
            rate: rounds.iter().map(|s| rays.len() as f64 / s.cpu * 1e-6).collect::<Vec<_>>().into(),
            bytes_a_triangle: engine.n_bytes() as f64 / n_triangles as f64,
            metrics: metrics.map(|metrics| metrics(&rays)).transpose()?,
        });
    }
    Ok(measured)
}

/// Those that no other beats in both, by build time.
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
        title: format!("{scene}: rays a second over build time"),
        x: Axis::log("build on one thread, ms"),
        y: Axis::linear("million rays a second"),
        series,
    });
}

fn table(chapter: &mut Chapter, scene: &str, measured: &[Measured]) {
    let mut table = Table::new(format!("{scene}: trees"), &["tree", "build", "M rays/s", "bytes a triangle"]);
    table.head.extend(METRICS.iter().map(|(name, _)| (*name).to_owned()));
    for tree in measured {
        let mut row = vec![
            Cell::text(tree.name.clone()),
            Cell::measured(tree.build.scaled(1e3), "ms"),
            Cell::measured(tree.rate.clone(), ""),
            Cell::text(number(tree.bytes_a_triangle)),
        ];
        row.extend(
            METRICS.iter().map(|(_, of)| Cell::text(tree.metrics.as_ref().map_or("–".to_owned(), |m| number(of(m))))),
        );
        table.rows.push(row);
    }
    chapter.tables.push(table);
}

/// The correlation of each metric with time over binary trees; the strongest of those known without tracing.
fn metric_table(chapter: &mut Chapter, scene: &str, measured: &[Measured]) -> Option<(&'static str, f64)> {
    let mut table = Table::new(format!("{scene}: which metric predicts time"), &["metric", "correlation", "trees"]);
    let mut best: Option<(&'static str, f64)> = None;
    for (i, (name, of)) in METRICS.into_iter().enumerate() {
        let pairs: Vec<(f64, f64)> = measured
            .iter()
            .filter_map(|tree| Some((of(tree.metrics.as_ref()?).ln(), -tree.rate.median().ln())))
            .filter(|(metric, _)| metric.is_finite())
            .collect();
        let found = fits::correlation(&pairs);
        let text = found.map_or("–".to_owned(), |r| format!("{r:.3}"));
        table.rows.push(vec![Cell::text(name), Cell::text(text), Cell::text(pairs.len().to_string())]);
        if let Some(r) = found.filter(|r| i < N_KNOWN && best.is_none_or(|(_, best)| *r > best)) {
            best = Some((name, r));
        }
    }
    chapter.tables.push(table);
    best
}
