//! Instances whose hits have similar errors, and the BVH over their boxes.

use canted_lbvh::par;
use canted_obb::round::{greatest, up};
use canted_obb::{Aabb, Obb};
use canted_trace::{InstanceId, Query, ReferencePoint, ScaledRay};
use canted_wide::{SimdPath, Stack};

use super::TopConfig;
use super::binary::BinaryTop;
use super::wide::WideTop;
use crate::InstanceError;
use crate::placement::{Bounds, JOB};

/// A BVH over some of the instances.
#[derive(Clone, Debug)]
pub(super) struct Class {
    bvh: Bvh,
    /// The instances, ascending; empty if they are all instances.
    ids: Vec<u32>,
    /// Error of hits relative to the ray's origin, the greatest of all instances.
    per_origin: f64,
}

#[derive(Clone, Debug)]
enum Bvh {
    Wide(WideTop),
    Binary(BinaryTop),
}

/// The instances in classes in which the greatest `per_origin` is at most `spread` times the least. At least one class; a single
/// one is empty and stands for all instances.
#[expect(clippy::cast_possible_truncation, reason = "fewer than 2^30 instances")]
pub(super) fn classify(bounds: &[Bounds], spread: f64) -> Vec<Vec<u32>> {
    let error = |i: u32| bounds[i as usize].error.per_origin;
    let (least, greatest) = range(bounds.iter());
    if greatest <= spread * least || bounds.is_empty() {
        return vec![vec![]];
    }
    let mut order: Vec<u32> = (0..bounds.len() as u32).collect();
    order.sort_by(|&a, &b| error(a).total_cmp(&error(b)));
    let mut classes: Vec<Vec<u32>> = vec![];
    let mut limit = f64::NEG_INFINITY;
    for i in order {
        if error(i) > limit {
            classes.push(vec![]);
            limit = spread * error(i);
        }
        classes.last_mut().expect("the first instance makes a class").push(i);
    }
    classes.iter_mut().for_each(|ids| ids.sort_unstable());
    classes
}

/// Least and greatest `per_origin`.
fn range<'a>(bounds: impl Iterator<Item = &'a Bounds>) -> (f64, f64) {
    let errors = bounds.map(|bounds| bounds.error.per_origin);
    errors.fold((f64::INFINITY, 0.0), |(least, greatest): (f64, f64), x| (least.min(x), greatest.max(x)))
}

impl Class {
    /// Builds over the instances `ids`, all if there are none; boxes are relative to `reference`.
    pub(super) fn build(
        (bounds, reference): (&[Bounds], ReferencePoint),
        ids: Vec<u32>,
        config: &TopConfig,
        path: SimdPath,
    ) -> Result<Self, InstanceError> {
        let of_class: Vec<&Bounds> = members(&ids, bounds).collect();
        let bvh = match config {
            TopConfig::Wide(config) => {
                let boxes = par::map(&of_class, JOB, |bounds| grown_aabb(bounds, reference));
                Bvh::Wide(WideTop::build(boxes, *config, path).map_err(|error| in_all(error.into(), &ids))?)
            }
            TopConfig::Binary(config) => {
                let obbs: Vec<Obb> = par::map(&of_class, JOB, |bounds| grown_obb(bounds, reference));
                Bvh::Binary(BinaryTop::build(&obbs, *config))
            }
        };
        let per_origin = range(of_class.into_iter()).1;
        Ok(Self { bvh, ids, per_origin })
    }

    pub(super) fn with_path(self, path: SimdPath) -> Self {
        let bvh = match self.bvh {
            Bvh::Wide(top) => Bvh::Wide(top.with_path(path)),
            binary @ Bvh::Binary(_) => binary,
        };
        Self { bvh, ..self }
    }

    pub(super) fn n_bytes(&self) -> usize {
        let of_bvh = match &self.bvh {
            Bvh::Wide(top) => top.n_bytes(),
            Bvh::Binary(top) => top.n_bytes(),
        };
        of_bvh + size_of_val(&self.ids[..])
    }

    pub(super) fn each_box(&self, visit: impl FnMut(Obb, u32, bool)) {
        match &self.bvh {
            Bvh::Wide(top) => top.each_box(visit),
            Bvh::Binary(top) => top.each_box(visit),
        }
    }

    pub(super) fn drift(&self) -> f32 {
        match &self.bvh {
            Bvh::Wide(top) => top.drift(),
            Bvh::Binary(top) => top.drift(),
        }
    }

    /// The greatest `per_origin` of the class over the least, with these bounds of all instances.
    pub(super) fn spread(&self, bounds: &[Bounds]) -> f64 {
        let (least, greatest) = range(members(&self.ids, bounds));
        greatest / least
    }

    /// New bounds for the same instances.
    pub(super) fn refit(&mut self, bounds: &[Bounds], reference: ReferencePoint) {
        let of_class: Vec<&Bounds> = members(&self.ids, bounds).collect();
        match &mut self.bvh {
            Bvh::Wide(top) => top.refit(par::map(&of_class, JOB, |bounds| grown_aabb(bounds, reference))),
            Bvh::Binary(top) => top.refit(&par::map(&of_class, JOB, |bounds| grown_obb(bounds, reference))),
        }
        self.per_origin = range(of_class.into_iter()).1;
    }

    /// The error of hits that boxes do not contain, of a ray relative to the reference point. Its origin was rounded, by 2^-24 of it, which
    /// moves the hit by as much.
    #[inline]
    fn error(&self, ray: &ScaledRay) -> f64 {
        const ROUNDING: f64 = ReferencePoint::ROUNDING as f64;
        (self.per_origin * (1.0 + 2.0 * ROUNDING) + ROUNDING) * f64::from(greatest(ray.origin.map(f32::abs)))
    }

    /// The instance of a number in the class.
    #[inline]
    fn instance(&self, number: u32) -> InstanceId {
        InstanceId(if self.ids.is_empty() { number } else { self.ids[number as usize] })
    }

    /// [`super::Top::traverse`] in the class; the ray is relative to the reference point.
    #[inline]
    pub(super) fn traverse<Q: Query, const ORDERED: bool>(
        &self,
        ray: &ScaledRay,
        query: &mut Q,
        stack: &mut Stack,
        mut enter: impl FnMut(InstanceId, f32, &mut Q) -> f32,
    ) {
        let enter = |number, t_max, query: &mut Q| enter(self.instance(number), t_max, query);
        let error = self.error(ray);
        match (&self.bvh, ORDERED) {
            (Bvh::Wide(top), _) => top.traverse::<Q, ORDERED>(ray, error, query, stack, enter),
            (Bvh::Binary(top), true) => top.traverse_ordered(ray, error, query, enter),
            (Bvh::Binary(top), false) => top.traverse_any(ray, error, query, enter),
        }
    }
}

/// The bounds of a class.
fn members<'a>(ids: &'a [u32], bounds: &'a [Bounds]) -> impl Iterator<Item = &'a Bounds> {
    let all = if ids.is_empty() { bounds } else { &[] };
    all.iter().chain(ids.iter().map(|&id| &bounds[id as usize]))
}

/// An error about a number in a class, about an instance.
fn in_all(error: InstanceError, ids: &[u32]) -> InstanceError {
    match error {
        InstanceError::OutOfRange { instance } if !ids.is_empty() => {
            InstanceError::OutOfRange { instance: ids[instance] as usize }
        }
        other => other,
    }
}

/// The axis-aligned box that contains every hit but for `per_origin`, relative to `reference` and rounded outward; planes beyond the
/// range of `f32` are its greatest numbers.
fn grown_aabb(Bounds { aabb: Aabb { min, max }, error, .. }: &Bounds, reference: ReferencePoint) -> Aabb {
    let fixed = error.fixed(reference);
    // Steps outward cover the roundings of both sums.
    let grow = |x: f32, reference: f32| {
        let moved = (f64::from(x) - f64::from(reference)).next_up();
        up((moved + fixed).next_up()).min(f32::MAX)
    };
    let at = reference.point();
    Aabb { min: [0, 1, 2].map(|k| -grow(-min[k], -at[k])), max: [0, 1, 2].map(|k| grow(max[k], at[k])) }
}

/// The same as an oriented box, or the axis-aligned one where that has less area.
fn grown_obb(bounds: &Bounds, reference: ReferencePoint) -> Obb {
    let center = reference.moved(bounds.obb.center);
    // The rounding of the center: a difference of two f32 is exact in f64 but for its last bit.
    let rounding = (0..3).fold(0.0, |most: f64, k| {
        let exact = f64::from(bounds.obb.center[k]) - f64::from(reference.point()[k]);
        most.max((exact - f64::from(center[k])).abs() + exact.abs() * f64::EPSILON)
    });
    let moved = Obb { center, ..bounds.obb };
    moved.grown(bounds.error.fixed(reference) + rounding).or_aabb(&grown_aabb(bounds, reference))
}
