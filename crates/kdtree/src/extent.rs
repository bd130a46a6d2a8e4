//! The extent of a triangle in a cell.
//!
//! Reads: vertices, a cell. Writes: a box.
//!
//! # What is contained
//! The *padded triangle* is all points within `p` of the triangle in each coordinate, with `p = AABB_PAD·ρ∞` and ρ∞ the greatest
//! absolute coordinate of its vertices. [`extent`] contains every point of the padded triangle in the closed cell. [`crate::traverse`]
//! says why that is what a leaf must refer to.
//!
//! # Proof
//! Let `y` be such a point and `x` the point of the triangle within `p` of it: `x` is in the cell enlarged by `p`. The triangle is
//! clipped by the six planes of the cell enlarged by `p + ε`, one after the other (Sutherland, Hodgman 1974), in `f64`. Let v = 2^-53 and
//! M = ρ∞.
//!
//! *Each computed corner is within ε of a point of the triangle, its true corner.* A vertex is its own. A crossing of the edge from `a` to
//! `b` is `a + λ·(b - a)` for a computed λ between 0 and 1; its true corner is the point that the same λ gives between the true
//! corners of `a` and `b`, which is in the triangle. Differences, product and sum add at most 5v·M, and the coordinate that is replaced by
//! that of the plane has the error of λ, three roundings of at most 2M, too: 11v·M and terms of v². After six planes that is less
//! than `72v·M`.
//!
//! *Nothing is lost.* The true corners form a convex polygon. A plane cuts off the true corners whose computed ones are beyond it, by chords
//! between crossings. What a chord cuts off is the hull of corners that are, computed, on the plane or beyond it, so all of it is beyond
//! the plane less ε: outside of the cell enlarged by `p`, or on its boundary. So `x` remains in the hull of the true corners, within ε
//! of the box of the computed ones, and `y` is within `p + ε`.
//!
//! `p + ε` is `PAD·ρ∞` with 128v for ε. The rest is for the roundings of the planes: one of at most 1.01 M where a plane meets
//! the triangle; elsewhere it clips nothing. Results are rounded outward.

use canted_lbvh::Corners;
use canted_obb::{Aabb, vector::to_f64};
use canted_trace::AABB_PAD;

/// `p + ε`, relative to ρ∞.
pub(crate) const PAD: f64 = AABB_PAD as f64 + 128.0 * (0.5 * f64::EPSILON);

/// Corners of a clipped triangle. A plane adds one at most for every second corner: 3, 4, 6, 9, 13, 19, 28.
const MAX_CORNERS: usize = 28;

/// A box that contains every point of the padded triangle in `cell`; `None` if it has none there. `pad` is [`PAD`].
pub(crate) fn extent(corners: &Corners, cell: &Aabb, pad: f64) -> Option<Aabb> {
    let pad = pad * f64::from(Aabb::from_points(*corners).reach());
    let mut polygon = Polygon::new(corners);
    for axis in 0..3 {
        polygon.clip(axis, f64::from(cell.min[axis]) - pad, 1.0);
        polygon.clip(axis, f64::from(cell.max[axis]) + pad, -1.0);
    }
    let [min, max] = polygon.bounds()?;
    let inside = Aabb {
        min: std::array::from_fn(|k| round_down(min[k] - pad).max(cell.min[k])),
        max: std::array::from_fn(|k| (-round_down(-max[k] - pad)).min(cell.max[k])),
    };
    (!inside.is_empty()).then_some(inside)
}

/// Greatest finite `f32` not above `x`.
fn round_down(x: f64) -> f32 {
    let near = x as f32;
    // Adding zero makes -0.0 positive: the two zeros are one plane.
    (if f64::from(near) > x { near.next_down() } else { near }).max(f32::MIN) + 0.0
}

/// The part of a triangle that is not clipped yet.
struct Polygon {
    corners: [[f64; 3]; MAX_CORNERS],
    n: usize,
}

impl Polygon {
    fn new(triangle: &Corners) -> Self {
        let mut corners = [[0.0; 3]; MAX_CORNERS];
        corners[..3].copy_from_slice(&triangle.map(to_f64));
        Self { corners, n: 3 }
    }

    /// Removes what is below `plane`, for a `sign` of 1, or above it, for -1.
    fn clip(&mut self, axis: usize, plane: f64, sign: f64) {
        let is_inside = |p: &[f64; 3]| sign * (p[axis] - plane) >= 0.0;
        if self.corners[..self.n].iter().all(is_inside) {
            return;
        }
        let old = std::mem::replace(self, Self { corners: [[0.0; 3]; MAX_CORNERS], n: 0 });
        for i in 0..old.n {
            let (a, b) = (&old.corners[i], &old.corners[if i + 1 < old.n { i + 1 } else { 0 }]);
            if is_inside(a) {
                self.push(*a);
            }
            if is_inside(a) != is_inside(b) {
                let along = (plane - a[axis]) / (b[axis] - a[axis]);
                let mut crossing: [f64; 3] = std::array::from_fn(|k| a[k] + along * (b[k] - a[k]));
                crossing[axis] = plane;
                self.push(crossing);
            }
        }
    }

    fn push(&mut self, corner: [f64; 3]) {
        self.corners[self.n] = corner;
        self.n += 1;
    }

    fn bounds(&self) -> Option<[[f64; 3]; 2]> {
        let corners = self.corners[..self.n].iter().copied();
        let min = corners.clone().reduce(|a, b| std::array::from_fn(|k| a[k].min(b[k])))?;
        let max = corners.reduce(|a, b| std::array::from_fn(|k| a[k].max(b[k])))?;
        Some([min, max])
    }
}

#[cfg(test)]
mod tests {
    use canted_fixtures::SplitMix64;
    use canted_obb::vector::{Vector, add, cross, dot, scale, sub};

    use super::*;

    /// The bounds of the triangle in the cell enlarged by the padding, from all points where faces and edges of one meet the other.
    fn meeting_points(corners: &Corners, cell: &Aabb, pad: f64) -> Option<[Vector; 2]> {
        let (min, max) = (to_f64(cell.min).map(|x| x - pad), to_f64(cell.max).map(|x| x + pad));
        let [a, b, c] = corners.map(to_f64);
        let mut points = vec![a, b, c];
        for (from, to) in [(a, b), (b, c), (c, a)] {
            for (k, plane) in (0..3).flat_map(|k| [(k, min[k]), (k, max[k])]) {
                let along = (plane - from[k]) / (to[k] - from[k]);
                if (0.0..=1.0).contains(&along) {
                    points.push(add(from, scale(sub(to, from), along)));
                }
            }
        }
        let normal = cross(sub(b, a), sub(c, a));
        for k in 0..3 {
            let (i, j) = ((k + 1) % 3, (k + 2) % 3);
            for corner in 0..4 {
                let mut p = [0.0; 3];
                (p[i], p[j]) = ([min[i], max[i]][corner & 1], [min[j], max[j]][corner >> 1]);
                p[k] = a[k] - (normal[i] * (p[i] - a[i]) + normal[j] * (p[j] - a[j])) / normal[k];
                let is_left = |from: Vector, to: Vector| dot(cross(sub(to, from), sub(p, from)), normal) >= 0.0;
                if is_left(a, b) && is_left(b, c) && is_left(c, a) {
                    points.push(p);
                }
            }
        }
        let slack = 1e-12;
        points.retain(|p| (0..3).all(|k| min[k] - slack <= p[k] && p[k] <= max[k] + slack));
        let fold =
            |pick: fn(f64, f64) -> f64| points.iter().copied().reduce(|p, q| std::array::from_fn(|k| pick(p[k], q[k])));
        Some([fold(f64::min)?, fold(f64::max)?])
    }

    #[test]
    fn extents_are_those_of_the_points_where_cell_and_triangle_meet() {
        let mut rng = SplitMix64::new(5);
        let mut point = || [0; 3].map(|_| rng.unit() as f32 * 2.0 - 1.0);
        let (mut n_some, mut n_smaller) = (0, 0);
        for _ in 0..20_000 {
            let (corners, cell) = ([point(), point(), point()], Aabb::from_points([point(), point()]));
            let pad = PAD * f64::from(Aabb::from_points(corners).reach());
            let found = extent(&corners, &cell, PAD);
            let Some([min, max]) = meeting_points(&corners, &cell, pad) else {
                assert!(found.is_none(), "{corners:?} is not in {cell:?}");
                continue;
            };
            let found = found.expect("the triangle is in the cell");
            n_some += 1;
            for k in 0..3 {
                // The points, padded, in the cell; 1e-12 for the oracle, one step for the result.
                let (low, high) = ((min[k] - pad).max(cell.min[k].into()), (max[k] + pad).min(cell.max[k].into()));
                assert!(f64::from(found.min[k]) <= low + 1e-12 && high - 1e-12 <= f64::from(found.max[k]));
                assert!(f64::from(found.min[k].next_up()) >= low - 1e-12, "{corners:?}, {cell:?}: {found:?}");
                assert!(f64::from(found.max[k].next_down()) <= high + 1e-12, "{corners:?}, {cell:?}: {found:?}");
                // The bounds of the triangle, cut by the cell, are larger: splits are perfect.
                let bounds = corners.map(|c| c[k]).into_iter().fold(f32::MAX, f32::min).max(cell.min[k]);
                n_smaller += usize::from(found.min[k] > bounds);
            }
        }
        assert!(n_some > 4_000 && n_smaller > 2_000, "{n_some} extents, {n_smaller} ends are inside");
    }
}
