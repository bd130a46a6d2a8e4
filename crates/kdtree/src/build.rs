//! From triangles to nodes.
//!
//! ```text
//! corners -> extent in the root -> sorted events -> sweep -> split -> extents of both sides -> merged events -> ...
//! ```

use canted_lbvh::{Corners, par};
use canted_obb::Aabb;

use crate::KdTreeConfig;
use crate::extent::{PAD, extent};
use crate::node::{Node, NodeKind, Reference};
use crate::sweep::{Event, Fragment, Split, best_split, fragment_of, push_events, renumbered};

/// Fragments from which both sides are built in parallel.
const FORK: usize = 1 << 11;

/// Triangles of one job.
const CHUNK: usize = 1 << 12;

/// Nodes and references, depth first, with the root's cell.
#[derive(Debug)]
pub(crate) struct Built {
    pub(crate) nodes: Vec<Node>,
    pub(crate) references: Vec<Reference>,
    pub(crate) cell: Aabb,
    pub(crate) depth: u32,
    pub(crate) n_leaves: u32,
}

/// Builds a kd-tree. No triangle: one empty leaf.
///
/// Reads: finite corners. Writes: nodes, and the triangles of each leaf.
/// Holds: every leaf refers to every triangle of which a padded point is in its cell, except that a point on the border of
/// several cells may be in one of them only; limits of `config`; the same bits for any number of threads.
/// Source: Wald, Havran 2006: events are sorted once and stay sorted, triangles are clipped to the cell. `O(n log n)` for the
/// number of references. Difference: there are limits for depth and references.
pub(crate) fn build(corners: &[Corners], config: &KdTreeConfig) -> Built {
    build_padded(corners, config, PAD)
}

/// As [`build`], with a padding of triangles relative to their coordinates; with less than [`PAD`] hits are lost.
pub(crate) fn build_padded(corners: &[Corners], config: &KdTreeConfig, pad: f64) -> Built {
    let everywhere = Aabb { min: [f32::MIN; 3], max: [f32::MAX; 3] };
    let boxes =
        par::map(corners, CHUNK, |corners| extent(corners, &everywhere, pad).expect("a triangle has an extent"));
    let cell = boxes.iter().fold(Aabb::EMPTY, |cell, aabb| cell.union(*aabb));
    let fragments: Vec<_> = (0..).zip(boxes).map(|(triangle, aabb)| Fragment { triangle, aabb }).collect();
    let mut events = [vec![], vec![], vec![]];
    events.iter_mut().for_each(|events| events.reserve(2 * fragments.len()));
    for (i, fragment) in fragments.iter().enumerate() {
        push_events(&mut events, i, &fragment.aabb);
    }
    let [x, y, z] = &mut events;
    par::join(|| x.sort_unstable(), || par::join(|| y.sort_unstable(), || z.sort_unstable()));
    let builder = Builder { corners, config, depth_limit: config.depth_limit(corners.len()), pad };
    let mut part = Part::default();
    builder.grow(&mut part, &cell, Side { fragments, events }, config.reference_limit(corners.len()), 0);
    let Part { mut nodes, references, depth } = part;
    let n_leaves = number_leaves(&mut nodes);
    Built { nodes, references, cell, depth, n_leaves }
}

/// Numbers the leaves depth first.
fn number_leaves(nodes: &mut [Node]) -> u32 {
    let mut n = 0;
    for node in nodes {
        if let NodeKind::Leaf { .. } = node.kind() {
            *node = node.with_number(n);
            n += 1;
        }
    }
    n
}

/// A part of the tree: the numbers of nodes and references are relative to it.
#[derive(Default)]
struct Part {
    nodes: Vec<Node>,
    references: Vec<Reference>,
    /// Greatest number of nodes above a leaf, from the root of the tree.
    depth: u32,
}

impl Part {
    fn n_nodes(&self) -> u32 {
        self.nodes.len() as u32
    }

    fn append(&mut self, other: &Self) {
        let (nodes, references) = (self.n_nodes(), self.references.len() as u32);
        self.nodes.extend(other.nodes.iter().map(|node| node.shifted(nodes, references)));
        self.references.extend(&other.references);
        self.depth = self.depth.max(other.depth);
    }

    fn push_leaf(&mut self, fragments: &[Fragment], depth: u32) {
        let first = (!fragments.is_empty()).then_some(self.references.len() as u32);
        self.nodes.push(Node::leaf(first));
        let last = fragments.len().wrapping_sub(1);
        let reference = |(i, f): (usize, &Fragment)| Reference::new(f.triangle, i == last);
        self.references.extend(fragments.iter().enumerate().map(reference));
        self.depth = self.depth.max(depth);
    }
}

/// What is in a cell.
#[derive(Default)]
struct Side {
    fragments: Vec<Fragment>,
    /// Sorted events of the fragments on each axis.
    events: [Vec<Event>; 3],
}

struct Builder<'a> {
    corners: &'a [Corners],
    config: &'a KdTreeConfig,
    depth_limit: u32,
    pad: f64,
}

impl Builder<'_> {
    /// Builds the subtree of a cell with at most `budget` references and empty leaves.
    fn grow(&self, part: &mut Part, cell: &Aabb, content: Side, budget: usize, depth: u32) {
        let n = content.fragments.len();
        let split = if depth < self.depth_limit && n > 0 {
            best_split(&content.events, n, cell, budget, self.config)
        } else {
            None
        };
        let Some(split) = split else { return part.push_leaf(&content.fragments, depth) };
        let (mut below, mut above) = (*cell, *cell);
        below.max[split.axis] = split.plane;
        above.min[split.axis] = split.plane;
        let [lower, upper] = self.divide(content, &split, [&below, &above]);
        let [lower_budget, upper_budget] = shares(budget, split.n);
        let node = part.nodes.len();
        part.nodes.push(Node::inner(split.axis, split.plane));
        if n > FORK {
            let mut right = Part::default();
            par::join(
                || self.grow(part, &below, lower, lower_budget, depth + 1),
                || self.grow(&mut right, &above, upper, upper_budget, depth + 1),
            );
            part.nodes[node] = part.nodes[node].with_number(part.n_nodes());
            part.append(&right);
        } else {
            self.grow(part, &below, lower, lower_budget, depth + 1);
            part.nodes[node] = part.nodes[node].with_number(part.n_nodes());
            self.grow(part, &above, upper, upper_budget, depth + 1);
        }
    }

    /// The fragments on each side with sorted events. Those on both sides are clipped to both cells.
    fn divide(&self, content: Side, split: &Split, cells: [&Aabb; 2]) -> [Side; 2] {
        let mut sides = [Side::default(), Side::default()];
        let n_both = (split.n[0] + split.n[1]).saturating_sub(content.fragments.len());
        for (side, n) in sides.iter_mut().zip(split.n) {
            side.fragments.reserve(n);
        }
        // The side of each fragment that is on one only, and its number there.
        let mut targets = Vec::with_capacity(content.fragments.len());
        let mut straddling = Vec::with_capacity(n_both);
        for fragment in &content.fragments {
            targets.push(match split.sides(&fragment.aabb) {
                [true, true] => {
                    straddling.push(fragment.triangle);
                    Target::BOTH
                }
                [_, is_upper] => {
                    let fragments = &mut sides[usize::from(is_upper)].fragments;
                    fragments.push(*fragment);
                    Target::new(fragments.len() - 1, is_upper)
                }
            });
        }
        let mut added: [[Vec<Event>; 3]; 2] = Default::default();
        for &triangle in &straddling {
            for ((side, added), cell) in sides.iter_mut().zip(&mut added).zip(cells) {
                if let Some(aabb) = extent(&self.corners[triangle as usize], cell, self.pad) {
                    push_events(added, side.fragments.len(), &aabb);
                    side.fragments.push(Fragment { triangle, aabb });
                }
            }
        }
        let [lower, upper] = &mut sides;
        for (axis, events) in content.events.iter().enumerate() {
            let [to_lower, to_upper] = [&mut lower.events[axis], &mut upper.events[axis]];
            to_lower.reserve(2 * lower.fragments.len());
            to_upper.reserve(2 * upper.fragments.len());
            for &event in events {
                let target = targets[fragment_of(event)];
                if target == Target::BOTH {
                    continue;
                }
                let to = if target.is_upper() { &mut *to_upper } else { &mut *to_lower };
                to.push(renumbered(event, target.fragment()));
            }
            merge(to_lower, &mut added[0][axis]);
            merge(to_upper, &mut added[1][axis]);
        }
        sides
    }
}

/// Where a fragment is after a split.
#[derive(Clone, Copy, PartialEq, Eq)]
struct Target(u32);

impl Target {
    const BOTH: Self = Self(u32::MAX);
    const UPPER: u32 = 1 << 30;

    fn new(fragment: usize, is_upper: bool) -> Self {
        Self(fragment as u32 | if is_upper { Self::UPPER } else { 0 })
    }

    fn is_upper(self) -> bool {
        self.0 & Self::UPPER != 0
    }

    fn fragment(self) -> u32 {
        self.0 & !Self::UPPER
    }
}

/// Adds events to a sorted list.
fn merge(sorted: &mut Vec<Event>, added: &mut [Event]) {
    added.sort_unstable();
    let (mut i, mut j) = (sorted.len(), added.len());
    sorted.extend_from_slice(added);
    // From the back, so that nothing is overwritten before it has moved.
    while j > 0 {
        if i > 0 && sorted[i - 1] > added[j - 1] {
            i -= 1;
            sorted[i + j] = sorted[i];
        } else {
            j -= 1;
            sorted[i + j] = added[j];
        }
    }
}

/// Divides what is left of a budget in proportion to the number of fragments.
fn shares(budget: usize, n: [usize; 2]) -> [usize; 2] {
    let used = n.map(|n| n.max(1));
    let rest = budget - used[0] - used[1];
    let lower = (rest as u64 * used[0] as u64 / (used[0] + used[1]) as u64) as usize;
    [used[0] + lower, used[1] + (rest - lower)]
}
