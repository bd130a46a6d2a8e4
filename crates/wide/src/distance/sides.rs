//! Which points are on the same side of a closed mesh.
//!
//! A surface without boundary divides space: a point stays inside, or outside, wherever it moves without meeting the surface. So points
//! in a ball around another one that holds no surface are where that one is. Of a grid most points are, and are not asked where they are.
//!
//! Distances are rounded; a margin covers that.

use canted_obb::vector::{length, reach, sub, to_f64};

use super::NearestPoint;
use crate::bvh::TriangleBvh;

/// By how much a computed distance may exceed the least one, relative to the coordinates. Edges and distances are at most 2√3 of these; 2^-26 of the longest edge is
/// the error of the closest point ([`canted_trace::closest_point_on_triangle`]), 2^-24 of the distance that of `f32`: less than 2^-21 in all, doubled.
const MARGIN: f64 = 1.0 / (1 << 20) as f64;

/// More than the rounding of a distance that is no normal number.
const LEAST: f64 = f32::MIN_POSITIVE as f64;

/// A point, how far the surface is, and which of the points that were asked for is on its side.
#[derive(Clone, Copy)]
struct Known {
    point: [f64; 3],
    distance: f64,
    asked: usize,
}

/// Points whose place must be asked for, and of each point which of these is on its side of the surface.
pub(super) struct Sides {
    pub(super) asked: Vec<[f32; 3]>,
    pub(super) of: Vec<usize>,
}

impl Sides {
    /// Of points whose nearest triangles are known. Without `is_closed` every point is asked for.
    pub(super) fn new(
        bvh: &TriangleBvh,
        points: &[[f32; 3]],
        nearest: &[Option<NearestPoint>],
        is_closed: bool,
    ) -> Self {
        let mut sides = Self { asked: vec![], of: Vec::with_capacity(points.len()) };
        if !is_closed {
            (sides.asked, sides.of) = (points.to_vec(), (0..points.len()).collect());
            return sides;
        }
        let extent = f64::from(bvh.aabb().reach());
        // The point before, and the one with the widest ball.
        let mut known: [Option<Known>; 2] = [None; 2];
        for (&point, nearest) in points.iter().zip(nearest) {
            let given = point;
            let (point, distance) =
                (to_f64(point), nearest.map_or(f64::INFINITY, |nearest| f64::from(nearest.distance)));
            let is_beside = |other: &Known| {
                let margin = MARGIN * (extent.max(reach(point)).max(reach(other.point))) + LEAST;
                // An infinite distance is one that `f32` does not hold. False for what is not a number.
                let distance = distance.max(other.distance);
                distance.is_finite() && length(sub(point, other.point)) + margin < distance
            };
            let asked = known.into_iter().flatten().find(is_beside).map_or_else(
                || {
                    sides.asked.push(given);
                    sides.asked.len() - 1
                },
                |other| other.asked,
            );
            sides.of.push(asked);
            let own = Known { point, distance, asked };
            let is_widest = known[1].is_none_or(|widest| widest.distance < distance);
            known = [Some(own), if is_widest { Some(own) } else { known[1] }];
        }
        sides
    }
}

#[cfg(test)]
mod tests {
    use canted_fixtures as fixtures;

    use super::*;

    /// Sides are taken over from points whose balls hold no surface, and from no others.
    #[test]
    fn points_are_asked_for_unless_a_ball_says_where_they_are() {
        let mesh = fixtures::icosphere(3);
        let bvh = TriangleBvh::build(&mesh.positions, &mesh.triangles).unwrap();
        let points: Vec<[f32; 3]> = (0..=64).map(|i| [i as f32 / 16.0 - 2.0, 0.01, 0.02]).collect();
        let mut nearest = vec![None; points.len()];
        bvh.nearest_point_many(&points, f32::INFINITY, &mut nearest);
        let sides = Sides::new(&bvh, &points, &nearest, true);
        // One outside, one inside, one outside again, and those next to the surface.
        assert!((3..=7).contains(&sides.asked.len()), "{}", sides.asked.len());
        for (&point, &side) in points.iter().zip(&sides.of) {
            assert_eq!(bvh.contains(point), bvh.contains(sides.asked[side]), "{point:?}");
        }
        let all = Sides::new(&bvh, &points, &nearest, false);
        assert_eq!((all.asked, all.of), (points.clone(), (0..points.len()).collect()));
        // Distances that are too great take over what is wrong, which the comparison above would notice.
        nearest.iter_mut().flatten().for_each(|nearest| nearest.distance += 0.2);
        let wrong = Sides::new(&bvh, &points, &nearest, true);
        assert!(
            points.iter().zip(&wrong.of).any(|(&point, &side)| bvh.contains(point) != bvh.contains(wrong.asked[side]))
        );
    }
}
