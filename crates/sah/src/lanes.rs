use canted_obb::Aabb;
use glam::{Vec4, Vec4Swizzles};

/// Two boxes in SIMD lanes: `(min of the first, min of the second, -max of the first, -max of the second)` per axis.
///
/// With negated maxima a union of both pairs is one minimum per axis. A single box is stored twice.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Lanes(pub(crate) [Vec4; 3]);

impl Lanes {
    /// Initial value.
    pub(crate) const UNSET: Self = Self([Vec4::ZERO; 3]);

    /// The box in units of `1 / scale`, stored twice.
    pub(crate) fn of(aabb: &Aabb, scale: f32) -> Self {
        Self(std::array::from_fn(|k| {
            let (min, max) = (scale * aabb.min[k], -scale * aabb.max[k]);
            Vec4::new(min, min, max, max)
        }))
    }

    /// The box of one side, stored twice.
    #[inline]
    pub(crate) fn side(&self, side: u32) -> Self {
        Self(if side == 0 { self.0.map(Vec4::xxzz) } else { self.0.map(Vec4::yyww) })
    }

    /// The first box of `first` and the second box of `second`.
    #[inline]
    pub(crate) fn pair(first: &Self, second: &Self) -> Self {
        let join = |a: Vec4, b: Vec4| Vec4::new(a.x, b.y, a.z, b.w);
        Self(std::array::from_fn(|k| join(first.0[k], second.0[k])))
    }

    /// With one side replaced by `other`.
    #[inline]
    pub(crate) fn with(&self, side: u32, other: &Self) -> Self {
        if side == 0 { Self::pair(other, self) } else { Self::pair(self, other) }
    }

    /// The union of each side with the same side of `other`.
    #[inline]
    pub(crate) fn union(&self, other: &Self) -> Self {
        Self(std::array::from_fn(|k| self.0[k].min(other.0[k])))
    }

    /// The union of both boxes, stored twice.
    #[inline]
    pub(crate) fn around(&self) -> Self {
        Self(self.0.map(|axis| axis.min(axis.yxwz())))
    }

    /// Half of the surface area of each box.
    ///
    /// Every operation is monotonic, so a box inside another never has more area.
    #[inline]
    pub(crate) fn half_areas(&self) -> [f32; 2] {
        let [x, y, z] = self.0.map(|axis| axis + axis.zwxy());
        let area = (x + z) * y + z * x;
        [area.x, area.y]
    }

    /// Half of the surface area of a box that is stored twice.
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
