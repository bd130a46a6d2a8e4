//! Boxes: the size of fitted and merged boxes relative to the smallest of all methods, and their cost.

use anyhow::Result;
use canted_fixtures::{Hair, Mesh, SplitMix64, Strand, displaced_icosphere, hair, scaffold_of, truss};
use canted_lbvh::{self as lbvh, Bits, Corners, Domain};
use canted_obb::{
    Aabb, Dop, Fit, Moments, Obb, bound, eigen, fit,
    merge::{self, Child, Weight},
};
use canted_tests::clouds::{placed, random_rotation};

use super::{
    model::{Axis, Cell, Chapter, Plot, Point, Series, Table},
    samples::{Samples, number},
};
use crate::report::model::Effort;
use crate::{
    models,
    timing::{self, Contender},
};

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
    let mut kinds = all_kinds(n_sets);
    for &(model, name) in effort.pick(&[][..], &MODELS, &MODELS) {
        match models::load(model)? {
            Some(model) => kinds.push(Kind { name, sets: nodes(&model.mesh, n_sets) }),
            None => chapter.skipped.push(format!("{name}: the model is not available.")),
        }
    }
    let rounds = effort.pick(2, 5, 9);
    let mut fits = vec![];
    let mut merges = vec![];
    for kind in kinds.iter().filter(|kind| !kind.sets.is_empty()) {
        let [of_fits, of_merges] = measure(kind, rounds);
        fits.push((kind.name, of_fits));
        merges.push((kind.name, of_merges));
    }
    chapter.set_sentences([sentence("Of fits", &fits), sentence("Of merges of two halves", &merges)]);
    chapter.method = METHOD.map(str::to_owned).to_vec();
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
    "The smallest size is that of the smallest of all measured boxes of an input, fits and merges together, for area and volume \
     separately: no ratio is below one. A volume of zero counts as smallest.",
    "A point is the median over inputs, and its bars reach from the best to the worst input; nanoseconds are per box, all methods in \
     turn, round by round, after a warm-up, each repeated 64 times to hide the clock's resolution.",
];

/// Fits and merges of one kind of input.
fn measure(kind: &Kind, rounds: usize) -> [Vec<Outcome>; 2] {
    let mut ratios = [vec![[vec![], vec![]]; FITS.len()], vec![[vec![], vec![]]; MERGES.len()]];
    let pairs: Vec<Pair> = kind.sets.iter().map(Pair::of).collect();
    for (set, pair) in kind.sets.iter().zip(&pairs) {
        let fitted = FITS.map(|(_, method)| fitted(set, method));
        let merged = MERGES.map(|(_, rule)| rule(pair));
        let all = || fitted.iter().chain(&merged);
        let least =
            [Obb::area as fn(&Obb) -> f64, Obb::volume].map(|size| all().map(size).fold(f64::INFINITY, f64::min));
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
    [
        outcomes(FITS.map(|(name, _)| name).to_vec(), fit_ratios, fits.into(), rounds, kind.sets.len()),
        outcomes(MERGES.map(|(name, _)| name).to_vec(), merge_ratios, merges.into(), rounds, pairs.len()),
    ]
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
    let to_ns = 1e9 / (REPEATS * n_boxes) as f64;
    let timings = timing::run(rounds, contenders);
    let outcome = |((method, ratios), timing): ((&'static str, [Vec<f64>; 2]), timing::Timing)| Outcome {
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
                series.push(Series::dots(outcome.method, vec![]));
            }
            let point = Point::new(*kind, outcome.ns.clone(), outcome.ratios[i].clone());
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

/// Sets of one kind.
pub(super) struct Kind {
    pub(super) name: &'static str,
    pub(super) sets: Vec<Set>,
}

/// Triangle corners in order, three per triangle.
pub(super) struct Set {
    pub(super) points: Vec<[f32; 3]>,
    /// The number of leading points that belong to the first child; the rest belong to the second.
    pub(super) split: usize,
}

impl Set {
    /// Indices of the triangles.
    pub(super) fn triangles(&self) -> Vec<[u32; 3]> {
        let n = u32::try_from(self.points.len() / 3).unwrap_or(0);
        (0..n).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect()
    }
}

/// Triangles of a synthetic cluster.
const N_TRIANGLES: usize = 24;

/// Number of triangles of a sampled node.
const NODE_TRIANGLES: std::ops::RangeInclusive<u32> = 8..=64;

/// `n` sets of each kind.
pub(super) fn all_kinds(n: usize) -> Vec<Kind> {
    let mut rng = SplitMix64::new(2026);
    let shapes: [(&'static str, [f64; 3]); 4] = [
        ("needle", [1.0, 0.01, 0.01]),
        ("plate", [1.0, 0.8, 0.01]),
        ("brick", [1.0, 0.6, 0.3]),
        ("cube", [1.0, 1.0, 1.0]),
    ];
    let mut all_kinds: Vec<Kind> = shapes
        .iter()
        .map(|&(name, half)| Kind { name, sets: (0..n).map(|_| cluster(&mut rng, half, |x| x)).collect() })
        .collect();
    let on_sphere = |x: [f64; 3]| {
        let length = x.iter().map(|c| c * c).sum::<f64>().sqrt().max(1e-3);
        x.map(|c| c / length)
    };
    all_kinds.push(Kind { name: "sphere", sets: (0..n).map(|_| cluster(&mut rng, [1.0; 3], on_sphere)).collect() });
    let any = |rng: &mut SplitMix64| [0; 3].map(|_: u8| 10.0f64.powf(-2.0 * rng.unit()));
    all_kinds.push(Kind {
        name: "random",
        sets: (0..n)
            .map(|_| {
                let half = any(&mut rng);
                cluster(&mut rng, half, |x| x)
            })
            .collect(),
    });
    let strands = Hair { n_strands: 60, n_segments: 12, width: 0.002, strand: Strand::Ribbon };
    for (name, mesh) in [
        ("nodes of a scaffold", scaffold_of(1, true, 4)),
        ("nodes of a truss", truss(4)),
        ("nodes of hair", hair(3, &strands)),
        ("nodes of a bumpy sphere", displaced_icosphere(3, 4).off_axis()),
    ] {
        all_kinds.push(Kind { name, sets: nodes(&mesh, n) });
    }
    all_kinds
}

/// Triangles with random vertices in a rotated box, mapped through `shape` first; half of them lie in each half of the
/// box.
fn cluster(rng: &mut SplitMix64, half: [f64; 3], shape: impl Fn([f64; 3]) -> [f64; 3]) -> Set {
    let rotation = random_rotation(rng);
    let points = (0..3 * N_TRIANGLES).map(|i| {
        let mut x = rng.signed3();
        x[0] = 0.5 * (x[0] + if i < 3 * N_TRIANGLES / 2 { -1.0 } else { 1.0 });
        placed(&rotation, half, [0.0; 3], shape(x))
    });
    Set { points: points.collect(), split: 3 * N_TRIANGLES / 2 }
}

/// The contents of `n` nodes of the radix tree, evenly from all nodes of suitable size.
pub(super) fn nodes(mesh: &Mesh, n: usize) -> Vec<Set> {
    let Ok((corners, bounds)) = lbvh::triangle_corners(&mesh.positions, &mesh.triangles) else { return vec![] };
    let tree =
        lbvh::radix(lbvh::sort_by_code(&lbvh::morton_codes(&Domain::new(&bounds, 3, Bits::B63), &corners), Bits::B63));
    let sorted: Vec<Corners> = lbvh::in_leaf_order(&corners, &tree.leaves);
    let fit: Vec<&lbvh::Node> = tree.nodes.iter().filter(|node| NODE_TRIANGLES.contains(&node.n_leaves())).collect();
    let step = (fit.len() / n).max(1);
    let set = |node: &&lbvh::Node| {
        let range = node.first as usize..=node.last as usize;
        let n_left = match node.left.kind() {
            lbvh::ChildKind::Leaf(_) => 1,
            lbvh::ChildKind::Inner(id) => tree.nodes[id.index()].n_leaves() as usize,
        };
        Set { points: sorted[range].as_flattened().to_vec(), split: 3 * n_left }
    };
    fit.iter().step_by(step).take(n).map(set).collect()
}

/// Two halves of a set.
pub(super) struct Pair {
    boxes: [Obb; 2],
    /// The halves as BVH children: a half of one triangle is that triangle.
    children: [Child; 2],
    /// The data that some builders propagate upwards instead of boxes.
    carried: [Carried; 2],
    /// The points of both halves.
    points: Vec<[f32; 3]>,
}

/// The propagated data of a half.
struct Carried {
    moments: Moments,
    extents: Dop,
    aabb: Aabb,
}

/// A rule by name.
type Rule = (&'static str, fn(&Pair) -> Obb);

pub(super) const MERGES: [Rule; 8] = [
    ("axis-aligned, of both axis-aligned boxes", |Pair { boxes: [a, b], .. }| {
        Obb::from_aabb(&a.aabb().union(b.aabb()))
    }),
    ("principal axes of corners", |Pair { boxes: [a, b], .. }| {
        merge::bounded(&Child::Box(*a), &Child::Box(*b), Weight::Corners)
    }),
    ("the same, by area", |Pair { boxes: [a, b], .. }| merge::bounded(&Child::Box(*a), &Child::Box(*b), Weight::Area)),
    ("quaternion", |Pair { boxes: [a, b], .. }| merge::quaternion(a, b, [a.area(), b.area()])),
    ("combined, by kind of child", |Pair { children: [a, b], .. }| merge::combined(a, b)),
    ("best of five frames", |Pair { boxes: [a, b], .. }| merge::best(a, b, None)),
    ("principal axes of all descendants", unbounded),
    ("propagated extents", by_extents),
];

/// As `Strategy::PcaUnbounded`: the frame comes from joined moments, the box from all points.
fn unbounded(Pair { carried: [a, b], points, .. }: &Pair) -> Obb {
    bound(a.moments.merged(&b.moments).axes(eigen::COARSE), points.iter().copied())
}

/// As `Strategy::Dop`: axis-aligned if no other frame of the fixed directions has less area.
fn by_extents(Pair { carried: [a, b], .. }: &Pair) -> Obb {
    a.extents.union(&b.extents).best_box().unwrap_or_else(|| Obb::from_aabb(&a.aabb.union(b.aabb)))
}

impl Pair {
    /// The two halves of a set.
    pub(super) fn of(set: &Set) -> Self {
        let (a, b) = set.points.split_at(set.split);
        let boxes = [a, b].map(|points| fitted(&Set { points: points.to_vec(), split: 0 }, Fit::AreaPca));
        let child = |points: &[[f32; 3]], obb| {
            if let &[a, b, c] = points { Child::Triangle([a, b, c]) } else { Child::Box(obb) }
        };
        Self {
            boxes,
            children: [child(a, boxes[0]), child(b, boxes[1])],
            carried: [a, b].map(Carried::of),
            points: set.points.clone(),
        }
    }
}

impl Carried {
    fn of(points: &[[f32; 3]]) -> Self {
        let (triangles, _) = points.as_chunks::<3>();
        let join = |all: Moments, &triangle: &[[f32; 3]; 3]| all.merged(&Moments::from_triangle(triangle));
        Self {
            moments: triangles.iter().fold(Moments::EMPTY, join),
            extents: Dop::from_points(points.iter().copied()),
            aabb: Aabb::from_points(points.iter().copied()),
        }
    }
}

#[cfg(test)]
mod tests {
    use canted_lbvh::{NodeId, Strategy, Volume, VolumeConfig};

    use super::*;

    /// Two triangles.
    const CORNERS: [[f32; 3]; 6] =
        [[0.0, 0.0, 0.0], [2.0, 1.0, 0.0], [0.0, 1.0, 3.0], [4.0, 5.0, 6.0], [5.0, 5.0, 7.0], [4.0, 6.0, 6.5]];

    #[test]
    fn merges_contain_both_halves_and_combined_uses_triangles() {
        let pair = Pair::of(&Set { points: CORNERS.to_vec(), split: 3 });
        assert!(pair.children.iter().all(|child| matches!(child, Child::Triangle(_))));
        for (name, rule) in MERGES {
            assert!(rule(&pair).volume() > 0.0 && rule(&pair).aabb().contains(CORNERS[5]), "{name}");
        }
        let of = |points: usize| Pair::of(&Set { points: [CORNERS, CORNERS].concat(), split: points });
        let [quaternion, combined] = [3, 4].map(|i| MERGES[i].1);
        assert_eq!(quaternion(&of(6)), combined(&of(6)));
        assert_ne!(quaternion(&of(3)), combined(&of(3)));
    }

    #[test]
    fn propagated_data_gives_the_boxes_of_a_bvh() {
        let (triangles, _) = CORNERS.as_chunks::<3>();
        let tree = lbvh::radix(lbvh::sort_by_code(&[0; 2], Bits::B30));
        let pair = Pair::of(&Set { points: CORNERS.to_vec(), split: 3 });
        for (strategy, rule) in [(Strategy::PcaUnbounded, MERGES[6].1), (Strategy::Dop, MERGES[7].1)] {
            let volumes = lbvh::volumes(&tree, triangles, &VolumeConfig { strategy, fallback: false });
            assert_eq!(volumes.of(NodeId::ROOT), Volume::Obb(&rule(&pair)), "{strategy:?}");
        }
    }
}
