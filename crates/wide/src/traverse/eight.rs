use canted_trace::{Axis, Ray, ScaledRay, Shear};

use super::block::{RayTriangles, ThroughTriangles};
use super::ray::{
    MeshFrame, Pads, RayLanes, RayNumbers, ThroughNodes, TracedRay, moved_by, near_row, reciprocal_and_toward,
};
use crate::simd::{AvailablePath, Scalar, Simd, Task};

/// Up to eight rays, prepared at once.
///
/// The arithmetic is that of [`ScaledRay::new`], `ReferencePoint::moved`, [`Pads::along`] and [`RayNumbers::new`], so every number has the same bits.
/// Products of directions with a power of two round as these do in `f64`: once, and only where they over- or underflow.
pub(crate) struct EightRays {
    /// Rays that can hit.
    valid: u32,
    /// Rays beyond the range of the lanes: those whose power of two, or its reciprocal, is not normal, and those whose interval over- or
    /// underflows, for its ends are rounded inward.
    beyond: u32,
    /// Whether all are rays that can hit, within the range of the lanes.
    are_all: bool,
    to_scaled: [f64; 8],
    t_max: [f32; 8],
    /// Two bits of the axis of each direction's greatest component.
    axis: [u32; 2],
    /// Bits of rays with negative directions along the axes of the mesh frame.
    negative: [u32; 3],
    /// Each ray by itself.
    one: [OneRay; 8],
    /// Rays within the range of the lanes.
    pub(super) lanes: RayRows,
}

/// Numbers of eight rays: each row holds one number of each.
pub(super) struct RayRows {
    /// Of [`RayNumbers`].
    pub(super) recip: [[f32; 8]; 3],
    pub(super) near: [[f32; 8]; 3],
    pub(super) far: [[f32; 8]; 3],
    pub(super) t_min: [f32; 8],
    /// Origins relative to the reference point, and these along the rows of the mesh frame.
    pub(super) moved: [[f32; 8]; 3],
    pub(super) along: [[f32; 8]; 3],
    /// Origins as they were given.
    pub(super) origin: [[f32; 8]; 3],
    /// Of the triangle test: shear factors and the reciprocal of the direction's greatest component.
    pub(super) shear: [[f32; 8]; 2],
    pub(super) recip_z: [f32; 8],
}

/// One ray in three rows, which are columns of vectors of eight rays.
///
/// A ray that is read number by number from [`RayRows`] is collected by gathers on AVX-512, which take as long as three nodes.
#[derive(Clone, Copy)]
struct OneRay {
    /// Reciprocals of the direction in the mesh frame, near planes' products, the start of the interval, the reciprocal of the direction's
    /// greatest component.
    near: [f32; 8],
    /// The far planes' products, the origin relative to the reference point, the pad of oriented boxes, the direction's greatest
    /// component.
    far: [f32; 8],
    /// The direction, the origin as it was given, permuted as [`Axis::permute`] does, shear factors.
    line: [f32; 8],
}

/// The axes of the greatest components of eight vectors: the absolute components, and the greater of the last two.
#[derive(Clone, Copy)]
struct AlongAxes<S: Simd> {
    x: S::F,
    y: S::F,
    z: S::F,
    other: S::F,
}

impl<S: Simd> AlongAxes<S> {
    /// Components permuted as [`Axis::permute`] does.
    #[inline(always)]
    fn permute(self, simd: S, [x, y, z]: [S::F; 3]) -> [S::F; 3] {
        [self.choose(simd, [y, z, x]), self.choose(simd, [z, x, y]), self.choose(simd, [x, y, z])]
    }

    /// Of each lane the number for the axis of its greatest component.
    #[inline(always)]
    fn choose(self, simd: S, [for_x, for_y, for_z]: [S::F; 3]) -> S::F {
        let Self { x, y, z, other } = self;
        simd.pick(x, other, simd.pick(y, z, for_z, for_y), for_x)
    }
}

/// The least power of two whose reciprocal is not normal, 2^127.
const BEYOND: f32 = f32::from_bits(254 << 23);

impl EightRays {
    /// No rays.
    pub(crate) const fn new() -> Self {
        let (zero, zeros) = ([0.0; 8], [[0.0; 8]; 3]);
        let lanes = RayRows {
            recip: zeros,
            near: zeros,
            far: zeros,
            t_min: zero,
            moved: zeros,
            along: zeros,
            origin: zeros,
            shear: [zero; 2],
            recip_z: zero,
        };
        let one = OneRay { near: zero, far: zero, line: zero };
        Self {
            valid: 0,
            beyond: 0,
            are_all: false,
            to_scaled: [0.0; 8],
            t_max: zero,
            axis: [0; 2],
            negative: [0; 3],
            one: [one; 8],
            lanes,
        }
    }

    /// Prepares the first eight of `rays`, in the memory of earlier ones: copies would take as long as a node.
    #[inline(always)]
    pub(crate) fn prepare<S: Simd>(&mut self, simd: S, rays: &[Ray], frame: &MeshFrame, pads: Pads) {
        self.prepare_in_range(simd, rays, frame, pads);
        self.are_all = self.valid & !self.beyond == 0xff;
        if self.beyond != 0 {
            self.set_beyond(rays, frame, pads);
        }
    }

    /// [`EightRays::prepare`] without the rays beyond the range of the lanes.
    #[inline(always)]
    fn prepare_in_range<S: Simd>(&mut self, simd: S, rays: &[Ray], frame: &MeshFrame, pads: Pads) {
        let (mut rows, mut seeing) = ([[0.0; 8]; 8], 0);
        if let Some([a, b, c, d, e, f, g, h]) = rays.first_chunk() {
            // Without a loop: compilers gather the numbers of a loop one by one, which takes as long as a node.
            rows = [row(a), row(b), row(c), row(d), row(e), row(f), row(g), row(h)];
        } else {
            for (row_of, ray) in rows.iter_mut().zip(rays) {
                *row_of = row(ray);
            }
        }
        for (i, ray) in rays.iter().take(8).enumerate() {
            seeing |= u32::from(ray.mask != 0) << i;
        }
        self.set_rows(simd, &rows, frame, pads);
        self.valid &= seeing;
    }

    /// Prepares the rays beyond the range of the lanes, one by one.
    #[cold]
    fn set_beyond(&mut self, rays: &[Ray], frame: &MeshFrame, pads: Pads) {
        while self.beyond != 0 {
            let i = (self.beyond.trailing_zeros() & 7) as usize;
            self.beyond &= self.beyond - 1;
            match rays.get(i).and_then(ScaledRay::new) {
                Some(ray) => {
                    self.set(i, &ray, &RayNumbers::relative(Scalar, &ray, frame, pads));
                }
                None => self.valid &= !(1 << i),
            }
        }
    }

    /// The rays of these rows.
    #[inline(always)]
    fn set_rows<S: Simd>(&mut self, simd: S, rows: &[[f32; 8]; 8], frame: &MeshFrame, pads: Pads) {
        let [a, b, c, d, e, f, g, h] = rows;
        let rows = [
            simd.load(a),
            simd.load(b),
            simd.load(c),
            simd.load(d),
            simd.load(e),
            simd.load(f),
            simd.load(g),
            simd.load(h),
        ];
        let [ox, oy, oz, dx, dy, dz, t_min, t_max] = simd.transpose(rows);
        let (zero, one, largest) = (simd.splat(0.0), simd.splat(1.0), simd.splat(f32::MAX));
        let greatest = max3(simd, simd.abs(dx), simd.abs(dy), simd.abs(dz));

        // A NaN in any lane compares as false.
        let finite_origin =
            simd.le(simd.abs(ox), largest) & simd.le(simd.abs(oy), largest) & simd.le(simd.abs(oz), largest);
        let finite_direction =
            simd.le(simd.abs(dx), largest) & simd.le(simd.abs(dy), largest) & simd.le(simd.abs(dz), largest);
        let interval = simd.le(zero, t_min) & simd.le(t_min, t_max) & simd.le(t_min, largest);
        let valid = finite_origin & finite_direction & interval & simd.lt(zero, greatest);

        let power = simd.power_of_two(greatest);
        let from_scaled = simd.div(one, power);
        let direction = [simd.mul(dx, from_scaled), simd.mul(dy, from_scaled), simd.mul(dz, from_scaled)];
        let along = self.set_axis(simd, direction);
        let ([d_i, d_j, d_k], [o_i, o_j, o_k]) = (along.permute(simd, direction), along.permute(simd, [ox, oy, oz]));
        let (shear, recip_z) = ([simd.div(d_i, d_k), simd.div(d_j, d_k)], simd.div(one, d_k));
        let finite_t_max = simd.min(t_max, largest);
        // An end that overflows is rounded inward, to the greatest number.
        let (scaled_t_min, scaled_t_max) = (simd.mul(t_min, power), simd.min(simd.mul(finite_t_max, power), largest));
        let normal = simd.le(simd.splat(f32::MIN_POSITIVE), greatest) & simd.lt(greatest, simd.splat(BEYOND));
        let beyond = valid & !(normal & exact(simd, t_min, scaled_t_min) & exact(simd, finite_t_max, scaled_t_max));

        let [cx, cy, cz] = frame.reference.point();
        let moved = [simd.sub(ox, simd.splat(cx)), simd.sub(oy, simd.splat(cy)), simd.sub(oz, simd.splat(cz))];
        let scale = max3(simd, simd.abs(moved[0]), simd.abs(moved[1]), simd.abs(moved[2]));
        let lanes = &mut self.lanes;
        lanes.moved = store3(simd, moved);
        let (o, d, toward) = if frame.is_identity {
            (moved, direction, pad(simd, pads.aligned, scale))
        } else {
            let (o, d) = (rotate(frame, &lanes.moved), rotate(frame, &store3(simd, direction)));
            (load3(simd, &o), load3(simd, &d), pad(simd, pads.rotated, scale))
        };
        lanes.along = store3(simd, o);
        let (mut recip, mut near, mut far) = (o, o, o);
        for k in 0..3 {
            let (r, toward) = reciprocal_and_toward(simd, d[k], toward);
            [near[k], far[k]] = moved_by(simd, o[k], toward, r);
            recip[k] = r;
            self.negative[k] = simd.lt(r, zero);
        }
        lanes.recip = store3(simd, recip);
        lanes.near = store3(simd, near);
        lanes.far = store3(simd, far);
        lanes.t_min = simd.store(scaled_t_min);
        lanes.origin = store3(simd, [ox, oy, oz]);
        lanes.shear = [simd.store(shear[0]), simd.store(shear[1])];
        lanes.recip_z = simd.store(recip_z);
        for (to_scaled, power) in self.to_scaled.iter_mut().zip(simd.store(power)) {
            *to_scaled = f64::from(power);
        }
        let pad_oriented = pad(simd, pads.oriented, scale);
        let ([r_x, r_y, r_z], [n_x, n_y, n_z], [f_x, f_y, f_z]) = (recip, near, far);
        let ([m_x, m_y, m_z], [d_x, d_y, d_z], [s_x, s_y]) = (moved, direction, shear);
        let near = simd.transpose([r_x, r_y, r_z, n_x, n_y, n_z, scaled_t_min, recip_z]);
        let far = simd.transpose([f_x, f_y, f_z, m_x, m_y, m_z, pad_oriented, d_k]);
        let line = simd.transpose([d_x, d_y, d_z, o_i, o_j, o_k, s_x, s_y]);
        for (i, one) in self.one.iter_mut().enumerate() {
            *one = OneRay { near: simd.store(near[i]), far: simd.store(far[i]), line: simd.store(line[i]) };
        }
        (self.valid, self.beyond, self.t_max) = (valid, beyond, simd.store(scaled_t_max));
    }

    /// The axes of the greatest components, by the comparisons of [`Shear::new`].
    #[inline(always)]
    fn set_axis<S: Simd>(&mut self, simd: S, [x, y, z]: [S::F; 3]) -> AlongAxes<S> {
        let (x, y, z) = (simd.abs(x), simd.abs(y), simd.abs(z));
        let other = simd.max(y, z);
        // The axis is x, or y unless its bit is set, too.
        self.axis = [simd.lt(x, other), simd.lt(y, z)];
        AlongAxes { x, y, z, other }
    }

    /// The axis of the greatest component of all eight directions, if it is one.
    #[inline(always)]
    pub(super) fn axis_of_all(&self) -> Option<Axis> {
        match self.axis {
            [0, _] => Some(Axis::X),
            [0xff, 0] => Some(Axis::Y),
            [0xff, 0xff] => Some(Axis::Z),
            _ => None,
        }
    }

    /// The axis of the greatest component of the direction of ray `i`.
    #[inline(always)]
    fn axis(&self, i: usize) -> Axis {
        let [is_not_x, is_z] = [self.axis[0] >> i & 1, self.axis[1] >> i & 1];
        [Axis::X, Axis::Y, Axis::Z, Axis::Z][(is_not_x * (1 + is_z)) as usize & 3]
    }

    /// Overwrites ray `i`.
    fn set(&mut self, i: usize, ray: &ScaledRay, of: &RayNumbers) {
        let shear = Shear::new(ray);
        let axis = shear.axis();
        let ([r_x, r_y, r_z], [n_x, n_y, n_z], [f_x, f_y, f_z]) = (of.recip, of.near, of.far);
        let ([m_x, m_y, m_z], [d_x, d_y, d_z]) = (of.origin, of.direction);
        let ([o_i, o_j, o_k], [s_x, s_y]) = (axis.permute(ray.origin), shear.factors());
        let along = ray.direction[axis.index()];
        self.one[i] = OneRay {
            near: [r_x, r_y, r_z, n_x, n_y, n_z, ray.t_min, 1.0 / along],
            far: [f_x, f_y, f_z, m_x, m_y, m_z, of.pad_oriented, along],
            line: [d_x, d_y, d_z, o_i, o_j, o_k, s_x, s_y],
        };
        self.t_max[i] = ray.t_max;
        for (bits, row) in self.negative.iter_mut().zip(of.near_row) {
            *bits = *bits & !(1 << i) | u32::from(row != 0) << i;
        }
        for (bits, is_set) in self.axis.iter_mut().zip([axis != Axis::X, axis == Axis::Z]) {
            *bits = *bits & !(1 << i) | u32::from(is_set) << i;
        }
        self.to_scaled[i] = ray.scale();
    }

    /// Whether all are rays that can hit, within the range of the lanes.
    #[inline(always)]
    pub(super) fn are_all(&self) -> bool {
        self.are_all
    }

    /// The scaled ends of their intervals.
    #[inline(always)]
    pub(crate) fn t_max(&self) -> [f32; 8] {
        self.t_max
    }

    /// Whether ray `i`, one of the first eight, can hit.
    #[inline(always)]
    pub(crate) fn can_hit(&self, i: usize) -> bool {
        self.valid >> (i & 7) & 1 == 1
    }

    /// Ray `i`, one of the first eight, which is `given` and can hit.
    #[inline(always)]
    pub(crate) fn scaled(&self, i: usize, given: &Ray) -> ScaledRay {
        let i = i & 7;
        let &OneRay { near: [.., t_min, _], line: [d_x, d_y, d_z, ..], .. } = &self.one[i];
        let scaled = Ray { direction: [d_x, d_y, d_z], t_min, t_max: self.t_max[i], ..*given };
        let interval = [given.t_min, given.t_max.min(f32::MAX)];
        ScaledRay::from_parts(&scaled, interval, self.to_scaled[i])
    }

    /// Ray `i`, one of the first eight, which is `given`; `None` where it cannot hit.
    #[inline(always)]
    pub(crate) fn ray(&self, i: usize, given: &Ray) -> Option<TracedRay> {
        if !self.can_hit(i) {
            return None;
        }
        Some(TracedRay { scaled: self.scaled(i, given), numbers: self.numbers(i) })
    }

    /// What nodes need of ray `i`, one of the first eight.
    #[inline(always)]
    fn numbers(&self, i: usize) -> RayNumbers {
        let (OneRay { near, far, line }, [x, y, z]) = (&self.one[i & 7], self.negative);
        let &[r_x, r_y, r_z, n_x, n_y, n_z, t_min, _] = near;
        let &[f_x, f_y, f_z, m_x, m_y, m_z, pad_oriented, _] = far;
        let &[d_x, d_y, d_z, ..] = line;
        RayNumbers {
            recip: [r_x, r_y, r_z],
            near: [n_x, n_y, n_z],
            far: [f_x, f_y, f_z],
            near_row: [near_row(x, i & 7), near_row(y, i & 7), near_row(z, i & 7)],
            t_min,
            origin: [m_x, m_y, m_z],
            direction: [d_x, d_y, d_z],
            pad_oriented,
        }
    }
}

/// One of eight rays.
#[derive(Clone, Copy)]
pub(crate) struct OneOfEight<'a> {
    pub(crate) rays: &'a EightRays,
    pub(crate) i: usize,
}

impl ThroughNodes for OneOfEight<'_> {
    #[inline(always)]
    fn lanes<S: Simd>(self, simd: S) -> RayLanes<S> {
        (&self.rays.numbers(self.i)).lanes(simd)
    }
}

impl ThroughTriangles for OneOfEight<'_> {
    #[inline(always)]
    fn prepare<S: Simd>(self, simd: S) -> RayTriangles<S> {
        let (of, i) = (self.rays, self.i & 7);
        let axis = of.axis(i);
        let &OneRay { near: [.., t_min, recip_z], far: [.., along], line } = &of.one[i];
        let [d_x, d_y, d_z, o_i, o_j, o_k, s_x, s_y] = line;
        let (origin, direction) = ([o_i, o_j, o_k], axis.permute_by_index([d_x, d_y, d_z]));
        RayTriangles::new(simd, (origin, direction, t_min), axis.indices(), ([s_x, s_y], along, recip_z))
    }
}

/// Up to eight rays, prepared for a level of boxes above other structures: see `WideBvh::prepare_rays`.
#[doc(hidden)]
pub struct PreparedRays(EightRays);

/// What is known of a ray that was prepared with others.
#[doc(hidden)]
#[derive(Clone, Copy, Debug)]
pub enum Prepared {
    /// It hits nothing.
    Misses,
    /// It is beyond the range in which rays are prepared together.
    Alone,
    /// See [`PreparedRays::parts`].
    Together,
}

impl Default for PreparedRays {
    fn default() -> Self {
        Self(EightRays::new())
    }
}

impl PreparedRays {
    /// Prepares the first eight of `rays`.
    #[inline(always)]
    pub(crate) fn prepare<S: Simd>(&mut self, simd: S, rays: &[Ray], frame: &MeshFrame, pads: Pads) {
        self.0.prepare_in_range(simd, rays, frame, pads);
    }

    /// What is known of ray `i`, one of the first eight.
    #[inline]
    #[must_use]
    pub fn ray(&self, i: usize) -> Prepared {
        match self.0.beyond >> (i & 7) & 1 {
            1 => Prepared::Alone,
            _ if self.0.can_hit(i) => Prepared::Together,
            _ => Prepared::Misses,
        }
    }

    /// Ray `i`, which is `given` and was prepared with the others, and the end of its interval rounded outward.
    #[inline(always)]
    #[must_use]
    pub fn parts(&self, i: usize, given: &Ray) -> (ScaledRay, f32) {
        let scaled = self.0.scaled(i, given);
        // The ends are exact, but for one that overflowed.
        let t_max = if scaled.t_max == f32::MAX { f32::INFINITY } else { scaled.t_max };
        (scaled, t_max)
    }

    /// Ray `i`, for nodes.
    #[inline(always)]
    pub(crate) fn one(&self, i: usize) -> OneOfEight<'_> {
        OneOfEight { rays: &self.0, i }
    }
}

/// Calls `each` with the index of each ray and the ray prepared for traversal; `None` where it cannot hit.
pub(crate) fn for_each_of_eight(
    path: AvailablePath,
    rays: &[Ray],
    frame: &MeshFrame,
    pads: Pads,
    each: &mut dyn FnMut(usize, Option<&TracedRay>),
) {
    path.run(EachOfEight { rays, frame, pads, each });
}

struct EachOfEight<'a> {
    rays: &'a [Ray],
    frame: &'a MeshFrame,
    pads: Pads,
    each: &'a mut dyn FnMut(usize, Option<&TracedRay>),
}

impl Task for EachOfEight<'_> {
    type Output = ();

    #[inline(always)]
    fn on<S: Simd>(self, simd: S) {
        let Self { rays, frame, pads, each } = self;
        let mut eight = EightRays::new();
        for (i, rays) in rays.chunks(8).enumerate() {
            eight.prepare(simd, rays, frame, pads);
            for (lane, ray) in rays.iter().enumerate() {
                each(8 * i + lane, eight.ray(lane, ray).as_ref());
            }
        }
    }
}

/// The numbers of a ray that are prepared together.
#[inline(always)]
fn row(&Ray { origin: [ox, oy, oz], direction: [dx, dy, dz], t_min, t_max, .. }: &Ray) -> [f32; 8] {
    [ox, oy, oz, dx, dy, dz, t_min, t_max]
}

/// Lanes in which the product of an end of an interval with a power of two is exact: it is normal, or the end is zero or
/// infinite. A product that is the least normal number may have been rounded up to it.
#[inline(always)]
fn exact<S: Simd>(simd: S, end: S::F, product: S::F) -> u32 {
    let (zero, largest) = (simd.splat(0.0), simd.splat(f32::MAX));
    let normal = simd.lt(simd.splat(f32::MIN_POSITIVE), product) & simd.le(product, largest);
    normal | simd.le(end, zero) | simd.lt(largest, end)
}

/// A relative pad in units of the space.
#[inline(always)]
fn pad<S: Simd>(simd: S, relative: f32, scale: S::F) -> S::F {
    simd.add(simd.mul(simd.splat(relative), scale), simd.splat(f32::MIN_POSITIVE))
}

/// Eight vectors in the frame of a mesh.
#[inline(always)]
fn rotate(frame: &MeshFrame, [x, y, z]: &[[f32; 8]; 3]) -> [[f32; 8]; 3] {
    let mut out = [[0.0; 8]; 3];
    for i in 0..8 {
        let v = frame.rotate([x[i], y[i], z[i]]);
        for k in 0..3 {
            out[k][i] = v[k];
        }
    }
    out
}

#[inline(always)]
fn load3<S: Simd>(simd: S, [x, y, z]: &[[f32; 8]; 3]) -> [S::F; 3] {
    [simd.load(x), simd.load(y), simd.load(z)]
}

#[inline(always)]
fn store3<S: Simd>(simd: S, [x, y, z]: [S::F; 3]) -> [[f32; 8]; 3] {
    [simd.store(x), simd.store(y), simd.store(z)]
}

#[inline(always)]
fn max3<S: Simd>(simd: S, x: S::F, y: S::F, z: S::F) -> S::F {
    simd.max(simd.max(x, y), z)
}

#[cfg(test)]
mod tests {
    use canted_fixtures::SplitMix64;
    use canted_trace::ReferencePoint;

    use super::*;
    use crate::SimdPath;

    /// Prepares rays together, and each by itself.
    struct Both<'a> {
        rays: &'a [Ray],
        frame: &'a MeshFrame,
    }

    impl Task for Both<'_> {
        type Output = [Vec<Option<Vec<u64>>>; 2];

        #[inline(always)]
        fn on<S: Simd>(self, simd: S) -> Self::Output {
            let Self { rays, frame } = self;
            let pads = Pads::of(canted_trace::HIT_ERROR);
            let mut eight = EightRays::new();
            eight.prepare(simd, rays, frame, pads);
            let alone = |ray: &Ray| {
                let ray = TracedRay::new(&ScaledRay::new(ray)?, frame, pads);
                Some([bits(&ray), (&ray.scaled).prepare(simd).bits(simd)].concat())
            };
            let together = rays.iter().enumerate().map(|(i, ray)| {
                let ray = eight.ray(i, ray)?;
                Some([bits(&ray), OneOfEight { rays: &eight, i }.prepare(simd).bits(simd)].concat())
            });
            [together.collect(), rays.iter().map(alone).collect()]
        }
    }

    fn bits(ray: &TracedRay) -> Vec<u64> {
        let TracedRay { scaled, numbers: n } = ray;
        let rows = [n.recip, n.near, n.far, n.origin, n.direction, [n.t_min, n.pad_oriented, scaled.t_max]];
        let scaled_rows = [scaled.origin, scaled.direction, [scaled.t_min, scaled.t_max, scaled.time]];
        let numbers = rows.iter().chain(&scaled_rows).flatten().map(|x| u64::from(x.to_bits()));
        let interval = scaled.exact_interval().map(f64::to_bits);
        let near_row = n.near_row.map(|row| row as u64);
        numbers.chain(interval).chain([scaled.scale().to_bits(), scaled.mask.into()]).chain(near_row).collect()
    }

    /// A number of any size, or one of those that need care.
    fn number(rng: &mut SplitMix64) -> f32 {
        const SPECIAL: [f32; 9] =
            [0.0, -0.0, 1e-45, f32::MIN_POSITIVE, 1.0, f32::MAX, f32::INFINITY, f32::NEG_INFINITY, f32::NAN];
        let random = rng.next_u64();
        match random % 8 {
            0 => SPECIAL[(random >> 8) as usize % SPECIAL.len()],
            1..4 => f32::from_bits(u32::try_from(random >> 32).expect("the upper half")),
            _ => (random >> 40) as f32 / 1e6 - 8.0,
        }
    }

    #[test]
    fn eight_rays_have_the_bits_of_single_rays() {
        let mut rng = SplitMix64::new(1);
        let (origin, far) = (ReferencePoint::ORIGIN, ReferencePoint::new([1e6, -3.0, 0.1]).expect("a small point"));
        let third = |at| MeshFrame::new([[0.6, 0.8, 0.0], [-0.8, 0.6, 0.0], [0.0, 0.0, 1.0]], at);
        let identity = |at| MeshFrame::new(canted_obb::Obb::IDENTITY_FRAME, at);
        let frames = [identity(origin), third(origin), identity(far), third(far)];
        let mut n_hitting = 0;
        for round in 0..4000 {
            let n = 1 + round % 8;
            let rays: Vec<Ray> = (0..n)
                .map(|_| {
                    let mut v = || [(); 3].map(|()| number(&mut rng));
                    let (origin, direction) = (v(), v());
                    let (a, b) = (number(&mut rng).abs(), number(&mut rng).abs());
                    let finite = |v: [f32; 3]| v.map(|x| if x.is_finite() { x } else { 3.0 });
                    let (origin, direction) =
                        if round % 4 == 0 { (origin, direction) } else { (finite(origin), finite(direction)) };
                    let t_max = if round % 3 == 0 { f32::INFINITY } else { a.max(b) };
                    Ray {
                        time: number(&mut rng).abs(),
                        mask: if round % 5 == 0 { 0 } else { 6 },
                        ..Ray::new(origin, direction).between(a.min(b), t_max)
                    }
                })
                .collect();
            for path in SimdPath::ALL.into_iter().filter(|path| path.is_available()) {
                let frame = &frames[round % 4];
                let [together, alone] = path.available().run(Both { rays: &rays, frame });
                for ((ray, a), b) in rays.iter().zip(together).zip(alone) {
                    assert_eq!(a, b, "{ray:?}, {}", path.name());
                    n_hitting += usize::from(b.is_some());
                }
            }
        }
        assert!(n_hitting > 10_000, "only {n_hitting} rays can hit");
    }
}
