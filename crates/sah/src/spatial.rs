use canted_lbvh::{Bits, Child, ChildKind, Corners, Leaf, NodeId, Tree, radix, sort_by_code};
use canted_obb::{Aabb, PrimId};

use crate::{
    TopDownConfig,
    candidates::{Candidate, Fragment, around, object_split, spatial_split},
    clip::{clip, intersection},
    par,
    top_down::top_down,
};

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
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        clippy::cast_precision_loss,
        reason = "saturating, and bounded by the number of nodes"
    )]
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

#[expect(clippy::cast_possible_truncation, reason = "at most 2^30 nodes and references")]
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
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::cast_precision_loss,
    reason = "a part of the budget, at most all of it"
)]
fn share(budget: usize, left: &[Fragment], right: &[Fragment]) -> usize {
    let [left, right] = [left, right].map(|side| side.iter().map(|fragment| fragment.aabb.area()).sum::<f64>());
    let part = if left + right > 0.0 { left / (left + right) } else { 0.5 };
    ((budget as f64 * part) as usize).min(budget)
}
