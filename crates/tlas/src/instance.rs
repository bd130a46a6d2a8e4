use canted_obb::{Affine, Obb};
use canted_trace::{HIT_ERROR, Query, Ray, ScaledRay};

use crate::motion::{Motion, invert, row_sum_norm};

/// A placed bottom level, still or moving.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Instance {
    /// Index of the bottom level.
    pub blas: u32,
    /// Where it stands, or where a moving one starts as the shutter opens; any invertible affine map.
    pub world_from_object: Affine,
    /// Where a moving one is as the shutter closes; `None` for one that stands still.
    ///
    /// Between the two every number of the map changes in a straight line, and so does every point of the instance: a
    /// rotation by a large angle shrinks on its way. Each map on the way must be invertible.
    pub world_from_object_close: Option<Affine>,
}

impl Instance {
    /// A bottom level that stands still.
    #[must_use]
    pub fn still(blas: u32, world_from_object: Affine) -> Self {
        Self { blas, world_from_object, world_from_object_close: None }
    }

    /// Rows of the inverse of where the instance stands, or starts, each with its translation last, computed in `f64`.
    ///
    /// # Errors
    /// A transform as the shutter opens that is not finite or too near singular, told of the instance with this number. What
    /// [`Tlas::new`](crate::Tlas::new) refuses besides is not looked at: the way from there on, and boxes that leave the numbers.
    pub fn object_from_world(&self, index: usize) -> Result<[[f64; 4]; 3], InstanceError> {
        if !self.world_from_object.is_finite() {
            return Err(InstanceError::NotFinite { instance: index });
        }
        let inverse = invert(&self.world_from_object.columns.map(|column| column.map(f64::from)));
        let condition = condition(self.world_from_object.row_sum_norm(), row_sum_norm(&inverse));
        if condition > MAX_CONDITION {
            return Err(InstanceError::IllConditioned { instance: index, condition });
        }
        Ok(inverse)
    }
}

/// Why instances cannot be placed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum InstanceError {
    /// An instance names a bottom level that does not exist.
    NoSuchBlas {
        /// The instance.
        instance: usize,
        /// The bottom level it names.
        blas: u32,
    },
    /// A transform has a number that is not finite.
    NotFinite {
        /// The instance.
        instance: usize,
    },
    /// A transform is singular, or so nearly that object space would keep too few digits.
    IllConditioned {
        /// The instance.
        instance: usize,
        /// ‖M‖·‖M⁻¹‖ in the greatest-row-sum norm; infinite where singular.
        condition: f64,
    },
    /// A transform becomes singular, or nearly, between the opening and the closing of the shutter.
    IllConditionedAt {
        /// The instance.
        instance: usize,
        /// When: 0 as the shutter opens, 1 as it closes.
        time: f64,
        /// The greatest ‖M‖ of the way times ‖M⁻¹‖ at that time, in the greatest-row-sum norm; infinite where singular.
        condition: f64,
    },
    /// A transform carries the bottom level's box out of the numbers.
    OutOfRange {
        /// The instance.
        instance: usize,
    },
    /// More instances than a tree can name.
    TooMany {
        /// Number of instances.
        n_instances: usize,
    },
}

impl std::fmt::Display for InstanceError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::NoSuchBlas { instance, blas } => {
                write!(f, "instance {instance} names bottom level {blas}, which does not exist")
            }
            Self::NotFinite { instance } => write!(f, "the transform of instance {instance} is not finite"),
            Self::IllConditioned { instance, condition } => {
                write!(f, "the transform of instance {instance} has condition {condition:e}, beyond {MAX_CONDITION:e}")
            }
            Self::IllConditionedAt { instance, time, condition } => {
                write!(
                    f,
                    "the transform of moving instance {instance} has condition {condition:e} at time {time} of the shutter, \
                     beyond {MAX_CONDITION:e}"
                )
            }
            Self::OutOfRange { instance } => {
                write!(f, "the transform of instance {instance} carries its box beyond what f32 can hold")
            }
            Self::TooMany { n_instances } => write!(f, "{n_instances} instances are more than a tree can hold"),
        }
    }
}

impl std::error::Error for InstanceError {}

/// Greatest condition of a transform: 2^20 leaves four of the 24 bits of an `f32` coordinate.
pub const MAX_CONDITION: f64 = 1_048_576.0;

/// Half of `f32::EPSILON`: the relative error of one rounding.
const U: f64 = 1.0 / 16_777_216.0;

/// By how much a hit may be off in world space, in each coordinate: `per_origin · |o|∞ + fixed`, `o` the ray's origin.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct WorldError {
    per_origin: f64,
    fixed: f64,
}

impl WorldError {
    /// An error that is at least both.
    pub(crate) fn max(self, other: Self) -> Self {
        Self { per_origin: self.per_origin.max(other.per_origin), fixed: self.fixed.max(other.fixed) }
    }

    /// The error of hits by this ray.
    #[inline]
    pub(crate) fn at(&self, ray_world: &ScaledRay) -> f64 {
        let [x, y, z] = ray_world.origin.map(f32::abs);
        self.per_origin * f64::from(x.max(y).max(z)) + self.fixed
    }
}

/// An instance ready for rays: its inverse, computed once.
#[derive(Clone, Debug)]
pub(crate) struct Placed {
    pub(crate) blas: u32,
    /// Rows of the inverse, each with its translation last; `f64`, so only the result is rounded.
    object_from_world: [[f64; 4]; 3],
    /// The way of an instance that moves, which the inverse of each ray's time takes the place of.
    motion: Option<Box<Motion>>,
}

impl Placed {
    /// Inverts the transform and bounds the error of the way through object space; with the image of the bottom level's
    /// `bounds`, at all times.
    ///
    /// A world ray `o + t·d` is traced as the object ray `o' = fl(M⁻¹(o - c))`, `d' = fl(M⁻¹d)`: computed in `f64`, each
    /// component rounded once, by at most `u` relative. A hit accepted at `t` lies within `HIT_ERROR·(|o'| + ρ)` of its
    /// triangle in object space (all norms ∞; ρ the reach of the bottom level). The world point differs from the image
    /// of the object point by `M` times at most `u·|o'| + u·t|d'|`, where `t|d'| <= ρ + |o'|` but for a second-order
    /// term. With one `u` more for `f64` rounding, the corner rounding of the box and second-order terms, the hit lies
    /// within `‖M‖·(HIT_ERROR + 4u)·(|o'| + ρ)` of the triangle's image, and `|o'| <= ‖M⁻¹‖·(|o| + |c|)`.
    ///
    /// Of a moving instance this holds with the greatest `‖M‖`, `|c|` and `‖M⁻¹‖` of the way. The first two are those of
    /// an end, since norms are convex; the last is bounded by [`Motion::norm_of_inverse`].
    pub(crate) fn new(
        index: usize,
        instance: &Instance,
        bounds: &Obb,
    ) -> Result<(Self, Obb, WorldError), InstanceError> {
        let open = &instance.world_from_object;
        // What ends where it begins stands still.
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
        let reach = f64::from(bounds.aabb().reach());
        let translation = greatest(&|m| m.columns[3].iter().map(|c| f64::from(c.abs())).fold(0.0, f64::max));
        let relative = f64::from(HIT_ERROR) + 4.0 * U;
        let error = WorldError {
            per_origin: relative * (forward * backward),
            fixed: relative * forward * (backward * translation + reach) + 2.0 * U * translation,
        };
        let bounds_world = swept(bounds, open, close);
        if !bounds_world.aabb().is_finite() {
            return Err(InstanceError::OutOfRange { instance: index });
        }
        Ok((Self { blas: instance.blas, object_from_world: inverse, motion }, bounds_world, error))
    }

    /// The world ray in object space; `t` stays the same number. `query` tells the ray's time where the instance moves.
    #[inline]
    #[expect(clippy::cast_possible_truncation, reason = "rounding to f32 is accounted for in the error")]
    pub(crate) fn ray_object<Q: Query>(&self, ray_world: &Ray, t_max: f32, query: &Q) -> Ray {
        let moved;
        let rows = match &self.motion {
            None => &self.object_from_world,
            Some(motion) => {
                moved = motion.object_from_world(query.time());
                &moved
            }
        };
        let o = ray_world.origin.map(f64::from);
        let d = ray_world.direction.map(f64::from);
        let linear = |row: &[f64; 4], v: [f64; 3]| (row[0] * v[0] + row[1] * v[1]) + row[2] * v[2];
        Ray {
            origin: std::array::from_fn(|k| (linear(&rows[k], o) + rows[k][3]) as f32),
            direction: std::array::from_fn(|k| linear(&rows[k], d) as f32),
            t_min: ray_world.t_min,
            t_max,
        }
    }
}

/// ‖M‖·‖M⁻¹‖; infinite where the inverse is not finite.
fn condition(forward: f64, backward: f64) -> f64 {
    if backward.is_finite() { forward * backward } else { f64::INFINITY }
}

/// A box around the image of `bounds` at all times between `open` and `close`.
///
/// Each corner moves in a straight line, so at any time it lies between its places at the ends. A convex set that
/// contains the boxes of both ends contains those lines and with them the hull of the corners at any time: the
/// axis-parallel box around both is one.
fn swept(bounds: &Obb, open: &Affine, close: Option<&Affine>) -> Obb {
    let at_open = bounds.transformed(open);
    close.map_or(at_open, |close| Obb::from_aabb(&at_open.aabb().union(bounds.transformed(close).aabb())))
}
