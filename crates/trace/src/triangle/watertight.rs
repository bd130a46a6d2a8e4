use super::{Kernel, TriangleHit};
use crate::rounding::nearest;
use crate::vector::{sub, wide};
use crate::{ScaledRay, Side};

/// The default kernel: a closed mesh has no holes, in any direction, at any scale.
///
/// Reads: a ray, three vertices. Writes: the hit.
/// Holds: neighbours share vertices bit for bit, so their edge functions are each other's negatives; the sign of an
/// edge function is exact. A ray through a shared edge or vertex hits at least one of the triangles around it.
/// Source: Woop, Benthin, Wald 2013; instead of their fallback on zeros, every hit is finished exactly.
///
/// # Steps
/// With `z` the axis of greatest `|d|` and `S = (d_x/d_z, d_y/d_z)`, vertices become `A = v - o`, then
/// `(A_x - S_x·A_z, A_y - S_y·A_z, A_z)` in f32: the ray is now the z axis. The edge functions
/// `U = C_x·B_y - C_y·B_x` (cyclic) are first computed in f32. Rounding is monotonic, so a sign is never wrong, at
/// most lost to zero, and opposite signs are a certain miss. What remains is computed in f64 from the same f32
/// coordinates: products of two f32 are exact there, so the signs are. No fused multiply-add may enter: it would break
/// the symmetry between neighbours.
///
/// # Error
/// Let u = 2^-24, `a = v - o` in real arithmetic, `M` the greatest `|a|∞` of the three vertices, `s = d_x/d_z` exact;
/// `|s| <= 1`. Then `A = a` up to u·M, and the sheared coordinate is `A_x - s·A_z` up to u·|A_x| (the subtraction) and
/// 3u·|s·A_z| (quotient, product, subtraction), together 4u·M. The finish is exact for the triangle with these sheared
/// vertices, hence for the triangle whose vertices are unsheared with exact `s`; these lie within 5u·M of the true ones
/// across the ray and u·M along z. The hit is the same convex combination of both, so it lies within 5u·M of the true
/// triangle. Rounding `t` moves the point by at most u·|t·d|∞ <= u·M; f64 roundings and all second-order terms stay
/// below 0.1 u·M. In all 6.1 u·M <= 6.1 u·(|o|∞ + ρ∞). Underflow adds a few 2^-149 at most.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Watertight;

/// The shear that turns a ray into the z axis; made once a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shear {
    axes: [usize; 3],
    factors: [f32; 2],
}

impl Shear {
    /// The shear of `ray`.
    #[inline]
    #[must_use]
    pub fn new(ray: &ScaledRay) -> Self {
        let [x, y, z] = ray.direction.map(f32::abs);
        let kz = if x >= y && x >= z {
            0
        } else if y >= z {
            1
        } else {
            2
        };
        let d = ray.direction;
        let (right, left) = ((kz + 1) % 3, (kz + 2) % 3);
        // Seen along the ray, the winding must not depend on the sign of d_z.
        let (kx, ky) = if d[kz] < 0.0 { (left, right) } else { (right, left) };
        Self { axes: [kx, ky, kz], factors: [d[kx] / d[kz], d[ky] / d[kz]] }
    }

    /// Which of the ray's axes play x, y and z.
    #[inline]
    #[must_use]
    pub fn axes(&self) -> [usize; 3] {
        self.axes
    }

    /// `d_x/d_z` and `d_y/d_z`, rounded to f32; absolute values at most 1.
    #[inline]
    #[must_use]
    pub fn factors(&self) -> [f32; 2] {
        self.factors
    }

    /// A vertex in sheared coordinates.
    #[inline]
    fn vertex(&self, ray: &ScaledRay, v: [f32; 3]) -> [f32; 3] {
        let a = sub(v, ray.origin);
        let [kx, ky, kz] = self.axes;
        let [sx, sy] = self.factors;
        [a[kx] - sx * a[kz], a[ky] - sy * a[kz], a[kz]]
    }
}

impl Kernel for Watertight {
    type Record = [[f32; 3]; 3];
    type Prepared = Shear;

    #[inline]
    fn record(vertices: [[f32; 3]; 3]) -> Self::Record {
        vertices
    }

    #[inline]
    fn prepare(ray: &ScaledRay) -> Shear {
        Shear::new(ray)
    }

    #[inline]
    fn intersect(shear: &Shear, ray: &ScaledRay, vertices: &Self::Record, t_max: f32) -> Option<TriangleHit> {
        let [a, b, c] = vertices.map(|v| shear.vertex(ray, v));
        let u = c[0] * b[1] - c[1] * b[0];
        let v = a[0] * c[1] - a[1] * c[0];
        let w = b[0] * a[1] - b[1] * a[0];
        if mixed(u, v, w) {
            return None;
        }
        finish(a, b, c, ray, ray.direction[shear.axes[2]], t_max)
    }
}

/// Whether one is negative and another positive. NaN, from overflow, is neither: it leaves the question open.
#[inline]
fn mixed<T: PartialOrd + Default>(u: T, v: T, w: T) -> bool {
    let zero = T::default();
    (u < zero || v < zero || w < zero) && (u > zero || v > zero || w > zero)
}

/// Decides exactly, in f64, from sheared f32 vertices.
#[inline]
fn finish(a: [f32; 3], b: [f32; 3], c: [f32; 3], ray: &ScaledRay, d_z: f32, t_max: f32) -> Option<TriangleHit> {
    let [a, b, c] = [a, b, c].map(wide);
    let u = c[0] * b[1] - c[1] * b[0];
    let v = a[0] * c[1] - a[1] * c[0];
    let w = b[0] * a[1] - b[1] * a[0];
    let det = u + v + w;
    if mixed(u, v, w) || det == 0.0 {
        return None;
    }
    let t = nearest((u * a[2] + v * b[2] + w * c[2]) / (det * f64::from(d_z)));
    if !(ray.t_min <= t && t <= t_max) {
        return None;
    }
    // Seen along the ray, a front face turns clockwise, and det is minus twice its signed area.
    let side = if det > 0.0 { Side::Front } else { Side::Back };
    Some(TriangleHit { t, u: nearest(v / det), v: nearest(w / det), side })
}
