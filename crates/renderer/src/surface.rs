mod hit_triangle;
mod lobes;
mod prefetch;
mod shading_normal;
mod surfaces;
mod texture_lookup;

use canted_trace::{Ray, SurfacePoint};

use crate::vector::{dot, narrow, scale, sub, wide};
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
    /// Direction of the longer highlights of an anisotropic surface, world space, of any length.
    pub along: Option<[f64; 3]>,
    /// Emitted radiance, the same on both sides.
    pub emission: [f32; 3],
    /// Distance from the triangle's plane at which new rays start, in world units; see [`SurfacePoint`].
    pub offset: f64,
    /// The ray cone of the incoming ray, at this point.
    pub cone: Cone,
}

impl Surface {
    /// The point from which new rays start, with its error bound.
    #[must_use]
    pub fn point(&self) -> SurfacePoint {
        SurfacePoint { position: self.position, normal: self.normal, offset: self.offset }
    }

    /// An infinite ray along `direction`: [`SurfacePoint::spawn_ray`].
    #[must_use]
    pub fn spawn_ray(&self, direction: [f32; 3]) -> Ray {
        self.point().spawn_ray(direction)
    }

    /// A ray that ends just before `target`: [`SurfacePoint::spawn_ray_to`].
    #[must_use]
    pub fn spawn_ray_to(&self, target: [f32; 3]) -> Option<Ray> {
        self.point().spawn_ray_to(target)
    }

    /// Mirrors a direction below the triangle's horizon to the outside.
    ///
    /// A direction may be above the horizon of the shading normal and below that of the triangle. Mirroring keeps rays
    /// out of the solid without losing energy, as rejecting the sample would.
    #[must_use]
    pub fn mirror_outward(&self, direction: [f32; 3]) -> [f32; 3] {
        let height = dot(self.normal, wide(direction));
        if height >= 0.0 { direction } else { narrow(sub(wide(direction), scale(self.normal, 2.0 * height))) }
    }
}
