use canted_lbvh::MAX_DEPTH;
use canted_trace::{Query, SlabRay};

use super::{Binary, ChildWord, ChildWordKind, PairRay, pair::Entries};

/// Subtrees to come back to that fit without an allocation: any radix tree's.
const INLINE_STACK: usize = MAX_DEPTH as usize;

/// A subtree left for later, and where the ray enters it.
#[derive(Clone, Copy)]
struct Waiting {
    child: ChildWord,
    near: f32,
}

impl Binary {
    /// Calls `leaf` with the position of each leaf whose box `ray` enters at or before `t_max`, nearer subtrees first.
    ///
    /// `leaf` returns the new `t_max`. A box is entered no later than any hit in it and is visited while that is `<= t_max`, so ties
    /// reach `leaf`, whatever the tree.
    #[inline]
    pub(crate) fn closest<Q: Query>(
        &self,
        ray: &SlabRay,
        t_max: f32,
        query: &mut Q,
        leaf: impl FnMut(u32, f32, &mut Q) -> f32,
    ) {
        self.walk::<true, Q>(ray, t_max, query, leaf);
    }

    /// Calls `leaf` for leaves in any order until it returns a `t_max` below zero.
    #[inline]
    pub(crate) fn any<Q: Query>(
        &self,
        ray: &SlabRay,
        t_max: f32,
        query: &mut Q,
        leaf: impl FnMut(u32, f32, &mut Q) -> f32,
    ) {
        self.walk::<false, Q>(ray, t_max, query, leaf);
    }

    #[inline(always)]
    fn walk<const ORDERED: bool, Q: Query>(
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
        let unset = Waiting { child: root, near: 0.0 };
        // At most one sibling waits per level above the current node.
        if self.depth as usize <= INLINE_STACK {
            self.descend::<ORDERED, Q>(root, &ray, t_max, &mut [unset; INLINE_STACK], query, leaf);
        } else {
            self.descend::<ORDERED, Q>(root, &ray, t_max, &mut vec![unset; self.depth as usize], query, leaf);
        }
    }

    #[inline(always)]
    fn descend<const ORDERED: bool, Q: Query>(
        &self,
        root: ChildWord,
        ray: &PairRay,
        mut t_max: f32,
        stack: &mut [Waiting],
        query: &mut Q,
        mut leaf: impl FnMut(u32, f32, &mut Q) -> f32,
    ) {
        let mut waiting = 0;
        let mut child = root;
        loop {
            let entered = match child.kind() {
                ChildWordKind::Leaf(position) => {
                    t_max = leaf(position, t_max, query);
                    if !ORDERED && t_max < 0.0 {
                        return;
                    }
                    None
                }
                ChildWordKind::Aabbs(index) => {
                    let pair = &self.aabb_pairs[index as usize];
                    Some((pair.entries(ray, t_max), pair.children))
                }
                ChildWordKind::Slabs(index) => {
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
                        stack[waiting] = Waiting { child: farther, near: far_entry };
                        waiting += 1;
                        child = nearer;
                        continue;
                    }
                }
            }
            // Come back to the last subtree that may still hold something as near.
            loop {
                if waiting == 0 {
                    return;
                }
                waiting -= 1;
                if stack[waiting].near <= t_max {
                    child = stack[waiting].child;
                    break;
                }
            }
        }
    }
}
