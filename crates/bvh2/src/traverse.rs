//! Rays through pairs.

use canted_lbvh::MAX_DEPTH;
use canted_trace::{Leaves, MIN_DIRECTION, Query, SlabRay};
use glam::{Vec4, Vec4Swizzles};

use crate::pairs::{AabbPair, ChildRef, ChildRefKind, PairBvh, SlabPair};

/// Stack entries on the call stack: enough for every radix tree.
const INLINE_STACK: usize = MAX_DEPTH as usize;

/// A subtree on the stack, and the `t` at which the ray enters it.
#[derive(Clone, Copy)]
struct StackEntry {
    child: ChildRef,
    near: f32,
}

impl PairBvh {
    /// Calls `leaf` with the position of each leaf whose box `ray` enters at or before `t_max`, nearer subtrees first.
    ///
    /// `ray` is prepared with a reach of 0: the boxes are padded. `t_max` is scaled, and `leaf` returns the new one. The entry
    /// `t` of a box is at most that of any hit in it, and boxes with an entry `<= t_max` are visited, so `leaf` receives all
    /// hits of equal `t`.
    #[inline]
    pub fn traverse_ordered<Q: Query>(
        &self,
        ray: &SlabRay,
        t_max: f32,
        query: &mut Q,
        leaf: impl FnMut(u32, f32, &mut Q) -> f32,
    ) {
        self.traverse::<true, Q>(ray, t_max, query, leaf);
    }

    /// As [`PairBvh::traverse_ordered`], in any order, until `leaf` returns a `t_max` below zero.
    #[inline]
    pub fn traverse_any<Q: Query>(
        &self,
        ray: &SlabRay,
        t_max: f32,
        query: &mut Q,
        leaf: impl FnMut(u32, f32, &mut Q) -> f32,
    ) {
        self.traverse::<false, Q>(ray, t_max, query, leaf);
    }

    #[inline(always)]
    fn descend<const ORDERED: bool, Q: Query>(
        &self,
        root: ChildRef,
        ray: &PairRay,
        mut t_max: f32,
        stack: &mut [StackEntry],
        query: &mut Q,
        mut leaf: impl FnMut(u32, f32, &mut Q) -> f32,
    ) {
        let mut n_stacked = 0;
        let mut child = root;
        loop {
            let entered = match child.kind() {
                ChildRefKind::Leaf(position) => {
                    t_max = leaf(position, t_max, query);
                    if !ORDERED && t_max < 0.0 {
                        return;
                    }
                    None
                }
                ChildRefKind::Aabbs(index) => {
                    let pair = &self.aabb_pairs[index as usize];
                    Some((pair.entries(ray, t_max), pair.children))
                }
                ChildRefKind::Slabs(index) => {
                    let pair = &self.slab_pairs[index as usize];
                    Some((pair.entries(ray, t_max), pair.children()))
                }
            };
            if let Some((Entries { near, mask }, [first, second])) = entered {
                query.boxes(2);
                match mask {
                    0 => {}
                    1 => {
                        child = first;
                        continue;
                    }
                    2 => {
                        child = second;
                        continue;
                    }
                    _ => {
                        let swap = ORDERED && near.y < near.x;
                        let (nearer, farther, far_entry) =
                            if swap { (second, first, near.x) } else { (first, second, near.y) };
                        stack[n_stacked] = StackEntry { child: farther, near: far_entry };
                        n_stacked += 1;
                        child = nearer;
                        continue;
                    }
                }
            }
            // Continue with the last subtree that can still contain a hit at or before t_max.
            loop {
                if n_stacked == 0 {
                    return;
                }
                n_stacked -= 1;
                if stack[n_stacked].near <= t_max {
                    child = stack[n_stacked].child;
                    break;
                }
            }
        }
    }
}

impl Leaves for PairBvh {
    #[inline(always)]
    fn traverse<const ORDERED: bool, Q: Query>(
        &self,
        ray: &SlabRay,
        t_max: f32,
        query: &mut Q,
        leaf: impl FnMut(u32, f32, &mut Q) -> f32,
    ) {
        let Some(root) = self.root else { return };
        query.boxes(1);
        if ray.intersect_slabs(&self.root_slabs, t_max).is_none() {
            return;
        }
        let ray = PairRay::new(ray);
        let unset = StackEntry { child: root, near: 0.0 };
        // At most one sibling per level above the current node is on the stack.
        if self.depth as usize <= INLINE_STACK {
            self.descend::<ORDERED, Q>(root, &ray, t_max, &mut [unset; INLINE_STACK], query, leaf);
        } else {
            self.descend::<ORDERED, Q>(root, &ray, t_max, &mut vec![unset; self.depth as usize], query, leaf);
        }
    }
}

/// A ray prepared for pair tests: each number is in the lanes that use it.
///
/// Lanes are (child 0, child 1) of the lower planes, then of the upper ones. The numbers are those of [`SlabRay`], so
/// its proof that no accepted hit is lost applies unchanged.
pub(crate) struct PairRay {
    origin: [Vec4; 3],
    recip: [Vec4; 3],
    origin_direction: [Vec4; 3],
    pad: Vec4,
    t_min: Vec4,
}

impl PairRay {
    pub(crate) fn new(ray: &SlabRay) -> Self {
        let lanes = |a: f32, b: f32| Vec4::new(a, a, b, b);
        Self {
            origin: std::array::from_fn(|k| lanes(ray.origin_lo()[k], ray.origin_hi()[k])),
            recip: std::array::from_fn(|k| Vec4::splat(ray.recip()[k])),
            origin_direction: std::array::from_fn(|k| lanes(ray.origin()[k], ray.direction()[k])),
            pad: lanes(ray.pad_oriented(), -ray.pad_oriented()),
            t_min: Vec4::splat(ray.t_min()),
        }
    }
}

/// The boxes of two siblings that a ray enters: entry `t` of each, and bit `i` set if it enters child `i`.
pub(crate) struct Entries {
    pub(crate) near: Vec4,
    pub(crate) mask: u32,
}

/// Combines the plane distances of the three axes. Lanes 0 and 1 hold the result.
#[inline(always)]
fn join(ray: &PairRay, [x, y, z]: [Vec4; 3], t_max: f32) -> Entries {
    let (swapped_x, swapped_y, swapped_z) = (x.zwxy(), y.zwxy(), z.zwxy());
    let near = x.min(swapped_x).max(y.min(swapped_y)).max(z.min(swapped_z).max(ray.t_min));
    let far = x.max(swapped_x).min(y.max(swapped_y)).min(z.max(swapped_z).min(Vec4::splat(t_max)));
    Entries { near, mask: near.cmple(far).bitmask() & 3 }
}

impl AabbPair {
    #[inline(always)]
    pub(crate) fn entries(&self, ray: &PairRay, t_max: f32) -> Entries {
        let distance = |k: usize| (self.planes[k] - ray.origin[k]) * ray.recip[k];
        join(ray, [distance(0), distance(1), distance(2)], t_max)
    }
}

impl SlabPair {
    #[inline(always)]
    pub(crate) fn children(&self) -> [ChildRef; 2] {
        [ChildRef(self.rows_z[1].z.to_bits()), ChildRef(self.rows_z[1].w.to_bits())]
    }

    #[inline(always)]
    pub(crate) fn entries(&self, ray: &PairRay, t_max: f32) -> Entries {
        let [o_d_x, o_d_y, o_d_z] = ray.origin_direction;
        let distance = |k: usize, z: Vec4| {
            // Lanes: origins of both children along the row, then directions.
            let xy = self.rows_xy[k];
            let along = (xy.xyxy() * o_d_x + xy.zwzw() * o_d_y) + z * o_d_z;
            let direction = along.zwzw();
            let direction = direction.abs().max(Vec4::splat(MIN_DIRECTION)).copysign(direction);
            (self.planes[k] - (along.xyxy() + ray.pad)) / direction
        };
        let [z01, z2] = self.rows_z;
        join(ray, [distance(0, z01.xyxy()), distance(1, z01.zwzw()), distance(2, z2.xyxy())], t_max)
    }
}
