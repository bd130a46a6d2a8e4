//! Triangles as leaves hold them.

use std::sync::OnceLock;

use canted_lbvh::Corners;
use canted_obb::PrimId;
use canted_trace::TriangleTest;

use super::closed::{Closed, EdgeSums};
use super::{LeafData, LeafPrimitive};
use crate::node::checked::{CheckedLeaf, Hierarchy};
use crate::node::{DecodedWord, HALF_BLOCK_WORDS, HalfBlock, LaneWords, LeafLayout, Nodes, PART_LANES, PARTS, Records};
use crate::par;
use crate::simd::Simd;
use crate::traverse::{Block, LeafRange};

/// A triangle, as the primitive of a [`TriangleBvh`](crate::TriangleBvh).
///
/// It has no value: leaves hold vertices in blocks of four and eight.
#[derive(Clone, Copy, Debug)]
pub enum Triangle {}

impl LeafPrimitive for Triangle {
    type Leaves = Blocks;
    type Shape = [[f32; 3]; 3];

    #[inline]
    fn for_each_shape(Blocks { halves, .. }: &Blocks, leaf: LeafRange, mut visit: impl FnMut(PrimId, &[[f32; 3]; 3])) {
        for place in 0..leaf.n {
            let (block, lane) = lane(halves, leaf, place);
            visit(block.primitive(lane), &block.vertices(lane));
        }
    }

    #[inline]
    fn with_shape<R>(
        Blocks { halves, .. }: &Blocks,
        leaf: LeafRange,
        place: u32,
        visit: impl FnOnce(PrimId, &[[f32; 3]; 3]) -> R,
    ) -> R {
        let (block, lane) = lane(halves, leaf, place);
        visit(block.primitive(lane), &block.vertices(lane))
    }

    fn leaf_data(Blocks { halves, lanes, .. }: &Blocks) -> LeafData<'_> {
        let n_bytes = size_of_val(&halves[..]) + lanes.get().map_or(0, |lanes| size_of_val(&lanes[..]));
        LeafData { blocks: bytemuck::cast_slice(halves), order: &[], n_bytes }
    }
}

/// Calls `visit` with the place of each triangle of a leaf that may be at most the root of a limit away from a point, those that seem nearest first. It
/// returns what the limit is then.
#[inline(always)]
pub(crate) fn each_near<S: Simd>(
    simd: S,
    halves: &[HalfBlock],
    leaf: LeafRange,
    point: [S::F; 3],
    mut limit: f32,
    visit: &mut dyn FnMut(u32) -> f32,
) {
    let (half, first) = start(leaf);
    for block in 0..leaf.n.div_ceil(8) {
        let n = leaf.n - 8 * block;
        let near = Block::at(halves, half + 2 * block as usize, n).near(simd, point, limit);
        let mut waiting = near.lanes >> first & ((1 << n.min(8)) - 1);
        let bound = |place: u32| near.bounds[place as usize + first];
        while waiting != 0 {
            let mut next = waiting.trailing_zeros();
            let mut others = waiting & (waiting - 1);
            while others != 0 {
                let place = others.trailing_zeros();
                others &= others - 1;
                if bound(place) < bound(next) {
                    next = place;
                }
            }
            waiting &= !(1 << next);
            // Not where the bound is NaN.
            if bound(next) > limit {
                continue;
            }
            limit = visit(8 * block + next);
        }
    }
}

/// The first half-block of a leaf, and its first lane there.
#[inline]
fn start(LeafRange { first, .. }: LeafRange) -> (usize, usize) {
    (first as usize / PARTS, first as usize % PARTS * PART_LANES)
}

/// The block and the lane of a leaf's triangle.
#[inline]
fn lane(halves: &[HalfBlock], leaf: LeafRange, place: u32) -> (Block<'_>, usize) {
    let (half, first) = start(leaf);
    let block = place / 8;
    (Block::at(halves, half + 2 * block as usize, leaf.n - 8 * block), first + place as usize % 8)
}

/// All triangles of a BVH.
#[derive(Clone, Debug)]
pub struct Blocks {
    pub(crate) halves: Records<HalfBlock>,
    pub(crate) test: TriangleTest,
    /// Of each triangle the first word, and in the lowest bit whether its rows have eight words.
    lanes: OnceLock<Vec<u32>>,
    /// Until the vertices change.
    closed: OnceLock<Closed>,
}

impl Blocks {
    pub(crate) fn new(halves: Records<HalfBlock>, test: TriangleTest) -> Self {
        Self { halves, test, lanes: OnceLock::new(), closed: OnceLock::new() }
    }

    pub(crate) fn triangle(&self, nodes: &Nodes, n: usize, id: PrimId) -> [[f32; 3]; 3] {
        let lanes = self.lanes.get_or_init(|| {
            let mut lanes = vec![0; n];
            self.each_triangle(nodes, |id, LaneWords { first, step }| {
                let first = first as u32;
                lanes[id.index()] = first << 1 | u32::from(step == 8);
            });
            lanes
        });
        let lane = lanes[id.index()];
        self.vertices(LaneWords { first: (lane >> 1) as usize, step: if lane & 1 == 0 { 4 } else { 8 } })
    }

    /// Whether the mesh of all `n` triangles is closed.
    pub(crate) fn closed(&self, nodes: &Nodes, n: usize) -> Closed {
        *self.closed.get_or_init(|| {
            let (mut closed, mut is_known) = (EdgeSums::default(), vec![false; n]);
            self.each_triangle(nodes, |id, lane| {
                // Spatial splits refer to a triangle from several leaves.
                if !std::mem::replace(&mut is_known[id.index()], true) {
                    closed.add(self.vertices(lane));
                }
            });
            closed.closed()
        })
    }

    /// Forgets what depends on the vertices.
    pub(crate) fn vertices_changed(&mut self) {
        self.closed.take();
    }

    pub(crate) fn each_triangle(&self, nodes: &Nodes, mut visit: impl FnMut(PrimId, LaneWords)) {
        let words: &[u32] = bytemuck::cast_slice(&self.halves);
        nodes.each_word(|word| {
            let DecodedWord::Leaf { first, n } = word else { return };
            let (first, n) = (first as usize, n as usize);
            for i in 0..n {
                let LaneWords { first: in_leaf, step } = LaneWords::of(i, n, first % PARTS);
                let lane = LaneWords { first: first / PARTS * HALF_BLOCK_WORDS + in_leaf, step };
                visit(PrimId(words[lane.word(LaneWords::ID_ROW)]), lane);
            }
        });
    }

    pub(crate) fn vertices(&self, lane: LaneWords) -> [[f32; 3]; 3] {
        let words: &[u32] = bytemuck::cast_slice(&self.halves);
        std::array::from_fn(|i| std::array::from_fn(|k| f32::from_bits(words[lane.word(3 * i + k)])))
    }
}

const LAYOUT: &LeafLayout = &LeafLayout::BLOCKS;

/// Triangles by their place: vertices, and ids.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct StoredTriangles {
    pub(crate) corners: Vec<Corners>,
    pub(crate) ids: Vec<PrimId>,
}

impl StoredTriangles {
    /// Reads all leaves.
    pub(crate) fn read(hierarchy: &Hierarchy, halves: &[HalfBlock]) -> Self {
        let words: &[u32] = bytemuck::cast_slice(halves);
        let mut all = vec![([[0.0; 3]; 3], PrimId(0)); hierarchy.n_places];
        par::for_pieces(
            &hierarchy.leaves,
            &mut all,
            |leaf| leaf.places.start,
            |leaf, out| {
                let words = &words[leaf.unit(LAYOUT) * HALF_BLOCK_WORDS..];
                let n = out.len();
                for (i, (corners, id)) in out.iter_mut().enumerate() {
                    let lane = LaneWords::of(i, n, leaf.part(LAYOUT));
                    for (row, x) in corners.as_flattened_mut().iter_mut().enumerate() {
                        *x = f32::from_bits(words[lane.word(row)]);
                    }
                    *id = PrimId(words[lane.word(LaneWords::ID_ROW)]);
                }
            },
        );
        let (corners, ids) = all.into_iter().unzip();
        Self { corners, ids }
    }
}

/// Whether all words of a leaf's unused lanes are zero; lanes of a part that no leaf shares are its own.
pub(crate) fn unused_lanes_are_zero(leaf: &CheckedLeaf, halves: &[HalfBlock]) -> bool {
    let (n, first) = (leaf.places.len(), leaf.unit(LAYOUT));
    let words: &[u32] = bytemuck::cast_slice(&halves[first..first + LAYOUT.n_units(n)]);
    let n_lanes = if leaf.is_shared { PART_LANES } else { n.next_multiple_of(4) };
    (n..n_lanes).all(|i| {
        // The lane of a triangle if its block were filled.
        let lane = LaneWords::of(i, n, leaf.part(LAYOUT));
        (0..=LaneWords::ID_ROW).all(|row| words[lane.word(row)] == 0)
    })
}
