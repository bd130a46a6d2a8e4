//! The top level: instances in classes of similar error, a BVH over the boxes of each class.
//!
//! # Where the error of hits is
//! A hit lies within `per_origin·|o - r|∞ + fixed(r)` of its instance's bounds, for every point `r`. Boxes are relative to a reference
//! point `r` near the instances, and so are the origins of rays: a cluster of instances far from the origin is traced as one near it.
//! `fixed` is part of the instance's box. `per_origin` is that of
//! the transform's condition; it is multiplied by the ray's origin, so rays carry it, and all boxes of a BVH get the greatest
//! of its instances. So instances whose `per_origin` differ much are in different BVHs, which a ray traverses one after
//! another: one ill-conditioned instance does not loosen the boxes of the others. Transforms that scale and rotate have
//! similar conditions, and almost all scenes one class.

use std::fmt;
use std::sync::Arc;

use canted_lbvh::{self as lbvh, par};
use canted_obb::round::{greatest, up};
use canted_obb::{Aabb, Obb, PrimId};
use canted_trace::{BoxBvh, InstanceId, Intersect, ReferencePoint, ScaledRay};
use canted_wide::{Config, MAX_PRIMITIVES, Order, SimdPath, WideBvh};

use crate::InstanceError;
use crate::placement::{Bounds, JOB};

/// Builds a BVH over oriented boxes, which have their indices as numbers.
pub type BuildBoxes = dyn Fn(&[Obb]) -> Arc<dyn BoxBvh> + Send + Sync;

/// How the top-level BVH is built.
#[derive(Clone)]
pub enum TopConfig {
    /// Eight-wide aligned nodes over the instances' axis-aligned boxes: the fastest to trace. `oriented` and `rotate_mesh` of
    /// the configuration are ignored.
    Wide(Config),
    /// Another BVH over the instances' oriented boxes: see [`TopConfig::other`].
    Other(Arc<BuildBoxes>),
}

impl Default for TopConfig {
    fn default() -> Self {
        Self::Wide(Config::default())
    }
}

/// Functions are equal if they are one.
impl PartialEq for TopConfig {
    fn eq(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Wide(a), Self::Wide(b)) => a == b,
            (Self::Other(a), Self::Other(b)) => std::ptr::addr_eq(Arc::as_ptr(a), Arc::as_ptr(b)),
            _ => false,
        }
    }
}

impl fmt::Debug for TopConfig {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Wide(config) => f.debug_tuple("Wide").field(config).finish(),
            Self::Other(_) => f.debug_tuple("Other").finish_non_exhaustive(),
        }
    }
}

impl TopConfig {
    /// Another BVH over the instances' oriented boxes, such as a binary one with volumes of any strategy:
    ///
    /// ```
    /// use canted_bvh2::Bvh2Boxes;
    /// use canted_lbvh::VolumeConfig;
    /// use canted_obb::Affine;
    /// use canted_tlas::{Instance, Tlas, TopConfig};
    /// use canted_trace::{Intersect, Ray};
    /// use canted_wide::TriangleBvh;
    ///
    /// let bvh = TriangleBvh::build(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], &[[0, 1, 2]])?;
    /// let top = TopConfig::other(Bvh2Boxes::builder(VolumeConfig::default()));
    /// let tlas = Tlas::new(vec![bvh], &[Instance::new(0, Affine::IDENTITY)], top)?;
    /// assert!(tlas.occluded(&Ray::new([0.2, 0.2, 1.0], [0.0, 0.0, -1.0])));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn other(build: impl Fn(&[Obb]) -> Arc<dyn BoxBvh> + Send + Sync + 'static) -> Self {
        Self::Other(Arc::new(build))
    }

    /// The greatest number of instances that the BVH can index.
    pub(crate) fn max_instances(&self) -> usize {
        match self {
            Self::Wide(_) => MAX_PRIMITIVES,
            Self::Other(_) => lbvh::MAX_PRIMITIVES,
        }
    }
}

/// The top-level BVHs.
#[derive(Clone, Debug)]
pub(crate) struct Top {
    classes: Vec<Class>,
    /// World space.
    aabb: Aabb,
    /// The same with what of the error of hits does not depend on rays.
    grown: Aabb,
    /// What the boxes of the classes are relative to.
    reference: ReferencePoint,
}

/// The spread of `per_origin` in a class when it is built; in a refit four times as much is allowed.
///
/// Boxes are then padded by at most 16 times what the best-conditioned instance needs: less than 400 u of the ray's origin,
/// u = 2^-24, for instances of which one is a rotation.
const SPREAD: f64 = 16.0;
const SPREAD_OF_REFIT: f64 = 64.0;

impl Top {
    /// Builds over the bounds of instances.
    pub(crate) fn build(bounds: &[Bounds], config: &TopConfig, path: SimdPath) -> Result<Self, InstanceError> {
        let classes = classify(bounds, SPREAD).into_iter();
        let reference = reference_of(bounds);
        let of_class = |ids| Class::build((bounds, reference), ids, config, path);
        let classes = classes.map(of_class).collect::<Result<_, _>>()?;
        Ok(Self { classes, aabb: aabb_of(bounds), grown: grown_of(bounds), reference })
    }

    /// The same BVHs traced on another path, if they are wide.
    pub(crate) fn with_path(self, path: SimdPath) -> Self {
        Self { classes: self.classes.into_iter().map(|class| class.with_path(path)).collect(), ..self }
    }

    /// Box around all instances; empty for none.
    pub(crate) fn aabb(&self) -> Aabb {
        self.aabb
    }

    /// Contains every hit but for [`Top::hit_error`]; a point at the origin for no instance.
    pub(crate) fn bounds(&self) -> Obb {
        match self.grown.is_empty() {
            true => Obb { center: [0.0; 3], frame: Obb::IDENTITY_FRAME, half_extents: [0.0; 3] },
            false => Obb::from_aabb(&self.grown),
        }
    }

    /// The error of hits relative to the ray's origin.
    pub(crate) fn hit_error(&self) -> f32 {
        up(self.classes.iter().map(|class| class.per_origin).fold(0.0, f64::max))
    }

    pub(crate) fn n_bytes(&self) -> usize {
        self.classes.iter().map(Class::n_bytes).sum()
    }

    /// Calls `visit` with the box of each node and leaf.
    pub(crate) fn each_box(&self, mut visit: impl FnMut(Obb, u32, bool)) {
        let mut in_world = |obb, level, is_leaf| visit(self.reference.given_box(obb), level, is_leaf);
        self.classes.iter().for_each(|class| class.each_box(&mut in_world));
    }

    /// New bounds for the same instances, in the same topology; built again where the errors of a class have spread too far.
    pub(crate) fn refit(&mut self, bounds: &[Bounds], config: &TopConfig, path: SimdPath) {
        if self.classes.iter().any(|class| class.spread(bounds) > SPREAD_OF_REFIT)
            && let Ok(top) = Self::build(bounds, config, path)
        {
            *self = top;
            return;
        }
        self.reference = reference_of(bounds);
        self.classes.iter_mut().for_each(|class| class.refit(bounds, self.reference));
        (self.aabb, self.grown) = (aabb_of(bounds), grown_of(bounds));
    }

    /// How many times the predicted traversal cost has grown since the build: the greatest growth of a class.
    pub(crate) fn drift(&self) -> f32 {
        self.classes.iter().map(Class::drift).fold(1.0, f32::max)
    }

    /// Entries of memory for subtrees that wait.
    #[inline]
    pub(crate) fn stack_len(&self) -> usize {
        self.classes.iter().map(Class::stack_len).fold(0, usize::max)
    }

    /// Calls `enter` with each instance whose box `ray` enters at or before `t_max`; returns the number of box tests. Nearer subtrees of a
    /// class come first for [`Order::Nearest`].
    ///
    /// `enter` gets the scaled `t_max` and returns the new one; a negative value ends the traversal. The entry `t` of a box
    /// is at most that of any hit on its instance, and boxes with an entry `<= t_max` are visited, so `enter` receives all
    /// hits of equal `t`.
    pub(crate) fn traverse(
        &self,
        ray: &ScaledRay,
        order: Order,
        stack: &mut [u64],
        enter: &mut dyn FnMut(InstanceId, f32) -> f32,
    ) -> u32 {
        let mut ray = self.reference.moved_ray(ray);
        let mut n_boxes = 0;
        for class in &self.classes {
            let mut t_max = ray.t_max;
            n_boxes += class.traverse(&ray, order, stack, &mut |instance, limit| {
                t_max = enter(instance, limit);
                t_max
            });
            if t_max < 0.0 {
                break;
            }
            ray.t_max = t_max;
        }
        n_boxes
    }
}

/// A point near the instances.
fn reference_of(bounds: &[Bounds]) -> ReferencePoint {
    ReferencePoint::near(bounds.len(), |i| bounds[i].aabb)
}

fn aabb_of(bounds: &[Bounds]) -> Aabb {
    bounds.iter().fold(Aabb::EMPTY, |all, bounds| all.union(bounds.aabb))
}

/// The box around all instances and what of the error of their hits does not depend on the ray.
fn grown_of(bounds: &[Bounds]) -> Aabb {
    bounds.iter().fold(Aabb::EMPTY, |all, bounds| all.union(grown_aabb(bounds, ReferencePoint::ORIGIN)))
}

/// A BVH over some of the instances, whose hits have similar errors.
#[derive(Clone, Debug)]
struct Class {
    bvh: Bvh,
    /// The instances, ascending; empty if they are all instances.
    ids: Vec<u32>,
    /// Error of hits relative to the ray's origin, the greatest of all instances.
    per_origin: f64,
}

#[derive(Clone, Debug)]
#[expect(clippy::large_enum_variant, reason = "one for each class of instances, and there are few")]
enum Bvh {
    /// Over the instances' axis-aligned boxes; and the growth of the predicted traversal cost since the build.
    Wide(WideBvh<Aabb>, f32),
    /// Over the instances' oriented boxes.
    Other(Arc<dyn BoxBvh>),
}

/// The instances in classes in which the greatest `per_origin` is at most `spread` times the least. At least one class; a single
/// one is empty and stands for all instances.
fn classify(bounds: &[Bounds], spread: f64) -> Vec<Vec<u32>> {
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
    fn build(
        (bounds, reference): (&[Bounds], ReferencePoint),
        ids: Vec<u32>,
        config: &TopConfig,
        path: SimdPath,
    ) -> Result<Self, InstanceError> {
        let bvh = match config {
            TopConfig::Wide(config) => {
                let bvh = WideBvh::over_with(grown_aabbs(&ids, bounds, reference), config.axis_aligned());
                Bvh::Wide(bvh.map_err(|error| in_all(error.into(), &ids))?.with_path(path), 1.0)
            }
            TopConfig::Other(build) => Bvh::Other(build(&grown_obbs(&ids, bounds, reference))),
        };
        let per_origin = range(members(&ids, bounds)).1;
        Ok(Self { bvh, ids, per_origin })
    }

    fn with_path(self, path: SimdPath) -> Self {
        let bvh = match self.bvh {
            Bvh::Wide(bvh, drift) => Bvh::Wide(bvh.with_path(path), drift),
            other @ Bvh::Other(_) => other,
        };
        Self { bvh, ..self }
    }

    fn n_bytes(&self) -> usize {
        let of_bvh = match &self.bvh {
            Bvh::Wide(bvh, _) => bvh.n_bytes(),
            Bvh::Other(bvh) => bvh.n_bytes(),
        };
        of_bvh + size_of_val(&self.ids[..])
    }

    fn each_box(&self, visit: &mut dyn FnMut(Obb, u32, bool)) {
        match &self.bvh {
            Bvh::Wide(bvh, _) => bvh.each_box(visit),
            Bvh::Other(bvh) => bvh.each_box(visit),
        }
    }

    fn drift(&self) -> f32 {
        match &self.bvh {
            Bvh::Wide(_, drift) => *drift,
            Bvh::Other(bvh) => bvh.drift(),
        }
    }

    #[inline]
    fn stack_len(&self) -> usize {
        match &self.bvh {
            Bvh::Wide(bvh, _) => bvh.stack_len(),
            Bvh::Other(_) => 0,
        }
    }

    /// The greatest `per_origin` of the class over the least, with these bounds of all instances.
    fn spread(&self, bounds: &[Bounds]) -> f64 {
        let (least, greatest) = range(members(&self.ids, bounds));
        greatest / least
    }

    /// New bounds for the same instances.
    fn refit(&mut self, bounds: &[Bounds], reference: ReferencePoint) {
        match &mut self.bvh {
            Bvh::Wide(bvh, drift) => {
                let boxes = grown_aabbs(&self.ids, bounds, reference);
                *drift = bvh.refit(boxes).expect("a finite box for each instance").drift;
            }
            Bvh::Other(bvh) => *bvh = bvh.refitted(&grown_obbs(&self.ids, bounds, reference)),
        }
        self.per_origin = range(members(&self.ids, bounds)).1;
    }

    /// The error of hits that boxes do not contain, of a ray relative to the reference point. Its origin was rounded, by 2^-24 of it, which
    /// moves the hit by as much.
    #[inline]
    fn error(&self, ray: &ScaledRay) -> f64 {
        const ROUNDING: f64 = ReferencePoint::ROUNDING as f64;
        (self.per_origin * (1.0 + 2.0 * ROUNDING) + ROUNDING) * f64::from(greatest(ray.origin.map(f32::abs)))
    }

    /// [`Top::traverse`] in the class; the ray is relative to the reference point.
    fn traverse(
        &self,
        ray: &ScaledRay,
        order: Order,
        stack: &mut [u64],
        enter: &mut dyn FnMut(InstanceId, f32) -> f32,
    ) -> u32 {
        let mut enter = |number: u32, t_max| {
            enter(InstanceId(if self.ids.is_empty() { number } else { self.ids[number as usize] }), t_max)
        };
        let error = self.error(ray);
        match &self.bvh {
            Bvh::Wide(bvh, _) => {
                bvh.traverse_scaled(ray, error, order, stack, &mut |PrimId(number), t_max| enter(number, t_max))
            }
            Bvh::Other(bvh) => bvh.traverse(ray, error, order == Order::Nearest, &mut enter),
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

fn grown_aabbs(ids: &[u32], bounds: &[Bounds], reference: ReferencePoint) -> Vec<Aabb> {
    let of_class: Vec<&Bounds> = members(ids, bounds).collect();
    par::map(&of_class, JOB, |bounds| grown_aabb(bounds, reference))
}

fn grown_obbs(ids: &[u32], bounds: &[Bounds], reference: ReferencePoint) -> Vec<Obb> {
    let of_class: Vec<&Bounds> = members(ids, bounds).collect();
    par::map(&of_class, JOB, |bounds| grown_obb(bounds, reference))
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
