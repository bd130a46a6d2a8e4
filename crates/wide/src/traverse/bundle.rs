//! Triangles against the rays of a group: which of eight any of the rays may hit, and one triangle against eight rays at once.
//!
//! # No lost hit
//! The watertight kernel computes `x = fl(fl(v_x - o_x) - fl(s_x·fl(v_z - o_z)))` of each vertex, and `y` alike. Every rounding is monotonic, so the
//! same operations on the ends of intervals that contain `o` and `s` of all rays give intervals that contain what it computes, without a pad. Its
//! edge functions satisfy `u·x_a + v·x_b + w·x_c = 0`, and their signs are exact. So where all `x` are positive, or all are negative, two edge
//! functions have different signs, or all are zero, and the kernel finds no hit.

use canted_trace::{ScaledRay, TriangleHit};

use super::block::{AlongZ, Block, Candidates, edges};
use super::eight::{EightRays, RayRows};
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
        for (k, ends) in hull.iter_mut().enumerate() {
            let ([least, greatest], [low, high]) = (self.origin[k], self.shear[k]);
            let (a, b) = (simd.mul(low, z[0]), simd.mul(low, z[1]));
            let (c, d) = (simd.mul(high, z[0]), simd.mul(high, z[1]));
            let most = simd.max(simd.max(a, b), simd.max(c, d));
            let fewest = simd.min(simd.min(a, b), simd.min(c, d));
            *ends = [simd.sub(simd.sub(vertex(k), greatest), most), simd.sub(simd.sub(vertex(k), least), fewest)];
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
        edges::<S, SURE, false>(
            simd,
            sheared,
            &AlongZ { recip: rays.recip_z, t_min: rays.t_min, t_max: simd.load(t_max) },
        )
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
        let RayRows { origin, shear: [s_x, s_y], recip_z, t_min, .. } = &rays.lanes;
        Self {
            origin: [simd.load(&origin[i]), simd.load(&origin[j]), simd.load(&origin[k])],
            shear: [simd.load(s_x), simd.load(s_y)],
            recip_z: simd.load(recip_z),
            t_min: simd.load(t_min),
        }
    }
}

/// The least and the greatest number of both, each in all lanes.
#[inline(always)]
fn ends<S: Simd>(simd: S, a: S::F, b: S::F) -> [S::F; 2] {
    [simd.splat(least_of(&simd.store(simd.min(a, b)))), simd.splat(greatest_of(&simd.store(simd.max(a, b))))]
}

const _: () = assert!(GROUP == 16, "a bundle has two vectors of rays");

#[cfg(test)]
mod tests {
    use canted_fixtures::SplitMix64;
    use canted_obb::Obb;
    use canted_trace::{Kernel, Ray, ReferencePoint, Watertight};

    use super::*;
    use crate::simd::{SimdPath, Task};
    use crate::traverse::{MeshFrame, Pads};

    /// Eight triangles against a group: as the kernel finds, with the intervals of the group or with those of its least numbers alone.
    struct Tested<'a> {
        rays: &'a [Ray],
        triangles: &'a [[[f32; 3]; 3]; 8],
        are_least: bool,
    }

    #[derive(Default)]
    struct Found {
        n_hits: usize,
        n_lost: usize,
        n_beside: usize,
        n_wrong: usize,
    }

    impl Task for Tested<'_> {
        type Output = Option<Found>;

        #[inline(always)]
        fn on<S: Simd>(self, simd: S) -> Option<Found> {
            let frame = MeshFrame::new(Obb::IDENTITY_FRAME, ReferencePoint::ORIGIN);
            let mut eights = [EightRays::new(), EightRays::new()];
            eights[0].prepare(simd, &self.rays[..8], &frame, Pads::of(0.0));
            eights[1].prepare(simd, &self.rays[8..], &frame, Pads::of(0.0));
            let mut bundle = Bundle::new(simd, &eights)?;
            if self.are_least {
                bundle.origin = bundle.origin.map(|[least, _]| [least; 2]);
                bundle.shear = bundle.shear.map(|[least, _]| [least; 2]);
            }
            let mut rows = [[0.0; 8]; 10];
            for (lane, triangle) in self.triangles.iter().enumerate() {
                for (row, &x) in rows.iter_mut().zip(triangle.as_flattened()) {
                    row[lane] = x;
                }
            }
            let may_hit = bundle.may_hit(simd, &Block::Eight(&rows));
            let mut found = Found { n_beside: 8 - may_hit.count_ones() as usize, ..Found::default() };
            for (i, ray) in self.rays.iter().enumerate() {
                let scaled = ScaledRay::new(ray).expect("a ray that can hit");
                for (k, triangle) in self.triangles.iter().enumerate() {
                    let want = Watertight::intersect(&Watertight::prepare(&scaled), &scaled, triangle, scaled.t_max);
                    let lanes = bundle.candidates::<true>(simd, i / 8, triangle, &[scaled.t_max; 8]);
                    let (may, is_sure) = (lanes.mask >> (i % 8) & 1 == 1, lanes.sure >> (i % 8) & 1 == 1);
                    let got = may.then(|| bundle.hit(simd, &lanes, (i % 8, &scaled), scaled.t_max)).flatten();
                    found.n_hits += usize::from(want.is_some());
                    found.n_lost += usize::from(want.is_some() && may_hit >> k & 1 == 0);
                    found.n_wrong += usize::from(got != want || is_sure && want.is_none());
                }
            }
            Some(found)
        }
    }

    #[test]
    fn bundles_have_the_hits_of_the_kernel_and_those_of_less_lose_some() {
        let mut rng = SplitMix64::new(4);
        let mut all = [Found::default(), Found::default()];
        for round in 0..4000 {
            let spread = [0.0, 1e-6, 0.02, 0.5][round % 4];
            let offset = [0.0, 1e3, 1e7][round / 4 % 3] * rng.unit();
            let size = [1.0, 0.05, 1e-3][round / 12 % 3];
            let mut point = |scale: f64| rng.signed3().map(|x| (offset + scale * x) as f32);
            // Some are flat, some share their vertices' coordinates.
            let triangles: [[[f32; 3]; 3]; 8] = std::array::from_fn(|i| {
                let [a, b, c] = [point(1.0), point(1.0), point(1.0)];
                let near = |v: [f32; 3]| [0, 1, 2].map(|k| a[k] + (v[k] - a[k]) * size);
                Watertight::record(if i == 0 { [a, near(b), a] } else { [a, near(b), near(c)] })
            });
            let target = triangles[round % 8];
            let start = point(3.0);
            let rays: Vec<Ray> = (0..GROUP)
                .map(|i| {
                    let weights = [0.3, 0.3, 0.4];
                    let of = |k: usize| (0..3).map(|j| weights[j] * target[j][k]).sum::<f32>();
                    let (a, b) = (rng.signed3(), rng.signed3());
                    let origin = [0, 1, 2].map(|k| start[k] + (spread * a[k]) as f32);
                    let end =
                        if i % 5 == 0 { target[i % 3] } else { [0, 1, 2].map(|k| of(k) + (spread * b[k]) as f32) };
                    Ray::new(origin, [0, 1, 2].map(|k| end[k] - origin[k]))
                })
                .collect();
            if rays.iter().any(|ray| ScaledRay::new(ray).is_none()) {
                continue;
            }
            for path in SimdPath::ALL.into_iter().filter(|path| path.is_available()) {
                for (all, are_least) in all.iter_mut().zip([false, true]) {
                    let tested = Tested { rays: &rays, triangles: &triangles, are_least };
                    let Some(found) = path.available().run(tested) else { continue };
                    assert_eq!(found.n_wrong, 0, "{}: {rays:?} {triangles:?}", path.name());
                    all.n_hits += found.n_hits;
                    all.n_lost += found.n_lost;
                    all.n_beside += found.n_beside;
                }
            }
        }
        let [right, less] = all;
        assert!(right.n_hits > 50_000 && right.n_beside > 10_000, "{} {}", right.n_hits, right.n_beside);
        assert_eq!(right.n_lost, 0);
        assert!(less.n_lost > 100, "{}", less.n_lost);
    }
}
