use canted_obb::Affine;

use crate::InstanceError;
use crate::matrix::{MAX_CONDITION, condition, invert, row_sum_norm};

/// A placed bottom-level BVH, static or moving.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Instance {
    /// Index of the bottom-level BVH.
    pub blas: u32,
    /// The transform, at the opening of the shutter if the instance moves: any invertible affine map.
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
