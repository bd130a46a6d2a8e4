//! The triangle test of eight triangles at once: a filter that rejects only triangles that the kernel certainly rejects, so that hits are
//! those of the kernel itself, bit for bit.

use canted_obb::PrimId;
use canted_trace::lanes::{UNIT_ROUNDOFF as U, WEIGHTS_ERROR, WEIGHTS_HEADROOM};
use canted_trace::{Kernel, MollerTrumbore, ScaledRay, Shear, TriangleHit, Watertight};

use super::ray::splat3;
use crate::node::{HALF_BLOCK_WORDS, HalfBlock, PART_LANES, PARTS};
use crate::simd::Simd;

/// What roundings may add to a squared lower bound.
pub(crate) const SHRINK: f32 = 1.0 - 32.0 * U;

/// What the lanes' filters need of a ray.
#[derive(Clone, Copy)]
pub(crate) struct RayTriangles<S: Simd> {
    /// Origin, permuted so that the kernel's z is last.
    origin: [S::F; 3],
    /// Shear factors, and the reciprocal of the direction along z.
    shear: [S::F; 2],
    recip_z: S::F,
    zero: S::F,
    t_min: S::F,
    /// The direction along z.
    d_z: f32,
    /// First row of the coordinates that are the kernel's x, y, z.
    rows: [usize; 3],
    direction: [S::F; 3],
}

impl<S: Simd> RayTriangles<S> {
    /// Of a ray whose origin, direction and rows are permuted as [`Shear::axis`] says; with the direction's z and its reciprocal.
    #[inline(always)]
    pub(super) fn new(
        simd: S,
        (origin, direction, t_min): ([f32; 3], [f32; 3], f32),
        rows: [usize; 3],
        ([s_x, s_y], d_z, recip_z): ([f32; 2], f32, f32),
    ) -> Self {
        Self {
            origin: splat3(simd, origin),
            shear: [simd.splat(s_x), simd.splat(s_y)],
            recip_z: simd.splat(recip_z),
            zero: simd.splat(0.0),
            t_min: simd.splat(t_min),
            d_z,
            rows,
            direction: splat3(simd, direction),
        }
    }
}

#[cfg(test)]
impl<S: Simd> RayTriangles<S> {
    /// The bits of all numbers.
    pub(super) fn bits(&self, simd: S) -> Vec<u64> {
        let Self { origin, shear: [s_x, s_y], recip_z, zero, t_min, d_z, rows, direction } = self;
        let lanes = [origin, direction].into_iter().flatten().chain([s_x, s_y, recip_z, zero, t_min]);
        let numbers = lanes.flat_map(|&x| simd.store(x)).chain([*d_z]);
        numbers.map(|x| u64::from(x.to_bits())).chain(rows.map(|row| row as u64)).collect()
    }
}

/// A ray that can be prepared for blocks of triangles: in its first leaf, for many rays reach none.
pub(crate) trait ThroughTriangles: Copy {
    /// The ray, prepared.
    fn prepare<S: Simd>(self, simd: S) -> RayTriangles<S>;
}

impl ThroughTriangles for &ScaledRay {
    #[inline(always)]
    fn prepare<S: Simd>(self, simd: S) -> RayTriangles<S> {
        let shear = Shear::new(self);
        let axis = shear.axis();
        let (origin, direction) = (axis.permute_by_index(self.origin), axis.permute_by_index(self.direction));
        let [.., d_z] = direction;
        RayTriangles::new(simd, (origin, direction, self.t_min), axis.indices(), (shear.factors(), d_z, 1.0 / d_z))
    }
}

/// Up to eight triangles: rows of their vertices' coordinates, then their ids.
#[derive(Clone, Copy)]
pub(crate) enum Block<'a> {
    Eight(&'a [[f32; 8]; 10]),
    Four(&'a [[f32; 4]; 10]),
}

/// Lanes of a block that a ray may hit.
pub(crate) struct Candidates<S: Simd> {
    pub(crate) mask: u32,
    /// Lanes that it certainly hits, where asked for.
    pub(crate) sure: u32,
    /// Lanes whose line passes through no edge, where asked for: not all of them.
    pub(crate) inside: u32,
    sheared: [[S::F; 3]; 3],
}

impl<S: Simd> Candidates<S> {
    /// The kernel's hit on a lane with these vertices.
    #[inline(always)]
    pub(crate) fn hit<const WATERTIGHT: bool>(
        &self,
        simd: S,
        ray: &RayTriangles<S>,
        scaled: &ScaledRay,
        (lane, vertices): (usize, &[[f32; 3]; 3]),
        t_max: f32,
    ) -> Option<TriangleHit> {
        if WATERTIGHT {
            return self.watertight_hit(simd, scaled, ray.d_z, lane, t_max);
        }
        // The hits of Baldwin and Weber are the same, by contract.
        MollerTrumbore::intersect(&(), scaled, vertices, t_max)
    }

    /// The watertight kernel's hit of a lane; `d_z` is the direction of its ray along the kernel's z.
    #[inline(always)]
    pub(super) fn watertight_hit(
        &self,
        simd: S,
        scaled: &ScaledRay,
        d_z: f32,
        lane: usize,
        t_max: f32,
    ) -> Option<TriangleHit> {
        let [a, b, c] = self.sheared;
        let sheared = [lane_of(simd, a, lane), lane_of(simd, b, lane), lane_of(simd, c, lane)];
        Watertight::intersect_sheared(scaled, d_z, sheared, t_max)
    }
}

/// The blocks of a leaf, each with its lanes that are of the leaf.
pub(crate) struct Blocks<'a> {
    halves: &'a [HalfBlock],
    first: usize,
    n: u32,
    shift: usize,
}

impl<'a> Blocks<'a> {
    #[inline(always)]
    pub(crate) fn new(halves: &'a [HalfBlock], first: u32, n: u32) -> Self {
        // A leaf that starts in the second part of a half-block holds no more than that.
        let shift = first as usize % PARTS * PART_LANES;
        Self { halves, first: first as usize / PARTS, n, shift }
    }
}

impl<'a> Iterator for Blocks<'a> {
    type Item = (Block<'a>, u32);

    #[inline(always)]
    fn next(&mut self) -> Option<Self::Item> {
        let &mut Self { halves, first, n, shift } = self;
        if n == 0 {
            return None;
        }
        (self.first, self.n) = (first + 2, n.saturating_sub(8));
        Some((Block::at(halves, first, n), if n < 8 { ((1 << n) - 1) << shift } else { 0xff }))
    }
}

/// Prefetches the first block of a leaf: two half-blocks, in five lines of the cache. Where there is a sixth, it has ids alone.
#[inline(always)]
pub(crate) fn prefetch_block<S: Simd>(simd: S, halves: &[HalfBlock], first: u32) {
    const WORDS_OF_A_LINE: usize = 16;
    if let Some([HalfBlock(a), HalfBlock(b), ..]) = halves.get(first as usize / PARTS..) {
        simd.prefetch(&a[0]);
        simd.prefetch(&a[WORDS_OF_A_LINE]);
        simd.prefetch(&a[2 * WORDS_OF_A_LINE]);
        simd.prefetch(&b[3 * WORDS_OF_A_LINE - HALF_BLOCK_WORDS]);
        simd.prefetch(&b[4 * WORDS_OF_A_LINE - HALF_BLOCK_WORDS]);
    }
}

impl<'a> Block<'a> {
    /// The block from half-block `first` that holds at most `n` triangles.
    #[inline(always)]
    pub(crate) fn at(halves: &'a [HalfBlock], first: usize, n: u32) -> Self {
        if n > 4 {
            let both: &[HalfBlock; 2] = halves[first..first + 2].try_into().expect("the length is that of the range");
            Self::Eight(bytemuck::cast_ref::<[u32; 2 * HALF_BLOCK_WORDS], _>(bytemuck::cast_ref(both)))
        } else {
            Self::Four(bytemuck::cast_ref::<[u32; HALF_BLOCK_WORDS], _>(&halves[first].0))
        }
    }

    #[inline(always)]
    pub(super) fn row<S: Simd>(&self, simd: S, row: usize) -> S::F {
        match self {
            Self::Eight(rows) => simd.load(&rows[row]),
            Self::Four(rows) => simd.load_half(&rows[row]),
        }
    }

    #[inline(always)]
    fn value(&self, row: usize, lane: usize) -> f32 {
        match self {
            Self::Eight(rows) => rows[row][lane],
            Self::Four(rows) => rows[row][lane],
        }
    }

    /// Vertices of a triangle, as they are stored ([`canted_obb::flat_as_edge`] of those given).
    #[inline(always)]
    pub(crate) fn vertices(&self, lane: usize) -> [[f32; 3]; 3] {
        let vertex = |row: usize| [self.value(row, lane), self.value(row + 1, lane), self.value(row + 2, lane)];
        [vertex(0), vertex(3), vertex(6)]
    }

    /// Id of a triangle.
    #[inline(always)]
    pub(crate) fn primitive(&self, lane: usize) -> PrimId {
        PrimId(self.value(9, lane).to_bits())
    }

    /// Lanes that `ray` may hit at `t_min <= t <= t_max`; every lane that the kernel accepts is among them. The kernel is the watertight one
    /// where `WATERTIGHT`, by the signs of its edge functions, else that of Möller and Trumbore, by weights with their error bound. With `SURE` also
    /// the lanes that it certainly hits, with `INSIDE` those that it certainly does not hit on an edge.
    #[inline(always)]
    pub(crate) fn candidates<S: Simd, const WATERTIGHT: bool, const SURE: bool, const INSIDE: bool>(
        &self,
        simd: S,
        ray: &RayTriangles<S>,
        t_max: f32,
    ) -> Candidates<S> {
        if WATERTIGHT {
            let sheared = [self.sheared(simd, ray, 0), self.sheared(simd, ray, 3), self.sheared(simd, ray, 6)];
            let ray = AlongZ { recip: ray.recip_z, t_min: ray.t_min, t_max: simd.splat(t_max) };
            return edges::<S, SURE, INSIDE>(simd, sheared, &ray);
        }
        Candidates { mask: self.weights(simd, ray), sure: 0, inside: 0, sheared: [[ray.zero; 3]; 3] }
    }

    /// The vertex whose coordinates start at `row`, as the kernel shears it.
    #[inline(always)]
    fn sheared<S: Simd>(&self, simd: S, ray: &RayTriangles<S>, row: usize) -> [S::F; 3] {
        let x = simd.sub(self.row(simd, row + (ray.rows[0] & 3)), ray.origin[0]);
        let y = simd.sub(self.row(simd, row + (ray.rows[1] & 3)), ray.origin[1]);
        let z = simd.sub(self.row(simd, row + (ray.rows[2] & 3)), ray.origin[2]);
        [simd.sub(x, simd.mul(ray.shear[0], z)), simd.sub(y, simd.mul(ray.shear[1], z)), z]
    }

    /// The filter of Möller and Trumbore: the arithmetic of `canted_trace`'s, lane by lane.
    #[inline(always)]
    fn weights<S: Simd>(&self, simd: S, ray: &RayTriangles<S>) -> u32 {
        let v0 = self.vertex(simd, ray, 0);
        let e1 = sub(simd, self.vertex(simd, ray, 3), v0);
        let e2 = sub(simd, self.vertex(simd, ray, 6), v0);
        let s = sub(simd, ray.origin, v0);
        let p = cross(simd, ray.direction, e2);
        let tiny = simd.splat(f32::MIN_POSITIVE);
        let edges = simd.add(simd.add(norm(simd, e1), norm(simd, e2)), tiny);
        let largest = simd.mul(simd.splat(WEIGHTS_HEADROOM), simd.mul(edges, simd.add(norm(simd, s), edges)));
        let error = simd.add(simd.mul(simd.splat(WEIGHTS_ERROR / WEIGHTS_HEADROOM), largest), tiny);
        let det = dot(simd, p, e1);
        let u = simd.xor_sign(dot(simd, p, s), det);
        let v = simd.xor_sign(dot(simd, cross(simd, s, e1), ray.direction), det);
        let below = simd.lt(simd.add(simd.min(u, v), error), ray.zero);
        let above = simd.lt(simd.add(simd.abs(det), error), simd.add(u, v));
        !(below | above) & 0xff
    }

    /// The vertex whose coordinates start at `row`, permuted so that the kernel's z is last.
    #[inline(always)]
    fn vertex<S: Simd>(&self, simd: S, ray: &RayTriangles<S>, row: usize) -> [S::F; 3] {
        [
            self.row(simd, row + (ray.rows[0] & 3)),
            self.row(simd, row + (ray.rows[1] & 3)),
            self.row(simd, row + (ray.rows[2] & 3)),
        ]
    }
}

/// What the filter needs of rays along the kernel's z, where vertices are sheared.
pub(super) struct AlongZ<S: Simd> {
    /// The reciprocal of the direction.
    pub(super) recip: S::F,
    pub(super) t_min: S::F,
    pub(super) t_max: S::F,
}

/// The watertight kernel's filter, then one of `t`.
///
/// The sheared coordinates and edge functions repeat the kernel's f32 arithmetic, so their signs are its signs. Of
/// the remaining lanes, most belong to the triangle that a ray starts on; their `t` in f32 avoids the f64 work.
///
/// # Error of `t`
/// `T = Σ U_i·z_i` with `z_i = A_z,i / d_z`, `det = Σ U_i`, S6 the sum of the six products' absolute values and
/// `Z = max|z_i|`. In f32 each `U_i` is off by 2.01 u of its two products, `z_i` by two roundings, the sums by
/// three: `T` by 8 u·S6·Z, `det` by 5 u·S6. Let the kernel accept `t = T*/det*`, a convex combination of the `z_i`,
/// so `t <= Z`. With signs flipped so that `det >= 0`, and its sign right, `T - t_max·det <= T - t·det`, which is at
/// most 13 u·S6·Z; if the sign is wrong, `|det| + |det*| <= 5 u·S6`, and it is no more. Likewise for `t_min`. One
/// u is for the product's rounding: 16 u cover it, with slack for second order. Where `2·S6·Z` overflows, the error
/// is infinite and nothing is dropped; what underflows is less than the smallest normal number times all factors.
///
/// # Sure hits
/// Rounding is monotonic, so edge functions that are all positive, or all negative, in f32 are so exactly: the line hits the
/// inside of the triangle, at an exact `t <= Z`. Let `m = min(t_max, 2Z)`. In f32 `m·det` is off by `2Z·(5 u·S6 + 1.01 u·S6)`,
/// `T` by 8 u·S6·Z, and their difference by one rounding of at most 3·S6·Z: in all 24 u·S6·Z. So where the computed
/// `m·det - T` exceeds twice the error above, 32 u·S6·Z, exactly `t < m <= t_max`. Likewise `t > t_min`: where `t_min`
/// exceeds 2Z, `T - 2Z·det` is not positive, so it is not sure. The kernel rounds `t` to nearest, so its own
/// comparisons agree. A product that overflows makes the error infinite and nothing sure.
#[inline(always)]
pub(super) fn edges<S: Simd, const SURE: bool, const INSIDE: bool>(
    simd: S,
    [a, b, c]: [[S::F; 3]; 3],
    ray: &AlongZ<S>,
) -> Candidates<S> {
    let zero = simd.splat(0.0);
    let (u_1, u_2) = (simd.mul(c[0], b[1]), simd.mul(c[1], b[0]));
    let (v_1, v_2) = (simd.mul(a[0], c[1]), simd.mul(a[1], c[0]));
    let (w_1, w_2) = (simd.mul(b[0], a[1]), simd.mul(b[1], a[0]));
    let (u, v, w) = (simd.sub(u_1, u_2), simd.sub(v_1, v_2), simd.sub(w_1, w_2));
    let least = simd.min(simd.min(u, v), w);
    let greatest = simd.max(simd.max(u, v), w);
    let passing = !(simd.lt(least, zero) & simd.lt(zero, greatest)) & 0xff;
    let tiny = simd.splat(f32::MIN_POSITIVE);
    let det = simd.add(simd.add(u, v), w);
    let z = [simd.mul(a[2], ray.recip), simd.mul(b[2], ray.recip), simd.mul(c[2], ray.recip)];
    let t = simd.add(simd.add(simd.mul(u, z[0]), simd.mul(v, z[1])), simd.mul(w, z[2]));
    let sum_u = simd.add(simd.abs(u_1), simd.abs(u_2));
    let sum_v = simd.add(simd.abs(v_1), simd.abs(v_2));
    let sum_w = simd.add(simd.abs(w_1), simd.abs(w_2));
    let sum = simd.add(simd.add(sum_u, sum_v), sum_w);
    let reach = simd.max(simd.max(simd.abs(z[0]), simd.abs(z[1])), simd.abs(z[2]));
    let under = simd.mul(tiny, simd.add(simd.add(sum, reach), simd.splat(1.0)));
    let error = simd.add(simd.mul(simd.splat(8.0 * U), simd.mul(simd.add(sum, sum), reach)), under);
    // With all signs flipped so that det is positive: T - t_max·det > error, or t_min·det - T > error.
    let (t, det) = (simd.xor_sign(t, det), simd.abs(det));
    let late = simd.lt(error, simd.sub(t, simd.mul(ray.t_max, det)));
    let early = simd.lt(error, simd.sub(simd.mul(ray.t_min, det), t));
    let mask = passing & !(late | early);
    let (mut sure, mut inside) = (0, 0);
    if (SURE || INSIDE) && mask != 0 {
        inside = simd.lt(zero, least) | simd.lt(greatest, zero);
    }
    if SURE && mask != 0 {
        let (farthest, twice) = (simd.add(reach, reach), simd.add(error, error));
        let before_end = simd.sub(simd.mul(simd.min(ray.t_max, farthest), det), t);
        let after_start = simd.sub(t, simd.mul(simd.min(ray.t_min, farthest), det));
        sure = mask & inside & simd.lt(twice, before_end) & simd.lt(twice, after_start);
    }
    Candidates { mask, sure, inside, sheared: [a, b, c] }
}

/// One lane of a vector.
#[inline(always)]
fn lane_of<S: Simd>(simd: S, [x, y, z]: [S::F; 3], lane: usize) -> [f32; 3] {
    let lane = lane & 7;
    [simd.store(x)[lane], simd.store(y)[lane], simd.store(z)[lane]]
}

#[inline(always)]
pub(super) fn sub<S: Simd>(simd: S, a: [S::F; 3], b: [S::F; 3]) -> [S::F; 3] {
    [simd.sub(a[0], b[0]), simd.sub(a[1], b[1]), simd.sub(a[2], b[2])]
}

#[inline(always)]
pub(super) fn cross<S: Simd>(simd: S, a: [S::F; 3], b: [S::F; 3]) -> [S::F; 3] {
    [
        simd.sub(simd.mul(a[1], b[2]), simd.mul(a[2], b[1])),
        simd.sub(simd.mul(a[2], b[0]), simd.mul(a[0], b[2])),
        simd.sub(simd.mul(a[0], b[1]), simd.mul(a[1], b[0])),
    ]
}

#[inline(always)]
pub(super) fn dot<S: Simd>(simd: S, a: [S::F; 3], b: [S::F; 3]) -> S::F {
    simd.add(simd.add(simd.mul(a[0], b[0]), simd.mul(a[1], b[1])), simd.mul(a[2], b[2]))
}

/// Sum of absolute components.
#[inline(always)]
pub(super) fn norm<S: Simd>(simd: S, a: [S::F; 3]) -> S::F {
    simd.add(simd.add(simd.abs(a[0]), simd.abs(a[1])), simd.abs(a[2]))
}

#[cfg(test)]
mod tests {
    //! Hits that are sure without the exact test.

    use canted_fixtures::SplitMix64;
    use canted_trace::Ray;

    use super::*;
    use crate::SimdPath;
    use crate::simd::Task;

    /// Sure lanes of a block of one triangle, and whether a test without error bound is sure.
    struct Sure<'a> {
        ray: &'a ScaledRay,
        vertices: &'a [[f32; 3]; 3],
        t_max: f32,
    }

    impl Task for Sure<'_> {
        type Output = bool;

        #[inline(always)]
        fn on<S: Simd>(self, simd: S) -> bool {
            let mut rows = [[0.0; 8]; 10];
            for (row, x) in rows.iter_mut().zip(self.vertices.as_flattened()) {
                *row = [*x; 8];
            }
            let ray = self.ray.prepare(simd);
            let found = Block::Eight(&rows).candidates::<S, true, true, false>(simd, &ray, self.t_max);
            assert_eq!(found.sure & !found.mask, 0);
            found.sure != 0
        }
    }

    #[test]
    fn sure_hits_are_hits_however_near_the_end_of_the_ray() {
        let mut rng = SplitMix64::new(5);
        let mut unit = || (rng.next_u64() >> 40) as f32 / (1 << 23) as f32 - 1.0;
        let (mut n_sure, mut n_near, mut n_naive_wrong) = (0, 0, 0);
        for round in 0..60_000 {
            let far = [1.0, 100.0, 1e6][round % 3];
            let offset = [unit() * far, unit() * far, unit() * far];
            let mut point = |size: f32| [0, 1, 2].map(|k| offset[k] + size * unit());
            let size = [1.0, 1e-3, 30.0][round / 3 % 3];
            let (vertices, origin) = ([point(size), point(size), point(size)], point(3.0));
            let weights = [0.2, 0.3, 0.5];
            let target = [0, 1, 2].map(|k| (0..3).map(|i| weights[i] * vertices[i][k]).sum::<f32>());
            let direction = [0, 1, 2].map(|k| target[k] - origin[k]);
            let Some(mut ray) = ScaledRay::new(&Ray::new(origin, direction)) else { continue };
            let kernel = Watertight::prepare(&ray);
            let Some(hit) = Watertight::intersect(&kernel, &ray, &vertices, f32::INFINITY) else { continue };
            // The ray ends, or begins, a few roundings from the hit.
            let steps = i32::try_from(round % 9).expect("less than nine") - 4;
            let at = f32::from_bits(hit.t.to_bits().saturating_add_signed(steps));
            let (t_min, t_max) = if round % 2 == 0 { (0.0, at) } else { (at, f32::INFINITY) };
            for (t_min, t_max) in [(t_min, t_max), (0.0, f32::INFINITY)] {
                ray.t_min = t_min;
                let hits = Watertight::intersect(&kernel, &ray, &vertices, t_max).is_some();
                let [a, b, c] = vertices.map(|v| kernel.vertex(&ray, v));
                let edge = |p: [f32; 3], q: [f32; 3]| q[0] * p[1] - q[1] * p[0];
                let (u, v, w) = (edge(b, c), edge(c, a), edge(a, b));
                let d_z = ray.direction[kernel.axis().index()];
                let t = (u * a[2] + v * b[2] + w * c[2]) / ((u + v + w) * d_z);
                n_naive_wrong += usize::from((t_min < t && t < t_max) && !hits);
                for path in SimdPath::ALL.into_iter().filter(|path| path.is_available()) {
                    let sure = path.available().run(Sure { ray: &ray, vertices: &vertices, t_max });
                    assert!(hits || !sure, "{ray:?} {vertices:?} {t_max} {}", path.name());
                    n_sure += usize::from(sure);
                    n_near += usize::from(sure && (t_min > 0.0 || t_max < f32::INFINITY));
                }
            }
        }
        assert!(n_sure > 10_000 && n_naive_wrong > 100, "{n_sure} sure, {n_naive_wrong} wrong without the bound");
        assert_eq!(n_near, 0, "a hit at the end of the ray cannot be sure");
    }
}
