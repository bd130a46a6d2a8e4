//! Triangles against the rays of a group: which of eight any of the rays may hit, and one triangle against eight rays at once.
//!
//! # No lost hit
//! The watertight kernel computes `x = fl(fl(v_x - o_x) - fl(s_x·fl(v_z - o_z)))` of each vertex, and `y` alike. Every rounding is monotonic, so the
//! same operations on the ends of intervals that contain `o` and `s` of all rays give intervals that contain what it computes, without a pad. Its
//! edge functions satisfy `u·x_a + v·x_b + w·x_c = 0`, and their signs are exact. So where all `x` are positive, or all are negative, two edge
//! functions have different signs, or all are zero, and the kernel finds no hit.

use canted_trace::{ScaledRay, TriangleHit};

use super::block::{AlongZ, Block, Candidates, edges};
use super::eight::EightRays;
use super::group::{GROUP, greatest_of, least_of};
use crate::simd::Simd;

/// The rays of a group as the triangle test needs them: those whose directions are longest along one axis.
pub(crate) struct Bundle<S: Simd> {
    /// First row of the coordinates that are the kernel's x, y, z.
    rows: [usize; 3],
    eights: [RaysInLanes<S>; 2],
    /// The least and the greatest of the group.
    origin: [[S::F; 2]; 3],
    shear: [[S::F; 2]; 2],
}

/// Eight rays: each vector holds one number of each.
struct RaysInLanes<S: Simd> {
    /// Origins, permuted so that the kernel's z is last.
    origin: [S::F; 3],
    shear: [S::F; 2],
    recip_z: S::F,
    t_min: S::F,
}

impl<S: Simd> Bundle<S> {
    /// `None` where the kernel's z is not the same axis for all rays.
    #[inline(always)]
    pub(crate) fn new(simd: S, eights: &[EightRays; 2]) -> Option<Self> {
        let axis = eights[0].axis_of_all()?;
        if eights[1].axis_of_all()? != axis {
            return None;
        }
        let rows = axis.indices();
        let eights = [RaysInLanes::new(simd, &eights[0], rows), RaysInLanes::new(simd, &eights[1], rows)];
        let [a, b] = &eights;
        let origin = [
            ends(simd, a.origin[0], b.origin[0]),
            ends(simd, a.origin[1], b.origin[1]),
            ends(simd, a.origin[2], b.origin[2]),
        ];
        let shear = [ends(simd, a.shear[0], b.shear[0]), ends(simd, a.shear[1], b.shear[1])];
        Some(Self { rows, eights, origin, shear })
    }

    /// The triangles of a block that a ray of the group may hit.
    #[inline(always)]
    pub(crate) fn may_hit(&self, simd: S, block: &Block<'_>) -> u32 {
        let [a, b, c] = [self.hull(simd, block, 0), self.hull(simd, block, 3), self.hull(simd, block, 6)];
        let zero = simd.splat(0.0);
        let mut beside = 0;
        for k in 0..2 {
            let least = simd.min(simd.min(a[k][0], b[k][0]), c[k][0]);
            let greatest = simd.max(simd.max(a[k][1], b[k][1]), c[k][1]);
            beside |= simd.lt(zero, least) | simd.lt(greatest, zero);
        }
        !beside & 0xff
    }

    /// The least and the greatest x and y, of all rays, of the vertices whose coordinates start at `row`.
    #[inline(always)]
    fn hull(&self, simd: S, block: &Block<'_>, row: usize) -> [[S::F; 2]; 2] {
        let vertex = |k: usize| block.row(simd, row + (self.rows[k] & 3));
        let [_, _, [least, greatest]] = self.origin;
        let z = [simd.sub(vertex(2), greatest), simd.sub(vertex(2), least)];
        let mut hull = [[z[0]; 2]; 2];
        for k in 0..2 {
            let ([least, greatest], [low, high]) = (self.origin[k], self.shear[k]);
            let (a, b) = (simd.mul(low, z[0]), simd.mul(low, z[1]));
            let (c, d) = (simd.mul(high, z[0]), simd.mul(high, z[1]));
            let most = simd.max(simd.max(a, b), simd.max(c, d));
            let fewest = simd.min(simd.min(a, b), simd.min(c, d));
            hull[k] = [simd.sub(simd.sub(vertex(k), greatest), most), simd.sub(simd.sub(vertex(k), least), fewest)];
        }
        hull
    }

    /// Which of the rays `8·half` to `8·half + 7` may hit a triangle: as [`Block::candidates`], with a ray in each lane.
    #[inline(always)]
    pub(crate) fn candidates<const SURE: bool>(
        &self,
        simd: S,
        half: usize,
        vertices: &[[f32; 3]; 3],
        t_max: &[f32; 8],
    ) -> Candidates<S> {
        let rays = &self.eights[half & 1];
        let [a, b, c] = vertices;
        let sheared = [self.sheared(simd, rays, a), self.sheared(simd, rays, b), self.sheared(simd, rays, c)];
        edges::<S, SURE, false>(simd, sheared, &AlongZ {
            recip: rays.recip_z,
            t_min: rays.t_min,
            t_max: simd.load(t_max),
        })
    }

    /// A vertex as the kernel shears it for each ray.
    #[inline(always)]
    fn sheared(&self, simd: S, rays: &RaysInLanes<S>, &[x, y, z]: &[f32; 3]) -> [S::F; 3] {
        let (vertex, [i, j, k]) = ([x, y, z, 0.0], self.rows);
        let x = simd.sub(simd.splat(vertex[i & 3]), rays.origin[0]);
        let y = simd.sub(simd.splat(vertex[j & 3]), rays.origin[1]);
        let z = simd.sub(simd.splat(vertex[k & 3]), rays.origin[2]);
        [simd.sub(x, simd.mul(rays.shear[0], z)), simd.sub(y, simd.mul(rays.shear[1], z)), z]
    }

    /// The kernel's hit of the ray in a lane, which is one of [`Bundle::candidates`].
    #[inline(always)]
    pub(crate) fn hit(
        &self,
        simd: S,
        candidates: &Candidates<S>,
        (lane, scaled): (usize, &ScaledRay),
        t_max: f32,
    ) -> Option<TriangleHit> {
        let [x, y, z] = scaled.direction;
        candidates.watertight_hit(simd, scaled, [x, y, z, 0.0][self.rows[2] & 3], lane, t_max)
    }
}

impl<S: Simd> RaysInLanes<S> {
    #[inline(always)]
    fn new(simd: S, rays: &EightRays, [i, j, k]: [usize; 3]) -> Self {
        let (origin, [s_x, s_y]) = (&rays.origin, &rays.shear);
        Self {
            origin: [simd.load(&origin[i]), simd.load(&origin[j]), simd.load(&origin[k])],
            shear: [simd.load(s_x), simd.load(s_y)],
            recip_z: simd.load(&rays.recip_z),
            t_min: simd.load(&rays.numbers.t_min),
        }
    }
}

/// The least and the greatest number of both, each in all lanes.
#[inline(always)]
fn ends<S: Simd>(simd: S, a: S::F, b: S::F) -> [S::F; 2] {
    [simd.splat(least_of(&simd.store(simd.min(a, b)))), simd.splat(greatest_of(&simd.store(simd.max(a, b))))]
}

const _: () = assert!(GROUP == 16, "a bundle has two vectors of rays");
