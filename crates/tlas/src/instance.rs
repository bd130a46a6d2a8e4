use std::fmt;

use canted_obb::Affine;
use canted_obb::vector::{cross, dot, scale};
use canted_wide::PrimitiveError;

/// A placed bottom-level BVH, static or moving.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Instance {
    /// Index of the bottom-level BVH.
    pub blas: u32,
    /// The transform, at the opening of the shutter if the instance moves: any invertible affine map, or a scale by zero, which hides the
    /// instance.
    pub world_from_object: Affine,
    /// The transform of a moving instance at the closing of the shutter; `None` if the instance is static.
    ///
    /// In between, every entry of the matrix is interpolated linearly, so every point of the instance moves along a
    /// straight line: during a large rotation the instance shrinks. Each interpolated map must be invertible.
    pub world_from_object_close: Option<Affine>,
    /// Which rays test the instance: those whose mask shares a bit with this one. All bits by default.
    pub mask: u32,
}

impl Instance {
    /// What [`Tlas::remove`](crate::Tlas::remove) leaves in the place of an instance: no ray tests it, it has no bounds, and the next instance
    /// that is inserted takes its number. [`Tlas::new`](crate::Tlas::new) accepts it, so that the other instances keep their numbers.
    pub const REMOVED: Self =
        Self { blas: u32::MAX, world_from_object: Affine::IDENTITY, world_from_object_close: None, mask: 0 };

    /// Whether this is [`Instance::REMOVED`].
    #[must_use]
    pub fn is_removed(&self) -> bool {
        *self == Self::REMOVED
    }

    /// Whether the transform maps everything to a point at all times, which hides the instance.
    pub(crate) fn is_zero(&self) -> bool {
        let is_zero = |map: &Affine| map.columns[..3].as_flattened().iter().all(|&x| x == 0.0);
        is_zero(&self.world_from_object) && self.world_from_object_close.as_ref().is_none_or(is_zero)
    }

    /// A static instance that every ray tests.
    #[must_use]
    pub fn new(blas: u32, world_from_object: Affine) -> Self {
        Self { blas, world_from_object, world_from_object_close: None, mask: u32::MAX }
    }

    /// An instance that moves while the shutter is open; every ray tests it.
    #[must_use]
    pub fn moving(blas: u32, open: Affine, close: Affine) -> Self {
        Self { world_from_object_close: Some(close), ..Self::new(blas, open) }
    }

    /// The same instance with another mask.
    #[must_use]
    pub fn with_mask(self, mask: u32) -> Self {
        Self { mask, ..self }
    }

    /// Rows of the inverse of [`Self::world_from_object`], each with its translation last, computed in `f64`.
    ///
    /// # Errors
    /// A transform that is not finite or too close to singular, reported with `index` as the instance. Other
    /// requirements of [`Tlas::new`](crate::Tlas::new) are not checked: the motion, and the range of the bounds.
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
    /// An instance refers to a bottom-level BVH that does not exist.
    NoSuchBlas {
        /// The instance.
        instance: usize,
        /// The index of the bottom-level BVH.
        blas: u32,
    },
    /// A transform has an entry that is not finite.
    NotFinite {
        /// The instance.
        instance: usize,
    },
    /// A transform is singular, or so close to it that object space would keep too few digits.
    IllConditioned {
        /// The instance.
        instance: usize,
        /// ‖M‖·‖M⁻¹‖ in the greatest-row-sum norm; infinite if singular.
        condition: f64,
    },
    /// The transform of a moving instance becomes singular, or nearly, while the shutter is open.
    IllConditionedAt {
        /// The instance.
        instance: usize,
        /// When: 0 as the shutter opens, 1 as it closes.
        time: f64,
        /// The greatest ‖M‖ of the motion times ‖M⁻¹‖ at that time, in the greatest-row-sum norm; infinite if singular.
        condition: f64,
    },
    /// The transformed bounds exceed the range of `f32`.
    OutOfRange {
        /// The instance.
        instance: usize,
    },
    /// More instances than a top-level BVH can index.
    TooMany {
        /// Number of instances.
        n_instances: usize,
    },
    /// There is no instance of this index.
    NoSuchInstance {
        /// The instance.
        instance: usize,
        /// Number of instances.
        n_instances: usize,
    },
    /// There is no bottom-level BVH of this index.
    UnknownBlas {
        /// The index.
        blas: u32,
        /// Number of bottom-level BVHs.
        n_blas: usize,
    },
}

impl fmt::Display for InstanceError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoSuchBlas { instance, blas } => {
                write!(f, "instance {instance} refers to bottom-level BVH {blas}, which does not exist")
            }
            Self::NotFinite { instance } => write!(f, "the transform of instance {instance} is not finite"),
            Self::IllConditioned { instance, condition } => {
                write!(
                    f,
                    "the transform of instance {instance} is too close to singular: its condition number is \
                     {condition:e}, at most {MAX_CONDITION:e} is supported"
                )
            }
            Self::IllConditionedAt { instance, time, condition } => {
                write!(
                    f,
                    "the transform of moving instance {instance} is too close to singular at shutter time {time}: its \
                     condition number is {condition:e}, at most {MAX_CONDITION:e} is supported"
                )
            }
            Self::OutOfRange { instance } => {
                write!(f, "the transformed bounds of instance {instance} exceed the range of f32")
            }
            Self::TooMany { n_instances } => {
                write!(f, "a top-level BVH cannot index {n_instances} instances")
            }
            Self::UnknownBlas { blas, n_blas } => {
                write!(f, "there is no bottom-level BVH {blas}: the TLAS has {n_blas}")
            }
            Self::NoSuchInstance { instance, n_instances } => {
                write!(f, "there is no instance {instance}: the TLAS has {n_instances} instances")
            }
        }
    }
}

impl std::error::Error for InstanceError {}

impl From<PrimitiveError> for InstanceError {
    fn from(error: PrimitiveError) -> Self {
        match error {
            PrimitiveError::Bounds { primitive } => Self::OutOfRange { instance: primitive.index() },
            PrimitiveError::TooMany { n_primitives } => Self::TooMany { n_instances: n_primitives },
        }
    }
}

/// Greatest supported condition number of a transform: 2^20 leaves four of the 24 bits of an `f32` coordinate.
pub const MAX_CONDITION: f64 = 1_048_576.0;

/// Columns of an affine map.
pub(crate) type Columns = [[f64; 3]; 4];

/// Rows of an affine map, each with its translation last.
pub(crate) type Rows = [[f64; 4]; 3];

/// ‖M‖·‖M⁻¹‖; infinite if the inverse is not finite.
pub(crate) fn condition(forward: f64, backward: f64) -> f64 {
    if backward.is_finite() { forward * backward } else { f64::INFINITY }
}

/// Greatest row sum of absolute values of the linear part of an affine map, given by its rows with the translation last.
/// Infinite if an entry is not finite.
#[must_use]
pub fn row_sum_norm(rows: &[[f64; 4]; 3]) -> f64 {
    // The computed inverse of a matrix of rank one is all NaN, and `f64::max` ignores NaN.
    if !rows.iter().flatten().all(|x| x.is_finite()) {
        return f64::INFINITY;
    }
    rows.iter().map(|row| row[..3].iter().map(|x| x.abs()).sum()).fold(0.0, f64::max)
}

/// Rows of the inverse map, by cofactors in `f64`; not finite if the matrix is singular.
#[inline]
pub(crate) fn invert(columns: &Columns) -> Rows {
    let [a, b, c, origin] = *columns;
    let reciprocal = 1.0 / dot(a, cross(b, c));
    [cross(b, c), cross(c, a), cross(a, b)].map(|row| {
        let [x, y, z] = scale(row, reciprocal);
        [x, y, z, -dot([x, y, z], origin)]
    })
}
