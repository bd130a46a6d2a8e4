//! Spatial splits: corners -> fragments -> { object split, spatial split } -> clip -> tree over references.

use canted_lbvh::{Bits, Child, ChildKind, Corners, Leaf, NodeId, Tree, radix, sort_by_code};
use canted_obb::{Aabb, PrimId, round::down};

use crate::{TopDownConfig, par, top_down::top_down};

/// Configuration of [`spatial()`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpatialConfig {
    /// Maximum number of additional references, relative to the number of triangles. At 0 no triangle is split.
    pub extra_references: f32,
    /// Spatial splits are tried where the children of the best object split overlap by more than this fraction of the area
    /// of the root.
    pub min_overlap: f32,
    /// Bins per axis, 2 to 64.
    pub bins: u32,
    /// Builder of subtrees without spatial splits; its depth limit applies to the entire tree.
    pub object_splits: TopDownConfig,
}

impl Default for SpatialConfig {
    /// The overlap recommended by the source, and at most 0.3 additional references per triangle.
    fn default() -> Self {
        Self { extra_references: 0.3, min_overlap: 1e-5, bins: 32, object_splits: TopDownConfig::BINNED }
    }
}

/// References to primitives. A split primitive has several, each with the box of its part.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct References {
    /// The primitive of each reference.
    pub primitives: Vec<PrimId>,
    /// The box of each reference. The boxes of a primitive together contain all of its points; they are rounded outward.
    pub boxes: Vec<Aabb>,
}

/// Up to this many references no spatial split is tried.
const FEW: usize = 8;

/// Builds a tree with spatial splits (SBVH) from the root down.
///
/// Reads: finite corners. Writes: a tree whose leaf [`PrimId`]s are indices of *references*, and the references.
/// Holds: at most `1 + extra_references` references per triangle on average, at least one each; every point of a triangle
/// is in the box of one of its references; the depth is at most `object_splits.max_depth`, as in
/// [`top_down`](crate::top_down()); the same bits for any number of threads.
/// Source: Stich, Friedrich & Dietrich 2009 with unsplitting; Popov et al. 2009. Difference: each child gets a share of the
/// additional references in proportion to the area of its boxes, so that subtrees are independent.
#[must_use]
pub fn spatial(corners: &[Corners], config: &SpatialConfig) -> (Tree, References) {
    let fragments: Vec<_> =
        (0..).map(PrimId).zip(corners).map(|(primitive, c)| Fragment { primitive, aabb: c.aabb() }).collect();
    let budget = ((corners.len() as f64 * f64::from(config.extra_references)) as usize).min((1 << 30) - corners.len());
    let root_area = around(&fragments).area();
    let mut part = Part::default();
    if !fragments.is_empty() {
        Builder { corners, config, root_area }.grow(&mut part, fragments, budget, 1);
    }
    let tree = match part.fragments.len() {
        n @ ..2 => radix(sort_by_code(&vec![0; n], Bits::B30)),
        _ => Tree::from_children(&part.children).expect("each reference is in one leaf, each node below one"),
    };
    let (primitives, boxes) = part.fragments.iter().map(|fragment| (fragment.primitive, fragment.aabb)).unzip();
    (tree, References { primitives, boxes })
}

/// A part of the tree: parents before children, leaves by index in `fragments`.
#[derive(Default)]
struct Part {
    children: Vec<[Child; 2]>,
    fragments: Vec<Fragment>,
}

impl Part {
    /// Appends a part; returns its root.
    fn append(&mut self, other: &Self) -> Child {
        let (nodes, leaves) = (self.children.len() as u32, self.fragments.len() as u32);
        self.children.extend(other.children.iter().map(|pair| {
            pair.map(|child| match child.kind() {
                ChildKind::Leaf(leaf) => Child::leaf(leaves + leaf),
                ChildKind::Inner(id) => Child::inner(NodeId(nodes + id.0)),
            })
        }));
        self.fragments.extend(&other.fragments);
        if other.children.is_empty() { Child::leaf(leaves) } else { Child::inner(NodeId(nodes)) }
    }

    /// Adds a node without children yet.
    fn node(&mut self) -> NodeId {
        self.children.push([Child::inner(NodeId::ROOT); 2]);
        NodeId(self.children.len() as u32 - 1)
    }
}

struct Builder<'a> {
    corners: &'a [Corners],
    config: &'a SpatialConfig,
    root_area: f64,
}

impl Builder<'_> {
    /// Builds the subtree over `fragments` with at most `budget` additional ones; returns its root.
    fn grow(&self, part: &mut Part, fragments: Vec<Fragment>, budget: usize, depth: u32) -> Child {
        let n = fragments.len();
        if n <= FEW || budget == 0 || self.config.object_splits.must_halve(n, depth) {
            return part.append(&self.rest(&fragments, depth));
        }
        let [left, right] = self.divide(fragments, budget);
        let budget = budget + n - left.len() - right.len();
        let left_budget = share(budget, &left, &right);
        let id = part.node();
        let children = if n > TopDownConfig::FORK {
            let side = |fragments, budget| {
                move || {
                    let mut part = Part::default();
                    self.grow(&mut part, fragments, budget, depth + 1);
                    part
                }
            };
            let (left, right) = par::join(side(left, left_budget), side(right, budget - left_budget));
            [part.append(&left), part.append(&right)]
        } else {
            let left = self.grow(part, left, left_budget, depth + 1);
            [left, self.grow(part, right, budget - left_budget, depth + 1)]
        };
        part.children[id.index()] = children;
        Child::inner(id)
    }

    /// The subtree over fragments that are not split further.
    fn rest(&self, fragments: &[Fragment], depth: u32) -> Part {
        let boxes: Vec<_> = fragments.iter().map(|fragment| fragment.aabb).collect();
        let max_depth = self.config.object_splits.max_depth.saturating_add(1).saturating_sub(depth);
        let tree = top_down(&boxes, &TopDownConfig { max_depth, ..self.config.object_splits });
        Part {
            children: tree.nodes.iter().map(|node| [node.left, node.right]).collect(),
            fragments: tree.leaves.iter().map(|leaf| fragments[leaf.index()]).collect(),
        }
    }

    /// Splits the fragments in two, spatially where that is cheaper.
    fn divide(&self, mut fragments: Vec<Fragment>, budget: usize) -> [Vec<Fragment>; 2] {
        let n_bins = self.config.bins as usize;
        let by_object = object_split(&fragments, n_bins);
        let overlap = by_object
            .map_or(f64::INFINITY, |cut| intersection(&cut.boxes[0], &cut.boxes[1]).map_or(0.0, |both| both.area()));
        if overlap > f64::from(self.config.min_overlap) * self.root_area
            && let Some(cut) = spatial_split(&fragments, self.corners, n_bins)
            && by_object.is_none_or(|other| cut.cost < other.cost)
        {
            let sides = self.split(&fragments, &cut, budget);
            // Unsplitting may leave everything on one side.
            if sides.iter().all(|side| !side.is_empty() && side.len() < fragments.len()) {
                return sides;
            }
        }
        match by_object {
            Some(cut) => {
                let left = |f: &Fragment| cut.grid.bin(f.aabb.center()[cut.axis]) < cut.bin;
                fragments.into_iter().partition::<Vec<_>, _>(left).into()
            }
            None => {
                let right = fragments.split_off(fragments.len().div_ceil(2));
                [fragments, right]
            }
        }
    }

    /// Assigns fragments to the sides of a plane; fragments across it are split, or moved to one side where that is cheaper.
    fn split(&self, fragments: &[Fragment], cut: &Candidate, mut budget: usize) -> [Vec<Fragment>; 2] {
        let (axis, plane) = (cut.axis, cut.grid.plane(cut.bin));
        let (mut sides, [mut left, mut right]) = ([vec![], vec![]], cut.boxes);
        let [mut n_left, mut n_right] = cut.counts.map(f64::from);
        for fragment in fragments {
            let Fragment { primitive, aabb } = *fragment;
            if aabb.max[axis] <= plane {
                sides[0].push(*fragment);
                continue;
            }
            if aabb.min[axis] >= plane {
                sides[1].push(*fragment);
                continue;
            }
            let parts = clip(&self.corners[primitive.index()], &aabb, axis, plane);
            let (grown_left, grown_right) = (left.union(aabb), right.union(aabb));
            let cost_left = grown_left.area() * n_left + right.area() * (n_right - 1.0);
            let cost_right = left.area() * (n_left - 1.0) + grown_right.area() * n_right;
            let split = left.area() * n_left + right.area() * n_right;
            match parts {
                [Some(a), Some(b)] if budget > 0 && split < cost_left.min(cost_right) => {
                    budget -= 1;
                    sides[0].push(Fragment { primitive, aabb: a });
                    sides[1].push(Fragment { primitive, aabb: b });
                }
                [Some(a), None] => sides[0].push(Fragment { primitive, aabb: a }),
                [None, Some(b)] => sides[1].push(Fragment { primitive, aabb: b }),
                _ if cost_left <= cost_right => {
                    (left, n_right) = (grown_left, n_right - 1.0);
                    sides[0].push(*fragment);
                }
                _ => {
                    (right, n_left) = (grown_right, n_left - 1.0);
                    sides[1].push(*fragment);
                }
            }
        }
        sides
    }
}

/// The share of the left side of a budget, by the areas of the boxes.
fn share(budget: usize, left: &[Fragment], right: &[Fragment]) -> usize {
    let [left, right] = [left, right].map(|side| side.iter().map(|fragment| fragment.aabb.area()).sum::<f64>());
    let part = if left + right > 0.0 { left / (left + right) } else { 0.5 };
    ((budget as f64 * part) as usize).min(budget)
}

/// The part of a primitive inside a box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Fragment {
    pub(crate) primitive: PrimId,
    pub(crate) aabb: Aabb,
}

/// The bounds of all fragments.
pub(crate) fn around(fragments: &[Fragment]) -> Aabb {
    fragments.iter().fold(Aabb::EMPTY, |all, fragment| all.union(fragment.aabb))
}

/// Maximum number of bins per axis.
pub(crate) const MAX_BINS: usize = 64;

/// Bounds of a bin, and how many fragments begin and end there.
#[derive(Clone, Copy)]
struct Bin {
    aabb: Aabb,
    begin: u32,
    end: u32,
}

const EMPTY: Bin = Bin { aabb: Aabb::EMPTY, begin: 0, end: 0 };

/// A split of fragments, with its cost.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Candidate {
    /// Area of each side times its number of fragments.
    pub(crate) cost: f64,
    pub(crate) axis: usize,
    /// First bin on the right.
    pub(crate) bin: usize,
    pub(crate) grid: Grid,
    pub(crate) boxes: [Aabb; 2],
    pub(crate) counts: [u32; 2],
}

/// Bins of equal width along an axis.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Grid {
    low: f64,
    width: f64,
    n: usize,
}

impl Grid {
    fn new(low: f64, high: f64, n: usize) -> Self {
        let n = n.clamp(2, MAX_BINS);
        Self { low, width: (high - low) / n as f64, n }
    }

    pub(crate) fn bin(&self, x: f64) -> usize {
        (((x - self.low) / self.width) as usize).min(self.n - 1)
    }

    /// The lower plane of a bin.
    pub(crate) fn plane(&self, bin: usize) -> f32 {
        (self.low + bin as f64 * self.width) as f32
    }
}

/// The object split of least cost, by the centers of the fragments; `None` if all centers are equal.
pub(crate) fn object_split(fragments: &[Fragment], n_bins: usize) -> Option<Candidate> {
    let mut centers = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for center in fragments.iter().map(|fragment| fragment.aabb.center()) {
        centers.0 = std::array::from_fn(|k| centers.0[k].min(center[k]));
        centers.1 = std::array::from_fn(|k| centers.1[k].max(center[k]));
    }
    let on = |axis: usize| {
        let grid = Grid::new(centers.0[axis], centers.1[axis], n_bins);
        let mut bins = [EMPTY; MAX_BINS];
        for fragment in fragments {
            let bin = &mut bins[grid.bin(fragment.aabb.center()[axis])];
            *bin = Bin { aabb: bin.aabb.union(fragment.aabb), begin: bin.begin + 1, end: bin.end + 1 };
        }
        cheapest(&bins, grid, axis, u32::MAX)
    };
    least((0..3).filter_map(on))
}

/// The spatial split of least cost; `None` if none makes both sides smaller.
pub(crate) fn spatial_split(fragments: &[Fragment], corners: &[Corners], n_bins: usize) -> Option<Candidate> {
    let bounds = around(fragments);
    let n = fragments.len() as u32;
    let on = |axis: usize| {
        let grid = Grid::new(bounds.min[axis].into(), bounds.max[axis].into(), n_bins);
        let mut bins = [EMPTY; MAX_BINS];
        for fragment in fragments {
            let [first, last] = [fragment.aabb.min, fragment.aabb.max].map(|end| grid.bin(end[axis].into()));
            bins[first].begin += 1;
            bins[last].end += 1;
            let mut rest = Some(fragment.aabb);
            for (i, bin) in (first + 1..).zip(&mut bins[first..last]) {
                let Some(aabb) = rest else { break };
                let [left, right] = clip(&corners[fragment.primitive.index()], &aabb, axis, grid.plane(i));
                bin.aabb = bin.aabb.union(left.unwrap_or(Aabb::EMPTY));
                rest = right;
            }
            bins[last].aabb = bins[last].aabb.union(rest.unwrap_or(Aabb::EMPTY));
        }
        cheapest(&bins, grid, axis, n - 1)
    };
    least((0..3).filter_map(on))
}

/// The first candidate of least cost.
fn least(candidates: impl Iterator<Item = Candidate>) -> Option<Candidate> {
    candidates.reduce(|best, next| if next.cost < best.cost { next } else { best })
}

/// The cheapest plane of an axis with at most `max` fragments on each side; ties go to the more balanced one.
fn cheapest(bins: &[Bin; MAX_BINS], grid: Grid, axis: usize, max: u32) -> Option<Candidate> {
    let mut rights = [(Aabb::EMPTY, 0); MAX_BINS];
    let mut right = (Aabb::EMPTY, 0);
    for i in (1..grid.n).rev() {
        right = (right.0.union(bins[i].aabb), right.1 + bins[i].end);
        rights[i] = right;
    }
    let (mut aabb, mut n, mut best) = (Aabb::EMPTY, 0, None::<Candidate>);
    for i in 1..grid.n {
        (aabb, n) = (aabb.union(bins[i - 1].aabb), n + bins[i - 1].begin);
        let (right, n_right) = rights[i];
        if n == 0 || n_right == 0 || n.max(n_right) > max {
            continue;
        }
        let cost = aabb.area() * f64::from(n) + right.area() * f64::from(n_right);
        let balance = |counts: [u32; 2]| counts[0].min(counts[1]);
        let counts = [n, n_right];
        if best.is_none_or(|best| cost < best.cost || cost == best.cost && balance(counts) > balance(best.counts)) {
            best = Some(Candidate { cost, axis, bin: i, grid, boxes: [aabb, right], counts });
        }
    }
    best
}

/// Rounding of a crossing in `f64`, relative to the greatest absolute coordinate of the edge.
///
/// Three roundings reach the parameter and two more its product with the edge, which is at most twice that coordinate;
/// one more touches the sum: `5 * 2 + 1` units, and one for the products of units.
const CROSSING_ERROR: f64 = 12.0 * (0.5 * f64::EPSILON);

/// Bounds of the parts of a fragment on both sides of a plane perpendicular to `axis`; `None` for an empty part.
///
/// The fragment is the part of the triangle in `aabb`. Holds: every point of the triangle in `aabb` is in one of the two
/// boxes. Corners are copied; crossings are computed in `f64` and rounded outward by their error bound.
#[must_use]
pub fn clip(corners: &Corners, aabb: &Aabb, axis: usize, plane: f32) -> [Option<Aabb>; 2] {
    let mut sides = [Aabb::EMPTY; 2];
    for (i, &corner) in corners.iter().enumerate() {
        let next = corners[(i + 1) % 3];
        if corner[axis] <= plane {
            sides[0].grow(corner);
        }
        if corner[axis] >= plane {
            sides[1].grow(corner);
        }
        if (corner[axis] < plane && plane < next[axis]) || (next[axis] < plane && plane < corner[axis]) {
            let crossing = crossing(corner, next, axis, plane);
            sides = sides.map(|side| side.union(crossing));
        }
    }
    sides.map(|side| intersection(&side, aabb))
}

/// The intersection of both.
pub(crate) fn intersection(a: &Aabb, b: &Aabb) -> Option<Aabb> {
    let both = Aabb {
        min: std::array::from_fn(|k| a.min[k].max(b.min[k])),
        max: std::array::from_fn(|k| a.max[k].min(b.max[k])),
    };
    (!both.is_empty()).then_some(both)
}

/// A box that contains the point where an edge crosses the plane; its ends are on different sides.
fn crossing(a: [f32; 3], b: [f32; 3], axis: usize, plane: f32) -> Aabb {
    let (from, to) = (a.map(f64::from), b.map(f64::from));
    let along = (f64::from(plane) - from[axis]) / (to[axis] - from[axis]);
    let mut aabb = Aabb { min: [plane; 3], max: [plane; 3] };
    for k in (0..3).filter(|&k| k != axis) {
        let at = from[k] + along * (to[k] - from[k]);
        let error = CROSSING_ERROR * from[k].abs().max(to[k].abs());
        // The point is between the ends, which are exact.
        aabb.min[k] = down(at - error).max(a[k].min(b[k]));
        aabb.max[k] = -down(-(at + error)).max(-a[k].max(b[k]));
    }
    aabb
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Fraction bits that represent every bit of an `f32` of at least 2^-36, and none beyond `i128` for integers to 2^10.
    const FRACTION_BITS: i32 = 60;

    fn fixed(x: f32) -> i128 {
        let scaled = f64::from(x) * f64::from(FRACTION_BITS).exp2();
        assert_eq!(scaled.fract(), 0.0);
        scaled as i128
    }

    /// Whether the box holds the exact crossing `from + (plane - from) / run * rise`, on another axis.
    fn contains_crossing(aabb: &Aabb, k: usize, [from, to]: [i128; 2], [start, end]: [i128; 2], plane: i128) -> bool {
        let (mut run, mut crossed) = (end - start, plane - start);
        if run < 0 {
            (run, crossed) = (-run, -crossed);
        }
        let exact = (from * run + crossed * (to - from)) << FRACTION_BITS;
        fixed(aabb.min[k]) * run <= exact && exact <= fixed(aabb.max[k]) * run
    }

    fn edge() -> impl Strategy<Value = ([i16; 3], [i16; 3], i16)> {
        let point = || prop::array::uniform3(-1000i16..=1000);
        (point(), point(), -999i16..1000)
    }

    proptest! {
        #[test]
        fn crossings_contain_the_exact_point((a, b, plane) in edge()) {
            prop_assume!((a[0] < plane && plane < b[0]) || (b[0] < plane && plane < a[0]));
            let mut aabb = crossing(a.map(f32::from), b.map(f32::from), 0, f32::from(plane));
            let check = |aabb: &Aabb, k: usize| {
                contains_crossing(aabb, k, [a[k], b[k]].map(i128::from), [a[0], b[0]].map(i128::from), plane.into())
            };
            for k in 1..3 {
                prop_assert!(check(&aabb, k), "{aabb:?}");
                // The check can fail: a box one step beyond does not contain the point.
                let beyond = aabb.max[k].next_up();
                aabb.min[k] = beyond;
                aabb.max[k] = beyond;
                prop_assert!(!check(&aabb, k), "{aabb:?}");
            }
        }
    }

    #[test]
    fn an_empty_side_is_none() {
        let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let aabb = Aabb::from_points(corners);
        assert_eq!(clip(&corners, &aabb, 0, 2.0), [Some(aabb), None]);
        // In the plane itself it is on both.
        assert_eq!(clip(&corners, &aabb, 2, 0.0), [Some(aabb); 2]);
    }
}
