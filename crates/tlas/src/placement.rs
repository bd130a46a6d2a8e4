use canted_obb::round::{down, up};
use canted_obb::{Aabb, Affine, Obb, vector};
use canted_trace::{Intersect, ReferencePoint};

use crate::instance::{MAX_CONDITION, Rows, condition, invert, row_sum_norm};
use crate::ray::{ObjectRay, WorldRay};
use crate::{Instance, InstanceError, Motion};

/// Half of `f32::EPSILON`: the relative error of one rounding to `f32`.
const U: f64 = 1.0 / 16_777_216.0;

/// Fewest instances that one job places.
pub(crate) const JOB: usize = 256;

/// A bound on the error of a hit in world space, in each coordinate: `per_origin · |o - r|∞ + fixed(r)`, `o` the ray's origin, for every
/// point `r`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct WorldError {
    pub(crate) per_origin: f64,
    /// What does not depend on `r`.
    constant: f64,
    /// Contains the image of the center of the bounds at all times.
    centers: Aabb,
}

impl WorldError {
    /// See the type.
    pub(crate) fn fixed(&self, r: ReferencePoint) -> f64 {
        let reach = vector::reach(vector::to_f64(r.point()));
        let from_center = f64::from(r.moved_box(&self.centers).reach().next_up());
        self.constant + self.per_origin * (from_center + F64_ROUNDINGS * reach)
    }
}

/// Roundings of `f64` in what a condition multiplies, relative to `per_origin`: fewer than 32 of 2^-53, and `per_origin` is at least
/// 2^-22 of the condition.
const F64_ROUNDINGS: f64 = 1.0 / (1_u64 << 26) as f64;

/// Bounds of an instance in world space, at all times, and how far hits may lie outside.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Bounds {
    pub(crate) obb: Obb,
    /// Around `obb`.
    pub(crate) aabb: Aabb,
    pub(crate) error: WorldError,
}

impl Bounds {
    /// Of an instance that no ray can hit.
    pub(crate) const EMPTY: Self = Self {
        obb: Obb { center: [0.0; 3], frame: Obb::IDENTITY_FRAME, half_extents: [0.0; 3] },
        aabb: Aabb::EMPTY,
        error: WorldError { per_origin: 0.0, constant: 0.0, centers: Aabb::EMPTY },
    };

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
        let at = reference.point();
        Aabb { min: [0, 1, 2].map(|k| -grow(-min[k], -at[k])), max: [0, 1, 2].map(|k| grow(max[k], at[k])) }
    }
}

/// What placing an instance needs of its bottom-level BVH.
pub(crate) struct Bottom {
    bounds: Obb,
    /// The error of hits, and whether it is local.
    error: (f32, bool),
    is_empty: bool,
}

impl Bottom {
    pub(crate) fn of<B: Intersect>(blas: &B) -> Self {
        let error = (blas.hit_error(), blas.has_local_error());
        Self { bounds: blas.bounds(), error, is_empty: blas.is_empty() }
    }
}

/// What traversal needs of an instance: two cache lines.
#[derive(Clone, Debug)]
#[repr(align(64))]
pub(crate) struct Placement {
    /// `f64`, so only the result is rounded.
    object_from_world: Inverse,
    /// The motion of a moving instance, which replaces `object_from_world`.
    motion: Option<Box<Motion>>,
    pub(crate) blas: u32,
    /// The instance's mask; zero hides an instance whose bounds are not known.
    pub(crate) mask: u32,
}

const _: () = assert!(size_of::<Placement>() == 128);

/// What traversal needs of an instance, and its bounds in world space.
pub(crate) type Placed = (Placement, Bounds);

/// The inverse of a transform: three columns, then the translation, one after the other. Four numbers are read from the start of
/// each, of which the last is not used.
#[derive(Clone, Copy, Debug)]
struct Inverse([f64; 13]);

impl Inverse {
    #[inline(always)]
    fn new(rows: &Rows) -> Self {
        let mut columns = [0.0; 13];
        for k in 0..4 {
            for (i, row) in rows.iter().enumerate() {
                columns[3 * k + i] = row[k];
            }
        }
        Self(columns)
    }

    /// The linear map of `v`. Lanes are independent, so that the compiler may use vectors of any width for the same bits.
    #[inline(always)]
    fn linear(&self, v: [f64; 3]) -> [f64; 4] {
        let [x, y, z] = [self.column(0), self.column(1), self.column(2)];
        let lane = |i: usize| (x[i] * v[0] + y[i] * v[1]) + z[i] * v[2];
        [lane(0), lane(1), lane(2), lane(3)]
    }

    #[inline(always)]
    fn point(&self, v: [f64; 3]) -> [f64; 4] {
        let ([a, b, c, d], [x, y, z, w]) = (self.linear(v), self.column(3));
        [a + x, b + y, c + z, d + w]
    }

    #[inline(always)]
    fn column(&self, k: usize) -> [f64; 4] {
        [self.0[3 * k], self.0[3 * k + 1], self.0[3 * k + 2], self.0[3 * k + 3]]
    }
}

impl Placement {
    /// The placement of an instance, and its bounds in world space: empty if nothing can be hit.
    pub(crate) fn of(index: usize, instance: &Instance, blas: &Bottom) -> Result<Placed, InstanceError> {
        let is_finite = instance.world_from_object.is_finite();
        if is_finite && instance.is_zero() && instance.world_from_object_close.is_none_or(|close| close.is_finite()) {
            return Ok((Self::hidden(instance.blas), Bounds::EMPTY));
        }
        let (placement, bounds) = Self::new(index, instance, &blas.bounds, blas.error)?;
        Ok((placement, if blas.is_empty { Bounds::EMPTY } else { bounds }))
    }

    /// Of an instance that no ray can hit.
    pub(crate) fn hidden(blas: u32) -> Self {
        Self { object_from_world: Inverse([0.0; 13]), motion: None, blas, mask: 0 }
    }

    /// Inverts the transform and bounds the error of hits. Also returns the bounds of the instance in world space;
    /// `bounds` and `hit_error` are those of the bottom-level BVH, and whether that is local.
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
    fn new(
        index: usize,
        instance: &Instance,
        bounds: &Obb,
        (hit_error, is_local): (f32, bool),
    ) -> Result<Placed, InstanceError> {
        let open = &instance.world_from_object;
        // Equal transforms at both ends make a static instance.
        let close = instance.world_from_object_close.as_ref().filter(|close| *close != open);
        let matrices = || std::iter::once(open).chain(close);
        if !matrices().all(Affine::is_finite) {
            return Err(InstanceError::NotFinite { instance: index });
        }
        let inverse = invert(&open.columns.map(|column| column.map(f64::from)));
        let motion = close.map(|close| Box::new(Motion::new(open, close)));
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
        let translation = greatest(&|m| m.columns[3].iter().map(|c| f64::from(c.abs())).fold(0.0, f64::max));
        let hit_error = f64::from(hit_error);
        let relative = hit_error + 4.0 * U + if hit_error > 0.125 { 4.0 * U * hit_error } else { 0.0 };
        let residual = motion.as_ref().map_or(0.0, |_| Motion::residual(condition(forward, backward)));
        let error = WorldError {
            per_origin: relative * (forward * backward),
            constant: relative * forward * spread
                + 2.0 * U * forward * vector::reach(center)
                + 2.0 * residual * forward * reach
                + (2.0 * U + relative * forward * backward * F64_ROUNDINGS) * translation
                + UNDERFLOW * forward,
            centers,
        };
        let bounds_world = swept_bounds(bounds, open, close);
        let aabb = bounds_world.aabb();
        if !aabb.is_finite() {
            return Err(InstanceError::OutOfRange { instance: index });
        }
        let placement =
            Self { object_from_world: Inverse::new(&inverse), motion, blas: instance.blas, mask: instance.mask };
        Ok((placement, Bounds { obb: bounds_world, aabb, error }))
    }

    /// The world ray in object space, at its time, up to the scaled `t_max`. `None` where its interval is empty.
    #[inline(always)]
    pub(crate) fn ray_object(&self, ray: &WorldRay, t_max: f64) -> Option<ObjectRay> {
        let moved;
        let inverse = match &self.motion {
            None => &self.object_from_world,
            Some(motion) => {
                moved = Inverse::new(&motion.object_from_world(ray.top.time));
                &moved
            }
        };
        let [origin, direction] = [ray.top.origin, ray.top.direction].map(|v| v.map(f64::from));
        let ([ox, oy, oz, _], [dx, dy, dz, _]) = (inverse.point(origin), inverse.linear(direction));
        ray.in_object([ox, oy, oz], [dx, dy, dz], t_max)
    }
}

/// What underflow in object space moves a hit by at most, 2⁻¹²⁵.
const UNDERFLOW: f64 = 2.0 * f32::MIN_POSITIVE as f64;

/// A box around the image of `bounds` at all times between `open` and `close`.
///
/// Each corner moves along a straight line between its positions at the ends. A convex set that contains the boxes of
/// both ends contains these lines, and so the hull of the corners at any time: the axis-aligned box of both is one.
fn swept_bounds(bounds: &Obb, open: &Affine, close: Option<&Affine>) -> Obb {
    let at_open = bounds.transformed(open);
    close.map_or(at_open, |close| Obb::from_aabb(&at_open.aabb().union(bounds.transformed(close).aabb())))
}
