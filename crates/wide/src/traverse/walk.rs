use super::node::{Entries, enter_aligned, enter_oriented, words};
use super::RayLanes;
use crate::layout::{ALIGNED_LINES, Line, NodeKind, Nodes, ORIENTED_LINES, Word, WordKind, rows};
use crate::leaf::LeafRange;
use crate::simd::Simd;

/// What a traversal calls.
pub(crate) trait Visitor {
    /// The ray enters a leaf. Returns the new `t_max`; a negative one ends the traversal.
    fn leaf(&mut self, leaf: LeafRange) -> f32;

    /// A node of this kind is about to be tested.
    fn node(&mut self, kind: NodeKind);
}

/// Visits every leaf that `ray` enters at or before `t_max`, nearer subtrees first where `ORDERED`.
///
/// A box is entered no later than any hit in it and is visited while that is `<= t_max`, so ties reach the leaf in every
/// BVH. `stack` has at least [`Nodes::stack_len`] entries: the entry of each subtree that waits above its child word, so that entries are
/// ordered as integers.
#[inline(always)]
pub(crate) fn walk<S: Simd, const ORDERED: bool>(
    simd: S,
    nodes: &Nodes,
    ray: &RayLanes<S>,
    mut t_max: f32,
    stack: &mut [u64],
    visitor: &mut impl Visitor,
) {
    let Nodes { lines, root, .. } = nodes;
    let lines: &[Line] = lines;
    let mut waiting = 0;
    let mut word = *root;
    loop {
        let t_max_lanes = simd.splat(t_max);
        let entered = match word.kind() {
            WordKind::Leaf { first, n } => {
                t_max = visitor.leaf(LeafRange { first, n, t_max });
                if t_max < 0.0 {
                    return;
                }
                None
            }
            WordKind::Node(kind, line) => {
                visitor.node(kind);
                Some(match kind {
                    NodeKind::Aligned => {
                        let rows = rows::<ALIGNED_LINES, 8>(lines, line);
                        (enter_aligned(simd, ray, rows, t_max_lanes), words(&rows[6]))
                    }
                    NodeKind::Oriented => {
                        let rows = rows::<ORIENTED_LINES, 16>(lines, line);
                        (enter_oriented(simd, ray, rows, t_max_lanes), words(&rows[15]))
                    }
                })
            }
            WordKind::Empty => None,
        };
        if let Some((Entries { near, mask }, words)) = entered
            && mask != 0
        {
            let first = mask.trailing_zeros() as usize;
            let rest = mask & (mask - 1);
            if rest == 0 {
                word = words[first];
                continue;
            }
            let near = simd.store(near);
            word = if ORDERED {
                push_ordered(stack, &mut waiting, mask, &near, words)
            } else {
                push(stack, &mut waiting, mask, &near, words)
            };
            continue;
        }
        // Resume with the last subtree that may still hold a hit at most `t_max` away.
        loop {
            if waiting == 0 {
                return;
            }
            waiting -= 1;
            let key = stack[waiting];
            if f32::from_bits((key >> 32) as u32) <= t_max {
                word = Word(key as u32);
                break;
            }
        }
    }
}

/// A stack entry: a child and where the ray enters it.
#[inline(always)]
fn key(near: &[f32; 8], words: &[Word; 8], child: u32) -> u64 {
    let child = (child & 7) as usize;
    u64::from(near[child].to_bits()) << 32 | u64::from(words[child].0)
}

/// Pushes all children but the nearest, the farthest first, and returns the nearest.
#[inline(always)]
fn push_ordered(stack: &mut [u64], waiting: &mut usize, mut mask: u32, near: &[f32; 8], words: &[Word; 8]) -> Word {
    let first = key(near, words, mask.trailing_zeros());
    mask &= mask - 1;
    let second = key(near, words, mask.trailing_zeros());
    mask &= mask - 1;
    let mut nearest = first.min(second);
    let base = *waiting;
    stack[base] = first.max(second);
    let mut top = base + 1;
    while mask != 0 {
        let next = key(near, words, mask.trailing_zeros());
        mask &= mask - 1;
        let far = nearest.max(next);
        nearest = nearest.min(next);
        // Insertion sort: entries of this node decrease from bottom to top.
        let mut at = top;
        while at > base && stack[at - 1] < far {
            stack[at] = stack[at - 1];
            at -= 1;
        }
        stack[at] = far;
        top += 1;
    }
    *waiting = top;
    Word(nearest as u32)
}

/// Pushes all children but the first, and returns it.
#[inline(always)]
fn push(stack: &mut [u64], waiting: &mut usize, mut mask: u32, near: &[f32; 8], words: &[Word; 8]) -> Word {
    let first = words[(mask.trailing_zeros() & 7) as usize];
    mask &= mask - 1;
    while mask != 0 {
        stack[*waiting] = key(near, words, mask.trailing_zeros());
        *waiting += 1;
        mask &= mask - 1;
    }
    first
}
