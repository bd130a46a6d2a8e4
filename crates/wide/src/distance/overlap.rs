//! All primitives that overlap a region.

use std::ops::ControlFlow;

use canted_obb::round::{down, up};
use canted_obb::vector::{dot, to_f64};
use canted_obb::{Aabb, PrimId};
use canted_trace::{Convex, Overlaps, forms};

use super::DistanceShape;
use super::nearest::squared;
use crate::bvh::WideBvh;
use crate::leaf::LeafPrimitive;
use crate::node::{ALIGNED_LINES, ChildWord, DecodedWord, NodeBox, NodeKind, node_words, rows};
use crate::traverse::LeafRange;

/// Rounding of a box corner and its projections, relative to the coordinates: f32 rows, and sums in f64; eight u.
const CORNER_ERROR: f64 = 8.0 / 16_777_216.0;

/// Primitives, in ascending order. A solid, such as a sphere or a box, overlaps what is inside of it; a triangle has no inside.
impl<P: LeafPrimitive> Overlaps for WideBvh<P>
where
    P::Shape: DistanceShape,
{
    type Found = PrimId;

    fn each_overlapping(&self, region: &Convex, visit: impl FnMut(PrimId) -> ControlFlow<()>) {
        self.each_in(region, P::Shape::overlaps, visit);
    }
}

/// # Overlaps
/// [`Overlaps`] has the questions about convex regions; these are about shells and balls.
impl<P: LeafPrimitive> WideBvh<P>
where
    P::Shape: DistanceShape,
{
    /// All primitives whose surface overlaps a region, in ascending order: of solids those whose shell does. Replaces the contents of `primitives`.
    pub fn overlapping_surfaces(&self, region: &Convex, primitives: &mut Vec<PrimId>) {
        forms::all(primitives, |visit| self.each_in(region, P::Shape::surface_overlaps, visit));
    }

    /// All primitives at most `radius` away from `center`, in ascending order. Replaces the contents of `primitives`.
    ///
    /// A solid is 0 away from what is inside of it; [`WideBvh::nearest_points`] measures from its surface. Nothing is found for a negative radius.
    pub fn overlapping_sphere(&self, center: impl Into<[f32; 3]>, radius: f32, primitives: &mut Vec<PrimId>) {
        let center = center.into();
        forms::all(primitives, |visit| {
            let Some(limit) = squared(radius) else { return };
            self.visit_near(center, limit, |primitive, shape, limit| {
                if shape.overlaps_ball(center, radius) {
                    let _ = visit(primitive);
                }
                limit
            });
        });
    }

    /// Calls `visit` with each primitive for which a test holds, which implies that its bounds overlap the region.
    fn each_in(
        &self,
        region: &Convex,
        test: impl Fn(&P::Shape, &Convex) -> bool,
        mut visit: impl FnMut(PrimId) -> ControlFlow<()>,
    ) {
        let mut waiting = if region.magnitude().is_finite() { vec![self.nodes.root] } else { vec![] };
        let reference = to_f64(self.frame.reference.point());
        while let Some(word) = waiting.pop() {
            match word.kind() {
                DecodedWord::Empty => {}
                DecodedWord::Leaf { first, n } => {
                    let mut flow = ControlFlow::Continue(());
                    P::for_each_shape(&self.leaves, LeafRange::new(first, n), |primitive, shape| {
                        if flow.is_continue() && test(shape, region) {
                            flow = visit(primitive);
                        }
                    });
                    if flow.is_break() {
                        return;
                    }
                }
                DecodedWord::Node(kind, line) => {
                    let words = *node_words(&self.nodes.lines, kind, line);
                    for (i, word) in words.into_iter().enumerate() {
                        let slot = || NodeBox::of_slot(&self.nodes.lines, kind, line, i, self.frame.rows);
                        if word != ChildWord::EMPTY && may_overlap(region, reference, &slot()) {
                            waiting.push(word);
                        }
                    }
                }
            }
        }
    }
}

impl<P: LeafPrimitive> WideBvh<P> {
    /// Calls `visit` with each primitive whose bounds may share a point with a box, in any order, and with its shape, until it breaks. Others may come, too,
    /// and one may come twice.
    pub fn visit_in(&self, aabb: &Aabb, mut visit: impl FnMut(PrimId, &P::Shape) -> ControlFlow<()>) {
        self.leaves_in(aabb, |leaf| {
            let mut flow = ControlFlow::Continue(());
            P::for_each_shape(&self.leaves, leaf, |primitive, shape| {
                if flow.is_continue() {
                    flow = visit(primitive, shape);
                }
            });
            flow
        });
    }

    /// Calls `visit` with the leaves whose boxes may share a point with a box, until it breaks.
    pub(crate) fn leaves_in(&self, aabb: &Aabb, mut visit: impl FnMut(LeafRange) -> ControlFlow<()>) {
        let region = Convex::from_aabb(aabb.min, aabb.max);
        let reference = to_f64(self.frame.reference.point());
        let mut waiting = if region.magnitude().is_finite() { vec![self.nodes.root] } else { vec![] };
        // Rounded outward, as the boxes are; a difference of two f32 is exact in f64 but for its last bit.
        let moved = |x: f32, k: usize| f64::from(x) - reference[k];
        let least: [f32; 3] = std::array::from_fn(|k| down(moved(aabb.min[k], k).next_down()));
        let greatest: [f32; 3] = std::array::from_fn(|k| up(moved(aabb.max[k], k).next_up()));
        while let Some(word) = waiting.pop() {
            match word.kind() {
                DecodedWord::Empty => {}
                DecodedWord::Leaf { first, n } => {
                    if visit(LeafRange::new(first, n)).is_break() {
                        return;
                    }
                }
                DecodedWord::Node(kind, line) => {
                    let lines = &self.nodes.lines;
                    let may_overlap = |i: usize| {
                        may_overlap(&region, reference, &NodeBox::of_slot(lines, kind, line, i, self.frame.rows))
                    };
                    let is_met: [bool; 8] = if kind == NodeKind::Aligned && self.frame.is_identity {
                        let rows = rows::<ALIGNED_LINES, 8>(lines, line);
                        std::array::from_fn(|i| {
                            (0..3).all(|k| (rows[2 * k][i] <= greatest[k]) & (least[k] <= rows[2 * k + 1][i]))
                        })
                    } else {
                        std::array::from_fn(may_overlap)
                    };
                    let children = node_words(lines, kind, line).iter().zip(is_met);
                    waiting.extend(
                        children.filter(|&(&word, is_met)| is_met && word != ChildWord::EMPTY).map(|(&word, _)| word),
                    );
                }
            }
        }
    }
}

/// Whether a box `lo <= rows·(x - reference) <= hi` may share a point with the region.
///
/// It looks for gaps only along axes that the tests of primitives use too, with more slack: so answers do not depend on
/// the BVH. With R·Rᵀ = I + E and ‖E‖ <= 1/4 the transposed rows are the inverse up to 1.2·‖E‖; the length of a vector is at most √3
/// times its greatest component. If they share a point, no coordinate of the reference exceeds the region's magnitude and √3 times the
/// box's reach together, so [`CORNER_ERROR`] covers its projection in f64.
fn may_overlap(region: &Convex, reference: [f64; 3], &NodeBox { rows, lo, hi }: &NodeBox) -> bool {
    let rows = rows.map(to_f64);
    let reach = lo.iter().chain(&hi).fold(region.magnitude(), |most, x| most.max(x.abs()));
    let skew = 3.0 * (0..3).map(|k| deviation(rows, k)).sum::<f64>() + CORNER_ERROR;
    skew > 0.25
        || region.axes().iter().all(|&axis| {
            let length = axis.iter().map(|x| x.abs()).sum::<f64>();
            let (mut center, mut radius) = (dot(reference, axis), skew * length * reach);
            for k in 0..3 {
                let along = dot(rows[k], axis);
                center += 0.5 * (lo[k] + hi[k]) * along;
                radius += 0.5 * (hi[k] - lo[k]) * along.abs();
            }
            let [min, max] = region.interval(axis);
            min <= center + radius && max >= center - radius
        })
}

/// How far a row is from unit length and from right angles with the others.
fn deviation(rows: [[f64; 3]; 3], k: usize) -> f64 {
    (0..3).map(|i| (dot(rows[k], rows[i]) - if i == k { 1.0 } else { 0.0 }).abs()).sum()
}
