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
