//! Boxes: how large a fit's or a merge's box is beside the least that a search finds, and what it costs.

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
    ("straight", Fit::Aabb),
    ("principal axes of points", Fit::Pca),
    ("principal axes of the surface", Fit::AreaPca),
    ("ditetrahedron", Fit::Dito),
    ("fixed directions", Fit::Dop),
];

/// What one way made of one kind of input.
struct Outcome {
    way: &'static str,
    /// Area, then volume, over the least found: a sample an input.
    ratios: [Samples; 2],
    /// Nanoseconds a box: a sample a round.
    ns: Samples,
}

/// Real models whose nodes are inputs, and how these are called.
const MODELS: [(&str, &str); 1] = [("bunny", "nodes of the bunny")];

/// Measures the chapter.
pub(super) fn chapter(effort: Effort) -> Result<Chapter> {
    let mut chapter = Chapter { id: "boxes", title: "Boxes: size over the least, against time", ..Chapter::default() };
    let n_sets = effort.pick(2, 40, 40);
    let mut kinds = inputs::kinds(n_sets);
    for &(model, name) in effort.pick(&[][..], &MODELS, &MODELS) {
        match subjects::load(model)? {
            Some(model) => kinds.push(Kind { name, sets: inputs::nodes(&model.mesh, n_sets) }),
            None => chapter.skipped.push(format!("{name}: the model is not at hand.")),
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
    chapter.tell([sentence("Of fits", &fits), sentence("Of merges of two halves", &merges)]);
    chapter.method = METHOD.map(str::to_owned).to_vec();
    chapter.method.push(told(gaps.map(Samples::from)));
    for (title, all) in [("Fits", &fits), ("Merges", &merges)] {
        for (i, size) in ["area", "volume"].into_iter().enumerate() {
            chapter.plots.push(plot(title, size, i, all));
        }
        chapter.tables.push(table(title, all));
    }
    Ok(chapter)
}

const METHOD: [&str; 3] = [
    "Clusters are 24 triangles in a turned shape; nodes are what a radix tree over the mesh holds, 8 to 64 triangles each. A fit is that \
     of `fit`, which gives the straight box where a way's own has more area: so no way does worse than straight, and its time is \
     that of both. A merge gets the boxes of the two halves (of a node: its children), each fitted by the principal axes of its \
     surface, and has no such fallback; 'combined' is the quaternion's rule but where a half is one triangle, of which it gets the \
     corners. Two rules get what a tree carries up in place of boxes: 'principal axes of all below' joins the moments of both halves' \
     surfaces and then measures all their points, 'extents carried up' joins those along 25 directions and sees no point again. What is \
     carried is made before time is taken.",
    "The least size is searched for exhaustively, area and volume each for itself: of 750 directions of an edge all around, 5 degrees from \
     each other, of those of the triangles' edges and of those across every two of these, every one gets its least rectangle, which \
     is exact, and four of the best are improved by ever smaller steps. It is the least of two such searches, turned otherwise, and \
     of every box that takes part: so no ratio is below one. For merges it is the least box of the points, which the rules of boxes \
     do not see. A volume of nothing counts as least.",
    "A point is the median over inputs, its bars reach from the best to the worst of them; nanoseconds are those of a box, all \
     ways in turn, round by round, after a warm-up, each 64 times over so that the clock does not show.",
];

/// What the search leaves open, from the greater of its ends over the lesser, of area and of volume.
fn told(gaps: [Samples; 2]) -> String {
    let [area, volume] = gaps.map(|gaps| {
        let known: Vec<f64> = gaps.values().iter().copied().filter(|gap| gap.is_finite()).collect();
        let known = Samples::from(known);
        format!("{} in the median and {} at worst", percent(known.median()), percent(known.range()[1]))
    });
    format!(
        "How good the search is, itself says: one of its two halves ends above the other by {area} of the area, by {volume} of the \
         volume."
    )
}

/// Both contests on one kind of input; of area and of volume, the greater of the search's ends over the lesser, an entry an input.
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
            // Too short to be timed once, as merges are.
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

/// How often each way makes all boxes in a round.
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
    let outcome = |((way, ratios), timing): ((&'static str, [Vec<f64>; 2]), interleave::Timing)| Outcome {
        way,
        ratios: ratios.map(Samples::from),
        ns: Samples::from(timing.seconds).scaled(to_ns),
    };
    names.into_iter().zip(ratios).zip(timings).map(outcome).collect()
}

/// As the crate offers it: the straight box takes the place of one that has more area.
fn fitted(set: &Set, method: Fit) -> Obb {
    fit(&set.points, &set.triangles(), method).unwrap_or_else(|_| unreachable!("points of inputs are finite"))
}

/// Which way is tightest, and at what price, over all kinds.
fn sentence(what: &str, all: &[(&'static str, Vec<Outcome>)]) -> String {
    let n_ways = all.first().map_or(0, |(_, outcomes)| outcomes.len());
    let over_kinds = |of: &dyn Fn(&Outcome) -> f64, way: usize| {
        Samples::from(all.iter().map(|(_, outcomes)| of(&outcomes[way])).collect::<Vec<_>>()).median()
    };
    let ranked = |of: &dyn Fn(&Outcome) -> f64| {
        (0..n_ways).map(|way| (over_kinds(of, way), way)).min_by(|a, b| a.0.total_cmp(&b.0))
    };
    let area = |outcome: &Outcome| outcome.ratios[0].median();
    let (Some((tight, way)), Some((ns, cheap))) = (ranked(&area), ranked(&|outcome| outcome.ns.median())) else {
        return String::new();
    };
    let name = |way: usize| all[0].1[way].way;
    format!(
        "{what}, {} comes nearest to the least area ({} times it, median of all kinds, for {} ns), and {} is cheapest ({} ns, {} times).",
        name(way),
        number(tight),
        number(over_kinds(&|outcome| outcome.ns.median(), way)),
        name(cheap),
        number(ns),
        number(over_kinds(&area, cheap)),
    )
}

fn plot(title: &str, size: &str, i: usize, all: &[(&'static str, Vec<Outcome>)]) -> Plot {
    let mut series: Vec<Series> = vec![];
    for (kind, outcomes) in all {
        for (way, outcome) in outcomes.iter().enumerate() {
            if series.len() <= way {
                series.push(Series { name: outcome.way.to_owned(), points: vec![], is_joined: false });
            }
            let point = Point { label: (*kind).to_owned(), x: outcome.ns.clone(), y: outcome.ratios[i].clone() };
            series[way].points.push(point);
        }
    }
    // What has no volume has no ratio that a plot could show.
    series.iter_mut().for_each(|series| series.points.retain(|point| point.y.range().iter().all(|y| y.is_finite())));
    Plot {
        title: format!("{title}: {size} over the least found"),
        x: Axis::log("ns a box"),
        y: Axis::log(format!("{size} over least")),
        series,
    }
}

fn table(title: &str, all: &[(&'static str, Vec<Outcome>)]) -> Table {
    let mut table = Table::new(title, &["input", "way", "area over least", "worst", "volume over least", "time"]);
    for (kind, outcomes) in all {
        for outcome in outcomes {
            table.rows.push(vec![
                Cell::text(*kind),
                Cell::text(outcome.way),
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
    fn the_search_tells_its_gap() {
        let said = told([vec![1.0, 1.02, f64::NAN, 1.5].into(), 1.0.into()]);
        assert!(said.contains("2.00% in the median and 50.0% at worst of the area"), "{said}");
    }
}
