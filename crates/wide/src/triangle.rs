//! Triangles as leaves hold them.

use std::marker::PhantomData;
use std::sync::OnceLock;

use canted_obb::PrimId;
use canted_trace::{ScaledRay, Watertight};

use crate::bvh::WideBvh;
use crate::layout::{HALF_WORDS, Half, Lane, Nodes, PART_LANES, PARTS, WordKind};
use crate::leaf::{HitSink, LeafData, LeafPrimitive, LeafRange, hit};
use crate::records::Records;
use crate::simd::Simd;
use crate::traverse::{Block, LaneKernel, RayTriangles};

/// A triangle with the triangle test `K`, as the primitive of a [`TriangleBvh`](crate::TriangleBvh).
///
/// It has no value: leaves hold vertices in blocks of four and eight.
#[derive(Clone, Copy, Debug)]
pub struct Triangle<K = Watertight>(PhantomData<K>);

/// A [`WideBvh`] over triangles with the triangle test `K`.
pub type TriangleBvh<K = Watertight> = WideBvh<Triangle<K>>;

impl<K: LaneKernel> LeafPrimitive for Triangle<K> {
    type Leaves = Blocks;
    type View<'a> = &'a [Half];
    type Shape = [[f32; 3]; 3];
    type Prepared<S: Simd> = RayTriangles<S>;

    const ERROR: f32 = K::ERROR;
    const IS_LOCAL: bool = true;

    #[inline(always)]
    fn view(leaves: &Blocks) -> &[Half] {
        &leaves.halves
    }

    #[inline(always)]
    fn prepare<S: Simd>(simd: S, ray: &ScaledRay) -> RayTriangles<S> {
        RayTriangles::new(simd, ray)
    }

    #[inline(always)]
    fn intersect_leaf<S: Simd, T: HitSink<Self::Shape>>(
        halves: &[Half],
        simd: S,
        prepared: &RayTriangles<S>,
        ray: &ScaledRay,
        leaf: LeafRange,
        sink: &mut T,
    ) -> f32 {
        let LeafRange { first, mut n, mut t_max } = leaf;
        // A leaf that starts in the second part of a half-block holds no more than that.
        let shift = first as usize % PARTS * PART_LANES;
        let mut first = first as usize / PARTS;
        loop {
            let block = Block::at(halves, first, n);
            let filled = if n < 8 { ((1 << n) - 1) << shift } else { 0xff };
            let candidates = match (T::ANY, T::SPLITS) {
                (true, _) => block.candidates::<S, K, true, false>(simd, prepared, t_max),
                (false, true) => block.candidates::<S, K, false, true>(simd, prepared, t_max),
                (false, false) => block.candidates::<S, K, false, false>(simd, prepared, t_max),
            };
            let mut mask = candidates.mask & filled;
            if T::ANY && candidates.sure & filled != 0 {
                return sink.take_any();
            }
            while mask != 0 {
                let lane = mask.trailing_zeros() as usize;
                mask &= mask - 1;
                let vertices = block.vertices(lane);
                let found = candidates.hit::<K>(simd, prepared, ray, (lane, &vertices), t_max);
                let Some(found) = found else { continue };
                let found = hit(found.t, [found.u, found.v], found.side, block.primitive(lane));
                t_max = if T::SPLITS && candidates.inside >> lane & 1 == 1 {
                    sink.take_inside(found, t_max)
                } else {
                    sink.take(ray, found, &vertices, t_max)
                };
                if t_max < 0.0 {
                    return t_max;
                }
            }
            if n <= 8 {
                return t_max;
            }
            n -= 8;
            first += 2;
        }
    }

    #[inline]
    fn ids(Blocks { halves, .. }: &Blocks, leaf: LeafRange) -> impl Iterator<Item = PrimId> {
        lanes(halves, leaf).map(|(block, lane)| block.primitive(lane))
    }

    #[inline]
    fn for_each_shape(Blocks { halves, .. }: &Blocks, leaf: LeafRange, mut visit: impl FnMut(PrimId, &[[f32; 3]; 3])) {
        lanes(halves, leaf).for_each(|(block, lane)| visit(block.primitive(lane), &block.vertices(lane)));
    }

    fn leaf_data(Blocks { halves, lanes }: &Blocks) -> LeafData<'_> {
        let n_bytes = size_of_val(&halves[..]) + lanes.get().map_or(0, |lanes| size_of_val(&lanes[..]));
        LeafData { blocks: bytemuck::cast_slice(halves), order: &[], n_bytes }
    }
}

/// The blocks and lanes of a leaf's triangles.
#[inline]
fn lanes(halves: &[Half], LeafRange { first, n, .. }: LeafRange) -> impl Iterator<Item = (Block<'_>, usize)> {
    let (half, part) = (first as usize / PARTS, first as usize % PARTS);
    (0..n)
        .map(move |i| (Block::at(halves, half + i as usize / 8 * 2, n - i / 8 * 8), part * PART_LANES + i as usize % 8))
}

impl<K: LaneKernel> WideBvh<Triangle<K>> {
    /// The vertices of a triangle, as they were given.
    ///
    /// The first call makes an index of four bytes for each triangle.
    ///
    /// # Panics
    /// If there is no such triangle.
    #[must_use]
    pub fn triangle(&self, id: PrimId) -> [[f32; 3]; 3] {
        self.leaves.triangle(&self.nodes, self.n_primitives, id)
    }

    /// The vertices of all triangles, in input order.
    #[must_use]
    pub fn triangles(&self) -> Vec<[[f32; 3]; 3]> {
        let mut triangles = vec![[[0.0; 3]; 3]; self.n_primitives];
        self.leaves.each_triangle(&self.nodes, |id, lane| triangles[id.index()] = self.leaves.vertices(lane));
        triangles
    }
}

/// All triangles of a BVH.
#[derive(Clone, Debug)]
pub struct Blocks {
    pub(crate) halves: Records<Half>,
    /// Of each triangle the first word, and in the lowest bit whether its rows have eight words.
    lanes: OnceLock<Vec<u32>>,
}

impl From<Records<Half>> for Blocks {
    fn from(halves: Records<Half>) -> Self {
        Self { halves, lanes: OnceLock::new() }
    }
}

impl Blocks {
    fn triangle(&self, nodes: &Nodes, n: usize, id: PrimId) -> [[f32; 3]; 3] {
        let lanes = self.lanes.get_or_init(|| {
            let mut lanes = vec![0; n];
            self.each_triangle(nodes, |id, Lane { first, step }| {
                #[expect(clippy::cast_possible_truncation, reason = "2^25 half-blocks of 40 words, twice")]
                let first = first as u32;
                lanes[id.index()] = first << 1 | u32::from(step == 8);
            });
            lanes
        });
        let lane = lanes[id.index()];
        self.vertices(Lane { first: (lane >> 1) as usize, step: if lane & 1 == 0 { 4 } else { 8 } })
    }

    fn each_triangle(&self, nodes: &Nodes, mut visit: impl FnMut(PrimId, Lane)) {
        let words: &[u32] = bytemuck::cast_slice(&self.halves);
        nodes.each_word(|word| {
            let WordKind::Leaf { first, n } = word else { return };
            let (first, n) = (first as usize, n as usize);
            for i in 0..n {
                let Lane { first: in_leaf, step } = Lane::of(i, n, first % PARTS);
                let lane = Lane { first: first / PARTS * HALF_WORDS + in_leaf, step };
                visit(PrimId(words[lane.word(Lane::ID_ROW)]), lane);
            }
        });
    }

    fn vertices(&self, lane: Lane) -> [[f32; 3]; 3] {
        let words: &[u32] = bytemuck::cast_slice(&self.halves);
        std::array::from_fn(|i| std::array::from_fn(|k| f32::from_bits(words[lane.word(3 * i + k)])))
    }
}
