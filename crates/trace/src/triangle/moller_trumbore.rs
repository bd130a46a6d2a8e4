use super::finish::finish;
use super::{Kernel, TriangleHit};
use crate::ScaledRay;
use crate::vector::{cross, dot, sub};

/// The kernel that needs nothing precomputed; rays exactly through shared edges may slip between the faces.
///
/// Reads: a ray, three vertices. Writes: the hit.
/// Holds: reported points lie within [`HIT_ERROR`](crate::HIT_ERROR); `t`, `u`, `v` have the bits of
/// [`BaldwinWeber`](crate::BaldwinWeber)'s where both hit. Rays within about 1e-8 of the face's plane miss.
/// Products in the filter underflow for triangles smaller than about 2^-60; the watertight kernel has no such limit.
/// Source: Möller, Trumbore 1997, without culling; the distance is left to f64, so that a traversal's shrinking
/// `t_max` cannot change which triangles are hit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct MollerTrumbore;

impl Kernel for MollerTrumbore {
    type Record = [[f32; 3]; 3];
    type Prepared = ();

    #[inline]
    fn record(vertices: [[f32; 3]; 3]) -> Self::Record {
        vertices
    }

    #[inline]
    fn prepare(_: &ScaledRay) {}

    #[inline]
    fn intersect((): &(), ray: &ScaledRay, vertices: &Self::Record, t_max: f32) -> Option<TriangleHit> {
        let [v0, v1, v2] = *vertices;
        let (e1, e2, s) = (sub(v1, v0), sub(v2, v0), sub(ray.origin, v0));
        let p = cross(ray.direction, e2);
        let det = dot(p, e1);
        let sign = 1.0f32.copysign(det);
        let u = sign * dot(p, s);
        let v = sign * dot(cross(s, e1), ray.direction);
        // Without branches: the signs are as good as random.
        if u < 0.0 || v < 0.0 || u + v > det.abs() {
            return None;
        }
        finish(ray, vertices, t_max)
    }
}
