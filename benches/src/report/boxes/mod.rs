//! Boxes: the size of fitted and merged boxes relative to the smallest found by a search, and their cost.

mod inputs;
mod merges;
mod rectangle;
mod search;

use anyhow::Result;
use canted_obb::{Fit, Obb, fit};

use super::effort::Effort;
use super::model::{Axis, Cell, Chapter, Plot, Point, Series, Table};
use super::samples::{Samples, number, percent};
use super::subjects;
use crate::interleave::{self, Contender};
use inputs::{Kind, Set};
use merges::{MERGES, Pair};

const FITS: [(&str, Fit); 5] = [
    ("axis-aligned", Fit::Aabb),
    ("principal axes of points", Fit::Pca),
    ("principal axes of the surface", Fit::AreaPca),
    ("ditetrahedron", Fit::Dito),
    ("fixed directions", Fit::Dop),
];

/// The results of one method on one kind of input.
struct Outcome {
    method: &'static str,
    /// Area, then volume, relative to the smallest found: a sample per input.
    ratios: [Samples; 2],
    /// Nanoseconds per box: a sample per round.
    ns: Samples,
}

/// Real models whose nodes are inputs, and the names of these inputs.
const MODELS: [(&str, &str); 1] = [("bunny", "nodes of the bunny")];

/// Measures the chapter.
pub(super) fn chapter(effort: Effort) -> Result<Chapter> {
    let mut chapter =
        Chapter { id: "boxes", title: "Boxes: size relative to the smallest, against time", ..Chapter::default() };
    let n_sets = effort.pick(2, 40, 40);
    let mut kinds = inputs::kinds(n_sets);
    for &(model, name) in effort.pick(&[][..], &MODELS, &MODELS) {
        match subjects::load(model)? {
            Some(model) => kinds.push(Kind { name, sets: inputs::nodes(&model.mesh, n_sets) }),
            None => chapter.skipped.push(format!("{name}: the model is not available.")),
        }
    }
    let rounds = effort.pick(2, 5, 9);
    let mut fits = vec![];
    let mut merges = vec![];
    let mut gaps: [Vec<f64>; 2] = Default::default();
    for kind in kinds.iter().filter(|kind| !kind.sets.is_empty()) {
        let ([of_fits, of_merges], of_search) = measure(kind, rounds);
        fits.push((kind.name, of_fits));
        merges.push((kind.name, of_merges));
        for (gaps, of_search) in gaps.iter_mut().zip(of_search) {
            gaps.extend(of_search);
        }
    }
    chapter.set_sentences([sentence("Of fits", &fits), sentence("Of merges of two halves", &merges)]);
    chapter.method = METHOD.map(str::to_owned).to_vec();
    chapter.method.push(search_gap(gaps.map(Samples::from)));
    for (title, all) in [("Fits", &fits), ("Merges", &merges)] {
        for (i, size) in ["area", "volume"].into_iter().enumerate() {
            chapter.plots.push(plot(title, size, i, all));
        }
        chapter.tables.push(table(title, all));
    }
    Ok(chapter)
}

const METHOD: [&str; 3] = [
    "Clusters are 24 triangles in a rotated shape; nodes come from a radix tree over the mesh and have 8 to 64 triangles each. A fit \
     is that of `fit`, which returns the axis-aligned box if the method's own box has more area: so no method is worse than \
     axis-aligned, and its time includes both. A merge gets the boxes of the two halves (for a node: its children), each fitted by \
     the principal axes of its surface, and has no such fallback; 'combined' is the quaternion rule, except that it gets the corners \
     of a half of one triangle. Two rules get other data than boxes: 'principal axes of all descendants' joins the moments of both \
     halves' surfaces and then measures all their points, 'propagated extents' joins extents along 25 directions and reads no \
     points. Preparing this data is not timed.",
    "The smallest size is found by an exhaustive search, for area and volume separately. Edge directions are 750 directions 5 \
     degrees apart, the triangles' edges and the cross products of every two edges; each gets its exact smallest rectangle, and four \
     of the best are refined with ever smaller steps. The result is the smallest of two such searches with different rotations and \
     of every measured box, so no ratio is below one. For merges it is the smallest box of the points, which box rules do not read. \
     A volume of zero counts as smallest.",
    "A point is the median over inputs, and its bars reach from the best to the worst input; nanoseconds are per box, all methods in \
     turn, round by round, after a warm-up, each repeated 64 times to hide the clock's resolution.",
];

/// The accuracy of the search, from the ratio of its two results, for area and volume.
fn search_gap(gaps: [Samples; 2]) -> String {
    let [area, volume] = gaps.map(|gaps| {
        let known: Vec<f64> = gaps.values().iter().copied().filter(|gap| gap.is_finite()).collect();
        let known = Samples::from(known);
        format!("{} in the median and {} at worst", percent(known.median()), percent(known.range()[1]))
    });
    format!("Accuracy of the search: its two halves differ by {area} of the area and by {volume} of the volume.")
}

/// Fits and merges of one kind of input; for area and volume, the ratio of the search's two results per input.
fn measure(kind: &Kind, rounds: usize) -> ([Vec<Outcome>; 2], [Vec<f64>; 2]) {
    let mut ratios = [vec![[vec![], vec![]]; FITS.len()], vec![[vec![], vec![]]; MERGES.len()]];
    let mut gaps: [Vec<f64>; 2] = Default::default();
    let pairs: Vec<Pair> = kind.sets.iter().map(Pair::of).collect();
    for ((set, pair), seed) in kind.sets.iter().zip(&pairs).zip(0..) {
        let fitted = FITS.map(|(_, method)| fitted(set, method));
        let merged = MERGES.map(|(_, rule)| rule(pair));
        let known: Vec<Obb> = fitted.iter().chain(&merged).copied().collect();
        let found = search::least(&set.points, &known, seed);
        for (gaps, found) in gaps.iter_mut().zip(found) {
            gaps.push(found.gap);
        }
        let least = found.map(|found| found.size);
        for (ratios, boxes) in ratios.iter_mut().zip([&fitted[..], &merged[..]]) {
            for (ratios, obb) in ratios.iter_mut().zip(boxes) {
                for (ratios, (size, least)) in ratios.iter_mut().zip([obb.area(), obb.volume()].into_iter().zip(least))
                {
                    ratios.push(if size == least { 1.0 } else { size / least });
                }
            }
        }
    }
    let [fit_ratios, merge_ratios] = ratios;
    let fits = FITS.map(|(name, method)| {
        Contender::new(name, move || {
            // Too short to be timed once, like merges.
            for set in (0..REPEATS).flat_map(|_| &kind.sets) {
                std::hint::black_box(fitted(set, method));
            }
        })
    });
    let merges = MERGES.map(|(name, rule)| {
        let pairs = &pairs;
        Contender::new(name, move || {
            for pair in (0..REPEATS).flat_map(|_| pairs) {
                std::hint::black_box(rule(pair));
            }
        })
    });
    let outcomes = [
        outcomes(FITS.map(|(name, _)| name).to_vec(), fit_ratios, fits.into(), rounds, kind.sets.len()),
        outcomes(MERGES.map(|(name, _)| name).to_vec(), merge_ratios, merges.into(), rounds, pairs.len()),
    ];
    (outcomes, gaps)
}

/// How often each method computes all boxes in a round.
const REPEATS: usize = 64;

fn outcomes(
    names: Vec<&'static str>,
    ratios: Vec<[Vec<f64>; 2]>,
    contenders: Vec<Contender<'_>>,
    rounds: usize,
    n_boxes: usize,
) -> Vec<Outcome> {
    #[expect(clippy::cast_precision_loss, reason = "few boxes")]
    let to_ns = 1e9 / (REPEATS * n_boxes) as f64;
    let timings = interleave::run(rounds, contenders);
    let outcome = |((method, ratios), timing): ((&'static str, [Vec<f64>; 2]), interleave::Timing)| Outcome {
        method,
        ratios: ratios.map(Samples::from),
        ns: Samples::from(timing.seconds).scaled(to_ns),
    };
    names.into_iter().zip(ratios).zip(timings).map(outcome).collect()
}

/// As the crate's public function: the axis-aligned box replaces one that has more area.
fn fitted(set: &Set, method: Fit) -> Obb {
    fit(&set.points, &set.triangles(), method).unwrap_or_else(|_| unreachable!("points of inputs are finite"))
}

/// The tightest and the cheapest method over all kinds.
fn sentence(what: &str, all: &[(&'static str, Vec<Outcome>)]) -> String {
    let n_methods = all.first().map_or(0, |(_, outcomes)| outcomes.len());
    let over_kinds = |of: &dyn Fn(&Outcome) -> f64, method: usize| {
        Samples::from(all.iter().map(|(_, outcomes)| of(&outcomes[method])).collect::<Vec<_>>()).median()
    };
    let ranked = |of: &dyn Fn(&Outcome) -> f64| {
        (0..n_methods).map(|method| (over_kinds(of, method), method)).min_by(|a, b| a.0.total_cmp(&b.0))
    };
    let area = |outcome: &Outcome| outcome.ratios[0].median();
    let (Some((tight, method)), Some((ns, cheap))) = (ranked(&area), ranked(&|outcome| outcome.ns.median())) else {
        return String::new();
    };
    let name = |method: usize| all[0].1[method].method;
    format!(
        "{what}, {} is closest to the smallest area ({} times it, median of all kinds, in {} ns), and {} is the cheapest ({} ns, {} \
         times the smallest area).",
        name(method),
        number(tight),
        number(over_kinds(&|outcome| outcome.ns.median(), method)),
        name(cheap),
        number(ns),
        number(over_kinds(&area, cheap)),
    )
}

fn plot(title: &str, size: &str, i: usize, all: &[(&'static str, Vec<Outcome>)]) -> Plot {
    let mut series: Vec<Series> = vec![];
    for (kind, outcomes) in all {
        for (method, outcome) in outcomes.iter().enumerate() {
            if series.len() <= method {
                series.push(Series { name: outcome.method.to_owned(), points: vec![], is_joined: false });
            }
            let point = Point { label: (*kind).to_owned(), x: outcome.ns.clone(), y: outcome.ratios[i].clone() };
            series[method].points.push(point);
        }
    }
    // A ratio of zero volume cannot be plotted.
    series.iter_mut().for_each(|series| series.points.retain(|point| point.y.range().iter().all(|y| y.is_finite())));
    Plot {
        title: format!("{title}: {size} relative to the smallest found"),
        x: Axis::log("ns a box"),
        y: Axis::log(format!("{size} relative to the smallest")),
        series,
    }
}

fn table(title: &str, all: &[(&'static str, Vec<Outcome>)]) -> Table {
    let mut table =
        Table::new(title, &["input", "method", "area over smallest", "worst", "volume over smallest", "time"]);
    for (kind, outcomes) in all {
        for outcome in outcomes {
            table.rows.push(vec![
                Cell::text(*kind),
                Cell::text(outcome.method),
                Cell::text(number(outcome.ratios[0].median())),
                Cell::text(number(outcome.ratios[0].range()[1])),
                Cell::text(number(outcome.ratios[1].median())),
                Cell::measured(outcome.ns.clone(), "ns"),
            ]);
        }
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_search_reports_its_gap() {
        let text = search_gap([vec![1.0, 1.02, f64::NAN, 1.5].into(), 1.0.into()]);
        assert!(text.contains("2.00% in the median and 50.0% at worst of the area"), "{text}");
    }
}
