//! The walk with a stack.
//!
//! Source: Havran 2000, TA-rec-B, as Silva 2010 has it, with near and far by the sign of the direction. Difference: two plane
//! distances, of which one ends the near interval and the other begins the far one; a plane behind the ray or beyond the interval needs
//! no case of its own.

use canted_trace::Query;

use super::{PlaneRay, ordered, visit_leaf};
use crate::KdNodes;
use crate::node::{MAX_DEPTH, NodeKind};

/// A far cell, and the interval of the ray in it.
#[derive(Clone, Copy)]
struct Far {
    node: u32,
    t_0: f32,
    t_1: f32,
}

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
    let (mut t_0, mut t_1) = ray.clip(tree.cell(), t_max);
    query.boxes(1);
    if t_0 > t_1 {
        return;
    }
    // At most one far cell for each node above the current one is on the stack.
    let mut stack = [Far { node: 0, t_0, t_1 }; MAX_DEPTH as usize];
    let mut n_stacked = 0;
    let mut node = 0;
    loop {
        match tree.nodes[node as usize].kind() {
            NodeKind::Inner { axis, plane, upper } => {
                query.boxes(1);
                let axis = &ray.axes[axis];
                let (near, far) = ordered(axis, node, upper);
                let (exit, entry) = (axis.exit(plane), axis.entry(plane));
                if exit < t_0 {
                    node = far;
                } else {
                    if entry <= t_1 {
                        stack[n_stacked] = Far { node: far, t_0: t_0.max(entry), t_1 };
                        n_stacked += 1;
                    }
                    node = near;
                    t_1 = t_1.min(exit);
                }
                continue;
            }
            NodeKind::Leaf { first, number } => {
                leaf(number);
                t_max = visit_leaf(&tree.references, first, t_max, query, &mut visit);
                if t_max < 0.0 {
                    return;
                }
            }
        }
        // Continue with the last far cell that can still contain a hit at or before t_max.
        loop {
            if n_stacked == 0 {
                return;
            }
            n_stacked -= 1;
            let far = stack[n_stacked];
            if far.t_0 <= t_max {
                (node, t_0, t_1) = (far.node, far.t_0, far.t_1.min(t_max));
                break;
            }
        }
    }
}
