mod lookups;
mod placed;
mod prefetch;
mod shading_normal;
mod surfaces;

use canted_trace::Ray;

use crate::vector::{Vector, add, dot, narrow, scale, sub, wide};
use crate::{Bsdf, Cone};
pub use surfaces::Surfaces;

/// A point of a surface, ready for shading. World space; colours linear RGB.
#[derive(Clone, Copy, Debug)]
pub struct Surface {
    /// The point, in the plane of its triangle but for a few roundings of `f64`.
    pub position: [f64; 3],
    /// Unit normal of the triangle, on the side that the incoming ray came from.
    pub normal: [f64; 3],
    /// Unit normal to shade with: interpolated, bent by a normal map, always on the viewer's side; [`Self::normal`] where
    /// what the file says is not.
    pub shading_normal: [f64; 3],
    /// Whether the ray came from the front: the side, in object space, from which the triangle runs counter-clockwise.
    pub is_front: bool,
    /// How it scatters light.
    pub bsdf: Bsdf,
    /// Emitted radiance, the same on both sides.
    pub emission: [f32; 3],
    /// Distance that new rays keep off the triangle's plane, in world units.
    pub offset: f64,
    /// The part of space that the incoming ray stood for, where it arrived.
    pub cone: Cone,
}

impl Surface {
    /// A ray without end that leaves along `direction`, on the side of the triangle to which `direction` points.
    ///
    /// It starts [`Surface::offset`] off the plane, which is as much as rounding can ask for; no constant of length is
    /// involved.
    #[must_use]
    pub fn spawn_ray(&self, direction: [f32; 3]) -> Ray {
        Ray::new(self.origin_towards(wide(direction)), direction)
    }

    /// A ray that ends short of `target`: its direction spans the whole way, its `t_max` stays below 1.
    ///
    /// The gap is the distance that rays keep off this surface, so that a surface through the target does not count,
    /// and four roundings of the direction. `None` where the target is too close to tell apart.
    #[must_use]
    pub fn spawn_ray_to(&self, target: [f32; 3]) -> Option<Ray> {
        let origin = self.origin_towards(sub(wide(target), self.position));
        let way = sub(wide(target), wide(origin));
        let gap = self.offset / dot(way, way).sqrt() + 2.0 * f64::from(f32::EPSILON);
        // False for a way of no length, whose gap is infinite or not a number.
        (gap < 1.0).then(|| {
            #[expect(clippy::cast_possible_truncation, reason = "rounding to f32 is within the gap")]
            let t_max = (1.0 - gap) as f32;
            Ray { t_max, ..Ray::new(origin, narrow(way)) }
        })
    }

    fn origin_towards(&self, direction: Vector) -> [f32; 3] {
        let side = self.offset.copysign(dot(self.normal, direction));
        narrow(add(self.position, scale(self.normal, side)))
    }

    /// Turns `direction` to the outer side of the triangle, where shading normal and triangle disagree about it.
    ///
    /// A direction that is above the shading normal's horizon and below the triangle's is mirrored in the triangle's
    /// plane: no ray enters the body, and no light is lost as it would be by dropping the sample.
    #[must_use]
    pub fn mirror_outward(&self, direction: [f32; 3]) -> [f32; 3] {
        let height = dot(self.normal, wide(direction));
        if height >= 0.0 { direction } else { narrow(sub(wide(direction), scale(self.normal, 2.0 * height))) }
    }
}
