use crate::rounding::nearest;
use crate::{Ray, ScaledRay};
use canted_obb::vector::{dot, length, sqrt, sub, to_f64};

/// A sphere, in the space of the rays.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sphere {
    /// Center.
    pub center: [f32; 3],
    /// Radius, at least 0.
    pub radius: f32,
}

impl Sphere {
    /// The `t` at which the line of `ray` enters and leaves, regardless of its interval; equal for a tangent. `None` for
    /// a miss or an invalid ray.
    ///
    /// Solved in f64, each root rounded once. The discriminant is computed from the vector perpendicular to the line from
    /// the center, which avoids cancellation for small and distant spheres (Haines et al., Ray Tracing Gems 2019, chapter 7).
    #[must_use]
    pub fn roots(&self, ray: &Ray) -> Option<[f32; 2]> {
        let ray = ScaledRay::new(ray)?;
        let (d, m) = (to_f64(ray.direction), sub(to_f64(ray.origin), to_f64(self.center)));
        let d_squared = dot(d, d);
        let closest_t = -dot(m, d) / d_squared;
        let across: [f64; 3] = core::array::from_fn(|k| m[k] + closest_t * d[k]);
        let radius = f64::from(self.radius);
        let distance = length(across);
        // A product avoids cancellation for rays near the silhouette.
        let chord_squared = (radius - distance) * (radius + distance);
        // Also false for NaN.
        (chord_squared >= 0.0).then(|| {
            let half_chord_t = sqrt(chord_squared / d_squared);
            [closest_t - half_chord_t, closest_t + half_chord_t].map(|t| ray.caller_t(nearest(t)))
        })
    }

    /// The first `t` in the closed interval of the ray at which it hits the surface; from inside, where it leaves.
    #[must_use]
    pub fn intersect(&self, ray: &Ray) -> Option<f32> {
        self.roots(ray)?.into_iter().find(|&t| ray.t_min <= t && t <= ray.t_max)
    }
}
