//! Rays that walk together: one test of a node for all of them, and of each leaf which of them enter it.
//!
//! # No lost hit
//! For the planes of an axis let all directions `d_i` of the group be positive. A node's near plane is computed as for one ray, with the greatest
//! origin that any ray has, thickened by the part of the pad of the greatest `|o|∞`, and the reciprocal of the greatest direction `d`. In the proof of
//! `traverse`, with `S` of the greatest `|o|∞`, what is multiplied by that reciprocal is at most `t·d_i·(1 - 2.01 u)` for a hit of ray `i` at `t`,
//! so with `t >= 0` and `d >= d_i` the entry is at most `t`. Far planes are crossed later than `t` by the same argument with the least origin and
//! direction, and negative directions exchange both. So a group enters every node that one of its rays has a hit in, no later than there.

use super::eight::EightRays;
use super::ray::{MeshFrame, Pads, splat3};
use super::walk::{Entries, LeafRange, words};
use crate::node::{ALIGNED_LINES, CacheLine, ChildWord, DecodedWord, NodeKind, Nodes, Row, rows};
use crate::simd::Simd;

/// Rays of a group.
pub(crate) const GROUP: usize = 16;

/// How many tests of nodes take as long as that of a block of triangles, about.
pub(crate) const BLOCK: u32 = 2;

/// What a group costs beyond its tests: the numbers of each ray pass through memory.
pub(crate) const OVERHEAD: u32 = 24;

/// Fewest rays in a leaf that are tested together: which triangles they may hit takes as long as a block, and each of those twice that.
const TOGETHER: u32 = 4;

/// Entries of the stack that a subtree takes which waits: where the group enters it and its word, and the place of its box.
pub(crate) const ENTRY: usize = 2;

/// Two times eight rays, prepared for a walk together.
pub(crate) struct RayGroup<'a, S: Simd> {
    eights: &'a [EightRays; 2],
    recip_near: [S::F; 3],
    recip_far: [S::F; 3],
    near: [S::F; 3],
    far: [S::F; 3],
    flipped: [bool; 3],
    t_min: S::F,
}

impl<'a, S: Simd> RayGroup<'a, S> {
    /// `None` where the rays have no common signs of directions along the axes, or one of them is none that eight can prepare.
    #[inline(always)]
    pub(crate) fn new(simd: S, eights: &'a [EightRays; 2], frame: &MeshFrame, pads: Pads) -> Option<Self> {
        let [a, b] = eights;
        if !a.are_all() || !b.are_all() {
            return None;
        }
        let mut reach = simd.splat(0.0);
        for k in 0..3 {
            let (o_a, o_b) = (simd.load(&a.lanes.moved[k]), simd.load(&b.lanes.moved[k]));
            reach = simd.max(reach, simd.max(simd.abs(o_a), simd.abs(o_b)));
        }
        let pads = pads.along([greatest_of(&simd.store(reach)); 3]);
        let pad = if frame.is_identity { pads.aligned } else { pads.rotated };
        let (mut recip_near, mut recip_far) = ([0.0; 3], [0.0; 3]);
        let (mut near, mut far, mut flipped) = ([0.0; 3], [0.0; 3], [false; 3]);
        for k in 0..3 {
            let (r_a, r_b) = (simd.load(&a.lanes.recip[k]), simd.load(&b.lanes.recip[k]));
            let (o_a, o_b) = (simd.load(&a.lanes.along[k]), simd.load(&b.lanes.along[k]));
            let r = [least_of(&simd.store(simd.min(r_a, r_b))), greatest_of(&simd.store(simd.max(r_a, r_b)))];
            let o =
                [least_of(&simd.store(simd.min(o_a, o_b))) - pad, greatest_of(&simd.store(simd.max(o_a, o_b))) + pad];
            flipped[k] = r[1] < 0.0;
            if r[0] < 0.0 && !flipped[k] {
                return None;
            }
            let ([r_near, r_far], [o_near, o_far]) = if flipped[k] { ([r[1], r[0]], o) } else { (r, [o[1], o[0]]) };
            (recip_near[k], recip_far[k]) = (r_near, r_far);
            (near[k], far[k]) = (-o_near * r_near, -o_far * r_far);
        }
        let t_min = simd.min(simd.load(&a.lanes.t_min), simd.load(&b.lanes.t_min));
        Some(Self {
            eights,
            recip_near: splat3(simd, recip_near),
            recip_far: splat3(simd, recip_far),
            near: splat3(simd, near),
            far: splat3(simd, far),
            flipped,
            t_min: simd.splat(least_of(&simd.store(t_min)) + 0.0),
        })
    }

    /// Whether no ray enters a child of the root.
    #[inline(always)]
    pub(crate) fn misses(&self, simd: S, nodes: &Nodes) -> bool {
        match nodes.root.kind() {
            DecodedWord::Node(NodeKind::Aligned, line) => {
                self.enter(simd, rows::<ALIGNED_LINES, 8>(&nodes.lines, line), f32::INFINITY).mask == 0
            }
            _ => false,
        }
    }

    /// Calls `leaf` with each ray that enters a leaf at or before its `t_max`, nearer subtrees of the group first where `ORDERED`. It returns the
    /// new `t_max` of the ray; a negative one ends its traversal.
    ///
    /// Nodes are aligned. `stack` has room for [`ENTRY`] times [`Nodes::stack_len`]. Returns the work, in tests of nodes; `None`
    /// once it exceeds `limit`, which only the last leaf may do.
    #[inline(always)]
    pub(crate) fn walk<const ORDERED: bool>(
        &self,
        simd: S,
        nodes: &Nodes,
        t_max: &mut [[f32; 8]; 2],
        stack: &mut [u64],
        leaves: &mut impl GroupLeaves,
        limit: u32,
    ) -> Option<u32> {
        let lines: &[CacheLine] = &nodes.lines;
        let mut farthest = greatest_of_all(t_max);
        let mut waiting = 0;
        let mut word = nodes.root;
        let mut place = None;
        let mut work = OVERHEAD;
        loop {
            work += 1;
            if work > limit {
                return None;
            }
            match word.kind() {
                DecodedWord::Node(NodeKind::Aligned, line) => {
                    let rows = rows::<ALIGNED_LINES, 8>(lines, line);
                    let Entries { near, mask } = self.enter(simd, rows, farthest);
                    if mask != 0 {
                        let near = simd.store(near);
                        push::<ORDERED>(stack, &mut waiting, mask, &near, words(&rows[6]), line);
                    }
                }
                DecodedWord::Leaf { first, n } => {
                    let entered = match place {
                        None => u32::MAX >> (32 - GROUP),
                        Some((line, slot)) => {
                            let rows = rows::<ALIGNED_LINES, 8>(lines, line);
                            self.enter_box(simd, rows, slot, t_max)
                        }
                    };
                    let mut mask = entered;
                    let mut has_hit = false;
                    if mask.count_ones() >= TOGETHER && leaves.can_test_together() {
                        let (tests, found) = leaves.leaf_together(mask, (first, n), t_max);
                        (mask, has_hit) = (0, found);
                        work += tests;
                    }
                    while mask != 0 {
                        let i = mask.trailing_zeros() as usize & (GROUP - 1);
                        mask &= mask - 1;
                        work += BLOCK * n.div_ceil(8);
                        let old = t_max[i / 8][i % 8];
                        let new = leaves.leaf(i, LeafRange { first, n, t_max: old });
                        t_max[i / 8][i % 8] = new;
                        has_hit |= new != old;
                    }
                    if has_hit {
                        farthest = greatest_of_all(t_max);
                        if farthest < 0.0 {
                            return Some(work);
                        }
                    }
                }
                DecodedWord::Node(NodeKind::Oriented, _) | DecodedWord::Empty => {}
            }
            loop {
                if waiting == 0 {
                    return Some(work);
                }
                waiting -= 1;
                let (key, at) = (stack[ENTRY * waiting], stack[ENTRY * waiting + 1]);
                if f32::from_bits((key >> 32) as u32) <= farthest {
                    word = ChildWord(key as u32);
                    place = Some(((at >> 3) as u32, (at & 7) as usize));
                    break;
                }
            }
        }
    }

    /// Where the group enters the children of a node.
    #[inline(always)]
    fn enter(&self, simd: S, rows: &[Row; 8], t_max: f32) -> Entries<S> {
        let near_x = self.near_plane(simd, rows, 0);
        let near_y = self.near_plane(simd, rows, 1);
        let near_z = self.near_plane(simd, rows, 2);
        let far_x = self.far_plane(simd, rows, 0);
        let far_y = self.far_plane(simd, rows, 1);
        let far_z = self.far_plane(simd, rows, 2);
        let near = simd.max(simd.max(near_x, near_y), simd.max(near_z, self.t_min));
        let far = simd.min(simd.min(far_x, far_y), simd.min(far_z, simd.splat(t_max)));
        Entries { near, mask: simd.le(near, far) }
    }

    #[inline(always)]
    fn near_plane(&self, simd: S, rows: &[Row; 8], k: usize) -> S::F {
        simd.mul_add(simd.load(&rows[2 * k + usize::from(self.flipped[k])]), self.recip_near[k], self.near[k])
    }

    #[inline(always)]
    fn far_plane(&self, simd: S, rows: &[Row; 8], k: usize) -> S::F {
        simd.mul_add(simd.load(&rows[2 * k + usize::from(!self.flipped[k])]), self.recip_far[k], self.far[k])
    }

    /// Which rays enter the box in a slot of a node, each by its own numbers.
    #[inline(always)]
    fn enter_box(&self, simd: S, rows: &[Row; 8], slot: usize, t_max: &[[f32; 8]; 2]) -> u32 {
        let slot = slot & 7;
        let mut planes = [[simd.splat(0.0); 2]; 3];
        for k in 0..3 {
            let flipped = usize::from(self.flipped[k]);
            planes[k] = [simd.splat(rows[2 * k + flipped][slot]), simd.splat(rows[2 * k + 1 - flipped][slot])];
        }
        let [a, b] = self.eights;
        enter_eight(simd, a, &planes, &t_max[0]) | enter_eight(simd, b, &planes, &t_max[1]) << 8
    }
}

#[inline(always)]
fn enter_eight<S: Simd>(simd: S, rays: &EightRays, planes: &[[S::F; 2]; 3], t_max: &[f32; 8]) -> u32 {
    let of = &rays.lanes;
    let (mut near, mut far) = (simd.load(&of.t_min), simd.load(t_max));
    for (k, &[near_plane, far_plane]) in planes.iter().enumerate() {
        let recip = simd.load(&of.recip[k]);
        near = simd.max(simd.mul_add(near_plane, recip, simd.load(&of.near[k])), near);
        far = simd.min(simd.mul_add(far_plane, recip, simd.load(&of.far[k])), far);
    }
    simd.le(near, far)
}

/// What a group calls.
pub(crate) trait GroupLeaves {
    /// Ray `i` enters a leaf. Returns its new `t_max`; a negative one ends its traversal.
    fn leaf(&mut self, i: usize, leaf: LeafRange) -> f32;

    /// Whether the rays can be tested together.
    fn can_test_together(&self) -> bool;

    /// These rays enter a leaf of `n` triangles from `first`. Changes their `t_max`; a negative one ends the traversal. Returns the work, in tests of
    /// nodes, and whether a `t_max` has changed.
    fn leaf_together(&mut self, rays: u32, leaf: (u32, u32), t_max: &mut [[f32; 8]; 2]) -> (u32, bool);
}

/// Pushes all children, the farthest first where `ORDERED`, else the last first.
#[inline(always)]
fn push<const ORDERED: bool>(
    stack: &mut [u64],
    waiting: &mut usize,
    mut mask: u32,
    near: &[f32; 8],
    words: &[ChildWord; 8],
    line: u32,
) {
    let base = *waiting;
    let mut top = base;
    while mask != 0 {
        let child = (31 - mask.leading_zeros()) as usize & 7;
        mask &= !(1 << child);
        let key = u64::from(near[child].to_bits()) << 32 | u64::from(words[child].0);
        let mut at = top;
        while ORDERED && at > base && stack[ENTRY * (at - 1)] < key {
            stack[ENTRY * at] = stack[ENTRY * (at - 1)];
            stack[ENTRY * at + 1] = stack[ENTRY * (at - 1) + 1];
            at -= 1;
        }
        stack[ENTRY * at] = key;
        stack[ENTRY * at + 1] = u64::from(line) << 3 | child as u64;
        top += 1;
    }
    *waiting = top;
}

#[inline(always)]
fn greatest_of_all([a, b]: &[[f32; 8]; 2]) -> f32 {
    f32::max(greatest_of(a), greatest_of(b))
}

#[inline(always)]
pub(super) fn greatest_of(x: &[f32; 8]) -> f32 {
    let pairs = [f32::max(x[0], x[4]), f32::max(x[1], x[5]), f32::max(x[2], x[6]), f32::max(x[3], x[7])];
    f32::max(f32::max(pairs[0], pairs[1]), f32::max(pairs[2], pairs[3]))
}

#[inline(always)]
pub(super) fn least_of(x: &[f32; 8]) -> f32 {
    let pairs = [f32::min(x[0], x[4]), f32::min(x[1], x[5]), f32::min(x[2], x[6]), f32::min(x[3], x[7])];
    f32::min(f32::min(pairs[0], pairs[1]), f32::min(pairs[2], pairs[3]))
}
