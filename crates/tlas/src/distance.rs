//! Distances to instances, and triangles of instances that overlap regions of world space.
//!
//! Distances are those in world space, under any affine map: the triangles near the point are mapped and compared there, in `f64`. Moving
//! instances are where they are as the shutter opens.
//!
//! # No lost triangle
//! Let `M` be the map of an instance, `q` the point of object space where the search starts, an `f32` near `M⁻¹p`, and `r = p - M·q`. A
//! triangle with a point `x` has `x - q = M⁻¹(M·x - p) + M⁻¹·r`. So within the distance `d` of `p` are only triangles within
//! `‖M⁻¹‖·(d + |r|)` of `q`. The spectral norm of a matrix `A` is at most the root of the greatest row sum of `A·Aᵀ` or `Aᵀ·A`; for rotations with a
//! scale it is that. The computed inverse is wrong by less than 2^-28 of its norm (`Placed::new`).

use std::borrow::Borrow;
use std::ops::ControlFlow;

use canted_lbvh::par;
use canted_obb::vector::{add, dot, length, reach, sub, to_f64};
use canted_obb::{Aabb, PrimId};
use canted_trace::{Convex, InstanceId, Intersect, Overlaps, closest_to_zero, forms};
use canted_wide::TriangleBvh;

use crate::Tlas;
use crate::inside::{InstancePrimitive, Placed, mapped};
use crate::instance::{Columns, Rows, row_sum_norm};

/// Points of one parallel job.
const CHUNK: usize = 1 << 6;

/// What roundings mostly add to the sum of two distances at most, relative to the coordinates. Where they add more, as beside a much larger triangle, nothing is found
/// within the sum, and the search starts again without it.
const STEP_ERROR: f64 = 64.0 * f64::EPSILON;

/// A point of a triangle of an instance near a query point, world space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NearestSurface {
    /// Distance between the query point and `position`.
    pub distance: f64,
    /// The closest point of the triangle.
    pub position: [f64; 3],
    /// The triangle.
    pub primitive: PrimId,
    /// The instance.
    pub instance: InstanceId,
}

/// The nearest of those that were taken, in order.
#[doc(hidden)]
#[derive(Clone, Debug)]
pub struct NearestSurfaces {
    pub found: Vec<NearestSurface>,
    /// At least one.
    pub k: usize,
    pub max_distance: f64,
}

impl NearestSurfaces {
    /// Takes a triangle, and returns the distance within which others count.
    pub fn take(&mut self, found: NearestSurface) -> f64 {
        let order = |a: &NearestSurface| (a.distance, a.instance, a.primitive);
        let place = self.found.partition_point(|other| order(other) < order(&found));
        // Found again through a second reference.
        if self.found.get(place) != Some(&found) {
            self.found.insert(place, found);
            self.found.truncate(self.k);
        }
        self.bound()
    }

    /// The distance within which others count.
    #[must_use]
    pub fn bound(&self) -> f64 {
        if self.found.len() < self.k { self.max_distance } else { self.found[self.k - 1].distance }
    }
}

/// Distances, overlaps and containment, of a TLAS over triangles.
///
/// Each takes time for every instance; triangles are searched for in those that are near.
///
/// ```
/// use canted_obb::Affine;
/// use canted_tlas::{Instance, Tlas};
/// use canted_wide::TriangleBvh;
///
/// let bvh = TriangleBvh::build(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], &[[0, 1, 2]])?;
/// let at = |z: f32| Instance::new(0, Affine::translation([0.0, 0.0, z]));
/// let tlas = Tlas::new(vec![bvh], &[at(0.0), at(3.0)], Default::default())?;
/// let nearest = tlas.nearest_point([0.25, 0.25, 2.0], f64::INFINITY).expect("there are triangles");
/// assert_eq!((nearest.distance, nearest.instance.0, nearest.position), (1.0, 1, [0.25, 0.25, 3.0]));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
impl<B: Intersect + Borrow<TriangleBvh>> Tlas<B> {
    /// The triangle closest to `point` among those at most `max_distance` away; ties go to the lowest (instance, primitive).
    #[must_use]
    pub fn nearest_point(&self, point: impl Into<[f64; 3]>, max_distance: f64) -> Option<NearestSurface> {
        let mut nearest = vec![];
        self.nearest_points(point, 1, max_distance, &mut nearest);
        nearest.pop()
    }

    /// The `k` triangles closest to `point` among those at most `max_distance` away, nearest first; ties go to the lowest (instance,
    /// primitive). Replaces the contents of `nearest`.
    pub fn nearest_points(
        &self,
        point: impl Into<[f64; 3]>,
        k: usize,
        max_distance: f64,
        nearest: &mut Vec<NearestSurface>,
    ) {
        nearest.clear();
        let mut list = NearestSurfaces { found: std::mem::take(nearest), k, max_distance };
        if k > 0 {
            self.visit_near(point.into(), max_distance, &mut |found| list.take(found));
        }
        *nearest = list.found;
    }

    /// The nearest triangle of each point; see [`Tlas::nearest_point`]. Points near their predecessors, as those of grids, take less time.
    ///
    /// # Panics
    /// Where the slices differ in length.
    pub fn nearest_point_many(&self, points: &[[f64; 3]], max_distance: f64, nearest: &mut [Option<NearestSurface>]) {
        assert_eq!(points.len(), nearest.len(), "one answer for each point");
        let mut last: Option<([f64; 3], f64)> = None;
        let mut found = vec![];
        for (&point, nearest) in points.iter().zip(nearest) {
            // What is nearest to the predecessor is no farther away than that and the step.
            let within = last.map_or(max_distance, |(other, distance)| {
                let size = reach(point).max(reach(other)) + distance;
                max_distance.min(length(sub(point, other)) + distance + STEP_ERROR * size)
            });
            self.nearest_points(point, 1, within, &mut found);
            if found.is_empty() && within < max_distance {
                self.nearest_points(point, 1, max_distance, &mut found);
            }
            *nearest = found.pop();
            last = nearest.map(|nearest| (point, nearest.distance));
        }
    }

    /// [`Tlas::nearest_point_many`] on all threads.
    pub fn par_nearest_point_many(&self, points: &[[f64; 3]], max_distance: f64, nearest: &mut [Option<NearestSurface>])
    where
        B: Sync,
    {
        assert_eq!(points.len(), nearest.len(), "one answer for each point");
        self.find_bounds();
        par::for_chunks(nearest, CHUNK, |first, nearest| {
            self.nearest_point_many(&points[first..first + nearest.len()], max_distance, nearest);
        });
    }

    /// Distance to the nearest surface of any instance: negative where [`Tlas::contains`] is true, infinite without triangles and for an infinite
    /// point, NaN for a point with a NaN.
    #[must_use]
    pub fn signed_distance(&self, point: impl Into<[f64; 3]>) -> f64 {
        let mut distance = [0.0];
        self.signed_distance_many(&[point.into()], &mut distance);
        distance[0]
    }

    /// The signed distance of each point; see [`Tlas::signed_distance`].
    ///
    /// # Panics
    /// Where the slices differ in length.
    pub fn signed_distance_many(&self, points: &[[f64; 3]], distances: &mut [f64]) {
        let mut nearest = vec![None; points.len()];
        self.nearest_point_many(points, f64::INFINITY, &mut nearest);
        assert_eq!(points.len(), distances.len(), "one answer for each point");
        for ((&point, nearest), distance) in points.iter().zip(nearest).zip(distances) {
            let is_number = !point.iter().any(|x| x.is_nan());
            let size = nearest.map_or(if is_number { f64::INFINITY } else { f64::NAN }, |nearest| nearest.distance);
            *distance = if size > 0.0 && self.contains(point) { -size } else { size };
        }
    }

    /// [`Tlas::signed_distance_many`] on all threads.
    pub fn par_signed_distance_many(&self, points: &[[f64; 3]], distances: &mut [f64])
    where
        B: Sync,
    {
        assert_eq!(points.len(), distances.len(), "one answer for each point");
        self.find_bounds();
        par::for_chunks(distances, CHUNK, |first, distances| {
            self.signed_distance_many(&points[first..first + distances.len()], distances);
        });
    }

    /// Calls `visit` with the closest point of each triangle that may be at most `limit` away; it returns the new limit. A triangle may come
    /// twice.
    #[doc(hidden)]
    pub fn visit_near(&self, point: [f64; 3], limit: f64, visit: &mut dyn FnMut(NearestSurface) -> f64) {
        // Nothing is near a negative limit, or one that is NaN.
        if !(point.iter().all(|x| x.is_finite()) && limit >= 0.0) {
            return;
        }
        self.top.each_near(point, limit, &mut |number, limit| {
            let Some(placed) = self.placed(InstanceId(number)) else { return limit };
            let mut limit = limit;
            if distance_to(&placed.aabb, point) > limit {
                return limit;
            }
            let search = Search::new(&placed, point);
            let bvh: &TriangleBvh = placed.blas.borrow();
            bvh.visit_near(search.start, search.bound(limit), |primitive, vertices, bound| {
                let from_point = vertices.map(|vertex| add(linear(&placed.columns, to_f64(vertex)), search.shift));
                let closest = closest_to_zero(&from_point);
                let distance = closest.distance_squared.sqrt();
                if distance > limit {
                    return bound;
                }
                let [a, b, c] = from_point;
                let offset = |k: usize| a[k] + (closest.u * (b[k] - a[k]) + closest.v * (c[k] - a[k]));
                let position = std::array::from_fn(|k| point[k] + offset(k));
                limit = visit(NearestSurface { distance, position, primitive, instance: placed.instance });
                search.bound(limit)
            });
            limit
        });
    }
}

/// A search for triangles of an instance.
struct Search {
    /// Object space.
    start: [f32; 3],
    /// What the linear map of a vertex is added to, so that it is relative to the query point.
    shift: [f64; 3],
    /// At least the spectral norm of the inverse.
    norm: f64,
    /// At least the distance of the image of `start` from the query point.
    rest: f64,
}

impl Search {
    fn new<B>(placed: &Placed<'_, B>, point: [f64; 3]) -> Self {
        let start = mapped(&placed.inverse, point).map(|x| x.clamp(-f64::from(f32::MAX), f64::from(f32::MAX)) as f32);
        let translation = placed.columns[3];
        let shift = sub(translation, point);
        let image = linear(&placed.columns, to_f64(start));
        // Fewer than eight roundings of the terms.
        let rounding = 8.0 * f64::EPSILON * (reach(point) + reach(translation) + reach(image));
        let terms = linear(&placed.columns.map(|column| column.map(f64::abs)), to_f64(start).map(f64::abs));
        let rest = length(add(image, shift)) + 4.0 * rounding + 8.0 * f64::EPSILON * length(terms);
        Self { start, shift, norm: spectral_norm(&placed.inverse) * (1.0 + 1.0 / f64::from(1 << 20)), rest }
    }

    /// The squared distance in object space within which everything lies that is at most `limit` from the query point.
    fn bound(&self, limit: f64) -> f64 {
        let distance = self.norm * (limit + self.rest);
        // The roundings here.
        distance * distance * (1.0 + 16.0 * f64::EPSILON)
    }
}

/// The linear part of a map.
fn linear([x, y, z, _]: &Columns, v: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|k| x[k] * v[0] + y[k] * v[1] + z[k] * v[2])
}

/// An upper bound of the spectral norm of the linear part.
fn spectral_norm(rows: &Rows) -> f64 {
    let [a, b, c] = rows.map(|[x, y, z, _]| [x, y, z]);
    let columns = [0, 1, 2].map(|k| [a[k], b[k], c[k]]);
    let greatest_sum = |vectors: [[f64; 3]; 3]| {
        let rows = vectors.map(|v| {
            let [x, y, z] = vectors.map(|w| dot(v, w));
            [x, y, z, 0.0]
        });
        row_sum_norm(&rows)
    };
    greatest_sum([a, b, c]).min(greatest_sum(columns)).sqrt()
}

/// At most the distance of a point from a box, computed in `f64`.
fn distance_to(aabb: &Aabb, point: [f64; 3]) -> f64 {
    let gap = |k: usize| (f64::from(aabb.min[k]) - point[k]).max(point[k] - f64::from(aabb.max[k])).max(0.0);
    let rounding = 8.0 * f64::EPSILON * (reach(point) + f64::from(aabb.reach()));
    (length([gap(0), gap(1), gap(2)]) - rounding).max(0.0)
}

/// Triangles, by instance, then primitive. Only instances near the region are looked at.
///
/// Capsules, convex hulls and whole bodies as questions, and instances of other primitives: `canted_collide`.
impl<B: Intersect + Borrow<TriangleBvh>> Overlaps for Tlas<B> {
    type Found = InstancePrimitive;

    fn each_overlapping(&self, region: &Convex, mut visit: impl FnMut(InstancePrimitive) -> ControlFlow<()>) {
        self.each_instance_in(&region.bounds(), |id| {
            let Some(placed) = self.placed(id).filter(|placed| region.overlaps_aabb(&placed.aabb)) else {
                return ControlFlow::Continue(());
            };
            let columns = placed.columns;
            let forward: Rows = std::array::from_fn(|k| std::array::from_fn(|j| columns[j][k]));
            let (bvh, mut flow): (&TriangleBvh, _) = (placed.blas.borrow(), ControlFlow::Continue(()));
            bvh.each_overlapping(&region.transformed(&placed.inverse, &forward), |primitive| {
                flow = visit((id, primitive));
                flow
            });
            flow
        });
    }
}

/// # Overlaps
/// [`Overlaps`] has the questions about convex regions.
impl<B: Intersect + Borrow<TriangleBvh>> Tlas<B> {
    /// All triangles at most `radius` away from `center`, by instance, then primitive. Replaces the contents of `found`. Nothing is found for a negative
    /// radius.
    pub fn overlapping_sphere(&self, center: impl Into<[f64; 3]>, radius: f64, found: &mut Vec<InstancePrimitive>) {
        forms::all(found, |visit| {
            self.visit_near(center.into(), radius, &mut |near| {
                let _ = visit((near.instance, near.primitive));
                radius
            });
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of diagonal maps and rotations the norm is known.
    #[test]
    fn spectral_norms_are_tight_for_rotations_and_never_too_small() {
        let rotated = [[0.6, -0.8, 0.0, 7.0], [0.8, 0.6, 0.0, 1.0], [0.0, 0.0, 1.0, 0.0]];
        assert!((spectral_norm(&rotated) - 1.0).abs() < 1e-15);
        assert_eq!(spectral_norm(&[[3.0, 0.0, 0.0, 0.0], [0.0, -5.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]]), 5.0);
        let shear = [[1.0, 2.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
        // The greatest singular value of a shear by 2: 1 + √2.
        assert!(spectral_norm(&shear) >= 1.0 + 2.0_f64.sqrt());
    }
}
