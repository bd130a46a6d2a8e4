use alloc::vec::Vec;

use canted_obb::PrimId;

/// Index of an instance in the scene; 0 without instances.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
#[repr(transparent)]
pub struct InstanceId(pub u32);

impl core::fmt::Display for InstanceId {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        self.0.fmt(f)
    }
}

impl InstanceId {
    /// The number as an index into the caller's array.
    #[inline]
    #[must_use]
    pub fn index(self) -> usize {
        self.0 as usize
    }
}

/// The side of a triangle that a ray hits; the vertices run counter-clockwise as seen from the front.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Side {
    /// The ray runs against the geometric normal `(v1 - v0) × (v2 - v0)`.
    Front,
    /// The ray runs along the geometric normal.
    Back,
}

/// A hit on a triangle at `(1 - u - v)·v0 + u·v1 + v·v2`.
///
/// [`crate::SurfacePoint`] gives the position, the geometric normal and rays that continue from it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Ray parameter, in units of the ray's direction. Infinite, subnormal or zero where the true one leaves the normal
    /// range of `f32`; hits are compared before that: see [`ScaledRay`](crate::ScaledRay).
    pub t: f32,
    /// Barycentric coordinate of the second vertex, for triangles from 0 to 1.
    pub u: f32,
    /// Barycentric coordinate of the third vertex; `u + v` exceeds 1 by at most 2^-21.
    pub v: f32,
    /// Index of the primitive in the caller's array.
    pub primitive: PrimId,
    /// Index of the instance.
    pub instance: InstanceId,
    /// The side hit, by the winding in object space.
    pub side: Side,
}

impl Hit {
    /// Whether this hit is closer than `other`; ties go to the lower `(instance, primitive)`.
    #[inline]
    #[must_use]
    pub fn before(&self, other: &Self) -> bool {
        let before = || (self.instance, self.primitive) < (other.instance, other.primitive);
        self.t < other.t || self.t == other.t && before()
    }
}

/// The hits of a slice of rays, one ray after another, in memory that is used again.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct HitLists {
    hits: Vec<Hit>,
    /// Where the hits of each ray end.
    ends: Vec<usize>,
}

impl HitLists {
    /// Lists of no rays.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// The hits of all rays: those of the first ray, then those of the second, and so on.
    #[must_use]
    pub fn hits(&self) -> &[Hit] {
        &self.hits
    }

    /// The hits of each ray, in order of the rays.
    pub fn of_rays(&self) -> impl Iterator<Item = &[Hit]> {
        let starts = core::iter::once(&0).chain(&self.ends);
        starts.zip(&self.ends).map(|(&start, &end)| &self.hits[start..end])
    }

    /// Removes all rays, for `n_rays` new ones.
    pub fn clear(&mut self, n_rays: usize) {
        self.hits.clear();
        self.ends.clear();
        self.ends.reserve(n_rays);
    }

    /// Adds a ray: `append` appends its hits to those of the rays before.
    #[inline(always)]
    pub fn add_ray(&mut self, append: impl FnOnce(&mut Vec<Hit>)) {
        append(self.next_ray());
        self.end_ray();
    }

    /// Where the hits of the next ray are appended, before [`HitLists::end_ray`].
    #[doc(hidden)]
    #[inline(always)]
    pub fn next_ray(&mut self) -> &mut Vec<Hit> {
        &mut self.hits
    }

    /// Ends the hits of a ray.
    #[doc(hidden)]
    #[inline(always)]
    pub fn end_ray(&mut self) {
        self.ends.push(self.hits.len());
    }
}
