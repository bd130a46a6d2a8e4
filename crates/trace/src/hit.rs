use canted_obb::PrimId;

/// Index of an instance in scene order; 0 where a scene has one level.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
#[repr(transparent)]
pub struct InstanceId(pub u32);

/// The side of a triangle that a ray meets, by its winding: counter-clockwise is the front.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Side {
    /// The ray runs against the geometric normal `(v1 - v0) x (v2 - v0)`.
    Front,
    /// The ray runs along it.
    Back,
}

/// Where a ray meets a triangle: `(1 - u - v)·v0 + u·v1 + v·v2`, at `t` in units of the caller's direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Distance in units of the ray's direction.
    pub t: f32,
    /// Weight of the second vertex.
    pub u: f32,
    /// Weight of the third vertex.
    pub v: f32,
    /// The primitive, in the caller's order.
    pub primitive: PrimId,
    /// The instance, in scene order.
    pub instance: InstanceId,
    /// The side met, in object space winding.
    pub side: Side,
}

impl Hit {
    /// Whether this hit comes before `other`: least `t`, then lowest `(instance, primitive)`.
    #[inline]
    #[must_use]
    pub fn before(&self, other: &Self) -> bool {
        (self.t, self.instance, self.primitive) < (other.t, other.instance, other.primitive)
    }
}
