//! Whether points are inside of a closed mesh, by exact parity.
//!
//! A ray upward along z from the point crosses the surface an odd number of times if the point is inside. Nothing is
//! rounded: the projected triangle contains the point by exact orientations in the plane, and lies above it by an exact
//! orientation in space. Where the point projects onto an edge or a vertex, it is moved by an infinitesimal `(ε, ε²)`, so
//! that exactly one of the triangles around counts (Edelsbrunner & Mücke 1990). Points on a triangle are found first.

use std::cmp::Ordering;

use canted_obb::{PrimId, orient_2d, orient_3d};
use canted_trace::{Ray, ScaledRay, with_stack};

use super::sides::Sides;
use crate::bvh::TriangleBvh;
use crate::leaf::{Closed, LeafPrimitive, Triangle};
use crate::node::NodeKind;
use crate::par;
use crate::simd::{Simd, Task};
use crate::traverse::{LeafRange, Visitor, walk};

/// Points of one parallel job.
const CHUNK: usize = 1 << 8;

impl TriangleBvh {
    /// Whether `point` is inside of a closed mesh or on its surface.
    ///
    /// The answer is exact for every finite point, also where the upward ray passes through edges and vertices. Nested
    /// surfaces alternate: a hole in a solid is outside. The triangles' orientation does not matter. For a mesh that is not closed
    /// the answer is the parity of its crossings above the point.
    #[must_use]
    pub fn contains(&self, point: impl Into<[f32; 3]>) -> bool {
        let mut inside = [false];
        self.contains_many(&[point.into()], &mut inside);
        inside[0]
    }

    /// Whether each point is inside; see [`TriangleBvh::contains`](crate::TriangleBvh::contains). Panics where the slices differ in length.
    pub fn contains_many(&self, points: &[[f32; 3]], inside: &mut [bool]) {
        assert_eq!(points.len(), inside.len(), "one answer per point");
        self.each_place(points, &mut |i, place| inside[i] = place != Place::Outside);
    }

    /// Where each point is, by parity alone: for meshes whose triangles are in several BVHs, of which an odd number says
    /// [`Place::Inside`] where the point is inside of the whole.
    pub fn places(&self, points: &[[f32; 3]], places: &mut [Place]) {
        assert_eq!(points.len(), places.len(), "one answer per point");
        self.each_place(points, &mut |i, place| places[i] = place);
    }

    /// Calls `answer` with the index of each point and its place.
    fn each_place(&self, points: &[[f32; 3]], answer: &mut dyn FnMut(usize, Place)) {
        with_stack(self.nodes.stack_len(), |stack| {
            self.path.run(Containment { bvh: self, points, answer, stack });
        });
    }

    /// Whether each point is inside, on all threads.
    pub fn par_contains_many(&self, points: &[[f32; 3]], inside: &mut [bool]) {
        assert_eq!(points.len(), inside.len(), "one answer per point");
        let jobs = points.chunks(CHUNK).zip(inside.chunks_mut(CHUNK)).collect();
        par::for_jobs(jobs, |(points, inside): (&[[f32; 3]], &mut [bool])| {
            self.contains_many(points, inside);
        });
    }

    /// Distance to the surface of a closed mesh: negative inside, zero on it, infinite for an empty mesh and for an infinite point, NaN for
    /// a point with a NaN.
    ///
    /// The sign is that of [`TriangleBvh::contains`](crate::TriangleBvh::contains), the magnitude that of [`TriangleBvh::nearest_point`](crate::TriangleBvh::nearest_point), but for
    /// points exactly on a triangle, which nearest points are computed too coarsely to tell.
    #[must_use]
    pub fn signed_distance(&self, point: impl Into<[f32; 3]>) -> f32 {
        let mut distance = [0.0];
        self.signed_distance_many(&[point.into()], &mut distance);
        distance[0]
    }

    /// The signed distance of each point; see [`TriangleBvh::signed_distance`](crate::TriangleBvh::signed_distance). Points near their predecessors, as those of
    /// grids, take less time.
    ///
    /// # Panics
    /// Where the slices differ in length.
    pub fn signed_distance_many(&self, points: &[[f32; 3]], distances: &mut [f32]) {
        let is_closed = points.len() > 1 && self.closed().by_parity;
        self.signed_by(points, is_closed, distances, |asked| {
            let mut places = vec![Place::Outside; asked.len()];
            self.places(asked, &mut places);
            places
        });
    }

    /// [`TriangleBvh::signed_distance_many`](crate::TriangleBvh::signed_distance_many) on all threads.
    pub fn par_signed_distance_many(&self, points: &[[f32; 3]], distances: &mut [f32]) {
        assert_eq!(points.len(), distances.len(), "one answer per point");
        par::for_chunks(distances, CHUNK, |first, distances| {
            self.signed_distance_many(&points[first..first + distances.len()], distances);
        });
    }

    /// In which sense the mesh is closed: a pass over all triangles the first time.
    pub(super) fn closed(&self) -> Closed {
        self.leaves.closed(&self.nodes, self.n_primitives())
    }

    /// The signed distances of points. `places` answers where those are that it is asked for: of a closed mesh few, of others all.
    pub(super) fn signed_by(
        &self,
        points: &[[f32; 3]],
        is_closed: bool,
        distances: &mut [f32],
        places: impl FnOnce(&[[f32; 3]]) -> Vec<Place>,
    ) {
        assert_eq!(points.len(), distances.len(), "one answer per point");
        let mut nearest = vec![None; points.len()];
        self.nearest_point_many(points, f32::INFINITY, &mut nearest);
        let sides = Sides::new(self, points, &nearest, is_closed);
        let places = places(&sides.asked);
        for (((point, &side), nearest), distance) in points.iter().zip(&sides.of).zip(nearest).zip(distances) {
            let size = nearest.map_or(f32::INFINITY, |nearest| nearest.distance);
            *distance = match places[side] {
                _ if point.iter().any(|x| x.is_nan()) => f32::NAN,
                Place::On => 0.0,
                Place::Inside => -size,
                Place::Outside => size,
            };
        }
    }
}

/// Where a point is, relative to a mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// On a triangle.
    On,
    /// An odd number of triangles is above it.
    Inside,
    /// An even number of triangles is above it.
    Outside,
}

struct Containment<'a> {
    bvh: &'a TriangleBvh,
    points: &'a [[f32; 3]],
    answer: &'a mut dyn FnMut(usize, Place),
    stack: &'a mut [u64],
}

impl Task for Containment<'_> {
    type Output = ();

    #[inline(always)]
    fn on<S: Simd>(self, simd: S) {
        let Self { bvh, points, answer, stack } = self;
        let mut crossings = vec![];
        for (i, &point) in points.iter().enumerate() {
            let Some(ray) = ScaledRay::new(&Ray::new(point, [0.0, 0.0, 1.0])) else {
                answer(i, Place::Outside);
                continue;
            };
            let numbers = bvh.prepare(&ray).numbers;
            crossings.clear();
            let mut visit = Crossed { bvh, point, is_on_surface: false, crossings: &mut crossings };
            walk::<S, _, _, false>(simd, &bvh.nodes, &numbers, ray.t_max, stack, &mut visit);
            let is_on_surface = visit.is_on_surface;
            // A triangle with two references crosses once.
            crossings.sort_unstable();
            crossings.dedup();
            let is_inside = crossings.len() % 2 == 1;
            answer(
                i,
                if is_on_surface {
                    Place::On
                } else if is_inside {
                    Place::Inside
                } else {
                    Place::Outside
                },
            );
        }
    }
}

/// Triangles above a point.
struct Crossed<'a> {
    bvh: &'a TriangleBvh,
    point: [f32; 3],
    is_on_surface: bool,
    crossings: &'a mut Vec<PrimId>,
}

impl Visitor for Crossed<'_> {
    #[inline(always)]
    fn leaf(&mut self, leaf: LeafRange) -> f32 {
        Triangle::for_each_shape(&self.bvh.leaves, leaf, |primitive, vertices| match position(self.point, vertices) {
            Position::On => self.is_on_surface = true,
            Position::Below => self.crossings.push(primitive),
            Position::Elsewhere => {}
        });
        if self.is_on_surface { -1.0 } else { leaf.t_max }
    }

    #[inline(always)]
    fn node(&mut self, _: NodeKind) {}
}

/// Where a point is, relative to a triangle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Position {
    /// On the triangle.
    On,
    /// The moved point is below the triangle's interior.
    Below,
    Elsewhere,
}

fn position(point: [f32; 3], vertices: &[[f32; 3]; 3]) -> Position {
    if is_beyond(point, vertices, 0)
        || is_beyond(point, vertices, 1)
        || point[2] > vertices[0][2].max(vertices[1][2]).max(vertices[2][2])
    {
        return Position::Elsewhere;
    }
    let volume = orient_3d(vertices[0], vertices[1], vertices[2], point);
    if volume == Ordering::Equal && is_on(point, vertices) {
        return Position::On;
    }
    let project = |v: [f32; 3]| [v[0], v[1]];
    let [a, b, c] = vertices.map(project);
    let area = orient_2d(a, b, c);
    let p = project(point);
    if area == Ordering::Equal || [[a, b], [b, c], [c, a]].iter().any(|&[start, end]| moved(start, end, p) != area) {
        return Position::Elsewhere;
    }
    // A triangle that is counterclockwise seen from above is above the point if the volume is positive.
    if volume == area { Position::Below } else { Position::Elsewhere }
}

/// Whether a point is outside of the bounds of a triangle along an axis.
fn is_beyond(point: [f32; 3], vertices: &[[f32; 3]; 3], axis: usize) -> bool {
    let [a, b, c] = vertices.map(|vertex| vertex[axis]);
    point[axis] < a.min(b).min(c) || point[axis] > a.max(b).max(c)
}

/// Whether a point in the plane of a triangle is on it: it is within its bounds, and so are its projections along all axes.
pub(super) fn is_on(point: [f32; 3], vertices: &[[f32; 3]; 3]) -> bool {
    (0..3).all(|axis| {
        if is_beyond(point, vertices, axis) {
            return false;
        }
        let project = |v: [f32; 3]| [v[(axis + 1) % 3], v[(axis + 2) % 3]];
        let [a, b, c] = vertices.map(project);
        let sides = [[a, b], [b, c], [c, a]].map(|[start, end]| orient_2d(start, end, project(point)));
        !(sides.contains(&Ordering::Greater) && sides.contains(&Ordering::Less))
    })
}

/// Side of the directed line from `start` to `end` on which `p`, moved by `(ε, ε²)`, lies.
///
/// The moved area is `area + (start_y - end_y)·ε + (end_x - start_x)·ε²`.
fn moved(start: [f32; 2], end: [f32; 2], p: [f32; 2]) -> Ordering {
    // Adding zero makes -0.0 positive: equal numbers are equal.
    let order = |a: f32, b: f32| (a + 0.0).total_cmp(&(b + 0.0));
    orient_2d(start, end, p).then_with(|| order(start[1], end[1])).then_with(|| order(end[0], start[0]))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A point on a shared edge counts for exactly one of two triangles on different sides.
    #[test]
    fn exactly_one_neighbor_counts() {
        let points = [[0.0, 0.0], [2.0, 0.0], [1.0, 1.0], [0.0, 2.0], [-1.0, 0.5]];
        for (i, &start) in points.iter().enumerate() {
            for &end in &points[i + 1..] {
                let p = [0.5 * (start[0] + end[0]), 0.5 * (start[1] + end[1])];
                assert_eq!(moved(start, end, p), moved(end, start, p).reverse(), "{start:?} {end:?}");
                let shift = |x: [f32; 2]| [f64::from(x[0]) - 1e-5, f64::from(x[1]) - 1e-10];
                let ([a, b], [c, d], [x, y]) = (shift(start), shift(end), p.map(f64::from));
                let area = (a - x) * (d - y) - (b - y) * (c - x);
                assert_eq!(moved(start, end, p), area.total_cmp(&0.0), "{start:?} {end:?}");
            }
        }
    }

    #[test]
    fn positions_around_a_triangle() {
        let triangle = [[0.0, 0.0, 1.0], [4.0, 0.0, 1.0], [0.0, 4.0, 1.0]];
        let flipped = [triangle[0], triangle[2], triangle[1]];
        for triangle in [triangle, flipped] {
            assert_eq!(position([1.0, 1.0, 0.0], &triangle), Position::Below);
            assert_eq!(position([1.0, 1.0, 1.0], &triangle), Position::On);
            assert_eq!(position([2.0, 2.0, 1.0], &triangle), Position::On);
            assert_eq!(position([4.0, 0.0, 1.0], &triangle), Position::On);
            assert_eq!(position([1.0, 1.0, 1.0_f32.next_up()], &triangle), Position::Elsewhere);
            assert_eq!(position([3.0, 3.0, 0.0], &triangle), Position::Elsewhere);
            assert_eq!(position([5.0, 0.0, 1.0], &triangle), Position::Elsewhere);
        }
        let vertical = [[0.0, 0.0, 0.0], [0.0, 0.0, 4.0], [0.0, 4.0, 0.0]];
        assert_eq!(position([0.0, 1.0, 1.0], &vertical), Position::On);
        assert_eq!(position([0.0, 1.0, -1.0], &vertical), Position::Elsewhere);
    }
}
