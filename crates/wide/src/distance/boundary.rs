//! Whether a mesh is closed, and which points are then on the same side of it.
//!
//! A surface without boundary divides space: a point stays inside, or outside, wherever it moves without meeting the surface. So points
//! in a ball around another one that holds no surface are where that one is. Of a grid most points are, and are not asked where they are.
//!
//! Both are exact but for roundings, which a margin covers, and for the sums by which edges are compared: two different sets of edges have the same sum
//! with a probability of 2^-128.

use canted_obb::vector::{length, reach, sub, to_f64};

use super::NearestPoint;
use crate::bvh::TriangleBvh;

/// By how much a computed distance may exceed the least one, relative to the coordinates: 2^-26 of the longest edge, which is at most 2√3 of them
/// ([`canted_trace::closest_point_on_triangle`]), and as much again for the distance rounded to `f32`. Doubled twice.
const MARGIN: f64 = 1.0 / (1 << 22) as f64;

/// In which sense the edges of a mesh cancel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Closed {
    /// An even number of triangles is at each edge: the parity of crossings tells inside from outside.
    pub(crate) by_parity: bool,
    /// As many triangles run along each edge in one direction as in the other: winding numbers are whole.
    pub(crate) by_winding: bool,
}

/// Sums over the edges of a mesh. Vertices are compared by their coordinates.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct EdgeSums {
    parity: [u64; 2],
    winding: [u64; 2],
}

impl EdgeSums {
    pub(crate) fn add(&mut self, [a, b, c]: [[f32; 3]; 3]) {
        for [start, end] in [[a, b], [b, c], [c, a]].map(|edge| edge.map(bits)) {
            if start == end {
                continue;
            }
            let (sum, is_forward) = if start < end { (hash(start, end), true) } else { (hash(end, start), false) };
            for k in 0..2 {
                self.parity[k] ^= sum[k];
                let add = if is_forward { u64::wrapping_add } else { u64::wrapping_sub };
                self.winding[k] = add(self.winding[k], sum[k]);
            }
        }
    }

    pub(crate) fn closed(&self) -> Closed {
        Closed { by_parity: self.parity == [0; 2], by_winding: self.winding == [0; 2] }
    }
}

fn bits(vertex: [f32; 3]) -> [u32; 3] {
    // Adding zero makes -0.0 positive.
    vertex.map(|x| (x + 0.0).to_bits())
}

/// Two hashes of an edge, by products of 128 bits whose halves are folded together.
fn hash(start: [u32; 3], end: [u32; 3]) -> [u64; 2] {
    let word = |low: u32, high: u32| u64::from(high) << 32 | u64::from(low);
    let words = [word(start[0], start[1]), word(start[2], end[0]), word(end[1], end[2])];
    // The fractions of the square roots of 2 to 5 without 4, and of 7: odd numbers without a pattern.
    [[0x6a09_e667_f3bc_c909, 0xbb67_ae85_84ca_a73b], [0x3c6e_f372_fe94_f82b, 0xa54f_f53a_5f1d_36f1]].map(
        |[mut state, factor]| {
            for word in words {
                let product = u128::from(state ^ word) * u128::from(factor);
                state = (product as u64 ^ (product >> 64) as u64).wrapping_add(factor);
            }
            state
        },
    )
}

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
                let margin = MARGIN * (extent.max(reach(point)).max(reach(other.point)));
                // False for what is not a number, and for points that are infinitely far apart.
                length(sub(point, other.point)) + margin < distance.max(other.distance)
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
    use canted_fixtures::{self as fixtures, Mesh};

    use super::*;

    fn closed(mesh: &Mesh) -> [bool; 2] {
        let corners = |triangle: &[u32; 3]| triangle.map(|vertex| mesh.positions[vertex as usize]);
        let mut sums = EdgeSums::default();
        mesh.triangles.iter().for_each(|triangle| sums.add(corners(triangle)));
        let Closed { by_parity, by_winding } = sums.closed();
        [by_parity, by_winding]
    }

    #[test]
    fn meshes_are_closed_where_their_edges_cancel() {
        let mut mesh = fixtures::torus(12, 8);
        assert_eq!(closed(&mesh), [true; 2]);
        // One triangle that is turned over.
        mesh.triangles[5].swap(0, 1);
        assert_eq!(closed(&mesh), [true, false]);
        mesh.triangles[5].swap(0, 1);
        // Triangles without area have edges, too; those without extent have none.
        let [a, b, c] = mesh.triangles[0];
        mesh.triangles.extend([[a, a, b], [c, c, c]]);
        assert_eq!(closed(&mesh), [true; 2]);
        mesh.triangles.push([a, b, c]);
        assert_eq!(closed(&mesh), [false; 2]);
        mesh.triangles.push([a, c, b]);
        assert_eq!(closed(&mesh), [true; 2]);
        for missing in 0..mesh.triangles.len() - 4 {
            let mut open = mesh.clone();
            open.triangles.remove(missing);
            assert_eq!(closed(&open), [false; 2], "{missing}");
        }
        assert_eq!(closed(&Mesh { positions: vec![], triangles: vec![] }), [true; 2]);
    }

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
