//! Triangles as leaves hold them.

use std::marker::PhantomData;

use canted_obb::PrimId;
use canted_trace::{ScaledRay, Watertight};

use crate::layout::{Half, PART_LANES, PARTS};
use crate::leaf::{HitSink, LeafData, LeafPrimitive, LeafRange, hit};
use crate::simd::Simd;
use crate::traverse::{Block, LaneKernel, RayTriangles};

/// A triangle with the triangle test `K`, as the primitive of a [`TriangleBvh`](crate::TriangleBvh).
///
/// It has no value: leaves hold vertices in blocks of four and eight.
#[derive(Clone, Copy, Debug)]
pub struct Triangle<K = Watertight>(PhantomData<K>);

/// A ray prepared for blocks of triangles, and for single triangles.
pub struct PreparedRay<S: Simd, K: LaneKernel> {
    lanes: RayTriangles<S>,
    kernel: K::Prepared,
}

impl<K: LaneKernel> LeafPrimitive for Triangle<K> {
    type Leaves = Vec<Half>;
    type Shape = [[f32; 3]; 3];
    type Prepared<S: Simd> = PreparedRay<S, K>;

    const ERROR: f32 = K::ERROR;

    #[inline(always)]
    fn prepare<S: Simd>(simd: S, ray: &ScaledRay) -> PreparedRay<S, K> {
        PreparedRay { lanes: RayTriangles::new(simd, ray), kernel: K::prepare(ray) }
    }

    #[inline(always)]
    fn intersect_leaf<S: Simd, T: HitSink<Self::Shape>>(
        blocks: &Vec<Half>,
        simd: S,
        prepared: &PreparedRay<S, K>,
        ray: &ScaledRay,
        leaf: LeafRange,
        sink: &mut T,
    ) -> f32 {
        let LeafRange { first, mut n, mut t_max } = leaf;
        // A leaf that starts in the second part of a half-block holds no more than that.
        let shift = first as usize % PARTS * PART_LANES;
        let mut first = first as usize / PARTS;
        loop {
            let block = Block::at(blocks, first, n);
            let filled = if n < 8 { ((1 << n) - 1) << shift } else { 0xff };
            let mut mask = block.candidates::<S, K>(simd, &prepared.lanes, t_max) & filled;
            while mask != 0 {
                let lane = mask.trailing_zeros() as usize;
                mask &= mask - 1;
                let vertices = block.vertices(lane);
                let Some(found) = K::finish(&prepared.kernel, ray, &vertices, t_max) else { continue };
                let found = hit(found.t, [found.u, found.v], found.side, block.primitive(lane));
                t_max = sink.take(ray, found, &vertices, t_max);
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
    fn ids(blocks: &Vec<Half>, leaf: LeafRange) -> impl Iterator<Item = PrimId> {
        let (half, part) = (leaf.first as usize / PARTS, leaf.first as usize % PARTS);
        (0..leaf.n).map(move |i| {
            let block = Block::at(blocks, half + i as usize / 8 * 2, leaf.n - i / 8 * 8);
            block.primitive(part * PART_LANES + i as usize % 8)
        })
    }

    fn leaf_data(blocks: &Vec<Half>) -> LeafData<'_> {
        LeafData { blocks: bytemuck::cast_slice(blocks), order: &[], n_bytes: size_of_val(&blocks[..]) }
    }
}
