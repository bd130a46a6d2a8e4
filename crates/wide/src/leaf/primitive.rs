//! Primitives of the caller.

use canted_obb::round::{down, up};
use canted_obb::{Aabb, Moments, Obb, PrimId};
use canted_trace::{HIT_ERROR, ReferencePoint, RoundSegment, ScaledRay, Side, Sphere};

use super::extents::{extent_of_box, moved_extent, unrounded_extent_of_box};
use super::{LeafData, LeafPrimitive};
use crate::traverse::LeafRange;

/// Four balls, each a center and a radius.
pub(super) type FourBalls = [[f32; 4]; 4];

/// Where a ray hits a primitive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PrimitiveHit {
    /// Distance in units of the scaled direction.
    pub t: f32,
    /// Coordinates on the surface, as the primitive defines them.
    pub u: f32,
    /// See `u`.
    pub v: f32,
    /// The side that is hit, as the primitive defines it.
    pub side: Side,
}

/// A shape of your own in a [`WideBvh`](crate::WideBvh).
///
/// It is a surface that a ray hits in a few points, each of which is reported. Two methods are required, [`Primitive::bounds`] and
/// [`Primitive::intersect`]; the others make the boxes around shapes that are not aligned with the axes smaller. A disk, with all of them:
///
/// ```
/// use canted_obb::{Aabb, Moments};
/// use canted_trace::{Intersect, Ray, ScaledRay, Side};
/// use canted_wide::{Primitive, PrimitiveHit, WideBvh, bounds_of_points, extent_of_points};
///
/// /// All points `center + x·a + y·b` with `x² + y² <= 1`; `a` and `b` are orthogonal and of equal length.
/// struct Disk { center: [f32; 3], a: [f32; 3], b: [f32; 3] }
///
/// fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
///     a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
/// }
///
/// impl Disk {
///     /// Corners of a square around it.
///     fn corners(&self) -> [[f32; 3]; 4] {
///         [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]
///             .map(|[x, y]| [0, 1, 2].map(|k| self.center[k] + x * self.a[k] + y * self.b[k]))
///     }
/// }
///
/// impl Primitive for Disk {
///     fn bounds(&self) -> Aabb {
///         bounds_of_points(self.corners(), 0.0)
///     }
///
///     fn extent_along(&self, direction: [f32; 3]) -> [f32; 2] {
///         extent_of_points(self.corners(), 0.0, direction)
///     }
///
///     fn moments(&self) -> Moments {
///         Moments::from_points(self.corners())
///     }
///
///     fn intersect(&self, ray: &ScaledRay, t_max: f32) -> Option<PrimitiveHit> {
///         let [o, d, c, a, b] = [ray.origin, ray.direction, self.center, self.a, self.b].map(|v| v.map(f64::from));
///         let normal = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
///         let to_center = [c[0] - o[0], c[1] - o[1], c[2] - o[2]];
///         let t = (dot(to_center, normal) / dot(d, normal)) as f32;
///         let p: [f64; 3] = [0, 1, 2].map(|k| f64::from(t) * d[k] - to_center[k]);
///         let (x, y) = (dot(p, a) / dot(a, a), dot(p, b) / dot(b, b));
///         let is_hit = ray.t_min <= t && t <= t_max && x * x + y * y <= 1.0;
///         let side = if dot(d, normal) < 0.0 { Side::Front } else { Side::Back };
///         is_hit.then_some(PrimitiveHit { t, u: x as f32, v: y as f32, side })
///     }
/// }
///
/// let disks = (0..100u8)
///     .map(|i| Disk { center: [f32::from(i), 0.0, 0.0], a: [0.5, 0.5, 0.0], b: [0.0, 0.0, 0.5f32.sqrt()] })
///     .collect();
/// let bvh = WideBvh::over(disks)?;
/// let hit = bvh.closest_hit(&Ray::new([7.25, 3.0, 0.0], [0.0, -1.0, 0.0])).expect("the ray hits a disk");
/// assert_eq!((hit.primitive.0, hit.t), (7, 2.75));
/// # Ok::<(), canted_wide::PrimitiveError>(())
/// ```
pub trait Primitive: Send + Sync {
    /// How far a reported point may lie from the primitive: `o + t·d`, in real arithmetic with the reported `t`, is within
    /// `ERROR·(|o|∞ + ρ∞)`, in each coordinate, of a point that [`Primitive::bounds`] and [`Primitive::extent_along`] of every
    /// direction contain; `|o|∞` is the greatest coordinate of the ray's origin, `ρ∞` that of the bounds. At most 1/8.
    ///
    /// A `t` computed in f64 and rounded once needs 2^-24. If the stated error is too small, hits are lost.
    const ERROR: f32 = HIT_ERROR;

    /// Whether [`Primitive::ERROR`] is relative to the greatest `|x - o|∞` of the points `x` of the bounds instead, which is smaller: the
    /// error then does not depend on where ray and primitive are in their space. So it is if the test subtracts the origin
    /// first. Boxes are then relative to a point near the primitives, so that those far from the origin are traced as fast.
    const IS_LOCAL: bool = false;

    /// Most primitives of a leaf, at most 32. Primitives of a leaf are tested one by one, boxes eight at a time: the more
    /// expensive the test, the fewer.
    const MAX_LEAF: usize = 2;

    /// How many times as long as a block of eight triangles the tests of a leaf take: the more expensive, the more oriented nodes pay, which keep rays
    /// away from leaves that they miss.
    const COST: f32 = 1.0;

    /// A round segment around a primitive, object space, where a cheap one is known: large leaves test eight of them at once, and then only the
    /// primitives that the ray may come near. Points that [`Primitive::intersect`] reports must be within 2^-24 of the greatest distance between the ray's
    /// origin and a point of the segment from the segment.
    const HULL: Option<fn(&Self) -> RoundSegment> = None;

    /// A ball around a primitive, as [`Primitive::HULL`]: for shapes that are about as long as they are wide, and cheaper to test. Points
    /// that [`Primitive::intersect`] reports must be within 2^-24 of the greatest distance between the ray's origin and a point of the ball
    /// from the ball, whatever [`Primitive::ERROR`] is; otherwise hits are lost. Where there is one, `HULL` is not used.
    const BALL: Option<fn(&Self) -> Sphere> = None;

    /// Four balls in object space, each a center and a radius, whose convex hull is approximately the primitive: where a type has them, frames of
    /// oriented boxes are compared by them instead of by [`Primitive::moments`] and [`Primitive::extent_along`], which halves the time of builds of
    /// curves. What boxes contain, and hits, do not depend on them.
    const FIT_BALLS: Option<fn(&Self) -> FourBalls> = None;

    /// Whether the primitive is its [`Primitive::BALL`] or [`Primitive::HULL`], and [`Primitive::intersect`] reports where a ray enters it and misses
    /// no line that is deeper inside than 2^-23 of the greatest distance between the ray's origin and a point of it, plus its radius: rays that
    /// certainly hit it need no other test where any hit will do.
    const IS_HULL: bool = false;

    /// A box around the primitive, object space: finite, not empty.
    fn bounds(&self) -> Aabb;

    /// An interval that contains `direction·x`, in real arithmetic, of all points `x` of the primitive: the extent of an
    /// oriented box. The direction is a unit vector but for rounding, of length at most 1 + 4u.
    ///
    /// The default is that of the bounds, with which oriented boxes cannot be smaller than the bounds. An interval
    /// wider than that is replaced by it. [`extent_of_points`](crate::extent_of_points) computes the interval of points and of shapes around them.
    fn extent_along(&self, direction: [f32; 3]) -> [f32; 2] {
        extent_of_box(&self.bounds(), direction)
    }

    /// Mean and scatter, whose principal axes are candidates for the axes of oriented boxes; hits do not depend on them.
    ///
    /// The default is that of the corners of the bounds, which does not depend on the orientation of a primitive. The ends
    /// of a long shape, or the corners of a flat one, do: [`Moments::from_points`].
    fn moments(&self) -> Moments {
        Moments::from_box_corners(&Obb::from_aabb(&self.bounds()), 1.0)
    }

    /// The first hit with `ray.t_min <= t <= t_max`. `t` must depend on the ray's origin and direction alone: another
    /// interval may hide a hit but not change it.
    fn intersect(&self, ray: &ScaledRay, t_max: f32) -> Option<PrimitiveHit>;
}

impl<P: Primitive> Primitive for &P {
    const ERROR: f32 = P::ERROR;
    const IS_LOCAL: bool = P::IS_LOCAL;
    const MAX_LEAF: usize = P::MAX_LEAF;
    const COST: f32 = P::COST;
    const HULL: Option<fn(&Self) -> RoundSegment> = match P::HULL {
        Some(_) => Some(|primitive| P::HULL.expect("it is one")(primitive)),
        None => None,
    };
    const BALL: Option<fn(&Self) -> Sphere> = match P::BALL {
        Some(_) => Some(|primitive| P::BALL.expect("it is one")(primitive)),
        None => None,
    };
    const FIT_BALLS: Option<fn(&Self) -> FourBalls> = match P::FIT_BALLS {
        Some(_) => Some(|primitive| P::FIT_BALLS.expect("it has them")(primitive)),
        None => None,
    };
    const IS_HULL: bool = P::IS_HULL;

    fn bounds(&self) -> Aabb {
        P::bounds(self)
    }

    fn extent_along(&self, direction: [f32; 3]) -> [f32; 2] {
        P::extent_along(self, direction)
    }

    fn moments(&self) -> Moments {
        P::moments(self)
    }

    #[inline]
    fn intersect(&self, ray: &ScaledRay, t_max: f32) -> Option<PrimitiveHit> {
        P::intersect(self, ray, t_max)
    }
}

/// Whether primitives have hulls that eight are tested with at once.
#[inline(always)]
pub(crate) const fn is_filtered<P: Primitive>() -> bool {
    P::BALL.is_some() || P::HULL.is_some()
}

/// What builds and refits need of a primitive of any type: their code is compiled once for all types.
pub(crate) trait Bounded: Send + Sync {
    /// [`Primitive::bounds`].
    fn bounds(&self) -> Aabb;

    /// [`Primitive::moments`].
    fn moments(&self) -> Moments;

    /// [`Primitive::FIT_BALLS`].
    fn fit_balls(&self) -> Option<FourBalls>;

    /// [`Primitive::extent_along`] each of these rows.
    fn extents_along(&self, rows: &[[f32; 3]], extents: &mut [[f32; 2]]);
}

impl<P: Primitive> Bounded for P {
    fn bounds(&self) -> Aabb {
        Primitive::bounds(self)
    }

    fn moments(&self) -> Moments {
        Primitive::moments(self)
    }

    fn fit_balls(&self) -> Option<FourBalls> {
        P::FIT_BALLS.map(|balls| balls(self))
    }

    fn extents_along(&self, rows: &[[f32; 3]], extents: &mut [[f32; 2]]) {
        extents.iter_mut().zip(rows).for_each(|(extent, &row)| *extent = self.extent_along(row));
    }
}

/// Primitives of a type by number.
pub(crate) trait Primitives: Sync {
    /// Their number.
    fn n(&self) -> usize;

    /// One of them.
    fn at(&self, i: usize) -> &dyn Bounded;
}

impl<P: Primitive> Primitives for Vec<P> {
    fn n(&self) -> usize {
        self.len()
    }

    fn at(&self, i: usize) -> &dyn Bounded {
        &self[i]
    }
}

/// A primitive of the caller, relative to a point of object space.
#[derive(Clone, Copy)]
pub(crate) struct Placed<'a> {
    pub(crate) primitive: &'a dyn Bounded,
    /// [`Primitive::bounds`], in object space, computed once.
    pub(crate) bounds: Aabb,
    pub(crate) reference: ReferencePoint,
}

impl<'a> Placed<'a> {
    /// In object space itself.
    pub(crate) fn given(primitive: &'a dyn Bounded) -> Self {
        Self { primitive, bounds: primitive.bounds(), reference: ReferencePoint::ORIGIN }
    }
}

/// The intervals along these rows around several primitives, rounded outward: least and greatest projections; empty for no
/// primitive.
///
/// Each interval is the intersection of the primitive's own with that of its bounds: where a primitive reports NaN or too
/// wide an interval, that of its bounds remains. So no projection exceeds those of the bounds, as the proof requires. Relative to a
/// reference point, bounds are rounded to nearest ([`ReferencePoint::ROUNDING`](canted_trace::ReferencePoint::ROUNDING)), own intervals outward.
pub(crate) fn extents_within(rows: &[[f32; 3]; 3], primitives: &[Placed]) -> [[f32; 3]; 2] {
    let (mut lo, mut hi, mut extents) = ([f64::from(f32::MAX); 3], [f64::from(f32::MIN); 3], [[0.0; 2]; 3]);
    for &Placed { primitive, bounds, reference } in primitives {
        let bounds = reference.moved_box(&bounds);
        primitive.extents_along(rows, &mut extents);
        for k in 0..3 {
            let own = moved_extent(extents[k], rows[k], reference).map(f64::from);
            let of_bounds = unrounded_extent_of_box(&bounds, rows[k]);
            // NaN is not greater or less than the bounds.
            let least = if own[0] > of_bounds[0] { own[0] } else { of_bounds[0] };
            let greatest = if own[1] < of_bounds[1] { own[1] } else { of_bounds[1] };
            lo[k] = if least < lo[k] { least } else { lo[k] };
            hi[k] = if greatest > hi[k] { greatest } else { hi[k] };
        }
    }
    // Rounded last: the order of numbers is that of the rounded ones.
    [lo.map(down), hi.map(up)]
}

/// A primitive that [`WideBvh::to_bytes`](crate::WideBvh::to_bytes) can write.
pub trait SavedPrimitive: Primitive + Sized {
    /// Its numbers: an array of 32-bit ones such as `[f32; 4]`, written with the least byte first on every machine.
    type Data: bytemuck::Pod;

    /// The numbers from which [`SavedPrimitive::from_data`] makes an equal primitive.
    fn to_data(&self) -> Self::Data;

    /// The primitive of these numbers. They may be any that a file holds; the loader then checks the bounds and all boxes.
    fn from_data(data: &Self::Data) -> Self;
}

/// Leaves of a BVH over primitives of the caller.
#[derive(Clone, Debug)]
pub struct Shapes<P> {
    /// Numbers of primitives by position in the leaves.
    pub(crate) order: Vec<PrimId>,
    /// In the order of the leaves where they are sorted, else in input order.
    pub(crate) primitives: Vec<P>,
    is_sorted: bool,
}

impl<P> Shapes<P> {
    /// Of primitives in input order.
    pub(crate) fn new(order: Vec<PrimId>, primitives: Vec<P>) -> Self {
        Self { order, primitives, is_sorted: false }
    }

    /// The primitive at a position.
    #[inline(always)]
    pub(crate) fn at(&self, place: usize) -> &P {
        &self.primitives[if self.is_sorted { place } else { self.order[place].index() }]
    }

    /// Those at eight positions from the first on, where they are one after another in memory.
    #[inline(always)]
    pub(crate) fn eight(&self, first: usize) -> Option<&[P; 8]> {
        if self.is_sorted { self.primitives.get(first..)?.first_chunk() } else { None }
    }

    /// All primitives in input order.
    pub(crate) fn in_input_order(&self) -> Vec<&P> {
        let mut all: Vec<&P> = self.primitives.iter().collect();
        if self.is_sorted {
            self.order.iter().zip(&self.primitives).for_each(|(id, primitive)| all[id.index()] = primitive);
        }
        all
    }

    /// Whether primitives are in the order of the leaves.
    pub(crate) fn is_sorted(&self) -> bool {
        self.is_sorted
    }

    /// Brings primitives into the order of the leaves, where each is in one: a ray then reads those of a leaf from one place of memory.
    pub(crate) fn sort(&mut self) {
        if self.is_sorted || self.order.len() != self.primitives.len() {
            return;
        }
        let mut given: Vec<Option<P>> = std::mem::take(&mut self.primitives).into_iter().map(Some).collect();
        let take = |id: &PrimId| given[id.index()].take().expect("a primitive is in one leaf");
        self.primitives = self.order.iter().map(take).collect();
        self.is_sorted = true;
    }

    /// Brings primitives into input order, as changes need them.
    pub(crate) fn unsort(&mut self) {
        if !std::mem::replace(&mut self.is_sorted, false) {
            return;
        }
        let mut sorted: Vec<Option<P>> = (0..self.order.len()).map(|_| None).collect();
        for (id, primitive) in self.order.iter().zip(std::mem::take(&mut self.primitives)) {
            sorted[id.index()] = Some(primitive);
        }
        self.primitives = sorted.into_iter().map(|primitive| primitive.expect("each is in a leaf")).collect();
    }
}

impl<P: Primitive> LeafPrimitive for P {
    type Leaves = Shapes<P>;
    type Shape = P;

    #[inline]
    fn for_each_shape(leaves: &Shapes<P>, leaf: LeafRange, mut visit: impl FnMut(PrimId, &P)) {
        for place in leaf.first as usize..(leaf.first + leaf.n) as usize {
            visit(leaves.order[place], leaves.at(place));
        }
    }

    #[inline]
    fn with_shape<R>(leaves: &Shapes<P>, leaf: LeafRange, place: u32, visit: impl FnOnce(PrimId, &P) -> R) -> R {
        let place = (leaf.first + place) as usize;
        visit(leaves.order[place], leaves.at(place))
    }

    fn leaf_data(leaves: &Shapes<P>) -> LeafData<'_> {
        let n_bytes = size_of_val(&leaves.order[..]) + size_of_val(&leaves.primitives[..]);
        LeafData { blocks: &[], order: &leaves.order, n_bytes }
    }
}
