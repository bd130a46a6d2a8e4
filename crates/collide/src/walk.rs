//! A walk over the nodes of two bodies at once.

use canted_obb::PrimId;
use canted_obb::vector::{Vector, add, dot, reach};
use canted_wide::NodeBox;

use crate::body::Body;
use crate::boxes::{Frame, times};
use crate::pose::Pose;

/// Roundings of distances and radii, relative to coordinates: far more than their error.
const ROUNDING: f64 = 1024.0 * f64::EPSILON;

/// A shape in the space of a query.
#[derive(Clone, Debug)]
pub(crate) struct PlacedShape {
    pub(crate) primitive: PrimId,
    pub(crate) points: Vec<Vector>,
    pub(crate) radius: f64,
    lo: Vector,
    hi: Vector,
}

impl PlacedShape {
    /// Whether the shapes may be at most `distance` apart, by their boxes.
    #[inline]
    pub(crate) fn is_near(&self, other: &Self, distance: f64) -> bool {
        let gaps = [0, 1, 2].map(|k| {
            let slack = ROUNDING * (self.lo[k].abs() + self.hi[k].abs() + other.lo[k].abs() + other.hi[k].abs());
            ((self.lo[k] - other.hi[k]).max(other.lo[k] - self.hi[k]) - slack).max(0.0)
        });
        // Squares are off by a few roundings, and by less than the smallest normal number where they underflow.
        dot(gaps, gaps) <= distance * distance * (1.0 + 16.0 * f64::EPSILON) + f64::MIN_POSITIVE
    }

    /// Whether the shapes may be at most `distance` apart, by their ends along an axis of unit length.
    #[inline]
    pub(crate) fn is_near_along(&self, other: &Self, axis: Vector, distance: f64) -> bool {
        let ends = |shape: &Self| {
            shape.points.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[least, most], &point| {
                let at = dot(point, axis);
                [if at < least { at } else { least }, if at > most { at } else { most }]
            })
        };
        let ([a, a_end], [b, b_end]) = (ends(self), ends(other));
        let coordinates = |shape: &Self| reach(shape.lo) + reach(shape.hi);
        let slack = ROUNDING * (coordinates(self) + coordinates(other));
        let gap = (b - a_end).max(a - b_end) - (self.radius + other.radius);
        gap.is_nan() || gap <= distance * (1.0 + 16.0 * f64::EPSILON) + slack
    }
}

impl PlacedShape {
    /// The shape moved by a vector.
    pub(crate) fn move_by(&mut self, by: Vector) {
        for point in self.points.iter_mut().chain([&mut self.lo, &mut self.hi]) {
            *point = add(*point, by);
        }
    }

    /// When this shape and another one that moves by `t·motion` may share a point, by their boxes, as
    /// [`PlacedBox::meeting`](crate::boxes::PlacedBox::meeting).
    pub(crate) fn meeting(&self, other: &Self, motion: Vector, slack: f64) -> [f64; 2] {
        (0..3).fold([f64::NEG_INFINITY, f64::INFINITY], |[from, to], k| {
            // The other one is reached when its ends pass these.
            let own = times(self.lo[k] - other.hi[k] - slack, self.hi[k] - other.lo[k] + slack, motion[k]);
            [from.max(own[0]), to.min(own[1])]
        })
    }
}

/// The shapes of a leaf, in memory that is used again.
#[derive(Default)]
pub(crate) struct PlacedLeaf {
    shapes: Vec<PlacedShape>,
    n: usize,
}

impl PlacedLeaf {
    pub(crate) fn shapes(&self) -> &[PlacedShape] {
        &self.shapes[..self.n]
    }

    pub(crate) fn fill<B: Body>(&mut self, body: &B, leaf: B::Node, pose: &Pose) {
        self.n = 0;
        body.each_shape(leaf, |primitive, shape| {
            if self.n == self.shapes.len() {
                let (points, zero) = (Vec::new(), [0.0; 3]);
                self.shapes.push(PlacedShape { primitive, points, radius: 0.0, lo: zero, hi: zero });
            }
            let placed = &mut self.shapes[self.n];
            placed.points.clear();
            shape.each_point(&mut |point| placed.points.push(pose.point(point)));
            let (mut lo, mut hi) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
            for point in &placed.points {
                lo = std::array::from_fn(|k| if point[k] < lo[k] { point[k] } else { lo[k] });
                hi = std::array::from_fn(|k| if point[k] > hi[k] { point[k] } else { hi[k] });
            }
            let radius = shape.radius() * pose.least_stretch();
            (placed.primitive, placed.radius) = (primitive, radius);
            (placed.lo, placed.hi) = (lo.map(|x| x - radius), hi.map(|x| x + radius));
            self.n += 1;
        });
    }
}

/// Whether what is at least `gap` apart may be within the limit; a gap that is NaN says nothing.
#[inline]
fn is_within(gap: f32, limit: f64) -> bool {
    gap.is_nan() || f64::from(gap) <= limit
}

/// A node of each body.
struct Pair<M, N> {
    a: (M, NodeBox),
    b: (N, NodeBox),
    gap: f32,
}

/// Two bodies under their poses.
pub(crate) struct Bodies<'a, A, B> {
    pub(crate) a: (&'a A, Pose),
    pub(crate) b: (&'a B, Pose),
}

impl<A: Body, B: Body> Bodies<'_, A, B> {
    /// Calls `visit` with the leaves of both bodies that may be at most `limit` apart, and with the limit; it returns the new one. A negative one
    /// ends the walk. Where `is_ordered`, nearer pairs of each node come first.
    pub(crate) fn walk(
        &self,
        mut limit: f64,
        is_ordered: bool,
        mut visit: impl FnMut(&PlacedLeaf, &PlacedLeaf, f64) -> f64,
    ) {
        let ((a, a_pose), (b, b_pose)) = (&self.a, &self.b);
        if !(a_pose.is_usable() && b_pose.is_usable()) {
            return;
        }
        let (Some(a_root), Some(b_root)) = (a.root(), b.root()) else { return };
        let origin = a_pose.point_f64(a.reference_point());
        let a_frame = Frame::new(*a, &a_root.1, a_pose, origin);
        let b_frame = Frame::new(*b, &b_root.1, b_pose, origin);
        let (mut a_leaf, mut b_leaf) = (PlacedLeaf::default(), PlacedLeaf::default());
        let (mut a_filled, mut b_filled) = (None, None);
        let mut waiting = vec![Pair { a: a_root, b: b_root, gap: f32::NEG_INFINITY }];
        while let Some(pair) = waiting.pop() {
            if !is_within(pair.gap, limit) {
                continue;
            }
            let (a_lanes, b_lanes) = (a.lanes(pair.a.0), b.lanes(pair.b.0));
            let base = waiting.len();
            match (a_lanes, b_lanes) {
                (None, None) => {
                    if a_filled != Some(pair.a.0) {
                        a_leaf.fill(*a, pair.a.0, a_pose);
                        a_filled = Some(pair.a.0);
                    }
                    if b_filled != Some(pair.b.0) {
                        b_leaf.fill(*b, pair.b.0, b_pose);
                        b_filled = Some(pair.b.0);
                    }
                    limit = visit(&a_leaf, &b_leaf, limit);
                    if limit < 0.0 {
                        return;
                    }
                }
                (Some(lanes), other) if other.is_none() || a_frame.size_of(&pair.a.1) >= b_frame.size_of(&pair.b.1) => {
                    let gaps = a_frame.gaps(&b_frame.placed(&pair.b.1), &b_frame, lanes, a.frame());
                    for (lane, gap) in gaps.into_iter().enumerate() {
                        if is_within(gap, limit)
                            && let Some(child) = a.child(pair.a.0, lane)
                        {
                            waiting.push(Pair { a: child, b: pair.b, gap });
                        }
                    }
                }
                (_, Some(lanes)) => {
                    let gaps = b_frame.gaps(&a_frame.placed(&pair.a.1), &a_frame, lanes, b.frame());
                    for (lane, gap) in gaps.into_iter().enumerate() {
                        if is_within(gap, limit)
                            && let Some(child) = b.child(pair.b.0, lane)
                        {
                            waiting.push(Pair { a: pair.a, b: child, gap });
                        }
                    }
                }
                (Some(_), None) => unreachable!("the first body's node is opened where the second has a leaf"),
            }
            if is_ordered {
                waiting[base..].sort_by(|one, other| other.gap.total_cmp(&one.gap));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use canted_obb::vector::{normalized, sub};

    use super::*;
    use crate::closest::closest_points;

    /// A point of the cube from -1 to 1.
    fn point(state: &mut u64) -> Vector {
        std::array::from_fn(|_| {
            *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (*state >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
        })
    }

    fn triangle(state: &mut u64, [size, at]: [f64; 2]) -> PlacedShape {
        let points: Vec<Vector> = (0..3).map(|_| point(state).map(|x| at + size * x)).collect();
        let end = |of: fn(f64, f64) -> f64| [0, 1, 2].map(|k| of(of(points[0][k], points[1][k]), points[2][k]));
        PlacedShape { primitive: PrimId(0), lo: end(f64::min), hi: end(f64::max), points, radius: 0.0 }
    }

    /// At the distance itself, so that a bound without its roundings skips some.
    #[test]
    fn nothing_within_the_distance_is_skipped() {
        let mut state = 4;
        let (mut n_skipped, mut n_lost) = (0, 0);
        for round in 0..20_000 {
            let [size, at] = [[1.0, 0.0], [1e-3, 0.0], [1.0, 1e7], [1e6, 0.0]][round % 4];
            let (a, b) = (triangle(&mut state, [size, at]), triangle(&mut state, [size, at + 2.5 * size]));
            let near = closest_points(&a, &b);
            let random = normalized(point(&mut state)).unwrap_or([1.0, 0.0, 0.0]);
            let axis = normalized(sub(near.points[1], near.points[0])).unwrap_or(random);
            assert!(a.is_near(&b, near.distance), "round {round}");
            assert!([axis, random].iter().all(|&axis| a.is_near_along(&b, axis, near.distance)), "round {round}");
            n_skipped += usize::from(!a.is_near_along(&b, axis, 0.99 * near.distance));
            // The same without what roundings may add.
            let gap = b.points.iter().map(|&p| dot(p, axis)).fold(f64::INFINITY, f64::min)
                - a.points.iter().map(|&p| dot(p, axis)).fold(f64::NEG_INFINITY, f64::max);
            n_lost += usize::from(gap > near.distance);
        }
        assert!(n_skipped > 15_000 && n_lost > 100, "{n_skipped} skipped, {n_lost} lost without the bound");
    }
}
