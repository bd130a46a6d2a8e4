use canted_lbvh::{Bits, Child, ChildKind, Corners, Leaf, NodeId, Tree, radix, sort_by_code};
use canted_obb::{Aabb, PrimId};

use crate::{
    TopDownConfig,
    chop::{Cut, between, through},
    clip::{clip, intersection},
    fragment::{Fragment, around},
    par,
    top_down::top_down,
};

/// How a tree with spatial splits is built.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpatialConfig {
    /// Most extra references, as a part of the number of triangles. At 0 no triangle is split.
    pub extra_references: f32,
    /// Spatial splits are tried where the children of the best other split overlap by more than this part of the
    /// root's area.
    pub min_overlap: f32,
    /// Slices an axis, 2 to 64.
    pub bins: u32,
    /// How subtrees are built in which nothing is left to split; its limit of depth is the whole tree's.
    pub object_splits: TopDownConfig,
}

impl Default for SpatialConfig {
    /// The overlap that the source recommends, and at most 0.3 extra references a triangle.
    fn default() -> Self {
        Self { extra_references: 0.3, min_overlap: 1e-5, bins: 32, object_splits: TopDownConfig::BINNED }
    }
}

/// References to primitives: several may name the same, each with the box of its part.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct References {
    /// The primitive of each reference.
    pub primitives: Vec<PrimId>,
    /// The box of each reference. All boxes of a primitive together hold each of its points; they are rounded outward.
    pub boxes: Vec<Aabb>,
}

/// Up to this many references nothing is split: it would gain little.
const FEW: usize = 8;

/// Builds a tree from the root down whose nodes may part triangles by planes.
///
/// Reads: corners (finite). Writes: a tree whose leaves' [`PrimId`]s number *references*, and these.
/// Holds: at most `1 + extra` references a triangle, at least one each; every point of a triangle inside one of its
/// references' boxes; a depth of at most `below.max_depth`, as [`top_down`](crate::top_down()) keeps it; the same bits for any
/// number of threads.
/// Source: Stich, Friedrich & Dietrich 2009 with unsplitting; Popov et al. 2009 on what may be gained. Departure: each
/// child gets a share of the extra references by the areas of its boxes, so that subtrees do not wait for each other.
#[must_use]
pub fn spatial(corners: &[Corners], config: &SpatialConfig) -> (Tree, References) {
    let fragments: Vec<_> =
        (0..).map(PrimId).zip(corners).map(|(primitive, c)| Fragment { primitive, aabb: c.aabb() }).collect();
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        clippy::cast_precision_loss,
        reason = "saturating, and bounded by what node references can name"
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

/// A part of the tree: nodes before their children, leaves naming `fragments`.
#[derive(Default)]
struct Part {
    children: Vec<[Child; 2]>,
    fragments: Vec<Fragment>,
}

#[expect(clippy::cast_possible_truncation, reason = "at most 2^30 nodes and references")]
impl Part {
    /// Adds a part with its own numbers; returns its root.
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

    /// Makes room for a node; its children follow.
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
    /// Builds the subtree over `fragments`, with at most `budget` more of them; returns its root.
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

    /// The subtree over fragments that stay whole.
    fn rest(&self, fragments: &[Fragment], depth: u32) -> Part {
        let boxes: Vec<_> = fragments.iter().map(|fragment| fragment.aabb).collect();
        let max_depth = self.config.object_splits.max_depth.saturating_add(1).saturating_sub(depth);
        let tree = top_down(&boxes, &TopDownConfig { max_depth, ..self.config.object_splits });
        Part {
            children: tree.nodes.iter().map(|node| [node.left, node.right]).collect(),
            fragments: tree.leaves.iter().map(|leaf| fragments[leaf.index()]).collect(),
        }
    }

    /// Parts the fragments in two, by a plane where that is cheaper.
    fn divide(&self, mut fragments: Vec<Fragment>, budget: usize) -> [Vec<Fragment>; 2] {
        let n_slices = self.config.bins as usize;
        let whole = between(&fragments, n_slices);
        let overlap = whole
            .map_or(f64::INFINITY, |cut| intersection(&cut.boxes[0], &cut.boxes[1]).map_or(0.0, |both| both.area()));
        if overlap > f64::from(self.config.min_overlap) * self.root_area
            && let Some(cut) = through(&fragments, self.corners, n_slices)
            && whole.is_none_or(|whole| cut.cost < whole.cost)
        {
            let sides = self.slice(&fragments, &cut, budget);
            // Where most were kept whole after all one side may hold everything.
            if sides.iter().all(|side| !side.is_empty() && side.len() < fragments.len()) {
                return sides;
            }
        }
        match whole {
            Some(cut) => {
                let left = |f: &Fragment| cut.ruler.slice(f.aabb.center()[cut.axis]) < cut.slice;
                fragments.into_iter().partition::<Vec<_>, _>(left).into()
            }
            None => {
                let right = fragments.split_off(fragments.len().div_ceil(2));
                [fragments, right]
            }
        }
    }

    /// Sends fragments to the sides of a plane; those across are split, or kept whole on the side where that costs less.
    fn slice(&self, fragments: &[Fragment], cut: &Cut, mut budget: usize) -> [Vec<Fragment>; 2] {
        let (axis, plane) = (cut.axis, cut.ruler.plane(cut.slice));
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
            let (wide_left, wide_right) = (left.union(aabb), right.union(aabb));
            let whole_left = wide_left.area() * n_left + right.area() * (n_right - 1.0);
            let whole_right = left.area() * (n_left - 1.0) + wide_right.area() * n_right;
            let split = left.area() * n_left + right.area() * n_right;
            match parts {
                [Some(a), Some(b)] if budget > 0 && split < whole_left.min(whole_right) => {
                    budget -= 1;
                    sides[0].push(Fragment { primitive, aabb: a });
                    sides[1].push(Fragment { primitive, aabb: b });
                }
                [Some(a), None] => sides[0].push(Fragment { primitive, aabb: a }),
                [None, Some(b)] => sides[1].push(Fragment { primitive, aabb: b }),
                _ if whole_left <= whole_right => {
                    (left, n_right) = (wide_left, n_right - 1.0);
                    sides[0].push(*fragment);
                }
                _ => {
                    (right, n_left) = (wide_right, n_left - 1.0);
                    sides[1].push(*fragment);
                }
            }
        }
        sides
    }
}

/// The left side's share of a budget, by the areas of boxes.
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
