mod lookups;
mod placed;
mod prefetch;
mod shading_normal;
mod surfaces;

use canted_trace::{Ray, SurfacePoint};

use crate::vector::{dot, narrow, scale, sub, wide};
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
    /// Distance from the triangle's plane at which new rays start, in world units; see [`SurfacePoint`].
    pub offset: f64,
    /// The part of space that the incoming ray stood for, where it arrived.
    pub cone: Cone,
}

impl Surface {
    /// The point with its error bound, where rays continue.
    #[must_use]
    pub fn point(&self) -> SurfacePoint {
        SurfacePoint { position: self.position, normal: self.normal, offset: self.offset }
    }

    /// A ray without end along `direction`: [`SurfacePoint::spawn_ray`].
    #[must_use]
    pub fn spawn_ray(&self, direction: [f32; 3]) -> Ray {
        self.point().spawn_ray(direction)
    }

    /// A ray that ends just before `target`: [`SurfacePoint::spawn_ray_to`].
    #[must_use]
    pub fn spawn_ray_to(&self, target: [f32; 3]) -> Option<Ray> {
        self.point().spawn_ray_to(target)
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
