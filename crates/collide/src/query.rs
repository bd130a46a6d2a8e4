//! Overlaps, touching pairs and distances of two bodies.

use std::ops::ControlFlow;

use canted_obb::PrimId;
use canted_obb::vector::{Vector, normalized, sub};
use canted_trace::forms;

use crate::body::Body;
use crate::closest::{Closest, closest_points, touch};
use crate::pose::Pose;
use crate::walk::Bodies;

/// A primitive of each body.
pub type PrimitivePair = [PrimId; 2];

/// The nearest points of two bodies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Distance {
    /// Distance; 0 where the bodies touch.
    pub distance: f64,
    /// A point of each body at that distance, in the space of the query. Where the bodies touch, both are one point that they share, up to
    /// rounding.
    pub points: [[f64; 3]; 2],
    /// The primitives that the points are on.
    pub primitives: PrimitivePair,
}

/// Whether two bodies share a point; touching counts.
///
/// The answer is that of a loop over all pairs of primitives; see [`pairs`] for what is exact.
#[must_use]
pub fn overlaps<A: Body, B: Body>(a: &A, a_pose: impl Into<Pose>, b: &B, b_pose: impl Into<Pose>) -> bool {
    forms::is_any(|visit| each_pair(a, a_pose, b, b_pose, visit))
}

/// All pairs of primitives that share a point, touching included, in ascending order. Replaces the contents of `found`.
///
/// Pairs of triangles, segments and points are exact for vertices as [`Pose`] maps them: none is lost and none invented, of degenerate triangles and of
/// those in one plane too. A triangle without area is the segment between its outer vertices. Other shapes are compared by their distance in `f64`: no pair is lost, and a gap below 2^-40 of the coordinates may count as
/// touching.
///
/// ```
/// use canted_collide::{Pose, pairs};
/// use canted_wide::TriangleBvh;
///
/// let a = TriangleBvh::build(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], &[[0, 1, 2]])?;
/// let b = TriangleBvh::build(&[[0.2, 0.2, -1.0], [0.2, 0.2, 1.0], [3.0, 3.0, 0.0]], &[[0, 1, 2]])?;
/// let mut found = vec![];
/// pairs(&a, Pose::IDENTITY, &b, Pose::IDENTITY, &mut found);
/// assert_eq!(found.len(), 1);
/// pairs(&a, Pose::IDENTITY, &b, Pose::translation([0.0, 0.0, 1.5]), &mut found);
/// assert!(found.is_empty());
/// # Ok::<(), canted_lbvh::GeometryError>(())
/// ```
pub fn pairs<A: Body, B: Body>(
    a: &A,
    a_pose: impl Into<Pose>,
    b: &B,
    b_pose: impl Into<Pose>,
    found: &mut Vec<PrimitivePair>,
) {
    forms::all(found, |visit| each_pair(a, a_pose, b, b_pose, visit));
}

/// Calls `visit` with all pairs of primitives that share a point, in any order, until it breaks. A pair may come twice.
pub fn each_pair<A: Body, B: Body>(
    a: &A,
    a_pose: impl Into<Pose>,
    b: &B,
    b_pose: impl Into<Pose>,
    mut visit: impl FnMut(PrimitivePair) -> ControlFlow<()>,
) {
    let bodies = Bodies { a: (a, a_pose.into()), b: (b, b_pose.into()) };
    bodies.walk(0.0, false, |a, b, limit| {
        for one in a.shapes() {
            for other in b.shapes() {
                if one.is_near(other, 0.0) && touch(one, other) && visit([one.primitive, other.primitive]).is_break() {
                    return -1.0;
                }
            }
        }
        limit
    });
}

/// The lowest pair of primitives that share a point, as [`pairs`] lists them.
#[must_use]
pub fn first_pair<A: Body, B: Body>(
    a: &A,
    a_pose: impl Into<Pose>,
    b: &B,
    b_pose: impl Into<Pose>,
) -> Option<PrimitivePair> {
    forms::first(|visit| each_pair(a, a_pose, b, b_pose, visit))
}

/// How many pairs of primitives share a point, each counted once.
#[must_use]
pub fn count_pairs<A: Body, B: Body>(a: &A, a_pose: impl Into<Pose>, b: &B, b_pose: impl Into<Pose>) -> usize {
    forms::count(|visit| each_pair(a, a_pose, b, b_pose, visit))
}

/// All pairs of primitives at most `tolerance` apart, in ascending order. Replaces the contents of `found`.
///
/// Distances are those of [`distance`]. Nothing is found for a negative tolerance.
pub fn pairs_within<A: Body, B: Body>(
    a: &A,
    a_pose: impl Into<Pose>,
    b: &B,
    b_pose: impl Into<Pose>,
    tolerance: f64,
    found: &mut Vec<PrimitivePair>,
) {
    found.clear();
    let bodies = Bodies { a: (a, a_pose.into()), b: (b, b_pose.into()) };
    each_closest(&bodies, tolerance, |closest| {
        found.push(closest.primitives);
        tolerance
    });
    found.sort_unstable();
    found.dedup();
}

/// The nearest points of two bodies at most `max_distance` apart; `None` if there are none. Ties go to the lowest pair.
///
/// Whether bodies touch is decided as by [`overlaps`]; the distance is 0 then, and only then. Other distances and points are computed in `f64`, with errors below
/// 2^-46 of the coordinates; between edges and faces of triangles that are thinner than 2^-24 of their length below 2^-26 of it.
#[must_use]
pub fn distance<A: Body, B: Body>(
    a: &A,
    a_pose: impl Into<Pose>,
    b: &B,
    b_pose: impl Into<Pose>,
    max_distance: f64,
) -> Option<Distance> {
    let mut nearest = vec![];
    closest_pairs(a, a_pose, b, b_pose, 1, max_distance, &mut nearest);
    nearest.pop()
}

/// The `k` pairs of primitives with the least distances, of those at most `max_distance` apart, nearest first; ties go to the lowest pair.
/// Replaces the contents of `nearest`. Distances are those of [`distance`].
pub fn closest_pairs<A: Body, B: Body>(
    a: &A,
    a_pose: impl Into<Pose>,
    b: &B,
    b_pose: impl Into<Pose>,
    k: usize,
    max_distance: f64,
    nearest: &mut Vec<Distance>,
) {
    nearest.clear();
    if k == 0 {
        return;
    }
    let bodies = Bodies { a: (a, a_pose.into()), b: (b, b_pose.into()) };
    each_closest(&bodies, max_distance, |found| {
        let order = |one: &Distance| (one.distance, one.primitives);
        let place = nearest.partition_point(|other| order(other) < order(&found));
        // Found again through a second reference.
        if nearest.get(place).is_none_or(|other| order(other) != order(&found)) {
            nearest.insert(place, found);
            nearest.truncate(k);
        }
        if nearest.len() < k { max_distance } else { nearest[k - 1].distance }
    });
}

/// Calls `visit` with the nearest points of each pair of primitives at most `limit` apart; it returns the new limit.
fn each_closest<A: Body, B: Body>(bodies: &Bodies<'_, A, B>, limit: f64, mut visit: impl FnMut(Distance) -> f64) {
    if limit.is_nan() || limit < 0.0 {
        return;
    }
    // Bodies that are apart are so along much the same axis wherever they are near.
    let mut axis = [0.0; 3];
    bodies.walk(limit, true, |a, b, mut limit| {
        for one in a.shapes() {
            for other in b.shapes() {
                if one.is_near(other, limit) && one.is_near_along(other, axis, limit) {
                    let Closest { distance, points } = closest_points(one, other);
                    if distance <= limit {
                        axis = normalized(sub(points[1], points[0])).unwrap_or(axis);
                        limit = visit(Distance { distance, points, primitives: [one.primitive, other.primitive] });
                    }
                }
            }
        }
        limit
    });
}

/// All pairs of primitives of one body that share a point, the lower primitive first, in ascending order. Replaces the contents of `found`.
///
/// Primitives are adjacent, and not reported, if one or two of their points are equal: neighbors in a mesh, and fans around a vertex, whether or not they
/// have indices in common. Two primitives with the same points coincide and are reported. A triangle without area has the ends of
/// its longest edge for points. All else is as for [`pairs`], without a pose.
pub fn self_intersections<A: Body>(body: &A, found: &mut Vec<PrimitivePair>) {
    found.clear();
    let bodies = Bodies { a: (body, Pose::IDENTITY), b: (body, Pose::IDENTITY) };
    bodies.walk(0.0, false, |a, b, limit| {
        for one in a.shapes() {
            for other in b.shapes() {
                let is_candidate = one.primitive < other.primitive && one.is_near(other, 0.0);
                if is_candidate && !are_adjacent(&one.points, &other.points) && touch(one, other) {
                    found.push([one.primitive, other.primitive]);
                }
            }
        }
        limit
    });
    found.sort_unstable();
    found.dedup();
}

/// Whether some points of two shapes are equal, but not all.
fn are_adjacent(a: &[Vector], b: &[Vector]) -> bool {
    let has = |points: &[Vector], p: Vector| points.contains(&p);
    let is_any_shared = a.iter().any(|&p| has(b, p));
    is_any_shared && !(a.iter().all(|&p| has(b, p)) && b.iter().all(|&p| has(a, p)))
}
