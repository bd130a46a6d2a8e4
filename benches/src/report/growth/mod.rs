//! Growth: how build and tracing grow with the number of triangles and of threads, beside the peers.
//!
//! Exponents are slopes of least squares through logarithms.

mod threads;

use anyhow::Result;

use super::builds;
use super::effort::Effort;
use super::fits::{self, Line, Unfit};
use super::model::{Axis, Cell, Chapter, Plot, Point, Series, Table};
use super::samples::Samples;
use super::subjects;
use crate::clock::Seconds;
use crate::models::Model;
use crate::options::Options;
use crate::wide::{
    duel,
    engine::{Entry, Owner},
    entries, growth, sets,
};

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
    let (mut says, mut left_out) = (vec![], vec![]);
    for (scene, generate) in growth::SCENES {
        let mut engines = vec![];
        let mut sizes = vec![];
        for &log2 in &log2s {
            let model = subjects::of_mesh(generate(log2));
            let n_triangles = model.mesh.triangles.len();
            let (entries, careful) = growing(&model)?;
            left_out = careful;
            engines = entries.iter().map(|entry| (entry.name.clone(), entry.owner)).collect();
            sizes.push((n_triangles, measure(&model, &entries, effort)?));
        }
        says.push(show(&mut chapter, scene, &engines, &sizes));
    }
    says.push(threads::add(&mut chapter, effort)?);
    chapter.tell(says);
    chapter.method = METHOD.map(str::to_owned).to_vec();
    chapter.method.push(not_grown(&left_out, cfg!(all(feature = "peers", target_feature = "avx2"))));
    Ok(chapter)
}

/// What does not grow with the others, and where it is measured: tinybvh only in builds that have it.
fn not_grown(careful: &[String], has_tinybvh: bool) -> String {
    let tinybvh = if has_tinybvh {
        ""
    } else {
        ", but not tinybvh, which takes the feature `peers` and a compiler that may assume AVX2"
    };
    format!(
        "Left out are {}, `obvhs` with more care than its medium preset, and tinybvh: they build for minutes where triangles are \
         most, or, as tinybvh, may end the program. The chapter of hierarchies has them at sizes of real models{tinybvh}.",
        careful.join(", ")
    )
}

const METHOD: [&str; 3] = [
    "Scaffolds of crossing struts and grids of terrain come in every size; a denser scaffold has more struts in each ray's way. \
     Builds are on one thread, all engines in turn, in seconds of the processor over all threads of the program, because Embree \
     builds on threads of its own; camera rays are in thread seconds, engines in turn every few milliseconds.",
    "Exponents are of triangles, fitted by least squares to logarithms, ± the standard error that the line leaves: a build of \
     exponent 1 is linear.",
    "The charts of Silva's study that are lost, seconds over primitives with a hierarchy and seconds over threads, are here. On \
     several threads builds and rays are timed by the clock on the wall, engines and numbers of threads in turn; threads take 1,024 \
     rays at a time.",
];

/// The engines that grow, and the names of those that are too careful to.
fn growing(model: &Model) -> Result<(Vec<Entry<'_>>, Vec<String>)> {
    let is_careful = |entry: &Entry<'_>| TOO_CAREFUL.iter().any(|word| entry.name.contains(word));
    let all = entries::growing(model, &Options::read(std::iter::empty())?);
    let (careful, growing): (Vec<_>, Vec<_>) = all.into_iter().partition(is_careful);
    let mut names: Vec<String> = careful.iter().map(|entry| format!("'{}'", entry.name)).collect();
    // Ours stand once for each kernel.
    names.dedup();
    Ok((growing, names))
}

#[expect(clippy::cast_precision_loss, reason = "rays are counted in thousands")]
fn measure(model: &Model, entries: &[Entry<'_>], effort: Effort) -> Result<Vec<Took>> {
    let rounds = if model.mesh.triangles.len() <= 1 << 20 { effort.pick(2, 3, 5) } else { 2 };
    // The tree that is kept is the same on any number of threads, and warms the caches for those that are timed.
    let build = |entry: &Entry<'_>| (entry.build)(rayon::current_num_threads());
    let engines = entries.iter().map(build).collect::<Result<Vec<_>>>()?;
    let builds = builds::on_one_thread(&entries.iter().collect::<Vec<_>>(), rounds)?;
    let camera = sets::camera(model, effort.pick(16, 128, 128));
    let (seconds, _) = duel::closest(&engines, &camera, effort.pick(2, 5, 7));
    let each = |rounds: &Vec<Seconds>| -> Samples {
        rounds.iter().map(|seconds| seconds.cpu * 1e9 / camera.len() as f64).collect::<Vec<_>>().into()
    };
    Ok(builds.into_iter().zip(&seconds).map(|(build, rounds)| Took { build, ray: each(rounds) }).collect())
}

#[expect(clippy::cast_precision_loss, reason = "triangles are fewer than 2^53")]
fn show(chapter: &mut Chapter, scene: &str, engines: &[(String, Owner)], sizes: &[(usize, Vec<Took>)]) -> String {
    type Pick = fn(&Took) -> &Samples;
    const PICKS: [(&str, &str, Pick); 2] =
        [("build", "s", |took| &took.build), ("a camera ray", "ns", |took| &took.ray)];
    let mut table = Table::new(format!("{scene}: exponents"), &["engine", "build ~ triangles^", "ray ~ triangles^"]);
    let exponent = |engine: usize, pick: Pick| {
        let point = |(n, tooks): &(usize, Vec<Took>)| (Samples::from(*n as f64), pick(&tooks[engine]).median());
        fits::exponent(&sizes.iter().map(point).collect::<Vec<_>>())
    };
    for (engine, (name, _)) in engines.iter().enumerate() {
        let cells = PICKS.map(|(_, _, pick)| Cell::text(fits::told(exponent(engine, pick))));
        table.rows.push([vec![Cell::text(name.clone())], cells.to_vec()].concat());
    }
    for (what, unit, pick) in PICKS {
        let series = engines.iter().enumerate().map(|(engine, (name, _))| Series {
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
        sizes_table.head.extend(engines.iter().map(|(name, _)| name.clone()));
        for (n, tooks) in sizes {
            let cells = tooks.iter().map(|took| Cell::measured(pick(took).clone(), unit));
            sizes_table.rows.push([Cell::text(n.to_string())].into_iter().chain(cells).collect());
        }
        chapter.tables.push(sizes_table);
    }
    chapter.tables.push(table);
    let fitted = |wanted: Owner| -> Vec<Fitted<'_>> {
        let of = (0..engines.len()).filter(|&engine| engines[engine].1 == wanted);
        of.map(|engine| (&engines[engine].0[..], exponent(engine, PICKS[0].2))).collect()
    };
    let ours = fitted(Owner::Ours)[0];
    if let Ok(line) = ours.1 {
        chapter.claims.insert(format!("{scene}.build-exponent"), format!("{:.2}", line.slope));
    }
    format!("On {scene} {}.", beside(&ours, &fitted(Owner::Peer)))
}

/// An engine, and how its builds grow.
type Fitted<'a> = (&'a str, Result<Line, Unfit>);

/// Ours beside the least and the greatest exponent of the peers.
fn beside(ours: &Fitted<'_>, peers: &[Fitted<'_>]) -> String {
    let mut lines: Vec<(&str, Line)> = peers.iter().filter_map(|(name, fit)| Some((*name, fit.ok()?))).collect();
    lines.sort_by(|a, b| a.1.slope.total_cmp(&b.1.slope));
    let is_noise = |line: &Line| ours.1.is_ok_and(|ours| (ours.slope - line.slope).abs() <= ours.error + line.error);
    let told = |(name, line): &(&str, Line)| {
        let noise = if is_noise(line) { ", apart from ours by noise" } else { "" };
        format!("{line} ('{name}'{noise})")
    };
    let theirs = match &lines[..] {
        [] => "no peer's has one".to_owned(),
        [one] => format!("that of the only peer's {}", told(one)),
        [least, .., greatest] => format!("those of peers' from {} to {}", told(least), told(greatest)),
    };
    format!("the exponent of triangles is {} for builds of '{}', {theirs}", fits::told(ours.1), ours.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ours_stands_beside_every_peer() {
        let line = |slope| Ok(Line { slope, error: 0.02 });
        let ours = ("a", line(1.0));
        let two = beside(&ours, &[("b", line(1.2)), ("c", line(1.03)), ("d", Err(Unfit::Few))]);
        let begin = "the exponent of triangles is 1.00 ±0.02 for builds of 'a', ";
        let range = "from 1.03 ±0.02 ('c', apart from ours by noise) to 1.20 ±0.02 ('b')";
        assert_eq!(two, format!("{begin}those of peers' {range}"));
        let one = beside(&ours, &[("b", line(1.2))]);
        assert_eq!(one, format!("{begin}that of the only peer's 1.20 ±0.02 ('b')"));
        assert!(beside(&ours, &[]).ends_with("no peer's has one"));
    }

    #[test]
    fn nothing_is_said_to_be_elsewhere_that_is_nowhere() {
        let careful = ["'a'".to_owned(), "'b'".to_owned()];
        assert!(not_grown(&careful, true).ends_with("at sizes of real models."));
        let without = not_grown(&careful, false);
        assert!(without.starts_with("Left out are 'a', 'b', ") && without.contains("but not tinybvh"), "{without}");
    }
}
