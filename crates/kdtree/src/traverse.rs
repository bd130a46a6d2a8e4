//! Rays through cells and leaves.
//!
//! # No lost hit
//! Let a kernel report a hit of a triangle at `t`. All coordinates are relative to the reference point of the tree, so there is a point
//! `x` of the triangle within `(HIT_ERROR + 2^-24)·(|o|∞ + ρ∞)` of `P = o + t·d` ([`canted_trace::ReferencePoint`]). [`canted_trace::SlabRay`] is proven to enter, on every axis, the box `[x - p, x + p]` with `p = AABB_PAD·ρ∞`
//! at most at `t`, and to leave it at `t` or later: the first part of the padding is that of the box, the second is carried by the
//! ray.
//!
//! A kd-tree has planes instead of boxes, and a plane lies between triangles of any size, so no padding can be part of it. Here the
//! *triangle* is padded by `p`: a leaf refers to it if a point of the padded triangle is in its cell ([`crate::extent`]). The ray is
//! that of the boxes. For a plane `s` on an axis, let the ray leave what is below at `e(s)` and enter what is above at `f(s)`:
//!
//! ```text
//! e(s) = fl(fl(s - o⁻)·r)     o⁻ = fl(o - AABB_PAD·|o|∞ - 2^-126)     r = fl(1/d), here positive
//! f(s) = fl(fl(s - o⁺)·r)     o⁺ = fl(o + AABB_PAD·|o|∞ + 2^-126)
//! ```
//!
//! A negative `r` exchanges below and above, and `o⁻` and `o⁺`. Of a node's interval `[t_0, t_1]` the near cell gets
//! `[t_0, min(t_1, e(s))]` and the far one `[max(t_0, f(s)), t_1]`. These overlap: `f(s) <= e(s)`.
//!
//! *There is a leaf whose interval contains `t` and that refers to the triangle.* Rounding is monotonic, so both functions
//! are. Hence the planes that the ray leaves at `t` or later, `e(s) >= t`, are all from some `a` upward, those with `f(s) <= t`
//! all up to some `b`, and no number is between `b` and `a`. The proof for boxes says `a <= x + p` and `b >= x - p`, both
//! rounded outward. So on each axis there is a real `y` with `|y - x| <= p` such that `e(s) >= t` for all planes `s >= y`, and
//! `f(s) <= t` for all `s <= y`. The point `y` belongs to the padded triangle. Go down from the root to a leaf whose cell
//! contains `y` and that refers to the triangle; where `y` is on a plane, [`crate::sweep::Split::sides`] says which. Every plane on the way
//! leaves `t` in the interval, and so do the faces of the root.
//!
//! Errors are thus relative to the triangle and the ray's origin only, although a plane may be far from both.
//!
//! # Order and end
//! Nearer cells come first, but the intervals overlap, so a hit does not end the walk: a leaf is skipped only if its interval
//! begins after the best hit so far. Every hit of equal `t` is thus found, and ties go to the lowest primitive.
//!
//! # Two walks
//! [`stack`] keeps the far cells on a stack. [`ropes`] continues from a leaf across a face. Both visit the same leaves in
//! the same order.

pub(crate) mod ropes;
pub(crate) mod stack;
#[cfg(test)]
mod tests;

use canted_obb::Aabb;
use canted_trace::{Query, SlabRay};

use crate::node::{Node, NodeKind, Reference};

/// A ray on one axis.
#[derive(Clone, Copy, Debug)]
pub(crate) struct AxisRay {
    /// The moved origin for planes that the ray leaves.
    exit_origin: f32,
    /// The moved origin for planes that the ray enters.
    entry_origin: f32,
    recip: f32,
    /// Whether the ray runs downward, so that the upper cell is near.
    pub(crate) is_down: bool,
}

impl AxisRay {
    /// Where the ray leaves what is before a plane.
    #[inline(always)]
    pub(crate) fn exit(&self, plane: f32) -> f32 {
        (plane - self.exit_origin) * self.recip
    }

    /// Where the ray enters what is behind a plane.
    #[inline(always)]
    pub(crate) fn entry(&self, plane: f32) -> f32 {
        (plane - self.entry_origin) * self.recip
    }
}

/// A ray prepared for planes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PlaneRay {
    pub(crate) axes: [AxisRay; 3],
    pub(crate) t_min: f32,
}

impl PlaneRay {
    /// `ray` is prepared with a reach of 0: triangles carry the padding relative to themselves.
    pub(crate) fn new(ray: &SlabRay) -> Self {
        let axis = |k: usize| {
            let (recip, above, below) = (ray.recip()[k], ray.origin_lo()[k], ray.origin_hi()[k]);
            let is_down = recip < 0.0;
            let (exit_origin, entry_origin) = if is_down { (above, below) } else { (below, above) };
            AxisRay { exit_origin, entry_origin, recip, is_down }
        };
        Self { axes: [axis(0), axis(1), axis(2)], t_min: ray.t_min() }
    }

    /// The interval of the ray in the root.
    pub(crate) fn clip(&self, cell: &Aabb, t_max: f32) -> (f32, f32) {
        let mut interval = (self.t_min, t_max);
        for (k, axis) in self.axes.iter().enumerate() {
            let (near, far) = if axis.is_down { (cell.max[k], cell.min[k]) } else { (cell.min[k], cell.max[k]) };
            interval = (interval.0.max(axis.entry(near)), interval.1.min(axis.exit(far)));
        }
        interval
    }
}

/// Near and far child of a node.
#[inline(always)]
pub(crate) fn ordered(axis: &AxisRay, node: u32, upper: u32) -> (u32, u32) {
    if axis.is_down { (upper, node + 1) } else { (node + 1, upper) }
}

/// Calls `visit` with the triangles of a leaf; returns the new `t_max`.
#[inline(always)]
pub(crate) fn visit_leaf<Q: Query>(
    references: &[Reference],
    first: Option<u32>,
    mut t_max: f32,
    query: &mut Q,
    visit: &mut impl FnMut(u32, f32, &mut Q) -> f32,
) -> f32 {
    let Some(first) = first else { return t_max };
    for reference in &references[first as usize..] {
        t_max = visit(reference.triangle(), t_max, query);
        if reference.is_last() || t_max < 0.0 {
            break;
        }
    }
    t_max
}

/// A leaf on the way of a ray.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Reached {
    pub(crate) first: Option<u32>,
    pub(crate) number: u32,
}

/// Goes down from `node` to the first leaf in the order of the ray whose interval is not empty; the interval of `node` begins at `t_0`
/// and is not empty.
#[inline(always)]
pub(crate) fn first_leaf<Q: Query>(nodes: &[Node], ray: &PlaneRay, mut node: u32, t_0: f32, query: &mut Q) -> Reached {
    loop {
        match nodes[node as usize].kind() {
            NodeKind::Leaf { first, number } => return Reached { first, number },
            NodeKind::Inner { axis, plane, upper } => {
                query.boxes(1);
                let axis = &ray.axes[axis];
                let (near, far) = ordered(axis, node, upper);
                // If the near interval is empty, the far one begins at t_0 too.
                node = if t_0 <= axis.exit(plane) { near } else { far };
            }
        }
    }
}
