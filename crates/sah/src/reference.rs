//! Boxes in SIMD registers: one box with its center, and two boxes at once.

use canted_obb::Aabb;
use glam::{Vec4, Vec4Swizzles};

use crate::par;

/// A box as `(min, -max)`, so that a union is two minima. The fourth lanes are not part of the box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Bounds {
    low: Vec4,
    high: Vec4,
}

impl Bounds {
    /// The identity of [`Self::union`].
    pub(crate) const EMPTY: Self = Self { low: Vec4::MAX, high: Vec4::MAX };

    #[inline]
    pub(crate) fn union(&self, other: &Self) -> Self {
        Self { low: self.low.min(other.low), high: self.high.min(other.high) }
    }

    /// Half of the surface area.
    #[inline]
    pub(crate) fn half_area(&self) -> f32 {
        // Negated extents: their pairwise products are those of the extents.
        let negated = self.low + self.high;
        let faces = negated * negated.yzxw();
        faces.x + faces.y + faces.z
    }

    /// Least coordinates.
    #[inline]
    pub(crate) fn low(&self) -> Vec4 {
        self.low
    }

    /// Side lengths.
    #[inline]
    pub(crate) fn extent(&self) -> Vec4 {
        -(self.low + self.high)
    }

    /// The axis of the longest side, the first of equals.
    pub(crate) fn longest(&self) -> usize {
        let extent = self.extent().to_array();
        (1..3).fold(0, |best, k| if extent[k] > extent[best] { k } else { best })
    }
}

/// The bits of the least normal float; indices below `2^30` are added to them.
const NORMAL: u32 = 0x0080_0000;

/// The bits of the float 1; numbers of primitives, far below `2^23`, are added to them.
const ONE: u32 = 0x3f80_0000;

/// A run of consecutive primitives, usually one, with its box, moved while nodes are split: half a cache line.
#[derive(Clone, Copy, Debug)]
#[repr(transparent)]
pub(crate) struct Reference(Bounds);

impl Reference {
    /// `primitive` with its box in units of `1 / scale`.
    ///
    /// The fourth lanes store the index and the number of primitives in the bits of floats, which are normal and less than 4:
    /// no sum or product of lanes is NaN, and none takes the slow path of subnormal numbers.
    pub(crate) fn new(primitive: u32, aabb: &Aabb, scale: f32) -> Self {
        let ([x, y, z], [u, v, w]) = (aabb.min.map(|c| scale * c), aabb.max.map(|c| -scale * c));
        let (primitive, one) = (f32::from_bits(NORMAL + primitive), f32::from_bits(ONE + 1));
        Self(Bounds { low: Vec4::new(x, y, z, primitive), high: Vec4::new(u, v, w, one) })
    }

    /// The primitives of this run and of the next, which follow them.
    pub(crate) fn joined(&self, next: &Self) -> Self {
        let mut joined = self.0.union(&next.0);
        joined.low.w = self.0.low.w;
        joined.high.w = f32::from_bits(ONE + self.n() + next.n());
        Self(joined)
    }

    /// The first primitive.
    #[inline]
    pub(crate) fn primitive(&self) -> u32 {
        self.0.low.w.to_bits() - NORMAL
    }

    /// Number of primitives.
    #[inline]
    pub(crate) fn n(&self) -> u32 {
        self.0.high.w.to_bits() - ONE
    }

    /// The scaled box.
    pub(crate) fn aabb(&self) -> Aabb {
        Aabb { min: self.0.low.xyz().to_array(), max: (-self.0.high).xyz().to_array() }
    }

    #[inline]
    pub(crate) fn bounds(&self) -> &Bounds {
        &self.0
    }

    /// Twice the center of the box.
    #[inline]
    pub(crate) fn center(&self) -> Vec4 {
        self.0.low - self.0.high
    }

    /// A coordinate of the center as an integer of the same order; both zeros are equal.
    #[inline]
    pub(crate) fn key(&self, axis: usize) -> u32 {
        let bits = (self.center().to_array()[axis] + 0.0).to_bits();
        if bits >> 31 == 1 { !bits } else { bits | 1 << 31 }
    }
}

/// Bounds of the doubled centers of all references.
pub(crate) fn centers(references: &[Reference]) -> Bounds {
    if references.len() < LARGE {
        return centers_serial(references);
    }
    // Minima: the order does not matter.
    let parts = par::map_chunks(references, CHUNK, |_, chunk| centers_serial(chunk));
    parts.iter().fold(Bounds::EMPTY, |all, part| all.union(part))
}

fn centers_serial(references: &[Reference]) -> Bounds {
    let mut all = Bounds::EMPTY;
    for reference in references {
        let center = reference.center();
        all = all.union(&Bounds { low: center, high: -center });
    }
    all
}

/// Minimum number of items for parallel bounds, and the size of chunks.
const LARGE: usize = 1 << 15;
const CHUNK: usize = 1 << 13;

/// The scale of the box around all boxes: [`Aabb::unit_scale`].
pub(crate) fn unit_scale(leaf_boxes: &[Aabb]) -> Option<f32> {
    let around = |boxes: &[Aabb]| boxes.iter().fold(Aabb::EMPTY, |all, aabb| all.union(*aabb));
    let parts = par::map_chunks(leaf_boxes, CHUNK, |_, chunk| around(chunk));
    around(&parts).unit_scale()
}

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
