use canted_lbvh::MAX_DEPTH;
use canted_trace::{Query, SlabRay};

use super::bvh::PairBvh;
use super::child::{ChildRef, ChildRefKind};
use super::node::{Entries, PairRay};

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
