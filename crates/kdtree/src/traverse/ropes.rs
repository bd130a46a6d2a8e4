//! The walk without a stack.
//!
//! # The next leaf
//! Let the ray be in leaf `A` with interval `[t_0, t_1]`, and let `N` be a node above `A` with `A` in its near cell. The walk with a stack
//! continues in the far cell of the *lowest* such `N` whose far interval is not empty. Of the planes above `A` on one axis with `A` on the near
//! side, only the lowest can be that of `N`: it is a face of `A`. For if its far interval is empty, it begins after `t_1`
//! of its node, which a lower plane of another axis has cut, by its `e(s)`, and the far interval of that plane is not empty, since
//! `f(s) <= e(s)`. So the candidates are the three faces of `A` through which the ray can leave.
//!
//! In the order of their nodes from the lowest up, a face with plane `s` is the next one if `f(s)` is at most `t_max` and at most the
//! exit `e` of each face of a higher node: the faces of lower nodes do not bound the interval of `N`, and those of `A` on their axes, which
//! are nearer than those of `N`, have failed, so they exceed the minimum anyway. A leaf stores the depth of each face. Faces of the root lead
//! nowhere, but end intervals.
//!
//! # The rope
//! A rope leads to the smallest subtree that covers the face, below the far cell of `N`. The walk may begin there if that skips no
//! leaf: on the way down from the far cell to the subtree, near cells beside the face are passed by, at planes not beyond the near
//! faces of `A`. They are empty if the ray has left what is before these faces, on the two other axes, before it enters the far cell: `e < f(s)`. The
//! far interval then begins at `max(t_min, f(s))`. Otherwise, that is where the ray passes an edge of `A` within rounding or runs in a plane, the
//! walk goes down from the root to `N` once more, which gives the interval of the far cell, and begins there.
//!
//! Source: Popov, Günther, Seidel, Slusallek 2007; Havran, Bittner, Žára 1998. Difference: intervals overlap, so that one face is not
//! enough to choose the next leaf.

use canted_trace::Query;

use super::{PlaneRay, first_leaf, ordered, visit_leaf};
use crate::KdNodes;
use crate::node::NodeKind;
use crate::nodes::Ropes;

/// Calls `leaf` with the number of each leaf in order, and `visit` with its triangles, until a `t_max` below zero.
#[inline(always)]
pub(crate) fn walk<Q: Query>(
    tree: &KdNodes,
    ray: &PlaneRay,
    mut t_max: f32,
    query: &mut Q,
    mut leaf: impl FnMut(u32),
    mut visit: impl FnMut(u32, f32, &mut Q) -> f32,
) {
    let (t_0, t_1) = ray.clip(tree.cell(), t_max);
    query.boxes(1);
    if t_0 > t_1 {
        return;
    }
    let mut next = Some((0, t_0));
    while let Some((node, t_0)) = next {
        let reached = first_leaf(&tree.nodes, ray, node, t_0, query);
        leaf(reached.number);
        t_max = visit_leaf(&tree.references, reached.first, t_max, query, &mut visit);
        if t_max < 0.0 {
            return;
        }
        next = successor(tree, ray, &tree.ropes[reached.number as usize], t_max);
    }
}

/// The node to go down from after a leaf, and where the ray enters it.
#[inline(always)]
fn successor(tree: &KdNodes, ray: &PlaneRay, from: &Ropes, t_max: f32) -> Option<(u32, f32)> {
    let far: [usize; 3] = std::array::from_fn(|k| 2 * k + usize::from(!ray.axes[k].is_down));
    let depths = far.map(|face| from.depths[face]);
    let exits: [f32; 3] = std::array::from_fn(|k| ray.axes[k].exit(from.plane(far[k])));
    // Axes by depth of their far faces, the lowest node first.
    let mut order = [0, 1, 2];
    for (i, j) in [(0, 1), (1, 2), (0, 1)] {
        if depths[order[i]] < depths[order[j]] {
            order.swap(i, j);
        }
    }
    for (i, &axis) in order.iter().enumerate() {
        if depths[axis] == 0 {
            return None;
        }
        let entry = ray.axes[axis].entry(from.plane(far[axis]));
        let limit = order[i + 1..].iter().fold(t_max, |limit, &k| limit.min(exits[k]));
        if entry > limit {
            continue;
        }
        let is_past = |k: usize| ray.axes[k].exit(from.plane(far[k] ^ 1)) < entry;
        if is_past((axis + 1) % 3) && is_past((axis + 2) % 3) {
            return Some((from.targets[far[axis]], entry.max(ray.t_min)));
        }
        let next = far_cell(tree, ray, from, far[axis]);
        if next.1 <= t_max {
            return Some(next);
        }
    }
    None
}

/// The far cell of the node whose plane is a face of the leaf, and where its interval begins.
#[cold]
fn far_cell(tree: &KdNodes, ray: &PlaneRay, from: &Ropes, face: usize) -> (u32, f32) {
    let (mut t_0, _) = ray.clip(tree.cell(), f32::INFINITY);
    let mut node = 0;
    for _ in 1..from.depths[face] {
        let NodeKind::Inner { axis, plane, upper } = tree.nodes[node as usize].kind() else { break };
        let is_upper = from.cell.min[axis] >= plane;
        let next = if is_upper { upper } else { node + 1 };
        let axis = &ray.axes[axis];
        if is_upper != axis.is_down {
            // The leaf is in the far cell.
            t_0 = t_0.max(axis.entry(plane));
        }
        node = next;
    }
    match tree.nodes[node as usize].kind() {
        NodeKind::Inner { axis, plane, upper } => {
            let axis = &ray.axes[axis];
            let (_, far) = ordered(axis, node, upper);
            (far, t_0.max(axis.entry(plane)))
        }
        NodeKind::Leaf { .. } => (node, t_0),
    }
}
