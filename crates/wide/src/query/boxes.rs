//! Traversals that call a function for each primitive of the leaves that a ray enters.

use std::ops::ControlFlow;

use canted_obb::{Aabb, PrimId};
use canted_trace::{Ray, ReferencePoint, ScaledRay, with_stack};

use super::sink::Visits;
use crate::bvh::WideBvh;
use crate::leaf::Primitive;
use crate::node::{LeafLayout, NodeKind, Nodes};
use crate::simd::{Simd, Task};
use crate::traverse::{LeafRange, MeshFrame, Pads, PreparedRays, RayNumbers, ThroughNodes, TracedRay, Visitor, walk};

/// In which order a traversal visits what a ray enters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Order {
    /// Nearer subtrees first: for the closest hit.
    Nearest,
    /// Any order, at a lower cost: for all hits, or whether there is one.
    Any,
}

impl<P: Primitive> WideBvh<P> {
    /// Calls `visit` with each primitive of each leaf that `ray` enters, nearer subtrees first, without testing it.
    ///
    /// `visit` gets the greatest `t` that is still searched, and returns the new one; [`ControlFlow::Break`] ends the traversal. A leaf is
    /// entered no later than any hit on one of its primitives, and while that is at most `t`. A `WideBvh<Aabb>` has one box in each
    /// leaf, so it reports the boxes that a ray enters: the building block for a level above other structures.
    ///
    /// ```
    /// use std::ops::ControlFlow;
    ///
    /// use canted_obb::Aabb;
    /// use canted_trace::Ray;
    /// use canted_wide::WideBvh;
    ///
    /// let boxes = [9.0, 0.0, 6.0, 3.0].map(|x| Aabb { min: [x, 0.0, 0.0], max: [x + 1.0, 1.0, 1.0] });
    /// let bvh = WideBvh::over(boxes.to_vec())?;
    /// let mut entered = vec![];
    /// bvh.traverse(&Ray::new([2.0, 0.5, 0.5], [1.0, 0.0, 0.0]), |id, t_max| {
    ///     entered.push(id.0);
    ///     // A hit at 4.5, inside the second box, hides the last one.
    ///     ControlFlow::Continue(if id.0 == 2 { 4.5 } else { t_max })
    /// });
    /// assert_eq!(entered, [3, 2]);
    /// # Ok::<(), canted_wide::PrimitiveError>(())
    /// ```
    pub fn traverse(&self, ray: &Ray, mut visit: impl FnMut(PrimId, f32) -> ControlFlow<(), f32>) {
        let Some(scaled) = ScaledRay::new(ray) else { return };
        let traced = TracedRay::new(&scaled, &self.frame, Pads::of(P::ERROR));
        with_stack(self.nodes.stack_len(), |stack| {
            self.visit(&traced, Order::Nearest, stack, &mut |_, id, t_max| match visit(id, scaled.caller_t(t_max)) {
                // What the caller leaves as it is stays as it is, bit for bit.
                ControlFlow::Continue(t) if t == scaled.caller_t(t_max) => t_max,
                ControlFlow::Continue(t) => scaled.scaled_t(t).min(t_max),
                ControlFlow::Break(()) => -1.0,
            });
        });
    }
}

impl WideBvh<Aabb> {
    /// Calls `visit` with each box that a scaled ray enters: what a level above other structures needs. Returns the number of box tests.
    ///
    /// `visit` gets the scaled `t_max` and returns the new one; a negative value ends the traversal. A box is entered no later than any
    /// hit that lies within `error` of it in each coordinate, in units of the space, and while that is `<= t_max`: so ties do not
    /// depend on the BVH. `stack` has at least [`Intersect::stack_len`](canted_trace::Intersect::stack_len) entries.
    pub fn traverse_scaled(
        &self,
        ray: &ScaledRay,
        error: f64,
        order: Order,
        stack: &mut [u64],
        visit: &mut dyn FnMut(PrimId, f32) -> f32,
    ) -> u32 {
        let visits = match order {
            Order::Nearest => self.path.run(TraverseBoxes::<true> { bvh: self, ray, error, stack, visit }),
            Order::Any => self.path.run(TraverseBoxes::<false> { bvh: self, ray, error, stack, visit }),
        };
        visits.n_boxes()
    }
}

impl WideBvh<Aabb> {
    /// Prepares up to eight rays for [`WideBvh::traverse_prepared`], as [`WideBvh::traverse_scaled`] would prepare each from its origin relative to
    /// `reference`, for hits within `error` times the greatest coordinate of that origin. `false` where the boxes have a reference point or a frame of
    /// their own: rays then have to be traced one by one.
    #[doc(hidden)]
    #[must_use]
    pub fn prepare_rays(
        &self,
        rays: &[Ray],
        reference: ReferencePoint,
        error: f64,
        prepared: &mut PreparedRays,
    ) -> bool {
        if !(self.frame.reference.is_origin() && self.frame.is_identity && error <= GREATEST_ERROR) {
            return false;
        }
        let frame = MeshFrame { reference, ..self.frame };
        self.path.run(PrepareRays { rays, frame: &frame, pads: Pads::of_origin(error), prepared });
        true
    }

    /// [`WideBvh::traverse_scaled`] of ray `i` of those prepared, up to `t_max`.
    #[doc(hidden)]
    pub fn traverse_prepared(
        &self,
        (prepared, i, t_max): (&PreparedRays, usize, f32),
        order: Order,
        stack: &mut [u64],
        visit: &mut dyn FnMut(PrimId, f32) -> f32,
    ) -> u32 {
        let visits = match order {
            Order::Nearest => self.path.run(TraversePrepared::<true> { bvh: self, prepared, i, t_max, stack, visit }),
            Order::Any => self.path.run(TraversePrepared::<false> { bvh: self, prepared, i, t_max, stack, visit }),
        };
        visits.n_boxes()
    }
}

/// # Without boxes
/// Traversals of boxes read nodes alone. What changes of a BVH need besides, the boxes themselves, may be taken out until then.
impl WideBvh<Aabb> {
    /// Takes the boxes out. Until [`WideBvh::put_boxes`], only `traverse_scaled`, `traverse_prepared`, `ids_in`, `ids_near` and `each_box`
    /// may be called, and what tells sizes.
    #[doc(hidden)]
    pub fn take_boxes(&mut self) -> Vec<Aabb> {
        self.leaves.unsort();
        // Where each leaf has one box, its word names that instead of its place.
        if self.nodes.leaf_words().all(|(_, n)| n == 1) {
            let order = std::mem::take(&mut self.leaves.order);
            self.nodes.rename_leaves(|first| order[first].index());
        }
        std::mem::take(&mut self.leaves.primitives)
    }

    /// Puts back the boxes that were taken out.
    ///
    /// # Panics
    /// If it is another number of boxes.
    #[doc(hidden)]
    pub fn put_boxes(&mut self, boxes: Vec<Aabb>) {
        assert_eq!(boxes.len(), self.n_primitives, "a box for each number");
        if self.leaves.order.len() < boxes.len() {
            let order = &mut self.leaves.order;
            self.nodes.rename_leaves(|id| {
                order.push(PrimId(id as u32));
                order.len() - 1
            });
            self.nodes.find_pieces(&LeafLayout::IDS, self.leaves.order.len());
        }
        self.leaves.primitives = boxes;
    }

    /// Whether there is no box to read.
    #[doc(hidden)]
    #[must_use]
    pub fn lacks_boxes(&self) -> bool {
        self.leaves.primitives.is_empty()
    }

    /// The ids in a leaf.
    fn ids(&self, leaf: LeafRange) -> impl Iterator<Item = PrimId> {
        let order = &self.leaves.order;
        (leaf.first..leaf.first + leaf.n).map(|place| order.get(place as usize).copied().unwrap_or(PrimId(place)))
    }

    /// [`WideBvh::visit_in`] without the boxes.
    #[doc(hidden)]
    pub fn ids_in(&self, aabb: &Aabb, mut visit: impl FnMut(PrimId) -> ControlFlow<()>) {
        self.leaves_in(aabb, |leaf| self.ids(leaf).try_for_each(&mut visit));
    }

    /// [`WideBvh::visit_near`] without the boxes.
    #[doc(hidden)]
    pub fn ids_near(&self, point: [f32; 3], bound: f64, mut visit: impl FnMut(PrimId) -> f64) {
        self.leaves_near(point, bound, &mut |leaf, place, bound| {
            self.ids(leaf).nth(place as usize).map_or(bound, &mut visit)
        });
    }
}

/// Greatest relative error of rays that are prepared together: its products with origins are finite.
const GREATEST_ERROR: f64 = (1_u64 << 32) as f64;

struct PrepareRays<'a> {
    rays: &'a [Ray],
    frame: &'a MeshFrame,
    pads: Pads,
    prepared: &'a mut PreparedRays,
}

impl Task for PrepareRays<'_> {
    type Output = ();

    #[inline(always)]
    fn on<S: Simd>(self, simd: S) {
        self.prepared.prepare(simd, self.rays, self.frame, self.pads);
    }
}

struct TraversePrepared<'a, const ORDERED: bool> {
    bvh: &'a WideBvh<Aabb>,
    prepared: &'a PreparedRays,
    i: usize,
    t_max: f32,
    stack: &'a mut [u64],
    visit: &'a mut dyn FnMut(PrimId, f32) -> f32,
}

impl<const ORDERED: bool> Task for TraversePrepared<'_, ORDERED> {
    type Output = Visits;

    #[inline(always)]
    fn on<S: Simd>(self, simd: S) -> Visits {
        let Self { bvh, prepared, i, t_max, stack, visit } = self;
        visit_leaves::<S, _, ORDERED>(simd, (&bvh.nodes, &bvh.leaves.order), (prepared.one(i), t_max), stack, visit)
    }
}

/// [`WideBvh::traverse_scaled`]: the ray is prepared with the instructions of the path.
struct TraverseBoxes<'a, const ORDERED: bool> {
    bvh: &'a WideBvh<Aabb>,
    ray: &'a ScaledRay,
    error: f64,
    stack: &'a mut [u64],
    visit: &'a mut dyn FnMut(PrimId, f32) -> f32,
}

impl<const ORDERED: bool> Task for TraverseBoxes<'_, ORDERED> {
    type Output = Visits;

    #[inline(always)]
    fn on<S: Simd>(self, simd: S) -> Visits {
        let Self { bvh, ray, error, stack, visit } = self;
        let numbers = RayNumbers::within(simd, ray, &bvh.frame, error);
        visit_leaves::<S, _, ORDERED>(simd, (&bvh.nodes, &bvh.leaves.order), (&numbers, ray.t_max), stack, visit)
    }
}

/// Calls `visit` with the ids of each leaf that a ray enters. Must be inlined, like all callers of [`Simd`].
#[inline(always)]
fn visit_leaves<S: Simd, R: ThroughNodes, const ORDERED: bool>(
    simd: S,
    (nodes, ids): (&Nodes, &[PrimId]),
    (ray, t_max): (R, f32),
    stack: &mut [u64],
    visit: &mut dyn FnMut(PrimId, f32) -> f32,
) -> Visits {
    let mut called = CalledForIds { ids, visit, visits: Visits::default() };
    walk::<S, _, _, ORDERED>(simd, nodes, ray, t_max, stack, &mut called);
    called.visits
}

/// Calls a function for each primitive of a leaf.
struct CalledForIds<'a> {
    ids: &'a [PrimId],
    visit: &'a mut dyn FnMut(PrimId, f32) -> f32,
    visits: Visits,
}

impl Visitor for CalledForIds<'_> {
    #[inline(always)]
    fn leaf(&mut self, LeafRange { first, n, mut t_max }: LeafRange) -> f32 {
        self.visits.leaf(n);
        for place in first..first + n {
            // Where the boxes are taken out, the word names the id.
            t_max = (self.visit)(self.ids.get(place as usize).copied().unwrap_or(PrimId(place)), t_max);
            if t_max < 0.0 {
                break;
            }
        }
        t_max
    }

    #[inline(always)]
    fn node(&mut self, kind: NodeKind) {
        self.visits.node(kind);
    }
}

#[cfg(test)]
mod tests {
    use canted_fixtures::SplitMix64;
    use canted_obb::vector::{sub, to_f64};

    use super::*;
    use crate::SimdPath;

    /// Rays, each with a box that it misses by at most `error` times its origin, and the scaled `t` at which it passes the box; boxes and origins are
    /// relative to `reference`.
    fn passing(rng: &mut SplitMix64, error: f64, reference: ReferencePoint) -> (Vec<Ray>, Vec<Aabb>, Vec<f32>) {
        let (mut rays, mut boxes, mut ends) = (vec![], vec![], vec![]);
        while rays.len() < 8 {
            let far = [3.0, 300.0, 1e5][rng.below(3)];
            let at = to_f64(reference.point());
            let (from, to) = (rng.signed3().map(|x| far * x), rng.signed3());
            let origin = [0, 1, 2].map(|k| (at[k] + from[k]) as f32);
            let start = sub(to_f64(origin), at);
            let scaled = ScaledRay::new(&Ray::new(origin, sub(to, start).map(|x| x as f32))).expect("a direction");
            let greatest = |v: [f64; 3]| v.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
            let end = (greatest(sub(to, start)) / greatest(to_f64(scaled.direction))) as f32;
            let touch = |k: usize| start[k] + f64::from(end) * f64::from(scaled.direction[k]);
            // From a corner next to the ray outward.
            let mut aabb = Aabb::EMPTY;
            for k in 0..3 {
                let sign = if rng.below(2) == 0 { -1.0 } else { 1.0 };
                let corner = touch(k) + sign * 0.999 * error * greatest(start);
                let (near, other) = (corner as f32, (corner + sign * (0.2 + rng.unit())) as f32);
                (aabb.min[k], aabb.max[k]) = (near.min(other), near.max(other));
            }
            // Rounding has not moved the corner too far away.
            let gap = |k: usize| {
                let x = touch(k);
                (f64::from(aabb.min[k]) - x).max(x - f64::from(aabb.max[k]))
            };
            if (0..3).all(|k| gap(k) <= error * greatest(start)) {
                let Ray { origin, .. } = Ray::new(origin, scaled.direction);
                rays.push(Ray::new(origin, scaled.direction));
                boxes.push(aabb);
                ends.push(end);
            }
        }
        (rays, boxes, ends)
    }

    /// How many boxes are not entered by rays that are prepared with this error.
    fn lost(bvh: &WideBvh<Aabb>, rays: &[Ray], ends: &[f32], reference: ReferencePoint, error: f64) -> usize {
        let mut eight = PreparedRays::default();
        assert!(bvh.prepare_rays(rays, reference, error, &mut eight));
        let mut stack = vec![0; bvh.nodes.stack_len()];
        (0..rays.len())
            .filter(|&i| {
                let mut is_entered = false;
                let mut visit = |id: PrimId, t_max| {
                    is_entered |= id.index() == i;
                    t_max
                };
                bvh.traverse_prepared((&eight, i, ends[i]), Order::Any, &mut stack, &mut visit);
                !is_entered
            })
            .count()
    }

    #[test]
    fn rays_that_are_prepared_together_enter_what_they_may_hit() {
        let mut rng = SplitMix64::new(7);
        let far = ReferencePoint::new([1e6, -3e6, 20.0]).expect("a small point");
        let (mut n_tests, mut n_lost_without) = (0, 0);
        for round in 0..400 {
            let error = [1e-6, 3e-5, 0.01][round % 3];
            let reference = [ReferencePoint::ORIGIN, far][round / 3 % 2];
            let (rays, boxes, ends) = passing(&mut rng, error, reference);
            for path in SimdPath::ALL.into_iter().filter(|path| path.is_available()) {
                let bvh = WideBvh::over(boxes.clone()).expect("finite boxes").with_path(path);
                if !bvh.frame.reference.is_origin() {
                    continue;
                }
                n_tests += rays.len();
                assert_eq!(lost(&bvh, &rays, &ends, reference, error), 0, "round {round}, {path:?}");
                n_lost_without += lost(&bvh, &rays, &ends, reference, 0.0);
            }
        }
        assert!(n_tests > 2000 && n_lost_without > 100, "{n_lost_without} of {n_tests} lost without the error");
    }
}
