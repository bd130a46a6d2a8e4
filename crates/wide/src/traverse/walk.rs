use super::ray::ROW;
use super::{RayLanes, ThroughNodes};
use crate::node::{ALIGNED_LINES, CacheLine, ChildWord, DecodedWord, NodeKind, Nodes, ORIENTED_LINES, Row, rows};
use crate::simd::Simd;

/// A leaf, and how far the ray still goes.
#[derive(Clone, Copy, Debug)]
pub struct LeafRange {
    pub(crate) first: u32,
    pub(crate) n: u32,
    pub(crate) t_max: f32,
}

impl LeafRange {
    /// A leaf outside of a traversal by rays.
    pub(crate) fn new(first: u32, n: u32) -> Self {
        Self { first, n, t_max: f32::INFINITY }
    }
}

/// What a traversal calls.
pub(crate) trait Visitor {
    /// Whether there is a second loop for BVHs without oriented nodes.
    const TWO_LOOPS: bool = true;

    /// Whether every leaf is visited, whatever the order: `t_max` stays as it is.
    const ALL: bool = false;

    /// The ray enters a leaf. Returns the new `t_max`; a negative one ends the traversal.
    fn leaf(&mut self, leaf: LeafRange) -> f32;

    /// A leaf that starts here waits to be entered.
    #[inline(always)]
    fn prefetch(&self, _: u32) {}

    /// A node of this kind is about to be tested.
    fn node(&mut self, kind: NodeKind);
}

/// Visits every leaf that `ray` enters at or before `t_max`, nearer subtrees first where `ORDERED`.
///
/// A box is entered no later than any hit in it and is visited while that is `<= t_max`, so ties reach the leaf in every
/// BVH. `stack` has room for at least [`Nodes::stack_len`] subtrees that wait; where it has more, walks to all leaves put some off. Each is
/// an integer: in its upper half the `t` at which the ray enters the subtree, in its lower half the child word. So the order of these integers
/// is the order along the ray.
#[inline(always)]
pub(crate) fn walk<S: Simd, R: ThroughNodes, V: Visitor, const ORDERED: bool>(
    simd: S,
    nodes: &Nodes,
    ray: R,
    t_max: f32,
    stack: &mut [u64],
    visitor: &mut V,
) {
    // Two loops: what oriented nodes need of the ray would push what aligned ones need out of registers.
    if V::TWO_LOOPS && !nodes.has_oriented {
        walk_nodes::<S, V, ORDERED, false>(simd, nodes, &ray.lanes(simd), t_max, stack, visitor);
    } else {
        walk_nodes::<S, V, ORDERED, true>(simd, nodes, &ray.lanes(simd), t_max, stack, visitor);
    }
}

/// [`walk`] through nodes of which some may be oriented, or none.
#[inline(always)]
fn walk_nodes<S: Simd, V: Visitor, const ORDERED: bool, const ORIENTED: bool>(
    simd: S,
    nodes: &Nodes,
    ray: &RayLanes<S>,
    mut t_max: f32,
    stack: &mut [u64],
    visitor: &mut V,
) {
    let Nodes { lines, root, .. } = nodes;
    let lines: &[CacheLine] = lines;
    let prefetches = lines.len() >= LARGE;
    // Subtrees are put off while fewer than this many wait: the walk of any other then has room above them.
    let room = if V::ALL && prefetches { stack.len().saturating_sub(nodes.stack_len() + 8) } else { 0 };
    let mut delayed = Delayed::NONE;
    let mut waiting = 0;
    let mut word = *root;
    loop {
        let t_max_lanes = simd.splat(t_max);
        let entered = match word.kind() {
            DecodedWord::Leaf { first, n } => {
                t_max = visitor.leaf(LeafRange { first, n, t_max });
                if t_max < 0.0 {
                    return;
                }
                None
            }
            DecodedWord::Node(NodeKind::Aligned, line) => {
                visitor.node(NodeKind::Aligned);
                let rows = rows::<ALIGNED_LINES, 8>(lines, line);
                Some((enter_aligned(simd, ray, rows, t_max_lanes), words(&rows[6])))
            }
            DecodedWord::Node(NodeKind::Oriented, line) if ORIENTED => {
                visitor.node(NodeKind::Oriented);
                let rows = rows::<ORIENTED_LINES, 16>(lines, line);
                Some((enter_oriented(simd, ray, rows, t_max_lanes), words(&rows[15])))
            }
            DecodedWord::Node(NodeKind::Oriented, _) | DecodedWord::Empty => None,
        };
        if let Some((Entries { near, mask }, words)) = entered
            && mask != 0
        {
            let first = mask.trailing_zeros() as usize;
            let rest = mask & (mask - 1);
            if rest == 0 {
                word = words[first];
                if V::ALL && waiting < room {
                    prefetch(simd, lines, mask, words, visitor);
                    word = delayed.next(word);
                }
                continue;
            }
            let near = simd.store(near);
            if prefetches {
                prefetch(simd, lines, mask, words, visitor);
            }
            word = if ORDERED {
                push_ordered(stack, &mut waiting, mask, &near, words)
            } else {
                push(stack, &mut waiting, mask, &near, words)
            };
            if V::ALL && waiting < room {
                word = delayed.next(word);
            }
            continue;
        }
        // Resume with the last subtree that may still hold a hit at most `t_max` away.
        loop {
            if waiting == 0 {
                match delayed.last() {
                    Some(next) if V::ALL => word = next,
                    _ => return,
                }
                break;
            }
            waiting -= 1;
            let key = stack[waiting];
            if f32::from_bits((key >> 32) as u32) <= t_max {
                word = ChildWord(key as u32);
                break;
            }
        }
    }
}

/// Subtrees that are entered two steps after the node above them, where order does not matter: what is prefetched for them arrives while
/// others are visited.
struct Delayed([ChildWord; 2]);

impl Delayed {
    const NONE: Self = Self([ChildWord::EMPTY; 2]);

    /// Puts a subtree off and returns the one to enter now, which may be empty.
    #[inline(always)]
    fn next(&mut self, word: ChildWord) -> ChildWord {
        let Self([next, then]) = *self;
        *self = Self([then, word]);
        next
    }

    /// One of them, where nothing else waits.
    #[inline(always)]
    fn last(&mut self) -> Option<ChildWord> {
        for _ in 0..2 {
            let next = self.next(ChildWord::EMPTY);
            if next.0 != ChildWord::EMPTY.0 {
                return Some(next);
            }
        }
        None
    }
}

/// Fewest lines of nodes for which children are prefetched: 1 MiB. With their leaves, which take two to three times as much, they exceed the cache of
/// a core. In smaller BVHs prefetching costs up to 4 %; half a million triangles gain 9 to 23 % (benches/TRIED.md).
const LARGE: usize = 1 << 14;

/// Prefetches these children, of which the nearest is visited while the others arrive.
#[inline(always)]
fn prefetch<S: Simd>(simd: S, lines: &[CacheLine], mut mask: u32, words: &[ChildWord; 8], visitor: &impl Visitor) {
    while mask != 0 {
        let word = words[(mask.trailing_zeros() & 7) as usize];
        mask &= mask - 1;
        match word.kind() {
            DecodedWord::Leaf { first, .. } => visitor.prefetch(first),
            // Of an oriented node the first half.
            DecodedWord::Node(_, line) => {
                if let Some([a, b, c, d, ..]) = lines.get(line as usize..) {
                    simd.prefetch(a);
                    simd.prefetch(b);
                    simd.prefetch(c);
                    simd.prefetch(d);
                }
            }
            DecodedWord::Empty => {}
        }
    }
}

/// A stack entry: a child and where the ray enters it.
#[inline(always)]
fn key(near: &[f32; 8], words: &[ChildWord; 8], child: u32) -> u64 {
    let child = (child & 7) as usize;
    u64::from(near[child].to_bits()) << 32 | u64::from(words[child].0)
}

/// Pushes all children but the nearest, the farthest first, and returns the nearest.
#[inline(always)]
fn push_ordered(
    stack: &mut [u64],
    waiting: &mut usize,
    mut mask: u32,
    near: &[f32; 8],
    words: &[ChildWord; 8],
) -> ChildWord {
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
    ChildWord(nearest as u32)
}

/// Pushes all children but the first, and returns it.
#[inline(always)]
fn push(stack: &mut [u64], waiting: &mut usize, mut mask: u32, near: &[f32; 8], words: &[ChildWord; 8]) -> ChildWord {
    let first = words[(mask.trailing_zeros() & 7) as usize];
    mask &= mask - 1;
    while mask != 0 {
        stack[*waiting] = key(near, words, mask.trailing_zeros());
        *waiting += 1;
        mask &= mask - 1;
    }
    first
}

/// Where a ray enters eight children, and which of them it enters.
#[derive(Clone, Copy)]
pub(crate) struct Entries<S: Simd> {
    pub(crate) near: S::F,
    pub(crate) mask: u32,
}

/// The child words of a node's last row.
#[inline(always)]
pub(crate) fn words(row: &Row) -> &[ChildWord; 8] {
    bytemuck::cast_ref(row)
}

/// Aligned node: rows lo x, hi x, lo y, hi y, lo z, hi z.
///
/// Bits may be compared: the ray starts at no less than +0.0, and of exits one of which is negative the result is negative or -0.0, so that the box
/// is passed, or at worst entered where it is behind. Nothing is NaN (see `traverse`). The same holds of oriented nodes.
#[inline(always)]
pub(crate) fn enter_aligned<S: Simd>(simd: S, ray: &RayLanes<S>, rows: &[Row; 8], t_max: S::F) -> Entries<S> {
    let [x, y, z] = ray.near_row;
    let near_x = plane(simd, ray, rows, 0, x, ray.near[0]);
    let near_y = plane(simd, ray, rows, 1, y, ray.near[1]);
    let near_z = plane(simd, ray, rows, 2, z, ray.near[2]);
    let far_x = plane(simd, ray, rows, 0, ROW - x, ray.far[0]);
    let far_y = plane(simd, ray, rows, 1, ROW - y, ray.far[1]);
    let far_z = plane(simd, ray, rows, 2, ROW - z, ray.far[2]);
    let near = simd.max_bits(simd.max_bits(near_x, near_y), simd.max_bits(near_z, ray.t_min));
    let far = simd.min_bits(simd.min_bits(far_x, far_y), simd.min_bits(far_z, t_max));
    Entries { near, mask: simd.le(near, far) }
}

/// Where the ray crosses the lower (0) or upper ([`ROW`]) planes of an axis.
#[inline(always)]
fn plane<S: Simd>(simd: S, ray: &RayLanes<S>, rows: &[Row; 8], k: usize, row: usize, moved: S::F) -> S::F {
    let pairs: &[[f32; 2]; 8 * ROW] = bytemuck::cast_ref(rows);
    let first = 2 * ROW * k + (row & ROW);
    let row: &[[f32; 2]; ROW] = pairs[first..first + ROW].try_into().expect("the length is that of the range");
    simd.mul_add(simd.load(bytemuck::cast_ref(row)), ray.recip[k], moved)
}

/// Oriented node: for each axis three components of the rows, the centers, the half-extents.
#[inline(always)]
pub(crate) fn enter_oriented<S: Simd>(simd: S, ray: &RayLanes<S>, rows: &[Row; 16], t_max: S::F) -> Entries<S> {
    let mut near = ray.t_min;
    let mut far = t_max;
    for k in 0..3 {
        let row = [simd.load(&rows[5 * k]), simd.load(&rows[5 * k + 1]), simd.load(&rows[5 * k + 2])];
        let center = simd.load(&rows[5 * k + 3]);
        let half = simd.add(simd.load(&rows[5 * k + 4]), ray.pad_oriented);
        let p = simd.mul_sub(row[2], ray.origin[2], center);
        let p = simd.mul_add(row[0], ray.origin[0], simd.mul_add(row[1], ray.origin[1], p));
        let direction = project(simd, row, ray.direction);
        let size = simd.max(simd.abs(direction), ray.min_direction);
        let a = simd.div(ray.one, size);
        let q = simd.mul(simd.xor_sign(p, direction), a);
        near = simd.max_bits(simd.neg_mul_sub(half, a, q), near);
        far = simd.min_bits(simd.mul_sub(half, a, q), far);
    }
    Entries { near, mask: simd.le(near, far) }
}

#[inline(always)]
fn project<S: Simd>(simd: S, row: [S::F; 3], v: [S::F; 3]) -> S::F {
    simd.mul_add(row[0], v[0], simd.mul_add(row[1], v[1], simd.mul(row[2], v[2])))
}
