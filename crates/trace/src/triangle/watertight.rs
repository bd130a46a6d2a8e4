use core::ops::{Mul, Sub};

use super::{Kernel, TriangleHit};
use crate::rounding::nearest;
use crate::{ScaledRay, Side};
use canted_obb::flat_as_edge;
use canted_obb::vector::{sub, to_f64};

/// The default kernel: no ray passes between the triangles of a closed mesh, in any direction, at any scale.
///
/// Reads: a ray, three vertices. Writes: the hit.
/// Holds: neighbors share vertices bit for bit, so their edge functions are each other's negatives; the sign of an
/// edge function is exact. A ray through a shared edge or vertex hits at least one of the triangles around it, unless all
/// of these have no area in the sheared coordinates.
///
/// What that means for thin geometry: sheared vertices are off by 4u·M (below). They still form the image of the surface under
/// one continuous map, in which triangles without area bound nothing. So a ray crosses a *closed* mesh, however thin, as often
/// inward as outward, and every crossing is a hit. An *isolated* fan or ribbon has no other side: where it is narrower than
/// the error, for vertices at a distance of a few times their extent about 64 ulps of the coordinates, its image may be
/// degenerate or lie beside the ray, and the ray misses it. No test in f32 coordinates can promise more.
///
/// A triangle without area is never hit, as it has no normal ([`canted_obb::is_flat`]). A mesh is closed here if it is without them: where one
/// fills a T-junction, of an edge and the two edges along it, the images of these edges differ by roundings, and a ray between them misses
/// the triangles on both sides.
///
/// Source: Woop, Benthin, Wald 2013; instead of their fallback for zeros, every hit is computed exactly.
///
/// # Steps
/// With `z` the axis of greatest `|d|` and `S = (d_x/d_z, d_y/d_z)`, vertices become `A = v - o`, then
/// `(A_x - S_x·A_z, A_y - S_y·A_z, A_z)` in f32: the ray is now the z axis. The edge functions
/// `U = C_x·B_y - C_y·B_x` (cyclic) are first computed in f32. Rounding is monotonic, so a sign is
/// never wrong, at most lost to zero, and opposite signs are a certain miss. The rest is computed in f64 from the same
/// f32 coordinates, where products of two f32, hence the signs, are exact. Fused multiply-add is not allowed: it would
/// break the symmetry between neighbors.
///
/// # Error
/// Let u = 2^-24, `a = v - o` in real arithmetic, `M` the greatest `|a|∞` of the three vertices, `s = d_x/d_z` exact;
/// `|s| <= 1`. Then `A = a` up to u·M, and the sheared coordinate is `A_x - s·A_z` up to u·|A_x| (the subtraction) and
/// 3u·|s·A_z| (quotient, product, subtraction), together 4u·M. The f64 step is exact for the triangle with these sheared
/// vertices, hence for the triangle whose vertices are unsheared with exact `s`; these lie within 5u·M of the true ones
/// perpendicular to the ray and u·M along z. The hit is the same convex combination of both, so it lies within 5u·M of the true
/// triangle. Rounding `t` moves the point by at most u·|t·d|∞ <= u·M; f64 roundings and all second-order terms stay
/// below 0.1 u·M. In all 6.1 u·M <= 6.1 u·(|o|∞ + ρ∞). Underflow adds a few 2^-149 at most.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Watertight;

/// The shear that maps the ray to the z axis; computed once per ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shear {
    axis: Axis,
    factors: [f32; 2],
}

impl Shear {
    /// The shear of `ray`.
    #[inline(always)]
    #[must_use]
    pub fn new(ray: &ScaledRay) -> Self {
        let axis = Axis::from_greatest(ray.direction, f32::abs);
        let [d_x, d_y, d_z] = axis.permute_by_index(ray.direction);
        Self { axis, factors: [d_x / d_z, d_y / d_z] }
    }

    /// The axis of the greatest component of the direction: the z axis; the two after it are x and y.
    #[inline]
    #[must_use]
    pub fn axis(&self) -> Axis {
        self.axis
    }

    /// `S = (d_x/d_z, d_y/d_z)`, rounded to f32; absolute values at most 1.
    #[inline]
    #[must_use]
    pub fn factors(&self) -> [f32; 2] {
        self.factors
    }

    /// A vertex in sheared coordinates, as the kernel computes them.
    #[doc(hidden)]
    #[inline(always)]
    #[must_use]
    pub fn vertex(&self, ray: &ScaledRay, v: [f32; 3]) -> [f32; 3] {
        let [x, y, z] = self.axis.permute(sub(v, ray.origin));
        let [s_x, s_y] = self.factors;
        [x - s_x * z, y - s_y * z, z]
    }
}

impl Kernel for Watertight {
    type Record = [[f32; 3]; 3];
    type Prepared = Shear;

    #[inline]
    fn record(vertices: [[f32; 3]; 3]) -> Self::Record {
        flat_as_edge(vertices)
    }

    #[inline]
    fn prepare(ray: &ScaledRay) -> Shear {
        Shear::new(ray)
    }

    // Always inlined, so that it is compiled with the instruction set of the SIMD path.
    #[inline(always)]
    fn intersect(shear: &Shear, ray: &ScaledRay, vertices: &Self::Record, t_max: f32) -> Option<TriangleHit> {
        let [a, b, c] = *vertices;
        let sheared = [shear.vertex(ray, a), shear.vertex(ray, b), shear.vertex(ray, c)];
        if mixed(edge_functions(sheared)) {
            return None;
        }
        let d_z = ray.direction[shear.axis.index()];
        Self::intersect_sheared(ray, d_z, sheared, t_max)
    }
}

impl Watertight {
    /// The exact part of the test, for a triangle in sheared coordinates ([`Shear::vertex`]); `d_z` is the direction along z.
    #[doc(hidden)]
    #[inline(always)]
    #[must_use]
    pub fn intersect_sheared(ray: &ScaledRay, d_z: f32, sheared: [[f32; 3]; 3], t_max: f32) -> Option<TriangleHit> {
        let [a, b, c] = sheared;
        let (t, u, v, side) = solve([to_f64(a), to_f64(b), to_f64(c)], f64::from(d_z))?;
        (ray.t_min <= t && t <= t_max).then_some(TriangleHit { t, u, v, side })
    }
}

/// Twice the signed areas, seen along z, of the origin with each edge; the first faces the first vertex.
#[inline(always)]
fn edge_functions<T: Copy + Sub<Output = T> + Mul<Output = T>>([a, b, c]: [[T; 3]; 3]) -> [T; 3] {
    [c[0] * b[1] - c[1] * b[0], a[0] * c[1] - a[1] * c[0], b[0] * a[1] - b[1] * a[0]]
}

/// Whether one is negative and another positive. NaN from an overflow is neither and passes.
#[inline]
fn mixed<T: Copy + PartialOrd + Default>([u, v, w]: [T; 3]) -> bool {
    let zero = T::default();
    // Branch-free, since the signs are unpredictable.
    ((u < zero) | (v < zero) | (w < zero)) & ((u > zero) | (v > zero) | (w > zero))
}

/// `t`, `u`, `v` and the side of a sheared f32 triangle with exact edge functions; `None` for a miss.
#[inline(always)]
fn solve(sheared: [[f64; 3]; 3], d_z: f64) -> Option<(f32, f32, f32, Side)> {
    let [u, v, w] = edge_functions(sheared);
    let det = u + v + w;
    if mixed([u, v, w]) || det == 0.0 {
        return None;
    }
    let [a, b, c] = sheared;
    let denominator = det * d_z;
    let t = nearest((u * a[2] + v * b[2] + w * c[2]) / denominator);
    // Seen along +z, a front face runs clockwise, and det is minus twice its signed area.
    let side = if denominator > 0.0 { Side::Front } else { Side::Back };
    Some((t, nearest(v / det), nearest(w / det), side))
}

/// A coordinate axis, chosen once for a ray or a triangle to take the role of z.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Axis {
    /// The first coordinate.
    X,
    /// The second.
    Y,
    /// The third.
    Z,
}

impl Axis {
    /// The axis of the greatest absolute component, the first of equals. Without branches, as for [`Axis::indices`].
    #[inline(always)]
    pub(crate) fn from_greatest<T: Copy + PartialOrd>([x, y, z]: [T; 3], abs: impl Fn(T) -> T) -> Self {
        let (x, y, z) = (abs(x), abs(y), abs(z));
        const AXES: [Axis; 3] = [Axis::X, Axis::Y, Axis::Z];
        let (is_x, y_is_first) = ((x >= y) & (x >= z), y >= z);
        AXES[usize::from(!is_x) * (2 - usize::from(y_is_first))]
    }

    /// Its index.
    #[inline]
    #[must_use]
    pub fn index(self) -> usize {
        self as usize
    }

    /// The indices of the axes, permuted cyclically so that this axis is last. From a table: rays of a slice differ in their
    /// axis, so a branch would be mispredicted.
    #[inline]
    #[must_use]
    pub fn indices(self) -> [usize; 3] {
        const INDICES: [[usize; 3]; 3] = [[1, 2, 0], [2, 0, 1], [0, 1, 2]];
        INDICES[self as usize]
    }

    /// [`Axis::permute`] of numbers in registers, without a branch: a copy is indexed in memory, so that the vector itself stays in
    /// registers.
    #[doc(hidden)]
    #[inline(always)]
    #[must_use]
    pub fn permute_by_index(self, [x, y, z]: [f32; 3]) -> [f32; 3] {
        let copy = [x, y, z, 0.0];
        let [i, j, k] = self.indices();
        [copy[i & 3], copy[j & 3], copy[k & 3]]
    }

    /// The components permuted cyclically so that this axis is last.
    #[inline]
    #[must_use]
    pub fn permute<T: Copy>(self, [x, y, z]: [T; 3]) -> [T; 3] {
        match self {
            Self::X => [y, z, x],
            Self::Y => [z, x, y],
            Self::Z => [x, y, z],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_permute_alike_with_and_without_branches() {
        for v in [[1.0, -2.0, 3.5], [-0.0, f32::MIN_POSITIVE, f32::MAX], [1e-45, f32::INFINITY, 0.0]] {
            for axis in [Axis::X, Axis::Y, Axis::Z] {
                let [x, y, z] = axis.indices();
                let want = [v[x], v[y], v[z]].map(f32::to_bits);
                assert_eq!(axis.permute_by_index(v).map(f32::to_bits), want, "{axis:?}");
                assert_eq!(axis.permute(v).map(f32::to_bits), want, "{axis:?}");
            }
        }
    }
}
