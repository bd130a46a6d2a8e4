//! Growth: how build and traversal times depend on the number of triangles and threads, compared with the peers.
//!
//! Exponents are least-squares slopes of logarithms.

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
    alternate,
    engine::{Entry, Owner},
    entries, growth, sets,
};

/// Engines with these words in their names are skipped: they build for minutes at the largest sizes.
const TOO_SLOW: [&str; 3] = ["quality", "high", "robust"];

/// Seconds of one engine at one size.
struct Took {
    build: Samples,
    /// Nanoseconds per camera ray.
    ray: Samples,
}

/// Measures the chapter.
pub(super) fn chapter(effort: Effort) -> Result<Chapter> {
    let mut chapter = Chapter { id: "growth", title: "Growth: time over triangles and threads", ..Chapter::default() };
    let log2s: Vec<u32> = effort.pick(vec![8, 10], vec![10, 12, 14, 16], (10..=24).step_by(2).collect());
    let (mut says, mut slow_engines) = (vec![], vec![]);
    for (scene, generate) in growth::SCENES {
        let mut engines = vec![];
        let mut sizes = vec![];
        for &log2 in &log2s {
            let model = subjects::of_mesh(generate(log2));
            let n_triangles = model.mesh.triangles.len();
            let (entries, slow) = growing(&model)?;
            slow_engines = slow;
            engines = entries.iter().map(|entry| (entry.name.clone(), entry.owner)).collect();
            sizes.push((n_triangles, measure(&model, &entries, effort)?));
        }
        says.push(show(&mut chapter, scene, &engines, &sizes));
    }
    says.push(threads::add(&mut chapter, effort)?);
    chapter.set_sentences(says);
    chapter.method = METHOD.map(str::to_owned).to_vec();
    chapter.method.push(skipped_engines(&slow_engines, cfg!(all(feature = "peers", target_feature = "avx2"))));
    Ok(chapter)
}

/// Which engines are skipped and where they are measured: tinybvh only in builds that include it.
fn skipped_engines(slow: &[String], has_tinybvh: bool) -> String {
    let tinybvh = if has_tinybvh {
        ""
    } else {
        ", except tinybvh, which requires the feature `peers` and a compiler that may assume AVX2"
    };
    format!(
        "Skipped engines: {}, `obvhs` presets slower than medium, and tinybvh. They build for minutes at the largest sizes or, like \
         tinybvh, may crash the program. The chapter on hierarchies measures them on real models{tinybvh}.",
        slow.join(", ")
    )
}

const METHOD: [&str; 3] = [
    "Scaffolds of crossing struts and terrain grids are generated in every size; a denser scaffold has more struts along each ray. \
     Builds run on one thread, all engines in turn, in processor seconds of all threads, because Embree builds on its own threads; \
     camera rays are in thread seconds, engines in turn every few milliseconds.",
    "Exponents of the number of triangles are fitted by least squares to logarithms, ± the standard error of the fit; a build of \
     exponent 1 is linear.",
    "Two lost charts of Silva's study, seconds over primitives with a hierarchy and seconds over threads, are repeated here. Builds \
     and rays on several threads are in wall time, engines and thread counts in turn; threads take 1,024 rays at a time.",
];

/// The engines to measure, and the names of those that are too slow.
fn growing(model: &Model) -> Result<(Vec<Entry<'_>>, Vec<String>)> {
    let is_slow = |entry: &Entry<'_>| TOO_SLOW.iter().any(|word| entry.name.contains(word));
    let all = entries::growing(model, &Options::read(std::iter::empty())?);
    let (slow, growing): (Vec<_>, Vec<_>) = all.into_iter().partition(is_slow);
    let mut names: Vec<String> = slow.iter().map(|entry| format!("'{}'", entry.name)).collect();
    // Ours occur once for each kernel.
    names.dedup();
    Ok((growing, names))
}

#[expect(clippy::cast_precision_loss, reason = "rays are counted in thousands")]
fn measure(model: &Model, entries: &[Entry<'_>], effort: Effort) -> Result<Vec<Took>> {
    let rounds = if model.mesh.triangles.len() <= 1 << 20 { effort.pick(2, 3, 5) } else { 2 };
    // The BVH does not depend on the number of threads; this build also warms the caches for the timed ones.
    let build = |entry: &Entry<'_>| (entry.build)(rayon::current_num_threads());
    let engines = entries.iter().map(build).collect::<Result<Vec<_>>>()?;
    let builds = builds::on_one_thread(&entries.iter().collect::<Vec<_>>(), rounds)?;
    let camera = sets::camera(model, effort.pick(16, 128, 128));
    let (seconds, _) = alternate::closest(&engines, &camera, effort.pick(2, 5, 7));
    let each = |rounds: &Vec<Seconds>| -> Samples {
        rounds.iter().map(|seconds| seconds.cpu * 1e9 / camera.len() as f64).collect::<Vec<_>>().into()
    };
    Ok(builds.into_iter().zip(&seconds).map(|(build, rounds)| Took { build, ray: each(rounds) }).collect())
}

#[expect(clippy::cast_precision_loss, reason = "triangles are fewer than 2^53")]
fn show(chapter: &mut Chapter, scene: &str, engines: &[(String, Owner)], sizes: &[(usize, Vec<Took>)]) -> String {
    type Pick = fn(&Took) -> &Samples;
    const PICKS: [(&str, &str, Pick); 2] = [("build", "s", |took| &took.build), ("camera ray", "ns", |took| &took.ray)];
    let mut table = Table::new(format!("{scene}: exponents"), &["engine", "build ~ triangles^", "ray ~ triangles^"]);
    let exponent = |engine: usize, pick: Pick| {
        let point = |(n, tooks): &(usize, Vec<Took>)| (Samples::from(*n as f64), pick(&tooks[engine]).median());
        fits::exponent(&sizes.iter().map(point).collect::<Vec<_>>())
    };
    for (engine, (name, _)) in engines.iter().enumerate() {
        let cells = PICKS.map(|(_, _, pick)| Cell::text(fits::formatted(exponent(engine, pick))));
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
    format!("On {scene} {}.", compared(&ours, &fitted(Owner::Peer)))
}

/// An engine and the exponent of its builds.
type Fitted<'a> = (&'a str, Result<Line, Unfit>);

/// Our exponent compared with the smallest and the greatest of the peers.
fn compared(ours: &Fitted<'_>, peers: &[Fitted<'_>]) -> String {
    let mut lines: Vec<(&str, Line)> = peers.iter().filter_map(|(name, fit)| Some((*name, fit.ok()?))).collect();
    lines.sort_by(|a, b| a.1.slope.total_cmp(&b.1.slope));
    let is_noise = |line: &Line| ours.1.is_ok_and(|ours| (ours.slope - line.slope).abs() <= ours.error + line.error);
    let described = |(name, line): &(&str, Line)| {
        let noise = if is_noise(line) { ", equal to ours within noise" } else { "" };
        format!("{line} ('{name}'{noise})")
    };
    let theirs = match &lines[..] {
        [] => "no peer has one".to_owned(),
        [one] => format!("those of the only peer {}", described(one)),
        [least, .., greatest] => format!("those of the peers {} to {}", described(least), described(greatest)),
    };
    format!("builds of '{}' have exponent {} over triangles, {theirs}", ours.0, fits::formatted(ours.1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ours_is_compared_with_every_peer() {
        let line = |slope| Ok(Line { slope, error: 0.02 });
        let ours = ("a", line(1.0));
        let two = compared(&ours, &[("b", line(1.2)), ("c", line(1.03)), ("d", Err(Unfit::Few))]);
        let begin = "builds of 'a' have exponent 1.00 ±0.02 over triangles, ";
        let range = "1.03 ±0.02 ('c', equal to ours within noise) to 1.20 ±0.02 ('b')";
        assert_eq!(two, format!("{begin}those of the peers {range}"));
        let one = compared(&ours, &[("b", line(1.2))]);
        assert_eq!(one, format!("{begin}those of the only peer 1.20 ±0.02 ('b')"));
        assert!(compared(&ours, &[]).ends_with("no peer has one"));
    }

    #[test]
    fn skipped_engines_are_listed_with_their_chapter() {
        let slow = ["'a'".to_owned(), "'b'".to_owned()];
        assert!(skipped_engines(&slow, true).ends_with("measures them on real models."));
        let without = skipped_engines(&slow, false);
        assert!(without.starts_with("Skipped engines: 'a', 'b', ") && without.contains("except tinybvh"), "{without}");
    }
}
