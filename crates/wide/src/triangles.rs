use canted_trace::ScaledRay;

use crate::WideBvh;
use crate::emit::Records;
use crate::layout::{PART_LANES, PARTS};
use crate::simd::Simd;
use crate::traced::{HitSink, Leaf, Traced, hit};
use crate::traverse::{Block, LaneKernel, MeshFrame, Pads, RayTriangles};

/// A ray ready for blocks of triangles, and for triangles one by one.
pub(crate) struct Prepared<S: Simd, K: LaneKernel> {
    lanes: RayTriangles<S>,
    kernel: K::Prepared,
}

/// Leaves hold triangles by their vertices.
impl<K: LaneKernel> Traced for WideBvh<K> {
    type Prepared<S: Simd> = Prepared<S, K>;
    type Met = [[f32; 3]; 3];

    #[inline(always)]
    fn records(&self) -> &Records {
        &self.records
    }

    #[inline(always)]
    fn frame(&self) -> &MeshFrame {
        &self.frame
    }

    #[inline(always)]
    fn reach(&self) -> f32 {
        self.bounds.reach()
    }

    #[inline(always)]
    fn pads(&self) -> Pads {
        const { Pads::of(K::ERROR) }
    }

    #[inline(always)]
    fn prepare<S: Simd>(simd: S, ray: &ScaledRay) -> Prepared<S, K> {
        Prepared { lanes: RayTriangles::new(simd, ray), kernel: K::prepare(ray) }
    }

    #[inline(always)]
    fn leaf<S: Simd, T: HitSink<Self::Met>>(
        &self,
        simd: S,
        prepared: &Prepared<S, K>,
        ray: &ScaledRay,
        leaf: Leaf,
        take: &mut T,
    ) -> f32 {
        let Leaf { first, mut n, mut t_max } = leaf;
        // A leaf that starts in the second part of a half-block holds no more than that.
        let shift = first as usize % PARTS * PART_LANES;
        let mut first = first as usize / PARTS;
        loop {
            let block = Block::at(&self.records.halves, first, n);
            let filled = if n < 8 { ((1 << n) - 1) << shift } else { 0xff };
            let mut mask = block.candidates::<S, K>(simd, &prepared.lanes, t_max) & filled;
            while mask != 0 {
                let lane = mask.trailing_zeros() as usize;
                mask &= mask - 1;
                let vertices = block.vertices(lane);
                let Some(found) = K::finish(&prepared.kernel, ray, &vertices, t_max) else { continue };
                let found = hit(found.t, [found.u, found.v], found.side, block.primitive(lane));
                t_max = take.take(ray, found, &vertices, t_max);
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
}
