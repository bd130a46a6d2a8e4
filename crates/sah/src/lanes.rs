use canted_obb::Aabb;
use glam::{Vec4, Vec4Swizzles};

/// Two boxes side by side: `(min of the first, min of the second, -max of the first, -max of the second)` an axis.
///
/// With the signs of `max` turned a union is one minimum an axis, for both boxes at once. A box alone stands in both
/// places.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Lanes(pub(crate) [Vec4; 3]);

impl Lanes {
    /// Zeros, to be filled.
    pub(crate) const UNSET: Self = Self([Vec4::ZERO; 3]);

    /// The box in units of `1 / scale`, in both places.
    pub(crate) fn of(aabb: &Aabb, scale: f32) -> Self {
        Self(std::array::from_fn(|k| {
            let (min, max) = (scale * aabb.min[k], -scale * aabb.max[k]);
            Vec4::new(min, min, max, max)
        }))
    }

    /// The box on one side, in both places.
    #[inline]
    pub(crate) fn side(&self, side: u32) -> Self {
        Self(if side == 0 { self.0.map(Vec4::xxzz) } else { self.0.map(Vec4::yyww) })
    }

    /// The first box of `first` beside the second box of `second`.
    #[inline]
    pub(crate) fn beside(first: &Self, second: &Self) -> Self {
        let join = |a: Vec4, b: Vec4| Vec4::new(a.x, b.y, a.z, b.w);
        Self(std::array::from_fn(|k| join(first.0[k], second.0[k])))
    }

    /// With `other`'s box on one side.
    #[inline]
    pub(crate) fn with(&self, side: u32, other: &Self) -> Self {
        if side == 0 { Self::beside(other, self) } else { Self::beside(self, other) }
    }

    /// Unions, each side with the same side of `other`.
    #[inline]
    pub(crate) fn union(&self, other: &Self) -> Self {
        Self(std::array::from_fn(|k| self.0[k].min(other.0[k])))
    }

    /// The box around both, in both places.
    #[inline]
    pub(crate) fn around(&self) -> Self {
        Self(self.0.map(|axis| axis.min(axis.yxwz())))
    }

    /// Half of each side's surface area.
    ///
    /// No part rounds but upward with its operands, so a box inside another never has more.
    #[inline]
    pub(crate) fn half_areas(&self) -> [f32; 2] {
        let [x, y, z] = self.0.map(|axis| axis + axis.zwxy());
        let area = (x + z) * y + z * x;
        [area.x, area.y]
    }

    /// Half of the surface area of a box that stands in both places.
    #[inline]
    pub(crate) fn half_area(&self) -> f32 {
        self.half_areas()[0]
    }

    /// The same in `f64`.
    #[inline]
    pub(crate) fn exact_half_area(&self) -> f64 {
        let [x, y, z] = self.0.map(|axis| f64::from(axis.x) + f64::from(axis.z));
        (x + z) * y + z * x
    }
}
