//! Single tests: lines against spheres, segments against boxes.

use canted_obb::Aabb;
use canted_obb::vector::{cross, dot, sqrt, sub, to_f64};

use crate::rounding::{UNIT_ROUNDOFF_F64, nearest};
use crate::{Ray, ScaledRay};

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
    /// Solved in f64, each root rounded once. The chord is computed from the vector perpendicular to the line from
    /// the center, which avoids cancellation for small and distant spheres (Haines et al., Ray Tracing Gems 2019, chapter 7).
    #[must_use]
    pub fn roots(&self, ray: &Ray) -> Option<[f32; 2]> {
        let ray = ScaledRay::new(ray)?;
        Some(self.roots_scaled(&ray)?.map(|t| ray.caller_t(t)))
    }

    /// The same of a scaled ray, whose `t` is scaled too.
    #[doc(hidden)]
    #[inline]
    #[must_use]
    pub fn roots_scaled(&self, ray: &ScaledRay) -> Option<[f32; 2]> {
        let (d, m) = (to_f64(ray.direction), sub(to_f64(ray.origin), to_f64(self.center)));
        let recip = 1.0 / dot(d, d);
        let closest_t = -dot(m, d) * recip;
        let across: [f64; 3] = core::array::from_fn(|k| m[k] + closest_t * d[k]);
        let radius = f64::from(self.radius);
        // The square of the radius is exact.
        let chord_squared = radius * radius - dot(across, across);
        // Also false for NaN.
        (chord_squared >= 0.0).then(|| {
            let half_chord_t = sqrt(chord_squared * recip);
            [closest_t - half_chord_t, closest_t + half_chord_t].map(nearest)
        })
    }

    /// The first `t` in the closed interval of the ray at which it hits the surface; from inside, where it leaves.
    #[must_use]
    pub fn intersect(&self, ray: &Ray) -> Option<f32> {
        self.roots(ray)?.into_iter().find(|&t| ray.t_min <= t && t <= ray.t_max)
    }
}

/// Rounding of one comparison, relative to the sum of the absolute terms in it: eight roundings in f64 at most touch a
/// term (two differences, a product and a sum on the left, as many on the right); doubled for second-order terms.
const COMPARISON_ERROR: f64 = 16.0 * UNIT_ROUNDOFF_F64;

/// Whether the closed segment from `p0` to `p1` and `aabb` share a point; an empty box shares none.
///
/// Separating-axis test with the three axes of the box and their cross products with the segment. It never misses an
/// overlap, even in a single point; a gap below about 1e-15 of the coordinates may count as an overlap. For a distance use
/// [`ray_aabb`](crate::ray_aabb). Source: Gregory et al., in Ericson 2005, section 5.3.3.
#[must_use]
pub fn segment_overlaps_aabb(p0: impl Into<[f32; 3]>, p1: impl Into<[f32; 3]>, aabb: &Aabb) -> bool {
    if aabb.is_empty() {
        return false;
    }
    let (p0, p1, min, max) = (to_f64(p0.into()), to_f64(p1.into()), to_f64(aabb.min), to_f64(aabb.max));
    // Everything is doubled, to avoid halving centers and extents.
    let center: [f64; 3] = core::array::from_fn(|k| (p0[k] + p1[k]) - (min[k] + max[k]));
    let extent: [f64; 3] = core::array::from_fn(|k| max[k] - min[k]);
    let along: [f64; 3] = core::array::from_fn(|k| p1[k] - p0[k]);
    let magnitude: [f64; 3] = core::array::from_fn(|k| p0[k].abs() + p1[k].abs() + min[k].abs() + max[k].abs());
    let normal = cross(center, along);
    (0..3).all(|k| {
        let (i, j) = ((k + 1) % 3, (k + 2) % 3);
        let (length_i, length_j) = (along[i].abs(), along[j].abs());
        let faces = center[k].abs() <= extent[k] + along[k].abs() + COMPARISON_ERROR * magnitude[k];
        // Relative to the length too, as all terms are: a short segment needs no more slack than a long one.
        let slack = COMPARISON_ERROR * (magnitude[i] * length_j + magnitude[j] * length_i);
        let edges = normal[k].abs() <= extent[i] * length_j + extent[j] * length_i + slack;
        faces && edges
    })
}
