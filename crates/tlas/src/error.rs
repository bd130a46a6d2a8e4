use std::fmt;

use canted_wide::PrimitiveError;

use crate::matrix::MAX_CONDITION;

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
