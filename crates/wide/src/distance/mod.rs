//! Distance and overlap queries over the nodes that rays traverse.
//!
//! ```text
//! point          -> PointLanes -> lower bounds of eight children -> nearest.rs      nearest point, k nearest, signed distance
//! point          -> upward ray -> exact orientation              -> containment.rs  inside of a closed mesh
//! points         -> balls that hold no surface                   -> sides.rs        points on the same side of a closed mesh
//! point          -> clusters far away, triangles close by     -> winding.rs      winding number, also of meshes that are not closed
//! convex, sphere -> eight children                               -> overlap.rs      all primitives that overlap a region
//! ```
//!
//! # No lost primitive
//! A child is skipped only if its lower bound exceeds what is searched for; so a lower bound must not exceed the distance of
//! anything below. Let u = 2^-24, `S = |p|∞ + ρ∞` with ρ∞ the greatest coordinate below a box, all relative to the
//! reference point of the BVH (below), and `R` the rows of a box `lo <= R·x <= hi`. A point `x` in the box and the query point `p` differ by `v` with `|R·v| >= g` per row, `g` the gaps of `R·p`
//! from the interval. So `|v|² >= |g|² / ‖R‖²`, and `‖R‖² <= ‖R·Rᵀ‖∞ <= L² + s` with `L` the greatest length of a row, at most
//! 1 + 2^-22, and `s` the sum of the rows' absolute products: almost orthogonal rows lose almost nothing, and a loaded file
//! with other rows loses time, not primitives.
//!
//! *Gaps.* Aligned nodes in the identity frame take one rounding of `lo - p`, at most u·S. In a rotated mesh frame `R·p` is
//! computed in f64 and rounded once: √3·u·S more. An oriented node computes `row·p - c` with four roundings of terms whose
//! absolute sum is at most 2·√3·S, and subtracts `h` with two more: of the terms in ρ∞, `c` takes one rounding, and the two
//! subtractions add at most 2·2·√3 u·ρ∞, in all 5·√3 u·ρ∞. Boxes are stored with planes moved outward by at least 7 u·ρ∞, 10·√3 u·ρ∞ and
//! 15·√3 u·ρ∞ (`traverse`), which covers all terms in ρ∞ with more than u·ρ∞ to spare for second order. For those in `|p|∞`
//! [`PointLanes`] subtracts pads of 3 u·|p|∞, 5·√3 u·|p|∞ and 17·√3 u·|p|∞.
//! *Moved coordinates.* `p` and `x` are rounded when they are made relative to the reference point (`ReferencePoint`), by u·|p|∞ and u·ρ∞ per
//! coordinate: along a row √3·u·S more, where rows are not those of the identity. The planes have as much more for ρ∞, the point for `|p|∞`.
//! *Squares.* Products, sums, `s` and the quotient take fewer than 16 roundings: [`SHRINK`] is 1 - 2^-19.
//! Distances of primitives are computed in f64 and fall short of the true ones by less than 2^-46·S, which the pads cover,
//! too. What underflows makes a bound smaller; what overflows is replaced by the greatest number.

mod containment;
mod nearest;
mod overlap;
mod sides;
mod winding;

use canted_obb::Aabb;
use canted_obb::vector::{dot as dot_f64, length, sub, to_f64};
use canted_trace::lanes::{SQRT_3, UNIT_ROUNDOFF as U};
use canted_trace::{Convex, Sphere, closest_point_on_triangle};

use crate::node::Row;
use crate::simd::Simd;
use crate::traverse::{MeshFrame, SHRINK};

pub use containment::Place;
pub use nearest::{Found, NearestList, NearestPoint};
pub use winding::WindingNumbers;

/// The point of a primitive that is closest to a query point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClosestPoint {
    /// Squared distance.
    pub distance_squared: f64,
    /// The point, in object space.
    pub position: [f64; 3],
}

/// A shape with distance and overlap queries. Implement it for your own [`Primitive`](crate::Primitive) to use them.
pub trait DistanceShape {
    /// The closest point of the shape.
    ///
    /// The distance may fall short of the true one by at most 2^-40 of the coordinates; otherwise nearer primitives are lost.
    fn closest_point(&self, point: [f32; 3]) -> ClosestPoint;

    /// Whether the shape and the region share a point. An overlap must not be denied. A solid overlaps what is inside of it.
    fn overlaps(&self, region: &Convex) -> bool;

    /// Whether the surface of the shape and the region share a point: of a solid, not what is inside of it.
    ///
    /// The default is for shapes that have no inside.
    fn surface_overlaps(&self, region: &Convex) -> bool {
        self.overlaps(region)
    }

    /// Whether a point of the shape is at most `radius` away from `center`.
    ///
    /// The default is for shapes that have no inside, by their closest point.
    fn overlaps_ball(&self, center: [f32; 3], radius: f32) -> bool {
        let radius = f64::from(radius);
        self.closest_point(center).distance_squared <= radius * radius
    }
}

/// A triangle by its vertices.
impl DistanceShape for [[f32; 3]; 3] {
    #[inline]
    fn closest_point(&self, point: [f32; 3]) -> ClosestPoint {
        let closest = closest_point_on_triangle(point, self);
        let [a, b, c] = self.map(to_f64);
        let position = std::array::from_fn(|k| a[k] + (closest.u * (b[k] - a[k]) + closest.v * (c[k] - a[k])));
        ClosestPoint { distance_squared: closest.distance_squared, position }
    }

    fn overlaps(&self, region: &Convex) -> bool {
        region.overlaps_triangle(self)
    }
}

/// Distances are to the surface. Overlaps are those of the ball: the surface and what is inside of it.
impl DistanceShape for Sphere {
    fn closest_point(&self, point: [f32; 3]) -> ClosestPoint {
        let (center, radius) = (to_f64(self.center), f64::from(self.radius));
        let offset = sub(to_f64(point), center);
        let length = length(offset);
        let distance = (length - radius).abs();
        let direction = if length > 0.0 { offset.map(|x| x / length) } else { [1.0, 0.0, 0.0] };
        let position = std::array::from_fn(|k| center[k] + radius * direction[k]);
        ClosestPoint { distance_squared: distance * distance, position }
    }

    fn overlaps(&self, region: &Convex) -> bool {
        region.overlaps_ball(to_f64(self.center), self.radius.into())
    }

    fn surface_overlaps(&self, region: &Convex) -> bool {
        self.overlaps(region) && !region.is_inside_ball(to_f64(self.center), self.radius.into())
    }

    fn overlaps_ball(&self, center: [f32; 3], radius: f32) -> bool {
        length(sub(to_f64(center), to_f64(self.center))) <= f64::from(self.radius) + f64::from(radius)
    }
}

/// Distances are to the surface. Overlaps are those of the solid box.
impl DistanceShape for Aabb {
    fn closest_point(&self, point: [f32; 3]) -> ClosestPoint {
        let (point, [min, max]) = (to_f64(point), [self.min, self.max].map(to_f64));
        let mut position: [f64; 3] = std::array::from_fn(|k| point[k].clamp(min[k], max[k].max(min[k])));
        if position == point {
            // From inside, the nearest face.
            let faces = (0..3).flat_map(|k| [(k, min[k]), (k, max[k])]);
            let depth = |&(k, plane): &(usize, f64)| (point[k] - plane).abs();
            if let Some((k, plane)) = faces.min_by(|one, other| depth(one).total_cmp(&depth(other))) {
                position[k] = plane;
            }
        }
        let offset = sub(point, position);
        ClosestPoint { distance_squared: dot_f64(offset, offset), position }
    }

    fn overlaps(&self, region: &Convex) -> bool {
        region.overlaps_aabb(self)
    }

    fn surface_overlaps(&self, region: &Convex) -> bool {
        self.overlaps(region) && !region.is_inside_aabb(self)
    }

    fn overlaps_ball(&self, center: [f32; 3], radius: f32) -> bool {
        let (center, [min, max]) = (to_f64(center), [self.min, self.max].map(to_f64));
        let gap: [f64; 3] = std::array::from_fn(|k| (min[k] - center[k]).max(center[k] - max[k]).max(0.0));
        length(gap) <= f64::from(radius)
    }
}

/// A query point in all lanes.
#[derive(Clone, Copy)]
pub(crate) struct PointLanes<S: Simd> {
    /// In the mesh frame, relative to the reference point.
    rotated: [S::F; 3],
    rotated_pad: S::F,
    /// Scale of squared bounds in the mesh frame.
    rotated_scale: S::F,
    /// In object space, relative to the reference point.
    point: [S::F; 3],
    oriented_pad: S::F,
    shrink: S::F,
    zero: S::F,
    one: S::F,
    greatest: S::F,
}

impl<S: Simd> PointLanes<S> {
    /// Lanes of `point`.
    #[inline(always)]
    pub(crate) fn new(simd: S, point: [f32; 3], frame: &MeshFrame) -> Self {
        let point = frame.reference.moved(point);
        let [x, y, z] = point.map(f32::abs);
        let scale = x.max(y).max(z);
        let pad = |roundings: f32| simd.splat(roundings * U * scale + f32::MIN_POSITIVE);
        let splat = |[x, y, z]: [f32; 3]| [simd.splat(x), simd.splat(y), simd.splat(z)];
        let (rotated, rotated_pad) =
            if frame.is_identity { (point, pad(3.0)) } else { (frame.rotate(point), pad(5.0 * SQRT_3)) };
        let [a, b, c] = frame.rows;
        let skew = dot(a, b).abs() + dot(b, c).abs() + dot(c, a).abs();
        Self {
            rotated: splat(rotated),
            rotated_pad,
            rotated_scale: simd.splat(SHRINK / (1.0 + skew)),
            point: splat(point),
            oriented_pad: pad(17.0 * SQRT_3),
            shrink: simd.splat(SHRINK),
            zero: simd.splat(0.0),
            one: simd.splat(1.0),
            greatest: simd.splat(f32::MAX),
        }
    }

    /// Lower bounds of the squared distances to eight boxes of an aligned node.
    #[inline(always)]
    pub(crate) fn aligned(&self, simd: S, rows: &[Row; 8]) -> S::F {
        let mut sum = self.zero;
        for k in 0..3 {
            let below = simd.sub(simd.load(&rows[2 * k]), self.rotated[k]);
            let above = simd.sub(self.rotated[k], simd.load(&rows[2 * k + 1]));
            let gap = simd.max(simd.sub(simd.max(below, above), self.rotated_pad), self.zero);
            sum = simd.add(sum, simd.mul(gap, gap));
        }
        simd.min(simd.mul(sum, self.rotated_scale), self.greatest)
    }

    /// Lower bounds of the squared distances to eight boxes of an oriented node.
    #[inline(always)]
    pub(crate) fn oriented(&self, simd: S, rows: &[Row; 16]) -> S::F {
        let row = |k: usize| [simd.load(&rows[5 * k]), simd.load(&rows[5 * k + 1]), simd.load(&rows[5 * k + 2])];
        let dot = |a: [S::F; 3], b: [S::F; 3]| {
            simd.add(simd.add(simd.mul(a[0], b[0]), simd.mul(a[1], b[1])), simd.mul(a[2], b[2]))
        };
        let axes = [row(0), row(1), row(2)];
        let mut sum = self.zero;
        for (k, &axis) in axes.iter().enumerate() {
            let along = simd.sub(dot(axis, self.point), simd.load(&rows[5 * k + 3]));
            let gap = simd.sub(simd.abs(along), simd.load(&rows[5 * k + 4]));
            let gap = simd.max(simd.sub(gap, self.oriented_pad), self.zero);
            sum = simd.add(sum, simd.mul(gap, gap));
        }
        let [a, b, c] = axes;
        let skew = simd.add(simd.abs(dot(a, b)), simd.add(simd.abs(dot(b, c)), simd.abs(dot(c, a))));
        let bound = simd.div(simd.mul(sum, self.shrink), simd.add(self.one, skew));
        simd.min(bound, self.greatest)
    }
}

fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
