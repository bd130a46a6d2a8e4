//! Nearest and k nearest primitives.

use canted_obb::PrimId;
use canted_obb::vector::{length, reach, sub, to_f64};
use canted_trace::with_stack;

use super::{ClosestPoint, DistanceShape, PointLanes};
use crate::bvh::WideBvh;
use crate::leaf::{LeafPrimitive, each_near};
use crate::node::{
    ALIGNED_LINES, ChildWord, DecodedWord, HalfBlock, NodeKind, Nodes, ORIENTED_LINES, node_words, rows,
};
use crate::par;
use crate::simd::{Simd, Task};
use crate::traverse::{LeafRange, MeshFrame};

/// Points of one parallel job.
const CHUNK: usize = 1 << 8;

/// What roundings mostly add to a sum of two distances at most, relative to the coordinates, and to its square. Where a triangle is much larger they may add more:
/// then nothing is found within the sum, and the search starts again without it.
const STEP_ERROR: f64 = 64.0 * f64::EPSILON;

/// A primitive near a query point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NearestPoint {
    /// Distance between the query point and `position`.
    pub distance: f32,
    /// The closest point of the primitive, in object space.
    pub position: [f32; 3],
    /// The primitive.
    pub primitive: PrimId,
}

/// A primitive that was found: squared distance, number, closest point.
pub type Found = (f64, PrimId, [f64; 3]);

impl From<Found> for NearestPoint {
    fn from((distance_squared, primitive, position): Found) -> Self {
        Self { distance: distance_squared.sqrt() as f32, position: position.map(|x| x as f32), primitive }
    }
}

/// The `k` nearest primitives, in order: least distance, then lowest primitive.
#[derive(Clone, Debug)]
pub struct NearestList {
    found: Vec<Found>,
    k: usize,
    limit: f64,
}

impl NearestList {
    /// Of `k` primitives, one at least, whose squared distance is at most `limit`.
    #[must_use]
    pub fn new(k: usize, limit: f64) -> Self {
        Self { found: vec![], k, limit }
    }

    /// The primitives so far.
    #[must_use]
    pub fn found(&self) -> &[Found] {
        &self.found
    }

    /// Squared distance beyond which nothing is searched for.
    #[must_use]
    pub fn bound(&self) -> f64 {
        if self.found.len() < self.k { self.limit } else { self.found[self.k - 1].0 }
    }

    /// Takes a primitive; it may come twice.
    pub fn take(&mut self, found: Found) {
        if found.0.is_nan() || found.0 > self.bound() {
            return;
        }
        let order = |entry: &Found| entry.0.total_cmp(&found.0).then(entry.1.cmp(&found.1));
        // `Ok`: found again through a second reference.
        if let Err(index) = self.found.binary_search_by(order) {
            self.found.insert(index, found);
            self.found.truncate(self.k);
        }
    }
}

/// The square of a distance, exactly; `None` for a distance below zero or not a number.
pub(super) fn squared(distance: f32) -> Option<f64> {
    (distance >= 0.0).then(|| f64::from(distance) * f64::from(distance))
}

impl<P: LeafPrimitive> WideBvh<P>
where
    P::Shape: DistanceShape,
{
    /// The primitive closest to `point` among those at most `max_distance` away; ties go to the lowest primitive.
    ///
    /// The answer is that of a loop over all primitives, to the bit.
    #[must_use]
    pub fn nearest_point(&self, point: impl Into<[f32; 3]>, max_distance: f32) -> Option<NearestPoint> {
        let mut nearest = vec![];
        self.nearest_points(point, 1, max_distance, &mut nearest);
        nearest.pop()
    }

    /// The `k` primitives closest to `point` among those at most `max_distance` away, nearest first; ties go to the lowest
    /// primitive.
    ///
    /// Replaces the contents of `nearest`.
    #[doc(alias = "k_nearest")]
    #[doc(alias = "knn")]
    pub fn nearest_points(
        &self,
        point: impl Into<[f32; 3]>,
        k: usize,
        max_distance: f32,
        nearest: &mut Vec<NearestPoint>,
    ) {
        nearest.clear();
        let Some(limit) = squared(max_distance).filter(|_| k > 0) else { return };
        let mut collector = NearestList::new(k, limit);
        self.collect_near(point.into(), limit, |found| {
            collector.take(found);
            collector.bound()
        });
        nearest.extend(collector.found.into_iter().map(NearestPoint::from));
    }

    /// The nearest primitive of each point; see [`WideBvh::nearest_point`]. Points near their predecessors, as those of grids, take less time: the search
    /// starts with what the predecessor found.
    ///
    /// # Panics
    /// Where the slices differ in length.
    pub fn nearest_point_many(&self, points: &[[f32; 3]], max_distance: f32, nearest: &mut [Option<NearestPoint>]) {
        assert_eq!(points.len(), nearest.len(), "one answer for each point");
        nearest.fill(None);
        let Some(limit) = squared(max_distance) else { return };
        let mut last: Option<([f32; 3], f64)> = None;
        for (&point, nearest) in points.iter().zip(nearest) {
            // What is nearest to the predecessor is no farther away than that and the step.
            let within = last.map_or(limit, |(other, distance)| {
                let (other, point) = (to_f64(other), to_f64(point));
                let sum =
                    length(sub(point, other)) + distance + STEP_ERROR * (reach(point).max(reach(other)) + distance);
                limit.min(sum * sum * (1.0 + STEP_ERROR))
            });
            let search = |limit: f64| {
                let mut collector = NearestList::new(1, limit);
                self.collect_near(point, limit, |found| {
                    collector.take(found);
                    collector.bound()
                });
                collector.found.pop()
            };
            // What is found within a bound is the nearest.
            let found = search(within).or_else(|| if within < limit { search(limit) } else { None });
            last = found.map(|found| (point, found.0.sqrt()));
            *nearest = found.map(NearestPoint::from);
        }
    }

    /// [`WideBvh::nearest_point_many`] on all threads.
    pub fn par_nearest_point_many(&self, points: &[[f32; 3]], max_distance: f32, nearest: &mut [Option<NearestPoint>]) {
        assert_eq!(points.len(), nearest.len(), "one answer for each point");
        par::for_chunks(nearest, CHUNK, |first, nearest| {
            self.nearest_point_many(&points[first..first + nearest.len()], max_distance, nearest);
        });
    }

    /// Calls `take` with every primitive that may be nearer than a bound, a squared distance; it returns the new bound.
    fn collect_near(&self, point: [f32; 3], bound: f64, mut take: impl FnMut(Found) -> f64) {
        self.visit_near(point, bound, |primitive, shape, _| {
            let ClosestPoint { distance_squared, position } = shape.closest_point(point);
            take((distance_squared, primitive, position))
        });
    }
}

impl<P: LeafPrimitive> WideBvh<P> {
    /// Calls `visit` with every primitive that may be nearer to `point` than a bound, a squared distance, and with the bound; it returns the
    /// new one. Nearer nodes come first; a primitive may come twice. Nothing is near a point that is not finite.
    pub fn visit_near(&self, point: [f32; 3], bound: f64, mut visit: impl FnMut(PrimId, &P::Shape, f64) -> f64) {
        self.leaves_near(point, bound, &mut |leaf, place, bound| {
            P::with_shape(&self.leaves, leaf, place, |primitive, shape| visit(primitive, shape, bound))
        });
    }

    /// The same with the leaf and the place there of each primitive.
    pub(crate) fn leaves_near(&self, point: [f32; 3], bound: f64, leaf: &mut dyn FnMut(LeafRange, u32, f64) -> f64) {
        let (path, nodes, frame) = (self.path, &self.nodes, &self.frame);
        if point.iter().all(|x| x.is_finite()) {
            with_stack(nodes.stack_len(), |stack| {
                let blocks = P::leaf_data(&self.leaves).blocks;
                // An empty slice need not be aligned.
                let halves: &[HalfBlock] = if blocks.is_empty() { &[] } else { bytemuck::cast_slice(blocks) };
                path.run(Search { nodes, frame, halves, stack, point, bound, leaf });
            });
        }
    }
}

/// What lower bounds of squared distances must not exceed so that nothing at most `bound` away is lost.
///
/// Where numbers are not normal, the three squares, their scale and the quotient of a lower bound are rounded by half the least number each, and
/// the sum of the squares is exact: less than four least numbers in all.
fn limit_of(bound: f64) -> f32 {
    /// The least number greater than zero.
    const LEAST: f32 = f32::from_bits(1);
    (bound as f32).next_up() + 4.0 * LEAST
}

/// Visits primitives that may be nearer than a bound. `leaf` gets one by its leaf and its place there, and the bound, and returns the new one.
struct Search<'a> {
    nodes: &'a Nodes,
    frame: &'a MeshFrame,
    /// The triangles; none for other primitives, all of which may be near.
    halves: &'a [HalfBlock],
    stack: &'a mut [u64],
    point: [f32; 3],
    bound: f64,
    leaf: &'a mut dyn FnMut(LeafRange, u32, f64) -> f64,
}

impl Task for Search<'_> {
    type Output = ();

    #[inline(always)]
    fn on<S: Simd>(self, simd: S) {
        let Self { nodes, frame, halves, stack, point, mut bound, leaf } = self;
        let lanes = PointLanes::new(simd, point, frame);
        let [x, y, z] = point;
        let given = [simd.splat(x), simd.splat(y), simd.splat(z)];
        let (mut n_waiting, mut limit) = (0, limit_of(bound));
        let mut word = nodes.root;
        loop {
            match word.kind() {
                DecodedWord::Leaf { first, n } => {
                    let range = LeafRange::new(first, n);
                    if halves.is_empty() {
                        (0..n).for_each(|place| bound = leaf(range, place, bound));
                    } else {
                        each_near(simd, halves, range, given, limit, &mut |place| {
                            bound = leaf(range, place, bound);
                            limit_of(bound)
                        });
                    }
                    limit = limit_of(bound);
                }
                DecodedWord::Node(kind, line) => {
                    let lines = &nodes.lines;
                    let words = node_words(lines, kind, line);
                    let bounds = match kind {
                        NodeKind::Aligned => lanes.aligned(simd, rows::<ALIGNED_LINES, 8>(lines, line)),
                        NodeKind::Oriented => lanes.oriented(simd, rows::<ORIENTED_LINES, 16>(lines, line)),
                    };
                    let mut mask = simd.le(bounds, simd.splat(limit));
                    let bounds = simd.store(bounds);
                    let base = n_waiting;
                    while mask != 0 {
                        let child = mask.trailing_zeros() as usize;
                        mask &= mask - 1;
                        if words[child] != ChildWord::EMPTY {
                            stack[n_waiting] = u64::from(bounds[child].to_bits()) << 32 | u64::from(words[child].0);
                            n_waiting += 1;
                        }
                    }
                    // The nearest child is on top.
                    stack[base..n_waiting].sort_unstable_by(|a, b| b.cmp(a));
                }
                DecodedWord::Empty => {}
            }
            loop {
                if n_waiting == 0 {
                    return;
                }
                n_waiting -= 1;
                let key = stack[n_waiting];
                if f32::from_bits((key >> 32) as u32) <= limit {
                    word = ChildWord(key as u32);
                    break;
                }
            }
        }
    }
}
