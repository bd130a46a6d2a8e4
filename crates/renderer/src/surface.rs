mod hit_triangle;
mod prefetch;
mod shading_normal;
mod surfaces;
mod texture_lookup;

use canted_trace::Ray;

use crate::vector::{Vector, add, dot, narrow, scale, sub, wide};
use crate::{Bsdf, Cone};
pub use surfaces::Surfaces;

/// A surface point, ready for shading. World space; colors linear RGB.
#[derive(Clone, Copy, Debug)]
pub struct Surface {
    /// The point, in the plane of its triangle up to a few `f64` roundings.
    pub position: [f64; 3],
    /// Unit geometric normal, on the side of the incoming ray.
    pub normal: [f64; 3],
    /// Unit shading normal, interpolated and perturbed by a normal map. Always on the viewer's side; falls back to
    /// [`Self::normal`].
    pub shading_normal: [f64; 3],
    /// Whether the ray came from the front: the side from which the triangle is counter-clockwise in object space.
    pub is_front: bool,
    /// The BSDF.
    pub bsdf: Bsdf,
    /// Emitted radiance, the same on both sides.
    pub emission: [f32; 3],
    /// Distance from the triangle's plane at which new rays start, in world units.
    pub offset: f64,
    /// The ray cone of the incoming ray, at this point.
    pub cone: Cone,
}

impl Surface {
    /// An infinite ray along `direction`, on the side of the triangle to which `direction` points.
    ///
    /// It starts [`Surface::offset`] from the plane, which exceeds all rounding errors.
    #[must_use]
    pub fn spawn_ray(&self, direction: [f32; 3]) -> Ray {
        Ray::new(self.origin_towards(wide(direction)), direction)
    }

    /// A ray towards `target` that ends just before it: its direction spans the entire distance, its `t_max` is below 1.
    ///
    /// The gap is this surface's offset, so that a surface through the target is no occluder, plus four roundings of the
    /// direction. `None` if the target is too close.
    #[must_use]
    pub fn spawn_ray_to(&self, target: [f32; 3]) -> Option<Ray> {
        let origin = self.origin_towards(sub(wide(target), self.position));
        let to_target = sub(wide(target), wide(origin));
        let gap = self.offset / dot(to_target, to_target).sqrt() + 2.0 * f64::from(f32::EPSILON);
        // False for a zero distance, whose gap is infinite or NaN.
        (gap < 1.0).then(|| {
            #[expect(clippy::cast_possible_truncation, reason = "rounding to f32 is within the gap")]
            let t_max = (1.0 - gap) as f32;
            Ray { t_max, ..Ray::new(origin, narrow(to_target)) }
        })
    }

    fn origin_towards(&self, direction: Vector) -> [f32; 3] {
        let signed_offset = self.offset.copysign(dot(self.normal, direction));
        narrow(add(self.position, scale(self.normal, signed_offset)))
    }

    /// Mirrors a direction below the triangle's horizon to the outside.
    ///
    /// A direction may be above the horizon of the shading normal and below that of the triangle. Mirroring keeps rays out of
    /// the solid without losing energy, as rejecting the sample would.
    #[must_use]
    pub fn mirror_outward(&self, direction: [f32; 3]) -> [f32; 3] {
        let height = dot(self.normal, wide(direction));
        if height >= 0.0 { direction } else { narrow(sub(wide(direction), scale(self.normal, 2.0 * height))) }
    }
}
