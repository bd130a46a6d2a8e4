use crate::rounding::nearest;
use crate::{Ray, ScaledRay};
use canted_obb::vector::{dot, length, sqrt, sub, to_f64};

/// A sphere, in the space of the rays.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sphere {
    /// Midpoint.
    pub center: [f32; 3],
    /// Radius, at least 0.
    pub radius: f32,
}

impl Sphere {
    /// Where the line of `ray` enters and leaves, in units of its direction and regardless of its interval; equal for
    /// a tangent. `None` if it passes by, or if the ray can hit nothing.
    ///
    /// The quadratic for a direction of any length, in f64, each root rounded once. Its discriminant comes from the
    /// vector from the centre to the line, at right angles to it, so small and far spheres lose no digits to
    /// cancellation; after Haines et al., Ray Tracing Gems 2019, chapter 7.
    #[must_use]
    pub fn roots(&self, ray: &Ray) -> Option<[f32; 2]> {
        let ray = ScaledRay::new(ray)?;
        let (d, m) = (to_f64(ray.direction), sub(to_f64(ray.origin), to_f64(self.center)));
        let d_squared = dot(d, d);
        let closest_t = -dot(m, d) / d_squared;
        let across: [f64; 3] = core::array::from_fn(|k| m[k] + closest_t * d[k]);
        let radius = f64::from(self.radius);
        let distance = length(across);
        // As a product, so that a ray near the rim loses no digits either.
        let chord_squared = (radius - distance) * (radius + distance);
        // Phrased so that what is not a number misses.
        (chord_squared >= 0.0).then(|| {
            let half_chord_t = sqrt(chord_squared / d_squared);
            [closest_t - half_chord_t, closest_t + half_chord_t].map(|t| ray.caller_t(nearest(t)))
        })
    }

    /// The first `t` of the ray's closed interval at which it meets the surface: from inside, where it leaves.
    #[must_use]
    pub fn intersect(&self, ray: &Ray) -> Option<f32> {
        self.roots(ray)?.into_iter().find(|&t| ray.t_min <= t && t <= ray.t_max)
    }
}
