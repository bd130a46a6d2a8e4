use canted_lbvh::par;
use canted_obb::round::{down, up};
use canted_obb::{Aabb, Affine, Obb, vector};
use canted_trace::{Intersect, ObjectMap, ReferencePoint};

use crate::instance::{MAX_CONDITION, condition, invert, row_sum_norm};
use crate::support::{KnownSupports, Supports, keeps_axes};
use crate::{Instance, InstanceError, Motion};

/// Half of `f32::EPSILON`: the relative error of one rounding to `f32`.
const U: f64 = 1.0 / 16_777_216.0;

/// Fewest instances that one job places.
pub(crate) const JOB: usize = 256;

/// A bound on the error of a hit in world space, in each coordinate: `per_origin · |o - r|∞ + fixed(r)`, `o` the ray's origin, for every
/// point `r`. Each number is rounded up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct WorldError {
    pub(crate) per_origin: f32,
    /// What does not depend on `r`.
    constant: f32,
    /// The image of the center of the bounds is at all times within `radius` of it, in each coordinate.
    center: [f32; 3],
    radius: f32,
}

impl WorldError {
    /// See the type.
    pub(crate) fn fixed(&self, r: ReferencePoint) -> f64 {
        let (point, center) = (vector::to_f64(r.point()), vector::to_f64(self.center));
        let reach = vector::reach(point);
        let from_center = (vector::reach(vector::sub(center, point)) + f64::from(self.radius)) * (1.0 + F64_ROUNDINGS);
        f64::from(self.constant) + f64::from(self.per_origin) * (from_center + F64_ROUNDINGS * reach)
    }
}

/// Roundings of `f64` in what a condition multiplies, relative to `per_origin`: fewer than 32 of 2^-53, and `per_origin` is at least
/// 2^-22 of the condition.
const F64_ROUNDINGS: f64 = 1.0 / (1_u64 << 26) as f64;

/// Bounds of an instance in world space, at all times, and how far hits may lie outside.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Bounds {
    pub(crate) aabb: Aabb,
    pub(crate) error: WorldError,
}

/// The oriented box around an instance that no ray can hit.
pub(crate) const NO_BOX: Obb = Obb { center: [0.0; 3], frame: Obb::IDENTITY_FRAME, half_extents: [0.0; 3] };

impl Bounds {
    /// Of an instance that no ray can hit.
    pub(crate) const EMPTY: Self =
        Self { aabb: Aabb::EMPTY, error: WorldError { per_origin: 0.0, constant: 0.0, center: [0.0; 3], radius: 0.0 } };

    pub(crate) fn is_empty(&self) -> bool {
        self.aabb.is_empty()
    }

    /// The axis-aligned box that contains every hit but for `per_origin`, relative to `reference` and rounded outward; planes beyond the
    /// range of `f32` are its greatest numbers.
    pub(crate) fn grown(&self, reference: ReferencePoint) -> Aabb {
        let Self { aabb: Aabb { min, max }, error, .. } = self;
        let fixed = error.fixed(reference);
        // Steps outward cover the roundings of both sums.
        let grow = |x: f32, reference: f32| {
            let moved = (f64::from(x) - f64::from(reference)).next_up();
            up((moved + fixed).next_up()).min(f32::MAX)
        };
        let (at, mut grown) = (reference.point(), Aabb::EMPTY);
        for k in 0..3 {
            (grown.min[k], grown.max[k]) = (-grow(-min[k], -at[k]), grow(max[k], at[k]));
        }
        grown
    }
}

/// What placing an instance needs of its bottom-level BVH.
pub(crate) struct Bottom<'a, B> {
    blas: &'a B,
    /// Its supports, from the first instance on that does not keep its axes.
    supports: &'a KnownSupports,
    bounds: Obb,
    /// The error of hits, and whether it is local.
    error: (f32, bool),
    is_empty: bool,
}

impl<'a, B: Intersect> Bottom<'a, B> {
    pub(crate) fn of(blas: &'a B, supports: &'a KnownSupports) -> Self {
        let error = (blas.hit_error(), blas.has_local_error());
        Self { blas, supports, bounds: blas.bounds(), error, is_empty: blas.is_empty() }
    }

    /// `aabb`, which is around the image of the BVH, or the part of it that contains the image.
    fn tightened(&self, aabb: Aabb, map: &Affine) -> Aabb {
        if keeps_axes(map) || !aabb.is_finite() {
            return aabb;
        }
        let supports = self.supports.get_or_init(|| Supports::of(self.blas).map(Box::new));
        let Some(Aabb { min, max }) = supports.as_ref().map(|supports| supports.image(map)) else { return aabb };
        Aabb { min: [0, 1, 2].map(|k| min[k].max(aabb.min[k])), max: [0, 1, 2].map(|k| max[k].min(aabb.max[k])) }
    }
}

/// What traversal needs of an instance, and all that is known of one that does not move: a cache line.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(crate) struct Placement {
    pub(crate) map: ObjectMap,
    pub(crate) blas: u32,
    pub(crate) mask: u32,
}

const _: () = assert!(size_of::<Placement>() == 64);

/// Of all instances.
#[derive(Clone, Debug)]
pub(crate) enum Placements {
    Each(Vec<Placement>),
    /// Static instances of the first BVH that every ray sees: the rows of their maps, each with its translation last.
    Copies(Vec<[[f32; 4]; 3]>),
}

impl Placements {
    pub(crate) fn n(&self) -> usize {
        match self {
            Self::Each(all) => all.len(),
            Self::Copies(all) => all.len(),
        }
    }

    pub(crate) fn n_bytes(&self) -> usize {
        match self {
            Self::Each(all) => size_of_val(&all[..]),
            Self::Copies(all) => size_of_val(&all[..]),
        }
    }

    /// The placement of an instance; `made` holds it where it is not stored.
    #[inline(always)]
    pub(crate) fn of<'a>(&'a self, index: usize, made: &'a mut Option<Placement>) -> &'a Placement {
        match self {
            Self::Each(all) => &all[index],
            Self::Copies(all) => made.insert(of_copy(&all[index])),
        }
    }

    /// All of them, stored.
    pub(crate) fn each(&mut self) -> &mut Vec<Placement> {
        if let Self::Copies(all) = self {
            *self = Self::Each(par::from_fn(all.len(), JOB, |i| of_copy(&all[i])));
        }
        match self {
            Self::Each(all) => all,
            Self::Copies(_) => unreachable!("they are stored"),
        }
    }
}

/// The placement of an instance that takes only a map: the bits of [`Placed`].
#[inline(always)]
fn of_copy(rows: &[[f32; 4]; 3]) -> Placement {
    let map = Affine::from_rows(*rows);
    let is_zero = map.columns[..3].as_flattened().iter().all(|&x| x == 0.0);
    Placement { map: if is_zero { ObjectMap::hidden(&map) } else { ObjectMap::new(&map) }, blas: 0, mask: u32::MAX }
}

/// What is known of an instance with a second transform.
#[derive(Clone, Debug)]
pub(crate) struct Moving {
    /// The transform as the shutter closes.
    pub(crate) close: Affine,
    /// None if both transforms are equal.
    pub(crate) motion: Option<Motion>,
}

/// An instance as it is kept.
#[derive(Clone, Debug)]
pub(crate) struct Placed {
    pub(crate) placement: Placement,
    pub(crate) moving: Option<Box<Moving>>,
    pub(crate) bounds: Bounds,
    /// A box around it, for top levels of oriented boxes.
    pub(crate) obb: Obb,
}

impl Placed {
    /// An instance that no ray can hit.
    pub(crate) fn hidden(instance: &Instance) -> Self {
        let map = ObjectMap::hidden(&instance.world_from_object);
        let placement = Placement { map, blas: instance.blas, mask: instance.mask };
        let moving = instance.world_from_object_close.map(|close| Box::new(Moving { close, motion: None }));
        Self { placement, moving, bounds: Bounds::EMPTY, obb: NO_BOX }
    }

    /// The instance with its bounds in world space: empty if nothing can be hit.
    pub(crate) fn of<B: Intersect>(
        index: usize,
        instance: &Instance,
        bottom: &Bottom<'_, B>,
    ) -> Result<Self, InstanceError> {
        let is_finite = instance.world_from_object.is_finite();
        if is_finite && instance.is_zero() && instance.world_from_object_close.is_none_or(|close| close.is_finite()) {
            return Ok(Self::hidden(instance));
        }
        let placed = Self::new(index, instance, bottom)?;
        Ok(if bottom.is_empty { Self { bounds: Bounds::EMPTY, obb: NO_BOX, ..placed } } else { placed })
    }

    /// Inverts the transform and bounds the error of hits.
    ///
    /// A world ray `o + t·d` is traced as the object ray `o' = fl(M⁻¹(o - c))`, `d' = fl(M⁻¹d)`, but for a power of two in `d` and
    /// `t`: computed in `f64`, each component rounded once, by at most `u` relative. A hit accepted at `t` lies within `e·(|o'| + ρ)` of the bounds in
    /// object space (all norms ∞; `e` the hit error, at most 1/8 but for a TLAS below, ρ the reach of the bottom-level BVH). The world point differs
    /// from the image of the object point by `M` times at most `u·|o'| + u·t|d'|`, where
    /// `t|d'| <= (1 + e)·(|o'| + ρ)`: together at most `2.2u·(|o'| + ρ)`. With `1.8u` more for `f64` rounding
    /// and second-order terms, the hit lies within `‖M‖·(e + 4u)·(|o'| + ρ)` of the image of the
    /// bounds, and `|o'| <= ‖M⁻¹‖·(|o - r| + |r - c|)` for every point `r`.
    ///
    /// A TLAS below may have a greater `e`: then `u·t|d'|` and second-order terms grow with it, and `e·u` more covers them.
    ///
    /// Where the hit error is relative to the distance of ray and content (`is_local`, [`Intersect::has_local_error`](canted_trace::Intersect::has_local_error)), the part
    /// of `e` and of `t|d'|` is relative to the center `q` of the bounds, whose image is `m`: `|o' - q| <= ‖M⁻¹‖·(|o - r| + |r - m|)`, and ρ the
    /// greatest distance from `q`. Only the rounding of `o'` remains, `u·|o'| <= u·(|o' - q| + |q|)`. Otherwise `q` is the origin
    /// of object space, and `m = c`.
    ///
    /// What `f64` rounds is relative to `‖M‖·‖M⁻¹‖·(|o| + |c|)` and does not become less: 2^-26 of `per_origin` covers it.
    ///
    /// What underflows in object space is less than 2⁻¹²⁶, with that of the hit itself: `‖M‖·2⁻¹²⁵` covers it.
    ///
    /// For a moving instance this holds with the greatest `‖M‖`, `|c|` and `‖M⁻¹‖` of the motion. The first two occur at
    /// an end, since norms are convex; [`Motion::norm_of_inverse`] bounds the third. The inverse `X` of a time is computed in
    /// `f64` from entries that are no `f32`, so that cofactors cancel, and `‖I - M·X‖` is at most the φ of
    /// [`Motion::residual`]. It moves a hit `P` by `φ·|P - c|`, and `|P - c| <= ‖M‖·ρ` but for the errors above: `2·φ·‖M‖·ρ` is
    /// added, and a rounding of the translation in `f64`, `4·2⁻⁵³·‖M‖·‖M⁻¹‖·|c|`, is within the `1.8u`. For a static
    /// instance products of entries are exact, and `‖I - M·X‖` is at most `20·2⁻⁵³·‖M‖·‖M⁻¹‖ < 2⁻²⁸`, within the `1.8u`.
    fn new<B: Intersect>(index: usize, instance: &Instance, bottom: &Bottom<'_, B>) -> Result<Placed, InstanceError> {
        let (bounds, (hit_error, is_local)) = (&bottom.bounds, bottom.error);
        let open = &instance.world_from_object;
        // Equal transforms at both ends make a static instance.
        let close = instance.world_from_object_close.as_ref().filter(|close| *close != open);
        let matrices = || std::iter::once(open).chain(close);
        if !matrices().all(Affine::is_finite) {
            return Err(InstanceError::NotFinite { instance: index });
        }
        let inverse = invert(&open.columns.map(|column| column.map(f64::from)));
        let motion = close.map(|close| Motion::new(open, close));
        let greatest = |of: &dyn Fn(&Affine) -> f64| matrices().map(of).fold(0.0, f64::max);
        let forward = greatest(&Affine::row_sum_norm);
        let backward = match &motion {
            None => {
                let backward = row_sum_norm(&inverse);
                let condition = condition(forward, backward);
                if condition > MAX_CONDITION {
                    return Err(InstanceError::IllConditioned { instance: index, condition });
                }
                backward
            }
            Some(motion) => motion.norm_of_inverse(MAX_CONDITION / forward).map_err(|(time, backward)| {
                InstanceError::IllConditionedAt { instance: index, time, condition: condition(forward, backward) }
            })?,
        };
        let aabb = bounds.aabb();
        let reach = f64::from(aabb.reach());
        let center = if is_local && !aabb.is_empty() { aabb.center() } else { [0.0; 3] };
        let from_center = |x: [f32; 3]| vector::reach(vector::sub(vector::to_f64(x), center));
        let spread = if aabb.is_empty() { 0.0 } else { from_center(aabb.min).max(from_center(aabb.max)) };
        let centers = matrices().map(|matrix| matrix.point_f64(center)).fold(Aabb::EMPTY, |all, at| {
            all.union(Aabb { min: at.map(|x| down(x.next_down())), max: at.map(|x| up(x.next_up())) })
        });
        let middle = vector::to_f32(centers.center());
        let ends = [centers.min, centers.max].map(vector::to_f64);
        let from_middle =
            ends.map(|end| vector::reach(vector::sub(end, vector::to_f64(middle)))).into_iter().fold(0.0, f64::max);
        let translation = greatest(&|m| m.columns[3].iter().map(|c| f64::from(c.abs())).fold(0.0, f64::max));
        let hit_error = f64::from(hit_error);
        let relative = hit_error + 4.0 * U + if hit_error > 0.125 { 4.0 * U * hit_error } else { 0.0 };
        let residual = motion.as_ref().map_or(0.0, |_| Motion::residual(condition(forward, backward)));
        let error = WorldError {
            per_origin: up(relative * (forward * backward)),
            constant: up(relative * forward * spread
                + 2.0 * U * forward * vector::reach(center)
                + 2.0 * residual * forward * reach
                + (2.0 * U + relative * forward * backward * F64_ROUNDINGS) * translation
                + UNDERFLOW * forward),
            center: middle,
            radius: up(from_middle.next_up()),
        };
        let (obb, aabb) = swept_bounds(bottom, open, close);
        if !aabb.is_finite() {
            return Err(InstanceError::OutOfRange { instance: index });
        }
        let placement = Placement { map: ObjectMap::new(open), blas: instance.blas, mask: instance.mask };
        let moving = instance.world_from_object_close.map(|close| Box::new(Moving { close, motion }));
        Ok(Self { placement, moving, bounds: Bounds { aabb, error }, obb })
    }
}

/// What underflow in object space moves a hit by at most, 2⁻¹²⁵.
const UNDERFLOW: f64 = 2.0 * f32::MIN_POSITIVE as f64;

/// Boxes around the image of a BVH at all times between `open` and `close`; the second is around the intersection of the image and the first.
///
/// Each point moves along a straight line between its positions at the ends. A convex set that contains both contains this line, and so the
/// image at any time: the axis-aligned box of both ends is one.
fn swept_bounds<B: Intersect>(bottom: &Bottom<'_, B>, open: &Affine, close: Option<&Affine>) -> (Obb, Aabb) {
    let at_open = bottom.bounds.transformed(open);
    let (aabb, tight) = (at_open.aabb(), bottom.tightened(at_open.aabb(), open));
    let Some(close) = close else { return (at_open, tight) };
    let at_close = bottom.bounds.transformed(close).aabb();
    (Obb::from_aabb(&aabb.union(at_close)), tight.union(bottom.tightened(at_close, close)))
}
