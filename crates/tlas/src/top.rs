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
use std::ops::ControlFlow;
use std::sync::Arc;

use canted_lbvh::{self as lbvh, par};
use canted_obb::round::{down, greatest, up};
use canted_obb::vector::{length, reach, sub, to_f64};
use canted_obb::{Aabb, Obb, PrimId};
use canted_trace::{BoxBvh, InstanceId, Intersect, Ray, ReferencePoint, ScaledRay, WorldRay};
use canted_wide::{Config, MAX_PRIMITIVES, Order, PreparedRays, SimdPath, WideBvh};

use crate::InstanceError;
use crate::around::{Around, Boxes, around};
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
    /// What the boxes of the classes are relative to.
    reference: ReferencePoint,
    /// Around all instances in world space, without and with what of the error of hits does not depend on rays.
    boxes: Boxes,
    /// What changes of single instances need; from the first one on, until all boxes change.
    changes: Option<Changes>,
}

/// See [`Top`].
#[derive(Clone, Debug)]
struct Changes {
    /// By instance.
    places: Vec<Option<Place>>,
    around: Around,
}

/// Where an instance is: its class, and its number there.
#[derive(Clone, Copy, Debug)]
struct Place {
    class: u32,
    number: u32,
}

/// The spread of `per_origin` in a class when it is built; as instances change four times as much is allowed.
///
/// Boxes are then padded by at most 16 times what the best-conditioned instance needs: less than 400 u of the ray's origin,
/// u = 2^-24, for instances of which one is a rotation.
const SPREAD: f64 = 16.0;
const SPREAD_OF_CHANGES: f64 = 64.0;

/// Bounds of all instances, and their oriented boxes; none of a wide top level.
type Known<'a> = (&'a [Bounds], &'a [Obb]);

/// Up to this part of all instances are changed one by one: a change of one takes about as long as a refit of as many.
const FEW: usize = 4;

impl Top {
    /// Builds over the bounds of instances, and their oriented boxes where `config` is about these.
    pub(crate) fn build(
        bounds: &[Bounds],
        obbs: &[Obb],
        config: &TopConfig,
        path: SimdPath,
    ) -> Result<Self, InstanceError> {
        let classes = classify(bounds, SPREAD).into_iter();
        let reference = reference_of(bounds);
        let of_class = |ids| Class::build((bounds, obbs, reference), ids, config, path);
        let classes = classes.map(of_class).collect::<Result<_, _>>()?;
        Ok(Self { classes, reference, boxes: around(bounds), changes: None })
    }

    /// The same BVHs traced on another path, if they are wide.
    pub(crate) fn with_path(self, path: SimdPath) -> Self {
        Self { classes: self.classes.into_iter().map(|class| class.with_path(path)).collect(), ..self }
    }

    /// Takes out what rays do not read; [`Top::prepare_changes`] puts it back.
    pub(crate) fn for_rays(mut self) -> Self {
        for class in &mut self.classes {
            if let Bvh::Wide(bvh) = &mut class.bvh {
                bvh.take_boxes();
            }
        }
        self
    }

    /// Makes what changes need; `bounds` are those of the build.
    pub(crate) fn prepare_changes(&mut self, bounds: &[Bounds]) {
        for class in &mut self.classes {
            let boxes = match &class.bvh {
                Bvh::Wide(bvh) if bvh.lacks_boxes() => grown_aabbs(&class.members(bounds), self.reference),
                _ => continue,
            };
            class.wide().put_boxes(boxes);
        }
    }

    /// Box around all instances; empty for none.
    pub(crate) fn aabb(&self) -> Aabb {
        self.boxes[0]
    }

    /// Contains every hit but for [`Top::hit_error`]; a point at the origin for no instance.
    pub(crate) fn bounds(&self) -> Obb {
        let [_, grown] = &self.boxes;
        match grown.is_empty() {
            true => Obb { center: [0.0; 3], frame: Obb::IDENTITY_FRAME, half_extents: [0.0; 3] },
            false => Obb::from_aabb(grown),
        }
    }

    /// The error of hits relative to the ray's origin.
    pub(crate) fn hit_error(&self) -> f32 {
        up(self.classes.iter().map(|class| class.per_origin[1]).fold(0.0, f64::max))
    }

    pub(crate) fn n_bytes(&self) -> usize {
        let of_changes = |changes: &Changes| size_of_val(&changes.places[..]) + changes.around.n_bytes();
        self.classes.iter().map(Class::n_bytes).sum::<usize>() + self.changes.as_ref().map_or(0, of_changes)
    }

    /// Calls `visit` with the box of each node and leaf.
    pub(crate) fn each_box(&self, mut visit: impl FnMut(Obb, u32, bool)) {
        let mut in_world = |obb, level, is_leaf| visit(self.reference.given_box(obb), level, is_leaf);
        self.classes.iter().for_each(|class| class.each_box(&mut in_world));
    }

    /// Instances with these numbers have others than these bounds, or are new: few of a wide top level are changed one by one, else all boxes are
    /// written.
    pub(crate) fn update(
        &mut self,
        changed: &[(u32, Bounds)],
        (bounds, obbs): Known<'_>,
        config: &TopConfig,
        path: SimdPath,
    ) {
        if changed.is_empty() {
            return;
        }
        let is_wide = matches!(config, TopConfig::Wide(_));
        let places = &self.changes(bounds).places;
        let comes_or_goes = |(i, _): &(u32, Bounds)| places[*i as usize].is_some() == bounds[*i as usize].is_empty();
        let others: Vec<(u32, Bounds)> = changed.iter().copied().filter(comes_or_goes).collect();
        // The reference point is chosen near instances.
        if self.aabb().is_empty() || !is_wide && !others.is_empty() {
            if let Ok(top) = Self::build(bounds, obbs, config, path) {
                *self = top;
            }
        } else if is_wide && changed.len() <= bounds.len() / FEW {
            changed.iter().for_each(|(i, old)| self.change(*i, old, bounds, config, path));
        } else {
            // The boxes around all instances are found anew there.
            others.iter().for_each(|(i, _)| self.place(*i, bounds, config, path));
            self.refit((bounds, obbs), config, path);
        }
    }

    /// What changes of single instances need.
    fn changes(&mut self, bounds: &[Bounds]) -> &mut Changes {
        let classes = &self.classes;
        let changes = self.changes.get_or_insert_with(|| {
            let mut places = vec![None; bounds.len()];
            for (class, Class { ids, bvh, .. }) in (0..).zip(classes) {
                match ids {
                    // Instances that were added since have higher numbers.
                    None => places[..bvh.n_boxes()]
                        .iter_mut()
                        .zip(0..)
                        .for_each(|(place, number)| *place = Some(Place { class, number })),
                    Some(ids) => {
                        ids.iter()
                            .zip(0..)
                            .for_each(|(&id, number)| places[id as usize] = Some(Place { class, number }));
                    }
                }
            }
            Changes { places, around: Around::new(bounds) }
        });
        changes.places.resize(bounds.len(), None);
        changes
    }

    /// One instance of a wide top level has others than these bounds.
    fn change(&mut self, i: u32, old: &Bounds, bounds: &[Bounds], config: &TopConfig, path: SimdPath) {
        self.place(i, bounds, config, path);
        if let Some(Changes { around, .. }) = &mut self.changes {
            around.update(i as usize, old, bounds);
            self.boxes = around.all();
        }
    }

    /// One instance of a wide top level has other bounds; it gets a place, or loses it.
    fn place(&mut self, i: u32, bounds: &[Bounds], config: &TopConfig, path: SimdPath) {
        let Self { classes, reference, changes: Some(Changes { places, .. }), .. } = self else { return };
        let new = &bounds[i as usize];
        let is_taken = |class: &Class| !new.is_empty() && class.takes(new.error.per_origin.into());
        match places[i as usize].map(|place| (place, &mut classes[place.class as usize])) {
            Some((place, class)) if is_taken(class) => class.move_one(place.number, new, *reference),
            known => {
                if let Some((place, class)) = known {
                    if let Some(last) = class.remove(place.number) {
                        places[last as usize] = Some(place);
                    }
                    places[i as usize] = None;
                }
                if !new.is_empty() {
                    let class = classes.iter().position(is_taken).unwrap_or_else(|| {
                        let class = Class::build((bounds, &[], *reference), Some(vec![]), config, path);
                        classes.push(class.expect("no instance is too many"));
                        classes.len() - 1
                    });
                    let number = classes[class].insert(i, new, *reference);
                    places[i as usize] = Some(Place { class: class as u32, number });
                }
            }
        }
    }

    /// New bounds for the same instances, in the same topology; built again where the errors of a class have spread too far.
    fn refit(&mut self, (bounds, obbs): Known<'_>, config: &TopConfig, path: SimdPath) {
        if self.classes.iter().any(|class| class.spread(bounds) > SPREAD_OF_CHANGES)
            && let Ok(top) = Self::build(bounds, obbs, config, path)
        {
            *self = top;
            return;
        }
        self.reference = reference_of(bounds);
        self.classes.iter_mut().for_each(|class| class.refit((bounds, obbs), self.reference));
        let around = Around::new(bounds);
        self.boxes = around.all();
        self.changes(bounds).around = around;
    }

    /// How many times the predicted traversal cost has grown since the build: the greatest growth of a class.
    pub(crate) fn drift(&self) -> f32 {
        self.classes.iter().map(|class| class.bvh.drift()).fold(1.0, f32::max)
    }

    /// Entries of memory for subtrees that wait.
    #[inline]
    pub(crate) fn stack_len(&self) -> usize {
        self.classes.iter().map(Class::stack_len).fold(0, usize::max)
    }

    /// Calls `visit` with each instance whose box shares a point with `aabb`, world space, and perhaps with others, until it breaks.
    pub(crate) fn each_in(&self, aabb: &Aabb, visit: &mut dyn FnMut(u32) -> ControlFlow<()>) -> ControlFlow<()> {
        let at = self.reference.point();
        // Boxes are rounded outward, and so is this one.
        let from = |x: f32, k: usize| f64::from(x) - f64::from(at[k]);
        let min = std::array::from_fn(|k| down(from(aabb.min[k], k).next_down()).max(f32::MIN));
        let max = std::array::from_fn(|k| up(from(aabb.max[k], k).next_up()).min(f32::MAX));
        let moved = Aabb { min, max };
        self.classes.iter().try_for_each(|class| class.each_in(&moved, visit))
    }

    /// Calls `visit` with the instances whose boxes may be at most `limit` away from `point`, world space, and with the limit; it returns the new
    /// one. Nearer subtrees of a class come first.
    pub(crate) fn each_near(&self, point: [f64; 3], mut limit: f64, visit: &mut dyn FnMut(u32, f64) -> f64) {
        let moved = sub(point, to_f64(self.reference.point()));
        for class in &self.classes {
            limit = class.each_near(moved, limit, visit);
        }
    }

    /// Calls `enter` with each instance whose box `ray` enters at or before `t_max`; returns the number of box tests. Nearer subtrees of a
    /// class come first for [`Order::Nearest`].
    ///
    /// `enter` gets the scaled `t_max` and returns the new one; a negative value ends the traversal. The entry `t` of a box
    /// is at most that of any hit on its instance, and boxes with an entry `<= t_max` are visited, so `enter` receives all
    /// hits of equal `t`.
    #[inline]
    pub(crate) fn traverse(
        &self,
        ray: &WorldRay<'_>,
        order: Order,
        stack: &mut [u64],
        mut enter: impl FnMut(InstanceId, f32) -> f32,
    ) -> u32 {
        let ([t_min, t_max], &ScaledRay { origin, direction, time, mask, .. }) = (ray.interval(), ray.ray);
        let moved = Ray { origin: self.reference.moved(origin), direction, t_min, t_max, time, mask };
        let mut ray = ScaledRay::from_parts(&moved, [t_min, t_max], 1.0);
        let mut n_boxes = 0;
        for class in &self.classes {
            let mut t_max = ray.t_max;
            n_boxes += class.traverse(&ray, order, stack, |instance, limit| {
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

/// The instances that a ray may hit: those of a top level, or of one for rays that are prepared together.
pub(crate) trait Entered {
    /// [`Top::traverse`]. Not for a `dyn` function: the traversal calls one already, and calls of one in another would take as long as a node.
    fn each(self, order: Order, stack: &mut [u64], enter: impl FnMut(InstanceId, f32) -> f32) -> u32;
}

impl Entered for (&Top, &WorldRay<'_>) {
    #[inline(always)]
    fn each(self, order: Order, stack: &mut [u64], enter: impl FnMut(InstanceId, f32) -> f32) -> u32 {
        self.0.traverse(self.1, order, stack, enter)
    }
}

impl Entered for (&SingleClass<'_>, &PreparedRay<'_>) {
    #[inline(always)]
    fn each(self, order: Order, stack: &mut [u64], enter: impl FnMut(InstanceId, f32) -> f32) -> u32 {
        self.0.traverse(self.1, order, stack, enter)
    }
}

/// A wide top level of one class, for rays that are prepared together.
pub(crate) struct SingleClass<'a> {
    class: &'a Class,
    bvh: &'a WideBvh<Aabb>,
    reference: ReferencePoint,
}

/// A ray that was prepared with others.
pub(crate) struct PreparedRay<'a> {
    pub(crate) ray: &'a ScaledRay,
    pub(crate) of: &'a PreparedRays,
    /// Its number among them.
    pub(crate) i: usize,
    /// The end of the interval, rounded outward.
    pub(crate) t_max: f32,
}

impl Top {
    /// See the type; `None` for other top levels.
    pub(crate) fn single_class(&self) -> Option<SingleClass<'_>> {
        match &self.classes[..] {
            [class @ Class { bvh: Bvh::Wide(bvh), .. }] => Some(SingleClass { class, bvh, reference: self.reference }),
            _ => None,
        }
    }
}

impl SingleClass<'_> {
    /// Prepares up to eight rays; whether it did.
    pub(crate) fn prepare(&self, rays: &[Ray], prepared: &mut PreparedRays) -> bool {
        self.bvh.prepare_rays(rays, self.reference, self.class.error_of_origin(), prepared)
    }

    #[inline]
    pub(crate) fn stack_len(&self) -> usize {
        self.bvh.stack_len()
    }

    /// [`Top::traverse`].
    #[inline]
    pub(crate) fn traverse(
        &self,
        &PreparedRay { of, i, t_max, .. }: &PreparedRay<'_>,
        order: Order,
        stack: &mut [u64],
        mut enter: impl FnMut(InstanceId, f32) -> f32,
    ) -> u32 {
        let mut visit = |PrimId(number), t_max| enter(InstanceId(self.class.id(number)), t_max);
        self.bvh.traverse_prepared((of, i, t_max), order, stack, &mut visit)
    }
}

/// A point near the instances.
fn reference_of(bounds: &[Bounds]) -> ReferencePoint {
    if !bounds.iter().any(Bounds::is_empty) {
        return ReferencePoint::near(bounds.len(), |i| bounds[i].aabb);
    }
    let boxes: Vec<Aabb> = bounds.iter().filter(|bounds| !bounds.is_empty()).map(|bounds| bounds.aabb).collect();
    ReferencePoint::near(boxes.len(), |i| boxes[i])
}

/// A BVH over some of the instances, whose hits have similar errors.
#[derive(Clone, Debug)]
struct Class {
    bvh: Bvh,
    /// The instance of each box; none if all instances have one, in order.
    ids: Option<Vec<u32>>,
    /// Errors of hits relative to the ray's origin: at most the least, and at least the greatest, of all instances.
    per_origin: [f64; 2],
}

#[derive(Clone, Debug)]
#[expect(clippy::large_enum_variant, reason = "one for each class of instances, and there are few")]
enum Bvh {
    /// Over the instances' axis-aligned boxes.
    Wide(WideBvh<Aabb>),
    /// Over the instances' oriented boxes, of this number.
    Other(Arc<dyn BoxBvh>, usize),
}

impl Bvh {
    fn n_boxes(&self) -> usize {
        match self {
            Self::Wide(bvh) => bvh.n_primitives(),
            Self::Other(_, n) => *n,
        }
    }

    fn drift(&self) -> f32 {
        match self {
            Self::Wide(bvh) => bvh.drift(),
            Self::Other(bvh, _) => bvh.drift(),
        }
    }
}

/// The instances that can be hit, in classes in which the greatest `per_origin` is at most `spread` times the least. At least one class; a
/// single one of all instances has no list.
fn classify(bounds: &[Bounds], spread: f64) -> Vec<Option<Vec<u32>>> {
    let error = |i: u32| f64::from(bounds[i as usize].error.per_origin);
    let [least, greatest] = range(bounds.iter());
    let mut order: Vec<u32> = (0..bounds.len() as u32).filter(|&i| !bounds[i as usize].is_empty()).collect();
    if order.len() == bounds.len() && (greatest <= spread * least || bounds.is_empty()) {
        return vec![None];
    }
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
    if classes.is_empty() {
        classes.push(vec![]);
    }
    classes.into_iter().map(Some).collect()
}

/// Least and greatest `per_origin`.
fn range<'a>(bounds: impl Iterator<Item = &'a Bounds>) -> [f64; 2] {
    let errors = bounds.map(|bounds| f64::from(bounds.error.per_origin));
    errors.fold([f64::INFINITY, 0.0], |[least, greatest], x| [f64::min(least, x), f64::max(greatest, x)])
}

impl Class {
    /// Builds over the instances `ids`, or all; boxes are relative to `reference`.
    fn build(
        (bounds, obbs, reference): (&[Bounds], &[Obb], ReferencePoint),
        ids: Option<Vec<u32>>,
        config: &TopConfig,
        path: SimdPath,
    ) -> Result<Self, InstanceError> {
        let members = of_ids(bounds, ids.as_deref());
        let bvh = match config {
            TopConfig::Wide(config) => {
                let bvh = WideBvh::over_with(grown_aabbs(&members, reference), config.axis_aligned());
                Bvh::Wide(bvh.map_err(|error| in_all(error.into(), ids.as_deref()))?.with_path(path))
            }
            TopConfig::Other(build) => {
                let obbs = of_ids(obbs, ids.as_deref());
                Bvh::Other(build(&grown_obbs(&members, &obbs, reference)), members.len())
            }
        };
        let per_origin = range(members.into_iter());
        Ok(Self { bvh, ids, per_origin })
    }

    fn with_path(self, path: SimdPath) -> Self {
        let bvh = match self.bvh {
            Bvh::Wide(bvh) => Bvh::Wide(bvh.with_path(path)),
            other @ Bvh::Other(..) => other,
        };
        Self { bvh, ..self }
    }

    fn n_bytes(&self) -> usize {
        let of_bvh = match &self.bvh {
            Bvh::Wide(bvh) => bvh.n_bytes(),
            Bvh::Other(bvh, _) => bvh.n_bytes(),
        };
        of_bvh + self.ids.as_ref().map_or(0, |ids| size_of_val(&ids[..]))
    }

    fn each_box(&self, visit: &mut dyn FnMut(Obb, u32, bool)) {
        match &self.bvh {
            Bvh::Wide(bvh) => bvh.each_box(visit),
            Bvh::Other(bvh, _) => bvh.each_box(visit),
        }
    }

    #[inline]
    fn stack_len(&self) -> usize {
        match &self.bvh {
            Bvh::Wide(bvh) => bvh.stack_len(),
            Bvh::Other(..) => 0,
        }
    }

    /// The bounds of its instances.
    fn members<'a>(&self, bounds: &'a [Bounds]) -> Vec<&'a Bounds> {
        // An instance that cannot be hit may have been added since.
        let known = if self.ids.is_none() { &bounds[..self.bvh.n_boxes()] } else { bounds };
        of_ids(known, self.ids.as_deref())
    }

    /// The greatest `per_origin` of the class over the least, with these bounds of all instances.
    fn spread(&self, bounds: &[Bounds]) -> f64 {
        let [least, greatest] = range(self.members(bounds).into_iter());
        greatest / least
    }

    /// New bounds for the same instances.
    fn refit(&mut self, (bounds, obbs): Known<'_>, reference: ReferencePoint) {
        let members = self.members(bounds);
        match &mut self.bvh {
            Bvh::Wide(bvh) => {
                bvh.refit(grown_aabbs(&members, reference)).expect("a finite box for each instance");
            }
            Bvh::Other(bvh, n) => {
                let known = if self.ids.is_none() { &obbs[..*n] } else { obbs };
                let obbs = of_ids(known, self.ids.as_deref());
                *bvh = bvh.refitted(&grown_obbs(&members, &obbs, reference));
            }
        }
        self.per_origin = range(members.into_iter());
    }

    /// Whether an instance with this `per_origin` may be in the class.
    fn takes(&self, per_origin: f64) -> bool {
        let [least, greatest] = self.per_origin;
        self.bvh.n_boxes() == 0 || greatest.max(per_origin) <= SPREAD_OF_CHANGES * least.min(per_origin)
    }

    /// The BVH of a class that changes in place.
    fn wide(&mut self) -> &mut WideBvh<Aabb> {
        match &mut self.bvh {
            Bvh::Wide(bvh) => bvh,
            Bvh::Other(..) => unreachable!("only wide classes change one by one"),
        }
    }

    /// Takes an instance that the class may have.
    fn include(&mut self, per_origin: f64) {
        let [least, greatest] = match self.bvh.n_boxes() {
            0 => [per_origin; 2],
            _ => self.per_origin,
        };
        self.per_origin = [least.min(per_origin), greatest.max(per_origin)];
    }

    /// New bounds for one of the instances.
    fn move_one(&mut self, number: u32, bounds: &Bounds, reference: ReferencePoint) {
        self.include(bounds.error.per_origin.into());
        let moved = self.wide().move_one(PrimId(number), bounds.grown(reference));
        moved.expect("a finite box for each instance");
    }

    /// Adds an instance; returns its number.
    fn insert(&mut self, id: u32, bounds: &Bounds, reference: ReferencePoint) -> u32 {
        self.include(bounds.error.per_origin.into());
        self.list().push(id);
        let PrimId(number) = self.wide().insert(bounds.grown(reference)).expect("a finite box for each instance");
        number
    }

    /// Removes the instance of this number; returns that which has the number now.
    fn remove(&mut self, number: u32) -> Option<u32> {
        self.list().swap_remove(number as usize);
        self.wide().remove(PrimId(number)).expect("each instance of the class has a box");
        self.list().get(number as usize).copied()
    }

    /// The instance of each box.
    fn list(&mut self) -> &mut Vec<u32> {
        let n = self.bvh.n_boxes() as u32;
        self.ids.get_or_insert_with(|| (0..n).collect())
    }

    /// The instance of a box.
    #[inline]
    fn id(&self, number: u32) -> u32 {
        self.ids.as_ref().map_or(number, |ids| ids[number as usize])
    }

    /// [`Top::each_in`]; the box is relative to the reference point.
    fn each_in(&self, aabb: &Aabb, visit: &mut dyn FnMut(u32) -> ControlFlow<()>) -> ControlFlow<()> {
        let mut flow = ControlFlow::Continue(());
        match &self.bvh {
            Bvh::Wide(bvh) => bvh.ids_in(aabb, |PrimId(number)| {
                flow = visit(self.id(number));
                flow
            }),
            Bvh::Other(_, n) => flow = (0..*n as u32).try_for_each(|number| visit(self.id(number))),
        }
        flow
    }

    /// [`Top::each_near`]; the point is relative to the reference point. Returns the last limit.
    fn each_near(&self, point: [f64; 3], mut limit: f64, visit: &mut dyn FnMut(u32, f64) -> f64) -> f64 {
        let rounded = point.map(|x| x as f32);
        match &self.bvh {
            Bvh::Wide(bvh) if rounded.iter().all(|x| x.is_finite()) => {
                // The search is around the rounded point; the difference has a rounding itself.
                let moved = length(sub(point, to_f64(rounded))) + 4.0 * f64::EPSILON * reach(point);
                let bound = |limit: f64| (limit + moved) * (limit + moved) * (1.0 + 16.0 * f64::EPSILON);
                bvh.ids_near(rounded, bound(limit), |PrimId(number)| {
                    limit = visit(self.id(number), limit);
                    bound(limit)
                });
            }
            bvh => (0..bvh.n_boxes() as u32).for_each(|number| limit = visit(self.id(number), limit)),
        }
        limit
    }

    /// The error of hits that boxes do not contain, of a ray relative to the reference point. Its origin was rounded, by 2^-24 of it, which
    /// moves the hit by as much.
    #[inline]
    fn error(&self, ray: &ScaledRay) -> f64 {
        let [x, y, z] = ray.origin;
        self.error_of_origin() * f64::from(greatest([x.abs(), y.abs(), z.abs()]))
    }

    /// [`Class::error`] over the greatest coordinate of the origin.
    #[inline]
    fn error_of_origin(&self) -> f64 {
        const ROUNDING: f64 = ReferencePoint::ROUNDING as f64;
        self.per_origin[1] * (1.0 + 2.0 * ROUNDING) + ROUNDING
    }

    /// [`Top::traverse`] in the class; the ray is relative to the reference point.
    #[inline]
    fn traverse(
        &self,
        ray: &ScaledRay,
        order: Order,
        stack: &mut [u64],
        mut enter: impl FnMut(InstanceId, f32) -> f32,
    ) -> u32 {
        let mut enter = |number: u32, t_max| enter(InstanceId(self.id(number)), t_max);
        let error = self.error(ray);
        match &self.bvh {
            Bvh::Wide(bvh) => {
                bvh.traverse_scaled(ray, error, order, stack, &mut |PrimId(number), t_max| enter(number, t_max))
            }
            Bvh::Other(bvh, _) => bvh.traverse(ray, error, order == Order::Nearest, &mut enter),
        }
    }
}

/// Those of these numbers, or all.
fn of_ids<'a, T>(all: &'a [T], ids: Option<&[u32]>) -> Vec<&'a T> {
    ids.map_or_else(|| all.iter().collect(), |ids| ids.iter().map(|&id| &all[id as usize]).collect())
}

/// An error about a number in a class, about an instance.
fn in_all(error: InstanceError, ids: Option<&[u32]>) -> InstanceError {
    match (error, ids) {
        (InstanceError::OutOfRange { instance }, Some(ids)) => {
            InstanceError::OutOfRange { instance: ids[instance] as usize }
        }
        (other, _) => other,
    }
}

fn grown_aabbs(members: &[&Bounds], reference: ReferencePoint) -> Vec<Aabb> {
    par::map(members, JOB, |bounds| bounds.grown(reference))
}

fn grown_obbs(members: &[&Bounds], obbs: &[&Obb], reference: ReferencePoint) -> Vec<Obb> {
    par::from_fn(members.len(), JOB, |i| grown_obb(members[i], obbs[i], reference))
}

/// [`Bounds::grown`] as an oriented box, or the axis-aligned one where that has less area.
fn grown_obb(bounds: &Bounds, obb: &Obb, reference: ReferencePoint) -> Obb {
    let center = reference.moved(obb.center);
    // The rounding of the center: a difference of two f32 is exact in f64 but for its last bit.
    let rounding = (0..3).fold(0.0, |most: f64, k| {
        let exact = f64::from(obb.center[k]) - f64::from(reference.point()[k]);
        most.max((exact - f64::from(center[k])).abs() + exact.abs() * f64::EPSILON)
    });
    let moved = Obb { center, ..*obb };
    moved.grown(bounds.error.fixed(reference) + rounding).or_aabb(&bounds.grown(reference))
}
