use canted_obb::Aabb;

use crate::rounding::UNIT_ROUNDOFF_F64;
use canted_obb::vector::{cross, to_f64};

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
